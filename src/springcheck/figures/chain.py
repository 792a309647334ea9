"""Chains: the energy of their strongest modes over time, and their wave in space and time."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from springcheck.figures import frames
from springcheck.figures.charts import Bank, Chart, Scale, Tiles
from springcheck.figures.frames import Frame
from springcheck.figures.motion import Exact
from springcheck.figures.naming import NAME_HIGH
from springcheck.figures.overlay import Runs, exact_curve, share
from springcheck.figures.portraits import extremes
from springcheck.figures.views import with_unit
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene

FEWEST_MASSES, LONG = 3, 8
"""Particles from which on a chain has modes worth a figure, and from which on its wave is an image."""

MODES = 3
"""How many of the strongest modes are drawn."""

WEAK = 1e-9
"""Fraction of the energy below which a mode is not excited."""

PANELS = 6
"""Images: the exact wave, and the errors of five schemes."""

DECADES = 20.0
"""Ratio of energies from which on their scale is logarithmic."""

BLOCKS, IMAGE_ROWS = 100, 120
"""Blocks of neighbours over which errors are averaged, and most frames in the image of a wave: an image does
not resolve the short waves of a long chain."""

WAVE_SHADES = (
    "#2166ac", "#4393c3", "#92c5de", "#d1e5f0", "#f7f7f7", "#fddbc7", "#f4a582", "#d6604d", "#b2182b",
)  # fmt: skip
"""Colours of displacements, from the largest below rest to the largest above (Brewer)."""

SHARES = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
"""Bounds of the shades of errors, relative to the largest displacement."""


def banks(runs: Runs, exact: Exact) -> list[Bank]:
    """The charts of a chain, none where a scene is not a linear chain of at least three."""
    scene, system = runs.scene, runs.scene.system
    if scene.n < FEWEST_MASSES or system.is_separate or not system.has_modes:
        return []
    return [_modes(runs, exact), *([_wave(runs, exact)] if scene.n >= LONG and exact.known else [])]


def _energies(scene: Scene, q: Reals, p: Reals) -> Floats:
    """Energy of each mode (f, n) at states (f, n) [M L2/T2]."""
    modes = scene.system.modes
    with np.errstate(over="ignore", invalid="ignore"):
        y, v = modes.about_centres(q, p)
        return np.asarray((v * v + modes.w2 * y**2) / 2, np.float64)


def _modes(runs: Runs, exact: Exact) -> Bank:
    scene = runs.scene
    start = np.abs(_energies(scene, scene.q[None, :], scene.p[None, :])[0])
    total = float(np.sum(start)) or 1.0
    strongest = [int(i) for i in np.argsort(-start)[:MODES] if start[i] > WEAK * total] or [0]
    chosen = sorted(strongest, key=lambda i: float(scene.system.modes.w2[i]))
    unit = np.where(start > 0, start, 1.0)[chosen]
    found = {run.label: _energies(scene, run.q, run.p)[:, chosen] / unit for run in runs.every}
    order = np.argsort(np.argsort(scene.system.modes.w2))
    longest = runs.longest
    true = _energies(scene, *exact.at(longest))[:, chosen] / unit if exact.known else None
    charts = []
    for j, mode in enumerate(chosen):
        mine = {label: x[:, j] for label, x in found.items()}
        ys = _scale(list(mine.values()), None if true is None else true[:, j])
        turn = abs(scene.step) * np.sqrt(max(float(scene.system.modes.w2[mode]), 0.0))
        name = f"mode {order[mode] + 1} of {scene.n}, h \N{GREEK SMALL LETTER OMEGA} = {turn:.3g}"
        charts.append(
            runs.over_time(
                mine,
                ys,
                title=f"Energy of {name}.",
                name="energy / its start",
                lines=[] if true is None else [exact_curve(longest.t, true[:, j])],
                short=f"{name}, {100 * start[mode] / total:.2g} % of the energy",
                span=(float(longest.t[0]), float(longest.t[-1])),
                height=2 * NAME_HIGH,
            )
        )
    off = {}
    for group in runs.groups:
        x = found[group.members[0].label][:, -1]
        with np.errstate(all="ignore"):
            off[group.title] = float(np.max(np.abs(x - (1.0 if true is None else true[: len(x), -1]))))
    fastest = f"the energy of mode {order[chosen[-1]] + 1} is off by at most {{}}"
    return runs.bank("modes", charts, extremes(off, fastest), (7.2, 2.0))


def _scale(found: Sequence[Floats], true: Floats | None) -> Frame:
    """The scale of the energies of one mode."""
    ys = frames.frame(found, true, far=10.0)
    least = min((float(np.min(x)) for x in found if ys.leaves(x) is None), default=0.0)
    if least > 0 and ys.high > DECADES * least:
        return Frame(least / 1.5, ys.high, ys.clipped, log=True)
    return ys


def _wave(runs: Runs, exact: Exact) -> Bank:
    """Displacement over particle and time: the exact wave, and the error of each scheme's."""
    scene, modes, longest = runs.scene, runs.scene.system.modes, runs.longest
    rest = np.asarray(modes.rest, np.float64)
    dt, t_unit = runs.time_unit
    true = np.asarray(exact.at(longest)[0], np.float64) - rest
    size = float(np.max(np.abs(true))) or 1.0
    width = 2 / len(WAVE_SHADES)
    signed = [(f"{-1 + width * i:.1f} to {-1 + width * (i + 1):.1f}", x) for i, x in enumerate(WAVE_SHADES)]
    names = [
        f"below {share(SHARES[0])}",
        *(f"{share(a)} to {share(b)}" for a, b in itertools.pairwise(SHARES)),
        "above",
    ]
    errors = [(f"error {name}", f"s{i}") for i, name in enumerate(names)]

    def panel(name: str, t: Floats, rows: np.ndarray, kinds: Sequence[tuple[str, str]]) -> Chart:
        places = np.linspace(0, scene.n - 1, rows.shape[1])
        times = np.linspace(dt * float(t[0]), dt * float(t[-1]), rows.shape[0])
        return Chart(
            title=f"{name}.",
            short=name,
            x=Scale(name="particle", values=places.round().tolist()),
            y=Scale(name=with_unit("time t", t_unit), values=times.tolist()),
            tiles=Tiles(kinds=kinds, rows=rows.tolist()),
        )

    bounds = np.linspace(-1, 1, len(WAVE_SHADES) + 1)[1:-1]
    wave = np.searchsorted(bounds, _few(true / size, signed=True))
    charts, largest = [panel("exact solution", longest.t, wave, signed)], {}
    for group in runs.groups[: PANELS - 1]:
        run = group.members[0]
        with np.errstate(all="ignore"):
            off = np.nan_to_num(np.asarray(run.q - exact.at(run)[0], np.float64) / size, nan=np.inf)
            largest[group.title] = float(np.max(np.abs(off)))
            name = f"{group.title}: {share(largest[group.title])}"
            charts.append(panel(name, run.t, np.searchsorted(SHARES, _few(off)), errors))
    said = extremes(largest, "the wave is off by at most {}")
    bank = runs.bank("wave", charts, said, (3.4, 2.9), columns=min(3, len(charts)))
    return replace(bank, title="The exact wave over its largest displacement, and errors")


def _few(image: Floats, *, signed: bool = False) -> Floats:
    """An image (f, n) of few frames: of errors the root mean square over blocks of neighbours."""
    image = image[np.linspace(0, len(image) - 1, min(IMAGE_ROWS, len(image))).round().astype(np.int64)]
    if signed:
        columns = min(2 * BLOCKS, image.shape[1])
        return image[:, np.linspace(0, image.shape[1] - 1, columns).round().astype(np.int64)]
    size = max(1, image.shape[1] // BLOCKS)
    starts = np.arange(0, image.shape[1], size)
    counts = np.diff([*starts, image.shape[1]])
    return np.asarray(np.sqrt(np.add.reduceat(image**2, starts, axis=1) / counts), np.float64)
