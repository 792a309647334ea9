"""Export one trajectory of a store as a store of its own, which MDAnalysis and other readers of H5MD read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
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
    if not out.absolute().parent.is_dir():
        raise StoreError(f"cannot write {out}: there is no folder {out.absolute().parent}")
    if out.suffix != ".h5md":
        raise StoreError(
            f"{out}: the name must end in .h5md; for .csv and .npz use Python: "
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
        if access.group_at(file, f"particles/{label}") is None:
            raise StoreError(f"{path} is an exported trajectory already: copy it")
        # positions and velocities are written twice, the second time in three dimensions
        size = 8 * sum(x.size * (1 + 3 * (x.ndim == 2)) for x in arrays.values()) + 16 * known.frames
        text = 16 * sum(len(str(value)) for value in known.parameters.values())
        root = {"run": os.urandom(16).hex(), "complete": True, "scene": known.scene,
                "scene_name": known.scene_name, "units": known.units}  # fmt: skip
        with files.told(out, "write"), files.unfinished(files.temporary(out)) as made:
            with layout.fresh(made, size + text) as target:
                layout.begin(target)
                layout.write_attributes(target, root)
                for place in (f"parameters/{label}", f"observables/{label}"):
                    target.require_group(place.partition("/")[0])
                    h5py.h5o.copy(file.id, place.encode(), target.id, place.encode())
                base = target[f"observables/{label}"]
                base.pop("error", None)
                _particles(file[f"particles/{label}"], target.create_group("particles/trajectory"), base["q"])
                target.visititems(_detach)
                layout.attach_scales(target)
                extents = digests.write(target)[1]
            for name in digests.broken(made, extents):
                raise StoreError(f"{name} was damaged on its way into {out}: check disk and memory")
            files.put(made, out)
    return found


def _detach(name: str, node: Any) -> None:
    """Remove the references to the dimension scales of the store."""
    for old in digests.SCALES & set(node.attrs):
        del node.attrs[old]


def _particles(source: Any, target: Any, axis: Any) -> None:
    """Copy a particle group, with numbers in the place of views; `axis` has the times and steps."""
    for name in source:
        h5py.h5o.copy(source.id, name.encode(), target.id, name.encode())
    time = source["position/time"]
    for name in ("position", "velocity", "species"):
        element = target[name]
        del element["time"], element["step"]
        element["step"] = axis["step"]
        if not time.is_virtual:
            element["time"] = axis["time"]
        elif name == "position":
            element["time"] = time[()]
            layout.write_attributes(element["time"], access.attributes(time))
        else:
            element["time"] = target["position/time"]
        if name != "species":
            value = _copied(source[name]["value"], element)
            layout.write_attributes(value, access.attributes(source[name]["value"]))


def _copied(source: Any, element: Any) -> Any:
    """Copy (frames, particles, 3) in pieces; axes along which nothing moves keep the fill value."""
    del element["value"]
    frames, particles, _ = source.shape
    rows = max(1, min(frames, CHUNK // (8 * particles)))
    made = element.create_dataset("value", source.shape, "<f8", chunks=(rows, particles, 1), fillvalue=0.0)
    for start in range(0, frames, rows):
        part = np.asarray(source[start : start + rows])
        for axis in np.flatnonzero(part.any(axis=(0, 1))):
            made[start : start + rows, :, axis] = part[:, :, axis]
    return made
