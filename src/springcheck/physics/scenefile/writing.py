"""From a `Scene` to the text of a scene file that reads back with exactly the same numbers."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from springcheck.physics.arrays import Floats
from springcheck.physics.distance import Distances
from springcheck.physics.fields import SceneFields
from springcheck.physics.graph import standing
from springcheck.physics.scenefile.tables import BODIES
from springcheck.physics.system import System
from springcheck.physics.term import Term
from springcheck.physics.terms import Column, Damping, Spring, WallSpring

MOST_WAVES = 64
"""Most standing waves by which the start of a chain is written."""


def text(system: System[Any]) -> str:
    """The scene file of a system's scene."""
    scene: SceneFields = system.scene
    head = {"title": scene.title, "source": scene.source, "units": scene.units, "kind": scene.kind}
    lines = [_assigned(head)]
    is_chain = scene.places is None and scene.kind == "particles" and system.is_uniform_chain
    is_chain &= all(_rest_in_0(term) for term in scene.terms if isinstance(term, WallSpring | Spring))
    if is_chain:
        lines += _chain(scene)
    else:
        table, names = next((name, of.columns) for name, of in BODIES.items() if of.kind == scene.kind)
        lines += [_table(f"[[{table}]]", row) for row in _bodies(scene, names)]
    for term in scene.terms:
        if not (is_chain and isinstance(term, WallSpring | Spring)):
            lines += _rows(scene, term)
    if scene.bath:
        given = {"temperature": scene.bath.temperature, "friction": scene.bath.friction}
        lines.append(_table("[bath]", given.items()))
    time = {"step": scene.step, "steps": scene.steps, "tolerance": scene.tolerance}
    lines.append(_table("[time]", time.items()))
    lines.append(_table("[methods]", [("include", list(scene.include))]))
    record = {"every": scene.every, "quantities": list(scene.quantities)}
    lines.append(_table("[record]", record.items()))
    return "\n".join(lines) + "\n"


def _bodies(scene: SceneFields, names: Sequence[str]) -> Iterator[Iterable[tuple[str, Any]]]:
    """Rows of the bodies: one number for each column, or for each of its axes."""
    rows = list(zip(*(x.tolist() for x in (scene.m, scene.q, scene.p)), strict=True))
    if scene.places is None:
        yield from (zip(names, row, strict=True) for row in rows)
        return
    places = scene.places.tolist()
    for _, several in itertools.groupby(zip(places, rows, strict=True), lambda one: one[0] // 3):
        at, own = zip(*several, strict=True)
        m, q, p = zip(*own, strict=True)
        along = "".join("xyz"[place % 3] for place in at)
        yield zip((*names, "axes"), (m[0], list(q), list(p), along), strict=True)


def _rest_in_0(term: Term) -> bool:
    """Whether springs rest in 0 and are not fast, as those of a [chain] and capacitors do."""
    return not (term.fast or np.any(getattr(term, term.origin)))


def _chain(scene: SceneFields) -> Iterator[str]:
    k = next(term.k for term in scene.terms if isinstance(term, Spring))
    known: dict[str, Any] = {"masses": scene.n, "mass": scene.m[0], "stiffness": k[0]}
    waves = None if np.any(scene.p) else _waves(scene.q)
    if waves is None:
        known |= {"position": scene.q.tolist(), "momentum": scene.p.tolist()}
    yield _table("[chain]", known.items())
    for mode, amplitude in waves or ():
        yield _table("[[chain.wave]]", [("mode", mode), ("amplitude", amplitude)])


def _waves(q: Floats) -> list[tuple[int, float]] | None:
    """The few standing waves (mode, amplitude) whose sum is q to the last bit; None where there are none."""
    n = len(q)
    odd = np.concatenate([[0.0], q, [0.0], -q[::-1]])
    amplitudes = -np.fft.rfft(odd).imag[1 : n + 1] / (n + 1)
    size = np.max(np.abs(amplitudes))
    if not np.isfinite(size) or size == 0:
        return None
    large = np.flatnonzero(np.abs(amplitudes) > 1e-12 * size)
    if len(large) > min(MOST_WAVES, n // 2 + 1):
        return None
    # an amplitude from a file has few digits
    for digits in (3, 6, 9, 12, 15, 17):
        found = [(int(j) + 1, float(f"{amplitudes[j]:.{digits}g}")) for j in large]
        orders: Any = itertools.permutations(found) if len(found) <= 4 else (found, found[::-1])
        for waves in orders:
            if np.array_equal(standing(n, waves), q):
                return list(waves)
    return None


def _rows(scene: SceneFields, term: Term) -> Iterator[str]:
    if isinstance(term, Damping) and scene.kind == "circuit":
        for loop, resistance in term.rows():
            yield _table("[[resistor]]", [("loop", loop), ("resistance", resistance)])
    elif isinstance(term, WallSpring | Spring) and scene.kind == "circuit" and _are_capacitors(term):
        for *loops, k, _ in term.rows():
            yield _table("[[capacitor]]", [("loops", loops), ("capacitance", 1 / k)])
    elif isinstance(term, WallSpring | Spring):
        for *at, k, rest in term.rows():
            ends, axis = _ends(scene, at)
            row: dict[str, Any] = {"ends": ["wall", *ends][-2:], "stiffness": k, **axis}
            # the name of its origin: wall or rest
            row |= {term.columns[1].name: rest} if rest else {}
            yield _table("[[spring]]", (row | ({"fast": True} if term.fast else {})).items())
    elif isinstance(term, Distances):
        yield from _distances(scene, term)
    else:
        yield from _by_columns(scene, term)


def _distances(scene: SceneFields, term: Distances) -> Iterator[str]:
    """One table for the rows of each distance."""
    for first, last in itertools.pairwise([*term.firsts.tolist(), len(term)]):
        ends, _ = _ends(scene, [int(index[first]) for index in term.particles])
        row: dict[str, Any] = {"ends": ["wall", *ends][-2:]}
        for column in term.columns:
            if column.field not in (term.origin, "number"):
                row |= [_given(term, column, first)]
        if term.origin and np.any(at := getattr(term, term.origin)[first:last]):
            row["wall"] = at.tolist()
        yield _table(f"[[{term.key.removeprefix('wall-')}]]", row.items())


def _given(term: Term, column: Column, j: int) -> tuple[str, float]:
    """Name and value of a column in a file: the inverse where it has the same number as its inverse."""
    value = float(getattr(term, column.field)[j])
    inverse = 1 / value if column.inverse and abs(value) > 1e-307 else 0.0
    # the inverse of an inverse is often, not always, the same number
    if inverse and 1 / inverse == value:
        return column.name, inverse
    return column.field if column.inverse else column.name, value


def _ends(scene: SceneFields, coordinates: Sequence[int]) -> tuple[list[int], dict[str, str]]:
    """The particles of these coordinates, and their axis where that is not x for all."""
    if scene.places is None:
        return list(coordinates), {}
    particles, axes = np.divmod(scene.places[list(coordinates)], 3)
    return particles.tolist(), {"axis": "xyz"[axes[0]]}


def _are_capacitors(term: WallSpring | Spring) -> bool:
    """Whether every row is V = q**2 / 2C with a C whose inverse is the stiffness to the last bit."""
    with np.errstate(divide="ignore", over="ignore"):
        capacitance = 1 / term.k
        exact = (term.k > 0) & (capacitance > 0) & np.isfinite(capacitance) & (1 / capacitance == term.k)
    return bool(np.all(exact)) and _rest_in_0(term)


def _by_columns(scene: SceneFields, term: Term) -> Iterator[str]:
    for j, at in enumerate(zip(*(index.tolist() for index in term.particles), strict=True)):
        ends, axis = _ends(scene, at)
        row: dict[str, Any] = {"particle": ends[0]} if len(ends) == 1 else {"ends": ends}
        row |= axis
        row |= [_given(term, column, j) for column in term.columns]
        yield _table(f"[[{term.key}]]", row.items())


def _table(head: str, items: Any) -> str:
    return f"\n{head}\n{_assigned(dict(items))}"


def _assigned(values: dict[str, Any]) -> str:
    return "".join(f"{name} = {_value(value)}\n" for name, value in values.items()).rstrip("\n")


def _value(value: Any) -> str:
    """A value in TOML: numbers by repr, which reads back to the last bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return f"[{', '.join(_value(one) for one in value)}]"
    return repr(value) if isinstance(value, int) else repr(float(value))
