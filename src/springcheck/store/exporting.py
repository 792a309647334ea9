"""Export one trajectory of a store as a store of its own, which MDAnalysis and other readers of H5MD read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Integers
from springcheck.store import access, checking, digests, files, layout, parts, reading
from springcheck.store.checking import Damage

CHUNK = 1 << 20
"""Bytes of a chunk of an exported array."""


def export(path: str | Path, label: str, out: str | Path) -> list[Damage]:
    """Write one trajectory as a store whose only particle group is ``/particles/trajectory``, without views.

    MDAnalysis expects that name, and the ending .h5md.  All that is known of the trajectory is copied, so
    that it is identified and judged as in its store.  Returns the damage found elsewhere in the store.
    Raises StoreError for an unknown label, a scene without particles, a path that exists, and a trajectory
    that differs from its digest, of which no clean file is made.
    """
    path, out = Path(path), Path(out)
    if os.path.lexists(out):
        raise StoreError(f"{out} exists: remove it or name another file")
    folder = out.absolute().parent
    if not folder.is_dir():
        raise StoreError(f"cannot write {out}: there is no folder {folder}")
    if out.suffix != ".h5md":
        raise StoreError(
            f"{out}: the name must end in .h5md, readers go by it; .csv and .npz are written in Python, by "
            f"springcheck.read({str(path)!r})[{label!r}].save({str(out)!r})"
        )
    source = reading.source_of(path, label)
    found = checking.check(path)
    for finding in found:
        place = finding.place.partition(": ")[2] or finding.place
        if place.split("/")[1:3] in (["observables", label], ["parameters", label]):
            raise StoreError(f"{path} is not what was written: {place} {finding.what}; nothing is exported")
    with parts.opened(source) as file:
        known, arrays = reading.run_and_arrays(file, label)
        if known.kind != "particles":
            raise StoreError(f"{label} of {path} has no positions to export: its scene has no particles")
        base, group = f"observables/{label}", f"particles/{label}"
        if access.group_at(file, group) is None:
            raise StoreError(f"{path} is an exported trajectory already: copy it")
        places = layout.places_of(known.axes, known.particles)
        if "velocity" in access.children(file, base):
            arrays["velocity"] = access.array(file, f"{base}/velocity/value", arrays["p"].shape)
        arrays["step"] = access.array(file, f"{base}/q/step", (known.frames,), "i")
        mass = access.array(file, f"{group}/mass", (int(np.max(places)) // 3 + 1,))
        # positions and velocities are written twice, the second time in three dimensions
        size = 8 * sum(x.size * (1 + (x.ndim == 2)) for x in arrays.values()) + 16 * known.frames
        text = 16 * sum(len(str(value)) for value in known.parameters.values())
        root = {"run": os.urandom(16).hex(), "complete": True, "scene": known.scene,
                "scene_name": known.scene_name, "units": known.units}  # fmt: skip
        with files.told(out, "write"), files.unfinished(files.temporary(out)) as made:
            with layout.fresh(made, size + text) as target:
                layout.begin(target)
                layout.write_attributes(target, root)
                layout.write_attributes(target.create_group(f"parameters/{label}"), known.parameters)
                axis = _observables(file[base], target.create_group(base), arrays)
                particles = target.create_group("particles/trajectory")
                if known.units == "reduced":
                    axis = {**axis, "time": particles.create_dataset("position/time", data=axis["time"][()])}
                    layout.write_unit(axis["time"], "ps")
                layout.write_particles(
                    particles, layout.UNITS[known.kind, known.units], mass[()], axis, "velocity" in arrays,
                    lambda element, source: _copy_values(arrays[source], element, places),
                )  # fmt: skip
                layout.attach_scales(target)
                extents = digests.write(target)[1]
            for name in digests.broken(made, extents):
                raise StoreError(f"{name} was damaged on its way into {out}: check disk and memory")
            files.put(made, out)
    return found


def _observables(source: Any, target: Any, arrays: dict[str, Any]) -> dict[str, Any]:
    """Copy the recorded arrays with their attributes -> time and step, one array each under many names."""
    layout.write_attributes(target, access.attributes(source))
    axis: dict[str, Any] = {}
    for name in [name for name in arrays if name not in ("time", "step")]:
        element = target.create_group(name)
        layout.write_attributes(element, access.attributes(source[name]))
        h5py.h5o.copy(arrays[name].id, b".", element.id, b"value")
        if axis:
            element.update(axis)
            continue
        for kind in ("time", "step"):
            h5py.h5o.copy(arrays[kind].id, b".", element.id, kind.encode())
            axis[kind] = element[kind]
    for node in [*axis.values(), *(target[name]["value"] for name in target)]:
        # they lead to the scales of the store
        for old in {"REFERENCE_LIST", "DIMENSION_LIST", "CLASS", "NAME"} & set(node.attrs):
            del node.attrs[old]
    return axis


def _copy_values(source: Any, target: Any, places: Integers) -> Any:
    """Copy (frames, n) to its places in (frames, particles, 3), in pieces; the rest keeps the fill value."""
    frames, particles = source.shape[0], int(np.max(places)) // 3 + 1
    rows = max(1, min(frames, CHUNK // (8 * particles)))
    shape = (frames, particles, 3)
    made = target.create_dataset("value", shape, "<f8", chunks=(rows, particles, 1), fillvalue=0.0)
    for start in range(0, frames, rows):
        part = np.asarray(source[start : start + rows])
        for columns, of, axis in layout.lines(places):
            made[start : start + rows, of, axis] = part[:, columns]
    return made
