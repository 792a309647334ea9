"""The main job: a scene by all its methods, stored as it goes, compared and judged."""

from __future__ import annotations

import json
import os
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from springcheck import checks, driver, engines, processes
from springcheck.engines.contract import Label
from springcheck.errors import EngineError, MethodError, SceneError, SpringcheckError, StoreError
from springcheck.physics import memory
from springcheck.physics.scene import Scene
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import LeftOut, choose
from springcheck.studies.run.changes import changed
from springcheck.studies.run.faulty import FAULT
from springcheck.studies.run.judging import PIECE_NUMBERS, Exact, judge
from springcheck.studies.run.result import Repeat, Repeats, Report, Stored, restored

if TYPE_CHECKING:
    from springcheck.studies.run.faulty import Broken

RUN_BYTES, MORE_BYTES = 2300, 700
"""Peak memory [bytes] of a run for each particle of a chain, and for each further method: as measured for
uniform chains of 60,000 to 1,000,000 masses, rounded down."""


def perform(options: Namespace, progress: Progress | None) -> Report | Repeats:
    """Carry out `springcheck run`."""
    if (options.scene is None) == (options.source is None):
        raise SpringcheckError(
            "run needs a SCENE, or --from FILE, and not both; `springcheck list` shows scenes"
        )
    changes = options.set or {options.step, options.steps, options.temperature, options.friction} != {None}
    if (changes or options.fault) and options.source is not None:
        raise SpringcheckError("--fault and what changes a scene, as --set or --step, goes with one SCENE")
    if options.source is not None:
        return Repeats(repeats=tuple(repeat(Path(options.source), methods=options.method, progress=progress)))
    scene = changed(options)
    path = Path(options.output or f"{scene.name}.h5")
    ours = options.output is None and _holds_runs(path)
    return run(
        scene,
        path,
        methods=["*"] if options.all else options.method,
        force=options.force or ours,
        thorough=options.thorough,
        faults=options.fault,
        progress=progress,
        seed=options.seed,
    )


def _holds_runs(path: Path) -> bool:
    """Whether a file is a store of runs, which under its default name is written anew."""
    try:
        return path.is_file() and bool(keeper.summary(path).runs)
    except SpringcheckError:
        return False


def stored(path: Path) -> Stored:
    """Data of a run that are stored next to its trajectories."""
    # an unfinished run has trajectories in its journal, and no file yet
    if not path.is_file():
        return Stored(path=path, verdicts=(), comparison=None)
    verdicts, comparison = keeper.verdicts(path), keeper.comparison(path)
    found = Stored(path=path, verdicts=verdicts, comparison=comparison)
    if comparison is None or "run" not in keeper.summary(path).documents:
        return found
    try:
        scene = keeper.stored_scene(path)
    except SceneError:
        # one of a subject that springcheck no longer has
        return found
    known = keeper.decoded(path, "run")
    return replace(found, report=restored(path, scene, known, verdicts, comparison))


def run(
    scene: Scene,
    path: str | Path,
    *,
    methods: Sequence[str] = (),
    force: bool = False,
    thorough: bool = False,
    faults: Sequence[str] = (),
    progress: Progress | None = None,
    seed: int | None = None,
) -> Report:
    """Run, compare, store, judge.  Work that an interrupted call has stored is reused.

    `thorough` adds the experiments, whose runs are not stored; `faults` adds engines broken on purpose, as
    NAME or NAME=SIZE; `seed` is that of the random methods, drawn by default. Raises SpringcheckError for all
    errors that a user can correct; finished work then stays in the journal, and an existing file is
    unchanged.  A method that fails next to others is listed under `broke` of their report, which is stored:
    one that was requested, or one of an engine of springcheck that is installed.
    """
    path = Path(path)
    if seed is not None and not scene.bath:
        raise SpringcheckError(
            "--seed goes with a scene that has a bath, which --temperature gives; at 0 K "
            "there is none, and nothing is drawn"
        )
    seeds = {"seed": driver.checked_seed(seed)} if scene.bath else {}
    labels, left, others = choose(scene, methods)
    globs = [one for one in methods if one != engines.UNNAMED]
    requested = engines.match(globs, bath=scene.bath is not None, every=True)
    wrong: list[Broken] = []
    if faults:
        from springcheck.studies.run.faulty import broken

        wrong = [broken(text) for text in dict.fromkeys(faults)]
    keeper.need_names(len(labels) + len(wrong))
    memory.need(
        scene.n * (RUN_BYTES + MORE_BYTES * (len(labels) - 1)),
        f"scene {scene.name}: judging {scene.n} particles by {len(labels)} methods would",
        "fewer particles, or one --method at a time, take less",
    )
    broke: dict[str, str] = {}
    bar = _Bar(progress, len(labels) * (1 + thorough))
    options = [f"{x.label}, {x.about}" for x in wrong] + ([] if seed is None else [f"seed {seed}"])
    command = keeper.command("run", labels, scene.digest, *options)
    with keeper.open_new(path, command, force=force) as journal:
        resumed = journal.finished()
        # each twice: until the store is in its place the parts stay
        many = 2 * (len(labels) + len(wrong)) - len(resumed)
        keeper.need_space(journal.path, keeper.size(scene) * many)
        for label in tuple(labels):
            if str(label) in resumed:
                continue
            try:
                with journal.draft(str(label), scene) as draft:
                    told = bar.of(label, scene.steps)
                    made = driver.play(scene, label, draft.append, progress=told, **seeds)
                    draft.finish(keeper.attributes(made))
            except MethodError as error:
                # this shows only when the engine starts; a method that was requested alone must not vanish
                if len(labels) == 1:
                    raise
                labels.remove(label)
                fails = isinstance(error, EngineError) and (
                    label in requested or engines.origin(label.engine).package == engines.OURS
                )
                if fails or str(label) in methods:
                    broke[str(label)] = str(error)
                else:
                    left.append(LeftOut(method=str(label), reason=str(error)))
        for one in wrong:
            if one.label not in resumed:
                with journal.draft(one.label, scene) as draft:
                    one.play(scene, draft)
        names = (*(str(label) for label in labels), *(one.label for one in wrong))
        sources = journal.finished()
        gathered = Exact(scene, names)
        mine = {name: sources[name] for name in names}
        report = judge(scene, path, mine, left, resumed=[*resumed], gathered=gathered)
        report = replace(report, faults={one.label: one.about for one in wrong}, others=others)
        if thorough:
            tried = checks.experiments_of(scene)
            for label in labels:
                told = bar.of(label, len(tried))
                more = checks.judge_thoroughly(scene, str(label), driver.run, tried, progress=told, **seeds)
                report = replace(report, verdicts=(*report.verdicts, *more))
        report = replace(report, verdicts=tuple(checks.shared(report.verdicts)))
        report = replace(report, broke=broke)
        for table in keeper.reference_of(scene):
            journal.add(table)
        journal.commit(
            scene, comparison=report.comparison, verdicts=report.verdicts, solution=gathered.solution(),
            documents={"run": json.dumps(report.kept_document(), allow_nan=False)},
        )  # fmt: skip
    return report


class _Bar:
    """Progress over several methods, each an equal part of the whole."""

    def __init__(self, progress: Progress | None, parts: int) -> None:
        self._progress, self._parts, self._begun = progress, parts, -1

    def of(self, label: Label, size: int) -> driver.Progress | None:
        """Callback for the progress of the next part, in units of `size` for all of it."""
        if self._progress is None:
            return None
        self._begun += 1
        told, before, done = self._progress, self._begun, 0
        told(before, self._parts, str(label))

        def step(more: int) -> None:
            nonlocal done
            done += more
            told(before + done / size, self._parts, str(label))

        return step


def repeat(path: Path, *, methods: Sequence[str] = (), progress: Progress | None = None) -> list[Repeat]:
    """Run every trajectory of a store again, and report whether the numbers are bitwise the same.

    `methods` are globs of labels.  Raises SpringcheckError where the file or an engine cannot be used.
    """
    known = {run.label: run for run in keeper.summary(path).runs}
    chosen = [label for label in known if not methods or any(fnmatchcase(label, m) for m in methods)]
    if not known:
        raise StoreError(f"{path}: holds no trajectory to run again")
    if not chosen:
        raise StoreError(f"{path}: holds no trajectory {' or '.join(methods)}; it has {', '.join(known)}")
    for name in chosen:
        if name.startswith(f"{FAULT}:"):
            why = "is of an engine broken on purpose, which --from does not run"
            raise StoreError(f"{path}: {name} {why}; name the others with --method")
    scene = keeper.stored_scene(path)
    found = []
    beside = path.absolute().parent
    # beside the store there is space for its repetition, unless that folder is read-only
    place = beside if os.access(beside, os.W_OK) else None
    with processes.folder(dir=place, prefix=".springcheck-") as folder:
        again = folder / "again.h5"
        with keeper.open_new(again, "repeat") as journal:
            bar = _Bar(progress, len(chosen))
            for name in chosen:
                before = known[name].parameters
                label = engines.parse(name)
                quantities = ("q", "p", "energy") if "energy" in known[name].kept else ("q", "p")
                mine = replace(scene, quantities=quantities)
                with journal.draft(name, mine) as draft:
                    told = bar.of(label, scene.steps)
                    seed = _seed(path, name, before.get("origin.seed")) if scene.bath else None
                    record = driver.play(mine, label, draft.append, progress=told, seed=seed)
                    digest = draft.finish(keeper.attributes(record))
                source = journal.finished()[name]
                found.append(
                    Repeat(
                        method=name,
                        equal=digest == keeper.digest(path, name),
                        as_written=digest == before["sha256"],
                        difference=_difference(scene, path, source, name),
                        changed=tuple(
                            f"{key} {was} -> {value}"
                            for key, value in record.origin.items()
                            if (was := before.get("origin." + key)) != value
                        ),
                    )
                )
    return found


def _seed(path: Path, name: str, kept: object) -> int:
    """The seed that a store holds for a random run.  StoreError where it holds none."""
    try:
        return driver.checked_seed(int(str(kept)))
    except (ValueError, MethodError):
        why = f"{path}: {name} cannot be run again: its seed is {kept!r}, and should be a whole number"
        raise StoreError(why) from None


def _difference(scene: Scene, one: Path, other: Path, label: str) -> float:
    norm = scene.system.norm
    worst = 0.0
    rows = max(2, PIECE_NUMBERS // scene.n)
    for a, b in zip_longest(keeper.windows(one, label, rows), keeper.windows(other, label, rows)):
        if a is None or b is None or len(a.t) != len(b.t):
            return float("nan")
        worst = float(np.maximum(worst, np.max(norm(a.q - b.q, a.p - b.p))))
    return worst
