"""What scene files could say once, and springcheck no longer has: a row for each table or field."""

from __future__ import annotations

from typing import Any

LEFT = {
    "box": "periodic boxes are not part of springcheck",
    "magnetic": "magnetic fields are not part of springcheck",
    "modulated-spring": "springs of modulated stiffness are not part of springcheck",
    "rod": "constraints are not part of springcheck",
    "rotor": "rotors and hinges are not part of springcheck",
    "time.every": "it is record.every",
    "cosine.length": "give wave = 1/length",
}
"""Why a table, or a field as ``table.field``, is refused."""


def refusal(data: Any) -> str:
    """Why the tables of a scene file are refused, with the first table or field that left; "" otherwise."""
    for path, why in LEFT.items():
        if _has(data, path.split(".")):
            return f"{path}: {why}"
    return ""


def _has(data: Any, path: list[str]) -> bool:
    """Whether nested tables, or any of several, have something at a path."""
    if not path:
        return True
    if isinstance(data, list):
        return any(_has(one, path) for one in data)
    return isinstance(data, dict) and path[0] in data and _has(data[path[0]], path[1:])
