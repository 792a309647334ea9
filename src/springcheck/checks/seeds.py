"""Experiments with a method in a bath: runs of one seed share their draws, and differ as is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from springcheck.bath import THERMOSTATS, Stepper, Thermostat
from springcheck.bath.catalogue import NO_NORMAL_NUMBERS
from springcheck.bath.draws import LARGEST_DRAW
from springcheck.bath.rounding import one_rounding, roundings_of
from springcheck.bath.stepper import forces
from springcheck.checks.case import small_move
from springcheck.checks.check import Finding, check
from springcheck.errors import MethodError
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

FEW = 8
"""Number of particles up to which each is perturbed by itself."""

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
        one = replace(self.scene, steps=1, every=1)
        return THERMOSTATS[self.play(one, self.label, seed=self.seed).scheme]

    def run(self, scene: Scene, steps: int, seed: Any = None) -> Trajectory:
        """A run of so many steps, each recorded.  MethodError where it diverges, or reuses forces."""
        run = self.play(replace(scene, steps=steps, every=1), self.label, seed=seed or self.seed)
        if limit := small_move(run):
            raise MethodError(limit)
        if len(run.t) <= steps:
            raise MethodError(f"it diverges within {steps} steps")
        return run

    def stepper(self, *, absolute: bool = False) -> Stepper:
        """The scheme's own step."""
        return Stepper.of(self.scheme, self.scene, absolute=absolute)

    def allowed(self, run: Trajectory, row: int = 0, factor: Any = True) -> Extended:
        """Bound on the rounding of a step from a frame (2, n); `factor` is a thermostat's on all momenta."""
        start = run.q[row].astype(np.longdouble), run.p[row].astype(np.longdouble)
        draws = [np.full(self.scene.n, LARGEST_DRAW)] * self.scheme.draws
        of_q, of_p = one_rounding(
            self.scene, self.stepper(absolute=True), start, draws, factor, run.arithmetic,
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
        return "a collision replaces the momenta: nothing of their difference is left"
    if scheme.rescales:
        return "a factor of all momenta is of both starts: no map of their difference"
    if not scene.system.is_linear or scene.n > FEW:
        return f"a linear scene of {FEW} particles at most is needed"
    size_p = np.sqrt(scene.m * scene.thermal)
    pushes = np.diag(np.concatenate([abs(scene.step) * size_p / scene.m, size_p])).reshape(-1, 2, scene.n)
    base = subject.run(scene, 2)
    none, off = np.zeros(scene.n, np.longdouble), list[Any]()
    whole = forces(scene.system)
    rest = whole(none, none)
    for dq, dp in pushes:
        other = subject.run(replace(scene, q=scene.q + dq, p=scene.p + dp), 2)
        # the second step: a draw that acts in two steps is then the same in both
        d = [(a - b)[1:].astype(np.longdouble) for a, b in ((other.q, base.q), (other.p, base.p))]
        draws = [none] * scheme.draws
        ideal = subject.stepper()(d[0][0], d[1][0], lambda q, p: whole(q, p) - rest, draws)
        allowed = subject.allowed(base, 1) + subject.allowed(other, 1)
        off.append(_off((d[0][1], d[1][1]), ideal, allowed))
    return Finding(np.max(off), *WITHIN, f"{2 * scene.n} pushes, roundings of both runs")


@check("size", family="noise")
def noise_size(subject: Seeded) -> Finding | str:
    """One seed at four times the temperature doubles the noise, and at four times all masses and stiffnesses
    doubles it in momenta and halves it in positions.

    Particles start at rest, or, where a factor acts on momenta, in motion that is scaled likewise.
    """
    scheme, scene = subject.scheme, subject.scene
    if not scheme.rescales:
        scene = replace(scene, q=0 * scene.q, p=0 * scene.p)
    if not scene.system.is_linear or np.any(scene.system.potential_force(0 * scene.q, 0 * scene.p)):
        return "a linear scene with its rest in 0 is needed"
    assert scene.bath is not None
    # a collision may not occur in a given step; a factor of 2 is exact over any number of steps
    steps = COLLIDED if scheme.collides else 1
    one = subject.run(scene, steps)
    warmer = replace(scene.bath, temperature=4 * scene.bath.temperature)
    hot = replace(scene, q=2 * scene.q, p=2 * scene.p, bath=warmer)
    heavy = replace(scene.system.scaled(4.0), m=4 * scene.m, q=scene.q / 2, p=2 * scene.p)
    off, allowed = list[Any](), 4 * steps * subject.allowed(one)
    for other, of_q, of_p in ((subject.run(hot, steps), 2.0, 2.0), (subject.run(heavy, steps), 0.5, 2.0)):
        expected = of_q * one.q[-1], of_p * one.p[-1]
        off.append(_off((other.q[-1], other.p[-1]), expected, allowed))
    if not np.any(one.p[-1]):
        if scheme.collides:
            return f"no collision in {COLLIDED} steps"
        return Finding(np.inf, *WITHIN, "there is no noise")
    return Finding(np.max(off), *WITHIN, "a factor of 2, roundings of both runs")


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
    off, pull = list[Any](), forces(scene.system)
    assert scene.bath is not None
    start = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)
    none = subject.stepper()(*start, pull, [np.zeros(scene.n, np.longdouble)] * scheme.draws)
    for unit, run in zip(np.eye(scheme.draws), runs, strict=True):
        draws = [np.full(scene.n, np.longdouble(x)) for x in unit]
        ideal = subject.stepper()(*start, pull, draws)
        factor: Any = True
        if scheme.rescales:
            force = scene.system.potential_force if scheme.rescales_after else lambda q, p: 0 * q
            both = [subject.stepper()(*start, force, draws, hit)[1] for hit in (None, 1.0)]
            factor = max(1.0, float(np.max(np.abs(both[0])) / np.max(np.abs(both[1]))))
        # an amplitude formed from 1 - c, with c rounded, loses digits by cancellation
        lost = run.arithmetic.unit / min(1.0, scene.bath.friction * scene.step)
        allowed = subject.allowed(run, factor=factor) + lost * np.abs(np.subtract(ideal, none))
        off.append(_off((run.q[1], run.p[1]), ideal, allowed))
    return Finding(np.max(off), *WITHIN, f"{scheme.draws} unit draws")


SEEDED = (noise_map, noise_size, noise_matrix)
