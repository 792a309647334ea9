"""Unknowns of one step from its entries, by Gauss-Newton for many families and maps at once."""

from __future__ import annotations

import numpy as np

from springcheck.identify.maps import Table
from springcheck.physics.arrays import Floats, Integers, Reals

GUESSED = 0.05
"""Distance of the entries of one step, of size 1, within which a first guess without friction is followed:
it is good to 1e-3 where the family is right."""

LOST = 30.0, 2.0, 0.5, 0.02, 1e-4
"""The same before each step with friction.  Measured on 2,900 maps of up to 0.9 of the critical damping, all
but one in a thousand: 26, 1.3, 0.28, 0.0076 and 9e-6 at most."""

DAMPED_LOST = 200.0
"""The same in units of (g/x)**(2**n) of the guess, n steps later: 100, 60, 70, 100 at most."""

CURVED = 30.0
"""What a step of relative length 1 may leave over beside what further steps take away, in units of its
square: 8.4 at most in the right families of 11,600 maps of up to 0.9 of the critical damping."""

QUOTIENT = 1e-5
"""The same in units of the step: difference quotients are as far off."""

FARTHEST = 0.3
"""Steps of that relative length say nothing of what is left over."""

LAST = 1e-7
"""A step of that relative length is the last: its square is rounding."""

FOUND = 1e-14
"""Distance of the entries at which a guess is not improved any further."""

CHUNK = 4096
"""Candidates that are solved at once, so that their arrays stay in the processor's cache."""


def solved(
    every: Table,
    which: Integers,
    a: Floats,
    g: Floats,
    wanted: Floats,
    *,
    free_scale: bool,
    away: Floats | None = None,
    turns: int = 0,
    spread: Floats | float = 0.0,
    far: bool = False,
) -> tuple[Floats, Floats, Floats]:
    """Gauss-Newton for a and g on the entries of one step, in double precision, and how far it is off; the
    friction of guesses is `away` from that of their curve."""
    away = np.abs(g) if away is None else away
    spread = np.broadcast_to(spread, np.shape(a))
    if len(a) > CHUNK:
        parts = [
            solved(
                every, which[i : i + CHUNK], a[i : i + CHUNK], g[i : i + CHUNK], wanted[i : i + CHUNK],
                away=away[i : i + CHUNK], free_scale=free_scale, turns=turns, spread=spread[i : i + CHUNK],
                far=far,
            )
            for i in range(0, len(a), CHUNK)
        ]  # fmt: skip
        one, other, off = (np.concatenate(x) for x in zip(*parts, strict=True))
        return one, other, off
    if not len(a):
        return a, g, np.zeros(0)
    free = 1 + every.damped
    values = np.array([a, g], np.float64)
    target = compared(wanted, free_scale=free_scale)
    size = np.maximum(np.abs(target), 1e-2)
    # every entry counts by its size, the lower left one by that of a
    least = 1e-3 if free_scale else np.array([[1e-3], [1e-3], [1e-300], [1e-3]])
    weight = 1 / np.maximum(np.abs(target), least)
    off = np.full(len(a), np.inf)
    alive = np.arange(len(a))
    rounds = turns or (6 if every.damped else 3)
    with np.errstate(all="ignore"):
        share = away / np.sqrt(np.abs(a))
        for turn in range(rounds + 1):
            x, n = values[:, alive], len(alive)
            d = np.stack([1e-6 * np.abs(x[0]), 1e-6 * np.maximum(np.abs(x[1]), 1e-3)])
            # the entries, and those with each unknown changed
            tried = np.repeat(x[:, None], 1 + free * (turn < rounds), axis=1)
            for i in range(tried.shape[1] - 1):
                tried[i, 1 + i] += d[i]
            units = every.unit(np.tile(which[alive], tried.shape[1]), *tried.reshape(2, -1))
            out = compared(units, free_scale=free_scale).reshape(len(target), -1, n)
            miss = target - out[:, 0]
            now = np.max(np.abs(miss) / size, axis=0)
            off[alive] = np.where(np.isnan(now), np.inf, now)
            if turn == rounds:
                break
            slopes = np.moveaxis(out[:, 1:] - out[:, :1], 1, 0) / d[:free, None] * weight
            change = least_squares(slopes, miss * weight)[0]
            # what has been found to rounding stays where it is
            good = ~(now <= FOUND)
            left = np.max(np.abs(miss - np.sum(slopes * change[:, None], axis=0) / weight) / size, axis=0)
            step = np.abs(change[0] / x[0]) + (np.abs(change[1]) / np.sqrt(np.abs(x[0])) if free > 1 else 0)
            if far and turn < (len(LOST) if every.damped else 1):
                room = (
                    np.minimum(LOST[turn], DAMPED_LOST * share[alive] ** 2**turn) if every.damped else GUESSED
                )
                good &= now <= room + spread[alive]
            elif not (far or turns):
                # what a step leaves over, but for its square, no further step takes away
                left = np.max(np.abs(miss - np.sum(slopes * change[:, None], axis=0) / weight) / size, axis=0)
                step = np.abs(change[0] / x[0]) + (
                    np.abs(change[1]) / np.sqrt(np.abs(x[0])) if free > 1 else 0
                )
                room = spread[alive] + QUOTIENT * step + CURVED * step**2
                good &= (left <= room) | (now <= spread[alive]) | (step > FARTHEST)
            limit = 0.5 * np.abs(x[0])
            change[0] = np.clip(change[0], -limit, limit)
            values[:free, alive[good]] += change[:, good]
            if not turns:
                settled = good & (step <= LAST)
                off[alive[settled]] = left[settled]
                good &= ~settled
            if not np.all(good):
                alive, target, size, weight = alive[good], target[:, good], size[:, good], weight[:, good]
            if not len(alive):
                break
    return values[0], values[1], off


def compared(units: Reals, *, free_scale: bool) -> Floats:
    """What of one-step maps (c, 2, 2) is compared (i, c): all entries, or what a scale of v leaves alone."""
    out = np.asarray(units.transpose(1, 2, 0).reshape(4, -1), np.float64)
    return np.stack([out[0], out[3], out[1] * out[2]]) if free_scale else out


def least_squares(slopes: Floats, miss: Floats) -> tuple[Floats, Floats]:
    """Solutions x (k, c) of the sum over k of slopes (k, i, c) x = miss (i, c), the shortest ones, and
    variances (k, c) of x for errors of 1; columns may differ by many powers of ten."""
    size = np.sqrt(np.sum(slopes**2, axis=1))
    size = np.where(np.isfinite(size) & (size > 0), size, 1.0)
    even = slopes / size[:, None]
    # what is no number changes nothing
    lost = ~np.isfinite(np.sum(even, axis=(0, 1)) + np.sum(miss, axis=0))
    if np.any(lost):
        even[:, :, lost], miss = 0.0, np.where(lost, 0.0, miss)
    right = np.sum(even * miss, axis=1)
    if len(even) == 1:
        present = np.sum(even**2, axis=1) > 0
        return right * present / size, present / size**2
    if len(even) == 2:
        # columns of length 1: eigenvalues 1 + r and 1 - r, of the sum and the difference
        r = np.sum(even[0] * even[1], axis=0)
        plus, minus = (np.where(x > 1e-15, 0.5 / np.maximum(x, 1e-15), 0.0) for x in (1 + r, 1 - r))
        inner = plus + minus
        return (inner * right + (plus - minus) * right[::-1]) / size, inner / size**2
    inverse = np.linalg.pinv(np.einsum("aic,bic->cab", even, even), hermitian=True)
    return np.einsum("cab,bc->ac", inverse, right) / size, np.einsum("caa->ac", inverse) / size**2
