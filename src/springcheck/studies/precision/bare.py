"""Time an engine alone: started and stepped as the driver does it, with nothing recorded."""

from __future__ import annotations

from time import perf_counter
from typing import NamedTuple

import numpy as np

from springcheck import engines
from springcheck.driver import PIECE
from springcheck.engines.contract import Label, Simulation
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Timing

UNHEARD = 0.25
"""Longest call of an engine that cannot be interrupted, where its numbers are discarded [s]."""


class Bare(NamedTuple):
    """Cost of running an engine alone, for one run of it: seconds of wall clock and force calls."""

    timing: Timing
    force_calls: int


def measure(scene: Scene, label: Label, *, copies: int = 1, planned: int = 0) -> Bare:
    """Time the engine alone: all steps in one call and one row read at the end, nothing recorded.

    `copies` fresh runs are timed together, one after the other, where one is too short for the clock.
    `planned` is how many steps the caller will
    take in all: an engine that compiles decides by them, not by this one run, so that all runs of a study
    use the same code.  Numbers that are not finite are timed like others: judge them by `play`.

    Raises:
        Stopped: the engine gave up.
    """
    method = engines.method(label)
    engines.load(label.engine)
    ahead = scene if method.adaptive else scene.derived(steps=max(scene.steps, planned))
    began = perf_counter()
    simulations = [engines.Started(ahead, label, 1) for _ in range(copies)]
    start_seconds = perf_counter() - began
    alone = [one.simulation for one in simulations]
    q, p = np.empty((2, 1, scene.n))

    def timed() -> float:
        began = perf_counter()
        for simulation in alone:
            _advance_unread(simulation, scene.steps, scene.steps if method.adaptive else PIECE, q, p)
        return perf_counter() - began

    run_seconds = engines.guarded(label, timed)
    return Bare(
        timing=Timing(start=start_seconds / copies, run=run_seconds / copies),
        force_calls=simulations[0].force_calls,
    )


def _advance_unread(simulation: Simulation, steps: int, piece: int, q: Floats, p: Floats) -> None:
    """All steps and one row, in as few calls as Ctrl-C allows: one takes at most about `UNHEARD` seconds."""
    while steps:
        began = perf_counter()
        some = min(piece, steps)
        simulation.advance(some, q, p)
        steps -= some
        if perf_counter() - began < UNHEARD / 4:
            piece *= 4
