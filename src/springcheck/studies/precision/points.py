"""One point of a study of precision: one method at one step or tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck.studies.precision.accuracy import Accuracy


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One method at one step or tolerance: what it cost and how far it was off, or why there is nothing."""

    method: str
    step: float | None
    """[T]; None for an adaptive solver."""
    tolerance: float | None
    steps: int | None
    outcome: str
    """"complete", or what else happened."""
    message: str = ""
    accuracy: Accuracy | None = None
    run_repeats: tuple[float, ...] = ()
    """Seconds inside the engine's stepping, nothing recorded."""
    start_repeats: tuple[float, ...] = ()
    """Seconds until the engine stood ready, its library imported and its code compiled before."""
    read_repeats: tuple[float, ...] = ()
    """Seconds of the same steps with each of them read."""
    force_calls: int | None = None
    spent: float = 0.0
    """Seconds that all of its runs took, with their starts and comparisons."""

    @property
    def complete(self) -> bool:
        """Whether there are errors to look at."""
        return self.outcome == "complete"

    @property
    def size(self) -> float:
        """Length of the step, 0 for an adaptive solver."""
        return self.step or 0.0

    @property
    def error(self) -> float:
        """The largest error, NaN where there is none."""
        return self.accuracy.largest if self.accuracy else float("nan")

    @property
    def rounding(self) -> float | None:
        """The part of the error that is rounding, where it is known."""
        return self.accuracy.rounding if self.accuracy else None

    @property
    def seconds(self) -> float:
        """The smallest run time, NaN without one."""
        return min(self.run_repeats, default=float("nan"))

    @property
    def quartiles(self) -> tuple[float, float] | None:
        """First and third quartile of the run times."""
        if not self.run_repeats:
            return None
        low, high = np.quantile(self.run_repeats, [0.25, 0.75])
        return float(low), float(high)
