"""The exact solution of particles whose modes friction couples, by the matrix exponential.

In the modes of the springs alone, with the positions of each multiplied by its frequency w, the state z obeys
z' = A z, A = [[0, W], [-W, -G]], G the friction between modes.  A + A^T is
-2 diag(0, G): the exponentials do not increase lengths, so that the error of a product of them grows with the
number of factors and no faster.  For a free mode the time constant of A replaces w.

Constant forces on free modes have a solution of their own, to which z is added: a drift d with G d the
force, such as a terminal velocity, which moves the centres of the other modes; and
a uniform acceleration of modes on which G does not act.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.physics.arrays import EPS, Extended
from springcheck.physics.exact.closedform import ClosedForm, States
from springcheck.physics.exact.linear import ROUNDINGS
from springcheck.physics.exact.normal import normal_modes
from springcheck.physics.system import System

WORST_DRIFT_CONDITION = 2.0**16
"""Largest condition of the matrix that a drift solves."""

DRIFT_REFINEMENTS = 3
"""Solutions in double precision, each of what the one before has left."""

MOST_COUPLED_MODES = 32
"""Most particles, for which the solution takes 0.1 s, and 40 us a frame."""

SERIES_TERMS = 17
"""Terms of the series of exp(A t) up to |A t| = 1/2: the next one is 2**-18/18!, 6e-22."""

RADIX_OF_STEPS = 16
"""Radix of the number of steps |A t| = 1/2: each of its digits is one product."""

MOST_STEP_DIGITS = 15
"""Most digits of that number: up to 2**60 steps, beyond which no digit of a phase is left."""


class CoupledModes(ClosedForm):
    """A whole linear scene whose friction couples modes: A takes z to z' (2n, 2n) [1/T], `scale`
    (n,) is z over positions, `rate` a bound of |A|, by rows or columns, and `free` the scale of free modes, 0
    where there are none; `away`, `drift` and `pull` (n,) of the solution by constant forces."""

    def __init__(self, system: System[Any]) -> None:
        """For springs and friction alone, without growing modes."""
        super().__init__(system)
        plain, n = system.without("damping"), system.n
        self.need(plain.is_linear and n <= MOST_COUPLED_MODES)
        self.need(all(term.kind in ("potential", "friction") for term in system.terms))
        self.modes = modes = normal_modes(plain)
        held, unit = modes.w2 > 0, np.eye(n, dtype=np.longdouble)
        self.need(not np.any(modes.w2 < 0))
        V = unit if modes.vectors is None else modes.vectors
        G = np.diag(system.friction_rates.astype(np.longdouble))
        G = V.T @ G @ V
        w = np.sqrt(np.where(held, modes.w2, 0))
        self.free = np.longdouble(0) if np.all(held) else np.max(w) + np.max(np.sum(np.abs(G), axis=1))
        self.scale = np.where(held, w, self.free)
        self.A = A = np.zeros((2 * n, 2 * n), np.longdouble)
        A[:n, n:], A[n:, :n], A[n:, n:] = np.diag(self.scale), -np.diag(w), -G
        # the larger of the two bounds |A|**2 by their product
        self.rate = np.sqrt(np.max(np.sum(np.abs(A), axis=0)) * np.max(np.sum(np.abs(A), axis=1)))
        self.pull, self.drift, self.condition = np.where(held, 0, modes.pull), 0 * w, 1.0
        carried = ~held & np.any(G != 0, axis=0)
        if np.any(self.pull[carried]):
            part = G[np.ix_(carried, carried)]
            self.condition = float(np.linalg.cond(part.astype(np.float64)))
            self.need(self.condition < WORST_DRIFT_CONDITION)
            for _ in range(DRIFT_REFINEMENTS):
                left = self.pull[carried] - part @ self.drift[carried]
                self.drift[carried] += np.linalg.solve(part.astype(np.float64), left.astype(np.float64))
            self.pull[carried] = 0
        self.away = np.where(held, -(G @ self.drift) / np.where(held, modes.w2, 1), 0)
        u, v = modes.start.u - self.away, modes.start.v - self.drift
        self.start = np.concatenate([self.scale * u, v])

    def at(self, t: Extended) -> States:
        n, z = self.system.n, np.empty((len(t), 2 * self.system.n), np.longdouble)
        for sign, mine in ((1, t[:, 0] >= 0), (-1, t[:, 0] < 0)):
            if np.any(mine):
                z[mine] = _from_start(sign * self.A, self.start, np.abs(t[mine]), self.rate)
        u = self.away + self.drift * t + self.pull * t * t / 2
        return self.modes.from_centres(z[:, :n] / self.scale + u, z[:, n:] + self.drift + self.pull * t)

    def doubt(self, t: np.longdouble) -> States:
        """A product of matrices (k, k) of norm 1 has an error of k**2/2 EPS (Higham, Accuracy and Stability
        of Numerical Algorithms, 3.13), and a power of a step at most the sum of the errors of its factors:
        each of 2 |A| t steps counts, with 4 such products for its series, A and the power.  Errors of modes
        act as forces.  Backwards in time friction amplifies.  The position of a free mode acts on nothing,
        and integrates velocities."""
        system, modes, n, duration = self.system, self.modes, self.system.n, np.abs(t)
        of_u, of_v, *_ = modes.start.sizes
        drift, away = (np.max(np.abs(x)) * np.ones(n) for x in (self.drift, self.away))
        of_u, of_v = of_u + self.condition * away, of_v + self.condition * drift
        size, begun = (np.sqrt(np.sum(x**2)) for x in (self.start, np.append(self.scale * of_u, of_v)))
        if t < 0:
            size, begun = (x * np.exp(np.max(system.friction_rates) * duration) for x in (size, begun))
        last = 2 * ((2 * n) ** 2 + ROUNDINGS) * EPS * (2 + 2 * self.rate * duration)
        known = (last + duration * np.max(modes.doubt / self.scale)) * size + ROUNDINGS * EPS * begun
        far = np.where(modes.w2 > 0, known, known * (1 + self.free * duration)) / self.scale
        moved = self.condition * (away + drift * duration) + np.abs(self.pull) * duration**2
        y = modes.spread(far + ROUNDINGS * EPS * (np.abs(modes.centre()) + moved))
        v = modes.spread(known + ROUNDINGS * EPS * (self.condition * drift + np.abs(self.pull) * duration))
        return y / modes.root_m, v * modes.root_m


def _series(A: Extended, z: Extended, t: Extended) -> Extended:
    """exp(A t) z for states z (..., 2n) at times t (..., 1) with |A t| up to 1/2."""
    out = z
    for j in range(SERIES_TERMS, 0, -1):
        out = z + (out @ A.T) * (t / j)
    return np.asarray(out)


def _from_start(A: Extended, start: Extended, t: Extended, rate: np.longdouble) -> Extended:
    """exp(A t) of one state (2n,) at times t (f, 1); at evenly spaced times by repeated doubling."""
    gaps = np.diff(t[:, 0])
    if len(t) <= RADIX_OF_STEPS or not np.ptp(gaps) <= 8 * EPS * np.max(t) < gaps[0]:
        return _propagated(A, np.broadcast_to(start, (len(t), len(start))), t, rate)
    out = np.empty((len(t), len(start)), np.longdouble)
    out[:1] = _propagated(A, start[None], t[:1], rate)
    unit = np.eye(len(A), dtype=np.longdouble)
    across = _propagated(A, unit, np.full((len(A), 1), (t[-1, 0] - t[0, 0]) / (len(t) - 1)), rate).T
    done = 1
    while done < len(t):
        more = out[: len(t) - done][:done]
        out[done : done + len(more)] = more @ across.T
        done, across = done + len(more), across @ across
    return out


def _propagated(A: Extended, z: Extended, t: Extended, rate: np.longdouble) -> Extended:
    """exp(A t) z of states (f, 2n) at times t (f, 1) >= 0."""
    step = 1 / (2 * rate)
    whole = np.minimum(np.floor(t / step), np.longdouble(RADIX_OF_STEPS) ** MOST_STEP_DIGITS - 1)
    z = _series(A, z, t - whole * step)
    unit = np.eye(len(A), dtype=np.longdouble)
    one = _series(A, unit, np.broadcast_to(step, (len(A), 1))).T
    while np.any(whole > 0):
        digit, power = np.fmod(whole, RADIX_OF_STEPS)[:, 0], unit
        for j in range(1, RADIX_OF_STEPS):
            power = power @ one
            z = np.where((digit == j)[:, None], z @ power.T, z)
        one, whole = power @ one, np.floor(whole / RADIX_OF_STEPS)
    return np.asarray(z)
