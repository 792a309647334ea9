"""Charts of a run, in figures and in the report page: phase portrait, position, energy and error, with the
engines overlaid; in a bath also the temperatures."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.bath.heat import Heated, heated_of
from springcheck.checks.compare import EXACT
from springcheck.figures import energies, looks, portraits
from springcheck.figures.charts import Bank, Chart, Curve, Rule, Scale
from springcheck.figures.motion import SMOOTH, Exact, true_motion
from springcheck.figures.overlay import Runs
from springcheck.figures.views import paths, views
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies import keeper
from springcheck.studies.run.drawable import Drawable
from springcheck.studies.run.result import Report, Stored

POSITIONS_IN_BATH = 4
"""Most schemes in a bath whose positions are drawn: more would hide one another."""

TWO_ERRORS = "two standard errors"


def banks(
    found: Stored | Report,
    *,
    particle: int | None = None,
    shown: Drawable | None = None,
    points: int = SMOOTH,
) -> list[Bank]:
    """Charts of the trajectories, or of the motion of one particle; of these frames by default all."""
    shown = found.drawable if shown is None else shown
    scene, path, errors = shown.scene, found.path, dict[str, float]()
    heated: list[Heated] = []
    if scene.bath is not None and path is not None:
        # over all frames
        heated = [heated_of(scene, keeper.windows(path, run.label)) for run in keeper.summary(path).runs]
    compared = found.comparison
    if compared is not None and EXACT in compared.labels:
        row = compared.max_difference[compared.labels.index(EXACT)]
        errors = dict(zip(compared.labels, row.tolist(), strict=True))
    failed = {verdict.method for verdict in found.verdicts if verdict.passed is False}
    return of_runs(
        scene, shown.runs, shown.followed, particle=particle, failed=failed, points=points, heated=heated,
        errors=errors,
    )  # fmt: skip


def of_runs(
    scene: Scene,
    runs: Mapping[str, Trajectory],
    followed: Mapping[str, Trajectory],
    *,
    particle: int | None = None,
    failed: Collection[str] = (),
    points: int = SMOOTH,
    heated: Sequence[Heated] = (),
    errors: Mapping[str, float] | None = None,
) -> list[Bank]:
    """The charts, none where no run has more than its start.

    `followed`: the parts of the runs in which the motion itself is shown; `particle`: draw this one's motion
    alone; `failed`: labels of runs with a failed verdict, drawn in red; `points`: number of points of the
    exact solution's line; `heated` and `errors`: temperatures and largest errors by all frames, by default
    by those of `runs`.  SpringcheckError where there is no such particle.
    """
    if not any(len(run.t) > 1 for run in runs.values()):
        return []
    usable, parts = Runs(scene, runs, failed), Runs(scene, followed, failed, errors)
    exact = Exact(scene)
    shown = views(scene, particle)
    if scene.bath is not None:
        firsts = [group.members[0].label for group in parts.groups[:POSITIONS_IN_BATH]]
        few = Runs(scene, {label: followed[label] for label in firsts}, failed)
        out = [
            portraits.clouds(usable, shown[0]),
            portraits.positions(few, shown, None, usable),
        ]
    else:
        truth, said = true_motion(scene, parts.every, points), energies.orbits(usable, parts, exact)
        out = [
            portraits.phase_portraits(parts, shown, truth, said),
            portraits.positions(parts, shown, truth, usable),
        ]
    if particle is not None:
        return [replace(bank, name=f"{bank.name}-particle-{particle}") for bank in out]
    if scene.bath is not None:
        heated = heated or [heated_of(scene, [run]) for run in usable.every]
        return [*out, *_temperatures(usable, heated)]
    # of a bound pair its bond is shown, and no path
    if shown[0].what != "length" and (planes := paths(scene)):
        out.append(portraits.phase_portraits(parts, planes, truth, said))
    out.append(energies.energy(usable, exact))
    if exact.known:
        out.append(energies.error(usable, exact))
    return out


def _temperatures(runs: Runs, heated: Sequence[Heated]) -> list[Bank]:
    """Configurational and kinetic temperature of each method next to the exact ones of its scheme."""
    found = [one for one in heated[::-1] if np.isfinite(one.kinetic)]
    if not found:
        return []
    kinds = ("configurational", "kinetic")
    charts = [_of_kind(kind, found) for kind in kinds if np.isfinite([getattr(x, kind) for x in found]).any()]
    heading, said = _farthest(found)
    return [
        Bank(name="temperature", title="Methods drawn", charts=charts, heading=heading,
             foot=f"{runs.scene.title}: {said}", columns=len(charts))
    ]  # fmt: skip


def _of_kind(kind: str, found: Sequence[Heated]) -> Chart:
    """One of the two temperatures: a row for each method, with two standard errors, and its law's value."""
    bars, marks, every = [], [], [1.0]
    for j, one in enumerate(found):
        value, error = getattr(one, kind), getattr(one, f"{kind}_error")
        own: dict[str, Any] = {"group": one.scheme, "title": looks.title(one.scheme)}
        if np.isfinite(error):
            ends = [value - 2 * error, value + 2 * error]
            bars.append(Curve(name=TWO_ERRORS, x=ends, y=[float(j)] * 2, **own))
            every += ends
        if np.isfinite(value):
            marks.append(Curve(name=one.method, x=[value], y=[float(j)], line=False, marks=True, **own))
            every.append(value)
    laws = np.array([getattr(one, f"{kind}_law") for one in found])
    known = np.flatnonzero(np.isfinite(laws))
    law = Curve(name="exact law of its scheme", group="exact", x=laws[known], y=known.astype(np.float64),
                line=False, marks=True)  # fmt: skip
    numbers = np.array([*every, *laws[known]])
    middle = numbers[np.abs(numbers - np.median(numbers)) <= 1.0]
    low, high, room = float(np.min(middle)), float(np.max(middle)), 0.1 * float(np.ptp(middle)) + 0.02
    name, said = f"{kind} temperature", f"{TWO_ERRORS} to either side"
    return Chart(
        title=f"{name.capitalize()}, {said}.", short=f"{name}, {said}",
        x=Scale(name=f"{name} / that of the bath", shown=(low - room, high + room)),
        # a row of its own for the name of the rule
        y=Scale(name="method", names=[one.method for one in found], shown=(-0.6, len(found) + 0.1)),
        curves=[*bars, *marks, law], rules=[Rule(axis="x", at=1.0, name="the bath", look="here")],
    )  # fmt: skip


def _farthest(found: Sequence[Heated]) -> tuple[str, str]:
    """The method farthest from its bath by its law, or else by its frames: in short, and in a sentence."""
    kinds, where = ("configurational", "kinetic"), "in theory"
    both = [(getattr(one, f"{kind}_law"), kind, one.method) for one in found for kind in kinds]
    if not np.any(np.isfinite([x for x, *_ in both])):
        both = [(getattr(one, kind), kind, one.method) for one in found for kind in kinds]
        where = "in its frames"
    x, kind, method = max((one for one in both if np.isfinite(one[0])), key=lambda one: abs(one[0] - 1))
    if x == 1:
        return ("In theory all have the temperature of the bath",) * 2
    off = f"{100 * abs(x - 1):.2g} % too {'hot' if x > 1 else 'cold'} {where}"
    return f"{method}: {off}", f"the {kind} temperature of {method} is {off}"
