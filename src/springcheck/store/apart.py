"""Files are first read in a child process with limited memory and time, whose end is never ours.

Libraries that read them (libhdf5, pandas, MDAnalysis, ASE ...) crash, hang and fill the memory on files that
are damaged, or were made to do so.  Nothing in a file can say that it is harmless: only files that this
process has written itself are opened without a trial.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from springcheck.errors import SpringcheckError, StoreError
from springcheck.processes import called
from springcheck.store import files

LIMIT, LONGEST, SPEED = 8.0, 20.0, 1e8
"""Seconds of processor time that reading a file may take: of a small one, and of any; bytes a second."""
MEMORY = 1 << 30
"""Bytes of memory that it may take."""
REFUSED = b"refused "
"""Prefix of a reader's message on a file that it refuses."""

_known: dict[tuple[int, ...], str] = {}
"""Whether this process may open files in the states in which it knows them: "", or why it may not."""


class EndedError(Exception):
    """The child process crashed or exceeded its limits: the message says which."""


def trust(path: Path, module: str) -> None:
    """Return if this process can open a file with libhdf5; raise StoreError otherwise.

    The function `tried` of the module reads all of it in a child process, once for each state of the file.
    """
    with files.told(path, "read"):
        now = state(path)
    if now not in _known:
        try:
            _known[now] = read(module, "tried", path.absolute()).decode()
        except StoreError as error:
            _known[now] = str(error)
        except EndedError as error:
            _known[now] = f"cannot read {path}: it is damaged, reading it {error}"
    if _known[now]:
        raise StoreError(_known[now])


def know(path: Path) -> None:
    """Remember that a file, as it is now, can be opened."""
    _known[state(path)] = ""


def state(path: Path) -> tuple[int, ...]:
    """What changes when a file is written or replaced."""
    found = path.stat()
    return found.st_dev, found.st_ino, found.st_mtime_ns, found.st_size


def read(module: str, function: str, path: Path, *words: str) -> bytes:
    """What a module's function returns for a file and further arguments, called in a child process.
    StoreError where it raises one, EndedError where the process does not end normally."""
    root = str(Path(__file__).parents[2])
    paths = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    # BLAS would take memory for a thread of each core
    threads = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    limit = min(LONGEST, LIMIT + path.stat().st_size / SPEED)
    begin = f"from springcheck.store import apart; apart.perform({int(limit) + 1})"
    command = [sys.executable, "-P", "-c", begin, module, function, str(path), *words]
    try:
        # on a busy machine it waits longer than it works, and work is what is limited
        done = called(command, 6 * limit, most=MEMORY, env={**os.environ, **threads, "PYTHONPATH": paths})
    except subprocess.TimeoutExpired:
        raise EndedError("does not end") from None
    except OSError as error:
        # no fault of the file
        why = f"{path} is read in a process of its own, and none can be started: {files.cause(error)}"
        raise SpringcheckError(why) from error
    if done.returncode:
        raise EndedError(
            f"crashes its library, or asks for more than {limit:.0f} s or {MEMORY >> 30} GiB of memory"
        )
    return heard(done.stdout)


def answer(module: str, function: str, path: Path, *words: str) -> bytes:
    """What a child process writes: the function's result, or its complaint about the file."""
    try:
        found: bytes = getattr(import_module(module), function)(path, *words)
    except StoreError as error:
        return REFUSED + str(error).encode("utf-8", "surrogatepass")
    return found


def heard(answer: bytes) -> bytes:
    """The result that a child process has written; its StoreError is raised again."""
    if answer.startswith(REFUSED):
        raise StoreError(answer.removeprefix(REFUSED).decode("utf-8", "backslashreplace"))
    return answer


def perform(seconds: int) -> None:
    """Entry point of a child process: apply the limits, and answer on standard output."""
    module, function, path, *words = sys.argv[1:]
    out = os.dup(1)
    os.dup2(2, 1)
    import_module(module)
    _limit(seconds)
    with open(out, "wb") as file:
        file.write(answer(module, function, Path(path), *words))
    # a library that was given a bad file may crash as it is tidied up
    os._exit(0)


def _limit(seconds: int) -> None:
    """Limit time and memory of this process, forbid it to write files, and end it with its parent."""
    try:
        import resource
    except ImportError:
        # Windows has no such limits; the process that asked waits no longer than its own
        return
    limits = {"CPU": seconds, "AS": MEMORY, "CORE": 0, "FSIZE": 0}
    for name, most in limits.items():
        # macOS knows no RLIMIT_AS
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (most, most))
    if sys.platform == "linux":
        import ctypes
        import signal

        parent_died = 1  # PR_SET_PDEATHSIG
        ctypes.CDLL(None).prctl(parent_died, signal.SIGKILL)
