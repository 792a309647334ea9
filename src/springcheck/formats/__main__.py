"""A file that a library reads, in a process of its own (see `springcheck.store.apart`)."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from springcheck import formats
from springcheck.errors import StoreError
from springcheck.store import apart


def main(kind: str, path: Path, columns: str, step: str) -> bytes:
    """The states that a format's reader finds, as NPZ; or what it says against the file."""
    names = msgspec.json.decode(columns, type=list[str])
    try:
        found = formats.BY_NAME[kind].read(path, names, float(step) if step else None)
    except StoreError as error:
        return apart.REFUSED + str(error).encode()
    known: dict[str, Any] = {
        "t": found.t, "q": found.q, "p": found.p, "v": found.v, "mass": found.mass,
        "roundoff": np.asarray(found.roundoff),
    }  # fmt: skip
    out = BytesIO()
    np.savez(out, **{name: x for name, x in known.items() if x is not None})
    return out.getvalue()


if __name__ == "__main__":
    apart.perform(main)
