"""Terms of a scene, and forces and energies made of them: pure functions of any width of float.

A term is a frozen class of parameter arrays.  Its formula is written once and serves double and
extended precision, one state and a whole trajectory alike.  To add a term: write its class here, put
it into `TERMS`, and name its key in the methods of the engines that serve it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np

from springcheck.model import Extended, Floats, Force, Integers, Reals, Scene, Term


def scatter(out: Reals, index: Integers, values: Reals) -> None:
    """Add values (..., s) to out (..., n) at index (s,), repeated indices included."""
    if len(index) == 1:
        out[..., index[0]] += values[..., 0]
    elif len(index) == out.shape[-1] and np.array_equal(index, np.arange(len(index))):
        out += values
    elif len(np.unique(index)) == len(index):
        out[..., index] += values
    else:
        where: Any = (..., index)
        np.add.at(out, where, values)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WallSpring:
    """Springs from particles i to fixed points: V = k/2 (q - at)**2.  k [M/T2], at [L]."""

    key: ClassVar[str] = "wall-spring"
    bodies: ClassVar[int] = 1
    i: Integers
    k: Floats
    at: Floats

    def energy(self, q: Reals) -> Reals:
        u = q[..., self.i] - self.at
        return np.asarray(0.5 * np.sum(self.k * u * u, axis=-1))

    def size(self, dq: Reals) -> Reals:
        u = dq[..., self.i]
        return np.asarray(0.5 * np.sum(np.abs(self.k) * u * u, axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        scatter(out, self.i, -self.k * (q[..., self.i] - self.at))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals) -> None:
        scatter(out, self.i, np.abs(self.k) * (np.abs(q[..., self.i]) + np.abs(self.at)))

    def add_stiffness(self, q: Reals, out: Reals) -> None:
        np.add.at(out, (self.i, self.i), self.k)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spring:
    """Springs between particles a and b: V = k/2 (q[b] - q[a] - rest)**2.  k [M/T2], rest [L]."""

    key: ClassVar[str] = "spring"
    bodies: ClassVar[int] = 2
    a: Integers
    b: Integers
    k: Floats
    rest: Floats

    def energy(self, q: Reals) -> Reals:
        u = q[..., self.b] - q[..., self.a] - self.rest
        return np.asarray(0.5 * np.sum(self.k * u * u, axis=-1))

    def size(self, dq: Reals) -> Reals:
        u = dq[..., self.b] - dq[..., self.a]
        return np.asarray(0.5 * np.sum(np.abs(self.k) * u * u, axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        tension = self.k * (q[..., self.b] - q[..., self.a] - self.rest)
        scatter(out, self.a, tension)
        scatter(out, self.b, -tension)

    def add_magnitude(self, q: Reals, p: Reals, out: Reals) -> None:
        size = np.abs(q[..., self.b]) + np.abs(q[..., self.a]) + np.abs(self.rest)
        scatter(out, self.a, np.abs(self.k) * size)
        scatter(out, self.b, np.abs(self.k) * size)

    def add_stiffness(self, q: Reals, out: Reals) -> None:
        np.add.at(out, (self.a, self.a), self.k)
        np.add.at(out, (self.b, self.b), self.k)
        np.add.at(out, (self.a, self.b), -self.k)
        np.add.at(out, (self.b, self.a), -self.k)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quartic:
    """Stiffening wells of particles i: V = b/4 (q - at)**4.  b [M/(L2 T2)], at [L]."""

    key: ClassVar[str] = "quartic"
    bodies: ClassVar[int] = 1
    i: Integers
    b: Floats
    at: Floats

    def energy(self, q: Reals) -> Reals:
        u = q[..., self.i] - self.at
        return np.asarray(0.25 * np.sum(self.b * (u * u) * (u * u), axis=-1))

    def size(self, dq: Reals) -> Reals:
        return np.zeros(dq.shape[:-1], dtype=dq.dtype)

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        u = q[..., self.i] - self.at
        scatter(out, self.i, -self.b * (u * u * u))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals) -> None:
        # a relative error of u counts threefold in u**3
        u = np.abs(q[..., self.i] - self.at)
        scatter(out, self.i, 3 * np.abs(self.b) * u * u * (np.abs(q[..., self.i]) + np.abs(self.at)))

    def add_stiffness(self, q: Reals, out: Reals) -> None:
        u = q[self.i] - self.at
        np.add.at(out, (self.i, self.i), 3 * self.b * u * u)


TERMS: tuple[type[Any], ...] = (WallSpring, Spring, Quartic)
LINEAR = frozenset({"wall-spring", "spring"})


def is_linear(scene: Scene) -> bool:
    """Whether every force of the scene is linear in q, so that steps are matrices."""
    return all(term.key in LINEAR for term in scene.terms)


def is_separate(scene: Scene) -> bool:
    """Whether no term joins two particles: n independent systems side by side."""
    return all(term.bodies == 1 for term in scene.terms)


def in_single(scene: Scene) -> Scene:
    """The scene with stiffnesses and rest lengths rounded to single precision; rest points stay."""

    def rounded(term: Any) -> Any:
        kept = {f.name: getattr(term, f.name) for f in fields(term) if f.name in ("k", "b", "rest")}
        return replace(
            term,
            **{
                name: value.astype(np.float32).astype(np.float64)
                for name, value in kept.items()
                if value.dtype == np.float64
            },
        )

    return replace(scene, terms=tuple(rounded(term) for term in scene.terms))


def force(terms: Iterable[Term]) -> Force:
    """The force of these terms as a function of (q, p), each (..., n) -> (..., n) [M L/T2]."""
    parts = tuple(terms)

    def total(q: Reals, p: Reals) -> Reals:
        out = np.zeros_like(q)
        for term in parts:
            term.add_force(q, p, out)
        return out

    return total


def magnitude(terms: Iterable[Term]) -> Force:
    """Like `force`, with every product and difference taken as a sum of absolute values.

    Rounding cannot exceed a few eps times this: the running error bound of Wilkinson.
    """
    parts = tuple(terms)

    def total(q: Reals, p: Reals) -> Reals:
        out = np.zeros_like(q)
        for term in parts:
            term.add_magnitude(q, p, out)
        return out

    return total


def stiffness(scene: Scene, q: Reals) -> Extended:
    """Second derivatives of the potential energy at q (n,) -> (n, n) [M/T2], extended precision."""
    out = np.zeros((scene.n, scene.n), dtype=np.longdouble)
    for term in scene.terms:
        term.add_stiffness(np.asarray(q, dtype=np.longdouble), out)
    return out


def kinetic_energy(scene: Scene, p: Reals) -> Reals:
    """Sum of p**2 / 2m of states p (..., n) -> (...) [M L2/T2]."""
    return np.asarray(np.sum(p * p / (2 * scene.m), axis=-1))


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
    parent = list(range(scene.n))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    held = np.zeros(scene.n, dtype=bool)
    for term in scene.terms:
        if isinstance(term, WallSpring):
            held[term.i[term.k != 0]] = True
    if np.all(held):
        return ()
    for term in scene.terms:
        if isinstance(term, Spring):
            for a, b in zip(term.a.tolist(), term.b.tolist(), strict=True):
                parent[root(a)] = root(b)
    roots = np.array([root(i) for i in range(scene.n)])
    loose = np.setdiff1d(roots, roots[held])
    return tuple(np.flatnonzero(roots == r) for r in loose)


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
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            wide = np.asarray(dq, np.longdouble), np.asarray(dp, np.longdouble)
            size = np.sqrt(_size(self.scene, self.groups, self.duration, *wide))
            return np.asarray(np.where(size == 0, 0, size / self.unit), dtype=np.float64)


def _size(scene: Scene, groups: tuple[Integers, ...], duration: float, dq: Reals, dp: Reals) -> Reals:
    total = kinetic_energy(scene, dp)
    for term in scene.terms:
        total = total + term.size(dq)
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
