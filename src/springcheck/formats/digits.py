"""Precision of the numbers of a file: single or double, significant digits or fixed decimals."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from springcheck.formats.columns import Fixed, Floats, States

SHOWN = 1000
"""Rows whose digits are counted."""
FEWEST_CELLS = 8
"""Different numbers of nine digits, too many to be of single precision by chance."""
FEWEST_LONG = 20
"""Numbers that would need 17 digits as doubles, by expectation, of which none has them in text of 16."""
AS_WIDE = 0.75
"""Share of the numbers of a column that are as wide as any where all were cut off at one width: of others the
last digits are zeros by chance, and may be left out."""


BARE_EXPONENT = re.compile(r"^([+-]?\d*\.\d*)([+-]\d{3})$")
"""Fortran omits the letter of an exponent of three digits."""


def number(cell: str) -> float:
    """The number in a cell, also with Fortran's exponents (1.5D+00, 1.5-100).  ValueError where there is
    none."""
    if "_" in cell:
        # Python's own way to write a number
        raise ValueError(f"could not convert string to float: {cell!r}")
    try:
        return float(cell)
    except ValueError:
        if len(cell) < 64:
            return float(BARE_EXPONENT.sub(r"\1e\2", cell).replace("d", "e").replace("D", "e"))
        raise


def roundoff(rows: Sequence[Sequence[str]], columns: Iterable[int]) -> float:
    """Half a unit of the last digit, relative to the largest number, of the column with the fewest digits.

    That of a double from 16 digits on, or 17 where many doubles would need them; and of single precision at
    least where all numbers equal single ones to their digits, or are the shortest text of such.  A column
    that is constant, or 0, does not count.
    """
    found = 2.0**-53
    for i in columns:
        cells = {row[i] for row in rows[:SHOWN]}
        x, digits = np.array([*map(number, cells)]), max(map(_digits, cells))
        size = np.abs(x[x != 0])
        long = np.sum(np.maximum(1 - np.spacing(size) / 10.0 ** (np.floor(np.log10(size)) - 15), 0))
        if len(cells) > 1 and 0 < digits < 16 + (long > FEWEST_LONG):
            half, many = 0.5 * 10.0 ** (1 - digits), len(cells) >= FEWEST_CELLS
            with np.errstate(over="ignore"):
                near = x.astype(np.float32)
                short = np.array([float(str(y)) for y in near]) == x
                single = many and np.all((np.abs(near - x) <= half * np.abs(x)) | short)
            found = max(found, half, 2.0**-24 if single else 0.0)
    return found


def as_written(states: States) -> States:
    """States with the digits that their numbers show, as of doubles that were rounded before they are stored;
    those of a format that states its own keep them."""
    if states.roundoff > 2.0**-53 or states.fixed:
        return states
    numbers = np.hstack([x[:SHOWN] for x in (states.q, states.p, states.v) if x is not None])
    width, of_q = numbers.shape[1], states.q.shape[1]

    def shortest(x: Floats) -> list[list[str]]:
        return [[np.format_float_positional(y, trim="0") for y in row] for row in x]

    if len(numbers) < FEWEST_CELLS or roundoff(shortest(numbers[:FEWEST_CELLS]), range(width)) == 2.0**-53:
        return states
    rows = shortest(numbers)
    known = roundoff(rows, range(width)), fixed(rows, range(of_q), range(of_q, width))
    return replace(states, roundoff=known[0], fixed=known[1]) if known[0] > 2.0**-53 else states


def fixed(rows: Sequence[Sequence[str]], q: Iterable[int], v: Iterable[int]) -> Fixed | None:
    """How columns of positions and of momenta or velocities are rounded to decimals; None where none is.

    The numbers of the largest decade have as many decimals as any, and few digits, or fewer of them the
    smaller they are.  A column that is constant has fixed decimals where others have as many.
    """
    halves, known, constant, coarse = [0.0, 0.0], set[int](), list[tuple[int, int]](), list[int]()
    single = True
    for part, i in [(0, i) for i in q] + [(1, i) for i in v]:
        cells = {row[i] for row in rows[:SHOWN]}
        x = np.array([*map(number, cells)])
        places = np.array([len(cell.partition(".")[2]) for cell in cells])
        digits, width = (np.array([*map(of, cells)]) for of in (_digits, len))
        most, whole = int(np.max(places)), width == np.max(width)
        if np.mean(whole) >= AS_WIDE and np.max(digits) < 16 and np.ptp(digits[whole]) > 0:
            # cut off behind so many letters, a minus among them
            places = np.where(whole, np.min(places[whole]), places)
            most = int(np.max(places))
        with np.errstate(divide="ignore"):
            decade = np.floor(np.log10(np.abs(x)))
        plain = not any(re.search(r"[eEdD]|\d[+-]", cell) for cell in cells)
        lossy = np.max(digits) < 16 or (np.min(places) == most and np.any((digits > 0) & (digits < 15)))
        half = 0.5 * 10.0**-most
        with np.errstate(over="ignore"):
            rest = np.abs(np.float32(x) - x)
        if np.ptp(x) == 0:
            constant.append((part, most))
        elif plain and lossy and np.max(places[decade == np.max(decade)]) == most:
            halves[part] = max(halves[part], half)
            known.add(most)
            single &= bool(np.all(rest <= half))
            if len(cells) < FEWEST_CELLS or np.ptp(places):
                # numbers of one decade without their last zeros may be of as many digits
                coarse += [i] if np.ptp(digits[places == most]) == 0 else []
        else:
            coarse.append(i)
            single &= roundoff(rows, [i]) > 2.0**-53 or not np.any(rest)
    for part, most in constant:
        if most in known:
            halves[part] = max(halves[part], 0.5 * 10.0**-most)
    beside = max(roundoff(rows, coarse), 2.0**-24 if single else 0.0)
    return Fixed(halves[0], halves[1], beside) if known else None


def _digits(cell: str) -> int:
    return len(re.sub(r"([eEdD]|(?<=.)[+-]).*$", "", cell).lstrip("+-").replace(".", "").lstrip("0"))
