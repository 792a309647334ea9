"""Folders of figures, one for each store: the figures of that store are replaced in it, and nothing else."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from springcheck.errors import StoreError
from springcheck.store import files

FIGURES = "springcheck-figures.json"
"""In a folder of figures: the store that they show, and the sha256 by which its own files are known."""


def folder_of(path: Path) -> Path:
    """Where the figures of a store go unless told."""
    return Path("figures", path.stem)


def put(drawn: list[Path], folder: Path, path: Path) -> list[Path]:
    """Put figures into their folder; StoreError where that would replace a file that is not this store's."""
    mine = str(path.absolute())
    known = _known(folder)
    if known["store"] not in {"", mine}:
        raise StoreError(f"{folder} holds the figures of {known['store']}: name another folder with -o")
    content = {one.name: one.read_bytes() for one in drawn}
    figures: dict[str, list[str]] = known["figures"]
    for name, figure in content.items():
        target = folder / name
        old = figures.get(name, [])
        if target.is_symlink() or (target.exists() and _sha256(target.read_bytes()) not in old):
            raise StoreError(f"{target} is no figure of {path} as it was drawn: move it away")
        # the last one too: whoever is killed in between may find it in its place
        figures[name] = [*old[-1:], _sha256(figure)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        files.put_bytes(json.dumps({"store": mine, "figures": figures}, indent=1).encode(), folder / FIGURES)
        for name, figure in content.items():
            files.put_bytes(figure, folder / name)
    except OSError as error:
        raise StoreError(f"{folder}: figures cannot be written: {error.strerror or error}") from error
    return [folder / name for name in content]


def _known(folder: Path) -> dict[str, Any]:
    """The store whose figures lie in a folder, and their digests."""
    try:
        with files.own(folder / FIGURES) as file:
            found = json.loads(file.read())
        figures = {name: list(map(str, old)) for name, old in found["figures"].items()}
        return {"store": str(found["store"]), "figures": figures}
    except FileNotFoundError:
        return {"store": "", "figures": {}}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StoreError(f"{folder / FIGURES} cannot be read: move it away") from error


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
