"""Faults of engines with constraints: SHAKE and RATTLE of one dumbbell in a plane, written out, and wrong
solutions for the rods of a triangle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from springcheck.physics.arrays import Floats, Integers, Reals
from springcheck.physics.rods import Rod, Rods, WallRod
from springcheck.physics.term import Term
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.faults.seeded import Case, Fault, braked, each, single
from springcheck.studies.faults.steppers import State, Step, textbook

Solver: TypeAlias = Callable[[Reals, Reals, float], Reals]
"""(r, s, length) -> the multiplier k with which s + k r has the length."""


def quadratic(r: Reals, s: Reals, length: float) -> Reals:
    """The multiplier of one rod in closed form."""
    a, b, c = r @ r, r @ s, s @ s - length**2
    return np.asarray(-c / (b + np.sqrt(b * b - a * c)))


def iterated(rounds: int, part: float = 1.0, enough: float = 0.0) -> Solver:
    """So many rounds of SHAKE's own iteration, each of which applies `part` of the correction, until the
    length is right to a relative tolerance."""

    def solve(r: Reals, s: Reals, length: float) -> Reals:
        k = np.zeros(())
        for _ in range(rounds):
            now = s + k * r
            if enough and abs(np.sqrt(now @ now) / length - 1) <= enough:
                break
            k = k + part * (length**2 - now @ now) / (2 * (r @ now))
        return np.asarray(k)

    return solve


@dataclass(frozen=True, kw_only=True)
class Rattle:
    """One step of RATTLE for a dumbbell, each part of which can be replaced by a fault."""

    solve: Solver = quadratic
    way: Callable[[Reals, Reals, Reals], Reals] = lambda r, s, older: r
    """Direction of the impulse, from the rod before and after the drift, and a step before."""
    ends: Callable[[Reals, Floats], tuple[Reals, Reals]] = lambda push, m: (-push / m[0], push / m[1])
    """Displacements of both ends by the impulse."""
    impulse: float = 1.0
    """Factor of the impulse that is applied to the momenta."""
    across: Callable[[Reals, Reals], Reals | None] = lambda r, s: s
    """Direction along which velocities are projected, from the rod before and after the drift."""
    reduced: Callable[[Floats], float] = lambda m: float(m[0] * m[1] / (m[0] + m[1]))
    longer: float = 0.0
    """Relative excess of the length."""

    def step(self, c: Case, i: int, q: Floats, p: Floats) -> State:
        """The step of a scene of one rod between two particles in the plane."""
        rods = c.scene.system.rods
        if rods is None:
            return c.right(i, q, p)
        m, h = c.scene.m[[0, 2]], c.scene.step
        length = float(rods.length[0]) * (1 + self.longer)
        a, b, u, v = q[:2], q[2:], p[:2] / m[0], p[2:] / m[1]
        r, s = b - a, (b + h * v) - (a + h * u)
        way = self.way(r, s, c.kept[-1] if c.kept else r)
        c.kept[:] = [r]
        push = self.reduced(m) * self.solve(way, s, length) * way
        da, db = self.ends(push, m)
        a, b = a + h * u + da, b + h * v + db
        u, v = u + self.impulse * da / h, v + self.impulse * db / h
        along = self.across(r, b - a)
        if along is not None:
            push = -self.reduced(m) * ((v - u) @ along) / (along @ along) * along
            da, db = self.ends(push, m)
            u, v = u + da, v + db
        return np.concatenate([a, b]), np.concatenate([m[0] * u, m[1] * v])


def leaking(push: Reals, m: Floats) -> tuple[Reals, Reals]:
    """Displacements of both ends in single precision, each rounded by itself."""
    a, b = (sign * push.astype(np.float32) / np.float32(one) for sign, one in zip((-1, 1), m, strict=True))
    return a.astype(np.float64), b.astype(np.float64)


def restarted_halves(c: Case, i: int, q: Floats, p: Floats) -> State:
    """A restart in the middle: momenta of half a step before are taken for those of the step."""
    new, after = c.right(i, q, p)
    early = bool(c.scene.system.rods) and i == c.scene.steps // 2
    return new, c.scene.m * (new - q) / c.scene.step if early else after


def stiff(c: Case) -> Step:
    """A stiff spring of h w = 1 in place of the rod."""
    rods = c.scene.system.rods
    if rods is None:
        return c.right
    k, length = 1 / float(rods.inverse_mass[0]) / c.scene.step**2, float(rods.length[0])

    def force(q: Reals, p: Reals) -> Reals:
        r = q[2:] - q[:2]
        size = np.sqrt(r @ r)
        pull = k * (size - length) / size * r
        return np.concatenate([pull, -pull])

    return textbook(c.scene.derived(terms=()), c.scheme, force=force)


def late_halves(c: Case, r: Trajectory) -> Trajectory:
    """Momenta half a step late, as SHAKE has them before projection."""
    p = r.p.copy()
    if c.scene.system.rods:
        p[1:-1] = c.scene.m * np.diff(r.q, axis=0)[1:] / c.scene.step
    return replace(r, p=p)


class OneByOne(Rods):
    """Rods that are solved independently, as if their ends had no other."""

    def __init__(self, m: Floats, places: Integers | None, terms: Sequence[Term]) -> None:
        super().__init__(m, places, terms)
        self.share = False


class Late(Rods):
    """Rods whose impulses act along their direction after the drift."""

    def drifted(self, before: Reals, q: Reals, p: Reals, x: Any) -> tuple[Reals, Reals]:
        return super().drifted(q, q, p, x)


class Once(Rods):
    """Rods that are solved by a single Newton iteration."""

    def multiplier(self, r: Reals, s: Reals) -> Reals:
        gap = (self.dot(s, s) - self.length**2) / 2
        return -self.solve(s, r, gap)


def alike(m: Floats) -> Floats:
    """The mean of the masses for each of them."""
    return np.full_like(m, np.mean(m))


def solved(
    c: Case, kind: type[Rods] = Rods, *, masses: Callable[[Floats], Floats] = lambda m: m, longer: float = 0.0
) -> Rods | None:
    """Rods of this class, with other masses of coordinates and other lengths than the scene's."""
    rods = [term for term in c.scene.terms if isinstance(term, Rod | WallRod)]
    terms = [replace(one, length=one.length * (1 + longer)) for one in rods]
    return kind(masses(c.scene.m), c.scene.places, terms) if terms else None


def rattled(c: Case, kind: type[Rods] = Rods, **other: Any) -> Step:
    """RATTLE with other rods."""
    return textbook(c.scene, c.scheme, hold=solved(c, kind, **other))


_LENGTH, _ALONG, _TURNED = (
    ("step-defect", *by) for by in (("rod-length",), ("rod-velocity",), ("angular-momentum", "turn"))
)

RIGID = each(
    Fault("rod-after-drift", "SHAKE along the rod as it lies after the drift, not before", _TURNED,
          step=Rattle(way=lambda r, s, older: s).step),
    Fault("rod-a-step-late", "SHAKE along the rod as it lay a step before", _TURNED,
          step=Rattle(way=lambda r, s, older: older).step),
    Fault("rod-in-single", "the rod's direction is kept in single precision",
          ("step-defect", "angular-momentum"), step=Rattle(way=lambda r, s, older: single(r)).step),
    Fault("rod-one-iteration", "one iteration of SHAKE instead of a solution",
          step=Rattle(solve=iterated(1)).step),
    Fault("rod-one-too-few", "two iterations of SHAKE, one too few", step=Rattle(solve=iterated(2)).step),
    # half of what is lacking in each: an iteration that creeps up to its tolerance
    Fault("rod-tolerance", "SHAKE ends at a tolerance that it does not declare",
          step=lambda c, i, q, p: Rattle(solve=iterated(99, 0.5, c.x)).step(c, i, q, p), size=1e-9),
    Fault("rod-not-projected", "velocities along the rod are left as SHAKE leaves them", _ALONG,
          step=Rattle(across=lambda r, s: None).step),
    Fault("rod-projected-early", "velocities are projected along the rod as it lay before the drift", _ALONG,
          step=Rattle(across=lambda r, s: r).step),
    Fault("rod-no-impulse", "SHAKE moves the ends and leaves their velocities", _TURNED,
          step=Rattle(impulse=0.0).step),
    Fault("rod-impulse", "the impulse of SHAKE is too large", _TURNED,
          step=lambda c, i, q, p: Rattle(impulse=1 + c.x).step(c, i, q, p), size=1e-10),
    Fault("rod-reduced-mass", "the multiplier has the mean of the masses for the reduced one",
          step=Rattle(reduced=lambda m: float(np.mean(m))).step),
    Fault("rod-masses-ignored", "SHAKE moves both ends by as much, whatever their masses",
          ("step-defect", "momentum", "angular-momentum"),
          step=Rattle(ends=lambda push, m: (-push, push), reduced=lambda m: 0.5).step),
    Fault("rod-one-end", "the rod pulls at one end alone", ("step-defect", "momentum"),
          step=Rattle(ends=lambda push, m: (0 * push, push), reduced=lambda m: 1.0).step),
    Fault("rod-leak", "what the rod does to its ends is rounded to single precision, each by itself",
          ("step-defect", "momentum", "rod-length"), step=Rattle(ends=leaking).step),
    Fault("rod-length", "the rod is too long", (*_LENGTH, "turn"),
          step=lambda c, i, q, p: Rattle(longer=c.x).step(c, i, q, p), size=1e-6),
    Fault("rod-as-spring", "a stiff spring for a rod", (*_LENGTH, "rod-velocity"), textbook=stiff),
    Fault("rod-every-other", "the rod holds at every second step alone", (*_LENGTH, "turn"),
          step=lambda c, i, q, p: (c.alone if i % 2 and c.scene.system.rods else c.right)(i, q, p)),
    Fault("rod-half-steps", "momenta are those of SHAKE half a step later", _ALONG, reports=late_halves),
    Fault("rod-restart", "a restart in the middle takes momenta of half a step before for those of the step",
          _ALONG, step=restarted_halves),
    Fault("triangle-one-by-one", "each rod of a triangle is solved by itself, as if it had no company",
          (*_LENGTH, "rod-velocity"), textbook=lambda c: rattled(c, OneByOne), scene="triangle"),
    Fault("triangle-one-iteration", "one iteration of Newton's for the rods of a triangle",
          textbook=lambda c: rattled(c, Once), scene="triangle"),
    Fault("triangle-masses-alike", "the rods of a triangle take its masses for equal", _ALONG,
          textbook=lambda c: rattled(c, masses=alike), scene="triangle"),
    Fault("triangle-friction", "momenta of a turning triangle lose a fraction at every step",
          ("step-defect", "turn", "angular-momentum"), after=braked, size=1e-10, scene="triangle"),
    Fault("rod-friction", "momenta of a turning rod lose a fraction at every step",
          ("step-defect", "turn", "angular-momentum"), after=braked, size=1e-10),
    caught_by=_LENGTH, scene="dumbbell",
)  # fmt: skip
