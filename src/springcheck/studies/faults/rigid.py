"""What is wrong with engines that keep lengths: SHAKE and RATTLE of one dumbbell in a plane, written out, and
the rods of a triangle solved wrongly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.rods import Rods
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.faults.seeded import Make, stepping
from springcheck.studies.faults.steppers import State, Step, textbook

Solver: TypeAlias = Callable[[Reals, Reals, float, float], Reals]
"""(r, s, length, size) -> by which part of r the way s is brought back to the length."""


def quadratic(r: Reals, s: Reals, length: float, size: float) -> Reals:
    """The multiplier of one rod in closed form."""
    a, b, c = r @ r, r @ s, s @ s - length**2
    return np.asarray(-c / (b + np.sqrt(b * b - a * c)))


def iterated(rounds: int) -> Solver:
    """So many rounds of SHAKE's own iteration."""

    def solve(r: Reals, s: Reals, length: float, size: float) -> Reals:
        k = np.zeros(())
        for _ in range(rounds):
            now = s + k * r
            k = k + (length**2 - now @ now) / (2 * (r @ now))
        return np.asarray(k)

    return solve


def until(r: Reals, s: Reals, length: float, size: float) -> Reals:
    """The same until the length is right to a relative tolerance."""
    k = np.zeros(())
    for _ in range(99):
        now = s + k * r
        if abs(np.sqrt(now @ now) / length - 1) <= size:
            break
        # half of what is lacking: an iteration that creeps up to its tolerance
        k = k + (length**2 - now @ now) / (4 * (r @ now))
    return k


@dataclass(frozen=True, kw_only=True)
class Rattle:
    """One step of RATTLE for a dumbbell, each part of it open to a fault."""

    solve: Solver = quadratic
    way: Callable[[Reals, Reals, Reals], Reals] = lambda r, s, older: r
    """Along which way the ends are pushed: of those before and after the drift, and a step before."""
    ends: Callable[[Reals, Floats], tuple[Reals, Reals]] = lambda push, m: (-push / m[0], push / m[1])
    """By how much a push moves both ends."""
    impulse: float | None = 1.0
    """Part of the push that momenta get; None: as far as `size` says, it is too large."""
    across: Callable[[Reals, Reals], Reals | None] = lambda r, s: s
    """Along which way velocities are projected, of those before and after the drift."""
    reduced: Callable[[Floats], float] = lambda m: float(m[0] * m[1] / (m[0] + m[1]))
    longer: bool = False
    """Whether the length is too large by the part `size`."""

    def step(self, scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        """The step of a scene of one rod between two particles in the plane."""
        rods = scene.system.rods
        if rods is None:
            return textbook(scene, scheme)
        m, h = scene.m[[0, 2]], scene.step
        length = float(rods.length[0]) * (1 + size if self.longer else 1)
        part = 1 + size if self.impulse is None else self.impulse
        older = [scene.q[2:] - scene.q[:2]]

        def one(i: int, q: Floats, p: Floats) -> State:
            a, b, u, v = q[:2], q[2:], p[:2] / m[0], p[2:] / m[1]
            r, s = b - a, (b + h * v) - (a + h * u)
            way = self.way(r, s, older[0])
            older[0] = r
            push = self.reduced(m) * self.solve(way, s, length, size) * way
            da, db = self.ends(push, m)
            a, b, u, v = a + h * u + da, b + h * v + db, u + part * da / h, v + part * db / h
            along = self.across(r, b - a)
            if along is not None:
                push = -self.reduced(m) * ((v - u) @ along) / (along @ along) * along
                da, db = self.ends(push, m)
                u, v = u + da, v + db
            return np.concatenate([a, b]), np.concatenate([m[0] * u, m[1] * v])

        return one

    @property
    def make(self) -> Make:
        """As a fault makes it."""
        return stepping(self.step)


def restarted_halves(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """After a restart in the middle momenta of half a step before are taken for those of the step."""
    right = textbook(scene, scheme)

    def step(i: int, q: Floats, p: Floats) -> State:
        new, after = right(i, q, p)
        early = bool(scene.system.rods) and i == scene.steps // 2
        return new, scene.m * (new - q) / scene.step if early else after

    return step


def stiff(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """A stiff spring for the rod, with h w = 1 of its own."""
    rods = scene.system.rods
    if rods is None:
        return textbook(scene, scheme)
    k = 1 / float(rods.inverse_mass[0]) / scene.step**2
    free = scene.derived(terms=())

    def force(q: Reals, p: Reals) -> Reals:
        r = q[2:] - q[:2]
        size = np.sqrt(r @ r)
        pull = k * (size - float(rods.length[0])) / size * r
        return np.concatenate([pull, -pull])

    return textbook(free, scheme, force=force)


def leaking(push: Reals, m: Floats) -> tuple[Reals, Reals]:
    """Displacements of both ends in single precision, each rounded by itself."""
    single = push.astype(np.float32)
    return tuple(x.astype(np.float64) for x in (-single / np.float32(m[0]), single / np.float32(m[1])))  # type: ignore[return-value]


def every_other(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The rod holds at every second step alone."""
    right = textbook(scene, scheme)
    other = textbook(scene.derived(terms=()), scheme) if scene.system.rods else right
    return lambda i, q, p: (other if i % 2 else right)(i, q, p)


def late_halves(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Momenta of half a step later, as SHAKE has them before they are projected."""
    p = run.p.copy()
    if scene.system.rods:
        p[1:-1] = scene.m * np.diff(run.q, axis=0)[1:] / scene.step
    return replace(run, p=p)


class OneByOne(Rods):
    """Every rod is solved by itself, as if its ends had no other."""

    def __init__(self, m: Floats, places: Integers | None, terms: Sequence[Term]) -> None:
        super().__init__(m, places, terms)
        self.share = False


class Late(Rods):
    """Ends are pushed along the way after the drift."""

    def drifted(self, before: Reals, q: Reals, p: Reals, x: Any) -> tuple[Reals, Reals]:
        return super().drifted(q, q, p, x)


class Once(Rods):
    """One iteration of Newton's for all."""

    def multiplier(self, r: Reals, s: Reals) -> Reals:
        gap = (self.dot(s, s) - self.length**2) / 2
        return -self.solve(s, r, gap)


def solved(kind: type[Rods], masses: Callable[[Floats], Floats] = lambda m: m) -> Make:
    """RATTLE with rods of this kind, which take these masses of coordinates for the scene's."""

    def step(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        if not scene.system.rods:
            return textbook(scene, scheme)
        return textbook(scene, scheme, hold=kind(masses(scene.m), scene.places, scene.terms))

    return stepping(step)
