"""A distance that particles keep as a rod keeps it, which no springs explain."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from springcheck.physics.arrays import Floats

RIGID, TURNED, EXACT = 1e-3, 0.05, 1e-12
"""Largest relative change of a rod's length, smallest rotation by which it shows [rad], and the change that
rounding alone leaves."""

MOST, FEWEST = 16, 8
"""Most particles that are looked at, and most frames that any circle fits."""


def on_a_circle(q: Floats) -> str:
    """The rod in positions q (f, N), in space or a plane, in a sentence: two particles at a constant distance
    that turn, or one that swings at a constant distance from a fixed point; "" without one."""
    for axes in (3, 2):
        if q.shape[1] % axes or len(q) <= FEWEST or not np.isfinite(q).all():
            continue
        x = q[:, : axes * MOST].reshape(len(q), -1, axes)
        for a, b in combinations(range(x.shape[1]), 2):
            way = x[:, b] - x[:, a]
            length, off = _kept(way)
            if off <= RIGID * length and np.max(np.ptp(way, axis=0)) >= TURNED * length:
                return f"particles {a} and {b} turn and keep their distance, {length:.6g} to {off:.1g}: a rod"
        for i in range(x.shape[1]):
            arm, bent = _arm(x[:, i])
            length, off = _kept(arm)
            # a straight path lies on a circle as well, and an orbit may without a rod, but does not turn back
            if (
                off <= RIGID * bent
                and bent >= TURNED**2 * length
                and (off <= EXACT * length or _turns_back(arm))
            ):
                kept = f"keeps its distance from a fixed point, {length:.6g} to {off:.1g}: a rod"
                return f"particle {i} swings and {kept}"
    return ""


def _kept(way: Floats) -> tuple[float, float]:
    """Mean length of a vector (f, 2 or 3), and the range of its lengths."""
    size = np.linalg.norm(way, axis=1)
    return float(np.mean(size)), float(np.ptp(size))


def _arm(way: Floats) -> tuple[Floats, float]:
    """Vector from the centre of the circle that fits a path (f, 2 or 3) best to each of its points, and the
    root mean square distance of the path from its straight line."""
    way = way - np.mean(way, axis=0)
    bent = float(np.linalg.svd(way, compute_uv=False)[1] / np.sqrt(len(way)))
    size = float(np.max(np.abs(way))) or 1.0
    way = way / size
    # |way - c| = l is linear in c and l**2 - c**2
    columns = np.column_stack([2 * way, np.ones(len(way))])
    centre = np.linalg.lstsq(columns, np.sum(way**2, axis=1))[0]
    return np.asarray((way - centre[:-1]) * size), bent


def _turns_back(arm: Floats) -> bool:
    """Whether a vector (f, 2 or 3) from a centre turns by less than a right angle a frame, and reverses."""
    outer = np.einsum("fi,fj->fij", arm[:-1], arm[1:])
    turned = (outer - outer.transpose(0, 2, 1)).reshape(len(outer), -1)
    along = turned @ turned[np.argmax(np.linalg.norm(turned, axis=1))]
    near = np.all(np.sum(arm[1:] * arm[:-1], axis=1) > 0)
    return bool(near and np.min(along) < -RIGID * np.max(along))
