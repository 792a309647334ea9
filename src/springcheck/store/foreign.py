"""Trajectories that other programs wrote: H5MD files, and the arrays of any HDF5 file by their names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Floats
from springcheck.store import access, layout, trust

MOST_NUMBERS = 1 << 24
"""Positions of one particle group that are read [numbers]: frames beyond are left out.  Of arrays by their
names, all together."""
MOST_FRAMES = 1 << 21
"""Frames of one particle group that are looked at, however many it declares."""
DEEPEST = 4
"""Groups in groups that are looked into."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Foreign:
    """One particle group of an H5MD file: t (f,), q and v (f, n, 3), mass (n,) or None; v is None where
    positions stand alone.

    `units` has those of q, v, t and mass that the file names; `roundoff` is the unit roundoff of the
    numbers as they were stored (6e-8 for single precision).
    """

    name: str
    t: Floats
    q: Floats
    v: Floats | None
    mass: Floats | None
    units: Mapping[str, str]
    roundoff: float


def read_foreign(path: str | Path, most: int | None = None, *, alone: bool = False) -> dict[str, Foreign]:
    """Particle groups of an H5MD file by name, those that have positions and velocities; where none has both
    and positions may be `alone`, those that have positions.

    `most` frames are read, from the first on; None for all.

    Where the two are stored at different steps, the common ones are taken.  None are of a file without
    /particles, which is no H5MD.  Raises StoreError when its groups hold no velocities, or are damaged.
    """
    path = Path(path)
    trust.trust(path, trust.FOREIGN)
    return load(path, most, alone=alone)


def load(path: Path, most: int | None = None, *, alone: bool = False) -> dict[str, Foreign]:
    """The same in this process, whatever the file does to libhdf5."""
    with access.for_reading(path) as file:
        is_h5md = isinstance(access.find(file, "particles"), h5py.Group)
        names = access.children(file, "particles") if is_h5md else []
        if not names:
            return {}
        found = dict(_groups(path, file, names, most))
        whole = {name: group for name, group in found.items() if group.v is not None}
        if not (whole or (alone and found)):
            lacks = "position and velocity" if not found else "velocity beside its positions"
            raise StoreError(
                f"{path} has no group under /particles with {lacks} ({', '.join(names)}): write velocities "
                "too; of positions alone `springcheck identify` says what they leave open"
            )
        return whole or found


def tried(path: Path) -> bytes:
    """Read all that could be read of a file, in a process of its own (see `trust`)."""
    for _ in arrays(path, lambda place: True):
        pass
    load(path, alone=True)
    return b""


def is_foreign(path: str | Path) -> bool:
    """Whether an HDF5 file is no store of ours.  StoreError where it cannot be read."""
    path = Path(path)
    trust.trust(path, trust.FOREIGN)
    with access.for_reading(path) as file:
        return access.attribute(file, "format") not in (layout.FORMAT, layout.OLDER)


def read_arrays(path: str | Path, wanted: Callable[[str], bool]) -> dict[str, dict[str, Any]]:
    """Arrays of numbers of an HDF5 file by group and name, those whose path is wanted.

    In the place of one that does not lie in the file, is none of numbers or is too large, stands a StoreError
    that says so.  Raises StoreError where the file cannot be read.
    """
    path = Path(path)
    trust.trust(path, trust.FOREIGN)
    found: dict[str, dict[str, Any]] = {}
    for place, values in arrays(path, wanted):
        group, _, name = place.rpartition("/")
        found.setdefault(group, {})[name] = values
    return found


def arrays(path: Path, wanted: Callable[[str], bool]) -> Iterator[tuple[str, Any]]:
    """Read the wanted arrays one by one, in this process: as many numbers as one trajectory may have."""
    left = MOST_NUMBERS
    with access.for_reading(path) as file:
        for place in filter(wanted, _places(file)):
            try:
                dataset = _numbers(path, file, place)
                if dataset.size > left:
                    raise StoreError(
                        f"{path}: the arrays up to {place} hold more than {MOST_NUMBERS:,} numbers"
                    )
                values = np.asarray(dataset[()])
                left -= dataset.size
                yield place, values
            except StoreError as error:
                yield place, error


def _places(file: Any) -> Iterator[str]:
    """Paths of the datasets of a file, and of the links that lead elsewhere."""
    groups = [("", file)]
    for place, _, node in access.walk(file, access.MOST_MEMBERS, DEEPEST):
        if isinstance(node, h5py.Group):
            groups.append((f"{place}/", node))
        elif isinstance(node, h5py.Dataset):
            yield place
    for place, group in groups:
        inside = {*access.members(group)}
        yield from (place + name for name in group if name not in inside)


def _groups(path: Path, file: Any, names: list[str], most: int | None) -> Iterator[tuple[str, Foreign]]:
    for name in names:
        group = access.find(file, f"particles/{name}")
        if access.find(group, "position") is None:
            continue
        q = _numbers(path, group, "position/value")
        v = q if access.find(group, "velocity") is None else _numbers(path, group, "velocity/value")
        if q.ndim != 3 or q.shape[1:] != v.shape[1:] or not q.size:
            raise _unlike(path, name, q.shape, v.shape)
        kept = min(MOST_FRAMES, MOST_NUMBERS // int(np.prod(q.shape[1:], dtype=object)))
        if not kept:
            raise StoreError(f"{path}: a frame of {name} has more than {MOST_NUMBERS} numbers")
        frames, frames_v = len(q), len(v)
        t, step = _axis(path, group, "position", frames, kept)
        rows = rows_v = np.arange(len(t))
        if v is not q:
            t_v, step_v = _axis(path, group, "velocity", frames_v, kept)
            if not np.array_equal(t, t_v):
                for steps in (step, step_v):
                    if len(np.unique(steps)) < len(steps):
                        raise StoreError(f"{path}: steps of {name} repeat: which velocities belong to which?")
                _, rows, rows_v = np.intersect1d(step, step_v, return_indices=True)
                if len(rows) == 0:
                    raise StoreError(f"{path}: no position and velocity of {name} belong to the same step")
        t, rows, rows_v = t[rows][:most], rows[:most], rows_v[:most]
        values = [_rows(dataset, chosen) for dataset, chosen in ((q, rows), (v, rows_v))]
        values[0] = values[0] + _crossed(path, group, q.shape, rows)
        if (order := _order(path, group, q.shape, rows)) is not None:
            values = [np.take_along_axis(x, order[:, :, None], axis=1) for x in values]
        time = access.find(group, "position/time")
        units = {
            key: _unit(node) for key, node in (("q", q), ("v", v), ("t", time)) if key != "v" or v is not q
        }
        mass, units["mass"] = _mass(path, group, q.shape[1])
        yield (
            name,
            Foreign(
                name=name,
                t=t,
                q=values[0],
                v=None if v is q else values[1],
                mass=mass,
                units={key: unit for key, unit in units.items() if unit},
                roundoff=max(
                    float(np.finfo(kind).eps) / 2 if kind.kind == "f" else 0.5 for kind in (q.dtype, v.dtype)
                ),
            ),
        )


def _beside(path: Path, group: Any, element: str, frames: int, rows: Any) -> Any:
    """An element beside so many positions: (f, ...) at rows of them, (1, ...) without time, or None."""
    node = access.find(group, element)
    if not isinstance(node, h5py.Group):
        return None if node is None else np.asarray(_numbers(path, group, element)[()], np.float64)[None]
    dataset = _numbers(path, group, f"{element}/value")
    if dataset.shape[:1] != (frames,):
        raise StoreError(f"{path}: {group.name} has {frames} positions, and {element} is {dataset.shape}")
    return _rows(dataset, rows)


def _crossed(path: Path, group: Any, shape: tuple[int, ...], rows: Any) -> Any:
    """What borders of a box took off positions: images times its edges, a matrix of rows if triclinic."""
    image = _beside(path, group, "image", shape[0], rows)
    if image is None or not np.any(image):
        return 0.0
    edges = _beside(path, group, "box/edges", shape[0], rows)
    if edges is None or image.shape[1:] != shape[1:] or edges.shape[1:] not in ((d := shape[2:]), (*d, *d)):
        raise StoreError(f"{path}: image of {group.name} does not count borders of its positions' box/edges")
    return image @ edges if edges.ndim == 3 else image * edges[:, None]


def _order(path: Path, group: Any, shape: tuple[int, ...], rows: Any) -> Any:
    """Where the particles of the first frame stand in each (f, n), by their ids; None where none moves."""
    ids = _beside(path, group, "id", shape[0], rows)
    if ids is None or ids.shape[1:] != shape[1:2] or np.all(ids == ids[:1]):
        return None
    order = np.argsort(ids, axis=1, kind="stable")
    if np.any(np.diff(np.take_along_axis(ids, order, axis=1), axis=0)):
        raise StoreError(f"{path}: particles of {group.name} are not the same in all frames, by their ids")
    return order[:, np.argsort(order[0])]


def _unlike(path: Path, name: str, q: tuple[int, ...], v: tuple[int, ...]) -> StoreError:
    return StoreError(
        f"{path}: position {q} and velocity {v} of {name} are not both (frames, particles, dimensions)"
    )


def _rows(dataset: Any, chosen: Any) -> Floats:
    """Rows of a dataset, read as one slice: libhdf5 takes minutes for as many one by one."""
    found = np.asarray(dataset[: chosen[-1] + 1], np.float64)
    return found if len(found) == len(chosen) else np.asarray(found[chosen])


def _numbers(path: Path, group: Any, name: str) -> Any:
    """A dataset of numbers; StoreError where it is none, or does not lie in the file."""
    dataset = access.dataset_at(group, name, packed=True)
    if dataset.dtype.kind not in "fiu":
        raise StoreError(f"{path}: {dataset.name} is no array of numbers")
    return dataset


def _axis(path: Path, group: Any, element: str, frames: int, kept: int) -> tuple[Floats, Floats]:
    """Times and steps of the first `kept` of so many frames; times where it has no steps."""
    if access.find(group, f"{element}/time") is None:
        raise StoreError(f"{path}: {group.name}/{element} has no time: nothing can be told without it")
    there = ["time"] * 2 if access.find(group, f"{element}/step") is None else ["time", "step"]
    t, step = (_column(path, group, element, name, frames, kept) for name in there)
    return t, step


def _column(path: Path, group: Any, element: str, name: str, frames: int, kept: int) -> Floats:
    """Time or step of frames; a scalar means a fixed interval (H5MD 1.1), with an optional offset."""
    dataset = _numbers(path, group, f"{element}/{name}")
    if dataset.ndim == 0:
        offset = access.attributes(dataset).get("offset", 0.0)
        if not isinstance(offset, int | float):
            raise StoreError(f"{path}: offset of {dataset.name} is no number")
        return np.asarray(float(offset) + np.arange(min(frames, kept)) * float(dataset[()]))
    if dataset.shape != (frames,):
        raise StoreError(
            f"{path}: frames of {group.name}/{element}: {frames}, and {name} has shape {dataset.shape}"
        )
    return np.asarray(dataset[:kept], np.float64)


def _mass(path: Path, group: Any, n: int) -> tuple[Floats | None, str]:
    node = access.find(group, "mass")
    if node is None:
        return None, ""
    dataset = _numbers(path, group, "mass/value" if isinstance(node, h5py.Group) else "mass")
    per_frame = dataset.ndim == 2 and len(dataset) > 0
    if (dataset.shape[1:] if per_frame else dataset.shape) not in {(), (n,)}:
        raise StoreError(f"{path}: mass of {group.name} has shape {dataset.shape}, not ({n},)")
    values = np.asarray(dataset[0] if per_frame else dataset[()], np.float64)
    return np.broadcast_to(values, (n,)).copy(), _unit(dataset)


def _unit(node: Any) -> str:
    known = {} if node is None else access.attributes(node)
    return str(known.get("unit", known.get("units", "")))
