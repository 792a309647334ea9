"""A kernel and what it works on, interpreted or compiled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from springcheck.physics.arrays import Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """A kernel, its constants, and its state, which it changes.  `work` counts spring-steps."""

    kernel: Callable[..., Any]
    arguments: tuple[Any, ...]
    n: int
    work: float

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill rows q and p (f, n)."""
        self.kernel(every, *self.arguments, q, p)

    @property
    def compiled(self) -> Job:
        """The job with its kernel compiled.  Raises ImportError without numba."""
        from springcheck.engines.own.compiled import compiled

        none = np.empty((0, self.n))
        kernel = compiled(self.kernel, (1, *self.arguments, none, none))
        return replace(self, kernel=kernel)

    @property
    def interpreted(self) -> Job:
        """The job on lists, whose numbers neither warn nor raise where they overflow."""
        return replace(self, arguments=_as_lists(self.arguments))


def with_room(head: tuple[Any, ...], m: Floats, q: Floats, p: Floats, stages: int) -> tuple[Any, ...]:
    """The arguments of `kernels.many` behind `every`: its constants, work arrays, and the state."""
    n = len(m)
    v, f, stage = np.zeros((stages, n)), np.zeros((max(stages, 2), n)), np.zeros((2, n if stages else 0))
    return *head, m, (v, f, stage, np.zeros(n + 1), np.ones(2, bool)), q, p


def _as_lists(value: Any) -> Any:
    """Tuples within tuples, arrays in them as lists."""
    if isinstance(value, tuple):
        return tuple(map(_as_lists, value))
    return value.tolist() if isinstance(value, np.ndarray) else value
