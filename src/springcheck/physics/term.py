"""A term of a scene: rows of parameters on particles, their law, and all operations on them.

A term is a frozen dataclass of arrays, one entry a row, derived from `OnParticles` or `OnPairs`.  It states
its law as four functions of the elongation u of its rows and of its parameters; all else (energy and force of
a whole state, growth, single precision, copies, parts of a scene) follows from them here.  A formula is
written once for every width of float, for one state and for a whole trajectory alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import SceneError
from springcheck.physics.arguments import of_kind
from springcheck.physics.arrays import Extended, Floats, Integers, Reals, is_masked

Where: TypeAlias = "slice | Integers"
Origin: TypeAlias = Literal["potential", "friction", "drive"]


class Column(NamedTuple):
    """A parameter of a term: its name in a scene file, the field that holds it, and its accepted values."""

    name: str
    field: str
    default: float | None = None
    sign: Literal["any", "positive", "nonnegative"] = "any"
    single: bool = True
    """Whether an engine with parameters in single precision stores this one so."""


class FrozenArrays:
    """A frozen dataclass with arrays: in another process the same fields, and arrays that stay read-only."""

    def __getstate__(self) -> dict[str, Any]:
        given: Any = self
        return {field.name: getattr(self, field.name) for field in fields(given)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
                self.__dict__[name] = value.view()


class Term(FrozenArrays):
    """Rows (s,) of parameters of one law.  Terms derive from `OnParticles` or `OnPairs`."""

    key: ClassVar[str]
    """The name of its table in a scene file."""
    formula: ClassVar[str]
    """The energy of a row in the names of its fields, for readers."""
    columns: ClassVar[tuple[Column, ...]]
    """Its parameters.  The first is the strength, to which energy and force are proportional."""
    ends: ClassVar[tuple[str, ...]]
    """The fields that hold the particles of each row: one, or two that the row joins."""
    origin: ClassVar[str] = ""
    """The field that is subtracted from the elongation, and is therefore no argument of the law."""
    is_linear: ClassVar[bool] = False
    """Whether the force is linear in positions and velocities, up to a constant."""
    is_by_axes: ClassVar[bool] = True
    """Whether the rows of an object along several axes may have each its own parameters."""
    kind: ClassVar[Origin] = "potential"
    """Origin of its force: a potential energy, the velocities, or the time."""
    fast: bool = False
    """Whether a method of multiple time steps takes these rows in its short step."""

    # functions of u (..., s) and of the parameters but the origin, in the order of the columns, (s,) each
    potential: ClassVar[Any]
    """Energy of each row (..., s) [M L2/T2], 0 at rest."""
    slope: ClassVar[Any]
    """First derivative of the energy by u: the restoring force (..., s) [M L/T2]."""
    second: ClassVar[Any]
    """Second derivative of the energy by u, (..., s) or, where it is constant, (s,) [M/T2]."""
    rounding: ClassVar[Any]
    """rounding(size, u, *parameters): the rounding of `slope` at u, in units of one rounding.

    Every product and difference in it is taken as a sum of absolute values; `size` is the sum of the
    absolute values of the two numbers whose difference is u.
    """

    def __post_init__(self) -> None:
        rows: int | None = None
        for name in self.ends:
            given = getattr(self, name)
            given = [given] if np.isscalar(given) else given
            object.__setattr__(self, name, frozen(given, np.int64, rows, f"{self.key}: {name}"))
            rows = len(getattr(self, name))
        for column in self.columns:
            values = frozen(getattr(self, column.field), np.float64, rows, f"{self.key}: {column.field}")
            object.__setattr__(self, column.field, values)
        of_kind(f"{self.key}: fast", self.fast, "bool")

    def check(self, n: int) -> None:
        """SceneError unless every parameter is finite and of its sign, and all ends are below n."""
        for name, index in zip(self.ends, self.particles, strict=True):
            bad = np.flatnonzero((index < 0) | (index >= n))
            if len(bad):
                raise SceneError(
                    f"{self.key}: {name}[{bad[0]}] = {index[bad[0]]}: particles are numbered 0 to {n - 1}"
                )
        if self.bodies == 2 and np.any(self.particles[0] == self.particles[1]):
            row = int(np.argmax(self.particles[0] == self.particles[1]))
            raise SceneError(f"{self.key}: row {row}: the two ends are the same particle")
        for column in self.columns:
            check_sign(getattr(self, column.field), column.sign, f"{self.key}: {column.field}")

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.particles[0])

    @property
    def bodies(self) -> int:
        """1 where a row acts on one particle, 2 where it joins two."""
        return len(self.ends)

    @property
    def particles(self) -> tuple[Integers, ...]:
        """The particles on which each row acts: (i,), or both ends (a, b), each (s,)."""
        return tuple(getattr(self, name) for name in self.ends)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Its numbers by the names of their fields, (s,) each: the ends of each row, then the columns."""
        return {name: getattr(self, name) for name in (*self.ends, *(c.field for c in self.columns))}

    def objects(self, places: Integers) -> list[tuple[tuple[int, ...], int]]:
        """The particles of each row, and which of several objects between them it belongs to: in space a
        spring or bond has a row for each axis; `places` as in `Scene`."""
        met: Counter[tuple[int, ...]] = Counter()
        found = []
        for row in zip(*(places[index].tolist() for index in self.particles), strict=True):
            met[row] += 1
            found.append((tuple(place // 3 for place in row), met[row]))
        return found

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Each row as Python's numbers: its ends, then its columns."""
        return zip(*(values.tolist() for values in self.arrays.values()), strict=True)

    @cached_property
    def parameters(self) -> tuple[Floats, ...]:
        """Arguments of the law's functions after u, each (s,)."""
        return tuple(getattr(self, c.field) for c in self.columns if c.field != self.origin)

    @cached_property
    def _wide(self) -> tuple[Extended, ...]:
        return tuple(x.astype(np.longdouble) for x in self.parameters)

    def law(self, name: str, u: Reals) -> Reals:
        """The function of this name at elongations u (..., s), in extended precision where u is: a product of
        two parameters would round to a double."""
        parameters = self._wide if np.asarray(u).dtype == np.longdouble else self.parameters
        return np.asarray(getattr(self, name)(u, *parameters))

    @cached_property
    def _places(self) -> tuple[tuple[Where, bool], ...]:
        """Index of each end in an array of all particles, and whether it contains some particle twice."""
        return tuple(_place(index) for index in self.particles)

    def stretch(self, q: Reals) -> Reals:
        """Change of each row's elongation for a displacement q (..., n) -> (..., s) [L]."""
        first, last = self._places[0][0], self._places[-1][0]
        return _taken(q, last) - _taken(q, first) if self.bodies == 2 else _taken(q, last)

    def most_stretch(self, size: Reals) -> Reals:
        """The largest |`stretch`| of displacements of these sizes (..., n), of any sign -> (..., s) [L]."""
        first, last = self._places[0][0], self._places[-1][0]
        return _taken(size, last) + _taken(size, first) if self.bodies == 2 else _taken(size, last)

    def elongation(self, q: Reals) -> Reals:
        """The coordinate u of each row at positions q (..., n) -> (..., s) [L]: 0 at rest."""
        u = self.stretch(q)
        return u - getattr(self, self.origin) if self.origin else u

    def scatter(self, values: Reals, out: Reals) -> None:
        """Add values (..., s) to every end's particle in out (..., n)."""
        for place in self._places:
            _scatter(np.add, out, place, values)

    def energies(self, q: Reals) -> Reals:
        """Potential energy of each row at positions q (..., n) -> (..., s) [M L2/T2], 0 at its own rest."""
        return self.law("potential", self.elongation(q))

    def energy(self, q: Reals) -> Reals:
        """Potential energy of states q (..., n) -> (...) [M L2/T2], 0 at the term's own rest."""
        return np.asarray(np.sum(self.energies(q), axis=-1))

    def pull(self, q: Reals) -> Reals:
        """Restoring force of each row at positions q (..., n) -> (..., s) [M L/T2]."""
        return self.law("slope", self.elongation(q))

    def add_force(self, q: Reals, v: Reals, out: Reals) -> None:
        """Add the force at positions q and velocities v, each (..., n), to out (..., n) [M L/T2]."""
        self.add_pull(self.pull(q), out)

    def add_pull(self, pull: Reals, out: Reals) -> None:
        """Add a force (..., s) [M L/T2] that shortens the elongation of each row to out (..., n)."""
        if self.bodies == 2:
            _scatter(np.add, out, self._places[0], pull)
        _scatter(np.subtract, out, self._places[-1], pull)

    def add_change(self, q: Reals, v: Reals, dq: Reals, dv: Reals, out: Reals) -> None:
        """Add to out (..., n) the linear change of the force at (q, v), without the part linear in v."""
        self.add_pull(self.curvature(q) * self.stretch(dq), out)

    def add_rounding(self, q: Reals, v: Reals, out: Reals, near: Reals | None, exact: bool) -> None:
        """Add to out (..., n) a bound on the rounding of add_force at states of sizes q, v."""
        self.scatter(self.pull_rounding(q, v, near, exact), out)

    def pull_rounding(self, q: Reals, v: Reals, near: Reals | None, exact: bool) -> Reals:
        """Bound on the rounding of each row's force (..., s) at states of sizes q, v (..., n), with the law
        evaluated near a state, or without one at the worst position within the sizes.

        With `exact` the force is evaluated at `near` itself: a law that is more sensitive to a rounding of
        its position than to that of its elongation may have a smaller bound then.
        """
        size = self.most_stretch(np.abs(q))
        if self.origin:
            size = size + np.abs(getattr(self, self.origin))
        u = -size if near is None else self.elongation(near)
        return np.asarray(np.abs(self.rounding(size, u, *self.parameters)))

    def curvature(self, q: Reals) -> Reals:
        """Second derivative of each row's energy by u, at q (..., n) -> (..., s) or (s,) [M/T2]."""
        return self.law("second", self.elongation(q))

    def elements(self, q: Reals) -> Iterator[tuple[Integers, Integers, Reals]]:
        """Rows, columns and values (..., s) that each pair of ends adds to the Hessian at q (..., n)."""
        k = np.broadcast_to(self.curvature(q), (*q.shape[:-1], len(self)))
        for one in self.particles:
            for other in self.particles:
                yield one, other, k if one is other else -k

    @cached_property
    def rigidity(self) -> Floats:
        """Absolute curvature of each row at rest (s,) [M/T2], the weight of errors of position."""
        zero = np.zeros(len(self))
        return np.asarray(np.abs(self.second(zero, *self.parameters)) + zero)

    def stiffness(self, q: Reals) -> Floats:
        """`rigidity`, or of a law without a rest that at the start q (n,) -> (s,) [M/T2]."""
        return self.rigidity

    @property
    def joins(self) -> NDArray[np.bool_]:
        """Which rows act on their ends at all (s,)."""
        # a law that is flat at its rest joins its ends too
        return np.asarray((self.rigidity > 0) | ((self.bodies == 2) & (self.parameters[0] != 0)))

    def scaled(self, factor: float | Floats) -> Self:
        """Copy with energy and force multiplied by a factor: one number, or one for each row (s,)."""
        strength = self.columns[0].field
        return self._changed(**{strength: getattr(self, strength) * factor})

    def shifted(self, length: float | Floats) -> Self:
        """Copy with the origin of every row's elongation moved, (s,) or alike [L]; friction has none."""
        return self._changed(**{self.origin: getattr(self, self.origin) + length}) if self.origin else self

    def in_single(self) -> Self:
        """A copy with parameters rounded as a single-precision engine keeps them; inf beyond its range."""
        names = [column.field for column in self.columns if column.single]
        with np.errstate(over="ignore", under="ignore"):
            kept = {name: getattr(self, name).astype(np.float32).astype(np.float64) for name in names}
        return self._changed(**kept)

    def tiled(self, copies: int, n: int) -> Self:
        """Copies of its rows, the j-th on particles shifted by n j."""
        shift = n * np.arange(copies)[:, None]
        return self._changed(
            **{name: (getattr(self, name) + shift).ravel() for name in self.ends},
            **{c.field: np.tile(getattr(self, c.field), copies) for c in self.columns},
        )

    def restricted(self, number: Integers) -> Self:
        """The rows on kept particles alone; number (n,) is the new number of each, -1 for one left out."""
        here = np.all([number[index] >= 0 for index in self.particles], axis=0)
        return self._changed(
            **{name: number[getattr(self, name)[here]] for name in self.ends},
            **{c.field: getattr(self, c.field)[here] for c in self.columns},
        )

    def joined(self, other: Self) -> Self:
        """The rows of both in one term, these first."""
        rows = other.arrays
        return self._changed(**{name: np.append(values, rows[name]) for name, values in self.arrays.items()})

    def _changed(self, **values: Any) -> Self:
        record: Any = self
        return replace(record, **values)  # type: ignore[no-any-return]


class LinearLaw:
    """The law of a linear spring, with the first parameter as its stiffness."""

    potential: ClassVar[Any] = staticmethod(lambda u, k, *_: 0.5 * (k * u * u))
    slope: ClassVar[Any] = staticmethod(lambda u, k, *_: k * u)
    second: ClassVar[Any] = staticmethod(lambda u, k, *_: k)
    rounding: ClassVar[Any] = staticmethod(lambda size, u, k, *_: k * size)


class WithoutPotential(Term):
    """A term without potential energy: friction, a driving force."""

    potential: ClassVar[Any] = staticmethod(lambda u, *_: np.zeros_like(u))
    slope: ClassVar[Any] = potential
    rounding: ClassVar[Any] = potential
    second: ClassVar[Any] = staticmethod(lambda u, strength, *_: np.zeros_like(strength))

    def scaled(self, factor: float | Floats) -> Self:
        """Itself, since it is no part of the potential."""
        return self


@dataclass(frozen=True, kw_only=True, eq=False)
class OnParticles(Term):
    """A term on single particles i (s,): u = q[i] - at."""

    ends: ClassVar[tuple[str, ...]] = ("i",)
    origin: ClassVar[str] = "at"
    i: Integers
    at: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class OnPairs(Term):
    """A term between particles a and b (s,): u = q[b] - q[a] - rest."""

    ends: ClassVar[tuple[str, ...]] = ("a", "b")
    origin: ClassVar[str] = "rest"
    a: Integers
    b: Integers
    rest: Floats


def frozen(values: Any, kind: type, rows: int | None, what: str) -> NDArray[Any]:
    """A read-only copy (s,) of int64 or float64; one number stands for all rows.  Raises SceneError."""
    base = values.base if isinstance(values, np.ndarray) else None
    is_mine = isinstance(base, np.ndarray) and not (base.flags.writeable or values.flags.writeable)
    if is_mine and values.dtype == kind and values.ndim == 1 and rows in (None, len(values)):
        return cast(NDArray[Any], values)
    try:
        found = np.asarray(values)
        known = "iu" if kind is np.int64 else "iuf"
        if is_masked(values) or (found.size and found.dtype.kind not in known):
            raise ValueError(found.dtype)
        out: NDArray[Any] = np.array(
            np.broadcast_to(found, (rows,)) if found.ndim == 0 and rows else found, dtype=kind
        )
    except (TypeError, ValueError, OverflowError):
        numbers = "whole numbers" if kind is np.int64 else "real numbers"
        raise SceneError(f"{what}: {numbers} are needed, in one row") from None
    if out.ndim != 1 or rows not in (None, len(out)):
        wanted = "one row of numbers" if rows is None else f"one number for each of {rows}"
        raise SceneError(f"{what} has the shape {out.shape}: {wanted} is needed")
    out.setflags(write=False)
    # of a view the flag cannot be set back
    return out.view()


def check_sign(values: Floats, sign: str, what: str) -> None:
    """SceneError, naming the first invalid value, unless all are finite and of this sign."""
    right, wanted = np.isfinite(values), "a finite number"
    if np.all(right) and sign == "positive":
        right, wanted = values > 0, "a number > 0"
    elif np.all(right) and sign == "nonnegative":
        right, wanted = values >= 0, "a number >= 0"
    if not np.all(right):
        row = int(np.argmin(right))
        raise SceneError(f"{what}[{row}] = {values[row]}: {wanted} is needed")


def _place(index: Integers) -> tuple[Where, bool]:
    n = len(index)
    if n and index[-1] - index[0] == n - 1 and np.all(np.diff(index) == 1):
        return slice(int(index[0]), int(index[-1]) + 1), False
    return index, len(np.unique(index)) < n


def _taken(q: Reals, where: Where) -> Reals:
    # take, because the memory order of q[..., index] makes the order of a later sum depend on the number of
    # states
    return q[..., where] if isinstance(where, slice) else np.take(q, where, axis=-1)


def _scatter(how: np.ufunc, out: Reals, place: tuple[Where, bool], values: Reals) -> None:
    where, is_repeated = place
    at: Any = (..., where)
    if is_repeated:
        how.at(out, at, values)
    else:
        out[at] = how(out[at], values)
