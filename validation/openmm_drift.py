"""OpenMM's Reference Verlet has a friction of one rounding: its shadow energy drifts where 1/h rounds.

Claim: VerletIntegrator rebuilds the velocity as (x' - x) * fl(1/h) at every step, so that it is multiplied
by h fl(1/h), and the shadow energy drifts by h fl(1/h) - 1 a step: -8.88e-17 at h = 0.013, which makes
-2.66e-11 in 300,000 steps, and nothing at h = 2**-7, whose reciprocal is exact.  springcheck's own
semi-implicit Euler rounds without a bias: its shadow energy walks.

Command: python validation/openmm_drift.py [FOLDER]     (default: validation-output; the picture goes there)

Expected:
    openmm:verlet, h = 0.013   drift of 64 springs after 300,000 steps   -2.67e-11 +- 2e-13, implied -2.66e-11
    openmm:verlet, h = 2**-7                                             0 within 5 standard errors
    own:semi-implicit-euler, both                                        0 within 5 standard errors
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from arguments import arguments, script
from springcheck.checks import laws
from springcheck.driver import run
from springcheck.figures import looks, style
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring

STEPS = 300_000
FRAMES = 300
SPRINGS = 64
METHODS = ("openmm:verlet", "own:semi-implicit-euler")


def scene(h: float) -> Scene:
    """64 of the experiment's springs, for a longer time."""
    many = laws.ensemble(h)
    spring = many.terms[0]
    assert isinstance(spring, WallSpring)
    return replace(
        many,
        m=many.m[:SPRINGS],
        q=many.q[:SPRINGS],
        p=many.p[:SPRINGS],
        terms=(replace(spring, i=spring.i[:SPRINGS], k=spring.k[:SPRINGS], at=spring.at[:SPRINGS]),),
        steps=STEPS,
        every=STEPS // FRAMES,
    )


def main() -> int:
    """Run, fit, draw; the exit status says whether the drift is the predicted one."""
    folder = arguments(__doc__, folder=Path("validation-output")).folder
    good = True
    with style.style():
        figure = Figure(figsize=(7.2, 3.2), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, h, name in zip(panels, (laws.ODD, laws.EVEN), ("0.013", "2$^{-7}$"), strict=True):
            for i, method in enumerate(METHODS):
                trajectory = run(scene(h), method)
                steps, change = laws.drifts(scene(h), trajectory)
                last = change[-1]
                mean, error = float(np.mean(last)), float(np.std(last, ddof=1) / np.sqrt(SPRINGS))
                implied = laws.predicted_drift(trajectory) * STEPS
                print(f"{method}, h = {h:.6g}: {mean:.2e} +- {error:.0e}, implied {implied:.2e}")
                good &= abs(mean - implied) <= 5 * error
                _draw(axes, steps, change, i, method)
                if method == METHODS[0]:
                    axes.plot(steps, implied / STEPS * steps, color="black", linewidth=0.8, label="implied")
            axes.set_title(f"h = {name}")
            axes.set_xlabel("steps")
            axes.locator_params(axis="x", nbins=4)
        panels[0].set_ylabel("relative change of the shadow energy")
        panels[0].legend(loc="lower left")
        for path in style.save(figure, folder, "openmm-drift"):
            print(path)
    return 0 if good else 1


def _draw(axes: object, steps: Floats, change: Floats, i: int, label: str) -> None:
    """The mean over the springs, and the band of one standard deviation of a spring."""
    from matplotlib.axes import Axes

    assert isinstance(axes, Axes)
    mean, spread = np.mean(change, axis=1), np.std(change, axis=1)
    look = looks.look(looks.scheme_of(label))
    # one colour for one scheme: its methods differ by their marks
    mark = "os^D"[i % 4]
    axes.plot(
        steps, mean, label=label, color=look.color, linestyle=look.linestyle, marker=mark, markevery=0.2
    )
    axes.fill_between(steps, mean - spread, mean + spread, color=look.color, alpha=0.15, linewidth=0)


if __name__ == "__main__":
    script(main)
