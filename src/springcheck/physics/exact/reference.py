"""The reference solution of a smooth scene: integrated in extended precision, with a stated error.

Collocation at the nodes of Radau IIA, of order 39 with 20 stages (Hairer & Wanner, Solving ODEs II, IV.8).
A step is the step of the scene times a power of 2, so that no time is rounded, and as long as the Legendre
series of the momenta just ends in rounding.  The stages are found by fixed-point iteration until rounding
(Hairer, McLachlan & Razakarivony, BIT 48 (2008) 231), or by Newton's iteration where friction is stiff.
States are sums with compensation.  Between the ends of steps the series gives every state.

Two more integrations have fewer stages, other steps, and random roundings more at every step, several times
as large as those of the first.  So their differences from it grow as its errors do, also where one passage or
an unstable rest decides them, and two do not vanish by chance.  The stated error is a multiple of the larger
difference so far, plus the roundings of constants, which all share.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np

from springcheck.physics.arrays import EPS, Extended, Floats, States, wide
from springcheck.physics.exact.collocation import integrals, legendre, onward, rule
from springcheck.physics.system import System

STAGES, FEWER_STAGES = 20, 16
"""Stages of the integration that counts, and of those that it is compared with."""
NOISE = 32
"""Largest share of the last two Legendre coefficients of a step, in units of rounding."""
SEEDS = (1, 2)
"""Integrations with fewer stages."""
KICK = 2 * EPS
"""Relative size of the roundings that these get at every step."""
FELT = 1.5
"""The stated error in units of the largest difference."""
FELT_ROUNDING = 3 * EPS
"""The least stated error, relative to the largest size so far and to the time: roundings of the constants of
a force are the same in all integrations."""
MOST_ERROR = 1e-3
"""The largest stated error of a reference, relative to the motion."""
REST = 2.0**-32
"""A smaller motion, relative to the positions or to the initial energy, counts as rest."""
MOST_CORRECTIONS = 60
MOST_CALLS = 200_000
"""Calls of the force in one integration, each at all stages: 15 s for a few particles."""
MOST_NUMBERS = 10_000_000
"""Most calls times coordinates, which takes as long for many."""
TRIAL_CALLS = 1_000
"""Calls after which the number for the whole motion is estimated."""
UNEVEN = 4
"""Factor by which a motion may need fewer calls than estimated."""
SHORTEST, LONGEST = -40, 16
"""Powers of 2 of the shortest and of the longest step, in steps of the scene."""
PATIENCE = 8
"""Steps after a rejected one before a longer one is tried again."""
STIFF = 4.0
"""Friction rate times step from which Newton's iteration is used."""
MOST_STIFF = 32
"""Most coordinates for which it is."""
PLACES = 8
"""Points of each step at which integrations are compared."""
BLOCK = 256
"""Steps that are compared at a time."""


class NoReferenceError(ValueError):
    """A motion that cannot be integrated here; the message says why."""


def _added(total: Extended, rest: Extended, change: Extended) -> tuple[Extended, Extended]:
    """A sum and its rounding error (Knuth's two-sum), which is added the next time."""
    change = change + rest
    new = total + change
    part = new - total
    return new, (total - (new - part)) + (change - part)


class Path:
    """One integration of a scene's system from its start, in units of a step (which may be negative).

    `done` (j + 1,) are the ends of its steps, and `series` (j, s, n) the momenta within each.
    """

    def __init__(self, system: System[Any], unit: float, stages: int, seed: int = 0, moving: int = 0) -> None:
        """With a seed the first `moving` coordinates get random roundings more at every step."""
        self.system, self.rule, self.stages = system, rule(stages), stages
        self.m, self.q, self.p = wide(system.m), wide(system.q), wide(system.p)
        # what rests exactly is not moved, nor is a clock
        self.kicked = ((self.p != 0) | (system.force(self.q, self.p) != 0)) & (np.arange(system.n) < moving)
        self.random = np.random.default_rng(seed) if seed else None
        self._kick()
        self.q_rest, self.p_rest = np.zeros_like(self.q), np.zeros_like(self.p)
        self.unit, self.power, self.calls, self.patience = np.longdouble(unit), 0, 0, 0
        self.done, self.starts, self.series = [np.longdouble(0)], [self.q], list[Extended]()
        self.powers = list[int]()
        self.most = [np.abs(self.q), np.abs(self.p), *np.abs([self.p / self.m, 0 * self.q, 0 * self.q])]
        """The largest |q|, |p|, |q'|, |p'| and |q - q(0)| so far (n,)."""

    def _kick(self) -> None:
        if self.random:
            signs = self.random.choice([-KICK, KICK], (2, len(self.m))).astype(np.longdouble) * self.kicked
            self.q, self.p = self.q * (1 + signs[0]), self.p * (1 + signs[1])

    def _guess(self, power: int) -> Extended:
        """Momenta at the nodes of the next step."""
        if self.powers and power <= self.powers[-1] + 1:
            return onward(self.stages, power - self.powers[-1]) @ self.series[-1]
        return np.tile(self.p, (self.stages, 1))

    def _noise(self, h: Any, q: Extended, p: Extended) -> Extended:
        """Rounding of the momenta of a step (n,)."""
        force = self.system.magnitude(near=q)(np.abs(q), np.abs(p))
        return wide(EPS * (np.max(np.abs(p), axis=0) + np.abs(h) * np.max(force, axis=0)))

    def _stages(self, power: int) -> tuple[Extended, Extended, Extended, bool] | None:
        """Momenta and forces at the nodes (s, n), the rounding of momenta (n,), and whether they are found by
        Newton's iteration; None where it does not converge."""
        h, of, m = self.unit * np.longdouble(2.0) ** power, self.rule, self.m
        p, last, noise = self._guess(power), np.inf, None
        rate = np.max(np.abs(self.system.friction_at(self.q)[0])) if self.system.is_damped else 0
        stiff = bool(np.abs(h) * rate > STIFF) and len(m) <= MOST_STIFF
        a, drift = h * of.a, self.q + np.multiply.outer(h * of.c, self.p / m)
        twice = h * h * of.aa
        q = self.q + (a @ p) / m
        for _ in range(MOST_CORRECTIONS):
            force = self.system.force(q, p)
            self.calls += 1
            if noise is None:
                noise = self._noise(h, q, p)
                safe = np.where(noise > 0, noise, 1)
            found = self.p + a @ force
            if stiff:
                found = p - self._newton(np.asarray(a, np.float64), q, p, p - found)
            off = float(np.max(np.abs(found - p) / safe))
            p, q = found, self.q + (a @ found) / m if stiff else drift + (twice @ force) / m
            if not np.isfinite(off) or off > 2 * max(last, NOISE) * (1e3 if stiff else 1):
                return None
            # an iteration that ends too early would drift like a systematic error
            if off == 0 or (off <= NOISE and off >= last / 2):
                return p, force, noise, stiff
            last = off
        return None

    def _newton(self, a: Floats, q: Extended, p: Extended, residual: Extended) -> Extended:
        """Newton's change of the momenta p (s, n) for a residual (s, n)."""
        n, s, system = len(self.m), self.stages, self.system
        rate, bend = system.friction_at(q)
        unit = np.eye(n)
        by_q = -np.asarray(system.hessian(q) + (bend * p)[..., None] * unit, np.float64)
        by_p = -np.asarray(rate[..., None] * unit, np.float64)
        matrix = np.einsum("ij,jab->iajb", a, by_p)
        matrix += np.einsum("ik,kab,kj,b->iajb", a, by_q, a, np.asarray(1 / self.m, np.float64))
        size = np.max(np.abs(residual)) or np.longdouble(1)
        right = np.asarray(residual / size, np.float64).ravel()
        try:
            change = np.linalg.solve(np.eye(s * n) - matrix.reshape(s * n, s * n), right)
        except np.linalg.LinAlgError:
            return np.full_like(residual, np.nan)
        return wide(change.reshape(s, n)) * size

    def extend(self, end: Any) -> None:
        """Integrate up to a time in units of the step.  Raises NoReferenceError."""
        limit = min(MOST_CALLS, MOST_NUMBERS // len(self.m))
        while self.done[-1] < end:
            done = max(float(self.done[-1]), 2.0**SHORTEST)
            if self.power < SHORTEST:
                t = f"{done * float(self.unit):.6g}"
                raise NoReferenceError(f"its motion or a force is singular at t = {t}, or not smooth")
            expected = self.calls * float(end) / done
            if self.calls > (TRIAL_CALLS if expected > UNEVEN * limit else limit):
                raise NoReferenceError(
                    f"it needs about {expected:.1g} force evaluations; the limit is {limit}"
                )
            self._step()

    def _step(self) -> None:
        met, of, power = self._stages(self.power), self.rule, self.power
        if met is not None:
            p, force, noise, stiff = met
            series = wide(of.series @ p)
            tail = np.max(np.abs(series[-2:]) / np.where(noise > 0, noise, 1))
        if met is None or not tail <= NOISE:
            self.power, self.patience = power - 1, PATIENCE
            return
        h = self.unit * np.longdouble(2.0) ** power
        if stiff:
            change = h * (of.end[0] @ p + of.end[1] @ p) / self.m
            self.p, self.p_rest = p[-1], 0 * self.p
        else:
            change = h * h * (of.end_twice[1] @ force + of.end_twice[0] @ force)
            change = (h * self.p + (h * self.p_rest + change)) / self.m
            self.p, self.p_rest = _added(self.p, self.p_rest, h * (of.end[1] @ force + of.end[0] @ force))
        self.q, self.q_rest = _added(self.q, self.q_rest, change)
        self._kick()
        most = (self.q, p, p / self.m, force, self.q - self.starts[0])
        self.most = [np.maximum(x, np.max(np.abs(y), axis=0)) for x, y in zip(self.most, most, strict=True)]
        self.series.append(series)
        self.starts.append(self.q)
        self.powers.append(power)
        self.done.append(self.done[-1] + np.longdouble(2.0) ** power)
        self.patience -= 1
        if tail <= 1 and power < LONGEST and self.patience < 0:
            self.power += 1

    def at(self, times: Extended) -> States:
        """q and p (f, n) at times (f,) in units of the step, from 0 to the end; NaN beyond."""
        j = np.clip(np.searchsorted(np.array(self.done), times) - 1, 0, len(self.powers) - 1)
        length = np.longdouble(2.0) ** np.array(self.powers)[j]
        x = 2 * (times - np.array(self.done)[j]) / length - 1
        x = np.where((x >= -1) & (x <= 1), x, np.nan)
        series, h = np.stack(self.series)[j], (self.unit * length)[:, None]
        q = np.einsum("fs,fsn->fn", integrals(x, self.stages), series)
        p = np.einsum("fs,fsn->fn", legendre(x, self.stages), series)
        return np.stack(self.starts)[j] + h * q / self.m, p


class ReferenceMotion:
    """The motion of a whole system by integration, with its stated error.

    Raises NoReferenceError where the motion of its scene needs too many calls, or is singular.
    """

    def __init__(self, system: System[Any], fill: Callable[[Any], None] | None = None) -> None:
        """`fill` reads paths and errors, in place of an integration."""
        self.n, self.digest = system.n, system.scene.digest
        self.system = system.beside(system.clocked)
        self.paths: dict[int, tuple[Path, ...]] = {}
        self.known: dict[int, tuple[Extended, Extended, Extended]] = {}
        """By direction in time: ends of steps (j,), and the largest errors of q and p up to these (j, n)."""
        if fill is not None:
            fill(self)
        self._reach(1, np.longdouble(system.scene.steps))
        _, *errors = self.known[1]
        most, amplitude = self.paths[1][0].most, REST * wide(system.amplitudes[1])
        sizes = (
            np.maximum(most[4], REST * most[0]),
            np.maximum(most[1], np.append(amplitude, most[1])[: len(most[1])]),
        )
        for error, size in zip(errors, sizes, strict=True):
            share = np.max(error[-1]) * FELT / (np.max(size[: self.n]) or 1)
            if not share <= MOST_ERROR:
                raise NoReferenceError(
                    f"the error of its reference solution reaches {share:.1g} of the motion"
                )

    @np.errstate(all="ignore")
    def _reach(self, sign: int, end: Any) -> None:
        """Integrate up to a time in steps, three times, and compare."""
        if len(self.paths.get(sign, ())) == 1 and self.known[sign][0][-1] < end:
            # read, and too short
            del self.paths[sign], self.known[sign]
        if sign not in self.paths:
            unit = sign * self.system.scene.step
            again = (Path(self.system, unit, FEWER_STAGES, seed, self.n) for seed in SEEDS)
            self.paths[sign] = (Path(self.system, unit, STAGES), *again)
        one, *others = self.paths[sign]
        none = np.zeros((1, self.n), np.longdouble)
        ends, dq, dp = self.known.get(sign, (np.zeros(1, np.longdouble), none, none))
        if ends[-1] >= end:
            return
        for path in self.paths[sign]:
            path.extend(end)
        done = np.array(one.done)
        inside = np.arange(1, PLACES + 1) / np.longdouble(PLACES)
        for j in range(len(ends) - 1, len(done) - 1, BLOCK):
            some = done[j : j + BLOCK + 1]
            places = (some[:-1, None] + np.diff(some)[:, None] * inside).ravel()
            # others may end a little earlier
            places = np.minimum(places, min(other.done[-1] for other in others))
            mine = np.stack(one.at(places))
            off = np.max([np.abs(np.stack(other.at(places)) - mine) for other in others], axis=0)
            apart = off[..., : self.n].reshape(2, -1, PLACES, self.n).max(axis=2)
            dq, dp = (np.concatenate([x, y]) for x, y in zip((dq, dp), apart, strict=True))
        dq, dp = (np.maximum.accumulate(x, axis=0) for x in (dq, dp))
        self.known[sign] = done, dq, dp

    def at(self, t: Extended) -> States:
        """See `solution.Motion`; NaN at times that are not reached."""
        times = t[:, 0] / np.longdouble(self.system.scene.step)
        q, p = np.full((2, len(t), self.n), np.nan, np.longdouble)
        for sign, mine in ((1, times >= 0), (-1, times < 0)):
            if np.any(mine):
                with contextlib.suppress(NoReferenceError):
                    self._reach(sign, np.max(np.abs(times[mine])))
                path = self.paths[sign][0]
                if path.powers:
                    q[mine], p[mine] = (x[:, : self.n] for x in path.at(np.abs(times[mine])))
        start = times == 0
        q[start], p[start] = self.system.q[: self.n], self.system.p[: self.n]
        return q, p

    @np.errstate(all="ignore")
    def doubt(self, t: np.longdouble) -> States:
        times = t / np.longdouble(self.system.scene.step)
        sign, times = (1 if times >= 0 else -1), np.abs(times)
        try:
            self._reach(sign, times)
        except NoReferenceError:
            q, p = np.full((2, self.n), np.inf, np.longdouble)
            return q, p
        ends, dq, dp = self.known[sign]
        j = int(np.searchsorted(ends, times))
        q, p, v, force, _ = (x[: self.n] for x in self.paths[sign][0].most)
        return (
            wide(FELT * dq[j] + FELT_ROUNDING * (q + np.abs(t) * v)),
            wide(FELT * dp[j] + FELT_ROUNDING * (p + np.abs(t) * force)),
        )


MOST_STORED = 32
_STORED: dict[str, ReferenceMotion | str] = {}
"""The latest references, or why there is none, by the digests of their scenes."""
FILLED: dict[str, Callable[[ReferenceMotion], None]] = {}
"""What reads a reference from a file, by the digest of its scene (see `springcheck.studies.references`)."""


def reference(system: System[Any]) -> ReferenceMotion:
    """The motion of a whole system.  Raises NoReferenceError."""
    key = system.scene.digest
    found = _STORED.pop(key, None)
    if found is None:
        try:
            with contextlib.suppress(ArithmeticError, LookupError, TypeError, ValueError):
                found = ReferenceMotion(system, FILLED[key])
            found = found or ReferenceMotion(system)
        except NoReferenceError as error:
            found = str(error)
    _STORED[key] = found
    while len(_STORED) > MOST_STORED:
        del _STORED[next(iter(_STORED))]
    if isinstance(found, str):
        raise NoReferenceError(found)
    return found
