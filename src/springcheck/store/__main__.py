"""Try a file that libhdf5 might crash on, in a process of its own (see `trust`)."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from springcheck.errors import StoreError
from springcheck.store import checking, foreign, trust


def main(kind: str, path: Path) -> str:
    """Findings of `checking.structure` as JSON, or what `foreign.load` says against the file."""
    if kind == trust.OURS:
        return json.dumps([(finding.place, finding.what) for finding in checking.structure(path)])
    try:
        foreign.load(path)
    except StoreError as error:
        return str(error)
    return ""


if __name__ == "__main__":
    sys.stdout.write(main(sys.argv[1], Path(sys.argv[2])))
