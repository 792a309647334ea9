"""Which scheme made these states: reading them, searching, and saying what was found."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify import arithmetic
from springcheck.identify.causes import causes
from springcheck.identify.coarse import QUANTUM
from springcheck.identify.fit import ROUNDING, Map, fit
from springcheck.identify.match import Terms
from springcheck.identify.record import Record, read
from springcheck.identify.result import NONE, Identification
from springcheck.identify.search import (
    Joint,
    aliases,
    difference,
    disagreements,
    find,
    numbers,
    search,
    visible,
)
from springcheck.model import Floats

VELOCITY_OFFSET = {
    "semi-implicit-euler": -0.5,
    "semi-implicit-euler-drift-kick": 0.5,
    "langevin-middle-early": -0.5,
}
"""Time of the velocities after that of the positions, in steps: where the map is of second order."""

COARSE = ("fixed-point force", "mixed", "single")
"""Precisions of GPU-type platforms, which keep force constants in single precision in every mode."""

SHOWN = 3
"""Schemes that a note names of those that are not told apart; all are in the candidates."""

LEAPFROG = {
    "semi-implicit-euler": "leapfrog with velocities half a step early",
    "semi-implicit-euler-drift-kick": "leapfrog with velocities half a step late",
}


def _moving(record: Record) -> tuple[list[int], list[str]]:
    """Oscillators that move, and a note on those that do not."""
    spread = np.ptp(record.q, axis=0) + np.ptp(record.v, axis=0) * abs(record.interval)
    moving = np.flatnonzero(spread > 0).tolist()
    if not moving:
        raise IdentificationError("nothing moves: at rest all schemes agree; start away from rest")
    still = len(spread) - len(moving)
    return moving, [f"{still} of {len(spread)} oscillators are at rest and left out"] if still else []


def _checked_map(record: Record, j: int) -> Map:
    found = fit(record, j)
    if not found.conditioned:
        raise IdentificationError(
            f"the states of oscillator {j} do not span its plane (a standing state, or whole or half periods "
            "between frames, or an arc shorter than the rounding): record more of the motion"
        )
    return found


def _stated_stride(record: Record, step: float | None, notes: list[str]) -> int | None:
    if step is None:
        return None
    if not math.isfinite(step) or step == 0:
        raise IdentificationError(f"step must be a finite number other than 0; found {step!r}")
    ratio = float(record.interval / np.longdouble(step))
    stride = round(ratio)
    if stride < 1 or abs(ratio - stride) > 4 * stride * (record.jitter + ROUNDING):
        notes.append(
            f"the stated step {step:.9g} does not divide the states' interval {float(record.interval):.9g}"
        )
        return -1
    return stride


def identify(
    t: ArrayLike,
    q: ArrayLike,
    p: ArrayLike | None = None,
    *,
    v: ArrayLike | None = None,
    mass: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    step: float | None = None,
) -> Identification:
    """The scheme that made a trajectory of independent oscillators, from its states alone.

    t (f,) [T]; q (f, n) or (f,) [L]; p [M L/T] or v [L/T] or both, like q.  Where both are given the mass
    follows from them.  With momenta alone and no mass, symmetric schemes look alike on a spring; the
    notes say so.  `mass` [M], `stiffness` [M/T2] and `step` [T] are what is stated of the trajectory: they
    are held against it.

    Raises IdentificationError where the states cannot show a map: too few, not finite, at rest, at uneven
    times, or not spanning the plane.
    """
    record = read(t, q, p, v, mass)
    moving, notes = _moving(record)
    maps = [_checked_map(record, j) for j in moving]
    for j, found in zip(moving, maps, strict=True):
        pull, error = abs(float(found.entries[1, 0])), math.sqrt(found.covariance[2, 2])
        if pull < 6 * error:
            raise IdentificationError(
                f"no force acts on oscillator {j}: every scheme moves it in a straight line"
            )
    stated = (
        None
        if stiffness is None
        else np.broadcast_to(np.asarray(stiffness, float).ravel(), record.q.shape[1])
    )
    stride = _stated_stride(record, step, notes)
    base = [_terms(record, j, stated) for j in moving]
    if record.momenta and stated is None:
        notes.append(
            "neither mass nor velocities nor stiffness are known, so only three numbers of each map count: "
            "velocity and position Verlet, implicit midpoint and the exact flow look alike; give the mass"
        )
    found_all, chosen, terms = find(record, maps, base, stride)
    if chosen is not None and stated is not None:
        agreeing = [x for x in found_all if not disagreements(record, moving, x, stated)]
        found_all = agreeing or found_all
        chosen = found_all[0]
    if (
        chosen is None
        or stride == -1
        or (stride is not None and chosen.stride != stride and chosen.scheme != "exact")
    ):
        if stride is not None and stride > 0:
            notes.append(f"with the stated step {step:.9g}, {stride} to a frame, no known scheme fits")
        stated_fits = stride is None
    else:
        stated_fits = True
    if chosen is None:
        return _unknown(record, moving, maps, base, found_all, notes)
    return _known(record, moving, maps, found_all, chosen, terms, stated, stated_fits, notes)


def _terms(record: Record, j: int, stated: Floats | None) -> Terms:
    log_stiffness = None
    if record.momenta and stated is not None and stated[j] > 0:
        log_stiffness = math.log(stated[j] * float(record.interval) ** 2)
    return Terms(mass_unknown=record.momenta, jitter=record.jitter, log_stiffness=log_stiffness)


def _determinants(maps: list[Map], stride: int) -> tuple[tuple[float, ...], float]:
    between = [float(x.entries[0, 0] * x.entries[1, 1] - x.entries[0, 1] * x.entries[1, 0]) for x in maps]
    each = tuple(math.copysign(abs(d) ** (1 / stride), d) for d in between)
    return each, max(abs(d - 1) for d in between)


def _known(
    record: Record,
    moving: list[int],
    maps: list[Map],
    accepted: list[Joint],
    chosen: Joint,
    terms: list[Terms],
    stated: Floats | None,
    stated_fits: bool,
    notes: list[str],
) -> Identification:
    defects: list[arithmetic.Defect] = []
    for joint in dict.fromkeys([chosen, *accepted]):
        defects = [
            arithmetic.defect(record, j, x, part, visible=visible(x, what, joint, accepted))
            for j, x, part, what in zip(moving, maps, joint.parts, terms, strict=True)
        ]
        if all(d.precision for d in defects):
            chosen = joint
            break
    else:
        return _unknown(record, moving, maps, terms, accepted, notes)
    worst = max(defects, key=lambda d: (d.precision != "double", d.ulp))
    notes = [*notes, *dict.fromkeys(d.note for d in defects if d.note)]
    omega, found_stiffness, friction = numbers(record, moving, chosen)
    determinant, symplectic = _determinants(maps, chosen.stride)
    h = float(record.interval) / chosen.stride
    if stated is not None:
        against = disagreements(record, moving, chosen, stated)
        single = stated.astype(np.float32).astype(np.float64)
        if (
            against
            and worst.precision in COARSE
            and not disagreements(record, moving, chosen, single, QUANTUM)
        ):
            against = []
            notes.append("the stiffness is the stated one in single precision, as GPU-type platforms keep it")
        stated_fits = stated_fits and not against
        notes += against
    notes += _remarks(accepted, chosen, friction)
    first = chosen.parts[0]
    return Identification(
        scheme=chosen.scheme,
        aliases=(*aliases(chosen.scheme), *([LEAPFROG[chosen.scheme]] if chosen.scheme in LEAPFROG else [])),
        candidates=tuple(str(x) for x in accepted),
        step=h,
        stride=chosen.stride,
        omega=omega,
        stiffness=found_stiffness,
        friction=friction,
        velocity_offset=VELOCITY_OFFSET.get(chosen.scheme, 0.0),
        determinant=determinant,
        symplectic_defect=symplectic,
        defect_ulp=max(d.ulp for d in defects),
        precision=worst.precision,
        fits=stated_fits,
        nearest=chosen.scheme,
        difference=difference(maps[0], first),
        notes=tuple(notes),
    )


def _remarks(accepted: list[Joint], chosen: Joint, friction: tuple[float, ...]) -> list[str]:
    out = []
    if chosen.scheme in LEAPFROG:
        out.append(f"the same map is {LEAPFROG[chosen.scheme]}: states alone do not tell the two apart")
    if any(part.friction for part in chosen.parts):
        out.append(f"the motion is damped at a rate c/m of {', '.join(f'{x:.6g}' for x in friction)}")
    if max(part.turns for part in chosen.parts):
        out.append(
            "the motion makes whole turns between two frames: the frequency is not the one that they show"
        )
    if any(part.a < 0 for part in chosen.parts):
        out.append("the spring is inverted: its stiffness is negative")
    others = [f"{x}{_apart(x, chosen)}" for x in accepted if x is not chosen]
    if others:
        shown = "; ".join(others[:SHOWN]) + (
            f"; and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        )
        lead = "no error of a step is visible, so " if chosen.scheme == "exact" else ""
        out.append(f"{lead}not told apart at this precision: {shown}; named is the plainest")
    return out


def _apart(other: Joint, chosen: Joint) -> str:
    """How much stiffer the spring is if it is the other scheme, where that shows."""
    off = other.parts[0].a * other.stride**2 / (chosen.parts[0].a * chosen.stride**2) - 1
    return f" (stiffness {off:+.1e})" if abs(off) > 1e-12 else ""


def _unknown(
    record: Record,
    moving: list[int],
    maps: list[Map],
    terms: list[Terms],
    tried: list[Joint],
    notes: list[str],
) -> Identification:
    """No scheme: the nearest, what differs, and what else may be the matter."""

    def distance(joint: Joint) -> float:
        return max(max(map(abs, difference(found, m))) for found, m in zip(maps, joint.parts, strict=True))

    if not tried:
        tried = search(maps, [replace(what, damped=False) for what in terms], range(1, 2))
    determinant, symplectic = _determinants(maps, 1)
    nearest = ""
    off: tuple[float, ...] = (math.nan,) * 4
    omega: tuple[float, ...] = tuple(math.nan for _ in moving)
    stiffness = None
    if tried:
        least = min(distance(x) for x in tried)
        # many schemes and strides come close by chance; the plainest of the close ones is the better guess
        close = min((x for x in tried if distance(x) <= 10 * least), key=lambda x: x.plainness)
        nearest, off = str(close), difference(maps[0], close.parts[0])
        omega, stiffness, _ = numbers(record, moving, close)
        entries = ", ".join(
            f"{name} {x:+.1e}" for name, x in zip(("M11", "M12", "M21", "M22"), off, strict=True)
        )
        notes = [*notes, f"nearest is {nearest}; measured less predicted entries on (q, v T): {entries}"]
    residual = max(float(np.max(found.residual)) for found in maps)
    notes = [*notes, *causes(maps, terms, residual)]
    return Identification(
        scheme=NONE,
        aliases=(),
        candidates=(),
        step=math.nan,
        stride=0,
        omega=omega,
        stiffness=stiffness,
        friction=tuple(math.nan for _ in moving),
        velocity_offset=math.nan,
        determinant=determinant,
        symplectic_defect=symplectic,
        defect_ulp=residual / 2.0**-52,
        precision="unknown",
        fits=False,
        nearest=nearest,
        difference=off,
        notes=tuple(notes),
    )
