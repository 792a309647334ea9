"""The map between recorded states: generalised least squares under the observation model.

States are z[n+1] = B z[n] + c + p[n], recorded as z + e: e is the error of the storage format, p the rounding
of a step.  The residuals r[n] = z[n+1] - B z[n] - c have the covariance V = A S A^T + P, a banded matrix,
since each e enters two of them.  B and c minimise r^T V^-1 r (Gauss-Helmert model: Mikhail, Observations and
Least Squares, 1976, chapter 9).  In double precision e = 0, V is diagonal and each pair of frames counts by
itself; with few digits V^-1 combines the whole orbit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import IdentificationError
from springcheck.identify.hypothesis import ERRORS
from springcheck.identify.noise import Noise
from springcheck.identify.record import Record
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Extended, Floats, Reals
from springcheck.physics.exact.powers import Rotation
from springcheck.schemes import rotation

CONSTANT_SHOWS = 50.0
"""Gain of chi-squared from which a constant part is fitted in double precision, whose residuals are not
Gaussian: at 25, five standard errors, one file in 700 has a spurious equilibrium."""

CONSTANT_LIKELY = 10.0
"""The same gain for coarse files, where a missing constant is a bias, a superfluous one widens errors."""

FLOOR = 1 / 8
"""Smallest standard error of one component relative to the other's: text has a fine zero."""

LEAST_LEFT = 1 / 16
"""Lower bound on the mean square residual, in squares of the unit roundoff: exact numbers leave less."""

ENOUGH = 8
"""Degrees of freedom below which residuals may be small by chance, so that the lower bound on their mean
square rises to one unit roundoff."""

LEAST_NOISE = 1e-130
"""Smallest size of a pair relative to the largest: the square of its rounding is a double still."""

CERTAIN = 14.0
"""Log of the likelihood ratio from which one of two noise models is chosen."""

FEWEST_UNEVEN = 20
"""Residuals up to which the effect of an uneven clock is not fitted."""

CLEAN = 100.0
"""Largest mean square residual, relative to its expectation, that may still be rounding."""

KURTOSIS = 0.8
"""Variance of the square of a uniform error over its mean squared: chi-squared of n varies by 0.8 n."""

CHANCE = 1e-6
"""Probability of fitting a constant part that is not there."""

UNKNOWN = 1e6
"""Standard deviation, relative to the state, of a pair of frames that is left out of the fit."""

MOST_ROUNDS = 12
"""Most Gauss-Newton steps: three converge to rounding in double precision, five in coarse text."""

SETTLED = 1e-3
"""Predicted gain of chi-squared, relative to its value per residual, below which Gauss-Newton stops."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Map:
    """The map z -> B z between frames of one oscillator, z = (q - centre, v T)/size.

    `covariance` (4, 4) belongs to the entries B11, B12, B21, B22.
    """

    entries: Extended
    covariance: Floats
    size: Extended
    centre: Extended
    z: Extended
    weight: Floats
    """Weight (f - 1,) of each pair: weighted states have a mean square of 2."""
    residual: Floats
    """Root mean square (2,) of the weighted residuals."""
    noise: Noise
    chi2: float
    """Chi-squared of the residuals under the observation model."""
    freedom: int
    conditioned: bool
    """Whether the states span the phase plane beyond the residuals."""
    spans: bool
    """Whether they span it beyond the rounding of the recorded numbers."""
    once: bool | None
    """Whether the states were rounded once, as they were written, and never in the motion; None where that
    does not show, or where they have all digits."""
    drifts: bool = False
    """Whether the constant part is no equilibrium but a constant added to the position in every step."""
    deviations: Extended | None = None
    """Relative deviation (f - 1,) of each step from the mean, where the steps follow the recorded times."""

    @property
    def unscaled(self) -> Extended:
        """The map on (q, v T), both [L]."""
        return np.asarray(self.entries * self.size[:, None] / self.size[None, :])

    @property
    def whole(self) -> bool:
        """Whether the entries are those of one orbit through all states, rather than of pairs."""
        return self.once is True or (self.once is None and not self.noise.diagonal and self.within)

    @property
    def turn(self) -> Rotation:
        """Angle and determinant of the map."""
        return rotation(self.entries[None])

    @property
    def clean(self) -> bool:
        """Whether the residuals may be rounding: at most ten times their expectation."""
        return self.chi2 <= CLEAN * self.freedom

    @property
    def within(self) -> bool:
        """Whether chi-squared agrees with the observation model."""
        return self.chi2 <= self.freedom + ERRORS * math.sqrt(KURTOSIS * self.freedom + 1)

    def residuals(self) -> Floats:
        """Residuals (f - 1, 2) of the map on all pairs of its states, those that were not kept among them."""
        return np.asarray(self.z[1:] - self.z[:-1] @ self.entries.T, np.float64)


def _sizes(z: Extended) -> Extended:
    """Root mean square (2,) of the two components over a turn; growth and decay are divided out."""
    square = z**2
    size = np.sqrt(square.mean(axis=0))
    size = np.where(size == 0, 1, size)
    for _ in range(3):
        norm = square @ size**-2
        share = (square / np.where(norm == 0, 1, norm)[:, None]).mean(axis=0)
        size = np.where(share == 0, size, np.sqrt(share))
    return np.asarray(size * np.sqrt((square @ size**-2).mean() / 2))


@dataclass(slots=True, eq=False)
class _Solution:
    """A minimum of chi-squared: entries and centre, covariance of all unknowns, chi-squared, noise model, and
    what else was fitted."""

    entries: Extended
    centre: Extended
    inverse: Floats
    chi2: float
    noise: Noise
    centred: int
    """Numbers of the constant part: 0 none, 1 an equilibrium at rest, 2 any."""
    deviations: Extended | None
    """The clock's deviations, whose effect on a step has 4 further entries; None where it was not fitted."""

    @property
    def unknowns(self) -> int:
        return len(self.inverse)

    @property
    def cost(self) -> float:
        """Minus twice the log-likelihood, up to a constant."""
        return self.chi2 + self.noise.log_det


def _minimum(
    z: Extended,
    sigma: Floats,
    process: Floats,
    start: _Solution | None,
    centred: int,
    deviations: Extended | None,
) -> _Solution:
    """Gauss-Newton for the map, its constant part, and the effect of the clock's deviations."""
    n = 4 + centred
    x = np.zeros(n if deviations is None else n + 4, np.longdouble)
    x[:n] = _first_guess(z, process, start, centred)
    # of size 1, as everything else
    slipping = None if deviations is None else (deviations / np.max(np.abs(deviations)))[:, None]
    best: _Solution | None = None
    noise = Noise(np.eye(2), 0 * sigma, process) if not np.any(sigma) else None
    for _ in range(MOST_ROUNDS):
        entries, centre = x[:4].reshape(2, 2), np.zeros(2, np.longdouble)
        centre[:centred] = x[4:n]
        state = z - centre
        left = state[1:] - state[:-1] @ entries.T
        if slipping is not None:
            left = left - slipping * (state[:-1] @ x[n:].reshape(2, 2).T)
        r = np.asarray(left, np.float64)
        now = noise or Noise(entries.astype(np.float64), sigma, process)
        weighted = now.solve(r[:, :, None])
        chi2 = float(np.sum(r * weighted[:, :, 0]))
        if best is not None and not chi2 + now.log_det < best.cost:
            break
        seen = state.astype(np.float64)
        if noise is None and chi2 < 100 * r.size:
            seen = seen - now.errors(weighted[:, :, 0])
        columns = np.zeros((*r.shape, len(x)))
        columns[:, 0, :2] = columns[:, 1, 2:4] = seen[:-1]
        columns[:, :, 4:n] = (np.eye(2) - entries.astype(np.float64))[None, :, :centred]
        if slipping is not None:
            columns[:, 0, -4:-2] = columns[:, 1, -2:] = slipping.astype(np.float64) * seen[:-1]
        flat = columns.reshape(r.size, -1)
        square = flat.T @ now.solve(columns).reshape(flat.shape)
        if not np.all(np.isfinite(square)):
            raise IdentificationError(
                "a coordinate rests but for a few frames, or its velocity changes and its position does not: "
                "leave it out"
            )
        size = np.sqrt(np.maximum(np.diag(square), 1e-300))
        inverse = np.linalg.pinv(square / size[:, None] / size, rcond=1e-14, hermitian=True)
        inverse = inverse / size[:, None] / size
        gradient = flat.T @ weighted.reshape(-1)
        best = _Solution(entries, centre, inverse, chi2, now, centred, deviations)
        change = inverse @ gradient
        if gradient @ change <= SETTLED * max(1.0, chi2 / r.size):
            break
        x = x + change
    assert best is not None
    return best


def _first_guess(z: Extended, process: Floats, of: _Solution | None, centred: int) -> Extended:
    """Entries and constant part (4 + `centred`,) of another solution, or by linear least squares where that
    has no constant part."""
    if of is not None and (not centred or np.any(of.centre)):
        return np.concatenate([of.entries.ravel(), of.centre[:centred]])
    if not centred:
        return np.eye(2, dtype=np.longdouble).ravel()
    # any constant is linear in the states; the equilibrium follows from it
    states, weight = z.astype(np.float64), 1 / process[:, None]
    columns = np.concatenate([states[:-1], np.ones((len(process), 1))], axis=1) * weight
    size = np.sqrt(np.sum(columns**2, axis=0))
    size = np.where(size > 0, size, 1)
    x = np.linalg.lstsq(columns / size, states[1:] * weight, rcond=None)[0] / size[:, None]
    centre = np.linalg.pinv((np.eye(2) - x[:2].T)[:, :centred]) @ x[2]
    return np.concatenate([x[:2].T.ravel(), centre]).astype(np.longdouble)


@np.errstate(over="ignore", invalid="ignore")
def fit(record: Record, j: int, *, kept: NDArray[np.bool_] | None = None, constant: bool = False) -> Map:
    """Map of oscillator j from the pairs that are `kept` (f - 1,), or from all.

    A constant part is fitted where it is significant, or always (`constant`): an equilibrium away from 0,
    whose velocity is 0, or else a constant that is added to the position in every step (`drifts`). Raises
    IdentificationError where the states allow no fit.
    """
    z: Extended = np.stack([record.q[:, j], record.v[:, j] * record.interval], axis=1).astype(np.longdouble)
    about, whole = _sizes(z - np.mean(z, axis=0)), _sizes(z)
    size = np.minimum(about, whole) if np.all(whole < 2 * about) else about
    z = np.asarray(z / size, np.longdouble)
    sigma = record.sigma(j) / size.astype(np.float64)
    row = np.max(sigma, axis=1, keepdims=True)
    sigma = np.maximum(sigma, FLOOR * np.where(row > 0, row, np.median(row)))
    # a mode that is a small difference of large coordinates has their roundings
    parts = np.zeros((len(z), 2)) if record.parts is None else record.summed(j) / size.astype(np.float64)
    length = _lengths(z, np.zeros(2), parts)
    # what happens in other pairs than those that are kept is unknown
    kept = np.ones(len(length), np.bool_) if kept is None else kept
    unknown = np.where(kept, 1.0, UNKNOWN / ROUNDING)
    process = ROUNDING * length * unknown
    # neighbours alone first: a map that is far off makes nothing of the orbit
    pairs = process if record.fine else np.hypot(process, np.max(sigma[1:], axis=1))
    best = _constant_part(z, 0 * sigma, pairs, None, record, constant)
    if best.centred:
        # roundings are relative to the distance from the equilibrium, and to that of the equilibrium from 0
        length = _lengths(z, best.centre, parts)
        process = ROUNDING * length * unknown
        if record.fine:
            best = _minimum(z, 0 * sigma, process, best, best.centred, best.deviations)
    if not record.fine:
        best = _constant_part(z, sigma, process, best, record, constant)
    once: bool | None = None
    pairs_kept = int(np.count_nonzero(kept))
    freedom = 2 * pairs_kept - best.unknowns
    if not record.fine:
        other = _fed_back(z, sigma, process, best, freedom)
        odds = (other.cost - best.cost) / 2
        expected = freedom + ERRORS * math.sqrt(KURTOSIS * freedom + 1)
        once = True if odds > CERTAIN and best.chi2 <= expected else False if odds < -CERTAIN else None
        if best.chi2 > expected:
            best = other
    scale = max(best.chi2 / max(freedom, 1), _least(freedom) if record.fine else 1.0)
    if record.deviations is not None and 2 * pairs_kept <= FEWEST_UNEVEN:
        # too few to be fitted, they turn each state on by as much of half a turn at most
        scale = max(scale, (math.pi * float(np.max(np.abs(record.deviations))) / ROUNDING) ** 2)
    covariance = best.inverse[:4, :4] * scale * (1.0 if record.fine else repeats(z))
    state = z - best.centre
    share = length.astype(np.longdouble)[:, None] ** -2
    shift = np.sum(share * state[:-1], axis=0) / np.sum(share) if best.centred else 0 * best.centre
    spread = (state[:-1] - shift).astype(np.float64) / length[:, None]
    weight = np.sqrt(2 * len(spread) / np.sum(spread**2)) / length
    spread = (state[:-1] - shift).astype(np.float64) * weight[:, None]
    smallest = float(np.linalg.eigvalsh(spread.T @ spread / len(spread))[0])
    left = (state[1:] - state[:-1] @ best.entries.T).astype(np.float64) * weight[:, None]
    residual = np.sqrt(np.mean(left[kept] ** 2, axis=0))
    rounded = float(np.max(np.mean((sigma[1:] ** 2 + sigma[:-1] ** 2) * weight[:, None] ** 2, axis=0)))
    spans = smallest > 100 * rounded and smallest > (64 * ROUNDING) ** 2
    return Map(
        weight=weight, residual=residual, spans=spans,
        entries=best.entries, covariance=covariance, size=size, centre=best.centre * size, z=state,
        noise=best.noise, chi2=best.chi2, freedom=freedom, once=once, drifts=best.centred == 2,
        deviations=best.deviations,
        conditioned=spans and smallest > 100 * float(np.max(residual)) ** 2,
    )  # fmt: skip


def _least(freedom: int) -> float:
    """Lower bound on the mean square residual by the degrees of freedom, in squares of the unit roundoff."""
    return max(LEAST_LEFT, min(1.0, ENOUGH / max(freedom, 1)))


def _lengths(z: Extended, centre: Extended | Floats, parts: Floats) -> Floats:
    """Sizes (f - 1,) to which the rounding of each pair is relative, `parts` (f, 2) at least."""
    away = np.sqrt(np.sum(np.maximum(np.abs((z - centre).astype(np.float64)), parts) ** 2, axis=1))
    if not np.any(away[:-1]):
        raise IdentificationError("a coordinate rests but for the last frame: give the part before")
    # a start of few digits, or 0, is exact, but what follows from it is not
    length = np.maximum(away[1:], away[:-1]) + float(np.sqrt(np.sum(centre.astype(np.float64) ** 2)))
    return np.asarray(np.maximum(length, LEAST_NOISE * np.max(length)))


def of_pairs(sizes: Reals, least: float = LEAST_NOISE) -> Reals:
    """Sizes (f - 1, 1) of pairs of frames: the larger of both, and at least a part of the largest of all."""
    return np.asarray(np.maximum(np.maximum(sizes[1:], sizes[:-1]), least * np.max(sizes))[:, None])


def _constant_part(
    z: Extended, sigma: Floats, process: Floats, start: _Solution | None, record: Record, constant: bool
) -> _Solution:
    """Solution with the smallest sufficient constant part, and with the deviations where they show."""
    from scipy.special import fdtri

    numbers, wide = 2 * len(process), None
    least = _least(numbers - 6) if record.fine else 1.0

    def gains(old: _Solution, new: _Solution, least_gain: float) -> bool:
        """Whether further unknowns reduce chi-squared by so much; by chance each reduces it by 1."""
        spare = max(numbers - 6, 1)
        # a few residuals are small by chance: Fisher's F, of one unknown more
        least_gain = max(least_gain, float(fdtri(1, spare, 1 - CHANCE)))
        return old.cost - new.cost > least_gain * max(new.chi2 / spare, least)

    best = _minimum(z, sigma, process, start, 0, None)
    if record.deviations is not None and numbers > FEWEST_UNEVEN:
        wide = _minimum(z, sigma, process, best, 1, None)
        sliding = _minimum(z, sigma, process, wide, 1, record.deviations)
        if gains(wide, sliding, 2 * CONSTANT_SHOWS):
            wide, best = None, _minimum(z, sigma, process, best, 0, record.deviations)
    unknown = best.unknowns
    plain = best.chi2 <= (numbers - unknown) * least
    if numbers <= unknown + 2 or (plain and not constant):
        return best
    wide = wide or _minimum(z, sigma, process, best, 1, best.deviations)
    if constant or gains(best, wide, CONSTANT_SHOWS if record.fine else CONSTANT_LIKELY):
        best = wide
    if record.fine and numbers > unknown + 3 and best.chi2 > (numbers - unknown) * least:
        widest = _minimum(z, sigma, process, best, 2, best.deviations)
        # at rest the roundings are the same in every step, and add up to a constant of their own
        shift = np.max(np.abs((np.eye(2) - widest.entries) @ (widest.centre - best.centre)))
        # where the clock's deviations are too few to be fitted, a constant may stand for them
        slipping = record.deviations is not None and numbers <= FEWEST_UNEVEN
        clean = not slipping or widest.chi2 <= CLEAN * (numbers - unknown - 3)
        if clean and gains(best, widest, CONSTANT_SHOWS) and shift > 64 * ROUNDING * np.max(np.abs(z)):
            best = widest
    return best


def _fed_back(z: Extended, sigma: Floats, process: Floats, found: _Solution, freedom: int) -> _Solution:
    """Solution for states that were rounded in every step as well as when they were written.  The size of the
    rounding in a step is fitted, so that chi-squared equals its degrees of freedom."""
    level = float(np.median(np.max(sigma[1:], axis=1) / process))
    for _ in range(4):
        found = _minimum(z, sigma / 2, level * process, found, found.centred, None)
        share = found.chi2 / freedom
        if 0.9 < share < 1.1:
            break
        level *= math.sqrt(max(share, 0.1))
    return found


def repeats(z: Extended) -> float:
    """Mean number of times that a state recurs: roundings that repeat with the motion do not average out."""
    return len(z) / len(np.unique(z.astype(np.float64) @ [1, 1j]))
