"""Comparison of a census with an earlier one, in words, from their JSON documents."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from springcheck import engines, schemes
from springcheck.errors import StoreError
from springcheck.schemes.elsewhere import ELSEWHERE
from springcheck.studies.census.rigid import NO_SCHEME
from springcheck.text.wording import number

Cells: TypeAlias = Mapping[str, Mapping[str, str]]
"""Version, and the text of each column, by method."""


def titles(names: str) -> str:
    """Titles of schemes, also of those that no engine here runs; several are joined by "or"."""
    return names if names == NO_SCHEME else " or ".join(map(_title, names.split(" or ")))


def _title(name: str) -> str:
    return getattr(ELSEWHERE.get(name), "title", schemes.title(name))


def _velocity(offset: float | None) -> str:
    return "-" if offset is None else "synchronised" if offset == 0 else f"{offset:+g} of a step"


def amount(x: float | None, least: float, form: str = "+.3g") -> str:
    """A signed number, or 0 below the least that counts."""
    return "0" if x is not None and abs(x) < least else number(x, form)


WATCHED: Mapping[str, tuple[str, Callable[[Mapping[str, Any]], str]]] = {
    "thermostat": ("thermostat", lambda x: x.get("thermostat") or "none"),
    "axes": ("axes", lambda x: x.get("along") or "x"),
    "constraint": ("constraint", lambda x: x.get("constraint") or "none"),
    "scheme": ("scheme, from the states", lambda x: titles(x["found"])),
    "velocity": ("stored velocity", lambda x: _velocity(x["velocity_offset"])),
    "substeps": ("steps inside", lambda x: str(x["substeps"] or "-")),
    "friction": ("unasked friction c/m", lambda x: amount(x["friction"], 1e-9)),
    "det": ("det - 1", lambda x: amount(x["area"], 1e-6 if x["precision"] == "single" else 1e-12)),
    "precision": ("arithmetic", lambda x: str(x["precision"])),
    "limit": (
        "first limit, h omega",
        lambda x: "none up to 4" if x["bounded"] else number(x["limit"], ".4f"),
    ),
    "amplitude": ("amplitude of the blog's spring (exact: 1)", lambda x: number(x["amplitude"], ".4f")),
}
"""Columns whose changes are reported: their titles, and their texts of an entry of the document.  Versions
are named beside them."""


def rows(document: Mapping[str, Any]) -> Cells:
    """The columns of every entry of a document."""
    engines.names()  # whose schemes have their titles from then on
    return {
        x["method"]: {"version": x["version"], **{name: of(x) for name, (_, of) in WATCHED.items()}}
        for x in document["entries"]
    }


def changes(before: Cells, after: Cells) -> Iterator[str]:
    """Differences, one line each; methods that only one of the two has are listed as such."""
    for name in (x for x in before if x not in after):
        yield f"{name} is no longer here ({before[name]['version']})"
    for name, row in after.items():
        was = before.get(name)
        if was is None:
            yield f"{name} is new: {row['scheme']} ({row['version']})"
            continue
        both = dict.fromkeys((was["version"], row["version"]))
        for column, (title, _) in WATCHED.items():
            if was[column] != row[column]:
                yield f"{name}, {title}: {was[column]} -> {row[column]} ({' -> '.join(both)})"


def versions(before: Cells, after: Cells) -> str:
    """Old and new versions of engines, where they differ."""
    pairs = [(before.get(name, row)["version"], row["version"]) for name, row in after.items()]
    return "; ".join(dict.fromkeys(f"{one} -> {other}" for one, other in pairs if one != other))


def load(path: str | Path) -> dict[str, Any]:
    """The document of a census, as `--json` prints it.  StoreError where it is none."""
    try:
        found = json.loads(Path(path).read_text(encoding="utf-8"))
        rows(found)
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise StoreError(f"{path}: is no JSON document of springcheck census --json") from error
    return dict(found)
