"""The ways in which an engine is broken: small pure functions over a plain engine.

A fault's `make(scene, scheme, size)` moves the scene wrongly and records it as if all were well; one of a
thermostat takes a seed as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.physics import exact
from springcheck.physics.arrays import Arithmetic, Floats, Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Trajectory
from springcheck.studies.faults.steppers import State, Step, energies, record, textbook, trajectory

Make: TypeAlias = Callable[..., Trajectory]
Where: TypeAlias = Literal[
    "spring", "chain", "long spring", "orbit", "driven", "box", "dumbbell", "triangle", "field", "bath",
    "wide bath", "hot rod", "varying steps",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Fault:
    """An engine broken on purpose."""

    name: str
    about: str
    caught_by: tuple[str, ...]
    make: Make
    _: KW_ONLY
    scheme: str = "velocity-verlet"
    """The scheme that the engine claims."""
    size: float | None = None
    """Size in the table; None where the fault has no size."""
    scene: Where = "spring"

    @property
    def random(self) -> bool:
        """Whether it is a thermostat."""
        return schemes.scheme(self.scheme).has("random")

    def run(
        self, scene: Scene, label: str = "", *, size: float | None = None, seed: Any = None
    ) -> Trajectory:
        """The broken engine's trajectory of a scene; `seed` is that of a thermostat."""
        chosen = size if size is not None else self.size
        drawn = (1 if seed is None else seed,) if self.random else ()
        made = self.make(scene, schemes.scheme(self.scheme), 0.0 if chosen is None else chosen, *drawn)
        return replace(made, label=label or self.name)


def moving(change: Callable[[Scene, float], Scene]) -> Make:
    """The engine moves another scene than it was given."""

    def make(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
        other = change(scene, size)
        return record(scene, scheme, textbook(other, scheme), start=(other.q, other.p))

    return make


def stepping(change: Callable[[Scene, schemes.Scheme, float], Step]) -> Make:
    """The engine takes another step than its scheme's."""
    return lambda scene, scheme, size: record(scene, scheme, change(scene, scheme, size))


def following(change: Callable[[Scene, float, int, State], State]) -> Make:
    """Something is done to the state after every right step: change(scene, size, step, (q, p))."""

    def broken(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        right = textbook(scene, scheme)
        return lambda i, q, p: change(scene, size, i, right(i, q, p))

    return stepping(broken)


def pulling(change: Callable[[float, float, Reals], Reals]) -> Make:
    """Another force: change(largest force, size, right force)."""

    def broken(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        right = scene.system.force
        largest = reach(scene)
        return textbook(scene, scheme, force=lambda q, p: change(largest, size, right(q, p)))

    return stepping(broken)


def reporting(change: Callable[[Scene, float, Trajectory], Trajectory], *, again: bool = True) -> Make:
    """The motion is right, its record is not; energies are computed `again` from the wrong record."""

    def make(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
        wrong = change(scene, size, record(scene, scheme, textbook(scene, scheme)))
        return replace(wrong, energy=energies(scene, wrong.q, wrong.p)) if again else wrong

    return make


def reported_start(change: Callable[[Scene, float], Scene]) -> Make:
    """The engine starts elsewhere, and reports the start that it was given."""

    def make(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
        other = change(scene, size)
        run = record(scene, scheme, textbook(other, scheme), start=(other.q, other.p))
        q, p = run.q.copy(), run.p.copy()
        q[0], p[0] = scene.q, scene.p
        return trajectory(scene, scheme, q, p)

    return make


def reach(scene: Scene) -> float:
    """The largest force that the energy of the start allows [M L/T2]."""
    energy = float(scene.system.energy(scene.q, scene.p))
    stiff = float(np.max(np.abs(np.diag(scene.system.hessian(scene.q)))))
    return float(np.sqrt(2 * energy * stiff)) or 1.0


def shifted(scene: Scene, size: float) -> Scene:
    """Rest points moved by a fraction of the amplitude."""
    reach = float(np.max(np.abs(scene.q)) + np.max(np.abs(scene.p)))
    return replace(scene, terms=tuple(term.shifted(size * reach) for term in scene.terms))


def by_hand(step: Callable[[Floats, Floats, Force, float, Floats, float], State]) -> Make:
    """The engine takes a step that is written out: step(q, p, force, h, m, size)."""

    def broken(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        force, h, m = scene.system.force, scene.step, scene.m
        return lambda i, q, p: step(q, p, force, h, m, size)

    return stepping(broken)


def verlet(
    q: Floats, p: Floats, force: Force, h: float, m: Floats | float, first: float = 0.5, second: float = 0.5
) -> State:
    """Velocity Verlet with other coefficients, or another mass in its drift."""
    p = p + first * h * force(q, p)
    q = q + h * (p / m)
    return q, np.asarray(p + second * h * force(q, p), np.float64)


def swapped_halves(q: Floats, p: Floats, force: Force, h: float, m: Floats, size: float) -> State:
    """h/2 where h*h/2 belongs, in the position form of velocity Verlet."""
    f = force(q, p)
    q = np.asarray(q + h * (p / m) + h / 2 * (f / m), np.float64)
    return q, np.asarray(p + h / 2 * (f + force(q, p)), np.float64)


def old_second_kick(q: Floats, p: Floats, force: Force, h: float, m: Floats, size: float) -> State:
    """The second half kick with the force of the old position."""
    f = force(q, p)
    p = p + h / 2 * f
    q = q + h * (p / m)
    return q, np.asarray(p + h / 2 * f, np.float64)


def one_iteration(q: Floats, p: Floats, force: Force, h: float, m: Floats, size: float) -> State:
    """Implicit Euler by one fixed-point iteration instead of a solution."""
    new = q + h * (p / m)
    p = np.asarray(p + h * force(new, p), np.float64)
    return q + h * (p / m), p


def stale_force(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """Forces come from a buffer one step old."""
    force = scene.system.force
    buffer = [force(scene.q, scene.p)]

    def stale(q: Reals, p: Reals) -> Reals:
        old = buffer[0]
        buffer[0] = force(q, p)
        return old

    return textbook(scene, scheme, force=stale)


def kept_force(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The force is kept while no position has moved by more than a part of the start's farthest."""
    force = scene.system.force
    near = size * float(np.max(np.abs(scene.q)))
    kept = [scene.q, force(scene.q, scene.p)]

    def lazy(q: Reals, p: Reals) -> Reals:
        if np.max(np.abs(q - kept[0])) > near:
            kept[:] = [q, force(q, p)]
        return kept[1]

    return textbook(scene, scheme, force=lazy)


def other_scheme(name: str) -> Make:
    """The engine runs another scheme than it claims."""
    return stepping(lambda scene, scheme, size: textbook(scene, schemes.SCHEMES[name]))


def coefficient(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """The second coefficient of a splitting is wrong in a digit."""
    (a, x), (b, y), *rest = scheme.stages
    wrong = str(np.longdouble(schemes.number(y, np.longdouble)) * (1 + np.longdouble(size)))
    return textbook(scene, replace(scheme, stages=((a, x), (b, wrong), *rest)))


def repeated(every: int, times: int) -> Make:
    """The last of so many steps is taken so often: not at all, or twice."""

    def broken(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
        right = textbook(scene, scheme)

        def step(i: int, q: Floats, p: Floats) -> State:
            for _ in range(times if i % every == every - 1 else 1):
                q, p = right(i, q, p)
            return q, p

        return step

    return stepping(broken)


def single(x: Reals) -> Floats:
    """Rounded to single precision."""
    return x.astype(np.float32).astype(np.float64)


def braked(scene: Scene, size: float, i: int, state: State) -> State:
    """Momenta lose a fraction."""
    return state[0], state[1] * (1 - size)


def significant(x: Floats, size: float) -> Floats:
    """Rounded to a relative spacing, like text of so many digits."""
    with np.errstate(divide="ignore"):
        unit = np.where(x == 0, 1, 10 ** np.floor(np.log10(np.abs(np.where(x == 0, 1, x))))) * size
    return np.asarray(np.round(x / unit) * unit)


def towards_zero(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """Every result is rounded towards zero: no step is off by more than one unit in the last place."""
    force = scene.system.force
    m = scene.m.astype(np.longdouble)

    def cut(x: Reals) -> Floats:
        near = np.asarray(x, np.float64)
        return np.where(np.abs(near) > np.abs(x), np.nextafter(near, 0), near)

    def step(i: int, q: Floats, p: Floats) -> State:
        a, b = schemes.step(
            scheme, q.astype(np.longdouble), p.astype(np.longdouble), h=scene.step, m=m, force=force
        )
        return cut(a), cut(b)

    return step


def half_step(scene: Scene, sign: int, run: Trajectory) -> Trajectory:
    """Momenta half a step early (-1) or late (1), the start's as asked for."""
    force = scene.system.force(run.q, run.p)
    p = np.asarray(run.p + sign * scene.step / 2 * force, np.float64)
    p[0] = scene.p
    return replace(run, p=p)


def swapped_frames(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """The two frames in the middle have changed places."""
    order = np.arange(len(run.t))
    middle = len(order) // 2
    if middle + 1 < len(order):
        order[[middle, middle + 1]] = order[[middle + 1, middle]]
    return replace(run, q=run.q[order], p=run.p[order])


def given_up(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """The run ends half-way."""
    half = slice(len(run.t) // 2)
    return replace(run.at(half), outcome=Outcome(status="stopped", step=(half.stop - 1) * run.every))


def accumulated(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Times are sums, not products."""
    t = np.concatenate([[0.0], np.cumsum(np.full(len(run.t) - 1, run.step * run.every))])
    return replace(run, t=t)


def half_step_energy(scene: Scene, size: float, run: Trajectory) -> Trajectory:
    """Energies are those of momenta half a step early."""
    early = run.p - scene.step / 2 * scene.system.force(run.q, run.p)
    return replace(run, energy=energies(scene, run.q, np.asarray(early, np.float64)))


def late_start(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
    """The first frame is the state after the first step."""
    step = textbook(scene, scheme)
    return record(scene, scheme, step, start=step(0, scene.q, scene.p))


def unpaired(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """Action is not reaction: what springs do to their second particle is too large."""
    right = scene.system.force

    def force(q: Reals, p: Reals) -> Reals:
        out = right(q, p)
        for term in scene.terms:
            if term.kind == "potential":
                np.subtract.at(out, term.particles[-1], size * term.pull(q))
        return out

    return textbook(scene, scheme, force=force)


def rescaled(scene: Scene, size: float, i: int, state: State) -> State:
    """A thermostat left on: momenta scaled so that the energy stays what it was."""
    q, p = state
    start = scene.system.energy(scene.q, scene.p)
    kinetic = scene.system.kinetic_energy(p)
    wanted = start - (scene.system.energy(q, p) - kinetic)
    return (q, p * float(np.sqrt(wanted / kinetic))) if kinetic > 0 and wanted > 0 else (q, p)


def random(scene: Scene, scheme: schemes.Scheme, size: float) -> Step:
    """Noise from the clock: no two runs are equal."""
    right = textbook(scene, scheme)
    rng = np.random.default_rng()

    def step(i: int, q: Floats, p: Floats) -> State:
        q, p = right(i, q, p)
        return q, p * (1 + size * rng.standard_normal(len(p)))

    return step


def restarted(scene: Scene, size: float, i: int, state: State) -> State:
    """One restart from a text file in the middle of the run."""
    if i != scene.steps // 2:
        return state
    return significant(state[0], size), significant(state[1], size)


def claims_single(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
    """Says single precision and computes in double."""
    named = Arithmetic(name="single", state=2.0**-24, force=2.0**-24)
    return record(scene, scheme, textbook(scene, scheme), arithmetic=named)


def adaptive(error: Callable[[float, float], float]) -> Make:
    """The exact solution, too slow by `error(tolerance, size)` of its time."""

    def make(scene: Scene, scheme: schemes.Scheme, size: float) -> Trajectory:
        steps = np.arange(scene.frames) * scene.every
        q, p = exact.true_motion(scene, steps, scene.step * (1 - error(scene.tolerance, size)))
        return trajectory(
            scene,
            scheme,
            np.asarray(q, np.float64),
            np.asarray(p, np.float64),
            tolerance=scene.tolerance,
            calls=2 * scene.steps,
        )

    return make
