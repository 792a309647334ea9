"""Thermostats on a thousand equal springs: temperatures and stability limits, each next to its law."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import nan
from pathlib import Path
from typing import Unpack

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.bath import THERMOSTATS
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import choose
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.sampling.laws import RATE, last_stable, law_at, limits
from springcheck.studies.sampling.result import SAMPLED, Sampled, Sampling

MASS, STIFFNESS, KT = 3.7, 2.9, 1.7
"""Mass, stiffness and kT, none of them 1."""

OMEGA = float(np.sqrt(STIFFNESS / MASS))

SAMPLED_TURNS = np.array([0.2, 0.5, 0.8, 1.0, 1.2, 1.4])
"""h omega at which temperatures are measured."""

FRICTIONS = np.array([0.03, 0.1, 0.3, 1.0, 3.0, 10.0])
"""Friction over omega at which limits are measured."""

WIDE, FRAMES, BLOCKS = 1000, 500, 20
"""Springs side by side, frames of a mean, and blocks of frames for the error of what all springs share."""

WAIT, SLOWEST_DECAY = 5.0, 0.002
"""Decay times of the motion and of its variances before frames are used, and the least decay a step."""

HOTTEST_LAW = 100.0
"""Largest temperature of a law over the bath's: above it, motion is not bounded within these steps."""

SEED_OF_ALL, SEED_OF_START = 27, 26
"""Seeds of all methods and of the states at the start; not tuned."""


def springs(n: int, turn: float, friction: float, steps: int = 1) -> Scene:
    """Equal springs in a bath at typical thermal states, by h omega and friction over omega."""
    q, p = np.random.default_rng(SEED_OF_START).standard_normal((2, n))
    return Scene(
        m=np.full(n, MASS), q=np.sqrt(KT / STIFFNESS) * q, p=np.sqrt(MASS * KT) * p, step=turn / OMEGA,
        terms=(WallSpring(i=np.arange(n), k=np.full(n, STIFFNESS), at=np.zeros(n)),), steps=steps,
        bath=Bath(temperature=KT, friction=friction * OMEGA), quantities=("q", "p"), name="springs",
    )  # fmt: skip


def temperature(squares: Floats) -> tuple[float, float]:
    """Mean of squares (f, n) over kT, and its standard error: the larger of that across springs as if these
    were independent, and of that across blocks of frames, which holds what springs share."""
    alone = float(np.std(np.mean(squares, axis=0))) / np.sqrt(squares.shape[1])
    blocks = [np.mean(block) for block in np.array_split(squares, BLOCKS)]
    return float(np.mean(squares)), max(alone, float(np.std(blocks, ddof=1)) / np.sqrt(BLOCKS))


def measured(label: Label) -> Sampled:
    """Measure one thermostat."""
    method = engines.method(label)
    scheme = THERMOSTATS[method.scheme]
    rows, run = [], None
    for turn in SAMPLED_TURNS:
        law = None if scheme.rescales else law_at(scheme.name, np.array([turn]), RATE)
        exact = (float(law.configurational[0]), float(law.kinetic[0])) if law else (nan, nan)
        if law and not max(exact) < HOTTEST_LAW:
            rows.append((nan,) * 6)
            continue
        # collisions mix maps, so that variances may settle far later than means
        left = max(law.slowest, float(law.growth[0])) if law else np.exp(-WAIT / 100)
        wait = round(WAIT / max(-np.log(left), SLOWEST_DECAY)) if left > 0 else 5
        run = driver.run(springs(WIDE, turn, RATE, wait + FRAMES), label, seed=SEED_OF_ALL)
        of_q = temperature(STIFFNESS * run.q[wait:] ** 2 / KT)
        of_p = temperature(run.p[wait:] ** 2 / (MASS * KT))
        rows.append((*of_q, exact[0], *of_p, exact[1]))
    if run is None:
        raise MethodError(f"{label}: no step is stable from h omega {SAMPLED_TURNS[0]} on")
    q, q_error, q_law, p, p_error, p_law = np.array(rows).T
    none, steps = np.full(len(FRICTIONS), nan), max(run.outcome.step, 1)
    linear = not scheme.rescales
    return Sampled(
        method=str(label), scheme=scheme.name, title=schemes.title(scheme.name), turn=SAMPLED_TURNS,
        configurational=q, configurational_error=q_error, configurational_law=q_law, kinetic=p,
        kinetic_error=p_error, kinetic_law=p_law, friction=FRICTIONS,
        limit=np.array([_limit_of_engine(label, float(x)) for x in FRICTIONS])
        if linear and not scheme.collides else none,
        limit_law=limits(scheme.name, FRICTIONS) if linear else none,
        force_calls=run.force_calls / steps, seconds=run.timing.run / steps / WIDE,
    )  # fmt: skip


def _radius_of_engine(label: Label, friction: float, turn: float) -> float:
    """Spectral radius of second moments under an engine's map; with one seed, three starts cancel noise."""
    one, rest = springs(1, turn, friction, 2), np.zeros(1)
    runs = [
        driver.run(replace(one, q=q, p=p), label, seed=SEED_OF_ALL)
        for q, p in ((rest, rest), (rest + 1, rest), (rest, rest + MASS * OMEGA))
    ]
    if any(len(run.q) < 3 for run in runs):
        return np.inf
    # from the first step to the second, because some engines begin with another step
    base, *both = (np.stack([run.q[1:3, 0], run.p[1:3, 0] / (MASS * OMEGA)]) for run in runs)
    moved = np.array([one - base for one in both])
    if not np.isfinite(moved).all():
        return np.inf
    A = np.linalg.lstsq(moved[:, :, 0], moved[:, :, 1])[0].T
    return float(np.max(np.abs(np.linalg.eigvals(A)))) ** 2


def _limit_of_engine(label: Label, friction: float) -> float:
    """The same of an engine's own map."""
    try:
        found = last_stable(
            lambda turns: np.array([_radius_of_engine(label, friction, float(x)) for x in turns]), 1, 1e-6
        )
    except MethodError:
        return nan
    return float(found[0])


def record(path: str | Path | None, methods: Sequence[str] = (), **how: Unpack[How]) -> Sampling:
    """Measure thermostats with these labels or globs, by default the default ones; saved in a store."""
    labels, left, _ = choose(replace(springs(1, 0.5, RATE), include=("*",)), methods)
    pieces = each(labels, "", lambda label: partial(measured, label), SAMPLED)

    def measure(kept: Keeper) -> Sampling:
        return Sampling(methods=tuple(kept.results(pieces)), left_out=tuple(left))

    return keeper.study("sampling", path, labels, measure, **how)


def perform(options: Namespace, progress: Progress | None) -> Sampling:
    """Carry out `springcheck sampling`."""
    return record(options.output or "sampling.h5", options.method, **keeper.how(options, progress))
