"""How a script of this folder begins and ends: its command line, and one line where it cannot go on."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from springcheck import interrupts
from springcheck.errors import SpringcheckError


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


def _by_interrupt(error: BaseException) -> bool:
    """Whether an exception was raised while an interrupt was on its way out."""
    before = error.__context__
    return before is not None and (isinstance(before, KeyboardInterrupt) or _by_interrupt(before))


def script(main: Callable[[], int | None]) -> NoReturn:
    """End the process with main's exit status, 0 for None.

    Ctrl-C (status 130) and a word that names nothing, a file that cannot be opened or a library that is not
    installed (status 2) are answered by one line on standard error.  Any other exception is a defect of the
    script and keeps its traceback.
    """
    interrupts.install()
    interrupts.announce("interrupted")
    try:
        status = main()
    except BaseException as error:
        # a library, or what ends files and processes, may call an interrupt an error of its own
        if interrupts.seen() or isinstance(error, KeyboardInterrupt) or _by_interrupt(error):
            print("springcheck: interrupted", file=sys.stderr)
            sys.exit(interrupts.STATUS)
        missing = isinstance(error, ModuleNotFoundError) and not str(error.name).startswith("springcheck")
        if missing or isinstance(error, SpringcheckError | OSError):
            print(f"{Path(sys.argv[0]).name}: {error}", file=sys.stderr)
            sys.exit(2)
        raise
    sys.exit(status)
