"""Any quantity of an ensemble over one or two of the fields that were varied, in figures and in the page."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from springcheck.errors import SpringcheckError, nearest
from springcheck.figures.charts import GUIDE, Bank, Chart, Curve, Rule, Scale, Tiles
from springcheck.figures.looks import scheme_of
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats
from springcheck.physics.exact import has_true_motion
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.schemes import known
from springcheck.studies.ensemble.measure import OUTCOMES
from springcheck.studies.ensemble.result import CELL_SCALE, Columns, Ensemble

TITLES = {
    "max_error": "largest error, relative to the initial energy norm",
    "energy_drift": f"|H - H0| / ({CELL_SCALE}) where it is largest",
    "q0": "q of the first particle at the end",
    "p0": "p of the first particle at the end",
    "steps": "steps with finite numbers",
    "outcome": "how the run ended",
}
"""Quantities that can be drawn, as axes name them."""

SIZES = ("max_error", "energy_drift")
"""Quantities drawn by their magnitude, over many powers of ten, and by default."""

MOST_SHOWN_SIZE = 1e3
"""Largest relative size that a chart shows: beyond it nothing can be read off."""

MOST_POINTS, MOST_TILES = 400, 64
FEW_POINTS = 100
"""Points up to which a curve shows each of them."""
FEWEST_BINNED = 9
"""Fewest random samples in a point or tile, on average."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reduced:
    """Values of one method over one field (i,) or two (j, i), of many cells their median; NaN for none."""

    places: tuple[Floats, ...]
    """Increasing values of the fields: x (i,), or x and y (j,)."""
    values: Floats
    ends: tuple[Floats, Floats]
    """Least and largest value at each place of one field."""
    joined: bool = True
    """Whether neighbours differ in these fields alone; otherwise no line joins them."""


def _title(quantity: str, scene: Scene) -> str:
    """Title of a quantity; with friction or a drive the energy is compared with the exact solution's."""
    if quantity == "energy_drift" and not scene.system.keeps_energy and has_true_motion(scene):
        return TITLES[quantity].replace("H0", "H exact")
    return TITLES[quantity]


def fields_over(found: Ensemble, over: str | None = None) -> tuple[str, ...]:
    """The fields of `over`, or else the first one or two.  SpringcheckError for an unknown field."""
    fields = found.fields[:2] if over is None else tuple(name.strip() for name in over.split(","))
    if not set(fields) <= set(found.fields) or len(fields) != len(set(fields)) or len(fields) > 2:
        raise SpringcheckError(f"--over {over}: one or two of {', '.join(found.fields)} are needed")
    return fields


def fixed(cells: Columns, found: Ensemble, over: Sequence[str]) -> dict[str, float]:
    """The other fields of a grid, each at its middle value."""
    others = {name: np.unique(cells[name]) for name in found.fields if found.grid and name not in over}
    return {name: float(known[len(known) // 2]) for name, known in others.items()}


def reduced(cells: Columns, found: Ensemble, quantity: str, over: Sequence[str]) -> Reduced:
    """The cells of one method to draw, with the other fields of a grid at their middle value."""
    keep = np.ones(len(cells[quantity]), dtype=bool)
    for name, value in fixed(cells, found, over).items():
        keep &= cells[name] == value
    values = np.asarray(cells[quantity][keep], np.float64)
    values = np.abs(values) if quantity in SIZES else values
    along = [cells[name][keep] for name in over]
    if len(along) == 1:
        return _line(along[0], values, joined=found.grid or len(found.fields) == 1)
    return _map(along[0], along[1], values, grid=found.grid)


def even_in_logarithm(values: Floats) -> bool:
    """Whether values are spaced evenly in the logarithm rather than linearly."""
    values = np.unique(values)
    low, high = float(values[0]), float(values[-1])
    if low <= 0 or high < 3 * low:
        return False
    middle = np.log(float(np.median(values)))
    return bool(abs(middle - np.log(low * high) / 2) < abs(middle - np.log((low + high) / 2)))


def _line(x: Floats, y: Floats, *, joined: bool) -> Reduced:
    order = np.argsort(x, kind="stable")
    x, y = x[order], y[order]
    most = MOST_POINTS if joined else len(x) // FEWEST_BINNED
    if len(x) <= max(most, FEW_POINTS):
        return Reduced(places=(x,), values=y, ends=(y, y), joined=joined)
    pieces = [np.array_split(z, min(most, MOST_POINTS)) for z in (x, y)]
    known = [(float(np.median(a)), b[np.isfinite(b)]) for a, b in zip(*pieces, strict=True)]
    low, middle, high = (
        np.array([f(b) if len(b) else np.nan for _, b in known]) for f in (np.min, np.median, np.max)
    )
    at = np.array([a for a, _ in known])
    return Reduced(places=(at,), values=middle, ends=(low, high))


def _map(x: Floats, y: Floats, values: Floats, *, grid: bool) -> Reduced:
    most = MOST_TILES if grid else int(np.clip(np.sqrt(len(values) / FEWEST_BINNED), 2, MOST_TILES))
    (us, i), (vs, j) = (_tiles(z, most, grid=grid) for z in (x, y))
    found = np.full(len(us) * len(vs), np.nan)
    good = np.isfinite(values)
    tile, values = (j * len(us) + i)[good], values[good]
    order = np.argsort(tile, kind="stable")
    held, first = np.unique(tile[order], return_index=True)
    for which, mine in zip(held, np.split(values[order], first[1:]), strict=True):
        found[which] = np.median(mine)
    plane = found.reshape(len(vs), len(us))
    return Reduced(places=(us, vs), values=plane, ends=(plane, plane))


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


SHADES = 7
"""Number of shades of a map, from small to large values."""

SIGNED_SHADES = ("#2166ac", "#67a9cf", "#d1e5f0", "#f7f7f7", "#fddbc7", "#ef8a62", "#b2182b")
"""Shades of a map of numbers of both signs, by Brewer."""

H_LIMIT = "limit h \N{GREEK SMALL LETTER OMEGA}"

FIELD_WORDS = {
    "stiffness": ("stiffness k", {"md": "kJ/mol/nm2", "si": "N/m"}),
    "mass": ("mass m", {"md": "u", "si": "kg"}),
    "step": ("step h", {"md": "ps", "si": "s"}),
    "steps": ("number of steps", {}),
}  # fmt: skip
"""Words for the last part of a field's name, and its unit."""


def banks(found: Ensemble, *, quantity: str | None = None, over: str | None = None) -> list[Bank]:
    """Charts of error and energy, or of one `quantity`, over one or two fields: a bank for each.

    SpringcheckError where there is no such quantity or field.
    """
    if quantity is not None and quantity not in TITLES:
        close = nearest(quantity, TITLES)
        raise SpringcheckError(f"--quantity {quantity}: {', '.join(TITLES)} can be drawn{close}")
    out, fields = [], fields_over(found, over)
    for name in SIZES if quantity is None else (quantity,):
        every = {x.method: reduced(found.of(x.method), found, name, fields) for x in found.tallies}
        # methods without a finite number are left out
        shown = {method: one for method, one in every.items() if np.isfinite(one.values).any()}
        if not shown:
            continue
        lines = len(fields) == 1
        charts = (_lines if lines else _maps)(found.scene, name, fields, shown)
        others = fixed(found.of(next(iter(shown))), found, fields)
        of = "" if over is None else "-over-" + "-".join(fields)
        title = "Methods drawn" if lines else f"Colour: {_title(name, found.scene)}"
        out.append(
            Bank(
                name=f"ensemble-{name}{of}", title=title, charts=charts,
                heading=_heading(found.scene, name, fields, shown, others),
                columns=1 if lines else min(3, len(charts)), size=(6.8, 4.2) if lines else None,
            )
        )  # fmt: skip
    return out


def _heading(
    scene: Scene, quantity: str, over: Sequence[str], shown: Mapping[str, Reduced],
    others: Mapping[str, float],
) -> str:  # fmt: skip
    """The quantity, the fields on the axes, and the values of the fields that are not shown."""
    typical = {method: float(np.nanmedian(one.values)) for method, one in shown.items()}
    best = min(typical, key=lambda x: abs(typical[x]))
    fields = " and ".join(named(x, scene) for x in over)
    said = [f"{scene.title}: {_title(quantity, scene).partition(',')[0]} over {fields}"]
    if len(shown) > 1 and quantity in SIZES:
        same = [
            x for x in typical if x != best and abs(typical[x] - typical[best]) <= 1e-9 * abs(typical[best])
        ]
        with_it = f" and {len(same)} like it" if same else ""
        said.append(f"smallest by {best}{with_it}, {typical[best]:.1g} in the middle")
    if others:
        said.append("at " + ", ".join(f"{named(name, scene)} = {x:.4g}" for name, x in others.items()))
    if any(np.any(x.ends[0] < x.ends[1]) for x in shown.values()):
        said.append("bands: all cells; lines: their median")
    return "; ".join(said)


def named(field: str, scene: Scene) -> str:
    """Name of a field on an axis: "spring.0.stiffness" is the stiffness k of spring 0."""
    *table, last = field.split(".")
    words, of = FIELD_WORDS.get(last, (last, {}))
    whose = f" of {' '.join(table)}" if table and table[-1].isdigit() else ""
    return with_unit(f"{words}{whose}", of.get(scene.units, ""))


def _limits(scene: Scene, method: str) -> dict[str, float]:
    """The limit of h omega of a method's scheme on a single spring, and each field's value that meets it."""
    walls, found = [x for x in scene.terms if isinstance(x, WallSpring)], known().get(scheme_of(method))
    alone = scene.n == len(scene.terms) == len(walls) == 1 and len(walls[0]) == 1 and walls[0].k[0] > 0
    if not alone or found is None or not 0 < found.limit < np.inf:
        return {}
    k, longest = float(walls[0].k[0]), found.limit * float(np.sqrt(scene.m[0] / walls[0].k[0]))
    return {
        H_LIMIT: found.limit,
        "spring.0.stiffness": k * (longest / scene.step) ** 2,
        "time.step": longest,
    }


def _lines(scene: Scene, quantity: str, fields: Sequence[str], shown: Mapping[str, Reduced]) -> list[Chart]:
    title, (over,) = _title(quantity, scene), fields
    every = [np.concatenate([one.values, *one.ends]) for one in shown.values()]
    seen: set[str] = set()
    curves = []
    for method, one in shown.items():
        scheme = scheme_of(method)
        curves.append(
            Curve(
                name=method, group=scheme, x=one.places[0], y=one.values, line=one.joined,
                dots=not one.joined, marks=True, over=scheme in seen and one.joined,
                band=None if scheme in seen or np.array_equal(*one.ends, equal_nan=True) else one.ends,
            )
        )  # fmt: skip
        seen.add(scheme)
    limits = {at[over]: f"{H_LIMIT} = {at[H_LIMIT]:.3g}" for x in shown if over in (at := _limits(scene, x))}
    low, high = (f([f(one.places) for one in shown.values()]) for f in (np.min, np.max))
    chart = Chart(
        title=f"{title[:1].upper()}{title[1:]}, over {over}.",
        x=Scale(name=named(over, scene), log=all(even_in_logarithm(*one.places) for one in shown.values())),
        y=_axis(quantity, scene, every),
        curves=curves,
        rules=[Rule(axis="x", at=at, name=name) for at, name in limits.items() if low < at < high],
    )
    return [chart]


def _axis(quantity: str, scene: Scene, values: Sequence[Floats]) -> Scale:
    """The axis of a quantity of each method, truncated where larger values are uninformative."""
    name, every = _title(quantity, scene).partition(",")[0], np.concatenate(values)
    good = every[np.isfinite(every)]
    if quantity == "outcome":
        return Scale(name=name, names=OUTCOMES)
    least = good[good > 0]
    low, high = float(np.min(good)), float(np.max(good))
    if low >= 0 and len(least) and high > 100 * (first := float(np.min(least))):
        return Scale(name=name, log=True, shown=(first / 2, min(2 * high, max(MOST_SHOWN_SIZE, 4 * first))))
    most = min(_most(values), MOST_SHOWN_SIZE * float(np.median(np.abs(good))))
    clipped = low < 0 < most < max(-low, high)
    return Scale(name=name, shown=(max(low, -most), min(high, most)) if clipped else None)


def _most(values: Sequence[Floats]) -> float:
    """Twice the largest size of the median method: one that diverges would hide the others."""
    sizes = sorted(float(np.max(np.abs(x[np.isfinite(x)]), initial=0.0)) for x in values)
    return 2 * sizes[(len(sizes) - 1) // 2]


def _maps(scene: Scene, quantity: str, over: Sequence[str], shown: Mapping[str, Reduced]) -> list[Chart]:
    kinds, bounds = _kinds(quantity, [one.values.ravel() for one in shown.values()])
    charts = []
    for method, one in shown.items():
        rows = np.searchsorted(bounds, one.values, side="right")
        x, y = (
            Scale(name=named(field, scene), values=at.tolist())
            for field, at in zip(over, one.places, strict=True)
        )
        charts.append(
            Chart(
                title=f"{method}.",
                short=method,
                x=x,
                y=y,
                tiles=Tiles(kinds=kinds, rows=np.where(np.isnan(one.values), -1, rows).tolist()),
                curves=_across(scene, over, one, _limits(scene, method)),
            )
        )
    return charts


def _across(scene: Scene, over: Sequence[str], one: Reduced, at: Mapping[str, float]) -> list[Curve]:
    """The line at the limit of h omega on a map of stiffness against step, in coordinates of its tiles."""
    if {*over, H_LIMIT} != set(at):
        return []
    flat = over[0] == "time.step"
    steps, ks = one.places if flat else one.places[::-1]
    k = np.geomspace(float(ks[0]), float(ks[-1]), 200)
    h = at[H_LIMIT] * np.sqrt(float(scene.m[0]) / k)
    inside = (h >= steps[0]) & (h <= steps[-1])
    if np.count_nonzero(inside) < 2:
        return []
    at_k, at_h = (np.interp(v[inside], z, np.arange(len(z))) for v, z in ((k, ks), (h, steps)))
    x, y = (at_h, at_k) if flat else (at_k, at_h)
    return [Curve(name=f"{H_LIMIT} = {at[H_LIMIT]:.3g}", group=GUIDE, x=x, y=y)]


def _kinds(quantity: str, values: Sequence[Floats]) -> tuple[list[tuple[str, str]], Floats]:
    """Classes of values, at most as many as there are shades, and the bounds between them."""
    every = np.concatenate(values)
    every = every[np.isfinite(every)]
    if quantity == "outcome":
        return list(zip(OUTCOMES, ("good", "limit", "wrong"), strict=False)), np.arange(1.0, len(OUTCOMES))
    if quantity in SIZES:
        return _decades(np.minimum(every[every > 0], MOST_SHOWN_SIZE))
    low, high = float(np.min(every)), float(np.max(every))
    shades: Sequence[str] = [f"s{i}" for i in range(SHADES)]
    if low < 0:
        high = min(max(-low, high), _most(values)) or max(-low, high)
        low, shades = -high, SIGNED_SHADES
    bounds = np.linspace(low, high if high > low else low + 1, SHADES + 1)
    names = [f"{a:.3g} to {b:.3g}" for a, b in itertools.pairwise(bounds)]
    return list(zip(names, shades, strict=True)), bounds[1:-1]


def _decades(values: Floats) -> tuple[list[tuple[str, str]], Floats]:
    """Classes of values by powers of ten, at most one for each shade, and the bounds between them."""
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
