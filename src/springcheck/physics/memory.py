"""Memory that a computation would take, compared with the available memory before it begins."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

from springcheck.errors import SceneError


def available(root: Path = Path("/")) -> int | None:
    """Bytes available to this process by the machine and by its control group; None where neither says."""
    found, group = [], root / "sys/fs/cgroup"
    with suppress(OSError, ValueError, StopIteration):
        lines = (root / "proc/meminfo").read_text().splitlines()
        found.append(1024 * int(next(x for x in lines if x.startswith("MemAvailable:")).split()[1]))
    with suppress(OSError, ValueError):
        # without a limit the file says "max"
        found.append(int((group / "memory.max").read_text()) - int((group / "memory.current").read_text()))
    return max(0, min(found)) if found else None


def need(size: float, what: str, then: str) -> None:
    """SceneError where `what` takes more bytes than are available; `then` is the remedy."""
    there = available()
    if there is not None and size > there:
        # a whole number may be larger than any double
        wanted, here = (f"{min(x, sys.float_info.max) / 1e9:.3g} GB" for x in (size, there))
        raise SceneError(f"{what} take {wanted} of memory and {here} are available here; {then}")
