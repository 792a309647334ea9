"""The sections of the studies: the report as text, its tables as tables, and the study's charts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from springcheck.cli import inspect
from springcheck.figures import charts
from springcheck.store import Summary
from springcheck.text.lines import Lines, TextTable


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """What the page says of one study."""

    name: str
    title: str
    blocks: Lines
    """Lines of text, and tables."""
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
        lines = study.lines(result, path=summary.path)
        found.append(
            Section(
                name=study.name,
                title=study.about[:1].upper() + study.about[1:],
                blocks=[line for line in lines if isinstance(line, TextTable) or str(line).strip()],
                banks=tuple(mine),
            )
        )
    return found, data
