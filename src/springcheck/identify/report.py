"""Which scheme made these states: reading them, searching, and saying what was found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from springcheck.arrays import Floats
from springcheck.errors import IdentificationError
from springcheck.identify import arithmetic
from springcheck.identify.causes import causes
from springcheck.identify.coarse import QUANTUM
from springcheck.identify.fit import ROUNDING, Map, fit
from springcheck.identify.match import Terms
from springcheck.identify.record import Record, read
from springcheck.identify.result import Candidate, Identification
from springcheck.identify.search import (
    Joint,
    aliases,
    difference,
    disagreements,
    find,
    frictionless,
    numbers,
    search,
    separation,
    visible,
)

T = TypeVar("T")

VELOCITY_OFFSET = {
    "semi-implicit-euler": -0.5,
    "semi-implicit-euler-drift-kick": 0.5,
    "langevin-middle-early": -0.5,
}
"""Time of the velocities after that of the positions, in steps: where the map is of second order."""

COARSE = ("fixed-point force", "mixed", "single")
"""Precisions of GPU-type platforms, which keep force constants in single precision in every mode."""

APART = 10.0
"""Standard errors by which two schemes must differ to be told apart for certain: five exclude, and chance
may take five away."""

MOST_DIGITS = 9
"""More digits than single precision has short of double: what needs more, digits do not tell."""

UNTOLD = "cannot tell"
"""Arithmetic where the candidates' are several."""

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
    joints, fitting, terms = find(record, maps, base, stride)
    if fitting and stated is not None:
        joints = [x for x in joints if not disagreements(record, moving, x, stated)] or joints
    if fitting and stride is not None and stride > 0:
        # a step that divides the interval leaves the flow, which has none, and schemes of that stride
        agreeing = [x for x in joints if x.stride == stride or x.scheme == "exact"]
        joints, stated_fits = agreeing or joints, bool(agreeing)
    else:
        stated_fits = stride is None
    if stride is not None and stride > 0 and not stated_fits:
        notes.append(f"with the stated step {step:.9g}, {stride} to a frame, no known scheme fits")
    if not fitting:
        return _unknown(record, moving, maps, base, joints, notes)
    return _known(record, moving, maps, joints, terms, stated, stated_fits, notes)


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
    terms: list[Terms],
    stated: Floats | None,
    stated_fits: bool,
    notes: list[str],
) -> Identification:
    explained: dict[Joint, list[arithmetic.Defect]] = {}
    for joint in accepted:
        defects = [
            arithmetic.defect(record, j, x, part, visible=visible(x, what, joint, accepted))
            for j, x, part, what in zip(moving, maps, joint.parts, terms, strict=True)
        ]
        if all(d.precision for d in defects):
            explained[joint] = defects
    if not explained:
        # what the states do not exclude is equally near; the plainest stands for all
        return _unknown(record, moving, maps, terms, accepted[:1], notes)
    joints = list(explained)
    plainest = joints[0]
    worst = [max(ds, key=lambda d: (d.precision != "double", d.ulp)) for ds in explained.values()]
    notes = [*notes, *dict.fromkeys(d.note for d in explained[plainest] if d.note)]
    if stated is not None:
        against = disagreements(record, moving, plainest, stated)
        single = stated.astype(np.float32).astype(np.float64)
        if (
            against
            and worst[0].precision in COARSE
            and not disagreements(record, moving, plainest, single, QUANTUM)
        ):
            against = []
            notes.append("the stiffness is the stated one in single precision, as GPU-type platforms keep it")
        stated_fits = stated_fits and not against
        notes += against
    candidates = tuple(_candidate(record, moving, joint) for joint in joints)
    scheme = _common([x.scheme for x in candidates])
    stride = _common([x.stride for x in candidates])
    determinant, symplectic = _determinants(maps, stride or 1)
    unknown = tuple(math.nan for _ in moving)
    offset = _common([VELOCITY_OFFSET.get(x.scheme, 0.0) for x in candidates])
    alone = len(joints) == 1
    return Identification(
        verdict="named" if scheme else "not told apart",
        scheme=scheme,
        aliases=_other_names(scheme, damped=_damped(joints)) if scheme else (),
        candidates=candidates,
        step=float(record.interval) / stride if stride else math.nan,
        stride=stride,
        omega=candidates[0].omega if alone else unknown,
        stiffness=candidates[0].stiffness if alone else None,
        friction=candidates[0].friction if alone or not _damped(joints) else unknown,
        velocity_offset=math.nan if offset is None else offset,
        determinant=determinant if stride else unknown,
        symplectic_defect=symplectic,
        defect_ulp=min(max(d.ulp for d in ds) for ds in explained.values()),
        precision=_common([d.precision for d in worst]) or UNTOLD,
        fits=stated_fits,
        nearest=scheme,
        difference=difference(maps[0], plainest.parts[0]) if alone else (math.nan,) * 4,
        notes=(*notes, *_remarks(record, maps, joints, candidates, stated is not None)),
    )


def _other_names(scheme: str, *, damped: bool) -> tuple[str, ...]:
    leapfrog = [LEAPFROG[scheme]] if scheme in LEAPFROG else []
    still = [] if damped else [f"{name} without friction" for name in frictionless(scheme)]
    return (*aliases(scheme), *leapfrog, *still)


def _hidden_friction(record: Record, found: Map) -> float:
    """Largest rate c/m [1/T] that the map's determinant leaves room for: five standard errors of it."""
    gradient = np.linalg.inv(found.entries.astype(np.float64)).T.reshape(4)
    error = math.sqrt(float(gradient @ found.covariance @ gradient))
    loss = abs(math.log(abs(float(np.linalg.det(found.entries.astype(np.float64))))))
    return (loss + 5 * error) / abs(float(record.interval))


def _common(values: Sequence[T]) -> T | None:
    """The value that all are, or None."""
    return values[0] if len(set(values)) == 1 else None


def _damped(joints: list[Joint]) -> bool:
    return any(part.friction for joint in joints for part in joint.parts)


def _candidate(record: Record, moving: list[int], joint: Joint) -> Candidate:
    omega, stiffness, friction = numbers(record, moving, joint)
    return Candidate(
        scheme=joint.scheme,
        aliases=_other_names(joint.scheme, damped=_damped([joint])),
        stride=joint.stride,
        step=float(record.interval) / joint.stride,
        turns=max(part.turns for part in joint.parts),
        omega=omega,
        stiffness=stiffness,
        friction=friction,
    )


def _remarks(
    record: Record,
    maps: list[Map],
    joints: list[Joint],
    candidates: tuple[Candidate, ...],
    stiffness_stated: bool,
) -> list[str]:
    out = []
    scheme = _common([x.scheme for x in candidates])
    if scheme in LEAPFROG:
        out.append(f"the same map is {LEAPFROG[scheme]}: states alone do not tell the two apart")
    if _damped(joints):
        rates = [candidates[0].friction, *([] if len(joints) == 1 else [candidates[-1].friction])]
        shown = " or ".join(dict.fromkeys(", ".join(f"{x:.6g}" for x in rate) for rate in rates))
        out.append(f"the motion is damped at a rate c/m of {shown}")
    elif not record.fine:
        most = max(_hidden_friction(record, found) for found in maps)
        with_it = {name: frictionless(name) for name in dict.fromkeys(x.scheme for x in candidates)}
        same = [f"{name} is {', '.join(names)}" for name, names in with_it.items() if names]
        if same:
            out.append(f"a friction c/m below {most:.1e} would not show: with it {' and '.join(same)}")
    if any(x.turns for x in candidates):
        might = "makes" if all(x.turns for x in candidates) else "may make"
        out.append(
            f"the motion {might} whole turns between two frames: the frequency is not the one that they show"
        )
    if any(part.a < 0 for part in joints[0].parts):
        out.append("the spring is inverted: its stiffness is negative")
    return out + _untold(record, maps, joints, stiffness_stated=stiffness_stated) if len(joints) > 1 else out


def _untold(record: Record, maps: list[Map], joints: list[Joint], *, stiffness_stated: bool) -> list[str]:
    """Why several schemes or numbers of steps are left, and what more the states would have to show."""
    plainest = joints[0]
    if plainest.scheme == "exact":
        why = "no error of a step is visible: fine steps of many schemes come as near to the exact flow"
        told = ["more digits", "a larger step"]
    else:
        least, nearest = min(
            ((separation(maps, plainest, x), x) for x in joints[1:]), key=lambda pair: pair[0]
        )
        digits = math.ceil(math.log10(APART / least)) if least > 0 else MOST_DIGITS + 1
        pair = f"the data cannot tell these apart: the maps of {plainest} and {nearest}"
        if digits > MOST_DIGITS:
            other = "mass" if record.momenta else "stiffness"
            why, told = f"{pair} are the same, on springs of different {other}", []
        else:
            why = f"{pair} are {least:.1g} standard errors of the numbers' rounding from each other"
            told = [f"about {digits} more digit{'s' * (digits > 1)}", "a larger step"] if digits > 0 else []
            told += ["more frames"] if digits <= 2 else []
    if record.momenta:
        told.append("the mass")
    elif not stiffness_stated and any(_stiffer(x, plainest) for x in joints):
        told.append(f"the {'mass and the ' * (record.mass is None)}stiffness, where known: they differ in it")
    listed = " or ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)
    return [why, *([f"what would tell them apart: {listed}"] if told else [])]


def _stiffer(one: Joint, other: Joint) -> bool:
    """Whether a spring differs in stiffness between two schemes by more than six standard errors."""
    return any(
        abs(a.a * one.stride**2 - b.a * other.stride**2)
        > 6 * (a.a_error * one.stride**2 + b.a_error * other.stride**2)
        for a, b in zip(one.parts, other.parts, strict=True)
    )


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
    nearest: str | None = None
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
        verdict="none",
        scheme=None,
        aliases=(),
        candidates=(),
        step=math.nan,
        stride=None,
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
