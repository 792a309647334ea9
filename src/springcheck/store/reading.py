"""What is in a store: trajectories, tables and texts of a collection and of the parts not yet in it."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast
from urllib.parse import unquote

import h5py
import numpy as np

from springcheck.arrays import Floats
from springcheck.engines.contract import Arithmetic
from springcheck.errors import StoreError
from springcheck.store import files, layout, tables, trust
from springcheck.store.layout import Scalar
from springcheck.store.tables import Table
from springcheck.trajectory import Comparison, Outcome, Timing, Trajectory, Verdict

MAPPED = 1 << 26
"""Arrays larger than this [B] are mapped into memory, not read: their pages come when they are used."""
PIECE = 1 << 20
"""Rows of a window unless told."""


def parts_folder(path: Path) -> Path:
    """The journal of a store."""
    return path.with_name(path.name + files.JOURNAL)


def claim(parts: Path) -> dict[str, str] | None:
    """Run id and command of a journal, and whether --force began it; None where there is no journal."""
    try:
        found = json.loads((parts / "command").read_bytes())
        forced = "forced" if found.get("forced") else ""
        return {"run": str(found["run"]), "command": str(found["command"]), "forced": forced}
    except FileNotFoundError:
        return None
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise StoreError(f"cannot read {parts / 'command'}: remove it, or start over with --force") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The files that make up a store: the collection, if it belongs to the run, and the parts."""

    collection: Path | None
    parts: list[Path]

    @property
    def collections(self) -> list[Path]:
        """The collection as a list of one or none."""
        return [] if self.collection is None else [self.collection]

    @classmethod
    def of(cls, path: Path, run: str | None) -> Parts:
        """`run` is the writer's; None for a reader, who takes the collection as it is."""
        folder = parts_folder(path)
        known = run
        if known is None:
            with contextlib.suppress(StoreError):
                known = (claim(folder) or {}).get("run")
        own = path.is_file() and (known is None or _run_of(path) == known)
        if run is None and path.is_file() and not own:
            return cls(collection=path, parts=[])
        parts = sorted(folder.glob("*-*.h5")) if known is not None else []
        return cls(collection=path if own else None, parts=parts)


def _run_of(path: Path) -> str:
    try:
        with opened(path) as file:
            return str(file.attrs.get("run", ""))
    except StoreError:
        return ""


@contextlib.contextmanager
def opened(path: Path) -> Iterator[Any]:
    """A file of ours, open for reading, its structure checked against its seal before libhdf5 sees it."""
    trust.trust(path, trust.OURS)
    with files.told(path, "read"), h5py.File(path, "r", locking="best-effort") as file:
        if file.attrs.get("format") == layout.EXPORTED:
            raise StoreError(
                f"{path} is an exported trajectory, no store: identify reads it, and so do readers of H5MD"
            )
        if file.attrs.get("format") != layout.FORMAT:
            raise StoreError(f"cannot read {path}: it is HDF5, but no store of springcheck")
        yield file


def sources(path: Path, run: str | None = None) -> dict[str, Path]:
    """Label of each trajectory -> the file that holds it, in the order in which they were started."""
    found = Parts.of(path, run)
    if found.collection is None and not found.parts and run is None:
        with files.told(path, "read"), path.open("rb"):
            pass
    listed: list[tuple[float, str, Path]] = []
    if found.collection is not None:
        with opened(found.collection) as file:
            listed += [
                (_sequence(file, label), label, found.collection) for label in file.get("parameters", ())
            ]
    known = {label for _, label, _ in listed}
    for part in found.parts:
        kind, label = part.stem.split("-", 1)
        if kind == "run" and unquote(label) not in known:
            with opened(part) as file:
                listed.append((_sequence(file, unquote(label)), unquote(label), part))
    return {label: source for _, label, source in sorted(listed)}


def _sequence(file: Any, label: str) -> float:
    return float(file[f"parameters/{label}"].attrs.get("sequence", 0))


def attributes(trajectory: Trajectory) -> dict[str, Scalar | None]:
    """What `Draft.finish` stores of a trajectory besides its numbers, which are not looked at."""
    a = trajectory.arithmetic
    origin = {f"origin.{key}": value for key, value in trajectory.origin.items()}
    return {
        "method": trajectory.label,
        "scheme": trajectory.scheme,
        "step": trajectory.step,
        "every": trajectory.every,
        "outcome": trajectory.outcome.status,
        "outcome_step": trajectory.outcome.step,
        "outcome_message": trajectory.outcome.message,
        "start_seconds": trajectory.timing.start,
        "run_seconds": trajectory.timing.run,
        "force_calls": trajectory.force_calls,
        "tolerance": trajectory.tolerance,
        "arithmetic": a.name,
        "state_roundoff": a.state,
        "force_roundoff": a.force,
        "force_quantum": a.quantum,
        "force_overflow": a.overflow,
        "parameter_precision": a.parameters,
        "force_excess": a.excess,
        "keeps_displacement": a.keeps_displacement,
        "rebuilds_velocity": trajectory.rebuilds_velocity,
        "off_axis": trajectory.off_axis,
        **origin,
    }


def parameters(file: Any, label: str) -> dict[str, Scalar]:
    """All that is known of a trajectory besides its numbers."""
    group = file.get(f"parameters/{label}")
    if group is None:
        raise StoreError(f"{file.filename} holds no trajectory {label!r}")
    return {str(key): tables.scalar(value) for key, value in group.attrs.items()}


def _trajectory(
    label: str, known: Mapping[str, Any], arrays: Mapping[str, Floats | None], stride: int = 1
) -> Trajectory:
    n = int(known["particles"])
    empty = np.empty((0, n))
    t, q, p = arrays["time"], arrays["q"], arrays["p"]
    assert t is not None
    default = Arithmetic()
    return Trajectory(
        label=label,
        scheme=str(known.get("scheme", "")),
        t=t,
        q=empty if q is None else q,
        p=empty if p is None else p,
        energy=arrays["energy"],
        step=float(known.get("step", np.nan)),
        every=int(known.get("every", 1)) * stride,
        outcome=Outcome(
            status=cast(Any, known.get("outcome", "complete")),
            step=int(known.get("outcome_step", 0)),
            message=str(known.get("outcome_message", "")),
        ),
        timing=Timing(
            start=float(known.get("start_seconds", np.nan)), run=float(known.get("run_seconds", np.nan))
        ),
        force_calls=int(known.get("force_calls", 0)),
        tolerance=float(known["tolerance"]) if "tolerance" in known else None,
        arithmetic=Arithmetic(
            name=str(known.get("arithmetic", default.name)),
            state=float(known.get("state_roundoff", default.state)),
            force=float(known.get("force_roundoff", default.force)),
            quantum=float(known.get("force_quantum", default.quantum)),
            overflow=float(known.get("force_overflow", default.overflow)),
            parameters=cast(Any, known.get("parameter_precision", default.parameters)),
            excess=float(known.get("force_excess", default.excess)),
            keeps_displacement=bool(known.get("keeps_displacement", False)),
        ),
        rebuilds_velocity=bool(known.get("rebuilds_velocity", False)),
        off_axis=float(known["off_axis"]) if "off_axis" in known else None,
        origin={key[7:]: str(value) for key, value in known.items() if key.startswith("origin.")},
    )


def _datasets(file: Any, label: str) -> dict[str, Any]:
    """The arrays of a trajectory: time, and q, p, energy or None."""
    group = file[f"observables/{label}"]
    found = {name: group[name]["value"] if name in group else None for name in ("q", "p", "energy")}
    kept = [name for name, value in found.items() if value is not None]
    if not kept:
        raise KeyError(f"no numbers of {label}")
    return {"time": group[kept[0]]["time"], **found}


def _whole(path: Path, dataset: Any) -> Floats:
    size = dataset.size * dataset.dtype.itemsize
    offset = dataset.id.get_offset()
    if size > MAPPED and offset is not None:
        return np.memmap(path, mode="r", dtype=dataset.dtype, offset=offset, shape=dataset.shape)
    values = np.asarray(dataset[()], dtype=np.float64)
    expected = dataset.attrs.get("sha256")
    if expected is not None and _sha256(values) != expected:
        raise StoreError(f"cannot read {path}: {dataset.name} is damaged, it does not match its sha256")
    return values


def _sha256(values: Floats) -> str:
    return hashlib.sha256(np.ascontiguousarray(values, dtype="<f8").data).hexdigest()


def read(path: str | Path) -> dict[str, Trajectory]:
    """The trajectories of a store by label, checked against their digests.

    Arrays of more than 64 MiB are mapped into memory rather than read, and left to `check`.  Where a
    scene did not ask for q or p, that array has no rows.
    """
    return {label: read_one(source, label) for label, source in sources(Path(path)).items()}


def read_one(path: str | Path, label: str) -> Trajectory:
    """One trajectory of one file."""
    path = Path(path)
    with opened(path) as file:
        known = parameters(file, label)
        arrays = {
            name: None if dataset is None else _whole(path, dataset)
            for name, dataset in _datasets(file, label).items()
        }
        return _trajectory(label, known, arrays)


def windows(path: str | Path, label: str, rows: int = PIECE, stride: int = 1) -> Iterator[Trajectory]:
    """Pieces of a trajectory, at most `rows` + 1 frames each, the first of them the last one's last.

    With a stride only every stride-th piece is read, and the last.
    """
    source = source_of(Path(path), label)
    with opened(source) as file:
        known = parameters(file, label)
        datasets = _datasets(file, label)
        frames = len(datasets["time"])
        starts = range(0, max(1, frames - 1), rows)
        for start in sorted({*starts[::stride], starts[-1]}):
            piece = _trajectory(label, known, _rows(datasets, slice(start, start + rows + 1)))
            end = start + len(piece.t) - 1
            # a piece ends where it ends; only the last one with what became of the run
            if end < frames - 1:
                piece = replace(piece, outcome=Outcome(status="continued", step=end * piece.every))
            yield piece


def strided(path: str | Path, label: str, max_frames: int) -> tuple[Trajectory, int]:
    """Every stride-th frame, at most `max_frames` of them, and the stride."""
    source = source_of(Path(path), label)
    with opened(source) as file:
        known = parameters(file, label)
        datasets = _datasets(file, label)
        stride = max(1, -(-len(datasets["time"]) // max_frames))
        return _trajectory(label, known, _rows(datasets, slice(None, None, stride)), stride), stride


def end(path: str | Path, label: str, rows: int) -> Trajectory:
    """The last `rows` frames of a trajectory."""
    source = source_of(Path(path), label)
    with opened(source) as file:
        return _trajectory(label, parameters(file, label), _rows(_datasets(file, label), slice(-rows, None)))


def _rows(datasets: Mapping[str, Any], rows: slice) -> dict[str, Floats | None]:
    return {
        name: None if dataset is None else np.asarray(dataset[rows], dtype=np.float64)
        for name, dataset in datasets.items()
    }


def source_of(path: Path, label: str) -> Path:
    """The file that holds a trajectory of a store."""
    found = sources(path)
    if label not in found:
        raise StoreError(f"{path} holds no trajectory {label!r}; it has {', '.join(found) or 'none'}")
    return found[label]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A trajectory without its numbers."""

    label: str
    frames: int
    n: int
    quantities: tuple[str, ...]
    parameters: Mapping[str, Scalar]


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What is in a store.  `complete` is False while a journal stands beside it; size [B]."""

    path: Path
    size: int
    complete: bool
    root: Mapping[str, Scalar]
    runs: tuple[Run, ...]
    tables: tuple[str, ...]
    documents: tuple[str, ...]


def summary(path: str | Path) -> Summary:
    """What is in a store, at no cost that grows with its length."""
    path = Path(path)
    found = sources(path)
    runs = []
    for label, source in found.items():
        with opened(source) as file:
            datasets = _datasets(file, label)
            runs.append(
                Run(
                    label=label,
                    frames=len(datasets["time"]),
                    n=int(parameters(file, label)["particles"]),
                    quantities=tuple(name for name in ("q", "p", "energy") if datasets[name] is not None),
                    parameters=parameters(file, label),
                )
            )
    root: dict[str, Scalar] = {}
    documents: tuple[str, ...] = ()
    if path.is_file():
        with opened(path) as file:
            root = {str(key): tables.scalar(value) for key, value in file.attrs.items()}
            documents = tuple(file.get("documents", ()))
    everything = [path] if path.is_file() else []
    everything += [part for part in Parts.of(path, None).parts if part.is_file()]
    return Summary(
        path=path,
        size=sum(part.stat().st_size for part in everything),
        complete=path.is_file() and bool(root.get("complete", False)) and not _is_claimed(path),
        root=root,
        runs=tuple(runs),
        tables=tuple(_tables(path)),
        documents=documents,
    )


def _is_claimed(path: Path) -> bool:
    """Whether a journal stands beside a store; what a kill at its very end has left of one is none."""
    try:
        return claim(parts_folder(path)) is not None
    except StoreError:
        return True


def _tables(path: Path, run: str | None = None) -> dict[str, Path]:
    found = Parts.of(path, run)
    listed: dict[str, Path] = {}
    if found.collection is not None:
        with opened(found.collection) as file:
            listed = dict.fromkeys(tables.names(file), found.collection)
    for part in found.parts:
        kind, name = part.stem.split("-", 1)
        if kind == "table":
            listed[unquote(name)] = part
    return listed


def _table(path: Path, name: str) -> Table:
    with opened(path) as file:
        if name not in file:
            raise StoreError(f"{path} holds no {name}")
        return tables.read(file[name], name)


def read_tables(path: str | Path, run: str | None = None) -> dict[str, Table]:
    """The tables of a store by name, but for comparison and verdicts."""
    return {name: _table(source, name) for name, source in _tables(Path(path), run).items()}


def verdicts(path: str | Path) -> tuple[Verdict, ...]:
    """The verdicts of a store; none where it has none."""
    path = Path(path)
    with opened(path) as file:
        if "verdicts" not in file:
            return ()
    with files.told(path, "read"):
        return tables.to_verdicts(_table(path, "verdicts"))


def comparison(path: str | Path) -> Comparison | None:
    """The matrix of differences between the trajectories of a store."""
    path = Path(path)
    with opened(path) as file:
        if "comparison" not in file:
            return None
    with files.told(path, "read"):
        return tables.to_comparison(_table(path, "comparison"))


def document(path: str | Path, name: str) -> str:
    """A text that was stored with `commit`."""
    with opened(Path(path)) as file:
        if name not in file.get("documents", {}):
            raise StoreError(f"{path} holds no document {name!r}")
        return str(file["documents"][name].asstr()[()])


def scene_text(path: str | Path) -> str:
    """The TOML text of the scene that a store was made from."""
    path = Path(path)
    source = path
    if not path.is_file():
        source = next(iter(sources(path).values()), path)
    with opened(source) as file:
        if "scene" in file.attrs:
            return str(file.attrs["scene"])
        for label in file.get("parameters", ()):
            return str(file[f"parameters/{label}"].attrs["scene"])
    raise StoreError(f"{path} holds no scene")
