"""Scene files: TOML in, `Scene` out; errors name the file, the field and the remedy."""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec

from springcheck.errors import SceneError, nearest, plain
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import building, left, tables

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
    """Read a shipped scene by its name, or a scene file by its path.

    >>> load_scene("spring")
    Scene('spring', 1 particle, 1 wall-spring, 200 steps of 0.1)

    Raises
    ------
    SceneError
        No such scene, or an error in the file: its field, its value, and what is accepted.
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
        raise SceneError(f"{where}: not a scene: it is nested too deep") from error
    except ValueError as error:
        # an integer of thousands of digits raises another ValueError than tomllib's
        raise SceneError(
            f"{where}: not valid TOML: {_unreadable(str(error).partition(';')[0], text)}"
        ) from error
    return from_tables(data, name=name, where=where)


def from_tables(data: Any, *, name: str, where: str) -> Scene:
    """The scene that the tables of a scene file describe.  Raises SceneError."""
    for field in _not_finite(data):
        raise SceneError(f"{where}: {field}; a finite number is needed")
    if reason := left.refusal(data):
        raise SceneError(f"{where}: {reason}")
    try:
        table = msgspec.convert(data, tables.scene_table(), strict=True)
    except msgspec.ValidationError as error:
        raise SceneError(f"{where}: {_explain(str(error), data)}") from error
    try:
        return building.scene(table, name=name)
    except building.MistakeError as error:
        raise SceneError(f"{where}: {error}") from error


def _unreadable(message: str, text: str) -> str:
    """tomllib's message with the line that it names."""
    what = re.sub(r"\('(.*?)',?\)", lambda x: "[" + x[1].replace("', '", ".") + "]", message)
    at = re.search(r"at line (\d+)", message)
    line = ": " + plain(text.split("\n")[int(at[1]) - 1].strip(), 60) if at else ""
    if what.startswith(("Expected newline", "Invalid value")):
        line += "; numbers are written as 0.25 or 1e-3, without arithmetic, and text in quotes"
    return what + line


def _not_finite(data: Any, path: str = "") -> Iterator[str]:
    """Field and value of each number in nested tables that no double holds."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _not_finite(value, f"{path}.{key}".lstrip("."))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from _not_finite(value, f"{path}[{i}]")
    elif isinstance(data, int | float) and not abs(data) <= sys.float_info.max:
        yield f"{path} = {data if isinstance(data, float) else 'inf'}"


_WORDS = {
    "float": "a number", "int": "a whole number", "str": "text in quotes", "bool": "true or false",
    "array": "a list in brackets", "object": "a table",
}  # fmt: skip
"""The types of msgspec's messages, as a scene file has them."""


def _explain(message: str, data: Any) -> str:
    """msgspec's message in the words of TOML: the field first, the value found, and what is accepted."""
    what, _, path = message.partition(" - at `$")
    field = path.rstrip("`").lstrip(".")
    found = data
    for part in re.findall(r"[^.\[\]]+", field):
        try:
            found = found[int(part)] if part.isdigit() else found[part]
        except (KeyError, IndexError, TypeError):
            found = None
    table = tables.named(re.sub(r"\[.*", "", field))
    if strange := re.match(r"Object (missing required|contains unknown) field `(.*)`", what):
        name, known = strange[2], table.__struct_encode_fields__ if table else ()
        named = f"table [{name}]" if tables.named(name) and not field else f"field `{name}`"
        said = f"lacks the {named}" if "missing" in what else f"has the unknown {named}{nearest(name, known)}"
        return f"{field or 'the scene'}: it {said}" + f"; its fields are {', '.join(known)}" * bool(known)
    wanted = re.sub(r", got .*|^Expected ", "", what).replace(" | null", "")
    if wanted.startswith("`array`") and ((table and "[" not in field) or isinstance(found, dict)):
        return f"{field}: write [[{field}]], in double brackets, for each one"
    if isinstance(found, list) and wanted == "`object`" and "[" not in field:
        return f"{field}: there is one of it: write [{field}], in single brackets, once"
    shown = str(found).lower() if isinstance(found, bool) else repr(found)
    last = re.sub(r"\[\d+\]$", "[]", field)
    accepted = tables.CHOICES.get(last) or tables.CHOICES.get(last.rpartition(".")[2])
    if accepted and wanted != "`int`":
        return f"{field} = {shown}: one of {', '.join(accepted)} is needed"
    if "regex" in wanted:
        return f"{field} = {shown}: letters of x, y and z are needed, as 'xy'"
    each = re.sub(r"`(.*?)`", lambda x: " or ".join(_WORDS.get(y, y) for y in x[1].split(" | ")), wanted)
    quoted = isinstance(found, str) and re.fullmatch(r"[-+.\deE]+", found) and "number" in each
    return f"{field} = {shown}: {each} is needed" + ", without quotes" * bool(quoted)
