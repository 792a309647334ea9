"""Fields of a scene file that are varied, over a grid or at random, and the scene of each cell.

A field is varied in the file itself, which is read again, so that every field of every term can be varied;
the resulting changes of the scene are then applied to all cells at once.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from springcheck.errors import SpringcheckError, nearest
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

CHUNK = 10_000
"""Cells that are saved together, and drawn from one state of the generator."""

CHECKED = 8
"""Cells of a chunk that are also read from the file as a whole, and compared."""

MOST_CELLS = 10**8

FORM = "FIELD=LOW:HIGH:COUNT[:log], FIELD=A,B,C, or with --samples FIELD=LOW:HIGH[:log]"

GRID = ("step", "steps", "every", "tolerance")
"""Fields that all cells of a run share."""

Place = tuple[Any, ...]
"""Position of a number in a scene: the name of a field, or ("terms", term, field), and the row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One field that is varied."""

    field: str
    values: tuple[float, ...] = ()
    """Values of a grid that are listed; empty where they are spaced evenly."""
    low: float = math.nan
    high: float = math.nan
    count: int = 0
    log: bool = False

    @property
    def size(self) -> int:
        """Number of grid values."""
        return len(self.values) or self.count

    def at(self, index: np.ndarray) -> Floats:
        """The grid values at these indices."""
        spaced = np.geomspace if self.log else np.linspace
        found: Floats = np.array(self.values or spaced(self.low, self.high, self.count), np.float64)[index]
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """All cells: the products of the axes of a grid, the last varying fastest, or random samples."""

    axes: tuple[Axis, ...]
    samples: int | None
    seed: int
    text: str = ""
    """Text of the scene file in which the axes name fields; by default the one that the scene writes."""

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.samples if self.samples is not None else math.prod(x.size for x in self.axes)

    @property
    def chunks(self) -> range:
        """Indices of the chunks."""
        return range(-(-self.cells // CHUNK))

    def values(self, chunk: int) -> dict[str, Floats]:
        """The values of each field in the cells of a chunk (c,)."""
        cells = np.arange(chunk * CHUNK, min((chunk + 1) * CHUNK, self.cells))
        if self.samples is None:
            index = np.unravel_index(cells, [x.size for x in self.axes])
            return {x.field: x.at(j) for x, j in zip(self.axes, index, strict=True)}
        found = {}
        for j, axis in enumerate(self.axes):
            part = np.random.default_rng([self.seed, j, chunk]).random(CHUNK)[: len(cells)]
            if axis.log:
                found[axis.field] = axis.low * (axis.high / axis.low) ** part
            else:
                found[axis.field] = axis.low + (axis.high - axis.low) * part
        return found


def plan(given: Sequence[str], samples: int | None = None, seed: int = 0, *, text: str = "") -> Plan:
    """Parse `--vary` options.  SpringcheckError where one is invalid."""
    if not given:
        raise SpringcheckError(f"an ensemble needs --vary {FORM}")
    axes = tuple(_axis(text, random=samples is not None) for text in given)
    names = [axis.field for axis in axes]
    if len(set(names)) < len(names):
        raise SpringcheckError(f"--vary: {max(names, key=names.count)} is given twice")
    if not (isinstance(seed, int | np.integer) and seed >= 0):
        raise SpringcheckError(f"--seed {seed}: a whole number, 0 or more, is needed")
    found = Plan(axes=axes, samples=samples, seed=int(seed), text=text)
    if not 0 < found.cells <= MOST_CELLS:
        raise SpringcheckError(f"{found.cells} cells: 1 to {MOST_CELLS} can be run")
    return found


def _axis(text: str, *, random: bool) -> Axis:
    field, equals, rest = text.partition("=")
    parts = rest.split(":")
    log = parts[-1] == "log"
    numbers = parts[: len(parts) - log]
    try:
        if random:
            low, high = map(float, numbers)
            found, some = Axis(field=field, low=low, high=high, log=log), [low, high]
            valid = not log or min(some) > 0
        elif len(parts) == 1:
            some = [float(x) for x in rest.split(",")]
            found, valid = Axis(field=field, values=tuple(some)), True
        else:
            first, last, number = numbers
            found = Axis(field=field, low=float(first), high=float(last), count=int(number), log=log)
            few, valid = min(found.count, 3), found.count > 0
            with np.errstate(all="raise"):
                some = replace(found, count=few).at(np.arange(few)).tolist()
        if not (field and equals and valid and all(map(math.isfinite, some))):
            raise ValueError
    except (ValueError, FloatingPointError):
        raise SpringcheckError(f"--vary {text}: {FORM} is needed") from None
    return found


class Varied:
    """A scene with varied fields, which an option of the command line names."""

    def __init__(self, scene: Scene, text: str, option: str = "--vary") -> None:
        """`text` is that of the scene file; "" for the one that the scene writes."""
        self.scene, self._option = scene, option
        self._data = tomllib.loads(text or scene.to_toml())

    def substitutions(self, values: Mapping[str, Floats]) -> dict[Place, Floats]:
        """The numbers of the scene that change, with their values in every cell (c,).

        SpringcheckError where a value gives no valid scene, or two fields change the same number.
        """
        found: dict[Place, Floats] = {}
        numbers = _arrays(self.scene)
        for field, column in values.items():
            different, where = np.unique(column, return_inverse=True)
            effects = [
                dict(_differences(self.scene, self.whole({field: float(value)}), field))
                for value in different
            ]
            for place in {place for effect in effects for place in effect}:
                if place in found:
                    raise SpringcheckError(f"--vary {field}: {place[0]} is changed by another --vary, too")
                known = float(numbers[place[:-1]][place[-1]])
                found[place] = np.array([effect.get(place, known) for effect in effects])[where]
        return found

    def _at(self, found: Any, field: str) -> tuple[Any, Any, Any]:
        """The table that holds a field in the tables of a file, the key in it, and its value there."""
        try:
            *parts, last = re.findall(r"[^.\[\]]+", field)
            for part in parts:
                found = found[_key(found, part)]
            key = _key(found, last)
            held = found.get(key) if isinstance(found, dict) else found[key]
            if isinstance(held, dict | list | str) or not isinstance(found, dict | list):
                raise KeyError
        except (KeyError, IndexError, ValueError, TypeError):
            raise SpringcheckError(
                f"{self._option} {field}: scene {self.scene.name} has no such number"
                f"{nearest(field, fields(self._data))}; "
                "fields are named as in its file, such as spring.0.stiffness or time.step"
            ) from None
        return found, key, held

    def whole(self, values: Mapping[str, float]) -> Scene:
        """The scene with these values in its file.  SpringcheckError where they are invalid."""
        tables = deepcopy(self._data)
        for field, value in values.items():
            table, key, held = self._at(tables, field)
            is_count = isinstance(held, int) and not isinstance(held, bool) and value == int(value)
            table[key] = int(value) if is_count else value
        where = f"{self._option} " + ", ".join(f"{field}={value:g}" for field, value in values.items())
        return scenefile.from_tables(tables, name=self.scene.name, where=where)

    def check(self, values: Mapping[str, Floats], changes: Mapping[Place, Floats]) -> None:
        """Raise SpringcheckError where fields interact, so that combined changes differ from the file.

        The first cell, the last and some between are each read from the file as a whole.
        """
        count = len(next(iter(values.values())))
        for j in sorted({*np.linspace(0, count - 1, CHECKED).astype(int).tolist()}):
            wanted = self.whole({field: float(column[j]) for field, column in values.items()})
            made = together(self.scene, changes, np.array([j]))
            if wanted.digest != made.digest:
                names = " and ".join(values)
                what = "act on one another" if len(values) > 1 else "is of the scene as a whole"
                raise SpringcheckError(f"--vary: {names} {what}, which no ensemble can")


def fields(tables: Mapping[str, Any]) -> list[str]:
    """Names of the fields of a scene file, as --vary and --set take them."""
    return [
        f"{name}.{i}.{field}" if isinstance(table, list) else f"{name}.{field}"
        for name, table in tables.items()
        for i, row in enumerate(table if isinstance(table, list) else [table])
        if isinstance(row, dict)
        for field in row
    ]


def _key(table: Any, part: str) -> Any:
    """Key of this name in a table, or index into a list; ValueError for an index out of range or negative."""
    return range(len(table)).index(int(part)) if isinstance(table, list) else part


def _differences(one: Scene, other: Scene, field: str) -> Iterator[tuple[Place, float]]:
    joins, its = ([(t.key, [i.tolist() for i in t.particles]) for t in x.terms] for x in (one, other))
    if one.n != other.n or joins != its:
        raise SpringcheckError(f"--vary {field}: it changes what acts on what, which no ensemble can")
    before = _arrays(one)
    for key, after in _arrays(other).items():
        for row in np.flatnonzero(before[key] != after):
            yield (*key, int(row)), float(after[row])


def _arrays(scene: Scene) -> dict[Place, np.ndarray]:
    """All numbers of a scene, by their position."""
    names = ("m", "q", "p", *GRID)
    found: dict[Place, np.ndarray] = {(name,): np.atleast_1d(getattr(scene, name)) for name in names}
    for t, term in enumerate(scene.terms):
        found |= {("terms", t, name): values for name, values in term.arrays.items()}
    return found


def together(scene: Scene, changes: Mapping[Place, Floats], chosen: np.ndarray) -> Scene:
    """The scenes of these cells side by side as one, without interaction.

    The cells must have one time grid.
    """
    copies = len(chosen)
    many = scene.system.tiled(copies)
    numbers, arrays = _arrays(many), dict[Place, np.ndarray]()
    more: dict[str, Any] = {}
    for (*key, row), values in changes.items():
        if key[0] in GRID:
            more[key[0]] = type(getattr(scene, key[0]))(values[chosen[0]])
        else:
            place = tuple(key)
            arrays.setdefault(place, numbers[place].reshape(copies, -1).copy())[:, row] = values[chosen]
    terms: list[Any] = list(many.terms)
    for (name, *where), whole in arrays.items():
        if where:
            terms[where[0]] = replace(terms[where[0]], **{where[1]: whole.ravel()})
        else:
            more[name] = whole.ravel()
    return many.derived(terms=tuple(terms), **more)
