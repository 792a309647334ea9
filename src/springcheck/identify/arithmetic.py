"""What the defect of single steps says of the arithmetic, once the scheme is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from springcheck.identify.fit import Map
from springcheck.identify.match import Match, frame
from springcheck.identify.record import Record
from springcheck.model import Extended, Floats
from springcheck.schemes import SCHEMES, roundings

QUANTUM = 2.0**-32
"""Of forces that GPU-type platforms of OpenMM sum in 64-bit fixed point."""

COARSEST = 1e-5
"""Relative error of a force up to which it can be rounding; beyond, the force is another one."""

STOERMER = {
    "semi-implicit-euler": (1, 0),
    "semi-implicit-euler-drift-kick": (0, 1),
    "velocity-verlet": (1, 1),
}
"""Schemes whose positions obey q'' - 2 q' + q = h**2 F/m, and whether v is the mean of the difference
before, after, or both: identities without a force, which hold to rounding however coarse the force is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """How far one step falls short, and what explains it.  `precision` is "" where nothing does."""

    ulp: float
    precision: str
    note: str = ""


def predicted(match: Match, found: Map) -> Extended:
    """The map between frames that a match predicts, extended precision, in the frame of `found`."""
    one = np.ones(1, dtype=np.longdouble)
    out = frame(
        SCHEMES[match.scheme],
        match.a * one,
        match.friction * one,
        match.log_mass * one,
        np.array([float(match.stride)]),
        found.size,
    )
    return np.asarray(out[0])


def defect(record: Record, j: int, found: Map, match: Match) -> Defect:
    """Defect of every step of oscillator j against the scheme, in units of double precision (2**-52)."""
    scheme = SCHEMES[match.scheme]
    b = predicted(match, found)
    z, centre = found.z, found.centre / found.size
    missing = np.abs(z[1:] - z[:-1] @ b.T).astype(np.float64)
    # sums of absolute values: what a rounding of either term is relative to
    size = np.abs(z[:-1]) @ np.abs(b).T + np.abs(z[1:]) + 2 * np.abs(centre)
    if match.stride > 1:
        # states between two frames lie on the same orbit: either component may be as large as the whole
        size = size + np.sqrt(np.sum(z[:-1] ** 2, axis=1) + np.sum(z[1:] ** 2, axis=1))[:, None]
    if scheme.flow:
        # a solution is evaluated at times, and their rounding turns the phase
        orbit = np.sqrt(np.max(np.sum(z**2, axis=1)))
        size = size + orbit * np.sqrt(abs(match.a)) * record.clock / 2.0**-52
    size = size.astype(np.float64)
    # a velocity that is a difference of positions over the step carries their rounding, eps q / h
    ratio = float(found.size[0] / found.size[1]) * match.stride
    position = np.abs(z[1:, 0] + centre[0]).astype(np.float64)
    difference = np.stack([np.zeros(len(size)), 2 * ratio * position], axis=1)
    rebuilt = size + difference
    path = (4 if scheme.flow else roundings(scheme)) * match.stride
    ulp = _largest(missing, 2.0**-52 * size)
    if ulp <= path:
        return Defect(ulp=ulp, precision="double", note=_written(record, ""))
    # the motion goes on from the rebuilt velocity, so that only the last one's rounding is seen: four of
    # position, quotient and read-out; with one a step an adaptive solver would pass for many small steps
    if _largest(missing, 2.0**-52 * (path * size + 4 * difference)) <= 1:
        return Defect(
            ulp=ulp,
            precision="double",
            note="velocities carry the rounding of positions over the step: rebuilt as a difference of them",
        )
    if record.q_storage.name == record.v_storage.name == "double":
        return _coarse_force(record, j, found, match, ulp)
    quanta = np.stack([record.q_quantum[:, j], record.v_quantum[:, j] * abs(float(record.interval))], axis=1)
    quanta = quanta / found.size.astype(np.float64)
    half = (quanta[1:] + quanta[:-1] @ np.abs(b).T.astype(np.float64)) / 2
    single = path * 2.0**-24 * rebuilt
    # the map is itself known from rounded states, to a few parts in sqrt(pairs) of their rounding
    slack = 1 + 10 / np.sqrt(len(z))
    if _largest(missing, slack * half + path * 2.0**-52 * rebuilt) <= 1:
        return Defect(ulp=ulp, precision=_stored(record, found, match, quanta))
    if _largest(missing, slack * half + single) <= 1:
        texts = [s.name for s in (record.q_storage, record.v_storage) if s.name.startswith("text")]
        return Defect(ulp=ulp, precision=texts[0] if texts else "single")
    return Defect(ulp=ulp, precision="")


def _largest(missing: Floats, unit: Floats) -> float:
    return float(np.max(missing / np.maximum(unit, np.finfo(np.float64).tiny)))


def _written(record: Record, otherwise: str) -> str:
    coarse = {s.name for s in (record.q_storage, record.v_storage)} - {"double"}
    return f"the numbers happen to be exact as {' and '.join(sorted(coarse))}" if coarse else otherwise


def _stored(record: Record, found: Map, match: Match, quanta: Floats) -> str:
    """The storage's name; for single precision, whether the arithmetic was finer than the file.

    The whole trajectory is one orbit of the scheme, seen through rounding to the nearest, or rounding was
    fed back into the motion and it strays from every orbit.
    """
    texts = [s.name for s in (record.q_storage, record.v_storage) if s.name.startswith("text")]
    if texts:
        return texts[0] if len(set(texts)) == 1 else " and ".join(dict.fromkeys(texts))
    missing = _orbit(found, match, 1 / np.maximum(quanta, 2.0**-60)) / np.maximum(quanta, 2.0**-60)
    frames = len(missing)
    # rounding to nearest: root mean square 1/sqrt(12), largest 1/2; a fit of few numbers shifts both
    within = np.max(np.abs(missing)) <= 0.5 + 3 / np.sqrt(frames)
    if within and np.sqrt(np.mean(missing**2)) <= (1 + 2 / np.sqrt(frames)) / np.sqrt(12.0):
        return "double, stored in single"
    return "single"


def _orbit(found: Map, match: Match, weights: Floats) -> Floats:
    """What the orbit of the scheme closest to all states leaves over (f, 2); free are start, a, friction.

    `weights` (f, 2) are the reciprocals of what each number is uncertain by.
    """
    frames = len(found.z)
    scheme = SCHEMES[match.scheme]
    values = np.array([match.a, match.friction], dtype=np.longdouble)
    free = [0] if match.friction == 0 else [0, 1]
    start = found.z[0].copy()
    numbers = np.arange(frames, dtype=np.float64) * match.stride

    def powers(x: Extended) -> Extended:
        grow = [np.full(frames, y) for y in (x[0], x[1], np.longdouble(match.log_mass))]
        out = frame(scheme, grow[0], grow[1], grow[2], np.maximum(numbers, 1), found.size)
        # frame scales by its own strides; here the velocity keeps the scale of one interval
        up = np.maximum(numbers, 1) / match.stride
        out[:, 0, 1] = out[:, 0, 1] * up
        out[:, 1, 0] = out[:, 1, 0] / up
        out[0] = np.eye(2)
        return np.asarray(out)

    missing = found.z
    for _ in range(6):
        maps = powers(values)
        missing = found.z - maps @ start
        columns = [maps[:, :, 0].ravel(), maps[:, :, 1].ravel()]
        for i in free:
            delta = np.zeros(2, dtype=np.longdouble)
            delta[i] = 1e-7 * abs(values[0])
            columns.append(
                (((powers(values + delta) - powers(values - delta)) @ start) / (2 * delta[i])).ravel()
            )
        slopes = np.stack(columns, axis=1).astype(np.float64) * weights.reshape(-1, 1)
        scale = np.sqrt(np.mean(slopes**2, axis=0))
        right = missing.ravel().astype(np.float64) * weights.ravel()
        change = np.linalg.lstsq(slopes / scale, right, rcond=None)[0] / scale
        start = start + change[:2]
        values[free] += change[2:]
    return np.asarray(found.z - powers(values) @ start, dtype=np.float64)


def _coarse_force(record: Record, j: int, found: Map, match: Match, ulp: float) -> Defect:
    """States in double precision whose force is not: the step's kinematics hold to rounding."""
    sides = STOERMER.get(match.scheme)
    if sides is None or match.stride != 1 or match.friction != 0:
        return Defect(ulp=ulp, precision="")
    h = record.interval
    q = found.z[:, 0] * found.size[0]
    v = found.z[:, 1] * found.size[1] / h
    centre = float(np.abs(found.centre[0]))
    before, after = (q[1:-1] - q[:-2]) / h, (q[2:] - q[1:-1]) / h
    mean = (sides[0] * before + sides[1] * after) / sum(sides)
    position = np.abs(q[1:-1]).astype(np.float64) + centre
    # four roundings each of positions over the step and of the velocity, and the identity's own few
    unit = 8 * 2.0**-52 * (np.abs(v[1:-1]).astype(np.float64) + 2 * position / abs(float(h)))
    if _largest(np.abs(v[1:-1] - mean).astype(np.float64), unit) > 1:
        return Defect(ulp=ulp, precision="")
    mass = 1.0 if record.mass is None else float(record.mass[j])
    force = mass * (after - before) / h
    noise = 16 * 2.0**-52 * mass * float(np.max(position)) / float(h) ** 2
    stiffness = match.a * mass / float(h) ** 2
    relative = float(
        np.sqrt(np.mean((force + stiffness * q[1:-1]) ** 2) / np.mean((stiffness * q[1:-1]) ** 2))
    )
    if relative > COARSEST:
        return Defect(ulp=ulp, precision="")
    values = force.astype(np.float64)
    for name, quantum, note in (
        (
            "mixed",
            np.spacing(np.abs(values).astype(np.float32)).astype(np.float64),
            "single-precision numbers",
        ),
        (
            "fixed-point force",
            np.full(len(values), QUANTUM),
            "whole multiples of 2**-32, a 64-bit fixed-point sum",
        ),
    ):
        # a fraction of a quantum is uniform, 1/4 on average, unless forces are whole multiples of it
        off = force / quantum
        if noise < 0.05 * float(np.median(quantum)) and float(np.mean(np.abs(off - np.rint(off)))) < 0.1:
            return Defect(ulp=ulp, precision=name, note=f"states are double, and forces are {note}")
    name = "mixed" if 2.0**-28 <= relative <= 2.0**-21 else "coarse force"
    return Defect(
        ulp=ulp, precision=name, note=f"states are double, but forces are off by {relative:.1e} of their size"
    )
