"""What the judge would see by h w: the smallest relative errors of stiffness, step and the like that fail.

    python validation/detection.py [STEPS SCENES]

One particle on a spring, every step recorded, an engine in extended precision whose states are rounded once
a step.  Each limit is the least of those that the verdicts of the right run say (`Verdict.sees`), and each is
put to the test: an engine that is off by three limits must fail, one that is off by a tenth must pass; so
are the limits of as many random scenes of every term, scheme and distance of frames as are asked for, and
those of the experiments: areas in phase space that grow at each step, and orders.  It prints a table of the
limits; exit status 1 where one of them is wrong.

Measured with 400 steps and 100 random scenes: 815 limits, 99 of experiments and 336; none wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

import clean
import textbook as steppers
from arguments import arguments, script
from judge_campaign import FIXED, random_scene
from springcheck import checks, schemes
from springcheck.checks import experiments, laws
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.terms import Damping
from springcheck.physics.trajectory import Limits, Trajectory, Verdict

TURNS = (0.001, 0.01, 0.1, 0.5, 1.0, 1.5, 1.9)
METHODS = (
    "explicit-euler", "semi-implicit-euler", "velocity-verlet", "forest-ruth", "rk4", "implicit-euler",
    "implicit-midpoint",
)  # fmt: skip
FACTORS = ((3.0, False), (0.1, True))
"""Limits by which an engine is off, and whether it passes."""


def planted(
    scene: Scene, scheme: schemes.Scheme, name: str = "", x: float = 0.0, row: int | None = None
) -> Trajectory:
    """A run in extended precision, rounded once a step, in which one quantity of `Limits` is off by x: of
    springs and frictions that of one row, or of all."""
    system, off = scene.system, np.longdouble(x)
    h = np.longdouble(scene.step) * (1 + off * (name == "step"))
    every = rows(scene, name) if name in ("stiffness", "friction") else []
    wrong = every if row is None else every[row : row + 1]

    on_each = np.ones(scene.n, dtype=np.longdouble)
    if name == "reaction":
        right = planted(scene, scheme)
        # what momentum may be off by grows with the steps and the states: that of which most shows
        _, of_p = checks.Case(trajectory=right, scene=scene).allowance_at(right.q, right.p)
        most = np.maximum.accumulate(np.sum(of_p, axis=1)) * np.arange(len(right.t))
        on_each[np.argmax(np.max(np.abs(right.p - scene.p)[1:] / most[1:, None], axis=0))] += off

    def force_of(terms: Iterable[Term]) -> Any:
        parts: list[tuple[Any, Any]] = [(system.force_of([term]), 1) for term in terms]
        mine = [one for number, one in wrong if any(term is scene.terms[number] for term in terms)]
        if mine:
            parts.append((system.force_of(mine), off))
        return lambda q, p: sum((force(q, p) * factor for force, factor in parts), np.zeros_like(q)) * on_each

    def stiffness(q: Any) -> tuple[Any, bool]:
        # it only steers the iteration
        return system.hessian(q), True

    rate = system.friction_rates.copy() if system.is_damped else None
    if rate is not None and name == "friction":
        for _, one in wrong:
            one.scatter(off * (one.parameters[0] / scene.m[one.particles[0]].astype(np.longdouble)), rate)

    def step(i: int, q: Floats, p: Floats) -> tuple[Floats, Floats]:
        a, b = schemes.step(
            scheme, q.astype(np.longdouble), p.astype(np.longdouble), h=h, m=scene.m,
            force=force_of(scene.terms), stiffness=stiffness if scheme.has("implicit") else None, rate=rate,
            parts=(force_of(system.slow), force_of(system.fast)),
        )  # fmt: skip
        return np.asarray(a, np.float64), np.asarray(b * (1 + off * (name == "area")), np.float64)

    return steppers.record(scene, scheme, step)


def rows(scene: Scene, name: str) -> list[tuple[int, Term]]:
    """Every spring, or every friction, of a scene: the number of its term, and a term of it alone."""
    found: list[tuple[int, Term]] = []
    for number, term in enumerate(scene.terms):
        if (term.kind == "potential") == (name == "stiffness"):
            for row in range(len(term)):
                alone: Any = {key: values[row : row + 1] for key, values in term.arrays.items()}
                found.append((number, replace(term, **alone)))  # type: ignore[type-var]
    return [(number, one) for number, one in found if one.parameters[0][0] != 0]


def growing(scene: Scene, scheme: schemes.Scheme, name: str = "", x: float = 0.0) -> Trajectory:
    """The textbook engine in doubles, in which a kick of a whole step also multiplies momenta by 1 + x."""
    system, rate = scene.system, x / scene.step
    step = steppers.textbook(scene, scheme, force=lambda q, p: system.force(q, p) + rate * p)
    return steppers.record(scene, scheme, step)


def of_order(scene: Scene, scheme: schemes.Scheme, name: str = "", x: float = 0.0) -> Trajectory:
    """A step that ends off the exact solution by a thousandth of its place, times (h / h of the first)**r,
    the order r off by x."""
    where = "spring" if scene.system.is_linear else "quartic potential"
    q, p = (np.asarray(y, np.float64) for y in laws.exact_end(where))
    share = 1e-3 * (scene.step * laws.COARSEST / laws.DURATION) ** (scheme.order + x)
    return steppers.trajectory(
        scene, scheme, np.stack([scene.q, q * (1 + share)]), np.stack([scene.p, p * (1 + share)])
    )


Planted: TypeAlias = Callable[[Scene, schemes.Scheme, str, float], Trajectory]
EXPERIMENTS: dict[checks.Check, Planted] = {
    experiments.determinant: planted,
    experiments.symplecticity: planted,
    experiments.reversibility: planted,
    laws.rounding_bias: growing,
    laws.rounding_growth: growing,
    laws.order: of_order,
    laws.order_anharmonic: of_order,
}
"""Experiments that state a limit, and how engines are off by it."""


def wrong(
    scene: Scene, scheme: schemes.Scheme, only: Iterable[str] = Limits.__slots__
) -> tuple[int, list[str]]:
    """How many limits the verdicts of the right run state, and those of them that do not hold."""

    def verdict(check: checks.Check, name: str = "", x: float = 0.0, row: int | None = None) -> Verdict:
        return checks.judge(scene, planted(scene, scheme, name, x, row), [check])[0]

    tried, out = 0, list[str]()
    for found in checks.judge(scene, planted(scene, scheme)):
        (check,) = (one for one in checks.CHECKS if one.name == found.check)
        several = {name: len(rows(scene, name)) for name in ("stiffness", "friction")}
        count, more = _held(found, partial(verdict, check), only, several)
        tried, out = tried + count, out + [f"{scheme.name}: {line}" for line in more]
    return tried, out


def wrong_experiment(experiment: checks.Check, scene: Scene, scheme: schemes.Scheme) -> tuple[int, list[str]]:
    """The same of one experiment."""

    def verdict(name: str = "", x: float = 0.0) -> Verdict:
        def run(made: Scene, label: str) -> Trajectory:
            return EXPERIMENTS[experiment](made, scheme, name, x)

        return experiment(checks.Bench(scene=scene, label="", run=run))

    tried, out = _held(verdict(), verdict, Limits.__slots__)
    return tried, [f"{scheme.name}: {line}" for line in out]


def _held(
    right: Verdict,
    verdict: Callable[..., Verdict],
    only: Iterable[str],
    several: Mapping[str, int] | None = None,
) -> tuple[int, list[str]]:
    """How many limits a passed verdict states, and those at which an engine is judged otherwise.

    Of several springs or frictions every one that is seen at all must be seen at three limits, and one of
    them not at a tenth.
    """
    tried, out = 0, []
    for name in only:
        limit = getattr(right.sees, name)
        if limit is None or not right.passed:
            continue
        tried += 1
        rows = (several or {}).get(name, 1)
        each = [{"row": row} for row in range(rows)] if rows > 1 else [{}]
        seen = [more for more in each if verdict(name, 2.0**-5, **more).passed is False]
        for factor, passes in FACTORS:
            found = [verdict(name, factor * limit, **more) for more in seen]
            right_so = [one.passed is passes for one in found]
            if not (any(right_so) if passes else all(right_so)):
                worst = found[right_so.index(False)] if found else right
                out.append(
                    f"{right.check}: {name} off by {factor:g} x {limit:.2g}: {worst.value:.3g} of "
                    f"{worst.bound:.3g}, {rows} of it"
                )
    return tried, out


def spring(hw: float, steps: int, *, damped: bool = False) -> Scene:
    """One particle on a spring, no number of it round."""
    m, k = np.array([3.7]), np.array([2.9])
    terms: tuple[Term, ...] = (clean.walls(k, np.array([0.1])),)
    if damped:
        terms += (Damping(i=np.array([0]), c=np.array([0.03])),)
    step = float(hw / np.sqrt(k[0] / m[0]))
    return clean.scene(m, terms, np.array([0.3]), np.array([0.7]), step=step, steps=steps)


def least(scene: Scene, name: str) -> Limits:
    """The least limits of all verdicts on the right run of a scheme."""
    run = planted(scene, schemes.SCHEMES[name])
    return Limits.least(v.sees for v in checks.judge(scene, run) if v.passed)


def main() -> int:
    """Print the limits, and what is wrong with them; 1 where one is."""
    asked = arguments(__doc__, steps=400, scenes=100)
    for name in ("stiffness", "step"):
        print(f"| {name}, h w = | {' | '.join(f'{hw:g}' for hw in TURNS)} |")
        print(f"|---|{'---|' * len(TURNS)}")
        for method in METHODS:
            cells = []
            for hw in TURNS:
                limit = getattr(least(spring(hw, asked.steps), method), name)
                cells.append("-" if limit is None else f"{limit:.0e}")
            print(f"| {method} | {' | '.join(cells)} |", flush=True)
        print()
    tried = 0
    failed: list[str] = []
    for method in METHODS:
        for hw in TURNS:
            for damped in (False, True):
                scene = replace(spring(hw, min(asked.steps, 60), damped=damped), quantities=("q", "p"))
                count, found = wrong(scene, schemes.SCHEMES[method])
                tried, failed = tried + count, failed + found
    print(f"{tried} limits tried, at 3 and at 0.1 of each: {len(failed)} wrong", flush=True)
    tried = 0
    for method in METHODS[1:]:
        for experiment in EXPERIMENTS:
            of_scene = experiment.family == "map"
            for hw in TURNS[1:] if of_scene else (0.1,):
                count, found = wrong_experiment(experiment, spring(hw, 60), schemes.SCHEMES[method])
                tried, failed = tried + count, failed + found
    print(f"{tried} limits of experiments likewise: {len(failed)} wrong in all", flush=True)
    tried = 0
    for seed in range(asked.scenes):
        rng = np.random.default_rng([13, seed])
        scheme = schemes.SCHEMES[str(rng.choice(FIXED))]
        with np.errstate(all="ignore"):
            count, found = wrong(random_scene(rng, scheme), scheme)
        tried, failed = tried + count, failed + found
    print(f"{tried} limits of {asked.scenes} random scenes likewise: {len(failed)} wrong in all")
    for line in failed:
        print(" ", line)
    return int(bool(failed))


if __name__ == "__main__":
    script(main)
