"""The negative controls, a row each: a fault, its scene, and the checks that must reject it.

Most are bugs that integrators have shipped with.  The sized ones are relative errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

import bathed as baths
from bathed import by, forgetting, heavy, of_rank, played
from springcheck import schemes
from springcheck.bath import THERMOSTATS
from springcheck.bath.catalogue import HALF, ONE, Act
from springcheck.physics import exact
from springcheck.physics.arrays import Arithmetic, Floats, Reals
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Drive, Spring
from springcheck.physics.trajectory import Outcome, Trajectory
from textbook import (
    FRAME_CHECKS,
    Case,
    Fault,
    State,
    Step,
    braked,
    each,
    energies,
    half_step,
    record,
    shifted,
    single,
    textbook,
    trajectory,
)


def alone(**other: Any) -> Scene:
    """One mass on a spring."""
    return spring(**{"m": 3.7, "k": 2.9, "q": 0.3, "p": 0.7, "title": "", **other})


DRIVE = Drive(i=np.array([0]), amplitude=np.array([0.43]), frequency=np.array([0.87]), phase=np.array([0.6]))

SCENES: Mapping[str, Callable[[], Scene]] = {
    "spring": alone,
    "long spring": partial(alone, steps=2100),
    "orbit": partial(alone, q=[0.3, -0.5, 0.8], p=[0.7, 1.1, -0.4], places=np.arange(3)),
    "driven": lambda: replace(one := alone(c=0.11), terms=(*one.terms, DRIVE)),
    "chain": lambda: Scene(
        m=np.array([1.3, 0.7, 2.1]), q=np.array([0.2, 1.0, 1.9]), p=np.array([0.4, -0.3, 0.5]), step=0.05,
        terms=(Spring(a=np.arange(2), b=np.arange(1, 3), k=np.array([1.1, 3.7]), rest=np.array([0.9, 1.2])),),
        steps=200),
    "bath": lambda: baths.springs(40),
    "wide bath": lambda: baths.springs(250),
}  # fmt: skip
"""The scenes of the faults: no mass, stiffness, rest point or step is 1, and h w is about 0.1."""


@cache
def scene(where: str) -> Scene:
    """A scene by its name."""
    return replace(SCENES[where](), name=where)


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


def stiffer(c: Case, axis: str) -> Scene:
    """The scene with springs too stiff by a fraction along one axis."""
    factor = np.where(c.on(axis), 1 + c.x, 1.0)
    return c.scene.derived(terms=tuple(term.scaled(factor[term.particles[0]]) for term in c.scene.terms))


def swapped(c: Case, x: Reals, one: int, other: int) -> Floats:
    """Numbers of coordinates (..., n) with two axes exchanged."""
    order = np.arange(c.scene.n)
    order[c.axes[one]], order[c.axes[other]] = c.axes[other], c.axes[one]
    return np.asarray(x[..., order], np.float64)


def turned(c: Case, x: Reals, to: Reals, part: float) -> Floats:
    """Vectors (..., n) plus a part of others rotated by 90 degrees in the plane of x and y."""
    out, (i, j, _) = x.astype(np.float64), c.axes
    out[..., i] -= part * to[..., j]
    out[..., j] += part * to[..., i]
    return out


def wrapped(c: Case, r: Trajectory) -> Trajectory:
    """Positions along y in a box of half of their span."""
    box = max(float(np.ptp(r.q)) / 2, 1e-300)
    return replace(r, q=np.where(c.on("y"), r.q - box * np.round(r.q / box), r.q))


def nearest_image(c: Case, f: Reals, q: Reals, p: Reals) -> Reals:
    """The force of the nearest image of the wall, in a box of the amplitude."""
    box = 1.5 * float(np.max(c.scene.system.amplitudes[0]))
    return c.force(q - box * np.round(q / box), p)


_IN_SPACE = each(
    Fault("stiff-y", "forces along y are too large", moves=lambda c: stiffer(c, "y"), size=1e-11),
    Fault("stiff-z-alone",
          "forces along z are too large, along which nothing moves until the scene is turned",
          ("orientation",), moves=lambda c: stiffer(c, "z"), size=1e-12),
    Fault("heavy-y", "the mass along y is too large, as in a mass matrix that is not isotropic",
          moves=lambda c: c.scene.derived(m=c.scene.m * (1 + c.x * c.on("y"))), size=1e-11),
    Fault("flat", "forces along z are left out",
          force=lambda c, f, q, p: np.where(c.on("z"), 0 * f, f)),
    Fault("flat-turned", "forces along y are left out, along which nothing moves until the scene is turned",
          ("orientation",), force=lambda c, f, q, p: np.where(c.on("y"), 0 * f, f)),
    Fault("mirrored-y", "the force along y has the wrong sign",
          force=lambda c, f, q, p: np.where(c.on("y"), -f, f)),
    Fault("single-z", "forces along z in single precision", FRAME_CHECKS,
          force=lambda c, f, q, p: np.where(c.on("z"), single(f), f)),
    Fault("swapped-axes", "the force along y acts along z, and that along z along y",
          force=lambda c, f, q, p: swapped(c, f, 1, 2)),
    Fault("velocity-order", "the momenta are written in the order y, x, z",
          ("start", "step-defect", "angular-momentum"),
          reports=lambda c, r: replace(r, p=swapped(c, r.p, 0, 1))),
    Fault("torque", "a force at right angles to the position turns the orbit",
          ("step-defect", "angular-momentum"), size=1e-11, force=lambda c, f, q, p: turned(
              c, f, q, c.x * float(c.scene.system.hessian_diagonal(c.scene.q)[0]))),
    Fault("coriolis", "momenta turn a little at every step, as in a rotating frame", FRAME_CHECKS,
          after=lambda c, i, q, p: (q, turned(c, p, p, c.x)), size=1e-12),
    Fault("wrapped", "positions along y are wrapped into a box", FRAME_CHECKS, reports=wrapped),
    Fault("nearest-image", "the force is that of the nearest image in a box that the orbit leaves",
          FRAME_CHECKS, force=nearest_image),
    Fault("late-z", "the momentum along z is that of half a step before", FRAME_CHECKS,
          reports=lambda c, r: replace(r, p=np.where(c.on("z"), half_step(c, -1, r).p, r.p))),
    Fault("still-z", "the position along z is written as it was at the start",
          reports=lambda c, r: replace(r, q=np.where(c.on("z"), r.q[0], r.q))),
    Fault("planar-friction", "momenta along x and y lose a fraction at every step, along z they do not",
          ("step-defect", "angular-momentum"), size=1e-12,
          after=lambda c, i, q, p: (q, np.where(c.on("z"), p, p * (1 - c.x)))),
    caught_by=(*FRAME_CHECKS, "angular-momentum"),
)  # fmt: skip
AXES = tuple(one if "orientation" in one.caught_by else replace(one, scene="orbit") for one in _IN_SPACE)
"""Faults that only a rotation of the scene shows are on a line, the others on an orbit."""


def clocked(c: Case, late: float = 0.0, pace: float = 1.0) -> Step:
    """The step with a drive that is late by this part of it, and whose clock goes at this pace."""
    return textbook(c.scene, c.scheme, clock=lambda i: ((i + late) * c.scene.step, pace))


def other(scene: Scene, change: Callable[[Drive], Drive]) -> Scene:
    """The scene with every drive changed."""
    return replace(scene, terms=tuple(change(x) if isinstance(x, Drive) else x for x in scene.terms))


DRIVES = each(
    Fault("late-drive", "the drive is taken later by a part of the step",
          textbook=lambda c: clocked(c, c.x), size=1e-9),
    Fault("held-drive", "the drive of the step's start is held over its stages",
          textbook=lambda c: clocked(c, pace=0.0)),
    Fault("drive-of-the-step-before", "the drive is that of the step before, as of a callback that is late",
          textbook=lambda c: clocked(c, -1.0)),
    Fault("drive-phase", "the phase of the drive has the wrong sign",
          moves=lambda c: other(c.scene, lambda d: replace(d, phase=-d.phase))),
    Fault("drive-over-mass", "the amplitude of the drive is divided by the mass",
          moves=lambda c: other(
              c.scene, lambda d: replace(d, amplitude=d.amplitude * (1 / c.scene.m)))),
    Fault("drive-in-degrees", "the phase of the drive is taken for degrees",
          moves=lambda c: other(c.scene, lambda d: replace(d, phase=d.phase * (np.pi / 180)))),
    Fault("drive-in-cycles", "the angular frequency of the drive is taken for cycles in a unit of time",
          moves=lambda c: other(c.scene, lambda d: replace(d, frequency=d.frequency * (2 * np.pi)))),
    caught_by=(*FRAME_CHECKS, "drive"), scene="driven",
)  # fmt: skip


_DIRECTION, _MATRIX, _MAP = ("noise-direction",), ("noise-matrix",), ("noise-map",)
_VARIANCE, _SHAPE, _SCALE = ("draws-variance",), ("draws-shape",), ("draws-variance", "noise-size")
_PAST, _TIES = ("draws-independent",), ("draws-differ",)

A, B = Act("drift", HALF), Act("kick", HALF)
O = THERMOSTATS["baoab"].acts[2]  # noqa: E741 - the letter of the literature


def _runs(other: str, claimed: str, caught_by: tuple[str, ...]) -> Fault:
    about = f"the thermostat {other} under the name of {claimed}"
    return Fault(f"{other}-for-{claimed}", about, caught_by, lambda c: played(c, runs=other), scheme=claimed)


OF_NOISE = each(
    Fault("mass-not-in-noise", "the noise lacks the root of the mass", _SCALE,
          lambda c: played(c, by(1 / np.sqrt(c.scene.m)))),
    Fault("mass-for-its-root", "the noise has the mass in the place of its root", _SCALE,
          lambda c: played(c, by(np.sqrt(c.scene.m)))),
    Fault("noise-size", "the noise is too large", _VARIANCE, lambda c: played(c, by(1 + c.x)), size=0.01,
          scene="wide bath"),
    Fault("temperature", "the temperature is too high", _MATRIX, lambda c: played(c, thermal=1 + c.x),
          size=2e-12),
    Fault("temperature-power", "the noise grows with another power of the temperature than 1/2",
          ("noise-size",), lambda c: played(c, thermal=c.scene.thermal**c.x), size=1e-11),
    Fault("decay-of-variance", "noise of 1 - c in the place of 1 - c**2", _VARIANCE,
          lambda c: played(c, by(1 / np.sqrt(1 + np.exp(-forgetting(c.scene)))))),
    Fault("calories", "calories for joules", _VARIANCE, lambda c: played(c, thermal=4.184)),
    Fault("boltzmann", "Boltzmann's constant of five digits", _MATRIX,
          lambda c: played(c, thermal=8.3145 / 8.31446261815324)),
    Fault("uniform-draws", "uniform draws", _SHAPE,
          lambda c: played(c, of_rank(lambda u: np.sqrt(12) * (u - 0.5)))),
    Fault("coins", "draws of 1 or -1", (*_SHAPE, *_TIES),
          lambda c: played(c, of_rank(lambda u: np.sign(u - 0.5)))),
    Fault("heavy-tails", "draws of Student's distribution with five degrees of freedom", _SHAPE,
          lambda c: played(c, of_rank(heavy))),
    Fault("cut-draws", "draws are cut off at 2", (*_VARIANCE, *_TIES),
          lambda c: played(c, lambda right: np.clip(right[-1], -2, 2))),
    Fault("off-centre", "draws are not centred", _PAST,
          lambda c: played(c, lambda right: right[-1] + c.x), size=0.05),
    Fault("draws-twice", "each draw is used in two steps", _TIES,
          lambda c: played(c, lambda right: right[(len(right) - 1) // 2 * 2])),
    Fault("antithetic", "every other draw is the opposite of the one before", (*_PAST, *_TIES),
          lambda c: played(c, lambda right: -right[-2] if len(right) % 2 == 0 else right[-1])),
    Fault("coloured", "a part of each draw is that of the step before", _PAST, size=0.1,
          make=lambda c: played(c, lambda right: (
              (right[-1] + c.x * right[-2]) / np.sqrt(1 + c.x * c.x) if right[1:] else right[-1]))),
    Fault("restart-64", "the generator begins anew every 64 steps", _TIES,
          lambda c: played(c, lambda right: right[(len(right) - 1) % 64])),
    Fault("restart-500", "the generator begins anew every 500 steps", _TIES,
          lambda c: played(c, lambda right: right[(len(right) - 1) % 500])),
    Fault("one-draw", "one draw for all particles", (*_PAST, *_TIES),
          lambda c: played(c, lambda right: np.full(c.scene.n, right[-1][0]))),
    Fault("draw-for-two", "one draw for each two particles", (*_PAST, *_TIES),
          lambda c: played(c, lambda right: np.repeat(right[-1][::2], 2)[: c.scene.n])),
    scheme="baoab", scene="bath",
)  # fmt: skip

THERMAL_STEPS = each(
    _runs("baoa", "baoab", _DIRECTION), _runs("gj-i-half", "gj-i", _DIRECTION),
    _runs("aboba", "baoab", _DIRECTION), _runs("obabo", "baoab", _DIRECTION), _runs("baoab", "obabo", _PAST),
    _runs("gj-ii", "baoab", _DIRECTION), _runs("gj-i", "baoab", _MAP), _runs("baoab", "gj-ii", _DIRECTION),
    _runs("lammps-langevin", "bbk", _MAP), _runs("bbk", "lammps-langevin", _MAP),
    _runs("andersen-leapfrog", "andersen", _DIRECTION), _runs("andersen", "andersen-after", _DIRECTION),
    Fault("collision-after-kick", "Andersen's collision after the first half kick, which is lost", _VARIANCE,
          lambda c: played(c, runs="andersen-after-kick"), scheme="andersen", scene="wide bath"),
    Fault("collision-chance", "collisions with the chance gamma h", ("collisions",), lambda c: played(
        c, collision=forgetting(c.scene) / -np.expm1(-forgetting(c.scene))), scheme="andersen"),
    Fault("collision-mass", "collisions without the root of the mass", _VARIANCE,
          lambda c: played(c, by(1 / np.sqrt(c.scene.m))), scheme="andersen"),
    _runs("bussi-after", "bussi", _DIRECTION),
    Fault("degrees-of-freedom", "a factor counts one degree of freedom too many", _MATRIX,
          lambda c: played(c, lambda right: np.append(right[-1], right[-1][0])), scheme="bussi"),
    Fault("energy-for-momentum", "kinetic energies forget as momenta should", (*_MATRIX, *_VARIANCE),
          lambda c: played(c, rate=0.5), scheme="bussi"),
    Fault("target-energy", "the kinetic energy aimed at is too large", _MATRIX,
          lambda c: played(c, thermal=1 + c.x), scheme="bussi", size=1e-11),
    Fault("friction-of-half", "the friction of half a step for the whole", _VARIANCE,
          lambda c: played(c, rate=0.5)),
    Fault("bath-friction", "the friction of the bath is too large", _MAP,
          lambda c: played(c, rate=1 + c.x), size=1e-9),
    Fault("drag-alone", "the drag is too strong for its noise", _PAST, lambda c: played(
        c, by(np.sqrt(np.expm1(-2 * (x := forgetting(c.scene))) / np.expm1(-2 * x * (1 + c.x)))),
        rate=1 + c.x), size=0.2, scene="wide bath"),
    Fault("force-with-two-draws", "every force is too large beside draws that reach every state",
          _PAST, lambda c: played(c, k=1 + c.x), scheme="obabo", size=0.1, scene="wide bath"),
    Fault("half-kick-lost", "the last half kick is left out", _DIRECTION,
          lambda c: played(c, runs=(B, A, O, A))),
    Fault("half-kick-old", "the last half kick has the old force", _DIRECTION,
          lambda c: played(c, runs=(B, A, O, A, Act("held", HALF)))),
    Fault("whole-drifts", "two whole drifts in the place of half ones", _DIRECTION,
          lambda c: played(c, runs=(B, Act("drift", ONE), O, Act("drift", ONE), B))),
    Fault("noise-in-position", "noise acts on positions too", _DIRECTION,
          lambda c: played(c, runs=(B, A, O, A, B, Act("jump", lambda x: c.x * x))), size=1e-9),
    Fault("bath-step", "every step in a bath is too long", _DIRECTION, lambda c: played(c, h=1 + c.x),
          size=1e-9),
    Fault("bath-stiffness", "every force in a bath is too large", _DIRECTION,
          lambda c: played(c, k=1 + c.x), size=1e-9),
    Fault("bath-masses", "all masses of the step are 1", _DIRECTION,
          lambda c: played(c, m=1 / c.scene.m)),
    scheme="baoab", scene="bath",
)  # fmt: skip


FAULTS: tuple[Fault, ...] = (
    *PARAMETERS, *FORCES, *STEPS, *ARITHMETIC, *REPORTS, *AXES, *DRIVES, *ADAPTIVE, *OF_NOISE, *THERMAL_STEPS,
)  # fmt: skip
