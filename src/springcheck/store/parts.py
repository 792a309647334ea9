"""The files of a store: a collection, and next to it the parts of a journal that are not yet in it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from urllib.parse import unquote

import msgspec

from springcheck.errors import StoreError
from springcheck.store import access, apart, collection, files

TRIAL = "springcheck.store.checking"
"""The module whose `tried` reads a store in a child process."""


class Claim(msgspec.Struct, frozen=True, kw_only=True):
    """Claim on a journal: run id and command, and whether --force began it."""

    format: Literal["springcheck journal 2"] = "springcheck journal 2"
    run: str
    command: str
    forced: bool


def folder_of(path: Path) -> Path:
    """The journal of a store."""
    return path.parent / (path.name + files.JOURNAL)


def claim(folder: Path) -> Claim | None:
    """The claim of a journal; None where there is none.  StoreError where it cannot be read as ours."""
    where = folder / "command"
    try:
        if where.is_symlink() or (where.exists() and not files.is_plain(where)):
            raise ValueError("a link")
        with where.open("rb") as file:
            return msgspec.json.decode(file.read(1 << 26), type=Claim)
    except FileNotFoundError:
        return None
    except (ValueError, OSError, RecursionError) as error:
        raise StoreError(
            f"cannot read {where}, which stands where the journal goes, or an older springcheck has left it; "
            "move it away"
        ) from error


def claimed_by(path: Path) -> str | None:
    """The run whose journal stands next to a store; None where there is none that can be read."""
    with contextlib.suppress(StoreError):
        return getattr(claim(folder_of(path)), "run", None)
    return None


def name_of(part: Path) -> str:
    """The label or table that a part holds."""
    return unquote(part.stem.partition("-")[2])


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The files that make up a store: the collection, or the parts of a run that are not yet in one."""

    runs: list[Path]
    """Parts of one trajectory each, or the collection alone."""
    tables: list[Path]
    complete: bool = False
    """Whether there is a collection."""

    @property
    def everything(self) -> list[Path]:
        """All of these files."""
        return [*self.runs, *self.tables]

    @classmethod
    def of(cls, path: Path, *, writing: bool = False) -> Parts:
        """The parts for their writer; for a reader the collection if there is one."""
        if not writing and path.is_file():
            return cls(runs=[path], tables=[], complete=True)
        found = [[], []] if claimed_by(path) is None else parts_in(folder_of(path))
        return cls(runs=found[0], tables=found[1])


def parts_in(folder: Path) -> list[list[Path]]:
    """The trajectories and the tables of a journal; a pipe or a link in their place is not ours."""
    return [sorted(filter(files.is_plain, folder.glob(f"{kind}-*.h5"))) for kind in ("run", "table")]


@contextlib.contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A file of ours, open for reading, after its trial (see `apart`)."""
    apart.trust(path, TRIAL)
    with access.for_reading(path) as file:
        collection.is_ours(file)
        yield file
