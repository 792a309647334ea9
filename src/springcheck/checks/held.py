"""Causes that rods show: the impulse along a rod is the difference of a step from the same step without rods,
and its direction follows from the positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.checks import other
from springcheck.checks.case import Case
from springcheck.checks.rods import rod_length, rod_velocity
from springcheck.checks.steps import seldom_off, step_defect
from springcheck.physics.arrays import Reals
from springcheck.physics.rods import Rods

PUSH_ROUNDINGS = 64
"""Roundings of the positions whose difference is an impulse: of a free step, and of the frame as recorded."""


def found(case: Case) -> str:
    """Momenta that are not projected, impulses along other directions than that of the rods before the drift,
    or of another size than keeps their lengths."""
    rods, run = case.system.rods, case.trajectory
    if rods is None or len(run.t) < 3:
        return ""
    q, p = (x.astype(np.longdouble) for x in (run.q, run.p))
    held = np.concatenate([run.p[:1], rods.projected(q[1:], p[1:]).astype(np.float64)])
    across = replace(case, trajectory=replace(run, p=held))
    if rod_velocity(case).passed is False and not seldom_off(case)[1] and step_defect(across).passed:
        return (
            "momenta keep their part along rods, which RATTLE takes off at the end of a step; without it "
            "each step is the scheme's own"
        )
    if len([kind for kind in case.scheme.kinds if kind.drifts]) != 1:
        return _of_wide_tolerance(case, rods)
    scene, q, p = case.judged, q[:-1], p[:-1]
    free = scene.derived(terms=tuple(x for x in scene.terms if x.kind != "constraint"))
    loose = Case(trajectory=run, scene=free).step(q, p)[0]
    push, noise = run.q[1:] - loose, 2.0**-53 * (np.abs(run.q[1:]) + np.abs(loose))
    moved = rods.apart(push)
    allowed = PUSH_ROUNDINGS * rods.spans(noise)

    def along(way: Reals) -> bool:
        size = rods.solve(way, way, rods.dot(moved, way))
        part = rods.apart(rods.spread(rods.each(size) * way) / scene.m)
        off = np.sqrt(rods.dot(moved - part, moved - part))
        return bool(np.all(off[1:] <= allowed[1:]))

    ways = rods.ways(q)
    if np.all(np.sqrt(rods.dot(moved, moved)) <= allowed):
        return ""
    if along(ways):
        off = float(np.max(np.abs(rods.strain(run.q[1:].astype(np.longdouble)))))
        return other.found(case) or (
            "SHAKE pushes along rods in their direction, and not as much as keeps lengths, off by up to "
            f"{off:.2g} of themselves: a wide tolerance, an iteration that stops early, other lengths or "
            "masses in it, or a spring in its place"
        ) * (rod_length(case).passed is False)
    if along(rods.ways(loose)):
        return (
            "SHAKE pushes the ends of a rod along it as it lies after the drift, where "
            f"{case.scheme.title} takes it as it lay before"
        )
    if along(np.concatenate([ways[:1], ways[:-1]])):
        return "SHAKE pushes the ends of a rod along it as it lay a step before"
    return ""


def _of_wide_tolerance(case: Case, rods: Rods) -> str:
    """Steps that are right but for what lengths of rods miss, where a step pushes along them more than once,
    at places that no frame holds."""
    run = case.trajectory
    off = float(np.max(np.abs(rods.strain(run.q.astype(np.longdouble)))))
    loose = replace(run, arithmetic=replace(run.arithmetic, lengths=off))
    if rod_length(case).passed is not False or not step_defect(replace(case, trajectory=loose)).passed:
        return ""
    return other.found(case) or (
        f"each step is the scheme's own to the lengths of rods, which are kept to {off:.2g} of themselves: "
        "SHAKE has a wide tolerance, or its iteration stops early"
    )
