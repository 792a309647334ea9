"""The table of engines in words, and against an earlier one: from the JSON documents of censuses."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from springcheck import engines, schemes
from springcheck.errors import StoreError
from springcheck.schemes.elsewhere import ELSEWHERE
from springcheck.text.wording import number
from springcheck.thermal.catalogue import family_of, random_scheme

Row = Mapping[str, Any]

COLUMNS = {
    "method": "engine and attachment",
    "about": "what is called",
    "version": "version",
    "thermostat": "thermostat",
    "axes": "axes",
    "constraint": "constraint",
    "scheme": "scheme, from the states",
    "claimed": "declared or documented as",
    "velocity": "stored velocity",
    "substeps": "steps inside",
    "friction": "unasked friction c/m",
    "det": "det - 1",
    "precision": "arithmetic",
    "limit": "first limit, h omega",
    "amplitude": "amplitude of the blog's spring (exact: 1)",
    "configurational": "configurational temperature, k<x2>/kT",
    "kinetic": "kinetic temperature, m<v2>/kT",
    "forces": "forces a step",
    "note": "note",
    "command": "command that makes the row",
}

WATCHED = (
    "thermostat", "axes", "constraint", "scheme", "velocity", "substeps", "friction", "det", "precision",
    "limit", "amplitude",
)  # fmt: skip
"""Columns of which a change is said; versions are named beside it."""


def rows(*documents: Mapping[str, Any]) -> list[dict[str, str]]:
    """One row for each entry of these documents, as text; of a method that is in several the first one's."""
    engines.names()  # whose schemes have their titles from then on
    found: dict[str, dict[str, str]] = {}
    for document in documents:
        for x in document["entries"]:
            found.setdefault(x["method"], _row(x))
    return list(found.values())


def _row(x: Row) -> dict[str, str]:
    named = x["found"] != "none that is known"
    limit = "none up to 4" if x["bounded"] else number(x["limit"], ".4f")
    offset = x["velocity_offset"]
    return {
        "method": x["method"],
        "about": x.get("about", ""),
        "version": x["version"],
        "thermostat": x.get("thermostat") or "none",
        "axes": x.get("along") or "x",
        "constraint": x.get("constraint") or "none",
        "scheme": _titles(x["found"]) if named else x["found"],
        "claimed": _titles(x["claimed"]),
        "velocity": "-" if offset is None else "synchronised" if offset == 0 else f"{offset:+g} of a step",
        "substeps": str(x["substeps"] or "-"),
        "friction": _number(x["friction"], 1e-9),
        "det": _number(x["area"], 1e-6 if x["precision"] == "single" else 1e-12),
        "precision": x["precision"],
        "limit": limit,
        "amplitude": number(x["amplitude"], ".4f"),
        "configurational": _share(x, "configurational"),
        "kinetic": _share(x, "kinetic"),
        "forces": f"{x['force_calls']:.3g}",
        "note": "; ".join(filter(None, (x.get("note", ""), "" if x["agrees"] else "DECLARED OTHERWISE"))),
        "command": x.get("command", f"springcheck census --method {x['method']}"),
    }


def _titles(names: str) -> str:
    return " or ".join(map(_title, names.split(" or ")))


def _title(name: str) -> str:
    """The title of a scheme, whether an engine here runs it or not."""
    if family_of(name)[1]:
        return random_scheme(name).title
    return getattr(ELSEWHERE.get(name), "title", schemes.title(name))


def _number(x: float | None, least: float) -> str:
    return "-" if x is None else "0" if abs(x) < least else f"{x:+.3g}"


def _share(x: Row, name: str) -> str:
    """A temperature of the bath's and its standard error."""
    value, error = x.get(name), x.get(f"{name}_error")
    return "-" if value is None else f"{value:.4f}" if error is None else f"{value:.4f} +- {error:.1g}"


def changes(old: Sequence[Mapping[str, str]], new: Sequence[Mapping[str, str]]) -> list[str]:
    """What is not as it was, one line each; methods that only one of the two has are said as such."""
    before, after = ({row["method"]: row for row in found} for found in (old, new))
    out = [f"{name} is no longer here ({before[name]['version']})" for name in before if name not in after]
    for name, row in after.items():
        was = before.get(name)
        if was is None:
            out.append(f"{name} is new: {row['scheme']} ({row['version']})")
            continue
        versions = (
            row["version"] if row["version"] == was["version"] else f"{was['version']} -> {row['version']}"
        )
        out += [
            f"{name}, {COLUMNS[column]}: {was[column]} -> {row[column]} ({versions})"
            for column in WATCHED
            if was[column] != row[column]
        ]
    return out


def versions(old: Sequence[Mapping[str, str]], new: Sequence[Mapping[str, str]]) -> str:
    """What each engine's version was and is, where methods of both have another."""
    was = {row["method"]: row["version"] for row in old}
    pairs = [(was.get(row["method"], row["version"]), row["version"]) for row in new]
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
