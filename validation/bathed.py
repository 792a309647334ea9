"""Thermostats with wrong draws, seeds, parameters or stages, by the plain engine of `textbook`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from springcheck import checks
from springcheck.bath import THERMOSTATS, Stepper
from springcheck.bath.catalogue import Act
from springcheck.bath.stepper import forces
from springcheck.checks.seeds import SEEDED, Seeded
from springcheck.physics.arrays import Floats, Force
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.terms import WallSpring
from springcheck.physics.trajectory import Trajectory
from textbook import Case, Fault, State, record

Draws: TypeAlias = Callable[[Sequence[Floats]], Any]
"""Correct draws so far, each (n,), the last one due -> the draw that is used in place of the last."""

OF_THERMOSTATS: tuple[str, ...] = (*(one.name for one in checks.RANDOM), *(one.name for one in SEEDED))
"""Names of the checks that judge thermostats."""


def springs(n: int, *, name: str = "bath", steps: int = 1200) -> Scene:
    """Unequal particles on unequal springs in a bath; no parameter is 1."""
    m, k = np.geomspace(0.7, 9.0, n), np.geomspace(5.0, 1.9, n)
    walls = WallSpring(i=np.arange(n), k=k, at=np.zeros(n))
    return Scene(
        m=m, q=np.full(n, 0.3), p=np.full(n, 0.2), terms=(walls,), step=0.35, steps=steps,
        name=name, bath=Bath(temperature=1.7, friction=0.8),
    )  # fmt: skip


def subject(
    fault: Fault, size: float | None, scene: Scene | None = None, seed: int = 20261122
) -> Seeded:  # fmt: skip
    """A fault as subject of the experiments with seeds, on three springs or another scene."""
    scene = scene or springs(3)
    return Seeded(scene=scene, label=fault.name, seed=seed, play=partial(fault.run, size=size))


def played(
    c: Case, draws: Draws = lambda right: right[-1], *, runs: str | Sequence[Act] = "",
    seed: Callable[[Any], Any] = lambda seed: seed, h: float = 1.0,
    m: Floats | float = 1.0, k: float = 1.0, rate: float = 1.0, thermal: float = 1.0, collision: float = 1.0,
) -> Trajectory:  # fmt: skip
    """A thermostat with other draws, another scheme (by name, or by its stages), another seed, or
    other parameters: factors of the step, masses, forces, friction, kT and the probability of a collision."""
    scene, claims = c.scene, THERMOSTATS[c.scheme.name]
    assert scene.bath is not None
    of = THERMOSTATS[runs or claims.name] if isinstance(runs, str) else replace(
        claims, acts=tuple(runs)
    )  # fmt: skip
    stepper = Stepper(
        replace(of, uniform=claims.uniform), h=scene.step * h, m=scene.m * m, rate=scene.bath.friction * rate,
        thermal=scene.thermal * thermal, width=np.float64,
    )  # fmt: skip
    # a scripted generator replaces every other
    source = c.seed if hasattr(c.seed, "standard_normal") else seed(c.seed)
    rng = source if hasattr(source, "standard_normal") else np.random.default_rng(source)
    right: list[Floats] = []

    def drawn() -> Any:
        uniform = claims.uniform
        right.append(np.sqrt(12) * (rng.random(scene.n) - 0.5) if uniform else rng.standard_normal(scene.n))
        return draws(right)

    def stiffer(terms: Sequence[Term]) -> Force:
        right = scene.system.force_of(terms)
        return lambda q, p: np.asarray(right(q, p) * k)

    force, carried = forces(scene.system, stiffer), [drawn() for _ in range(of.carried)]

    def one(i: int, q: Floats, p: Floats) -> State:
        taken = [*carried, *(drawn() for _ in range(of.fresh))]
        hit = rng.random(scene.n) < collision * stepper.collision if of.collides else None
        carried[:] = taken[len(taken) - of.carried :]
        return stepper(q, p, force, taken, hit)  # type: ignore[return-value]

    return record(scene, c.scheme, one)


def by(factor: Any) -> Draws:
    """Draws too large by a factor."""
    return lambda right: right[-1] * factor


def of_rank(change: Callable[[Floats], Any]) -> Draws:
    """Draws of another distribution, by a function of uniform numbers in (0, 1)."""

    def draws(right: Sequence[Floats]) -> Any:
        from scipy.special import ndtr

        return change(ndtr(right[-1]))

    return draws


def heavy(rank: Floats) -> Any:
    """Student's distribution of five degrees of freedom, of variance 1."""
    from scipy.special import stdtrit

    return stdtrit(5, rank) * np.sqrt(0.6)


def forgetting(scene: Scene) -> float:
    """gamma h of a scene in a bath."""
    assert scene.bath is not None
    return scene.step * scene.bath.friction
