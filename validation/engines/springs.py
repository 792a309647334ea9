"""What the engines of this folder share: each mass on its spring to a wall, stepped by a function."""

from collections.abc import Callable
from typing import Any

from springcheck.engines import Method, named
from springcheck.engines.contract import by_name
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
