"""Candidates of the hypotheses that fit: names, friction laws, numbers, agreement with what is stated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, TypeVar

import numpy as np

from springcheck.identify.coarse import QUANTUM
from springcheck.identify.evidence import SINGLE_ROOM, Measured
from springcheck.identify.families import FAMILIES, MOST_TITLES, title, titles
from springcheck.identify.hypothesis import Joint, aliases, frictionless
from springcheck.identify.notes import LEAPFROG, hidden_friction, same_maps, untold
from springcheck.identify.record import DEEP, Record
from springcheck.identify.result import Candidate, Explanation, Identification
from springcheck.identify.search import coincident
from springcheck.identify.wrong import stiffness_ratio
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES
from springcheck.schemes.elsewhere import ELSEWHERE
from springcheck.text.wording import few

T = TypeVar("T")

SINGLE_CONSTANTS = ("fixed-point force", "mixed", "single")
"""Precisions of GPU-type platforms, whose force constants are in single precision."""


def shared(candidates: tuple[Candidate, ...], n: int, *, named: bool = True) -> dict[str, Any]:
    """Fields of the `Identification` of n oscillators that follow from its candidates: the scheme if all have
    the same and it may be `named`, and the numbers that all share."""
    scheme = common([x.scheme for x in candidates]) if named else None
    # without friction a scheme has the names of others that have none then
    law = next((x for x in candidates if x.law), candidates[0])
    unknown, known = (math.nan,) * n, candidates[0].stiffness is not None
    return {
        "verdict": "named" if scheme else "not told apart",
        "scheme": scheme,
        "nearest": scheme,
        "aliases": law.aliases if scheme else (),
        "candidates": candidates,
        "step": common([x.step for x in candidates]) or math.nan,
        "stride": common([x.stride for x in candidates]),
        "omega": _alike([x.omega for x in candidates]) or unknown,
        "stiffness": _alike([x.stiffness or () for x in candidates]) if known else None,
        "friction": _alike([x.friction for x in candidates]) or unknown,
    }


def _alike(rows: list[tuple[float, ...]]) -> tuple[float, ...] | None:
    """Numbers that all candidates share to a relative 1e-9, or None."""
    return rows[0] if np.allclose(rows, rows[0], rtol=1e-9, atol=0, equal_nan=True) else None


def steps_between(stride: int | None) -> str:
    """Number of steps between frames, as a phrase."""
    if stride is None:
        return ", in an unknown number of steps"
    return "" if stride == 1 else f", {stride} steps to a frame"


def stated_stiffness(
    seen: Measured, joints: Sequence[Joint], precision: str, stated: Floats
) -> tuple[list[Explanation], list[str]]:
    """The cause of a stiffness of the hypotheses, the simplest first, that differs significantly from the
    stated one, and notes on the difference."""
    simplest, quantum = joints[0], QUANTUM if precision in SINGLE_CONSTANTS else 0.0
    against = seen.disagreements(simplest)
    if not against or (quantum and not seen.disagreements(simplest, quantum=quantum)):
        return [], []
    room = max(part.a_room for part in simplest.parts)
    for what, other, of_force in _single_constants(seen.record, stated, simplest.stride):
        if seen.disagreements(simplest, other, quantum if of_force else 0.0):
            continue
        # a difference barely above its own error may have any cause of that size
        if (quantum and of_force) or room < 0.1 * float(np.max(np.abs(other / stated - 1))):
            why = ", as GPU-type platforms keep it" if quantum else ""
            return [], [f"the {what} is the stated one in single precision{why}"]
    several = joints if np.all(stated) else joints[:1]
    every = {x.cause: x for x, _ in (_of_a_spring(seen, joint, stated) for joint in several)}
    first = next(iter(every.values()))
    # of several schemes each has a stiffness of its own
    return [replace(first, cause=few(list(every), MOST_TITLES, "; or "))], against * (len(every) == 1)


def _of_a_spring(seen: Measured, joint: Joint, stated: Floats) -> tuple[Explanation, str]:
    """The cause of a hypothesis' stiffness that differs from the stated one, and the meaning of their ratio,
    "" where it has none."""
    _, stiffness, _ = seen.numbers(joint)
    each, masses = zip(seen.moving, stiffness or (math.nan,), strict=False), seen.record.mass
    j, found = max(each, key=lambda one: abs(one[1] - stated[one[0]]) / (stated[one[0]] or 1.0))
    k = float(stated[j])
    ratio = found / k if k else math.inf
    meaning = stiffness_ratio(ratio, None if masses is None else float(masses[j]), k)
    stiff = (
        f"{ratio:.9g} times as stiff as stated" if abs(ratio - 1) > 1e-6 else f"stiffer by {ratio - 1:+.1e}"
    )
    stiff = stiff if k else f"of stiffness {found:.9g} where 0 is stated"
    cause = f"{title(joint.scheme)}, but of a spring {stiff}"
    remedy = "look at the units of the force constant, and at whether V is k/2 q**2"
    if ratio < 0:
        sign = "look at the sign of the force, F = -k q, and of the kick, p + h F"
        remedy = sign if abs(ratio + 1) < 1e-5 else f"{sign}; {remedy}"
    cause = f"{cause}: {meaning}" if meaning else cause
    return Explanation(cause, remedy, abs(ratio - 1)), meaning


def of_stated_stiffness(seen: Measured, precisions: dict[Joint, str], stated: Floats) -> list[Joint]:
    """The hypotheses, of these with the arithmetic that explains each, of the stated stiffness: exactly, or
    with a constant in single precision, or else the nearest; and others of the same stiffness as the
    first."""
    joints = list(precisions)
    agreeing = [x for x in joints if not seen.disagreements(x)] or [
        x for x in joints if not stated_stiffness(seen, [x], precisions[x], stated)[0]
    ]
    found = {x: zip(seen.moving, seen.numbers(x)[1] or (), strict=False) for x in joints}
    if agreeing:
        same = stated.copy()
        for j, k in found[agreeing[0]]:
            same[j] = k
        return agreeing + [x for x in joints if x not in agreeing and not seen.disagreements(x, same)]
    off = {x: max((abs(k / stated[j] - 1) for j, k in each if stated[j]), default=0.0)
           for x, each in found.items()}  # fmt: skip
    # to within single precision and errors
    room = {x: SINGLE_ROOM + max(part.a_room for part in x.parts) for x in joints}
    near = [x for x in joints if off[x] <= 2 * min(off.values()) + room[x]]
    # a factor that means something is likelier than one that does not
    return [x for x in near if _of_a_spring(seen, x, stated)[1]] or near


def _single_constants(record: Record, stated: Floats, stride: int) -> list[tuple[str, Floats, bool]]:
    """Constants that may be in single precision: name, apparent stiffness, whether the force has it."""
    with np.errstate(all="ignore"):
        single = stated.astype(np.float32).astype(np.float64)
        h = float(record.interval) / stride
        longer = (float(np.float32(h)) / h) ** 2
        out = [("stiffness", single, True), ("step", stated * longer, False)]
        out += [("stiffness and the step", single * longer, False)]
        if record.mass is not None:
            share = record.mass / record.mass.astype(np.float32).astype(np.float64)
            out += [("mass", stated * share, False), ("stiffness and the mass", single * share, False)]
    return [
        (what, k, of_force) for what, k, of_force in out if np.all(np.isfinite(k)) and np.any(k != stated)
    ]


@cache
def other_names(scheme: str, *, damped: bool) -> tuple[str, ...]:
    """Other names of a scheme's map, and schemes that have it on a spring of another stiffness."""
    if scheme not in SCHEMES:
        return ELSEWHERE[scheme].also if scheme in ELSEWHERE else ()
    names = [*aliases(scheme), *([LEAPFROG[scheme]] if scheme in LEAPFROG else [])]
    if not damped:
        names += [f"{name} without friction" for name in frictionless(scheme)]
        names += dict.fromkeys(f"{FAMILIES[x].scheme} with friction" for x in coincident(scheme))
    return tuple(names)


def held_over(joint: Joint) -> str:
    """Phrase for a held force, with its possible numbers of substeps."""
    numbers_ = list(map(str, joint.substeps[0])) or ["many"]
    how_many = " to ".join(dict.fromkeys([numbers_[0], numbers_[-1]]))
    return f"Semi-implicit Euler whose force is held over {how_many} substeps"


def either_way(ways: list[Identification]) -> Identification:
    """Combine two identifications of frames whose times fall: as steps back in time, and in reverse order."""
    fitting = [
        x for x in ways if x.fits and not any(rate < 0 for one in x.candidates for rate in one.friction)
    ]
    names = {x.scheme for x in fitting}
    if len(fitting) < 2 or (len(names) == 1 and None not in names):
        # friction that feeds energy in is none
        return fitting[0] if fitting else ways[-1] if ways[0].fits else ways[0]
    back, turned = (titles(x.scheme for x in one.candidates) for one in fitting)
    candidates = tuple(x for one in fitting for x in one.candidates)
    return replace(
        fitting[0],
        **shared(candidates, len(fitting[0].omega), named=False),
        statement=f"Times fall: steps of {back} back in time, or frames of {turned} in reverse order",
        velocity_offset=math.nan,
        notes=(*fitting[0].notes, "what would tell the two apart: the step, with its sign"),
    )


def common(values: Sequence[T]) -> T | None:
    """The value that all share, or None."""
    return values[0] if len(set(values)) == 1 else None


def candidates_of(seen: Measured, joint: Joint) -> list[Candidate]:
    """Candidates of a hypothesis: one for each friction law of its map that has the stated friction c."""
    family, record = FAMILIES[joint.family], seen.record
    out = []
    for law in family.laws if joint.damped else ("",):
        omega, stiffness, friction = seen.numbers(joint, law)
        if seen.friction is not None and record.mass is not None:
            rates = [seen.friction / float(record.mass[j]) for j in seen.moving]
            room = [
                8 * part.g_error * joint.stride / abs(float(record.interval))
                + (1e-9 + 8 * record.jitter) * rate
                for part, rate in zip(joint.parts, rates, strict=True)
            ]
            if any(abs(x - y) > z for x, y, z in zip(friction, rates, room, strict=True)):
                continue
        out.append(Candidate(
            scheme=joint.scheme, aliases=other_names(joint.scheme, damped=joint.damped), stride=joint.stride,
            step=seen.step(joint), turns=max(part.turns for part in joint.parts),
            omega=omega, stiffness=stiffness, friction=friction, law=f"{law} {family.place}".strip(),
        ))  # fmt: skip
    return out


def law_assumed(candidates: Sequence[Candidate]) -> list[str]:
    """Note on the friction rate under each law that it may follow; empty without friction."""
    laws = [x for x in candidates if x.law]
    each = "; ".join(f"{', '.join(f'{y:.6g}' for y in x.friction[:3])} by {x.law}" for x in laws[:6])
    is_ = "is" if len(laws) == len(candidates) else "may be"
    return (
        [f"the motion {is_} damped, and the law is an assumption: the friction c/m is {each}"] if laws else []
    )


def all_remarks(seen: Measured, joints: list[Joint], candidates: tuple[Candidate, ...]) -> list[str]:
    """Notes beside a name: schemes of the same map, the law of friction, turns that frames do not show."""
    out = []
    scheme = common([x.scheme for x in candidates])
    if scheme in LEAPFROG:
        out.append(f"the same map is {LEAPFROG[scheme]}: states alone do not tell the two apart")
    jitter = seen.record.jitter if seen.record.vague and seen.stride is None else 0.0
    if jitter > DEEP and (scheme or not seen.vague):
        whose = "its digits are the scheme's" if seen.vague else "no frequency or stiffness to more"
        out.append(f"the times show the step to {jitter:.0e} of it, and {whose}")
    damped = law_assumed(candidates)
    out += damped
    if not (damped or seen.record.fine):
        most = max(hidden_friction(seen.record, found) for found in seen.maps)
        names = dict.fromkeys(x.scheme for x in candidates if x.scheme in SCHEMES)
        same = [f"{name} is {', '.join(frictionless(name))}" for name in names if frictionless(name)]
        if same:
            out.append(f"a friction c/m below {most:.1e} would not show: with it {' and '.join(same)}")
    if scheme and not damped and seen.stiffness is None and scheme in SCHEMES:
        out += same_maps(seen, joints[0])
    if any(x.turns for x in candidates):
        might = "makes" if all(x.turns for x in candidates) else "may make"
        out.append(
            f"the motion {might} whole turns between two frames: the frequency is not the one that they show"
        )
    if any(part.a < 0 for part in joints[0].parts):
        out.append("the spring is inverted: its stiffness is negative")
    several = len({(x.scheme, x.stride) for x in joints}) > 1
    return out + untold(seen, joints) if several else out
