"""From the tables of a scene file to a `Scene`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, TypeAlias

import msgspec
import numpy as np

from springcheck.errors import SceneError
from springcheck.physics import builders
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.bath import Bath
from springcheck.physics.fields import Kind
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import tables
from springcheck.physics.term import Term
from springcheck.physics.terms import Damping, OnDistances, Spring, WallSpring

Rows: TypeAlias = Iterator[tuple[type[Term], bool, tuple[float, ...]]]
"""For each row its term, whether it is fast, and its ends and columns."""


class MistakeError(ValueError):
    """A value of the right type that is invalid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
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

    def ends(self, where: str, row: Any) -> tuple[str, list[int]]:
        """The field of a row that gives its bodies, and the bodies, one or two.  MistakeError."""
        field = next(name for name in ("particle", "ends", "loops", "loop") if hasattr(row, name))
        given, n = getattr(row, field), len(self.axes)
        numbers = [end for end in (given if isinstance(given, tuple) else (given,)) if end != "wall"]
        field = f"{where}.{field}"
        for number in numbers:
            if not 0 <= number < n:
                bodies = {"inductor": "inductors", "chain": "masses"}.get(self.name, "particles")
                raise MistakeError(f"{field} = {number}: {bodies} here are numbered from 0 to {n - 1}")
        if not numbers:
            raise MistakeError(f"{field}: a {where.partition('[')[0]} between two walls moves nothing")
        if len(numbers) == 2 and numbers[0] == numbers[1]:
            raise MistakeError(f"{field} = {numbers}: the two ends are the same particle")
        if len(numbers) == 2 and getattr(row, "wall", None):
            raise MistakeError(f"{where}.wall is given, but no end of it is a wall")
        return field, numbers

    def along(self, where: str, row: Any, *origins: str) -> list[tuple[int, ...]]:
        """Coordinates of a row's bodies along its axis, or along each of theirs.

        Raises MistakeError where these differ, or where an origin other than 0 is given for several axes.
        """
        field, numbers = self.ends(where, row)
        axis, shared = getattr(row, "axis", None), [self.axes[number] for number in numbers]
        if axis is None and len({frozenset(axes) for axes in shared}) > 1:
            raise MistakeError(f"{field}: the two move along {' and '.join(shared)}; say along which axis")
        if any(axis not in axes for axes in shared if axis):
            raise MistakeError(f"{field}: axis = {axis!r}, along which it cannot move")
        found = [tuple(self.coordinates[i, x] for i in numbers) for x in (axis or shared[0])]
        for name in origins if len(found) > 1 else ():
            if value := getattr(row, name):
                raise MistakeError(
                    f"{where}.{name} = {value:g} along {len(found)} axes: a spring along several axes rests "
                    "in 0; give one row for each axis, with axis"
                )
        return found


FILE_PATHS = {
    "step": "time.step", "steps": "time.steps", "every": "record.every", "tolerance": "time.tolerance",
    "quantities": "record.quantities", "include": "methods.include",
}  # fmt: skip
"""Path in a scene file of each field of a scene, for messages."""


def scene(table: Any, *, name: str) -> Scene:
    """The scene of a `tables.scene_table`.  Raises MistakeError."""
    bodies = _bodies(table)
    kind: Kind = "circuit" if bodies.name == "inductor" else "particles"
    if table.kind not in (None, kind):
        raise MistakeError(
            f"kind = {table.kind!r}, but what moves is given by [[{bodies.name}]]: "
            "particles come as [[particle]] or [chain], circuits as [[inductor]]"
        )
    terms = (*bodies.terms, *_terms(table, bodies))
    try:
        bath = table.bath and table.bath.temperature != 0 and Bath(**msgspec.structs.asdict(table.bath))
        found = Scene(
            m=bodies.m, q=bodies.q, p=bodies.p, places=bodies.places, terms=terms, step=table.time.step,
            steps=table.time.steps, every=table.record.every, bath=bath or None, kind=kind,
            tolerance=table.time.tolerance, units=table.units or ("si" if kind == "circuit" else "reduced"),
            include=table.methods.include, quantities=table.record.quantities, name=name,
            title=table.title, source=table.source,
        )  # fmt: skip
        # temperature 0: friction without noise
        return builders.cold(found, table.bath.friction) if table.bath and not bath else found
    except SceneError as error:
        field, separator, rest = str(error).partition(" ")
        head, colon = field.removesuffix(":"), ":" if field.endswith(":") else ""
        raise MistakeError(f"{FILE_PATHS.get(head, head)}{colon}{separator}{rest}") from error


def _bodies(table: Any) -> Bodies:
    given = [name for name in ("particle", "inductor", "chain") if getattr(table, name)]
    if not given:
        raise MistakeError("nothing moves: a scene needs [[particle]], or [[inductor]], or [chain]")
    if len(given) > 1:
        raise MistakeError(f"[[{given[0]}]] and [[{given[1]}]] are both given; a scene has one kind of them")
    if table.chain:
        made = _chain(table.chain)
        return Bodies(m=made.m, q=made.q, p=made.p, name="chain", axes="x" * made.n, terms=made.terms)
    axes: list[str] = []
    states: list[tuple[float, float, float]] = []
    for j, row in enumerate(getattr(table, given[0])):
        m, *state = msgspec.structs.astuple(row)[:3]
        along = getattr(row, "axes", None) or "xyz"[: max(len(np.atleast_1d(x)) for x in state)]
        if len(set(along)) < len(along):
            raise MistakeError(f"particle[{j}].axes = {along!r}: each axis once")
        for i, (name, x) in enumerate(zip(("position", "momentum"), state, strict=True)):
            if isinstance(x, tuple) and len(x) != len(along):
                raise MistakeError(f"particle[{j}].{name}: one for each of {along} is needed, not {len(x)}")
            if not isinstance(x, tuple) and x and len(along) > 1:
                raise MistakeError(f"particle[{j}].{name} = {x:g}: a number for each of {along} is needed")
            state[i] = np.broadcast_to(x, len(along)).tolist()
        axes.append(along)
        states += [(m, *each) for each in zip(*state, strict=True)]
    m, q, p = np.array(states).T
    return Bodies(m=m, q=q, p=p, name=given[0], axes=axes)


def _chain(table: Any) -> Scene:
    """The scene of a [chain]; its time grid is irrelevant."""
    start = {name: getattr(table, name) for name in ("position", "momentum")}
    if table.wave and any(start.values()):
        raise MistakeError("chain: both chain.wave and the position or momentum of each mass are given")
    if not (table.wave or any(start.values())):
        raise MistakeError("chain: its start is needed: [[chain.wave]], or position and momentum")
    for name, values in start.items():
        if len(values) not in (0, table.masses):
            raise MistakeError(f"chain.{name}: {table.masses} are needed, not {len(values)}")
    for j, wave in enumerate(table.wave):
        if wave.mode > table.masses:
            highest = f"the highest of this chain is {table.masses}"
            raise MistakeError(f"chain.wave[{j}].mode = {wave.mode}: {highest}")
    waves = [(wave.mode, wave.amplitude) for wave in table.wave] or [(1, 0.0)]
    q, p = (values or 0.0 for values in start.values())
    try:
        return builders.chain(table.masses, table.mass, table.stiffness, waves=waves, q=q, p=p)
    except SceneError as error:
        raise MistakeError(f"chain: {error}") from error


def _terms(table: Any, bodies: Bodies) -> Iterator[Term]:
    """The rows of all tables, joined by their terms, fast or not."""
    readers: dict[str, Any] = {
        "spring": _spring,
        **{x.key: partial(_distance if issubclass(x, OnDistances) else _row, x) for x in tables.of_terms()},
        "capacitor": _circuit,
        "resistor": _circuit,
    }
    found: dict[tuple[type[Term], bool], list[tuple[float, ...]]] = {}
    for key, read in readers.items():
        for j, row in enumerate(getattr(table, tables.identifier(key))):
            for term, fast, values in read(bodies, key, j, row):
                found.setdefault((term, fast), []).append(values)
    for (term, fast), several in found.items():
        names = (*term.ends, *(column.field for column in term.columns))
        fields: Any = dict(zip(names, map(np.array, zip(*several, strict=True)), strict=True))
        yield term(**fields, **({"fast": True} if fast else {}))


def _spring(bodies: Bodies, key: str, j: int, row: Any) -> Rows:
    rest = row.rest
    for at in bodies.along(f"{key}[{j}]", row, "rest", "wall"):
        if len(at) == 1:
            rest = row.wall + row.rest if row.ends[0] == "wall" else row.wall - row.rest
        yield WallSpring if len(at) == 1 else Spring, row.fast, (*at, row.stiffness, rest)


def _distance(term: Any, bodies: Bodies, key: str, j: int, row: Any) -> Rows:
    """A row for each axis of the two particles, or of a particle and a fixed point."""
    where = f"{key}[{j}]"
    if bodies.name == "inductor":
        raise MistakeError(f"{where}: a {key} joins two particles; circuits have none")
    values, found = _values(term.columns[:-1], row), bodies.along(where, row)
    wall = row.wall if isinstance(row.wall, tuple) else (row.wall,) * (1 if row.wall else len(found))
    if len(wall) != len(found):
        raise MistakeError(f"{where}.wall: {len(found)} for its axes are needed, not {len(wall)}")
    for at, x in zip(found, wall, strict=True):
        yield (
            (term, False, (*at, *values, j))
            if len(at) == 2
            else (term.to_points, False, (*at, *values, x, j))
        )


def _row(term: Any, bodies: Bodies, key: str, j: int, row: Any) -> Rows:
    """A row of a term that is defined by its columns: its ends, and a number for each column."""
    single = len(term.ends) == 1
    origins = [tables.identifier(x.name) for x in term.columns if single and x.field == term.origin]
    found = bodies.along(f"{key}[{j}]", row, *origins)
    if len(found) > 1 and not single:
        raise MistakeError(f"{key}[{j}]: its law holds along a line; say which by axis")
    for at in found:
        yield term, False, (*at, *_values(term.columns, row))


def _values(columns: Any, row: Any) -> list[float]:
    return [float(getattr(row, tables.identifier(column.name))) for column in columns]


def _circuit(bodies: Bodies, key: str, j: int, row: Any) -> Rows:
    """A capacitor as a spring of stiffness 1/C, of one loop to 0, or between two; a resistor as friction."""
    if bodies.name != "inductor":
        raise MistakeError("capacitors and resistors belong to a circuit: give its loops as [[inductor]]")
    (at,) = bodies.along(f"{key}[{j}]", row)
    if key == "resistor":
        yield Damping, False, (*at, row.resistance)
    else:
        yield WallSpring if len(at) == 1 else Spring, False, (*at, 1 / row.capacitance, 0.0)
