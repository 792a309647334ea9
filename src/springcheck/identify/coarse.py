"""Forces of less than double precision in states of double precision, from the residuals of single steps.

GPU-type platforms compute forces in single precision and sum them in 64-bit fixed point, whatever the
precision of the states.  Truncation makes a bias as well as noise.  Such errors are recognised by their size
and by where they enter: in kicks, never in drifts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import repeat
from typing import TypeAlias

import numpy as np

from springcheck.identify.families import FAMILIES, G_ROUNDING
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import CHANCE, Match, most
from springcheck.identify.maps import power, unit
from springcheck.identify.record import Record
from springcheck.physics.arrays import Extended, Floats, Reals
from springcheck.schemes import SCHEMES, magnitude_step, step
from springcheck.schemes.rounding import Met

EPSILON = 2.0**-52
"""Machine epsilon of double precision."""

REBUILT = 1 / 32, 1.0
"""Range of the root mean square error of a rebuilt velocity, relative to the expected rounding."""

QUANTUM = 2.0**-32
"""Quantum of the forces that GPU-type platforms of OpenMM sum in 64-bit fixed point [kJ/mol/nm]."""

EXCESS = 2.0**-32
"""Relative excess of the fixed-point forces of OpenMM's CustomIntegrator, which divides by 2**32 - 1."""

LARGEST_SINGLE = 4 * 2.0**-24
"""Largest relative error of a force in single precision: position, product, a root and a quotient."""

LEAST = 1 / 100
"""Smallest root mean square of residuals, relative to its bound, that the bound explains."""

STOERMER = {
    "semi-implicit-euler": (1, 0),
    "semi-implicit-euler-drift-kick": (0, 1),
    "velocity-verlet": (1, 1),
}
"""Schemes with q[n+1] - 2 q[n] + q[n-1] = h**2 F/m, and the weights of the differences before and after in
their velocity: identities that hold to rounding however coarse the force is."""

KICKED = ("explicit-euler", "position-verlet")
"""Schemes of one kick a step, which shows in the velocity."""


def differences(match: Match) -> bool:
    """Whether the velocity may be a difference of positions: the mean of two, as in Stoermer's schemes, or
    that of the step, as where the new velocity moves the position."""
    if match.scheme in STOERMER:
        return True
    (q, v), (x, u) = unit(FAMILIES[match.family], np.array([match.a]), np.array([match.g]))[0]
    return bool(abs(q - x - 1) < G_ROUNDING and abs(v - u) < G_ROUNDING)


def is_rebuilt(match: Match, missing: Floats, half: Floats, size: Floats, difference: Floats) -> bool:
    """Whether only the velocities are inaccurate, by eps q / h as differences of positions over the step are,
    beside the rounding `half` of the storage format.

    The rounding of a position enters the leapfrog's velocity in every step, and through it the position: a
    random walk that grows as s**(1/2) in the velocity and as s**(3/2) in the position over s steps.
    """
    steps = np.sqrt(match.stride)
    each = EPSILON * steps * difference
    allowed = half + EPSILON * (4 + 2 * np.array([steps**3, steps])) * size + 4 * each
    if np.any(missing > allowed):
        return False
    share = float(np.sqrt(np.mean(missing[:, 1] ** 2) / np.mean(each[:, 1] ** 2 + half[:, 1] ** 2)))
    return REBUILT[0] <= share <= REBUILT[1] and differences(match)


def over_single(x: float | np.longdouble) -> np.longdouble:
    """Ratio of a number to its value in single precision; 1 where that is 0 or overflows."""
    with np.errstate(over="ignore", under="ignore"):
        short = np.longdouble(np.float32(x))
    return np.longdouble(x) / short if short and np.isfinite(short) else np.longdouble(1)


def _sized(record: Record, j: int, found: Map, match: Match, signed: Floats) -> tuple[str, str]:
    """Precision and note where the residuals (f - 1, 2) of single frames have the size and place of a force
    error.

    An error of the force in every kick displaces a frame by at most the sum of the kicks' displacements,
    propagated by the steps that follow; drifts add the rounding of the state.
    """
    if match.scheme not in SCHEMES:
        return "", ""
    missing = np.abs(signed)
    kicks, steps = _reach(found, match)
    z = found.z.astype(np.float64)
    position = found.size[0].astype(np.float64) + abs(float(found.centre[0]))
    orbit = np.sqrt(np.sum(z[1:] ** 2, axis=1) + np.sum(z[:-1] ** 2, axis=1)) + abs(
        float(found.centre[0] / found.size[0])
    )
    path = FAMILIES[match.family].path * match.stride
    # a position and a product are rounded; a stiffness too, but that is the same in every kick
    relative = LARGEST_SINGLE / 2 * abs(match.a) * orbit
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


def _reach(found: Map, match: Match) -> tuple[Floats, Floats]:
    """Bounds (2,), in the units of `found`, on the effect on a frame of an error of 1: of h**2 F/(m q) in
    every kick, and of both components of the state in every step."""
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


def _kinematic(record: Record, j: int, found: Map, match: Match) -> tuple[str, str] | None:
    """Precision and note by the forces of single steps, where positions and velocities are consistent to
    rounding; both are "" where the forces have no quanta.

    None where the forces are not resolved finely enough for quanta to show, or too few are near multiples to
    exclude chance.
    """
    forces = _forces(record, j, found, match)
    if forces is None:
        return None
    values, noise, consistent = forces
    single = np.spacing(np.abs(values).astype(np.float32)).astype(np.float64)
    fixed = np.full(len(values), QUANTUM)
    mass = 1.0 if record.mass is None else float(record.mass[j])
    readable = noise < 0.05 * float(np.median(single))
    for name, quantum, factor, note in (
        # which those of half precision are as well
        ("", np.ldexp(single, 13), 1.0, ""),
        ("mixed", single, 1.0, "single-precision numbers"),
        ("mixed", single, float(over_single(mass)), "single-precision numbers, and so is the mass"),
        ("fixed-point force", fixed, 1.0, "whole multiples of 2**-32, a 64-bit fixed-point sum"),
        ("fixed-point force", fixed, 1 + EXCESS,
         "whole multiples of 1/(2**32 - 1), as OpenMM's CustomIntegrator has them"),
    ):  # fmt: skip
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
                return name, note and f"states are double, and forces are {note}"
            readable = False
    return ("", "") if readable and consistent else None


OUTLIER = 6.0
"""Largest rounding error relative to the root mean square of its neighbours: 1.7 if uniform, 4 if normal."""

LAGS = range(2, 26)
"""Lags of the autocorrelation, up to a quarter of the frames; in some schemes neighbours share a force."""


def is_white(missing: Floats, bias: Floats | None = None) -> bool:
    """Whether residuals (f, c), freed of a bias (f, b), are white noise, as rounding is.

    What depends on position, velocity, time or parity recurs after some frames; the sum of squared
    autocorrelations of a white series is chi-squared (Box & Pierce 1970).
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


def _white(found: Map, signed: Floats) -> bool:
    """Whether the residuals (f - 1, 2) of frames are irregular."""
    # where the motion decays or grows, residuals are tested relative to the size of each frame as well
    weight = found.weight[:, None] / np.max(found.weight)
    return is_white(signed) and is_white(weight * signed, weight)


def _forces(record: Record, j: int, found: Map, match: Match) -> tuple[Floats, float, bool] | None:
    """The force of each step, from the states, its noise, and whether v is consistent with q to rounding;
    None where the scheme has more than one force a step, or v is off by more than half a kick in single."""
    if match.stride != 1 or match.friction != 0 or match.scheme not in (*STOERMER, *KICKED):
        return None
    h, consistent = record.interval, True
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
        consistent = not np.any(np.abs(off) > unit)
        if np.any(np.abs(off) > unit + np.abs(h * force) * (LARGEST_SINGLE / (2 * mass))):
            return None
        noise = 16 * 2.0**-52 * mass * float(np.max(position)) / float(h) ** 2
    return force.astype(np.float64), noise, consistent


EXPLAINED = 0.3
"""Largest ratio of the root mean square residuals with truncated forces to that without, for these to be the
cause; other noise of that size adds up to a ratio of 1.4."""

REFINED = 16
"""Newton steps for the stiffness, which the residuals bias."""

Force: TypeAlias = Callable[[Floats, Reals], Floats]
"""k (c, 1) and q (c, f) -> -k q in an arithmetic; k and the result are in quanta."""

Pull: TypeAlias = Callable[[Floats, Reals], Floats]
"""a (c, 1) and q (c, f) -> h**2 F/m."""


def _single(k: Floats, q: Reals) -> Floats:
    return (-k * q).astype(np.float32).astype(np.float64)


def _all_single(k: Floats, q: Reals) -> Floats:
    return ((-k).astype(np.float32) * q.astype(np.float32)).astype(np.float64)


FORCES: dict[str, tuple[Force, ...]] = {
    "fixed-point force": (lambda k, q: np.trunc(-k * q), lambda k, q: np.rint(-k * q)),
    "mixed": (
        _single, _all_single,
        lambda k, q: np.trunc(_single(k, q)), lambda k, q: np.trunc(_all_single(k, q)),
    ),
}  # fmt: skip


def coarse_forces(record: Record, j: int, found: Map, match: Match, signed: Floats) -> tuple[str, str, bool]:
    """Precision of forces that explain these residuals (f - 1, 2), a note, and whether it is certain; ""
    where none explains them."""
    name, note = _sized(record, j, found, match, signed)
    for each in FORCES if name else ():
        if _reproduced(record, j, found, match, each):
            return each, "states are double, and the steps redone with such forces are those recorded", True
    seen = _kinematic(record, j, found, match)
    if seen is not None:
        return *seen, record.mass is not None
    rough = record.rough and match.friction == 0 and match.scheme in (*STOERMER, *KICKED)
    return (name, note, False) if name and (rough or _white(found, signed)) else ("", "", True)


def _reproduced(record: Record, j: int, found: Map, match: Match, precision: str) -> bool:
    """Whether forces of a precision, in an explicit scheme without friction, explain the residuals."""
    own = SCHEMES[match.scheme]
    if record.mass is None or not own.has("explicit"):
        return False
    mass, h = float(record.mass[j]), float(record.interval) / match.stride
    # about the equilibrium; velocities as lengths
    q = (found.z[:, 0] * found.size[0]).astype(np.float64)
    v = (found.z[:, 1] * found.size[1] / record.interval).astype(np.float64) * h
    kick = h * h / mass * QUANTUM

    def missed(a: Floats, pull: Pull, *, leaps: bool = False) -> Floats:
        """Residuals (c, 2 f - 2) of steps with these (h w)**2 (c, 1)."""
        x, y = (np.broadcast_to(z[:-1], (len(a), len(z) - 1)) for z in (q, v))
        scheme = SCHEMES["semi-implicit-euler"] if leaps else own
        if leaps:
            # stored half a step early, and half a kick of the exact force added where it was read
            y = y + a * x / 2
        for _ in range(match.stride):
            x, y = step(scheme, x, y, h=1.0, m=np.ones(1), force=lambda at, _: pull(a, at))
        if leaps:
            y = y - a * x / 2
        return np.concatenate([q[1:] - x, v[1:] - y], axis=1)

    def exact(a: Floats, x: Reals) -> Floats:
        return np.asarray(-a * x)

    start, shift = np.array([[match.a]]), 1e-6 * match.a
    first = missed(start, exact)
    rows = first.reshape(2, -1)
    size = np.sqrt(np.mean(rows**2, axis=1, keepdims=True)) + 2.0**-52 * np.max(np.abs(q))
    scale = np.broadcast_to(1 / size, rows.shape).ravel()
    slope = (missed(start + shift, exact) - missed(start - shift, exact))[0] / (2 * shift) * scale
    # residuals of another stiffness need no quantum
    inverse = (slope / (slope @ slope))[:, None]
    without = missed(start - first * scale @ inverse, exact) * scale
    before = float(np.sqrt(np.mean(without**2)))
    counted = float(np.sum(without**2) ** 2 / np.sum(without**4)) - 1
    single = float(over_single(mass))
    factors = [x * y for x in (1.0, 1.0 + EXCESS) for y in dict.fromkeys((1.0, single))]
    quanta = kick * np.array(factors)[:, None]
    forces, n = FORCES[precision], len(factors)

    def cut(a: Floats, x: Reals) -> Floats:
        # every force with all factors, one below the other
        parts = ((f, a[i : i + n], x[i : i + n]) for f, i in zip(forces, range(0, len(a), n), strict=True))
        return np.concatenate([quanta * f(b / kick, y) for f, b, y in parts])

    for leaps in (False, True) if match.family == "velocity-verlet" else (False,):
        values = np.repeat(start, len(forces) * n, axis=0)
        for _ in range(REFINED):
            left = missed(values, cut, leaps=leaps) * scale
            share = np.sqrt(np.mean(left**2, axis=1)) / before
            # a single residual vanishes at some stiffness
            if np.any((share <= EXPLAINED) & (share**counted <= CHANCE)):
                return True
            values = values - left @ inverse
    return False
