"""Covariance of a map's residuals, by storage and rounding errors; least squares in extended precision."""

from __future__ import annotations

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.physics.arrays import Extended, Floats


class Noise:
    """The covariance V of the residuals of a map, as its Cholesky factor."""

    def __init__(self, entries: Floats, sigma: Floats, process: Floats) -> None:
        self.sigma, self.entries = sigma, entries
        pairs = len(process)
        self.diagonal = not np.any(sigma)
        if self.diagonal:
            self.scale = np.repeat(process, 2).reshape(pairs, 2)
            self.log_det = 2 * float(np.sum(np.log(self.scale)))
            return
        # slow to import, and roundings alone need none of it
        from scipy.linalg.lapack import dpbtrf

        s = sigma**2
        across = np.einsum("ij,nj,kj->nik", entries, s[:-1], entries)
        across[:, 0, 0] += s[1:, 0] + process**2
        across[:, 1, 1] += s[1:, 1] + process**2
        self.scale = np.sqrt(np.stack([across[:, 0, 0], across[:, 1, 1]], axis=1))
        below = -entries[None] * s[1:-1, None, :] / self.scale[1:, :, None] / self.scale[:-1, None, :]
        band = np.zeros((4, 2 * pairs))
        band[0] = 1
        band[1, ::2] = across[:, 1, 0] / self.scale[:, 0] / self.scale[:, 1]
        band[1, 1:-1:2], band[2, :-2:2] = below[:, 0, 1], below[:, 0, 0]
        band[2, 1:-1:2], band[3, :-2:2] = below[:, 1, 1], below[:, 1, 0]
        self.factor, failed = dpbtrf(band, lower=1)
        if failed:
            raise IdentificationError("the numbers of the file are too coarse, or too unlike, for a fit")
        self.log_det = 2 * float(np.sum(np.log(self.factor[0])) + np.sum(np.log(self.scale)))

    def solve(self, x: Floats) -> Floats:
        """V^-1 x of columns x (f - 1, 2, k)."""
        y = x / self.scale[:, :, None]
        if not self.diagonal:
            from scipy.linalg.lapack import dpbtrs

            y = dpbtrs(self.factor, y.reshape(-1, x.shape[2]), lower=1)[0].reshape(x.shape)
        return np.asarray(y / self.scale[:, :, None])

    def errors(self, weighted: Floats) -> Floats:
        """Most likely errors e (f, 2) of the recorded numbers, from V^-1 r (f - 1, 2)."""
        out = np.zeros_like(self.sigma)
        out[1:] += weighted
        out[:-1] -= weighted @ self.entries
        return np.asarray(self.sigma**2 * out)


def least_squares(columns: Extended, right: Extended) -> Extended:
    """Solution x of columns x = right by normal equations in extended precision."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    size = np.where(size > 0, size, 1)
    columns = columns / size
    gram = columns.T @ columns
    inverse = np.linalg.pinv(gram.astype(np.float64), rcond=1e-15, hermitian=True).astype(np.longdouble)
    x = inverse @ (columns.T @ right)
    for _ in range(4):
        x = x + inverse @ (columns.T @ (right - columns @ x))
    return np.asarray(x / size[:, None])
