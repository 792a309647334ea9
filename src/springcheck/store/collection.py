"""The file of a finished run or study: every part copied, digests compared, what viewers draw added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from springcheck.errors import StoreError
from springcheck.physics.arrays import Floats
from springcheck.store import access, digests, layout, tables
from springcheck.store.access import Scalar
from springcheck.store.tables import Table

_TREES = ("particles", "observables", "parameters")
_INCOMING = "incoming"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """The exact solution at its times t (f,), q and p (f, n), and the error of each trajectory (frames,),
    relative to the norm of the start, by label."""

    t: Floats
    q: Floats
    p: Floats
    errors: Mapping[str, Floats]


def is_ours(file: Any) -> None:
    """StoreError where an open file is no store that can be read."""
    marked = access.attribute(file, "format")
    if marked not in (layout.FORMAT, *layout.OLDER):
        older = isinstance(marked, str) and marked.startswith("springcheck store ")
        why = (
            f"another springcheck wrote it ({marked})" if older else "it is HDF5, but no store of springcheck"
        )
        raise StoreError(f"cannot read {file.filename}: {why}")


def write(
    path: Path,
    parts: Sequence[Path],
    root: Mapping[str, Scalar],
    extra: Sequence[Table],
    documents: Mapping[str, str],
    solution: Solution | None,
) -> None:
    """Write a file of these parts, of further tables and of documents.

    StoreError where something differs from what the parts list.
    """
    arrays = [] if solution is None else [solution.t, solution.q, solution.p, *solution.errors.values()]
    size = sum(part.stat().st_size for part in parts) + sum(x.nbytes for x in arrays)
    size += sum(len(text.encode()) for text in documents.values()) + (1 << 20) + 4096 * len(parts)
    size += 512 * sum(len(column) for table in extra for column in table.columns.values())
    listed: dict[str, str] = {}
    with layout.fresh(path, size) as file:
        layout.begin(file)
        layout.write_attributes(file, root)
        for one in parts:
            with access.opened(one) as part:
                listed |= digests.read(part)
                _take(file, part)
        for table in extra:
            tables.write(file, table)
        for name, text in documents.items():
            made = file.require_group("documents")
            made.create_dataset(name, data=text, dtype=h5py.string_dtype("utf-8"))
        if solution is not None:
            _solution(file, solution)
        layout.attach_scales(file)
        _plots(file)
        found, extents = digests.write(file)
    common = {"/", *(place for place in listed if place.startswith("/h5md") or place.count("/") < 2)}
    wrong = [place for place in listed.keys() - common if found.get(place) != listed[place]]
    for place in [*wrong, *digests.broken(path, extents)]:
        raise StoreError(f"{place} was damaged on its way into {path}: check disk and memory")


def image(root: Mapping[str, Scalar], table: Table) -> bytes:
    """A small file of one table, as bytes."""
    with h5py.File("image", "w", driver="core", backing_store=False, libver=layout.LIBVER) as file:
        layout.begin(file)
        layout.write_attributes(file, {"format": layout.FORMAT, **root})
        tables.write(file, table)
        digests.write(file)
        file.flush()
        return bytes(file.id.get_file_image())


def _take(file: Any, part: Any) -> None:
    """Copy the trajectory or the table of a part.

    One H5Ocopy of the whole part preserves the hard links of time and step; moving links costs nothing.
    """
    h5py.h5o.copy(part.id, b".", file.id, _INCOMING.encode())
    incoming = file[_INCOMING]
    for tree in _TREES:
        for label in incoming.get(tree, ()):
            file.require_group(tree)
            file.move(f"{_INCOMING}/{tree}/{label}", f"{tree}/{label}")
    for name in tables.names(incoming):
        if "/" in name:
            file.require_group(name.rpartition("/")[0])
        file.move(f"{_INCOMING}/{name}", name)
    del file[_INCOMING]


def _solution(file: Any, solution: Solution) -> None:
    """The exact solution among the observables, and the error of each trajectory there."""
    first = file["observables"][next(iter(solution.errors))]
    exact = file["observables"].create_group(layout.EXACT)
    if "units_are" in first.attrs:
        layout.write_attributes(exact, {"units_are": layout.REDUCED})
    for name, values in (("q", solution.q), ("p", solution.p)):
        unit = first[name]["value"].attrs["unit"]
        _element(exact, name, values, unit)
    steps = [file["observables"][label]["q/step"] for label in solution.errors]
    step = next(one for one in steps if len(one) == len(solution.t))
    exact["q"].create_dataset("time", data=solution.t)
    layout.write_unit(exact["q/time"], first["q/time"].attrs["unit"], "t")
    h5py.h5o.copy(step.id, b".", exact["q"].id, b"step")
    exact["p"].update({"time": exact["q/time"], "step": exact["q/step"]})
    for label, values in solution.errors.items():
        run = file["observables"][label]
        _element(run, "error", values, "1")
        run["error"].update({"time": run["q/time"], "step": run["q/step"]})


def _element(group: Any, name: str, values: Floats, unit: str) -> None:
    element = group.create_group(name)
    element.create_dataset("value", data=values)
    layout.as_element(element, values.ndim)
    layout.write_unit(element["value"], unit, f"{name} of {group.name.rpartition('/')[2]}")


def _plots(file: Any) -> None:
    """/plots: the first particle's q (or p), the energies, of all runs of the most common length."""
    observables = file.get("observables", {})
    drawn = next((name for name in tables.names(file) if "signal" in file[name].attrs), None)
    if not observables and drawn is None:
        return
    plots = file.create_group("plots")
    runs = {
        label: file[f"parameters/{label}"].attrs.get("sequence", 0) for label in file.get("parameters", ())
    }
    order = {label: observables[label] for label in sorted(runs, key=lambda label: runs[label])}
    made = [name for name in ("q", "p", "energy") if _plot(order, plots, name)]
    if drawn is not None and not made:
        made = [drawn.replace("/", " ")]
        plots[made[0]] = h5py.SoftLink(f"/{drawn}")
    layout.write_attributes(plots, {"NX_class": "NXentry", "default": made[0]})
    layout.write_attributes(file, {"default": "plots"})


def _plot(runs: Mapping[str, Any], plots: Any, name: str) -> bool:
    values = {label: run[name]["value"] for label, run in runs.items() if name in run}
    if not values:
        return False
    frames = max(map(len, values.values()))
    curves = [label for label, value in values.items() if len(value) == frames]
    group = plots.create_group(name)
    title = {"q": "q of the first particle", "p": "p of the first particle", "energy": "total energy"}[name]
    layout.write_attributes(group, {"NX_class": "NXdata", "signal": curves[0], "axes": ["time"]})
    group.create_dataset("title", data=title, dtype=h5py.string_dtype("utf-8"))
    if len(curves) > 1:
        layout.write_attributes(group, {"auxiliary_signals": curves[1:]})
    group["time"] = h5py.SoftLink(f"{values[curves[0]].parent.name}/time")
    for label in curves:
        value = values[label]
        if value.ndim == 1:
            group[label] = h5py.SoftLink(value.name)
            continue
        view = h5py.VirtualLayout((frames,), "<f8")
        view[:] = h5py.VirtualSource(".", value.name, value.shape, "<f8")[:, 0]
        shown = {key: value.attrs[key] for key in ("units", "long_name")}
        layout.write_attributes(group.create_virtual_dataset(label, view), shown)
    return True
