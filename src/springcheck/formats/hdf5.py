"""Trajectories of other programs in HDF5: particle groups of H5MD, and arrays of any file by their names.

In a child process (see `springcheck.store.apart`): what lies in other files is not read, and no more numbers
than one trajectory may have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import MOST_NUMBERS, Floats, States, fitting, kind, named
from springcheck.formats.numbers import states_of
from springcheck.store import access

DEEPEST = 4
"""Depth of nested groups that are searched."""


def read_hdf5(
    path: Path, columns: Sequence[str] = (), step: float | None = None, most: int | None = None
) -> dict[str, States]:
    """The trajectories of an HDF5 file, by name; of H5MD the first `most` frames.

    Every particle group of H5MD is one: those with velocities, or all where none has velocities.  Elsewhere
    every group with datasets of times and positions is one; or `columns` name the datasets, as
    ``t=run/clock,q=run/x,v=run/dx``.  Raises StoreError where there is none.
    """
    with access.for_reading(path) as file:
        if columns:
            wanted = {text.rpartition("=")[2].strip("/") for text in columns}
            names = [text.replace("=/", "=").removeprefix("/") for text in columns]
            found = dict(arrays(file, lambda place: place in wanted))
            return {path.name: states_of(path, found, names, step)}
        if access.is_group(particles := access.find(file, "particles")):
            groups = {name: _states(path, particles[name], most) for name in access.members(particles)}
            known = {name: states for name, states in groups.items() if states is not None}
            if groups and not known:
                raise StoreError(f"{path} has no group under /particles with position ({', '.join(groups)})")
            if known:
                return {name: one for name, one in known.items() if one.v is not None} or known
        return _by_name(path, file, step)


def _by_name(path: Path, file: Any, step: float | None) -> dict[str, States]:
    """The groups whose datasets have names of times and positions, or are a table of pandas."""
    tables: dict[str, dict[str, Any]] = {}
    for place, values in arrays(file, lambda place: kind(_name_of(place).rpartition("/")[2]) is not None):
        group, _, name = _name_of(place).rpartition("/")
        tables.setdefault(group, {})[name] = values
    for place, values in arrays(file, lambda place: place.endswith("_values")):
        names = access.find(file, place.replace("_values", "_items"))
        if names is not None and not isinstance(values, StoreError) and values.ndim == 2:
            heads = [access.scalar(x) for x in names[:1000]]
            tables.setdefault(place.rpartition("/")[0], {}).update(named(path, values, [*map(str, heads)]))
    made: dict[str, States] = {}
    refused = []
    for group, table in tables.items():
        try:
            if "q" in (meant := {kind(name) for name in table}) and ("t" in meant or step is not None):
                made[group or path.name] = fitting(path, states_of(path, table, step=step))
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


def arrays(file: Any, wanted: Callable[[str], bool]) -> Iterator[tuple[str, Any]]:
    """The arrays at the wanted paths, one by one.

    In the place of an array that lies in another file, is not numeric or is too large, stands a StoreError
    that says so.
    """
    left = MOST_NUMBERS
    for place in filter(wanted, _places(file)):
        try:
            dataset = _numbers(file, place)
            left -= dataset.size
            if left < 0:
                raise access.refuse(dataset, f"is one of arrays of more than {MOST_NUMBERS:,} numbers in all")
            yield place, np.asarray(dataset[()])
        except StoreError as error:
            yield place, error


def _places(file: Any) -> Iterator[str]:
    """Paths of the datasets of a file, and of the links to other files."""
    groups = [("", file)]
    for place, _, node in access.walk(file, DEEPEST):
        if access.is_group(node):
            groups.append((f"{place}/", node))
        elif node is not None:
            yield place
    for place, group in groups:
        inside = {*access.members(group)}
        yield from (place + name for name in group if name not in inside)


def _numbers(group: Any, name: str) -> Any:
    """A dataset of numbers; StoreError where it is not numeric, or lies in another file."""
    dataset = access.dataset_at(group, name, packed=True)
    if dataset.dtype.kind not in "fiu":
        raise access.refuse(dataset, "is no array of numbers")
    return dataset


def _states(path: Path, group: Any, most: int | None) -> States | None:
    """The states of a particle group of H5MD; None where it has no positions."""
    elements = [x for x in ("position", "velocity") if access.find(group, x) is not None]
    if "position" not in elements:
        return None
    data = [_numbers(group, f"{element}/value") for element in elements]
    q = data[0]
    if q.ndim != 3 or not q.size or any(x.shape[1:] != q.shape[1:] for x in data):
        shapes = " and ".join(f"{element} {x.shape}" for element, x in zip(elements, data, strict=True))
        raise access.refuse(group, f"has {shapes}, not (frames, particles, dimensions)")
    frames = min(len(data[0]), len(data[-1]), MOST_NUMBERS // int(np.prod(q.shape[1:], dtype=object)))
    frames = frames if most is None else min(frames, most)
    if not frames:
        raise access.refuse(group, f"has more than {MOST_NUMBERS:,} numbers in a frame")
    t, *others = (_times(group, element, frames) for element in elements)
    if any(not np.array_equal(t, other) for other in others):
        raise access.refuse(
            group, "has positions and velocities at different times: write both in each frame"
        )
    values = [np.asarray(x[:frames], np.float64) for x in data]
    if (image := _beside(group, "image", frames)) is not None and np.any(image):
        raise access.refuse(group, "has positions that are wrapped into a box; write them unwrapped")
    ids = _beside(group, "id", frames)
    if ids is not None and ids.shape == (frames, q.shape[1]):
        order = np.argsort(ids, axis=1, kind="stable")
        if np.any(np.diff(np.take_along_axis(ids, order, axis=1), axis=0)):
            raise access.refuse(group, "has other particles in some frames, by their ids")
        # in the order of the first frame
        order = order[:, np.argsort(order[0])]
        values = [np.take_along_axis(x, order[:, :, None], axis=1) for x in values]
    mass = access.find(group, "mass")
    if mass is not None:
        mass = _numbers(group, "mass/value" if access.is_group(mass) else "mass")
    m = (
        None
        if mass is None
        else np.asarray(mass[0] if mass.ndim == 2 and len(mass) else mass[()], np.float64)
    )
    if m is not None and m.shape not in {(), (q.shape[1],)}:
        raise access.refuse(mass, f"has shape {mass.shape}, not ({q.shape[1]},)")
    nodes = {"t": access.find(group, "position/time"), **dict(zip("qv", data, strict=False)), "mass": mass}
    flat = [x.reshape(frames, -1) for x in values]
    return States(
        t=t, q=flat[0], p=None, v=flat[1] if len(flat) > 1 else None,
        mass=None if m is None else np.broadcast_to(m, (q.shape[1],)).copy(),
        units={name: unit for name, node in nodes.items() if (unit := _unit(node))},
        roundoff=max(map(_roundoff, data)),
    )  # fmt: skip


def _roundoff(dataset: Any) -> float:
    """Unit roundoff of numbers as stored: 6e-8 for single precision, a half for integers."""
    return max(2.0**-53, float(np.finfo(dataset.dtype).eps) / 2) if dataset.dtype.kind == "f" else 0.5


def _times(group: Any, element: str, frames: int) -> Floats:
    """Times of the first frames; a scalar is a fixed interval (H5MD 1.1), with an optional offset."""
    if access.find(group, f"{element}/time") is None:
        raise access.refuse(group, f"has no time of its {element}, which is needed")
    dataset = _numbers(group, f"{element}/time")
    if dataset.ndim == 0:
        offset = access.attributes(dataset).get("offset", 0.0)
        if not isinstance(offset, int | float):
            raise access.refuse(dataset, "has an offset that is no number")
        return np.asarray(float(offset) + np.arange(frames) * float(dataset[()]))
    if dataset.ndim != 1 or len(dataset) < frames:
        raise access.refuse(dataset, f"has shape {dataset.shape}, and there are {frames} frames")
    return np.asarray(dataset[:frames], np.float64)


def _beside(group: Any, element: str, frames: int) -> Any:
    """An element stored with the positions, of as many frames; None where there is none that changes."""
    if not access.is_group(access.find(group, element)):
        return None
    return np.asarray(_numbers(group, f"{element}/value")[:frames])


def _unit(node: Any) -> str:
    known = {} if node is None else access.attributes(node)
    return str(known.get("unit", known.get("units", "")))
