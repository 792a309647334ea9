"""Experiments with the seed of a thermostat: what one seed keeps equal is known to rounding."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from springcheck import driver, engines
from springcheck.checks.case import Case
from springcheck.checks.check import Chance, Finding, check
from springcheck.checks.thermal import reading
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.thermal import THERMOSTATS, Stepper, chance
from springcheck.thermal.draws import IN_AND_OUT, PER_ACT, SMALLEST

FEW = 8
"""Particles up to which each is pushed by itself."""

COLLIDED = 30
"""Steps in which a collision is waited for."""

LARGEST_DRAW = 8.0
"""No draw of a run of a few steps is larger: its chance is 1e-15."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Seeded:
    """A thermostat that is started as often as it takes."""

    scene: Scene
    label: str
    seed: int

    @property
    def method(self) -> Any:
        """Its declaration."""
        return engines.method(engines.parse(self.label))

    def run(self, scene: Scene, steps: int, seed: int | None = None) -> Trajectory:
        """A run of so many steps, each recorded."""
        return driver.run(replace(scene, steps=steps, every=1), self.label, seed=seed or self.seed)

    def at_rest(self) -> Scene:
        """The scene, every particle at rest in 0."""
        none = np.zeros(self.scene.n)
        return replace(self.scene, q=none, p=none)

    def stepper(self, scene: Scene, *, absolute: bool = False) -> Stepper:
        """The scheme's own step on a scene."""
        assert scene.bath is not None
        return Stepper(
            THERMOSTATS[self.method.scheme], h=scene.step, m=scene.m, rate=scene.bath.friction,
            thermal=scene.thermal, width=np.longdouble, absolute=absolute,
        )  # fmt: skip

    def allowed(self, q: Floats, p: Floats) -> tuple[Extended, Extended]:
        """What a step from a state (n,) may be off by."""
        scheme = THERMOSTATS[self.method.scheme]
        how = engines.arithmetic(engines.parse(self.label))
        unit = (IN_AND_OUT + PER_ACT * len(scheme.acts)) * max(how.state, how.force)
        draws = [np.full(len(q), LARGEST_DRAW)] * scheme.draws
        of_q, of_p = self.stepper(self.scene, absolute=True)(
            np.abs(q).astype(np.longdouble), np.abs(p).astype(np.longdouble),
            self.scene.system.magnitude(), draws, True,
        )  # fmt: skip
        if self.method.rebuilds_velocity:
            of_p = of_p + self.scene.m * of_q / abs(self.scene.step)
        return unit * of_q + SMALLEST, unit * of_p + SMALLEST


def _off(found: tuple[Any, Any], expected: tuple[Any, Any], allowed: tuple[Any, Any]) -> float:
    return float(max(np.max(np.abs(f - e) / a) for f, e, a in zip(found, expected, allowed, strict=True)))


@check("map", family="noise")
def noise_map(subject: Seeded) -> Finding | str:
    """One seed and two starts: the difference of the runs, which no noise reaches, is the scheme's map."""
    scene, scheme = subject.scene, THERMOSTATS[subject.method.scheme]
    if scheme.collides:
        return "a collision leaves nothing of the difference of two momenta"
    if not scene.system.is_linear or scene.n > FEW:
        return f"a linear scene of {FEW} particles at most is needed"
    size_p = np.sqrt(scene.m * scene.thermal)
    pushes = np.concatenate([np.diag(abs(scene.step) * size_p / scene.m), np.diag(size_p)])
    base = subject.run(scene, 2)
    force, none = scene.system.potential_force, np.zeros(scene.n, np.longdouble)
    rest, worst = force(none, none), 0.0
    for i, push in enumerate(pushes):
        dq, dp = (push, 0 * push) if i < scene.n else (0 * push, push)
        other = subject.run(replace(scene, q=scene.q + dq, p=scene.p + dp), 2)
        # the second step: the draw of a start that acts again is then in both
        d = [(a - b)[1:].astype(np.longdouble) for a, b in ((other.q, base.q), (other.p, base.p))]
        draws = [none] * scheme.draws
        ideal = subject.stepper(scene)(d[0][0], d[1][0], lambda q, p: force(q, p) - rest, draws)
        both = [subject.allowed(run.q[1], run.p[1]) for run in (base, other)]
        allowed = both[0][0] + both[1][0], both[0][1] + both[1][1]
        worst = max(worst, _off((d[0][1], d[1][1]), ideal, allowed))
    return Finding(worst, 1.0, "of what rounding allows", f"{2 * scene.n} pushes, roundings of both runs")


@check("size", family="noise")
def noise_size(subject: Seeded) -> Finding | str:
    """One seed at four times the temperature doubles the noise, and at four times all masses and stiffnesses
    doubles it in momenta and halves it in positions."""
    scene = subject.at_rest()
    if not scene.system.is_linear or np.any(scene.system.potential_force(scene.q, scene.p)):
        return "a linear scene with its rest in 0 is needed"
    assert scene.bath is not None
    # collisions come now and then; a factor of 2 is exact over any number of steps
    collides = THERMOSTATS[subject.method.scheme].collides
    steps = COLLIDED if collides else 1
    one = subject.run(scene, steps)
    hot = replace(scene, bath=Bath(temperature=4 * scene.bath.temperature, friction=scene.bath.friction))
    heavy = replace(scene.system.scaled(4.0), m=4 * scene.m)
    worst = 0.0
    allowed = [4 * steps * x for x in subject.allowed(one.q[0], one.p[0])]
    for other, of_q, of_p in ((subject.run(hot, steps), 2.0, 2.0), (subject.run(heavy, steps), 0.5, 2.0)):
        expected = of_q * one.q[-1], of_p * one.p[-1]
        worst = max(worst, _off((other.q[-1], other.p[-1]), expected, (allowed[0], allowed[1])))
    if not np.any(one.p[-1]):
        if collides:
            return f"no collision in {COLLIDED} steps"
        return Finding(np.inf, 1.0, "of what rounding allows", "there is no noise")
    return Finding(worst, 1.0, "of what rounding allows", "a factor of 2, of both runs")


class Script:
    """A generator that hands out numbers of a list, one for all particles at a time, and then 0."""

    def __init__(self, values: Any) -> None:
        self._left = list(values)

    def standard_normal(self, size: Any) -> Floats:
        """Numbers in the shape (steps, draws, particles), or of one draw in any other."""
        out = np.zeros(size)
        for row in out[0] if out.ndim == 3 else [out]:
            row[...] = self._left.pop(0) if self._left else 0.0
        return out


@check("script", family="noise")
def noise_matrix(subject: Seeded) -> Finding | str:
    """A scripted generator reads the noise itself: what each unit draw does in a step, to rounding."""
    scheme, scene = THERMOSTATS[subject.method.scheme], subject.scene
    if not subject.method.scripted or scheme.uniform or scheme.collides:
        return "it takes no generator of normal numbers"
    worst = 0.0
    for j in range(scheme.draws):
        unit = np.eye(scheme.draws)[j]
        simulation = engines.start(replace(scene, steps=1), engines.parse(subject.label), Script(unit))
        q, p = np.empty((2, 1, scene.n))
        simulation.advance(1, q, p)
        draws = [np.full(scene.n, np.longdouble(x)) for x in unit]
        start = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)
        ideal = subject.stepper(scene)(*start, scene.system.potential_force, draws)
        worst = max(worst, _off((q[0], p[0]), ideal, subject.allowed(scene.q, scene.p)))
    return Finding(worst, 1.0, "of what rounding allows", f"{scheme.draws} unit draws")


@check("seed", family="noise")
def seed_kept(subject: Seeded) -> Finding | str:
    """Two runs of one seed are equal bit for bit, and another seed is another run."""
    one, same, other = (subject.run(subject.scene, 20, subject.seed + i) for i in (0, 0, 1))
    differ = np.count_nonzero(np.any((one.q != same.q) | (one.p != same.p), axis=1))
    if not np.any(one.p[1:] != other.p[1:]):
        return Finding(21, 0.0, "frames", "another seed changes nothing: it is ignored")
    return Finding(differ, 0.0, "frames", "the same draws in the same order")


@check("seeds", family="noise")
def seeds_apart(subject: Seeded) -> Chance | str:
    """The draws of one seed say nothing of those of the next."""
    if THERMOSTATS[subject.method.scheme].collides:
        return "its draws come now and then"
    x, y = (
        reading(Case(trajectory=subject.run(subject.scene, 200, seed), scene=subject.scene)).draws
        for seed in (subject.seed, subject.seed + 1)
    )
    return Chance(chance.pairs(x, y), f"correlation {np.mean(x * y):+.2e} of {x.size} draws")


SEEDED = (noise_map, noise_size, noise_matrix, seed_kept, seeds_apart)
