"""Try a file that libhdf5 might crash on, in a process of its own (see `trust`)."""

from __future__ import annotations

import json
import re
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.store import apart, checking, foreign, trust


def main(kind: str, path: Path) -> bytes:
    """Findings of `checking.structure` as JSON, or what `foreign.load` says against the file.

    MemoryError where libhdf5 asked for more than it got: elsewhere it would get it, and fill it.
    """
    if kind == trust.OURS:
        said = json.dumps([(finding.place, finding.what) for finding in checking.structure(path)])
        if re.search(r"allocation failed|(unable to|can't) allocate", said):
            raise MemoryError
        return said.encode()
    try:
        for _ in foreign.arrays(path, lambda place: True):
            pass
        foreign.load(path, alone=True)
    except StoreError as error:
        return str(error).encode()
    return b""


if __name__ == "__main__":
    apart.perform(main)
