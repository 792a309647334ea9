"""A student's integrator, judged in one line: a Python callable ``step(q, p, h, force, mass) -> (q, p)``."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from springcheck.arrays import Floats
from springcheck.errors import IdentificationError, MethodError
from springcheck.identify.report import identify
from springcheck.identify.result import Identification
from springcheck.schemes import SCHEMES

Stepper: TypeAlias = Callable[..., Any]

SPRINGS = ((3.7, 2.9, 0.31), (0.6, 1.7, 0.11), (1.9, 0.8, 0.43))
"""m, k, h: uneven, so that a mass left out or a half step misplaced shows."""

FRAMES = 81

WELL = (1.3, 2.1, 1.1, 0.4, 2.0)
"""m, b, q0, p0 and duration on V = b/4 q**4, a quarter of whose time scale passes in a unit of time."""


def load_stepper(spec: str) -> Stepper:
    """The callable that ``module:function`` names; the current folder is searched as well."""
    module_name, colon, name = spec.partition(":")
    if not (colon and module_name and name):
        raise MethodError(f"stepper {spec!r} is not of the form module:function")
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        missing = error.name or module_name
        if missing == module_name.split(".", maxsplit=1)[0] or module_name.startswith(f"{missing}."):
            raise MethodError(f"no module {module_name!r} in {here} or among the installed ones") from error
        raise MethodError(f"module {module_name!r} needs {missing!r}, which is not installed") from error
    except Exception as error:
        raise MethodError(
            f"module {module_name!r} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    finally:
        sys.path.remove(here)
    found: Any = module
    for part in name.split("."):
        if not hasattr(found, part):
            known = [x for x in vars(module) if callable(getattr(module, x)) and not x.startswith("_")]
            raise MethodError(
                f"module {module_name!r} has no {name!r}; it has {', '.join(known) or 'no functions'}"
            )
        found = getattr(found, part)
    if not callable(found):
        raise MethodError(f"{spec!r} is a {type(found).__name__}, not a function")
    return found  # type: ignore[no-any-return]


def _one(
    step: Stepper, q: float, p: float, h: float, force: Callable[..., Any], mass: float
) -> tuple[float, float]:
    """One step of the student's; numbers first, arrays of one particle where it wants to index them."""
    try:
        try:
            out = step(q, p, h, force, mass)
        except (TypeError, IndexError, AttributeError):
            out = step(np.array([q]), np.array([p]), h, force, np.array([mass]))
        new_q, new_p = out
        q, p = (
            float(np.asarray(x, dtype=np.float64).reshape(())) if np.ndim(x) == 0 else float(np.ravel(x)[0])
            for x in (new_q, new_p)
        )
    except Exception as error:
        raise MethodError(
            f"the stepper failed at q={q:.6g}, p={p:.6g}, h={h:.6g}: {type(error).__name__}: {error}; "
            "it is called as step(q, p, h, force, mass) and returns (q, p)"
        ) from error
    if not (math.isfinite(q) and math.isfinite(p)):
        raise MethodError(f"the stepper returned q={q}, p={p}, which are not finite numbers")
    return q, p


def _run(
    step: Stepper, force: Callable[..., Any], m: float, h: float, start: tuple[float, float], frames: int
) -> tuple[Floats, Floats, Floats]:
    states = [start]
    for _ in range(frames - 1):
        states.append(_one(step, *states[-1], h, force, m))
    q, p = np.array(states).T
    return np.asarray(h * np.arange(frames), dtype=np.float64), q, p


def _spring(k: float) -> Callable[..., Any]:
    return lambda q, p=0.0: -k * q


def identify_stepper(step: Stepper) -> Identification:
    """Which scheme a callable ``step(q, p, h, force, mass) -> (q, p)`` is, and what is wrong with it.

    It is driven over three springs of uneven mass, stiffness and step, backwards in time, and over an
    anharmonic well, where the order of a scheme shows that on a spring can look higher than it is.
    ``force`` may be called as force(q) or force(q, p).  The numbers are those of the first spring.

    Raises MethodError where the callable fails or returns no pair of finite numbers.
    """
    results = []
    for m, k, h in SPRINGS:
        t, q, p = _run(step, _spring(k), m, h, (1.3, 0.7 * m), FRAMES)
        try:
            results.append(identify(t, q, p, mass=m, stiffness=k, step=h))
        except IdentificationError as error:
            raise MethodError(f"the stepper does not move a spring as a scheme would: {error}") from error
    found = results[0]
    schemes = {x.scheme for x in results}
    fits = all(x.fits for x in results) and len(schemes) == 1
    notes = list(dict.fromkeys(note for x in results for note in x.notes)) if fits else list(found.notes)
    if len(schemes) > 1:
        named = "; ".join(
            f"{x.scheme} at m={m}, k={k}, h={h}" for x, (m, k, h) in zip(results, SPRINGS, strict=True)
        )
        notes.append(f"the stepper looks like different schemes on different springs: {named}")
    if not fits:
        notes += _mass_use(step)
    backward = _backwards(step, found) if found.scheme else ""
    fits = fits and not backward
    notes += [backward] if backward else []
    slope, deviation = _order(step)
    if math.isnan(slope):
        notes.append("its error on a quartic well does not fall as a power of the step: no order is seen")
        fits = False
    else:
        notes.append(f"order {slope:.2f} +- {deviation:.2f} on a quartic well")
        order = SCHEMES[found.scheme].order if found.scheme in SCHEMES else 0
        if order and slope < order - max(5 * deviation, 0.25):
            notes.append(
                f"on a spring it is {found.scheme}, of order {order}, but not on forces that are not linear: "
                "look for a force that is evaluated at the wrong place"
            )
            fits = False
    return replace(found, fits=fits, notes=tuple(notes), defect_ulp=max(x.defect_ulp for x in results))


def _mass_use(step: Stepper) -> list[str]:
    """Whether the mass is left out, or used twice, where that explains what no scheme does."""
    m, k, h = SPRINGS[0]
    t, q, p = _run(step, _spring(k), m, h, (1.3, 0.7 * m), FRAMES)
    readings = (
        (1.0, k, "dq/dt = p: the mass is left out"),
        (1.0, k / m, "dq/dt = p and dp/dt = F/m: p is treated as a velocity"),
        (m, k / m, "dq/dt = p/m and dp/dt = F/m: the force is divided by the mass although p is a momentum"),
    )
    for mass, stiffness, meaning in readings:
        reading = identify(t, q, p, mass=mass, stiffness=stiffness, step=h)
        if reading.fits:
            return [f"it is {reading.scheme} with {meaning}"]
    return []


def _backwards(step: Stepper, found: Identification) -> str:
    """What a negative step does wrong, or "" where it goes backwards by the same scheme."""
    m, k, h = SPRINGS[0]
    t, q, p = _run(step, _spring(k), m, -h, (1.3, 0.7 * m), FRAMES)
    back = identify(t, q, p, mass=m, stiffness=k, step=-h)
    if back.scheme == found.scheme:
        return ""
    forward = identify(-t, q, p, mass=m, stiffness=k, step=h)
    if forward.scheme == found.scheme:
        return "a negative step goes forwards: the sign of the step is lost"
    return f"a negative step is not {found.scheme} backwards but {back.scheme}"


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
