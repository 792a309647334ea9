"""From the tables of a scene file to a `Scene`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.errors import SceneError
from springcheck.physics import builders
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene, Units
from springcheck.physics.scenefile import tables
from springcheck.physics.terms import Column, Damping, Spring, Term, WallSpring


class MistakeError(ValueError):
    """A value of the right type that makes no sense."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Bodies:
    """What moves: m, q, p (n,), and what it is called in the file."""

    m: Floats
    q: Floats
    p: Floats
    name: str
    terms: tuple[Term, ...] = ()

    def number(self, value: int, field: str) -> int:
        """The number of a body, as a field of the file gives it.  MistakeError where there is none."""
        n = len(self.m)
        if not 0 <= value < n:
            several = tables.BODIES[self.name].several
            raise MistakeError(f"{field} = {value}: there are {n} {several}, numbered 0 to {n - 1}")
        return value


PLACES = {
    "step": "time.step",
    "steps": "time.steps",
    "every": "record.every",
    "tolerance": "time.tolerance",
    "quantities": "record.quantities",
    "include": "methods.include",
}
"""Where a field of a scene stands in its file, for messages."""


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
            "particles come as [[particle]] or [chain], rotors as [[rotor]], circuits as [[inductor]]"
        )
    units: Units = table.units or ("si" if kind == "circuit" else "reduced")
    terms = tuple(_terms(table, bodies))
    try:
        return Scene(
            name=name,
            title=table.title,
            source=table.source,
            units=units,
            kind=kind,
            m=bodies.m,
            q=bodies.q,
            p=bodies.p,
            terms=terms,
            step=time.step,
            steps=time.steps,
            every=table.record.every or time.every or 1,
            tolerance=time.tolerance,
            include=table.methods.include,
            quantities=table.record.quantities,
        )
    except SceneError as error:
        field, separator, rest = str(error).partition(" ")
        head, colon = field.removesuffix(":"), ":" if field.endswith(":") else ""
        raise MistakeError(f"{PLACES.get(head, head)}{colon}{separator}{rest}") from error


def _bodies(table: Any) -> _Bodies:
    given = [name for name in tables.BODIES if getattr(table, name)]
    if not given:
        raise MistakeError(
            "nothing moves: a scene needs [[particle]], or [[rotor]], or [[inductor]], or [chain]"
        )
    if len(given) > 1:
        raise MistakeError(f"[[{given[0]}]] and [[{given[1]}]] are both given; a scene has one kind of them")
    name = given[0]
    if name == "chain":
        made = _chain(table.chain)
        return _Bodies(m=made.m, q=made.q, p=made.p, name=name, terms=made.terms)
    columns = tables.BODIES[name].columns
    m, q, p = (np.array([getattr(row, column) for row in getattr(table, name)]) for column in columns)
    return _Bodies(m=m, q=q, p=p, name=name)


def _chain(table: Any) -> Scene:
    """The chain of a [chain]; its time grid is of no account."""
    n = table.masses
    if table.wave and (table.position or table.momentum):
        raise MistakeError("chain.wave is given beside the position or momentum of each mass; keep one")
    if not (table.wave or table.position or table.momentum):
        raise MistakeError("chain: its start is needed: [[chain.wave]], or position and momentum")
    for name in ("position", "momentum"):
        if len(getattr(table, name)) not in (0, n):
            raise MistakeError(f"chain.{name}: {len(getattr(table, name))} numbers for {n} masses")
    for j, wave in enumerate(table.wave):
        if wave.mode > n:
            raise MistakeError(f"chain.wave[{j}].mode = {wave.mode}: a chain of {n} masses has {n} modes")
    waves = [(wave.mode, wave.amplitude) for wave in table.wave] or [(1, 0.0)]
    try:
        return builders.chain(
            n, table.mass, table.stiffness, waves=waves, q=table.position or 0.0, p=table.momentum or 0.0
        )
    except SceneError as error:
        raise MistakeError(f"chain: {error}") from error


def _terms(table: Any, bodies: _Bodies) -> Iterator[Term]:
    yield from bodies.terms
    yield from _springs(table.spring, bodies)
    yield from _capacitors(table, bodies)
    for key, (term, _) in tables.of_terms().items():
        yield from _by_columns(term, getattr(table, tables.identifier(key)), bodies)
    yield from _by_columns(Damping, table.damping, bodies)
    loops = [bodies.number(row.loop, f"resistor[{j}].loop") for j, row in enumerate(table.resistor)]
    if loops:
        yield Damping(i=np.array(loops), c=np.array([row.resistance for row in table.resistor]))


def _springs(springs: Sequence[Any], bodies: _Bodies) -> Iterator[Term]:
    rows: dict[tuple[type[Term], bool], list[tuple[float, ...]]] = {}
    for j, spring in enumerate(springs):
        field = f"spring[{j}].ends"
        for end in spring.ends:
            if end != "wall":
                bodies.number(end, field)
        match spring.ends:
            case ("wall", "wall"):
                raise MistakeError(f"{field}: a spring between two walls moves nothing")
            case ("wall", int(particle)):
                row: tuple[float, ...] = (particle, spring.stiffness, spring.wall + spring.rest)
            case (int(particle), "wall"):
                row = (particle, spring.stiffness, spring.wall - spring.rest)
            case (int(one), int(other)):
                _two_ends(one, other, field)
                if spring.wall:
                    raise MistakeError(f"spring[{j}].wall is given, but no end of it is a wall")
                row = (one, other, spring.stiffness, spring.rest)
        rows.setdefault((WallSpring if len(row) == 3 else Spring, spring.fast), []).append(row)
    yield from _of_rows(rows)


def _of_rows(rows: Mapping[tuple[type[Term], bool], Sequence[tuple[float, ...]]]) -> Iterator[Term]:
    """Terms, fast or not, of rows of their ends and columns."""
    for (term, fast), several in rows.items():
        names = (*term.ends, *(column.field for column in term.columns))
        fields: Any = dict(zip(names, map(np.array, zip(*several, strict=True)), strict=True))
        yield term(**fields, **({"fast": True} if fast else {}))


def _two_ends(one: int, other: int, field: str) -> None:
    if one == other:
        raise MistakeError(f"{field} = [{one}, {other}]: the two ends are the same particle")


def _capacitors(table: Any, bodies: _Bodies) -> Iterator[Term]:
    """A capacitor is a spring of stiffness 1/C: in one loop towards 0, between two towards each other."""
    if (table.capacitor or table.resistor) and bodies.name != "inductor":
        raise MistakeError("capacitors and resistors belong to a circuit: give its loops as [[inductor]]")
    rows: dict[tuple[type[Term], bool], list[tuple[float, ...]]] = {}
    for j, capacitor in enumerate(table.capacitor):
        loops = [bodies.number(loop, f"capacitor[{j}].loops") for loop in capacitor.loops]
        if len(loops) == 2:
            _two_ends(loops[0], loops[1], f"capacitor[{j}].loops")
        kind = WallSpring if len(loops) == 1 else Spring
        rows.setdefault((kind, False), []).append((*loops, 1 / capacitor.capacitance, 0.0))
    yield from _of_rows(rows)


def _by_columns(term: Any, rows: Sequence[Any], bodies: _Bodies) -> Iterator[Term]:
    """A term of the rows of its table, if any: what it acts on, and an array for each column."""
    if not rows:
        return
    fields = {}
    for column in term.columns:
        if column.inverse:
            values = [_inverse(term, column, j, row) for j, row in enumerate(rows)]
        else:
            values = [getattr(row, tables.identifier(column.name)) for row in rows]
        fields[column.field] = np.array(values)
    ends: list[tuple[int, ...]] = []
    for j, row in enumerate(rows):
        if len(term.ends) == 1:
            ends.append((bodies.number(row.particle, f"{term.key}[{j}].particle"),))
        else:
            ends.append(tuple(bodies.number(end, f"{term.key}[{j}].ends") for end in row.ends))
            _two_ends(row.ends[0], row.ends[1], f"{term.key}[{j}].ends")
    yield term(**dict(zip(term.ends, map(np.array, zip(*ends, strict=True)), strict=True)), **fields)


def _inverse(term: Any, column: Column, j: int, row: Any) -> float:
    """What the field of an inverse column holds: given as such, or as the inverse of what is given."""
    given, inverse = getattr(row, tables.identifier(column.name)), getattr(row, column.field)
    if given is not None and inverse is not None:
        raise MistakeError(f"{term.key}[{j}]: {column.name} and its inverse {column.field} are both given")
    if inverse is not None:
        return float(inverse)
    value = column.default if given is None else given
    if value is None:
        raise MistakeError(f"{term.key}[{j}] lacks the field {column.name!r}")
    return float(1 / value)
