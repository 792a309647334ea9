"""A clock that no other program's load moves: a budget of seconds ends at the same step everywhere."""

from __future__ import annotations

from typing import Any

import pytest

from springcheck import driver, engines
from springcheck.studies.precision import measure, sweeping


class Clock:
    """Seconds by what was done: 1e-7 a step, 1e-5 a frame of an adaptive solver, 1e-7 a look at the clock."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        self.seconds += 1e-7
        return self.seconds


class _Metered:
    """A simulation that puts the clock forward."""

    def __init__(self, inner: Any, clock: Clock, each: float) -> None:
        self._inner, self._clock, self._each = inner, clock, each

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def advance(self, every: int, q: Any, p: Any) -> None:
        self._clock.seconds += self._each * every * len(q)
        self._inner.advance(every, q, p)


def steady(patch: pytest.MonkeyPatch) -> Clock:
    """Have driver and precision read such a clock."""
    clock = Clock()
    load = engines.load

    class Driver:
        def __init__(self, name: str) -> None:
            self._inner = load(name)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._inner, name)

        def start(self, scene: Any, method: Any, label: Any, step: float) -> _Metered:
            each = 1e-5 if method.adaptive else 1e-7
            return _Metered(self._inner.start(scene, method, label, step), clock, each)

    patch.setattr(engines, "load", Driver)
    for module in (driver, measure, sweeping):
        patch.setattr(module, "perf_counter", clock)
    return clock
