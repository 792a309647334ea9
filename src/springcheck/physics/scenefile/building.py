"""From the tables of a scene file to a `Scene`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import msgspec
import numpy as np

from springcheck.errors import SceneError
from springcheck.physics import builders
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.bath import Bath
from springcheck.physics.fields import Units
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import tables
from springcheck.physics.term import Column, Term
from springcheck.physics.terms import Damping, OnDistances, Spring, WallSpring


class MistakeError(ValueError):
    """A value of the right type that is invalid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bodies:
    """The moving bodies: m, q, p (n,) by coordinate, their name in the file, and the axes of each body."""

    m: Floats
    q: Floats
    p: Floats
    name: str
    axes: Sequence[str]
    terms: tuple[Term, ...] = ()

    @cached_property
    def coordinates(self) -> dict[tuple[int, str], int]:
        """The number of each coordinate, by its body and its axis."""
        every = [(i, x) for i, axes in enumerate(self.axes) for x in axes]
        return {coordinate: j for j, coordinate in enumerate(every)}

    @property
    def places(self) -> Integers | None:
        """Position of each coordinate, as in `Scene.places`; None where each body moves along x alone."""
        if set(self.axes) == {"x"}:
            return None
        return np.array([3 * i + "xyz".index(x) for i, x in self.coordinates])

    def number(self, value: int, field: str) -> int:
        """The number of a body in a field of the file.  MistakeError where there is no such body."""
        n = len(self.axes)
        if not 0 <= value < n:
            several = tables.BODIES[self.name].several
            raise MistakeError(f"{field} = {value}: {several} here are numbered from 0 to {n - 1}")
        return value

    def along(self, field: str, axis: str | None, *bodies: int) -> list[tuple[int, ...]]:
        """Coordinates of these bodies along an axis, or along each of their axes.  MistakeError."""
        shared = [self.axes[self.number(value, field)] for value in bodies]
        if axis is None and len({frozenset(axes) for axes in shared}) > 1:
            raise MistakeError(f"{field}: the two move along {' and '.join(shared)}; say along which axis")
        if any(axis not in axes for axes in shared if axis):
            raise MistakeError(f"{field}: axis = {axis!r}, along which it cannot move")
        return [tuple(self.coordinates[i, x] for i in bodies) for x in (axis or shared[0])]


FILE_PATHS = {
    "step": "time.step", "steps": "time.steps", "every": "record.every", "tolerance": "time.tolerance",
    "quantities": "record.quantities", "include": "methods.include",
}  # fmt: skip
"""Path in a scene file of each field of a scene, for messages."""


def scene(table: Any, *, name: str) -> Scene:
    """The scene of a `tables.scene_table`.  Raises MistakeError."""
    time = table.time
    if time.every is not None and table.record.every is not None:
        raise MistakeError("record.every and time.every are both given; keep record.every")
    bodies = _bodies(table)
    kind = tables.BODIES[bodies.name].kind
    if table.kind not in (None, kind):
        raise MistakeError(
            f"kind = {table.kind!r}, but what moves is given by [[{bodies.name}]]: "
            "particles come as [[particle]] or [chain], circuits as [[inductor]]"
        )
    units: Units = table.units or ("si" if kind == "circuit" else "reduced")
    terms = tuple(_terms(table, bodies))
    try:
        bath = table.bath and table.bath.temperature != 0 and Bath(**msgspec.structs.asdict(table.bath))
        found = Scene(
            m=bodies.m, q=bodies.q, p=bodies.p, places=bodies.places, terms=terms, step=time.step,
            steps=time.steps, every=table.record.every or time.every or 1,
            bath=bath or None, tolerance=time.tolerance, units=units,
            kind=kind, include=table.methods.include, quantities=table.record.quantities, name=name,
            title=table.title, source=table.source,
        )  # fmt: skip
        # temperature 0: friction without noise
        return builders.cold(found, table.bath.friction) if table.bath and not bath else found
    except SceneError as error:
        field, separator, rest = str(error).partition(" ")
        head, colon = field.removesuffix(":"), ":" if field.endswith(":") else ""
        raise MistakeError(f"{FILE_PATHS.get(head, head)}{colon}{separator}{rest}") from error


def _bodies(table: Any) -> _Bodies:
    given = [name for name in tables.BODIES if getattr(table, name)]
    if not given:
        raise MistakeError("nothing moves: a scene needs [[particle]], or [[inductor]], or [chain]")
    if len(given) > 1:
        raise MistakeError(f"[[{given[0]}]] and [[{given[1]}]] are both given; a scene has one kind of them")
    name = given[0]
    if name == "chain":
        made = _chain(table.chain)
        return _Bodies(m=made.m, q=made.q, p=made.p, name=name, axes="x" * made.n, terms=made.terms)
    columns = tables.BODIES[name].columns
    if name == "particle":
        return _particles(table.particle)
    m, q, p = (np.array([getattr(row, column) for row in getattr(table, name)]) for column in columns)
    return _Bodies(m=m, q=q, p=p, name=name, axes="x" * len(m))


def _particles(rows: Sequence[Any]) -> _Bodies:
    """Particles, each along its own axes."""
    axes: list[str] = []
    m: list[float] = []
    q: list[float] = []
    p: list[float] = []
    for j, row in enumerate(rows):
        given = {"position": row.position, "momentum": row.momentum}
        along = row.axes or "xyz"[: max(len(x) if isinstance(x, tuple) else 1 for x in given.values())]
        if len(set(along)) < len(along):
            raise MistakeError(f"particle[{j}].axes = {along!r}: each axis once")
        for (name, x), out in zip(given.items(), (q, p), strict=True):
            if isinstance(x, tuple) and len(x) != len(along):
                raise MistakeError(f"particle[{j}].{name}: one for each of {along} is needed, not {len(x)}")
            if not isinstance(x, tuple) and x and len(along) > 1:
                raise MistakeError(f"particle[{j}].{name} = {x:g}: a number for each of {along} is needed")
            out.extend(x if isinstance(x, tuple) else (x,) * len(along))
        axes.append(along)
        m += [row.mass] * len(along)
    return _Bodies(name="particle", axes=axes, m=np.array(m), q=np.array(q), p=np.array(p))


def _chain(table: Any) -> Scene:
    """The scene of a [chain]; its time grid is irrelevant."""
    n = table.masses
    if table.wave and (table.position or table.momentum):
        raise MistakeError("chain.wave is given beside the position or momentum of each mass; keep one")
    if not (table.wave or table.position or table.momentum):
        raise MistakeError("chain: its start is needed: [[chain.wave]], or position and momentum")
    for name in ("position", "momentum"):
        if len(getattr(table, name)) not in (0, n):
            raise MistakeError(f"chain.{name}: {n} are needed, not {len(getattr(table, name))}")
    for j, wave in enumerate(table.wave):
        if wave.mode > n:
            raise MistakeError(f"chain.wave[{j}].mode = {wave.mode}: the highest of this chain is {n}")
    waves = [(wave.mode, wave.amplitude) for wave in table.wave] or [(1, 0.0)]
    try:
        return builders.chain(
            n, table.mass, table.stiffness, waves=waves, q=table.position or 0.0, p=table.momentum or 0.0
        )
    except SceneError as error:
        raise MistakeError(f"chain: {error}") from error


def _terms(table: Any, bodies: _Bodies) -> Iterator[Term]:
    """Terms of the bodies, and of all other rows, joined by their kinds, fast or not."""
    yield from bodies.terms
    rows = itertools.chain(
        _springs(table.spring, bodies),
        *(
            (_distances if issubclass(x, OnDistances) else _by_columns)(
                x, getattr(table, tables.identifier(x.key)), bodies
            )
            for x in tables.of_terms()
        ),
        _circuit(table, bodies),
    )
    found: dict[tuple[type[Term], bool], list[tuple[float, ...]]] = {}
    for term, fast, row in rows:
        found.setdefault((term, fast), []).append(row)
    for (term, fast), several in found.items():
        names = (*term.ends, *(column.field for column in term.columns))
        fields: Any = dict(zip(names, map(np.array, zip(*several, strict=True)), strict=True))
        yield term(**fields, **({"fast": True} if fast else {}))


_Rows: TypeAlias = Iterator[tuple[type[Term], bool, tuple[float, ...]]]
"""For each row its term, whether it is fast, and its ends and columns."""


def _springs(springs: Sequence[Any], bodies: _Bodies) -> _Rows:
    for j, spring in enumerate(springs):
        numbers = _loose_ends(f"spring[{j}]", spring, bodies)
        rest = spring.rest
        if len(numbers) == 1:
            rest = spring.wall + rest if spring.ends[0] == "wall" else spring.wall - rest
        ends = bodies.along(f"spring[{j}].ends", spring.axis, *numbers)
        _one_axis(f"spring[{j}]", {"rest": spring.rest, "wall": spring.wall}, ends)
        for at in ends:
            yield WallSpring if len(at) == 1 else Spring, spring.fast, (*at, spring.stiffness, rest)


def _loose_ends(where: str, row: Any, bodies: _Bodies) -> list[int]:
    """The ends of a row that are no wall, one or two bodies.  MistakeError."""
    field = f"{where}.ends"
    numbers = [bodies.number(end, field) for end in row.ends if end != "wall"]
    if not numbers:
        raise MistakeError(f"{field}: a {where.partition('[')[0]} between two walls moves nothing")
    if len(numbers) == 2:
        _two_ends(numbers[0], numbers[1], field)
        if row.wall:
            raise MistakeError(f"{where}.wall is given, but no end of it is a wall")
    return numbers


def _distances(term: Any, rows: Sequence[Any], bodies: _Bodies) -> _Rows:
    """A row for each axis of the two particles, or of a particle and a fixed point."""
    for j, row in enumerate(rows):
        where = f"{term.key}[{j}]"
        if bodies.name not in ("particle", "chain"):
            raise MistakeError(f"{where}: a {term.key} joins particles")
        numbers = _loose_ends(where, row, bodies)
        values = [_value(term, column, j, row) for column in term.columns[:-1]]
        found = bodies.along(f"{where}.ends", None, *numbers)
        wall = row.wall if isinstance(row.wall, tuple) else (row.wall,) * (1 if row.wall else len(found))
        if len(wall) != len(found):
            raise MistakeError(f"{where}.wall: {len(found)} for its axes are needed, not {len(wall)}")
        for at, x in zip(found, wall, strict=True):
            if len(at) == 2:
                yield term, False, (*at, *values, j)
            else:
                yield term.to_points, False, (*at, *values, x, j)


def _one_axis(row: str, places: Mapping[str, float], ends: Sequence[tuple[int, ...]]) -> None:
    """MistakeError where a row along several axes has an origin other than 0, a single number."""
    for name, value in places.items():
        if value and len(ends) > 1:
            raise MistakeError(
                f"{row}.{name} = {value:g} along {len(ends)} axes: what is the same along each rests in 0; "
                "give one row for each axis, with axis"
            )


def _two_ends(one: int, other: int, field: str) -> None:
    if one == other:
        raise MistakeError(f"{field} = [{one}, {other}]: the two ends are the same particle")


def _circuit(table: Any, bodies: _Bodies) -> _Rows:
    """A capacitor as a spring of stiffness 1/C, of one loop to 0, or between two; a resistor as friction."""
    if (table.capacitor or table.resistor) and bodies.name != "inductor":
        raise MistakeError("capacitors and resistors belong to a circuit: give its loops as [[inductor]]")
    for j, capacitor in enumerate(table.capacitor):
        loops = [bodies.number(loop, f"capacitor[{j}].loops") for loop in capacitor.loops]
        if len(loops) == 2:
            _two_ends(loops[0], loops[1], f"capacitor[{j}].loops")
        yield WallSpring if len(loops) == 1 else Spring, False, (*loops, 1 / capacitor.capacitance, 0.0)
    for j, resistor in enumerate(table.resistor):
        yield Damping, False, (bodies.number(resistor.loop, f"resistor[{j}].loop"), resistor.resistance)


def _by_columns(term: Any, rows: Sequence[Any], bodies: _Bodies) -> _Rows:
    """Rows of a term: its ends, and a number for each column."""
    origin = next((column.name for column in term.columns if column.field == term.origin), "")
    for j, row in enumerate(rows):
        where, values = f"{term.key}[{j}]", [_value(term, column, j, row) for column in term.columns]
        if len(term.ends) == 1:
            found = bodies.along(f"{where}.particle", row.axis, row.particle)
            _one_axis(where, {origin: getattr(row, tables.identifier(origin))} if origin else {}, found)
        else:
            found = bodies.along(f"{where}.ends", row.axis, *row.ends)
            _two_ends(row.ends[0], row.ends[1], f"{where}.ends")
            if len(found) > 1:
                raise MistakeError(f"{where}: its law holds along a line; say which by axis")
        for at in found:
            yield term, False, (*at, *values)


def _value(term: Any, column: Column, j: int, row: Any) -> float:
    """Value of a column's field: as given, or the inverse of the given one."""
    given = getattr(row, tables.identifier(column.name))
    if not column.inverse:
        return float(given)
    inverse = getattr(row, column.field)
    if given is not None and inverse is not None:
        raise MistakeError(f"{term.key}[{j}]: {column.name} and its inverse {column.field} are both given")
    if inverse is not None:
        return float(inverse)
    value = column.default if given is None else given
    if value is None:
        raise MistakeError(f"{term.key}[{j}] lacks the field {column.name!r}")
    return float(1 / value)
