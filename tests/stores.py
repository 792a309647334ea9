"""Trajectories, stores and interruptions that several tests make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from springcheck import store
from springcheck.physics.arrays import Arithmetic
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Timing, Trajectory

LABELS = ["own:euler", "openmm:verlet@OpenCL-mixed", "sundials:adams"]


def scene(n: int = 3, steps: int = 40, **changed: object) -> Scene:
    m = np.array([3.7, 0.4, 1.9, 2.2, 8.0])[:n]
    plain = Scene(
        name="chain", title="A chain", source="", m=m, q=0.1 * m, p=m, terms=(), step=-0.25, steps=steps,
        every=2, units="md",
    )  # fmt: skip
    return replace(plain, **changed)


def trajectory(s: Scene, label: str, seed: int = 0, frames: int | None = None) -> Trajectory:
    f = s.frames if frames is None else frames
    rng = np.random.default_rng(seed)
    return Trajectory(
        label=label,
        scheme="explicit-euler",
        t=np.arange(f) * s.step * s.every,
        q=rng.normal(size=(f, s.n)),
        p=rng.normal(size=(f, s.n)),
        energy=rng.normal(size=f) if "energy" in s.quantities else None,
        step=s.step,
        every=s.every,
        outcome=Outcome(status="diverged", step=17, message="force is inf: Kraft ∞"),
        timing=Timing(start=0.25, run=1.5),
        force_calls=41,
        tolerance=1e-12,
        arithmetic=Arithmetic(
            name="mixed", state=2.0**-24, force=2.0**-53, quantum=2.0**-32, overflow=2.0**31
        ),
        rebuilds_velocity=True,
        origin={"openmm": "8.6.1", "platform": "OpenCL", "velocity": "full step"},
    )


def written(path: Path, s: Scene, labels: list[str] = LABELS) -> dict[str, Trajectory]:
    made = {label: trajectory(s, label, seed) for seed, label in enumerate(labels)}
    with store.open_new(path, "run") as journal:
        for each in made.values():
            journal.save(each, s)
        journal.commit(s)
    return made


def assert_same(a: Trajectory, b: Trajectory) -> None:
    for name in ("t", "q", "p", "energy"):
        one, two = getattr(a, name), getattr(b, name)
        assert (one is None) == (two is None)
        assert one is None or one.tobytes() == np.ascontiguousarray(two).tobytes(), name
    for name in set(Trajectory.__slots__) - {"t", "q", "p", "energy"}:
        assert getattr(a, name) == getattr(b, name), name


def raising(after: int) -> Callable[..., None]:
    """A progress callback that is Ctrl-C at its `after`-th call."""
    calls: list[object] = []

    def told(*what: object) -> None:
        calls.append(what)
        if len(calls) == after:
            raise KeyboardInterrupt

    return told
