"""Scene files: TOML in, `Scene` out; errors name the file, the field and the remedy."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec

from springcheck.errors import SceneError, nearest
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import building, tables

LONGEST_TEXT = 1 << 25
"""Most characters of a scene: parsing so many takes ten seconds and a gigabyte of memory."""


def folder() -> Path:
    """Folder of the shipped scenes: in the installed package, or in a checkout's data folder."""
    packaged = Path(__file__).parents[2] / "data" / "scenes"
    return packaged if packaged.is_dir() else Path(__file__).parents[4] / "data" / "scenes"


def names() -> tuple[str, ...]:
    """Names of the shipped scenes."""
    return tuple(sorted(path.stem for path in folder().glob("*.toml")))


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a shipped scene by name, or any scene file by path.

    Raises:
        SceneError: no such scene, or an error in the file; it names the field, its value and the accepted
            ones.
    """
    path, text = _read(name_or_path)
    return parse(text, name=path.stem, where=str(path))


def text_of(name_or_path: str | Path) -> str:
    """The text of a scene file.  SceneError where there is none."""
    return _read(name_or_path)[1]


def _read(name_or_path: str | Path) -> tuple[Path, str]:
    if not isinstance(name_or_path, str | PathLike):
        raise SceneError(f"the name or path of a scene is needed, not {type(name_or_path).__name__}")
    path = Path(name_or_path)
    if path.suffix != ".toml" and path.parent == Path() and not path.is_file():
        path = folder() / f"{name_or_path}.toml"
        if not path.is_file():
            raise SceneError(
                f"no scene {str(name_or_path)!r}{nearest(str(name_or_path), names())}; "
                f"shipped are {', '.join(names())}; the name of a file of your own ends in .toml"
            )
    try:
        with path.open(encoding="utf-8-sig") as file:  # some editors put a mark in front
            text = file.read(LONGEST_TEXT + 1)
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text, as a scene in TOML is"
        raise SceneError(f"{path}: cannot be read: {reason}") from error
    return path, text


def parse(text: str, *, name: str, where: str | None = None) -> Scene:
    """The scene that a TOML text describes; `where` is named in messages.  Raises SceneError."""
    where = where or name
    if len(text) > LONGEST_TEXT:
        raise SceneError(
            f"{where}: more than {LONGEST_TEXT / 1e6:.0f} MB of text: join alike particles to a [chain]"
        )
    try:
        data = tomllib.loads(text)
    except RecursionError as error:
        raise SceneError(f"{where}: not valid as a scene: it is nested too deep") from error
    except ValueError as error:
        # an integer of thousands of digits raises another ValueError than tomllib's
        raise SceneError(f"{where}: not valid TOML: {str(error).partition(';')[0]}") from error
    return from_tables(data, name=name, where=where)


def from_tables(data: Any, *, name: str, where: str) -> Scene:
    """The scene that the tables of a scene file describe.  Raises SceneError."""
    for field, value in _numbers(data):
        if not math.isfinite(value):
            raise SceneError(f"{where}: {field} = {value}; a finite number is needed")
    try:
        table = msgspec.convert(data, tables.scene_table(), strict=True)
    except msgspec.ValidationError as error:
        raise SceneError(f"{where}: {_explain(str(error), data)}") from error
    try:
        return building.scene(table, name=name)
    except building.MistakeError as error:
        raise SceneError(f"{where}: {error}") from error


def _numbers(data: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """All numbers in nested tables, each with its field's path."""
    if isinstance(data, bool):
        return
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _numbers(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from _numbers(value, f"{path}[{i}]")
    elif isinstance(data, int | float):
        try:
            yield path, float(data)
        except OverflowError:
            yield path, math.inf


def _explain(message: str, data: Any) -> str:
    """msgspec's message with the field first, the value found, and the accepted fields."""
    what, _, path = message.partition(" - at `$")
    field = path.rstrip("`").lstrip(".")
    found = data
    for part in re.findall(r"[^.\[\]]+", field):
        try:
            found = found[int(part)] if part.isdigit() else found[part]
        except (KeyError, IndexError, TypeError):
            found = None
    what = (what[0].lower() + what[1:]).replace("missing required field", "lacks the field")
    what = what.replace("contains unknown field", "has the unknown field")
    names = re.sub(r"\[\d+\]$", "[]", field), field.rpartition(".")[2]
    accepted = next((one for name in names if (one := tables.CHOICES.get(name))), None)
    if accepted:
        return f"{field} = {found!r}: one of {', '.join(accepted)} is needed"
    if "unknown field" in what or "lacks the field" in what:
        table = tables.named(re.sub(r"\[.*", "", field))
        known = f"; its fields are {', '.join(table.__struct_encode_fields__)}" if table else ""
        return f"{field or 'the scene'}: {what.replace('object', 'it')}{known}"
    return f"{field} = {found!r}: {what}"
