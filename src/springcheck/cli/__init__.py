"""The command line: parses, calls, prints, and answers errors of users with one line and exit status 2.

Heavy modules are imported by the command that needs them: `--help` and `list` import no engine, no HDF5 and
no NumPy that they do not use.
"""

from __future__ import annotations

import argparse
import errno
import gc
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import springcheck
from springcheck import interrupts
from springcheck.cli import groups, output, slips
from springcheck.cli.commands import COMMANDS, Command
from springcheck.errors import SpringcheckError, StoreWarning, plain
from springcheck.studies import STUDIES
from springcheck.studies.arguments import REPORTING, REPORTS, reported
from springcheck.studies.study import Study, study_of


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 passed, 1 a verdict failed, 2 an error of the user."""
    try:
        words = sys.argv[1:] if arguments is None else arguments
        options = _parser(words).parse_args(words)
    except OSError as error:
        return _mistake(error)
    command: Callable[[argparse.Namespace], int] = options.command
    what = "nothing was saved"
    if "keeps" not in options and "output" in options:
        # every file is moved into place as a whole, each of several figures too
        what = "no file is half written"
    elif "keeps" in options and options.keeps(options):
        what = "finished work is saved; the same command continues"
    interrupts.announce(f"interrupted; {what}")
    try:
        slips.look(options)
        if reported(options):
            from springcheck.cli import ci

            ci.check_paths(options)
        read = getattr(options, "file", None) or getattr(options, "source", None)
        with _said(), output.readable(read):
            if any(getattr(options, name, None) for name in ("engine", "stepper", "program")):
                from springcheck import doors

                with output.alone():
                    doors.bring(options)
            if "keeps" not in options:
                gc.enable()
            try:
                status = command(options)
            except SpringcheckError as error:
                if reported(options):
                    ci.failed(options, error)
                raise
            # so that a full disk is still reported
            sys.stdout.flush()
            return status
    except BaseException as error:
        # a library that was interrupted may raise an error of its own
        if interrupts.seen():
            raise
        if isinstance(error, KeyboardInterrupt):
            print(f"springcheck: interrupted; {what}", file=sys.stderr)
            return interrupts.STATUS
        if isinstance(error, SpringcheckError | OSError):
            return _mistake(error)
        raise


@contextmanager
def _said() -> Iterator[None]:
    """Print warnings about stores as lines on standard error."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", StoreWarning)
        shown = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any, **named: Any) -> None:
            if issubclass(category, StoreWarning):
                print(f"springcheck: {message}", file=sys.stderr)
            else:
                shown(message, category, *rest, **named)

        warnings.showwarning = show
        yield


def _mistake(error: SpringcheckError | OSError) -> int:
    """Print an error in one line; returns the exit status."""
    if isinstance(error, BrokenPipeError):
        # the program ends without a message
        raise error
    # the library names its files; any other OSError is of our own output, on a full disk for example
    closed = getattr(error, "errno", None) == errno.EBADF
    why = "standard output is closed" if closed else getattr(error, "strerror", "")
    refused = slips.refused(error) if isinstance(error, OSError) else ""
    said = refused or (f"cannot write the output: {why}" if isinstance(error, OSError) else error)
    print(f"springcheck: {said}", file=sys.stderr)
    if isinstance(error, OSError) and not refused:
        # nothing more can be written, not even by the interpreter's shutdown
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 2


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """A parser for the command that these words begin with, or for all: each takes long to set up."""
    parser = slips.Parser(
        prog="springcheck",
        description="Simulation engines judged to rounding by a mass on a spring.",
        epilog="Exit status: 0 every verdict passed; 1 some verdict failed; "
        f"2 bad input, nothing was measured, or an engine failed; {interrupts.STATUS} interrupted; "
        "141 broken pipe.",
    )
    version = f"springcheck {springcheck.__version__}"
    parser.add_argument("--version", action="version", version=version, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", dest="name")

    every: tuple[Study | Command, ...] = (*STUDIES, *COMMANDS)
    for one in [one for one in every if one.name in words[:1]] or every:
        # a study of a plug-in has none
        examples = groups.EXAMPLES.get(one.name, [""])
        parser_of = commands.add_parser(
            one.name,
            help=one.about,
            description=one.about[:1].upper() + one.about[1:] + ".",
            epilog="\n".join(["examples:", *(f"  springcheck {one.name} {x}".rstrip() for x in examples)]),
            formatter_class=groups.Formatter,
        )
        if one.name in words:
            groups.add(parser_of, one.name, (*one.arguments, *(REPORTS if one.name in REPORTING else ())))
        if isinstance(one, Study):
            parser_of.set_defaults(command=partial(_study, one), keeps=one.keeps)
        else:
            parser_of.set_defaults(command=one.perform)
    return parser


def _study(study: Study, options: argparse.Namespace) -> int:
    source = getattr(options, "source", None)
    doubts = output.doubts(source) if source else []
    with output.alone(), output.progress(study.name, quiet=options.quiet) as progress:
        found = study.perform(options, progress)
    shown = study_of(found)
    output.warn(str(source), doubts)
    trusted = {"not_trusted": doubts} if source else {}
    broke: dict[str, str] = getattr(found, "broke", {})
    status = output.answer(
        options,
        lambda: {**found.document(), **trusted},
        lambda: shown.lines(found, options),
        found.status or int(bool(doubts)),
        shown.name,
    )
    if options.quiet and not options.json and found.status == 2 and not broke:
        why = "nothing was measured, or not all could be judged; without --quiet the report says what"
        print(f"springcheck: {why}", file=sys.stderr)
    for why in broke.values():
        print(f"springcheck: {plain(why)}", file=sys.stderr)
    return status
