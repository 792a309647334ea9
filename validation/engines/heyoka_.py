"""heyoka: the equations of motion as symbols, integrated by Taylor series of its own order and step.

The right-hand side is compiled from formulas of the terms, so that no force of ours is called.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.engines.contract import Engine, Label, Method, Stopped, by_name, named, version_of
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Damping, Quartic, Spring, WallSpring
from springcheck.schemes import solver

SMALLEST_TOLERANCE = float(np.finfo(np.float64).eps)
"""heyoka takes no tolerance below the spacing of double precision at 1."""

MOST_PARTICLES = 200
"""Compiling takes a time that grows faster than the number of equations."""


def _forces(scene: Scene, library: Any, q: list[Any], v: list[Any]) -> list[Any]:
    """The force on each particle, as expressions in positions and velocities."""
    force: list[Any] = [library.expression(0.0) for _ in q]
    for term in scene.terms:
        if isinstance(term, WallSpring | Quartic | Cosine):
            for i, strength, *wave, at in term.rows():
                u = q[i] - at
                if isinstance(term, WallSpring):
                    force[i] -= strength * u
                elif isinstance(term, Quartic):
                    force[i] -= strength * u * u * u
                else:
                    force[i] -= strength * wave[0] * library.sin(wave[0] * u)
        elif isinstance(term, Spring):
            for a, b, k, rest in term.rows():
                pull = k * (q[b] - q[a] - rest)
                force[a] += pull
                force[b] -= pull
        elif isinstance(term, Damping):
            for i, c in term.rows():
                force[i] -= c * v[i]
    return force


class _Series:
    """heyoka's adaptive Taylor integrator in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        import heyoka

        if scene.n > MOST_PARTICLES:
            raise MethodError(
                f"{label}: equations of {scene.n} particles, at most {MOST_PARTICLES} are compiled"
            )
        self.force_calls = 0
        self._n, self._m, self._h, self._done = scene.n, scene.m, step, 0
        q = heyoka.make_vars(*(f"q{i}" for i in range(scene.n)))
        v = heyoka.make_vars(*(f"v{i}" for i in range(scene.n)))
        q, v = (x if isinstance(x, list) else [x] for x in (q, v))
        force = _forces(scene, heyoka, q, v)
        pushed = [(y, f / float(m)) for y, f, m in zip(v, force, scene.m, strict=True)]
        self._integrator = heyoka.taylor_adaptive(
            [*zip(q, v, strict=True), *pushed],
            state=np.concatenate([scene.q, scene.p / scene.m]).tolist(),
            tol=max(scene.tolerance, SMALLEST_TOLERANCE),
        )

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        n = self._n
        for row in range(len(q)):
            self._done += every
            outcome, *_, steps, _, _ = self._integrator.propagate_until(self._done * self._h)
            if "time_limit" not in str(outcome):
                raise Stopped(row, f"heyoka says {str(outcome).rpartition('.')[2]}")
            state = self._integrator.state
            q[row], p[row] = state[:n], state[n:] * self._m
            # one evaluation of the series stands for one of the force
            self.force_calls += steps


ENGINE = Engine(
    name="heyoka",
    title="heyoka",
    distribution="heyoka",
    methods=named(
        by_name(
            "taylor", "heyoka-taylor", "taylor_adaptive of the scene's equations, propagate_until each frame",
            frozenset({"wall-spring", "spring", "quartic", "cosine", "damping"}), adaptive=True,
        ),
    ),
    schemes=(
        solver(
            "heyoka-taylor", "Taylor series, adaptive order and step",
            "Biscani & Izzo, MNRAS 504 (2021) 2614; Jorba & Zou, Exp. Math. 14 (2005) 99",
        ),
    ),
    start=_Series,
    version=version_of("heyoka"),
)  # fmt: skip
