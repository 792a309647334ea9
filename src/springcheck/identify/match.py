"""Known schemes held against the entries of a map: one unknown, (h w)**2, and the others are predictions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.special import chdtri

from springcheck.arrays import Extended, Floats
from springcheck.identify.fit import ROUNDING, Map
from springcheck.schemes import SCHEMES, Scheme, matrix, rotation, roundings

CHANCE = 1e-7
"""Probability with which a right scheme may be refused: five standard errors."""

STRIDES = 12, 100
"""Strides looked at: first up to this many steps per frame, and where nothing fits, up to so many."""

WHOLE = 2
"""Roundings of a step that act on a whole state and not on what a step adds to it."""

HOPELESS = 1e4
"""Chi-squared that is not refined any further after the first few steps: a hundred standard errors."""

NEAR = 0.02
"""Distance of entries, of size 1, within which a first guess is worth refining."""

ONE_STEP = tuple(s for s in SCHEMES.values() if (s.one_step and not s.mixes) or s.flow)
OWN_FRICTION = tuple(s for s in ONE_STEP if any(kind == "friction" for kind, _ in s.stages))


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """A scheme with `stride` steps to a frame against one map; a = (h w)**2, friction is gamma h."""

    scheme: str
    stride: int
    turns: int
    """Whole turns of the phase between two frames, which the frames do not show."""
    a: float
    a_error: float
    friction: float
    log_mass: float
    chi2: float
    freedom: int
    predicted: tuple[float, ...]
    """The four entries, in the frame of the map."""

    @property
    def accepted(self) -> bool:
        """Whether the entries agree within their uncertainty."""
        return self.chi2 <= float(chdtri(self.freedom, CHANCE))


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """How a map is to be matched: what is unknown, and how finely the arithmetic resolves coefficients."""

    damped: bool = False
    mass_unknown: bool = False
    rounding: float = ROUNDING
    jitter: float = 0.0
    bias: float = 0.0
    """How far entries may be off in units of the residuals of their rows, whatever the number of pairs:
    coarse rounding that cuts off, or repeats itself from turn to turn, is no noise that averages away."""
    log_stiffness: float | None = None
    """log(k T**2) where the stiffness is known and the mass is not: the mass follows from a then."""


def unit_matrix(scheme: Scheme, a: Extended, friction: Extended) -> Extended:
    """One-step matrices (c, 2, 2) on (q, v h) for (h w)**2 = a and gamma h = friction, each (c,)."""
    return matrix(scheme, h=1.0, m=np.ones(1, dtype=np.longdouble), k=a, c=friction)


def power(matrices: Extended, strides: Floats) -> Extended:
    """matrices (c, 2, 2) to the powers strides (c,), from phase and determinant."""
    found = rotation(matrices)
    s = np.asarray(strides, dtype=np.longdouble)
    root = np.sqrt(np.abs(found.determinant))
    turning = found.angle > 0
    angle = np.where(turning, found.angle, 0)
    growth = np.where(turning, 0, found.growth)
    even_s, even_1 = (np.where(turning, np.cos(angle * x), np.cosh(growth * x)) for x in (s, 1))
    odd_1 = np.where(turning, np.sin(angle), np.sinh(growth))
    odd_s = np.where(turning, np.sin(angle * s), np.sinh(growth * s))
    flat = odd_1 == 0
    odd = np.where(flat, s, odd_s / np.where(flat, 1, odd_1))
    # real eigenvalues of the sign of the trace: factor the sign out, take it to the power s
    sign = np.where(turning, 1, found.sign)
    normal = matrices * (sign / root)[:, None, None]
    eye = np.eye(2, dtype=np.longdouble)
    out = even_s[:, None, None] * eye + odd[:, None, None] * (normal - even_1[:, None, None] * eye)
    return np.asarray(out * (root**s * np.where(np.mod(s, 2) == 0, 1, sign))[:, None, None])


def frame(
    scheme: Scheme, a: Extended, friction: Extended, log_mass: Extended, s: Floats, size: Extended
) -> Extended:
    """Predicted maps (c, 2, 2) over s steps on (q, v T) in units of `size`, T = s h."""
    out = power(unit_matrix(scheme, a, friction), s)
    up = np.asarray(np.exp(-log_mass) / s * size[1] / size[0])
    out[:, 0, 1] = out[:, 0, 1] * up
    out[:, 1, 0] = out[:, 1, 0] / up
    return out


@cache
def _phases(name: str) -> tuple[tuple[Floats, Floats], ...]:
    """(phase of one step ascending, h w) over each range of h w in which the phase grows or falls."""
    scheme = SCHEMES[name]
    top = min(scheme.limit, 60.0) if scheme.limit > 0 else 4.0
    # the phase bends like a square root at a limit of stability, so points crowd there
    x = top * np.sin(np.linspace(0, np.pi / 2, 2001)[1:-1])
    x = np.concatenate([x[x < 0.05 * top], np.geomspace(0.05 * top, x[-1], 2000)]) if top == 60 else x
    matrices = unit_matrix(scheme, np.square(x.astype(np.longdouble)), np.zeros(1, np.longdouble))
    found = rotation(matrices)
    side = np.where(matrices[:, 0, 1] < 0, -1, 1)
    phase = np.unwrap(np.asarray(side * found.angle, dtype=np.float64))
    rising = np.diff(phase) > 0
    ends = [0, *(np.flatnonzero(rising[1:] != rising[:-1]) + 1).tolist(), len(x) - 1]
    parts = [(phase[a : b + 1], x[a : b + 1]) for a, b in pairwise(ends)]
    return tuple((y, z) if y[-1] > y[0] else (y[::-1], z[::-1]) for y, z in parts)


def _starts(scheme: Scheme, entries: Extended, strides: range) -> tuple[Floats, Floats, Floats]:
    """First guesses: strides, whole turns, and h w, from the phase between frames."""
    phase = float(rotation(entries[None]).angle[0])
    if entries[0, 1] < 0:
        phase = -phase
    if scheme.flow:
        turns = np.arange(0 if phase > 0 else 1, 8, dtype=np.float64)
        return np.ones_like(turns), turns, phase + 2 * np.pi * turns
    s = np.repeat(np.array(strides, dtype=np.float64), [r // 2 + 1 for r in strides])
    turns = np.concatenate([np.arange(r // 2 + 1, dtype=np.float64) for r in strides])
    target = (phase + 2 * np.pi * turns) / s
    parts: list[tuple[Floats, Floats, Floats]] = []
    for phases, x in _phases(scheme.name):
        # the first range begins at the first tabulated step; a phase below it is as good as proportional
        low = 0.0 if phases is _phases(scheme.name)[0][0] else phases[0]
        inside = (target > low) & (target < phases[-1])
        value = np.interp(target[inside], phases, x) * np.minimum(target[inside] / phases[0], 1)
        parts.append((s[inside], turns[inside], value))
    return (
        np.concatenate([part[0] for part in parts]),
        np.concatenate([part[1] for part in parts]),
        np.concatenate([part[2] for part in parts]),
    )


def _decays(found: Map, strides: range) -> tuple[list[float], list[float]]:
    """Strides and first guesses of a from two real rates of growth or decay, whose product it is."""
    b = found.entries.astype(np.float64)
    half = (b[0, 0] + b[1, 1]) / 2
    product = float(b[0, 0] * b[1, 1] - b[0, 1] * b[1, 0])
    if not (half > 0 and product > 0):
        return [], []
    larger = half + np.sqrt(max(half**2 - product, 0.0))
    a = float(np.log(larger) * np.log(product / larger))
    return [float(s) for s in strides], [a / s**2 for s in strides]


def _real_starts(scheme: Scheme, found: Map, strides_wanted: range) -> tuple[Floats, Floats, Floats]:
    """First guesses of a where nothing turns: an inverted spring, friction, or a step beyond the limit."""
    grid = np.concatenate([-np.geomspace(16, 1e-8, 400), np.geomspace(1e-8, 60, 600)])
    zero = np.zeros(1, dtype=np.longdouble)
    strides, values = _decays(found, range(1, 2) if scheme.flow else strides_wanted)
    for s in (1,) if scheme.flow else (1, 2, 3, 4):
        s_all = np.full(len(grid), float(s))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            miss = frame(scheme, grid.astype(np.longdouble), zero, zero, s_all, found.size) - found.entries
            off = np.asarray(np.sum(miss**2, axis=(1, 2)), dtype=np.float64)
        off = np.where(np.isfinite(off), off, np.inf)
        low = np.flatnonzero((off[1:-1] <= off[:-2]) & (off[1:-1] <= off[2:]) & (off[1:-1] < 1)) + 1
        strides += [float(s)] * len(low)
        values += grid[low].tolist()
    return np.array(strides), np.zeros(len(strides)), np.array(values)


def match(scheme: Scheme, found: Map, terms: Terms, strides: range) -> list[Match]:
    """The scheme fitted to a map at these strides, every whole number of unseen turns included."""
    turning = float(rotation(found.entries[None]).angle[0]) > 0
    if turning:
        s, turns, x = _starts(scheme, found.entries, strides)
        a = np.square(x.astype(np.longdouble))
    else:
        s, turns, values = _real_starts(scheme, found, strides)
        a = values.astype(np.longdouble)
    if not len(s):
        return []
    zero = np.zeros(len(s), dtype=np.longdouble)
    unknowns = [a, zero, zero]
    free = [0]
    if terms.damped:
        own = rotation(unit_matrix(scheme, a, zero)).determinant
        all_steps = rotation(found.entries[None]).determinant[0]
        if not all_steps > 0:
            return []
        unknowns[1] = np.log(np.abs(own)) - np.log(all_steps) / s
        free.append(1)
        # friction shrinks areas; what grows beyond the scheme's own growth is no friction
        damped = unknowns[1] > 0
        if not np.any(damped):
            return []
        s, turns, unknowns, zero = s[damped], turns[damped], [x[damped] for x in unknowns], zero[damped]
        if turning:
            # friction slows the phase down, to nothing where it is critical: w**2 = phase**2 + (gamma/2)**2
            unknowns[0] = unknowns[0] + np.square(unknowns[1] / 2)
        a = unknowns[0]
    if terms.mass_unknown and terms.log_stiffness is None:
        guess = frame(scheme, a, unknowns[1], zero, s, found.size)
        up = np.abs(guess[:, 0, 1] / found.entries[0, 1])
        down = np.abs(found.entries[1, 0] / guess[:, 1, 0])
        unknowns[2] = np.log(up * down) / 2
        free.append(2)
    return _refine(scheme, found, terms, s, turns, unknowns, free)


def _refine(
    scheme: Scheme,
    found: Map,
    terms: Terms,
    s: Floats,
    turns: Floats,
    unknowns: list[Extended],
    free: list[int],
) -> list[Match]:
    """Gauss-Newton on the four entries, weighted by their covariance; all first guesses at once."""
    observed = found.entries.reshape(4)

    def log_masses(values: Extended, strides: Floats) -> Extended:
        if terms.log_stiffness is None:
            return values[:, 2]
        return np.asarray(terms.log_stiffness - 2 * np.log(strides) - np.log(np.abs(values[:, 0])))

    def entries_at(values: Extended, strides: Floats) -> Extended:
        masses = log_masses(values, strides)
        return frame(scheme, values[:, 0], values[:, 1], masses, strides, found.size).reshape(-1, 4)

    values = np.stack(unknowns, axis=1)
    with np.errstate(all="ignore"):
        entries = entries_at(values, s)
    if not terms.damped and not terms.mass_unknown:
        # a first guess from the phase is good to 1e-3 where the scheme is right
        off = np.max(np.abs(np.asarray(observed - entries, dtype=np.float64)), axis=1)
        near = off <= NEAR * max(1.0, float(np.max(np.abs(observed))))
        near |= off <= 10 * np.sqrt(found.covariance.max())
        near[np.argmin(off)] = True
        values, entries, s, turns = values[near], entries[near], s[near], turns[near]
    weights = _weights(scheme, found, terms, s, values[:, 0], values[:, 1])
    kept = values.copy()
    chi2, errors, stalled = np.full(len(s), np.inf), np.zeros(len(s)), np.zeros(len(s), dtype=int)
    alive = np.arange(len(s))
    # Newton's steps double the digits of a phase known to 1e-3, and what has not come close by then will not
    hopeless = 4 if len(free) == 1 else 10
    with np.errstate(all="ignore"):
        for turn in range(20):
            now_s, now_weights, now_values = s[alive], weights[alive], values[alive]
            predicted = entries_at(now_values, now_s)
            miss = np.asarray(observed - predicted, dtype=np.float64)
            now = np.einsum("ci,cij,cj->c", miss, now_weights, miss)
            slopes = np.empty((len(alive), 4, len(free)))
            for column, i in enumerate(free):
                # a difference quotient: its error slows the iteration, it does not move the end
                delta = (
                    np.abs(now_values[:, 0]) * 1e-5 if i == 0 else np.full(len(alive), np.longdouble(1e-6))
                )
                shift = np.zeros_like(now_values)
                shift[:, i] = delta
                rise = entries_at(now_values + shift, now_s) - entries_at(now_values - shift, now_s)
                slopes[:, :, column] = (rise / (2 * delta[:, None])).astype(np.float64)
            inverse = _inverse(np.einsum("cia,cij,cjb->cab", slopes, now_weights, slopes))
            better = now < chi2[alive]
            stalled[alive] = np.where(now < 0.9 * chi2[alive], 0, stalled[alive] + 1)
            new = alive[better]
            kept[new], entries[new], chi2[new] = now_values[better], predicted[better], now[better]
            errors[new] = np.sqrt(inverse[better, 0, 0])
            change = np.nan_to_num(np.einsum("cab,cib,cij,cj->ca", inverse, slopes, now_weights, miss))
            limit = 0.5 * np.abs(now_values[:, 0].astype(np.float64))
            change[:, 0] = np.clip(change[:, 0], -limit, limit)
            values[alive[:, None], free] += change
            going = (stalled[alive] < 2) & (np.abs(change[:, 0]) > 1e-17 * np.abs(now_values[:, 0]))
            alive = alive[going & ((turn < hopeless) | (chi2[alive] < HOPELESS))]
            if not len(alive):
                break
    masses = log_masses(kept, s)
    physical = kept[:, 1] > 0 if terms.damped else np.ones(len(s), dtype=bool)
    return [
        Match(
            scheme=scheme.name,
            stride=int(s[i]),
            turns=int(turns[i]),
            a=float(kept[i, 0]),
            a_error=float(errors[i]),
            friction=float(kept[i, 1]),
            log_mass=float(masses[i]),
            chi2=float(chi2[i]),
            freedom=4 - len(free),
            predicted=tuple(float(x) for x in entries[i]),
        )
        for i in np.flatnonzero(np.isfinite(chi2) & physical)
    ]


def _inverse(normal: Floats) -> Floats:
    """Inverses of positive matrices (c, i, i) whose diagonals differ by many powers of ten."""
    if normal.shape[-1] == 1:
        return np.where(normal > 0, 1 / np.where(normal > 0, normal, 1), 0.0)
    scale = np.sqrt(np.einsum("caa->ca", normal))
    scale = np.where(np.isfinite(scale) & (scale > 0), scale, 1.0)
    even = np.nan_to_num(normal / scale[:, :, None] / scale[:, None, :], posinf=0, neginf=0)
    return np.asarray(np.linalg.pinv(even, hermitian=True) / scale[:, :, None] / scale[:, None, :])


def _weights(scheme: Scheme, found: Map, terms: Terms, s: Floats, a: Extended, friction: Extended) -> Floats:
    """Inverse covariances (c, 4, 4): of the fit, of coefficients rounded once, of the interval.

    The rounding of h k or h/m is the same in every step, so no number of pairs averages it away: an entry
    of the map over s steps is uncertain by the roundings of its path times what s steps add to a state,
    s h w of it and no more than s, whatever the fit says.  A factor near 1, of friction or of a velocity
    that is rebuilt over the step, is rounded as well, and acts on the whole state in each of s steps.
    """
    b = np.abs(found.entries.astype(np.float64))
    largest = max(1.0, float(np.max(b)))
    path = 1 if scheme.flow else roundings(scheme)
    added = np.minimum(np.sqrt(np.abs(a)) + np.abs(friction), 1).astype(np.float64)
    coherent = terms.rounding * (path * added + WHOLE) * s * largest
    clock = np.diag((terms.jitter * b * np.array([[0, 1], [1, 0]])).reshape(4) ** 2)
    bias = np.diag(np.repeat(terms.bias * found.residual, 2) ** 2)
    total = found.covariance + clock + bias + coherent[:, None, None] ** 2 * np.eye(4)
    return _inverse(total)
