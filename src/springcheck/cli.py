"""The command line: parses, calls, prints, and answers mistakes with one line and exit status 2.

Heavy modules are imported by the command that needs them: `--help` and `list` import no engine, no
HDF5 and no NumPy that they do not use.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from springcheck import interrupts
from springcheck.errors import SpringcheckError

if TYPE_CHECKING:
    from rich.console import Console, RenderableType

INTERRUPTED = interrupts.STATUS


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status: 0 passed, 1 a verdict failed, 2 a mistake."""
    options = _parser().parse_args(arguments)
    command: Callable[[argparse.Namespace], int] = options.command
    kept = command in KEEPING and getattr(options, "source", None) is None
    what = "what was finished is kept, the same command goes on" if kept else "nothing is kept"
    interrupts.announce(f"interrupted; {what}")
    try:
        return command(options)
    except KeyboardInterrupt:
        return _interrupted(what)
    except Exception as error:
        if interrupts.seen():
            # a library that was interrupted may call it an error of its own
            return _interrupted(what)
        if isinstance(error, SpringcheckError | OSError):
            return _mistake(error)
        raise


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
    parser = argparse.ArgumentParser(
        prog="springcheck",
        description="Simulation engines judged to rounding by a mass on a spring.",
        epilog="Exit status: 0 every verdict passed; 1 some verdict failed; "
        f"2 bad input, or nothing was measured; {INTERRUPTED} interrupted.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="run a scene by every method, compare, store, judge")
    run.add_argument(
        "scene", metavar="SCENE", nargs="?", help="a shipped scene's name, or the path of a scene file"
    )
    _scene_options(run)
    run.add_argument(
        "--from", dest="source", metavar="FILE", help="run a store's trajectories again and compare"
    )
    run.add_argument("--verdicts", action="store_true", help="print every verdict with its reason")
    run.add_argument("--thorough", action="store_true", help="add the experiments: order, reversal, rounding")
    run.set_defaults(command=_run)

    faults = commands.add_parser("faults", help="engines broken on purpose: what sees them, how small")
    faults.add_argument("--json", action="store_true", help="one JSON document on standard output")
    faults.add_argument("--quiet", action="store_true", help="print nothing but mistakes")
    faults.set_defaults(command=_faults)

    precision = commands.add_parser("precision", help="error against run time, down to rounding")
    precision.add_argument("scene", metavar="SCENE", help="a shipped scene's name, or a scene file's path")
    _scene_options(precision)
    precision.add_argument(
        "--budget", type=float, metavar="SECONDS", help="time to spend, shared fairly (default 75)"
    )
    precision.add_argument("--points", action="store_true", help="print every point")
    precision.set_defaults(command=_precision)

    stability = commands.add_parser("stability", help="limits of stability, measured against theory")
    stability.add_argument("scene", metavar="SCENE", help="a shipped scene's name, or a scene file's path")
    _scene_options(stability)
    stability.set_defaults(command=_stability)

    extremes = commands.add_parser("extremes", help="the atlas of extreme cases")
    _scene_options(extremes)
    extremes.add_argument("--quick", action="store_true", help="fewer cells, in about 20 seconds")
    extremes.set_defaults(command=_extremes)

    inspect = commands.add_parser("inspect", help="what is in a store")
    inspect.add_argument("file", metavar="FILE")
    inspect.add_argument("--trajectory", metavar="LABEL", help="print the numbers of one trajectory")
    inspect.add_argument(
        "--rows", type=int, default=20, metavar="N", help="how many frames of it (default 20)"
    )
    inspect.add_argument("--verdicts", action="store_true", help="print every verdict with its reason")
    inspect.add_argument("--json", action="store_true", help="one JSON document on standard output")
    inspect.set_defaults(command=_inspect)

    plot = commands.add_parser("plot", help="draw what is in a store, as PNG and SVG")
    plot.add_argument("file", metavar="FILE")
    plot.add_argument("-o", "--output", metavar="FOLDER", default="figures", help="default: figures")
    plot.add_argument("--quiet", action="store_true", help="print nothing but mistakes")
    plot.set_defaults(command=_plot)

    identify = commands.add_parser("identify", help="which scheme made a trajectory, ours or anyone's")
    identify.add_argument("file", metavar="FILE", nargs="?", help="a store, or any H5MD file with velocities")
    identify.add_argument(
        "--trajectory", metavar="LABEL", help="one trajectory or particle group of the file"
    )
    identify.add_argument("--stiffness", type=float, metavar="K", help="is this the stiffness?")
    identify.add_argument(
        "--mass", type=float, metavar="M", help="mass of every particle, where the file has none"
    )
    identify.add_argument("--step", type=float, metavar="H", help="is this the time step?")
    identify.add_argument(
        "--stepper",
        metavar="MODULE:FUNCTION",
        help="judge a Python function step(q, p, h, force, mass) -> (q, p)",
    )
    identify.add_argument("--json", action="store_true", help="one JSON document on standard output")
    identify.set_defaults(command=_identify)

    check = commands.add_parser("check", help="is a store whole: digests, completeness, structure")
    check.add_argument("file", metavar="FILE")
    check.set_defaults(command=_check)

    export = commands.add_parser("export", help="one trajectory as a file of its own, for other tools")
    export.add_argument("file", metavar="FILE")
    export.add_argument("label", metavar="LABEL")
    export.add_argument("output", metavar="OUT.h5md")
    export.set_defaults(command=_export)

    listing = commands.add_parser("list", help="scenes, engines with their versions, checks")
    listing.add_argument("--json", action="store_true", help="one JSON document on standard output")
    listing.set_defaults(command=_list)
    return parser


def _scene_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", metavar="FILE", help="the store (default: SCENE.h5)")
    parser.add_argument(
        "--method",
        action="append",
        default=[],
        metavar="LABEL",
        help="engine:method[@platform[-precision]] or a glob such as 'own:*'; repeatable",
    )
    parser.add_argument("--force", action="store_true", help="write an existing store anew")
    parser.add_argument("--json", action="store_true", help="one JSON document on standard output")
    parser.add_argument("--quiet", action="store_true", help="print nothing but mistakes")


class _Version(argparse.Action):
    """Reads the version only when it is asked for: importlib.metadata takes longer than the rest."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"springcheck {version('springcheck')}")
        parser.exit()


def _console(quiet: bool = False) -> Console:
    from rich.console import Console

    # in a pipe there is no width to keep to; long lines are for the reader's tools to fold
    return Console(quiet=quiet, highlight=False, soft_wrap=False, width=None if sys.stdout.isatty() else 100)


def _show(lines: Sequence[RenderableType], *, quiet: bool = False) -> None:
    console = _console(quiet)
    if quiet or sys.stdout.isatty():
        for line in lines:
            wide = None if quiet else _wider(line, console)
            (wide or console).print(line)
        return
    with console.capture() as captured:
        for line in lines:
            console.print(line)
    # a table's last column is padded, which a file or a diff need not keep
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def _wider(line: RenderableType, console: Console) -> Console | None:
    """A console for a table of unbroken words that is wider than the terminal, which may fold its rows.

    Drawn in to the terminal's width, its numbers would lose digits and units.
    """
    from rich.console import Console
    from rich.measure import Measurement
    from rich.table import Table

    if not isinstance(line, Table) or not all(column.no_wrap for column in line.columns):
        return None
    needed = Measurement.get(console, console.options.update(max_width=1000), line).maximum
    if needed <= console.width:
        return None
    return Console(highlight=False, width=needed, height=console.height)


def _document(data: Any) -> None:
    print(json.dumps(data, allow_nan=False, indent=2))


def _run(options: argparse.Namespace) -> int:
    from springcheck.physics import scenefile as scenes
    from springcheck.studies.run import measure as session

    if (options.scene is None) == (options.source is None):
        raise SpringcheckError(
            "run needs a SCENE, or --from FILE, and not both; `springcheck list` shows scenes"
        )
    if options.source is not None:
        return _repeat(options)
    scene = scenes.load_scene(options.scene)
    path = Path(options.output or f"{scene.name}.h5")
    with _progress(options) as started:
        found = session.run(
            scene,
            path,
            methods=options.method,
            force=options.force,
            thorough=options.thorough,
            started=started,
        )
    if options.json:
        _document(session.document(found))
    elif not options.quiet:
        from springcheck.studies import text as report

        lines: list[RenderableType] = list(report.run_report(found))
        if options.verdicts:
            lines.append(report.verdicts_table(found.verdicts))
        _show(lines)
    return found.status


def _repeat(options: argparse.Namespace) -> int:
    from springcheck.studies import text as report
    from springcheck.studies.run import measure as session

    with _progress(options) as started:
        found = session.repeat(Path(options.source), methods=options.method, started=started)
    if options.json:
        _document(session.repeat_document(found))
    else:
        _show([report.repeat_line(one) for one in found], quiet=options.quiet)
    return 0 if all(one.equal for one in found) else 1


def _faults(options: argparse.Namespace) -> int:
    from springcheck import engines, simulate
    from springcheck.studies import text as report
    from springcheck.studies.faults.measure import ENGINES, study

    labels = [str(label) for label in engines.match(ENGINES) if engines.absence(label.engine) is None]
    with _progress(options) as started:
        found = study(
            simulate.run, labels, workers=min(2, os.cpu_count() or 1), progress=_filling(started, "faults")
        )
    if options.json:
        _document(found.document())
    else:
        _show(report.fault_report(found), quiet=options.quiet)
    return 0 if found.sound else 1


def _precision(options: argparse.Namespace) -> int:
    from springcheck.physics import scenefile as scenes
    from springcheck.studies import text as report
    from springcheck.studies.precision import measure as precision
    from springcheck.studies.run import measure as session

    budget = precision.BUDGET if options.budget is None else options.budget
    if not (math.isfinite(budget) and budget > 0):
        raise SpringcheckError(f"--budget {budget}: a number of seconds above 0 is needed")
    scene = scenes.load_scene(options.scene)
    labels, left = session.choose(scene, options.method)
    path = Path(options.output or f"{scene.name}-precision.h5")
    with _progress(options) as started:
        found = precision.record(
            scene, labels, path, budget=budget, force=options.force, progress=_filling(started, "precision")
        )
    if options.json:
        _document(found.document())
    else:
        lines = [*report.precision_report(found, points=options.points), *report.left_out(left)]
        _show([*lines, report.plain(f"Stored in {path}")], quiet=options.quiet)
    if found.interrupted:
        return _interrupted("what was finished is kept, the same command goes on")
    return 0 if any(point.complete for point in found.points) else 2


def _stability(options: argparse.Namespace) -> int:
    from springcheck.physics import scenefile as scenes
    from springcheck.studies import text as report
    from springcheck.studies.run.measure import LeftOut
    from springcheck.studies.stability import measure as stability

    scene = scenes.load_scene(options.scene)
    path = Path(options.output or f"{scene.name}-stability.h5")
    with _progress(options) as started:
        found = stability.record(
            scene, path, options.method, force=options.force, progress=_filling(started, "stability")
        )
    if options.json:
        _document(stability.document(found))
    else:
        left = [LeftOut(method=method, reason=reason) for method, reason in found.left_out]
        lines = [*report.stability_report(found), *report.left_out(left)]
        _show([*lines, report.plain(f"Stored in {path}")], quiet=options.quiet)
    return 0 if found.passed else 1


def _extremes(options: argparse.Namespace) -> int:
    from springcheck.studies import text as report
    from springcheck.studies.extremes import measure as extremes
    from springcheck.studies.run.measure import LeftOut

    path = Path(options.output or "extremes.h5")
    with _progress(options) as started:
        found = extremes.record(
            path,
            options.method,
            quick=options.quick,
            force=options.force,
            progress=_filling(started, "extremes"),
        )
    if options.json:
        _document(extremes.document(found))
    else:
        left = [LeftOut(method=method, reason=reason) for method, reason in found.left_out]
        lines = [*report.extremes_report(found), *report.left_out(left)]
        _show([*lines, report.plain(f"Stored in {path}")], quiet=options.quiet)
    return 0 if found.passed else 1


def _filling(started: Any, title: str) -> Callable[..., None] | None:
    """A progress bar that is told how much is done, of how much, and what comes next."""
    if started is None:
        return None
    bar: Callable[..., None] | None = None
    shown = 0.0

    def told(done: float, whole: float, what: str = "") -> None:
        nonlocal bar, shown
        bar = bar or started(title, whole)
        bar(done - shown, f"{title}: {what}" if what else None)
        shown = done

    return told


@contextmanager
def _progress(options: argparse.Namespace) -> Iterator[Any]:
    """Progress bars on a terminal, nothing in a pipe."""
    if options.quiet or not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    bars = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=24),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )

    def started(label: object, whole: float) -> Callable[..., None]:
        task = bars.add_task(str(label), total=whole)
        return lambda done, what=None: bars.update(task, advance=done, description=what)

    with bars:
        yield started


def _inspect(options: argparse.Namespace) -> int:
    from springcheck import inspection

    if options.rows < 1:
        raise SpringcheckError(f"--rows {options.rows}: a number of frames from 1 on is needed")
    found = inspection.look(Path(options.file), trajectory=options.trajectory, rows=options.rows)
    if options.json:
        _document(inspection.document(found))
    else:
        _show(inspection.lines(found, verdicts=options.verdicts))
    return 0


def _identify(options: argparse.Namespace) -> int:
    from springcheck import identify
    from springcheck.identify import files
    from springcheck.studies import text as report

    if (options.file is None) == (options.stepper is None):
        raise SpringcheckError("identify needs a FILE, or --stepper MODULE:FUNCTION, and not both")
    if options.stepper is not None:
        found = {options.stepper: identify.identify_stepper(identify.load_stepper(options.stepper))}
    else:
        stated = {"mass": options.mass, "stiffness": options.stiffness, "step": options.step}
        for name, value in stated.items():
            if value is not None and not (math.isfinite(value) and (value > 0 or name != "mass")):
                raise SpringcheckError(f"--{name} {value}: a finite number is needed, a mass above 0")
        found = {}
        for states in files.read(Path(options.file), options.trajectory):
            try:
                found[states.label] = files.identify_states(states, **stated)
            except SpringcheckError as error:
                raise type(error)(f"{options.file}, {states.label}: {error}") from error
    documents = [{"trajectory": label, **one.document()} for label, one in found.items()]
    if options.json:
        _document(documents[0] if len(documents) == 1 else {"identifications": documents})
    else:
        _show([line for label, one in found.items() for line in report.identification(label, one)])
    return 0 if all(one.fits or one.verdict == "adaptive" for one in found.values()) else 1


def _plot(options: argparse.Namespace) -> int:
    from springcheck import inspection, store
    from springcheck.studies.extremes import figure as extremes
    from springcheck.studies.precision import figure as precision
    from springcheck.studies.run import figure as trajectories
    from springcheck.studies.stability import figure as stability

    path, folder = Path(options.file), Path(options.output)
    summary = store.summary(path)
    studies = inspection.studied(path, summary)
    written: list[Path] = []
    if studies.precision is not None:
        written += precision.draw(studies.precision.document(), folder)
    if studies.stability is not None:
        written += stability.draw(studies.stability, folder)
    if studies.extremes is not None:
        written += extremes.draw(studies.extremes, folder)
    notes: list[str] = []
    if summary.runs or not studies.any:
        found = inspection.drawable(path, summary)
        written += trajectories.draw(found.scene, found.runs, folder, followed=found.followed)
        notes = found.notes
    if not written:
        raise SpringcheckError(f"{path}: nothing was measured in its study that can be drawn")
    if not options.quiet:
        for line in notes:
            print(line)
        for path in written:
            print(path)
    return 0


def _check(options: argparse.Namespace) -> int:
    from springcheck import store

    findings = store.check(Path(options.file))
    for finding in findings:
        print(f"{options.file}: {finding.place}: {finding.what}")
    if not findings:
        ended = store.summary(Path(options.file)).complete
        rest = "" if ended else "; unfinished: the command that writes it goes on when it is given again"
        print(f"{options.file}: whole; every digest matches{rest}")
    return 1 if findings else 0


def _export(options: argparse.Namespace) -> int:
    from springcheck import store

    store.export(Path(options.file), options.label, Path(options.output))
    print(f"{options.output}: {options.label}")
    return 0


def _list(options: argparse.Namespace) -> int:
    from springcheck import catalogue

    found = catalogue.catalogue()
    if options.json:
        _document(found)
    else:
        for line in catalogue.lines(found):
            print(line)
    return 0


KEEPING = (_run, _precision, _stability, _extremes)
"""Commands that keep each piece of their work as it is finished, and take it up again."""
