"""Export one trajectory of a store to a file of its own, for MDAnalysis and other readers of H5MD."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Floats, Integers
from springcheck.store import access, checking, files, layout, parts, reading, space
from springcheck.store.checking import Damage


def export(path: str | Path, label: str, out: str | Path) -> list[Damage]:
    """Write one trajectory as plain H5MD: one group ``/particles/trajectory``, no virtual datasets.

    MDAnalysis expects that name, and the ending .h5md.  Returns the damage found elsewhere in the store.
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
        known, attributes = reading.known_of(file, label)
        if known.kind != "particles" or not {"q", "p"} & set(known.kept):
            raise StoreError(f"{label} of {path} has no positions to export: its scene has no particles")
        base, wide = f"observables/{label}", (known.frames, known.particles)
        places = space.places_of(known.axes, known.particles)
        velocity = "velocity" if "velocity" in access.children(file, base) else "p"
        arrays = {
            element: access.array(file, f"{base}/{name}/value", wide)
            for element, kept, name in (("position", "q", "q"), ("velocity", "p", velocity))
            if kept in known.kept
        }
        first = f"{base}/{known.kept[0]}"
        columns = {
            "time": access.array(file, f"{first}/time", wide[:1]),
            "step": access.array(file, f"{first}/step", wide[:1], "i"),
            "mass": access.array(file, f"particles/{label}/mass", (int(np.max(places)) // 3 + 1,)),
        }
        place = f"particles/{label}/box"
        edges = None
        if "edges" in access.children(file, place):
            edges = access.array(file, f"{place}/edges", (3,))[()]
        with files.told(out, "write"), files.unfinished(files.temporary(out)) as made:
            size = sum(2 * values.size * 8 for values in arrays.values())
            with layout.fresh(made, size + 24 * known.frames) as target:
                layout.begin(target)
                layout.write_attributes(target, {"format": layout.EXPORTED})
                group = target.create_group("particles/trajectory")
                _write(group, arrays, columns, places, layout.UNITS[known.kind, known.units], edges)
                layout.write_attributes(target.create_group("parameters/trajectory"), attributes)
            files.put(made, out)
    return found


def _write(
    group: Any,
    arrays: dict[str, Any],
    columns: dict[str, Any],
    places: Integers,
    unit: layout.UnitsOf,
    edges: Floats | None,
) -> None:
    layout.write_box(group)
    first = next(iter(arrays))
    for name, source in arrays.items():
        element = group.create_group(name)
        _copy_values(source, element, places)
        layout.write_unit(element["value"], unit["q" if name == "position" else "velocity"])
        for kind in ("time", "step"):
            # two elements share them
            element[kind] = group[f"{first}/{kind}"] if name != first else columns[kind][()]
        layout.write_unit(element["time"], unit["time"])
    if edges is not None:
        layout.write_attributes(group["box"], {"boundary": 3 * ["periodic"]})
        # a value for each frame, as MDAnalysis expects
        element = group["box"].create_group("edges")
        element["value"] = np.broadcast_to(edges, (len(columns["time"]), 3))
        layout.write_unit(element["value"], unit["q"])
        for kind in ("time", "step"):
            element[kind] = group[f"{first}/{kind}"]
    group["mass"] = columns["mass"][()]
    layout.write_unit(group["mass"], unit["mass"])


def _copy_values(source: Any, target: Any, places: Integers) -> None:
    """Copy (frames, n) to its places in (frames, particles, 3), in pieces; the rest keeps the fill value."""
    frames, particles = source.shape[0], int(np.max(places)) // 3 + 1
    rows = max(1, min(frames, layout.CHUNK // (8 * particles)))
    shape = (frames, particles, 3)
    made = target.create_dataset("value", shape, "<f8", chunks=(rows, particles, 1), fillvalue=0.0)
    for start in range(0, frames, rows):
        part = np.asarray(source[start : start + rows])
        for columns, of, axis in space.lines(places):
            made[start : start + rows, of, axis] = part[:, columns]
