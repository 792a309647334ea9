"""From the tables of a scene file to a `Scene`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.errors import SceneError
from springcheck.physics import builders
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Kind, Scene, Units
from springcheck.physics.scenefile import tables
from springcheck.physics.terms import Column, Damping, Spring, Term, WallSpring


class MistakeError(ValueError):
    """A value of the right type that makes no sense."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Bodies:
    """What moves: m, q, p (n,), what it is, and what it is called in the file."""

    m: Floats
    q: Floats
    p: Floats
    kind: Kind
    name: str
    terms: tuple[Term, ...] = ()


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
    if table.kind not in (None, bodies.kind):
        raise MistakeError(
            f"kind = {table.kind!r}, but what moves is given by [[{bodies.name}]]: "
            "particles come as [[particle]] or [chain], rotors as [[rotor]], circuits as [[inductor]]"
        )
    units: Units = table.units or ("si" if bodies.kind == "circuit" else "reduced")
    terms = tuple(_terms(table, bodies))
    try:
        return Scene(
            name=name,
            title=table.title,
            source=table.source,
            units=units,
            kind=bodies.kind,
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
    given = [name for name in ("particle", "rotor", "inductor", "chain") if getattr(table, name)]
    if not given:
        raise MistakeError(
            "nothing moves: a scene needs [[particle]], or [[rotor]], or [[inductor]], or [chain]"
        )
    if len(given) > 1:
        raise MistakeError(f"[[{given[0]}]] and [[{given[1]}]] are both given; a scene has one kind of them")
    name = given[0]
    if name == "chain":
        made = _chain(table.chain)
        return _Bodies(m=made.m, q=made.q, p=made.p, kind="particles", name=name, terms=made.terms)
    columns = {
        "particle": ("mass", "position", "momentum"),
        "rotor": ("inertia", "angle", "momentum"),
        "inductor": ("inductance", "charge", "flux"),
    }[name]
    kinds: dict[str, Kind] = {"particle": "particles", "rotor": "rotor", "inductor": "circuit"}
    m, q, p = (np.array([getattr(row, column) for row in getattr(table, name)]) for column in columns)
    return _Bodies(m=m, q=q, p=p, kind=kinds[name], name=name)


def _chain(table: tables.ChainTable) -> Scene:
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


def _number(value: int, bodies: _Bodies, field: str) -> int:
    n = len(bodies.m)
    if not 0 <= value < n:
        several = {"particle": "particles", "rotor": "rotors", "inductor": "inductors", "chain": "masses"}
        raise MistakeError(f"{field} = {value}: there are {n} {several[bodies.name]}, numbered 0 to {n - 1}")
    return value


def _terms(table: Any, bodies: _Bodies) -> Iterator[Term]:
    yield from bodies.terms
    yield from _springs(table.spring, bodies)
    yield from _capacitors(table, bodies)
    for key, (term, _) in tables.of_terms().items():
        rows = getattr(table, tables.identifier(key))
        if rows:
            yield _by_columns(term, rows, bodies)
    yield from _friction(table, bodies)


def _springs(springs: Sequence[tables.SpringTable], bodies: _Bodies) -> Iterator[Term]:
    rows: dict[tuple[type[Term], bool], list[tuple[float, ...]]] = {}
    for j, spring in enumerate(springs):
        field = f"spring[{j}].ends"
        for end in spring.ends:
            if end != "wall":
                _number(end, bodies, field)
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
    if (table.capacitor or table.resistor) and bodies.kind != "circuit":
        raise MistakeError("capacitors and resistors belong to a circuit: give its loops as [[inductor]]")
    rows: dict[tuple[type[Term], bool], list[tuple[float, ...]]] = {}
    for j, capacitor in enumerate(table.capacitor):
        loops = [_number(loop, bodies, f"capacitor[{j}].loops") for loop in capacitor.loops]
        if len(loops) == 2:
            _two_ends(loops[0], loops[1], f"capacitor[{j}].loops")
        kind = WallSpring if len(loops) == 1 else Spring
        rows.setdefault((kind, False), []).append((*loops, 1 / capacitor.capacitance, 0.0))
    yield from _of_rows(rows)


def _by_columns(term: Any, rows: Sequence[Any], bodies: _Bodies) -> Term:
    """A term from rows of its table: what it acts on, and an array for each column."""
    values = {}
    for column in term.columns:
        if column.inverse:
            values[column.field] = np.array([_inverse(term, column, j, row) for j, row in enumerate(rows)])
        else:
            values[column.field] = np.array([getattr(row, tables.identifier(column.name)) for row in rows])
    if len(term.ends) == 1:
        field = f"{term.key}[{{}}].particle"
        ends = [[_number(row.particle, bodies, field.format(j)) for j, row in enumerate(rows)]]
    else:
        for j, row in enumerate(rows):
            one, other = (_number(end, bodies, f"{term.key}[{j}].ends") for end in row.ends)
            _two_ends(one, other, f"{term.key}[{j}].ends")
        ends = [list(end) for end in zip(*(row.ends for row in rows), strict=True)]
    found: Term = term(**dict(zip(term.ends, map(np.array, ends), strict=True)), **values)
    return found


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


def _friction(table: Any, bodies: _Bodies) -> Iterator[Term]:
    rows = [(row.particle, row.coefficient, f"damping[{j}].particle") for j, row in enumerate(table.damping)]
    rows += [(row.loop, row.resistance, f"resistor[{j}].loop") for j, row in enumerate(table.resistor)]
    found = [(_number(particle, bodies, field), c) for particle, c, field in rows]
    yield from _of_rows({(Damping, False): found} if found else {})
