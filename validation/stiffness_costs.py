"""What stiffness costs: steps, force calls and error of every method as two scales move apart.

Three families: the chain of a soft and a stiff spring (the shipped `two-scales` with another ratio of
stiffnesses), a spring in ever more friction (`overdamped` with another damping ratio), and `van-der-pol`
with another mu.  Every run goes as far as the slow motion needs to show; the error is that of the slow
motion at the end.

Command: python validation/stiffness_costs.py [SCENE] [METHOD ...]     (default: two-scales, by all methods)

prints a line for each run and draws them into figures/stability-costs-SCENE.png and .svg.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from arguments import arguments, script
from cvode_steps import internal_steps, step_seconds
from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label, Stopped
from springcheck.errors import MethodError, SpringcheckError
from springcheck.figures import render
from springcheck.figures.charts import Bank, Chart, Curve, Scale
from springcheck.figures.looks import scheme_of
from springcheck.figures.style import save, style
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.text.lines import TextTable, as_text, table
from springcheck.text.wording import number

Family = Literal["two-scales", "overdamped", "van-der-pol"]

RATIOS: dict[Family, tuple[float, ...]] = {
    "two-scales": tuple(10.0**e for e in range(0, 13, 2)),
    "overdamped": tuple(10.0**e for e in range(7)),
    "van-der-pol": tuple(10.0**e for e in range(7)),
}
"""Stiffness ratios, damping ratios c / (2 sqrt(k m)), and mu = c / sqrt(k m)."""

RATIO_NAMES: dict[str, str] = {
    "two-scales": "stiffness ratio",
    "overdamped": "damping ratio",
    "van-der-pol": "mu",
}
"""What the ratios of a family are called."""

MOST_ERROR = 30.0
"""Errors above this say nothing."""

OUTPUTS = 2000
"""Steps of a method that no fast mode holds down."""

TOLERANCE = 1e-6
"""Relative tolerance per step of adaptive solvers."""

WORTH_SECONDS = 1.2
"""What a run may take before it is not worth its time."""

MOST_STEPS = 1_500_000
"""Steps that a run may take however fast they are."""


def most_steps(label: Label) -> int:
    """Steps of this method that are worth their time."""
    return min(MOST_STEPS, round(WORTH_SECONDS / step_seconds(label)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """One run of a family."""

    family: Family
    method: str
    ratio: float
    step: float
    """Step of the method, or the mean internal step of a solver [T]."""
    steps: int
    """Steps to the end; where a run was not worth it, those that it would take."""
    rejected: int = 0
    """Internal steps that a solver tried and did not keep; 0 for methods of fixed step."""
    force_calls: int = 0
    error: float = np.nan
    """Error of the slow motion at the end, in units of its amplitude; NaN where there is no end."""
    outcome: str


def scene(family: Family, ratio: float) -> Scene:
    """The shipped scene of a family with another ratio, over one turn of the slow motion at least."""
    found = scenes.load_scene(family)
    first, second = found.terms
    if family == "two-scales":
        stiff: Any = replace(second, k=first.k * ratio)  # type: ignore[attr-defined, type-var]
        end = 8.0
    elif family == "van-der-pol":
        c = ratio * np.sqrt(first.k * found.m)  # type: ignore[attr-defined]
        stiff = replace(second, c=c)  # type: ignore[type-var]
        # a period and a quarter, which ends on a slow arc
        end = float(2 * np.pi * np.sqrt(found.m[0] / first.k[0]) + 2 * c[0] / first.k[0])  # type: ignore[attr-defined]
    else:
        c = 2 * ratio * np.sqrt(first.k * found.m)  # type: ignore[attr-defined]
        stiff = replace(second, c=c)  # type: ignore[type-var]
        end = 5.0
    return replace(
        found, terms=(first, stiff), step=end / OUTPUTS, steps=OUTPUTS, every=OUTPUTS, tolerance=TOLERANCE
    )


def step_for(found: Scene, label: Label) -> float:
    """The step of a method: half its limit on the fastest mode, an OUTPUTS-th of the end at most."""
    scheme = schemes.scheme(engines.method(label).scheme)
    held = found.step
    if np.isfinite(scheme.limit):
        modes = (
            found.system.modes.w2
            if found.system.has_modes
            else found.system.hessian_diagonal(found.q) / found.m
        )
        held = min(held, (scheme.limit / 2 or 0.1) / float(np.sqrt(np.max(modes))))
        if not any(kind.friction for kind in scheme.kinds) and found.system.is_damped:
            # friction in the force of an explicit method: h c/m < 2
            held = min(held, 0.5 / float(np.max(found.system.friction_at(found.q)[0])))
    return held


def serves(label: Label, family: Family) -> bool:
    """Whether a method has a row in a family; a platform in another precision answers another question."""
    known = engines.obstacle(scene(family, RATIOS[family][0]), label)
    return known is None and not label.platform


def measure(label: Label, family: Family, ratios: Sequence[float] = ()) -> tuple[Cost, ...]:
    """The runs of a method that serves the family, one at every ratio."""
    run = _solver if engines.method(label).adaptive else _fixed
    return tuple(run(scene(family, ratio), label, family, ratio) for ratio in ratios or RATIOS[family])


def _fixed(found: Scene, label: Label, family: Family, ratio: float) -> Cost:
    end = found.step * found.steps
    steps = int(np.ceil(end / step_for(found, label)))
    run = replace(found, step=end / steps, steps=steps, every=steps, quantities=("q", "p"))
    most = most_steps(label)
    common: dict[str, Any] = {"family": family, "method": str(label), "ratio": ratio, "steps": steps}
    common["step"] = run.step
    if steps > most:
        return Cost(**common, force_calls=steps, outcome=f"not run: {steps:.1e} steps")
    try:
        done = driver.run(run, label)
    except MethodError as refused:
        return Cost(**common, outcome=str(refused))
    error = float("nan")
    if done.outcome.status == "complete":
        error = slow_error(run, done.q[-1], done.p[-1], steps)
    return Cost(**common, force_calls=done.force_calls, error=error, outcome=done.outcome.status)


def _solver(found: Scene, label: Label, family: Family, ratio: float) -> Cost:
    end = found.step * found.steps
    common: dict[str, Any] = {"family": family, "method": str(label), "ratio": ratio}
    try:
        done = internal_steps(found, engines.method(label), most=most_steps(label))
    except Stopped as stop:
        return Cost(**common, step=np.nan, steps=stop.rows, outcome=f"stopped: {stop}")
    whole = done.t >= end
    steps = done.accepted if whole else int(done.accepted * end / done.t)
    return Cost(
        **common,
        step=done.t / done.accepted,
        steps=steps,
        rejected=max(done.attempted - done.accepted, 0),
        force_calls=done.force_calls,
        error=slow_error(found, done.q, done.p, found.steps) if whole else float("nan"),
        outcome="complete" if whole else f"not run to the end: {steps:.1e} steps",
    )


def slow_error(found: Scene, q: Any, p: Any, steps: int) -> float:
    """Distance of a state from the true slow motion at the end, in units of the slow amplitude."""
    if not found.system.has_modes:
        # a relaxation oscillation starts at its amplitude
        true_q, _ = exact.true_motion(found, np.array([steps]), found.step)
        return float(np.max(np.abs(q - true_q[0])) / np.max(np.abs(found.q)))
    modes = found.system.modes
    j = int(np.argmin(modes.w2))
    w = np.sqrt(modes.w2[j])
    true = modes.into(*exact.true_motion(found, np.array([steps]), found.step))
    here = modes.into(np.asarray(q), np.asarray(p))
    y, v = (here[i][j] - true[i][0, j] for i in range(2))
    # the slow motion of an overdamped mass is in q alone: its momentum follows from it
    if found.system.is_damped:
        return float(abs(y) / np.max(np.abs(modes.into(found.q, found.p)[0])))
    start = modes.into(found.q, found.p)
    return float(np.hypot(w * y, v) / np.hypot(w * start[0][j], start[1][j]))


def study(family: Family, methods: Sequence[str] = ()) -> list[Cost]:
    """The runs of the methods that these labels or globs name (left out: all) and that serve a family."""
    chosen = engines.match(tuple(methods) or ("*",))
    return [row for label in chosen if serves(label, family) for row in measure(label, family)]


def as_table(costs: Sequence[Cost]) -> TextTable:
    """A line for each run."""
    rows = [
        (
            x.method, f"{x.ratio:.0e}", str(x.steps), str(x.rejected), str(x.force_calls),
            number(x.error, ".1e"), x.outcome.partition(":")[0],
        )
        for x in costs
    ]  # fmt: skip
    titles = ("method", "ratio", "steps", "rejected", "force calls", "error", "outcome")
    return table(titles, rows, left=("method", "outcome"))


def charts(costs: Sequence[Cost]) -> list[Chart]:
    """Steps, force calls and errors against the ratio."""
    ratio = RATIO_NAMES[costs[0].family]
    what: tuple[tuple[str, str, Callable[[Cost], bool]], ...] = (
        ("steps", "steps; those of unfinished runs are estimates", lambda x: True),
        ("force_calls", "force calls of finished runs", lambda x: x.outcome == "complete"),
        ("error", "error of the slow motion", lambda x: x.error < MOST_ERROR),
    )
    found = []
    for name, title, shown in what:
        curves = []
        for method in dict.fromkeys(x.method for x in costs):
            mine = [x for x in costs if x.method == method and float(getattr(x, name)) > 0 and shown(x)]
            x, y = [x.ratio for x in mine], [float(getattr(x, name)) for x in mine]
            left = [x.outcome != "complete" for x in mine]
            curves.append(Curve(name=method, group=scheme_of(method), x=x, y=y, marks=True, open=left))
        scales = Scale(name=ratio, log=True), Scale(name=title.partition(";")[0], log=True)
        said = f"What stiffness costs: {title}."
        found.append(Chart(title=said, short=title, x=scales[0], y=scales[1], curves=curves))
    return found


def draw(costs: Sequence[Cost], folder: Path) -> list[Path]:
    """Draw them into a folder; returns the files."""
    family = costs[0].family
    heading = f"{family}: what stiffness costs (hollow: estimates of runs too long)"
    with style():
        picture = render.picture(Bank(title="Methods drawn", heading=heading, charts=charts(costs)))
        return save(picture, folder, f"stability-costs-{family}")


def main() -> int:
    """Print the costs of a family and draw them; 1 where nothing was measured."""
    given = arguments(__doc__, scene="two-scales", methods=list[str]())
    if given.scene not in get_args(Family):
        raise SpringcheckError(f"{given.scene}: {', '.join(get_args(Family))} have costs")
    found = study(given.scene, given.methods)
    if not found:
        return 1
    print(as_text([as_table(found)]))
    for path in draw(found, Path("figures")):
        print(path)
    return 0


if __name__ == "__main__":
    script(main)
