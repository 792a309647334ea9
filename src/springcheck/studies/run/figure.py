"""The pictures of a run: phase portrait, position, energy and error, with the engines laid over each other;
of a chain also its modes and its wave."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from matplotlib.figure import Figure

from springcheck.figures import chain, energies, portraits
from springcheck.figures.motion import Exact, true_motion
from springcheck.figures.overlay import Runs
from springcheck.figures.views import paths, views
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.run.result import Report, Stored


def pictures(found: Stored | Report, *, particle: int | None = None) -> dict[str, Figure]:
    """The figures of trajectories, or of the motion of one particle, by name."""
    shown = found.drawable
    failed = {verdict.method for verdict in found.verdicts if verdict.passed is False}
    return of_runs(shown.scene, shown.runs, shown.followed, particle=particle, failed=failed)


def of_runs(
    scene: Scene,
    runs: Mapping[str, Trajectory],
    followed: Mapping[str, Trajectory],
    *,
    particle: int | None = None,
    failed: Collection[str] = (),
) -> dict[str, Figure]:
    """The figures by name, none where no run has more than its start.

    `followed`: the parts of the runs in which the motion itself is shown; `particle`: this one's motion
    alone; `failed`: labels of runs that some verdict rejects, drawn in red.  SpringcheckError where
    there is no such particle.
    """
    if not any(len(run.t) > 1 for run in runs.values()):
        return {}
    usable, parts = Runs(scene, runs, failed), Runs(scene, followed, failed)
    exact = Exact(scene)
    shown = views(scene, particle)
    truth = true_motion(scene, parts.every)
    ending = "" if particle is None else f"-particle-{particle}"
    out = {
        f"phase-portrait{ending}": portraits.phase_portraits(parts, shown, truth),
        f"position{ending}": portraits.positions(parts, shown, truth),
    }
    if particle is None and (planes := paths(scene)):
        out["path"] = portraits.phase_portraits(parts, planes, truth, what="path")
    if particle is None:
        out["energy"] = energies.energy(usable, exact)
        if exact.known:
            out["error"] = energies.error(usable, exact)
        out |= chain.pictures(usable, exact)
    return out
