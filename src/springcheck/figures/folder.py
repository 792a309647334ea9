"""Folders of figures, one for each store: the figures of that store are replaced in it, and nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.store import files

FIGURES = "springcheck-figures.json"
"""Index of a folder of figures: the store that each file shows, and the file's sha256."""


def check(names: Iterable[str], folder: Path, path: Path) -> None:
    """StoreError where figures of a store by these names would replace any other file of a folder."""
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"{folder} is a file: figures need a folder, name another one with -o")
    mine = str(path.absolute())
    known = _known(folder)
    for name in names:
        target = folder / name
        whose, *old = known.get(name, [mine])
        if target.is_symlink() or (target.exists() and _sha256(target.read_bytes()) not in old):
            raise StoreError(f"{target} is no figure of ours as it was drawn: move it away")
        if target.exists() and whose != mine:
            raise StoreError(f"{target} shows {whose}: name another folder with -o")


def put(drawn: Mapping[str, bytes], folder: Path, path: Path) -> list[Path]:
    """Put figures of a store, by the names of their files, into a folder -> their paths.

    StoreError where that would replace any other file, or the folder cannot be written.
    """
    check(drawn, folder, path)
    mine, known = str(path.absolute()), _known(folder)
    for name, figure in drawn.items():
        _, *old = known.get(name, [mine])
        # the last one too: whoever is killed in between may find it in its place
        known[name] = [mine, *old[-1:], _sha256(figure)]
    files.need_space(folder / FIGURES, sum(map(len, drawn.values())))
    _, *written = write({FIGURES: json.dumps(known, indent=1).encode(), **drawn}, folder)
    return written


def write(content: Mapping[str, bytes], folder: Path) -> list[Path]:
    """Write files by their names into a folder, each whole or not at all -> their paths."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in content.items():
            files.put_bytes(data, folder / name)
    except OSError as error:
        why = files.cause(error, writing=True)
        raise StoreError(f"{folder}: figures cannot be written: {why}") from error
    return [folder / name for name in content]


def _known(folder: Path) -> dict[str, list[str]]:
    """The store, then the digests, of each figure in a folder."""
    index = folder / FIGURES
    try:
        if index.exists() and not files.is_plain(index):
            raise ValueError("a link, or no file")
        found = json.loads(index.read_bytes())
        return {str(name): [str(one) for one in known] for name, known in found.items() if known}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise StoreError(f"{folder / FIGURES} cannot be read: move it away") from error


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
