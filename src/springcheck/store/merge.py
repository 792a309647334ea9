"""Merge parts into one store: copy every object, compare digests, seal the result."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.store import access, adopt, digests, files, layout, pieces, seal, tables
from springcheck.store.access import Scalar
from springcheck.store.parts import Parts
from springcheck.store.tables import Table

_TREES = ("particles", "observables", "parameters")
_INCOMING = "incoming"


def collection(
    path: Path, found: Parts, root: Mapping[str, Scalar], extra: Sequence[Table], documents: Mapping[str, str]
) -> None:
    """Write a sealed file of everything in `found`, of the tables in `extra` and of the documents.

    The largest part, if it is large, is renamed to `path` instead of copied (see `adopt`).
    """
    base = adopt.choice(found.runs)
    sources = [part for part in found.runs if part != base]
    total = sum(source.stat().st_size for source in (*sources, *found.tables))
    text = sum(len(document.encode()) for document in documents.values())
    margin = (1 << 20) + text + 1024 * len(sources)
    margin += 512 * sum(np.asarray(column).size for table in extra for column in table.columns.values())
    if base is None:
        kept: tuple[seal.Extent, ...] = ()
        made = layout.fresh(path, total + margin)
    else:
        files.need_space(path, total + margin)
        kept = adopt.adopt(base, path)
        made = layout.reopened(path, total + margin)
    with made as file:
        if base is None:
            layout.begin(file)
        file.attrs.pop("part", None)
        layout.write_attributes(file, root)
        for source in sources:
            with access.opened(source) as part:
                _take(file, part)
        by: list[tuple[str, pieces.Worker]] = []
        for table in pieces.joined(found.tables, by):
            tables.write(file, table)
            _compare(file[table.name], table)
        for table in (*extra, *pieces.provenance(by)):
            tables.write(file, table)
        for name, document in documents.items():
            file.require_group("documents").create_dataset(
                name, data=document, dtype=h5py.string_dtype("utf-8")
            )
        _plots(file)
        extents = list_digests(file)
    seal_checked(path, extents, str(root["run"]), kept)


def list_digests(file: Any) -> list[seal.Extent]:
    """Write the list of digests into a complete collection -> its recorded arrays."""
    listed, extents = digests.contents(file)
    layout.write_attributes(file, {digests.KEY: json.dumps(listed, separators=(",", ":"))})
    return extents


def seal_checked(
    path: Path, extents: Iterable[seal.Extent], run: str, kept: Iterable[seal.Extent] = ()
) -> None:
    """Seal a collection.  StoreError where an array, those that it `kept` aside, differs from its sha256."""
    there = {(extent.offset, extent.sha256) for extent in kept}
    copied = [extent for extent in extents if (extent.offset, extent.sha256) not in there]
    for name in seal.broken(path, copied):
        raise StoreError(f"{name} was damaged on its way into {path}: check disk and memory")
    seal.attach(path, extents, run)


def image(root: Mapping[str, Scalar], content: Iterable[Table]) -> bytes:
    """A small sealed file of tables, as bytes."""
    with h5py.File("image", "w", driver="core", backing_store=False, libver=layout.LIBVER) as file:
        layout.begin(file)
        layout.write_attributes(file, {"format": layout.FORMAT, **root})
        for table in content:
            tables.write(file, table)
        file.flush()
        body: bytes = file.id.get_file_image()
    return seal.sealed(body, str(root["run"]))


def _compare(group: Any, table: Table) -> None:
    """StoreError where a table as written differs from the one that was read from a part."""
    for name, dataset in group.items():
        back, values = access.column(dataset), np.asarray(table.columns[name])
        is_text = back.dtype == object
        if back.tolist() != values.tolist() if is_text else back.tobytes() != values.tobytes():
            raise StoreError(f"{table.name}/{name} was damaged on its way: check disk and memory")


def _take(file: Any, part: Any) -> None:
    """Copy the trajectory of a part.

    One H5Ocopy of the whole part keeps the hard links of time and step; moving links costs nothing.
    """
    h5py.h5o.copy(part.id, b".", file.id, _INCOMING.encode())
    for tree in _TREES:
        for label in file[_INCOMING].get(tree, ()):
            file.require_group(tree)
            file.move(f"{_INCOMING}/{tree}/{label}", f"{tree}/{label}")
    del file[_INCOMING]


def _plots(file: Any) -> None:
    """/plots: the first particle's q (or p), the energies, of all runs of the most common length."""
    observables = file.get("observables", {})
    drawn = next((name for name in tables.names(file) if "signal" in file[name].attrs), None)
    if not observables and drawn is None:
        return
    plots = file.create_group("plots")
    runs = {label: file[f"parameters/{label}"].attrs.get("sequence", 0) for label in observables}
    order = {label: observables[label] for label in sorted(runs, key=lambda label: runs[label])}
    made = [name for name in ("q", "p", "energy") if _plot(order, plots, name)]
    if drawn is not None and not made:
        made = [drawn.replace("/", " ")]
        plots[made[0]] = h5py.SoftLink(f"/{drawn}")
    layout.write_attributes(plots, {"NX_class": "NXentry", "default": made[0]})
    layout.write_attributes(file, {"default": "plots"})


def _plot(runs: Mapping[str, Any], plots: Any, name: str) -> bool:
    kept = {label: run[name]["value"] for label, run in runs.items() if name in run}
    if not kept:
        return False
    frames = max(map(len, kept.values()))
    curves = [label for label, value in kept.items() if len(value) == frames]
    group = plots.create_group(name)
    title = {"q": "q of the first particle", "p": "p of the first particle", "energy": "total energy"}[name]
    layout.write_attributes(group, {"NX_class": "NXdata", "signal": curves[0], "axes": ["time"]})
    group.create_dataset("title", data=title, dtype=h5py.string_dtype("utf-8"))
    if len(curves) > 1:
        layout.write_attributes(group, {"auxiliary_signals": curves[1:]})
    group["time"] = h5py.SoftLink(f"{kept[curves[0]].parent.name}/time")
    for label in curves:
        value = kept[label]
        if value.ndim == 1:
            group[label] = h5py.SoftLink(value.name)
            continue
        view = h5py.VirtualLayout((frames,), "<f8")
        view[:] = h5py.VirtualSource(".", value.name, value.shape, "<f8")[:, 0]
        shown = {key: value.attrs[key] for key in ("units", "long_name")}
        layout.write_attributes(group.create_virtual_dataset(label, view), shown)
    return True
