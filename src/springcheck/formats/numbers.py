"""NPY and NPZ files: arrays by name, or the columns of one array."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.formats.columns import States, named, split


def _load(path: Path) -> Any:
    try:
        # NumPy leaves a damaged file open; this one is in memory
        found = np.load(BytesIO(path.read_bytes()), allow_pickle=False)
        return dict(found) if hasattr(found, "files") else found
    except Exception as error:
        raise StoreError(f"{path}: NumPy cannot read it: {' '.join(str(error).split())[:200]}") from error


def _roundoff(arrays: Sequence[Any]) -> float:
    widths = [np.finfo(a.dtype).eps / 2 for a in arrays if np.issubdtype(a.dtype, np.floating)]
    return float(max([2.0**-53, *widths]))


def read_npz(path: Path) -> States:
    """Arrays t (f,), q and p or v (f,) or (f, n), and perhaps m (n,)."""
    arrays: dict[str, Any] = _load(path)
    frames = {len(a) for name, a in arrays.items() if name == "t" and a.ndim == 1}
    rows = next(iter(frames), 0)
    columns = {}
    mass = None
    for name, a in arrays.items():
        if not (np.issubdtype(a.dtype, np.floating) or np.issubdtype(a.dtype, np.integer)):
            continue
        if name in ("m", "mass"):
            mass = np.atleast_1d(np.asarray(a, np.float64))
        elif a.ndim in (1, 2, 3) and len(a) == rows:
            columns[name] = np.asarray(a, np.float64).reshape(rows, -1)
    found_states = split(path, columns, _roundoff([a for a in arrays.values() if a.ndim]))
    if mass is None:
        return found_states
    return States(
        t=found_states.t, q=found_states.q, p=found_states.p, v=found_states.v, mass=mass,
        roundoff=found_states.roundoff,
    )  # fmt: skip


def read_npy(path: Path, names: Sequence[str]) -> States:
    """A structured array with named fields, or a table (f, c) whose columns are named."""
    found = _load(path)
    if found.dtype.names:
        columns = {name: np.asarray(found[name], np.float64) for name in found.dtype.names}
        return split(path, columns, _roundoff([found[name] for name in found.dtype.names]))
    if found.ndim != 2 or not np.issubdtype(found.dtype, np.number) or np.iscomplexobj(found):
        raise StoreError(f"{path}: an array of {found.dtype} and shape {found.shape} is no table of numbers")
    if not names:
        raise StoreError(f"{path}: its {found.shape[1]} columns have no names; give them, as --columns t,q,v")
    return split(path, named(path, np.asarray(found, np.float64), names), _roundoff([found]))
