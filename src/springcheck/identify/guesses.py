"""First guesses of the families' unknowns, from the roots of a measured map.

Without friction the map of a family is a curve over the phase of its step, which is tabulated.  Each matrix
root of the measured map has a phase, so that its entries are compared with those of all curves at once; what
comes near is refined by Gauss-Newton.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np

from springcheck.identify.families import FAMILIES, Family
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import STRIDES
from springcheck.identify.maps import MapTable, table, unit
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats, Integers
from springcheck.schemes import rotation

NEAR = 1e-11, 30.0
"""Distance of the entries of one step within which a family is compared exactly, absolute and in standard
errors: what Gauss-Newton in double precision leaves of the right family."""

FAR = 3.0
"""Distance of the entries beyond which a guess is dropped before Gauss-Newton converges."""

CURVED, QUOTIENT, FARTHEST = 30.0, 1e-5, 0.3
"""Residual after a Gauss-Newton step of length d of a family that converges: at most `CURVED` d**2 (8.4 was
the largest in 11,600 maps, damped up to 0.9 of the critical) plus `QUOTIENT` d (slopes are difference
quotients), for d below `FARTHEST`."""

FLOW_TURNS = 8
"""Largest number of turns between two frames for the exact solution, which has no step that limits them."""

CELLS = 4096
CELL = 2 * math.pi / CELLS
"""Cells of the table, over a whole turn: RK4 turns by more than half a turn, beyond its limit by almost a
whole one."""

NODE_HALVINGS = 16
"""Halvings of an interval of h w on which a phase ends, as a square root: 2**-8 is left, below a cell."""

GLANCE = 3e-6
"""Distance of the entries of one step from the table, relative to the root of the determinant and beside the
error of linear interpolation, within which a guess is refined."""

DAMPING = 2.0
"""Distance from the table that friction may add, in units of g: 1.7 at most in 2,900 maps of up to 0.9 of the
critical damping."""

SWAY = 8.0
"""Phase by which friction exceeds the largest one, in units of g: substeps forward and back add up to 4.4
steps in Forest & Ruth's scheme, and count twice in a phase that is far from half a turn."""

END = 0.02
"""Phase beside the largest one within which the table is not relied upon."""

FOLDED = 0.7
"""Share of the largest phase from which friction may raise a phase above it."""

FOLDS = 0.6, 0.75, 0.9, 1.05, 1.2
"""First guesses of h w in that case, in units of the h w of the largest phase."""

LARGEST = 30.0
"""Largest h w that is tabulated, of schemes that are unstable there too."""


@dataclass(frozen=True, slots=True, eq=False)
class _Curves:
    """One-step maps of frictionless families over the phase: a curve for each interval of h w on which the
    phase is monotonic.

    Each curve has its family and last phase; `rows` (curves, 5, `CELLS` + 1) holds h w, the log of the
    determinant, M11 and M12 over the root of the determinant, and the curvature within a cell.
    """

    family: Integers
    high: Floats
    rows: Floats


@lru_cache(maxsize=64)
def _curves(families: tuple[str, ...]) -> _Curves:
    each = [_curve(name) for name in families]
    of = np.repeat(np.arange(len(each)), [len(x.high) for x in each])
    return _Curves(of, *(np.concatenate([getattr(x, name) for x in each]) for name in ("high", "rows")))


@cache
def _curve(name: str) -> _Curves:
    def rows_at(x: Floats) -> Floats:
        m = np.asarray(unit(FAMILIES[name], np.square(x), np.zeros_like(x)), np.float64)
        found = rotation(m.astype(np.longdouble))
        phase = np.where(m[:, 0, 1] < 0, 2 * np.pi - found.angle, found.angle)
        loss = np.log(np.abs(np.asarray(found.determinant, np.float64)))
        turning = np.asarray(found.angle > 0, np.float64)
        return np.array([turning, phase, x, loss, *(m[:, 0].T * np.exp(-loss / 2))], np.float64)

    with np.errstate(all="ignore"):
        every = rows_at(np.concatenate([np.geomspace(1e-6, 1e-4, 9), np.linspace(2e-4, 3.5, 1000),
                                        np.geomspace(3.5, LARGEST, 300)[1:]]))  # fmt: skip
        for _ in range(NODE_HALVINGS):
            # nodes a cell apart at most: the phase is steep where it ends, as Verlet's at the limit
            wide = np.flatnonzero(np.abs(np.diff(every[1])) > CELL)
            more = rows_at((every[2, wide] + every[2, wide + 1]) / 2)
            every = np.insert(every, wide + 1, more, axis=1)
    turning = np.flatnonzero(every[0])
    phase, rows = every[1, turning], every[2:, turning]
    cuts = np.flatnonzero((np.diff(np.sign(np.diff(phase))) != 0) | (np.diff(turning)[:-1] > 1)) + 1
    grid = np.linspace(0, 2 * math.pi, CELLS + 1)
    high, out = [], []
    for piece in np.split(np.arange(len(phase)), cuts):
        at = piece if phase[piece[-1]] >= phase[piece[0]] else piece[::-1]
        if len(at) > 1:
            high.append(phase[at[-1]])
            curve = np.array([np.interp(grid, phase[at], row[at]) for row in rows])
            bend = np.max(np.abs(np.diff(curve[1:], 2)), axis=0)
            bend = np.concatenate([bend[:1], np.maximum(bend[1:], bend[:-1]), bend[-1:]])
            out.append(np.concatenate([curve, [np.append(bend, bend[-1])]]))
    return _Curves(np.zeros(len(out), np.int64), np.array(high), np.array(out))


@cache
def _traces(family: Family) -> tuple[Floats, Floats]:
    """Values of (h w)**2 of either sign, and the trace of a step over the root of its determinant there."""
    half = np.geomspace(1e-8, LARGEST**2, 2000)
    nodes = np.concatenate([-half[::-1], half])
    m = np.asarray(unit(family, nodes, 0 * nodes), np.float64)
    return nodes, np.trace(m, axis1=1, axis2=2) / np.sqrt(np.abs(np.linalg.det(m)))


@dataclass(slots=True, eq=False)
class Roots:
    """Matrix roots (r,) of a map, as possible steps on (q, v h), with phase and log of the determinant."""

    s: Floats
    turns: Floats
    phase: Floats
    log_det: Floats
    step: Floats
    error: float


@lru_cache(maxsize=64)
def roots_of_map(found: Map, strides: tuple[int, ...]) -> Roots:
    """Matrix roots of these degrees, for every possible number of turns between two frames."""
    every = np.array(strides, np.float64)
    b = found.entries.astype(np.float64)
    ratio = float(found.size[1] / found.size[0])
    turn = found.turn
    det, angle = float(turn.determinant[0]), float(turn.angle[0])
    error = float(np.sqrt(np.max(np.diag(found.covariance)))) + ROUNDING
    if angle > 0:
        normal = (b / math.sqrt(det) - math.cos(angle) * np.eye(2)) / math.sin(angle)
        counts = np.maximum(every.astype(int), FLOW_TURNS if every[0] == 1 else 1)
        s = np.repeat(every, counts)
        turns = np.concatenate([np.arange(n) for n in counts]).astype(np.float64)
        # a map that turns by more than half a turn has an upper right entry below 0
        own = angle if b[0, 1] > 0 else 2 * math.pi - angle
        normal = normal if b[0, 1] > 0 else -normal
        phase = (own + 2 * math.pi * turns) / s
        kept = (phase < 2 * math.pi) | (s == 1)
        s, turns, phase = s[kept], turns[kept], phase[kept]
        log_det = math.log(det) / s
        step = np.cos(phase)[:, None, None] * np.eye(2) + np.sin(phase)[:, None, None] * normal
        step = step * np.exp(log_det / 2)[:, None, None]
        # relative to the root of the determinant: little is left of what dies down within a frame
        error *= (1 + 1 / math.sin(angle)) / math.sin(angle) / min(math.sqrt(det), 1.0)
    else:
        values, vectors = np.linalg.eig(b)
        values, vectors = np.real(values), np.real(vectors)
        # beyond its limit a step has negative eigenvalues, and an even number of them positive ones
        s = np.append(every, -every[every % 2 == 0]) if np.all(values > 0) else every[every % 2 == 1]
        gap = abs(values[0] - values[1]) / max(abs(values[0]), abs(values[1]), 1e-300)
        if gap < 1e-9 or not np.all(values):
            s = s[s == 1]
            step = np.repeat(b[None], len(s), axis=0)
        else:
            each = np.sign(s)[:, None] * np.sign(values) * np.abs(values) ** (1 / np.abs(s)[:, None])
            step = (vectors * each[:, None, :]) @ np.linalg.inv(vectors)
        s = np.abs(s)
        turns, phase, log_det = np.zeros_like(s), np.full(len(s), np.nan), math.log(abs(det) or 1e-300) / s
        error *= (1 + 1 / max(gap, 1e-6)) / max(gap, 1e-6)
    step = step.copy()
    # from (q/size, v T/size) to (q, v h)
    step[:, 0, 1] *= s / ratio
    step[:, 1, 0] *= ratio / s
    return Roots(s, turns, phase, log_det, step, error)


@dataclass(slots=True, eq=False)
class Guesses:
    """First guesses (c,): the indices of family and root, and the unknowns a and g."""

    which: Integers
    root: Integers
    a: Floats
    g: Floats

    def __getitem__(self, at: Integers) -> Guesses:
        return Guesses(self.which[at], self.root[at], self.a[at], self.g[at])


def first(every: MapTable, roots: Roots, *, growing: bool, free_scale: bool, far: bool) -> Guesses:
    """First guesses: a from the phase by the family's curve, g from the determinant.  Without `far`, only
    those whose entries may agree."""
    turning = np.flatnonzero(np.isfinite(roots.phase))
    standing = np.flatnonzero(~np.isfinite(roots.phase))
    curved = [i for i, f in enumerate(every.families) if not (f.held or f.flow)]
    parts = []
    if curved and len(turning):
        parts.append(_on_curves(every, roots, np.array(curved), turning, free_scale=free_scale, far=far))
    for i, family in enumerate(every.families):
        if family.held:
            a = 2 - np.trace(roots.step, axis1=1, axis2=2) + np.expm1(roots.log_det)
            g = (1 - roots.step[:, 0, 0]) / np.where(a == 0, 1, a)
            at = np.flatnonzero(np.abs(roots.step[:, 0, 1] - 1) < 0.1)
            parts.append((np.full(len(at), i), at, a[at], g[at]))
            continue
        if family.flow:
            at = turning[roots.s[turning] == 1]
            g = -roots.log_det[at] if family.damped else np.zeros(len(at))
            parts.append((np.full(len(at), i), at, roots.phase[at] ** 2 + g**2 / 4, g))
        elif family.damped and len((curve := _curve(_base(family))).high) > 1:
            # the phase turns back at its largest, which friction exceeds
            highest = curve.high[0] + SWAY * np.abs(roots.log_det)
            left = np.flatnonzero(~(roots.phase < FOLDED * curve.high[0]) & ~(roots.phase > highest))
            left = left[roots.s[left] <= STRIDES[0]]
            tries = np.array([(h_w * curve.rows[0, 0, -1], share) for h_w in FOLDS for share in (0.5, 1.0)])
            g = np.outer(-roots.log_det[left], tries[:, 1]).ravel()
            h_w = np.tile(tries[:, 0], len(left))
            parts.append((np.full(len(g), i), np.repeat(left, len(tries)), h_w**2, g))
        if len(standing):
            # real eigenvalues: an inverted spring, or friction beyond the critical
            left = standing[roots.s[standing] == 1] if family.flow else standing
            logs = np.log(np.abs(np.real(np.linalg.eigvals(roots.step[left]))) + 1e-300)
            a = logs[:, 0] * logs[:, 1]
            g = -np.sum(logs, axis=1) if family.damped else 0 * a
            parts.append((np.full(len(left), i), left, a, g))
            if not (family.damped or family.flow):
                # beyond its limit a step has the trace of one of its springs all the same
                wanted = np.trace(roots.step[left], axis1=1, axis2=2) * np.exp(-roots.log_det[left] / 2)
                nodes, traces = _traces(family)
                off = traces - wanted[:, None]
                at, k = np.nonzero(off[:, 1:] * off[:, :-1] <= 0)
                a = nodes[k] + (nodes[k + 1] - nodes[k]) * off[at, k] / (off[at, k] - off[at, k + 1])
                parts.append((np.full(len(at), i), left[at], a, 0 * a))
    which, root, a, g = (np.concatenate(x) for x in zip(*parts, strict=True))
    if every.damped and not growing:
        held = every.held[which]
        g = np.where(held, g, np.maximum(g, 1e-9))
    good = np.isfinite(a) & np.isfinite(g) & (a != 0)
    return Guesses(which[good], root[good].astype(np.int64), a[good], g[good])


def _base(family: Family) -> str:
    """Name of the family without its friction."""
    return family.scheme if family.damped else family.name


def _on_curves(
    every: MapTable, roots: Roots, curved: Integers, turning: Integers, *, free_scale: bool, far: bool
) -> tuple[Integers, Integers, Floats, Floats]:
    """Families and roots of the same phase without friction, whose entries may agree, with a and g."""
    # friction moves a step away from that without it, which many families share
    bases = np.array([_base(every.families[i]) for i in curved.tolist()])
    names, base = np.unique(bases, return_inverse=True)
    curves = _curves(tuple(names.tolist()))
    at = turning[roots.phase[turning] < 2 * math.pi]
    phase, log_det = roots.phase[at], roots.log_det[at]
    first, second = (roots.step[at, 0, k] * np.exp(-log_det / 2) for k in (0, 1))
    cell = np.minimum((phase / CELL).astype(np.int64), CELLS - 1)
    part = phase / CELL - cell

    def between(k: int, curve: Any, r: Any) -> Floats:
        left, right = (curves.rows[curve, k, cell[r] + i] for i in (0, 1))
        return np.asarray(left + (right - left) * part[r])

    each, all_ = np.arange(len(curves.high))[:, None], np.arange(len(at))
    bend, loss = curves.rows[each, 4, cell], between(1, each, all_) - log_det
    lost, off = np.abs(loss) - bend, np.abs(between(2, each, all_) - first) - bend
    room = GLANCE + NEAR[1] * roots.error
    beyond = phase - curves.high[:, None]
    close = off <= room + DAMPING * np.abs(loss) if every.damped else (off <= room) & (lost <= 2 * room)
    # friction may exceed the largest phase, and beside it a table says little
    beside = (beyond > -END) & (np.abs(loss) <= 2 if every.damped else True)
    curve, r = np.nonzero(
        far | (close & (beyond < END + DAMPING * np.abs(loss) * every.damped)) | (beside & (beyond < END))
    )
    if not (far or free_scale):
        other = between(3, curve, r)
        size = np.minimum(np.abs(other), np.abs(second[r])) + 0.05
        rooms = (
            room + (DAMPING * np.abs(loss[curve, r]) if every.damped else 0) + curves.rows[curve, 4, cell[r]]
        )
        kept = (np.abs(other - second[r]) <= rooms * size) | (phase[r] > curves.high[curve] - END)
        curve, r = curve[kept], r[kept]
    g = loss[curve, r] if every.damped else np.zeros(len(r))
    h_w = between(0, curve, r)
    # a step so small that it is not tabulated
    h_w = np.where(phase[r] < CELL, phase[r], h_w)
    # every family of a curve
    order = np.argsort(base, kind="stable")
    counts = np.bincount(base, minlength=len(names))
    of = curves.family[curve]
    times = counts[of]
    begin = np.repeat((np.cumsum(counts) - counts)[of] - (np.cumsum(times) - times), times)
    which = curved[order[begin + np.arange(int(np.sum(times)))]]
    return which, np.repeat(at[r], times), np.repeat(h_w**2 + g**2 / 4, times), np.repeat(g, times)


def polished(every: MapTable, roots: Roots, x: Guesses, *, free_scale: bool, far: bool = False) -> Guesses:
    """Refine guesses by Gauss-Newton on a step's entries; keep those near a root, with `far` within `FAR`."""
    # three of a table's guesses, and one more beside the largest phase, where it says little
    rounds = 6 if every.damped else 4
    bound = NEAR[0] + NEAR[1] * roots.error
    length = np.full(len(x.a), np.inf)

    def left(a: Floats, g: Floats, wanted: Floats, size: Floats) -> Floats:
        found = _compared(every.unit(x.which, a, g).astype(np.float64), free_scale=free_scale)
        return np.asarray((found - wanted) / size)

    for turn in range(rounds + 1):
        wanted = _compared(roots.step[x.root], free_scale=free_scale)
        size = _entry_sizes(wanted, roots, x)
        r = left(x.a, x.g, wanted, size)
        off = np.max(np.abs(r), axis=0)
        # after a short step the residual is of the order of its square, or Gauss-Newton does not converge
        short = np.where(length < FARTHEST, CURVED * length**2 + QUOTIENT * length, FAR)
        keep = np.flatnonzero(off <= (FAR if far else bound + (short if turn < rounds else 0.0)))
        x, length = x[keep], length[keep]
        if turn == rounds or not len(keep) or float(np.max(off[keep])) < NEAR[0]:
            return x
        r, wanted, size = r[:, keep], wanted[:, keep], size[:, keep]
        moves = [(1e-6 * np.abs(x.a), 0.0)] + ([(0.0, 1e-7)] if every.damped else [])
        slopes = np.array([(left(x.a + d, x.g + e, wanted, size) - r) / (d + e) for d, e in moves])
        step = least_squares(slopes, -r)[0]
        x.a = x.a + np.clip(step[0], -0.5 * np.abs(x.a), 0.5 * np.abs(x.a))
        length = np.abs(step[0] / x.a)
        if every.damped:
            x.g = x.g + step[1]
            length = length + np.abs(step[1]) / np.sqrt(np.abs(x.a))
        # at the limit an entry is all but 0, and changes by a multiple of itself
        length = np.maximum(length, np.max(np.abs(np.einsum("imc,ic->mc", slopes, step)), axis=0))
    return x


def _entry_sizes(wanted: Floats, roots: Roots, x: Guesses) -> Floats:
    """Scales of the entries: for the diagonal the root of the determinant, for the others their own size
    without its zero at half a turn."""
    whole = np.exp(np.maximum(roots.log_det[x.root] / 2, -600))
    bend = np.nan_to_num(np.abs(np.sinc(roots.phase[x.root] / np.pi)), nan=1.0)
    out = np.abs(wanted)
    out[[0, -1]] = np.maximum(out[[0, -1]], whole)
    out[1:-1] = np.maximum(out[1:-1], 0.1 * out[1:-1] / np.maximum(bend, 1e-9)) + 1e-300
    # a drift moves by v h; what does not turn may leave little of it
    lost = ~np.isfinite(roots.phase[x.root])
    out[1] = np.where(lost & (len(out) == 4), np.maximum(out[1], 0.3), out[1])
    return out


def _compared(m: Floats, *, free_scale: bool) -> Floats:
    """Entries (4, c) of matrices (c, 2, 2); with `free_scale` invariants (3, c) under scaled velocities."""
    if free_scale:
        return np.stack([m[:, 0, 0], m[:, 0, 1] * m[:, 1, 0], m[:, 1, 1]])
    return np.stack([m[:, 0, 0], m[:, 0, 1], m[:, 1, 0], m[:, 1, 1]])


def least_squares(slopes: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Solutions (k, c) of c least-squares problems with derivatives (k, m, c), values (m, c); variances."""
    square = np.einsum("imc,jmc->cij", slopes, slopes)
    size = np.sqrt(np.einsum("cii->ci", square)) + 1e-300
    even = square / size[:, :, None] / size[:, None, :] + 1e-13 * np.eye(len(slopes))
    inverse = np.linalg.inv(even) / size[:, :, None] / size[:, None, :]
    step = np.einsum("cij,jmc,mc->ic", inverse, slopes, right)
    return np.asarray(step), np.asarray(np.einsum("cii->ic", inverse))


def roots_of(
    families: tuple[Family, ...], steps: Floats, room: float, *, free_scale: bool = False
) -> tuple[Integers, Integers, Floats, Floats]:
    """Families that have one of these one-step matrices (r, 2, 2) on (q, v h) to within `room`: indices of
    family and matrix, a and g."""
    every = table(families)
    with np.errstate(all="ignore"):
        found = rotation(steps.astype(np.longdouble))
        phase = np.where(found.angle > 0, found.angle, np.nan).astype(np.float64)
        phase = np.where(steps[:, 0, 1] < 0, 2 * np.pi - phase, phase)
        log_det = np.log(np.abs(found.determinant)).astype(np.float64)
        ones = np.ones(len(steps))
        roots = Roots(ones, 0 * ones, phase, log_det, steps, room / NEAR[1])
        x = first(every, roots, growing=False, free_scale=True, far=True)
        x = polished(every, roots, x, free_scale=free_scale)
    return x.which, x.root, x.a, x.g
