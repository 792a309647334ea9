"""Whether libhdf5 may be let loose on a file: it can crash, or never end, on a damaged one.

A file that carries our seal is checked against it, in milliseconds.  Any other is first read by a process
of its own, with little memory and time, whose end tells; what survives that is read again here.
"""

from __future__ import annotations

import os
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import h5py

from springcheck.errors import StoreError
from springcheck.interrupts import called
from springcheck.store import files, seal

OURS, FOREIGN = "ours", "foreign"
"""What a file is read as when it is tried."""

MODULE = "springcheck.store"
LIMIT, SPEED = 8.0, 1e8
"""Seconds that reading a file may take, whatever its size, and bytes a second on top."""
MEMORY = 1 << 30
"""Bytes of memory that it may take."""


def trust(path: Path, kind: str) -> None:
    """Return when this process can read a file without harm; raise StoreError otherwise.

    `kind` says how a file that carries no seal is tried.
    """
    with files.told(path, "read"):
        with path.open("rb"):
            pass
        said = _against(path.absolute(), kind, _state(path))
    if said:
        raise StoreError(f"cannot read {path}: {said}")


@lru_cache(maxsize=4096)
def _against(path: Path, kind: str, state: tuple[int, ...]) -> str:
    """What speaks against a file, once for each state of it; nothing where it can be read."""
    found = seal.find(path)
    if not h5py.is_hdf5(path):
        return "it is no HDF5 file"
    if found is None:
        said, harmless = _tried(path, kind, state)
        return "" if harmless else said
    if not seal.is_whole(path, found):
        return "it is damaged, it has changed since it was written; springcheck check names the places"
    return ""


def _state(path: Path) -> tuple[int, ...]:
    state = path.stat()
    return state.st_dev, state.st_ino, state.st_mtime_ns, state.st_size


def guarded(path: Path, kind: str) -> str:
    """Read a file in a process of its own -> what that says (see `__main__`).

    Raises StoreError when it crashes, or takes so long that it will never end.
    """
    said, harmless = _tried(path.absolute(), kind, _state(path))
    if not harmless:
        raise StoreError(f"cannot read {path}: {said}")
    return said


@lru_cache(maxsize=4096)
def _tried(path: Path, kind: str, state: tuple[int, ...]) -> tuple[str, bool]:
    """What the process says, and whether it lived to say it."""
    root = str(Path(__file__).parents[2])
    paths = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    # BLAS would take memory for a thread of each core
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    limit = LIMIT + path.stat().st_size / SPEED
    try:
        done = called(
            [sys.executable, "-P", "-m", MODULE, kind, str(path), str(int(limit) + 1), str(MEMORY)],
            # on a busy machine it waits longer than it works, and work is what is limited
            6 * limit,
            env={**os.environ, **threads, "PYTHONPATH": paths},
        )
    except subprocess.TimeoutExpired:
        return "it is damaged, reading it does not end", False
    if done.returncode:
        return "it is damaged, reading it crashes the HDF5 library, or asks for too much of it", False
    return done.stdout.decode("utf-8", "backslashreplace").strip(), True
