"""Trajectories of other programs in HDF5: particle groups of H5MD, and arrays of any file by their names.

In a child process (see `springcheck.store.apart`): what lies in other files is not read, and no more numbers
than one trajectory may have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import MOST_NUMBERS, States, fitting, kind, named
from springcheck.formats.numbers import states_of
from springcheck.store import access

DEEPEST = 4
"""Depth of nested groups that are searched."""
H5MD = "particles/"
MORE = "id", "image"
"""Elements of a particle group: numbers of the particles, and of the boxes that they are in."""


def read_hdf5(
    path: Path, columns: Sequence[str] = (), step: float | None = None, most: int | None = None
) -> dict[str, States]:
    """The trajectories of an HDF5 file, by name: the first `most` frames.

    Every particle group of H5MD is one: those with velocities, or all where none has velocities.  Elsewhere
    every group with datasets of times and positions is one; or `columns` name the datasets, as
    ``t=run/clock,q=run/x,v=run/dx``.  Raises StoreError where there is none.
    """
    with access.for_reading(path) as file:
        if columns:
            wanted = {text.rpartition("=")[2].strip("/") for text in columns}
            names = [text.replace("=/", "=").removeprefix("/") for text in columns]
            found = {place: values for place, values, _ in arrays(file, lambda place: place in wanted)}
            return {path.name: states_of(path, found, names, step)}
        ours = H5MD if access.is_group(access.find(file, H5MD)) else ""
        tables, units = _tables(path, file, ours, most)
    made: dict[str, States] = {}
    refused = []
    for group, table in tables.items():
        meant = {kind(name) for name in table}
        if "q" in meant and ("t" in meant or step is not None):
            try:
                made[group.removeprefix(ours) or path.name] = _states(
                    path, group, table, units.get(group, {}), step
                )
            except StoreError as error:
                refused.append(error)
    if not made:
        said = (
            f"{path} has no datasets of times, positions and velocities by their names, and none as H5MD has "
            "under /particles; give these, as --columns t=clock,q=run/x,v=run/dx"
        )
        raise next(iter(refused), StoreError(said))
    return {name: one for name, one in made.items() if not ours or one.v is not None} or made


def _tables(
    path: Path, file: Any, beginning: str, most: int | None
) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, str]]]:
    """Arrays and their units by their names, of each group; elements of H5MD, and of Octave, are one name."""
    tables: dict[str, dict[str, Any]] = {}
    units: dict[str, dict[str, str]] = {}

    def wanted(place: str) -> bool:
        name = _named(place)[1]
        return place.startswith(beginning) and (
            kind(name) is not None or name in MORE or place[-7:] == "_values"
        )

    for place, values, unit in arrays(file, wanted, most):
        group, name = _named(place)
        table = tables.setdefault(group, {})
        if unit:
            units.setdefault(group, {})[{"m": "mass"}.get(str(kind(name)), str(kind(name)))] = unit
        heads = access.find(file, place.replace("_values", "_items")) if place.endswith("_values") else None
        if heads is not None and not isinstance(values, StoreError) and values.ndim == 2:
            # as pandas stores a table
            table |= named(path, values, [str(access.scalar(x)) for x in heads[:1000]])
        elif name == "time" and "time" in table and not np.array_equal(table["time"], values):
            table["time"] = StoreError(f"{path}: positions and velocities of {group} have different times")
        else:
            table[name] = values
    return tables, units


def _named(place: str) -> tuple[str, str]:
    """Group and name of a dataset: of ``a/position/value`` and ``a/position/time`` the group is a."""
    group, _, name = place.rpartition("/")
    if name == "value" or (name == "time" and kind(group.rpartition("/")[2]) in ("q", "v", "p")):
        above, _, element = group.rpartition("/")
        return above, element if name == "value" else name
    return group, name


def _states(
    path: Path, group: str, table: dict[str, Any], units: dict[str, str], step: float | None
) -> States:
    image, ids = (table.pop(name, None) for name in reversed(MORE))
    if isinstance(image, np.ndarray) and image.ndim > 1 and np.any(image):
        raise StoreError(f"{path}: positions of {group} are wrapped into a box; write them unwrapped")
    if isinstance(ids, np.ndarray) and ids.ndim > 1 and np.any(ids != ids[:1]):
        raise StoreError(f"{path}: particles of {group} change their order; sort them by their ids")
    return fitting(
        path, replace(states_of(path, table, step=step, finite=not group.startswith(H5MD)), units=units)
    )


def arrays(
    file: Any, wanted: Callable[[str], bool], most: int | None = None
) -> Iterator[tuple[str, Any, str]]:
    """The arrays at the wanted paths, one by one, of the first `most` rows, and their units.

    In the place of an array that lies in another file, is not numeric or is too large, stands a StoreError
    that says so.
    """
    left = MOST_NUMBERS
    for place in filter(wanted, _places(file)):
        try:
            dataset = access.dataset_at(file, place, packed=True)
            if dataset.dtype.kind not in "fiu":
                raise access.refuse(dataset, "is no array of numbers")
            frames = dataset.shape[0] if dataset.ndim else 1
            # masses of particles are no frames
            rows = frames if most is None or kind(_named(place)[1]) == "m" else min(frames, most)
            left -= dataset.size // max(frames, 1) * rows
            if left < 0:
                raise access.refuse(dataset, f"is one of arrays of more than {MOST_NUMBERS:,} numbers in all")
            known = access.attributes(dataset)
            values = np.asarray(dataset[:rows] if dataset.ndim else dataset[()])
            element = access.find(file, f"{place.removesuffix('time')}value") if not dataset.ndim else None
            if element is not None and element.ndim:
                # a fixed interval of H5MD 1.1
                frames = min(len(element), most or len(element))
                values = float(known.get("offset", 0)) + np.arange(frames) * float(values)
            yield place, values, str(known.get("unit", known.get("units", "")))
        except StoreError as error:
            yield place, error, ""


def _places(file: Any) -> Iterator[str]:
    """Paths of the datasets of a file, and of the links to other files."""
    groups = [("", file)]
    for place, _, node in access.walk(file, DEEPEST):
        if access.is_group(node):
            groups.append((f"{place}/", node))
        else:
            yield place
    for place, group in groups:
        inside = {*access.members(group)}
        yield from (place + name for name in group if name not in inside)
