"""Trajectories on axes of one's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from springcheck.physics.arguments import typed
from springcheck.physics.norm import energy_changes
from springcheck.physics.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@typed
def phase(*runs: Trajectory, particle: int = 0, ax: Axes | None = None) -> Axes:
    """Phase portraits, p over q, of one particle of each trajectory; returns the axes."""
    axes = _axes(ax)
    for run in runs:
        axes.plot(*run.of_particle(particle), label=run.label)
    return _finished(axes, "q", "p")


@typed
def position(*runs: Trajectory, particle: int = 0, ax: Axes | None = None) -> Axes:
    """Positions over time of one particle of each trajectory; returns the axes."""
    axes = _axes(ax)
    for run in runs:
        axes.plot(run.t, run.of_particle(particle)[0], label=run.label)
    return _finished(axes, "t", "q")


@typed
def energy(*runs: Trajectory, ax: Axes | None = None) -> Axes:
    """Change of the total energy over time, relative to the kinetic plus the absolute potential energy of
    the start, or where that is 0 to what the scene may gain; without a scene to |H0|.  Returns the axes.

    SpringcheckError where a trajectory was recorded without energies.
    """
    axes = _axes(ax)
    for run in runs:
        axes.plot(run.t, energy_changes(run), label=run.label)
    return _finished(axes, "t", "(H - H0) / (initial T + |V|)")


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib import pyplot

    return pyplot.figure(layout="constrained").add_subplot()


def _finished(axes: Axes, x: str, y: str) -> Axes:
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.legend()
    return axes
