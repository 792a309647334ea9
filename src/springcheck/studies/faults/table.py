"""The faults, a row each.  Most are bugs that integrators have shipped with.

The sized ones are relative errors; the smallest size that a check still sees is its detection limit.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck import schemes
from springcheck.physics import exact
from springcheck.physics.arrays import Arithmetic, Floats, Reals
from springcheck.physics.trajectory import Outcome, Trajectory
from springcheck.studies.faults.heat import OF_NOISE, THERMAL_STEPS
from springcheck.studies.faults.seeded import (
    FRAME_CHECKS,
    Case,
    Fault,
    braked,
    each,
    half_step,
    shifted,
    single,
)
from springcheck.studies.faults.space import AXES, DRIVES
from springcheck.studies.faults.steppers import State, Step, energies, record, textbook, trajectory

STEP = ("step-defect", "propagator")
MOTION = ("step-defect", "closed-form", "frequency", "propagator")
KEPT = ("step-defect", "shadow-energy", "determinant", "symplecticity")

PARAMETERS = (
    *each(
        Fault("stiffness", "every spring is too stiff", moves=lambda c: c.scene.system.scaled(1 + c.x)),
        Fault("mass", "every mass is too large", moves=lambda c: replace(c.scene, m=c.scene.m * (1 + c.x))),
        Fault("step", "every step is too long",
              moves=lambda c: replace(c.scene, step=c.scene.step * (1 + c.x))),
        Fault("rest", "rest points are moved, relative to the amplitude", STEP,
              moves=lambda c: shifted(c.scene, c.x)),
        Fault("start-momentum", "the initial momenta are too large",
              ("start", "closed-form", "shadow-energy"),
              moves=lambda c: replace(c.scene, p=c.scene.p * (1 + c.x))),
        Fault("start-position",
              "the initial positions are too large, and row 0 is reported as it was asked for", FRAME_CHECKS,
              moves=lambda c: replace(c.scene, q=c.scene.q * (1 + c.x)),
              reports=lambda c, r: replace(r, q=np.vstack([c.scene.q, r.q[1:]]))),
        caught_by=MOTION, size=1e-12,
    ),
    Fault("kcal", "kJ per kcal written 4.814 for 4.184", (*MOTION, "order"),
          moves=lambda c: c.scene.system.scaled(4.814 / 4.184)),
    Fault("time-unit", "time unit 48.89 for 48.88821 (fs in units of A, u and kcal/mol)", MOTION,
          moves=lambda c: replace(c.scene, step=c.scene.step * 48.89 / 48.88821)),
    Fault("stiffness-in-single", "stiffness kept in single precision: 2.9 becomes 2.9000000954", STEP,
          moves=lambda c: c.scene.system.in_single),
    Fault("unsigned-step", "the size of the step is taken: backward runs go forward", ("mirror",),
          moves=lambda c: replace(c.scene, step=abs(c.scene.step))),
)  # fmt: skip


def unpaired(c: Case, f: Reals, q: Reals, p: Reals) -> Reals:
    """Force of springs that is too large on their second particle."""
    for term in c.scene.terms:
        if term.kind == "potential":
            np.subtract.at(f, term.particles[-1], c.x * term.pull(q))
    return f


def stale(c: Case, f: Reals, q: Reals, p: Reals) -> Reals:
    """The force comes from a buffer one step old."""
    c.kept.append(f)
    return c.kept.pop(0) if len(c.kept) > 1 else f


FORCES = each(
    Fault("friction", "momenta lose a fraction at every step", (*KEPT, "rounding-bias"),
          after=braked, size=1e-12),
    Fault("heating", "positions gain a fraction at every step", (*KEPT, "rounding-bias"),
          after=lambda c, i, q, p: (q * (1 + c.x), p), size=1e-12),
    Fault("constant-force", "a constant force, in units of the largest at the start",
          force=lambda c, f, q, p: f + c.x * c.largest, size=1e-12),
    Fault("anharmonic", "springs stiffen with the square of their stretch",
          force=lambda c, f, q, p: f * (1 + c.x * (f / c.largest) ** 2), size=1e-12),
    Fault("action-not-reaction", "the force of a spring on its second particle is too large",
          ("step-defect", "momentum"), force=unpaired, size=1e-12, scene="chain"),
    Fault("fixed-point-force", "undeclared fixed-point force, a fraction of the largest at the start",
          force=lambda c, f, q, p: np.trunc(f / (c.x * c.largest)) * (c.x * c.largest), size=2.0**-32),
    Fault("small-forces-dropped", "forces below a fraction of the largest are taken for none",
          ("step-defect",), force=lambda c, f, q, p: np.where(np.abs(f) < c.x * c.largest, 0.0, f), size=1e-3,
          scene="long spring"),
    Fault("capped-force", "forces are cut off at 0.9 of the largest at the start", FRAME_CHECKS,
          force=lambda c, f, q, p: np.clip(f, -0.9 * c.largest, 0.9 * c.largest)),
    Fault("single-force", "forces in single precision", force=lambda c, f, q, p: single(f)),
    Fault("stale-force", "forces come from a buffer one step old", FRAME_CHECKS,
          force=stale, scheme="semi-implicit-euler"),
    caught_by=STEP,
)  # fmt: skip


def verlet(
    c: Case, q: Floats, p: Floats, *, mass: float | None = None, first: float = 0.5, second: float = 0.5,
    old: bool = False,
) -> State:  # fmt: skip
    """Velocity Verlet with other coefficients, another mass in its drift, or the old force in its second
    kick."""
    h, m, f = c.scene.step, mass or c.scene.m, c.force(q, p)
    p = p + first * h * f
    q = q + h * (p / m)
    return q, np.asarray(p + second * h * (f if old else c.force(q, p)), np.float64)


def swapped_halves(c: Case, i: int, q: Floats, p: Floats) -> State:
    """Velocity Verlet in its position form, with h/2 in place of h*h/2."""
    h, m, f = c.scene.step, c.scene.m, c.force(q, p)
    q = np.asarray(q + h * (p / m) + h / 2 * (f / m), np.float64)
    return q, np.asarray(p + h / 2 * (f + c.force(q, p)), np.float64)


def one_iteration(c: Case, i: int, q: Floats, p: Floats) -> State:
    """Implicit Euler by one fixed-point iteration, so that its equation is not solved."""
    h, m = c.scene.step, c.scene.m
    p = np.asarray(p + h * c.force(q + h * (p / m), p), np.float64)
    return q + h * (p / m), p


def coefficient(c: Case, size: float) -> Step:
    """A splitting whose second coefficient is wrong in a digit."""
    (a, x), (b, y), *rest = c.scheme.stages
    wrong = str(np.longdouble(schemes.number(y, np.longdouble)) * (1 + np.longdouble(size)))
    return textbook(c.scene, replace(c.scheme, stages=((a, x), (b, wrong), *rest)))


def last_of_1000(i: int) -> bool:
    """Whether a step is the last of a thousand."""
    return i % 1000 == 999


def rescaled(c: Case, i: int, q: Floats, p: Floats) -> State:
    """A thermostat left on: momenta are rescaled to the initial energy."""
    system = c.scene.system
    kinetic = system.kinetic_energy(p)
    wanted = system.energy(c.scene.q, c.scene.p) - (system.energy(q, p) - kinetic)
    return (q, p * float(np.sqrt(wanted / kinetic))) if kinetic > 0 and wanted > 0 else (q, p)


def significant(x: Floats, size: float) -> Floats:
    """Round to a relative spacing, as text of so many digits does."""
    with np.errstate(divide="ignore"):
        unit = np.where(x == 0, 1, 10 ** np.floor(np.log10(np.abs(np.where(x == 0, 1, x))))) * size
    return np.asarray(np.round(x / unit) * unit)


STEPS = (
    Fault("unequal-half-kicks", "the first half kick is too large, the second too small", STEP,
          step=lambda c, i, q, p: verlet(c, q, p, first=0.5 * (1 + c.x), second=0.5 * (1 - c.x)),
          size=1e-12),
    Fault("coefficient", "the second coefficient of a fourth-order splitting is wrong", ("step-defect",),
          textbook=lambda c: coefficient(c, c.x), size=1e-12, scheme="forest-ruth"),
    Fault("coefficient-digits", "the same, as if typed with eight digits: fourth order in name", STEP,
          textbook=lambda c: coefficient(c, 3e-9), scheme="yoshida4"),
    Fault("explicit-for-semi-implicit", "a symplectic Euler that is explicit",
          ("step-defect", "determinant", "symplecticity", "shadow-energy", "reversibility"),
          runs="explicit-euler", scheme="semi-implicit-euler"),
    Fault("drift-kick-for-kick-drift", "drift and kick in the other order", (*STEP, "shadow-energy"),
          runs="semi-implicit-euler-drift-kick", scheme="semi-implicit-euler"),
    Fault("first-order", "velocity Verlet in name, semi-implicit Euler in fact",
          (*STEP, "order", "order-anharmonic"), runs="semi-implicit-euler"),
    Fault("position-for-velocity-verlet",
          "position Verlet under the name of velocity Verlet: same order, same frequency",
          (*STEP, "shadow-energy"), runs="position-verlet"),
    Fault("one-iteration", "implicit Euler by one iteration instead of a solution", (*STEP, "determinant"),
          step=one_iteration, scheme="implicit-euler"),
    Fault("momentum-for-velocity", "dq/dt = p; a mass of 1 hides it", (*MOTION, "order"),
          step=lambda c, i, q, p: verlet(c, q, p, mass=1.0)),
    Fault("swapped-halves", "h/2 where h*h/2 belongs", ("step-defect", "determinant", "order"),
          step=swapped_halves),
    Fault("lost-half", "0*5 for 0.5: the first half kick is none", ("step-defect", "frequency", "order"),
          step=lambda c, i, q, p: verlet(c, q, p, first=0.0)),
    Fault("old-second-kick", "the second half kick uses the force of the first",
          ("step-defect", "determinant", "shadow-energy", "order", "order-anharmonic"),
          step=lambda c, i, q, p: verlet(c, q, p, old=True)),
    Fault("skipped-step", "every 1000th step is left out", ("step-defect", "frequency"),
          step=lambda c, i, q, p: (q, p) if last_of_1000(i) else c.right(i, q, p), scene="long spring"),
    Fault("doubled-step", "every 1000th step is taken twice", ("step-defect", "frequency"),
          after=lambda c, i, q, p: c.right(i, q, p) if last_of_1000(i) else (q, p), scene="long spring"),
    Fault("thermostat", "momenta are scaled at every step so that the energy stays",
          ("step-defect", "determinant", "reversibility"), after=rescaled),
    Fault("centre-of-mass-removal", "the total momentum is taken away every tenth step", FRAME_CHECKS,
          after=lambda c, i, q, p: (
              q, p - (i % 10 == 9) * c.scene.m / np.sum(c.scene.m) * np.sum(p))),
    Fault("restart", "one restart, half way, from text rounded to a relative spacing", FRAME_CHECKS,
          after=lambda c, i, q, p: (
              (q, p) if i != c.scene.steps // 2 else (significant(q, c.x), significant(p, c.x))), size=1e-7),
)  # fmt: skip


def towards_zero(c: Case, i: int, q: Floats, p: Floats) -> State:
    """A step rounded towards zero: no result is off by more than one unit in the last place."""
    start = q.astype(np.longdouble), p.astype(np.longdouble)
    wide = schemes.step(c.scheme, *start, h=c.scene.step, m=c.scene.m, force=c.force)
    near = [np.asarray(x, np.float64) for x in wide]
    a, b = (np.where(np.abs(y) > np.abs(x), np.nextafter(y, 0), y) for x, y in zip(wide, near, strict=True))
    return a, b


ARITHMETIC = (
    Fault("single-state", "positions and momenta kept in single precision", STEP,
          after=lambda c, i, q, p: (single(q), single(p))),
    Fault("decimal-state", "momenta rounded to a decimal spacing at every step", STEP,
          after=lambda c, i, q, p: (q, significant(p, c.x)), size=1e-9),
    Fault("cut-off", "every result is cut off instead of rounded: no step is off by more than one rounding",
          ("rounding-bias", "rounding-growth"), step=towards_zero),
    Fault("noise", "noise in the momenta: no two runs are equal", ("step-defect", "repeatability"),
          after=lambda c, i, q, p: (
              q, p * (1 + c.x * np.random.default_rng().standard_normal(len(p)))), size=1e-12),
    Fault("single-in-name", "says single precision and computes in double", ("arithmetic",),
          reports=lambda c, r: replace(
              r, arithmetic=Arithmetic(name="single", state=2.0**-24, force=2.0**-24))),
)  # fmt: skip


def kept_force(c: Case, f: Reals, q: Reals, p: Reals) -> Reals:
    """Reuse the force while no position has moved by more than a fraction of the largest initial one."""
    if not c.kept or np.max(np.abs(q - c.kept[0])) > c.x * float(np.max(np.abs(c.scene.q))):
        c.kept[:] = [q, f]
    return np.asarray(c.kept[1])


def swapped_frames(c: Case, r: Trajectory) -> Trajectory:
    """Exchange the two frames in the middle."""
    order = np.arange(len(r.t))
    middle = slice(len(order) // 2, len(order) // 2 + 2)
    order[middle] = order[middle][::-1]
    return replace(r, q=r.q[order], p=r.p[order])


def given_up(c: Case, r: Trajectory) -> Trajectory:
    """End the run half-way."""
    half = slice(len(r.t) // 2)
    return replace(r.at(half), outcome=Outcome(status="stopped", step=(half.stop - 1) * r.every))


REPORTS = (
    Fault("early-momenta", "momenta of half a step before, reported as synchronised",
          ("step-defect", "shadow-energy"), reports=lambda c, r: half_step(c, -1, r)),
    Fault("late-momenta", "momenta of half a step after, reported as synchronised",
          ("step-defect", "shadow-energy"), reports=lambda c, r: half_step(c, 1, r)),
    Fault("delayed-momenta", "momenta one frame behind the positions", FRAME_CHECKS,
          reports=lambda c, r: replace(r, p=np.concatenate([r.p[:1], r.p[:-1]]))),
    Fault("late-start", "the first frame is the state after the first step", ("start", "closed-form"),
          lambda c: record(c.scene, c.scheme, c.right, start=c.right(0, c.scene.q, c.scene.p))),
    Fault("swapped-frames", "two frames have changed places", FRAME_CHECKS, reports=swapped_frames),
    Fault("length-unit", "positions are reported too large", ("start", *FRAME_CHECKS),
          reports=lambda c, r: replace(r, q=r.q * (1 + c.x)), size=1e-12),
    Fault("single-file", "states are written in single precision", ("step-defect",),
          reports=lambda c, r: replace(r, q=single(r.q), p=single(r.p))),
    Fault("text-file", "states are written with so many digits", FRAME_CHECKS,
          reports=lambda c, r: replace(r, q=significant(r.q, c.x), p=significant(r.p, c.x)), size=1e-9),
    Fault("accumulated-time", "times are summed up step by step", ("times",), reports=lambda c, r: replace(
        r, t=np.concatenate([[0.0], np.cumsum(np.full(len(r.t) - 1, r.step * r.every))]))),
    Fault("time-stamps", "times are stamped too late", ("times",),
          reports=lambda c, r: replace(r, t=r.t * (1 + c.x)), size=1e-12),
    Fault("half-step-energy", "energies are computed from momenta half a step early", ("energies",),
          reports=lambda c, r: replace(r, energy=energies(
              c.scene, r.q, np.asarray(r.p - c.scene.step / 2 * c.force(r.q, r.p), np.float64)))),
    Fault("kept-force", "forces are kept while no position moves by more than a part of its start",
          ("step-defect", "company"), force=kept_force, size=0.01),
    Fault("off-axis", "particles leave their line", ("line",),
          reports=lambda c, r: replace(r, off_axis=c.x), size=1e-12),
    Fault("gives-up", "half of the frames, and no reason why the run has stopped there", ("grid",),
          reports=given_up),
)  # fmt: skip


def slow_time(c: Case, part: float) -> Trajectory:
    """The exact solution with its time scaled down by this part."""
    steps = np.arange(c.scene.frames) * c.scene.every
    q, p = (np.asarray(x, np.float64) for x in exact.true_motion(c.scene, steps, c.scene.step * (1 - part)))
    return trajectory(c.scene, c.scheme, q, p, tolerance=c.scene.tolerance, calls=2 * c.scene.steps)


ADAPTIVE = (
    Fault("deaf-to-tolerance", "an adaptive solver whose error does not follow its tolerance",
          ("convergence", "tolerance"), lambda c: slow_time(c, c.x), size=1e-9, scheme="adams"),
    Fault("loose-tolerance", "an adaptive solver that multiplies its tolerance",
          ("tolerance",), lambda c: slow_time(c, c.x * c.scene.tolerance), size=1e6, scheme="bdf"),
)  # fmt: skip

FAULTS: tuple[Fault, ...] = (
    *PARAMETERS, *FORCES, *STEPS, *ARITHMETIC, *REPORTS, *AXES, *DRIVES, *ADAPTIVE,
    *OF_NOISE, *THERMAL_STEPS,
)  # fmt: skip
