"""Slips on the command line: names that are empty or mistyped, options that nothing reads."""

from __future__ import annotations

import argparse
import errno
import os
import re
import sys
from pathlib import Path
from typing import Any, NoReturn

from springcheck.errors import LONGEST_MESSAGE, SpringcheckError, nearest, plain

NAMES = {
    "scene": "SCENE",
    "file": "FILE",
    "source": "--from",
    "output": "-o",
    "label": "LABEL",
    "trajectory": "--trajectory",
}
"""Attributes of the arguments that name something, and their names on the command line."""


LEAST_MEMORY = 1 << 29
"""Least address space [bytes]: NumPy, libhdf5 and SciPy take 400 MiB, and each of their threads more."""

UNREAD = (
    ("source", "--from", ("-o", "--force", "--thorough", "--verdicts")),
    ("integrator", "--stepper", ("--mass", "--stiffness", "--friction", "--step", "--trajectory")),
)
"""An option, and those that its command does not read next to it."""


class Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line, and suggests the nearest word for a mistyped one."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        # -5K is a value as -5 is
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        wrong = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if wrong:
            known = [word.strip(" '") for word in wrong[2].split(",")]
            kind = "command" if "run" in known or len(known) == 1 else "choice"
            message = f"{wrong[1]!r} is no {kind}{nearest(wrong[1], known)}; there are {', '.join(known)}"
        if lone := re.fullmatch(r"argument (?:\S*/)?(--[\w-]+): expected one argument", message):
            option = lone[1]
            message = f"{option}: a value is needed; write one that begins with - as {option}=-..."
        sys.stderr.write(f"springcheck: {plain(message, LONGEST_MESSAGE)}\n")
        raise SystemExit(2)

    def _print_message(self, message: str, file: Any = None) -> None:
        """As argparse's, but raises the errors of a full disk or a closed pipe."""
        print(message, end="", file=file, flush=True)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        # names may begin with -, which leaves a column out
        words = re.sub(r"(?<=\0--columns)\0(?=-,)", "=", "\0".join(["", *args])).split("\0")[1:]
        found, extra = self.parse_known_args(words, namespace)
        if extra:
            (commands,) = (x for x in self._actions if isinstance(x, argparse._SubParsersAction))
            command = commands.choices[found.name]
            options = [*self._option_string_actions, *command._option_string_actions]
            near, shows = nearest(extra[0].partition("=")[0], options), f"`{command.prog} -h` shows them"
            self.error(f"{' '.join(extra)}: unknown or too many arguments{near}; {shows}")
        return found


def look(options: argparse.Namespace) -> None:
    """SpringcheckError for an argument that names nothing, or that the command would not read."""
    given = vars(options)
    _has_room()
    for attribute, called in NAMES.items():
        if given.get(attribute) == "":
            raise SpringcheckError(f"{called}: a name is needed, not an empty one")
    if "" in (given.get("files") or ()):
        raise SpringcheckError("FILE: a name is needed, not an empty one")
    for name in (given.get("file"), given.get("source"), *(given.get("files") or ())):
        if name is not None:
            _is_file(name)
    if options.name not in ("plot",) and given.get("output"):
        _leads_somewhere(given["output"])
    for attribute, called, unread in UNREAD:
        if given.get(attribute) is not None:
            for option in unread:
                if given.get("output" if option == "-o" else option[2:]):
                    raise SpringcheckError(f"{option} is not used with {called}: leave it out")
    if "rows" in given and given["rows"] is not None and given["trajectory"] is None:
        raise SpringcheckError("--rows is for the numbers of a trajectory: name one with --trajectory")


def _has_room() -> None:
    """SpringcheckError where memory does not suffice to load libraries: they crash, or retry forever."""
    try:
        import resource
    except ImportError:
        return
    most = resource.getrlimit(resource.RLIMIT_AS)[0]
    if most != resource.RLIM_INFINITY and most < LEAST_MEMORY:
        raise SpringcheckError(
            f"{most >> 20} MiB of address space (ulimit -v): at least {LEAST_MEMORY >> 20} MiB are needed"
        )


def _is_file(name: str) -> None:
    path = Path(name)
    if not path.exists() and (store := path.with_name(f"{path.name}.h5")).is_file():
        raise SpringcheckError(f"{name}: no such file, did you mean {store}?")
    if path.is_dir():
        raise SpringcheckError(f"{name}: it is a folder, a file is needed")
    if path.exists() and not path.is_file():
        raise SpringcheckError(f"{name}: it is a device or a pipe, a file is needed")


def _leads_somewhere(name: str) -> None:
    if os.path.islink(name):
        try:
            os.stat(name)
        except FileNotFoundError:
            return
        except OSError as error:
            raise SpringcheckError(f"cannot write {name}: {error.strerror}") from error


def open_streams() -> None:
    """Replace closed standard streams by ones that lead nowhere; write what they cannot encode as escapes."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "r" if number == 0 else "w", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def refused(error: BaseException) -> str:
    """A limit of the system that some error comes from, in a line; "" where it comes from none."""
    limits = {
        errno.EMFILE: "open files (ulimit -n)",
        errno.ENFILE: "open files on this machine",
        errno.EAGAIN: "processes or threads (ulimit -u)",
        errno.ENOMEM: "memory",
    }
    chain: BaseException | None = error
    while chain is not None:
        what = "memory" if isinstance(chain, MemoryError) else limits.get(getattr(chain, "errno", None) or 0)
        if what:
            return f"the system refuses more {what}"
        chain = chain.__cause__ or chain.__context__
    return ""


def one_line(error: BaseException) -> str:
    """One line on an error beyond a user's remedy: a limit of the system, or a mistake in springcheck."""
    said = " ".join(str(error).split())[:200]
    where = "SPRINGCHECK_TRACEBACK=1 shows where"
    mistake = f"{type(error).__name__}: {said}; this is a mistake in springcheck: {where}"
    return refused(error) or mistake
