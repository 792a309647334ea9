"""Whether libhdf5 may be let loose on a file: it can crash, or never end, on a damaged one.

A file that carries our seal is checked against it, in milliseconds.  Any other is first read by a process
of its own, whose end tells; what survives that is read again here.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.store import files, seal

OURS, FOREIGN = "springcheck.store.checking", "springcheck.store.foreign"
"""Modules that read a file in full when they are run on it."""


def trust(path: Path, module: str) -> None:
    """Return when this process can read a file without harm; raise StoreError otherwise.

    `module` tries a file that carries no seal.
    """
    with files.told(path, "read"):
        state = path.stat()
        with path.open("rb"):
            pass
        _trusted(path.absolute(), module, (state.st_dev, state.st_ino, state.st_mtime_ns, state.st_size))


@lru_cache(maxsize=4096)
def _trusted(path: Path, module: str, state: tuple[int, ...]) -> None:
    """Once for each state of a file; failures are not remembered."""
    found = seal.find(path)
    if found is None:
        said = guarded(module, path)
        if module == FOREIGN and said:
            raise StoreError(said)
    elif not seal.is_whole(path, found):
        raise StoreError(
            f"cannot read {path}: it is damaged, it has changed since it was written "
            f"(springcheck check {path} names the places)"
        )


def guarded(module: str, path: Path) -> str:
    """Run a module of ours on a file in a process of its own -> what it printed.

    Raises StoreError when it crashes, or takes longer than 30 s and what 5 MB/s would take.
    """
    root = str(Path(__file__).parents[2])
    paths = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", module, str(path)],
            capture_output=True,
            text=True,
            timeout=30 + path.stat().st_size / 5e6,
            check=False,
            stdin=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": paths},
        )
    except subprocess.TimeoutExpired:
        raise StoreError(f"cannot read {path}: it is damaged, reading it does not end") from None
    if done.returncode:
        raise StoreError(f"cannot read {path}: it is damaged, reading it crashes the HDF5 library")
    return done.stdout.strip()
