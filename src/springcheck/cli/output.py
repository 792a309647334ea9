"""Output of the command line: lines and JSON on standard output, warnings and progress on standard error."""

from __future__ import annotations

import json
import os
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from springcheck import interrupts
from springcheck.errors import SpringcheckError, StoreError, plain
from springcheck.studies.arguments import reported

if TYPE_CHECKING:
    from springcheck.studies.arguments import Progress
    from springcheck.text.lines import Lines

PIPE_WIDTH = 1 << 16
"""Width of output that is not a terminal's: its reader wraps long lines."""

SCHEMAS = {"stability": 2}
"""Versions of JSON documents, 1 of the others: raised where a name is removed or changes its meaning, and not
where one is added."""


def show(lines: Lines) -> None:
    """Print lines as wide as the terminal, or without a limit into a pipe.

    Styles are for terminals, and on request: https://force-color.org.
    """
    from springcheck.text.lines import drawn, shown

    terminal = sys.stdout.isatty()
    if not terminal and not any(map(os.environ.get, ("FORCE_COLOR", "TTY_COMPATIBLE"))):
        print("\n".join(str(line).rstrip() for line in shown(lines, PIPE_WIDTH)), flush=True)
        return
    from rich.console import Console

    # NO_COLOR overrides all other settings; Rich would still write bold
    colours: Literal["auto"] | None = None if os.environ.get("NO_COLOR") else "auto"
    # on a closed pipe Rich would end the program with an exit status of its own
    width, into = (None, None) if terminal else (PIPE_WIDTH, StringIO())
    drawn(lines, Console(highlight=False, width=width, color_system=colours, file=into))
    if into is not None:
        # a folded line ends in a blank, which files and diffs do not need
        print("\n".join(line.rstrip() for line in into.getvalue().splitlines()))


def answer(
    options: Namespace,
    document: Callable[[], dict[str, Any]],
    lines: Callable[[], Lines],
    status: int = 0,
    name: str = "",
) -> int:
    """Print the result of a command as requested: reports for continuous integration, and a JSON document (of
    the command's name by default) or text.  Returns the exit status."""
    reports = reported(options)
    data = document() if reports or options.json else {}
    if reports:
        from springcheck.cli import ci

        ci.report(options, data, status)
    if options.json:
        schema = f"springcheck/{name or options.name}/{SCHEMAS.get(name or options.name, 1)}"
        whole = json.dumps({"schema": schema, **data}, allow_nan=False, indent=2)
        print(whole, flush=True)
    elif not getattr(options, "quiet", False) and (said := lines()):
        show(said)
    if "keeps" not in options:
        interrupts.announce("interrupted; the answer is complete")
    return status


def doubts(file: str) -> list[dict[str, str]]:
    """Damage found in a store, for JSON; `warn` reports it first."""
    from springcheck import store

    return listed(store.doubts(Path(file)))


def listed(found: Sequence[Any]) -> list[dict[str, str]]:
    """Findings of a store as plain data."""
    return [{"place": one.place, "what": one.what} for one in found]


def _changed(file: str, found: Sequence[dict[str, str]], most: int) -> str:
    """Which parts of a store are damaged, in a line of about `most` letters; "" where none is."""
    first = "; ".join(f"{one['place']} {one['what']}" for one in found[:3])
    more = f"; {len(found) - 3} more, which springcheck check names" if len(found) > 3 else ""
    return f"{plain(f'{file} is not what was written: {first}', most)}{more}" if found else ""


def warn(file: str, found: Sequence[dict[str, str]]) -> None:
    """Print in one line which parts of a store are damaged, before anything of it is shown."""
    if said := _changed(file, found, 400):
        print(f"springcheck: {said}", file=sys.stderr)


@contextmanager
def warned(file: str, found: Sequence[dict[str, str]]) -> Iterator[None]:
    """Warn of damage once what is done here has succeeded; what fails here names it in the same line."""
    try:
        with readable(file):
            yield
    except SpringcheckError as error:
        # what makes it unreadable is said by the error
        if others := [one for one in found if one["what"] not in str(error)]:
            raise type(error)(f"{_changed(file, others, 250)}: {error}") from error
        raise
    warn(file, found)


@contextmanager
def alone() -> Iterator[None]:
    """Reserve standard output for springcheck: what an engine prints, in Python or C, goes to standard error.

    The engine gets a stream of its own, which it may close.
    """
    sys.stdout.flush()
    shown = sys.stdout
    kept, out = os.dup(1), os.dup(2)
    stream = open(out, "w", errors="backslashreplace")  # noqa: SIM115
    try:
        os.dup2(2, 1)
        sys.stdout = stream
        yield
    finally:
        sys.stdout = shown
        with suppress(OSError, ValueError):
            stream.close()
        if os.name == "posix":
            import ctypes

            # output of C code may still be in its buffer
            ctypes.CDLL(None).fflush(None)
        os.dup2(kept, 1)
        os.close(kept)


@contextmanager
def readable(file: str | None) -> Iterator[None]:
    """Turn any other exception in reading a file into a StoreError, so that no content causes a traceback."""
    try:
        yield
    except (SpringcheckError, OSError):
        raise
    except Exception as error:
        if file is None or interrupts.seen():
            raise
        from traceback import extract_tb

        last = extract_tb(error.__traceback__)[-1]
        where = f"line {last.lineno} of {Path(last.filename).name}"
        raise StoreError(f"{file}: cannot be made sense of ({type(error).__name__}, {where})") from error


@contextmanager
def progress(title: str, *, quiet: bool) -> Iterator[Progress | None]:
    """A progress bar on a terminal, nothing in a pipe."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    import rich.progress
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    bars = rich.progress.Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    with bars:
        yield _Bar(bars, title)


class _Bar:
    """A progress bar, and above it results as soon as they are known."""

    def __init__(self, bars: Any, title: str) -> None:
        self._bars, self._title, self._task = bars, title, None

    def __call__(self, done: float, whole: float, what: str = "") -> None:
        if self._task is None:
            self._task = self._bars.add_task(self._title, total=whole)
        said = f"{self._title}: {what}" if what else self._title
        self._bars.update(self._task, completed=done, total=whole, description=said)

    def line(self, text: str) -> None:
        """Print a result."""
        self._bars.console.print(text, highlight=False, markup=False)
