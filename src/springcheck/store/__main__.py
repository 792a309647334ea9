"""Try a file that libhdf5 might crash on, in a process of its own (see `trust`)."""

from __future__ import annotations

import contextlib
import json
import re
import sys
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.store import checking, foreign, trust


def limit(seconds: int, memory: int) -> None:
    """Take no more time and memory than this [s, B], write no file, and die with the process that asked."""
    try:
        import resource
    except ImportError:
        # Windows has no such limits; the process that asked waits no longer than its own
        return
    for what, most in (
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, 0),
    ):
        # macOS knows no RLIMIT_AS
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(what, (most, most))
    if sys.platform == "linux":
        import ctypes
        import signal

        parent_died = 1  # PR_SET_PDEATHSIG
        ctypes.CDLL(None).prctl(parent_died, signal.SIGKILL)


def main(kind: str, path: Path) -> str:
    """Findings of `checking.structure` as JSON, or what `foreign.load` says against the file.

    MemoryError where libhdf5 asked for more than it got: elsewhere it would get it, and fill it.
    """
    if kind == trust.OURS:
        said = json.dumps([(finding.place, finding.what) for finding in checking.structure(path)])
        if re.search(r"allocation failed|(unable to|can't) allocate", said):
            raise MemoryError
        return said
    try:
        for _ in foreign.arrays(path, lambda place: True):
            pass
        foreign.load(path, alone=True)
    except StoreError as error:
        return str(error)
    return ""


if __name__ == "__main__":
    limit(int(sys.argv[3]), int(sys.argv[4]))
    sys.stdout.write(main(sys.argv[1], Path(sys.argv[2])))
