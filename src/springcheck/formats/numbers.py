"""Arrays by their names, or the columns of one array."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError, nearest, plain
from springcheck.formats.columns import BARE, Floats, States, is_rate, kind, kinds, listed, named, split
from springcheck.physics.arrays import roundoff

STATES = "y", "u", "state", "states", "sol", "solution", "z"
"""Names of one array of positions and velocities, as SciPy's ``solve_ivp`` has it."""
BETWEEN = "dt", "h", "delta_t", "timestep", "time_step"
"""Names of the time between frames, a single number."""


def of_table(path: Path, found: Any, names: Sequence[str], step: float | None = None) -> States:
    """The states in the unnamed columns (f, c) of an array, named by `names`."""
    states = split(path, named(path, np.asarray(found, np.float64), names), roundoff(found), step)
    return states if names else replace(states, notes=(*states.notes, BARE))


def states_of(
    path: Path, arrays: Mapping[str, Any], names: Sequence[str] = (), step: float | None = None,
    finite: bool = True,
) -> States:  # fmt: skip
    """Named arrays as states: t (f,), q and p or v (f,), (f, n) or (f, n, 3), and perhaps m (n,).

    MATLAB and Octave write times as (1, f) or (f, 1), and may write columns as rows.  `names` select arrays
    and state their quantities, as ``t=clock,q=x,v=dx``; for a single array they name the columns.
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
    states = split(path, columns, roundoff(*(numbers[name] for name in columns)), step, finite)
    both = [name for name in given if name not in arrays] if not names else []
    notes = [
        f"{plain(name, 40)} was taken as positions and their rates, as SciPy writes them" for name in both
    ]
    return replace(states, mass=masses[0] if masses else states.mass, notes=(*states.notes, *notes))


def _state_vector(arrays: Mapping[str, Any], step: float | None) -> tuple[Mapping[str, Any], float | None]:
    """Arrays with one state vector split into q and v, and the time between frames."""
    good = {name: a for name, a in arrays.items() if not isinstance(a, StoreError) and a.dtype.kind in "fiu"}
    apart = [float(a.ravel()[0]) for name, a in good.items() if name.lower() in BETWEEN and a.size == 1]
    step = apart[0] if step is None and apart else step
    both = [name for name, a in good.items() if name.lower() in STATES and a.ndim == 2 and a.size]
    others = {kind(name) for name in arrays if name not in both} & {"q", "p", "v"}
    if len(both) != 1 or others:
        return arrays, step
    t = next((a.ravel() for name, a in good.items() if kind(name) == "t"), None)
    y = good[both[0]]
    frames = max(y.shape) if t is None else len(t)
    y = y.T if len(y) != frames else y
    n, odd = divmod(y.shape[1], 2)
    clock: Floats = np.arange(frames) * (step or 1.0) if t is None else np.asarray(t, np.float64)
    known = n and not odd and len(y) == frames and (t is not None or step)
    if not known or not all(is_rate(clock, *np.asarray(y[:, [i, n + i]], float).T) for i in range(n)):
        return arrays, step
    rest = {name: a for name, a in arrays.items() if name != both[0]}
    return {**rest, "q": y[:, :n], "v": y[:, n:]}, step


def _may_be_left_out(path: Path, name: str, a: Any, rows: int) -> None:
    """StoreError where an array named as a quantity of each frame cannot be read as one: others would pass
    for all that was recorded.  Masses, and arrays shorter than half of the frames, belong to no frame."""
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
            near = nearest(name, arrays)
            raise StoreError(f"{path}: holds no array {name!r}{near}; it has {listed(arrays)}")
        found[what or name] = arrays[name]
    return found
