"""Any quantity of an ensemble over one or two of the fields that were varied, in figures and in the page."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from springcheck.figures.charts import GUIDE, Bank, Chart, Curve, Rule, Scale, Tiles
from springcheck.figures.looks import scheme_of
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.studies.ensemble.measure import OUTCOMES
from springcheck.studies.ensemble.result import Ensemble
from springcheck.studies.ensemble.shown import (
    MOST,
    SIZES,
    TITLES,
    Choice,
    Line,
    Map,
    choices,
    even_in_logarithm,
    parts,
)  # fmt: skip

SHADES = 7
"""Of a map, from small to large numbers."""

SIGNED_SHADES = ("#2166ac", "#67a9cf", "#d1e5f0", "#f7f7f7", "#fddbc7", "#ef8a62", "#b2182b")
"""Of a map of numbers of both signs, by Brewer."""

LIMIT_NAME = "limit h \N{GREEK SMALL LETTER OMEGA} = 2"

FIELD_WORDS = {
    "stiffness": ("stiffness k", {"md": "kJ/mol/nm2", "si": "N/m"}),
    "mass": ("mass m", {"md": "u", "si": "kg"}),
    "step": ("step h", {"md": "ps", "si": "s"}),
    "steps": ("number of steps", {}),
}  # fmt: skip
"""The last part of a field's name in words, and its unit."""


def banks(found: Ensemble, *, quantity: str | None = None, over: str | None = None) -> list[Bank]:
    """Error and energy, or one `quantity`, over one or two fields: a bank for each.

    SpringcheckError where there is no such quantity or field.
    """
    out = []
    for choice in choices(found, quantity, over):
        shown = dict(parts(found, choice))
        if not shown:
            continue
        lines = {method: one for method, one in shown.items() if isinstance(one, Line)}
        maps = {method: one for method, one in shown.items() if isinstance(one, Map)}
        charts = [_lines(found.scene, choice, lines)] if lines else _maps(found.scene, choice, maps)
        fields = "" if over is None else "-over-" + "-".join(choice.over)
        title = "Methods drawn" if lines else f"Colour: {TITLES[choice.quantity]}"
        out.append(
            Bank(
                name=f"ensemble-{choice.quantity}{fields}", title=title, charts=charts,
                heading=_heading(found.scene, choice, shown), columns=1 if lines else min(3, len(charts)),
                size=(6.8, 4.2) if lines else None,
            )
        )  # fmt: skip
    return out


def _heading(scene: Scene, choice: Choice, shown: Mapping[str, Line | Map]) -> str:
    """What was found, over what, and at which values of the fields that are not shown."""
    typical = {x: float(np.nanmedian(y.y if isinstance(y, Line) else y.values)) for x, y in shown.items()}
    best = min(typical, key=lambda x: abs(typical[x]))
    over = " and ".join(named(x, scene) for x in choice.over)
    said = [f"{scene.title}: {TITLES[choice.quantity].partition(',')[0]} over {over}"]
    if len(shown) > 1 and choice.quantity in SIZES:
        same = [
            x for x in typical if x != best and abs(typical[x] - typical[best]) <= 1e-9 * abs(typical[best])
        ]
        with_it = f" and {len(same)} like it" if same else ""
        said.append(f"smallest by {best}{with_it}, {typical[best]:.1g} in the middle")
    one = next(iter(shown.values()))
    if one.fixed:
        said.append("at " + ", ".join(f"{named(name, scene)} = {x:.4g}" for name, x in one.fixed.items()))
    if any(isinstance(x, Line) and np.any(x.low < x.high) for x in shown.values()):
        said.append("bands: all cells; lines: their median")
    return "; ".join(said)


def named(field: str, scene: Scene) -> str:
    """A field as an axis names it: "spring.0.stiffness" is the stiffness k of spring 0."""
    *table, last = field.split(".")
    words, of = FIELD_WORDS.get(last, (last, {}))
    whose = f" of {' '.join(table)}" if table and table[-1].isdigit() else ""
    return with_unit(f"{words}{whose}", of.get(scene.units, ""))


def _limits(scene: Scene) -> dict[str, float]:
    """Of one spring, where h omega = 2 by the fields that move it."""
    walls = [term for term in scene.terms if isinstance(term, WallSpring)]
    if scene.n > 1 or len(scene.terms) != 1 or not walls or len(walls[0]) != 1 or not walls[0].k[0] > 0:
        return {}
    m, k, h = float(scene.m[0]), float(walls[0].k[0]), abs(scene.step)
    return {"spring.0.stiffness": 4 * m / h**2, "time.step": float(2 * np.sqrt(m / k))}


def _lines(scene: Scene, choice: Choice, shown: Mapping[str, Line]) -> Chart:
    title, (over,) = TITLES[choice.quantity], choice.over
    y = _axis(
        choice.quantity, np.concatenate([x for one in shown.values() for x in (one.low, one.y, one.high)])
    )
    seen: set[str] = set()
    curves = []
    for method, one in shown.items():
        scheme = scheme_of(method)
        curves.append(
            Curve(
                name=method, group=scheme, x=one.x, y=one.y, line=one.joined, dots=not one.joined,
                marks=True, over=scheme in seen and one.joined,
                band=None if scheme in seen or np.array_equal(one.low, one.high, equal_nan=True)
                else (one.low, one.high),
            )
        )  # fmt: skip
        seen.add(scheme)
    at = _limits(scene).get(over)
    low, high = (f([f(one.x) for one in shown.values()]) for f in (np.min, np.max))
    return Chart(
        title=f"{title[:1].upper()}{title[1:]}, over {over}.",
        x=Scale(name=named(over, scene), log=all(even_in_logarithm(one.x) for one in shown.values())),
        y=y,
        curves=curves,
        rules=[Rule(axis="x", at=at, name=LIMIT_NAME)] if at is not None and low < at < high else [],
    )


def _axis(quantity: str, values: Floats) -> Scale:
    """Of a quantity, up to where nothing is read off it."""
    name, good = TITLES[quantity].partition(",")[0], values[np.isfinite(values)]
    if quantity == "outcome":
        return Scale(name=name, names=OUTCOMES)
    least = good[good > 0]
    low, high = float(np.min(good)), float(np.max(good))
    if low >= 0 and len(least) and high > 100 * (first := float(np.min(least))):
        return Scale(name=name, log=True, shown=(first / 2, min(2 * high, max(MOST, 4 * first))))
    if max(-low, high) > MOST:
        return Scale(name=name, shown=(max(low, -MOST), min(high, MOST)))
    return Scale(name=name)


def _maps(scene: Scene, choice: Choice, shown: Mapping[str, Map]) -> list[Chart]:
    kinds, bounds = _kinds(choice.quantity, [one.values.ravel() for one in shown.values()])
    charts = []
    for method, one in shown.items():
        rows = np.searchsorted(bounds, one.values, side="right")
        limit = _across(scene, choice, one)
        charts.append(
            Chart(
                title=f"{method}.",
                short=method,
                x=Scale(name=named(choice.over[0], scene), values=one.x.tolist()),
                y=Scale(name=named(choice.over[1], scene), values=one.y.tolist()),
                tiles=Tiles(kinds=kinds, rows=np.where(np.isnan(one.values), -1, rows).tolist()),
                curves=limit,
            )
        )
    return charts


def _across(scene: Scene, choice: Choice, one: Map) -> list[Curve]:
    """Where h omega = 2 on a map of stiffness and step, by the places of its tiles."""
    if set(choice.over) != set(_limits(scene)):
        return []
    flat = choice.over[0] == "time.step"
    steps, ks = (one.x, one.y) if flat else (one.y, one.x)
    k = np.geomspace(float(ks[0]), float(ks[-1]), 200)
    h = 2 * np.sqrt(float(scene.m[0]) / k)
    inside = (h >= steps[0]) & (h <= steps[-1])
    if np.count_nonzero(inside) < 2:
        return []
    at_k, at_h = (np.interp(v[inside], z, np.arange(len(z))) for v, z in ((k, ks), (h, steps)))
    x, y = (at_h, at_k) if flat else (at_k, at_h)
    return [Curve(name=LIMIT_NAME, group=GUIDE, x=x, y=y)]


def _kinds(quantity: str, values: Sequence[Floats]) -> tuple[list[tuple[str, str]], Floats]:
    """Kinds of numbers, as many as there are shades at most, and the bounds between them."""
    every = np.concatenate(values)
    every = every[np.isfinite(every)]
    if quantity == "outcome":
        return list(zip(OUTCOMES, ("good", "limit", "wrong"), strict=False)), np.arange(1.0, len(OUTCOMES))
    if quantity in SIZES:
        return _decades(np.minimum(every[every > 0], MOST))
    low, high = float(np.min(every)), float(np.max(every))
    shades: Sequence[str] = [f"s{i}" for i in range(SHADES)]
    if low < 0:
        # of methods that explode as much as twice what the middle one shows
        sizes = sorted(float(np.max(np.abs(x[np.isfinite(x)]), initial=0.0)) for x in values)
        high = min(max(-low, high), 2 * sizes[(len(sizes) - 1) // 2]) or max(-low, high)
        low, shades = -high, SIGNED_SHADES
    bounds = np.linspace(low, high if high > low else low + 1, SHADES + 1)
    names = [f"{a:.3g} to {b:.3g}" for a, b in itertools.pairwise(bounds)]
    return list(zip(names, shades, strict=True)), bounds[1:-1]


def _decades(values: Floats) -> tuple[list[tuple[str, str]], Floats]:
    """Kinds of numbers by powers of ten, as few as there are shades, and the bounds between them."""
    if not len(values):
        return [("0", "s0")], np.empty(0)
    first, last = (int(np.floor(np.log10(f(values)))) for f in (np.min, np.max))
    wide = -(-(last - first + 1) // SHADES)
    exponents = [first + wide * i for i in range(1, SHADES) if first + wide * i <= last]
    names = [f"below 1e{exponents[0]}" if exponents else f"below 1e{last + 1}"]
    names += [f"1e{a} to 1e{b}" for a, b in itertools.pairwise(exponents)]
    names += [f"1e{exponents[-1]} and above"] if exponents else []
    shades = [f"s{round(i * (SHADES - 1) / max(1, len(names) - 1))}" for i in range(len(names))]
    return list(zip(names, shades, strict=True)), 10.0 ** np.array(exponents, np.float64)
