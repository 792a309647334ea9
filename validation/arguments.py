"""How a script of this folder begins and ends: its command line, and one line where it cannot go on."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from springcheck.errors import SpringcheckError
from springcheck.interrupts import STATUS


def arguments(description: str | None, **defaults: Any) -> argparse.Namespace:
    """The command line of a script, with its docstring for --help; whatever is left out has its default.

    A default that is False makes an option (`--name`); a tuple holds the words to choose from, the first of
    them being the default; a list takes any number of words; anything else takes one of its type, and a type
    without a default is left out as None.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default in defaults.items():
        if default is False:
            parser.add_argument(f"--{name}", action="store_true")
        elif isinstance(default, tuple):
            parser.add_argument(name, nargs="?", choices=default, default=default[0])
        elif isinstance(default, list):
            parser.add_argument(name, nargs="*", default=default)
        elif isinstance(default, type):
            parser.add_argument(name, nargs="?", type=default)
        else:
            parser.add_argument(name, nargs="?", type=type(default), default=default)
    return parser.parse_args()


def script(main: Callable[[], int | None]) -> NoReturn:
    """End the process with main's exit status, 0 for None.

    Ctrl-C (status 130) and a word that names nothing or a file that cannot be opened (status 2) are answered
    by one line on standard error.  Any other exception is a defect of the script and keeps its traceback.
    """
    why: object
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        why, status = "interrupted", STATUS
    except (SpringcheckError, OSError) as error:
        why, status = error, 2
    print(f"{Path(sys.argv[0]).name}: {why}", file=sys.stderr)
    sys.exit(status)
