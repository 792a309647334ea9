"""Fit of all hypotheses to measured maps at once, by Gauss-Newton and chi-squared.

A hypothesis is a family of one-step maps, a number of steps to a frame, and a number of whole turns between
two frames.  Each matrix root of the measured map is a possible step: its phase gives a first guess of
(h w)**2 for every family, its determinant one of the friction, and the four entries decide.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from springcheck.identify.families import Family
from springcheck.identify.fit import Map
from springcheck.identify.guesses import Guesses, Roots, first, least_squares, polished, roots_of_map
from springcheck.identify.hypothesis import Joint, Match, Terms, most
from springcheck.identify.maps import MapTable, table
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats, Reals

WHOLE = 2
"""Roundings of a step relative to the whole state, beside those relative to its increment."""

COARSE_ERROR = 1e-9
"""Error of the entries above which double precision suffices for their prediction."""


class Target:
    """A measured map with the covariance of its entries: of the fit, the scale of velocities, biased
    forces."""

    def __init__(self, found: Map, terms: Terms) -> None:
        self.found, self.terms = found, terms
        self.observed = found.entries.reshape(4)
        self.ratio = found.size[1] / found.size[0]
        self.largest = max(1.0, float(np.max(np.abs(self.observed))))
        shear = (0 if terms.vague else terms.jitter) * self.observed.astype(np.float64) * [0, 1, -1, 0]
        bias = terms.bias * np.repeat(found.residual, 2)
        values, self.axes = np.linalg.eigh(found.covariance + np.outer(shear, shear) + np.diag(bias**2))
        self.variance = np.maximum(values, 1e-15 * values[-1])

    def weight(self, every: MapTable, x: Guesses, s: Floats) -> Floats:
        """Reciprocal errors (4, c) along the axes of the covariance.

        A coefficient, as h k or h/m, is rounded once, which no number of pairs averages out: an entry of the
        map of s steps is uncertain by the roundings of the family's path times the increment of s steps.
        """
        added = np.minimum(np.sqrt(np.abs(x.a)) + np.abs(x.g), 1)
        # neither are roundings of the whole state averaged out, but for sums in double precision
        scaled = every.scaled[x.which] | (self.terms.rounding > ROUNDING)
        whole = np.where(scaled, WHOLE, WHOLE / math.sqrt(len(self.found.z)))
        whole = (every.path[x.which] * added + whole) * s * self.largest * self.terms.rounding
        return np.asarray(1 / np.sqrt(self.variance[:, None] + whole**2))

    def entries(self, every: MapTable, x: Guesses, s: Floats, values: Reals) -> Reals:
        a, g, log_mass = values
        if self.terms.log_stiffness is not None:
            log_mass = self.terms.log_stiffness - 2 * np.log(s) - np.log(np.abs(a))
        elif self.terms.scales:
            log_mass = log_mass + np.array(self.terms.scales, values.dtype)[s.astype(int)]
        return np.asarray(every.frame(x.which, a, g, log_mass, s, np.full(len(s), self.ratio, values.dtype)))


def matches(
    found: Map, terms: Terms, families: tuple[Family, ...], strides: Iterable[int], *, far: bool = False
) -> list[Match]:
    """Best fit of each family and stride to a map, if chi-squared accepts it; with `far` in any case."""
    every = table(families)
    with np.errstate(all="ignore"):
        roots = replace(roots_of_map(found, tuple(strides)))
        if not len(roots.s):
            return []
        # the scale of velocities is as uncertain as the interval, and where it is known, that of a number in
        # single precision
        roots.error += terms.bias * float(np.max(found.residual))
        roots.error += terms.rounding * 20 * float(np.max(roots.s))
        roots.error += float(np.max(np.abs(terms.scales), initial=0.0))
        free_scale = terms.mass_unknown
        near = replace(roots, error=roots.error + terms.jitter)
        x = first(every, near, growing=terms.growing, free_scale=free_scale, far=far)
        # an interval that each hypothesis sets for itself leaves no error to the entries
        roots, free_scale = (roots, True) if terms.vague else (near, free_scale)
        if not all(family.flow for family in families):
            # an exact solution has the phase and the determinant of the root from the start
            x = polished(every, roots, x, free_scale=free_scale, far=far)
        if not len(x.a):
            return []
        return solved(every, Target(found, terms), roots, x, far=far)


def solved(
    every: MapTable, target: Target, roots: Roots, x: Guesses, *, far: bool = False, every_turn: bool = False
) -> list[Match]:
    """Best fit from these guesses for each family and stride, of those that chi-squared accepts (`far`: of
    all); with `every_turn` for each number of turns and each spring."""
    terms = target.terms
    free = [0, 1] if every.damped else [0]
    if terms.vague or (terms.mass_unknown and terms.log_stiffness is None):
        free.append(2)
    freedom = len(target.observed) + terms.vague - len(free)
    s = roots.s[x.root]
    values = np.stack([x.a, x.g, np.zeros_like(x.a)])
    if roots.error < COARSE_ERROR:
        values = values.astype(np.longdouble)
    if 2 in free:
        predicted = target.entries(every, x, s, values)
        scale = np.abs(predicted[1] / target.observed[1] * target.observed[2] / predicted[2])
        values[2] = np.nan_to_num(np.log(scale) / 2)
    weight = target.weight(every, x, s)

    def left(values: Reals) -> tuple[Reals, Floats]:
        entries = target.entries(every, x, s, values)
        off = (target.observed[:, None] - entries).astype(np.float64)
        known = [values[2].astype(np.float64) / terms.jitter] if terms.vague else []
        return entries, np.vstack([target.axes.T @ off * weight, *known])

    entries, r = left(values)
    chi2 = np.sum(r**2, axis=0)
    best = values, entries, chi2
    errors = np.zeros((3, len(s)))
    for _ in range(8):
        slopes = []
        for i in free:
            d = np.abs(values[0]) * 1e-8 if i == 0 else np.full(len(s), 1e-8, values.dtype)
            moved = values.copy()
            moved[i] += d
            slopes.append((r - left(moved)[1]) / d.astype(np.float64))
        step, variance = least_squares(np.array(slopes), r)
        errors[free] = np.sqrt(np.abs(variance))
        limit = 0.5 * np.abs(values[0].astype(np.float64))
        step[0] = np.clip(step[0], -limit, limit)
        values = values.copy()
        values[free] += step
        entries, r = left(values)
        new = np.sum(r**2, axis=0)
        better = new < best[2]
        gain = np.max((best[2] - new)[better] / (1 + new[better]), initial=0.0)
        best = (np.where(better, values, best[0]), np.where(better, entries, best[1]),
                np.where(better, new, best[2]))  # fmt: skip
        if not gain > 1e-6:
            break
    values, entries, chi2 = best
    good = np.isfinite(chi2) & np.all(np.isfinite(entries), axis=0)
    # a rounding of times is bounded: by chance an interval is off by its jitter at most
    timed = np.abs(values[2]) <= terms.jitter if terms.vague else True
    good &= (chi2 <= most(freedom)) & timed | far
    if every.damped and not terms.growing:
        good &= (values[1] > 0) | every.held[x.which]
    kept: dict[tuple[Any, ...], tuple[float, float, int]] = {}
    for i in np.flatnonzero(good).tolist():
        key: tuple[Any, ...] = int(x.which[i]), int(s[i])
        if every_turn:
            # one number of turns, to the left or right and on each branch of a scheme, is several springs
            key += tuple(f"{float(y):.6g}" for y in values[:2, i])
        # a free scale of velocities lets steps of several lengths fit: the shortest is the simplest
        scaled = free[-1] == 2 and freedom <= 2 and not terms.vague
        close = abs(float(values[0, i])) if scaled else float(chi2[i])
        turns = float(roots.turns[x.root[i]])
        rank = (0.0 if far else turns), close, i
        kept[key] = min(kept.get(key, rank), rank)
    out = []
    for (which, stride, *_), (_, _, i) in kept.items():
        a, g, log_mass = (float(y) for y in values[:, i])
        if terms.log_stiffness is not None:
            log_mass = terms.log_stiffness - 2 * math.log(stride) - math.log(abs(a))
        elif terms.scales:
            log_mass += terms.scales[stride]
        out.append(
            Match(
                family=every.families[which].name, stride=stride, turns=int(roots.turns[x.root[i]]),
                a=a, a_error=float(errors[0, i]), g=g, g_error=float(errors[1, i]), log_mass=log_mass,
                mass_error=float(errors[2, i]), chi2=float(chi2[i]), freedom=max(freedom, 1),
                predicted=tuple(entries[:, i].astype(np.longdouble)),
            )
        )  # fmt: skip
    return out


def compare(
    maps: list[Map],
    terms: list[Terms],
    families: tuple[Family, ...],
    strides: Iterable[int],
    *,
    far: bool = False,
) -> list[Joint]:
    """Families and strides that fit every oscillator, the simplest first; with `far` all, at their best.
    What one oscillator excludes is not tried on the others."""
    steps = list(strides)
    parts: list[dict[tuple[str, int], Match]] = []
    for found, what in zip(maps, terms, strict=True):
        fitting = {(x.family, x.stride): x for x in matches(found, what, families, steps, far=far)}
        parts.append(fitting)
        families = tuple(f for f in families if any(f.name == name for name, _ in fitting))
        steps = sorted({s for _, s in fitting})
        if not families:
            return []
    shared = (key for key in parts[0] if all(key in x for x in parts))
    joints = [Joint(family=key[0], stride=key[1], parts=tuple(x[key] for x in parts)) for key in shared]
    return sorted(joints, key=lambda x: x.simplicity)


nearest = partial(compare, far=True)
"""Best fit of every family and stride, accepted or not."""
