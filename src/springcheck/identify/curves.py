"""Which families a map may be of, at a glance: their one-step maps over the phase of a step, tabulated.

Without friction a family is a curve over its phase.  A map that turns has one phase for each number of steps
and of unseen turns, so the entries of its root and those of the curve there can be compared at once, for
all families and roots.  With friction a map of the same phase differs from the curve by the order of g.
Where the phase has a largest value, which friction exceeds, `folded` finds what has a determinant and trace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import pairwise

import numpy as np

from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import Map
from springcheck.identify.maps import table, unit
from springcheck.physics.arrays import Floats, Integers
from springcheck.schemes import rotation

CELLS = 2048
"""Cells of the phase from 0 to pi, of which the nearest one is looked up."""

APART = 32.0
"""Distance of the curves on one axis, on which all are interpolated together."""

FAR = 0.005
"""Distance of the entries of one step from a curve within which a family is looked at, where the nearest one
is wanted."""

SIDE = 100.0, 3e-6
"""The same in units of the error of an entry of the roots, and beside it."""

DAMPING = 2.0
"""The same in units of g, where there is friction, beside it.  Measured on 2,900 maps of up to 0.9 of the
critical damping: 1.7."""

END = 0.05
"""Room beside the end of a curve."""

BEYOND = 1e-5, 0.02
"""Phases by which a tabulated curve may end before its largest phase, and by which errors may exceed that."""

MEETING = 0.02
"""Imaginary share of two steps of the same trace that may be one."""

SMALL = 0.05
"""Size below which an entry is not asked to agree relatively."""


@dataclass(frozen=True, slots=True, eq=False)
class Roots:
    """One-step maps (c, 2, 2) on (q, v h) that a frame's map may be a power of, with their phases, sorted
    by strides; `log_det` (c,) of each."""

    s: Floats
    turns: Floats
    phase: Floats
    entries: Floats
    log_det: Floats
    cell: Integers
    """Cell of the phase, and how far along it the phase stands."""
    part: Floats
    normal: Floats
    """M11, M12 (2, c) over the root of the determinant."""


def roots(found: Map, strides: range) -> Roots:
    """The s-th roots of a map that turns, every whole number of unseen turns included."""
    if ("roots", strides) not in found.found:
        found.found["roots", strides] = _roots(found, strides)
    out: Roots = found.found["roots", strides]
    return out


def _roots(found: Map, strides: range) -> Roots:
    b = found.unscaled
    angle, d = float(found.turn.angle[0]), float(found.turn.determinant[0])
    side = -1.0 if b[0, 1] < 0 else 1.0
    s, turns = _steps(strides)
    phase = (side * angle + 2 * np.pi * turns) / s
    keep = (phase > 0) & (phase <= np.pi)
    s, turns, phase = s[keep], turns[keep], phase[keep]
    generator = side * (b.astype(np.float64) / np.sqrt(d) - np.cos(angle) * np.eye(2)) / np.sin(angle)
    even, odd = np.cos(phase), np.sin(phase)
    size = d ** (0.5 / s)
    first = even + odd * generator[0, 0], odd * generator[0, 1] * s
    entries = np.empty((len(s), 2, 2))
    entries[:, 0, 0], entries[:, 0, 1] = (size * x for x in first)
    entries[:, 1, 0], entries[:, 1, 1] = (
        size * odd * generator[1, 0] / s,
        size * (even + odd * generator[1, 1]),
    )
    at = phase * (CELLS / np.pi)
    cell = np.minimum(at.astype(np.int64), CELLS - 1)
    return Roots(s, turns, phase, entries, np.log(d) / s, cell, at - cell, np.array(first))


@lru_cache(maxsize=64)
def _steps(strides: range) -> tuple[Floats, Floats]:
    """Strides and unseen turns up to half of each."""
    s = np.repeat(np.array(strides, dtype=np.float64), [r // 2 + 1 for r in strides])
    return s, np.concatenate([np.arange(r // 2 + 1, dtype=np.float64) for r in strides])


@cache
def keys(families: tuple[Family, ...]) -> tuple[tuple[str, ...], tuple[Integers, Integers]]:
    """The names of the families without friction whose curves stand behind these, each once, and which of
    them are whose; none of what has no step, or a curve that turns back under friction."""
    own: list[str | None] = []
    for family in families:
        base = family.scheme if family.damped else family.name
        own.append(None if family.flow or family.held or is_folded(family) else base)
    each = tuple(dict.fromkeys(base for base in own if base is not None))
    which = [(k, each.index(base)) for k, base in enumerate(own) if base is not None]
    return each, (np.array([k for k, _ in which], np.int64), np.array([b for _, b in which], np.int64))


@cache
def is_folded(family: Family) -> bool:
    """Whether friction moves the largest phase of a splitting."""
    return family.damped and bool(family.stages) and not family.held and len(_ranges(family.scheme)) > 1


@cache
def _losses(family: Family) -> tuple[Floats, Floats]:
    """Logs of a step's determinant, ascending, and the friction g of each, about none."""
    g = np.linspace(-1, 2, 6001)
    with np.errstate(all="ignore"):
        loss = np.log(unit(family, np.zeros_like(g), g)[:, 1, 1])
    middle = int(np.argmin(np.abs(g)))
    falls = np.nan_to_num(np.diff(loss)) < 0
    first = middle - int(np.argmin([*falls[:middle][::-1], False]))
    last = middle + int(np.argmin([*falls[middle:], False]))
    return loss[first : last + 1][::-1], g[first : last + 1][::-1]


@cache
def _degree(family: Family) -> int:
    """Degree of the trace of a splitting's step in a."""
    kinds = [kind for kind, _ in family.stages]
    return min(kinds.count("drift"), len(kinds) - kinds.count("drift") - kinds.count("friction"))


def folded(
    families: tuple[Family, ...], log_det: Floats, trace: Floats
) -> tuple[Integers, Integers, Floats, Floats]:
    """Steps of splittings with friction that have these determinants and traces (c,): the numbers of each
    one's family and determinant, its a and its g.  The determinant is a function of g alone, and the trace a
    polynomial of a, for all these families of one degree."""
    parts = []
    for k, family in enumerate(families):
        loss, of = _losses(family)
        within = np.flatnonzero((log_det > loss[0]) & (log_det < loss[-1]))
        parts.append((np.full(len(within), k), within, np.interp(log_det[within], loss, of)))
    which, at, g = (np.concatenate(x) for x in zip(*parts, strict=True))
    degree = max(_degree(family) for family in families)
    nodes = np.arange(degree + 1.0)
    steps = table(families).unit(
        np.repeat(which, degree + 1), np.tile(nodes, len(g)), np.repeat(g, degree + 1)
    )
    values = (steps[:, 0, 0] + steps[:, 1, 1]).reshape(len(g), degree + 1) - trace[at, None]
    powers = np.asarray(values @ np.linalg.inv(np.vander(nodes)).T, np.float64)
    companion = np.zeros((len(g), degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1
    companion[:, 0] = -powers[:, 1:] / powers[:, :1]
    a = np.linalg.eigvals(companion)
    # at the largest phase two of them meet, and rounding makes them complex
    row, column = np.nonzero(np.abs(a.imag) <= MEETING * np.abs(a.real))
    return which[row], at[row], np.asarray(a.real[row, column]), g[row]


@cache
def _ranges(name: str) -> tuple[tuple[Floats, Floats], ...]:
    """(phase of one step ascending, h w) over each range of h w in which the phase grows or falls."""
    family = FAMILIES[name]
    top = min(family.limit, 60.0) if family.limit > 0 else 4.0
    # the phase bends like a square root at a limit of stability, so points crowd there
    x = top * np.sin(np.linspace(0, np.pi / 2, 2001)[1:-1])
    # and areas change with the square of a small step
    x = np.geomspace(1e-4, x[-1], 4000) if top == 60 else x
    x = np.concatenate([np.geomspace(1e-4, 0.05 * top, 500), x[x > 0.05 * top]]) if top < 60 else x
    matrices = unit(family, np.square(x), np.zeros(len(x)))
    found = rotation(matrices)
    side = np.where(matrices[:, 0, 1] < 0, -1, 1)
    phase = np.unwrap(np.asarray(side * found.angle, dtype=np.float64))
    rising = np.diff(phase) > 0
    ends = [0, *(np.flatnonzero(rising[1:] != rising[:-1]) + 1).tolist(), len(x) - 1]
    parts = [(phase[a : b + 1], x[a : b + 1]) for a, b in pairwise(ends)]
    ordered = [(y, z) if y[-1] > y[0] else (y[::-1], z[::-1]) for y, z in parts]
    # a phase below that of the first tabulated step is as good as proportional to it
    first, x = ordered[0]
    return (np.append(0.0, first), np.append(0.0, x)) if first[0] > 0 else ordered[0], *ordered[1:]


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves (b,) of several families: `base` is the number of each one's family."""

    base: Integers
    low: Floats
    high: Floats
    normal: Floats
    """Entries M11, M12 (2, b, CELLS + 1) of a step, divided by the root of its determinant."""
    log_det: Floats
    bend: Floats
    """How far entries bend within a cell (b, CELLS + 1), which straight lines miss."""
    axis: Floats
    """Phases of all curves, `APART` one from the next, with h w and log of the determinant there."""
    x: Floats
    loss: Floats

    @cached_property
    def most(self) -> float:
        """The most that entries bend."""
        return float(np.max(self.bend))

    @cached_property
    def hull(self) -> tuple[Floats, Floats]:
        """Least and most (3, CELLS) in each cell of M11, M12, log det of all curves, with what they bend."""
        upper = self.normal[1]
        wide = self.bend * np.array([np.ones_like(upper), np.abs(upper) + SMALL, np.zeros_like(upper)])
        rows = np.array([*self.normal, self.log_det])
        low, high = np.fmin.reduce(rows - wide, axis=1), np.fmax.reduce(rows + wide, axis=1)
        return np.fmin(low[:, :-1], low[:, 1:]), np.fmax(high[:, :-1], high[:, 1:])

    def _any_near(self, root: Roots, room: float, *, damped: bool, free_scale: bool) -> Integers:
        """Roots whose entries may agree with those of any curve."""
        low, high = (x[:, root.cell] for x in self.hull)
        above, below = high[2] - root.log_det, low[2] - root.log_det
        rooms = room + DAMPING * np.maximum(np.abs(above), np.abs(below)) if damped else room
        off = [np.maximum(low[i] - x, x - high[i]) for i, x in enumerate(root.normal)]
        good = off[0] <= rooms
        if not free_scale:
            good &= off[1] <= rooms * (np.maximum(np.abs(low[1]), np.abs(high[1])) + SMALL)
        if not damped:
            good &= np.maximum(below, -above) <= 2 * (room + self.most)
        return np.flatnonzero(good)

    def near(
        self, root: Roots, error: float, *, damped: bool, growing: bool, free_scale: bool, far: bool
    ) -> tuple[Integers, Integers]:
        """Curves and roots whose entries may agree, known to within `error`; with `far` the nearest root of
        each stride as well."""
        room = SIDE[0] * error + SIDE[1]
        # what no curve comes near is not held against each of them
        chosen = (
            np.arange(len(root.s)) if far
            else self._any_near(root, room, damped=damped, free_scale=free_scale)
        )  # fmt: skip
        phase, log_det, cell, part = (x[chosen] for x in (root.phase, root.log_det, root.cell, root.part))
        one, other = root.normal[:, chosen]
        low = self.log_det[:, cell]
        loss = low + (self.log_det[:, cell + 1] - low) * part - log_det
        # a phase that is known to within an error may lie beyond the largest
        beyond = min(BEYOND[0] + SIDE[0] * error, BEYOND[1])
        worth = (phase > self.low - beyond) & (phase < self.high + beyond)
        if damped and not growing:
            # friction shrinks areas
            worth &= loss > 0
        elif not (damped or far):
            worth &= np.abs(loss) <= 2 * (room + self.most)
        which, index = np.nonzero(worth)
        cell, part, loss = cell[index], part[index], loss[which, index]

        def between(y: Floats) -> Floats:
            low = y[which, cell]
            return np.asarray(low + (y[which, cell + 1] - low) * part)

        one, other = one[index], other[index]
        rooms = room + self.bend[which, cell] + (DAMPING * np.abs(loss) if damped else 0)
        off = np.abs(between(self.normal[0]) - one)
        if not free_scale:
            upper = between(self.normal[1])
            off = np.maximum(off, np.abs(upper - other) / (np.minimum(np.abs(upper), np.abs(other)) + SMALL))
        if not damped:
            off = np.maximum(off, np.abs(loss) / 2)
        good = off <= rooms
        if far and len(index):
            good |= off <= FAR
            off = np.where(np.isfinite(off), off, np.inf)
            order = np.lexsort((off, root.s[index], which))
            starts = np.diff(which[order], prepend=-1) + np.diff(root.s[index][order], prepend=-1.0) != 0
            good[order[starts]] = True
        return which[good], chosen[index[good]]

    def at(self, which: Integers, phase: Floats) -> tuple[Floats, Floats]:
        """h w, and log of the determinant of a step, where these curves have these phases."""
        at = which * APART + np.clip(phase, self.low[which, 0], self.high[which, 0])
        return np.interp(at, self.axis, self.x), np.interp(at, self.axis, self.loss)


@lru_cache(maxsize=64)
def curves(of: Sequence[str]) -> Curves:
    """The curves of these families."""
    each = [_curve(key) for key in of]
    base = np.repeat(np.arange(len(of)), [len(x.low) for x in each])
    shift = np.repeat(APART * np.arange(len(base)), [len(y) for key in of for y, _ in _ranges(key)])
    return Curves(
        base,
        np.concatenate([x.low for x in each]),
        np.concatenate([x.high for x in each]),
        np.concatenate([x.normal for x in each], axis=1),
        np.concatenate([x.log_det for x in each]),
        np.concatenate([x.bend for x in each]),
        np.concatenate([x.axis for x in each]) + shift,
        np.concatenate([x.x for x in each]),
        np.concatenate([x.loss for x in each]),
    )


@cache
def _curve(key: str) -> Curves:
    """The curves of one family, all at the beginning of the axis."""
    grid = np.linspace(0, np.pi, CELLS + 1)
    ranges = _ranges(key)
    ends = np.array([(y[0], y[-1]) for y, _ in ranges])
    x = np.array([np.interp(grid, *part) for part in ranges])
    with np.errstate(all="ignore"):
        for _ in range(3):
            # straight lines between tabulated steps are not as fine as the comparison
            better = x + (grid - _phase(key, x)) * np.gradient(x, grid, axis=1)
            x = np.where(np.isfinite(better) & (np.abs(better - x) < 0.1 * x), better, x)
        cells = _normal(key, x.ravel())
    # a root beside the end of a curve lies between two cells of which one is beyond it
    low, high = ends[:, :1], ends[:, 1:]
    room = BEYOND[1] + np.pi / CELLS
    inside = (grid > low - room) & (grid < high + room)
    normal, log_det = (np.where(inside, part.reshape(*part.shape[:-1], *x.shape), np.nan) for part in cells)
    # at the end of a curve straight lines miss more than can be seen beside it
    bend = np.full(x.shape, END)
    rows = np.array([*normal, log_det])
    bend[:, 1:-1] = np.max(np.abs(rows[..., 2:] - 2 * rows[..., 1:-1] + rows[..., :-2]), axis=0)
    bend[:, 0] = bend[:, 1]
    bend[(np.abs(grid - low) < room) & (low > room) | (np.abs(grid - high) < room)] = END
    bend = np.where(np.isfinite(bend), bend, END)
    bend[:, :-1] = np.maximum(bend[:, :-1], bend[:, 1:])
    axis, every = (np.concatenate([part[i] for part in ranges]) for i in (0, 1))
    return Curves(
        np.zeros(len(ranges), dtype=np.int64), low, high, normal, log_det, bend, axis, every,
        _normal(key, every)[1],
    )  # fmt: skip


def _phase(key: str, x: Floats) -> Floats:
    """The phase of a step of h w = x (b, c), between 0 and 2 pi."""
    out = unit(FAMILIES[key], np.square(x.ravel()), np.zeros(x.size))
    angle = np.asarray(rotation(out).angle, np.float64)
    return np.where(out[:, 0, 1] < 0, 2 * np.pi - angle, angle).reshape(x.shape)


def _normal(key: str, x: Floats) -> tuple[Floats, Floats]:
    """M11 and M12 (2, c) over the root of the determinant, and its log (c,)."""
    out = unit(FAMILIES[key], np.square(x), np.zeros(len(x)))
    log_det = np.log(np.abs(np.linalg.det(out)))
    return np.asarray(out[:, 0, :].T * np.exp(-log_det / 2)), log_det
