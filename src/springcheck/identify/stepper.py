"""A student's integrator, judged in one line: a Python callable ``step(q, p, h, force, mass) -> (q, p)``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from springcheck.errors import IdentificationError, MethodError, told
from springcheck.identify.families import title
from springcheck.identify.report import identify_arrays
from springcheck.identify.result import Explanation, Identification
from springcheck.identify.unknown import ONE_MAP
from springcheck.identify.wrong import faults_like
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES
from springcheck.schemes.elsewhere import ELSEWHERE

Stepper: TypeAlias = Callable[..., Any]

SPRINGS = ((3.7, 2.9, 0.31), (0.6, 1.7, 0.11), (1.9, 0.8, 0.43))
"""m, k, h: uneven, so that a mass left out or a half step misplaced shows."""

FRAMES = 81

BATH_FRAMES = 4001
"""Frames of a stepper that draws random numbers, by which its kT is known to a tenth."""

TINY_STEP = 1e-6, 1e-3
"""A step that shows the terms linear in h, and by how much their sums of weights may be off 1."""

RUNAWAY = 1e5
"""Growth of a state at which a run ends."""

WELL = (1.3, 2.1, 1.1, 0.4, 2.0)
"""m, b, q0, p0 and duration on V = b/4 q**4, a quarter of whose time scale passes in a unit of time."""


class _Timeless:
    """A force that may be asked for at a time, of which it knows nothing."""

    t = 0.0

    def __init__(self, law: Callable[..., Any]) -> None:
        self._law = law

    def __call__(self, q: Any, p: Any = 0.0, t: float = 0.0) -> Any:
        return self._law(q, p)


def _one(
    step: Stepper, q: float, p: float, h: float, force: Callable[..., Any], mass: float
) -> tuple[float, float]:
    """One step of the student's; numbers first, arrays of one particle where it wants to index them."""
    force = _Timeless(force)
    try:
        try:
            out = step(q, p, h, force, mass)
        except Exception as first:
            try:
                out = step(np.array([q]), np.array([p]), h, force, np.array([mass]))
            except Exception:
                raise first from None
        new_q, new_p = out
        q, p = (
            float(np.asarray(x, dtype=np.float64).reshape(())) if np.ndim(x) == 0 else float(np.ravel(x)[0])
            for x in (new_q, new_p)
        )
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        file = getattr(getattr(step, "__code__", None), "co_filename", "")
        raise MethodError(
            f"the stepper failed at q={q:.6g}, p={p:.6g}, h={h:.6g}: {told(error, file)}; "
            "it is called as step(q, p, h, force, mass) and returns (q, p)"
        ) from error
    if not (math.isfinite(q) and math.isfinite(p)):
        raise MethodError(f"the stepper returned q={q}, p={p}, which are not finite numbers")
    return q, p


def _run(
    step: Stepper, force: Callable[..., Any], m: float, h: float, start: tuple[float, float], frames: int
) -> tuple[Floats, Floats, Floats]:
    states = [start]
    most = RUNAWAY * max(map(abs, start))
    for _ in range(frames - 1):
        # of a motion that runs away the growing direction alone is left: no map can be fitted to it
        if len(states) > 6 and max(map(abs, states[-1])) > most:
            break
        states.append(_one(step, *states[-1], h, force, m))
    q, p = np.array(states).T
    return np.asarray(h * np.arange(len(q)), dtype=np.float64), q, p


def _spring(k: float) -> Callable[..., Any]:
    return lambda q, p=0.0: -k * q


def identify_stepper(step: Stepper) -> Identification:
    """Which scheme a callable ``step(q, p, h, force, mass) -> (q, p)`` is, and what is wrong with it.

    It is driven over three springs of uneven mass, stiffness and step, backwards in time, and over an
    anharmonic well, where the order of a scheme shows that on a spring can look higher than it is.
    ``force`` may be called as force(q), force(q, p) or force(q, p, t), and knows the time at which the step
    starts as ``force.t``.  The numbers are those of the first spring.

    Raises MethodError where the callable fails or returns no pair of finite numbers.
    """
    results = []
    for m, k, h in SPRINGS:
        t, q, p = _run(step, _spring(k), m, h, (1.3, 0.7 * m), FRAMES)
        try:
            results.append(identify_arrays(t, q, p, mass=m, stiffness=k, step=h))
        except IdentificationError as error:
            if _draws(step):
                return _in_a_bath(step)
            raise MethodError(f"the stepper does not move a spring as a scheme would: {error}") from error
        if not results[0].fits:
            break
    found = results[0]
    if not found.fits and _draws(step):
        return _in_a_bath(step)
    notes = list(dict.fromkeys(note for x in results for note in x.notes))
    wrong: list[Explanation] = []
    schemes = {x.scheme for x in results}
    if found.fits and len(schemes) > 1:
        named = "; ".join(
            f"{x.scheme or 'none that is known'} at m={m}, k={k}, h={h}"
            for x, (m, k, h) in zip(results, SPRINGS, strict=False)
        )
        wrong.append(
            Explanation(
                cause=f"The stepper looks like different schemes on different springs: {named}",
                remedy="look for numbers that are written into it",
            )
        )
    elif found.fits and any(not x.fits for x in results):
        wrong += next(x for x in results if not x.fits).explanations
    if any(x.law for x in found.candidates):
        rates = ", ".join(f"{x.friction[0]:.4g} by {x.law}" for x in found.candidates[:3])
        wrong.append(
            Explanation(
                cause=f"{title(found.candidates[0].scheme)} with a friction that the force has not: c/m is "
                f"{rates}",
                remedy="set the damping to 0, which many engines do not by default",
            )
        )
    if any(x.cause.startswith(ONE_MAP) for x in found.explanations[:1]):
        wrong += _short(step)
    if found.scheme and not wrong:
        wrong += _backwards(step, found)
    if found.scheme in ELSEWHERE and _calls(step) > len(ELSEWHERE[found.scheme].over) - 1 > 0:
        # more stages than the scheme needs: a fault of the same map has them
        wrong += [Explanation(cause=one.cause, remedy=one.remedy) for one in faults_like(found.scheme)]
    slope, deviation = _order(step)
    if math.isnan(slope):
        notes.append("its error on a quartic well does not fall as a power of the step: no order is seen")
    else:
        notes.append(f"order {slope:.2f} +- {deviation:.2f} on a quartic well")
        known = SCHEMES.get(str(found.scheme)) or ELSEWHERE.get(str(found.scheme))
        order = known.order if known else 0
        if order and slope < order - max(5 * deviation, 0.25):
            wrong.append(
                Explanation(
                    cause=f"On a spring it is {found.scheme}, of order {order}, but not on forces that are "
                    "not linear",
                    remedy="look for a force that is evaluated at the wrong place",
                )
            )
    fits = found.fits and not wrong
    explanations = (*wrong, *found.explanations)
    return replace(
        found,
        fits=fits,
        statement=wrong[0].cause if wrong else found.statement,
        explanations=explanations,
        notes=tuple(dict.fromkeys(notes)),
        defect_ulp=max(x.defect_ulp for x in results),
    )


def _draws(step: Stepper) -> bool:
    """Whether a third call from one state still gives another result than the second."""
    m, k, h = SPRINGS[0]
    _, one, other = (_one(step, 1.3, 0.7 * m, h, _spring(k), m) for _ in range(3))
    return one != other


def _in_a_bath(step: Stepper) -> Identification:
    """Which thermostat a stepper that draws random numbers is, on the first spring."""
    m, k, h = SPRINGS[0]
    states = _run(step, _spring(k), m, h, (1.3, 0.7 * m), BATH_FRAMES)
    return identify_arrays(*states, mass=m, stiffness=k, step=h)


def _short(step: Stepper) -> list[Explanation]:
    """Terms linear in h whose weights do not add up to 1: no scheme, whatever its order."""
    (m, k, _), (h, off) = SPRINGS[0], TINY_STEP
    q, p = 1.3, 0.7 * m
    new_q, new_p = _one(step, q, p, h, _spring(k), m)
    drift, kick = (new_q - q) / (h * p / m), (new_p - p) / (-h * k * q)
    if max(abs(drift - 1), abs(kick - 1)) < off:
        return []
    cause = (
        f"Over a short step the momentum changes by {kick:.5g} h F and the position by {drift:.5g} h p/m, "
        "where a scheme of any order has 1 and 1"
    )
    remedy = "add up the lengths of its kicks and of its drifts, or the weights of its stages: each sum is 1"
    return [Explanation(cause=cause, remedy=remedy, misfit=max(abs(drift - 1), abs(kick - 1)))]


def _calls(step: Stepper) -> int:
    """Evaluations of the force in a step."""
    m, k, h = SPRINGS[0]
    calls = [0]

    def force(q: Any, p: Any = 0.0) -> Any:
        calls[0] += 1
        return -k * q

    _one(step, 1.3, 0.7 * m, h, force, m)
    return calls[0]


def _backwards(step: Stepper, found: Identification) -> list[Explanation]:
    """Test a negative step: explanations where it does not go backwards by the same scheme."""
    m, k, h = SPRINGS[0]
    t, q, p = _run(step, _spring(k), m, -h, (1.3, 0.7 * m), FRAMES)
    back = identify_arrays(t, q, p, mass=m, stiffness=k, step=-h)
    if back.scheme == found.scheme:
        return []
    forward = identify_arrays(-t, q, p, mass=m, stiffness=k, step=h)
    if forward.scheme == found.scheme:
        cause = f"{title(str(found.scheme))}, but a negative step goes forwards: the sign of the step is lost"
        return [Explanation(cause=cause, remedy="take the step with its sign")]
    cause = f"A negative step is not {found.scheme} backwards but {back.scheme}"
    return [Explanation(cause=cause, remedy="look for what depends on the direction of time")]


def _order(step: Stepper) -> tuple[float, float]:
    """Slope of log error against log step on a quartic well, with its standard error; NaN where unseen."""
    from scipy.integrate import solve_ivp

    m, b, q0, p0, duration = WELL
    true = solve_ivp(
        lambda t, z: [z[1] / m, -b * z[0] ** 3],
        (0, duration),
        [q0, p0],
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    ).y[:, -1]
    steps, errors = [], []
    for count in (16, 24, 36, 54, 80, 120, 180, 270, 400, 600):
        h = duration / count
        q, p = q0, p0
        for _ in range(count):
            if not abs(q) + abs(p) < RUNAWAY:
                break
            q, p = _one(step, q, p, h, lambda x, y=0.0: -b * x**3, m)
        size = math.hypot(q - true[0], (p - true[1]) / m)
        # below, rounding and the reference take over; above, the leading term does not lead yet
        if 1e-10 < size < 0.03:
            steps.append(math.log(h))
            errors.append(math.log(size))
    if len(steps) < 4:
        return math.nan, math.nan
    x, y = np.array(steps[-5:]), np.array(errors[-5:])
    x = x - np.mean(x)
    slope = float(x @ y / (x @ x))
    left = y - np.mean(y) - slope * x
    return slope, float(np.sqrt(left @ left / (len(x) - 2) / (x @ x)))
