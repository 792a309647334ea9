"""Decay factors of a momentum over a step, by scheme, as functions of x = gamma h, friction rate times h."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Decay:
    """Factor of a momentum over a step, c(x), and the loss 1 - c(x) without its cancellation at small x."""

    left: Callable[[Any], Any]
    lost: Callable[[Any], Any]
    added: Callable[[Any], Any] | None = None
    """1 + c(x), where 2 - lost(x) would cancel."""

    def __call__(self, x: Any) -> Any:
        """c(x)."""
        return self.left(x)

    def both(self, x: Any) -> Any:
        """1 + c(x)."""
        return self.added(x) if self.added else 2 - self.lost(x)

    def stretch(self, x: Any) -> Any:
        """Factor by which a GJ scheme stretches kicks and drifts: q**2 = 2 (1 - c2)/((1 + c2) x)."""
        return np.sqrt(2 * self.lost(x) / (self.both(x) * x))


def decay(share: int) -> Decay:
    """exp(-x/share)."""
    return Decay(lambda x: np.exp(-x / share), lambda x: -np.expm1(-x / share))


def _seventh(x: Any) -> Any:
    """The y > 0 with x = 2 y**2 coth y, by Newton: log c = -2 y solves x = (1 + c)/(1 - c) log(c)**2 / 2."""
    path = [y := np.where(np.asarray(x) < 1, x / 2, np.sqrt(np.abs(x) / 2))]
    for i in range(60):
        change = (2 * y * y / np.tanh(y) - x) / (4 * y / np.tanh(y) - 2 * (y / np.sinh(y)) ** 2)
        path.append(y := y - change)
        # rounding carries some of many numbers round in twos, threes and fours: the last step finds them so
        round_again = i % 12 == 11 and np.all(y == path[-13])
        if round_again or np.all(np.abs(change) <= np.finfo(y.dtype).eps * np.abs(y)):
            break
    return y


def _root(x: Any) -> Any:
    return np.sqrt(1 + 4 * x)


GJ: dict[str, Decay] = {
    "i": Decay(lambda x: (1 - x / 2) / (1 + x / 2), lambda x: x / (1 + x / 2), lambda x: 2 / (1 + x / 2)),
    "ii": decay(1),
    "iii": Decay(lambda x: 1 - x, lambda x: x),
    "iv": Decay(lambda x: 2 / (1 + _root(x)), lambda x: 4 * x / (1 + _root(x)) ** 2),
    "v": Decay(lambda x: 1 / (1 + x), lambda x: x / (1 + x)),
    "vi": Decay(lambda x: 1 / (1 + x / 2) ** 2, lambda x: x * (1 + x / 4) / (1 + x / 2) ** 2),
    "vii": Decay(lambda x: np.exp(-2 * _seventh(x)), lambda x: -np.expm1(-2 * _seventh(x))),
    "viii": Decay(
        lambda x: 1 / (np.hypot(1, x) + x),
        lambda x: x * (1 + x / (np.hypot(1, x) + 1)) / (np.hypot(1, x) + x),
    ),
}
"""The decay c2 of each GJ scheme as a function of x = gamma h."""

MOST_FRICTION = {"iii": 2.0}
"""The x up to which such a decay is above -1, where it is not so everywhere."""
