"""Experiments with the seed of a thermostat: runs of one seed share their draws, and differ as is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from springcheck.bath import THERMOSTATS, Stepper, Thermostat, chance
from springcheck.bath.catalogue import NO_NORMAL_NUMBERS
from springcheck.bath.draws import LARGEST_DRAW, law_of, read
from springcheck.bath.rounding import one_rounding, roundings_of
from springcheck.bath.stepper import forces
from springcheck.checks.case import Case, small_move
from springcheck.checks.check import Chance, Finding, check
from springcheck.checks.thermal import HIDDEN, reading
from springcheck.errors import MethodError
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

FEW = 8
"""Number of particles up to which each is perturbed by itself."""

LONGEST_WAIT, NONE_LEFT = 10_000, 1e-9
"""Most steps of a run that waits for a collision, and the probability that none comes in time."""

COLLIDED = 30
"""Steps of the runs of `noise_size` where noise comes from collisions."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seeded:
    """A random method on a scene, to be run with one seed or another."""

    scene: Scene
    label: str
    seed: int
    play: Callable[..., Trajectory]
    """(scene, label, seed=) -> trajectory, by a seed or a generator.  May raise MethodError."""

    @cached_property
    def scheme(self) -> Thermostat:
        """The scheme that the method claims to run."""
        return THERMOSTATS[
            self.play(replace(self.scene, steps=1, every=1), self.label, seed=self.seed).scheme
        ]

    def run(self, scene: Scene, steps: int, seed: Any = None) -> Trajectory:
        """A run of so many steps, each recorded.  MethodError where it diverges, or reuses forces."""
        run = self.play(replace(scene, steps=steps, every=1), self.label, seed=seed or self.seed)
        if limit := small_move(run):
            raise MethodError(limit)
        if len(run.t) <= steps:
            raise MethodError(f"it diverges within {steps} steps")
        return run

    def at_rest(self) -> Scene:
        """The scene with every particle at rest at 0."""
        none = np.zeros(self.scene.n)
        return replace(self.scene, q=none, p=none)

    def stepper(self, scene: Scene, *, absolute: bool = False) -> Stepper:
        """The scheme's own step on a scene."""
        return Stepper.of(self.scheme, scene, absolute=absolute)

    def allowed(self, run: Trajectory, row: int = 0, factor: Any = True) -> Extended:
        """Bound on the rounding of a step from a frame (2, n); `factor` is a thermostat's on all momenta."""
        start = run.q[row].astype(np.longdouble), run.p[row].astype(np.longdouble)
        draws = [np.full(self.scene.n, LARGEST_DRAW)] * self.scheme.draws
        of_q, of_p = one_rounding(
            self.scene, self.stepper(self.scene, absolute=True), start, draws, factor, run.arithmetic,
            run.rebuilds_velocity,
        )  # fmt: skip
        if self.scheme.rescales_after:
            # the kinetic energy that determines the factor has the roundings of all steps before it
            of_p = of_p + np.sqrt(self.scene.m * np.sum(of_p**2 / self.scene.m))
        return roundings_of(self.scheme) * np.stack([of_q, of_p])


WITHIN = 1.0, "of what rounding allows"
"""Bound and unit of a difference over what is allowed."""


def _off(found: Any, expected: Any, allowed: Extended) -> Any:
    """The largest difference of states (2, n) over what is allowed; NaN, which max() drops, of one of NaN."""
    return np.max(np.abs(np.subtract(found, expected)) / allowed)


@check("map", family="noise")
def noise_map(subject: Seeded) -> Finding | str:
    """One seed and two starts: the difference of the runs, which no noise reaches, is the scheme's map."""
    scene, scheme = subject.scene, subject.scheme
    if scheme.collides:
        return "a collision leaves nothing of the difference of two momenta"
    if scheme.rescales:
        return "a factor of all momenta is of both starts: no map of their difference"
    if not scene.system.is_linear or scene.n > FEW:
        return f"a linear scene of {FEW} particles at most is needed"
    size_p = np.sqrt(scene.m * scene.thermal)
    pushes = np.diag(np.concatenate([abs(scene.step) * size_p / scene.m, size_p])).reshape(-1, 2, scene.n)
    base = subject.run(scene, 2)
    none, off = np.zeros(scene.n, np.longdouble), list[Any]()

    def without_rest(terms: Any) -> Any:
        force = scene.system.force_of(terms)
        rest = force(none, none)
        return lambda q, p: force(q, p) - rest

    force = forces(scheme, scene.system, without_rest)
    for dq, dp in pushes:
        other = subject.run(replace(scene, q=scene.q + dq, p=scene.p + dp), 2)
        # the second step: a draw that acts in two steps is then the same in both
        d = [(a - b)[1:].astype(np.longdouble) for a, b in ((other.q, base.q), (other.p, base.p))]
        draws = [none] * scheme.draws
        ideal = subject.stepper(scene)(d[0][0], d[1][0], force, draws)
        allowed = subject.allowed(base, 1) + subject.allowed(other, 1)
        off.append(_off((d[0][1], d[1][1]), ideal, allowed))
    return Finding(np.max(off), *WITHIN, f"{2 * scene.n} pushes, roundings of both runs")


@check("size", family="noise")
def noise_size(subject: Seeded) -> Finding | str:
    """One seed at four times the temperature doubles the noise, and at four times all masses and stiffnesses
    doubles it in momenta and halves it in positions; at another friction it comes of the same draws.

    Particles start at rest, or, where a factor acts on momenta, in motion that is scaled likewise.
    """
    scheme, scene = subject.scheme, subject.scene if subject.scheme.rescales else subject.at_rest()
    if not scene.system.is_linear or np.any(scene.system.potential_force(0 * scene.q, 0 * scene.p)):
        return "a linear scene with its rest in 0 is needed"
    assert scene.bath is not None
    # a collision may not occur in a given step; a factor of 2 is exact over any number of steps
    collides = scheme.collides
    steps = COLLIDED if collides else 1
    one = subject.run(scene, steps)
    warmer = replace(scene.bath, temperature=4 * scene.bath.temperature)
    hot = replace(scene, q=2 * scene.q, p=2 * scene.p, bath=warmer)
    heavy = replace(scene.system.scaled(4.0), m=4 * scene.m, q=scene.q / 2, p=2 * scene.p)
    off, allowed = list[Any](), 4 * steps * subject.allowed(one)
    for other, of_q, of_p in ((subject.run(hot, steps), 2.0, 2.0), (subject.run(heavy, steps), 0.5, 2.0)):
        expected = of_q * one.q[-1], of_p * one.p[-1]
        off.append(_off((other.q[-1], other.p[-1]), expected, allowed))
    if not np.any(one.p[-1]):
        if collides:
            return f"no collision in {COLLIDED} steps"
        return Finding(np.inf, *WITHIN, "there is no noise")
    # where a step takes two draws, its state determines only their sum, weighted by friction
    if not collides and not scheme.rescales and scheme.fresh == 1:
        off.append(_redrawn(subject, one))
    return Finding(np.max(off), *WITHIN, "a factor of 2, and the same draws, of both runs")


def _redrawn(subject: Seeded, one: Trajectory) -> float:
    """Difference, over its bound, of the draws of a step from rest from the same seed's at another friction.

    An engine that takes 1 - c**2 from c loses digits at small x = gamma h: 1/2x roundings of the noise, and
    1/x times as many where c is a difference itself, as in LAMMPS' (sqrt(1 + 4x) - 1)/2x.
    """
    bath, scene = subject.scene.bath, subject.at_rest()
    assert bath is not None
    x = bath.friction * scene.step
    factor = 4.0 if 4 * x <= 1 else 0.25
    other = replace(scene, bath=replace(bath, friction=factor * bath.friction))
    both = [
        read(subject.scheme, at, run.q, run.p, how=run.arithmetic, rebuilt=run.rebuilds_velocity)
        for at, run in ((scene, one), (other, subject.run(other, 1)))
    ]
    # a sum of two draws has the roundings of both, however near it is to 0
    size = np.maximum(np.abs(both[0].draws), LARGEST_DRAW * (subject.scheme.carried > 0))
    if both[0].draws.shape != both[1].draws.shape:
        # at so small a friction a state resolves fewer draws
        return 0.0
    lost = one.arithmetic.unit * size / min(1.0, x, factor * x) ** 2
    error = np.sum([y.error for y in both], axis=0).reshape(lost.shape)
    return float(np.max(np.abs(both[0].draws - both[1].draws) / (lost + error)))


class Script:
    """A generator that returns the numbers of a list, one for all particles at a time, and then 0."""

    def __init__(self, values: Any) -> None:
        self._left = list(values)

    def standard_normal(self, size: Any = ()) -> Floats:
        """The next number of the list for each draw of a shape (steps, draws, particles), or one for any
        other."""
        out = np.zeros(size)
        for row in out[0] if out.ndim == 3 else [out]:
            row[...] = self._last = self._left.pop(0) if self._left else 0.0
        return out

    def standard_gamma(self, shape: float) -> float:
        """Half of the squares of so many halves of the last number."""
        return shape * self._last**2


@check("script", family="noise")
def noise_matrix(subject: Seeded) -> Finding | str:
    """A scripted generator reads the noise itself: what each unit draw does in a step, to rounding."""
    scheme, scene = subject.scheme, subject.scene
    if scheme.uniform or scheme.collides:
        return NO_NORMAL_NUMBERS
    runs = [subject.run(scene, 1, Script(unit)) for unit in np.eye(scheme.draws)]
    off, pull = list[Any](), forces(scheme, scene.system)
    assert scene.bath is not None
    start = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)
    none = subject.stepper(scene)(*start, pull, [np.zeros(scene.n, np.longdouble)] * scheme.draws)
    for unit, run in zip(np.eye(scheme.draws), runs, strict=True):
        draws = [np.full(scene.n, np.longdouble(x)) for x in unit]
        ideal = subject.stepper(scene)(*start, pull, draws)
        factor: Any = True
        if scheme.rescales:
            force = scene.system.potential_force if scheme.rescales_after else lambda q, p: 0 * q
            both = [subject.stepper(scene)(*start, force, draws, hit)[1] for hit in (None, 1.0)]
            factor = max(1.0, float(np.max(np.abs(both[0])) / np.max(np.abs(both[1]))))
        # an amplitude formed from 1 - c, with c rounded, loses digits by cancellation
        lost = run.arithmetic.unit / min(1.0, scene.bath.friction * scene.step)
        allowed = subject.allowed(run, factor=factor) + lost * np.abs(np.subtract(ideal, none))
        off.append(_off((run.q[1], run.p[1]), ideal, allowed))
    return Finding(np.max(off), *WITHIN, f"{scheme.draws} unit draws")


@check("seed", family="noise")
def seed_kept(subject: Seeded) -> Finding | str:
    """Two runs of one seed are equal bit for bit, and another seed is another run."""
    steps = 20
    if subject.scheme.collides:
        # two runs without a collision are equal whatever their seeds
        rare = law_of(subject.scheme, subject.scene).collision * subject.scene.n
        steps = max(steps, int(np.ceil(-np.log(NONE_LEFT) / rare)))
        if steps > LONGEST_WAIT:
            return f"in {LONGEST_WAIT} steps a collision is not certain"
    one, same, other = (subject.run(subject.scene, steps, subject.seed + i) for i in (0, 0, 1))
    rows = [np.concatenate([run.q, run.p], axis=1) for run in (one, same, other)]
    differ = sum(not np.array_equal(a, b, equal_nan=True) for a, b in zip(rows[0], rows[1], strict=True))
    if np.array_equal(rows[0], rows[2], equal_nan=True):
        if not np.isfinite(rows[0]).all():
            return "it diverges before a draw shows"
        return Finding(steps + 1, 0.0, "frames", "another seed changes nothing: it is ignored")
    return Finding(differ, 0.0, "frames", "the same draws in the same order")


@check("seeds", family="noise")
def seeds_apart(subject: Seeded) -> Chance | str:
    """The draws of one seed say nothing of those of the next, wherever in the run and of whichever particle.

    All draws in a row are held against those of the next seed at every distance up to half of the run.
    """
    if subject.scheme.collides:
        return "its draws come now and then"
    steps = min(200, subject.scene.steps)
    runs = [subject.run(subject.scene, steps, subject.seed + i) for i in (0, 1)]
    both = [reading(Case(trajectory=run, scene=subject.scene)) for run in runs]
    if not all(one.known for one in both):
        return HIDDEN
    x, y = (one.draws for one in both)
    found = chance.crossed(x.ravel(), y.ravel())
    return Chance(found, f"largest correlation of {x.size} draws of each")


SEEDED = (noise_map, noise_size, noise_matrix, seed_kept, seeds_apart)
