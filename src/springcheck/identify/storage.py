"""The storage format of recorded numbers, inferred from the numbers: double, single, half, decimal text."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from springcheck.physics.arrays import Floats

ROUNDING = 2.0**-53
"""Unit roundoff of double precision."""

SAMPLE = 500
"""Most values whose decimal form is examined, spread evenly over a long file."""

FEWEST_VALUES = 4
"""Fewest distinct magnitudes from which a format is inferred."""

BINARY = {"single": 24, "half": 11, "bfloat16": 8}
"""Significant bits of the binary formats shorter than double precision."""

SMALLEST = {"single": -149, "half": -24, "bfloat16": -133}
"""Binary exponents of the smallest subnormal numbers of these formats."""

MOST_DIGITS = 16
"""Most significant decimal digits of text that is coarser than double precision."""

DIGITS_OF_SINGLE = 7
"""Significant decimal digits that a number of single precision has: more of them only rewrite it."""

MOSTLY, MANY = 0.97, 50
"""Share of numbers that have fixed decimals where a few have more, and fewest numbers that show it."""

BY_CHANCE = 1e-6
"""Probability of a coincidence of numbers below which their format is certain."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Storage:
    """A storage format by its name, as "double", "single", "text, 6 digits", and its resolution."""

    name: str = "double"
    digits: int = 0
    """Significant decimal digits of text; 0 for binary formats and fixed decimals."""
    decimals: int | None = None
    """Digits after the decimal point of text with fixed decimals."""

    def quantum(self, x: Floats) -> Floats:
        """Spacing of the representable numbers around x."""
        if self.decimals is not None:
            # large numbers have no more digits than double precision
            return np.maximum(10.0**-self.decimals, np.spacing(np.abs(x)))
        if self.digits:
            size = np.where(x == 0, 1.0, np.abs(x))
            return np.where(x == 0, 0.0, 10.0 ** (np.floor(np.log10(size)) - self.digits + 1))
        if self.name in BINARY:
            return _spacing(x, self.name)
        return np.asarray(np.spacing(np.abs(x)))


def _spacing(x: Floats, name: str) -> Floats:
    """Spacing of the numbers of a binary format around x."""
    _, exponent = np.frexp(x)
    return np.asarray(np.ldexp(1.0, np.maximum(exponent - BINARY[name], SMALLEST[name])))


def _rounded(x: Floats, name: str) -> Floats:
    """x rounded to the nearest numbers of a binary format."""
    unit = _spacing(x, name)
    return np.asarray(np.rint(x / unit) * unit)


def single_of(x: Floats, digits: int = 0) -> bool:
    """Whether x are numbers of single precision: within an ulp of double, as after a conversion of units, or
    within the rounding of the decimal digits that they were written with."""
    x = x[x != 0]
    off = np.abs(_rounded(x, "single") - x)
    if np.all(off <= 2.0**-51 * np.abs(x)):
        return True
    if digits <= DIGITS_OF_SINGLE:
        return False
    unit = Storage(digits=digits).quantum(x)
    if np.any(off > unit / 2 + 2.0**-51 * np.abs(x)):
        return False
    # every number of few digits more lies near one by chance
    return float(np.sum(np.log(np.minimum(unit / _spacing(x, "single"), 1)))) < math.log(BY_CHANCE)


def storage(x: Floats) -> Storage:
    """Detect the storage format of x from the numbers themselves."""
    return storages(x)[0]


def storages(x: Floats) -> list[Storage]:
    """The formats that can hold x, the likeliest first: significant digits or fixed decimals for text."""
    values = np.ravel(x)
    values = values[values != 0]
    if len(np.unique(np.abs(values))) < FEWEST_VALUES:
        return [Storage()]
    at = np.linspace(0, len(values) - 1, min(len(values), SAMPLE)).astype(int)
    sample = values[at]
    listed = sample.tolist()
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        single = bool(np.all(np.abs(values) < 3e38)) and single_of(values)
        exact = (x for x in ("bfloat16", "half") if single and np.all(_rounded(values, x) == values))
        short = next(exact, None)

    def same(text: str, y: float) -> bool:
        return bool(np.float32(text) == np.float32(y)) if single else float(text) == y

    most = DIGITS_OF_SINGLE if single else MOST_DIGITS
    digits = next((d for d in range(1, most + 1) if all(same(f"{y:.{d - 1}e}", y) for y in listed)), 0)
    decimals = next((d for d in range(most) if all(same(f"{y:.{d}f}", y) for y in listed)), None)
    if not single and digits > DIGITS_OF_SINGLE and single_of(values, digits):
        # nine digits hold a number of single precision
        return [Storage(name="single")]
    found = [Storage(name=f"text, {digits} digits", digits=digits)] if digits else []
    # a row of small numbers has more decimals than the others, as NumPy prints it
    few = [d for d in range(decimals or 0) if np.mean([same(f"{y:.{d}f}", y) for y in listed]) >= MOSTLY]
    if few and len(listed) >= MANY:
        found.append(Storage(name=f"text, {few[0]} decimals", decimals=few[0]))
    if decimals is not None:
        found.append(Storage(name=f"text, {decimals} decimals", decimals=decimals))
    # text that is finer than the numbers around it says nothing: every number has such a decimal form
    binary = Storage(name=short or ("single" if single else "double"))
    with np.errstate(over="ignore"):
        finer = [text.quantum(sample) / (2 * binary.quantum(sample)) for text in found]
    # whole numbers of few digits are of a short format as well, which is hardly finer; of numbers that grow
    # beyond the digits of double precision the smaller ones show fixed decimals
    found = [
        x for x, y in zip(found, finer, strict=True)
        if np.all(y >= 1) or (short and np.all(y > 0) and np.sum(np.log(y)) >= 0)
        or (x.decimals is not None and np.sum(np.log(np.maximum(y, 1))) > -math.log(BY_CHANCE))
    ]  # fmt: skip
    # both can hold the numbers; the coarser of the two leaves less to chance.  A power of ten has its
    # neighbours below it ten times as close as those above
    below = sample * (1 - 2.0**-40)
    return sorted(found, key=lambda s: -float(np.mean(np.log10(s.quantum(below))))) or [binary]
