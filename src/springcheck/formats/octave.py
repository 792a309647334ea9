"""Octave's default text files (`save file.txt`): a name, a type and the numbers of each variable."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.formats.columns import States, kind
from springcheck.formats.lines import Lines, number
from springcheck.formats.numbers import shortened, states_of
from springcheck.formats.tables import SHOWN, roundoff

OF_NUMBERS = re.compile(r"((u?int\d+|float|double_)? ?)(matrix|scalar|range)")


def read_octave(path: Path, names: list[str], step: float | None) -> States:
    """The states in the real numbers of an Octave text file, of its structs too."""
    with Lines(path) as lines:
        found = {name: (values, width) for name, values, width in _variables(lines)}
    arrays = shortened({name: values for name, (values, _) in found.items()})
    called = {text.rpartition("=")[2]: text.partition("=")[0] for text in names}
    states = states_of(path, arrays, names)
    moving = [
        width
        for name, (_, width) in zip(arrays, found.values(), strict=True)
        if len(arrays) == 1 or kind(called.get(name, name)) in ("q", "p", "v")
    ]
    return replace(states, roundoff=max([states.roundoff, *moving]))


def _variables(lines: Lines) -> Iterator[tuple[str, Any, float]]:
    """Each variable's name, its numbers, and their precision."""
    within: list[tuple[str, int]] = []
    for line in lines:
        what, _, name = line.partition(": ")
        if what != "# name":
            continue
        within = [one for one in within if one[1]]
        if within:
            within[-1] = within[-1][0], within[-1][1] - 1
        name = "".join(f"{struct}." for struct, _ in within) + name
        kind_ = next(lines, "").removeprefix("# type: ")
        if kind_ == "scalar struct":
            length = next((x for x in lines if x.startswith("# length")), "0")
            within.append((name, _integers(lines, length)[0]))
        elif (match := OF_NUMBERS.fullmatch(kind_)) and "<" not in name:
            cells, shape, columns_first = _cells(lines)
            try:
                numbers = [number(cell) for cell in cells]
                if match[3] == "range":
                    start, stop, step = numbers[:3]
                    shape = [round(1 + (stop - start) / step)]
                    lines.count(shape[0])
                    numbers = [start + step * i for i in range(shape[0])]
            except (ValueError, ArithmeticError):
                raise lines.wrong(f"{name}: {kind_} holds what is no number") from None
            if len(numbers) != prod(shape):
                raise lines.wrong(f"{name}: numbers: {len(numbers)}, and {prod(shape)} are said")
            if cells and len(shape) < 4:
                values = np.array(numbers, np.float32 if match[2] == "float" else np.float64)
                values = values.reshape(shape[::-1]).T if columns_first else values.reshape(shape)
                yield name, values, roundoff([[x] for x in cells[:SHOWN]], [0])
        elif "matrix" in kind_:
            # other types are reported where they are asked for
            yield name, np.array(_cells(lines)[0], object), 0.0


def _integers(lines: Lines, line: str) -> list[int]:
    cells = line.rpartition(":")[2].split()
    if not cells or not all(cell.isdecimal() and len(cell) < 10 for cell in cells):
        raise lines.wrong(f"{line[:40]!r} says no size")
    return [int(cell) for cell in cells]


def _cells(lines: Lines) -> tuple[list[str], list[int], bool]:
    """The cells of a variable, which an empty line ends, its shape, and whether columns come first."""
    shape: list[int] = []
    cells: list[str] = []
    columns_first = False
    for line in lines:
        if line.startswith("# ndims"):
            shape, columns_first = _integers(lines, next(lines, "")), True
        elif line.startswith(("# rows", "# columns")):
            shape += _integers(lines, line)
        elif line and not line.startswith("#"):
            row = line.split()
            lines.count(len(row))
            cells += row
        elif not line:
            break
    return cells, shape or [1], columns_first
