"""The sections of the studies: the report as text, its tables as tables, and the study's charts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from springcheck.cli import inspect
from springcheck.store import Summary
from springcheck.studies import charts
from springcheck.text.lines import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A text of one look: a line, a cell of a table."""

    text: str
    bad: bool = False
    strong: bool = False
    number: bool = False
    """Of a column that ends at its right edge."""
    prose: bool = False
    """Of a column that is broken into lines."""
    heading: bool = False
    """Over the rows of a table that follow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """A table; a row of one piece is a heading over all columns."""

    titles: tuple[Piece, ...]
    rows: tuple[tuple[Piece, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What the page says of one study."""

    name: str
    title: str
    blocks: tuple[Piece | Sheet, ...]
    banks: tuple[str, ...]
    """Names of its charts in the data of the page."""


def sections(summary: Summary) -> tuple[list[Section], dict[str, Any]]:
    """The studies of a store that are no trajectories, and the data of all their charts by name."""
    found: list[Section] = []
    data: dict[str, Any] = {}
    for study, result in inspect.held(summary):
        if study.trajectories:
            continue
        mine = {f"{study.name}-{i}": charts.plain(bank) for i, bank in enumerate(study.banks(result))}
        data |= mine
        found.append(
            Section(
                name=study.name,
                title=study.about[:1].upper() + study.about[1:],
                blocks=tuple(_blocks(study.lines(result, path=summary.path))),
                banks=tuple(mine),
            )
        )
    return found, data


def _blocks(lines: Iterable[Any]) -> Iterator[Piece | Sheet]:
    for line in lines:
        if isinstance(line, Table):
            yield _sheet(line)
        elif str(line).strip():
            yield _piece(line)


def _sheet(table: Table) -> Sheet:
    looks = [
        {"number": title not in table.left and title != table.prose, "prose": title == table.prose}
        for title in table.titles
    ]
    rows = [
        (_piece(row),)
        if hasattr(row, "plain")
        else tuple(
            _piece(cell, **look)
            for cell, look in zip((*row, *[""] * (len(looks) - len(row))), looks, strict=True)
        )
        for row in table.rows
    ]
    titles = (Piece(text=title, **look) for title, look in zip(table.titles, looks, strict=True))
    return Sheet(titles=tuple(titles), rows=tuple(rows))


def _piece(text: Any, *, number: bool = False, prose: bool = False) -> Piece:
    style = str(getattr(text, "style", ""))
    return Piece(
        text=str(text).strip(),
        bad="red" in style,
        strong="bold" in style,
        heading="italic" in style,
        number=number,
        prose=prose,
    )
