"""The tables of a scene file: one struct for each, fields with their units."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, Literal, get_args

import msgspec

from springcheck.physics import terms
from springcheck.physics.distance import ToPoints
from springcheck.physics.fields import Kind, Quantity, Units

Positive = Annotated[float, msgspec.Meta(gt=0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
Count = Annotated[int, msgspec.Meta(ge=1)]
End = int | Literal["wall"]
Axis = Literal["x", "y", "z"]
PerAxis = Annotated[tuple[float, ...], msgspec.Meta(min_length=1, max_length=3)]


class SceneTable(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """A table of a scene file; unknown fields are refused."""


class ParticleTable(SceneTable, frozen=True):
    """mass [M], position [L] and momentum [M L/T] at the start: numbers, or one for each axis.

    `axes` names the axes of these numbers, by default "x", "xy" or "xyz".
    """

    mass: Positive
    position: float | PerAxis = 0.0
    momentum: float | PerAxis = 0.0
    axes: Annotated[str, msgspec.Meta(pattern="^[xyz]{1,3}$")] | None = None


class InductorTable(SceneTable, frozen=True):
    """The inductor of a loop: inductance [H], circulated charge [C] and flux [Wb] at the start."""

    inductance: Positive
    charge: float = 0.0
    flux: float = 0.0


class CapacitorTable(SceneTable, frozen=True):
    """A capacitor in one loop, or between two loops that traverse it in opposite directions [F]."""

    loops: Annotated[tuple[int, ...], msgspec.Meta(min_length=1, max_length=2)]
    capacitance: Positive


class ResistorTable(SceneTable, frozen=True):
    """A resistor of one loop [Ohm]."""

    loop: int
    resistance: NonNegative


class SpringTable(SceneTable, frozen=True):
    """A spring of a stiffness [M/T2] and a rest length [L]; a wall end is at `wall` [L].

    A method of multiple time steps evaluates `fast` springs in its short step.  Where particles move along
    several axes it acts along `axis`, or alike along all of them.
    """

    ends: tuple[End, End]
    stiffness: float
    rest: float = 0.0
    wall: float = 0.0
    fast: bool = False
    axis: Axis | None = None


class WaveTable(SceneTable, frozen=True):
    """One standing wave of a chain: mode number (1 is the slowest) and amplitude [L]."""

    mode: Count
    amplitude: float


class ChainTable(SceneTable, frozen=True):
    """Equal masses [M] between two walls, neighbours joined by equal springs [M/T2].

    Positions are relative to the rest of each mass; the start is a sum of standing waves, or the position and
    the momentum of each mass.
    """

    masses: Count
    mass: Positive
    stiffness: Positive
    wave: tuple[WaveTable, ...] = ()
    position: tuple[float, ...] = ()
    momentum: tuple[float, ...] = ()


class TimeTable(SceneTable, frozen=True):
    """Step [T], number of steps, and the relative tolerance per step of adaptive solvers."""

    step: float
    steps: Count
    tolerance: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 1e-12


class BathTable(SceneTable, frozen=True):
    """A heat bath: temperature [K, or kT where units are reduced], and its friction rate [1/T]."""

    temperature: float
    friction: float


class MethodsTable(SceneTable, frozen=True):
    """Labels or globs of the methods to run; by default all that can serve the scene."""

    include: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("*",)


class RecordTable(SceneTable, frozen=True):
    """Number of steps between recorded frames, and the recorded quantities."""

    every: Count = 1
    quantities: tuple[Quantity, ...] = ("q", "p", "energy")


class SceneBase(SceneTable, frozen=True):
    """A scene file without the tables of the terms that are defined by their columns alone."""

    time: TimeTable
    title: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    source: str = ""
    units: Units | None = None
    kind: Kind | None = None
    particle: tuple[ParticleTable, ...] = ()
    inductor: tuple[InductorTable, ...] = ()
    capacitor: tuple[CapacitorTable, ...] = ()
    resistor: tuple[ResistorTable, ...] = ()
    chain: ChainTable | None = None
    spring: tuple[SpringTable, ...] = ()
    bath: BathTable | None = None
    methods: MethodsTable = MethodsTable()
    record: RecordTable = RecordTable()


_SIGNS: dict[str, Any] = {"any": float, "positive": Positive, "nonnegative": NonNegative}


def _of_term(term: Any) -> Any:
    """The table of a term: its particle or two ends, its axis, and its columns."""
    in_space = issubclass(term, terms.OnDistances)
    columns = term.columns[:-1] if in_space else term.columns
    fields: list[Any] = [("particle", int) if len(term.ends) == 1 else ("ends", tuple[int, int])]
    if in_space:
        fields = [("ends", tuple[End, End]), ("wall", float | PerAxis, 0.0)]
    for column in columns:
        default = () if column.default is None else (column.default,)
        fields.append((identifier(column.name), _SIGNS[column.sign], *default))
    return msgspec.defstruct(
        f"{term.__name__}SceneTable",
        fields if in_space else [*fields, ("axis", Axis | None, None)],
        bases=(SceneTable,),
        frozen=True,
        kw_only=True,
        rename={identifier(column.name): column.name for column in columns},
    )


def identifier(name: str) -> str:
    """The attribute of a struct for a name in a scene file: dashes become underscores."""
    return name.replace("-", "_")


def of_terms() -> tuple[Any, ...]:
    """Terms that are read by their columns alone."""
    known = terms.known().values()
    return tuple(x for x in known if not issubclass(x, terms.WallSpring | terms.Spring | ToPoints))


def scene_table() -> Any:
    """The struct of a whole scene file, with a table for every registered term."""
    return _scene_table(of_terms())


@lru_cache(maxsize=8)
def _scene_table(several: tuple[Any, ...]) -> Any:
    return msgspec.defstruct(
        "SceneTable",
        [(identifier(term.key), tuple[_of_term(term), ...], ()) for term in several],  # type: ignore[misc]
        bases=(SceneBase,),
        frozen=True,
        kw_only=True,
        rename={identifier(term.key): term.key for term in several},
    )


CHOICES: dict[str, tuple[str, ...]] = {
    "units": get_args(Units),
    "kind": get_args(Kind),
    "record.quantities[]": get_args(Quantity),
    "axis": get_args(Axis),
    "ends[]": ('"wall"', "the number of a particle"),
}
"""Accepted words of a field, for messages; for a list, of each of its entries."""


def named(name: str) -> Any:
    """The table of this name, for messages that list its fields; None where there is none."""
    if not name:
        return scene_table()
    kind = next((x.type for x in msgspec.structs.fields(scene_table()) if x.encode_name == name), None)
    parts = (part for part in (kind, *get_args(kind)) if isinstance(part, type))
    return next((part for part in parts if issubclass(part, SceneTable)), None)
