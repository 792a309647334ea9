"""The identification by the hypotheses that explain every step, compared with what is stated."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from springcheck.identify.arithmetic import SINGLE
from springcheck.identify.candidates import (
    all_remarks,
    candidates_of,
    common,
    held_over,
    of_stated_stiffness,
    shared,
    stated_stiffness,
    steps_between,
)
from springcheck.identify.evidence import Measured
from springcheck.identify.families import FAMILIES, MOST_TITLES, title, titles
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import Match
from springcheck.identify.laws import friction_shows
from springcheck.identify.misplaced import turned
from springcheck.identify.notes import (
    LEAPFROG,
    beside_unknown,
    of_either_sign,
    of_stated_friction,
    of_unasked_friction,
)
from springcheck.identify.result import UNTOLD, Explanation, Identification, rounded_by
from springcheck.identify.search import Explained, visible
from springcheck.identify.together import OF_A_BOND, of_a_bond
from springcheck.identify.wrong import faults_like, faults_of
from springcheck.schemes.elsewhere import ELSEWHERE
from springcheck.text.wording import few

VELOCITY_OFFSET = {
    "semi-implicit-euler": -0.5,
    "semi-implicit-euler-drift-kick": 0.5,
    "langevin-middle-early": -0.5,
}
"""Time of the velocities minus that of the positions, in steps, at which the map is of second order."""


def named(seen: Measured, explained: Explained, step: float | None) -> Identification:
    """Identification by the hypotheses that explain every step and agree with the stated stiffness, `step`
    and friction; if none agrees, with the reason."""
    joints, friction, stride = list(explained), seen.friction, seen.stride
    if (stated := seen.stiffness) is not None:
        bond = of_a_bond(seen.record, seen.moving, stated) if seen.disagreements(joints[0]) else None
        if bond is not None:
            seen, stated = replace(seen.noting(OF_A_BOND), stiffness=bond), bond
        joints = of_stated_stiffness(seen, {x: ds[0].precision for x, ds in explained.items()}, stated)
    stated_fits = stride is None
    if stride is not None and stride > 0:
        agreeing = [x for x in joints if x.stride == stride or x.scheme == "exact"]  # which has no step
        if seen.vague:
            # with a clock in single precision the step may be in that, too, and nobody types more digits
            exactly, short = (
                [x for x in agreeing if all(abs(y.log_mass) <= y.interval_room + room for y in x.parts)]
                for room in (0.0, SINGLE)
            )
            agreeing = exactly or short
            seen = seen.at_stated_times() if exactly else seen
        joints, stated_fits = agreeing or joints, bool(agreeing)
        if not agreeing:
            seen = seen.noting(f"with the stated step {step:.9g}, {stride} to a frame, no known scheme fits")
    if friction is not None:
        of_rate = [x for x in joints if candidates_of(seen, x)]
        joints, stated_fits = of_rate or joints, stated_fits and bool(of_rate)
        seen = seen if of_rate else replace(seen, friction=None)
    found = _known(seen, {x: explained[x] for x in joints}, stated_fits)
    # quadratic drag and nonlinear forces have to be excluded as the cause of a friction
    parts = ((seen.evidence(i), part) for x in joints if x.damped for i, part in enumerate(x.parts))
    plainly = friction is not None or seen.record.deep or all(friction_shows(*x) for x in parts)
    if seen.stiffness is None:
        of_maps = zip(seen.maps, seen.terms, strict=True)
        plainly = plainly and any(visible(*x, damped=joints[0].damped) for x in of_maps)
    found = beside_unknown(seen.record, found, stated=stride is not None, seen=plainly)
    if friction is not None and seen.friction is None and seen.record.mass is not None:
        found = of_stated_friction(found, friction, float(seen.record.mass[seen.moving[0]]))
    if seen.stiffness is None:
        return found if seen.record.fine else of_either_sign(found, turned(seen.record, seen.moving))
    mass = math.nan if seen.record.mass is None else float(seen.record.mass[seen.moving[0]])
    found = of_unasked_friction(found, mass) if seen.friction is None else found
    faults = faults_of(seen, friction) if found.explanations and found.candidates else []
    if not faults:
        return found
    # a scheme on another spring, or a wrong one on the stated spring: the latter is the simpler
    other = [x.cause for x in found.explanations if ": " in x.cause]
    return found.refuted("; or ".join([faults[0].cause, *other]), *faults, *found.explanations)


def _known(seen: Measured, explained: Explained, stated_fits: bool) -> Identification:
    """Identification by these hypotheses and the defects of their steps."""
    joints, maps, notes = list(explained), seen.maps, list(seen.notes)
    simplest = joints[0]
    worst = [max(ds, key=lambda d: (d.precision != "double", d.ulp)) for ds in explained.values()]
    notes += dict.fromkeys(d.note for d in explained[simplest] if d.note)
    explanations: list[Explanation] = []
    if seen.stiffness is not None:
        explanations, remarks = stated_stiffness(seen, joints, worst[0].precision, seen.stiffness)
        notes += remarks
        stated_fits = stated_fits and not explanations
    candidates = tuple(x for joint in joints for x in candidates_of(seen, joint))
    scheme = common([x.scheme for x in candidates])
    stride = common([x.stride for x in candidates])
    determinant, symplectic = determinants(maps, stride or 1)
    unknown = tuple(math.nan for _ in maps)
    offset = common([VELOCITY_OFFSET.get(x.scheme, 0.0) for x in candidates])
    damped = any(joint.damped for joint in joints)
    doubt = "" if all(joint.damped for joint in joints) else " or without"
    first = candidates[0]
    precision = common([d.precision for d in worst]) or UNTOLD
    notes += all_remarks(seen, joints, candidates)
    steps = steps_between(stride)
    law = f" with{doubt} friction" if damped else ""
    law = f" with {first.law}" if first.law and len(candidates) == 1 else law
    if scheme == "held-force":
        kicks = simplest.substeps[1]
        order = "kick, then drift" if kicks else "drift, then kick"
        statement = f"{held_over(simplest)} ({order}){steps}"
        if simplest.endless:
            # coarse numbers do not tell many substeps from infinitely many, which is a fault
            statement, scheme = f"{statement}, or {FAMILIES['fault: old force'].cause}", None
    elif scheme:
        also = f" (or {LEAPFROG[scheme]})" if scheme in LEAPFROG else ""
        slips = faults_like(scheme) if scheme in ELSEWHERE else ()
        also = "".join(f" (on a spring also {x.cause})" for x in slips) or also
        statement = f"{title(scheme)}{also}{law}{steps}: {rounded_by(precision)} explains every step"
    else:
        names = few(list(dict.fromkeys(x.scheme for x in candidates)), MOST_TITLES)
        statement = f"Several schemes fit, which the states do not tell apart: {names}"
    undecided = any(not d.certain for d in explained[simplest]) and stated_fits
    if undecided:
        statement = (
            f"{titles(x.scheme for x in candidates)}{law}{steps}, and errors of the force of the size of "
            f"{precision} arithmetic: noise or a systematic error of that size cannot be excluded"
        )
        notes.append("what would show the arithmetic: every step recorded, and the mass")
    undecided = undecided or (scheme is None and len(joints) == 1)
    statement = explanations[0].cause if explanations else statement
    return Identification(
        **shared(candidates, len(maps), named=scheme is not None),
        statement=statement,
        velocity_offset=math.nan if offset is None else offset,
        determinant=determinant if stride else unknown,
        symplectic_defect=symplectic,
        defect_ulp=min(max(d.ulp for d in ds) for ds in explained.values()),
        precision=precision,
        fits=stated_fits and not undecided,
        undecided=undecided,
        difference=difference(maps[0], simplest.parts[0]) if len(joints) == 1 else (math.nan,) * 4,
        notes=tuple(dict.fromkeys(notes)),
        explanations=tuple(explanations),
    )


def difference(found: Map, part: Match) -> tuple[float, ...]:
    """Measured minus predicted entries on (q, v T)."""
    off = found.entries.reshape(4) - np.array(part.predicted, dtype=np.longdouble)
    ratio = float(found.size[0] / found.size[1])
    return tuple(float(x) * y for x, y in zip(off, (1, ratio, 1 / ratio, 1), strict=True))


def determinants(maps: list[Map], stride: int) -> tuple[tuple[float, ...], float]:
    """Determinant of one step of each map, and the largest |det - 1| between frames."""
    between = [float(x.entries[0, 0] * x.entries[1, 1] - x.entries[0, 1] * x.entries[1, 0]) for x in maps]
    each = tuple(math.copysign(abs(d) ** (1 / stride), d) for d in between)
    return each, max(abs(d - 1) for d in between)
