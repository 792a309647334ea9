"""Energy and error over time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from springcheck.figures import overlay
from springcheck.figures.motion import Exact, true_motion
from springcheck.figures.overlay import TRUTH, Frame, Runs
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.trajectory import Trajectory

MOST = 1e3
"""Energies and errors, relative to those of the start, beyond which nothing is read off a picture."""

LARGE = 30.0
"""How many times the right energy one may be that sets the scale; one beyond leaves the picture."""

DECADES = 100.0
"""Ratio of largest to smallest energy from which the scale is logarithmic."""

LEAST = 1e-4
"""Of the initial energy, what the logarithmic scale goes down to."""

CHANGED, MOST_FINDINGS = 0.05, 3
"""Logarithm of an energy over that of the start from which it has changed; schemes that a title names."""

FLOOR = 2.0**-53
"""Relative differences below this are none: they stand on the lower edge."""


def energy(runs: Runs, exact: Exact) -> Figure:
    """Energy over time, and below it how far it is from that of the exact motion on a logarithmic scale.

    Without friction that is the initial energy; where friction acts and no closed form is known it is the
    initial one too, and the axis says so.  All in units of the kinetic plus the absolute potential energy of
    the start, which is the initial energy unless a potential is negative.
    """
    figure = Figure(figsize=(7.8, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, sharex=True)
    scene = runs.scene
    start = float(scene.system.energy(scene.q, scene.p))
    unit = float(scene.system.norm.unit) ** 2 or 1.0
    whole = abs(start - unit) <= 1e-12 * unit
    unit = start if whole else unit
    of = "initial energy" if whole else "initial T + |V|"
    changes = not scene.system.keeps_energy and exact.known

    def energies(q: Reals, p: Reals) -> Floats:
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(scene.system.energy(q, p), np.float64)

    def off(run: Trajectory) -> Floats:
        right = energies(*exact.at(run)) if changes else start
        return np.asarray(np.abs(energies(run.q, run.p) - right) / unit)

    found = {run.label: energies(run.q, run.p) / unit for run in runs.every}
    dt, t_unit = runs.time_unit
    true: Floats | None = None
    if changes and (truth := true_motion(scene, runs.every)) is not None:
        true = energies(*truth[1:]) / unit
        upper.plot(dt * truth[0], true, **TRUTH)
    elif scene.system.keeps_energy:
        true = np.full(2, start / unit)
        upper.axhline(start / unit, **TRUTH)
    ys = _scale(upper, list(found.values()), true)
    runs.draw(upper, lambda run: (dt * run.t, ys.within(found[run.label])))
    upper.set_ylabel(f"energy / {of}")
    runs.note(upper, lambda run: ys.leaves(found[run.label]))
    _decades(lower, runs, off)
    lower.set_ylabel(f"|energy - {'exact' if changes else 'initial'}| / {of}")
    lower.set_xlabel(with_unit("time t", t_unit))
    lower.ticklabel_format(axis="x", useOffset=False)
    said = _findings(runs, found) if scene.system.keeps_energy else []
    overlay.heading(figure, f"{scene.title}: energy" + "".join(f"; {one}" for one in said[:MOST_FINDINGS]))
    runs.legend(figure, truth=true is not None)
    return figure


def _findings(runs: Runs, found: Mapping[str, Floats]) -> list[str]:
    """Which schemes gain or lose energy in every step alike, and how much."""
    said = []
    for group in runs.groups:
        x = found[group.members[0].label]
        steps = (len(x) - 1) * group.members[0].every
        middle = len(x) // 2
        if group.failed or middle < 2 or not (np.isfinite(x[-1]) and min(x[0], x[middle], x[-1]) > 0):
            continue
        rate, half = (np.log(x[j] / x[0]) / j for j in (len(x) - 1, middle))
        # what only wavers does not change alike in both halves
        if abs(rate) * (len(x) - 1) > CHANGED and abs(half - rate) < abs(rate) / 4:
            each = 100 * abs(np.expm1(np.log(x[-1] / x[0]) / steps))
            said.append(f"{group.title} {'gains' if rate > 0 else 'loses'} {each:.2g} % a step")
    return said


def _scale(axes: Axes, found: Sequence[Floats], true: Floats | None) -> Frame:
    """Scale and limits of an axis of energies, set by all that stay within some times the right one."""
    largest = max(1.0, 0.0 if true is None else float(np.max(np.abs(true))))
    near = [x for x in found if np.max(np.abs(x)) <= LARGE * largest] or list(found)
    right = [] if true is None else [true]
    low, high = (float(f([f(x) for x in (*near, *right)])) for f in (np.min, np.max))
    if low > 0 and high > DECADES * low:
        axes.set_yscale("log")
        # the right energy may fall further
        bottom = max(min(LEAST, 0.1 * float(np.min(true)) if true is not None else LEAST), FLOOR)
        ys = Frame(max(low / 2, bottom), 2 * high, len(near) < len(found) or low < bottom)
    else:
        ys = overlay.widened(low, high, clipped=len(near) < len(found))
    axes.set_ylim(ys.low, ys.high)
    return ys


def _decades(axes: Axes, runs: Runs, pick: Callable[[Trajectory], Floats]) -> None:
    """Differences on a logarithmic scale."""
    dt, _ = runs.time_unit
    found = {run.label: pick(run) for run in runs.every}
    # the start is right; what is less than the floor at other frames stands on the lower edge
    positive = [x[1:][x[1:] > 0] for x in found.values()]
    low = max(min((float(np.min(x)) for x in positive if len(x)), default=FLOOR) / 2, FLOOR)
    inside = [float(np.max(x)) for x in found.values() if np.max(x) <= MOST]
    clipped = len(inside) < len(found)
    high = max((20 if clipped else 2) * max(inside, default=MOST / 20), 1e3 * low)

    def shown(run: Trajectory) -> tuple[Floats, Floats]:
        y = found[run.label]
        end = _beyond(y, high)
        last = len(y) if end is None else end + 1
        return dt * run.t[1:last], np.clip(y[1:last], low, high * overlay.FAR_OFF)

    runs.draw(axes, shown)
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    runs.note(axes, lambda run: _beyond(found[run.label], high))


def _beyond(values: Floats, high: float) -> int | None:
    return int(np.argmax(values > high)) if np.any(values > high) else None


def error(runs: Runs, exact: Exact) -> Figure:
    """Distance from the exact solution over time, on a logarithmic scale."""
    figure = Figure(figsize=(7.8, 4.6), layout="constrained")
    axes = figure.add_subplot()
    _decades(axes, runs, exact.error)
    axes.axhline(1.0, color="#888888", linewidth=0.8)
    axes.set_xlabel(with_unit("time t", runs.time_unit[1]))
    axes.ticklabel_format(axis="x", useOffset=False)
    axes.set_ylabel("error / initial energy norm")
    ends = {run.label: float(np.max(exact.error(run))) for run in runs.every}
    known = {label: x for label, x in ends.items() if np.isfinite(x)}
    title = f"{runs.scene.title}: largest distance from the exact solution"
    if known:
        small, large = min(known, key=lambda x: known[x]), max(known, key=lambda x: known[x])
        title += f" {known[small]:.1e} by {small}" + (
            f" to {known[large]:.1e} by {large}" if len(known) > 1 else ""
        )
    overlay.heading(figure, title)
    runs.legend(figure)
    return figure
