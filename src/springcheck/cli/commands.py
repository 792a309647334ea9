"""Commands other than studies: their arguments, and what they do.

Heavy modules are imported by the command that needs them.
"""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from springcheck.cli import output
from springcheck.errors import SpringcheckError, plain
from springcheck.studies.arguments import ENGINE, JSON, QUIET, Argument, argument
from springcheck.studies.team import processes


class Command(NamedTuple):
    """A command of the command line."""

    name: str
    about: str
    perform: Callable[[Namespace], int]
    """Carries out the command; returns the exit status."""
    arguments: tuple[Argument, ...]


def _inspect(options: Namespace) -> int:
    from springcheck import store
    from springcheck.cli import inspect

    if options.rows is not None and options.rows < 1:
        raise SpringcheckError(f"--rows {options.rows}: a number of frames from 1 on is needed")
    doubts = output.doubts(options.file)
    summary = store.summary(Path(options.file))
    # all of it is read before anything is printed
    document = inspect.document(summary, options) if options.json else {}
    lines = [] if options.json else inspect.lines(summary, options)
    output.warn(options.file, doubts)
    whole = {"not_trusted": doubts, **document}
    return output.answer(options, lambda: whole, lambda: lines, int(bool(doubts)))


def _plot(options: Namespace) -> int:
    from springcheck import formats
    from springcheck.cli import drawing

    drawing.need_matplotlib()
    path = Path(options.file)
    into = Path(options.output or Path("figures", path.stem))
    if into.suffix in (".png", ".svg", ".pdf") and not into.is_dir():
        raise SpringcheckError(f"-o {into}: a folder is needed, figures have names of their own in it")
    ours = not options.columns and (not path.is_file() or formats.is_store(path))
    if ours and options.step is not None:
        raise SpringcheckError(f"{path}: --step is for files of other programs; a store has its step")
    doubts = output.doubts(options.file) if ours else []
    with output.warned(options.file, doubts):
        if ours and options.trajectory is None:
            written, notes = drawing.draw(path, into, particle=options.particle, x=options.x, y=options.y)
        else:
            which = {"columns": _columns(options), "step": options.step, "trajectory": options.trajectory}
            written, notes = drawing.draw_foreign(path, into, particle=options.particle, **which)
    if not options.quiet:
        print(*map(plain, (*notes, *written)), sep="\n")
    return int(bool(doubts))


def _report(options: Namespace) -> int:
    from springcheck import store
    from springcheck.cli import page

    path = Path(options.file)
    into = Path(options.output or f"{path.stem}.html")
    doubts = store.doubts(path)
    with output.warned(options.file, output.listed(doubts)):
        size = page.write(page.gather(path, doubts), into)
    if not options.quiet:
        print(plain(f"{into}: {size / 1e3:.0f} kB"))
    return int(bool(doubts))


def _show(options: Namespace) -> int:
    from springcheck.physics import scenefile

    text = scenefile.text_of(options.scene)
    if options.output is None:
        sys.stdout.write(text)
        return 0
    from springcheck.store import files

    if os.path.lexists(options.output):
        raise SpringcheckError(f"{options.output} exists: name another file with -o")
    with files.told(Path(options.output), "write"):
        files.put_bytes(text.encode(), Path(options.output))
    print(plain(f"{options.output}: run it with springcheck run {options.output}"))
    return 0


def _explain(options: Namespace) -> int:
    from springcheck.cli import explain
    from springcheck.text.lines import plain as plain_line

    output.show([plain_line(line) for line in explain.lines(options.word)])
    return 0


def _cite(options: Namespace) -> int:
    from springcheck.cli import citing
    from springcheck.text.lines import plain as plain_line

    output.show([plain_line(line) for line in citing.lines(options.store)])
    return 0


def _columns(options: Namespace) -> list[str]:
    return [name.strip() for name in (options.columns or "").split(",") if name.strip()]


def _identify(options: Namespace) -> int:
    from springcheck import schemes
    from springcheck.doors import function
    from springcheck.identify import identify_stepper
    from springcheck.identify.files import titled
    from springcheck.identify.result import identification
    from springcheck.text.lines import plain as plain_line

    if bool(options.files) == (options.integrator is not None):
        raise SpringcheckError("identify needs a FILE, or --stepper FILE.py:FUNCTION, and not both")
    asked = schemes.scheme(options.scheme).name if options.scheme is not None else None
    answers: Iterable[tuple[str, Any]]
    if options.integrator is not None:
        # its own output goes to standard error
        with redirect_stdout(sys.stderr):
            found = {options.integrator: identify_stepper(function.load(options.integrator))}
        answers = [(options.integrator, (found, []))]
    else:
        stated = {name: getattr(options, name) for name in ("mass", "stiffness", "friction", "step")}
        columns = _columns(options)
        look: Callable[..., Any] = _look
        if options.scene is not None:
            look = partial(_look_on, options.scene)
        parts = [partial(look, file, options.trajectory, columns, stated) for file in options.files]
        answers = zip(options.files, _in_order(parts, options.workers), strict=True)
    many = len(options.files) > 1
    documents: list[dict[str, Any]] = []
    statuses: list[int] = []
    for file, answer in answers:
        if isinstance(answer, Exception):
            if not many:
                raise answer
            print(f"springcheck: {answer}", file=sys.stderr)
            documents.append({"file": file, "error": str(answer)})
            statuses.append(2)
            continue
        found, doubts = answer
        output.warn(file, doubts)
        each = [{"trajectory": label, **one.document()} for label, one in found.items()]
        unlike = {label: _unlike(one, asked) for label, one in found.items()} if asked else {}
        for one in each if asked else ():
            one["unlike"] = unlike[one["trajectory"]]
        known = each[0] if len(each) == 1 else {"identifications": each}
        documents.append({**({"file": file} if many else {}), **known, "not_trusted": doubts})
        if not options.json:
            titles = {label: titled(file, label) if many else label for label in found}
            output.show([x for label, one in found.items() for x in identification(titles[label], one)])
            output.show([plain_line(f"{titles[x]}: {y}", "bold red") for x, y in unlike.items() if y])
        fits = all(one.fits or one.undecided or one.verdict == "adaptive" for one in found.values())
        undecided = any(one.undecided for one in found.values())
        statuses.append(1 if doubts or not fits or any(unlike.values()) else 2 if undecided else 0)
    status = 1 if 1 in statuses else max(statuses)
    # the text of each file has already been printed
    return output.answer(options, lambda: {"files": documents} if many else documents[0], list, status)


def _unlike(found: Any, asked: str) -> str:
    """Which scheme the states show instead of the stated one, in a sentence; "" where they may show that."""
    from springcheck.schemes import title

    shown = [x for one in (found, *found.candidates) for x in (one.scheme, *one.aliases) if x]
    if asked in shown or not (shown and found.fits):
        return ""
    return f"these states are not {title(asked)}, but {title(found.scheme or shown[0])}"


def _in_order(parts: Sequence[Callable[[], Any]], workers: int) -> Iterator[Any]:
    """Results of the parts, in their order."""
    from springcheck.studies.team import Processes

    known: dict[int, Any] = {}
    following = 0
    with closing(Processes(min(workers, len(parts))).carried_out(parts)) as found:
        for i, answer in found:
            known[i] = answer
            while following in known:
                yield known.pop(following)
                following += 1


def _look(file: str, trajectory: str | None, columns: list[str], stated: dict[str, float | None]) -> Any:
    """Identifications of a file and its damaged parts, or the reason why it cannot be read."""
    from springcheck import formats
    from springcheck.identify import files

    try:
        with output.readable(file):
            doubts = output.doubts(file) if formats.is_hdf5(Path(file)) else []
            return files.identify_file(Path(file), trajectory, columns, stated), doubts
    except (SpringcheckError, OSError) as error:
        return error


def _look_on(
    scene: str, file: str, trajectory: str | None, columns: list[str], stated: dict[str, float | None]
) -> Any:
    """As `_look`, of a file of a scene, whose force is known."""
    from springcheck import schemes
    from springcheck.cli import taken
    from springcheck.identify.scenes import of_scene
    from springcheck.physics.scenefile import load_scene

    schemes.bring(schemes.UNKNOWN)
    try:
        with output.readable(file):
            path, found = Path(file), load_scene(scene)
            states = taken.states_in(path, columns, stated["step"], trajectory)
            judged, run, notes, _ = taken.as_trajectory(path, states, found, schemes.UNKNOWN.name)
            return {path.name: of_scene(judged, run, notes)}, []
    except (SpringcheckError, OSError) as error:
        return error


def _judge(options: Namespace) -> int:
    from springcheck import formats
    from springcheck.cli import file

    doubts = output.doubts(options.file) if formats.is_hdf5(Path(options.file)) else []
    names = ("scene", "scheme", "step", "trajectory", "differences", "arithmetic", "partial")
    given = {x: getattr(options, x) for x in names}
    found = file.judge(Path(options.file), columns=_columns(options), **given)
    output.warn(options.file, doubts)
    status = found.status or int(bool(doubts))
    lines = partial(found.lines, verdicts=options.verdicts)
    return output.answer(options, lambda: {**found.document(), "not_trusted": doubts}, lines, status)


def _check(options: Namespace) -> int:
    from springcheck import store

    findings = store.check(Path(options.file))
    for finding in findings:
        print(plain(f"{options.file}: {finding.place}: {finding.what}"))
    if not findings:
        found = store.summary(Path(options.file))
        what = "every digest matches" if found.listed else "its arrays match; an older store lists no more"
        rest = "" if found.complete else "; unfinished: give the command that writes it again to resume it"
        print(f"{options.file}: whole; {what}{rest}")
    return 1 if findings else 0


def _export(options: Namespace) -> int:
    from springcheck import store

    doubts = store.export(Path(options.file), options.label, Path(options.output))
    output.warn(options.file, output.listed(doubts))
    print(plain(f"{options.output}: {options.label}"))
    return int(bool(doubts))


def _list(options: Namespace) -> int:
    from springcheck.cli import listing

    found = listing.listing()
    return output.answer(options, lambda: found, lambda: listing.lines(found, options.kind))


def _doctor(options: Namespace) -> int:
    from springcheck.cli import doctor

    with output.alone():
        found = doctor.found()
    status = 0 if any(one["problem"] is None for one in found["engines"]) else 2
    return output.answer(options, lambda: found, lambda: doctor.lines(found), status)


FORMATS = (
    "H5MD, HDF5, NPY, .xlsx, NPZ, Parquet, Feather, MATLAB .mat, JSON, LAMMPS dump, .trr, ASE .traj, "
    ".xyz, text tables; texts also gzipped"
)
"""Formats that `springcheck.formats` reads, which is not imported for this text."""

KINDS = ("scenes", "methods", "checks", "terms", "schemes")
"""Pages of `springcheck list`, by the names in `springcheck.cli.listing`."""

_FILE = argument("file", metavar="FILE")
_GROUP = argument("--trajectory", metavar="LABEL", help="one trajectory or particle group of the file")
_NAMES = argument(
    "--columns", metavar="NAMES", help="names of the columns, as t,q,v (- skips one); of HDF5 t=a,q=b,v=c"
)
_STEPS = argument("--step", "--dt", type=float, metavar="H", help="the time step of a file that counts steps")

COMMANDS = (
    Command("inspect", "print what a store contains", _inspect, (
        _FILE,
        argument("--trajectory", metavar="LABEL",
                 help="print the numbers of one trajectory, first to last frame"),
        argument("--rows", type=int, metavar="N", help="number of frames to print (default 20)"),
        argument("--verdicts", action="store_true", help="print every verdict with its reason"),
        JSON,
        ENGINE,
    )),
    Command("plot", "draw a store, or a trajectory of any program, as PNG and SVG", _plot, (
        _FILE,
        argument("-o", "--output", metavar="FOLDER", help="default: figures/ and the store's name"),
        argument("--particle", type=int, metavar="I",
                 help="draw this particle only, 0 or more (default: all)"),
        argument("--x", metavar="NAME", help="of a study of precision: time, calls, or an error"),
        argument("--y", metavar="NAME", help="the error along y: largest, end, energy or phase"),
        _NAMES,
        _STEPS,
        _GROUP,
        QUIET,
        ENGINE,
    )),
    Command("report", "write a store as one HTML page that checks itself", _report, (
        _FILE,
        argument("-o", "--output", metavar="OUT.html", help="default: the store's name, .html"),
        QUIET,
        ENGINE,
    )),
    Command("show", "print a shipped scene file, to start from", _show, (
        argument("scene", metavar="SCENE"),
        argument("-o", "--output", metavar="MY.toml", help="write it to this new file"),
    )),
    Command("explain", "explain a check, scheme, fault, finding or term", _explain, (
        argument("word", metavar="NAME", help="a check, scheme, engine:method, fault, finding or term"),
        ENGINE,
    )),
    Command("cite", "print what to cite: springcheck, engines, schemes", _cite, (
        argument("store", metavar="FILE", nargs="?", help="a store, whose engines and schemes to cite"),
    )),
    Command("identify", "identify the scheme behind a trajectory of any program", _identify, (
        argument("files", metavar="FILE", nargs="*", help=f"stores, or files of any program: {FORMATS}"),
        _GROUP,
        argument("--stiffness", type=float, metavar="K", help="the stiffness, which is tested"),
        argument("--friction", type=float, metavar="C", help="the c of a friction -c v, which is tested"),
        argument("--mass", type=float, metavar="M",
                 help="mass of every particle in the file's unit (default: the file's)"),
        _NAMES,
        argument("--step", "--dt", type=float, metavar="H", help="the time step, which is tested"),
        argument("--scheme", metavar="NAME", help="the scheme, which is tested"),
        argument("--scene", metavar="SCENE", help="the scene of the trajectory, whose force is used"),
        argument("--stepper", dest="integrator", metavar="FILE.py:FUNCTION",
                  help="judge a Python function step(q, p, h, force, mass) -> (q, p)"),
        argument("--workers", type=processes, default=1, metavar="N",
                  help="number of processes for many files (default 1)"),
        JSON,
    )),
    Command("judge", "judge a trajectory of any program by its scheme", _judge, (
        argument("file", metavar="FILE", help=f"a store, or a file of any program: {FORMATS}"),
        argument("--scene", required=True, metavar="SCENE", help="the scene of the trajectory"),
        argument("--scheme", metavar="NAME", help="the scheme to judge it by (default: the one it shows)"),
        _NAMES,
        _GROUP,
        _STEPS,
        argument("--differences", action="store_true",
                 help="velocities are differences of positions, rounded by eps q/h"),
        argument("--arithmetic", metavar="LABEL",
                 help="judge with the rounding of this method, as openmm:verlet@CUDA-mixed"),
        argument("--partial", action="store_true", help="accept a file that covers a part of the scene"),
        argument("--verdicts", action="store_true", help="print every check with its reason"),
        JSON,
        ENGINE,
    )),
    Command("check", "verify the digests and the structure of a store", _check, (_FILE, ENGINE)),
    Command("export", "export one trajectory for other tools", _export, (
        _FILE, argument("label", metavar="LABEL"), argument("output", metavar="OUT.h5md"),
    )),
    Command("list", "list scenes, methods, checks, terms and schemes", _list, (
        argument("kind", nargs="?", choices=KINDS, help="one page of the list (default: an overview)"),
        JSON,
        ENGINE,
    )),
    Command("doctor", "report what this installation can do, and what is missing", _doctor, (JSON,)),
)  # fmt: skip
"""Every command that is no study, in the order of `--help`."""
