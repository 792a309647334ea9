"""The pictures of a run: phase portrait, position, energy and error, with the engines laid over each other;
of a chain also its modes and its wave."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from springcheck.figures import chain, energies, overlay, portraits
from springcheck.figures.motion import Exact, true_motion
from springcheck.figures.overlay import every
from springcheck.figures.style import save, style
from springcheck.figures.views import views
from springcheck.physics.scene import Scene
from springcheck.studies.run.result import Stored
from springcheck.trajectory import Trajectory


def draw(found: Stored, folder: Path, *, particle: int | None = None) -> list[Path]:
    """Draw the trajectories of a store, or the motion of one particle, into a folder; returns the files."""
    shown = found.drawable
    return draw_runs(shown.scene, shown.runs, folder, followed=shown.followed, particle=particle)


def draw_runs(
    scene: Scene,
    runs: Mapping[str, Trajectory],
    folder: Path,
    *,
    followed: Mapping[str, Trajectory] | None = None,
    particle: int | None = None,
) -> list[Path]:
    """Draw all figures of trajectories into a folder; returns the files (see `pictures`)."""
    if not any(len(run.t) > 1 for run in runs.values()):
        return []
    written = []
    parts = runs if followed is None else followed
    with style():
        for name, picture in pictures(scene, runs, parts, particle=particle).items():
            written += save(picture, folder, name)
    return written


def pictures(
    scene: Scene,
    runs: Mapping[str, Trajectory],
    followed: Mapping[str, Trajectory],
    *,
    particle: int | None = None,
) -> dict[str, Figure]:
    """The figures by name.  `followed`: the parts of the runs in which the motion itself is shown.

    `particle`: this one's motion alone.  SpringcheckError where there is no such particle.
    """
    usable, parts = overlay.grouped(runs), overlay.grouped(followed)
    exact = Exact(scene)
    shown = views(scene, particle)
    truth = true_motion(scene, every(parts))
    ending = "" if particle is None else f"-particle-{particle}"
    out = {
        f"phase-portrait{ending}": portraits.phase_portraits(scene, parts, shown, truth),
        f"position{ending}": portraits.positions(scene, parts, shown, truth),
    }
    if particle is None:
        out["energy"] = energies.energy(scene, usable, exact)
        if exact.known:
            out["error"] = energies.error(scene, usable, exact)
        out |= chain.pictures(scene, usable, exact)
    return out
