"""The faults: data over `seeded`.  Most are bugs that integrators have shipped with.

The sized ones are relative errors; the smallest size that a check still sees is its detection limit.
`caught_by` names checks that must reject a fault at the size given here: a test holds them to it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.studies.faults import seeded
from springcheck.studies.faults.seeded import Fault

STEP = ("step-defect", "propagator")
MOTION = ("step-defect", "closed-form", "frequency", "propagator")

PARAMETERS = (
    Fault(
        name="stiffness",
        about="every spring is too stiff",
        size=1e-12,
        caught_by=MOTION,
        make=seeded.moving(lambda s, x: seeded.stiffer(s, 1 + x)),
    ),
    Fault(
        name="mass",
        about="every mass is too large",
        size=1e-12,
        caught_by=MOTION,
        make=seeded.moving(lambda s, x: replace(s, m=s.m * (1 + x))),
    ),
    Fault(
        name="step",
        about="every step is too long",
        size=1e-12,
        caught_by=MOTION,
        make=seeded.moving(lambda s, x: replace(s, step=s.step * (1 + x))),
    ),
    Fault(
        name="rest",
        about="rest points are moved, relative to the amplitude",
        size=1e-12,
        caught_by=STEP,
        make=seeded.moving(seeded.shifted),
    ),
    Fault(
        name="start-momentum",
        about="the momenta of the start are too large",
        size=1e-12,
        caught_by=("start", "closed-form", "shadow-energy"),
        make=seeded.moving(lambda s, x: replace(s, p=s.p * (1 + x))),
    ),
    Fault(
        name="start-position",
        about="the positions of the start are too large, and row 0 is reported as it was asked for",
        size=1e-12,
        caught_by=("step-defect", "closed-form"),
        make=seeded.reported_start(lambda s, x: replace(s, q=s.q * (1 + x))),
    ),
    Fault(
        name="kcal",
        about="kJ per kcal written 4.814 for 4.184",
        caught_by=(*MOTION, "order"),
        make=seeded.moving(lambda s, x: seeded.stiffer(s, 4.814 / 4.184)),
    ),
    Fault(
        name="time-unit",
        about="time unit 48.89 for 48.88821 (fs in units of A, u and kcal/mol)",
        caught_by=MOTION,
        make=seeded.moving(lambda s, x: replace(s, step=s.step * 48.89 / 48.88821)),
    ),
    Fault(
        name="stiffness-in-single",
        about="stiffness kept in single precision: 2.9 becomes 2.9000000954",
        caught_by=STEP,
        make=seeded.moving(lambda s, x: s.system.in_single),
    ),
    Fault(
        name="unsigned-step",
        about="the size of the step is taken: backward runs go forward",
        caught_by=("mirror",),
        make=seeded.moving(seeded.unsigned),
    ),
)

FORCES = (
    Fault(
        name="friction",
        about="momenta lose a fraction at every step",
        size=1e-12,
        caught_by=("step-defect", "shadow-energy", "determinant", "symplecticity", "rounding-bias"),
        make=seeded.following(lambda s, x, i, z: (z[0], z[1] * (1 - x))),
    ),
    Fault(
        name="heating",
        about="positions gain a fraction at every step",
        size=1e-12,
        caught_by=("step-defect", "shadow-energy", "determinant", "symplecticity", "rounding-bias"),
        make=seeded.following(lambda s, x, i, z: (z[0] * (1 + x), z[1])),
    ),
    Fault(
        name="constant-force",
        about="a constant force, in units of the largest at the start",
        size=1e-12,
        caught_by=STEP,
        make=seeded.pulling(lambda top, x, f: f + x * top),
    ),
    Fault(
        name="anharmonic",
        about="springs stiffen with the square of their stretch",
        size=1e-12,
        caught_by=("step-defect", "propagator"),
        make=seeded.pulling(lambda top, x, f: f * (1 + x * (f / top) ** 2)),
    ),
    Fault(
        name="action-not-reaction",
        about="springs pull their second particle too hard",
        size=1e-12,
        scene="chain",
        caught_by=("step-defect", "momentum"),
        make=seeded.stepping(seeded.unpaired),
    ),
    Fault(
        name="fixed-point-force",
        about="undeclared fixed-point force, a fraction of the largest at the start",
        size=2.0**-32,
        caught_by=STEP,
        make=seeded.pulling(lambda top, x, f: np.trunc(f / (x * top)) * (x * top)),
    ),
    Fault(
        name="small-forces-dropped",
        about="forces below a fraction of the largest are taken for none",
        size=1e-3,
        caught_by=("step-defect",),
        make=seeded.pulling(lambda top, x, f: np.where(np.abs(f) < x * top, 0.0, f)),
        scene="long spring",
    ),
    Fault(
        name="capped-force",
        about="forces are cut off at 0.9 of the largest at the start",
        caught_by=("step-defect", "closed-form"),
        make=seeded.pulling(lambda top, x, f: np.clip(f, -0.9 * top, 0.9 * top)),
    ),
    Fault(
        name="single-force",
        about="forces in single precision",
        caught_by=STEP,
        make=seeded.pulling(lambda top, x, f: f.astype(np.float32).astype(np.float64)),
    ),
    Fault(
        name="stale-force",
        about="forces come from a buffer one step old",
        caught_by=("step-defect", "closed-form"),
        make=seeded.stepping(seeded.stale_force),
        scheme="semi-implicit-euler",
    ),
)

STEPS = (
    Fault(
        name="unequal-half-kicks",
        about="the first half kick is too large, the second too small",
        size=1e-12,
        caught_by=("step-defect", "propagator"),
        make=seeded.stepping(lambda s, c, x: seeded.verlet(s, first=0.5 * (1 + x), second=0.5 * (1 - x))),
    ),
    Fault(
        name="coefficient",
        about="the second coefficient of a fourth-order splitting is wrong",
        size=1e-12,
        scheme="forest-ruth",
        caught_by=("step-defect",),
        make=seeded.stepping(seeded.coefficient),
    ),
    Fault(
        name="coefficient-digits",
        about="the same, as if typed with eight digits: fourth order in name",
        scheme="yoshida4",
        caught_by=("step-defect", "propagator"),
        make=seeded.stepping(lambda s, c, x: seeded.coefficient(s, c, 3e-9)),
    ),
    Fault(
        name="explicit-for-semi-implicit",
        about="a symplectic Euler that is explicit",
        scheme="semi-implicit-euler",
        caught_by=("step-defect", "determinant", "symplecticity", "shadow-energy", "reversibility"),
        make=seeded.other_scheme("explicit-euler"),
    ),
    Fault(
        name="drift-kick-for-kick-drift",
        about="drift and kick in the other order",
        scheme="semi-implicit-euler",
        caught_by=("step-defect", "propagator", "shadow-energy"),
        make=seeded.other_scheme("semi-implicit-euler-drift-kick"),
    ),
    Fault(
        name="first-order",
        about="velocity Verlet in name, semi-implicit Euler in fact",
        caught_by=("step-defect", "propagator", "order", "order-anharmonic"),
        make=seeded.other_scheme("semi-implicit-euler"),
    ),
    Fault(
        name="position-for-velocity-verlet",
        about="position Verlet under the name of velocity Verlet: same order, same frequency",
        caught_by=("step-defect", "propagator", "shadow-energy"),
        make=seeded.other_scheme("position-verlet"),
    ),
    Fault(
        name="one-iteration",
        about="implicit Euler by one iteration instead of a solution",
        scheme="implicit-euler",
        caught_by=("step-defect", "propagator", "determinant"),
        make=seeded.stepping(seeded.one_iteration),
    ),
    Fault(
        name="momentum-for-velocity",
        about="dq/dt = p; a mass of 1 hides it",
        caught_by=(*MOTION, "order"),
        make=seeded.stepping(seeded.mass_of_drift),
    ),
    Fault(
        name="swapped-halves",
        about="h/2 where h*h/2 belongs",
        caught_by=("step-defect", "determinant", "order"),
        make=seeded.stepping(seeded.swapped_halves),
    ),
    Fault(
        name="lost-half",
        about="0*5 for 0.5: the first half kick is none",
        caught_by=("step-defect", "frequency", "order"),
        make=seeded.stepping(lambda s, c, x: seeded.verlet(s, first=0.0)),
    ),
    Fault(
        name="old-second-kick",
        about="the second half kick uses the force of the first",
        caught_by=("step-defect", "determinant", "shadow-energy", "order", "order-anharmonic"),
        make=seeded.stepping(seeded.old_second_kick),
    ),
    Fault(
        name="skipped-step",
        about="every 1000th step is left out",
        scene="long spring",
        caught_by=("step-defect", "frequency"),
        make=seeded.skipped(1000),
    ),
    Fault(
        name="doubled-step",
        about="every 1000th step is taken twice",
        scene="long spring",
        caught_by=("step-defect", "frequency"),
        make=seeded.stepping(seeded.doubled),
    ),
    Fault(
        name="thermostat",
        about="momenta are scaled at every step so that the energy stays",
        caught_by=("step-defect", "determinant", "reversibility"),
        make=seeded.following(seeded.rescaled),
    ),
    Fault(
        name="centre-of-mass-removal",
        about="the total momentum is taken away every tenth step",
        caught_by=("step-defect", "closed-form"),
        make=seeded.following(
            lambda s, x, i, z: (z[0], z[1] - (i % 10 == 9) * s.m / np.sum(s.m) * np.sum(z[1]))
        ),
    ),
    Fault(
        name="restart",
        about="one restart, half way, from text rounded to a relative spacing",
        size=1e-7,
        caught_by=("step-defect", "closed-form"),
        make=seeded.following(seeded.restarted),
    ),
)

ARITHMETIC = (
    Fault(
        name="single-state",
        about="positions and momenta kept in single precision",
        caught_by=STEP,
        make=seeded.following(seeded.single_state),
    ),
    Fault(
        name="decimal-state",
        about="momenta rounded to a decimal spacing at every step",
        size=1e-9,
        caught_by=("step-defect", "propagator"),
        make=seeded.following(lambda s, x, i, z: (z[0], seeded.significant(z[1], x))),
    ),
    Fault(
        name="cut-off",
        about="every result is cut off instead of rounded: no step is off by more than one rounding",
        caught_by=("rounding-bias", "rounding-growth"),
        make=seeded.stepping(seeded.towards_zero),
    ),
    Fault(
        name="noise",
        about="noise in the momenta: no two runs are equal",
        size=1e-12,
        caught_by=("step-defect", "repeatability"),
        make=seeded.stepping(seeded.random),
    ),
    Fault(
        name="single-in-name",
        about="says single precision and computes in double",
        caught_by=("arithmetic",),
        make=seeded.claims_single,
    ),
)

REPORTS = (
    Fault(
        name="early-momenta",
        about="momenta of half a step before, reported as synchronised",
        caught_by=("step-defect", "shadow-energy"),
        make=seeded.reporting(lambda s, x, r: seeded.half_step(s, -1, r)),
    ),
    Fault(
        name="late-momenta",
        about="momenta of half a step after, reported as synchronised",
        caught_by=("step-defect", "shadow-energy"),
        make=seeded.reporting(lambda s, x, r: seeded.half_step(s, 1, r)),
    ),
    Fault(
        name="delayed-momenta",
        about="momenta one frame behind the positions",
        caught_by=("step-defect", "closed-form"),
        make=seeded.reporting(seeded.delayed),
    ),
    Fault(
        name="late-start",
        about="the first frame is the state after the first step",
        caught_by=("start", "closed-form"),
        make=seeded.late_start,
    ),
    Fault(
        name="swapped-frames",
        about="two frames have changed places",
        caught_by=("step-defect", "closed-form"),
        make=seeded.reporting(seeded.swapped_frames),
    ),
    Fault(
        name="length-unit",
        about="positions are reported too large",
        size=1e-12,
        caught_by=("start", "step-defect", "closed-form"),
        make=seeded.reporting(lambda s, x, r: replace(r, q=r.q * (1 + x))),
    ),
    Fault(
        name="single-file",
        about="states are written in single precision",
        caught_by=("step-defect",),
        make=seeded.reporting(
            lambda s, x, r: replace(
                r, q=r.q.astype(np.float32).astype(np.float64), p=r.p.astype(np.float32).astype(np.float64)
            )
        ),
    ),
    Fault(
        name="text-file",
        about="states are written with so many digits",
        size=1e-9,
        caught_by=("step-defect", "closed-form"),
        make=seeded.reporting(
            lambda s, x, r: replace(r, q=seeded.significant(r.q, x), p=seeded.significant(r.p, x))
        ),
    ),
    Fault(
        name="accumulated-time",
        about="times are summed up step by step",
        caught_by=("times",),
        make=seeded.reporting(seeded.accumulated),
    ),
    Fault(
        name="time-stamps",
        about="times are stamped too late",
        size=1e-12,
        caught_by=("times",),
        make=seeded.reporting(lambda s, x, r: replace(r, t=r.t * (1 + x))),
    ),
    Fault(
        name="half-step-energy",
        about="energies are computed from momenta half a step early",
        caught_by=("energies",),
        make=seeded.reporting(seeded.half_step_energy, again=False),
    ),
    Fault(
        name="kept-force",
        about="forces are kept while no position moves by more than a part of its start",
        size=0.01,
        caught_by=("step-defect", "company"),
        make=seeded.stepping(seeded.kept_force),
    ),
    Fault(
        name="off-axis",
        about="particles leave their line",
        size=1e-12,
        caught_by=("line",),
        make=seeded.reporting(lambda s, x, r: replace(r, off_axis=x)),
    ),
    Fault(
        name="gives-up",
        about="half of the frames, and no reason why the run has stopped there",
        caught_by=("grid",),
        make=seeded.reporting(seeded.given_up, again=False),
    ),
)

ADAPTIVE = (
    Fault(
        name="deaf-to-tolerance",
        about="an adaptive solver whose error does not follow its tolerance",
        scheme="adams",
        size=1e-9,
        caught_by=("convergence", "tolerance"),
        make=seeded.adaptive(lambda tolerance, size: size),
    ),
    Fault(
        name="loose-tolerance",
        about="an adaptive solver that multiplies its tolerance",
        scheme="bdf",
        size=1e6,
        caught_by=("tolerance",),
        make=seeded.adaptive(lambda tolerance, size: size * tolerance),
    ),
)

FAULTS: tuple[Fault, ...] = PARAMETERS + FORCES + STEPS + ARITHMETIC + REPORTS + ADAPTIVE
