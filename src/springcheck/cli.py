"""The command line: parses, calls, prints, and answers mistakes with one line and exit status 2.

Heavy modules are imported by the command that needs them: `--help` and `list` import no engine, no
HDF5 and no NumPy that they do not use.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from springcheck import interrupts, slips
from springcheck.errors import IdentificationError, SpringcheckError, StoreError, StoreWarning, plain
from springcheck.studies import STUDIES
from springcheck.studies.study import Study, engine_option

if TYPE_CHECKING:
    from rich.console import RenderableType

    from springcheck.studies.study import Progress

INTERRUPTED = interrupts.STATUS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 passed, 1 a verdict failed, 2 a mistake."""
    try:
        options = _parser().parse_args(arguments)
    except OSError as error:
        return _mistake(error)
    command: Callable[[argparse.Namespace], int] = options.command
    kept = "keeps" in options and options.keeps(options)
    what = "what was finished is kept, the same command goes on" if kept else "nothing is kept"
    interrupts.announce(f"interrupted; {what}")
    try:
        slips.look(options)
        with _said(), _readable(options):
            if any(getattr(options, name, None) for name in ("engine", "stepper", "program")) and (
                command is not _identify
            ):
                from springcheck import doors

                doors.bring(options)
            status = command(options)
            # while a full disk can still be said
            sys.stdout.flush()
            return status
    except KeyboardInterrupt:
        return _interrupted(what)
    except Exception as error:
        if interrupts.seen():
            # a library that was interrupted may call it an error of its own
            return _interrupted(what)
        if isinstance(error, SpringcheckError | OSError):
            return _mistake(error)
        raise


@contextmanager
def _said() -> Iterator[None]:
    """Warnings about stores as lines on standard error."""
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


@contextmanager
def _readable(options: argparse.Namespace) -> Iterator[None]:
    """The last line of defence of commands that read a file: whatever is in it, no traceback."""
    path = getattr(options, "file", None) or getattr(options, "source", None)
    try:
        yield
    except (SpringcheckError, OSError):
        raise
    except Exception as error:
        if path is None or interrupts.seen():
            raise
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        where = f", line {trace.tb_lineno} of {Path(trace.tb_frame.f_code.co_filename).name}" if trace else ""
        raise StoreError(f"{path}: cannot be made sense of ({type(error).__name__}{where})") from error


def _doubts(file: str) -> list[dict[str, str]]:
    """What of a store cannot be trusted, for JSON; `_warn` says it first."""
    from springcheck import store

    return [{"place": one.place, "what": one.what} for one in store.doubts(Path(file))]


def _warn(file: str, doubts: Sequence[dict[str, str]]) -> None:
    """Say in one line what of a store cannot be trusted, before anything of it is shown."""
    if doubts:
        first = "; ".join(f"{one['place']} {one['what']}" for one in doubts[:3])
        more = f"; {len(doubts) - 3} more, which springcheck check names" if len(doubts) > 3 else ""
        print(f"springcheck: {plain(f'{file} is not what was written: {first}', 400)}{more}", file=sys.stderr)


def _interrupted(what: str) -> int:
    """Say what Ctrl-C has left; returns the exit status."""
    print(f"springcheck: interrupted; {what}", file=sys.stderr)
    interrupts.announce("")
    return INTERRUPTED


def _mistake(error: SpringcheckError | OSError) -> int:
    """Say what went wrong in one line; returns the exit status."""
    if not isinstance(error, BrokenPipeError):
        # the library names its files; what is left of OSError is our own output, on a full disk for one
        said = error.strerror if isinstance(error, OSError) else None
        print(f"springcheck: {said or error}", file=sys.stderr)
    if isinstance(error, OSError):
        # nothing more can be written, by the interpreter's shutdown either
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = slips.Parser(
        prog="springcheck",
        description="Simulation engines judged to rounding by a mass on a spring.",
        epilog="Exit status: 0 every verdict passed; 1 some verdict failed; "
        f"2 bad input, or nothing was measured; {INTERRUPTED} interrupted.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", dest="name")

    for study in STUDIES:
        parser_of = commands.add_parser(study.name, help=study.about)
        study.options(parser_of)
        parser_of.set_defaults(command=partial(_study, study), keeps=study.keeps)

    inspect = commands.add_parser("inspect", help="what is in a store")
    inspect.add_argument("file", metavar="FILE")
    inspect.add_argument("--trajectory", metavar="LABEL", help="print the numbers of one trajectory")
    inspect.add_argument("--rows", type=int, metavar="N", help="how many frames of it (default 20)")
    inspect.add_argument("--verdicts", action="store_true", help="print every verdict with its reason")
    inspect.add_argument("--json", action="store_true", help="one JSON document on standard output")
    inspect.set_defaults(command=_inspect)

    plot = commands.add_parser("plot", help="draw what is in a store, as PNG and SVG")
    plot.add_argument("file", metavar="FILE")
    plot.add_argument("-o", "--output", metavar="FOLDER", help="default: figures/ and the store's name")
    plot.add_argument("--quiet", action="store_true", help="print nothing but mistakes")
    plot.set_defaults(command=_plot)

    report = commands.add_parser("report", help="a store as one HTML page that checks itself in a browser")
    report.add_argument("file", metavar="FILE")
    report.add_argument("-o", "--output", metavar="OUT.html", help="default: the store's name, .html")
    report.add_argument("--quiet", action="store_true", help="print nothing but mistakes")
    report.set_defaults(command=_report)

    show = commands.add_parser("show", help="a shipped scene as a file to start from")
    show.add_argument("scene", metavar="SCENE")
    show.add_argument("-o", "--output", metavar="MY.toml", help="write it there, where nothing is yet")
    show.set_defaults(command=_show_scene)

    explain = commands.add_parser("explain", help="what a check looks at, what a scheme does")
    explain.add_argument("word", metavar="NAME", help="a check, a scheme, or a method as engine:method")
    engine_option(explain)
    explain.set_defaults(command=_explain)

    identify = commands.add_parser("identify", help="which scheme made a trajectory, ours or anyone's")
    identify.add_argument("file", metavar="FILE", nargs="?", help="a store, or any H5MD file with velocities")
    identify.add_argument(
        "--trajectory", metavar="LABEL", help="one trajectory or particle group of the file"
    )
    identify.add_argument("--stiffness", type=float, metavar="K", help="is this the stiffness?")
    identify.add_argument(
        "--mass", type=float, metavar="M", help="mass of every particle, where the file has none"
    )
    identify.add_argument("--columns", metavar="NAMES", help="names of a table's columns, as t,q,v")
    identify.add_argument("--step", type=float, metavar="H", help="is this the time step?")
    identify.add_argument(
        "--stepper",
        metavar="MODULE:FUNCTION",
        help="judge a Python function step(q, p, h, force, mass) -> (q, p)",
    )
    identify.add_argument("--json", action="store_true", help="one JSON document on standard output")
    identify.set_defaults(command=_identify)

    judge = commands.add_parser("judge", help="is a trajectory of any program what its scheme promises")
    judge.add_argument("file", metavar="FILE", help="a table, NPY, NPZ, extended XYZ, LAMMPS dump, H5MD ...")
    judge.add_argument("--scene", required=True, metavar="SCENE", help="the scene that it is of")
    judge.add_argument("--scheme", required=True, metavar="NAME", help="the scheme that it should have")
    judge.add_argument("--columns", metavar="NAMES", help="names of its columns, as t,q,v")
    judge.add_argument("--trajectory", metavar="LABEL", help="one trajectory or particle group of the file")
    judge.add_argument("--step", type=float, metavar="H", help="the time step of a file that counts steps")
    judge.add_argument("--json", action="store_true", help="one JSON document on standard output")
    judge.set_defaults(command=_judge)

    check = commands.add_parser("check", help="is a store whole: digests, completeness, structure")
    check.add_argument("file", metavar="FILE")
    check.set_defaults(command=_check)

    export = commands.add_parser("export", help="one trajectory as a file of its own, for other tools")
    export.add_argument("file", metavar="FILE")
    export.add_argument("label", metavar="LABEL")
    export.add_argument("output", metavar="OUT.h5md")
    export.set_defaults(command=_export)

    listing = commands.add_parser("list", help="scenes, engines with their versions, checks")
    engine_option(listing)
    listing.add_argument("--json", action="store_true", help="one JSON document on standard output")
    listing.set_defaults(command=_list)
    return parser


class _Version(argparse.Action):
    """Reads the version only when it is asked for: importlib.metadata takes longer than the rest."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"springcheck {version('springcheck')}", flush=True)
        parser.exit()


def _show(lines: Sequence[RenderableType], *, quiet: bool = False) -> None:
    from rich.console import Console

    # in a pipe there is no width to keep to; long lines are for the reader's tools to fold
    terminal = sys.stdout.isatty()
    console = Console(quiet=quiet, highlight=False, width=None if terminal else 1 << 16)
    if quiet or terminal:
        for line in lines:
            console.print(line, crop=False)
        return
    with console.capture() as captured:
        for line in lines:
            console.print(line, crop=False)
    # a line that was folded ends in a blank, which a file or a diff need not keep
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def _document(data: Any) -> None:
    print(json.dumps(data, allow_nan=False, indent=2))


def _study(study: Study, options: argparse.Namespace) -> int:
    source = getattr(options, "source", None)
    doubts = _doubts(source) if source else []
    with _progress(options, study.name) as progress:
        found = study.perform(options, progress)
    _warn(str(source), doubts)
    if options.json:
        _document({**found.document(), **({"not_trusted": doubts} if source else {})})
    elif not options.quiet:
        _show(study.lines(found, options))
    elif found.status == 2:
        print("springcheck: nothing was measured; without --quiet the report says why", file=sys.stderr)
    return found.status or int(bool(doubts))


@contextmanager
def _progress(options: argparse.Namespace, title: str) -> Iterator[Progress | None]:
    """A progress bar on a terminal, nothing in a pipe."""
    if options.quiet or not sys.stderr.isatty():
        yield None
        return
    import rich.progress
    from rich.console import Console
    from rich.progress import BarColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

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
    task: list[TaskID] = []

    def told(done: float, whole: float, what: str = "") -> None:
        if not task:
            task.append(bars.add_task(title, total=whole))
        bars.update(task[0], completed=done, total=whole, description=f"{title}: {what}" if what else title)

    with bars:
        yield told


def _inspect(options: argparse.Namespace) -> int:
    from springcheck import inspect

    rows = 20 if options.rows is None else options.rows
    if rows < 1:
        raise SpringcheckError(f"--rows {rows}: a number of frames from 1 on is needed")
    doubts = _doubts(options.file)
    found = inspect.look(Path(options.file), trajectory=options.trajectory, rows=rows)
    _warn(options.file, doubts)
    if options.json:
        _document({"not_trusted": doubts, **inspect.document(found)})
    else:
        _show(inspect.lines(found, options))
    return int(bool(doubts))


def _columns(options: argparse.Namespace) -> list[str]:
    return [name.strip() for name in (options.columns or "").split(",") if name.strip()]


def _judge(options: argparse.Namespace) -> int:
    from springcheck.doors import file

    found = file.judge(
        Path(options.file),
        scene=options.scene,
        scheme=options.scheme,
        columns=_columns(options),
        step=options.step,
        trajectory=options.trajectory,
    )
    if options.json:
        _document(found.document())
    else:
        _show(found.lines())
    return found.status


def _identify(options: argparse.Namespace) -> int:
    from springcheck import formats, identify
    from springcheck.identify import files, text

    if (options.file is None) == (options.stepper is None):
        raise SpringcheckError("identify needs a FILE, or --stepper MODULE:FUNCTION, and not both")
    if options.stepper is not None:
        doubts = []
        # what it prints is not ours to show
        with redirect_stdout(sys.stderr):
            found = {options.stepper: identify.identify_stepper(identify.load_stepper(options.stepper))}
    else:
        stated = {"mass": options.mass, "stiffness": options.stiffness, "step": options.step}
        for name, value in stated.items():
            if value is None or (value == 0 and name == "stiffness"):
                continue
            # beyond these sizes the squares of numbers are none
            if not 1e-150 < abs(value) < 1e150 or (name == "mass" and value < 0):
                needed = "a number of a size from 1e-150 to 1e150, a mass above 0"
                raise SpringcheckError(f"--{name} {value:g}: {needed} is needed")
        found = {}
        doubts = _doubts(options.file) if formats.is_hdf5(Path(options.file)) else []
        for states in files.read(Path(options.file), options.trajectory, _columns(options), options.step):
            try:
                found[states.label] = files.identify_states(states, **stated)
            except SpringcheckError as error:
                raise type(error)(f"{options.file}, {states.label}: {error}") from error
            except (ArithmeticError, ValueError) as error:
                given = [f"--{name} {value:g}" for name, value in stated.items() if value is not None]
                raise IdentificationError(
                    f"{options.file}, {states.label}: nothing can be worked out with "
                    f"{', '.join(given) or 'its numbers'}: {error}"
                ) from error
    _warn(options.file, doubts)
    documents = [{"trajectory": label, **one.document()} for label, one in found.items()]
    if options.json:
        document = documents[0] if len(documents) == 1 else {"identifications": documents}
        _document({**document, "not_trusted": doubts})
    else:
        _show([line for label, one in found.items() for line in text.identification(label, one)])
    fits = all(one.fits or one.verdict == "adaptive" for one in found.values())
    return 0 if fits and not doubts else 1


def _plot(options: argparse.Namespace) -> int:
    from springcheck import plot
    from springcheck.figures import folder

    path = Path(options.file)
    doubts = _doubts(options.file)
    written, notes = plot.draw(path, Path(options.output or folder.folder_of(path)))
    _warn(options.file, doubts)
    if not options.quiet:
        for line in (*notes, *written):
            print(plain(line))
    return int(bool(doubts))


def _report(options: argparse.Namespace) -> int:
    from springcheck import page

    path = Path(options.file)
    into = Path(options.output or f"{path.stem}.html")
    content = page.gather(path)
    size = page.write(content, into)
    _warn(options.file, [{"place": one.place, "what": one.what} for one in content.not_trusted])
    if not options.quiet:
        print(plain(f"{into}: {size / 1e3:.0f} kB"))
    return int(bool(content.not_trusted))


def _show_scene(options: argparse.Namespace) -> int:
    from springcheck.physics import scenefile

    text = scenefile.text_of(options.scene)
    if options.output is None:
        sys.stdout.write(text)
        return 0
    try:
        with open(options.output, "x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise SpringcheckError(f"cannot write {options.output}: {error.strerror}") from error
    print(plain(f"{options.output}: run it with springcheck run {options.output}"))
    return 0


def _explain(options: argparse.Namespace) -> int:
    from springcheck import explain

    for line in explain.lines(options.word):
        print(line)
    return 0


def _check(options: argparse.Namespace) -> int:
    from springcheck import store

    findings = store.check(Path(options.file))
    for finding in findings:
        print(plain(f"{options.file}: {finding.place}: {finding.what}"))
    if not findings:
        ended = store.summary(Path(options.file)).complete
        rest = "" if ended else "; unfinished: the command that writes it goes on when it is given again"
        print(f"{options.file}: whole; every digest matches{rest}")
    return 1 if findings else 0


def _export(options: argparse.Namespace) -> int:
    from springcheck import store

    doubts = store.export(Path(options.file), options.label, Path(options.output))
    _warn(options.file, [{"place": one.place, "what": one.what} for one in doubts])
    print(plain(f"{options.output}: {options.label}"))
    return int(bool(doubts))


def _list(options: argparse.Namespace) -> int:
    from springcheck import listing

    found = listing.listing()
    if options.json:
        _document(found)
    else:
        for line in listing.lines(found):
            print(line)
    return 0
