"""The whole trajectory as one orbit of a map, seen through the rounding of the file.

Where the arithmetic is finer than the file, states are M**i z0, each rounded once when it was written.
Pairs of neighbours then waste what the long way shows: the errors of phase and growth fall with the
frames to the power 3/2, not 1/2.  Where the arithmetic is as coarse as the file, every rounding is fed
back into the motion, and neighbours are all that counts.  The two are told apart by their likelihoods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck.physics.arrays import Extended, Floats

CERTAIN = 14.0
"""Log of the likelihood ratio from which one of two is called: exp(-14) bounds the chance of a mistake."""

ERRORS = 5.0
"""Standard errors that what is left over may lie above what rounding to nearest leaves."""

FLOOR = 1 / 8
"""A number near zero is written finer than its neighbours by any power of ten; it counts as no finer than
this share of the other component's quantum, so that no single number decides a fit."""


SETTLED = 1e-12
"""Share of what is left over that another step of the fit must promise to take away."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Orbit:
    """The orbit closest to all states; `entries` (2, 2) of its map and their `covariance` (4, 4)."""

    entries: Extended
    covariance: Floats
    centre: Extended
    within: bool
    """Whether what it leaves over is what rounding to nearest leaves."""
    odds: float
    """Log of the likelihood of states rounded once over that of states rounded in every step, less one for
    each number fitted: as much as a fit gains by chance."""

    @property
    def once(self) -> bool | None:
        """Whether states were rounded once, as they were written (True), or in every step (False); None
        where both are likely, or neither."""
        if self.odds < -CERTAIN:
            return False
        return True if self.odds > CERTAIN and self.within else None


def powers(entries: Extended, frames: int) -> Extended:
    """entries (2, 2) to the powers 0 to frames - 1, (frames, 2, 2), by doubling."""
    out, last = np.eye(2, dtype=np.longdouble)[None], entries
    while len(out) < frames:
        out = np.concatenate([out, out @ last])
        last = last @ last
    return np.asarray(out[:frames])


def _slopes(entries: Floats, frames: int) -> Floats:
    """Change of the powers of entries with each of the four, (4, frames, 2, 2): the upper right block of the
    powers of [[entries, E], [0, entries]]."""
    both = np.zeros((4, 4, 4))
    both[:, :2, :2] = both[:, 2:, 2:] = entries
    both[np.arange(4), [0, 0, 1, 1], [2, 3, 2, 3]] = 1
    out = np.broadcast_to(np.eye(4), (1, 4, 4, 4))
    while len(out) < frames:
        out = np.concatenate([out, out @ both])
        both = both @ both
    return np.asarray(np.moveaxis(out[:frames, :, :2, 2:], 0, 1))


def orbit(z: Extended, quanta: Floats, pairs: Extended, *, constant: bool) -> Orbit | None:
    """Fit states z (f, 2) of size 1, written to within `quanta` (f, 2), from the map of their pairs.

    `constant` says that the position of the equilibrium is unknown; its velocity is 0.  None where the fit
    does not converge.
    """
    frames = len(z)
    unit = np.maximum(quanta, FLOOR * np.max(quanta, axis=1, keepdims=True)) / np.sqrt(12.0)
    # a motion that has died down to nothing is at rest, exactly
    moving = np.any(z != 0, axis=1, keepdims=True)
    weights = np.where(moving & (unit > 0), 1 / np.where(unit > 0, unit, 1), 0.0)
    entries, start, centre = pairs.copy(), z[0].copy(), np.zeros(2, dtype=np.longdouble)
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(8):
            maps = powers(entries, frames)
            columns = [maps[:, :, 0], maps[:, :, 1]]
            columns += list(_slopes(entries.astype(np.float64), frames) @ start)
            if constant:
                columns.append(np.broadcast_to(np.array([1, 0], np.longdouble), (frames, 2)))
            missing = z - centre - maps @ start
            right = (missing * weights).astype(np.float64).ravel()
            slopes = np.stack([(x * weights).astype(np.float64).ravel() for x in columns], axis=1)
            if not (np.all(np.isfinite(slopes)) and np.all(np.isfinite(right))):
                return None
            scale = np.sqrt(np.sum(slopes**2, axis=0))
            if not np.all(scale > 0):
                return None
            across, triangle = np.linalg.qr(slopes / scale)
            if np.linalg.cond(triangle) > 1e9:
                return None
            change = np.linalg.solve(triangle, across.T @ right) / scale
            start = start + change[:2]
            entries = entries + change[2:6].reshape(2, 2)
            if constant:
                centre = centre + np.array([change[6], 0])
            if np.sum((across.T @ right) ** 2) <= SETTLED * max(float(np.sum(right**2)), 1.0):
                break
    u = (right - slopes @ change).reshape(frames, 2)
    converged = float(np.sum((across.T @ right) ** 2)) <= 1e-6 * max(float(np.sum(u**2)), 1.0)
    if not converged:
        return None
    inverse = np.linalg.inv(triangle)
    covariance = inverse @ inverse.T / scale[:, None] / scale[None, :]
    share = np.where(weights > 0, quanta * weights / np.sqrt(12.0), 0.0)
    leverage = np.sum(across**2, axis=1).reshape(frames, 2)
    total, count = float(np.sum(u**2)), float(np.sum(share**2))
    # a uniform error has a fourth moment of 9/5 of its variance squared
    within = total <= count + ERRORS * np.sqrt(0.8 * float(np.sum(share**4)) + 1)
    within = within and bool(np.all(np.abs(u) <= np.sqrt(3.0) * share + ERRORS * np.sqrt(leverage) + 1e-6))
    return Orbit(
        entries=entries,
        covariance=np.asarray(covariance[2:6, 2:6] * repeats(z)),
        centre=centre,
        within=within,
        odds=_fed_back(z, weights, pairs) - total / 2 - slopes.shape[1],
    )


def repeats(z: Extended) -> float:
    """How often each state comes back: roundings that repeat with the motion do not average away."""
    return len(z) / len(np.unique(z.astype(np.float64) @ [1, 1j]))


def _fed_back(z: Extended, weights: Floats, pairs: Extended) -> float:
    """Minus the log of the likelihood that every state follows from the recorded one before it, with an
    error of its own, of the covariance that fits best.  Constants and units are those of `total`/2."""
    r = ((z[1:] - z[:-1] @ pairs.T) * weights[1:]).astype(np.float64)
    r = r[np.all(weights[1:] > 0, axis=1)]
    spread = r.T @ r / max(len(r), 1)
    determinant = float(np.linalg.det(spread))
    return len(r) * (1 + 0.5 * np.log(max(determinant, 1e-300))) if len(r) else 0.0
