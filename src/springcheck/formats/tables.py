"""Text tables: columns of numbers separated by commas, semicolons, tabs or blanks, with or without names."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import (
    Fixed,
    Floats,
    States,
    counts_steps,
    kinds,
    listed,
    named,
    split,
    times,
)
from springcheck.formats.lines import Lines, number

SHOWN = 1000
"""Rows whose digits are counted."""
FEWEST_CELLS = 8
"""Different numbers of nine digits, too many to be of single precision by chance."""
FEWEST_LONG = 20
"""Numbers that would need 17 digits as doubles, by expectation, of which none has them in text of 16."""
AS_WIDE = 0.75
"""Share of the numbers of a column that are as wide as any where all were cut off at one width: of others the
last digits are zeros by chance, and may be left out."""
COMMENT = ("#", "%", "!", "//")
"""Prefix of a comment, which may name the columns and holds no row of numbers."""


def read_table(path: Path, columns: list[str], step: float | None) -> States:
    """The states of a text table; the last line before the numbers names the columns, or has their units."""
    header: list[str] = []
    legends: list[str] = []
    units = ""
    first: list[list[str]] = []
    numbers, width = array("d"), 0
    unlike: StoreError | None = None
    with Lines(path) as lines:
        for line in lines:
            if len(first) == SHOWN and width > 1 and (row := _plain(line)) and len(row) == width:
                lines.count(width)
                numbers.extend(row)
                continue
            if width == 1 and len(first) == SHOWN:
                break  # the message is the same, however many follow
            if not width and line.lstrip().startswith("@"):
                legends += _legend(line)
                continue
            cells, is_comment = _cells(line), line.lstrip().startswith(COMMENT)
            row = _numbers(cells)
            if not cells or (is_comment and (width or row)):
                continue
            if row is None:
                bad = [cell for cell in cells if _numbers([cell]) is None]
                wrong = lines.wrong(f"{bad[0][:40]!r} is no number")
                if width:
                    raise wrong
                # the first row: as many numbers as the rows that follow, or names of columns
                unlike = wrong if not is_comment and 2 * len(bad) <= len(cells) else None
                of_names, here = (kinds(names).values() for names in (header, cells))
                if not unlike and len(cells) == len(header) and "t" in of_names and "t" not in here:
                    units = f"line {lines.number} left out as units ({listed(cells)}): no number is converted"
                    continue
                header, units = cells, ""
                continue
            if not width and unlike and len(header) == len(row):
                raise unlike
            width = width or len(row)
            if len(row) != width:
                raise lines.wrong(f"numbers in this row: {len(row)}, in the first: {width}")
            lines.count(width)
            numbers.extend(row)
            if len(first) < SHOWN:
                first.append(cells)
    if not width:
        # a row with some numbers in it was meant to be one
        raise wrong if header and len(bad) < len(header) else StoreError(f"{path}: holds no row of numbers")
    states = of_rows(path, np.frombuffer(numbers).reshape(-1, width), first, columns, legends or header, step)
    return replace(states, notes=(*states.notes, *([units] if units else [])))


def _legend(line: str) -> list[str]:
    """Name of the next column in a line of a Grace file (.xvg of GROMACS); most lines with @ name none."""
    words = line[:1000].replace("@", " ", 1).split(None, 2)
    axis = words[:2] == ["xaxis", "label"]
    curve = len(words) == 3 and words[0][:1] == "s" and words[0][1:].isdecimal() and words[1] == "legend"
    return [_bare(words[2])] if len(words) == 3 and (axis or curve) else []


def of_rows(
    path: Path, values: Floats, first: Sequence[Sequence[str]], names: list[str], header: list[str],
    step: float | None = None,
) -> States:  # fmt: skip
    """The states in the rows of a table, the first of which are also given as text."""
    width = values.shape[1]
    # an index that numbers the rows is written without a name
    if (
        not names
        and len(header) == width - 1
        and values[0, 0] in (0, 1)
        and np.all(np.diff(values[:, 0]) == 1)
    ):
        header = ["", *header]
    chosen = names or header
    counted = [i for i, name in enumerate(chosen[:width]) if counts_steps(name)]
    if counted and "t" not in kinds(chosen).values():
        i, values, chosen = counted[0], values.copy(), [*chosen]
        values[:, i], chosen[i] = times(path, values[:, i], step), "t"
    meant = kinds(chosen)
    of = {what: [i for i, name in enumerate(chosen[:width]) if meant.get(name) == what] for what in "qpv"}
    states = split(path, named(path, values, chosen), roundoff(first, [*of["q"], *of["p"], *of["v"]]))
    return replace(states, fixed=fixed(first, of["q"], of["p"] or of["v"]))


def _cells(line: str) -> list[str]:
    text = line.strip(" ").lstrip("#%!/").strip(" ")
    if ";" in text or "\t" in text:
        # there a comma stands for a decimal point
        parts = [re.sub(r"^([+-]?\d*),(\d+)(?![\d.,])", r"\1.\2", _bare(x)) for x in re.split(r"[;\t]", text)]
    else:
        # a name may contain a blank, as in "t [s]", where columns have another separator
        parts = [*map(_bare, text.split(","))] if "," in text else text.split()
    while parts and not parts[-1]:
        parts.pop()
    return parts


def _bare(cell: str) -> str:
    """A cell without surrounding blanks and quotes."""
    return cell.strip().removeprefix('"').removesuffix('"').strip()


def _plain(line: str) -> list[float] | None:
    """The numbers of a row that `float` alone can parse, as most are: some four times as fast."""
    if ";" in line or "\t" in line or "_" in line:
        return None
    try:
        return [*map(float, line.split("," if "," in line else None))]
    except ValueError:
        return None


def _numbers(cells: Iterable[str]) -> list[float] | None:
    """The numbers of a row; None where one of its cells is not a number."""
    try:
        return [number(cell) for cell in cells]
    except ValueError:
        return None


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
