"""First guesses of the families' unknowns, from the phase, the growth and the entries of one step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import ROUNDING, Map
from springcheck.identify.maps import Table, table, unit
from springcheck.physics.arrays import Floats, Integers
from springcheck.schemes import rotation

NEAR = 3e-4
"""Distance of the entries of one step, of size 1, within which a family is worth an exact comparison."""

GUESSED = 0.05
"""The same for a first guess without friction, which is good to 1e-3 where the family is right."""

LOST = 30.0, 2.0, 0.5, 0.3
"""The same before each step with friction.  Measured on 2,900 maps of h w up to 1 and up to a third of the
critical damping: 19, 0.18, 0.006 and 1e-6 at most."""

CHUNK = 4096
"""Candidates that are solved at once, so that their arrays stay in the processor's cache."""

FLOW_TURNS = 8
"""Turns between two frames that the exact flow is looked for at."""


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


@cache
def _phases(name: str) -> tuple[tuple[Floats, Floats], ...]:
    """(phase of one step ascending, h w) over each range of h w in which the phase grows or falls."""
    family = FAMILIES[name]
    top = min(family.limit, 60.0) if family.limit > 0 else 4.0
    # the phase bends like a square root at a limit of stability, so points crowd there
    x = top * np.sin(np.linspace(0, np.pi / 2, 2001)[1:-1])
    x = np.concatenate([x[x < 0.05 * top], np.geomspace(0.05 * top, x[-1], 2000)]) if top == 60 else x
    matrices = unit(family, np.square(x), np.zeros(len(x)))
    found = rotation(matrices)
    side = np.where(matrices[:, 0, 1] < 0, -1, 1)
    phase = np.unwrap(np.asarray(side * found.angle, dtype=np.float64))
    rising = np.diff(phase) > 0
    ends = [0, *(np.flatnonzero(rising[1:] != rising[:-1]) + 1).tolist(), len(x) - 1]
    parts = [(phase[a : b + 1], x[a : b + 1]) for a, b in pairwise(ends)]
    return tuple((y, z) if y[-1] > y[0] else (y[::-1], z[::-1]) for y, z in parts)


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """One-step maps (c, 2, 2) on (q, v h) that a frame's map may be a power of, with their phases."""

    s: Floats
    turns: Floats
    phase: Floats
    entries: Floats


def roots(found: Map, strides: range) -> Roots:
    """The s-th roots of a map that turns, every whole number of unseen turns included."""
    b = found.unscaled
    turn = rotation(b[None])
    angle, d = float(turn.angle[0]), float(turn.determinant[0])
    side = -1.0 if b[0, 1] < 0 else 1.0
    s = np.repeat(np.array(strides, dtype=np.float64), [r // 2 + 1 for r in strides])
    turns = np.concatenate([np.arange(r // 2 + 1, dtype=np.float64) for r in strides])
    phase = (side * angle + 2 * np.pi * turns) / s
    keep = (phase > 0) & (phase <= np.pi)
    s, turns, phase = s[keep], turns[keep], phase[keep]
    generator = side * (b.astype(np.float64) / np.sqrt(d) - np.cos(angle) * np.eye(2)) / np.sin(angle)
    entries = np.cos(phase)[:, None, None] * np.eye(2) + np.sin(phase)[:, None, None] * generator
    entries = entries * (d ** (0.5 / s))[:, None, None]
    entries[:, 0, 1] *= s
    entries[:, 1, 0] /= s
    return Roots(s, turns, phase, entries)


def starts(every: Table, found: Map, of: int, terms: Terms, strides: range) -> Guesses:
    """Guesses for the families of a table on one map, number `of`, that turns."""
    root = roots(found, strides)
    det = np.linalg.det(root.entries)
    bases: dict[str, tuple[Integers, Floats, Floats]] = {}

    def of_phase(base: Family) -> tuple[Integers, Floats, Floats]:
        """Roots that the undamped family reaches, a there, and -log of what its own area shrinks by."""
        if base.name not in bases:
            ranges = _phases(base.name)
            index, values = [], []
            for phases, x in ranges:
                # the first range begins at the first tabulated step; a phase below is as good as proportional
                low = 0.0 if phases is ranges[0][0] else phases[0]
                inside = np.flatnonzero((root.phase > low) & (root.phase < phases[-1]))
                phase = root.phase[inside]
                index.append(inside)
                values.append(np.interp(phase, phases, x) * np.minimum(phase / phases[0], 1))
            at, a = np.concatenate(index), np.square(np.concatenate(values))
            loss = np.zeros_like(a)
            if every.damped:
                loss = np.log(np.abs(np.linalg.det(unit(base, a, np.zeros_like(a))))) - np.log(det[at])
            bases[base.name] = at, a, loss
        return bases[base.name]

    parts, flows = [], []
    for k, family in enumerate(every.families):
        if family.flow:
            flows.append(_flow_starts(found, k, of, damped=family.damped, growing=terms.growing))
            continue
        if family.held:
            index = np.arange(len(root.s))
            a = -root.entries[:, 1, 0]
            g = (1 - root.entries[:, 0, 0]) / np.where(a == 0, 1, a)
        elif family.damped:
            index, a, g = of_phase(FAMILIES[family.scheme])
            # friction shrinks areas; what grows beyond the scheme's own growth is no friction
            good = (g > 0) | terms.growing
            index, a, g = index[good], a[good] + np.square(g[good] / 2), g[good]
        else:
            index, a, g = of_phase(family)
        parts.append((np.full(len(index), k), index, a, g))
    if not parts:
        return joined(flows)
    which, index, a, g = (np.concatenate(x) for x in zip(*parts, strict=True))
    spread = 100 * float(np.sqrt(found.covariance.max()))
    a, g, off = solved(every, which, a, g, root.entries[index], free_scale=terms.mass_unknown, spread=spread)
    s = root.s[index]
    near = off <= NEAR + spread
    # of each family and stride without a near root the nearest is kept
    order = np.lexsort((off, s, which))
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(which[order]) != 0) | (np.diff(s[order]) != 0)
    kept = np.union1d(np.flatnonzero(near), order[first])
    turning = Guesses(which, np.full(len(s), of), s, root.turns[index], a, g, near)[kept]
    return joined([turning, *flows])


def solved(
    every: Table,
    which: Integers,
    a: Floats,
    g: Floats,
    wanted: Floats,
    *,
    free_scale: bool,
    turns: int = 0,
    spread: float = 0.0,
) -> tuple[Floats, Floats, Floats]:
    """Gauss-Newton for a and g on the entries of one step, in double precision, and how far it is off."""
    if len(a) > CHUNK:
        parts = [
            solved(
                every, which[i : i + CHUNK], a[i : i + CHUNK], g[i : i + CHUNK], wanted[i : i + CHUNK],
                free_scale=free_scale, turns=turns, spread=spread,
            )
            for i in range(0, len(a), CHUNK)
        ]  # fmt: skip
        one, other, off = (np.concatenate(x) for x in zip(*parts, strict=True))
        return one, other, off
    damped = every.damped
    values = np.stack([a, g], axis=1).astype(np.float64)

    def compared(out: Floats) -> Floats:
        out = out.reshape(-1, 4)
        if free_scale:
            product = out[:, 1] * out[:, 2]
            out = np.stack([out[:, 0], out[:, 3], product], axis=1)
        return out

    def entries(at: Integers, x: Floats) -> Floats:
        return compared(np.asarray(every.unit(which[at], x[:, 0], x[:, 1])))

    target = compared(wanted)
    size = np.maximum(np.abs(target), 1e-2)
    # every entry counts by its size, the lower left one by that of a
    least = 1e-3 if free_scale else np.array([1e-3, 1e-3, 1e-300, 1e-3])
    weight = 1 / np.maximum(np.abs(target), least)
    off = np.full(len(values), np.inf)
    alive = np.arange(len(values))
    rounds = turns or (6 if damped else 3)
    with np.errstate(all="ignore"):
        for turn in range(rounds + 1):
            now, x = entries(alive, values[alive]), values[alive]
            miss = target[alive] - now
            off[alive] = np.nan_to_num(np.max(np.abs(miss) / size[alive], axis=1), nan=np.inf)
            if turn == rounds:
                break
            if not turns and turn < (len(LOST) if damped else 1):
                good = off[alive] <= (LOST[turn] if damped else GUESSED) + spread
                alive, now, x, miss = alive[good], now[good], x[good], miss[good]
            if not len(alive):
                break
            slopes = []
            for i in range(1 + damped):
                delta = 1e-6 * (np.abs(x[:, 0]) if i == 0 else np.maximum(np.abs(x[:, 1]), 1e-3))
                shifted = x.copy()
                shifted[:, i] += delta
                slopes.append((entries(alive, shifted) - now) / delta[:, None] * weight[alive])
            change = least_squares(np.stack(slopes, axis=2), miss * weight[alive])[0]
            limit = 0.5 * np.abs(x[:, 0])
            change[:, 0] = np.clip(change[:, 0], -limit, limit)
            values[alive, : 1 + damped] += change
    return values[:, 0], values[:, 1], off


def least_squares(slopes: Floats, miss: Floats) -> tuple[Floats, Floats]:
    """Solutions (c, k) of slopes (c, i, k) x = miss (c, i), the shortest ones, and variances (c, k) of x for
    errors of 1; columns may differ by many powers of ten."""
    size = np.sqrt(np.sum(slopes**2, axis=1))
    size = np.where(np.isfinite(size) & (size > 0), size, 1.0)
    even = slopes / size[:, None, :]
    # what is no number changes nothing
    lost = ~np.isfinite(np.sum(even, axis=(1, 2)) + np.sum(miss, axis=1))
    if np.any(lost):
        even[lost], miss = 0.0, np.where(lost[:, None], 0.0, miss)
    right = np.sum(even * miss[:, :, None], axis=1)
    if even.shape[2] == 1:
        present = np.sum(even[:, :, 0] ** 2, axis=1, keepdims=True) > 0
        return right * present / size, present / size**2
    if even.shape[2] == 2:
        # columns of length 1: eigenvalues 1 + r and 1 - r, of the sum and the difference
        r = np.sum(even[:, :, 0] * even[:, :, 1], axis=1)
        plus, minus = (np.where(x > 1e-15, 0.5 / np.maximum(x, 1e-15), 0.0) for x in (1 + r, 1 - r))
        inner = np.stack([plus + minus, plus - minus, plus + minus], axis=1)
        x = np.stack(
            [
                inner[:, 0] * right[:, 0] + inner[:, 1] * right[:, 1],
                inner[:, 1] * right[:, 0] + inner[:, 2] * right[:, 1],
            ],
            axis=1,
        )
        return x / size, inner[:, [0, 2]] / size**2
    inverse = np.linalg.pinv(np.einsum("cia,cib->cab", even, even), hermitian=True)
    return np.einsum("cab,cb->ca", inverse, right) / size, np.einsum("caa->ca", inverse) / size**2


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
            off = np.sum((frames - found.entries.reshape(4).astype(np.float64)) ** 2, axis=1)
            off = np.where(np.isfinite(off), off, np.inf).reshape(-1, len(GRID))
            row, low = np.nonzero(
                (off[:, 1:-1] <= off[:, :-2]) & (off[:, 1:-1] <= off[:, 2:]) & (off[:, 1:-1] < 1)
            )
            least[b] = [*strided, *(row + 1.0).tolist()], [*values, *GRID[low + 1].tolist()]
        parts = []
        total = float(rotation(found.entries[None]).determinant[0])
        for k in kinds:
            family = every.families[k]
            b = names.index(family.scheme) if names else k
            s_, a_ = (np.array(x, dtype=np.float64) for x in least[b])
            g = np.zeros_like(a_)
            good = np.ones(len(a_), dtype=bool)
            if family.damped and len(a_):
                own = np.linalg.det(bases.unit(np.full(len(a_), b), a_, g))
                g = np.log(np.abs(own)) - np.log(total) / s_
                good = np.isfinite(g) & ((g > 0) | terms.growing)
            n = int(np.count_nonzero(good))
            parts.append(
                Guesses(
                    np.full(n, k), np.full(n, of), s_[good], np.zeros(n), a_[good], g[good], np.ones(n, bool)
                )
            )
    return joined(parts)


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


def _flow_starts(found: Map, which: int, of: int, *, damped: bool, growing: bool) -> Guesses:
    """The exact flow's guesses: it has no step, and turns several times between frames."""
    turn = rotation(found.entries[None])
    phase = float(turn.angle[0]) * (-1.0 if found.entries[0, 1] < 0 else 1.0)
    turns = np.arange(0 if phase > 0 else 1, FLOW_TURNS, dtype=np.float64)
    g = -float(np.log(turn.determinant[0])) if damped else 0.0
    if damped and g <= 0 and not growing:
        turns = turns[:0]
    n = len(turns)
    a = np.asarray(np.square(phase + 2 * np.pi * turns) + (g / 2) ** 2)
    return Guesses(np.full(n, which), np.full(n, of), np.ones(n), turns, a, np.full(n, g), np.ones(n, bool))
