"""The map between recorded states, by least squares, and how well the states determine it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import IdentificationError
from springcheck.identify.orbit import orbit, repeats
from springcheck.identify.record import Record
from springcheck.physics.arrays import Extended, Floats
from springcheck.schemes import rotation
from springcheck.schemes.linear import Rotation

ROUNDING = 2.0**-53

DEAD = 2.0**-40
"""Distance from an equilibrium, as a share of its own from 0, below which a motion has died down to it."""

SHOWN, SUSPECTED = 50.0, 10.0
"""Chi-squared that shows a constant part, and that one may make in a coarse file: it must stay far below what
a right scheme may miss."""

SHORT = 8
"""Distance of an arc from the equilibrium, in its own size, from which its size is that distance."""

LEAST_NOISE = 1e-30
"""Share of the largest noise that a pair counts with at least: a motion that grows by 1e20 shows its
equilibrium in its first frames alone."""

FEWEST_PAIRS = 3
"""More pairs than these are needed before a constant part is looked for: as many unknowns has a row then."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Map:
    """The map z -> B z of one oscillator's states z = ((q - centre)/size_q, v T/size_v), of size 1 each.

    `covariance` (4, 4) belongs to the entries B11, B12, B21, B22; `residual` (2,) is the root mean square
    of what B leaves over of each component.
    """

    entries: Extended
    covariance: Floats
    residual: Floats
    size: Extended
    centre: Extended
    z: Extended
    weight: Floats
    """Weight (f - 1,) of each pair of states."""
    conditioned: bool
    """Whether the states span the plane beyond their noise."""
    whole: bool = False
    """Whether entries and covariance are those of the orbit of all states, not of pairs."""
    drifts: bool = False
    """Whether the constant part is no equilibrium: the position gets a constant in every step."""
    slips: Extended | None = None
    """Relative excess (f - 1,) of each step over the mean, where the steps show it."""
    found: dict[Any, Any] = field(default_factory=dict, init=False)
    """What was already looked for with this map: searches ask for the same several times."""
    once: bool | None = None
    """Whether the states were rounded once, as they were written, and never in the motion; None where that
    does not show."""

    @property
    def unscaled(self) -> Extended:
        """The map on (q, v T), both lengths."""
        return np.asarray(self.entries * self.size[:, None] / self.size[None, :])

    @property
    def turn(self) -> Rotation:
        """How the map turns."""
        if "turn" not in self.found:
            self.found["turn"] = rotation(self.entries[None])
        out: Rotation = self.found["turn"]
        return out

    def misses(self, other: Map | None = None) -> Floats:
        """What the map leaves over in each pair of its states, or of those of another fit, (f - 1, 2)."""
        z = self.z
        if other is not None:
            z = (other.z * other.size + other.centre - self.centre) / self.size
        return np.asarray(z[1:] - z[:-1] @ self.entries.T, np.float64)


def least_squares(columns: Extended, right: Extended) -> Extended:
    """Solution x of columns x = right by normal equations in extended precision, refined twice.

    With columns of size 1 the condition of the normal equations is far below 1/eps of extended precision
    unless the states are degenerate, which is found out apart.
    """
    size = np.sqrt(np.sum(columns**2, axis=0))
    size = np.where(size > 0, size, 1)
    columns = columns / size
    inverse = np.linalg.pinv((columns.T @ columns).astype(np.float64)).astype(np.longdouble)
    x = inverse @ (columns.T @ right)
    for _ in range(3):
        x = x + inverse @ (columns.T @ (right - columns @ x))
    return np.asarray(x / size[:, None])


def _sizes(z: Extended) -> Extended:
    """Sizes (2,) of the two components over one turn, also where the motion grows or decays."""
    square = z**2
    size = np.sqrt(square.mean(axis=0))
    size = np.where(size == 0, 1, size)
    for _ in range(3):
        norm = square @ size**-2
        share = (square / np.where(norm == 0, 1, norm)[:, None]).mean(axis=0)
        size = np.where(share == 0, size, np.sqrt(share))
    return np.asarray(size * np.sqrt((square @ size**-2).mean() / 2))


def fit(record: Record, j: int, *, kept: NDArray[np.bool_] | None = None, constant: bool = False) -> Map:
    """The map of oscillator j, from the pairs that are `kept` (f - 1,), or from all.

    A constant part is taken in where it shows, or in any case (`constant`): an equilibrium away from 0,
    whose velocity is 0, or else a constant that is added to the position in every step (`drifts`).  Where
    the steps are the differences of rounded times, the map's change with the step is fitted along with it
    (`slips`).

    Rounding is relative to a state's distance from the equilibrium and to that of the equilibrium from 0,
    or to what the file resolves: pairs count by the inverse of it, so that a motion over many powers of ten
    is not judged by its largest states alone.
    """
    z = np.stack([record.q[:, j], record.v[:, j] * record.interval], axis=1)
    size, whole = _sizes(z - np.mean(z, axis=0)), _sizes(z)
    size = np.minimum(size, whole) if np.all(whole < 2 * size) else size
    chosen = np.ones(len(z) - 1, dtype=bool) if kept is None else kept
    pairs = int(np.count_nonzero(chosen))
    first = _preliminary(z / size, chosen)
    # a short arc about 0 is as large as its distance from there
    short = record.fine and not np.any(first) and bool(np.any(whole > SHORT * size))
    size = whole if short else size
    z = z / size
    quanta = record.quanta(j) / size.astype(np.float64)
    # at rest beside 0 the numbers' rounding is all that is left, and the same in every step
    away = np.sqrt(np.sum((z[:-1].astype(np.float64) - first) ** 2, axis=1))
    dead = away < DEAD * float(np.sqrt(np.sum(first**2)))
    if np.count_nonzero(chosen & ~dead) > 3 * FEWEST_PAIRS:
        chosen = chosen & ~dead
        pairs = int(np.count_nonzero(chosen))
    weight = _pair_weights(z, quanta, first) * chosen
    w = weight[:, None].astype(np.longdouble)
    before, after = w * z[:-1], w * z[1:]
    slips, part = _following(record, before, w, after)
    after = after - part
    x = least_squares(before, after)
    left = after - before @ x
    centre = np.zeros(2, dtype=np.longdouble)
    floor = np.full(2, np.sum((4 * ROUNDING * before) ** 2), np.float64)
    if not record.fine:
        # few pairs may fit better than their numbers were written
        earlier, later = (np.sum((weight[:, None] * y) ** 2, axis=0) / 12 for y in (quanta[:-1], quanta[1:]))
        floor += later + (x.T.astype(np.float64) ** 2) @ earlier
    drifts = False

    def better(old: Extended, new: Extended, gain: float) -> bool:
        """Whether one number more removes so much of chi-squared; by chance it removes 1."""
        noise = np.maximum(np.sum(new**2, axis=0) / max(pairs - 3, 1), floor / pairs)
        return bool(np.any(np.sum(old**2, axis=0) - np.sum(new**2, axis=0) > gain * noise))

    if (constant or np.any(np.sum(left**2, axis=0) > floor)) and pairs > FEWEST_PAIRS:
        y = least_squares(np.concatenate([before, w], axis=1), after)
        free = after - np.concatenate([before, w], axis=1) @ y
        if constant or better(left, free, SHOWN if record.fine else SUSPECTED):
            noise = np.sqrt(np.maximum(np.sum(free**2, axis=0), floor))
            entries, at, resting = _about_rest(before, after, w, y, noise)
            # at rest the roundings are the same in every step, and add up to a constant of their own
            off = y[2] - (np.eye(2) - y[:2].T) @ at
            room = 64 * ROUNDING * float(np.max(np.abs(z)))
            drifts = better(resting, free, SHOWN) and float(np.max(np.abs(off))) > room
            if drifts:
                back = np.linalg.pinv((np.eye(2) - y[:2].T).astype(np.float64)).astype(np.longdouble)
                at = back @ y[2]
                for _ in range(3):
                    at = at + back @ (y[2] - at + y[:2].T @ at)
                entries, resting = y[:2], free
            x, left, centre = entries, resting, at
    z = z - centre
    rss = np.sum(left**2, axis=0)
    # beside an equilibrium that is fitted as well, states count by how they differ
    shift = np.sum(w**2 * z[:-1], axis=0) / np.sum(w**2) if np.any(centre != 0) else 0 * centre
    spread = (w * (z[:-1] - shift)).astype(np.float64)
    gram = spread.T @ spread
    least = ROUNDING / 2 * float(np.sqrt(np.sum(before**2) / pairs))
    variance = np.maximum(rss.astype(np.float64) / max(pairs - 2, 1), least**2)
    smallest = float(np.linalg.eigvalsh(gram / pairs)[0])
    conditioned = smallest > 100 * float(np.max(variance)) and smallest > (64 * ROUNDING) ** 2
    inverse = np.asarray(np.linalg.pinv(gram), dtype=np.float64)
    covariance: Floats = np.kron(np.diag(variance), inverse).astype(np.float64)
    found = Map(
        entries=x.T,
        covariance=covariance,
        residual=np.sqrt(rss.astype(np.float64) / pairs),
        size=size,
        centre=centre * size,
        z=z,
        weight=weight,
        conditioned=conditioned,
        drifts=drifts,
        slips=slips,
    )
    if record.fine or not conditioned or drifts or kept is not None:
        return found
    return _seen_through_storage(found, quanta, inverse, z[:-1] - shift, text=record.text)


def _following(
    record: Record, before: Extended, w: Extended, after: Extended
) -> tuple[Extended | None, Extended]:
    """The record's slips, where steps follow them, and what these do to the weighted states (f - 1, 2)."""
    pairs = int(np.count_nonzero(w))
    if record.slips is not None and pairs > 3 * FEWEST_PAIRS:
        plain = np.concatenate([before, w], axis=1)
        x = least_squares(plain, after)
        rest = np.linalg.pinv((np.eye(2) - x[:2].T).astype(np.float64)) @ x[2]
        wide = np.concatenate([plain, record.slips[:, None] * 1e12 * (before - w * rest)], axis=1)
        y = least_squares(wide, after)
        lost, left = (float(np.sum((after - columns @ u) ** 2)) for columns, u in ((plain, x), (wide, y)))
        floor = float(np.sum((4 * ROUNDING * before) ** 2))
        # a clock is known, so that even errors within the rounding of a step show whether steps follow it
        if lost - left > 100 * max(left / pairs, floor / pairs / 256):
            return record.slips, wide[:, 3:] @ y[3:]
    return None, np.zeros_like(after)


def _preliminary(z: Extended, chosen: NDArray[np.bool_]) -> Floats:
    """The equilibrium (2,) as pairs show it that count by their size, 0 where they show none."""
    before, after = z[:-1][chosen].astype(np.float64), z[1:][chosen].astype(np.float64)
    if len(before) <= FEWEST_PAIRS:
        return np.zeros(2)
    # of a motion that grows the first frames show it, however small they are beside the last
    weight = np.sqrt(np.sum(before**2 + after**2, axis=1, keepdims=True))
    weight = 1 / np.maximum(weight, LEAST_NOISE * np.max(weight))
    before, after = weight * before, weight * after
    wide = np.concatenate([before, weight], axis=1)
    y, x = (np.linalg.lstsq(columns, after, rcond=None)[0] for columns in (wide, before))
    one, other = (float(np.sum((after - c @ b) ** 2)) for c, b in ((wide, y), (before, x)))
    floor = float(np.sum((8 * ROUNDING * before) ** 2))
    if other <= floor or other - one <= 50 * max(one, floor) / len(before):
        return np.zeros(2)
    return np.asarray(np.linalg.pinv(np.eye(2) - y[:2].T) @ y[2])


def _pair_weights(z: Extended, quanta: Floats, rest: Floats) -> Floats:
    """Weights (f - 1,) of the pairs, whose weighted states have a mean square of 2."""
    states = z.astype(np.float64)
    length = np.sqrt(np.sum((states - rest) ** 2, axis=1)) + np.sqrt(np.sum(rest**2))
    noise = np.sqrt((ROUNDING * length) ** 2 + np.sum(quanta**2, axis=1) / 12)
    # of both states of a pair: a start that is 0, or near it, is finer than what follows from it
    noise, length = (np.maximum(x[:-1], x[1:]) for x in (noise, length))
    # a start of few digits, or 0, is exact, but what follows from it is not: it may not outweigh the rest
    moving = length > 0
    shares = np.sort(noise[moving] / length[moving])
    lowest = float(np.interp(0.1 * (len(shares) - 1), np.arange(len(shares)), shares)) if len(shares) else 0.0
    noise = np.maximum(noise, lowest / 3 * length)
    weight = 1 / np.maximum(noise, LEAST_NOISE * np.max(noise))
    about = states[:-1] - rest
    size = float(np.sum((weight[:, None] * about) ** 2))
    if not size:
        raise IdentificationError("a coordinate rests but for the last frame: give the part before")
    return np.asarray(weight * np.sqrt(2 * len(about) / size))


def _about_rest(
    before: Extended, after: Extended, w: Extended, y: Extended, noise: Extended
) -> tuple[Extended, Extended, Extended]:
    """The map (transposed), equilibrium and residuals where the velocity of the equilibrium is 0: five
    unknowns, found from y, the three of each row by itself, whose rows have this `noise` (2,)."""
    n = len(before)
    x = y[:2]
    gap = np.eye(2) - x.T
    scale = float(np.sum(gap[:, 0] ** 2))
    at = np.array([gap[:, 0] @ y[2] / scale if scale else 0.0, 0.0], dtype=np.longdouble)
    for _ in range(3):
        columns = np.zeros((2, n, 5), dtype=np.longdouble)
        columns[0, :, :2] = columns[1, :, 2:4] = before - w * at
        columns[:, :, 4] = w[:, 0] * gap[:, :1]
        # the old equilibrium's own part, which the last column corrects
        right = (after - w * at).T
        u = least_squares(
            (columns / noise[:, None, None]).reshape(-1, 5), (right / noise[:, None]).reshape(-1, 1)
        )[:, 0]
        x = np.stack([u[:2], u[2:4]], axis=1)
        gap = np.eye(2) - x.T
        at = at + np.array([u[4], 0], dtype=np.longdouble)
    left = after - w * at - (before - w * at) @ x
    return x, at, np.asarray(left)


def _seen_through_storage(
    found: Map, quanta: Floats, inverse: Floats, before: Extended, *, text: bool
) -> Map:
    """The map with what its states' storage, to within `quanta` (f, 2), says of it.

    Where all states are one orbit, rounded once, that orbit knows the map best.  Text does not show
    whether the arithmetic was coarser than it, so there it is enough that an orbit explains it.
    """
    storage = _storage_covariance(before, found.entries, quanta, found.weight, inverse)
    pairs = replace(found, covariance=(found.covariance + storage) * repeats(found.z))
    whole = orbit(found.z, quanta, found.entries, constant=bool(np.any(found.centre != 0)))
    if whole is None:
        return pairs
    if not (whole.within if text else whole.once):
        return replace(pairs, once=whole.once)
    return replace(
        found,
        entries=whole.entries,
        covariance=whole.covariance,
        z=found.z - whole.centre,
        centre=found.centre + whole.centre * found.size,
        whole=True,
        once=whole.once,
    )


def _storage_covariance(
    before: Extended, entries: Extended, quanta: Floats, weight: Floats, inverse: Floats
) -> Floats:
    """Covariance (4, 4) of the entries from the rounding of each recorded number, uniform within a quantum.

    A rounded state stands in two pairs, once as the later and once as the earlier one; the two
    influences partly cancel, so they are summed before they are squared.
    """
    b = entries.astype(np.float64)
    later, earlier = np.zeros((2, len(quanta), 2))
    later[1:] = earlier[:-1] = weight[:, None] ** 2 * before.astype(np.float64)
    # influence[m, j, i, a]: of the error of component j of state m on entry (i, a)
    influence = np.eye(2)[None, :, :, None] * later[:, None, None, :]
    influence = influence - b.T[None, :, :, None] * earlier[:, None, None, :]
    influence = (influence @ inverse).reshape(len(quanta), 2, 4)
    weighted = (influence * (quanta / np.sqrt(12.0))[:, :, None]).reshape(-1, 4)
    return np.asarray(weighted.T @ weighted)
