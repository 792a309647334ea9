"""Faults along y and z, to which a scene along x is blind; and of drives at another time or with other
parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Drive
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.faults.seeded import FRAME_CHECKS, Case, Fault, each, half_step, single
from springcheck.studies.faults.steppers import Step, textbook


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
