"""REBOUND: particles without gravity, their forces added by `additional_forces`.

WHFast moves particles on Kepler orbits between the kicks, which are straight lines where G = 0; it takes them
as test particles about one that rests.

IAS15 chooses its step by default from the ratio of acceleration and jerk, which is 0 wherever a spring's
force is: a thousand steps for each passage of q = 0.  Aarseth's criterion, which it has too, is 1/w at every
phase, as long as there is no friction.  Steps end at every frame.
"""

from __future__ import annotations

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from springcheck.engines.contract import (
    EVERY_POTENTIAL,
    Engine,
    Label,
    Method,
    Stopped,
    by_name,
    named,
    version_of,
)
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.schemes import solver

LOOK, LEAST = 4096, 1e-9
"""Force calls after which IAS15, which takes about a hundred a radian, must have come forward by this share
of the way to the next frame."""


@contextmanager
def _signals() -> Iterator[None]:
    """Ctrl-C as it was before: `integrate` hands it to a function of its own, for good, which forgets it."""
    kept = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        # None: it was not set by Python; elsewhere than in the main thread it cannot be set
        if kept is not None and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, kept)


class _Simulation:
    """REBOUND's simulation in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        import rebound

        integrator = method.name
        self.force_calls = 0
        self.off_axis = 0.0
        self._m, self._step, self._done = scene.m, step, 0
        self._adaptive = integrator == "ias15"
        self._simulation = sim = rebound.Simulation()
        sim.G, sim.gravity, sim.integrator, sim.dt = 0.0, "none", integrator, step
        if self._adaptive:
            sim.integrator.adaptive_mode = "aarseth85"
        centre = integrator == "whfast"
        if centre:
            # off the line, so that no particle ever meets it
            sim.add(m=1.0, y=1.0)
        for m, q, v in zip(scene.m.tolist(), scene.q.tolist(), (scene.p / scene.m).tolist(), strict=True):
            sim.add(m=0.0 if centre else m, x=q, vx=v)
        self._q, self._y, self._v, acceleration = _columns(sim, int(centre), scene.n)
        force = scene.system.force

        self._seen, self._stands = 0.0, False

        def forces(_: Any) -> None:
            self.force_calls += 1
            acceleration[:] += force(self._q, self._v * self._m) / self._m
            if self._adaptive and not self.force_calls % LOOK:
                self._stands = abs(sim.t - self._seen) < LEAST * abs(step) * scene.every
                self._seen = sim.t
                if self._stands:
                    sim.stop()

        sim.additional_forces = forces

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        steps, q_now, v_now = self._simulation.steps, self._q, self._v
        with np.errstate(over="ignore", invalid="ignore"), _signals():
            for row in range(len(q)):
                self._done += every
                if self._adaptive:
                    self._simulation.integrate(self._done * self._step)
                    if self._stands:
                        raise Stopped(row, f"IAS15 comes no further: {LOOK} force calls for 1e-9 of a frame")
                else:
                    steps(every)
                q[row] = q_now
                np.multiply(v_now, self._m, out=p[row])
            self.off_axis = max(self.off_axis, float(np.max(np.abs(self._y))))


def _columns(sim: Any, first: int, n: int) -> list[Floats]:
    """Views (n,) of x, y, and velocity and acceleration along x of REBOUND's particles from this one on."""
    import rebound

    size = ctypes.sizeof(rebound.Particle)
    address = ctypes.addressof(sim.particles[first])
    memory: Any = (ctypes.c_char * (size * n)).from_address(address)
    offsets = [getattr(rebound.Particle, name).offset for name in ("x", "y", "vx", "ax")]
    return [np.ndarray((n,), np.float64, memory, offset, (size,)) for offset in offsets]


ENGINE = Engine(
    name="rebound",
    title="REBOUND",
    distribution="rebound",
    methods=named(
        by_name("leapfrog", "position-verlet", "additional_forces, integrator leapfrog", EVERY_POTENTIAL),
        by_name("whfast", "position-verlet", "additional_forces, integrator WHFast, G = 0", EVERY_POTENTIAL,
            note="without gravity WHFast is a drift-kick-drift"),
        by_name(
            "ias15", "rebound-ias15", "additional_forces, integrator IAS15, Aarseth's step", EVERY_POTENTIAL,
            adaptive=True,
        ),
    ),
    schemes=(
        solver(
            "rebound-ias15", "IAS15, Gauss-Radau of order 15, adaptive",
            "Rein & Spiegel, MNRAS 446 (2015) 1424; step: Aarseth 1985, in Pham, Rein & Spiegel 2023",
        ),
    ),
    start=_Simulation,
    version=version_of("rebound"),
)  # fmt: skip
