"""The arithmetic by which every recorded frame follows from the one before, if a hypothesis is right."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from springcheck.identify.compare import SINGLE, Match
from springcheck.identify.measure import Map
from springcheck.identify.record import Record
from springcheck.identify.storage import BINARY, ROUNDING

MOST_DRAG = 40.0
"""Drags over one step above which exp(-drag) is below every rounding."""


def arithmetic(record: Record, found: Map, m: Match) -> str:
    """The arithmetic that explains every single frame by a hypothesis: "double", "single", the format of the
    file, or both; "" where none does."""
    if m.row.damped and abs(m.g) > MOST_DRAG:
        return ""  # a step that keeps no digit of a velocity tells of no drag, and roundings have no size
    s, b, z = m.stride, m.entries.reshape(2, 2), found.z
    ratio = float(found.size[1] / found.size[0])
    terms = m.sums * np.array([[1, ratio / s], [s / ratio, 1]])
    terms = np.maximum(terms, np.abs(b.astype(float)))
    miss = np.abs((z[1:] - z[:-1] @ b.T).astype(float))
    size, middle = np.abs(z.astype(float)), np.abs((found.centre / found.size).astype(float))
    length = np.sqrt(np.sum(size**2, 1))
    total = size[:-1] @ terms.T + size[1:] + 2 * (middle + terms @ middle)
    total = total + (length[:-1] + length[1:])[:, None] * (s > 1)
    if m.of_way:
        # velocities may be differences of positions over the step
        total[:, 1] += 2 * s / ratio * (size[1:, 0] + middle[0])
    if record.mixed:
        pace = abs(float(record.interval))
        own = np.stack([record.dq, record.dv * pace], -1).max(1)[1:] / found.size.astype(float)
        total = total + own / 2.0**-52
    # a force that is held over n substeps is added n times
    substeps = min(1 / max(abs(2 * m.g - 1), 1 / 64), 64) if m.row.free == "share" else 1
    usual = min(s * max(m.row.roundings, 4), 4 + 2 * math.sqrt(s * substeps)) * 4
    # steps may follow times that are rounded
    clock = record.clock if record.clock < 1e-12 or m.row.scheme == "exact" else 0.0
    slip = abs(m.a) ** 0.5 * s * clock
    turned = np.abs(z[:-1].astype(float)[:, ::-1] * [float(b[0, 1]), float(b[1, 0])])
    slide = (0.0 if m.scale_error else record.jitter) * turned
    allowed = 2 * ROUNDING * total * usual + slip * (length[:-1] + length[1:])[:, None] + 2 * slide
    if record.fine:
        return "double" if np.all(miss <= allowed) else ""
    return _of_digits(record, found, miss, allowed, total, b)


def _of_digits(record: Record, found: Map, miss: Any, allowed: Any, total: Any, b: Any) -> str:
    """As `arithmetic`, of numbers that are stored with fewer digits than double precision has."""
    quanta = found.noise * np.sqrt(12) / 2
    stored = quanta[1:] + quanta[:-1] @ np.abs(b.T.astype(float))
    stored = stored * (1 + 10 / math.sqrt(len(miss)))
    if np.all(miss <= allowed + stored):
        kept = (f"double, stored in {name}" if name in BINARY else name for name in record.names)
        return " and ".join(dict.fromkeys(kept))
    if np.median(quanta) < SINGLE * float(np.median(np.abs(found.z))) / 8:
        # numbers of single precision have no more digits
        return ""
    single = allowed * SINGLE / ROUNDING
    if np.all(miss <= single + stored) and SINGLE * total.max() > 1e-4 * np.median(quanta):
        return "single"
    return ""
