"""Which scheme made these states: reading them, searching, and saying what was found."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify import arithmetic
from springcheck.identify.candidates import (
    all_remarks,
    candidates_of,
    common,
    either_way,
    held_over,
    of_stated_stiffness,
    said_of,
    stated_stiffness,
)
from springcheck.identify.compare import nearest
from springcheck.identify.evidence import Measured
from springcheck.identify.explain import explain
from springcheck.identify.families import DAMPED_ELSEWHERE, FAMILIES, KNOWN_ELSEWHERE, title
from springcheck.identify.fit import fit
from springcheck.identify.hypothesis import FEW, Joint, distinct, likely
from springcheck.identify.interrupted import remembered
from springcheck.identify.judged import judged
from springcheck.identify.misplaced import turned
from springcheck.identify.notes import (
    LEAPFROG,
    beside_unknown,
    of_either_sign,
    of_few,
    of_stated_friction,
    of_unasked_friction,
)
from springcheck.identify.positions import identify_positions
from springcheck.identify.record import Record, of_size, read, stated_stride
from springcheck.identify.result import Explanation, Identification, nothing
from springcheck.identify.search import (
    determinants,
    difference,
    find,
    visible,
)  # fmt: skip
from springcheck.identify.shortened import single_parameters
from springcheck.identify.thermal import explained, of_bath
from springcheck.identify.together import OF_A_BOND, at_rest, distance, of_a_bond, of_a_pair, of_rotation
from springcheck.identify.wrong import faults_like, faults_of
from springcheck.schemes.elsewhere import ELSEWHERE

VELOCITY_OFFSET = {
    "semi-implicit-euler": -0.5,
    "semi-implicit-euler-drift-kick": 0.5,
    "langevin-middle-early": -0.5,
}
"""Time of the velocities after that of the positions, in steps: where the map is of second order."""

AS_NEAR = 1.5
"""Factor by which the residual of one scheme may exceed that of another for which a cause was found."""


def identify_arrays(
    t: ArrayLike,
    q: ArrayLike,
    p: ArrayLike | None = None,
    *,
    v: ArrayLike | None = None,
    mass: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    friction: float | None = None,
    step: float | None = None,
) -> Identification:
    """The scheme that made a trajectory of oscillators, from its states alone.

    t (f,) [T]; q (f, n) or (f,) [L]; p [M L/T] or v [L/T] or both, like q.  Where both are given the mass
    follows from them; where neither is, `positions` says what is left open.  With momenta alone and no mass,
    symmetric schemes look alike on a spring; the notes say so.  Coupled oscillators are judged by their
    normal modes.  `mass` [M], `stiffness` [M/T2], `friction` c [M/T] and `step` [T] are what is stated of the
    trajectory: they are held against it.

    Raises IdentificationError where the states cannot show a map: too few, not finite, at rest, at uneven
    times, or not spanning the plane.
    """
    if p is None and v is None:
        alone = read(t, q, None, np.zeros(np.shape(q)), mass)
        return _of_positions(alone, stiffness, step, friction)
    stated: dict[str, Any] = {"mass": mass, "stiffness": stiffness, "friction": friction, "step": step}
    times = np.asarray(t, dtype=np.float64)
    if not (times.ndim == 1 and len(times) > 1 and times[-1] < times[0]):
        return _of_states(t, q, p, v, **stated)
    # steps back in time, or frames that stand in reverse order
    given, turned = (x is None or np.sign(x) == side for x, side in ((step, -1), (step, 1)))
    reverse: list[Any] = [None if x is None else np.asarray(x)[::-1] for x in (t, q, p, v)]
    ways = [_of_states(t, q, p, v, **stated)] if given or not turned else []
    return either_way([*ways, *([_of_states(*reverse, **stated)] if turned else [])])


def _of_states(t: Any, q: Any, p: Any, v: Any, *, mass: ArrayLike | None, **stated: Any) -> Identification:
    """Identify the scheme from times, positions, momenta or velocities, of which one may be None."""
    record = read(t, q, p, v, mass)
    try:
        found = of_few(record, _of_record(record, **stated))
        found = found if found.fits and stated["stiffness"] is not None else of_rotation(record, found)
    except IdentificationError:
        if in_a_bath := of_bath(t, q, p, v, mass, **stated):
            return in_a_bath
        raise
    # noise is not looked for where a scheme, or a mistake in the record, explains the states
    local = any(x.local for x in found.explanations)
    return found if found.candidates or local else explained(found, t, q, p, v, mass, **stated)


def _of_record(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> Identification:
    found = _of_coordinates(record, stiffness, friction, step)
    named = found.fits and found.scheme is not None
    if named and stiffness is None:
        return at_rest(record, found)
    if named or stiffness is not None or (pair := distance(record)) is None:
        return found
    other = _of_coordinates(pair, None, friction, step)
    # a coordinate of a pair is no oscillator, and what is said of it alone is wrong
    return of_a_pair(record, other) if other.fits or other.defect_ulp < found.defect_ulp else found


def _of_coordinates(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> Identification:
    seen = judged(record, stiffness, friction, step)
    fine, stride = seen.record.fine, seen.stride
    if any(found.drifts for found in seen.maps):
        return _unknown(seen, range(1, 2))
    joints, wide = find(seen)
    strides_left = range(1, 2) if joints else FEW
    explained = _explained(wide, joints)

    def agrees(x: Joint) -> bool:
        """Whether a scheme has the stated step and stiffness."""
        return stride in (None, x.stride) and (seen.stiffness is None or not seen.disagreements(x))

    apart = seen
    if not (fine or any(map(agrees, explained))):
        # an equilibrium beside 0 that a short or coarse file does not show may still be there
        each = zip(seen.moving, seen.maps, strict=True)
        maps = [x if np.any(x.centre) else fit(seen.record, j, constant=True) for j, x in each]
        apart = replace(seen, maps=maps)
    if not explained and not fine:
        joints, wide = find(apart)
        if explained := _explained(wide, joints):
            seen = apart
    if not explained:
        later, joints = remembered(seen)
        if explained := _explained(later, joints):
            seen = later.noting(
                "the first step has the friction of the first velocity: none is half a step old"
            )
    if explained and seen.stiffness is not None and not (fine or any(map(agrees, explained))):
        # friction, or an equilibrium beside 0, is as plain as another spring than the stated one
        for way, damped in ((x, y) for x in (seen, apart) for y in (False, True)):
            joints = [x for x in way.compare(distinct(damped=damped), FEW) if agrees(x)]
            if more := _explained(way, likely(joints)):
                seen, explained = way, more
                break
    if all(x.stride not in FEW for x in explained):
        # of many steps, which a numerous family has, nothing is plainer than few of a scheme elsewhere
        explained = {**_elsewhere(seen, FEW), **explained}
    elif stride is not None or seen.stiffness is not None:
        right = {x.scheme for x in explained if agrees(x)}
        if (stride is not None or len(right - {"exact"}) != 1) and not (fine and right):
            # what is stated tells more than that the step is a simple one
            others = _elsewhere(seen, FEW if stride is None else range(stride, stride + 1))
            others = {x: ds for x, ds in others.items() if agrees(x)}
            explained = {**(explained if right or not others else {}), **others}
    elif not fine:
        # what coarse numbers do not tell apart they do not tell from a scheme elsewhere either
        alone = len({(x.scheme, x.stride) for x in explained}) == 1
        strides = range(1, min(x.stride for x in explained)) if alone else FEW
        others = {**explained, **(_elsewhere(seen, strides) if strides else {})}
        explained = {x: others[x] for x in likely(list(others))}
    if all(x.stride not in FEW for x in explained):
        # few steps, one of them rounded, are plainer than many
        joints, remark = single_parameters(seen)
        rounded = _explained(seen, joints)
        seen, explained = (seen.noting(remark), rounded) if rounded else (seen, explained)
    if not explained:
        return _unknown(seen, strides_left)
    joints = list(explained)
    if (stated := seen.stiffness) is not None:
        bond = of_a_bond(seen.record, seen.moving, stated) if seen.disagreements(joints[0]) else None
        if bond is not None:
            seen, stated = replace(seen.noting(OF_A_BOND), stiffness=bond), bond
        joints = of_stated_stiffness(seen, {x: ds[0].precision for x, ds in explained.items()}, stated)
    stated_fits = stride is None
    if stride is not None and stride > 0:
        agreeing = [x for x in joints if x.stride == stride or x.scheme == "exact"]  # which has no step
        joints, stated_fits = agreeing or joints, bool(agreeing)
        if not agreeing:
            seen = seen.noting(f"with the stated step {step:.9g}, {stride} to a frame, no known scheme fits")
    if friction is not None:
        of_rate = [x for x in joints if candidates_of(seen, x)]
        joints, stated_fits = of_rate or joints, stated_fits and bool(of_rate)
        seen = seen if of_rate else replace(seen, friction=None)
    found = _known(seen, {x: explained[x] for x in joints}, stated_fits)
    of_maps = zip(seen.maps, seen.terms, strict=True)
    plainly = seen.stiffness is not None or any(visible(*x, damped=joints[0].damped) for x in of_maps)
    known = friction is not None or seen.record.deep
    plainly = plainly and (known or all(x.shows_law for x in joints))
    found = beside_unknown(seen.record, found, stated=stride is not None, seen=plainly)
    if friction is not None and seen.friction is None and seen.record.mass is not None:
        found = of_stated_friction(found, friction, float(seen.record.mass[seen.moving[0]]))
    if seen.stiffness is None:
        return found if fine else of_either_sign(found, turned(seen.record, seen.moving))
    found = of_unasked_friction(found) if seen.friction is None else found
    faults = faults_of(seen, friction) if found.explanations and found.candidates else []
    if faults:
        # a scheme on another spring, or a wrong one on the stated spring: the latter is the plainer
        other = [x.cause for x in found.explanations if ": " in x.cause]
        return replace(
            found, verdict="none", scheme=None, candidates=(), aliases=(),
            statement="; or ".join([faults[0].cause, *other]),
            explanations=(*faults, *found.explanations), fits=False,
        )  # fmt: skip
    return found


def _of_positions(
    record: Record, stiffness: ArrayLike | None, step: float | None, friction: float | None
) -> Identification:
    notes: list[str] = []
    stated = of_size("stiffness", stiffness, record.q.shape[1], zero=True)
    of_size("friction", friction, zero=True)
    if stated is not None and record.mass is None:
        notes.append("the stiffness says nothing of positions without the mass; give the mass as well")
    stride = stated_stride(record, step, notes)
    return identify_positions(record, stated, stride, friction, notes)


def _explained(seen: Measured, accepted: list[Joint]) -> dict[Joint, list[arithmetic.Defect]]:
    """The schemes of which a known arithmetic explains every step, with the defects of their steps."""
    left = [x for x in accepted if not FAMILIES[x.family].held or x.substeps[0]]
    alone = len({(x.scheme, x.stride) for x in accepted}) == 1
    defects: list[list[arithmetic.Defect]] = [[] for _ in left]
    for i, (j, found, what) in enumerate(zip(seen.moving, seen.maps, seen.terms, strict=True)):
        if not left:
            break
        shows = partial(visible, found, what, damped=left[0].damped) if alone else bool
        new = arithmetic.defects(seen.record, j, found, [x.parts[i] for x in left], shows)
        # what explains one scheme's misses does not exclude the others, which miss the states by no more
        good = [x for x in new if x.precision]
        new = [
            next((y for y in good if x.miss <= AS_NEAR * y.miss), x) if not x.precision else x for x in new
        ]
        explained = [k for k, x in enumerate(new) if x.precision]
        defects = [[*defects[k], new[k]] for k in explained]
        left = [left[k] for k in explained]
    return dict(zip(left, defects, strict=True))


def _elsewhere(seen: Measured, strides: range) -> dict[Joint, list[arithmetic.Defect]]:
    """The schemes that springcheck does not run of which a known arithmetic explains every step."""
    joints = seen.compare(KNOWN_ELSEWHERE, strides) or seen.compare(DAMPED_ELSEWHERE, strides)
    return _explained(seen, likely(joints))


def _known(
    seen: Measured, explained: dict[Joint, list[arithmetic.Defect]], stated_fits: bool
) -> Identification:
    joints, maps, notes = list(explained), seen.maps, list(seen.notes)
    plainest = joints[0]
    worst = [max(ds, key=lambda d: (d.precision != "double", d.ulp)) for ds in explained.values()]
    notes += dict.fromkeys(d.note for d in explained[plainest] if d.note)
    explanations: list[Explanation] = []
    if seen.stiffness is not None:
        explanations, remarks = stated_stiffness(seen, plainest, worst[0].precision, seen.stiffness)
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
    precision = common([d.precision for d in worst]) or "cannot tell"
    notes += all_remarks(seen, joints, candidates)
    steps = (
        "" if stride == 1 else f", {stride} steps to a frame" if stride else ", in an unknown number of steps"
    )
    law = f" with{doubt} friction" if damped else ""
    law = f" with {first.law}" if first.law and len(candidates) == 1 else law
    if scheme == "held-force":
        kicks = plainest.substeps[1]
        order = "kick, then drift" if kicks else "drift, then kick"
        statement = f"{held_over(plainest)} ({order}){steps}"
        if plainest.endless:
            # coarse numbers do not tell many substeps from no end of them, which is a fault
            statement, scheme = f"{statement}, or {FAMILIES['fault: old force'].cause}", None
    elif scheme:
        also = f" (or {LEAPFROG[scheme]})" if scheme in LEAPFROG else ""
        slips = faults_like(scheme) if scheme in ELSEWHERE else ()
        also = "".join(f" (on a spring also {x.cause})" for x in slips) or also
        statement = f"{title(scheme)}{also}{law}{steps}: {precision} arithmetic explains every step"
    else:
        names = list(dict.fromkeys(x.scheme for x in candidates))
        more = f" and {len(names) - 4} more" if len(names) > 4 else ""
        statement = f"Several schemes fit, which the states do not tell apart: {', '.join(names[:4])}{more}"
    undecided = any(not d.certain for d in explained[plainest]) and stated_fits
    if undecided:
        statement = (
            f"{title(scheme or plainest.scheme)}{law}{steps}, and errors of the force of the size of "
            f"{precision} arithmetic: noise or a systematic error of that size cannot be excluded"
        )
        notes.append("what would show the arithmetic: every step recorded, and the mass")
    undecided = undecided or (scheme is None and len(joints) == 1)
    statement = explanations[0].cause if explanations else statement
    return Identification(
        **said_of(candidates, scheme, damped, len(maps)),
        statement=statement,
        step=float(seen.record.interval) / stride if stride else math.nan,
        stride=stride,
        velocity_offset=math.nan if offset is None else offset,
        determinant=determinant if stride else unknown,
        symplectic_defect=symplectic,
        defect_ulp=min(max(d.ulp for d in ds) for ds in explained.values()),
        precision=precision,
        fits=stated_fits and not undecided,
        undecided=undecided,
        difference=difference(maps[0], plainest.parts[0]) if len(joints) == 1 else (math.nan,) * 4,
        notes=tuple(dict.fromkeys(notes)),
        explanations=tuple(explanations),
    )


def _unknown(seen: Measured, strides: range) -> Identification:
    """No scheme: what may be wrong, and the nearest of these strides, but to velocities of the other sign."""
    maps = seen.maps

    def distance(joint: Joint) -> float:
        return max(max(map(abs, difference(found, m))) for found, m in zip(maps, joint.parts, strict=True))

    tried = nearest(maps, seen.terms, distinct(damped=False), strides)
    determinant, symplectic = determinants(maps, 1)
    near: dict[str, Any] = {}
    if tried and not turned(seen.record, seen.moving):
        least = min(distance(x) for x in tried)
        # many schemes and strides come close by chance; the plainest of the close ones is the better guess
        close = min((x for x in tried if distance(x) <= 10 * least), key=lambda x: x.plainness)
        omega, stiffness, _ = seen.numbers(close)
        off = difference(maps[0], close.parts[0])
        near = {"nearest": str(close), "difference": off, "omega": omega, "stiffness": stiffness}
    return nothing(
        explain(seen),
        determinant=determinant,
        symplectic_defect=symplectic,
        defect_ulp=max(float(np.max(found.residual)) for found in maps) / 2.0**-52,
        notes=seen.notes,
        **near,
    )
