"""Modes of joined particles in one bath, by their noise: each is an oscillator by itself."""

from __future__ import annotations

import numpy as np

from springcheck.physics.arrays import Floats

FREE_OF_NOISE = 1e-9
"""What a combination free of noise leaves, over the smallest that has noise, if it is one to rounding."""


def modes(q: Floats, v: Floats, m: Floats) -> tuple[Floats, bool] | None:
    """Combinations (n, n) of the positions q (f, n) of masses m (n,) that move each by itself, a row each,
    and whether they are known to rounding.

    Where n combinations of (q', v', q, v) are free of noise, and their matrices are no multiples of 1, these
    have them to rounding; else the best map of a frame, symmetric in sqrt(m) q, has them by statistics.  None
    where neither does.
    """
    n, root = q.shape[1], np.sqrt(m)
    x, u = (q - np.mean(q, axis=0)) * root, (v - np.mean(v, axis=0)) * root
    scale = np.repeat([np.std(x), np.std(u)], n)
    if not np.all((scale > 0) & np.isfinite(scale)):
        return None
    z = np.concatenate([x, u], axis=1) / scale
    frames = np.column_stack([z[1:], z[:-1], np.ones(len(z) - 1)])
    weights, turned = np.linalg.svd(frames, full_matrices=False)[1:]
    exact = bool(weights[-n] < FREE_OF_NOISE * weights[-n - 1])
    if exact:
        free = turned[-n:, : 4 * n]
        if np.linalg.cond(free[:, :n]) > 1 / FREE_OF_NOISE:
            return None
        blocks = np.split(np.linalg.solve(free[:, :n], free[:, n:]), 3, axis=1)
    else:
        A = np.linalg.lstsq(np.column_stack([z[:-1], np.ones(len(z) - 1)]), z[1:], rcond=None)[0][:-1].T
        blocks = [part for row in np.split(A, 2) for part in np.split(row, 2, axis=1)]
    apart = [np.linalg.norm(x - np.eye(n) * np.trace(x) / n) for x in blocks]
    best = blocks[int(np.argmax(apart))]
    if not max(apart) > np.sqrt(FREE_OF_NOISE):
        return None
    return np.asarray(np.linalg.eigh((best + best.T) / 2)[1].T * root), exact
