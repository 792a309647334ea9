"""Memory that a computation would take, compared with the available memory before it begins."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from springcheck.errors import SceneError

LIMITS = (("memory.max", "memory.current"), ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"))
"""Files below a control group's root with its limit and its use, in versions 2 and 1."""


def available(root: Path = Path("/")) -> int | None:
    """Bytes available to this process: by the machine, its control group and its own limit.

    None on systems that do not report them.
    """
    found = []
    with suppress(OSError, ValueError, StopIteration):
        lines = (root / "proc/meminfo").read_text().splitlines()
        found.append(1024 * int(next(x for x in lines if x.startswith("MemAvailable:")).split()[1]))
    for most, used in LIMITS:
        # without a limit the file says "max"
        with suppress(OSError, ValueError):
            group = root / "sys/fs/cgroup"
            found.append(int((group / most).read_text()) - int((group / used).read_text()))
    with suppress(ImportError, OSError, ValueError, AttributeError):
        import resource

        most_here = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most_here != resource.RLIM_INFINITY:
            pages = int((root / "proc/self/statm").read_text().split()[0])
            found.append(most_here - pages * os.sysconf("SC_PAGE_SIZE"))
    return max(0, min(found)) if found else None


def need(size: float, what: str, then: str) -> None:
    """SceneError where `what` takes more bytes than are available; `then` is the remedy."""
    there = available()
    if there is not None and size > there:
        # a whole number may be larger than any double
        wanted, here = (f"{min(x, sys.float_info.max) / 1e9:.3g} GB" for x in (size, there))
        raise SceneError(f"{what} take {wanted} of memory and {here} are available here; {then}")
