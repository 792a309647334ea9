"""Commands of springcheck in this process, by the documents that they print."""

from __future__ import annotations

import json
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

from springcheck.cli import main as springcheck


def told(*arguments: str) -> dict[str, Any]:
    """The document that a command of springcheck prints, with its exit status."""
    out = StringIO()
    with redirect_stdout(out):
        status = springcheck([*arguments, "--json"])
    found: dict[str, Any] = json.loads(out.getvalue())
    return found | {"status": status}
