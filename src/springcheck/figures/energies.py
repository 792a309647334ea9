"""Energy and error over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from springcheck.figures import frames, naming
from springcheck.figures.charts import Bank, Chart, Rule, Scale
from springcheck.figures.frames import Frame
from springcheck.figures.motion import Exact, periods, true_motion
from springcheck.figures.naming import NAME_HIGH
from springcheck.figures.overlay import Runs, exact_curve
from springcheck.figures.portraits import extremes
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.norm import energy_scale
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

MOST_DRAWN = 1e3
"""Energies and errors, relative to those of the start, beyond which a chart shows nothing useful."""

LARGE_ENERGY = 30.0
"""Multiple of the right energy up to which a run sets the scale; larger ones leave the chart."""

DECADES = 100.0
"""Ratio of largest to smallest energy from which on the scale is logarithmic."""

LEAST_DRAWN = 1e-4
"""Lower end of the logarithmic scale, relative to the initial energy."""

MOST_TURNING = 8
"""Particles among which some must turn for their motion to be called an orbit."""

ORBIT_WORDS = {
    "gains energy": "gain energy", "loses energy": "lose energy",
    "conserves it on average": "conserve it on average",
}  # fmt: skip
"""What the energy may do over a run, of one scheme and of several."""

CHANGED = 0.05
"""Fraction of an energy that counts as a change."""

SEEN = 0.01
"""Fraction of an energy from which on a linear axis shows a change."""

FLAT = 1e-3
"""Fraction of half a chart below the width of a line."""

FLOOR, ALL_ROUNDED = 2.0**-53, 2.0**-44
"""Relative differences that are drawn at the lower edge if below, and that count as roundings if below."""


def energy(runs: Runs, exact: Exact) -> Bank:
    """Energy over time, and below it how far it is from that of the exact solution on a logarithmic scale.

    Without friction that is the initial energy; where friction acts and no closed form is known it is the
    initial one too, and the axis says so.  All in units of the scene's `energy_scale`.
    """
    scene = runs.scene
    start = float(scene.system.energy(scene.q, scene.p))
    scale, of = energy_scale(scene.system)
    unit, of = start if of == "initial energy" else float(scale), of or "unit"
    changes = not scene.system.keeps_energy and exact.known

    def off(run: Trajectory) -> Floats:
        right = _energies(scene, *exact.at(run)) if changes else start
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.abs(_energies(scene, run.q, run.p) - right) / unit)

    found = {run.label: _energies(scene, run.q, run.p, unit) for run in runs.every}
    lines = []
    true: Floats | None = None
    if changes and (truth := true_motion(scene, runs.every)) is not None:
        true = _energies(scene, *truth[1:], unit)
        lines.append(exact_curve(truth[0], true))
    elif scene.system.keeps_energy:
        true = np.full(2, start / unit)
        lines.append(exact_curve(runs.longest.t[[0, -1]], true))
    ys = _scale(list(found.values()), true)
    upper = runs.over_time(
        found, ys, title="Energy over time.", name=f"energy / {of}", lines=lines, height=1.5 * NAME_HIGH
    )
    differences = {run.label: off(run) for run in runs.every}
    what = "exact" if changes else "initial"
    lower = decades(runs, differences, f"|energy - {what}| / {of}", f"Difference from the {what} energy.")
    said = ""
    if scene.system.keeps_energy or changes:
        largest = _largest(runs, differences)
        said = extremes(largest, "largest energy error {}", beyond=MOST_DRAWN)
        if scene.system.keeps_energy and (most := max(largest.values())) <= ALL_ROUNDED:
            said = f"all keep the energy to rounding, {most:.0e}" if most else "all keep the energy exactly"
    # coinciding lines are better shown by their differences
    flat = lower and scene.system.keeps_energy and max(map(np.max, differences.values())) < FLAT * ys.half
    charts = lower if flat else [upper, *lower]
    return runs.bank("energy", charts, said or "energy", (7.2, 4.2 if flat and len(lower) == 1 else 2.7))


def _energies(scene: Scene, q: Reals, p: Reals, unit: float = 1.0) -> Floats:
    """Energy of each frame (f,) in this unit; not finite where a run has diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(scene.system.energy(q, p), np.float64) / unit


def _largest(runs: Runs, found: Mapping[str, Floats]) -> dict[str, float]:
    """The largest number of any engine of each scheme."""
    return {x.title: max(float(np.max(found[run.label])) for run in x.members) for x in runs.groups}


def orbits(runs: Runs, parts: Runs, exact: Exact) -> str:
    """Who gains or loses energy over the run, and the largest error of the states of others."""
    scene = runs.scene
    said: dict[str, list[str]] = {way: [] for way in ORBIT_WORDS}
    off = {}
    for group in runs.groups:
        run = group.members[0]
        if group.failed:
            continue
        if exact.known:
            each = [max(np.max(exact.error(x)), parts.errors.get(x.label, 0.0)) for x in group.members]
            off[group.title] = float(np.max(each))
        if scene.system.keeps_energy:
            e = _energies(scene, run.q, run.p)
            first, last = e[: len(e) // 4 + 1], e[-(len(e) // 4) - 1 :]
            unit = CHANGED * float(scene.system.norm.unit) ** 2
            # a motion that diverged did not oscillate
            out = not np.isfinite(e).all() or np.min(last) > np.max(first) + unit
            # at once, or more and more; of a negative energy half is larger
            inwards = not out and np.max(last) < max(np.min(first), min(e[0], e[0] / 2)) - unit
            way = "gains energy" if out else "loses energy" if inwards else "conserves it on average"
            said[way].append(group.title)
    turns = max(periods(x) for x in parts.longest.q.T[:MOST_TURNING])
    if turns >= 1 and (said["gains energy"] or said["loses energy"]):
        return "; ".join(
            f"{names[0]} {way}" if len(names) == 1 else f"{len(names)} {ORBIT_WORDS[way]}"
            for way, names in said.items()
            if names
        )
    some = {name: x for name, x in off.items() if np.isfinite(x)}
    if not some:
        return ""
    return extremes(some, "largest state error {}", beyond=MOST_DRAWN * exact.reach(runs.longest))


def _scale(found: Sequence[Floats], true: Floats | None) -> Frame:
    """Limits of an axis of energies, by the exact energy and all runs within `LARGE_ENERGY` times its
    size."""
    largest = max(1.0, 0.0 if true is None else float(np.max(np.abs(true))))
    near = [x for x in found if np.max(np.abs(x)) <= LARGE_ENERGY * largest] or list(found)
    right = [] if true is None else [true]
    low, high = (float(f([f(x) for x in (*near, *right)])) for f in (np.min, np.max))
    if low > 0 and high > DECADES * low:
        # the right energy may fall further
        bottom = max(min(LEAST_DRAWN, 0.1 * float(np.min(true)) if true is not None else LEAST_DRAWN), FLOOR)
        return Frame(max(low / 2, bottom), 2 * high, len(near) < len(found) or low < bottom, log=True)
    ys = frames.widened(low, high, clipped=len(near) < len(found))
    # smaller differences are left to the panel of differences below
    room = max(ys.half, SEEN * abs(ys.centre))
    return Frame(ys.centre - room, ys.centre + room, ys.clipped)


def decades(
    runs: Runs, found: Mapping[str, Floats], name: str, title: str, *, known: bool = False
) -> list[Chart]:
    """Differences (f,) of each run on a logarithmic scale; none where all are roundings.  `known`: the scale
    follows from the scene, and 1 is as large as the motion itself."""
    finite = {label: np.where(np.isfinite(x), x, np.inf) for label, x in found.items()}
    if max((float(np.max(x)) for x in finite.values()), default=0.0) <= ALL_ROUNDED and not known:
        return []
    one = [Rule(axis="y", at=1.0, name="as large as the motion", look="one")] if known else []
    return [_panel(runs, finite, name, title, one)]


def _panel(runs: Runs, found: Mapping[str, Floats], name: str, title: str, rules: Sequence[Rule]) -> Chart:
    """Differences (f,) of some of the runs, and the rules within their decades."""
    # the start is right; differences below the floor at other frames are drawn at the lower edge
    positive = [x[1:][x[1:] > 0] for x in found.values()]
    low = max(min((float(np.quantile(x, 0.02)) for x in positive if len(x)), default=FLOOR) / 2, FLOOR)
    inside = [float(np.max(x)) for x in found.values() if np.max(x) <= MOST_DRAWN]
    clipped = len(inside) < len(found)
    high = max((20 if clipped else 2) * max(inside, default=MOST_DRAWN / 20), 10 * low)
    leaves = {label: int(np.argmax(x > high)) for label, x in found.items() if np.any(x > high)}

    def shown(run: Trajectory) -> tuple[Floats, Floats]:
        y = found[run.label]
        last = leaves.get(run.label, len(y) - 1) + 1
        return run.t[1:last], np.clip(y[1:last], FLOOR, high * frames.FAR_OFF)

    # an engine may be farther off than others of its scheme
    groups = [
        replace(group, members=members)
        for group in runs.groups
        if (members := tuple(run for run in group.members if run.label in found))
    ]
    chart = Chart(
        title=title,
        x=runs.time(),
        y=Scale(name=name, log=True, shown=(low, high)),
        curves=runs.curves(shown, groups=groups),
        rules=[rule for rule in rules if low < rule.at < high],
        note=runs.leaving(lambda run: leaves.get(run.label)),
    )
    return naming.at_ends(chart, height=1.4 * NAME_HIGH)


def error(runs: Runs, exact: Exact) -> Bank:
    """Distance from the exact solution over time, on a logarithmic scale."""
    found = {run.label: exact.error(run) for run in runs.every}
    name, title = "error / initial energy norm", "Distance from the exact solution."
    charts = decades(runs, found, name, title, known=True)
    largest = _largest(runs, found)
    some = {label: x for label, x in largest.items() if np.isfinite(x)}
    far = MOST_DRAWN * exact.reach(runs.longest)
    said = extremes(some, "largest distance from the exact solution {}", beyond=far) if some else "errors"
    return runs.bank("error", charts, said, (7.2, 4.2 if len(charts) == 1 else 2.6))
