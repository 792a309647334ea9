"""Trajectories that other programs wrote: any H5MD file with positions and velocities."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.arrays import Floats
from springcheck.errors import StoreError
from springcheck.store import files, trust

EXPANSION = 1100
"""More than deflate can expand (1032); an array that claims more than this times the file is damaged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Foreign:
    """One particle group of an H5MD file: t (f,), q and v (f, n, 3), mass (n,) or None.

    `units` has those of q, v, t and mass that the file names; `roundoff` is the unit roundoff of the
    numbers as they were stored (6e-8 for single precision).
    """

    name: str
    t: Floats
    q: Floats
    v: Floats
    mass: Floats | None
    units: Mapping[str, str]
    roundoff: float


def read_foreign(path: str | Path, most: int | None = None) -> dict[str, Foreign]:
    """Particle groups of an H5MD file by name, those that have positions and velocities.

    `most` frames are read, from the first on; None for all.

    Where the two are stored at different steps, the common ones are taken.  Raises StoreError when the
    file is no H5MD, holds no velocities, or is damaged.
    """
    path = Path(path)
    trust.trust(path, trust.FOREIGN)
    return load(path, most)


def load(path: Path, most: int | None = None) -> dict[str, Foreign]:
    """The same in this process, whatever the file does to libhdf5."""
    with files.told(path, "read"), h5py.File(path, "r", locking="best-effort") as file:
        groups = file.get("particles")
        if not isinstance(groups, h5py.Group) or not len(groups):
            raise StoreError(f"{path} has no /particles: it is no H5MD trajectory")
        found = dict(_groups(path, groups, most))
        if not found:
            names = ", ".join(groups)
            raise StoreError(
                f"{path} has no group under /particles with both position and velocity ({names}): "
                "write velocities too, nothing can be told from positions alone"
            )
        return found


def _groups(path: Path, groups: Any, most: int | None) -> Iterator[tuple[str, Foreign]]:
    for name in groups:
        group = groups.get(name)
        if not isinstance(group, h5py.Group) or not {"position", "velocity"} <= set(group):
            continue
        q, v = group["position"], group["velocity"]
        t, rows_q, rows_v = _common(path, name, q, v)
        if most is not None and len(t) > most:
            t, rows_q, rows_v = t[:most], _first(rows_q, most), _first(rows_v, most)
        values = [_values(path, q["value"], rows_q), _values(path, v["value"], rows_v)]
        if values[0].ndim != 3 or values[0].shape != values[1].shape or len(values[0]) == 0:
            raise StoreError(
                f"{path}: position {values[0].shape} and velocity {values[1].shape} of {name} are not "
                "both (frames, particles, dimensions)"
            )
        units = {
            key: _unit(node) for key, node in (("q", q["value"]), ("v", v["value"]), ("t", q.get("time")))
        }
        mass, units["mass"] = _mass(path, group)
        kinds = [q["value"].dtype, v["value"].dtype]
        yield (
            name,
            Foreign(
                name=name,
                t=t,
                q=values[0],
                v=values[1],
                mass=mass,
                units={key: unit for key, unit in units.items() if unit},
                roundoff=max(float(np.finfo(kind).eps) / 2 for kind in kinds),
            ),
        )


def _first(rows: Any, most: int) -> Any:
    """The first rows of a slice or of an index array."""
    return slice(0, most) if isinstance(rows, slice) else rows[:most]


def _values(path: Path, dataset: Any, rows: Any = ()) -> Floats:
    """A dataset, or rows of it, as float64; StoreError where it is none or larger than its file."""
    if not isinstance(dataset, h5py.Dataset) or dataset.dtype.kind not in "fiu":
        raise StoreError(f"{path}: {getattr(dataset, 'name', 'a dataset')} is no array of numbers")
    claimed = dataset.size * dataset.dtype.itemsize
    if claimed > EXPANSION * path.stat().st_size:
        raise StoreError(f"{path} is damaged: {dataset.name} claims {files.readable(claimed)}")
    return np.asarray(dataset[rows], dtype=np.float64)


def _common(path: Path, name: str, q: Any, v: Any) -> tuple[Floats, Any, Any]:
    """Times, and the rows of positions and of velocities that share a step."""
    t = _axis(path, q, "time")
    t_v = _axis(path, v, "time")
    if t.shape == t_v.shape and np.array_equal(t, t_v):
        return t, slice(None), slice(None)
    step, step_v = _axis(path, q, "step"), _axis(path, v, "step")
    _, rows, rows_v = np.intersect1d(step, step_v, return_indices=True)
    if len(rows) == 0:
        raise StoreError(f"{path}: no position and velocity of {name} belong to the same step")
    return t[rows], rows, rows_v


def _axis(path: Path, element: Any, name: str) -> Floats:
    """Time or step of every frame; a scalar means a fixed interval (H5MD 1.1), with an optional offset."""
    if name not in element:
        if name == "time":
            raise StoreError(f"{path}: {element.name} has no time: nothing can be told without it")
        return _axis(path, element, "time")
    values = _values(path, element[name])
    frames = len(element["value"])
    if values.ndim == 0:
        offset = float(np.asarray(element[name].attrs.get("offset", 0)))
        return np.asarray(offset + np.arange(frames) * float(values))
    if values.shape != (frames,):
        raise StoreError(f"{path}: {element.name} has {frames} frames and {name} of shape {values.shape}")
    return values


def _mass(path: Path, group: Any) -> tuple[Floats | None, str]:
    if "mass" not in group:
        return None, ""
    node = group["mass"]
    dataset = node["value"] if isinstance(node, h5py.Group) else node
    values = _values(path, dataset)
    n = group["position"]["value"].shape[1]
    values = values[0] if values.ndim == 2 and len(values) else values
    if values.shape not in {(), (n,)}:
        raise StoreError(f"{path}: mass of {group.name} has shape {values.shape}, not ({n},)")
    return np.broadcast_to(values, (n,)).copy(), _unit(dataset)


def _unit(node: Any) -> str:
    if node is None:
        return ""
    unit = node.attrs.get("unit", node.attrs.get("units", ""))
    return unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
