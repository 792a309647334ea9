"""What a study of stability keeps in a store, and the same read back: every array and number, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from springcheck.store import Table
from springcheck.studies.stability.costs import Cost
from springcheck.studies.stability.limits import Limit
from springcheck.studies.stability.regions import Region
from springcheck.studies.stability.resonance import Resonance

LIMITS, REGIONS = "stability/limits/", "stability/regions/"
RESONANCES, COSTS = "stability/resonances/", "stability/costs/"
"""Beginnings of the tables' names; the method follows."""

_OF_LIMIT = (
    "scheme", "limit", "theory", "bound", "growth_above", "growth_predicted", "growth_below",
    "growth_below_predicted", "edge", "edge_predicted",
)  # fmt: skip
_OF_REGION = ("off", "undecided", "wrong")
_OF_COST: tuple[tuple[str, Any], ...] = (
    ("family", object), ("method", object), ("ratio", float), ("step", float), ("steps", np.int64),
    ("rejected", np.int64), ("force_calls", np.int64), ("error", float), ("outcome", object),
)  # fmt: skip


def of_limit(x: Limit) -> Table:
    """A limit: radii by h w, and the rest as attributes."""
    return Table(
        name=f"{LIMITS}{x.method}",
        columns={"h_w": x.turn, "radius": x.radius, "radius_predicted": x.radius_predicted},
        attributes={name: getattr(x, name) for name in _OF_LIMIT},
        signal="radius",
        axes=("h_w",),
        auxiliary=("radius_predicted",),
        log=("h_w", "radius"),
    )


def of_region(x: Region) -> Table:
    """A region: radii and stability (j, i) by damping ratio (j,) and h w (i,).

    Its axes are decades, evenly spaced, because H5Web draws every image on even axes.
    """
    return Table(
        name=f"{REGIONS}{x.method}",
        columns={
            "damping_ratio": x.ratio,
            "h_w": x.turn,
            "log10_damping_ratio": np.log10(x.ratio),
            "log10_h_w": np.log10(x.turn),
            "radius": x.radius,
            "radius_predicted": x.radius_predicted,
            "stable": x.stable,
            "stable_predicted": x.stable_predicted,
        },
        attributes={name: getattr(x, name) for name in _OF_REGION},
        signal="radius",
        axes=("log10_damping_ratio", "log10_h_w"),
        auxiliary=("radius_predicted",),
        log=("radius",),
    )


def of_resonance(x: Resonance) -> Table:
    """A resonance: radii by h w of the fast spring, and the bands (b, 2), from and to."""
    return Table(
        name=f"{RESONANCES}{x.method}",
        columns={
            "h_w": x.turn,
            "radius": x.radius,
            "radius_predicted": x.radius_predicted,
            "bands": np.reshape(x.bands, (-1, 2)),
            "bands_predicted": np.reshape(x.bands_predicted, (-1, 2)),
        },
        attributes={"scene": x.scene},
        signal="radius",
        axes=("h_w",),
        auxiliary=("radius_predicted",),
    )


def to_limit(table: Table) -> Limit:
    """The limit of such a table.  KeyError where it is another's."""
    return Limit(
        method=table.name.removeprefix(LIMITS),
        turn=_column(table, "h_w"),
        radius=_column(table, "radius"),
        radius_predicted=_column(table, "radius_predicted"),
        **{name: cast(Any, table.attributes[name]) for name in _OF_LIMIT},
    )


def to_region(table: Table) -> Region:
    """The region of such a table.  KeyError where it is another's."""
    return Region(
        method=table.name.removeprefix(REGIONS),
        turn=_column(table, "h_w"),
        ratio=_column(table, "damping_ratio"),
        radius=_column(table, "radius"),
        radius_predicted=_column(table, "radius_predicted"),
        stable=_column(table, "stable"),
        stable_predicted=_column(table, "stable_predicted"),
        **{name: cast(Any, table.attributes[name]) for name in _OF_REGION},
    )


def to_resonance(table: Table) -> Resonance:
    """The resonance of such a table.  KeyError where it is another's."""
    bands, predicted = (
        tuple((float(a), float(b)) for a, b in _column(table, name)) for name in ("bands", "bands_predicted")
    )
    return Resonance(
        method=table.name.removeprefix(RESONANCES),
        scene=str(table.attributes["scene"]),
        turn=_column(table, "h_w"),
        radius=_column(table, "radius"),
        radius_predicted=_column(table, "radius_predicted"),
        bands=bands,
        bands_predicted=predicted,
    )


def of_costs(rows: Sequence[Cost]) -> Table:
    """The runs of one method over the ratios of a family."""
    return Table(
        name=f"{COSTS}{rows[0].method}",
        columns={name: np.array([getattr(x, name) for x in rows], dtype=kind) for name, kind in _OF_COST},
    )


def to_costs(table: Table) -> tuple[Cost, ...]:
    """The runs of such a table.  KeyError where it is another's."""
    columns = {name: _column(table, name).tolist() for name, _ in _OF_COST}
    return tuple(Cost(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True))


def _column(table: Table, name: str) -> np.ndarray:
    return np.asarray(table.columns[name])
