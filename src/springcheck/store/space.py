"""Mapping from columns of q and p (frames, n) to x, y and z of particles (frames, particles, 3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Integers
from springcheck.physics.scene import Scene


def axes_of(scene: Scene) -> str:
    """Axes along which particles move, of all or with commas of each: "x", "xyz", "xy,xyz"."""
    if scene.places is None:
        return "x"
    of, axis = np.divmod(scene.places, 3)
    each = ["".join("xyz"[a] for a in axis[of == i]) for i in range(scene.particles)]
    return each[0] if len(set(each)) == 1 else ",".join(each)


def places_of(axes: str, n: int) -> Integers:
    """The place, 3 particle + axis, of each of n columns.  StoreError where these are not the axes of n."""
    each = axes.split(",")
    if "," not in axes:
        each *= max(1, n // max(1, len(axes)))
    found = [3 * i + "xyz".find(axis) for i, own in enumerate(each) for axis in own]
    if len(found) != n or len(set(found)) < n or not set(axes) <= set("xyz,") or not all(each):
        raise StoreError(f"axes {axes[:40]!r} are not those of {n} coordinates")
    return np.array(found)


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
