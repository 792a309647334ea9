"""The map between recorded states, by least squares, and how well the states determine it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from springcheck.arrays import Extended, Floats
from springcheck.identify.orbit import orbit, repeats
from springcheck.identify.record import Record

ROUNDING = 2.0**-53

FEWEST_PAIRS = 5
"""More pairs than these are needed before a constant part is looked for."""


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
    once: bool | None = None
    """Whether the states were rounded once, as they were written, and never in the motion; None where that
    does not show."""

    @property
    def unscaled(self) -> Extended:
        """The map on (q, v T), both lengths."""
        return np.asarray(self.entries * self.size[:, None] / self.size[None, :])


def _least_squares(columns: Extended, right: Extended) -> Extended:
    """Solution x of columns x = right by normal equations in extended precision, refined twice.

    With columns of size 1 the condition of the normal equations is far below 1/eps of extended precision
    unless the states are degenerate, which is found out apart.
    """
    gram = columns.T @ columns
    inverse = np.linalg.pinv(gram.astype(np.float64)).astype(np.longdouble)
    x = inverse @ (columns.T @ right)
    for _ in range(3):
        x = x + inverse @ (columns.T @ (right - columns @ x))
    return np.asarray(x)


def _sizes(z: Extended) -> Extended:
    """Sizes (2,) of the two components over one turn, also where the motion grows or decays."""
    size = np.sqrt(np.mean(z**2, axis=0))
    size = np.where(size == 0, 1, size)
    for _ in range(3):
        norm = np.sum((z / size) ** 2, axis=1, keepdims=True)
        share = np.mean(z**2 / np.where(norm == 0, 1, norm), axis=0)
        size = np.where(share == 0, size, np.sqrt(share))
    return np.asarray(size * np.sqrt(np.mean(np.sum((z / size) ** 2, axis=1)) / 2))


def fit(record: Record, j: int) -> Map:
    """The map of oscillator j.  A constant part (an equilibrium away from 0) is taken in where it shows.

    Rounding is relative to a state's size, or to what the file resolves: pairs count by the inverse of it,
    so that a motion over many powers of ten is not judged by its largest states alone.
    """
    z = np.stack([record.q[:, j], record.v[:, j] * record.interval], axis=1)
    size = _sizes(z - np.mean(z, axis=0))
    size = np.minimum(size, _sizes(z)) if np.all(_sizes(z) < 2 * size) else size
    z = z / size
    quanta = np.stack([record.q_quantum[:, j], record.v_quantum[:, j] * abs(float(record.interval))], axis=1)
    quanta = quanta / size.astype(np.float64)
    pairs = len(z) - 1
    noise = np.sqrt(np.sum((ROUNDING * z.astype(np.float64)) ** 2 + quanta**2 / 12, axis=1))[:-1]
    length = np.sqrt(np.sum(z[:-1].astype(np.float64) ** 2, axis=1))
    # a start of few digits, or 0, is exact, but what follows from it is not: it may not outweigh the rest
    moving = length > 0
    lowest = float(np.quantile(noise[moving] / length[moving], 0.1)) if np.any(moving) else 0.0
    noise = np.maximum(noise, lowest / 3 * length)
    weight = 1 / np.maximum(noise, 1e-9 * np.max(noise))
    about = z[:-1] - np.mean(z, axis=0) if np.any(np.abs(np.mean(z, axis=0)) > 1) else z[:-1]
    weight = np.asarray(
        weight * np.sqrt(2 * pairs / float(np.sum((weight[:, None] * about) ** 2))), dtype=np.float64
    )
    w = weight[:, None].astype(np.longdouble)
    before, after = w * z[:-1], w * z[1:]
    x = _least_squares(before, after)
    rss = np.sum((after - before @ x) ** 2, axis=0)
    centre = np.zeros(2, dtype=np.longdouble)
    floor = float(np.sum((4 * ROUNDING * before) ** 2))
    if np.any(rss > floor) and pairs > FEWEST_PAIRS:
        wide = np.concatenate([before, w], axis=1)
        y = _least_squares(wide, after)
        left = np.sum((after - wide @ y) ** 2, axis=0)
        # one number more per row removes chi-squared of 1 by chance; 50 is seven standard errors
        if np.any(rss - left > 50 * np.maximum(left / (pairs - 3), floor / pairs)):
            back = np.linalg.pinv((np.eye(2) - y[:2].T).astype(np.float64)).astype(np.longdouble)
            centre = back @ y[2]
            for _ in range(3):
                centre = centre + back @ (y[2] - centre + y[:2].T @ centre)
            x, rss = y[:2], left
    z = z - centre
    spread = (w * z[:-1]).astype(np.float64)
    gram = spread.T @ spread
    least = ROUNDING / 2 * float(np.sqrt(np.mean(np.sum(before**2, axis=1))))
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
    )
    if record.fine or not conditioned:
        return found
    return _seen_through_storage(found, quanta, inverse, text=record.text)


def _seen_through_storage(found: Map, quanta: Floats, inverse: Floats, *, text: bool) -> Map:
    """The map with what its states' storage, to within `quanta` (f, 2), says of it.

    Where all states are one orbit, rounded once, that orbit knows the map best.  Text does not show
    whether the arithmetic was coarser than it, so there it is enough that an orbit explains it.
    """
    storage = _storage_covariance(found.z, found.entries, quanta, found.weight, inverse)
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
    z: Extended, entries: Extended, quanta: Floats, weight: Floats, inverse: Floats
) -> Floats:
    """Covariance (4, 4) of the entries from the rounding of each recorded number, uniform within a quantum.

    A rounded state stands in two pairs, once as the later and once as the earlier one; the two
    influences partly cancel, so they are summed before they are squared.
    """
    states, b = z.astype(np.float64), entries.astype(np.float64)
    later, earlier = np.zeros_like(states), np.zeros_like(states)
    later[1:] = weight[:, None] ** 2 * states[:-1]
    earlier[:-1] = weight[:, None] ** 2 * states[:-1]
    # influence[m, j, i, a]: of the error of component j of state m on entry (i, a)
    influence = np.eye(2)[None, :, :, None] * later[:, None, None, :]
    influence = influence - b.T[None, :, :, None] * earlier[:, None, None, :]
    influence = (influence @ inverse).reshape(len(states), 2, 4)
    weighted = (influence * (quanta / np.sqrt(12.0))[:, :, None]).reshape(-1, 4)
    return np.asarray(weighted.T @ weighted)
