"""What the checks of one trajectory share: the scheme's own next states, and what one rounding is worth."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.arrays import Extended, Floats, Force, Integers, Reals
from springcheck.checks import verdicts
from springcheck.engines.contract import Arithmetic
from springcheck.physics import exact
from springcheck.physics.norm import Norm
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Term
from springcheck.trajectory import Trajectory, Verdict

SMALLEST = np.longdouble(5e-324)
"""What an operation can lose to underflow: one unit of a subnormal double."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A trajectory, or a piece of it, with what the checks share: computed at most once."""

    trajectory: Trajectory
    scene: Scene

    @property
    def scheme(self) -> schemes.Scheme:
        """The scheme that the method claims to run."""
        return schemes.SCHEMES[self.trajectory.scheme]

    @cached_property
    def judged(self) -> Scene:
        """The scene with its parameters as the engine's arithmetic keeps them."""
        arithmetic = self.trajectory.arithmetic
        scene = self.scene.system.in_single if arithmetic.parameters == "single" else self.scene
        return scene.system.scaled(1 + arithmetic.excess) if arithmetic.excess else scene

    @cached_property
    def steps(self) -> Integers:
        """The number of steps behind each frame."""
        first = float(self.trajectory.t[0]) / self.trajectory.step
        # a time that is no number is for the check of the times: the frames are then counted from the start
        return (round(first) if abs(first) < 2.0**62 else 0) + np.arange(
            len(self.trajectory.t)
        ) * self.trajectory.every

    @cached_property
    def linear(self) -> bool:
        """Whether each normal mode has a one-step matrix of its own."""
        return self.scene.system.has_modes and not self.mixed

    @property
    def mixed(self) -> bool:
        """Whether the scheme acts at different times by slow and by fast springs, and there are both."""
        return self.scheme.mixes and any(term.is_potential for term in self.scene.system.slow)

    @property
    def area_preserving(self) -> bool:
        """Whether every step keeps area: a symplectic scheme, and no friction."""
        return self.scheme.symplectic and not self.scene.system.is_damped

    @cached_property
    def law(self) -> dict[str, Any]:
        """What `schemes.step` and `schemes.magnitude_step` need beside the forces."""
        scene = self.judged
        stiff: Extended | None = None
        if self.scheme.implicit:
            system = scene.system
            stiff = (system.hessian_diagonal if system.is_separate else system.hessian)(scene.q)
        return {"stiffness": stiff, "rate": scene.system.friction_rates if scene.system.is_damped else None}

    @cached_property
    def modes(self) -> exact.Modes:
        return exact.modes(self.judged)

    @cached_property
    def matrices(self) -> Extended:
        """One-step matrices of the modes, on (y, v)."""
        one = np.ones(1, dtype=np.longdouble)
        return schemes.matrix(self.scheme, h=self.trajectory.step, m=one, k=self.modes.w2, c=self.modes.rate)

    @cached_property
    def w(self) -> Extended:
        """Frequencies that scale mode positions to velocities; a free mode takes 1/duration."""
        duration = abs(self.trajectory.step) * max(int(self.steps[-1]), 1)
        w = np.sqrt(np.abs(self.modes.w2))
        return np.asarray(np.where(w > 0, w, 1 / np.longdouble(duration)))

    @cached_property
    def next_states(self) -> tuple[Extended, Extended]:
        """The scheme's own next state after each frame but the last, in extended precision."""
        q = self.trajectory.q[:-1].astype(np.longdouble)
        p = self.trajectory.p[:-1].astype(np.longdouble)
        return advance(self, q, p, self.trajectory.every)

    @cached_property
    def allowance(self) -> tuple[Extended, Extended]:
        """One rounding of everything that one step from each frame but the last adds up, (f-1, n) each."""
        return self.allowance_at(self.trajectory.q[:-1], self.trajectory.p[:-1])

    def allowance_at(
        self, q: Reals, p: Reals, *, smallest: np.longdouble = SMALLEST
    ) -> tuple[Extended, Extended]:
        """One rounding of everything that one step from states (..., n) adds up, (..., n) each.

        `smallest` is what an operation may lose to underflow.
        """
        run, scene = self.trajectory, self.judged
        rounding = run.arithmetic
        near, momenta = q.astype(np.longdouble), p.astype(np.longdouble)
        q, p = np.abs(near), np.abs(momenta)
        h, m = np.longdouble(abs(run.step)), scene.m.astype(np.longdouble)
        sizes = scene.system.magnitude(near)
        parts = (
            scene.system.magnitude_of(scene.system.slow, near),
            scene.system.magnitude_of(scene.system.fast, near),
        )
        kicks = self._kicks(near, momenta) if self.scheme.reach == 2 else []
        size_q, size_p = schemes.magnitude_step(
            self.scheme, q, p, h=run.step, m=m, magnitude=sizes, parts=parts, kicks=kicks, **self.law
        )
        # an engine may count positions from where the springs rest, and so round those
        size_q = size_q + np.abs(self.rest_positions)
        of_q, of_p = rounding.state * size_q, rounding.state * size_p
        extra = np.zeros_like(p)
        if rounding.force > rounding.state:
            extra += rounding.force * h * sizes(q, p)
        if rounding.quantum:
            # each term's force on a particle is cut off once a step, not once for every rounding, and a
            # force below the quantum is lost, no more
            lost = np.minimum(rounding.quantum * scene.system.pulls, sizes(q, p))
            extra += h * lost / self.roundings
        if run.rebuilds_velocity and not rounding.keeps_displacement:
            extra += rounding.state * m * (q + size_q) / h
        extra += smallest * (1 + m)
        # carried on as far as the scheme carries it and no farther: beyond stability what a later force
        # feels is larger than the force itself
        reach = self.scheme.reach
        shift = h / m * (extra if reach else smallest * (1 + m)) + smallest
        later = kicks[-1] if kicks else sizes
        felt = h * (later(q + shift, p) - later(q, p)) if reach == 2 else 0
        return np.asarray(of_q + shift), np.asarray(of_p + extra + felt)

    @cached_property
    def allowance_of_stretches(self) -> Extended:
        """One rounding of what a step adds up on each stretch between frames (f-1,), as `Norm.size`.

        Of both ends, the far one where the scheme itself comes to, and of what lies before: a frame that is
        wrong must not enlarge what it is judged by.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            ends = self.allowance, self.allowance_at(*self.next_states)
            return np.maximum.accumulate(np.max([self.norm.size(*end) for end in ends], axis=0))

    @cached_property
    def closed_states(self) -> tuple[Extended, Extended]:
        """The scheme's closed-form motion at the frames: modes about their centres, (f, n) each."""
        y, v = self.modes.into(self.scene.q, self.scene.p)
        return schemes.propagate(
            self.matrices, y - self.modes.centre(), v, self.steps, area_preserving=self.area_preserving
        )

    @cached_property
    def growth(self) -> tuple[Floats, Extended]:
        """Bound on the distance from the closed form (f,), in units of one rounding, and that unit.

        One rounding a step, enlarged by the map from the step where it arises, and all of one sign.  The
        unit is a root of an energy: see `Norm.size`.
        """
        total, grown = schemes.amplification(self.matrices, self.w, self.steps)
        size = self.norm.size(*self.allowance)
        size = np.maximum.accumulate(np.concatenate([size[:1], size]))
        if self.steps[0] == 0:
            first = size[0]
        else:
            # a piece of a long run: what came before it is bounded by the envelope of the motion
            before = self.envelope, (self.scene.q, self.scene.p)
            first = np.max([self.norm.size(*self.allowance_at(*x)) for x in before])
        return np.asarray(self.roundings * total), np.asarray(np.maximum(size, first * grown))

    def _kicks(self, q: Extended, p: Extended) -> list[Force]:
        """The magnitude of each kick of a splitting, near where the scheme from (q, p) takes it.

        In a motion that explodes the last force of a step dwarfs the first.  Empty where no law bends, and
        for a scheme with more than kicks and drifts.
        """
        scene, stages = self.judged, self.scheme.stages
        if scene.system.is_linear or not {kind for kind, _ in stages} <= {"kick", "drift"}:
            return []
        found: list[Force] = []
        m, h = scene.m.astype(np.longdouble), np.longdouble(self.trajectory.step)
        force = scene.system.force
        with np.errstate(over="ignore", invalid="ignore"):
            for kind, c in stages:
                ch = schemes.number(c, np.longdouble) * h
                if kind == "drift":
                    q = np.asarray(q + ch * (p / m), np.longdouble)
                else:
                    found.append(scene.system.magnitude(q))
                    p = np.asarray(p + ch * force(q, p), np.longdouble)
        return found

    @cached_property
    def strongest(self) -> Reals:
        """The largest force on the scheme's way from each frame to the next (f-1,) [M L/T2].

        Of any one spring, or of all on a particle; 0 where modes take many steps at once.
        """
        peak = np.zeros(len(self.trajectory.t) - 1, dtype=np.longdouble)

        system = self.judged.system

        def watched(terms: Iterable[Term]) -> Force:
            parts = tuple(terms)
            true = system.force_of(parts)

            def force(q: Reals, p: Reals) -> Reals:
                np.maximum(peak, system.strongest(q, parts), out=peak)
                return true(q, p)

            return force

        q, p = (x[:-1].astype(np.longdouble) for x in (self.trajectory.q, self.trajectory.p))
        advance(self, q, p, self.trajectory.every, forces=watched)
        return peak

    @cached_property
    def envelope(self) -> tuple[Extended, Extended]:
        """What |q| and |p| (n,) never exceed while the map's determinants do not grow.

        Each mode stays within its invariant ellipse, whose axes have the ratio `schemes.condition`;
        a mode that does not turn is left at its start.
        """
        y, v = self.modes.into(self.scene.q, self.scene.p)
        centre = self.modes.centre()
        axes = schemes.condition(self.matrices, self.w)
        reach = np.hypot(self.w * (y - centre), v) * np.where(np.isfinite(axes), axes, 1)
        rest, _ = self.modes.out_of(centre, np.zeros_like(centre))
        q = np.abs(rest) + self.modes.spread(reach / self.w) / self.modes.root_m
        return np.asarray(q), np.asarray(self.modes.spread(reach) * self.modes.root_m)

    @cached_property
    def rest_positions(self) -> Floats:
        """Where springs between particles have their rest lengths, 0 where they cannot agree (n,)."""
        found = self.judged.system.rest_positions
        return np.zeros(self.scene.n) if found is None else found

    @cached_property
    def norm(self) -> Norm:
        return self.judged.system.norm

    @cached_property
    def rounding(self) -> float:
        """The largest allowance of a step in the norm of errors, up to each frame (f-1,)."""
        return float(np.max(self.norm(*self.allowance)))

    @property
    def roundings(self) -> int:
        """Roundings along one step."""
        return schemes.roundings(self.scheme)

    def verdict(self, check: str, value: float, bound: float, unit: str, why: str) -> Verdict:
        """Passed only if the value is a number within the bound."""
        return verdicts.within(self.trajectory.label, check, value, bound, unit, why)

    def not_applicable(self, check: str, why: str) -> Verdict:
        """Reported as what it is, never as passed."""
        return verdicts.not_applicable(self.trajectory.label, check, why)


def overflows(how: Arithmetic) -> str:
    """The reason of steps that are off because their forces leave the range of a fixed-point sum."""
    return f"fixed-point sum of forces overflows beyond 2**{np.log2(how.overflow):g}"


REPEATED = 1000
"""Steps between two frames that are redone one by one; more are taken at once where modes allow it."""


def advance(
    case: Case,
    q: Extended,
    p: Extended,
    steps: int,
    *,
    forces: Callable[[Iterable[Term]], Force] | None = None,
) -> tuple[Extended, Extended]:
    """So many steps of the scheme from states (f, n), in extended precision; `forces` makes the forces."""
    if steps > REPEATED and case.linear:
        return _leap(case, q, p, steps)
    scene = case.judged
    forces = forces or scene.system.force_of
    force = forces(scene.terms)
    parts = forces(scene.system.slow), forces(scene.system.fast)
    m = scene.m.astype(np.longdouble)
    a: Reals = q
    b: Reals = p
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(steps):
            a, b = schemes.step(
                case.scheme, a, b, h=case.trajectory.step, m=m, force=force, parts=parts, **case.law
            )
    return np.asarray(a), np.asarray(b)


def _leap(case: Case, q: Extended, p: Extended, steps: int) -> tuple[Extended, Extended]:
    """Many steps at once: the power of each mode's matrix, in its closed form."""
    one, none = np.ones_like(case.modes.w2), np.zeros_like(case.modes.w2)
    powers = [
        schemes.propagate(case.matrices, y, v, np.array([steps]), area_preserving=case.area_preserving)
        for y, v in ((one, none), (none, one))
    ]
    (a, c), (b, d) = powers
    y, v = case.modes.into(q, p)
    u = y - case.modes.centre()
    return case.modes.out_of(a * u + b * v + case.modes.centre(), c * u + d * v)
