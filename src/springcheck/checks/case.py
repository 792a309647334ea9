"""What the checks of one trajectory share: the scheme's own next states, and the size of one rounding."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from springcheck import schemes
from springcheck.checks import rounding
from springcheck.checks.claim import Claim
from springcheck.checks.stretch import DEVIATIONS, Stretch, follow
from springcheck.physics.arrays import WIDE, Arithmetic, Extended, Floats, Force, Integers, Reals
from springcheck.physics.driven import CLOCK, sums
from springcheck.physics.term import Term
from springcheck.physics.trajectory import Trajectory

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, eq=False)
class Case(Claim):
    """A claim with the quantities that its checks share, each computed at most once."""

    piece: bool = False
    """Whether the trajectory may begin after the start, as later pieces of a long one do."""

    @cached_property
    def _made(self) -> dict[Callable[[Case], Any], Any]:
        return {}

    def once(self, work: Callable[[Case], T]) -> T:
        """Result of a function of this case, computed once and cached."""
        if work not in self._made:
            self._made[work] = work(self)
        return self._made[work]  # type: ignore[no-any-return]

    @cached_property
    def clocked(self) -> Case:
        """The case with a clock next to the particles, which shows the time of each frame; itself where no
        force depends on the time."""
        if not self.scene.system.is_driven:
            return self
        run = self.trajectory
        t = (self.sums if self.sums_steps else self.steps * run.step)[:, None]
        q, p = np.hstack([run.q, t]), np.hstack([run.p, np.full_like(t, CLOCK)])
        return replace(self, trajectory=replace(run, q=q, p=p), scene=self.scene.system.clocked)

    @property
    def sums(self) -> Floats:
        """The time of each frame as a sum of steps (f,)."""
        return sums(self.trajectory.step, self.steps)

    @cached_property
    def sums_steps(self) -> bool:
        """Whether a driven run records sums of steps as its times: its drives are then judged at these."""
        run = self.trajectory
        products = np.array_equal(run.t, self.steps * run.step)
        return self.scene.system.is_driven and not products and np.array_equal(run.t, self.sums)

    @cached_property
    def undriven(self) -> Case:
        """The case without driving forces, of the same normal modes; this case where nothing drives it."""
        alone = self.scene.system.without("drive").scene
        return replace(self, scene=alone) if len(alone.terms) < len(self.scene.terms) else self

    @cached_property
    def steps(self) -> Integers:
        """The number of steps behind each frame."""
        first = float(self.trajectory.t[0]) / self.trajectory.step
        # a time that is no number is for the check of the times: the frames are then counted from the start
        return (round(first) if abs(first) < 2.0**62 else 0) + np.arange(
            len(self.trajectory.t)
        ) * self.trajectory.every

    @property
    def begun(self) -> tuple[Integers, tuple[Extended, Extended]]:
        """Steps since the start (f,), and its q and p (n,); of a later piece of a long run, before which
        nothing bounds the motion, since its own first frame."""
        first, steps = self.trajectory if self.steps[0] else self.scene, self.steps - self.steps[0]
        q, p = (x.reshape(-1, self.scene.n)[0].astype(np.longdouble) for x in (first.q, first.p))
        return steps, (q, p)

    @property
    def linear(self) -> bool:
        """Whether each normal mode has a one-step matrix of its own."""
        return self.scene.system.has_modes and not self.law.has("mixes")

    @property
    def area_preserving(self) -> bool:
        """Whether every step keeps area: a symplectic scheme, and no friction."""
        return self.law.has("symplectic", "undamped")

    @cached_property
    def w(self) -> Extended:
        """Frequencies that scale mode positions to velocities; a free mode takes 1/duration."""
        duration = abs(self.trajectory.step) * max(int(self.steps[-1]), 1)
        w = np.sqrt(np.abs(self.system.modes.w2))
        return np.asarray(np.where(w > 0, w, 1 / np.longdouble(duration)))

    @cached_property
    def ahead(self) -> Stretch | None:
        """The scheme's own next frame after each frame but the last, with bounds on the effect of rounding.
        None where there are so many steps that only the energy norm is judged."""
        every = self.trajectory.every
        if every > REPEATED:
            return None
        return follow(self, *self._starts, every)

    @cached_property
    def residual(self) -> tuple[Extended, Extended] | None:
        """The equation of an implicit step that has no force in it, Q = q + x P/m, or of two stages q' = q +
        x (p + p')/m: its factor x/m (n,), and one rounding of what it adds up after each frame but the last
        (f-1, n); None for a scheme without such an equation.

        An engine gets the position from the momentum by it, or the momentum from the position, whichever way
        it solves for a step and however far A^-1 carries the residual of its solver.
        """
        run, stages = self.trajectory, self.scheme.a
        if not (self.ahead and run.every == 1 and self.law.has("implicit") and len(stages) <= 2):
            return None
        part = np.longdouble(float(stages[-1][-1]))
        way = part * run.step / self.judged.m
        (q, p), (end_q, end_p) = self._starts, self.ahead.end
        if len(stages) == 1:
            pulls = self.system.friction_rates * np.abs(p + part * (end_p - p))
            for term in self.judged.terms:
                if term.kind == "potential":
                    term.scatter(np.abs(term.pull(q + part * (end_q - q))), pulls)
        else:
            # the momentum that moves q is solved for; the stored one adds up the forces of both ends again
            both = (self.system.magnitude(x)(abs(x), abs(y)) for x, y in ((q, p), (end_q, end_p)))
            pulls = np.maximum(*both) * max(1.0, run.arithmetic.force / run.arithmetic.state)
        # the increment of p may be rounded like the sum of forces, and separately from that of P
        moved = np.abs(p) + np.abs(end_p) + abs(run.step) * pulls
        sizes = np.abs(q) + np.abs(end_q) + np.abs(way) * moved + self.origins
        half = run.arithmetic.recorded(self.judged.m, run.step, run.rebuilds_velocity)
        # of both ends
        written = 2 * (half[0] + np.abs(way) * half[1]) / self.roundings
        least = rounding.SMALLEST + np.abs(way) * rounding.of_underflow(self)
        return way, np.asarray(run.arithmetic.state * sizes + least + written)

    @property
    def _starts(self) -> tuple[Extended, Extended]:
        return self.trajectory.q[:-1].astype(np.longdouble), self.trajectory.p[:-1].astype(np.longdouble)

    @cached_property
    def next_states(self) -> tuple[Extended, Extended]:
        """The scheme's own next state after each frame but the last, in extended precision."""
        if self.ahead is not None:
            q, p = self.ahead.end
            return q, p
        return advance(self, *self._starts, self.trajectory.every)

    @cached_property
    def allowance(self) -> tuple[Extended, Extended]:
        """One rounding of everything that one step from each frame but the last adds up, (f-1, n) each."""
        if self.trajectory.every == 1 and self.ahead is not None:
            of_q, of_p = self.ahead.last
            return of_q, of_p
        return self.allowance_at(self.trajectory.q[:-1], self.trajectory.p[:-1])

    def allowance_at(
        self, q: Reals, p: Reals, *, smallest: np.longdouble = rounding.SMALLEST
    ) -> tuple[Extended, Extended]:
        """One rounding of everything that one step from states (..., n) adds up, (..., n) each.

        `smallest` is the loss of an operation to underflow.
        """
        places: list[Reals] | None = [] if self.placed else None
        if self.placed:
            self.step(q.astype(np.longdouble), p.astype(np.longdouble), met=places)
        with np.errstate(all="ignore"):
            one = rounding.of_step(self, q, p, places, smallest=smallest)
            written = rounding.of_recording(self, q, p, places)
            return one[0] + written[0] / self.roundings, one[1] + written[1] / self.roundings

    @cached_property
    def allowance_of_stretches(self) -> Extended:
        """One rounding of what a step adds up on each stretch between frames (f-1,), as `Norm.most`.

        The larger of its two ends, the far one being the scheme's own, and no less than on any stretch
        before, so that a wrong frame cannot widen its own bound.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            ends = self.allowance, self.allowance_at(*self.next_states)
            return np.maximum.accumulate(np.max([self.system.norm.most(*end) for end in ends], axis=0))

    @cached_property
    def mode_start(self) -> tuple[Extended, Extended]:
        """The start of the scene in its modes, about their centres (n,)."""
        return self.system.modes.about_centres(self.scene.q, self.scene.p)

    @cached_property
    def closed_states(self) -> tuple[Extended, Extended]:
        """The scheme's discrete solution at the frames: modes about their centres, (f, n) each."""
        return self.closed_at(self.steps)

    def closed_at(self, steps: Integers) -> tuple[Extended, Extended]:
        """The same after so many steps (f,): the undriven motion, and the response to each drive from
        rest."""
        alone = self.undriven
        u, v = schemes.propagate(
            alone.law.propagator, *alone.mode_start, steps, area_preserving=alone.area_preserving
        )
        if alone is self:
            return u, v
        # imported here: scenes without a drive do without it
        from springcheck.schemes import forced

        one_step, h = alone.law.propagator, self.trajectory.step
        y, w = forced.answer(self.scheme, self.system, alone.system.modes, one_step, h=h, steps=steps)
        return u + y, v + w

    @cached_property
    def growth(self) -> tuple[Floats, Extended]:
        """Bound on the distance from the closed form (f,), in units of one rounding, and that unit.

        The roundings of all steps are taken with one sign, and the map amplifies each from its step on; a
        splitting has the bound of `walk` where that is less.  The unit is the root of an energy: see
        `Norm.most`.
        """
        alone, n = self.undriven, self.scene.n
        total, grown = schemes.amplification(alone.law.propagator, alone.w, self.steps)
        # without that of a clock
        size = self.system.norm.most(*(one[:, :n] for one in self.clocked.allowance))
        size = np.maximum.accumulate(np.concatenate([size[:1], size]))
        if self.steps[0] == 0:
            first = size[0]
        else:
            # a piece of a long run: the envelope of the motion bounds what came before it
            before = self.envelope, (self.scene.q, self.scene.p)
            first = np.max([self.system.norm.most(*self.allowance_at(*x)) for x in before])
        bound = np.asarray(self.roundings * total)
        condition = float(np.max(schemes.condition(alone.law.propagator, alone.w)))
        if np.isfinite(condition):
            bound = np.minimum(bound, condition * self.walk(self.steps))
        return bound, np.asarray(np.maximum(size, first * grown))

    def walk(self, steps: Reals | Integers, turn: float | None = None) -> Floats:
        """Accumulated rounding of so many steps, in the coordinates in which a step is a rotation and in
        allowances of a step (f,); infinite but for kicks and drifts in double precision without friction.

        Roundings of states are effectively random and add up as a random walk: 5 standard deviations of one
        unit each.  A coefficient is rounded once, so that its error is the same in every step: one for the
        kick and one for the drift, each of which turns the phase by h w, and one for the factor of the whole
        state, near 1, where there is one.  A closed form that rounds like the engine is no walk.  `turn`
        is h w, that of the modes unless it is given.
        """
        how, plain = self.trajectory.arithmetic, self.law.has("plain", "undamped", "linear")
        double = how.is_double and how.force == 2.0**-53 and not how.quantum
        if not WIDE or not plain or not double:
            return np.full(len(steps), np.inf)
        n = steps.astype(np.float64)
        turn = abs(self.trajectory.step) * float(np.max(self.w)) if turn is None else turn
        turn = min(turn, 2.0)
        added = max(1, int(np.max(self.scene.system.pulls())))
        return np.asarray(DEVIATIONS * np.sqrt(n) + (2 * turn * added + 1.5) * n)

    @cached_property
    def strongest(self) -> Reals:
        """The largest force on the scheme's way from each frame to the next (f-1,) [M L/T2].  Of any one
        spring, or of all on a particle; 0 where modes advance many steps at once."""
        peak, system = np.zeros(len(self.trajectory.t) - 1, dtype=np.longdouble), self.system

        def watched(terms: Iterable[Term]) -> Force:
            parts = tuple(terms)
            true = system.force_of(parts)

            def force(q: Reals, p: Reals) -> Reals:
                np.maximum(peak, strongest(parts, q), out=peak)
                return true(q, p)

            return force

        advance(self, *self._starts, self.trajectory.every, forces=watched)
        return peak

    @cached_property
    def envelope(self) -> tuple[Extended, Extended]:
        """Upper bounds of |q| and |p| (n,) while the map's determinants do not grow.

        Each mode stays within its invariant ellipse, whose axes have the ratio `schemes.condition`; a mode
        that does not oscillate keeps its initial size.
        """
        modes, (u, v) = self.system.modes, self.mode_start
        axes = schemes.condition(self.law.propagator, self.w)
        reach = np.hypot(self.w * u, v) * np.where(np.isfinite(axes), axes, 1)
        q = np.abs(modes.rest) + modes.spread(reach / self.w) / modes.root_m
        return np.asarray(q), np.asarray(modes.spread(reach) * modes.root_m)


def strongest(parts: tuple[Term, ...], q: Reals) -> Reals:
    """The largest |force| at q (..., n) -> (...) of one row of a term, or of all on a particle at rest."""
    whole, none = np.zeros_like(q), np.zeros_like(q)
    for term in parts:
        term.add_force(q, none, whole)
    rows = (term.pull(q) for term in parts if term.kind in ("potential", "drive"))
    return np.asarray(np.max(np.abs(np.concatenate([whole, *rows], axis=-1)), axis=-1))


def overflows(how: Arithmetic) -> str:
    """Reason of steps that are wrong because their forces overflow a fixed-point sum."""
    return f"fixed-point sum of forces overflows beyond 2**{np.log2(how.overflow):g}"


def keeps(how: Arithmetic) -> str:
    """Reason of steps that are wrong because an engine reused a force that it had computed before."""
    return f"forces are reused while no position moves by more than {how.stale:g}"


def least_moved(moved: Reals) -> Reals:
    """The shorter displacement of each step and the one before (f,): a step starts with the force of the last
    one's end.

    Twice what an engine overlooks bounds it: a position may have come back past where its force was computed.
    """
    return np.asarray(np.minimum(moved, np.append(moved[:1], moved[:-1])))


def too_strong(case: Case) -> str:
    """A sentence where a force of some frame overflows the engine's fixed-point sum; "" elsewhere."""
    run, how = case.trajectory, case.trajectory.arithmetic
    peak = (
        np.max(strongest(case.scene.terms, run.q.astype(np.longdouble))) if np.isfinite(how.overflow) else 0
    )
    return f"the engine's limit: {overflows(how)}, and a force is {peak:.3g}" if peak >= how.overflow else ""


def small_move(run: Trajectory) -> str:
    """A sentence where some step moves so little that the engine reuses a stored force; "" elsewhere."""
    how = run.arithmetic
    if how.stale and run.every == 1 and len(run.q) > 1:
        moved = np.max(np.abs(np.diff(run.q, axis=0)), axis=1)
        if np.any((moved > 0) & (moved <= 2 * how.stale)):
            return f"the engine's limit: {keeps(how)}, and a step moves by {np.min(moved[moved > 0]):.3g}"
    return ""


REPEATED = 2000
"""Steps between two frames that are recomputed one by one; more are taken at once where modes allow it."""


def advance(
    case: Case, q: Extended, p: Extended, steps: int, *,
    forces: Callable[[Iterable[Term]], Force] | None = None,
) -> tuple[Extended, Extended]:  # fmt: skip
    """The scheme's own steps from states (f, n), in extended precision; `forces` computes the forces."""
    if steps > REPEATED and case.linear:
        return _leap(case, q, p, steps)
    for _ in range(steps):
        q, p = case.step(q, p, forces=forces)
    return q, p


def _leap(case: Case, q: Extended, p: Extended, steps: int) -> tuple[Extended, Extended]:
    """Many steps at once: the power of each mode's matrix, in its closed form."""
    one, none = np.ones_like(case.system.modes.w2), np.zeros_like(case.system.modes.w2)
    powers = [
        schemes.propagate(case.law.propagator, y, v, np.array([steps]), area_preserving=case.area_preserving)
        for y, v in ((one, none), (none, one))
    ]
    (a, c), (b, d) = powers
    u, v = case.system.modes.about_centres(q, p)
    return case.system.modes.from_centres(a * u + b * v, c * u + d * v)
