"""Error against run time on the blog's spring: the figure and the table of the README, checked.

Claims:

* the fitted orders are those of the schemes, within three times the stated error and 0.01;
* at the number of force calls that the table gives for an error, a run has that error, by the closed form
  of the motion in 30 digits (mpmath): at most 1.01 times of it, and a run of 1 % fewer steps has more;
* RK4 loses 63 % of its energy in 100,000 steps at h w = 0.3, and falls behind velocity Verlet in energy after
  2,326 steps, where 18/(h w)**4 is 2,222;
* the fastest and the method of fewest force calls differ at an error of 1e-6 by what a force call costs.

Command: python validation/error_vs_runtime.py [FOLDER]      (default: data/figures; a minute)

Expected (an idle core of an AMD EPYC, openmm 8.6, ase 3.29, scikit-sundae 1.2), time
and force calls of an error relative to the initial energy norm:

    1e-2   own:ruth3    2.2 us      own:ruth3          93
    1e-4   own:ruth3    4.6 us      sundials:adams    164
    1e-6   own:rk4       12 us      sundials:adams    292
    1e-8   own:rk4       35 us      sundials:adams    292
    1e-10  own:rk4      106 us      sundials:adams    391
    1e-12  own:rk4      328 us      sundials:adams    447

Exit status 0 where the claims hold, 1 otherwise.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from pathlib import Path

import mpmath as mp

from arguments import arguments, script
from springcheck import driver, engines, load_scene
from springcheck.schemes import SCHEMES
from springcheck.studies.precision import STUDY, longtime
from springcheck.studies.precision import measure as precision
from springcheck.studies.precision.points import TARGETS, Sweep
from springcheck.studies.precision.result import PrecisionStudy, cost_in_words
from springcheck.text.lines import as_text

mp.mp.dps = 30
BUDGET = 45.0
"""Seconds of the study."""

MOST_STEPS = 40_000
"""Longest run that is compared in mpmath."""


def error(label: str, steps: int) -> float:
    """Largest error of a run of the spring by so many steps, from sine and cosine in 30 digits."""
    scene = load_scene("spring")
    duration = scene.step * scene.steps
    run = driver.run(replace(scene, step=duration / steps, steps=steps, every=1), label)
    m, k, p0 = (mp.mpf(float(x)) for x in (scene.m[0], scene.terms[0].parameters[0][0], scene.p[0]))
    w, worst = mp.sqrt(k / m), mp.mpf(0)
    for i, (q, p) in enumerate(zip(run.q[:, 0].tolist(), run.p[:, 0].tolist(), strict=True)):
        t = i * mp.mpf(duration / steps)
        dq, dp = q - p0 / (m * w) * mp.sin(w * t), p - p0 * mp.cos(w * t)
        worst = max(worst, mp.sqrt(k * dq * dq + dp * dp / m))
    return float(worst / mp.sqrt(p0 * p0 / m))


def calls_hold(sweep: Sweep) -> list[str]:
    """Errors at the printed numbers of force calls, and at 1 % fewer steps."""
    out, finest = [], sweep.complete[-1]
    for target in TARGETS:
        calls = sweep.cost("calls", target)
        steps = round(calls * (finest.steps or 0) / (finest.force_calls or 1)) if calls < math.inf else 0
        if not 50 < steps < MOST_STEPS:
            continue
        here, fewer = error(sweep.method, steps), error(sweep.method, math.floor(0.98 * steps))
        if not here <= 1.01 * target < 1.01 * fewer:
            out.append(
                f"{sweep.method} at {steps} steps: {here:.3g}, printed {target:.0e}; before {fewer:.3g}"
            )
    return out


def failures(study: PrecisionStudy) -> list[str]:
    """What does not hold of the claims."""
    out = []
    for sweep in study.measured:
        scheme = SCHEMES[engines.method(engines.parse(sweep.method)).scheme]
        fit = sweep.fit
        if fit and not abs(fit.order - scheme.order) < 0.01 + 3 * fit.standard_error:
            out.append(f"{sweep.method}: order {fit.order:.4f} +- {fit.standard_error:.4f}")
        out += [] if sweep.adaptive else calls_hold(sweep)
    time, calls = (study.winner(kind, 1e-6) for kind in ("time", "calls"))
    if not time or not calls or time[0].seconds_per_call > calls[0].seconds_per_call:
        out.append("the fastest method has no cheaper force call")
    scene = load_scene("spring").derived(step=0.3)
    labels = [engines.parse(x) for x in ("own:velocity-verlet", "own:rk4")]
    long = longtime.record(scene, labels, periods=1e4, metric="energy")
    factor = 1 - mp.mpf("0.3") ** 6 / 72 + mp.mpf("0.3") ** 8 / 576
    bounded = mp.mpf("0.0225") / (1 - mp.mpf("0.0225"))
    crossing, predicted = long.crossings[0][2], mp.log(1 - bounded) / mp.log(factor)
    print(f"RK4 keeps {float(factor**100_000):.3f} of its energy in 100,000 steps at h w = 0.3")
    print(f"it falls behind velocity Verlet after {crossing:.0f} steps, predicted {float(predicted):.0f}")
    return [*out, *(["the crossing is elsewhere"] if not abs(crossing / predicted - 1) < 0.01 else [])]


def rows(study: PrecisionStudy) -> list[str]:
    """Both winners of each error, as a table in Markdown."""
    out = ["| error | least run time | by | fewest force calls | by |", "|---|---|---|---|---|"]
    for target in TARGETS:
        cells = [f"{target:.0e}"]
        for kind in ("time", "calls"):
            won = study.winner(kind, target)
            cells += [cost_in_words(kind, won[1]), f"`{won[0].method}`"] if won else ["-", "-"]
        out.append(f"| {' | '.join(cells)} |")
    return out


def main() -> int:
    """Measure, print the tables, write the figure, and check."""
    folder = arguments(__doc__, folder=Path("data/figures")).folder
    scene = load_scene("spring")
    labels, left = precision.methods(scene, ())
    study = precision.record(scene, labels, left=left, budget=BUDGET)
    print(as_text(study.lines(), 80), "", *rows(study), "", sep="\n")
    with tempfile.TemporaryDirectory() as name:
        STUDY.draw(study, Path(name))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "error-vs-runtime.png").write_bytes(Path(name, "precision.png").read_bytes())
    wrong = failures(study)
    print(*(f"DOES NOT HOLD: {what}" for what in wrong), f"{len(wrong)} claims do not hold", sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    script(main)
