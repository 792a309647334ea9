"""How trajectories lie in HDF5: H5MD 1.1 for molecular readers, NXdata attributes for silx and H5Web.

::

    /h5md                      version, author, creator, modules/units
    /particles/<label>/        position and velocity (frames, n, 3), mass, species; scenes of particles only
    /observables/<label>/      q, p (frames, n), energy, error (frames,), velocity: {step, time, value}
    /observables/exact/        q, p (frames, n) of the exact solution, where it is known
    /parameters/<label>        attributes: scene, method, versions, machine, outcome, digest
    /comparison /verdicts      tables of one column per dataset
    /digests                   the path of every object and its sha256
    /plots                     NXentry of NXdata; root @default leads there

The numbers are stored once, contiguous, as little-endian float64, and neither compressed nor chunked:
trajectories are noise to gzip (validation/long_runs.py), and a contiguous array is written past
libhdf5 at the speed of the disk.  /particles holds virtual datasets of three dimensions over them; axes along
which nothing moves are a fill value and cost no bytes.  `time` and `step` are hard links to one array each,
and `time` is a dimension scale.  A reduced scene has no units; only /particles names those of H5MD.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

import springcheck
from springcheck.errors import StoreError, plain
from springcheck.physics.arrays import Integers
from springcheck.physics.scene import Scene
from springcheck.store import access, files

FORMAT = "springcheck store 3"
OLDER = ("springcheck store 2",)
"""Format of a store, and of those by older versions that are still read."""
LIBVER = ("v110", "v110")
"""Smaller than the oldest format, with checksums in its structure, and read by h5dump 1.10 and H5Web."""

MARGIN = 1 << 16
"""Bytes reserved beyond the arrays, for groups and attributes."""

RESERVED = (
    "h5md", "particles", "observables", "parameters", "comparison", "verdicts", "documents", "digests",
    "plots",
)  # fmt: skip
QUANTITIES = ("q", "p", "energy")
"""Quantities of a trajectory that may be stored in addition to its times."""
EXACT = "exact"
"""Name of the exact solution among the observables."""
_STRING = h5py.string_dtype("utf-8")

_NAMES = "q", "p", "energy", "velocity", "time", "mass"
_MD = dict(zip(_NAMES, ("nm", "u nm ps-1", "kJ mol-1", "nm ps-1", "ps", "u"), strict=True))
_SI = dict(zip(_NAMES, ("m", "kg m s-1", "J", "m s-1", "s", "kg"), strict=True))
_BARE = dict.fromkeys(_MD, "1")
UNITS = {
    ("particles", "md"): _MD,
    ("particles", "reduced"): _MD,
    ("particles", "si"): _SI,
    ("circuit", "si"): {**_SI, "q": "C", "p": "Wb", "velocity": "A", "mass": "H"},
}
"""Units in /particles by kind and units of the scene; others have none."""
REDUCED = "reduced: the numbers carry no unit; nm, ps, u and kJ/mol stand for 1 in /particles"
ABOUT_GROUPS = (
    "Motion by simulation engines, judged to rounding. observables: q, p and energy of each method, bit for "
    "bit, its error, and the exact solution; particles: the same for readers of H5MD; parameters: how each "
    "was made; verdicts: value, bound and reason of each check; comparison: largest differences of pairs; "
    "digests: sha256 of every object; plots: what viewers draw; documents, and groups by their names: "
    "studies. Read and checked by springcheck"
)
"""The root's attribute `about`."""
HOME_PAGE = ""  # OWNER: the project's address, once there is one; it follows in `about`


class Column(NamedTuple):
    """One array of a trajectory: HDF5 path, bytes per row, dtype."""

    path: str
    shape: tuple[int, ...]
    dtype: str = "<f8"

    @property
    def size(self) -> int:
        """Bytes."""
        return int(np.prod(self.shape, dtype=object)) * np.dtype(self.dtype).itemsize


def check_label(label: str) -> None:
    """Raise StoreError for a label that cannot be the name of a group."""
    if not access.is_name(label) or "/" in label or label in {".", "..", EXACT}:
        raise StoreError(
            f"{label!r} cannot name a trajectory: it is empty, longer than {access.LONGEST_NAME} characters, "
            f"not printable, holds '/', or is one of '.', '..' and {EXACT!r}"
        )


def need_names(trajectories: int) -> None:
    """Raise StoreError for more trajectories than a store can hold."""
    if trajectories > access.MOST_MEMBERS:
        raise StoreError(
            f"{trajectories} trajectories: a store holds at most {access.MOST_MEMBERS}; run fewer methods"
        )


def shape(name: str, frames: int, n: int) -> tuple[int, ...]:
    """The shape of one of the quantities."""
    return (frames, n) if name in ("q", "p") else (frames,)


def columns(label: str, scene: Scene, frames: int) -> dict[str, Column]:
    """The arrays that a trajectory of this scene is made of, by short name."""
    base = f"/observables/{label}"
    found = {x: Column(path=f"{base}/{x}/value", shape=shape(x, frames, scene.n)) for x in scene.quantities}
    if scene.kind == "particles" and np.any(scene.m != 1):
        found["velocity"] = Column(path=f"{base}/velocity/value", shape=found["p"].shape)
    found["time"] = Column(path=f"{base}/q/time", shape=(frames,))
    step = "<i4" if scene.steps < 2**31 else "<i8"
    found["step"] = Column(path=f"{base}/q/step", shape=(frames,), dtype=step)
    return found


def size(scene: Scene) -> int:
    """Bytes that one trajectory of a scene takes."""
    return sum(column.size for column in columns("label", scene, scene.frames).values()) + MARGIN


def write_attributes(node: Any, values: Mapping[str, Any]) -> None:
    """Attributes: strings as variable-length UTF-8, sequences of strings as arrays of them."""
    for name, value in values.items():
        first = value[0] if isinstance(value, list | tuple) and value else value
        kind = _STRING if isinstance(first, str) else None
        node.attrs.create(name, value.replace("\0", "") if isinstance(value, str) else value, dtype=kind)


def begin(file: Any) -> None:
    """The head of every file of ours: /h5md and what it is."""
    write_attributes(file, {"NX_class": "NXroot", "about": f"{ABOUT_GROUPS} {HOME_PAGE}".strip()})
    head = file.create_group("h5md")
    head.attrs["version"] = np.array([1, 1], dtype=np.int32)
    # a user's name need not be UTF-8
    author = plain(os.environ.get("USER") or "unknown", access.LONGEST_NAME)
    write_attributes(head.create_group("author"), {"name": author})
    write_attributes(
        head.create_group("creator"), {"name": "springcheck", "version": springcheck.__version__}
    )
    head.create_group("modules/units").attrs["version"] = np.array([1, 0], dtype=np.int32)


@cache
def _empty() -> bytes:
    """An HDF5 file with its format and nothing else, so that every store begins with the same bytes."""
    with h5py.File("empty", "w", driver="core", backing_store=False, libver=LIBVER) as file:
        write_attributes(file, {"format": FORMAT})
        file.flush()
        return bytes(file.id.get_file_image())


@contextlib.contextmanager
def fresh(path: Path, size: int) -> Iterator[Any]:
    """A new HDF5 file, open for writing, with `size` bytes of the disk reserved beforehand.

    libhdf5 cannot close a file whose last write failed, and crashes the interpreter at its end: so it is
    never the one to find the disk full.
    """
    files.need_space(path, size)
    with path.open("xb") as raw:
        raw.write(_empty())
    with reopened(path, size) as file:
        yield file


@contextlib.contextmanager
def reopened(path: Path, size: int) -> Iterator[Any]:
    """A file of ours, open for writing, with `size` more bytes reserved beforehand."""
    with path.open("rb+") as raw:
        files.reserve(raw, raw.seek(0, os.SEEK_END) + size + MARGIN)
    with h5py.File(path, "r+", libver=LIBVER, locking=False) as file:
        yield file


def skeleton(file: Any, label: str, scene: Scene, found: Mapping[str, Column]) -> dict[str, int]:
    """Create a trajectory's groups and arrays without their numbers -> offset of each array [B]."""
    unit = _BARE if scene.units == "reduced" else UNITS.get((scene.kind, scene.units), _BARE)
    base = file.create_group(f"observables/{label}")
    if scene.units == "reduced":
        write_attributes(base, {"units_are": REDUCED})
    arrays = {name: _contiguous(file, column) for name, column in found.items()}
    axis = {name: arrays[name] for name in ("time", "step")}
    write_unit(axis["time"], unit["time"], "t")
    for name, array in arrays.items():
        if name not in axis:
            as_element(base[name], array.ndim)
            write_unit(array, unit[name], f"{name} of {label}")
            if name != "q":
                base[name].update(axis)
    if scene.kind == "particles":
        _particles(file, label, scene, found, axis)
    return {name: int(array.id.get_offset()) for name, array in arrays.items()}


def as_element(element: Any, dimensions: int) -> None:
    """Say how viewers draw an element: its value, against time."""
    axes = ["time", "."][:dimensions]
    write_attributes(element, {"NX_class": "NXdata", "signal": "value", "axes": axes})
    if dimensions == 2:
        write_attributes(element, {"default_slice": [".", "0"]})


def _contiguous(file: Any, column: Column) -> Any:
    """A dataset whose bytes lie in one piece, not yet written."""
    group, name = column.path.rsplit("/", 1)
    how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    how.set_layout(h5py.h5d.CONTIGUOUS)
    how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    how.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    kind = h5py.h5t.py_create(np.dtype(column.dtype))
    space = h5py.h5s.create_simple(column.shape)
    return h5py.Dataset(h5py.h5d.create(file.require_group(group).id, name.encode(), kind, space, how))


def _particles(
    file: Any, label: str, scene: Scene, found: Mapping[str, Column], axis: Mapping[str, Any]
) -> None:
    """The particle group of a trajectory: views of its observables, at its times and steps."""

    group = file.create_group(f"particles/{label}")
    if scene.units == "reduced":
        # readers of H5MD ask for a unit of time, which the numbers themselves do not have
        column = found["time"]
        view = h5py.VirtualLayout(column.shape, "<f8")
        view[:] = h5py.VirtualSource(".", column.path, column.shape, "<f8")
        axis = {**axis, "time": group.create_group("position").create_virtual_dataset("time", view)}
        write_unit(axis["time"], _MD["time"])
    unit = UNITS.get((scene.kind, scene.units), _BARE)
    rates = "velocity" if "velocity" in found else "p"
    for name, source, quantity in (("position", "q", "q"), ("velocity", rates, "velocity")):
        column, element = found[source], group.require_group(name)
        view = h5py.VirtualLayout((column.shape[0], scene.particles, 3), "<f8")
        numbers = h5py.VirtualSource(".", column.path, column.shape, "<f8")
        for columns_, particles, direction in lines(scene.all_places):
            view[:, particles, direction] = numbers[:, columns_]
        write_unit(element.create_virtual_dataset("value", view, fillvalue=0.0), unit[quantity])
        _on(element, axis)
    write_unit(group.create_dataset("mass", data=scene.masses.astype("<f8")), unit["mass"])
    # no element of the periodic table: a fill value alone, which costs no bytes
    species, frames = group.create_group("species"), len(axis["time"])
    size = (frames, scene.particles)
    species.create_dataset("value", size, "<i4", chunks=(min(frames, 4096), 1), fillvalue=0)
    _on(species, axis)
    box = group.create_group("box")
    box.attrs["dimension"] = 3
    write_attributes(box, {"boundary": ["none"] * 3})


def _on(element: Any, axis: Mapping[str, Any]) -> None:
    element.update({name: one for name, one in axis.items() if name not in element})


def write_unit(dataset: Any, unit: str, name: str = "") -> None:
    """Write the unit under the names of H5MD and of NeXus, and the name that viewers write at an axis."""
    # H5Web adds no unit to a long_name
    named = {"long_name": name if unit == "1" else f"{name} ({unit})"} if name else {}
    write_attributes(dataset, {"unit": unit, "units": unit, **named})


def attach_scales(file: Any) -> None:
    """Attach the times of each element to its values, so that xarray names their dimension."""
    for tree in ("observables", "particles"):
        for label in file.get(tree, ()):
            for element in file[tree][label].values():
                if isinstance(element, h5py.Group) and {"time", "value"} <= set(element):
                    time = element["time"]
                    if not time.is_scale:
                        time.make_scale("time")
                        element["step"].dims[0].attach_scale(time)
                    element["value"].dims[0].attach_scale(time)


def axes_of(scene: Scene) -> str:
    """Axes along which particles move, of all or with commas of each: "x", "xyz", "xy,xyz"."""
    if scene.places is None:
        return "x"
    of, axis = np.divmod(scene.places, 3)
    each = ["".join("xyz"[a] for a in axis[of == i]) for i in range(scene.particles)]
    return each[0] if len(set(each)) == 1 else ",".join(each)


def lines(places: Integers) -> Iterator[tuple[slice, slice, int]]:
    """Slices of columns of (frames, n) that move along one axis, those of their particles, and the axis."""
    for axis in range(3):
        columns = np.flatnonzero(places % 3 == axis)
        steps = np.diff(np.stack([columns, places[columns] // 3]), axis=1)
        cuts = np.flatnonzero(np.any(np.diff(steps, axis=1) != 0, axis=0)) + 2
        for part in np.split(columns, cuts):
            if len(part):
                yield _even(part), _even(places[part] // 3), axis


def _even(index: Integers) -> slice:
    step = int(index[1] - index[0]) if len(index) > 1 else 1
    return slice(int(index[0]), int(index[-1]) + 1, step)
