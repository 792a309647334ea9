"""What the engines of this folder share: each mass on its spring to a wall, stepped by a function."""

import subprocess
from collections.abc import Callable
from typing import Any

import numpy as np

from springcheck.engines import Method, named
from springcheck.engines.contract import by_name
from springcheck.errors import MethodError
from springcheck.physics.terms import WallSpring

SPRINGS = frozenset({"wall-spring"})


def methods(**found: tuple[str, str]) -> dict[str, Method]:
    """Methods by name: scheme, and what is called."""
    return named(
        *(by_name(x.replace("_", "-"), scheme, about, SPRINGS) for x, (scheme, about) in found.items())
    )


class Springs:
    """Every particle moved by itself: `start(m, k, at, q, v, h)` gives the `step()` that returns q and v."""

    def __init__(
        self, scene: Any, step: float, start: Callable[..., Callable[[], tuple[float, float]]]
    ) -> None:
        tied = dict.fromkeys(range(scene.n), (0.0, 0.0))
        for term in scene.terms:
            if isinstance(term, WallSpring):
                for i, k, at in term.rows():
                    tied[i] = (tied[i][0] + k, at)
        self._m, self.force_calls = scene.m, 0
        self._steps = [
            start(m, *tied[i], q, v, step)
            for i, (m, q, v) in enumerate(
                zip(scene.m.tolist(), scene.q.tolist(), (scene.p / scene.m).tolist(), strict=True)
            )
        ]

    def advance(self, every: int, q: Any, p: Any) -> None:
        """Fill rows of positions and momenta, each `every` steps after the one before."""
        for row in range(len(q)):
            for i, step in enumerate(self._steps):
                for _ in range(every):
                    x, v = step()
                q[row, i], p[row, i] = x, v * self._m[i]
        self.force_calls += every * len(q)


class Batch:
    """A program that writes a whole run, called for as many steps as the scene has at the first rows."""

    def __init__(self, scene: Any, states: Callable[[int], tuple[Any, Any]]) -> None:
        self._steps, self._states, self._row, self.force_calls = scene.steps, states, 0, 0
        self._found: tuple[Any, Any] | None = None

    def advance(self, every: int, q: Any, p: Any) -> None:
        """Fill rows of positions and momenta, each `every` steps after the one before."""
        if self._found is None:
            self._found = self._states(max(self._steps, every * len(q)))
        rows = self._row + every * (1 + np.arange(len(q)))
        q[:], p[:] = (x[rows] for x in self._found)
        self._row, self.force_calls = int(rows[-1]), self.force_calls + every * len(q)


def placed(scene: Any) -> tuple[Any, Any, Any, Any]:
    """Positions, velocities, stiffnesses of the springs to walls and where these are, each (particles, 3)."""
    x, v, pull, at = np.zeros((4, 3 * scene.particles))
    where = np.arange(3 * scene.particles)[scene.where]
    x[where], v[where] = scene.q, scene.p / scene.m
    for term in scene.terms:
        if isinstance(term, WallSpring):
            pull[where[term.i]], at[where[term.i]] = term.k, term.at
    return x.reshape(-1, 3), v.reshape(-1, 3), pull.reshape(-1, 3), at.reshape(-1, 3)


def called(command: str, folder: str) -> str:
    """What a program prints that is run in a folder; MethodError with its last lines where it fails."""
    ran = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, check=False)
    if ran.returncode:
        last = " ".join((ran.stdout + ran.stderr).split())[-300:]
        raise MethodError(f"{command.partition(' ')[0]} failed: {last}")
    return ran.stdout
