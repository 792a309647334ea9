"""Where the powers of a one-step map stop being bounded: a scan, narrow windows of growth, bisection.

Two eigenvalues of a symplectic map have to meet before they leave the unit circle (Krein).  So a window of
growth narrower than the spacing of the scan lies where two of them come nearest: for one oscillator where the
trace is extremal near 2 or -2.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from springcheck.physics.arrays import Floats, Reals

Maps = Callable[[Floats], Reals]
"""Steps, or h w, (j,) -> one-step maps (j, g, 2n, 2n) of g groups of n coupled coordinates."""

COUPLED_GROWTH = 1e-7
"""Growth per step from which coupled modes count as growing: nearly equal eigenvalues of their matrix are
known to the square root of the rounding only."""

FINE, MOST_ROUNDS, ENOUGH = 256, 6, 1e-10
"""Points of each refinement of the bracket, most refinements, and the relative width that ends them."""

EQUAL_ANGLES = 1e-6
"""Difference of two angles of eigenvalues below which they count as equal throughout."""

CLOSING_ROUNDS = 9
"""Times that the interval about a meeting is divided by 4, to 4e-6 of the grid's spacing."""


@np.errstate(all="ignore")
def radius(maps: Reals, rounding: float | Floats) -> tuple[Floats, Floats]:
    """Spectral radii (...) of maps (..., 2n, 2n), and bounds on the effect of rounding of the entries.

    Where the discriminant of a 2 x 2 map is within its rounding of 0 its eigenvalues count as equal: at a
    limit of stability a change of eps in the trace would move them by sqrt(eps).
    """
    if maps.shape[-1] > 2:
        found = np.max(np.abs(eigenvalues(maps)), axis=-1)
        return found, np.full_like(found, COUPLED_GROWTH)
    (a, b), (c, d) = np.moveaxis(maps, (-2, -1), (0, 1))
    half, size = (a + d) / 2, np.abs(a * d) + np.abs(b * c)
    determinant = a * d - b * c
    discriminant = half * half - determinant
    near = np.abs(discriminant) <= 4 * rounding * (half * half + size)
    root = np.sqrt(np.where(near, 0, np.abs(discriminant)))
    turning = near | (discriminant < 0)
    found = np.where(turning, np.sqrt(np.abs(determinant)), np.abs(half) + root)
    of_turning = rounding * size / np.maximum(found, np.finfo(np.float64).tiny)
    of_real = rounding * (np.abs(a) + np.abs(d)) + rounding * (half * half + size) / np.maximum(root, 1e-300)
    moved = np.where(turning, of_turning, of_real)
    return np.asarray(found, np.float64), np.asarray(moved, np.float64)


def grows(maps: Reals, rounding: float | Floats) -> np.ndarray:
    """Whether powers of each map are unbounded beyond the rounding of its entries, or not finite."""
    found, moved = radius(maps, rounding)
    return np.asarray(~(found <= 1 + np.where(np.isfinite(moved), np.minimum(moved, 1), 0)))


def eigenvalues(maps: Reals) -> np.ndarray:
    """Eigenvalues (..., 2n) of maps, NaN of those that are not finite."""
    finite = np.asarray(np.isfinite(maps).all(axis=(-1, -2)))
    values = np.linalg.eigvals(np.where(finite[..., None, None], maps, 0).astype(np.float64))
    return np.where(finite[..., None], values, np.nan)


@np.errstate(all="ignore")
def first_growth(maps: Maps, grid: Floats, rounding: float, of_square: float = 0.0) -> float:
    """Lower end of the first range of growth, to a part in 1e10: 0 from the first point of the grid on,
    infinity nowhere.  Entries are known to rounding + of_square x**2."""

    def wild(x: Floats) -> np.ndarray:
        known = (rounding + of_square * x * x)[:, None]
        return np.asarray(grows(maps(x), known).any(axis=-1))

    found = wild(grid)
    before = grid[: int(np.argmax(found)) + 1] if found.any() else grid
    met = _meetings(maps, before)
    if len(met):
        found, grid = np.append(found, wild(met)), np.append(grid, met)
        order = np.argsort(grid)
        found, grid = found[order], grid[order]
    if not found.any():
        return float("inf")
    if found[0]:
        return 0.0
    low, high = grid[int(np.argmax(found)) - 1 :][:2]
    for _ in range(MOST_ROUNDS):
        if high - low <= ENOUGH * high:
            break
        points = np.linspace(low, high, FINE)
        found = wild(points[1:-1])
        j = int(np.argmax(found)) + 1 if found.any() else FINE - 1
        low, high = points[j - 1], points[j]
    return float(low)


def _meetings(maps: Maps, grid: Floats) -> Floats:
    """Points (c,) between those of a grid (j,) at which angles of eigenvalues come nearest."""

    def gaps(x: Floats) -> tuple[Floats, Floats]:
        # real matrices: each angle from 0 to pi is there twice, with its conjugate or with its inverse
        found = eigenvalues(maps(x))
        angle = np.sort(np.abs(np.angle(found)), axis=-1)[..., ::2]
        apart = np.diff(angle, axis=-1, prepend=0.0, append=np.pi)
        growth = np.broadcast_to(np.max(np.abs(found), axis=-1, keepdims=True) - 1, apart.shape)
        return apart.reshape(len(x), -1), growth.reshape(len(x), -1)

    if len(grid) < 3:
        return np.zeros(0)
    found, _ = gaps(grid)
    before, here, after = found[:-2], found[1:-1], found[2:]
    most = np.maximum(before, after)
    # equal frequencies have no gap to close, and one that hardly changes from point to point does not
    at, which = np.nonzero((here <= np.minimum(before, after)) & (most > EQUAL_ANGLES) & (most > 1.5 * here))
    low, middle, high, each = grid[at], grid[at + 1], grid[at + 2], np.arange(len(at))
    for _ in range(CLOSING_ROUNDS if len(at) else 0):
        x = np.linspace(low, high, 9)
        gap, growth = (y.reshape(*x.shape, -1)[:, each, which] for y in gaps(x.ravel()))
        # where the gap is closed, the point of most growth
        best = np.argmin(gap - growth, axis=0)
        low, middle, high = (x[np.clip(best + i, 0, 8), each] for i in (-1, 0, 1))
    return middle
