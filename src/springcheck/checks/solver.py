"""Adaptive solvers: the error that their tolerance allows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.checks import sight
from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check
from springcheck.checks.steps import fastest
from springcheck.physics import exact
from springcheck.physics.arrays import Extended, Floats


@check("toler", family="motion", requires={"tolerance", "two-frames", "solution"})
def tolerance(case: Case) -> Finding | str:
    """The error of an adaptive solver is what its tolerance allows."""
    run = case.trajectory
    q, p = exact.true_motion(case.scene, case.steps, run.step)
    value = float(np.max(case.system.norm(run.q - q, run.p - p)))
    # sizes of the exact solution: a diverging one would excuse itself
    true = replace(run, q=np.asarray(q, np.float64), p=np.asarray(p, np.float64))
    known = exact.uncertainty(case.scene, float(case.steps[-1]) * run.step)
    bound = tolerance_bound(Case(trajectory=true, scene=case.scene)) + known
    if not np.isfinite(bound) or not np.isfinite([q, p]).all():
        return "the exact flow leaves the range of numbers"
    moved = np.max(case.system.norm(q - case.scene.q, p - case.scene.p))
    if value <= bound and 0 < moved <= bound:
        return "standing still would pass: it allows all of the motion"
    why = (
        f"{run.tolerance:g} a step of every component, at most {most_steps(case):.0f} internal steps, "
        f"each error enlarged by the exact flow at most {flow_growth(case):.3g} times" + _not_believed(case)
    )
    sees = sight.of_exact(case, lambda change: case.system.norm(*change) / bound)
    return Finding(value, bound, "initial energy norms", why, sees)


@np.errstate(all="ignore")
def tolerance_bound(case: Case) -> float:
    """What an adaptive solver's errors may add up to, relative to the initial energy norm.

    CVODE and IDA keep the weighted root mean square of the 2n local errors below 1, each weighed by the
    tolerance times its size and its amplitude; all of it may lie in the component that counts most.  The
    exact flow carries each of them on: near an instability it carries them apart.
    """
    states = case.trajectory.q, case.trajectory.p
    if case.scene.system.is_linear and case.scene.system.is_separate and case.linear:
        # an error made later grows for a shorter time: state and growth are both taken from the start
        states = (case.scene.q[None], case.scene.p[None]) if np.any(case.system.modes.w2 < 0) else states
    local = _worst_local_error(case, *states)
    return float((case.trajectory.tolerance or 0.0) * most_steps(case) * local * flow_growth(case))


def most_steps(case: Case) -> float:
    """Internal steps that a solver may have made: no more than force calls, and than order 1 needs.

    At order 1 a step of h leaves h**2 |z''|/2, which is the tolerance of |z| for h = sqrt(2 tolerance)/rate;
    and no more than `A_FRAME` for each frame, or `A_RADIAN` for each radian of the fastest motion if those
    are more.  A method that reports more of them is not believed.
    """
    slowest = _radians(case) / np.sqrt(2 * (case.trajectory.tolerance or 1.0))
    return float(min(case.trajectory.force_calls, max(slowest, STARTING), _believed(case)))


def _radians(case: Case) -> float:
    return abs(float(case.trajectory.t[-1])) * fastest(case)


def _believed(case: Case) -> float:
    frames = float(case.steps[-1]) / case.trajectory.every
    return max(A_FRAME * frames, A_RADIAN * _radians(case), STARTING)


def _not_believed(case: Case) -> str:
    """A sentence where a method declares more force calls than are believed; "" elsewhere."""
    calls = case.trajectory.force_calls
    if calls <= _believed(case):
        return ""
    return (
        f"; of the {calls:.3g} force calls that it declares {_believed(case):.0f} are believed, the most of "
        f"{A_FRAME:g} a frame, {A_RADIAN:g} a radian of the fastest motion, and {STARTING:g}"
    )


STARTING = 100.0
"""Steps that a solver may take before its step has grown to the size that the motion allows."""

A_FRAME, A_RADIAN = 64.0, 500.0
"""Force calls that are believed: a step or two that end at a frame, by the costliest of the known methods
(IAS15, 38); and steps of order 5, each with six calls, at a tolerance of 1e-10."""

TIMES = 128
"""Times along the motion between which the growth of the exact flow is evaluated."""

CHANGE = np.longdouble(2.0**-24)
"""Relative change of the start for the derivative of the exact solution: its second order is 2**-24 of the
first, its rounding in extended precision 2**-40."""


def flow_growth(case: Case) -> float:
    """The largest |D phi| of the exact flow between any two times of the run, in the energy norm, at least 1.

    For linear scenes it is known: a mode that nothing holds grows with the time, an unstable one with its
    exponential.  Elsewhere it is taken from exact solutions with slightly different starts.
    """
    run, scene = case.trajectory, case.scene
    duration = abs(float(run.t[-1]))
    if scene.system.is_linear:
        if not (case.linear and np.any(case.system.modes.w2 < 0)):
            return 1.0
        turn = float(np.sqrt(np.max(-case.system.modes.w2)) * duration)
        return float(np.exp(turn) * max(turn, 1.0))
    if duration == 0:
        return 1.0
    maps = _flow_maps(case, duration)
    if maps is None:
        return 1.0 + fastest(case) * duration / 2
    try:
        back = np.linalg.inv(maps)
        # from every time to every later one
        found = max(
            float(np.max(np.linalg.norm(maps[j:] @ back[j], 2, axis=(-2, -1)))) for j in range(len(maps))
        )
    except np.linalg.LinAlgError:
        # the flow leaves the range of numbers
        return np.inf
    return max(1.0, found) if np.isfinite(found) else np.inf


def _flow_maps(case: Case, duration: float) -> Floats | None:
    """Derivatives of the exact flow from the start to `TIMES` times, in units of the energy norm: (f, [n,]
    d, d).

    None where no exact solution is known, and for more joined particles than are worth it.
    """
    scene, n = case.scene, case.scene.n
    separate = scene.system.is_separate
    if scene.system.solution is None or (not separate and n > JOINED):
        return None
    unit = np.stack(_units(case))
    # separate particles are all pushed at once
    pushes = np.eye(2)[..., None] * unit if separate else np.eye(2 * n).reshape(2 * n, 2, n) * unit
    h = duration / TIMES
    moved = np.asarray(np.stack([scene.q, scene.p]) + np.stack([pushes, -pushes], axis=1), np.float64)
    # copies side by side, all integrated at once
    q, p = np.moveaxis(moved, 2, 0).reshape(2, -1, n)
    copies = replace(scene.system.tiled(len(q)), q=q.ravel(), p=p.ravel(), steps=TIMES, every=1, step=h)
    if not exact.has_true_motion(copies):
        return None
    found = np.stack(exact.true_motion(copies, np.arange(TIMES + 1), h), axis=1)
    found = found.reshape(TIMES + 1, 2, len(pushes), 2, n)
    columns: list[Extended] = []
    for j in range(len(pushes)):
        one, other = found[:, :, j, 0], found[:, :, j, 1]
        # by the actual difference of the doubles
        change = (moved[j, 0] - moved[j, 1]) / unit
        columns.append((one - other) / (unit * np.sum(change, axis=0 if separate else None)))
    # (d, f, 2, n): which column, time, q or p, particle
    table = np.stack(columns).astype(np.float64)
    if separate:
        return np.moveaxis(table, (0, 3), (3, 1))
    return np.moveaxis(table.reshape(2 * n, TIMES + 1, 2 * n), 0, -1)


JOINED = 4
"""Joined particles of an anharmonic scene up to which the growth of the exact flow is computed."""


def _units(case: Case) -> tuple[Extended, Extended]:
    """Small changes of positions and momenta (n,), each of the same size in the energy norm."""
    stiff, m = _stiff(case), case.scene.m.astype(np.longdouble)
    stiff = np.where(stiff > 0, stiff, m * np.longdouble(fastest(case)) ** 2)
    unit = case.system.norm.unit * CHANGE
    return np.asarray(unit * np.sqrt(2 / stiff)), np.asarray(unit * np.sqrt(2 * m))


def _stiff(case: Case) -> Extended:
    """Upper bound of the weight of a position error in the error norm (n,) [M/T2]."""
    # (du)**2 of a spring is at most twice the sum of its ends' squares; nothing held: see `Norm`
    stiff = case.system.rigidity.astype(np.longdouble)
    for group in case.system.norm.groups:
        stiff[group] += case.judged.m[group] / case.system.norm.duration**2
    return stiff


def _worst_local_error(case: Case, q: Floats, p: Floats) -> np.longdouble:
    """The largest local error at states (f, n) that passes, in tolerances times the initial energy norm."""
    scene = case.judged
    # extended: the squares of large states leave the range of a double
    of_q, of_p = (x.astype(np.longdouble) for x in scene.system.amplitudes)
    weight_q, weight_p = np.max(np.abs(q), axis=0) + of_q, np.max(np.abs(p), axis=0) + of_p
    largest = np.max(np.maximum(_stiff(case) * weight_q**2, weight_p**2 / scene.m)) / 2
    if largest == 0:
        return np.longdouble(0)
    return np.longdouble(np.sqrt(2 * scene.n * largest) / case.system.norm.unit)
