"""Rods: rigid distances between two particles, or between a particle and a fixed point, and how they hold.

A rod is a row of a term for each axis of its particles.  A step that is taken without it is brought back to
its length along where it lay before the step, and momenta to what moves its ends alike along it (SHAKE:
Ryckaert, Ciccotti & Berendsen, J. Comput. Phys. 23 (1977) 327; RATTLE: Andersen, ibid. 52 (1983) 24; in
stages of a splitting: Leimkuhler & Matthews, Proc. R. Soc. A 472 (2016) 20160138).  With s the way between
the ends after the step without the rod and r that before it, the multiplier k of one rod solves |s + k r| =
length, a quadratic; rods that share a particle are solved for together, by Newton's method, to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import SceneError
from springcheck.physics.arrays import Extended, Floats, Integers, Reals
from springcheck.physics.term import Column, OnParticles, Origin, Term, WithoutPotential

MOST_NEWTON = 60
"""Iterations of Newton's method, which converges quadratically: what needs more has no solution."""

UNTRUE = 2.0**-46
"""How far lengths and velocities along rods may be off at the start, relative to what they are made of: 64
roundings, as numbers have that are written with all of their digits."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rod(WithoutPotential):
    """Rods between particles: |q[b] - q[a]| = length [L], a row for each axis."""

    key: ClassVar[str] = "rod"
    formula: ClassVar[str] = "|q[b] - q[a]| = length"
    columns: ClassVar[tuple[Column, ...]] = (Column("length", "length", sign="positive"),)
    ends: ClassVar[tuple[str, ...]] = ("a", "b")
    kind: ClassVar[Origin] = "constraint"
    a: Integers
    b: Integers
    length: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class WallRod(WithoutPotential, OnParticles):
    """Rods from particles i to fixed points: |q - at| = length [L], a row for each axis."""

    key: ClassVar[str] = "wall-rod"
    formula: ClassVar[str] = "|q - at| = length"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("length", "length", sign="positive"),
        Column("wall", "at", 0.0, single=False),
    )
    kind: ClassVar[Origin] = "constraint"
    length: Floats


def _where_regular(work: Callable[..., Floats], matrix: Floats, *more: Floats) -> Floats:
    """Apply a function of numpy.linalg to matrices (..., c, c); NaN for singular ones."""
    try:
        return work(matrix, *more)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(matrix)[0] == 0
        return work(np.where(singular[..., None, None], np.nan, matrix), *more)


class Rods:
    """All rods of a scene: masses m (n,), places of coordinates as in `Scene`, and its terms."""

    def __init__(self, m: Floats, places: Integers | None, terms: Sequence[Term]) -> None:
        self.m = m
        self._terms: list[Any] = [term for term in terms if term.kind == "constraint"]
        self._places = places = 3 * np.arange(len(m)) if places is None else places
        met: dict[Any, int] = {}
        rods: dict[Any, int] = {}
        number, axes = [], []
        for term in self._terms:
            for ends in zip(*(index.tolist() for index in term.particles), strict=True):
                of = term.key, *(int(places[j]) // 3 for j in ends)
                row = *of, int(places[ends[0]]) % 3
                axes.append(row[-1])
                # of several rods between the same ends each has one row along an axis
                met[row] = met.get(row, 0) + 1
                number.append(rods.setdefault((of, met[row]), len(rods)))
        self.ends = tuple(of[1:] for of, _ in rods)
        """The particles of each rod: two, or one that is tied to a fixed point."""
        self._axes = np.asarray(axes, np.int64)
        self._order = np.argsort(number, kind="stable")
        self._rod = np.asarray(number, np.int64)[self._order]
        self._starts = np.flatnonzero(np.diff(self._rod, prepend=-1))
        of_row = np.concatenate([term.length for term in self._terms])[self._order]
        self.length: Floats = of_row[self._starts]
        """Length of each rod (c,) [L]."""
        wide = m.astype(np.longdouble)
        inverse = [sum(1 / wide[index] for index in term.particles) for term in self._terms]
        self.inverse_mass: Extended = np.concatenate(inverse)[self._order][self._starts]
        """1/m of both ends together (c,), the inverse of the reduced mass [1/M]."""
        taken = [index for term in self._terms for index in term.particles]
        self.share = len(np.unique(np.concatenate(taken))) < sum(map(len, taken))
        """Whether some particle has two rods."""
        self._at = [getattr(term, "at", np.zeros(len(term))) for term in self._terms]

    def __len__(self) -> int:
        """Number of rods."""
        return len(self.length)

    def named(self, j: int) -> str:
        """What a rod is called in messages."""
        several = "s" if len(self.ends[j]) > 1 else ""
        return f"the rod of particle{several} {' and '.join(map(str, self.ends[j]))}"

    def joints(self) -> Iterator[tuple[tuple[int, ...], float, Floats | None]]:
        """Each rod for a program: its particles, length [L], and the fixed point (x, y, z) of one end."""
        at = self.split(np.concatenate(self._at))
        along = self.split(self._axes)
        for j, (ends, length) in enumerate(zip(self.ends, self.length.tolist(), strict=True)):
            point = np.zeros(3)
            point[along[j]] = at[j]
            yield ends, length, point if len(ends) == 1 else None

    # between coordinates (..., n), rows (..., s) and rods (..., c)

    def _rows(self, name: str, q: Reals) -> Reals:
        rows = np.concatenate([getattr(term, name)(q) for term in self._terms], axis=-1)
        return np.take(rows, self._order, axis=-1)

    def ways(self, q: Reals) -> Reals:
        """Vectors from one end of each rod to the other, by axes, at positions q (..., n) -> (..., s) [L]."""
        return self._rows("elongation", q)

    def apart(self, change: Reals) -> Reals:
        """Change of these vectors by a change of positions, or of velocities (..., s)."""
        return self._rows("stretch", change)

    def dot(self, one: Reals, other: Reals) -> Reals:
        """Products over the axes of each rod (..., s) -> (..., c)."""
        return np.asarray(np.add.reduceat(one * other, self._starts, axis=-1))

    def each(self, values: Reals) -> Reals:
        """A number of each rod (..., c) for each of its axes (..., s)."""
        return np.take(values, self._rod, axis=-1)

    def spread(self, values: Reals, *, size: bool = False) -> Reals:
        """Effect on coordinates (..., n) of pushing the ends of each rod apart by values (..., s); the sum of
        the sizes of these effects, if `size`."""
        back = np.empty_like(values)
        back[..., self._order] = values
        out = np.zeros((*values.shape[:-1], len(self.m)), dtype=values.dtype)
        begin = 0
        for term in self._terms:
            mine = back[..., begin : begin + len(term)]
            begin += len(term)
            if size:
                term.scatter(mine, out)
            else:
                term.add_pull(-mine, out)
        return out

    @cached_property
    def _joined(self) -> Floats:
        """Change of the vectors of all rows by a unit push along each (s, s) [1/M]."""
        unit = np.eye(len(self._rod))
        return np.asarray(self.apart(self.spread(unit) / self.m).T, np.float64)

    def _matrix(self, left: Reals, right: Reals) -> Floats:
        whole = np.asarray(left, np.float64)[..., :, None] * self._joined * right[..., None, :]
        part = np.add.reduceat(np.asarray(whole, np.float64), self._starts, axis=-1)
        return np.asarray(np.add.reduceat(part, self._starts, axis=-2))

    def split(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Numbers of each row of its terms (s,), by rods."""
        return np.split(values[self._order], self._starts[1:]) if len(values) else []

    def solve(self, left: Reals, right: Reals, wanted: Reals) -> Reals:
        """k (..., c) for which pushes k `right` (..., s) move the ways by as much along `left` as wanted."""
        if not self.share:
            return np.asarray(wanted / (self.dot(left, right) * self.inverse_mass.astype(wanted.dtype)))
        matrix = self._matrix(left, right)
        found = np.zeros_like(wanted)
        # solved in double precision, and made as wide as the numbers by its residual
        for _ in range(3):
            moved = self.apart(self._push(found, right) / self.m.astype(wanted.dtype))
            lacks = np.asarray(wanted - self.dot(left, moved), np.float64)
            found = found + _where_regular(np.linalg.solve, matrix, lacks[..., None])[..., 0]
        return found

    def reach(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The coordinates (n,) that rods join to some of these (n,), they among them."""
        while True:
            taken = self._rows("most_stretch", chosen.astype(np.float64))
            more = chosen | (self.spread(self.each(self.dot(taken, taken)), size=True) > 0)
            if np.array_equal(more, chosen):
                return chosen
            chosen = more

    # what they do to a step

    def multiplier(self, r: Reals, s: Reals) -> Reals:
        """k (..., c) with which k r, momentum times time, brings the ways s (..., s) back to their lengths.

        NaN where none does, which for a rod that turns freely is from h w = 1 on.
        """
        length = self.length.astype(s.dtype)
        if not self.share:
            a, b, c = self.dot(r, r), self.dot(r, s), self.dot(s, s) - length * length
            root = np.sqrt(b * b - a * c)
            # the rod that lies within a quarter turn of where it lay
            k = np.where(b > 0, -c / (b + root), (root - b) / a)
            return np.asarray(k / self.inverse_mass.astype(s.dtype))
        k = np.zeros_like(self.dot(r, s))
        last, going = np.full(k.shape[:-1], np.inf), np.ones(k.shape[:-1], np.bool_)
        m = self.m.astype(s.dtype)
        # each state by itself: one without a solution must not stop the others
        for _ in range(MOST_NEWTON):
            now = s + self.apart(self._push(k, r) / m)
            gap = (self.dot(now, now) - length * length) / 2
            most = np.asarray(np.max(np.abs(gap) / (length * length), axis=-1, initial=0.0), np.float64)
            going &= most < last
            if not np.any(going):
                break
            k = np.where(going[..., None], k - self.solve(now, r, gap), k)
            last = np.where(going, most, last)
        solved = ~going & (last < np.sqrt(np.finfo(s.dtype).eps))
        return np.where(solved[..., None], k, np.nan)

    def _push(self, k: Reals, r: Reals) -> Reals:
        return self.spread(self.each(k) * r)

    def _along(self, r: Reals, p: Reals) -> Reals:
        """The multipliers of what changes lengths in momenta p (..., n), at ways r (..., s)."""
        return self.solve(r, r, self.dot(r, self.apart(p / self.m.astype(p.dtype))))

    def drifted(self, before: Reals, q: Reals, p: Reals, x: Any) -> tuple[Reals, Reals]:
        """A drift for the time x from `before` to q, with its momenta p, brought back to the lengths."""
        r = self.ways(before)
        push = self._push(self.multiplier(r, self.ways(q)), r)
        return q + push / self.m.astype(q.dtype), p + push / x

    def projected(self, q: Reals, p: Reals) -> Reals:
        """Momenta without what would change a length: RATTLE's second half."""
        r = self.ways(q)
        return np.asarray(p - self._push(self._along(r, p), r))

    def sizes(
        self, before: Reals | None, q: Reals, p: Reals, x: Any, of: tuple[Reals, Reals], loose: float
    ) -> tuple[Reals, Reals]:
        """What bounds the rounding of a stage after its rods have held it, `of` before they did.

        The stage leads from `before`, None where nothing moves, to q, with momenta p that are not projected
        yet.  An error of the ways s is seen along s, and taken back along r: r/(r s) times as much.  What
        that leaves of momenta is its part across the rod.  `loose` is the tolerance of lengths, in roundings.
        """
        of_q, of_p = of
        m, s, ones = self.m.astype(q.dtype), self.ways(q), np.ones(len(self))
        square = self.length.astype(q.dtype) ** 2
        around = self._most(of_q)
        if before is not None:
            r = self.ways(before)
            k = self._enlarged(s, r, self.dot(np.abs(s), around) + square * (ones + loose))
            of_q = of_q + self.spread(np.abs(r) * self.each(k), size=True) / m
            across = np.abs(r - s * self.each(self.dot(r, s) / self.dot(s, s)))
            of_p = of_p + self.spread(across * self.each(k), size=True) / np.abs(x)
            around = self._most(of_q)
        along = np.abs(self._along(s, p))
        seen = self.sum_of_sizes(s, of_p / m)
        held = np.abs(s) * self.each(self._enlarged(s, s, seen)) + around * self.each(along)
        return of_q, of_p + self.spread(held, size=True)

    def sum_of_sizes(self, r: Reals, size: Reals) -> Reals:
        """Bound of products of the vectors r (..., s) with changes of positions of these sizes (..., n)."""
        return self.dot(np.abs(r), self._rows("most_stretch", size))

    def spans(self, size: Reals) -> Reals:
        """Bound of the length by which changes of these sizes (..., n) move the vectors (..., c)."""
        most = self._rows("most_stretch", size)
        return np.asarray(np.sqrt(self.dot(most, most)))

    def magnitude(self, q: Reals) -> Reals:
        """Effect of one rounding of positions q (..., n) on each length, relative to it (..., c)."""
        return np.asarray(self.dot(np.abs(self.ways(q)), self._most(np.abs(q))) / self.length**2)

    def _most(self, size: Reals) -> Reals:
        """Bound of the vectors between positions of these sizes."""
        at = np.concatenate([np.abs(one) for one in self._at])[self._order]
        return np.asarray(self._rows("most_stretch", size) + at)

    def _enlarged(self, left: Reals, right: Reals, size: Reals) -> Reals:
        """Bound of |k| in `solve`, where what is wanted has these sizes."""
        if not self.share:
            return np.abs(self.solve(left, right, size))
        inverse = np.abs(_where_regular(np.linalg.inv, self._matrix(left, right)))
        found = (inverse @ size[..., None])[..., 0]
        return np.asarray(np.where(np.isnan(found), np.inf, found))

    # what is said of states

    def strain(self, q: Reals) -> Reals:
        """Strain of each rod, its excess length over its length, at positions q (..., n) -> (..., c)."""
        r, length = self.ways(q), self.length.astype(q.dtype)
        # the difference of squares by its factors: a length has lost half of what they tell
        size = np.sqrt(self.dot(r, r))
        return np.asarray((size - length) / length)

    @property
    def freedoms(self) -> int:
        """Degrees of freedom that they leave: `check` refuses one that the others make needless."""
        return len(self.m) - len(self)

    def rates(self, q: Reals, p: Reals) -> Reals:
        """Angular velocity of each rod, its sign left out, at states (..., n) -> (..., c) [1/T]."""
        v, r = self.apart(p / self.m.astype(p.dtype)), self.ways(q)
        square = self.dot(r, r)
        along = self.each(self.dot(r, v) / square) * r
        return np.asarray(np.sqrt(self.dot(v - along, v - along) / square))

    def too_fast(self, q: Floats, p: Floats, h: float) -> str:
        """Why no multiplier keeps the lengths in a step of h from a state (n,), or ""; forces left out."""
        turn = self.rates(q, p) * abs(h)
        if self.share or not np.any(turn >= 1):
            return ""
        j = int(np.argmax(turn))
        return (
            f"{self.named(j)} turns by h w = {turn[j]:.3g} in a drift, and from h w = 1 on no push along it "
            "keeps its length; take a shorter step"
        )

    def _needless(self, r: Reals) -> str:
        """Why the multipliers of the rods have no one solution at these ways (s,), or ""."""

        def first(matrix: Floats) -> int:
            unit = np.sqrt(np.diag(matrix))
            # a column that depends linearly on those before it leaves a diagonal entry of 0 in R
            left = np.abs(np.diag(np.linalg.qr(matrix / np.outer(unit, unit), mode="r")))
            return int(np.argmax(np.append(left <= UNTRUE * len(self), True)))

        if (j := first(self._matrix(r, r))) == len(self):
            return ""
        if first(Rods(np.ones_like(self.m), self._places, self._terms)._matrix(r, r)) < len(self):
            return (
                f"{self.named(j)}: at the start the rods before it keep its length too, and their "
                "multipliers have no one solution; leave it out"
            )
        mass = dict(zip((self._places // 3).tolist(), self.m.tolist(), strict=True))
        light = min(self.ends[j], key=mass.__getitem__)
        return (
            f"{self.named(j)}: particle {light}, of mass {mass[light]:g} beside {max(self.m):g}, is too "
            "light for pushes along rods on one line to be told apart; give it more mass"
        )

    def check(self, q: Floats, p: Floats, untrue: float = UNTRUE) -> None:
        """SceneError unless every rod has its length at the start, and nothing moves along it."""
        r, v = self.ways(q), self.apart(p / self.m)
        with np.errstate(all="ignore"):
            off, along = np.abs(self.strain(q)), np.abs(self.dot(r, v))
            size = self.sum_of_sizes(r, np.abs(p) / self.m)
        wrong = ~(off <= untrue * (1 + self.magnitude(q)))
        if np.any(wrong):
            j = int(np.argmax(wrong))
            raise SceneError(
                f"{self.named(j)}: its length is {float(self.length[j])!r}, and its ends are "
                f"{float(np.sqrt(self.dot(r, r))[j])!r} apart at the start; leave the length out to keep that"
            )
        if self.share and (needless := self._needless(r)):
            raise SceneError(needless)
        wrong = ~(along <= untrue * size)
        if np.any(wrong):
            j = int(np.argmax(wrong))
            rate = float(self.dot(r, v)[j] / self.length[j])
            raise SceneError(
                f"{self.named(j)}: its ends {'come apart' if rate > 0 else 'approach each other'} by "
                f"{abs(rate):.3g} a unit of time at the start; momenta that keep its length are "
                f"p = {np.asarray(self.projected(q, p)).tolist()}"
            )


def rods_of(m: Floats, places: Integers | None, terms: Sequence[Term]) -> Rods | None:
    """The rods among the terms of a scene, None where there are none."""
    return Rods(m, places, terms) if any(term.kind == "constraint" for term in terms) else None
