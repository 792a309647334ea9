"""The files of a store: a collection, and beside it the parts of a journal that are not yet in it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal
from urllib.parse import unquote

import msgspec

from springcheck.errors import StoreError
from springcheck.store import access, files, layout, seal, trust

ROWS = "rows-"
"""Prefix of parts that hold rows of a table; others begin with run- or table-."""


def name_of(part: Path) -> str:
    """The label, table, or piece of a table that a part holds."""
    return unquote(part.stem.partition("-")[2])


def table_of(part: Path) -> str:
    """The table of the collection that a part goes into: pieces of one are named <table>/<piece>."""
    return name_of(part).rpartition("/")[0] if part.name.startswith(ROWS) else name_of(part)


def parts_in(folder: Path) -> list[Path]:
    """The parts in a journal; a pipe or a link in that place is not ours."""
    return sorted(filter(files.is_plain, folder.glob("*-*.h5")))


def parts_folder(path: Path) -> Path:
    """The journal of a store."""
    return path.parent / (path.name + files.JOURNAL)


class JournalClaim(msgspec.Struct, frozen=True, kw_only=True):
    """Claim on a journal: run id and command, whether --force began it, and whether a method failed."""

    format: Literal["springcheck journal 1"] = "springcheck journal 1"
    run: str
    command: str
    forced: bool
    failed: bool = False

    def write(self, parts: Path) -> None:
        """Put it into the journal."""
        files.put_bytes(msgspec.json.encode(self), parts / "command")


def claim(parts: Path) -> JournalClaim | None:
    """The claim of a journal; None where there is none.  StoreError where it cannot be read as ours."""
    try:
        with files.own(parts / "command") as file:
            return msgspec.json.decode(file.read(1 << 26), type=JournalClaim)
    except FileNotFoundError:
        return None
    except (ValueError, OSError, RecursionError) as error:
        raise StoreError(
            f"cannot read {parts / 'command'}, which stands where the journal goes; move it away"
        ) from error


def claimed_by(path: Path) -> str | None:
    """The run whose journal stands beside a store; None where there is none that can be read."""
    with contextlib.suppress(StoreError):
        return getattr(claim(parts_folder(path)), "run", None)
    return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The files that make up a store: the collection, or the parts of a run that are not yet in one."""

    runs: list[Path]
    """Parts of one trajectory each, or the collection alone."""
    tables: list[Path] = field(default_factory=list)
    """Parts of a table, or of rows of one."""
    complete: bool = False
    """Whether there is a collection."""

    @property
    def everything(self) -> list[Path]:
        """All of these files."""
        return [*self.runs, *self.tables]

    @classmethod
    def of(cls, path: Path, run: str | None) -> Parts:
        """`run` is the writer's, whose parts they are; None for a reader, who takes the collection if there
        is one."""
        if run is None and path.is_file():
            return cls(runs=[path], complete=True)
        known = claimed_by(path) if run is None else run
        there = parts_in(parts_folder(path)) if known is not None else []
        parts = [part for part in there if (found := seal.find(part)) is None or found.run == known]
        runs = [part for part in parts if part.name.startswith("run-")]
        return cls(runs=runs, tables=[part for part in parts if part not in runs])


@contextlib.contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A file of ours, open for reading, its structure checked against its seal before libhdf5 sees it."""
    trust.trust(path, trust.OURS)
    with access.for_reading(path) as file:
        marked = access.attribute(file, "format")
        if marked == layout.OLDER:
            raise StoreError(f"{path} was written by an older springcheck: run its scene again")
        if marked != layout.FORMAT:
            raise StoreError(f"cannot read {path}: it is HDF5, but no store of springcheck")
        yield file
