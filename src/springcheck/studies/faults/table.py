"""The faults: data over `seeded`.  Most are bugs that integrators have shipped with.

The sized ones are relative errors; the smallest size that a check still sees is its detection limit.
`caught_by` names checks that must reject a fault at the size given here: a test holds them to it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.physics.rods import Rods
from springcheck.studies.faults import fields, rigid, seeded, space
from springcheck.studies.faults.fields import FIELDS
from springcheck.studies.faults.heat import OF_NOISE, RODS_IN_BATHS, THERMAL_STEPS
from springcheck.studies.faults.rigid import Rattle
from springcheck.studies.faults.seeded import Fault, Make
from springcheck.studies.faults.varying import VARYING

STEP = ("step-defect", "propagator")
MOTION = ("step-defect", "closed-form", "frequency", "propagator")

PARAMETERS = (
    Fault("stiffness", "every spring is too stiff",
          MOTION, seeded.moving(lambda s, x: s.system.scaled(1 + x)), size=1e-12),
    Fault("mass", "every mass is too large",
          MOTION, seeded.moving(lambda s, x: replace(s, m=s.m * (1 + x))), size=1e-12),
    Fault("step", "every step is too long",
          MOTION, seeded.moving(lambda s, x: replace(s, step=s.step * (1 + x))), size=1e-12),
    Fault("rest", "rest points are moved, relative to the amplitude",
          STEP, seeded.moving(seeded.shifted), size=1e-12),
    Fault("start-momentum", "the initial momenta are too large",
          ("start", "closed-form", "shadow-energy"),
          seeded.moving(lambda s, x: replace(s, p=s.p * (1 + x))), size=1e-12),
    Fault("start-position",
          "the initial positions are too large, and row 0 is reported as it was asked for",
          ("step-defect", "closed-form"),
          seeded.reported_start(lambda s, x: replace(s, q=s.q * (1 + x))), size=1e-12),
    Fault("kcal", "kJ per kcal written 4.814 for 4.184",
          (*MOTION, "order"), seeded.moving(lambda s, x: s.system.scaled(4.814 / 4.184))),
    Fault("time-unit", "time unit 48.89 for 48.88821 (fs in units of A, u and kcal/mol)",
          MOTION, seeded.moving(lambda s, x: replace(s, step=s.step * 48.89 / 48.88821))),
    Fault("stiffness-in-single", "stiffness kept in single precision: 2.9 becomes 2.9000000954",
          STEP, seeded.moving(lambda s, x: s.system.in_single)),
    Fault("unsigned-step", "the size of the step is taken: backward runs go forward",
          ("mirror",), seeded.moving(lambda s, x: replace(s, step=abs(s.step)))),
)  # fmt: skip

FORCES = (
    Fault("friction", "momenta lose a fraction at every step",
          ("step-defect", "shadow-energy", "determinant", "symplecticity", "rounding-bias"),
          seeded.following(seeded.braked), size=1e-12),
    Fault("heating", "positions gain a fraction at every step",
          ("step-defect", "shadow-energy", "determinant", "symplecticity", "rounding-bias"),
          seeded.following(lambda s, x, i, z: (z[0] * (1 + x), z[1])), size=1e-12),
    Fault("constant-force", "a constant force, in units of the largest at the start",
          STEP, seeded.pulling(lambda top, x, f: f + x * top), size=1e-12),
    Fault("anharmonic", "springs stiffen with the square of their stretch",
          STEP, seeded.pulling(lambda top, x, f: f * (1 + x * (f / top) ** 2)), size=1e-12),
    Fault("action-not-reaction", "the force of a spring on its second particle is too large",
          ("step-defect", "momentum"), seeded.stepping(seeded.unpaired), size=1e-12, scene="chain"),
    Fault("fixed-point-force", "undeclared fixed-point force, a fraction of the largest at the start",
          STEP, seeded.pulling(lambda top, x, f: np.trunc(f / (x * top)) * (x * top)), size=2.0**-32),
    Fault("small-forces-dropped", "forces below a fraction of the largest are taken for none",
          ("step-defect",),
          seeded.pulling(lambda top, x, f: np.where(np.abs(f) < x * top, 0.0, f)), size=1e-3,
              scene="long spring"),
    Fault("capped-force", "forces are cut off at 0.9 of the largest at the start",
          ("step-defect", "closed-form"),
          seeded.pulling(lambda top, x, f: np.clip(f, -0.9 * top, 0.9 * top))),
    Fault("single-force", "forces in single precision",
          STEP, seeded.pulling(lambda top, x, f: seeded.single(f))),
    Fault("stale-force", "forces come from a buffer one step old",
          ("step-defect", "closed-form"), seeded.stepping(seeded.stale_force), scheme="semi-implicit-euler"),
)  # fmt: skip

STEPS = (
    Fault("unequal-half-kicks", "the first half kick is too large, the second too small",
          STEP,
          seeded.by_hand(lambda q, p, f, h, m, x: seeded.verlet(q, p, f, h, m, 0.5 * (1 + x), 0.5 * (1 - x))),
          size=1e-12),
    Fault("coefficient", "the second coefficient of a fourth-order splitting is wrong",
          ("step-defect",), seeded.stepping(seeded.coefficient), size=1e-12, scheme="forest-ruth"),
    Fault("coefficient-digits", "the same, as if typed with eight digits: fourth order in name",
          STEP, seeded.stepping(lambda s, c, x: seeded.coefficient(s, c, 3e-9)), scheme="yoshida4"),
    Fault("explicit-for-semi-implicit", "a symplectic Euler that is explicit",
          ("step-defect", "determinant", "symplecticity", "shadow-energy", "reversibility"),
          seeded.other_scheme("explicit-euler"), scheme="semi-implicit-euler"),
    Fault("drift-kick-for-kick-drift", "drift and kick in the other order",
          ("step-defect", "propagator", "shadow-energy"),
          seeded.other_scheme("semi-implicit-euler-drift-kick"), scheme="semi-implicit-euler"),
    Fault("first-order", "velocity Verlet in name, semi-implicit Euler in fact",
          ("step-defect", "propagator", "order", "order-anharmonic"),
          seeded.other_scheme("semi-implicit-euler")),
    Fault("position-for-velocity-verlet",
          "position Verlet under the name of velocity Verlet: same order, same frequency",
          ("step-defect", "propagator", "shadow-energy"), seeded.other_scheme("position-verlet")),
    Fault("one-iteration", "implicit Euler by one iteration instead of a solution",
          ("step-defect", "propagator", "determinant"),
          seeded.by_hand(seeded.one_iteration), scheme="implicit-euler"),
    Fault("momentum-for-velocity", "dq/dt = p; a mass of 1 hides it",
          (*MOTION, "order"), seeded.by_hand(lambda q, p, f, h, m, x: seeded.verlet(q, p, f, h, 1.0))),
    Fault("swapped-halves", "h/2 where h*h/2 belongs",
          ("step-defect", "determinant", "order"), seeded.by_hand(seeded.swapped_halves)),
    Fault("lost-half", "0*5 for 0.5: the first half kick is none",
          ("step-defect", "frequency", "order"),
          seeded.by_hand(lambda q, p, f, h, m, x: seeded.verlet(q, p, f, h, m, first=0.0))),
    Fault("old-second-kick", "the second half kick uses the force of the first",
          ("step-defect", "determinant", "shadow-energy", "order", "order-anharmonic"),
          seeded.by_hand(seeded.old_second_kick)),
    Fault("skipped-step", "every 1000th step is left out",
          ("step-defect", "frequency"), seeded.repeated(1000, 0), scene="long spring"),
    Fault("doubled-step", "every 1000th step is taken twice",
          ("step-defect", "frequency"), seeded.repeated(1000, 2), scene="long spring"),
    Fault("thermostat", "momenta are scaled at every step so that the energy stays",
          ("step-defect", "determinant", "reversibility"), seeded.following(seeded.rescaled)),
    Fault("centre-of-mass-removal", "the total momentum is taken away every tenth step",
          ("step-defect", "closed-form"),
          seeded.following(lambda s, x, i, z: (z[0], z[1] - (i % 10 == 9) * s.m / np.sum(s.m) *
              np.sum(z[1])))),
    Fault("restart", "one restart, half way, from text rounded to a relative spacing",
          ("step-defect", "closed-form"), seeded.following(seeded.restarted), size=1e-7),
)  # fmt: skip

ARITHMETIC = (
    Fault("single-state", "positions and momenta kept in single precision",
          STEP, seeded.following(lambda s, x, i, z: (seeded.single(z[0]), seeded.single(z[1])))),
    Fault("decimal-state", "momenta rounded to a decimal spacing at every step",
          STEP, seeded.following(lambda s, x, i, z: (z[0], seeded.significant(z[1], x))), size=1e-9),
    Fault("cut-off", "every result is cut off instead of rounded: no step is off by more than one rounding",
          ("rounding-bias", "rounding-growth"), seeded.stepping(seeded.towards_zero)),
    Fault("noise", "noise in the momenta: no two runs are equal",
          ("step-defect", "repeatability"), seeded.stepping(seeded.random), size=1e-12),
    Fault("single-in-name", "says single precision and computes in double",
          ("arithmetic",), seeded.claims_single),
)  # fmt: skip

REPORTS = (
    Fault("early-momenta", "momenta of half a step before, reported as synchronised",
          ("step-defect", "shadow-energy"), seeded.reporting(lambda s, x, r: seeded.half_step(s, -1, r))),
    Fault("late-momenta", "momenta of half a step after, reported as synchronised",
          ("step-defect", "shadow-energy"), seeded.reporting(lambda s, x, r: seeded.half_step(s, 1, r))),
    Fault("delayed-momenta", "momenta one frame behind the positions",
          ("step-defect", "closed-form"),
          seeded.reporting(lambda s, x, r: replace(r, p=np.concatenate([r.p[:1], r.p[:-1]])))),
    Fault("late-start", "the first frame is the state after the first step",
          ("start", "closed-form"), seeded.late_start),
    Fault("swapped-frames", "two frames have changed places",
          ("step-defect", "closed-form"), seeded.reporting(seeded.swapped_frames)),
    Fault("length-unit", "positions are reported too large",
          ("start", "step-defect", "closed-form"),
          seeded.reporting(lambda s, x, r: replace(r, q=r.q * (1 + x))), size=1e-12),
    Fault("single-file", "states are written in single precision",
          ("step-defect",),
          seeded.reporting(lambda s, x, r: replace(r, q=seeded.single(r.q), p=seeded.single(r.p)))),
    Fault("text-file", "states are written with so many digits",
          ("step-defect", "closed-form"),
          seeded.reporting(lambda s, x, r: replace(r, q=seeded.significant(r.q, x),
              p=seeded.significant(r.p, x))), size=1e-9),
    Fault("accumulated-time", "times are summed up step by step",
          ("times",), seeded.reporting(seeded.accumulated)),
    Fault("time-stamps", "times are stamped too late",
          ("times",), seeded.reporting(lambda s, x, r: replace(r, t=r.t * (1 + x))), size=1e-12),
    Fault("half-step-energy", "energies are computed from momenta half a step early",
          ("energies",), seeded.reporting(seeded.half_step_energy, again=False)),
    Fault("kept-force", "forces are kept while no position moves by more than a part of its start",
          ("step-defect", "company"), seeded.stepping(seeded.kept_force), size=0.01),
    Fault("off-axis", "particles leave their line",
          ("line",), seeded.reporting(lambda s, x, r: replace(r, off_axis=x)), size=1e-12),
    Fault("gives-up", "half of the frames, and no reason why the run has stopped there",
          ("grid",), seeded.reporting(seeded.given_up, again=False)),
)  # fmt: skip

SPACE = ("step-defect", "closed-form", "angular-momentum")

_MOTION_CHECKS = ("step-defect", "closed-form")

AXES = (
    Fault("stiff-y", "forces along y are too large",
          SPACE, seeded.moving(space.stiffer("y")), size=1e-11, scene="orbit"),
    Fault("stiff-z-alone",
          "forces along z are too large, along which nothing moves until the scene is turned",
          ("orientation",), seeded.moving(space.stiffer("z")), size=1e-12),
    Fault("heavy-y", "the mass along y is too large, as in a mass matrix that is not isotropic",
          SPACE, seeded.moving(space.heavier("y")), size=1e-11, scene="orbit"),
    Fault("flat", "forces along z are left out",
          SPACE, seeded.stepping(space.along("z", lambda f: 0 * f)), scene="orbit"),
    Fault("flat-turned", "forces along y are left out, along which nothing moves until the scene is turned",
          ("orientation",), seeded.stepping(space.along("y", lambda f: 0 * f))),
    Fault("mirrored-y", "the force along y has the wrong sign",
          SPACE, seeded.stepping(space.along("y", lambda f: -f)), scene="orbit"),
    Fault("single-z", "forces along z in single precision",
          ("step-defect", "closed-form"),
          seeded.stepping(space.along("z", seeded.single)), scene="orbit"),
    Fault("swapped-axes", "the force along y acts along z, and that along z along y",
          SPACE, seeded.stepping(space.swapped_axes), scene="orbit"),
    Fault("velocity-order", "the momenta are written in the order y, x, z",
          ("start", "step-defect", "angular-momentum"), seeded.reporting(space.momenta_swapped),
          scene="orbit"),
    Fault("torque", "a force at right angles to the position turns the orbit",
          ("step-defect", "angular-momentum"), seeded.stepping(space.torque), size=1e-11, scene="orbit"),
    Fault("coriolis", "momenta turn a little at every step, as in a rotating frame",
          ("step-defect", "closed-form"), seeded.following(space.rotated), size=1e-12, scene="orbit"),
    Fault("wrapped", "positions along y are wrapped into a box",
          ("step-defect", "closed-form"), seeded.reporting(space.wrapped), scene="orbit"),
    Fault("nearest-image", "the force is that of the nearest image in a box that the orbit leaves",
          ("step-defect", "closed-form"), seeded.stepping(space.nearest_image), scene="orbit"),
    Fault("late-z", "the momentum along z is that of half a step before",
          ("step-defect", "closed-form"), seeded.reporting(space.late_z), scene="orbit"),
    Fault("still-z", "the position along z is written as it was at the start",
          SPACE, seeded.reporting(space.still_z), scene="orbit"),
    Fault("planar-friction", "momenta along x and y lose a fraction at every step, along z they do not",
          ("step-defect", "angular-momentum"), seeded.following(space.planar_friction), size=1e-12,
          scene="orbit"),
)  # fmt: skip

_OF_DRIVES, _AT_BORDERS = (*_MOTION_CHECKS, "drive"), (*_MOTION_CHECKS, "border")

DRIVES = (
    Fault("late-drive", "the drive is taken later by a part of the step",
          _OF_DRIVES, seeded.stepping(fields.late), size=1e-9, scene="driven"),
    Fault("held-drive", "the drive of the step's start is held over its stages",
          _OF_DRIVES, seeded.stepping(fields.held), scene="driven"),
    Fault("drive-of-the-step-before", "the drive is that of the step before, as of a callback that is late",
          _OF_DRIVES, seeded.stepping(lambda s, k, x: fields.late(s, k, -1.0)), scene="driven"),
    Fault("drive-phase", "the phase of the drive has the wrong sign",
          _OF_DRIVES, seeded.moving(lambda s, x: fields.other(s, phase=-1)), scene="driven"),
    Fault("drive-over-mass", "the amplitude of the drive is divided by the mass",
          _OF_DRIVES, seeded.moving(lambda s, x: fields.other(s, amplitude=1 / s.m)), scene="driven"),
    Fault("drive-in-degrees", "the phase of the drive is taken for degrees",
          _OF_DRIVES, seeded.moving(lambda s, x: fields.other(s, phase=np.pi / 180)), scene="driven"),
    Fault("drive-in-cycles", "the angular frequency of the drive is taken for cycles in a unit of time",
          _OF_DRIVES, seeded.moving(lambda s, x: fields.other(s, frequency=2 * np.pi)), scene="driven"),
)  # fmt: skip


def _rod(
    name: str, about: str, by: tuple[str, ...], make: Make, size: float | None = None,
    scene: seeded.Where = "dumbbell",
) -> Fault:  # fmt: skip
    return Fault(name, about, ("step-defect", *by), make, size=size, scene=scene)


_LENGTH, _ALONG, _TURNED = ("rod-length",), ("rod-velocity",), ("angular-momentum", "turn")

RIGID = (
    _rod("rod-after-drift", "SHAKE along the rod as it lies after the drift, not before",
         _TURNED, Rattle(way=lambda r, s, older: s).make),
    _rod("rod-a-step-late", "SHAKE along the rod as it lay a step before",
         _TURNED, Rattle(way=lambda r, s, older: older).make),
    _rod("rod-in-single", "the rod's direction is kept in single precision",
         ("angular-momentum",), Rattle(way=lambda r, s, older: seeded.single(r)).make),
    _rod("rod-one-iteration", "one iteration of SHAKE instead of a solution",
         _LENGTH, Rattle(solve=rigid.iterated(1)).make),
    _rod("rod-one-too-few", "two iterations of SHAKE, one too few",
         _LENGTH, Rattle(solve=rigid.iterated(2)).make),
    _rod("rod-tolerance", "SHAKE ends at a tolerance that it does not declare",
         _LENGTH, Rattle(solve=rigid.until).make, 1e-9),
    _rod("rod-not-projected", "velocities along the rod are left as SHAKE leaves them",
         _ALONG, Rattle(across=lambda r, s: None).make),
    _rod("rod-projected-early", "velocities are projected along the rod as it lay before the drift",
         _ALONG, Rattle(across=lambda r, s: r).make),
    _rod("rod-no-impulse", "SHAKE moves the ends and leaves their velocities",
         _TURNED, Rattle(impulse=0.0).make),
    _rod("rod-impulse", "the impulse of SHAKE is too large", _TURNED, Rattle(impulse=None).make, 1e-10),
    _rod("rod-reduced-mass", "the multiplier has the mean of the masses for the reduced one",
         _LENGTH, Rattle(reduced=lambda m: float(np.mean(m))).make),
    _rod("rod-masses-ignored", "SHAKE moves both ends by as much, whatever their masses",
         ("momentum", "angular-momentum"),
         Rattle(ends=lambda push, m: (-push, push), reduced=lambda m: 0.5).make),
    _rod("rod-one-end", "the rod pulls at one end alone",
         ("momentum",), Rattle(ends=lambda push, m: (0 * push, push), reduced=lambda m: 1.0).make),
    _rod("rod-leak", "what the rod does to its ends is rounded to single precision, each by itself",
         ("momentum", "rod-length"), Rattle(ends=rigid.leaking).make),
    _rod("rod-length", "the rod is too long", ("rod-length", "turn"), Rattle(longer=True).make, 1e-6),
    _rod("rod-as-spring", "a stiff spring for a rod",
         ("rod-length", "rod-velocity"), seeded.stepping(rigid.stiff)),
    _rod("rod-every-other", "the rod holds at every second step alone",
         ("rod-length", "turn"), seeded.stepping(rigid.every_other)),
    _rod("rod-half-steps", "momenta are those of SHAKE half a step later",
         _ALONG, seeded.reporting(rigid.late_halves)),
    _rod("rod-restart", "a restart in the middle takes momenta of half a step before for those of the step",
         _ALONG, seeded.stepping(rigid.restarted_halves)),
    _rod("triangle-one-by-one", "each rod of a triangle is solved by itself, as if it had no company",
         ("rod-length", "rod-velocity"), rigid.solved(rigid.OneByOne), scene="triangle"),
    _rod("triangle-one-iteration", "one iteration of Newton's for the rods of a triangle",
         _LENGTH, rigid.solved(rigid.Once), scene="triangle"),
    _rod("triangle-masses-alike", "the rods of a triangle take its masses for equal",
         _ALONG, rigid.solved(Rods, lambda m: np.full_like(m, np.mean(m))), scene="triangle"),
    _rod("triangle-friction", "momenta of a turning triangle lose a fraction at every step",
         ("turn", "angular-momentum"), seeded.following(seeded.braked), 1e-10, scene="triangle"),
    _rod("rod-friction", "momenta of a turning rod lose a fraction at every step",
         ("turn", "angular-momentum"), seeded.following(seeded.braked), 1e-10),
)  # fmt: skip

BOX = (
    Fault("far-image", "a bond across the border of a periodic box pulls the long way round",
          _AT_BORDERS, seeded.stepping(space.imaged(lambda d, box: d)), scene="box"),
    Fault("image-to-the-right", "the image of a bond's end is the next one to the right, not the nearest",
          _AT_BORDERS, seeded.stepping(space.imaged(lambda d, box: d - box * np.floor(d / box))),
          scene="box"),
    Fault("cubic-box", "images along y are as far apart as those along x",
          _AT_BORDERS, seeded.stepping(space.imaged(lambda d, box: d - box[0] * np.round(d / box[0]))),
          scene="box"),
    Fault("swapped-images", "borders crossed along x are counted along y, and those along y along x",
          _AT_BORDERS, seeded.reporting(space.swapped_images), scene="box"),
    Fault("late-image", "a border that is crossed is counted a frame later",
          _AT_BORDERS, seeded.reporting(space.late_images), scene="box"),
)  # fmt: skip

ADAPTIVE = (
    Fault("deaf-to-tolerance", "an adaptive solver whose error does not follow its tolerance",
          ("convergence", "tolerance"),
          seeded.adaptive(lambda tolerance, size: size), size=1e-9, scheme="adams"),
    Fault("loose-tolerance", "an adaptive solver that multiplies its tolerance",
          ("tolerance",), seeded.adaptive(lambda tolerance, size: size * tolerance), size=1e6, scheme="bdf"),
)  # fmt: skip

FAULTS: tuple[Fault, ...] = (
    *PARAMETERS, *FORCES, *STEPS, *ARITHMETIC, *REPORTS, *AXES, *BOX, *DRIVES, *RIGID, *FIELDS, *ADAPTIVE,
    *VARYING, *OF_NOISE, *THERMAL_STEPS, *RODS_IN_BATHS,
)  # fmt: skip
