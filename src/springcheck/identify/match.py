"""Families held against the entries of maps: one unknown or two, and the other entries are predictions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import chdtri

from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import ROUNDING, Map
from springcheck.identify.maps import Table, table
from springcheck.identify.solve import least_squares
from springcheck.identify.starts import Guesses, Terms, joined, real_starts, starts
from springcheck.physics.arrays import Extended, Floats, Integers, Reals

CHANCE = 1e-7
"""Probability with which a right scheme may be refused: five standard errors."""

WHOLE = 2
"""Roundings of a step that act on a whole state and not on what a step adds to it."""

FAR = 1e300
"""Chi-squared of what is not worth a comparison."""

HOPELESS = 1e4
"""Chi-squared that is not refined any further after the first few steps: a hundred standard errors."""

ROUNDS = 20
"""Newton's steps at most; they double the digits of a guess."""

SETTLED = 1e-4, 1e-12
"""Share of 1 + chi-squared by which another step must promise to bring it down, in double and in extended
precision."""

FEW = 8
"""Candidates that are refined in extended precision at once."""

OPERATIONS = 8
"""Roundings of double precision that a predicted entry may be off by, in units of `Targets.coherent`."""


@cache
def most(freedom: int) -> float:
    """Largest chi-squared that is accepted."""
    return float(chdtri(freedom, CHANCE))


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
    predicted: tuple[np.longdouble, ...]
    """The four entries, in the frame of the map."""

    @property
    def accepted(self) -> bool:
        """Whether the entries agree within their uncertainty."""
        return self.chi2 <= most(self.freedom)

    @property
    def scheme(self) -> str:
        return FAMILIES[self.family].scheme

    @property
    def friction(self) -> float:
        """g where it is friction, 0 where it is not."""
        return 0.0 if FAMILIES[self.family].held else self.g


class Targets:
    """Maps that families are held against, and the errors of their entries.

    The covariance of a candidate is that of the fit and the interval, the same for all, and of coefficients
    rounded once, a multiple of 1: in the eigenvectors of the former it is diagonal.
    """

    def __init__(self, maps: Sequence[Map], terms: Sequence[Terms]) -> None:
        self.terms = terms[0]
        self.observed: Extended = np.stack([found.entries.reshape(4) for found in maps])
        self.ratio: Extended = np.array([found.size[1] / found.size[0] for found in maps])
        sizes = np.abs(self.observed.astype(np.float64))
        self.largest = np.maximum(1.0, sizes.max(axis=1))
        self.log_stiffness = None
        if terms[0].log_stiffness is not None:
            self.log_stiffness = np.array([x.log_stiffness for x in terms], np.float64)
        self.log_mass = np.array([x.log_mass for x in terms], np.longdouble)
        self.scaled = bool(self.log_mass.size)
        covariance = np.stack([found.covariance for found in maps])
        diagonal = np.stack(
            [np.repeat(x.bias * found.residual, 2) for found, x in zip(maps, terms, strict=True)]
        )
        # velocities count in positions an interval, of which the times show no more than their digits
        share = math.hypot(terms[0].scale, terms[0].jitter)
        shear = share * self.observed.astype(np.float64) * [0, 1, -1, 0]
        covariance = covariance + shear[:, :, None] * shear[:, None, :]
        values, self.axes = np.linalg.eigh(covariance + diagonal[:, :, None] ** 2 * np.eye(4))
        self.variance = np.maximum(values, 1e-15 * values[:, -1:])

    def coherent(self, every: Table, x: Guesses, a: Reals, g: Reals) -> Floats:
        """What roundings of coefficients do to an entry (c,), the same in every step.

        No number of pairs averages the rounding of h k or h/m away: an entry of the map over s steps is
        uncertain by the roundings of its path times what s steps add to a state, s h w of it and no more
        than s, whatever the fit says.  A factor near 1, of friction or of a velocity that is rebuilt over
        the step, is rounded as well, and acts on the whole state in each of s steps.
        """
        added = np.minimum(np.sqrt(np.abs(a)) + np.abs(g), 1).astype(np.float64)
        return np.asarray((every.path[x.which] * added + WHOLE) * x.s * self.largest[x.of])

    def log_masses(self, x: Guesses, values: Reals) -> Reals:
        if self.log_stiffness is None:
            if not self.scaled:
                return np.asarray(values[2])
            return np.asarray(values[2] + self.log_mass[x.of, x.s.astype(int)].astype(values.dtype))
        return np.asarray(self.log_stiffness[x.of] - 2 * np.log(x.s) - np.log(np.abs(values[0])))

    def entries(self, every: Table, x: Guesses, values: Reals) -> Reals:
        """Predicted entries (4, c) of unknowns (3, c): a, g and the log of the mass."""
        masses = self.log_masses(x, values)
        return every.frame(x.which, values[0], values[1], masses, x.s, self.ratio[x.of])

    def turned(self, of: Integers, off: Reals) -> Floats:
        """Differences of entries (4, m, c) along the axes of their errors."""
        rows = off.astype(np.float64)
        if len(self.axes) == 1:
            rows = self.axes[0].T @ rows.reshape(4, -1)
            return np.asarray(rows).reshape(off.shape)
        return np.asarray(np.einsum("cji,jmc->imc", self.axes[of], rows))


def _targets(maps: Sequence[Map], terms: Sequence[Terms]) -> Targets:
    if len(maps) > 1:
        return Targets(maps, terms)
    asked = "targets", terms[0]
    if asked not in maps[0].found:
        maps[0].found[asked] = Targets(maps, terms)
    out: Targets = maps[0].found[asked]
    return out


def match(
    families: tuple[Family, ...],
    maps: Sequence[Map],
    terms: Sequence[Terms],
    strides: range,
    *,
    keys: set[tuple[str, int]] | None = None,
    far: bool = False,
) -> list[dict[tuple[str, int], Match]]:
    """The best match of each family and stride with each map, of those in `keys` where these are given.

    What cannot be accepted is given only where `far` asks for it.
    """
    every = table(families)
    with np.errstate(all="ignore"):
        target = _targets(maps, terms)
        errors = np.sqrt(target.variance[:, -1])
        errors += (
            terms[0].rounding * (float(np.max(every.path)) + WHOLE) * (strides.stop - 1) * target.largest
        )
        parts = []
        for of, (found, what) in enumerate(zip(maps, terms, strict=True)):
            turning = bool(found.turn.angle[0] > 0)
            if not turning and not found.turn.determinant[0] > 0 and every.damped:
                continue
            error = float(errors[of])
            asked = "starts", of, families, strides, error, what.mass_unknown, what.growing, far
            if asked not in found.found:
                found.found[asked] = (
                    starts(every, found, of, what, strides, error, far=far)
                    if turning
                    else real_starts(every, found, of, what, strides)
                )
            parts.append(found.found[asked])
        out: list[dict[tuple[str, int], Match]] = [{} for _ in maps]
        if not parts:
            return out
        guesses = joined(parts)
        if keys is not None:
            wanted = np.zeros((len(families), strides.stop), dtype=bool)
            for name, stride in keys:
                wanted[[f.name for f in families].index(name), stride] = True
            guesses = guesses[np.flatnonzero(wanted[guesses.which, guesses.s.astype(int)])]
        if len(guesses.s):
            _matched(every, target, guesses, out, far=far)
    return out


def _matched(
    every: Table, target: Targets, guesses: Guesses, out: list[dict[tuple[str, int], Match]], *, far: bool
) -> None:
    """Candidates in double precision first, and what may be accepted then in extended precision."""
    free = [0, 1] if every.damped else [0]
    values = np.stack([guesses.a, guesses.g, np.zeros_like(guesses.a)])
    if target.terms.mass_unknown and target.log_stiffness is None:
        free.append(2)
        predicted = target.entries(every, guesses, values)
        observed = target.observed[guesses.of].astype(np.float64).T
        scale = np.abs(predicted[1] / observed[1]) * np.abs(observed[2] / predicted[2])
        values[2] = np.nan_to_num(np.log(scale) / 2)
    freedom = 4 - len(free)
    if far and not np.all(guesses.near):
        # what it predicts is wanted, and no best fit
        at = np.flatnonzero(~guesses.near)
        entries = target.entries(every, guesses[at], values[:, at])
        chi2 = np.full(len(at), FAR)
        _best(every, target, guesses[at], values[:, at], chi2, entries, 0 * entries[:3], freedom, out)
    at = np.flatnonzero(guesses.near)
    x, values = guesses[at], values[:, at]
    if far or len(at) > FEW:
        chi2, values, entries, errors = _refined(every, target, x, values, free)
        if far:
            _best(every, target, x, values, chi2, entries, errors, freedom, out)
        # roundings of double precision, in standard errors of an entry
        whole = target.coherent(every, x, values[0], values[1])
        error = np.sqrt((target.terms.rounding * whole) ** 2 + target.variance[x.of, 0])
        room = np.sqrt(most(freedom)) + OPERATIONS * ROUNDING * whole / error
        likely = np.flatnonzero(chi2 <= room**2)
        x, values = x[likely], values[:, likely]
    if len(x.s):
        chi2, values, entries, errors = _refined(every, target, x, values.astype(np.longdouble), free)
        _best(every, target, x, values, chi2, entries, errors, freedom, out)


def _refined(
    every: Table, target: Targets, x: Guesses, values: Reals, free: list[int]
) -> tuple[Floats, Reals, Reals, Floats]:
    """Gauss-Newton on the four entries, by their covariance, in the width of the values (3, c): chi-squared
    (c,), values, entries (4, c) and errors (3, c)."""
    n = len(x.s)
    whole = target.terms.rounding * target.coherent(every, x, values[0], values[1])
    weight = 1 / np.sqrt(target.variance[x.of].T + whole**2)
    observed = target.observed[x.of].T.astype(values.dtype)
    kept, entries = values.copy(), np.zeros((4, n), dtype=values.dtype)
    chi2, stalled, errors = np.full(n, np.inf), np.zeros(n, dtype=int), np.zeros((3, n))
    alive = np.arange(n)
    least = SETTLED[values.dtype.itemsize > 8]
    hopeless = 4 if len(free) == 1 else 8
    # a difference quotient: its error slows the iteration, it does not move the end
    for turn in range(ROUNDS):
        if not len(alive):
            break
        now = values[:, alive]
        d = np.stack([np.abs(now[0]) * 1e-5 if i == 0 else np.full(len(alive), 1e-6) for i in free])
        tried = np.repeat(now[:, None], 1 + len(free), axis=1)
        for k, i in enumerate(free):
            tried[i, 1 + k] += d[k]
        predicted = target.entries(every, x[np.tile(alive, 1 + len(free))], tried.reshape(3, -1)).reshape(
            4, 1 + len(free), -1
        )
        of, rows = x.of[alive], weight[:, alive]
        predicted[:, 1:] = (predicted[:, 1:] - predicted[:, :1]) / d
        best = predicted[:, 0].copy()
        predicted[:, 0] = observed[:, alive] - best
        miss, *slopes = np.moveaxis(target.turned(of, predicted) * rows[:, None], 1, 0)
        size = np.sum(miss**2, axis=0)
        better = size < chi2[alive]
        stalled[alive] = np.where(size < 0.9 * chi2[alive], 0, stalled[alive] + 1)
        new = alive[better]
        kept[:, new], entries[:, new], chi2[new] = now[:, better], best[:, better], size[better]
        change, variance = least_squares(np.array(slopes), miss)
        errors[np.array(free)[:, None], new] = np.sqrt(np.abs(variance[:, better]))
        limit = 0.5 * np.abs(now[0].astype(np.float64))
        change[0] = np.clip(change[0], -limit, limit)
        values[np.array(free)[:, None], alive] += change
        gain = np.sum(sum(y * z for y, z in zip(slopes, change, strict=True)) ** 2, axis=0)
        going = (
            (gain > least * (1 + size))
            & (stalled[alive] < 2)
            & ((turn < hopeless) | (chi2[alive] < HOPELESS))
        )
        alive = alive[going]
    return chi2, kept, entries, errors


def _best(
    every: Table,
    target: Targets,
    x: Guesses,
    values: Reals,
    chi2: Floats,
    entries: Reals,
    errors: Reals,
    freedom: int,
    out: list[dict[tuple[str, int], Match]],
) -> None:
    """Put the best candidate of each map, family and stride into `out`: accepted, of few turns, close."""
    physical = np.isfinite(chi2) & np.all(np.isfinite(entries), axis=0)
    if every.damped and not target.terms.growing:
        physical &= (values[1] > 0) | every.held[x.which]
    masses = target.log_masses(x, values)
    at = np.flatnonzero(physical)
    refused = chi2 > most(freedom)
    # a free scale of velocities lets steps of several lengths fit: the shortest is the plainest
    close = np.where(refused | (freedom > 2), chi2, np.abs(values[0])) if target.terms.mass_unknown else chi2
    order = at[np.lexsort((close[at], x.turns[at], refused[at], x.s[at], x.which[at], x.of[at]))]
    keys = np.array([x.of, x.which, x.s])[:, order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = np.any(keys[:, 1:] != keys[:, :-1], axis=0)
    chosen = order[first]
    (of, which, s), numbers = (
        keys[:, first].astype(int),
        np.array([values[0], values[1], masses, chi2, *errors]),
    )
    rows = zip(
        of.tolist(), which.tolist(), s.tolist(), x.turns[chosen].astype(int).tolist(),
        numbers[:, chosen].T.astype(np.float64).tolist(), entries[:, chosen].T.astype(np.longdouble),
        strict=True,
    )  # fmt: skip
    for i, k, stride, turns, (a, g, log_mass, size, a_error, g_error, mass_error), predicted in rows:
        name = every.families[k].name
        out[i][name, stride] = Match(
            family=name, stride=stride, turns=turns, a=a, a_error=a_error, g=g, g_error=g_error,
            log_mass=log_mass, mass_error=mass_error, chi2=size, freedom=freedom, predicted=tuple(predicted),
        )  # fmt: skip
