"""Error and energy over the fields that were varied, in the report page."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Scale, Tiles
from springcheck.figures.looks import scheme_of
from springcheck.physics.arrays import Floats
from springcheck.studies.ensemble.result import Ensemble
from springcheck.studies.ensemble.shown import (
    MOST,
    TITLES,
    Choice,
    Line,
    Map,
    choices,
    even_in_logarithm,
    parts,
)

SHADES = 7
"""Of a map, from small to large numbers."""


def banks(found: Ensemble) -> list[Bank]:
    """Charts over one field in one bank; maps over the first two a bank for each quantity."""
    if found.path is None:
        return []
    charts, maps = [], []
    for choice in choices(found):
        shown = dict(parts(found, choice))
        lines = {method: one for method, one in shown.items() if isinstance(one, Line)}
        tiles = {method: one for method, one in shown.items() if isinstance(one, Map)}
        if lines:
            charts.append(_chart(choice, lines))
        if tiles:
            maps.append(Bank(title=f"Colour: {TITLES[choice.quantity]}", charts=_maps(choice, tiles)))
    return [Bank(title="Methods drawn", charts=charts), *maps] if charts else maps


def _chart(choice: Choice, shown: dict[str, Line]) -> Chart:
    title, (over,) = TITLES[choice.quantity], choice.over
    return Chart(
        title=f"{title[:1].upper()}{title[1:]}, over {over}.",
        x=Scale(name=over, log=all(even_in_logarithm(one.x) for one in shown.values())),
        y=Scale(name=title.partition(",")[0], log=True),
        curves=[
            Curve(
                name=method,
                group=scheme_of(method),
                x=one.x,
                y=one.y,
                line=one.joined,
                marks=len(one.x) < 100,
            )
            for method, one in shown.items()
        ],
    )


def _maps(choice: Choice, shown: dict[str, Map]) -> list[Chart]:
    every = np.concatenate([one.values.ravel() for one in shown.values()])
    kinds, bounds = _decades(np.minimum(every[every > 0], MOST))
    charts = []
    for method, one in shown.items():
        rows = np.searchsorted(bounds, one.values, side="right")
        charts.append(
            Chart(
                title=method,
                x=Scale(name=choice.over[0], values=one.x.tolist()),
                y=Scale(name=choice.over[1], values=one.y.tolist()),
                tiles=Tiles(kinds=kinds, rows=np.where(np.isnan(one.values), -1, rows).tolist()),
            )
        )
    return charts


def _decades(values: Floats) -> tuple[list[tuple[str, str]], Floats]:
    """Kinds of numbers by powers of ten, as few as there are shades, and the bounds between them."""
    if not len(values):
        return [("0", "s0")], np.empty(0)
    first, last = (int(np.floor(np.log10(f(values)))) for f in (np.min, np.max))
    wide = -(-(last - first + 1) // SHADES)
    exponents = [first + wide * i for i in range(1, SHADES) if first + wide * i <= last]
    names = [f"below 1e{exponents[0]}" if exponents else f"below 1e{last + 1}"]
    names += [f"1e{a} to 1e{b}" for a, b in pairwise(exponents)]
    names += [f"1e{exponents[-1]} and above"] if exponents else []
    shades = [f"s{round(i * (SHADES - 1) / max(1, len(names) - 1))}" for i in range(len(names))]
    return list(zip(names, shades, strict=True)), 10.0 ** np.array(exponents, np.float64)
