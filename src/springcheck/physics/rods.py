"""Rods: rigid distances between two particles, or between a particle and a fixed point, and their
constraints.

A rod is a row of a term for each axis of its particles.  A step without it is projected back to its length
along its direction before the step, and momenta to those that do not change lengths (SHAKE: Ryckaert,
Ciccotti & Berendsen, J. Comput. Phys. 23 (1977) 327; RATTLE: Andersen, ibid. 52 (1983) 24; in stages of a
splitting: Leimkuhler & Matthews, Proc. R. Soc. A 472 (2016) 20160138).  With s the vector between the ends
after the unconstrained step and r that before it, the multiplier k of one rod solves |s + k r| = length, a
quadratic; rods that share a particle are solved together, by Newton's method, to rounding.
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
"""Iterations of Newton's method, which converges quadratically: where more are needed there is no
solution."""

START_TOLERANCE = 2.0**-46
"""Largest error of lengths and velocities along rods at the start, relative to their summands: 64 roundings,
as of numbers written with all their digits."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rod(WithoutPotential):
    """Rods between particles: |q[b] - q[a]| = length [L], a row for each axis."""

    key: ClassVar[str] = "rod"
    formula: ClassVar[str] = "|q[b] - q[a]| = length"
    columns: ClassVar[tuple[Column, ...]] = (Column("length", "length", sign="positive"),)
    ends: ClassVar[tuple[str, ...]] = ("a", "b")
    is_by_axes: ClassVar[bool] = False
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
    is_by_axes: ClassVar[bool] = False
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
        rods: dict[Any, int] = {}
        number = [
            rods.setdefault((one, term.key, term.fast), len(rods))
            for term in self._terms
            for one in term.objects(places)
        ]
        self.ends = tuple(ends for (ends, _), *_ in rods)
        """The particles of each rod: two, or one joined to a fixed point."""
        self._axes = np.concatenate([places[term.particles[0]] % 3 for term in self._terms])
        self._order = np.argsort(number, kind="stable")
        self._rod = np.asarray(number, np.int64)[self._order]
        self._starts = np.flatnonzero(np.diff(self._rod, prepend=-1))
        of_row = np.concatenate([term.length for term in self._terms])[self._order]
        self.length: Floats = of_row[self._starts]
        """Length of each rod (c,) [L]."""
        wide = m.astype(np.longdouble)
        inverse = [sum(1 / wide[index] for index in term.particles) for term in self._terms]
        self.inverse_mass: Extended = np.concatenate(inverse)[self._order][self._starts]
        """Sum of 1/m over both ends (c,), the inverse of the reduced mass [1/M]."""
        taken = [index for term in self._terms for index in term.particles]
        self.share = len(np.unique(np.concatenate(taken))) < sum(map(len, taken))
        """Whether some particle has two rods."""
        self._at = np.concatenate([getattr(term, "at", np.zeros(len(term))) for term in self._terms])

    def __len__(self) -> int:
        """Number of rods."""
        return len(self.length)

    def named(self, j: int) -> str:
        """Name of a rod in messages."""
        several = "s" if len(self.ends[j]) > 1 else ""
        return f"the rod of particle{several} {' and '.join(map(str, self.ends[j]))}"

    def joints(self) -> Iterator[tuple[tuple[int, ...], float, Floats | None]]:
        """Each rod for a program: its particles, length [L], and the fixed point (x, y, z) of one end."""
        at, along = self.split(self._at), self.split(self._axes)
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
        """Dot products over the axes of each rod (..., s) -> (..., c)."""
        return np.asarray(np.add.reduceat(one * other, self._starts, axis=-1))

    def each(self, values: Reals) -> Reals:
        """The number of each rod (..., c), repeated for its axes (..., s)."""
        return np.take(values, self._rod, axis=-1)

    def spread(self, values: Reals, *, size: bool = False) -> Reals:
        """Effect on coordinates (..., n) of impulses that separate the ends of each rod by values (..., s);
        with `size` the sum of the absolute effects."""
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
    def _coupling(self) -> Floats:
        """Change of the vectors of all rows by a unit impulse along each (s, s) [1/M]."""
        unit = np.eye(len(self._rod))
        return np.asarray(self.apart(self.spread(unit) / self.m).T, np.float64)

    def _matrix(self, left: Reals, right: Reals) -> Floats:
        whole = np.asarray(left, np.float64)[..., :, None] * self._coupling * right[..., None, :]
        part = np.add.reduceat(np.asarray(whole, np.float64), self._starts, axis=-1)
        return np.asarray(np.add.reduceat(part, self._starts, axis=-2))

    def split(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Split an array with one number for each row of the rods (s,) into one array for each rod."""
        return np.split(values[self._order], self._starts[1:]) if len(values) else []

    def solve(self, left: Reals, right: Reals, wanted: Reals) -> Reals:
        """k (..., c) for which impulses k `right` (..., s) move the vectors along `left` as wanted (...,
        c)."""
        if not self.share:
            return np.asarray(wanted / (self.dot(left, right) * self.inverse_mass.astype(wanted.dtype)))
        matrix = self._matrix(left, right)
        found = np.zeros_like(wanted)
        # solved in double precision, and refined to the precision of the numbers by its residual
        for _ in range(3):
            moved = self.apart(self._push(found, right) / self.m.astype(wanted.dtype))
            lacks = np.asarray(wanted - self.dot(left, moved), np.float64)
            found = found + _where_regular(np.linalg.solve, matrix, lacks[..., None])[..., 0]
        return found

    def reach(self, chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The coordinates (n,) connected by rods to some of these (n,), these included."""
        while True:
            taken = self._rows("most_stretch", chosen.astype(np.float64))
            more = chosen | (self.spread(self.each(self.dot(taken, taken)), size=True) > 0)
            if np.array_equal(more, chosen):
                return chosen
            chosen = more

    # effect on a step

    def multiplier(self, r: Reals, s: Reals) -> Reals:
        """k (..., c) for which k r, momentum times time, restores the lengths of the vectors s (..., s).

        NaN where there is none, for a freely rotating rod from h w = 1 on.
        """
        length = self.length.astype(s.dtype)
        if not self.share:
            a, b, c = self.dot(r, r), self.dot(r, s), self.dot(s, s) - length * length
            root = np.sqrt(b * b - a * c)
            # of two solutions the rod within a quarter turn of its former direction
            k = np.where(b > 0, -c / (b + root), (root - b) / a)
            return np.asarray(k / self.inverse_mass.astype(s.dtype))
        k = np.zeros_like(self.dot(r, s))
        last, going = np.full(k.shape[:-1], np.inf), np.ones(k.shape[:-1], np.bool_)
        m = self.m.astype(s.dtype)
        # each state separately: one without a solution must not stop the others
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
        """Multipliers of the components of momenta p (..., n) that change lengths, at vectors r (..., s)."""
        return self.solve(r, r, self.dot(r, self.apart(p / self.m.astype(p.dtype))))

    def drifted(self, before: Reals, q: Reals, p: Reals, x: Any) -> tuple[Reals, Reals]:
        """A drift over the time x from `before` to q, with its momenta p, projected back to the lengths."""
        r = self.ways(before)
        push = self._push(self.multiplier(r, self.ways(q)), r)
        return q + push / self.m.astype(q.dtype), p + push / x

    def projected(self, q: Reals, p: Reals) -> Reals:
        """Momenta without the components that change a length: RATTLE's second half."""
        r = self.ways(q)
        return np.asarray(p - self._push(self._along(r, p), r))

    def sizes(
        self, before: Reals | None, q: Reals, p: Reals, x: Any, of: tuple[Reals, Reals],
        loose: tuple[float, float],
    ) -> tuple[Reals, Reals]:  # fmt: skip
        """Bound on the rounding of a stage with rods, from the bound `of` it without them.

        The stage leads from `before`, None where nothing moves, to q, with momenta p that are not projected
        yet.  An error of the vectors s is measured along s and corrected along r, which amplifies it by r/(r
        s).  In the momenta only its part across the rod remains.  `loose` are the tolerances of lengths
        and of their rates [1/T], in roundings.
        """
        of_q, of_p = of
        m, s, ones = self.m.astype(q.dtype), self.ways(q), np.ones(len(self))
        square = self.length.astype(q.dtype) ** 2
        around = self._most(of_q)
        if before is not None:
            r = self.ways(before)
            k = self._bound(s, r, self.dot(np.abs(s), around) + square * (ones + loose[0]))
            of_q = of_q + self.spread(np.abs(r) * self.each(k), size=True) / m
            across = np.abs(r - s * self.each(self.dot(r, s) / self.dot(s, s)))
            of_p = of_p + self.spread(across * self.each(k), size=True) / np.abs(x)
            around = self._most(of_q)
        along = np.abs(self._along(s, p))
        seen = self.sum_of_sizes(s, of_p / m) + square * ones * loose[1]
        held = np.abs(s) * self.each(self._bound(s, s, seen)) + around * self.each(along)
        return of_q, of_p + self.spread(held, size=True)

    def sum_of_sizes(self, r: Reals, size: Reals) -> Reals:
        """Bound on products of the vectors r (..., s) with changes of positions of these sizes (..., n)."""
        return self.dot(np.abs(r), self._rows("most_stretch", size))

    def spans(self, size: Reals) -> Reals:
        """Bound on the length by which changes of these sizes (..., n) move the vectors (..., c)."""
        most = self._rows("most_stretch", size)
        return np.asarray(np.sqrt(self.dot(most, most)))

    def magnitude(self, q: Reals) -> Reals:
        """Effect of one rounding of positions q (..., n) on each length, relative to it (..., c)."""
        return np.asarray(self.dot(np.abs(self.ways(q)), self._most(np.abs(q))) / self.length**2)

    def _most(self, size: Reals) -> Reals:
        """Bound on the vectors between positions of these sizes."""
        return np.asarray(self._rows("most_stretch", size) + np.abs(self._at)[self._order])

    def _bound(self, left: Reals, right: Reals, size: Reals) -> Reals:
        """Bound on |k| in `solve`, where the wanted amounts have these sizes."""
        if not self.share:
            return np.abs(self.solve(left, right, size))
        inverse = np.abs(_where_regular(np.linalg.inv, self._matrix(left, right)))
        found = (inverse @ size[..., None])[..., 0]
        return np.asarray(np.where(np.isnan(found), np.inf, found))

    # properties of states

    def strain(self, q: Reals) -> Reals:
        """Strain of each rod, its excess length over its length, at positions q (..., n) -> (..., c)."""
        r, length = self.ways(q), self.length.astype(q.dtype)
        size = np.sqrt(self.dot(r, r))
        return np.asarray((size - length) / length)

    @property
    def freedoms(self) -> int:
        """Degrees of freedom besides the rods; `check` excludes redundant ones."""
        return len(self.m) - len(self)

    def rates(self, q: Reals, p: Reals) -> Reals:
        """Absolute angular velocity of each rod at states (..., n) -> (..., c) [1/T]."""
        v, r = self.apart(p / self.m.astype(p.dtype)), self.ways(q)
        square = self.dot(r, r)
        along = self.each(self.dot(r, v) / square) * r
        return np.asarray(np.sqrt(self.dot(v - along, v - along) / square))

    def too_fast(self, q: Floats, p: Floats, h: float) -> str:
        """Why no multiplier satisfies the lengths in a force-free step of h from a state (n,), or ""."""
        turn = self.rates(q, p) * abs(h)
        if self.share or not np.any(turn >= 1):
            return ""
        j = int(np.argmax(turn))
        return (
            f"{self.named(j)} turns by h w = {turn[j]:.3g} in a drift, and from h w = 1 on no push along it "
            "keeps its length; take a shorter step"
        )

    def _redundant(self, r: Reals) -> str:
        """Why the multipliers of the rods are not unique at these vectors (s,), or ""."""

        def first(matrix: Floats) -> int:
            unit = np.sqrt(np.diag(matrix))
            # a column that depends linearly on those before it leaves a diagonal entry of 0 in R
            left = np.abs(np.diag(np.linalg.qr(matrix / np.outer(unit, unit), mode="r")))
            return int(np.argmax(np.append(left <= START_TOLERANCE * len(self), True)))

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

    def check(self, q: Floats, p: Floats, untrue: float = START_TOLERANCE) -> None:
        """SceneError unless every rod has its length at the start, and no velocity along it."""
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
        if self.share and (needless := self._redundant(r)):
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
