"""A plain engine in double precision for every scheme, and the hooks by which it is broken on purpose.

It is the clean engine of the negative controls: the textbook step in NumPy doubles, and a recorder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.physics.arrays import Arithmetic, Floats, Force, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Trajectory, of_scene

State: TypeAlias = tuple[Floats, Floats]
Step: TypeAlias = Callable[[int, Floats, Floats], State]
"""(number of the step from 0, q, p) -> the next (q, p)."""


Clock: TypeAlias = Callable[[int], tuple[float, float]]
"""Number of a step from 0 -> the time at its start, and the rate of that clock."""


def textbook(
    scene: Scene,
    scheme: schemes.Scheme,
    *,
    force: Force | None = None,
    clock: Clock | None = None,
) -> Step:
    """The scheme's own step in double precision, with the scene's force or another, and a clock for a
    drive."""
    n, scene = scene.n, scene.system.clocked
    law, m, h = schemes.Law(scheme=scheme, scene=scene, h=scene.step), scene.m, scene.step

    def one(i: int, q: Floats, p: Floats) -> State:
        if len(m) > n:
            time, pace = clock(i) if clock else (i * h, 1.0)
            q, p = np.append(q, time), np.append(p, pace * scene.p[n])
        a, b = schemes.step(
            scheme, q, p, h=h, m=m, force=force or scene.system.force, stiffness=law.stiffness,
            parts=scene.system.parts, rate=law.rate,
        )  # fmt: skip
        return np.asarray(a[:n], np.float64), np.asarray(b[:n], np.float64)

    return one


def record(
    scene: Scene,
    scheme: schemes.Scheme,
    step: Step,
    *,
    start: State | None = None,
    arithmetic: Arithmetic | None = None,
    label: str = "plain",
) -> Trajectory:
    """Advance the start by `scene.steps` steps and keep every `scene.every`-th state."""
    q = np.empty((scene.frames, scene.n))
    p = np.empty_like(q)
    a, b = start or (scene.q, scene.p)
    q[0], p[0] = a, b
    with np.errstate(all="ignore"):
        for row in range(1, scene.frames):
            for i in range((row - 1) * scene.every, row * scene.every):
                a, b = step(i, a, b)
            q[row], p[row] = a, b
    return trajectory(scene, scheme, q, p, arithmetic=arithmetic, label=label)


def trajectory(
    scene: Scene,
    scheme: schemes.Scheme,
    q: Floats,
    p: Floats,
    *,
    arithmetic: Arithmetic | None = None,
    label: str = "plain",
    tolerance: float | None = None,
    calls: int | None = None,
) -> Trajectory:
    """The trajectory of recorded states up to the last finite one, with their times and energies."""
    finite = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
    f = len(q) if finite.all() else int(np.argmin(finite))
    q, p = q[:f], p[:f]
    return of_scene(
        scene,
        q,
        p,
        label=label,
        scheme=scheme.name,
        energy=energies(scene, q, p) if "energy" in scene.quantities else None,
        outcome=Outcome(status="complete" if f == scene.frames else "diverged", step=(f - 1) * scene.every),
        force_calls=scene.steps if calls is None else calls,
        tolerance=tolerance,
        arithmetic=arithmetic or Arithmetic(),
        off_axis=0.0,
    )


def energies(scene: Scene, q: Floats, p: Floats) -> Floats:
    """Total energy of each frame (f,)."""
    with np.errstate(all="ignore"):
        return np.asarray(scene.system.energy(q, p), np.float64)


FRAME_CHECKS = ("step-defect", "closed-form")


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A fault on a scene: what its hooks are given."""

    scene: Scene
    scheme: schemes.Scheme
    """The one that the engine claims."""
    x: float
    """The size of the fault."""
    seed: Any = 1
    """Seed of a thermostat: a number, or a script of draws."""
    kept: list[Any] = field(default_factory=list)
    """State of a hook between calls."""

    @property
    def force(self) -> Force:
        """The correct force."""
        return self.scene.system.force

    @cached_property
    def right(self) -> Step:
        """The correct step."""
        return textbook(self.scene, self.scheme)

    @cached_property
    def alone(self) -> Step:
        """The correct step of the particles without any term."""
        return textbook(self.scene.derived(terms=()), self.scheme)

    @cached_property
    def largest(self) -> float:
        """The largest force at the energy of the start [M L/T2]."""
        system, q = self.scene.system, self.scene.q
        stiff = float(np.max(np.abs(np.diag(system.hessian(q)))))
        return float(np.sqrt(2 * float(system.energy(q, self.scene.p)) * stiff)) or 1.0

    def on(self, axis: str) -> NDArray[np.bool_]:
        """Which coordinates lie along an axis (n,)."""
        return np.asarray(self.scene.all_places % 3 == "xyz".index(axis))

    @cached_property
    def axes(self) -> Integers:
        """The coordinates along x, y and z of particles that move in space (3, particles), or of none."""
        found = [np.flatnonzero(self.on(axis)) for axis in "xyz"]
        return np.array(found) if len({len(one) for one in found}) == 1 else np.empty((3, 0), np.int64)


@dataclass(frozen=True, slots=True)
class Fault:
    """An engine broken on purpose: correct except for its hooks."""

    name: str
    about: str
    caught_by: tuple[str, ...] = ()
    """Checks that must reject it at its size, as a test requires."""
    make: Callable[[Case], Trajectory] | None = None
    """A complete engine in place of the hooks."""
    _: KW_ONLY
    moves: Callable[[Case], Scene] | None = None
    """The scene that it moves instead of the given one."""
    runs: str = ""
    """The scheme that it runs instead of the claimed one."""
    force: Callable[[Case, Reals, Reals, Reals], Reals] | None = None
    """(case, correct force, q, p) -> its force."""
    textbook: Callable[[Case], Step] | None = None
    """Its step, as a modified textbook step."""
    step: Callable[[Case, int, Floats, Floats], State] | None = None
    """Its step by hand: the number of the step from 0, q, p -> the next (q, p)."""
    after: Callable[[Case, int, Floats, Floats], State] | None = None
    """Changes the state after each correct step: the number of the step, q, p -> the next (q, p)."""
    reports: Callable[[Case, Trajectory], Trajectory] | None = None
    """Changes the recorded motion; energies are recomputed unless they are changed here."""
    scheme: str = "velocity-verlet"
    """The scheme that the engine claims."""
    size: float | None = None
    """Size in the table; None where the fault has no size."""
    scene: str = "spring"
    """On which it is judged: see `measure.SCENES`."""

    @property
    def random(self) -> bool:
        """Whether it is a thermostat."""
        return schemes.scheme(self.scheme).has("random")

    def run(
        self, scene: Scene, label: str = "", *, size: float | None = None, seed: Any = None
    ) -> Trajectory:
        """The broken engine's trajectory of a scene; `seed` is that of a thermostat."""
        x = size if size is not None else self.size or 0.0
        case = Case(scene=scene, scheme=schemes.scheme(self.scheme), x=x, seed=1 if seed is None else seed)
        return replace((self.make or self._recorded)(case), label=label or self.name)

    def _recorded(self, case: Case) -> Trajectory:
        moved = self.moves(case) if self.moves else case.scene
        made = record(case.scene, case.scheme, self._step(case, moved), start=(moved.q, moved.p))
        if self.reports is None:
            return made
        told = self.reports(case, made)
        anew = told.energy is made.energy
        return replace(told, energy=energies(case.scene, told.q, told.p)) if anew else told

    def _step(self, case: Case, moved: Scene) -> Step:
        if by_hand := self.step:
            return partial(by_hand, case)
        pull, after = self.force, self.after
        force: Force | None = None if pull is None else lambda q, p: pull(case, case.force(q, p), q, p)
        scheme = schemes.SCHEMES[self.runs] if self.runs else case.scheme
        step = self.textbook(case) if self.textbook else textbook(moved, scheme, force=force)
        return step if after is None else lambda i, q, p: after(case, i, *step(i, q, p))


def each(*faults: Fault, **alike: Any) -> tuple[Fault, ...]:
    """Faults with these fields, except where a row sets its own."""
    known = Fault("", "")
    return tuple(
        replace(one, **{k: v for k, v in alike.items() if getattr(one, k) == getattr(known, k)})
        for one in faults
    )


def shifted(scene: Scene, size: float) -> Scene:
    """The scene with rest points moved by a fraction of the amplitude."""
    reach = float(np.max(np.abs(scene.q)) + np.max(np.abs(scene.p)))
    return replace(scene, terms=tuple(term.shifted(size * reach) for term in scene.terms))


def braked(case: Case, i: int, q: Floats, p: Floats) -> State:
    """Momenta reduced by a fraction."""
    return q, p * (1 - case.x)


def single(x: Reals) -> Floats:
    """Rounded to single precision."""
    return x.astype(np.float32).astype(np.float64)


def half_step(case: Case, sign: int, made: Trajectory) -> Trajectory:
    """Momenta half a step early (-1) or late (1), except in the first frame."""
    p = np.asarray(made.p + sign * case.scene.step / 2 * case.force(made.q, made.p), np.float64)
    p[0] = case.scene.p
    return replace(made, p=p)
