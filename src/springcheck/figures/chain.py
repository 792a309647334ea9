"""Chains: the energy of their strongest modes over time, and their wave in space and time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from springcheck.figures import overlay
from springcheck.figures.motion import Exact
from springcheck.figures.overlay import TRUTH, Runs
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene

FEWEST_MASSES, LONG = 3, 8
"""Particles from which a scene has modes worth drawing, and from which its wave is drawn as an image."""

MODES = 3
"""The strongest ones are drawn."""

WEAK = 1e-9
"""Part of the energy below which a mode is not at work."""

PANELS = 6
"""Images: the exact wave, and the errors of five schemes."""

DECADES = 20.0
"""Ratio of energies from which their scale is logarithmic."""

BLOCKS = 100
"""Of neighbours, over which errors are averaged: no picture resolves the short waves of a long chain."""


def pictures(runs: Runs, exact: Exact) -> dict[str, Figure]:
    """The figures of a chain by name, none where a scene is no linear chain of at least three."""
    scene, system = runs.scene, runs.scene.system
    if scene.n < FEWEST_MASSES or system.is_separate or not system.has_modes:
        return {}
    out = {"modes": _modes(runs, exact)}
    if scene.n >= LONG and exact.known:
        out["wave"] = _wave(runs, exact)
    return out


def _energies(scene: Scene, q: Reals, p: Reals) -> Floats:
    """Energy of each mode (f, n) at states (f, n) [M L2/T2]."""
    modes = scene.system.modes
    with np.errstate(over="ignore", invalid="ignore"):
        y, v = modes.about_centres(q, p)
        return np.asarray((v * v + modes.w2 * y**2) / 2, np.float64)


def _modes(runs: Runs, exact: Exact) -> Figure:
    scene = runs.scene
    start = np.abs(_energies(scene, scene.q[None, :], scene.p[None, :])[0])
    total = float(np.sum(start)) or 1.0
    strongest = [int(i) for i in np.argsort(-start)[:MODES] if start[i] > WEAK * total] or [0]
    chosen = sorted(strongest, key=lambda i: float(scene.system.modes.w2[i]))
    unit = np.where(start > 0, start, 1.0)[chosen]
    found = {run.label: _energies(scene, run.q, run.p)[:, chosen] / unit for run in runs.every}
    figure, panels, _ = overlay.panels(len(chosen), 1, (7.8, 0), (1.9, 0.8), shared="x")
    dt, t_unit = runs.time_unit
    order = np.argsort(np.argsort(scene.system.modes.w2))
    longest = runs.longest
    true = _energies(scene, *exact.at(longest))[:, chosen] / unit if exact.known else None
    for j, (axes, mode) in enumerate(zip(panels, chosen, strict=True)):
        mine = {label: x[:, j] for label, x in found.items()}
        if true is not None:
            axes.plot(dt * longest.t, true[:, j], **TRUTH)
        _mode(axes, runs, mine, None if true is None else true[:, j])
        turn = abs(scene.step) * np.sqrt(max(float(scene.system.modes.w2[mode]), 0.0))
        share = f"{100 * start[mode] / total:.2g} % of the energy"
        name = f"mode {order[mode] + 1} of {scene.n}, $h\\,\\omega$ = {turn:.3g}, {share}"
        axes.set_title(name, fontsize=9, loc="left")
        axes.set_ylabel("energy / its start")
    panels[-1].set_xlabel(with_unit("time t", t_unit))
    what = "modes" if len(chosen) > 1 else "mode"
    overlay.heading(figure, f"{scene.title}: energy of the strongest {what}")
    runs.legend(figure, truth=true is not None)
    return figure


def _mode(axes: Axes, runs: Runs, found: Mapping[str, Floats], true: Floats | None) -> None:
    """The energy of one mode."""
    ys = overlay.frame(list(found.values()), true, far=10.0)
    dt, _ = runs.time_unit
    runs.draw(axes, lambda run: (dt * run.t, ys.within(found[run.label])))
    inside = [x for x in found.values() if ys.leaves(x) is None]
    least = min((float(np.min(x)) for x in inside), default=0.0)
    if least > 0 and ys.high > DECADES * least:
        axes.set_yscale("log")
        axes.set_ylim(least / 1.5, ys.high)
    else:
        axes.set_ylim(ys.low, ys.high)
    runs.note(axes, lambda run: ys.leaves(found[run.label]))


def _wave(runs: Runs, exact: Exact) -> Figure:
    """Displacement over particle and time: the exact wave, and what each scheme's differs from it."""
    scene, modes, longest = runs.scene, runs.scene.system.modes, runs.longest
    rest = np.asarray(modes.rest, np.float64)
    dt, t_unit = runs.time_unit
    true = np.asarray(exact.at(longest)[0], np.float64) - rest
    images = [("exact solution", longest.t, true)]
    for group in runs.groups[: PANELS - 1]:
        run = group.members[0]
        images.append(
            (f"{group.title}\n{run.label}", run.t, np.asarray(run.q - exact.at(run)[0], np.float64))
        )
    figure, grid, columns = overlay.panels(len(images), 3, (3.6, 0), (3.3, 0.5), shared="xy")
    for j, (axes, (name, t, image)) in enumerate(zip(grid, images, strict=True)):
        axes.grid(False)
        size = float(np.max(np.abs(image))) or 1.0
        shown = image / size if j == 0 else _mean(image / size)
        low, high = (0.0, float(np.max(shown)) or 1.0) if j else (-1.0, 1.0)
        axes.imshow(
            shown, origin="lower", aspect="auto", interpolation="nearest",
            cmap="magma_r" if j else "RdBu_r", vmin=low, vmax=high,
            extent=(-0.5, scene.n - 0.5, dt * float(t[0]), dt * float(t[-1])),
        )  # fmt: skip
        axes.set_title(f"{name}\n{'error up to' if j else 'displacement up to'} {size:.2g}", fontsize=8.5)
        if j % columns == 0:
            axes.set_ylabel(with_unit("time t", t_unit))
        if j >= len(images) - columns:
            axes.set_xlabel("particle")
    overlay.heading(figure, f"{scene.title}: the wave, and what schemes make of it", 40 * columns)
    return figure


def _mean(error: Floats) -> Floats:
    """Root mean square of errors (f, n) over blocks of neighbours (f, b)."""
    size = max(1, error.shape[1] // BLOCKS)
    starts = np.arange(0, error.shape[1], size)
    counts = np.diff([*starts, error.shape[1]])
    return np.asarray(np.sqrt(np.add.reduceat(error**2, starts, axis=1) / counts), np.float64)
