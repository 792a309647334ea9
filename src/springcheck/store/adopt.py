"""The part of a long trajectory becomes the collection in place: it is renamed and added to, without a copy.

This is the one place where a file that holds reported numbers is opened for writing, so everything in it but
the recorded arrays, which libhdf5 leaves where they are, is first written into an undo file.  If the process
is killed in between, the next writer restores the part byte for byte.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.store import files, seal

LARGE = 1 << 28
"""Parts from this size on [B] are adopted; copying smaller ones takes no longer than a second."""


def choice(parts: Sequence[Path]) -> Path | None:
    """The part worth adopting: the largest, if it has at least `LARGE` bytes; else None."""
    largest = max(parts, key=lambda part: part.stat().st_size, default=None)
    return largest if largest is not None and largest.stat().st_size >= LARGE else None


def adopt(part: Path, temporary: Path) -> tuple[seal.Extent, ...]:
    """Rename a part to `temporary`, its undo file written -> the arrays that it holds."""
    known = seal.find(part)
    if known is None or not seal.is_whole(part, known):
        raise StoreError(f"{part} is damaged: remove it, then give the same command again")
    with part.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        pieces = list(seal.gaps(known.extents, size))
        content = [b"".join(seal.blocks(file, start, length)) for start, length in pieces]
    head = json.dumps({"name": part.name, "run": known.run, "size": size, "pieces": pieces}).encode()
    files.put_bytes(b"\n".join([head, b"".join(content)]), _undo(part.parent))
    part.replace(temporary)
    files.sync_folder(part.parent)
    return known.extents


def settled(folder: Path) -> None:
    """Remove the undo file, once the collection is in its place."""
    _undo(folder).unlink(missing_ok=True)


def recover(folder: Path, temporary: Path, run: str) -> None:
    """Restore a part of this run that was adopted and never became the collection."""
    undo = _undo(folder)
    try:
        with files.own(undo) as kept:
            head, body = kept.read().split(b"\n", 1)
        known = json.loads(head)
        if known["run"] != run or Path(known["name"]).name != known["name"]:
            raise ValueError("of another run")
    except FileNotFoundError:
        return
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{undo} stands where the journal of a store goes; move it away") from error
    if temporary.is_file():
        with files.own(temporary, create=True) as file:
            start = 0
            for offset, length in known["pieces"]:
                file.seek(offset)
                file.write(body[start : start + length])
                start += length
            file.truncate(known["size"])
        files.put(temporary, folder / known["name"])
    settled(folder)


def _undo(folder: Path) -> Path:
    return folder / "undo"
