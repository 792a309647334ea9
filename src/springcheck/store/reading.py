"""Contents of a store: trajectories, tables and texts of a collection and of the parts not yet in it."""

from __future__ import annotations

import contextlib
import hashlib
from collections import UserDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError, nearest
from springcheck.physics.arrays import Floats
from springcheck.physics.trajectory import Comparison, Outcome, Trajectory, Verdict
from springcheck.store import access, digests, files, layout, parts, records, tables
from springcheck.store.access import Scalar
from springcheck.store.parts import Parts, opened
from springcheck.store.records import Run
from springcheck.store.tables import Table

MAPPED = 1 << 26
"""Arrays larger than this [B] are mapped into memory, not read: their pages come when they are used."""
PIECE = 1 << 20
"""Rows of a window by default."""


def sources(path: Path, *, writing: bool = False) -> dict[str, Path]:
    """Label of each trajectory -> the file that holds it, in the order in which they were started; for their
    writer the parts of a journal alone."""
    found = Parts.of(path, writing=writing)
    if not found.everything and not writing:
        with files.told(path, "read"), path.open("rb"):
            pass
    listed: list[tuple[int, str, Path]] = []
    for part in found.runs:
        with opened(part) as file:
            labels = access.children(file, "parameters") if found.complete else [parts.name_of(part)]
            for label in labels:
                group = access.group_at(file, f"parameters/{label}")
                sequence = None if group is None else access.attribute(group, "sequence")
                listed.append((sequence if isinstance(sequence, int) else 0, label, part))
    return {label: source for _, label, source in sorted(listed)}


def run_and_arrays(file: Any, label: str) -> tuple[Run, dict[str, Any]]:
    """A trajectory's metadata and its arrays, validated: time, and those quantities that are recorded."""
    group = access.group_at(file, f"parameters/{label}")
    if group is None:
        raise StoreError(f"{file.filename} holds no trajectory {label!r}")
    run = records.record(f"cannot read {file.filename}, {label}", label, access.attributes(group))
    base = f"observables/{label}"
    found = {"time": access.array(file, f"{base}/q/time", (run.frames,))}
    for name in run.kept:
        shape = layout.shape(name, run.frames, run.particles)
        found[name] = access.array(file, f"{base}/{name}/value", shape)
    return run, found


@contextlib.contextmanager
def _held(path: str | Path, label: str) -> Iterator[tuple[Run, dict[str, Any]]]:
    """Metadata of a trajectory of a store, and its arrays (see `run_and_arrays`)."""
    with opened(source_of(Path(path), label)) as file:
        yield run_and_arrays(file, label)


def _whole(path: Path, dataset: Any) -> Floats:
    size = dataset.size * dataset.dtype.itemsize
    if size > MAPPED:
        offset = dataset.id.get_offset()
        return np.memmap(path, mode="r", dtype=dataset.dtype, offset=offset, shape=dataset.shape)
    values = np.asarray(dataset[()], dtype=np.float64)
    expected = dataset.attrs.get("sha256")
    if expected is not None and hashlib.sha256(np.ascontiguousarray(values).data).hexdigest() != expected:
        raise StoreError(f"cannot read {path}: {dataset.name} is damaged, it does not match its sha256")
    return values


def read(path: str | Path) -> dict[str, Trajectory]:
    """The trajectories of a store by label, checked against their digests.

    Arrays of more than 64 MiB are mapped into memory rather than read, and left to `check`.
    """
    return {label: read_one(source, label) for label, source in sources(Path(path)).items()}


def read_one(path: str | Path, label: str) -> Trajectory:
    """One trajectory of one file."""
    path = Path(path)
    with opened(path) as file:
        run, arrays = run_and_arrays(file, label)
        return records.trajectory(run, {name: _whole(path, x) for name, x in arrays.items()})


def digest(path: str | Path, label: str) -> str:
    """The digest of the numbers of a trajectory as they are now (see `digests.combined`)."""
    with _held(path, label) as (_, arrays), open(arrays["time"].file.filename, "rb") as raw:
        found = {
            name: digests.sha256(raw, x.id.get_offset(), x.size * x.dtype.itemsize)
            for name, x in arrays.items()
        }
        return digests.combined(found, arrays)


def windows(path: str | Path, label: str, rows: int = PIECE, stride: int = 1) -> Iterator[Trajectory]:
    """Split a trajectory into pieces of at most `rows` + 1 frames; consecutive pieces share one frame.

    With a stride only every stride-th piece is read, and the last one.
    """
    with _held(path, label) as (run, arrays):
        starts = range(0, max(1, run.frames - 1), rows)
        for start in sorted({*starts[::stride], starts[-1]}):
            piece = records.trajectory(run, _rows(arrays, slice(start, start + rows + 1)))
            end = start + len(piece.t) - 1
            # a piece ends where it ends; only the last one with what became of the run
            if end < run.frames - 1:
                piece = replace(piece, outcome=Outcome(status="continued", step=end * piece.every))
            yield piece


def strided(path: str | Path, label: str, max_frames: int) -> tuple[Trajectory, int]:
    """Every stride-th frame, at most `max_frames` of them, and the stride."""
    with _held(path, label) as (run, arrays):
        stride = max(1, -(-run.frames // max_frames))
        return records.trajectory(run, _rows(arrays, slice(None, None, stride)), stride), stride


def end(path: str | Path, label: str, rows: int) -> Trajectory:
    """The last `rows` frames of a trajectory."""
    with _held(path, label) as (run, arrays):
        return records.trajectory(run, _rows(arrays, slice(-rows, None)))


def _rows(arrays: Mapping[str, Any], rows: slice) -> dict[str, Floats]:
    return {name: np.asarray(x[slice(*rows.indices(len(x)))], np.float64) for name, x in arrays.items()}


def source_of(path: Path, label: str) -> Path:
    """The file that holds a trajectory of a store; a part of a journal is that file."""
    if path.parent.suffix == files.JOURNAL:
        return path
    found = sources(path)
    if label not in found:
        known = f"{nearest(label, found)}; it has {', '.join(found) or 'none'}"
        raise StoreError(f"{path} holds no trajectory {label!r}{known}")
    return found[label]


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What is in a store.  `complete` is False while a journal of another run stands next to it; size [B]."""

    path: Path
    size: int
    complete: bool
    root: Mapping[str, Scalar]
    runs: tuple[Run, ...]
    tables: tuple[str, ...]
    documents: tuple[str, ...]

    @property
    def listed(self) -> bool:
        """Whether it lists digests of all its objects: an older store has only those of arrays."""
        return self.root.get("format") not in layout.OLDER


def summary(path: str | Path) -> Summary:
    """Contents of a store, at a cost that does not grow with its length."""
    path = Path(path)
    runs = []
    for label, source in sources(path).items():
        with opened(source) as file:
            runs.append(run_and_arrays(file, label)[0])
    found = Parts.of(path)
    root: dict[str, Scalar] = {}
    documents: tuple[str, ...] = ()
    if found.complete:
        with opened(path) as file:
            root, documents = access.attributes(file), tuple(access.children(file, "documents"))
    return Summary(
        path=path,
        size=sum(part.stat().st_size for part in found.everything),
        complete=root.get("complete") is True and parts.claimed_by(path) in (None, root.get("run")),
        root=root,
        runs=tuple(runs),
        tables=tuple(tables_of(path)),
        documents=documents,
    )


def tables_of(path: str | Path) -> Mapping[str, Table]:
    """The tables of a store by name, without comparison and verdicts; each is read on access."""
    found = Parts.of(Path(path))
    if not found.complete:
        return Tables({parts.name_of(part): part for part in found.tables})
    with opened(Path(path)) as file:
        return Tables(dict.fromkeys(tables.names(file), Path(path)))


class Tables(UserDict[str, Any]):
    """Files by the names of the tables that they hold; an item is the table, read from its file."""

    def __getitem__(self, name: str) -> Table:
        with opened(Path(self.data[name])) as file:
            if (group := access.group_at(file, name)) is None:
                raise StoreError(f"{self.data[name]} holds no {name}")
            return tables.read(group, name)


def _has(path: str | Path, name: str) -> bool:
    with opened(Path(path)) as file:
        return access.group_at(file, name) is not None


def verdicts(path: str | Path) -> tuple[Verdict, ...]:
    """The verdicts of a store; none where it has none."""
    name = "verdicts"
    return tables.to_verdicts(Tables({name: path})[name]) if _has(path, name) else ()


def comparison(path: str | Path) -> Comparison | None:
    """The matrix of differences between the trajectories of a store."""
    name = "comparison"
    return tables.to_comparison(Tables({name: path})[name]) if _has(path, name) else None


def document(path: str | Path, name: str) -> str:
    """A text that was stored with `commit`."""
    with opened(Path(path)) as file:
        if name not in access.children(file, "documents"):
            raise StoreError(f"{path} holds no document {name!r}")
        return access.text(file, f"documents/{name}")


def decoded(path: str | Path, name: str) -> Any:
    """A JSON document of a store.  StoreError where it is not JSON, or nested deeper than any of ours."""
    try:
        return access.json(document(path, name))
    except ValueError as error:
        raise StoreError(f"{path}: its document {name} is no JSON: {error}") from error


def scene_text(path: str | Path) -> str:
    """The TOML text of the scene that a store was made from."""
    path = Path(path)
    with opened(path if path.is_file() else next(iter(sources(path).values()), path)) as file:
        known = access.attributes(file)
        if "scene" in known:
            return str(known["scene"])
        for label in access.children(file, "parameters"):
            return run_and_arrays(file, label)[0].scene
    raise StoreError(f"{path} holds no scene")
