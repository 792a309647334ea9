"""Thermostats on a thousand springs: temperatures, statistical errors and limits, each beside its law."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import nan
from pathlib import Path
from typing import Unpack

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.bath import THERMOSTATS, Law
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import choose
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.sampling.result import SAMPLED, Sampled, Sampling
from springcheck.studies.sampling.springs import KT, MASS, STIFFNESS, springs, temperatures

OMEGA = float(np.sqrt(STIFFNESS / MASS))

SAMPLED_TURNS = np.array([0.2, 0.5, 0.8, 1.0, 1.2, 1.4])
"""h omega at which temperatures are measured."""

RATE = 0.4
"""Friction over omega at which temperatures are measured."""

AVERAGED_STEPS = np.array([10.0, 20.0, 50.0, 100.0, 200.0, 500.0])
"""Steps over which <q**2> is averaged, at the second h omega."""

FRICTIONS = np.array([0.03, 0.1, 0.3, 1.0, 3.0, 10.0])
"""Friction over omega at which limits are measured."""

WIDE, WAIT = 1000, 5.0
"""Springs side by side, and decay times of the motion and of its variances before frames are used."""

SLOWEST_DECAY = 0.002
"""Least rate of decay a step that is waited for, which takes 2,500 steps."""

LARGEST_H_OMEGA = 8.0
"""Largest h omega up to which a limit is looked for."""

HOTTEST_LAW = 100.0
"""Largest temperature of a law, over the bath's: above it, motion is not bounded within these steps."""

SEED_OF_ALL = 27
"""Seed of all methods; not tuned."""


def bathed(scene: Scene, turn: float, friction: float) -> Scene:
    """Springs at another h omega and friction over omega."""
    return replace(scene, step=turn / OMEGA, bath=Bath(temperature=KT, friction=friction * OMEGA), every=1)


def law_at(scheme: str, turn: float, friction: float) -> Law:
    """The law of a scheme on one of these springs, by h omega and gamma/omega."""
    return Law(
        scheme=THERMOSTATS[scheme], h=turn / OMEGA, m=np.array([MASS]), k=np.array([STIFFNESS]),
        rate=friction * OMEGA, thermal=KT,
    )  # fmt: skip


def measured(label: Label) -> Sampled:
    """Measure one thermostat."""
    method = engines.method(label)
    linear = not THERMOSTATS[method.scheme].rescales
    laws = [law_at(method.scheme, turn, RATE) if linear else None for turn in SAMPLED_TURNS]
    rows, run, q = [], None, np.empty(0)
    for i, (turn, law) in enumerate(zip(SAMPLED_TURNS, laws, strict=True)):
        exact = (nan, nan) if law is None else (float(law.configurational[0]), float(law.kinetic[0]))
        if linear and not max(exact) < HOTTEST_LAW:
            rows.append((nan,) * 6)
            continue
        # collisions mix maps, so that variances may settle far later than means
        left = max(law.slowest, float(law.growth[0])) if law else 0.0
        slowest_decay = max(-np.log(left), SLOWEST_DECAY) if left > 0 else 1.0
        wait = round(WAIT / slowest_decay) if law else 100
        made = driver.run(bathed(springs(WIDE, wait + 500), turn, RATE), label, seed=SEED_OF_ALL)
        found = temperatures(made.q[wait:], made.p[wait:])
        rows.append((*found[0], exact[0], *found[1], exact[1]))
        if i <= 1:
            run, q = made, STIFFNESS * made.q[wait:] ** 2 / KT
    if run is None:
        raise MethodError(f"{label}: no step is stable from h omega {SAMPLED_TURNS[0]} on")
    law = laws[1]
    columns = np.array(rows).T
    steps = max(run.outcome.step, 1)
    return Sampled(
        method=str(label), scheme=method.scheme, title=schemes.title(method.scheme), turn=SAMPLED_TURNS,
        configurational=columns[0], configurational_error=columns[1], configurational_law=columns[2],
        kinetic=columns[3], kinetic_error=columns[4], kinetic_law=columns[5], frames=AVERAGED_STEPS,
        off=np.array([np.sqrt(np.mean((np.mean(q[: int(n)], axis=0) - 1) ** 2)) for n in AVERAGED_STEPS]),
        off_law=np.array([_error_of_average(law, int(n)) for n in AVERAGED_STEPS]), friction=FRICTIONS,
        limit=np.array([_last_stable(partial(_radius_of_engine, label, x), 1e-6) for x in FRICTIONS])
        if linear and not THERMOSTATS[method.scheme].collides else np.full(len(FRICTIONS), nan),
        limit_law=np.array([_last_stable(partial(_radius, method.scheme, x), 1e-9) for x in FRICTIONS])
        if linear else np.full(len(FRICTIONS), nan),
        force_calls=run.force_calls / steps, seconds=run.timing.run / steps / WIDE,
    )  # fmt: skip


def _error_of_average(law: Law | None, frames: int) -> float:
    """Error of k <q**2>/kT over so many frames: systematic and statistical."""
    if law is None:
        return nan
    ratio = float(law.configurational[0])
    return float(np.hypot(ratio - 1, ratio * law.error_of_variances(frames)[0, 0]))


def _radius(scheme: str, friction: float, turn: float) -> float:
    """Spectral radius of the law's map of second moments."""
    with np.errstate(all="ignore"):
        return float(law_at(scheme, turn, friction).growth[0])


def _radius_of_engine(label: Label, friction: float, turn: float) -> float:
    """Spectral radius of second moments under an engine's map; with one seed, three starts cancel noise."""
    one = bathed(springs(1, 1), turn, friction)
    rest = np.zeros(1)
    runs = [
        driver.run(replace(one, q=q, p=p, steps=2), label, seed=SEED_OF_ALL)
        for q, p in ((rest, rest), (rest + 1, rest), (rest, rest + MASS * OMEGA))
    ]
    # from the first step to the second, because some engines begin with another step
    (q0, p0), *moved = [(run.q[1:, 0], run.p[1:, 0]) for run in runs]
    if not all(len(q) == 2 for q, _ in moved) or len(q0) != 2:
        return np.inf
    both = np.array([[q - q0, (p - p0) / (MASS * OMEGA)] for q, p in moved])
    if not np.isfinite(both).all():
        return np.inf
    A = np.linalg.lstsq(both[:, :, 0], both[:, :, 1])[0].T
    return float(np.max(np.abs(np.linalg.eigvals(A)))) ** 2


RESOLVED = 5e-5
"""Largest error of a limit: half of the last decimal that is printed."""


def _last_stable(radius: Callable[[float], float], to: float) -> float:
    """The largest h omega up to which no map grows, `to` this part of it; infinity where none up to 8 does,
    NaN where growth there is too slow to tell from none.

    The rounding of a map is 1e-15; where its two eigenvalues coincide it acts by its square root.
    """
    slack = 1e-7

    def grows(turn: float) -> bool:
        return not radius(turn) <= 1 + slack

    def decays(turn: float) -> bool:
        return radius(turn) <= 1 - slack

    try:
        tried = np.geomspace(0.02, LARGEST_H_OMEGA, 25)
        first = next((i for i, turn in enumerate(tried) if grows(float(turn))), None)
        if first is None:
            return float("inf") if decays(LARGEST_H_OMEGA) else nan
        low, high = (float(tried[first - 1]), float(tried[first])) if first else (0.0, float(tried[0]))
        while high - low > to * high and high > 1e-3:
            middle = (low + high) / 2
            low, high = (low, middle) if grows(middle) else (middle, high)
        return 0.0 if high <= 1e-3 else low if decays(low - RESOLVED) else nan
    except MethodError:
        return nan


def record(path: str | Path | None, methods: Sequence[str] = (), **how: Unpack[How]) -> Sampling:
    """Measure thermostats with these labels or globs, by default the default ones; saved in a store."""
    labels, left, _ = choose(replace(springs(1, 1), include=("*",)), methods)
    pieces = each(labels, "", lambda label: partial(measured, label), SAMPLED)

    def measure(kept: Keeper) -> Sampling:
        return Sampling(methods=tuple(kept.results(pieces)), left_out=tuple(left))

    return keeper.study("sampling", path, labels, measure, **how)


def perform(options: Namespace, progress: Progress | None) -> Sampling:
    """Carry out `springcheck sampling`."""
    return record(options.output or "sampling.h5", options.method, **keeper.how(options, progress))


@keeper.restoring("sampling")
def stored(kept: keeper.Kept) -> Sampling:
    """The study that `record` has saved.  StoreError where the file holds none."""
    return Sampling(methods=kept.listed(SAMPLED, "methods"), left_out=kept.left_out, path=kept.path)


def curve(scheme: str, turns: Floats, of: str) -> Floats:
    """The law's temperature at these h omega, NaN where the step is unstable."""
    with np.errstate(all="ignore"):
        found = np.array([float(getattr(law_at(scheme, x, RATE), of)[0]) for x in turns])
    return np.where(np.isfinite(found), found, nan)
