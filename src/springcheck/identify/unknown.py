"""The class of a one-step method that is not in the catalogue, from its map of a spring."""

from __future__ import annotations

import cmath
import math

import numpy as np

from springcheck.identify.measure import Map

MAP_OF = "it is that of a one-step method, "
ONE_MAP, UNKNOWN = "One linear map explains the states", "not known here"


def _order_of(x: float, step: float, y: float) -> tuple[int, float]:
    """Order of a method whose stability function is x + i y on the imaginary axis at `step`, and the
    coefficient of the power after it; 0 where no single power explains the error."""
    wrong = complex(x, y) - cmath.exp(1j * step)
    found = {n: wrong / (1j * step) ** n for n in range(1, 10)}
    real = [n for n, c in found.items() if abs(c.imag) < 0.3 * abs(c.real)]
    if not real:
        return 0, math.nan
    n = min(real, key=lambda n: abs(math.log(abs(found[n].real) * math.factorial(n))))
    return n - 1, 1 / math.factorial(n) + found[n].real


def kind_of_map(m: Map) -> str:
    """The class of a one-step method, from its map of a spring, as a sentence; "" where it shows none."""
    (x, y), (z, u) = m.unscaled
    error = 6 * np.sqrt(np.diag(m.cov)) + 1e-13
    ratio = float(m.size[1] / m.size[0])
    det, turn = x * u - y * z, -z / y if y else -1.0
    if not (det > 0 and turn > 0):
        return ""
    begin = f"{ONE_MAP}: if every step was recorded, it is that of a one-step method {UNKNOWN}"
    even = abs(x - u) <= math.hypot(error[0], error[3])
    keeps = abs(det - 1) <= 4 * float(np.max(error)) * max(ratio, 1 / ratio)
    areas = "keeps areas" if keeps else f"multiplies areas by 1 {det - 1:+.2e}"
    if not even:
        return f"{begin}, which {areas}"
    order, weight = _order_of(x, math.sqrt(turn), math.sqrt(turn) * y)
    areas = f"{areas} and is symmetric in time" if keeps else areas
    if not order:
        return f"{begin}, which {areas}"
    begin = begin.replace("one-step method", f"one-step method of order {order},")
    if keeps:
        return f"{begin}, which {areas}"
    return f"{begin}, whose stability function has {weight:.3g} z**{order + 1}"
