"""`springcheck inspect`: the contents of a store, in bounded memory however long its runs are."""

from __future__ import annotations

import tomllib
from argparse import Namespace
from collections.abc import Iterator
from typing import Any

from springcheck import engines, schemes, store
from springcheck.bath import THERMOSTATS
from springcheck.errors import SpringcheckError
from springcheck.figures.views import Units, units, with_unit
from springcheck.physics.scenefile import left
from springcheck.physics.trajectory import Trajectory
from springcheck.studies import STUDIES, keeper
from springcheck.studies.study import Study, StudyResult
from springcheck.text.lines import Lines, TextTable, plain, table
from springcheck.text.wording import ordinal

OF_RUNS, NOT_VERSIONS = ("outcome", "origin.seed"), ("seed", "threads", "draws")
"""Parameters of each run that are printed, and numbers of its origin that are no versions."""


def held(summary: store.Summary) -> Iterator[tuple[Study, StudyResult]]:
    """The studies of a store with their results.  StoreError where one of them cannot be read."""
    # engines register the schemes that they define
    for run in summary.runs:
        if run.parameters.get("scheme") not in {**schemes.known(), **THERMOSTATS}:
            engines.names(run.label.partition(":")[0])
    for study in STUDIES:
        if study.held(summary):
            yield study, study.stored(summary.path)


def lines(summary: store.Summary, options: Namespace) -> Lines:
    """The store as text.  StoreError where it cannot be read or holds no such trajectory."""
    out: Lines = [plain(f"{summary.path}: {summary.size / 1e6:.3g} MB", "bold")]
    run, stride = _asked_for(summary, options)
    if run is not None:
        of = Units() if _left(summary) else units(keeper.stored_scene(summary.path))
        out += _frames(run, stride, store.end(summary.path, run.label, 1), of)
        if not options.verdicts:
            return out
    if not summary.complete:
        out.append(plain("unfinished: the command that writes it has not ended", "bold red"))
    results = list(held(summary))
    out += [line for study, found in results if study.trajectories for line in study.lines(found, options)]
    if summary.runs:
        known = summary.runs[0].parameters
        out += [
            plain(),
            *_left(summary),
            _runs(summary),
            plain(f"scene {known.get('scene_name')}, units {known.get('units')}", "dim"),
            plain(
                f"{known.get('finished')} on {known.get('host')}: {known.get('processor')}, "
                f"{known.get('cores')} cores, {known.get('system')}",
                "dim",
            ),
            plain(f"versions: {_versions(summary)}; --json has them and the digests of each run", "dim"),
        ]
    for study, result in results:
        if not study.trajectories:
            out += [plain(), *study.lines(result, options, summary.path)]
    return [*out, *[plain()] * bool(summary.tables), *(plain(f"table {x}", "dim") for x in summary.tables)]


def _left(summary: store.Summary) -> Lines:
    """What the scene of a store has and springcheck no longer has, in a line."""
    try:
        reason = left.refusal(tomllib.loads(store.scene_text(summary.path)))
    except (ValueError, SpringcheckError):
        return []
    return [plain(f"  its scene cannot be run or judged here: {reason}", "bold red")] if reason else []


def _asked_for(summary: store.Summary, options: Namespace) -> tuple[Trajectory | None, int]:
    """Evenly spaced frames of the trajectory asked for, and their stride."""
    if options.trajectory is None:
        return None, 1
    return store.strided(summary.path, options.trajectory, 20 if options.rows is None else options.rows)


def _runs(summary: store.Summary) -> TextTable:
    titles = ("trajectory", "frames", "n", "outcome", "seed")
    rows = [
        (run.label, str(run.frames), str(run.particles), *(str(run.parameters.get(x, "")) for x in OF_RUNS))
        for run in summary.runs
    ]
    seeded = any(row[-1] for row in rows)
    return table(titles[: 4 + seeded], [row[: 4 + seeded] for row in rows], left=("trajectory", "outcome"))


def _versions(summary: store.Summary) -> str:
    """Versions of the libraries of all runs, each once."""
    of = ("python", "numpy", "h5py", "hdf5")
    named = {name: str(summary.runs[0].parameters.get(name)) for name in of}
    for run in summary.runs:
        known = {key[7:]: str(x) for key, x in run.parameters.items() if key.startswith("origin.")}
        named |= {
            key: x for key, x in known.items() if x[:1].isdigit() and key not in (*named, *NOT_VERSIONS)
        }
    return ", ".join(f"{name} {version}" for name, version in named.items())


def _frames(run: Trajectory, stride: int, last: Trajectory, of: Units) -> Lines:
    """Table of some frames, and of the last one."""
    n = run.q.shape[1]
    shown = min(n, 3)
    title = f"{run.label}" + (f", every {ordinal(stride)} frame and the last" if stride > 1 else "")
    if n > shown:
        title += f", the first {shown} of {n} particles"
    numbers = range(shown) if n > 1 else [""]
    names = [("t", of.t), *((f"{x}{i}", unit) for x, unit in (("q", of.q), ("p", of.p)) for i in numbers)]
    rows = [
        [repr(float(x)) for x in (t, *q[:shown], *p[:shown])]
        for one in (run, last)
        for t, q, p in zip(one.t, one.q, one.p, strict=True)
    ]
    if rows[-2:-1] == rows[-1:]:
        del rows[-1]
    return [plain(title, "italic"), table([with_unit(*name) for name in names], rows)]


def document(summary: store.Summary, options: Namespace) -> dict[str, Any]:
    """The store as plain data for JSON."""
    documents: dict[str, Any] = {}
    kept: dict[str, Any] = {"verdicts": ()}
    for study, result in held(summary):
        if study.trajectories:
            kept |= result.document()
        else:
            documents[study.name] = result.document()
    run, stride = _asked_for(summary, options)
    shown = run and {"label": run.label, "stride": stride, "t": run.t, "q": run.q, "p": run.p}
    return keeper.document(
        store=summary.path,
        bytes=summary.size,
        complete=summary.complete,
        root=summary.root,
        trajectories=[
            {
                "label": run.label,
                "frames": run.frames,
                "particles": run.particles,
                "quantities": run.kept,
                "parameters": run.parameters,
            }
            for run in summary.runs
        ],
        tables=summary.tables,
        studies=documents,
        **kept,
        trajectory=shown,
    )
