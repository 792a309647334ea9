"""Maps of no known scheme: the class of a one-step method, and multistep methods."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from functools import partial

import numpy as np

from springcheck.identify.compare import nearest
from springcheck.identify.evidence import AGREES, FALLS, LEFT_BY_ROUNDING, Evidence, distance
from springcheck.identify.families import title
from springcheck.identify.fit import Map, fit
from springcheck.identify.hypothesis import STRIDES, SURE, distinct
from springcheck.identify.laws import ANHARMONIC, LAWS, OF_VELOCITY, Cause, Regression, regression
from springcheck.identify.record import DEEP
from springcheck.identify.result import Explanation
from springcheck.physics.arrays import Floats
from springcheck.text.wording import either

REAL = 0.3
"""Largest ratio of the imaginary to the real part of a coefficient that is real to leading order."""

ORDERS = range(1, 9)
"""Powers of h L among which the first wrong coefficient is sought."""

FORGOTTEN = 0.1
"""Largest residual in the last three quarters of the frames over the largest, of a start-up transient."""

CHOSEN = 1200
"""Common denominator of the parameters that people choose."""

ONE_MAP = "One linear map explains the states"
MAP_OF = "if every step was recorded, it is that of a one-step method, "
UNKNOWN_METHOD = "a one-step method that is not known here, which"

AS_IT_WAS = 0.1
"""Relative error of the coefficient of z[n-1], which is 1, in the two-step leapfrog."""

AS_BEFORE = 1e-3
"""Share of what the first frames miss up to which the first state leads to those after them by one map."""

FEWEST_WITH_MEMORY = 12
"""Fewest frames for a map of two states."""


def tied(e: Evidence) -> Explanation | None:
    """The cause where the velocity is a multiple of the position from frame 1 on; None where it is not."""
    q, v = e.found.z[1:].astype(np.float64).T
    slope = float(q @ v / (q @ q)) if np.any(q) else 0.0
    if not (slope and np.all(np.abs(v - slope * q) <= 8 * e.unit)):
        return None
    times = slope * float(e.found.size[1] / e.found.size[0] / e.record.interval)
    still = np.all(np.abs(v) <= 8 * e.unit)
    return Explanation(
        "The velocity is 0 from frame 1 on"
        if still
        else f"The velocity follows the position: from frame 1 on it is {times:.6g} times its distance "
        "from rest",
        "look for a buffer that both share, or a velocity that is made from the position",
        float(np.max(np.abs(v - slope * q))),
    )


def misfit(e: Evidence) -> Explanation:
    """The class of a map of no known scheme, and its distance from the nearest."""
    entries = e.found.entries.astype(np.float64)
    det = float(np.linalg.det(entries))
    joints = nearest([e.found], [e.terms], distinct(damped=False), range(1, 2))
    closest = min(joints, key=lambda x: distance(e.found, x.parts[0]), default=None)
    growth = (
        f"amplitudes change by {math.sqrt(abs(det)) - 1:+.2e} in each frame" if det > 0 else "areas turn over"
    )
    near, off = "", math.nan
    if closest is not None:
        off = distance(e.found, closest.parts[0])
        near = f"; the nearest, {title(closest.scheme)}, misses a frame by {off:.1e} of its size"
    kind = _class(e) or growth
    few, many = STRIDES
    none = f", but it is none of the known schemes' in up to {many} steps to a frame, or {few} with friction"
    return Explanation(
        f"{ONE_MAP}{'' if kind.startswith(MAP_OF) else none}: {kind}{near}",
        "compare the order of its stages and their coefficients with the scheme's; state the step "
        "where more of them lie between frames",
        off,
    )


def _class(e: Evidence) -> str:
    """Class of a one-step method, from its map of a spring; "" where it has none.

    A Runge-Kutta method takes (q, v) by R(h L), which is x + y L with L**2 = -w**2, so that M11 = M22 and
    M12, M21 show (h w)**2; R(i h w) - exp(i h w) is c (i h w)**n with a real c, and order n - 1. The theta
    method's (1 + (1 - theta) z)/(1 - theta z) gives a real theta.  Newmark's method has M12 = 1/(1 + beta a),
    M11 = 1 - a M12/2, M22 = 1 - gamma a M12 on (q, h v), and M21 to test it by.
    """
    if e.terms.mass_unknown or (e.terms.vague and e.record.jitter > DEEP):
        return ""
    entries = e.found.unscaled.astype(np.float64)
    (x, y), (z, u) = entries
    error = np.sqrt(np.diag(e.found.covariance))
    det, turn = x * u - y * z, -z / y if y else -1.0
    if not (det > 0 and turn > 0):
        return ""
    size = float(e.found.size[1] / e.found.size[0])
    symmetric = abs(x - u) <= SURE * math.hypot(error[0], error[3]) + 1e-14
    stated = e.stated
    room = 4 * (SURE * float(np.max(error)) * max(size, 1 / size) + 1e-14)
    with np.errstate(divide="ignore", invalid="ignore"):
        a = 2 * (1 - x) / y
        beta, gamma = (1 / y - 1) / a, (1 - u) / (a * y)
        chosen = abs(beta - np.rint(CHOSEN * beta) / CHOSEN) * a < room
    # any map that keeps areas and is symmetric is one of gamma = 1/2 on some spring, or in some mass
    other = stated is None or symmetric
    own = 0 <= beta <= 1 and (chosen or not other) and (stated is None or abs(stated - a) < room)
    if own and abs(z + a * (1 - gamma + gamma * x)) < room < AGREES * a and e.record.fine:
        return f"{MAP_OF}Newmark's method with beta = {beta:.6g}, gamma = {gamma:.6g}"
    keeps = abs(det - 1) <= SURE * float(np.max(error) * max(size, 1 / size)) + 1e-13
    growing = f"multiplies areas by 1 {det - 1:+.2e}"
    if symmetric and keeps:
        other = "or a known one whose velocities have another scale, or whose mass another value"
        return f"{UNKNOWN_METHOD} keeps areas and is symmetric in time, {other}"
    if not symmetric:
        return f"{UNKNOWN_METHOD} {'keeps areas' if keeps else growing}"
    step = math.sqrt(turn)
    if stated is not None and abs(stated / turn - 1) > AGREES:
        return ""
    w, r = 1j * step, complex(x, step * y)
    theta = (r - 1 - w) / (w * (r - 1))
    if abs(theta.imag) * turn < room < AGREES * turn and e.record.fine:
        return f"{MAP_OF}the theta method with theta = {theta.real:.6g} (implicit Euler 1, trapezoidal 1/2)"
    wrong = r - cmath.exp(1j * step)
    found = {n: wrong / (1j * step) ** n for n in ORDERS}
    real = [n for n, c in found.items() if abs(c.imag) < REAL * abs(c.real)]
    if not real:
        return f"{UNKNOWN_METHOD} {growing}"
    n = min(real, key=lambda n: abs(math.log(abs(found[n].real) * math.factorial(n))))
    should = 1 / math.factorial(n)
    return (
        f"if every step was recorded, a one-step method of order {n - 1}, whose stability function has "
        f"{should + found[n].real:.3g} z**{n} in place of {should:.3g} z**{n}"
    )


def by_parameter(e: Evidence) -> str:
    """The method with a parameter that has the map of every step; "" where there is none."""
    kind = _class(e)
    return kind.removeprefix(MAP_OF) if kind.startswith(MAP_OF) else ""


def _before(e: Evidence, steps: int) -> list[Floats]:
    """The states before each pair's own, those of `steps` together."""
    lost = np.full((len(e.states), 2), math.nan)
    return [x for i in range(1, steps) for x in np.vstack([lost[:i], e.states[: -1 - i]]).T]


REMEMBERED = TWO_STEPS, *_ = tuple(
    Cause(
        kind="is remembered", columns=partial(_before, steps=steps), remedy="",
        cause=f"Each state follows from the {states} before it, and not from one",
    )
    for steps, states in ((2, "two"), (3, "three"), (4, "four"))
)  # fmt: skip
"""Multistep maps: the next state from several."""


def _remembering(e: Evidence) -> Regression | None:
    """The multistep map of the fewest states that leaves only rounding."""
    every = (regression(e, law) for law in REMEMBERED)
    return next((x for x in every if x.exact and x.above > x.rank), None)


def lasting(e: Evidence) -> Explanation | None:
    """A multistep map whose parasitic solution does not decay.

    A disturbance of relative size d with a few frequencies obeys a multistep map to d**2, and a drive of one
    frequency obeys it exactly.  So do the few harmonics of a force that is
    not quite linear.
    """
    found = None if e.size**2 < LEFT_BY_ROUNDING * np.max(e.unit) else _remembering(e)
    if found is None or any(
        x.exact or (x.law.kind in (ANHARMONIC, OF_VELOCITY) and x.shows and FALLS * x.left < 1)
        for x in (regression(e, law) for law in LAWS)
    ):
        return None
    return Explanation(
        f"{found.law.cause}, and what is remembered does not fade: a scheme of several steps (as Milne's), "
        "or a coupled oscillator not recorded",
        "give all coordinates; a scheme of several steps whose memory lasts is not stable",
        found.left,
    )


def memory(e: Evidence) -> Explanation | None:
    """A multistep method: the two-step leapfrog, or a start-up transient, which leaves residuals of one map
    in the first frames, and not in the first pair alone."""
    size, off = np.max(np.abs(e.states[1:]), axis=1), np.max(np.abs(e.residuals), axis=1)
    if len(e.states) < FEWEST_WITH_MEMORY or np.min(size) < 1e-100 * np.max(size):
        return None
    relative, rounding = off / size, LEFT_BY_ROUNDING * float(np.max(e.unit / size))
    if np.max(relative[1:]) < rounding:
        return None
    found, twice = regression(e, TWO_STEPS), np.linalg.matrix_power(e.found.entries.astype(np.float64), 2)
    # maps that alternate have nearly the state of two steps ago in them as well, turned by two frames
    off_by = AS_IT_WAS * np.max(np.abs(twice - np.eye(2)))
    if found.exact and np.max(np.abs(found.x[-2:] - np.eye(2))) < off_by:
        return Explanation(
            "Each state is the last but one and a linear map of the last: the leapfrog of two steps, "
            "z[n+1] = z[n-1] + 2 h f(z[n]), whose even and odd frames part",
            "judge it as a scheme of two steps; a first step of second order parts them less",
            found.left,
            local=True,
        )
    # where the motion grows, a lasting disturbance falls relative to it too: its own size has to fall
    fading = relative, np.maximum(off - 8 * e.unit, 0)
    if any(x[e.pairs // 4 :].max() > FORGOTTEN * x.max() for x in fading):
        return None
    several = _remembering(e)
    follows = several.law.cause if several else "The first frames follow another map than those after them"
    found = several or found
    # the first frames alone show the other map, but for which all follow one
    later = fit(e.record, e.j, kept=np.arange(e.pairs) >= e.pairs // 2)
    start = np.max(np.abs(later.residuals()), axis=1)
    before, weighted = (float(np.max(x[1:])) for x in (start / size, e.weight * start))
    last = int(np.max(np.flatnonzero(start > 8 * e.unit), initial=-1)) + 1
    # a force that is not linear fades where the motion does, down to no map at all
    lasts = several is None and last > e.pairs // 2
    forced = abs(float(later.entries[1, 0])) >= SURE * math.sqrt(later.covariance[2, 2])
    if lasts or not forced or before < rounding or weighted < FALLS * found.worst:
        return None
    goes_on = later.z[last] - np.linalg.matrix_power(later.entries, last) @ later.z[0]
    if np.max(np.abs(goes_on)) < AS_BEFORE * np.max(start):
        # frames between are written wrongly: what is remembered would have moved those that follow
        return None
    whose = either(_remembered(e, later))
    kind = "several steps or with an acceleration of its own (Adams, BDF, generalised alpha, Gear)"
    # what fades may be a force that is not linear, where no multistep map explains it
    other = "" if whose or several else ", or a force that is not linear where the motion is largest"
    return Explanation(
        f"{follows}: a scheme with memory, of {whose or kind}{other}, whose start differs from one map by "
        f"{before:.1e} of the state's size",
        "leave the first frames out, and judge it as a scheme of as many steps",
        found.worst / weighted,
        local=found.exact,
    )


def _many_steps(*rows: Floats) -> Floats:
    """Map of (q, v h) of a linear multistep method, after its start-up transient: by the root nearest to
    exp(z) of the sum of its polynomials (rho, -sigma, a corrector's) times 1, z, z**2; x is (h w)**2."""
    *polynomials, x = rows
    z = 1j * math.sqrt(max(x[0], 1e-300))
    roots = np.roots(sum(z**i * row for i, row in enumerate(polynomials)))
    r = roots[np.argmin(np.abs(roots - np.exp(z)))]
    return np.array([r.real, r.imag / z.imag, -z.imag * r.imag, r.real])


def _adams(*sigma: int, corrector: tuple[int, ...] = ()) -> Callable[[Floats], Floats]:
    """Adams' method of these weights over their sum, the newest first; or a corrector's predictor (PECE)."""
    weights, last = np.array(sigma) / sum(sigma), np.eye(len(sigma))[1]
    rho = np.eye(len(sigma))[0] - last
    if not corrector:
        return partial(_many_steps, rho, -weights)
    new, *old = np.pad(corrector, (0, len(sigma) - len(corrector))) / sum(corrector)
    return partial(_many_steps, rho, -new * last - [0, *old], -new * weights)


def _generalised(shares: Callable[[float], tuple[float, float]], x: Floats) -> Floats:
    """Map of the generalised alpha method (Chung & Hulbert, J. Appl. Mech. 60 (1993) 371), of second order
    and least damping, by its alpha_m and alpha_f as functions of the parameter x[1]; x[0] is (h w)**2."""
    a, (m, f) = x[0], shares(x[1])
    gamma, beta = 0.5 - m + f, (1 - m + f) ** 2 / 4
    whole = 1 - m + (1 - f) * a * beta
    last = -np.array([a, (1 - f) * a, m + (1 - f) * a * (0.5 - beta)]) / whole
    rows = np.array([[1, 1, 0.5 - beta], [0, 1, 1 - gamma], [0, 0, 0]]) + np.outer([beta, gamma, 1], last)
    if not np.all(np.isfinite(rows)):
        return np.full(4, np.inf)
    values, left = np.linalg.eig(rows.T)
    # the acceleration that is left once the third motion has died
    dead = left[:, np.argmin(np.abs(values))].real
    return (rows[:2, :2] - np.outer(rows[:2, 2], dead[:2] / dead[2])).ravel()


WITH_MEMORY: dict[str, Callable[[Floats], Floats]] = {
    "second order, Adams-Bashforth (AB2)": _adams(0, 3, -1),
    "third order, Adams-Bashforth (AB3)": _adams(0, 23, -16, 5),
    "fourth order, Adams-Bashforth (AB4)": _adams(0, 55, -59, 37, -9),
    "third order, Adams-Moulton": _adams(5, 8, -1),
    "fourth order, Adams-Moulton": _adams(9, 19, -5, 1),
    "second order, Adams-Bashforth-Moulton (PECE)": _adams(0, 3, -1, corrector=(1, 1)),
    "third order, Adams-Bashforth-Moulton (PECE)": _adams(0, 23, -16, 5, corrector=(5, 8, -1)),
    "fourth order, Adams-Bashforth-Moulton (PECE)": _adams(0, 55, -59, 37, -9, corrector=(9, 19, -5, 1)),
    "second order, BDF2": partial(_many_steps, np.array([3, -4, 1]), np.array([-2, 0, 0])),
    "third order, BDF3": partial(_many_steps, np.array([11, -18, 9, -2]), np.array([-6, 0, 0, 0])),
    "second order, HHT with alpha = -{:.6g}": partial(_generalised, lambda x: (0.0, x)),
    "second order, generalised alpha with rho_infinity = {:.6g}": partial(
        _generalised, lambda x: ((2 * x - 1) / (x + 1), x / (x + 1))
    ),
    "second order, WBZ with alpha_m = -{:.6g}": partial(_generalised, lambda x: (-x, 0.0)),
}
"""Maps of multistep and generalised alpha methods after the start-up transient, by order and name."""

DIGITS = 9
"""Decimals to which a parameter is rounded."""

PARAMETERS = 0.05, 0.3, 0.6, 0.9
"""Starting values of a parameter's fit."""

NO_METHOD = 1e100
"""Residual of parameters at which a method has no map."""


@np.errstate(all="ignore")
def _remembered(e: Evidence, found: Map) -> list[str]:
    """Methods of `WITH_MEMORY` that have the map of the frames after the start-up transient."""
    from scipy.optimize import least_squares

    entries, error = found.unscaled.astype(np.float64).ravel(), np.sqrt(np.diag(found.covariance))
    turn, stated, out = -entries[2] / entries[1] if entries[1] else -1.0, e.stated, []
    if e.terms.mass_unknown or not e.record.fine or turn <= 0 or e.record.jitter > DEEP:
        return []
    ratio = float(found.size[1] / found.size[0])
    error = SURE * error * [1, 1 / ratio, ratio, 1] + 1e-14
    for name, entries_of in WITH_MEMORY.items():

        def left(x: Floats, of: Callable[[Floats], Floats] = entries_of) -> Floats:
            # not finite beyond the parameters that a scheme can have
            off = (of(np.array([turn, 1.0])[: len(x)] * x) - entries) / error
            return np.nan_to_num(off, nan=NO_METHOD, posinf=NO_METHOD, neginf=-NO_METHOD)

        for start in [[1.0, y] for y in PARAMETERS] if "{" in name else [[1.0]]:
            best = least_squares(left, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
            other = stated is not None and abs(best.x[0] * turn - stated) > AGREES * abs(stated)
            if np.max(np.abs(best.fun)) > 1 or other:
                continue
            known = [round(float(y), DIGITS) + 0.0 for y in best.x[1:]]
            if all(0 <= y <= 1 for y in known):
                out.append(name.format(*known))
                break
    return out
