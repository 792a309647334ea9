"""Families held against the entries of a map: one unknown or two, and the other entries are predictions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from springcheck.arrays import Extended, Floats
from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import Map
from springcheck.identify.starts import (
    Roots,
    Terms,
    flow_starts,
    frame,
    inverse,
    real_starts,
    roots,
    starts,
)
from springcheck.schemes import rotation

CHANCE = 1e-7
"""Probability with which a right scheme may be refused: five standard errors."""

STRIDES = 12, 100
"""Strides looked at: first up to this many steps per frame, and where nothing fits, up to so many."""

WHOLE = 2
"""Roundings of a step that act on a whole state and not on what a step adds to it."""

FAR = 1e300
"""Chi-squared of what is not worth a comparison."""

HOPELESS = 1e4
"""Chi-squared that is not refined any further after the first few steps: a hundred standard errors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """A family with `stride` steps to a frame against one map; a = (h w)**2, g its second unknown."""

    family: str
    stride: int
    turns: int
    """Whole turns of the phase between two frames, which the frames do not show."""
    a: float
    a_error: float
    g: float
    g_error: float
    log_mass: float
    mass_error: float
    chi2: float
    freedom: int
    predicted: tuple[float, ...]
    """The four entries, in the frame of the map."""

    @property
    def accepted(self) -> bool:
        """Whether the entries agree within their uncertainty."""
        return self.chi2 <= float(chdtri(self.freedom, CHANCE))

    @property
    def scheme(self) -> str:
        return FAMILIES[self.family].scheme

    @property
    def friction(self) -> float:
        """g where it is friction, 0 where it is not."""
        return 0.0 if FAMILIES[self.family].held else self.g


def match(family: Family, found: Map, terms: Terms, strides: range, root: Roots | None = None) -> list[Match]:
    """The family fitted to a map at these strides; `root` are the map's roots where it turns."""
    base = FAMILIES[family.scheme] if family.damped and not family.held else family
    far = False
    if rotation(found.entries[None]).angle[0] > 0:
        if family.flow:
            s, turns, a, g = flow_starts(found, damped=family.damped, growing=terms.growing)
        else:
            spread = 100 * float(np.sqrt(found.covariance.max()))
            s, turns, a, g, far = starts(family, base, root or roots(found, strides), terms, spread)
    elif family.held:
        return []
    else:
        s, turns, values = real_starts(base, found, strides)
        a, g = values.astype(np.longdouble), np.zeros(len(s), dtype=np.longdouble)
        if family.damped and len(s):
            own = rotation(base.unit(a, g)).determinant
            total = rotation(found.entries[None]).determinant[0]
            if not total > 0:
                return []
            with np.errstate(all="ignore"):
                g = np.log(np.abs(own)) - np.log(total) / s
            good = np.isfinite(g) & ((g > 0) | terms.growing)
            s, turns, a, g = s[good], turns[good], a[good], g[good]
    if not len(s):
        return []
    unknowns = [a, g, np.zeros_like(a)]
    free = [0, 1] if family.damped else [0]
    if terms.mass_unknown and terms.log_stiffness is None:
        with np.errstate(all="ignore"):
            guess = frame(family, a, g, unknowns[2], s, found.size)
            up = np.abs(guess[:, 0, 1] / found.entries[0, 1])
            down = np.abs(found.entries[1, 0] / guess[:, 1, 0])
            unknowns[2] = np.nan_to_num(np.log(up * down) / 2)
        free.append(2)
    return _refine(family, found, terms, s, turns, unknowns, free, rounds=1 if far else 20)


def _refine(
    family: Family,
    found: Map,
    terms: Terms,
    s: Floats,
    turns: Floats,
    unknowns: list[Extended],
    free: list[int],
    *,
    rounds: int,
) -> list[Match]:
    """Gauss-Newton on the four entries, weighted by their covariance; all first guesses at once."""
    observed = found.entries.reshape(4)

    def log_masses(values: Extended, strides: Floats) -> Extended:
        if terms.log_stiffness is None:
            return values[:, 2]
        return np.asarray(terms.log_stiffness - 2 * np.log(strides) - np.log(np.abs(values[:, 0])))

    def entries_at(values: Extended, strides: Floats) -> Extended:
        masses = log_masses(values, strides)
        return frame(family, values[:, 0], values[:, 1], masses, strides, found.size).reshape(-1, 4)

    values = np.stack(unknowns, axis=1)
    if rounds == 1:
        # far off: what it predicts is wanted, and no best fit
        with np.errstate(all="ignore"):
            entries = entries_at(values, s)
        chi2, errors = np.full(len(s), FAR), np.zeros((len(s), 3))
        return _matches(
            family, terms, s, turns, values, log_masses(values, s), errors, chi2, entries, len(free)
        )
    weights = _weights(family, found, terms, s, values[:, 0], values[:, 1])
    kept, entries = values.copy(), np.zeros((len(s), 4), dtype=np.longdouble)
    chi2, stalled = np.full(len(s), np.inf), np.zeros(len(s), dtype=int)
    errors = np.zeros((len(s), 3))
    alive = np.arange(len(s))
    # Newton's steps double the digits of a guess, and what has not come close by then will not
    hopeless = 4 if len(free) == 1 else 8
    with np.errstate(all="ignore"):
        for turn in range(rounds):
            now_s, now_weights, now_values = s[alive], weights[alive], values[alive]
            predicted = entries_at(now_values, now_s)
            miss = np.asarray(observed - predicted, dtype=np.float64)
            now = np.einsum("ci,cij,cj->c", miss, now_weights, miss)
            better = now < chi2[alive]
            stalled[alive] = np.where(now < 0.9 * chi2[alive], 0, stalled[alive] + 1)
            new = alive[better]
            kept[new], entries[new], chi2[new] = now_values[better], predicted[better], now[better]
            going = (stalled[alive] < 2) & ((turn < hopeless) | (chi2[alive] < HOPELESS))
            if not np.any(going):
                break
            slopes = np.empty((len(alive), 4, len(free)))
            for column, i in enumerate(free):
                # a difference quotient: its error slows the iteration, it does not move the end
                delta = (
                    np.abs(now_values[:, 0]) * 1e-5 if i == 0 else np.full(len(alive), np.longdouble(1e-6))
                )
                shift = np.zeros_like(now_values)
                shift[:, i] = delta
                rise = entries_at(now_values + shift, now_s) - predicted
                slopes[:, :, column] = (rise / delta[:, None]).astype(np.float64)
            spread = inverse(np.einsum("cia,cij,cjb->cab", slopes, now_weights, slopes))
            errors[np.ix_(new, free)] = np.sqrt(np.abs(np.einsum("cii->ci", spread[better])))
            change = np.nan_to_num(np.einsum("cab,cib,cij,cj->ca", spread, slopes, now_weights, miss))
            limit = 0.5 * np.abs(now_values[:, 0].astype(np.float64))
            change[:, 0] = np.clip(change[:, 0], -limit, limit)
            values[alive[:, None], free] += change
            going &= np.any(np.abs(change) > 1e-17 * np.maximum(np.abs(now_values[:, free]), 1e-300), axis=1)
            alive = alive[going]
            if not len(alive):
                break
    masses = log_masses(kept, s)
    return _matches(family, terms, s, turns, kept, masses, errors, chi2, entries, len(free))


def _matches(
    family: Family,
    terms: Terms,
    s: Floats,
    turns: Floats,
    kept: Extended,
    masses: Extended,
    errors: Floats,
    chi2: Floats,
    entries: Extended,
    unknowns: int,
) -> list[Match]:
    physical = np.isfinite(chi2) & np.all(np.isfinite(entries), axis=1)
    if family.damped and not family.held and not terms.growing:
        physical &= kept[:, 1] > 0
    return [
        Match(
            family=family.name,
            stride=int(s[i]),
            turns=int(turns[i]),
            a=float(kept[i, 0]),
            a_error=float(errors[i, 0]),
            g=float(kept[i, 1]),
            g_error=float(errors[i, 1]),
            log_mass=float(masses[i]),
            mass_error=float(errors[i, 2]),
            chi2=float(chi2[i]),
            freedom=4 - unknowns,
            predicted=tuple(float(x) for x in entries[i]),
        )
        for i in np.flatnonzero(physical)
    ]


def _weights(family: Family, found: Map, terms: Terms, s: Floats, a: Extended, g: Extended) -> Floats:
    """Inverse covariances (c, 4, 4): of the fit, of coefficients rounded once, of the interval.

    The rounding of h k or h/m is the same in every step, so no number of pairs averages it away: an entry
    of the map over s steps is uncertain by the roundings of its path times what s steps add to a state,
    s h w of it and no more than s, whatever the fit says.  A factor near 1, of friction or of a velocity
    that is rebuilt over the step, is rounded as well, and acts on the whole state in each of s steps.
    """
    b = np.abs(found.entries.astype(np.float64))
    largest = max(1.0, float(np.max(b)))
    added = np.minimum(np.sqrt(np.abs(a)) + np.abs(g), 1).astype(np.float64)
    coherent = terms.rounding * (family.path * added + WHOLE) * s * largest
    clock = np.diag((terms.jitter * b * np.array([[0, 1], [1, 0]])).reshape(4) ** 2)
    bias = np.diag(np.repeat(terms.bias * found.residual, 2) ** 2)
    total = found.covariance + clock + bias + coherent[:, None, None] ** 2 * np.eye(4)
    return inverse(total)
