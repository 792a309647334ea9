"""Arrays by their names, or the columns of one array: of NPY and NPZ files, and of what others read."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError, nearest, plain
from springcheck.formats.columns import Floats, States, is_rate, kind, kinds, listed, named, split
from springcheck.formats.lines import MOST_NUMBERS
from springcheck.physics.arrays import roundoff

LARGEST = 16 * MOST_NUMBERS
"""Bytes of all arrays of a file, unpacked."""
STATES = "y", "u", "state", "states", "sol", "solution", "z"
"""Names of one array of positions and velocities, as SciPy's ``solve_ivp`` has it."""
BETWEEN = "dt", "h", "delta_t", "timestep", "time_step"
"""Names of the time between frames, a single number."""


def _load(path: Path) -> Any:
    try:
        if zipfile.is_zipfile(path):
            with zipfile.ZipFile(path) as packed:
                found = sum(member.file_size for member in packed.infolist())
        else:
            found = path.stat().st_size
        if found <= LARGEST:
            # NumPy leaves a damaged file open; this one is in memory
            loaded = np.load(BytesIO(path.read_bytes()), allow_pickle=False)
            return dict(loaded) if hasattr(loaded, "files") else loaded
    except Exception as error:
        raise StoreError(f"{path}: NumPy cannot read it: {' '.join(str(error).split())[:200]}") from error
    raise StoreError(
        f"{path}: {found / 1e6:.0f} MB of arrays, {LARGEST / 1e6:.0f} can be read: keep fewer frames"
    )


def read_npz(path: Path, columns: list[str], step: float | None) -> States:
    """Arrays t (f,), q and p or v (f,) or (f, n), and perhaps m (n,), by their names or as `columns` say."""
    return states_of(path, _load(path), columns, step)


def read_npy(path: Path, columns: list[str], step: float | None) -> States:
    """A structured array with named fields, or a table (f, c) whose columns are named."""
    found = _load(path)
    if found.dtype.names:
        return states_of(path, {name: found[name] for name in found.dtype.names}, columns, step)
    if found.ndim != 2 or not np.issubdtype(found.dtype, np.number) or np.iscomplexobj(found):
        raise StoreError(f"{path}: an array of {found.dtype} and shape {found.shape} is no table of numbers")
    return of_table(path, found, columns, step)


def of_table(path: Path, found: Any, names: Sequence[str], step: float | None = None) -> States:
    """The states in the unnamed columns (f, c) of an array, named by `names`."""
    return split(path, named(path, np.asarray(found, np.float64), names), roundoff(found), step)


def states_of(
    path: Path, arrays: Mapping[str, Any], names: Sequence[str] = (), step: float | None = None
) -> States:
    """Named arrays as states: t (f,), q and p or v (f,), (f, n) or (f, n, 3), and perhaps m (n,).

    From MATLAB and Octave times may be (1, f) or (f, 1), and columns may stand in rows.  `names` select among
    the arrays, and give the quantity of one whose name does not: ``t=clock,q=x,v=dx``; of a single array they
    name the columns.
    """
    given = arrays
    first, *more = arrays.values() or [np.empty(0)]
    alone = not (more or isinstance(first, StoreError) or "=" in "".join(names))
    if alone and np.issubdtype(first.dtype, np.number) and first.ndim == 2:
        return of_table(path, first, names, step)
    if not names:
        arrays, step = _state_vector(arrays, step)
    arrays = _chosen(path, arrays, names)
    meant = kinds(arrays)
    numbers = {
        name: a.ravel() if meant.get(name) == "t" and a.ndim == 2 and 1 in a.shape else a
        for name, a in arrays.items()
        if not isinstance(a, StoreError) and a.dtype.kind in "fiu"
    }
    clock = [a for name, a in numbers.items() if meant.get(name) == "t" and a.ndim == 1]
    # without positions there is nothing but a table of energies, and without times its rows are counted
    if step or (meant and "q" not in meant.values()):
        clock += [a for name, a in numbers.items() if a.ndim and meant.get(name) != "m"]
    rows = len(clock[0]) if clock else 0
    if not rows:
        refused = [arrays[name] for name in meant if isinstance(arrays[name], StoreError)]
        how = "name them, as --columns t=clock,q=x,v=dx, or give the time between frames, as --step H"
        raise next(iter(refused), StoreError(f"{path}: no array of times among {listed(given)}; {how}"))
    numbers = {
        name: a.T if a.ndim == 2 and len(a) != rows == a.shape[1] else a for name, a in numbers.items()
    }
    columns = {
        name: np.asarray(a, np.float64).reshape(rows, -1)
        for name, a in numbers.items()
        if a.ndim in (1, 2, 3) and len(a) == rows and (name in meant or "q" not in meant.values())
    }
    for name in meant.keys() - columns.keys():
        _may_be_left_out(path, name, arrays[name], rows)
    masses = [
        np.asarray(a, np.float64).ravel()
        for name, a in numbers.items()
        if meant.get(name) == "m" and name not in columns
    ]
    states = split(path, columns, roundoff(*(numbers[name] for name in columns)), step)
    return replace(states, mass=masses[0]) if masses else states


def _state_vector(arrays: Mapping[str, Any], step: float | None) -> tuple[Mapping[str, Any], float | None]:
    """Arrays of which one holds positions and then velocities as q and v, and the time between frames."""
    plain_ = {
        name: a for name, a in arrays.items() if not isinstance(a, StoreError) and a.dtype.kind in "fiu"
    }
    apart = [float(a.ravel()[0]) for name, a in plain_.items() if name.lower() in BETWEEN and a.size == 1]
    step = apart[0] if step is None and apart else step
    both = [name for name, a in plain_.items() if name.lower() in STATES and a.ndim == 2]
    others = {kind(name) for name in arrays if name not in both} & {"q", "p", "v"}
    if len(both) != 1 or others:
        return arrays, step
    t = next((a.ravel() for name, a in plain_.items() if kind(name) == "t"), None)
    y = plain_[both[0]]
    frames = max(y.shape) if t is None else len(t)
    y = y.T if len(y) != frames else y
    n, odd = divmod(y.shape[1], 2)
    clock: Floats = np.arange(frames) * (step or 1.0) if t is None else np.asarray(t, np.float64)
    if odd or len(y) != frames or not (t is not None or step) or not _is_state(clock, y, n):
        return arrays, step
    rest = {name: a for name, a in arrays.items() if name != both[0]}
    return {**rest, "q": y[:, :n], "v": y[:, n:]}, step


def _is_state(t: Floats, y: Any, n: int) -> bool:
    return all(is_rate(t, *np.asarray(y[:, [i, n + i]], np.float64).T) for i in range(n))


def _may_be_left_out(path: Path, name: str, a: Any, rows: int) -> None:
    """StoreError where an array named as a quantity of each frame cannot be read as one: without it, the
    others would pass for all that was recorded.

    Masses, and arrays shorter than half of the frames, such as initial values, belong to no frame.
    """
    if isinstance(a, StoreError):
        raise a
    if kind(name) != "m" and 2 * a.size > rows:
        what = f"{a.dtype} of shape {a.shape}, no numbers of {rows} frames"
        raise StoreError(f"{path}: {plain(name, 40)} is {what}; choose arrays, as --columns t=t,q=x,v=dx")


def _chosen(path: Path, arrays: Mapping[str, Any], names: Sequence[str]) -> Mapping[str, Any]:
    if not names:
        return arrays
    found = {}
    for text in names:
        what, _, name = text.rpartition("=")
        if name not in arrays:
            raise StoreError(
                f"{path}: holds no array {name!r}{nearest(name, arrays)}; it has {listed(arrays)}"
            )
        found[what or name] = arrays[name]
    return found
