"""Checks of laws that show only over many runs: order, rounding over long times, tolerance.

Order is fitted on the spring and on a quartic potential: on the spring alone it can mislead.  A scheme's
error is C h**r (1 + c h + ...), the second term c h**2 where the scheme is symmetric; both are fitted, so
that the residual gives the error of the slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.checks.bench import Bench
from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check
from springcheck.checks.stats import line, student
from springcheck.physics import exact
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic
from springcheck.physics.trajectory import Limits, Trajectory

HALVINGS = 6
CHANCE = 1e-3
"""Probability with which a right order or exponent may be refused, by Student's t, two-sided."""
UNRESOLVED = 0.125
"""Orders are whole numbers; a slope with an uncertainty above an eighth does not determine one."""
COARSEST = 16
"""Steps of the coarsest run over 2.5 radians: h w = 0.16, where the second term of the error is small."""

MEMBERS = 256
LONG = 4096
SIGMAS = 5.0
"""Standard deviations that a normal variable exceeds by chance once in 1.7 million."""

DECADES = tuple(10.0**-d for d in range(4, 13))


# values far from 1, so that no mass, stiffness or coefficient can hide
_GRID: dict[str, Any] = {"step": 1.0, "steps": 1, "quantities": ("q", "p"), "name": "experiment"}
SPRING = spring(m=3.7, k=2.9, q=0.3, p=0.7, title="", **_GRID)
WELL = Scene(m=[1.3], q=[0.9], p=[0.4], terms=(Quartic(i=[0], b=2.3, at=0.0),), **_GRID)  # type: ignore[arg-type]
DURATION = 2.5 / np.sqrt(2.9 / 3.7)


@check("order", family="law", requires={"one-step"})
def order(bench: Bench) -> Finding | str:
    """On a spring the error falls with the scheme's order."""
    return _order(bench, SPRING, "spring")


@check("order, quartic", family="law", requires={"one-step"})
def order_anharmonic(bench: Bench) -> Finding | str:
    """In a quartic potential, where errors do not cancel, the error falls with the scheme's order."""
    return _order(bench, WELL, "quartic potential")


def _order(bench: Bench, scene: Scene, where: str) -> Finding | str:
    scheme = bench.scheme
    truth = exact_end(where)
    norm = scene.system.norm
    h, error, floor = [], [], []
    for j in range(HALVINGS):
        steps = COARSEST * 2**j
        made = replace(scene, step=float(DURATION / steps), steps=steps, every=steps)
        run = bench.run(made, bench.label)
        if len(run.t) < 2:
            return Finding(np.inf, UNRESOLVED, "orders", f"stopped at h = {made.step:g}")
        case = Case(trajectory=run, scene=made)
        h.append(made.step)
        error.append(float(norm(run.q[-1] - truth[0], run.p[-1] - truth[1])))
        floor.append(float(norm(*(x[0] for x in case.allowance))) * steps)
    slope, se, rounding = fitted(h, error, floor, second=2 if scheme.has("reversible") else 1)
    bound = min(student(HALVINGS - 3, CHANCE) * se + rounding, UNRESOLVED)
    seen = f"slope {slope:.5f} +- {se:.1g} on the {where}, h from {h[0]:.3g} to {h[-1]:.3g}"
    why = f"{seen}; {scheme.title} has order {scheme.order}"
    return Finding(abs(slope - scheme.order), bound, "orders", why, Limits(order=bound))


def fitted(
    h: Sequence[float], error: Sequence[float], floor: Sequence[float], *, second: int
) -> tuple[float, float, float]:
    """Signed slope of log error on log h, with a term h**second: slope, standard error, and what errors
    of the size of `floor` can do to it."""
    x, size = np.array(h), np.maximum(np.array(error), 1e-300)
    fit = line(np.log(x), np.log(size), x**second)
    return fit.slope, fit.standard_error, float(np.sum(np.abs(fit.leverage) * np.array(floor) / size))


@cache
def exact_end(where: str) -> tuple[Extended, Extended]:
    """Exact state of the spring or of the quartic potential after `DURATION`, (n,) and (n,)."""
    if where == "spring":
        q, p = exact.true_motion(replace(SPRING, step=DURATION), np.array([1]), DURATION)
        return q[0], p[0]
    return extrapolated(WELL, DURATION)


def extrapolated(scene: Scene, duration: float) -> tuple[Extended, Extended]:
    """The state of any scene without friction after a time, in extended precision: (n,) and (n,).

    Velocity Verlet with 24, 48, 72 ... steps; its error has even powers of the step alone, and
    Neville's scheme removes one with each level (Gragg 1965; Hairer, Norsett & Wanner,
    Solving Ordinary Differential Equations I, II.8 and II.9).
    """
    force = scene.system.force
    rows: list[tuple[Extended, Extended]] = []
    counts = [24 * (j + 1) for j in range(7)]
    for count in counts:
        q, p = scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)
        h = np.longdouble(duration) / count
        for _ in range(count):
            a, b = schemes.step(schemes.SCHEMES["velocity-verlet"], q, p, h=h, m=scene.m, force=force)
            q, p = np.asarray(a, np.longdouble), np.asarray(b, np.longdouble)
        rows.append((q, p))
    for level in range(1, len(counts)):
        for j in range(len(counts) - 1, level - 1, -1):
            ratio = (np.longdouble(counts[j]) / counts[j - level]) ** 2 - 1
            fine, coarse = rows[j], rows[j - 1]
            rows[j] = (fine[0] + (fine[0] - coarse[0]) / ratio, fine[1] + (fine[1] - coarse[1]) / ratio)
    return rows[-1]


@cache
def ensemble(h: float) -> Scene:
    """256 equal springs with random starts, so that the random walks of their rounding are independent."""
    rng = np.random.default_rng(20260101)
    amplitude, phase = rng.uniform(1, 2, MEMBERS), rng.uniform(0, 2 * np.pi, MEMBERS)
    q, p = amplitude * np.cos(phase), amplitude * np.sin(phase) * np.sqrt(3.7 * 2.9)
    grid = _GRID | {"step": h, "steps": LONG, "every": LONG // 64}
    return spring(m=3.7, k=2.9, q=q, p=p, title="", **grid)


ODD, EVEN = 0.013, 2.0**-7
"""A step whose reciprocal rounds, h fl(1/h) = 1 - 8.9e-17, and one whose reciprocal is exact."""


def drifts(scene: Scene, run: Trajectory) -> tuple[Floats, Floats]:
    """Steps (f,) and relative change of each member's shadow energy at them (f, n)."""
    case = Case(trajectory=run, scene=scene)
    form = schemes.invariant(case.law.propagator, h=run.step)
    y, v = case.system.modes.into(run.q, run.p)
    energy = form[:, 0] * y * y + form[:, 1] * y * v + form[:, 2] * v * v
    return case.steps[1:].astype(np.float64), np.asarray(energy[1:] / energy[0] - 1, np.float64)


def predicted_drift(run: Trajectory) -> float:
    """Relative change of the shadow energy each step that a method's arithmetic implies.

    A velocity rebuilt as (x' - x) fl(1/h) is multiplied by h fl(1/h) at every step: a friction, or its
    opposite, of one rounding.  Half of the energy is kinetic on average, and it goes with the square.
    """
    if not run.rebuilds_velocity:
        return 0.0
    h = np.longdouble(run.step)
    return float(h * np.longdouble(1.0 / run.step) - 1)


WALK = frozenset({"one-step", "splitting", "symplectic", "double"})
"""Traits of schemes that conserve a shadow energy up to a random walk of its roundings."""


@check("bias", family="law", requires=WALK)
def rounding_bias(bench: Bench) -> Finding | str:
    """The shadow energy drifts no more than the stated arithmetic implies."""
    if any(_is_short(bench, h) for h in (ODD, EVEN)):
        return Finding(np.inf, 0.0, "per step", SHORT)
    found = [_drift(bench, h) for h in (ODD, EVEN)]
    off = np.array([abs(mean - implied) for mean, _, implied in found])
    limit = np.array([SIGMAS * se + exact.EPS for _, se, _ in found])
    # the first that is no number, or else the worse
    worst = int(np.argmax(off / limit))
    if np.all(off <= limit) and np.max(limit) >= (most := schemes.roundings(bench.scheme) * 2.0**-52):
        return f"rounding noise would hide even the largest bias, {most:.1e} per step"
    seen = "; ".join(
        f"at h = {h:.6g} the drift is {mean:.1e} +- {se:.0e} per step, implied is {implied:.1e}"
        for h, (mean, se, implied) in zip((ODD, EVEN), found, strict=True)
    )
    if limit[worst] < off[worst] <= ROUNDED_MATRIX:
        seen += "; a one-step matrix whose elements are rounded drifts by as much"
    why = f"{SIGMAS:g} standard errors over {MEMBERS} springs and {LONG} steps; {seen}"
    # momenta times 1 + x at each step raise the energy by x of it: half of it is kinetic, and squared
    return Finding(off[worst], limit[worst], "per step", why, Limits(area=float(np.min(limit))))


SHORT = "a run of it ended early"

ROUNDED_MATRIX = 2.0**-52
"""Largest error of the determinant of a one-step matrix near 1 whose elements are rounded."""


def _is_short(bench: Bench, h: float) -> bool:
    return len(bench.once(ensemble(h)).t) < ensemble(h).frames


def _drift(bench: Bench, h: float) -> tuple[float, float, float]:
    """Mean relative drift of the shadow energy per step, its standard error, and what is implied."""
    run = bench.once(ensemble(h))
    steps, change = drifts(ensemble(h), run)
    each = change[-1] / steps[-1]
    se = float(np.std(each, ddof=1) / np.sqrt(MEMBERS))
    return float(np.mean(each)), se, predicted_drift(run)


@check("growth", family="law", requires=WALK)
def rounding_growth(bench: Bench) -> Finding | str:
    """The rounding error of the shadow energy grows as a random walk, with the square root of the steps."""
    scene = ensemble(ODD)
    run = bench.once(scene)
    if _is_short(bench, ODD):
        return Finding(np.inf, 0.0, "exponent", SHORT)
    steps, change = drifts(scene, run)
    change = change - predicted_drift(run) * steps[:, None]
    slope, se = _growth(steps, change)
    if slope <= 0.5 + SIGMAS * se and 0.5 + SIGMAS * se >= 1:
        return f"an exponent of {slope:.3f} +- {se:.3f} does not separate a random walk from a bias"
    seen = f"{slope:.3f} +- {se:.3f} by the jackknife, {MEMBERS} springs, {LONG} steps of {ODD:g}"
    why = f"rounding errors that walk at random have 1/2, a bias 1; {seen}"
    return Finding(slope, 0.5 + SIGMAS * se, "exponent", why, Limits(area=_seen_bias(steps, change)))


def _growth(steps: Floats, change: Floats) -> tuple[float, float]:
    """Exponent with which changes (f, members) grow with the steps (f,), and its standard error by the
    jackknife."""
    late = np.array([1, 2, 4, 8, 16, 32, 64]) - 1

    def exponent(squares: Floats) -> float:
        size = np.sqrt(np.mean(squares, axis=1))
        if not np.all(np.isfinite(size)):
            return float("nan")
        if np.any(size == 0):
            return 0.0
        return line(np.log(steps[late]), np.log(size)).slope

    squares = change[late] ** 2
    blocks = np.array_split(np.arange(MEMBERS), 16)
    left = np.array([exponent(np.delete(squares, block, axis=1)) for block in blocks])
    return exponent(squares), float(np.sqrt((len(left) - 1) * np.mean((left - np.mean(left)) ** 2)))


def _seen_bias(steps: Floats, change: Floats) -> float | None:
    """The least bias a step, to a tenth of a decade, of either sign, that raises a walk's exponent beyond its
    bound."""
    for bias in 10.0 ** np.arange(-20, -10, 0.1):
        found = (_growth(steps, change + sign * bias * steps[:, None]) for sign in (1, -1))
        if all(slope > 0.5 + SIGMAS * se for slope, se in found):
            return float(bias)
    return None


@check("tolerance", family="law", requires={"tolerance", "convergence"})
def convergence(bench: Bench) -> Finding | str:
    """The error of an adaptive solver falls with its tolerance, decade by decade."""
    power = bench.scheme.convergence
    assert power is not None
    duration = 20.0
    error = []
    for tolerance in DECADES:
        scene = replace(SPRING, tolerance=tolerance, step=duration / 40, steps=40, quantities=("q", "p"))
        run = bench.run(scene, bench.label)
        if len(run.t) < scene.frames:
            return Finding(np.inf, UNRESOLVED, "", f"stopped at {tolerance:g}")
        case = Case(trajectory=run, scene=scene)
        q, p = exact.true_motion(scene, case.steps, scene.step)
        error.append(float(np.sqrt(np.mean(case.system.norm(run.q - q, run.p - p) ** 2))))
    fit = line(np.log(np.array(DECADES)), np.log(np.maximum(np.array(error), 1e-300)))
    slope, se, law = fit.slope, fit.standard_error, float(power)
    bound = student(len(error) - 2, CHANCE) * se
    if abs(slope - law) <= bound and bound >= law:
        return f"an exponent of {slope:.3f} +- {se:.2g} is too uncertain to test the law"
    why = (
        f"exponent {slope:.3f} +- {se:.2g} over {len(error)} decades of tolerance; {bench.scheme.title} "
        f"has {power}: the error of one step of its highest order, times the number of steps"
    )
    return Finding(abs(slope - law), bound, "exponent", why, Limits(order=bound))
