"""Trajectories of other programs in HDF5: particle groups of H5MD, and arrays of any file by their names."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import Floats, States, fitting, kind
from springcheck.formats.lines import MOST_NUMBERS
from springcheck.formats.numbers import states_of
from springcheck.store import access, apart, checking, layout

MOST_FRAMES = 1 << 21
"""Frames of one particle group that are read, however many it declares."""
DEEPEST = 4
"""Depth of nested groups that are searched."""


def is_foreign(path: str | Path) -> bool:
    """Whether an HDF5 file is no store of ours.  StoreError where it cannot be read."""
    path = Path(path)
    apart.trust(path, __name__)
    with access.for_reading(path) as file:
        return access.attribute(file, "format") not in (layout.FORMAT, *layout.OLDER)


def read_hdf5(path: Path, columns: Sequence[str] = (), most: int | None = None) -> dict[str, States]:
    """The trajectories of an HDF5 file that is no store, by name; of H5MD the first `most` frames.

    Every particle group of H5MD is one: those with velocities, or all where none has velocities.  Elsewhere
    every group with datasets of times and positions is one; or `columns` name the datasets, as
    ``t=run/clock,q=run/x,v=run/dx``.  Raises StoreError where there is none.
    """
    apart.trust(path, __name__)
    if columns:
        wanted = {text.rpartition("=")[2].strip("/") for text in columns}
        names = [text.replace("=/", "=").removeprefix("/") for text in columns]
        found = dict(arrays(path, lambda place: place in wanted))
        return {path.name: states_of(path, found, names)}
    if particles := particle_groups(path, most):
        return {name: states for name, states in particles.items() if states.v is not None} or particles
    groups: dict[str, dict[str, Any]] = {}
    for place, values in arrays(path, lambda place: kind(_name_of(place).rpartition("/")[2]) is not None):
        group, _, name = _name_of(place).rpartition("/")
        groups.setdefault(group, {})[name] = values
    made: dict[str, States] = {}
    refused = []
    for group, values in groups.items():
        try:
            if {"t", "q"} <= {kind(name) for name in values}:
                made[group or path.name] = fitting(path, states_of(path, values))
        except StoreError as error:
            refused.append(error)
    if not made:
        said = (
            f"{path} has no /particles as H5MD has, and no datasets of times, positions and velocities by "
            "their names; give these, as --columns t=clock,q=run/x,v=run/dx"
        )
        raise next(iter(refused), StoreError(said))
    return made


def _name_of(place: str) -> str:
    """Name of the dataset at a path; Octave stores each in a group of its name, as ``t/value``."""
    return place.removesuffix("/value")


def tried(path: Path) -> bytes:
    """Read everything that `read_hdf5` might, in a child process (see `springcheck.store.apart`)."""
    with access.for_reading(path) as file:
        ours = access.attribute(file, "format") in (layout.FORMAT, *layout.OLDER)
    if ours:
        return checking.tried(path)
    for _ in arrays(path, lambda place: True):
        pass
    particle_groups(path)
    return b""


def arrays(path: Path, wanted: Callable[[str], bool]) -> Iterator[tuple[str, Any]]:
    """The arrays at the wanted paths, one by one: in total no more numbers than one trajectory may have.

    In the place of an array that lies in another file, is not numeric or is too large, stands a StoreError
    that says so.
    """
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
    """Paths of the datasets of a file, and of the links to other files."""
    groups = [("", file)]
    for place, _, node in access.walk(file, access.MOST_MEMBERS, DEEPEST):
        if access.is_group(node):
            groups.append((f"{place}/", node))
        elif node is not None:
            yield place
    for place, group in groups:
        inside = {*access.members(group)}
        yield from (place + name for name in group if name not in inside)


def particle_groups(path: Path, most: int | None = None) -> dict[str, States]:
    """The particle groups of an H5MD file that have positions; none without /particles, which is not H5MD.

    Frames are read from the first on, at most `most`, and as many as one trajectory may have positions.
    Where positions and velocities are stored at different steps, the common ones are taken.
    """
    with access.for_reading(path) as file:
        particles = access.find(file, "particles")
        names = access.children(file, "particles") if access.is_group(particles) else []
        found = {name: _states(path, access.find(file, f"particles/{name}"), name, most) for name in names}
    if names and not any(found.values()):
        raise StoreError(f"{path} has no group under /particles with position ({', '.join(names)})")
    return {name: states for name, states in found.items() if states is not None}


def _states(path: Path, group: Any, name: str, most: int | None) -> States | None:
    """The states of a particle group; None where it has no positions."""
    if access.find(group, "position") is None:
        return None
    elements = [x for x in ("position", "velocity") if access.find(group, x) is not None]
    data = [_numbers(path, group, f"{element}/value") for element in elements]
    q = data[0]
    if q.ndim != 3 or not q.size or any(x.shape[1:] != q.shape[1:] for x in data):
        shapes = " and ".join(f"{element} {x.shape}" for element, x in zip(elements, data, strict=True))
        raise StoreError(f"{path}: {shapes} of {name} are not (frames, particles, dimensions)")
    kept = min(MOST_FRAMES, MOST_NUMBERS // int(np.prod(q.shape[1:], dtype=object)))
    if not kept:
        raise StoreError(f"{path}: a frame of {name} has more than {MOST_NUMBERS} numbers")
    axes = [_axis(path, group, x, len(values), kept) for x, values in zip(elements, data, strict=True)]
    (t, step), (t_v, step_v) = axes[0], axes[-1]
    rows = rows_v = np.arange(len(t))
    if not np.array_equal(t, t_v):
        for steps in (step, step_v):
            if len(np.unique(steps)) < len(steps):
                raise StoreError(f"{path}: steps of {name} repeat: which velocities belong to which?")
        _, rows, rows_v = np.intersect1d(step, step_v, return_indices=True)
        if len(rows) == 0:
            raise StoreError(f"{path}: no position and velocity of {name} belong to the same step")
    rows, rows_v = rows[:most], rows_v[:most]
    values = [_rows(x, chosen) for x, chosen in zip(data, (rows, rows_v), strict=False)]
    _not_wrapped(path, group, q.shape[0], rows)
    if (order := _order(path, group, q.shape, rows)) is not None:
        values = [np.take_along_axis(x, order[:, :, None], axis=1) for x in values]
    mass, mass_unit = _mass(path, group, q.shape[1])
    named = {"t": access.find(group, "position/time"), **dict(zip("qv", data, strict=False))}
    units = {key: _unit(node) for key, node in named.items()} | {"mass": mass_unit}
    flat = [x.reshape(len(rows), -1) for x in values]
    return States(
        t=t[rows],
        q=flat[0],
        p=None,
        v=flat[1] if len(flat) > 1 else None,
        mass=mass,
        units={key: unit for key, unit in units.items() if unit},
        roundoff=max(map(_roundoff, data)),
    )


def _roundoff(dataset: Any) -> float:
    """Unit roundoff of numbers as stored: 6e-8 for single precision, a half for integers."""
    return max(2.0**-53, float(np.finfo(dataset.dtype).eps) / 2) if dataset.dtype.kind == "f" else 0.5


def _beside(path: Path, group: Any, element: str, frames: int, rows: Any) -> Any:
    """An element stored with the positions: (f, ...) at their rows, (1, ...) if it is constant, or None."""
    node = access.find(group, element)
    if not access.is_group(node):
        return None if node is None else np.asarray(_numbers(path, group, element)[()], np.float64)[None]
    dataset = _numbers(path, group, f"{element}/value")
    if dataset.shape[:1] != (frames,):
        raise StoreError(f"{path}: {group.name} has {frames} positions, and {element} is {dataset.shape}")
    return _rows(dataset, rows)


def _not_wrapped(path: Path, group: Any, frames: int, rows: Any) -> None:
    """StoreError where images say that positions were wrapped into a box."""
    image = _beside(path, group, "image", frames, rows)
    if image is not None and np.any(image):
        raise StoreError(f"{path}: positions of {group.name} are wrapped into a box; write them unwrapped")


def _order(path: Path, group: Any, shape: tuple[int, ...], rows: Any) -> Any:
    """Index of the first frame's particles in each frame (f, n), by their ids; None where none moves."""
    ids = _beside(path, group, "id", shape[0], rows)
    if ids is None or ids.shape[1:] != shape[1:2] or np.all(ids == ids[:1]):
        return None
    order = np.argsort(ids, axis=1, kind="stable")
    if np.any(np.diff(np.take_along_axis(ids, order, axis=1), axis=0)):
        raise StoreError(f"{path}: particles of {group.name} are not the same in all frames, by their ids")
    return order[:, np.argsort(order[0])]


def _rows(dataset: Any, chosen: Any) -> Floats:
    """Rows of a dataset, read as one slice: libhdf5 takes minutes for single rows."""
    found = np.asarray(dataset[: chosen[-1] + 1], np.float64)
    return found if len(found) == len(chosen) else np.asarray(found[chosen])


def _numbers(path: Path, group: Any, name: str) -> Any:
    """A dataset of numbers; StoreError where it is not numeric, or lies in another file."""
    dataset = access.dataset_at(group, name, packed=True)
    if dataset.dtype.kind not in "fiu":
        raise StoreError(f"{path}: {dataset.name} is no array of numbers")
    return dataset


def _axis(path: Path, group: Any, element: str, frames: int, kept: int) -> tuple[Floats, Floats]:
    """Times and steps of the first `kept` of so many frames; times where it has no steps."""
    if access.find(group, f"{element}/time") is None:
        raise StoreError(f"{path}: {group.name}/{element} has no time, which is needed")
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
    dataset = _numbers(path, group, "mass/value" if access.is_group(node) else "mass")
    per_frame = dataset.ndim == 2 and len(dataset) > 0
    if (dataset.shape[1:] if per_frame else dataset.shape) not in {(), (n,)}:
        raise StoreError(f"{path}: mass of {group.name} has shape {dataset.shape}, not ({n},)")
    values = np.asarray(dataset[0] if per_frame else dataset[()], np.float64)
    return np.broadcast_to(values, (n,)).copy(), _unit(dataset)


def _unit(node: Any) -> str:
    known = {} if node is None else access.attributes(node)
    return str(known.get("unit", known.get("units", "")))
