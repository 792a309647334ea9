"""What the defect of single steps says of the arithmetic, once the scheme is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck.arrays import Extended, Floats
from springcheck.identify import coarse
from springcheck.identify.coarse import QUANTUM
from springcheck.identify.families import FAMILIES
from springcheck.identify.fit import Map
from springcheck.identify.maps import table
from springcheck.identify.match import Match
from springcheck.identify.record import Record

__all__ = ["QUANTUM", "Defect", "defect", "misses", "predicted"]

REBUILT = 1 / 32, 1.0
"""Range of the root mean square of a rebuilt velocity's error in units of what a step adds to it."""


STORED = "double, stored in single"
EITHER = "single, or double stored in single"
"""Where the states are too few to tell an orbit that was rounded once from one rounded in every step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """How far one step falls short, and what explains it.  `precision` is "" where nothing does."""

    ulp: float
    precision: str
    note: str = ""


def predicted(match: Match, found: Map, slip: float = 0.0) -> Extended:
    """The map between frames that a match predicts, extended precision, in the frame of `found`; for steps
    longer by the share `slip`."""
    one = np.ones(1, dtype=np.longdouble)
    family = FAMILIES[match.family]
    out = table((family,)).frame(
        np.zeros(1, dtype=np.int64),
        match.a * one * (1 + slip) ** 2,
        match.g * one * (1 if family.held else 1 + slip),
        match.log_mass * one - np.log1p(slip),
        np.array([float(match.stride)]),
        found.size[1:] / found.size[0],
    )
    return np.asarray(out.reshape(2, 2))


def misses(match: Match, found: Map) -> Extended:
    """What each frame differs by from the step of the one before, (f - 1, 2), in the frame of `found`."""
    b = predicted(match, found)
    out = found.z[1:] - found.z[:-1] @ b.T
    if found.slips is not None:
        d = 1e-7
        change = (predicted(match, found, d) - predicted(match, found, -d)) / (2 * d)
        out = out - found.slips[:, None] * (found.z[:-1] @ change.T)
    return np.asarray(out)


def defect(record: Record, j: int, found: Map, match: Match, *, visible: bool) -> Defect:
    """Defect of every step of oscillator j against the scheme, in units of double precision (2**-52).

    `visible` says that the scheme's own error stands far above the defect, and no other scheme has it;
    only then is more than plain rounding explained, and never to an exact flow.
    """
    scheme = FAMILIES[match.family]
    b = predicted(match, found)
    z, centre = found.z, found.centre / found.size
    signed = misses(match, found).astype(np.float64)
    missing = np.abs(signed)
    # a force is that of the whole position, whose rounding it carries into the velocity
    at = np.abs(centre) + np.abs(b) @ np.abs(centre)
    # sums of absolute values: what a rounding of either term is relative to
    size = np.abs(z[:-1]) @ np.abs(b).T + np.abs(z[1:]) + 2 * at
    if match.stride > 1:
        # states between two frames lie on the same orbit: either component may be as large as the whole
        size = size + np.sqrt(np.sum(z[:-1] ** 2, axis=1) + np.sum(z[1:] ** 2, axis=1))[:, None]
    if scheme.flow:
        # a solution is evaluated at times, and their rounding turns the phase
        orbit = np.sqrt(np.max(np.sum(z**2, axis=1)))
        size = size + orbit * np.sqrt(abs(match.a)) * record.clock / 2.0**-52
    size = size.astype(np.float64)
    if record.parts is not None:
        summed = np.stack(
            [record.parts[0][:, j], record.parts[1][:, j] * abs(float(record.interval))], axis=1
        )
        size = size + 2 * (summed[1:] + summed[:-1]) / found.size.astype(np.float64)
    # a velocity that is a difference of positions over the step carries their rounding, eps q / h
    ratio = float(found.size[0] / found.size[1]) * match.stride
    position = np.abs(z[1:, 0] + centre[0]).astype(np.float64)
    difference = np.stack([np.zeros(len(size)), 2 * ratio * position], axis=1)
    path = (4 if scheme.flow else scheme.path) * match.stride
    ulp = _largest(missing, 2.0**-52 * size)
    # what rounds at random stays far below the sum of all roundings; what comes near it must stand out
    if ulp <= min(path, 4 + 2 * np.sqrt(match.stride)) or (ulp <= path and visible):
        return Defect(ulp=ulp, precision="double", note=_written(record, ""))
    if _is_rebuilt(match, missing, size, difference):
        return Defect(
            ulp=ulp,
            precision="double",
            note="velocities carry the rounding of positions over the step: rebuilt as a difference of them",
        )
    if record.fine:
        if scheme.flow or not visible:
            return Defect(ulp=ulp, precision="")
        name, note = coarse.kinematic(record, j, found, match) or coarse.sized(
            record, j, found, match, signed
        )
        return Defect(ulp=ulp, precision=name, note=note)
    quanta = np.stack([record.q_quantum[:, j], record.v_quantum[:, j] * abs(float(record.interval))], axis=1)
    quanta = quanta / found.size.astype(np.float64)
    half = (quanta[1:] + quanta[:-1] @ np.abs(b).T.astype(np.float64)) / 2
    rebuilt = size + difference
    single = path * 2.0**-24 * rebuilt
    # the map is itself known from rounded states, to a few parts in sqrt(pairs) of their rounding
    slack = 1 + 10 / np.sqrt(len(z))
    if _largest(missing, slack * half + path * 2.0**-52 * rebuilt) <= 1:
        return Defect(ulp=ulp, precision=_stored(record, found))
    if _largest(missing, slack * half + single) <= 1:
        texts = [s.name for s in (record.q_storage, record.v_storage) if s.name.startswith("text")]
        # one orbit, rounded once, leaves no room for more than that
        return Defect(ulp=ulp, precision=texts[0] if texts else "" if found.once else "single")
    return Defect(ulp=ulp, precision="")


def _is_rebuilt(match: Match, missing: Floats, size: Floats, difference: Floats) -> bool:
    """Whether velocities alone are off, and by eps q / h, as differences of positions over the step are.

    Rounding of a position enters the leapfrog's velocity in every step, and the position itself through it:
    it walks at random, with the root of the steps and their power of 3/2.
    """
    if match.scheme not in coarse.STOERMER:
        return False
    steps = np.sqrt(match.stride)
    if _largest(missing[:, 0], 2.0**-52 * (4 + 2 * steps**3) * size[:, 0]) > 1:
        return False
    unit = 2.0**-52 * steps * difference[:, 1]
    if _largest(missing[:, 1], 2.0**-52 * (4 + 2 * steps) * size[:, 1] + 4 * unit) > 1:
        return False
    least, most = REBUILT
    share = float(np.sqrt(np.mean(missing[:, 1] ** 2) / np.mean(unit**2)))
    return least <= share <= most


def _largest(missing: Floats, unit: Floats) -> float:
    return float(np.max(missing / np.maximum(unit, np.finfo(np.float64).tiny)))


def _written(record: Record, otherwise: str) -> str:
    coarse = {s.name for s in (record.q_storage, record.v_storage)} - {"double"}
    return f"the numbers happen to be exact as {' and '.join(sorted(coarse))}" if coarse else otherwise


def _stored(record: Record, found: Map) -> str:
    """The storage's name; for single precision, whether the arithmetic was finer than the file."""
    texts = [s.name for s in (record.q_storage, record.v_storage) if s.name.startswith("text")]
    if texts:
        return texts[0] if len(set(texts)) == 1 else " and ".join(dict.fromkeys(texts))
    return {True: STORED, False: "single", None: EITHER}[found.once]
