"""First guesses of the families' unknowns, from the phase, the growth and the entries of one step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from springcheck.identify.curves import SIDE, Roots, curves, folded, is_folded, keys, roots
from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import ROUNDING, Map
from springcheck.identify.maps import Table, table
from springcheck.identify.solve import GUESSED, LOST, compared, solved
from springcheck.physics.arrays import Floats, Integers

NEAR = 3e-4
"""Distance of the entries of one step, of size 1, within which a family is worth an exact comparison."""

SURE = 1e-6, 1e4
"""Distance, and how many errors of an entry, beyond which a converged guess cannot be accepted."""

BESIDE = 0.15
"""Friction that a guess which has it counts as `away` from its curve."""

DRIFT = 2.0
"""Way of a step of a splitting whose phase turns back, in units of v h, at most, beside the log of its
determinant: 1.7 at most, and 2.5 where that is 2."""

FLOW_TURNS = 8
"""Turns between two frames that the exact flow is looked for at."""


Starts: TypeAlias = tuple[Integers, Integers, Floats, Floats, Floats]
"""Families and roots, a, g and how far g is `away` from that of a curve."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """How a map is to be matched: what is unknown, and how finely the arithmetic resolves coefficients."""

    mass_unknown: bool = False
    rounding: float = ROUNDING
    jitter: float = 0.0
    bias: float = 0.0
    """How far entries may be off in units of the residuals of their rows, whatever the number of pairs:
    coarse rounding that cuts off, or repeats itself from turn to turn, is no noise that averages away."""
    log_stiffness: float | None = None
    """log(k T**2) where the stiffness is known and the mass is not: the mass follows from a then."""
    log_mass: tuple[float, ...] = ()
    """Log of the scale of momenta over velocities at each stride from 0 on, where it is known beforehand."""
    scale: float = 0.0
    """Relative error of the scale of velocities: in a coarse file a step or a mass may be in single precision
    as well, and others than the true scheme would fit if it were taken for exact."""
    growing: bool = False
    """Whether friction of the wrong sign is looked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Guesses:
    """Candidates (c,): family of a table, map, strides, unseen turns, a and g; `near` is False for the one of
    a family and stride that comes nearest and yet is far off."""

    which: Integers
    of: Integers
    s: Floats
    turns: Floats
    a: Floats
    g: Floats
    near: np.ndarray[tuple[int], np.dtype[np.bool_]]

    def __getitem__(self, at: Integers) -> Guesses:
        return Guesses(*(getattr(self, name)[at] for name in self.__slots__))


def joined(parts: list[Guesses]) -> Guesses:
    """Candidates one after another."""
    return Guesses(*(np.concatenate([getattr(x, name) for x in parts]) for name in Guesses.__slots__))


def starts(
    every: Table, found: Map, of: int, terms: Terms, strides: range, error: float, *, far: bool = False
) -> Guesses:
    """Guesses for the families of a table on one map, number `of`, that turns: those that may be near, and
    with `far` the nearest of each family and stride where none is.  `error` is that of an entry."""
    root = roots(found, strides)
    spread = 100 * float(np.sqrt(found.covariance.max()))
    # roots blow an error up where the motion is near a whole or a half period
    sine = float(np.sin(found.turn.angle[0]))
    error /= sine
    sure = np.inf if far else SURE[0] + SURE[1] * error
    most = min(NEAR + spread, sure)
    flows = [
        _flow_starts(every, found, k, of, terms, GUESSED + spread if far else most)
        for k, family in enumerate(every.families)
        if family.flow
    ]
    parts = [
        _held_starts(k, root, LOST[0] if far else SIDE[0] * error + SIDE[1])
        for k, family in enumerate(every.families)
        if family.held
    ]
    wanted = GUESSED + (LOST[0] if far else SIDE[0] * error)
    splittings = np.flatnonzero([is_folded(family) for family in every.families])
    if len(splittings):
        parts.append(_folded_starts(every, splittings, root, wanted, free_scale=terms.mass_unknown))
    of_curves, bases = keys(every.families)
    if of_curves:
        curve = curves(of_curves)
        at, index = curve.near(
            root, error, damped=every.damped, growing=terms.growing, free_scale=terms.mass_unknown, far=far
        )  # fmt: skip
        x, loss = curve.at(at, root.phase[index])
        a, g, away = np.square(x), np.zeros_like(x), np.zeros_like(x)
        if every.damped:
            g = loss - root.log_det[index]
            # friction shrinks areas; what grows beyond the scheme's own growth is no friction
            good = (g > 0) | terms.growing
            at, index, g, a = at[good], index[good], g[good], a[good] + np.square(g[good] / 2)
            away = np.abs(g)
        # every family of a curve gets its guesses
        families, base = bases
        ends = np.searchsorted(curve.base[at], np.arange(len(of_curves) + 1))
        counts = np.diff(ends)[base]
        mine = np.arange(np.sum(counts)) + np.repeat(ends[base] - np.cumsum(counts) + counts, counts)
        parts.append((np.repeat(families, counts), index[mine], a[mine], g[mine], away[mine]))
    parts = parts or [(np.zeros(0, int), np.zeros(0, int), *np.zeros((3, 0)))]
    which, index, a, g, away = (np.concatenate(x) for x in zip(*parts, strict=True))
    wide = spread * np.maximum(1.0, np.sin(root.phase[index]) / sine)
    room = np.minimum(NEAR + wide, sure)
    a, g, off = solved(
        every,
        which,
        a,
        g,
        root.entries[index],
        away=away,
        free_scale=terms.mass_unknown,
        spread=wide + room,
        far=far,
    )
    s = root.s[index]
    near = off <= room
    kept = np.flatnonzero(near)
    if far:
        # of each family and stride without a near root the nearest is kept
        order = np.lexsort((off, s, which))
        first = np.ones(len(order), dtype=bool)
        first[1:] = (np.diff(which[order]) != 0) | (np.diff(s[order]) != 0)
        kept = np.union1d(kept, order[first])
    turning = Guesses(which, np.full(len(s), of), s, root.turns[index], a, g, near)[kept]
    return joined([turning, *flows])


def _held_starts(k: int, root: Roots, room: float) -> Starts:
    """Guesses for a held force, whose step moves the position by the whole velocity."""
    entries = root.entries
    off = np.maximum(np.abs(entries[:, 0, 1] - 1), np.abs(entries[:, 1, 1] - 1))
    index = np.flatnonzero(off <= room)
    a = -entries[index, 1, 0]
    g = (1 - entries[index, 0, 0]) / np.where(a == 0, 1, a)
    return np.full(len(index), k), index, a, g, np.abs(g)


def _folded_starts(
    every: Table, splittings: Integers, root: Roots, room: float, *, free_scale: bool
) -> Starts:
    """Guesses for splittings whose phase turns back: what has the determinant and the trace of a root."""
    upper = root.normal[1]
    likely = np.flatnonzero(free_scale | (np.abs(upper) <= (1 + room) * (DRIFT + np.abs(root.log_det))))
    entries, families = root.entries[likely], tuple(every.families[k] for k in splittings)
    of, index, a, g = folded(families, root.log_det[likely], entries[:, 0, 0] + entries[:, 1, 1])
    which = splittings[of]
    off = np.abs(every.unit(which, a, g)[:, 0] - entries[index, 0])
    good = (a > 0) & (off[:, 0] <= room)
    good &= free_scale | (off[:, 1] <= room * (1 + np.abs(upper[likely][index])))
    index, a, g = likely[index[good]], a[good], g[good]
    return which[good], index, a, g, np.full(len(a), BESIDE)


GRID = np.concatenate([-np.geomspace(16, 1e-8, 400), np.geomspace(1e-8, 60, 600)])
"""Values of a that are tried where nothing turns."""


def real_starts(every: Table, found: Map, of: int, terms: Terms, strides: range) -> Guesses:
    """Guesses where nothing turns: an inverted spring, friction, or a step beyond the limit."""
    kinds = [k for k, family in enumerate(every.families) if not family.held]
    names = list(dict.fromkeys(every.families[k].scheme for k in kinds if every.families[k].damped))
    bases = table(tuple(FAMILIES[x] for x in names)) if names else every
    decays = _decays(found, strides)
    ratio = np.array([float(found.size[1] / found.size[0])])
    least: dict[int, tuple[list[float], list[float]]] = {}
    with np.errstate(all="ignore"):
        for b, base in enumerate(bases.families):
            if base.held:
                continue
            strided, values = _decays(found, range(1, 2)) if base.flow else decays
            s = np.repeat(np.arange(1.0, 2.0 if base.flow else 5.0), len(GRID))
            x = np.tile(GRID, len(s) // len(GRID))
            frames = bases.frame(np.full(len(x), b), x, 0 * x, 0 * x, s, ratio)
            shown = compared(frames.T.reshape(-1, 2, 2), free_scale=terms.mass_unknown)
            off = np.sum((shown - compared(found.entries[None], free_scale=terms.mass_unknown)) ** 2, axis=0)
            off = np.where(np.isfinite(off), off, np.inf).reshape(-1, len(GRID))
            row, low = np.nonzero(
                (off[:, 1:-1] <= off[:, :-2]) & (off[:, 1:-1] <= off[:, 2:]) & (off[:, 1:-1] < 1)
            )
            least[b] = [*strided, *(row + 1.0).tolist()], [*values, *GRID[low + 1].tolist()]
        parts = []
        total = float(found.turn.determinant[0])
        for k in kinds:
            family = every.families[k]
            b = names.index(family.scheme) if names else k
            s_, a_ = (np.array(x, dtype=np.float64) for x in least[b])
            g = np.zeros_like(a_)
            good = np.ones(len(a_), dtype=bool)
            if family.damped:
                own = np.linalg.det(bases.unit(np.full(len(a_), b), a_, g))
                g = np.log(np.abs(own)) - np.log(total) / s_
                if is_folded(family):
                    s_, a_, g = (
                        np.append(x, y) for x, y in zip((s_, a_, g), _folded_real(family, found), strict=True)
                    )
                good = np.isfinite(g) & ((g > 0) | terms.growing)
            good = good & (np.isin(s_, strides) | family.flow)
            n = int(np.count_nonzero(good))
            parts.append(
                Guesses(
                    np.full(n, k), np.full(n, of), s_[good], np.zeros(n), a_[good], g[good], np.ones(n, bool)
                )
            )
    none = np.zeros(0)
    return joined(
        parts or [Guesses(none.astype(int), none.astype(int), none, none, none, none, none.astype(bool))]
    )


def _folded_real(family: Family, found: Map) -> tuple[Floats, Floats, Floats]:
    """Strides, a and g of a splitting whose phase turns back, from two real eigenvalues."""
    values = np.sort(np.real(np.linalg.eigvals(found.entries.astype(np.float64))))
    s = np.arange(1.0, 5.0)[:: 1 if values[0] > 0 else 2]
    each = np.sign(values) * np.abs(values) ** (1 / s[:, None])
    _, index, a, g = folded((family,), np.log(np.prod(each, axis=1)), np.sum(each, axis=1))
    return s[index], a, g


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


def _flow_starts(every: Table, found: Map, which: int, of: int, terms: Terms, most: float) -> Guesses:
    """The exact flow's guesses: it has no step, and turns several times between frames."""
    damped = every.families[which].damped
    asked = "flow", damped, terms.mass_unknown, terms.growing
    if asked not in found.found:
        b, turn = found.unscaled, found.turn
        phase = float(turn.angle[0]) * (-1.0 if b[0, 1] < 0 else 1.0)
        turns = np.arange(0 if phase > 0 else 1, FLOW_TURNS, dtype=np.float64)
        g = -float(np.log(turn.determinant[0])) if damped else 0.0
        if damped and g <= 0 and not terms.growing:
            turns = turns[:0]
        a = np.asarray(np.square(phase + 2 * np.pi * turns) + (g / 2) ** 2)
        gs = np.full(len(turns), g)
        units = every.unit(np.full(len(turns), which), a, gs)
        out, target = (compared(x, free_scale=terms.mass_unknown) for x in (units, b[None]))
        off = np.max(np.abs(out - target) / np.maximum(np.abs(target), 1e-2), axis=0)
        found.found[asked] = turns, a, gs, off
    turns, a, gs, off = found.found[asked]
    n = len(turns)
    return Guesses(np.full(n, which), np.full(n, of), np.ones(n), turns, a, gs, off <= most)
