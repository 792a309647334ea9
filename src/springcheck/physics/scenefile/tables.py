"""What may stand in a scene file: the fields of each table, with their units."""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, Literal, NamedTuple, get_args

import msgspec

from springcheck.physics import terms
from springcheck.physics.scene import Kind, Quantity, Units

Positive = Annotated[float, msgspec.Meta(gt=0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0)]
Count = Annotated[int, msgspec.Meta(ge=1)]
End = int | Literal["wall"]


class Table(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """A table of a scene file: what is not a field of it is refused."""


def _table(name: str, fields: dict[str, Any], rename: dict[str, str] | None = None) -> Any:
    """A table of these fields: the type of each, with its default where it may be left out."""
    given = [(field, *(of if isinstance(of, tuple) else (of,))) for field, of in fields.items()]
    return msgspec.defstruct(f"{name}Table", given, bases=(Table,), frozen=True, kw_only=True, rename=rename)


def _several(table: Any) -> Any:
    """The field of a scene that holds any number of such tables."""
    return tuple[table, ...], ()


class Body(NamedTuple):
    """What moves: the kind of its scenes, the word for several, and what it calls m, q and p."""

    kind: Kind
    several: str
    columns: tuple[str, ...] = ()


BODIES = {
    # [M], [L], [M L/T]
    "particle": Body("particles", "particles", ("mass", "position", "momentum")),
    # a body that turns: [M L2], [rad], [M L2/T]
    "rotor": Body("rotor", "rotors", ("inertia", "angle", "momentum")),
    # the inductor of a loop: [H], charge that has gone round [C], [Wb]
    "inductor": Body("circuit", "inductors", ("inductance", "charge", "flux")),
    "chain": Body("particles", "masses"),
}
"""What moves, by the name of its table."""

_FIELDS: dict[str, dict[str, Any]] = {
    **{
        name: {body.columns[0]: Positive, body.columns[1]: (float, 0.0), body.columns[2]: (float, 0.0)}
        for name, body in BODIES.items()
        if body.columns
    },
    # in one loop, or between two loops that go through it in opposite directions [F]
    "capacitor": {
        "loops": Annotated[tuple[int, ...], msgspec.Meta(min_length=1, max_length=2)],
        "capacitance": Positive,
    },
    # of one loop [Ohm]
    "resistor": {"loop": int, "resistance": NonNegative},
    # equal masses [M] between two walls, neighbours joined by equal springs [M/T2]; positions count from the
    # rest of each; the start is a sum of standing waves, mode 1 the slowest, or that of each mass
    "chain": {
        "masses": Count,
        "mass": Positive,
        "stiffness": Positive,
        "wave": _several(_table("wave", {"mode": Count, "amplitude": float})),
        "position": (tuple[float, ...], ()),
        "momentum": (tuple[float, ...], ()),
    },
    # [M/T2], rest length [L], place of a wall [L]; `fast` ones are taken in the short step of a method of
    # multiple time steps
    "spring": {
        "ends": tuple[End, End],
        "stiffness": float,
        "rest": (float, 0.0),
        "wall": (float, 0.0),
        "fast": (bool, False),
    },
    # force -coefficient p/mass [M/T]
    "damping": {"particle": int, "coefficient": NonNegative},
    # [T], and the relative tolerance per step of adaptive solvers
    "time": {
        "step": float,
        "steps": Count,
        "every": (Count | None, None),
        "tolerance": (Annotated[float, msgspec.Meta(gt=0, lt=1)], 1e-12),
    },
    # labels or globs of the methods to run; all that can serve the scene when left out
    "methods": {"include": (Annotated[tuple[str, ...], msgspec.Meta(min_length=1)], ("*",))},
    # every how many steps a frame is kept, and what of it
    "record": {"every": (Count | None, None), "quantities": (tuple[Quantity, ...], ("q", "p", "energy"))},
}
_TABLES = {name: _table(name, fields) for name, fields in _FIELDS.items()}

_SCENE: dict[str, Any] = {
    "title": str,
    "time": _TABLES["time"],
    "source": (str, ""),
    "units": (Units | None, None),
    "kind": (Kind | None, None),
    **{
        name: (table | None, None) if name == "chain" else _several(table)
        for name, table in _TABLES.items()
        if name not in ("time", "methods", "record")
    },
    "methods": (_TABLES["methods"], _TABLES["methods"]()),
    "record": (_TABLES["record"], _TABLES["record"]()),
}
"""A scene file without the tables of the terms that need no more than their columns."""


_SIGNS: dict[str, Any] = {"any": float, "positive": Positive, "nonnegative": NonNegative}


def _of_term(term: Any) -> Any:
    """The table of a term: the particle or the two ends on which it acts, and its columns."""
    fields: dict[str, Any] = {"particle": int} if len(term.ends) == 1 else {"ends": tuple[int, int]}
    for column in term.columns:
        kind: Any = _SIGNS[column.sign]
        name = identifier(column.name)
        if column.inverse:
            # given itself, or its inverse under the name of the field
            fields |= {name: (kind | None, None), column.field: (kind | None, None)}
        else:
            fields[name] = kind if column.default is None else (kind, column.default)
    names = {identifier(column.name): column.name for column in term.columns}
    return _table(term.__name__, fields, names)


def identifier(name: str) -> str:
    """The attribute under which a struct holds what a scene file calls so: words with dashes are none."""
    return name.replace("-", "_")


OTHERWISE = ("wall-spring", "spring", "damping")
"""Terms that have tables of their own."""


def of_terms() -> dict[str, tuple[Any, Any]]:
    """The terms that are read by their columns alone, with their tables."""
    return _of_terms(tuple(terms.known().values()))


@lru_cache(maxsize=8)
def _of_terms(known: tuple[type[terms.Term], ...]) -> dict[str, tuple[Any, Any]]:
    return {term.key: (term, _of_term(term)) for term in known if term.key not in OTHERWISE}


def scene_table() -> Any:
    """The struct of a whole scene file, with a table for every term that is known by now."""
    return _scene_table(tuple(terms.known().values()))


@lru_cache(maxsize=8)
def _scene_table(known: tuple[type[terms.Term], ...]) -> Any:
    several = {identifier(key): _several(table) for key, (_, table) in _of_terms(known).items()}
    return _table("Scene", _SCENE | several, {identifier(key): key for key in _of_terms(known)})


CHOICES: dict[str, tuple[str, ...]] = {
    "units": get_args(Units),
    "kind": get_args(Kind),
    "record.quantities[]": get_args(Quantity),
}
"""What a field of a few words accepts, for messages; of a list, what each of its entries does."""


def named(name: str) -> Any:
    """The table of a name, for messages that say which fields it has; None for a name that has none."""
    found = _TABLES | {key: table for key, (_, table) in of_terms().items()} | {"": scene_table()}
    return found.get(name)
