"""Extreme lengths of runs: every method of fixed step up to 1e6 steps, the fastest up to 1e8.

Claim: no run is silently wrong.  Each is judged by the closed form of its scheme's motion at ten frames.

Command: python validation/long_cells.py [METHOD ...]       (default: every method that `extremes` takes)

`validation/extreme.py` counts these cells among its own.

Printed: 292 long runs: 264 right, 23 unstable, as theory says, 5 not measured; 2 minutes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from arguments import arguments, script
from cvode_steps import step_seconds
from springcheck import checks, driver, engines
from springcheck.checks.case import overflows
from springcheck.engines.contract import Label
from springcheck.studies.extremes import grid, judging, measure
from springcheck.studies.extremes.grid import Spec
from springcheck.studies.extremes.judging import Cell, Outcome
from springcheck.studies.stability.propagators import MASS, STEP

LENGTHS = (1, 10, 1000, 100_000, 1_000_000)
LONGEST = 100_000_000
"""Steps of the runs that are judged by their end; LONGEST for engines of `FAST_SECONDS` a step alone."""

FAST_SECONDS, SLOW_SECONDS = 1e-8, 1e-4


def lengths(label: Label, *, quick: bool = False) -> list[Spec]:
    """Cells that are judged by the end of a long run."""
    seconds = step_seconds(label)
    steps = list(LENGTHS)
    if seconds > SLOW_SECONDS:
        steps = [1, 10, 1000] if quick else [1, 10, 1000, 4000]
    elif label.platform or quick:
        steps = [1, 10, 1000, 10_000]
    if seconds <= FAST_SECONDS and not label.platform:
        steps.append(LONGEST // 100 if quick else LONGEST)
    turns: tuple[float, ...] = (1e-4, 0.01, 0.1, 1.0, 1.9)
    if label.platform and quick:
        # every run costs a context, a quarter of a second
        steps, turns = [1000], turns[2:]
    found = []
    for n in steps:
        for turn in turns if n < LONGEST // 100 else (0.1,):
            k = MASS * (turn / STEP) ** 2
            # forces of 2**10 keep fixed-point sums at their best
            q = 1024.0 / k
            found.append(
                Spec(block="length", m=MASS, k=k, q=q, p=0.6 * MASS * (turn / STEP) * q, h=STEP, steps=n)
            )
    return found


def last(label: Label, specs: Sequence[Spec]) -> list[Cell]:
    """Cells of one long run each, judged by the closed form of the scheme's motion at ten frames."""
    found = []
    for spec in specs:
        scene = grid.scene([spec], engines.method(label).requires)
        scene = replace(scene, every=max(1, spec.steps // 10))
        with np.errstate(all="ignore"):
            run = driver.run(scene, label)
            case, limit = _within_range(checks.Case(trajectory=run, scene=scene))
            verdict = checks.closed_form(case)
            if verdict.passed is None and len(case.trajectory.t) > 1:
                verdict = checks.step_defect(case)
            growth = judging.growth_of(case, scene)[0]
        unstable = bool(growth * spec.steps >= np.log(judging.UNSTABLE_GROWTH))
        outcome: Outcome = "unstable, as theory says" if unstable else "right"
        reason = limit
        if limit and not unstable:
            outcome = "engine's limit"
        value, bound = verdict.value, verdict.bound
        if run.outcome.status != "complete":
            # the driver ends a run at the last finite frame; the next one is out of range by theory
            high = judging.RANGES["double"][1]
            most = (0.5 if engines.engine(label.engine).squares_lengths else 1) * np.log(high) - np.log(
                max(abs(spec.q), abs(spec.p))
            )
            left = growth * (run.outcome.step + scene.every) > most
            quantum = case.trajectory.arithmetic.overflow
            gone = growth * run.outcome.step > np.log(quantum / spec.force) if np.isfinite(quantum) else False
            reason = f"{run.outcome.status} after step {run.outcome.step}, grown out of range"
            if not (unstable and (left or gone)):
                outcome, reason = "silently wrong", f"{run.outcome.status}: {run.outcome.message}"
        judged = outcome != "silently wrong" and len(case.trajectory.t) > 1
        if judged and verdict.passed is None:
            outcome, reason = "not measured", verdict.why
        elif judged and not value <= bound:
            outcome, reason = "silently wrong", f"{verdict.check} is {value:.3g} of {bound:.3g}"
        found.append(judging.cell(label, spec, outcome, reason, value, bound, tolerance=spec.tolerance))
    return found


def _within_range(case: checks.Case) -> tuple[checks.Case, str]:
    """The frames before a force leaves the range of a fixed-point sum, and what it then says."""
    run = case.trajectory
    beyond = (
        case.strongest >= run.arithmetic.overflow if np.isfinite(run.arithmetic.overflow) else np.zeros(0)
    )
    if not np.any(beyond):
        return case, ""
    held = slice(int(np.argmax(beyond)) + 1)
    reason = f"grown out of range after step {case.steps[held][-1]}: {overflows(run.arithmetic)}"
    return checks.Case(trajectory=run.at(held), scene=case.scene), reason


def cells(methods: Sequence[str] = ()) -> list[Cell]:
    """Cells of every method of fixed step that these labels or globs name."""
    labels = engines.match(tuple(methods) or measure.everything())
    here = [label for label in labels if not engines.method(label).adaptive and not measure.absence(label)]
    return [cell for label in here for cell in last(label, lengths(label))]


def main() -> int:
    """Print how many cells came out how; 1 where one is silently wrong."""
    found = cells(arguments(__doc__, methods=list[str]()).methods)
    wrong = [cell for cell in found if cell.outcome == "silently wrong"]
    print(f"{len(found)} long runs: {dict(Counter(cell.outcome for cell in found))}")
    for cell in wrong:
        print(f"silently wrong: {cell}")
    return int(bool(wrong) or not found)


if __name__ == "__main__":
    script(main)
