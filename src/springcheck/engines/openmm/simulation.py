"""One spring system in OpenMM: built by hand, moved by OpenMM's integrators, read synchronised.

The `System` is built by hand because `ForceField.createSystem` would add a `CMMotionRemover`, which
freezes a single bound particle.  A wall is a particle of mass 0, which OpenMM never moves, standing
where the spring is at rest: a bond of rest length 0 works through q = 0 and costs no digits.

`VerletIntegrator` is a leapfrog: the velocity that it stores belongs to t - h/2, and it takes the one
that it is handed for that.  Handed v0 it is the kick-drift Euler ("leapfrog" here).  Handed
v0 - (h/2) F/m, with half a kick added to what is read, it is velocity Verlet ("verlet" here).

`LangevinMiddleIntegrator` kicks, drifts half a step, lets friction and noise act on the velocity,
and drifts the other half.  At T = 0 there is no noise, and read like "verlet" it is the symmetric
scheme kick-drift-friction-drift-kick.  Its friction is one rate c/m for all particles.  `LangevinIntegrator`
is the same by now, bit for bit.

OpenMM takes no negative step.  A run backwards in time is the run forwards of reflected momenta: every
scheme here turns into its own -h under that reflection, because the force does not depend on p.
Friction does, and goes forwards only.

A drive is an energy in which the time is a global parameter.  OpenMM's own integrators hold it over a step,
so it is set before each: their force is taken once, where the step starts.  A `CustomIntegrator` sets it
itself, from the number of its step.
"""

from __future__ import annotations

import contextlib
import itertools
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import openmm as mm

from springcheck.engines import bonds, quiet
from springcheck.engines.contract import Label, Method, Stopped
from springcheck.engines.openmm.rounding import CUSTOM, arithmetic, sizes
from springcheck.engines.openmm.thermostats import thermostat
from springcheck.engines.solvers import timed
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.driven import Drive
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Distances, Morse, RadialSpring, WallSpring

CUSTOM_TERMS: dict[str, tuple[str, tuple[str, ...]]] = {
    "wall-spring": ("0.5*k*(x-at)^2", ("k", "at")),
    "quartic": ("0.25*b*(x-at)^4", ("b", "at")),
    "cosine": ("depth*(1-cos(wave*(x-at)))", ("depth", "wave", "at")),
    "weight": ("-force*(x-at)", ("force", "at")),
    "morse": ("depth*(1-exp(-steepness*(r-rest)))^2", ("depth", "steepness", "rest")),
}
"""Energies as OpenMM reads them, and the parameters in them, the origin last.  No parameter is divided by or
multiplied with another: GPU-type platforms keep them as float and do that in float, in every mode."""

SHIFTED = frozenset({"verlet", "langevin-middle", "langevin", "langevin-middle-synchronised"})
"""Methods whose stored velocity is half a kick behind the position, and is synchronised here."""


FAST_STEPS = {"mts": 8}
"""Evaluations of the fast springs in a step, next to one of the others, by method."""

CUSTOM_STAGES = {
    "euler": (["v0"], [("v0", "v"), ("v", "v + dt*(f/m)"), ("x", "x + dt*v0")]),
    "semi-implicit-euler": ([], [("v", "v + dt*(f/m)"), ("x", "x + dt*v")]),
}
"""Variables and stages of methods by a `CustomIntegrator`."""

ATTENTIVE = 500
"""Steps in one call, which cannot be interrupted: 1.5 ms on Reference, 0.1 s on OpenCL; a call takes 1 us."""


def version() -> dict[str, str]:
    """Version of OpenMM."""
    return {"openmm": str(mm.Platform.getOpenMMVersion())}


def convention(method: Method) -> str:
    """How the stored velocities were read."""
    if method.name in SHIFTED:
        return "stored half a step early by OpenMM; started half a kick back and read half a kick on"
    if method.name == "leapfrog":
        return "as OpenMM stores them, taken for synchronised"
    return "synchronised"


def _system(scene: Scene, origins: Floats) -> tuple[mm.System, Floats]:
    """Particles, then one fixed anchor for each rest point of a term; positions (N, 3)."""
    system = mm.System()
    start = np.zeros((scene.particles, 3))
    start.reshape(-1)[scene.where] = scene.q - origins
    for m in scene.masses.tolist():
        system.addParticle(m)
    fixed: list[Any] = []
    fast, slow = mm.HarmonicBondForce(), mm.HarmonicBondForce()
    fast.setForceGroup(1)
    for term in scene.terms:
        try:
            joints = bonds.joints(scene, term, origins)
        except MethodError:
            if not isinstance(term, WallSpring):
                raise
            # different along its axes: no bond, but a potential of each coordinate
            for force in _custom(scene, term, origins):
                force.setForceGroup(int(term.fast))
                system.addForce(force)
            continue
        anchors: dict[Any, int] = {}
        for ends, k, length, at in joints:
            if at is not None and at not in anchors:
                anchors[at] = system.addParticle(0.0)
                fixed.append(at)
            first = () if at is None else (anchors[at],)
            (fast if term.fast else slow).addBond(*first, *ends, length, k)
    for group in (slow, fast):
        if group.getNumBonds():
            system.addForce(group)
    for term in scene.terms:
        if isinstance(term, Distances) and not isinstance(term, RadialSpring):
            force, points = _of_distances(scene, term, origins, scene.particles + len(fixed))
            for point in points:
                system.addParticle(0.0)
                fixed.append(point)
            system.addForce(force)
        if isinstance(term, Morse):
            _stays_right_way_round(scene, term)
        if term.key in CUSTOM_TERMS and not isinstance(term, WallSpring):
            for force in _custom(scene, term, origins):
                system.addForce(force)
        elif isinstance(term, Drive):
            for force in _driven(scene, term):
                system.addForce(force)
    return system, np.concatenate([start, np.reshape(fixed, (-1, 3))])


def _custom(scene: Scene, term: Any, origins: Floats) -> Iterator[mm.Force]:
    """The energy of a term as an expression in x, y or z of a particle, or in the length r of a bond."""
    energy, names = CUSTOM_TERMS[term.key]
    if term.bodies == 2 and scene.places is not None:
        raise MethodError(
            f"scene {scene.name!r}: OpenMM knows only the length of a bond, no part along an axis"
        )
    first, last = term.particles[0], term.particles[-1]
    origin = getattr(term, term.origin) - (origins[last] - (origins[first] if term.bodies == 2 else 0))
    columns = np.transpose([*(getattr(term, name) for name in names[:-1]), origin])
    places = scene.all_places
    ends = np.transpose([places[index] // 3 for index in term.particles])
    along = places[term.particles[0]] % 3
    for axis in np.unique(along).tolist():
        if term.bodies == 1:
            force = mm.CustomExternalForce(energy.replace("(x-", f"({'xyz'[axis]}-"))
            name_parameter, add = force.addPerParticleParameter, force.addParticle
        else:
            force = mm.CustomBondForce(energy)
            name_parameter, add = force.addPerBondParameter, force.addBond
        for name in names:
            name_parameter(name)
        rows = along == axis
        for particles, values in zip(ends[rows].tolist(), columns[rows].tolist(), strict=True):
            add(*particles, values)
        yield force


def _of_distances(
    scene: Scene, term: Distances, origins: Floats, anchor: int
) -> tuple[mm.Force, list[tuple[float, ...]]]:
    """A term of distances by its own formula, and its fixed points, as particles from `anchor` on."""
    force = mm.CustomBondForce(re.sub(r"\bu\b", "r", term.formula).replace("**", "^"))
    names = [c.field for c in term.columns if c.field not in (term.origin, "number")]
    for name in names:
        force.addPerBondParameter(name)
    points: list[tuple[float, ...]] = []
    places = scene.all_places
    for first, last in itertools.pairwise([*term.firsts.tolist(), len(term)]):
        ends = [int(places[index[first]]) // 3 for index in term.particles]
        if term.bodies == 1:
            point = np.zeros(3)
            i = term.particles[0][first:last]
            point[places[i] % 3] = getattr(term, term.origin)[first:last] - origins[i]
            ends.append(anchor + len(points))
            points.append(tuple(point.tolist()))
        force.addBond(*ends, [float(getattr(term, name)[first]) for name in names])
    return force, points


def _driven(scene: Scene, term: Drive) -> Iterator[mm.Force]:
    """A drive, row by row, as energies of a particle and of the time; every platform keeps the numbers that
    are written into an expression as double."""
    for i, amplitude, frequency, phase in term.rows():
        particle, axis = divmod(int(scene.all_places[i]), 3)
        wave = f"cos(({frequency!r})*time+({phase!r}))"
        force = mm.CustomExternalForce(f"-({amplitude!r})*{wave}*{'xyz'[axis]}")
        force.addGlobalParameter("time", 0.0)
        force.addParticle(particle, [])
        yield force


def _stays_right_way_round(scene: Scene, term: Morse) -> None:
    """MethodError where a Morse bond could reach length 0: OpenMM's has a length without a sign."""
    energy = 4 * float(scene.system.energy(scene.q, scene.p))
    barrier = term.depth * np.expm1(term.steepness * term.rest) ** 2
    safe = (scene.q[term.b] > scene.q[term.a]) & (term.rest > 0) & (barrier > energy)
    if not (np.all(safe) and bonds.gains_nothing(scene, "quartic", "cosine", "morse")):
        raise MethodError(
            f"scene {scene.name!r}: a Morse bond may turn over, and OpenMM knows only the length of a bond; "
            "its second end must start right of the first, too slow to reach it, and no term may add energy"
        )


def _integrator(scene: Scene, name: str, step: float) -> mm.Integrator:
    signed, step = step, abs(step)
    if name in ("verlet", "leapfrog"):
        return mm.VerletIntegrator(step)
    if name == "mts":
        return mm.MTSIntegrator(step, [(0, 1), (1, FAST_STEPS[name])])
    if name == "nose-hoover":
        return mm.NoseHooverIntegrator(step)
    if name in ("langevin", "langevin-middle"):
        made = mm.LangevinIntegrator if name == "langevin" else mm.LangevinMiddleIntegrator
        return made(0.0, float(scene.system.friction_rates[0]), step)
    integrator = mm.CustomIntegrator(step)
    if scene.system.is_driven:
        integrator.addGlobalVariable("done", 0)
        integrator.addComputeGlobal("time", f"done*({signed!r})")
        integrator.addComputeGlobal("done", "done+1")
    own, stages = CUSTOM_STAGES[name]
    for variable in own:
        integrator.addPerDofVariable(variable, 0)
    for variable, value in stages:
        integrator.addComputePerDof(variable, value)
    return integrator


def _context(system: mm.System, integrator: mm.Integrator, label: Label) -> mm.Context:
    name = label.platform or "Reference"
    here = [mm.Platform.getPlatform(i).getName() for i in range(mm.Platform.getNumPlatforms())]
    if name not in here:
        raise MethodError(f"{label}: OpenMM has no platform {name} on this machine; it has {', '.join(here)}")
    properties = {"Precision": label.precision} if label.precision else {}
    if name == "CPU":
        # each of its threads has a seed of its own
        properties["Threads"] = "1"
    try:
        # OpenMM's C++ warns on standard output, where results go, that an OpenCL is a processor's; the
        # compiler behind it says on standard error that Ctrl-C has met it
        with quiet.caught(1), quiet.caught(2):
            return mm.Context(system, integrator, mm.Platform.getPlatformByName(name), properties)
    except mm.OpenMMException as error:
        raise MethodError(f"{label}: OpenMM cannot start there: {error}") from error


def _warm_up(context: mm.Context, integrator: mm.Integrator, positions: Floats) -> None:
    """Take a step and undo it: OpenMM compiles its kernels in the first step, which counts as start."""
    context.setPositions(positions)
    # a scene that blows up in its first step is to do so in its run
    with contextlib.suppress(mm.OpenMMException):
        integrator.step(1)
        context.getState(positions=True, velocities=True)
    context.setTime(0.0)
    context.setStepCount(0)


class _Context:
    """A context in motion.  Reads go to one buffer: the public accessors wrap units, 20 us a frame."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float, seed: int = 0) -> None:
        if step < 0 and scene.system.is_damped:
            raise MethodError(f"{label}: no negative step is taken, so friction runs forwards in time only")
        if arithmetic(label).parameters == "single":
            bonds.within(label, sizes(scene, step, arithmetic(label)))
            # the half kicks below must be those of the springs as OpenMM rounds them
            scene = scene.system.in_single
        if scene.system.is_driven and arithmetic(label).state > 2.0**-53:
            raise MethodError(f"{label}: the time of a drive is a parameter, in single precision there")
        self.force_calls, self.off_axis = 0, 0.0
        self._done, self._step, self._driven = 0, step, scene.system.is_driven
        origins = bonds.rests(scene, label) if method.generator else bonds.origins(scene, method.scheme)
        system, positions = _system(scene, origins)
        if method.generator:
            self._integrator = thermostat(scene, method.name, step, seed, system)
        else:
            self._integrator = _integrator(scene, method.name, step)
        self._context = _context(system, self._integrator, label)
        self._origins = origins if np.any(origins) else None
        # what OpenMM computes: all but friction
        pull = scene.system.potential_force
        self._force: Callable[..., Any] = lambda t, q, p: pull(q, p)
        if self._driven:
            self._force, _ = timed(scene.derived(terms=tuple(x for x in scene.terms if x.kind != "friction")))
        self._on_a_line = not method.generator
        self._each = 1 + FAST_STEPS.get(method.name, 0)
        self._half_kick = 0.5 * step if method.name in SHIFTED else 0.0
        self._m = np.copysign(scene.m, step)
        self._where, self._elsewhere = scene.where, scene.elsewhere
        self._x, self._v = np.zeros_like(positions), np.zeros_like(positions)
        velocities = np.zeros_like(positions)
        with np.errstate(all="ignore"):
            started = (scene.p - self._half_kick * self._force(0.0, scene.q, scene.p)) / self._m
        velocities.reshape(-1)[scene.where] = started
        if not method.generator:
            # whose numbers begin with its first step
            _warm_up(self._context, self._integrator, positions)
        if self._driven and method.name in CUSTOM:
            self._integrator.setGlobalVariableByName("done", 0)
        self._set_time = self._driven and method.name not in CUSTOM
        self._context.setPositions(positions)
        self._context.setVelocities(velocities)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        take, row = self._integrator.step, 0
        try:
            for row in range(len(q)):
                if self._set_time:
                    for i in range(self._done + row * every, self._done + (row + 1) * every):
                        self._context.setParameter("time", i * self._step)
                        take(1)
                else:
                    for left in range(every, 0, -ATTENTIVE):
                        take(min(left, ATTENTIVE))
                self._read(q[row], p[row])
            row += 1
        except mm.OpenMMException as error:
            raise Stopped(row, str(error)) from error
        finally:
            self._synchronise(every, q[:row], p[:row])
            self._done += every * row
            self.force_calls += every * row * self._each
            if self._on_a_line:
                self.off_axis = max(self.off_axis, bonds.off_axis(self._x, self._elsewhere))

    def _read(self, q: Floats, p: Floats) -> None:
        """Fill positions and velocities (n,) with what OpenMM stores."""
        state = self._context.getState(positions=True, velocities=True)
        state._getVectorAsNumpy(mm.State.Positions, self._x)
        state._getVectorAsNumpy(mm.State.Velocities, self._v)
        q[:], p[:] = self._x.reshape(-1)[self._where], self._v.reshape(-1)[self._where]

    def _synchronise(self, every: int, q: Floats, p: Floats) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            if self._origins is not None:
                q += self._origins
            p *= self._m
            if self._half_kick and self._driven:
                for row in range(len(q)):
                    t = (self._done + (row + 1) * every) * self._step
                    p[row] += self._half_kick * self._force(t, q[row], p[row])
            elif self._half_kick:
                p += self._half_kick * self._force(0.0, q, p)


start = _Context
