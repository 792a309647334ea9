"""Arithmetic coarser than double precision in states that are not: what its forces leave behind.

GPU-type platforms compute forces in single precision and sum them in 64-bit fixed point, whatever the
states are kept in.  The error is cut off rather than rounded, so it is a bias as much as a noise; what
tells it from anything else is where it enters (in kicks, never in drifts) and its size.
"""

from __future__ import annotations

import math
from itertools import repeat

import numpy as np

from springcheck.identify.families import FAMILIES
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import CHANCE, Match, most
from springcheck.identify.maps import power, unit
from springcheck.identify.record import Record
from springcheck.physics.arrays import Extended, Floats, Reals
from springcheck.schemes import SCHEMES, magnitude_step
from springcheck.schemes.rounding import Met

QUANTUM = 2.0**-32
"""Quantum of the forces that GPU-type platforms of OpenMM sum in 64-bit fixed point [kJ/mol/nm]."""

EXCESS = 2.0**-32
"""Relative excess of the fixed-point forces of OpenMM's CustomIntegrator, which divides by 2**32 - 1."""

LEAST = 1 / 100
"""Share of its bound that an error must reach in the mean square for the bound to be what explains it."""

STOERMER = {
    "semi-implicit-euler": (1, 0),
    "semi-implicit-euler-drift-kick": (0, 1),
    "velocity-verlet": (1, 1),
}
"""Schemes whose positions obey q'' - 2 q' + q = h**2 F/m, and whether v is the mean of the difference
before, after, or both: identities without a force, which hold to rounding however coarse the force is."""

KICKED = ("explicit-euler", "position-verlet")
"""Schemes of one kick a step that positions do not see at once."""


def over_single(x: float | np.longdouble) -> np.longdouble:
    """A number over its value in single precision; 1 where that has no such number."""
    with np.errstate(over="ignore", under="ignore"):
        short = np.longdouble(np.float32(x))
    return np.longdouble(x) / short if short and np.isfinite(short) else np.longdouble(1)


def sized(record: Record, j: int, found: Map, match: Match, signed: Floats) -> tuple[str, str]:
    """Precision and note where what single frames miss, (f-1, 2), has the size and place of a force's error.

    A force off by e in every kick shifts a frame by at most the sum of its kicks' shifts, carried on by
    the steps that follow; drifts add only the rounding of the state.
    """
    if match.scheme not in SCHEMES:
        return "", ""
    missing = np.abs(signed)
    kicks, steps = reach(found, match)
    z = found.z.astype(np.float64)
    position = found.size[0].astype(np.float64) + abs(float(found.centre[0]))
    orbit = np.sqrt(np.sum(z[1:] ** 2, axis=1) + np.sum(z[:-1] ** 2, axis=1)) + abs(
        float(found.centre[0] / found.size[0])
    )
    path = FAMILIES[match.family].path * match.stride
    # a position and a product are rounded; a stiffness too, but that is the same in every kick
    relative = 2 * 2.0**-24 * abs(match.a) * orbit
    quantum = np.zeros(len(orbit))
    if record.mass is not None:
        h = float(record.interval) / match.stride
        quantum += QUANTUM * h**2 / float(record.mass[j]) / position
    levels = (
        ("fixed-point force", quantum, 2.0**-52, "of the size of 2**-32, a 64-bit fixed-point sum"),
        ("mixed", relative + quantum, 2.0**-48, "of the size of single-precision numbers"),
    )
    for name, force, state, note in levels:
        # twice: half a kick of another precision may be added to what is read
        error = 2 * force[:, None] * kicks
        bound = error + path * state * orbit[:, None] * steps
        if not np.all(missing <= bound) or not np.any(force):
            continue
        if np.sqrt(np.mean(missing[:, 1] ** 2)) >= LEAST * np.sqrt(np.mean(error[:, 1] ** 2)):
            return name, f"states are double, and forces are off by errors {note}"
    return "", ""


def reach(found: Map, match: Match) -> tuple[Floats, Floats]:
    """Bounds (2,), in the frame of `found`, of what an error of 1 does to a frame: of h**2 F/(m q) in every
    kick, and of both components of the state in every step."""
    one = np.ones(1, dtype=np.longdouble)
    a, rate = abs(match.a) * one, match.friction * one

    def size(q: Reals, p: Reals) -> Reals:
        return np.asarray(1 + a * q)

    met = repeat(Met(magnitude=size, stiffness=np.diag(a), joined=True))
    slowed = rate if match.friction else None
    q, p = magnitude_step(SCHEMES[match.scheme], 0 * one, 0 * one, h=1.0, m=one, met=met, rate=slowed)
    numbers = np.arange(match.stride, dtype=np.float64)
    one_step = np.broadcast_to(
        unit(FAMILIES[match.family], match.a * one, match.g * one), (match.stride, 2, 2)
    )
    # q in units of its size, v of the interval's: v h grows by the stride and the ratio of the sizes
    up = np.array([1.0, match.stride * float(found.size[0] / found.size[1])])
    carried: Extended = np.sum(np.abs(power(one_step, numbers)), axis=0)
    kicks = (carried @ np.array([q[0], p[0]])).astype(np.float64) * up
    steps = (carried.astype(np.float64) * up[:, None] / up[None, :]).sum(axis=1)
    return kicks, steps


def kinematic(record: Record, j: int, found: Map, match: Match) -> tuple[str, str] | None:
    """Precision and note where positions and velocities of every step fit together to rounding, so that
    only the force can be coarse; its own numbers then show how, and are none where they show nothing.

    None where forces cannot be read so finely that their quanta would show, or so few of them lie near
    multiples that others might.
    """
    forces = _forces(record, j, found, match)
    if forces is None:
        return None
    values, noise = forces
    single = np.spacing(np.abs(values).astype(np.float32)).astype(np.float64)
    fixed = np.full(len(values), QUANTUM)
    mass = 1.0 if record.mass is None else float(record.mass[j])
    readable = noise < 0.05 * float(np.median(single))
    for name, quantum, factor, note in (
        ("mixed", single, 1.0, "single-precision numbers"),
        ("mixed", single, float(over_single(mass)), "single-precision numbers, and so is the mass"),
        ("fixed-point force", fixed, 1.0, "whole multiples of 2**-32, a 64-bit fixed-point sum"),
        (
            "fixed-point force",
            fixed,
            1 + EXCESS,
            "whole multiples of 1/(2**32 - 1), as OpenMM's CustomIntegrator has them",
        ),
    ):
        # a fraction of a quantum is uniform, 1/4 on average, unless forces are whole multiples of it
        off = values / (quantum * factor)
        whole = np.rint(off)
        # forces far below a quantum are near 0 of them, and cannot be sums of quanta
        clear = noise < 0.05 * float(np.median(quantum)) and np.any(whole)
        left = np.abs(off - whole)
        if clear and float(np.mean(left)) < 0.1:
            # the sum of n numbers, each uniform up to 1, is at most s with a chance of s**n/n! or less
            n, total = len(left), float(np.sum(2 * left)) or math.ulp(1.0)
            if n * math.log(total) - math.lgamma(n + 1) < math.log(CHANCE):
                return name, f"states are double, and forces are {note}"
            readable = False
    return ("", "") if readable else None


OUTLIER = 6.0
"""Largest error of bounded rounding over the root mean square of its neighbours': 1.7 where uniform, 4 where
normal."""

LAGS = range(2, 26)
"""Frames at whose distance errors are correlated, a quarter of all at most; neighbours share a force in some
schemes."""


def irregular(missing: Floats, bias: Floats | None = None) -> bool:
    """Whether what frames miss (f, c) is white, as rounding is, once it is freed of a bias (f, b).

    What goes with position, velocity, their powers, time, parity or a neighbour comes back after some
    frames; the sum of squared autocorrelations of a white series is chi-squared (Box & Pierce 1970).
    """
    lags = range(LAGS.start, min(LAGS.stop, len(missing) // 4))
    if not lags:
        return True
    limit = most(len(lags))
    for row in missing.T:
        x = row - np.mean(row) if bias is None else row - bias @ np.linalg.lstsq(bias, row, rcond=None)[0]
        total = float(x @ x)
        if total == 0:
            continue
        # rounding is bounded: one error that towers above its neighbours is none
        blocks = [np.sort(np.abs(b)) for b in np.array_split(x, 8) if len(b) > OUTLIER]
        if any(b[-1] > OUTLIER * np.sqrt(np.mean(b[:-1] ** 2)) for b in blocks):
            return False
        if len(x) * sum((float(x[k:] @ x[:-k]) / total) ** 2 for k in lags) > limit:
            return False
    return True


def white(found: Map, match: Match, signed: Floats) -> bool:
    """Whether what single frames miss (f - 1, 2) is irregular but for the bias of cutting off."""
    biased = cut_off(found, match)
    biased = np.concatenate([biased, np.ones((len(biased), 1))], axis=1)
    # where the motion decays or grows, residuals are tested relative to the size of each frame as well
    weight = found.weight[:, None] / np.max(found.weight)
    return irregular(signed, biased) and irregular(weight * signed, weight * biased)


def cut_off(found: Map, match: Match) -> Floats:
    """Displacement (f - 1, 2) of each frame by forces truncated towards zero in each of its steps."""
    one = np.ones(1)
    step = unit(FAMILIES[match.family], match.a * one, match.g * one)[0]
    up = np.array([1.0, match.stride * float(found.size[0] / found.size[1])])
    state = found.z[:-1].astype(np.float64) / up
    out = np.zeros_like(state)
    rest = float(found.centre[0] / found.size[0])
    for _ in range(match.stride):
        out = out @ step.T
        out[:, 1] -= np.sign(state[:, 0] + rest)
        state = state @ step.T
    return np.asarray(out * up)


def _forces(record: Record, j: int, found: Map, match: Match) -> tuple[Floats, float] | None:
    """Forces read from states alone, where each step has one, and their noise; None where v does not belong
    to q."""
    if match.stride != 1 or match.friction != 0 or match.scheme not in (*STOERMER, *KICKED):
        return None
    h = record.interval
    mass = 1.0 if record.mass is None else float(record.mass[j])
    q = found.z[:, 0] * found.size[0]
    v = found.z[:, 1] * found.size[1] / h
    if match.scheme in KICKED:
        # one kick a step, read from the velocity
        force = mass * (v[1:] - v[:-1]) / h
        noise = 8 * 2.0**-52 * mass * float(np.max(np.abs(v))) / abs(float(h))
    else:
        sides = STOERMER[match.scheme]
        before, after = (q[1:-1] - q[:-2]) / h, (q[2:] - q[1:-1]) / h
        position = np.abs(q[1:-1]).astype(np.float64) + float(np.abs(found.centre[0]))
        force = mass * (after - before) / h
        # four roundings each of positions over the step and of the velocity, and the identity's own few
        unit = 8 * 2.0**-52 * (np.abs(v[1:-1]).astype(np.float64) + 2 * position / abs(float(h)))
        off = v[1:-1] - (sides[0] * before + sides[1] * after) / sum(sides)
        if np.any(np.abs(off) > unit):
            return None
        noise = 16 * 2.0**-52 * mass * float(np.max(position)) / float(h) ** 2
    return force.astype(np.float64), noise
