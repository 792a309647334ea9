"""What follows from the terms of a scene: forces, stiffness, energies and sizes, as pure functions.

They take any width of float, and a trajectory as well as one state.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.arrays import Extended, Floats, Force, Integers, Reals
from springcheck.physics.scene import Scene, Term
from springcheck.physics.terms import LINEAR, Damping, Spring, WallSpring, apart, gather, particles, scatter


def acting(scene: Scene) -> dict[str, NDArray[np.bool_]]:
    """For each kind of term in the scene, on which particles it acts (n,)."""
    out: dict[str, NDArray[np.bool_]] = {}
    for term in scene.terms:
        for end in particles(term):
            out.setdefault(term.key, np.zeros(scene.n, dtype=bool))[end] = True
    return out


def part(scene: Scene, chosen: Integers) -> Scene:
    """These particles (s,) alone, renumbered, with the terms that act on nothing else."""
    number = np.full(scene.n, -1)
    number[chosen] = np.arange(len(chosen))

    def cut(term: Any) -> Any:
        here = np.all([number[end] >= 0 for end in particles(term)], axis=0)
        values = {f.name: getattr(term, f.name) for f in fields(term)}
        rows = {name: x[here] for name, x in values.items() if isinstance(x, np.ndarray)}
        ends = {name: number[row] for name, row in rows.items() if name in ("i", "a", "b") and _is_index(row)}
        return replace(term, **rows | ends)

    terms = tuple(cut(term) for term in scene.terms)
    return replace(
        scene,
        m=scene.m[chosen],
        q=scene.q[chosen],
        p=scene.p[chosen],
        terms=tuple(term for term in terms if len(particles(term)[0])),
    )


def _is_index(values: NDArray[Any]) -> bool:
    return bool(np.issubdtype(values.dtype, np.integer))


def is_linear(scene: Scene) -> bool:
    """Whether every force of the scene is linear in q and p, so that steps are matrices."""
    return all(term.key in LINEAR for term in scene.terms)


def rates(scene: Scene) -> Extended:
    """Rates at which friction alone would slow each particle down, c/m (n,) [1/T], extended precision."""
    out = np.zeros(scene.n, dtype=np.longdouble)
    for term in scene.terms:
        if isinstance(term, Damping):
            np.add.at(out, term.i, term.c / term.m.astype(np.longdouble))
    return out


def is_damped(scene: Scene) -> bool:
    """Whether any friction acts."""
    return bool(np.any(rates(scene) != 0))


MOST_JOINED = 256
"""Joined particles up to which normal modes are computed: their cost in extended precision grows with the
cube, 5 s here.  The modes of a uniform chain are known at any length."""


def has_modes(scene: Scene) -> bool:
    """Whether the motion falls apart into modes: linear, friction couples none of them, and they can be had.

    Friction does not couple modes where no term joins two particles, or where every particle is slowed
    down at the same rate (to a rounding of c/m).
    """
    if not is_linear(scene):
        return False
    if is_separate(scene):
        return True
    rate = rates(scene)
    alike = bool(np.ptp(rate) <= 2.0**-52 * np.max(rate))
    return alike and (scene.n <= MOST_JOINED or is_uniform_chain(scene))


def is_uniform_chain(scene: Scene) -> bool:
    """Whether equal masses stand in a row between two walls, neighbours joined by equal springs."""
    walls = [term for term in scene.terms if isinstance(term, WallSpring)]
    links = [term for term in scene.terms if isinstance(term, Spring)]
    if len(walls) != 1 or len(links) != 1 or scene.n < 2 or np.any(scene.m != scene.m[0]):
        return False
    wall, link = walls[0], links[0]
    row = np.arange(scene.n - 1)
    return bool(
        np.array_equal(wall.i, [0, scene.n - 1])
        and np.array_equal(link.a, row)
        and np.array_equal(link.b, row + 1)
        and np.all(wall.k == wall.k[0])
        and np.all(link.k == wall.k[0])
    )


def split(terms: Iterable[Term]) -> tuple[tuple[Term, ...], tuple[Term, ...]]:
    """The slow and the fast terms: fast are the springs that the scene marks so."""
    parts = tuple(terms)
    return (
        tuple(term for term in parts if not getattr(term, "fast", False)),
        tuple(term for term in parts if getattr(term, "fast", False)),
    )


def is_separate(scene: Scene) -> bool:
    """Whether no term joins two particles: n independent systems side by side."""
    return all(term.bodies == 1 for term in scene.terms)


def in_single(scene: Scene) -> Scene:
    """The scene with the parameters of its potential in single precision; walls stay in their place."""

    def rounded(term: Any) -> Any:
        names = {column.field for column in term.columns} or {"k", "rest"}
        kept = {f.name: getattr(term, f.name) for f in fields(term) if f.name in names}
        return replace(term, **{name: x.astype(np.float32).astype(np.float64) for name, x in kept.items()})

    with np.errstate(over="ignore", under="ignore"):
        return replace(scene, terms=tuple(rounded(term) for term in scene.terms))


def stiffened(scene: Scene, factor: float) -> Scene:
    """The scene with every force of its potential multiplied by a factor."""

    def scaled(term: Any) -> Any:
        found = {f.name: getattr(term, f.name) for f in fields(term) if f.name in ("k", "b", "depth")}
        # the b of a spring is the index of an end
        return replace(term, **{name: x * factor for name, x in found.items() if x.dtype == np.float64})

    return replace(scene, terms=tuple(scaled(term) for term in scene.terms))


def force(terms: Iterable[Term]) -> Force:
    """The force of these terms as a function of (q, p), each (..., n) -> (..., n) [M L/T2]."""
    parts = tuple(terms)

    def total(q: Reals, p: Reals) -> Reals:
        out = np.zeros_like(q)
        for term in parts:
            term.add_force(q, p, out)
        return out

    return total


def strongest(terms: Iterable[Term], q: Reals) -> Reals:
    """The largest |force| at q (..., n) -> (...) of any one spring, or of all on a particle [M L/T2]."""
    parts = tuple(terms)
    each = ((parts, q), *(((alone,), where) for alone, where in (apart(term, q) for term in parts)))
    sizes = [np.abs(force(some)(where, np.zeros_like(where))) for some, where in each]
    return np.asarray(np.max(np.concatenate(sizes, axis=-1), axis=-1))


def magnitude(terms: Iterable[Term], near: Reals | None = None) -> Force:
    """Like `force`, with every product and difference taken as a sum of absolute values.

    Rounding cannot exceed a few eps times this: the running error bound of Wilkinson.  It takes sizes
    of positions and momenta.  Laws that bend are evaluated at the states `near` (..., n), a step away at
    most, or where these are not given at the worst place within the sizes.
    """
    parts = tuple(terms)

    def total(q: Reals, p: Reals) -> Reals:
        out = np.zeros_like(q)
        for term in parts:
            term.add_magnitude(q, p, out, near)
        return out

    return total


def stiffness(scene: Scene, q: Reals) -> Extended:
    """Second derivatives of the potential energy at q (n,) -> (n, n) [M/T2], extended precision."""
    out = np.zeros((scene.n, scene.n), dtype=np.longdouble)
    wide = np.asarray(q, dtype=np.longdouble)
    for term in scene.terms:
        ends, k = particles(term), term.curvature(wide)
        for end in ends:
            np.add.at(out, (end, end), k)
        if len(ends) == 2:
            np.add.at(out, ends, -k)
            np.add.at(out, ends[::-1], -k)
    return out


def own_stiffness(scene: Scene, q: Reals) -> Extended:
    """Diagonal of `stiffness` (n,), all of it where nothing joins two particles."""
    out = np.zeros(scene.n, dtype=np.longdouble)
    wide = np.asarray(q, dtype=np.longdouble)
    for term in scene.terms:
        for end in particles(term):
            np.add.at(out, end, term.curvature(wide))
    return out


def steepness(scene: Scene, q: Reals) -> Reals:
    """Bound on the sum of |stiffness| in each particle's row, at states q (..., n) -> (..., n) [M/T2]."""
    out = np.zeros_like(q)
    for term in scene.terms:
        k = np.maximum(np.abs(term.curvature(q)), term.rigidity)
        for end in particles(term):
            scatter(out, end, np.broadcast_to(k * term.bodies, (*q.shape[:-1], len(end))))
    return out


def kinetic_energy(scene: Scene, p: Reals) -> Reals:
    """Sum of p**2 / 2m of states p (..., n) -> (...) [M L2/T2]."""
    # 2 m would overflow from half the largest number on
    return np.asarray(np.sum(0.5 * (p * p) / scene.m, axis=-1))


def energy(scene: Scene, q: Reals, p: Reals) -> Reals:
    """Total energy of states q, p (..., n) -> (...) [M L2/T2]."""
    total = kinetic_energy(scene, p)
    for term in scene.terms:
        total = total + term.energy(q)
    return np.asarray(total)


def rest_positions(scene: Scene) -> Floats | None:
    """Positions (n,) [L] at which every spring between particles has its rest length.

    The lowest particle of each connected group stands at 0.  None where springs in a ring disagree.
    """
    neighbours: dict[int, list[tuple[int, float]]] = {}
    for term in scene.terms:
        if isinstance(term, Spring):
            for a, b, rest in zip(term.a.tolist(), term.b.tolist(), term.rest.tolist(), strict=True):
                neighbours.setdefault(a, []).append((b, rest))
                neighbours.setdefault(b, []).append((a, -rest))
    found = np.zeros(scene.n)
    seen: set[int] = set()
    for root in sorted(neighbours):
        if root in seen:
            continue
        seen.add(root)
        front = [root]
        while front:
            a = front.pop()
            for b, rest in neighbours[a]:
                if b not in seen:
                    seen.add(b)
                    found[b] = found[a] + rest
                    front.append(b)
                elif found[b] != found[a] + rest and found[a] != found[b] - rest:
                    return None
    return found


def free_groups(scene: Scene) -> tuple[Integers, ...]:
    """Groups of particles joined to each other and held by nothing with a stiffness: they can drift."""
    held = np.zeros(scene.n, dtype=bool)
    for term in scene.terms:
        if term.bodies == 1:
            held[particles(term)[0][term.rigidity > 0]] = True
    if np.all(held):
        return ()
    lowest = _lowest_joined(scene)
    loose = np.setdiff1d(lowest, lowest[held])
    return tuple(np.flatnonzero(lowest == r) for r in loose)


def _lowest_joined(scene: Scene) -> Integers:
    """The lowest particle to which each is joined, through however many others (n,)."""
    lowest = np.arange(scene.n)
    # a bond without stiffness joins nothing
    bonds = [[end[term.rigidity > 0] for end in particles(term)] for term in scene.terms if term.bodies == 2]
    while True:
        before = lowest.copy()
        for a, b in bonds:
            low = np.minimum(lowest[a], lowest[b])
            for end in (a, b):
                np.minimum.at(lowest, lowest[end], low)
        # what a particle points to points further: every round halves the way
        while np.any(lowest[lowest] != lowest):
            lowest = lowest[lowest]
        if np.array_equal(lowest, before):
            return lowest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Norm:
    """The size of a difference between states, as the square root of an energy, in units of the start's.

    The sum of dp**2 / 2m and of |k| du**2 / 2 over the springs, u their change of length, divided by
    the kinetic plus the absolute potential energy of the start.  For one spring it is the
    distance in the phase plane in units of the amplitude.  A group of particles that nothing holds
    would have no size in position: there the kinetic energy counts that makes up the difference of its
    centre within the duration of the run.
    """

    scene: Scene
    groups: tuple[Integers, ...]
    duration: float
    unit: np.longdouble

    def __call__(self, dq: Reals, dp: Reals) -> Floats:
        """(..., n) and (..., n) -> (...).  At rest in equilibrium the unit is 0 and any error infinite."""
        size = self.size(dq, dp)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(np.where(size == 0, 0, size / self.unit), dtype=np.float64)

    def size(self, dq: Reals, dp: Reals) -> Extended:
        """The same, not divided by the unit: a root of an energy, (..., n) and (..., n) -> (...)."""
        with np.errstate(invalid="ignore", over="ignore"):
            wide = np.asarray(dq, np.longdouble), np.asarray(dp, np.longdouble)
            return np.asarray(np.sqrt(_size(self.scene, self.groups, self.duration, *wide)), np.longdouble)


def _size(scene: Scene, groups: tuple[Integers, ...], duration: float, dq: Reals, dp: Reals) -> Reals:
    total = kinetic_energy(scene, dp)
    for term in scene.terms:
        ends = particles(term)
        du = gather(dq, ends[-1]) - gather(dq, ends[0]) if len(ends) == 2 else gather(dq, ends[0])
        total = total + 0.5 * np.sum(term.rigidity * du * du, axis=-1)
    for group in groups:
        m = scene.m[group]
        centre = np.sum(m * dq[..., group], axis=-1) / np.sum(m)
        total = total + 0.5 * np.sum(m) * (centre / duration) ** 2
    return np.asarray(total)


def norm(scene: Scene) -> Norm:
    """The measure of errors of this scene (see `Norm`)."""
    groups = free_groups(scene)
    duration = abs(scene.step) * scene.steps
    q, p = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)
    unit = kinetic_energy(scene, p)
    for term in scene.terms:
        unit = unit + np.abs(term.energy(q))
    return Norm(scene=scene, groups=groups, duration=duration, unit=np.longdouble(np.sqrt(unit)))


def amplitudes(scene: Scene) -> tuple[Floats, Floats]:
    """How far each position and momentum could go (n,) if it had all of the energy of the start to itself.

    A particle that nothing holds is as far as it could get within the run.
    """
    unit = float(norm(scene).unit)
    k = np.zeros(scene.n)
    for term in scene.terms:
        for end in particles(term):
            np.add.at(k, end, np.maximum(np.abs(term.curvature(scene.q)), term.rigidity))
    held = k > 0
    duration = abs(scene.step) * scene.steps
    with np.errstate(over="ignore"):
        p = np.sqrt(2.0) * np.sqrt(scene.m) * unit
        q = np.where(held, np.sqrt(2 / np.where(held, k, 1)) * unit, p / scene.m * duration)
    return q, p
