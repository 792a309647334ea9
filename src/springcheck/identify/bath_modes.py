"""Modes of joined particles in one bath, from their noise: each is an oscillator by itself."""

from __future__ import annotations

import numpy as np

from springcheck.physics.arrays import Floats

FREE_OF_NOISE = 1e-9
"""What a combination free of noise leaves, over the smallest that has noise, if it is one to rounding."""


def modes(q: Floats, v: Floats, m: Floats) -> tuple[Floats, bool] | None:
    """Combinations (n, n) of the positions q (f, n) of masses m (n,) that move each by itself, a row each,
    and whether they are known to rounding.

    Where n combinations of (q', v', q, v) are free of noise, and their matrices are no multiples of 1, the
    modes are eigenvectors of these, to rounding; else of the best map of a frame, symmetric in sqrt(m) q, to
    its statistical error.  None where nothing moves.
    """
    n, root = q.shape[1], np.sqrt(m)
    x, u = (q - np.mean(q, axis=0)) * root, (v - np.mean(v, axis=0)) * root
    scale = np.repeat([np.std(x), np.std(u)], n)
    if not np.all((scale > 0) & np.isfinite(scale)):
        return None
    z = np.concatenate([x, u], axis=1) / scale
    frames = np.column_stack([z[1:], z[:-1], np.ones(len(z) - 1)])
    weights, turned = np.linalg.svd(frames, full_matrices=False)[1:]
    free = turned[-n:, : 4 * n]
    if weights[-n] < FREE_OF_NOISE * weights[-n - 1] and np.linalg.cond(free[:, :n]) < 1 / FREE_OF_NOISE:
        best, apart = _least_alike(np.linalg.solve(free[:, :n], free[:, n:]))
        # modes are off by what these are off by, over what tells them apart
        if apart**2 > max(weights[-n] / weights[-n - 1], 2.0**-52):
            return np.asarray(np.linalg.eigh(best + best.T)[1].T * root), True
    A = np.linalg.lstsq(frames[:, 2 * n :], frames[:, : 2 * n], rcond=None)[0][: 2 * n].T
    best, _ = _least_alike(np.concatenate(np.split(A, 2), axis=1))
    return np.asarray(np.linalg.eigh(best + best.T)[1].T * root), False


def _least_alike(blocks: Floats) -> tuple[Floats, float]:
    """The one of some matrices (n, n) in a row (n, .. n) that is least a multiple of 1, and how much."""
    n = len(blocks)
    each = np.split(blocks, blocks.shape[1] // n, axis=1)
    apart = [float(np.linalg.norm(x - np.eye(n) * np.trace(x) / n)) for x in each]
    i = int(np.argmax(apart))
    return each[i], apart[i]
