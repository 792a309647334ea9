"""Trajectories on matplotlib axes: ``plot.phase(run)`` draws one, and returns the axes.

>>> springcheck.plot.phase(springcheck.simulate("spring", "own:euler")).get_xlabel()
'q'
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from springcheck.errors import SpringcheckError
from springcheck.physics.arguments import typed
from springcheck.physics.norm import energy_changes
from springcheck.physics.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@typed
def phase(*runs: Trajectory, particle: int = 0, ax: Axes | None = None) -> Axes:
    """Phase portraits, p over q, of one particle of each trajectory; returns the axes."""
    return _drawn([(run.label, *run.of_particle(particle)) for run in runs], ("q", "p"), ax)


@typed
def position(*runs: Trajectory, particle: int = 0, ax: Axes | None = None) -> Axes:
    """Positions over time of one particle of each trajectory; returns the axes."""
    return _drawn([(run.label, run.t, run.of_particle(particle)[0]) for run in runs], ("t", "q"), ax)


@typed
def energy(*runs: Trajectory, ax: Axes | None = None) -> Axes:
    """Change of the total energy over time; returns the axes.

    It is relative to the initial kinetic plus absolute potential energy, or where that is 0 to what the scene
    may gain; without a scene to ``|H0|``.  SpringcheckError for a trajectory without energies.
    """
    curves = [(run.label, run.t, energy_changes(run)) for run in runs]
    return _drawn(curves, ("t", "(H - H0) / (initial T + |V|)"), ax)


def _drawn(curves: list[tuple[str, Any, Any]], names: tuple[str, str], ax: Axes | None) -> Axes:
    """The axes, or new ones, with these curves: label, x (f,) and y (f,).  SpringcheckError for none."""
    if not curves:
        raise SpringcheckError("nothing to draw: give one trajectory or more")
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").add_subplot()
    for label, x, y in curves:
        ax.plot(x, y, label=label)
    ax.set_xlabel(names[0])
    ax.set_ylabel(names[1])
    ax.legend()
    return ax
