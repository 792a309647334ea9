"""One trajectory of a store as a file of its own that MDAnalysis and its kin open."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from springcheck.errors import StoreError
from springcheck.store import files, layout, reading

_ELEMENTS = ("position", "velocity")


def export(path: str | Path, label: str, out: str | Path) -> None:
    """Write one trajectory as plain H5MD: one group ``/particles/trajectory``, no virtual datasets.

    MDAnalysis wants that name, and the ending .h5md.  Raises StoreError for an unknown label, a scene
    without particles, and a path that exists.
    """
    path, out = Path(path), Path(out)
    if out.exists():
        raise StoreError(f"{out} exists: remove it or name another file")
    folder = out.absolute().parent
    if not folder.is_dir():
        raise StoreError(f"cannot write {out}: there is no folder {folder}")
    if out.suffix != ".h5md":
        raise StoreError(f"{out}: the name must end in .h5md, readers go by it")
    source = reading.source_of(path, label)
    with reading.opened(source) as file:
        group = file.get(f"particles/{label}")
        if group is None:
            raise StoreError(f"{label} of {path} has no positions to export: its scene has no particles")
        total = sum(group[name]["value"].size * 8 for name in _ELEMENTS if name in group)
        temporary = out.with_name(out.name + ".new")
        with files.told(out, "write"):
            try:
                _write(temporary, file, group, label, total)
                files.put(temporary, out)
            finally:
                temporary.unlink(missing_ok=True)


def _write(path: Path, file: Any, group: Any, label: str, total: int) -> None:
    with layout.fresh(path, 2 * total) as out:
        layout.begin(out)
        layout.write_attributes(out, {"format": layout.EXPORTED})
        target = out.create_group("particles/trajectory")
        file.copy(group["box"], target, "box")
        first: Any = None
        for name in _ELEMENTS:
            if name not in group:
                continue
            made = target.create_group(name)
            _copy_values(group[name]["value"], made)
            if first is None:
                first = made
                file.copy(group[name]["time"], made, "time")
                file.copy(group[name]["step"], made, "step")
            else:
                made["time"], made["step"] = first["time"], first["step"]
        file.copy(group["mass"], target, "mass")
        layout.write_attributes(out.create_group("parameters/trajectory"), reading.parameters(file, label))


def _copy_values(source: Any, target: Any) -> None:
    """Copy (frames, n, 3) in pieces: only x is written, y and z are the fill value of their chunks."""
    frames, n, _ = source.shape
    rows = max(1, min(frames, layout.CHUNK // (8 * n)))
    made = target.create_dataset("value", source.shape, "<f8", chunks=(rows, n, 1), fillvalue=0.0)
    for start in range(0, frames, rows):
        made[start : start + rows, :, 0] = source[start : start + rows, :, 0]
    for key in ("unit", "units"):
        layout.write_attributes(made, {key: source.attrs[key]})
