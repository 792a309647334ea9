"""Grade steppers: python grade.py exercises.py; exit status 0 where all are what they are meant to be.

Each function of `AIMS` is given to `springcheck identify --stepper FILE:NAME --json`, whose document says
which scheme its states show, whether all of them fit it to rounding, and otherwise what may be wrong.
"""

import json
import os
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from springcheck.cli import main as springcheck
from springcheck.doors.function import load


def document(module: str, name: str) -> dict[str, object]:
    """What `springcheck identify` says of one function."""
    out = StringIO()
    with redirect_stdout(out):
        status = springcheck(["identify", "--stepper", f"{module}:{name}", "--json"])
    if status not in (0, 1):
        return {"fits": False, "statement": "it is no stepper, see above"}
    found: dict[str, object] = json.loads(out.getvalue())
    return found


def main(arguments: list[str]) -> int:
    """Print a line for each stepper."""
    path = Path(arguments[0] if arguments else "exercises.py").resolve()
    os.chdir(path.parent)
    aims = load(f"{path.stem}:AIMS.copy")()
    mended = 0
    for name, aim in aims.items():
        found = document(path.stem, name)
        right = bool(found["fits"]) and found.get("scheme") == aim
        mended += right
        print(f"{name:6} {'right' if right else 'not yet'}: {found['statement']}")
    print(f"{mended} of {len(aims)}")
    return 0 if mended == len(aims) else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
