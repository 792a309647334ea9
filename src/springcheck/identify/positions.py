"""Identification from positions alone, by their `recurrence`, and what they leave open."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify.candidates import (
    candidates_of,
    common,
    held_over,
    law_assumed,
    shared,
    steps_between,
)
from springcheck.identify.evidence import SINGLE_ROOM, Measured
from springcheck.identify.families import FAMILIES, HELD, Family, title
from springcheck.identify.hypothesis import FEW, SURE, Joint, Match, distinct
from springcheck.identify.record import AT_REST, Record, stated
from springcheck.identify.recurrence import FEWEST_FRAMES, Recurrence, classes, matches, recurrence
from springcheck.identify.result import UNTOLD, Explanation, Identification, nothing, rounded_by
from springcheck.text.wording import either

CERTAIN_CHANGE = 1e8
"""Significance of 1 - det, in standard errors, from which no friction agrees with a scheme by chance."""

ALONE = (
    "positions alone show a frequency and how areas change, and no velocities: velocity Verlet, leapfrog, "
    "semi-implicit Euler and position Verlet have the same positions"
)


def identify_positions(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> Identification:
    """The schemes that may have made these positions.  Raises IdentificationError where they show none."""
    stiff, stride, notes = stated(record, stiffness, friction, step)
    if stiff is not None and record.mass is None:
        notes.insert(0, "the stiffness says nothing of positions without the mass; give the mass as well")
    notes.append(ALONE)
    if not (moving := record.moving):
        raise IdentificationError(AT_REST)
    if len(record.q) < FEWEST_FRAMES:
        raise IdentificationError(
            f"too few frames of positions alone: {len(record.q)}; give {FEWEST_FRAMES}, or velocities"
        )
    strides = range(stride, stride + 1) if stride is not None and stride > 0 else FEW
    every = {j: recurrence(record, j, strides.stop - 1) for j in moving}
    # of what no single line explains, the size of the force says nothing
    lines = [j for j, x in every.items() if x.precision]
    free = [j for j in lines if not abs(every[j].alpha) > SURE * math.sqrt(every[j].covariance[0, 0])]
    moving = [j for j in moving if j not in free]
    if not moving:
        raise IdentificationError(
            "the positions show no force: the arc is too short, or nothing pulls; record more of the motion"
        )
    if free:
        notes.append(f"{len(free)} of {len(free) + len(moving)} coordinates show no force, and are left out")
    found = [every[j] for j in moving]
    if any(x.phase <= 0 and (x.precision or not x.beta < 1) for x in found):
        raise IdentificationError(
            "the motion does not turn: without velocities one that dies or grows alone shows no scheme"
        )
    seen = Measured(
        record=record, moving=moving, maps=[], terms=[], stiffness=stiff, friction=friction or None,
        stride=stride, notes=tuple(notes),
    )  # fmt: skip
    if any(not x.precision for x in found):
        return _none(seen, found, [])
    known, wanted = stiff is not None and record.mass is not None, [0.0 for _ in moving]
    if stiff is not None and record.mass is not None:
        wanted = [float(stiff[j] / record.mass[j] * record.interval**2) for j in moving]
    plain = tuple(x[0] for x in classes())
    every_stride = known or not _all_preserve(found)
    joints = (_joined if every_stride else _first)(found, plain, strides, wanted)
    joints += [x for x in _joined(found, (HELD,), strides, wanted) if x.endless or x.substeps[0]]
    seen, kept = _stated(seen, joints) if known else (seen, joints)
    # a change of areas so well known meets that of a scheme without friction by no chance
    sure = _all_preserve(found) or any(
        abs(float(x.beta)) > CERTAIN_CHANGE * math.sqrt(x.covariance[1, 1]) for x in found
    )
    if friction or (friction is None and not (kept and sure)):
        damped = (_joined if known else _first)(found, distinct(damped=True), strides, wanted)
        seen, damped = _stated(seen, damped) if known else (seen, damped)
        kept = [x for x in damped if candidates_of(seen, x)] if friction else kept + damped
    return _known(seen, found, kept, known, friction) if kept else _none(seen, found, joints)


def _all_preserve(found: list[Recurrence]) -> bool:
    return all(x.preserving for x in found)


def _joined(
    found: list[Recurrence], families: tuple[Family, ...], strides: range, wanted: list[float]
) -> list[Joint]:
    """Families and strides that fit every oscillator, for each spring of the first.  Of the others the spring
    nearest to the `wanted` (w T)**2 is taken, or where that is 0 that of the fewest turns."""
    parts: list[dict[tuple[str, int], list[Match]]] = []
    for x in found:
        own: dict[tuple[str, int], list[Match]] = {}
        for m in matches(x, families, strides):
            own.setdefault((m.family, m.stride), []).append(m)
        parts.append(own)
    out = []
    for key in parts[0]:
        if all(key in own for own in parts):
            rest = tuple(
                min(own[key], key=lambda m: (m.turns * (not a), abs(m.a * m.stride**2 - a)))
                for own, a in zip(parts[1:], wanted[1:], strict=True)
            )
            out += [Joint(family=key[0], stride=key[1], parts=(m, *rest)) for m in parts[0][key]]
    return sorted(out, key=lambda x: (x.simplicity, abs(x.parts[0].a)))


def _first(
    found: list[Recurrence], families: tuple[Family, ...], strides: range, wanted: list[float]
) -> list[Joint]:
    """The hypothesis of the fewest steps of each family."""
    out = _joined(found, families, strides[:1], wanted)
    left = tuple(f for f in families if f.name not in {x.family for x in out})
    if left and len(strides) > 1:
        seen: dict[str, Joint] = {}
        for x in _joined(found, left, strides[1:], wanted):
            seen.setdefault(x.family, x)
        out += seen.values()
    return out


def _stated(seen: Measured, joints: list[Joint]) -> tuple[Measured, list[Joint]]:
    """Hypotheses of the stated stiffness, exactly or to single precision, with a note on that."""
    for room in (0.0, SINGLE_ROOM):
        fitting = [x for x in joints if not seen.disagreements(x, room=room)]
        if fitting:
            remarks = ["a stated number was rounded to single precision"] if room else []
            return seen.noting(*remarks), fitting
    return seen, []


def _members(joints: list[Joint]) -> list[Joint]:
    """Every scheme with the same positions, once for each number of steps, with the fewest turns."""
    shared = {x[0].name: x for x in classes()}
    out: dict[tuple[str, int], Joint] = {}
    for joint in joints:
        for member in shared.get(joint.family, (FAMILIES[joint.family],)):
            out.setdefault(
                (member.name, joint.stride), Joint(family=member.name, stride=joint.stride, parts=joint.parts)
            )
    return list(out.values())


def _known(
    seen: Measured, found: list[Recurrence], kept: list[Joint], known: bool, friction: float | None
) -> Identification:
    """Identification by the hypotheses that fit; a stated `friction` of 0 leaves no damped spring open."""
    record, notes, joints = seen.record, list(seen.notes), _members(kept)
    candidates = tuple(x for joint in joints for x in candidates_of(seen, joint))
    names = list(dict.fromkeys(x.scheme for x in candidates))
    preserving, damped = _all_preserve(found), [joint.damped for joint in joints]
    # the number of steps does not show where areas are kept and the stiffness is not known
    hidden = preserving and not known and seen.stride is None
    stride = None if hidden else common([x.stride for x in candidates])
    # several friction laws, or places of it, of one scheme are no other scheme
    fields = shared(candidates, len(found), named=stride is not None)
    fields |= {} if stride else {"step": math.nan, "stride": None}
    scheme, precision = fields["scheme"], common([x.precision for x in found]) or UNTOLD
    frames = steps_between(stride)
    if scheme:
        said = common([x.law for x in candidates])
        law = f" with {said}" if said else " with friction" if all(damped) else ""
        notes += law_assumed(candidates) if all(damped) else []
        whose = held_over(joints[0]) if scheme == HELD.scheme else title(scheme)
        if scheme == HELD.scheme and joints[0].endless:
            whose += f", or {FAMILIES['fault: old force'].cause}"
            fields |= {"verdict": "not told apart", "scheme": None, "aliases": ()}
        statement = f"{whose}{law}{frames}, by positions alone: {rounded_by(precision)} explains them"
    else:
        listed = names[:6] + ([f"{len(names) - 6} more"] if len(names) > 6 else [])
        change = "are kept" if preserving else "shrink" if float(found[0].beta) > 0 else "grow"
        statement = f"Positions alone: areas {change}, and they are those of {either(listed)}{frames}"
    if not known:
        told = "mass and stiffness" if record.mass is None else "the stiffness"
        more = ", the friction" if friction is None else ""
        notes.append(f"what would tell more: {told}, where known{more}, or velocities")
    if any(damped) and seen.friction is None:
        notes.append(
            "with friction every scheme has a spring that fits; a stated friction of 0 leaves it out"
        )
    elif scheme and float(found[0].beta) > 0 and not known and friction != 0:
        notes.append("a damped spring of another stiffness may have the same positions")
    share = 1 / stride if stride else math.nan
    return Identification(
        **fields,
        statement=statement,
        determinant=tuple(math.exp(x.log_det * share) for x in found),
        symplectic_defect=max(abs(float(x.beta)) for x in found),
        defect_ulp=max(x.ulp for x in found),
        precision=precision,
        fits=True,
        notes=tuple(dict.fromkeys(notes)),
    )


def _none(seen: Measured, found: list[Recurrence], joints: list[Joint]) -> Identification:
    """Identification without a scheme, and its cause; `joints` fit but contradict what is stated."""
    worst = max(found, key=lambda x: x.residual)
    remedy = "compare the order of its stages and their coefficients with the scheme's; velocities show more"
    if any(not x.precision for x in found):
        cause = (
            "The positions are not those of one linear scheme: its recurrence leaves over "
            f"{worst.residual:.1e} of their size, {worst.ulp:.2g} units in the last place"
        )
        remedy = "look for a force that is not linear, coupled coordinates, a restart or noise; "
        remedy += "velocities show more"
    elif joints and seen.stiffness is not None:
        shown = [*seen.disagreements(joints[0]), "it has another friction"][0]
        cause = f"The positions may be those of {title(joints[0].scheme)}, but of another spring: {shown}"
        remedy = "look at the units of the force constant and of the times, and at the mass"
    else:
        cause = (
            "One linear map explains the positions, but it is none of the known schemes': areas change by "
            f"{math.exp(found[0].log_det) - 1:+.2e} in each frame"
        )
    return nothing(
        (Explanation(cause, remedy, worst.residual),),
        determinant=tuple(math.exp(x.log_det) for x in found),
        symplectic_defect=max(abs(float(x.beta)) for x in found),
        defect_ulp=max(x.ulp for x in found),
        notes=seen.notes,
    )
