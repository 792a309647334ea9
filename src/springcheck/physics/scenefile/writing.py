"""From a `Scene` to the text of a scene file that reads back with exactly the same numbers."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from springcheck.physics.distance import Distances
from springcheck.physics.fields import SceneFields
from springcheck.physics.scenefile import tables
from springcheck.physics.system import System
from springcheck.physics.term import Term
from springcheck.physics.terms import Spring, WallSpring

Row = dict[str, Any]


def text(system: System[Any]) -> str:
    """The scene file of a system's scene."""
    scene: SceneFields = system.scene
    lines = [_assigned({name: getattr(scene, name) for name in ("title", "source", "units", "kind")})]
    springs = [term for term in scene.terms if isinstance(term, WallSpring | Spring)]
    is_chain = scene.places is None and scene.kind == "particles" and system.is_uniform_chain
    is_chain &= not any(term.fast or np.any(getattr(term, term.origin)) for term in springs)
    if is_chain:
        known = {"masses": scene.n, "mass": scene.m[0], "stiffness": springs[0].k[0]}
        start = {"position": scene.q.tolist()} | ({"momentum": scene.p.tolist()} if np.any(scene.p) else {})
        lines.append(_table("[chain]", known | start))
    else:
        name = "inductor" if scene.kind == "circuit" else "particle"
        lines += [_table(f"[[{name}]]", row) for row in _bodies(scene)]
    for term in scene.terms:
        if not (is_chain and term in springs):
            key = "spring" if term in springs else term.key
            key = key.removeprefix("wall-") if isinstance(term, Distances) else key
            lines += [_table(f"[[{key}]]", row) for row in _rows(scene, term)]
    if scene.bath:
        lines.append(_table("[bath]", {x: getattr(scene.bath, x) for x in ("temperature", "friction")}))
    lines.append(_table("[time]", {x: getattr(scene, x) for x in ("step", "steps", "tolerance")}))
    lines.append(_table("[methods]", {"include": list(scene.include)}))
    lines.append(_table("[record]", {"every": scene.every, "quantities": list(scene.quantities)}))
    return "\n".join(lines) + "\n"


def _bodies(scene: SceneFields) -> Iterator[Row]:
    """Rows of the bodies: one number for each column, or for each of its axes."""
    of = tables.InductorTable if scene.kind == "circuit" else tables.ParticleTable
    rows = zip(*(x.tolist() for x in (scene.m, scene.q, scene.p)), strict=True)
    if scene.places is None:
        yield from (dict(zip(of.__struct_fields__, row, strict=False)) for row in rows)
        return
    coordinates = zip(scene.places.tolist(), rows, strict=True)
    for _, several in itertools.groupby(coordinates, lambda one: one[0] // 3):
        places, states = zip(*several, strict=True)
        m, q, p = zip(*states, strict=True)
        axes = "".join("xyz"[place % 3] for place in places)
        yield {"mass": m[0], "position": list(q), "momentum": list(p), "axes": axes}


def _rows(scene: SceneFields, term: Term) -> Iterator[Row]:
    """A row for each of a term's, or for each of its distances."""
    in_space, is_spring = isinstance(term, Distances), isinstance(term, WallSpring | Spring)
    firsts: Iterable[int] = term.firsts.tolist() if isinstance(term, Distances) else range(len(term))
    for first, last in itertools.pairwise([*firsts, len(term)]):
        ends, axis = _ends(scene, [int(index[first]) for index in term.particles])
        row: Row = {"ends": ["wall", *ends][-2:]}
        if term.bodies == 1 and not (in_space or is_spring):
            row = {"particle": ends[0]}
        row |= {} if in_space else axis
        for column in term.columns:
            values = getattr(term, column.field)[first:last].tolist()
            if in_space and column.field == term.origin:
                row |= {"wall": values} if any(values) else {}
            elif column.field != "number" and values[0] != column.default:
                row[column.name] = values[0]
        yield row | ({"fast": True} if term.fast else {})


def _ends(scene: SceneFields, coordinates: list[int]) -> tuple[list[int], dict[str, str]]:
    """The particles of these coordinates, and their axis where that is not x for all."""
    if scene.places is None:
        return coordinates, {}
    particles, axes = np.divmod(scene.places[coordinates], 3)
    return particles.tolist(), {"axis": "xyz"[axes[0]]}


def _table(head: str, values: Row) -> str:
    return f"\n{head}\n{_assigned(values)}"


def _assigned(values: Row) -> str:
    return "\n".join(f"{name} = {_value(value)}" for name, value in values.items())


def _value(value: Any) -> str:
    """A value in TOML: numbers by repr, which reads back to the last bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return f"[{', '.join(_value(one) for one in value)}]"
    return repr(value) if isinstance(value, int) else repr(float(value))
