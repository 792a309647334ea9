"""First guesses of a family's unknowns, from the phase, the growth and the entries of one step."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from springcheck.arrays import Extended, Floats
from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import ROUNDING, Map
from springcheck.schemes import rotation

NEAR = 3e-4
"""Distance of the entries of one step, of size 1, within which a family is worth an exact comparison."""

GUESSED = 0.05
"""The same for a first guess."""


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
    growing: bool = False
    """Whether friction of the wrong sign is looked for."""


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
    family: Family, a: Extended, g: Extended, log_mass: Extended, s: Floats, size: Extended
) -> Extended:
    """Predicted maps (c, 2, 2) over s steps on (q, v T) in units of `size`, T = s h."""
    out = family.unit(a, g)
    if np.any(s != 1):
        out = power(out, s)
    up = np.asarray(np.exp(-log_mass) / s * size[1] / size[0])
    out[:, 0, 1] = out[:, 0, 1] * up
    out[:, 1, 0] = out[:, 1, 0] / up
    return out


@cache
def _phases(name: str) -> tuple[tuple[Floats, Floats], ...]:
    """(phase of one step ascending, h w) over each range of h w in which the phase grows or falls."""
    family = FAMILIES[name]
    top = min(family.limit, 60.0) if family.limit > 0 else 4.0
    # the phase bends like a square root at a limit of stability, so points crowd there
    x = top * np.sin(np.linspace(0, np.pi / 2, 2001)[1:-1])
    x = np.concatenate([x[x < 0.05 * top], np.geomspace(0.05 * top, x[-1], 2000)]) if top == 60 else x
    matrices = family.unit(np.square(x.astype(np.longdouble)), np.zeros(len(x), np.longdouble))
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
    generator = side * (b.astype(np.float64) / np.sqrt(d) - np.cos(angle) * np.eye(2)) / np.sin(angle)
    entries = np.cos(phase)[:, None, None] * np.eye(2) + np.sin(phase)[:, None, None] * generator
    entries = entries * (d ** (0.5 / s))[:, None, None]
    entries[:, 0, 1] *= s
    entries[:, 1, 0] /= s
    keep = (phase > 0) & (phase <= np.pi)
    return Roots(s[keep], turns[keep], phase[keep], entries[keep])


def starts(
    family: Family, base: Family, root: Roots, terms: Terms, spread: float
) -> tuple[Floats, Floats, Extended, Extended, bool]:
    """Strides, turns and guesses of a and g of the roots that a family comes near to; where it comes near
    none, the nearest, and True."""
    parts = []
    if family.held:
        parts.append((np.arange(len(root.s)), root.phase))
    for phases, x in () if family.held else _phases(base.name):
        # the first range begins at the first tabulated step; a phase below it is as good as proportional
        low = 0.0 if phases is _phases(base.name)[0][0] else phases[0]
        inside = np.flatnonzero((root.phase > low) & (root.phase < phases[-1]))
        value = np.interp(root.phase[inside], phases, x) * np.minimum(root.phase[inside] / phases[0], 1)
        parts.append((inside, value))
    index = np.concatenate([i for i, _ in parts])
    a = np.square(np.concatenate([x for _, x in parts]))
    g = np.zeros_like(a)
    wanted = root.entries[index]
    det = wanted[:, 0, 0] * wanted[:, 1, 1] - wanted[:, 0, 1] * wanted[:, 1, 0]
    if family.held:
        a = -wanted[:, 1, 0]
        g = (1 - wanted[:, 0, 0]) / np.where(a == 0, 1, a)
    elif family.damped and len(a):
        own = base.unit(a, g)
        own_det = np.abs(own[:, 0, 0] * own[:, 1, 1] - own[:, 0, 1] * own[:, 1, 0])
        g = np.log(own_det) - np.log(det)
        # friction shrinks areas; what grows beyond the scheme's own growth is no friction
        good = (g > 0) | terms.growing
        index, a, g, wanted = index[good], a[good], g[good], wanted[good]
        a = a + np.square(g / 2)
    if not len(index):
        none = np.zeros(0, dtype=np.longdouble)
        return root.s[index], root.turns[index], none, none, True
    values, off = solved(family, a, g, wanted, free_scale=terms.mass_unknown, spread=spread)
    near = off <= NEAR + spread
    far = not np.any(near)
    near[np.argmin(off)] = True
    return root.s[index][near], root.turns[index][near], values[near, 0], values[near, 1], far


def solved(
    family: Family,
    a: Floats,
    g: Floats,
    wanted: Floats,
    *,
    free_scale: bool,
    turns: int = 0,
    spread: float = 0.0,
) -> tuple[Extended, Floats]:
    """Gauss-Newton for a and g on the entries of one step, in double precision, and how far it is off."""
    columns = 2 if family.damped else 1
    values = np.stack([a, g], axis=1)

    def entries(x: Floats) -> Floats:
        out = np.asarray(family.unit(x[:, 0], x[:, 1]), np.float64).reshape(-1, 4)
        if free_scale:
            product = out[:, 1] * out[:, 2]
            out = np.stack([out[:, 0], out[:, 3], product, np.zeros_like(product)], axis=1)
        return out

    target = wanted.reshape(-1, 4)
    if free_scale:
        product = target[:, 1] * target[:, 2]
        target = np.stack([target[:, 0], target[:, 3], product, np.zeros_like(product)], axis=1)
    # every entry counts by its size, the lower left one by that of a
    unit = np.maximum(np.abs(target), 1e-300)
    unit = np.where(np.arange(4) == (4 if free_scale else 2), unit, np.maximum(unit, 1e-3))
    with np.errstate(all="ignore"):
        if not turns and not family.damped:
            # a first guess from the phase is good to 1e-3 where the family is right
            first = np.max(np.abs(entries(values) - target) / np.maximum(np.abs(target), 1e-2), axis=1)
            good = first <= GUESSED + spread
            if not np.any(good):
                return values.astype(np.longdouble), np.where(np.isfinite(first), first, np.inf)
            if not np.all(good):
                # the others stay what they are
                better, off = solved(
                    family, a[good], g[good], wanted[good], free_scale=free_scale, spread=spread
                )
                out = values.astype(np.longdouble)
                out[good], first[good] = better, off
                return out, np.where(np.isfinite(first), first, np.inf)
        for _ in range(turns or (6 if family.damped else 3)):
            now = entries(values)
            slopes = np.empty((len(values), 4, columns))
            for i in range(columns):
                delta = 1e-6 * (np.abs(values[:, 0]) if i == 0 else np.maximum(np.abs(values[:, 1]), 1e-3))
                shifted = values.copy()
                shifted[:, i] += delta
                slopes[:, :, i] = (entries(shifted) - now) / delta[:, None]
            scaled = slopes / unit[:, :, None]
            right = np.einsum("cij,ci->cj", scaled, (target - now) / unit)
            change = np.einsum("cij,cj->ci", inverse(np.einsum("cki,ckj->cij", scaled, scaled)), right)
            change = np.nan_to_num(change)
            limit = 0.5 * np.abs(values[:, 0])
            change[:, 0] = np.clip(change[:, 0], -limit, limit)
            values[:, :columns] += change
        off = np.max(np.abs(entries(values) - target) / np.maximum(np.abs(target), 1e-2), axis=1)
    return values.astype(np.longdouble), np.where(np.isfinite(off), off, np.inf)


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


def real_starts(family: Family, found: Map, strides_wanted: range) -> tuple[Floats, Floats, Floats]:
    """First guesses of a where nothing turns: an inverted spring, friction, or a step beyond the limit."""
    grid = np.concatenate([-np.geomspace(16, 1e-8, 400), np.geomspace(1e-8, 60, 600)])
    zero = np.zeros(1, dtype=np.longdouble)
    strides, values = _decays(found, range(1, 2) if family.flow else strides_wanted)
    for s in (1,) if family.flow else (1, 2, 3, 4):
        s_all = np.full(len(grid), float(s))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            miss = frame(family, grid.astype(np.longdouble), zero, zero, s_all, found.size) - found.entries
            off = np.asarray(np.sum(miss**2, axis=(1, 2)), dtype=np.float64)
        off = np.where(np.isfinite(off), off, np.inf)
        low = np.flatnonzero((off[1:-1] <= off[:-2]) & (off[1:-1] <= off[2:]) & (off[1:-1] < 1)) + 1
        strides += [float(s)] * len(low)
        values += grid[low].tolist()
    return np.array(strides), np.zeros(len(strides)), np.array(values)


def flow_starts(found: Map, *, damped: bool, growing: bool) -> tuple[Floats, Floats, Extended, Extended]:
    """The exact flow's guesses: it has no step, and turns up to eight times between frames."""
    turn = rotation(found.entries[None])
    phase = float(turn.angle[0]) * (-1.0 if found.entries[0, 1] < 0 else 1.0)
    turns = np.arange(0 if phase > 0 else 1, 8, dtype=np.float64)
    g = -float(np.log(turn.determinant[0])) if damped else 0.0
    if damped and g <= 0 and not growing:
        turns = turns[:0]
    a = np.asarray(np.square(phase + 2 * np.pi * turns) + (g / 2) ** 2, np.longdouble)
    return np.ones_like(turns), turns, a, np.full(len(turns), g).astype(np.longdouble)


def inverse(normal: Floats) -> Floats:
    """Inverses of positive matrices (c, i, i) whose diagonals differ by many powers of ten."""
    if normal.shape[-1] == 1:
        return np.where(normal > 0, 1 / np.where(normal > 0, normal, 1), 0.0)
    scale = np.sqrt(np.einsum("caa->ca", normal))
    scale = np.where(np.isfinite(scale) & (scale > 0), scale, 1.0)
    even = np.nan_to_num(normal / scale[:, :, None] / scale[:, None, :], posinf=0, neginf=0)
    return np.asarray(np.linalg.pinv(even, hermitian=True) / scale[:, :, None] / scale[:, None, :])
