"""Rounding of one step from given states: a running error bound, each degree of freedom by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.checks.claim import Claim
from springcheck.physics.arrays import ROUNDOFF, WIDE, Arithmetic, Extended, Force, Reals
from springcheck.physics.term import Term
from springcheck.schemes.rounding import Met

SMALLEST = np.longdouble(5e-324 if WIDE else 1e-323)
"""Loss of an operation to underflow: one unit of a subnormal double, and as much again where the reference
step is no wider than double."""

OF_LENGTH = 6
"""Roundings of a joint's length: the places of both ends, their difference, its square, the root of that, and
what is left beyond the rest length."""


def of_step(
    case: Claim, q: Reals, p: Reals, places: list[Reals] | None, *,
    smallest: np.longdouble = SMALLEST, recorded: bool = False, width: Any = np.longdouble,
) -> tuple[Reals, Reals]:  # fmt: skip
    """One rounding of everything that one step from states (..., n) adds up, (..., n) each, in this width.

    `places` are the positions at which the scheme evaluates the force on its way: a nonlinear force is
    bounded there, and so is the solution of an implicit stage.  `smallest` is the loss of an operation to
    underflow.  `recorded` says that the step starts and ends at recorded positions, which are not rounded
    once more.
    """
    run, scene = case.trajectory, case.judged
    how = run.arithmetic
    q, p = q.astype(width), p.astype(width)
    h, m, smallest = width(abs(run.step)), scene.m.astype(width), width(smallest)
    # the reference step rounds as well
    state = how.state + ROUNDOFF
    lost = of_underflow(case, smallest)
    fine: list[Reals] = []
    # of a force that is coarser than the state, first the sizes that it has without its own error
    for way in [how] if how.force <= how.state else [replace(how, force=how.state, quantum=0.0), how]:
        size_q, size_p = schemes.magnitude_step(
            case.scheme, q, p, h=run.step, m=m, rate=case.law.rate,
            lost=(smallest * (1 + h) / state, lost / state),
            met=_evaluations(case, partial(_force, case, way, fine), places, recorded),
        )  # fmt: skip
    # an engine may count positions from the rest points of springs, and so round those
    of_q, of_p = state * (size_q + case.origins), state * size_p
    if run.rebuilds_velocity and not how.keeps_displacement:
        # as they are counted: from rest
        of_p = of_p + how.state * m * (np.abs(q) + size_q + 2 * case.origins) / h
    return np.asarray(of_q + h / m * lost + smallest), np.asarray(of_p + lost)


def of_underflow(case: Claim, smallest: Any = SMALLEST) -> Reals:
    """What underflow takes off the momenta in a stage (n,).

    A force, its product with the step, and a velocity may each lose `smallest`; a solver adds up n products.
    """
    scene, h = case.judged, type(smallest)(abs(case.trajectory.step))
    lost = smallest * (1 + scene.m.astype(type(smallest)) + h * scene.system.pulls())
    return np.asarray(lost * scene.n if case.scheme.has("implicit") else lost)


def of_recording(case: Claim, q: Reals, p: Reals, places: list[Reals] | None) -> tuple[Extended, Extended]:
    """Bound on what decimals take off the state after a step from states (..., n), (..., n) each: that of its
    own numbers, and that of the numbers before, which the step carries on.  0 where there are none.

    The running error bound is affine in the sizes of a state, and so carries their errors.
    """
    run, m = case.trajectory, case.judged.m.astype(np.longdouble)
    half = run.arithmetic.recorded(m, run.step, run.rebuilds_velocity)
    if not np.any(half):
        return 0 * q, 0 * p

    def plain(terms: tuple[Term, ...], near: Reals | None, whole: float, exact: bool) -> Force:
        return case.system.magnitude(near, terms)

    met = _evaluations(case, plain, places, recorded=False)
    off, none = (
        schemes.magnitude_step(
            case.scheme, q + np.copysign(part * half[0], q), p + np.copysign(part * half[1], p), h=run.step,
            m=m, rate=case.law.rate, met=met,
        )
        for part in (1, 0)
    )  # fmt: skip
    return half[0] + off[0] - none[0], half[1] + off[1] - none[1]


def _evaluations(
    case: Claim, of: Callable[..., Force], places: list[Reals] | None, recorded: bool
) -> list[Met]:
    """Error bound `of` each evaluation of the force within a step."""
    scene, scheme = case.judged, case.scheme
    joints: Any = 0.0
    if case.trajectory.arithmetic.joints:
        far = np.full(scene.n, scene.system.far, np.longdouble)
        joints = OF_LENGTH / np.longdouble(case.roundings) * scene.system.magnitude()(far, 0 * far)
    acting = {"slow": scene.system.slow, "fast": scene.system.fast}
    found: list[Met] = []
    brakes = scene.system.brakes_by_place
    made: dict[tuple[str, float], Met] = {}
    for number, (terms, part, at_end) in enumerate(scheme.evaluations):
        # an engine may take a step's kick in one piece, with the whole error of its force
        whole = max(1.0, 1 / abs(float(schemes.number(part, np.float64))))
        known = terms, whole
        if places is not None or known not in made:
            near = None if places is None else places[number]
            bent = None if case.system.is_linear else near
            stiffness = None
            if scheme.has("implicit"):
                stiffness = case.law.stiffness if bent is None else scene.system.slope(bent)[0]
            made[known] = Met(
                magnitude=of(acting.get(terms, scene.terms), bent, whole, recorded and at_end),
                stiffness=stiffness,
                joined=not scene.system.is_separate,
                joints=joints,
                q=near,
                friction=None if near is None or not brakes else scene.system.friction_at(near),
                pull=None if near is None else scene.system.potential_force(near, np.zeros_like(near)),
            )
        found.append(made[known])
    return found


def _force(
    case: Claim, how: Arithmetic, fine: list[Reals], terms: tuple[Term, ...], near: Reals | None,
    whole: float, exact: bool,
) -> Force:  # fmt: skip
    """Bound on the rounding of a force, in roundings of the state: of its sum, its width and its quantum.

    The error of a coarse force is no size for that of the next: a fine step leaves its `fine` sizes.
    """
    plain = case.system.magnitude(near, terms, exact=exact)
    count = case.scene.system.pulls(terms)
    # each term on a particle after the first is added with a rounding of its own
    more = 1 + np.maximum(count - 1, 0) / np.longdouble(case.roundings)
    width = whole * how.force / np.longdouble(how.state) if how.force > how.state else 0.0
    # roundings of the force at the start, and of its change with the displacement from there
    far = np.abs(case.scene.q) if how.from_start else 0.0

    def force(q: Reals, p: Reals) -> Reals:
        sizes = plain(q + far, p)
        bound = sizes * more.astype(sizes.dtype)
        if width:
            bound = bound + sizes.dtype.type(width) * fine.pop(0)
        elif how is not case.trajectory.arithmetic:
            fine.append(sizes)
        if how.quantum:
            # each term's force on a particle is truncated once in a kick, not once for every rounding, and a
            # force below the quantum is lost, no more
            lost = np.minimum(how.quantum * count, sizes)
            bound = bound + whole * lost / (np.longdouble(how.state) * case.roundings)
        return np.asarray(bound, sizes.dtype)

    return force
