"""What figures and page show of an ensemble: a quantity over one field as a line, over two as a map.

However many cells there are, a line has at most `MOST_POINTS` and a map `MOST_TILES` squared: more of them
are put together, and their median stands for them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from springcheck.errors import SpringcheckError, nearest
from springcheck.physics.arrays import Floats
from springcheck.studies.ensemble.result import Columns, Ensemble

TITLES = {
    "max_error": "largest error, relative to the initial energy norm",
    "energy_drift": "|H - H0| / |H0| where it is largest",
    "q0": "q of the first particle at the end",
    "p0": "p of the first particle at the end",
    "steps": "steps with finite numbers",
    "outcome": "how the run ended",
}
"""Quantities that can be drawn, as axes name them."""

SIZES = ("max_error", "energy_drift")
"""Those of which the magnitude counts, over many powers of ten."""

MOST = 1e3
"""Of these, relative to the start, beyond which nothing is read off a picture."""

DRAWN = SIZES
"""Those that are drawn unless others are chosen."""

MOST_POINTS, MOST_TILES = 400, 64
FEW = 100
"""Points that are shown as they are in any case."""
TOGETHER = 9
"""Random samples of a point or tile, on average at least."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line:
    """Values over one field, by its size; of many cells put together their median and their range."""

    x: Floats
    y: Floats
    low: Floats
    high: Floats
    joined: bool
    """Whether neighbours differ in this field alone: else the others differ, too, and no line joins them."""
    fixed: Mapping[str, float]
    """The other fields of a grid, with their value here."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Map:
    """Values (len(y), len(x)) over two fields; NaN where there is none."""

    x: Floats
    y: Floats
    values: Floats
    fixed: Mapping[str, float]
    """The other fields of a grid, with their value here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A quantity over one or two fields."""

    quantity: str
    over: tuple[str, ...]


def choices(found: Ensemble, quantity: str | None = None, over: str | None = None) -> list[Choice]:
    """What is asked for; else error and energy over the first one or two fields.

    SpringcheckError where there is no such quantity or field.
    """
    if quantity is not None and quantity not in TITLES:
        close = nearest(quantity, TITLES)
        raise SpringcheckError(f"--quantity {quantity}: {', '.join(TITLES)} can be drawn{close}")
    fields = found.fields[:2] if over is None else tuple(name.strip() for name in over.split(","))
    if not set(fields) <= set(found.fields) or len(fields) != len(set(fields)) or len(fields) > 2:
        raise SpringcheckError(f"--over {over}: one or two of {', '.join(found.fields)} are needed")
    names = DRAWN if quantity is None else (quantity,)
    return [Choice(quantity=name, over=fields) for name in names]


def parts(found: Ensemble, choice: Choice) -> Iterator[tuple[str, Line | Map]]:
    """What is shown of each method, read one by one; methods without a number are left out."""
    for tally in found.tallies:
        cells = found.of(tally.method)
        part = reduced(cells, found, choice)
        if np.isfinite(part.y if isinstance(part, Line) else part.values).any():
            yield tally.method, part


def reduced(cells: Columns, found: Ensemble, choice: Choice) -> Line | Map:
    """What is shown of the cells of one method; the other fields of a grid have the value in their middle."""
    keep = np.ones(len(cells[choice.quantity]), dtype=bool)
    fixed = {}
    for name in found.fields:
        if found.grid and name not in choice.over:
            known = np.unique(cells[name])
            fixed[name] = float(known[len(known) // 2])
            keep &= cells[name] == fixed[name]
    values = np.asarray(cells[choice.quantity][keep], np.float64)
    values = np.abs(values) if choice.quantity in SIZES else values
    over = [cells[name][keep] for name in choice.over]
    if len(over) == 1:
        return _line(over[0], values, fixed, joined=found.grid or len(found.fields) == 1)
    return _map(over[0], over[1], values, fixed, grid=found.grid)


def even_in_logarithm(values: Floats) -> bool:
    """Whether values are spread over a logarithmic axis rather than over a linear one."""
    values = np.unique(values)
    low, high = float(values[0]), float(values[-1])
    if low <= 0 or high < 3 * low:
        return False
    middle = np.log(float(np.median(values)))
    return bool(abs(middle - np.log(low * high) / 2) < abs(middle - np.log((low + high) / 2)))


def _line(x: Floats, y: Floats, fixed: Mapping[str, float], *, joined: bool) -> Line:
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    most = MOST_POINTS if joined else len(x) // TOGETHER
    if len(x) <= max(most, FEW):
        return Line(x=x, y=y, low=y, high=y, joined=joined, fixed=fixed)
    pieces = [np.array_split(z, min(most, MOST_POINTS)) for z in (x, y)]
    known = [(float(np.median(a)), b[np.isfinite(b)]) for a, b in zip(*pieces, strict=True)]
    low, middle, high = (
        np.array([f(b) if len(b) else np.nan for _, b in known]) for f in (np.min, np.median, np.max)
    )
    return Line(x=np.array([a for a, _ in known]), y=middle, low=low, high=high, joined=True, fixed=fixed)


def _map(x: Floats, y: Floats, values: Floats, fixed: Mapping[str, float], *, grid: bool) -> Map:
    most = MOST_TILES if grid else int(np.clip(np.sqrt(len(values) / TOGETHER), 2, MOST_TILES))
    (us, i), (vs, j) = (_tiles(z, most, grid=grid) for z in (x, y))
    found = np.full(len(us) * len(vs), np.nan)
    good = np.isfinite(values)
    tile, values = (j * len(us) + i)[good], values[good]
    order = np.argsort(tile, kind="stable")
    held, first = np.unique(tile[order], return_index=True)
    for which, mine in zip(held, np.split(values[order], first[1:]), strict=True):
        found[which] = np.median(mine)
    return Map(x=us, y=vs, values=found.reshape(len(vs), len(us)), fixed=fixed)


def _tiles(x: Floats, most: int, *, grid: bool) -> tuple[Floats, np.ndarray]:
    """Centres of tiles along a field, and the tile of each cell."""
    log = even_in_logarithm(x)
    if grid:
        values, index = np.unique(x, return_inverse=True)
        together = -(-len(values) // most)
        ends = np.arange(0, len(values), together)
        last = np.minimum(ends + together, len(values)) - 1
        pair = values[ends], values[last]
        return (np.sqrt(pair[0] * pair[1]) if log else (pair[0] + pair[1]) / 2), index.ravel() // together
    u = np.log(x) if log else x
    bounds = np.linspace(float(np.min(u)), float(np.max(u)), most + 1)
    centres = (bounds[1:] + bounds[:-1]) / 2
    index = np.clip(np.searchsorted(bounds, u, side="right") - 1, 0, most - 1)
    return (np.exp(centres) if log else centres), index
