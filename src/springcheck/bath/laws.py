"""The exact law of a random scheme on springs: map, noise, stationary covariance, and its moments.

One step of a linear random scheme is z' = A z + G xi with z = (q, p) and draws xi of variance 1; one with
collisions takes one of several such maps, each with a probability.  A and G come from stepping unit states
and unit draws, so a scheme is written down once.  The covariance is then S = A S A' + G G' (discrete
Lyapunov), averaged over the maps; the rest follows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from springcheck.bath.catalogue import Thermostat
from springcheck.bath.stepper import Stepper
from springcheck.physics.arrays import ROUNDOFF, Extended, Floats, Reals

UNKNOWN_FROM = 1e-6
"""Relative error from which on a covariance is not reported."""
AT_A_LIMIT = 1e-5
"""Growth that may be due to rounding."""
REFINEMENTS = 6
"""Steps of refinement, each of which gains the digits that 1 - A A' has in double precision."""


def _squared(a: Any) -> Any:
    """What matrices (n, d, d) make of products of two numbers, (n, d d, d d)."""
    n, d = a.shape[:2]
    return np.einsum("nij,nkl->nikjl", a, a).reshape(n, d * d, d * d)


def _gaussian(S: Any) -> Any:
    """Fourth moments (n, d d, d d) of Gaussian numbers of covariances (n, d, d) (Isserlis)."""
    n, d = S.shape[:2]
    pairs = sum(np.einsum(f"n{x},n{y}->nijkl", S, S) for x, y in (("ij", "kl"), ("ik", "jl"), ("il", "jk")))
    return np.reshape(pairs, (n, d * d, d * d))


@dataclass(frozen=True, kw_only=True, eq=False)
class Law:
    """A random scheme on n separate springs m, k (n,), at friction rate gamma [1/T], one or (n,) of them,
    and thermal energy kT."""

    scheme: Thermostat
    h: float
    m: Reals
    k: Reals
    rate: Reals | float
    thermal: float

    @property
    def collision(self) -> float:
        """The chance of a collision a step, 1 - exp(-gamma h), of one rate."""
        return float(-np.expm1(-self.rate * self.h))

    @cached_property
    def _maps(self) -> tuple[tuple[Any, Extended, Extended], ...]:
        """The affine maps of (q, p, carried draws) that a step may take: the chance of each, one or
        (n, 1, 1), A (n, d, d), and G (n, d, fresh draws)."""
        if not self.scheme.collides:
            return ((1.0, *self._map(hit=False)),)
        x = np.asarray(self.rate * self.h, np.longdouble).reshape((-1, 1, 1) if np.ndim(self.rate) else ())
        return (np.exp(-x), *self._map(hit=False)), (-np.expm1(-x), *self._map(hit=True))

    def _map(self, *, hit: bool) -> tuple[Extended, Extended]:
        m, k = (np.atleast_1d(np.asarray(x, np.longdouble)) for x in (self.m, self.k))
        r, c, n = self.scheme.draws, self.scheme.carried, len(m)
        q, p, *draws = np.eye(2 + r, dtype=np.longdouble)[:, :, None] * np.ones(n)
        stepper = Stepper(
            self.scheme, h=self.h, m=m, rate=self.rate, thermal=self.thermal, width=np.longdouble
        )
        out = np.zeros((n, 2 + c, 2 + r), np.longdouble)
        out[:, :2] = np.stack(stepper(q, p, lambda q, p: -k * q, draws, hit), axis=0).transpose(2, 0, 1)
        # the last draws of this step are the first of the next
        out[:, 2 + np.arange(c), 2 + r - c + np.arange(c)] = 1
        return out[:, :, : 2 + c], out[:, :, 2 + c :]

    @property
    def A(self) -> Extended:  # noqa: N802 - the letter of the propagator
        """The propagator (n, 2, 2) of the means."""
        return np.asarray(sum(chance * A[:, :2, :2] for chance, A, _ in self._maps))

    @property
    def G(self) -> Extended:  # noqa: N802 - the letter of the noise
        """The noise (n, 2, draws) of the last map: the only one, or that of a collision."""
        _, A, fresh = self._maps[-1]
        return np.concatenate([A[:, :2, 2:], fresh[:, :2]], axis=2)

    @cached_property
    def _even(self) -> Floats:
        """Stationary covariance of (q, p, carried draws) in units of `_scale`; infinite where there is none,
        NaN where its relative error exceeds `UNKNOWN_FROM`.

        With little friction, or much, 1 - A A' nearly cancels: it is computed in extended precision, as are
        the residuals of the iterative refinement.  The carried draws keep their unit covariance.
        """
        n, d = self._maps[0][1].shape[:2]
        right = np.asarray(sum(c * (g @ g.transpose(0, 2, 1)) for c, _, g in self._scaled)).reshape(n, d * d)
        left = np.eye(d * d) - self._moments
        rough, bound = left.astype(np.float64), np.atleast_1d(np.asarray(self.k)) != 0
        # at a limit of stability three roots of a map meet, and are known to the third root of a rounding
        none = np.where(bound & ~(self.growth > 1 + AT_A_LIMIT), np.nan, np.inf)
        out = none[:, None, None] * np.ones((d, d))
        i = np.flatnonzero(np.isfinite(rough).all(axis=(1, 2)))
        i = i[np.linalg.det(rough[i]) != 0]
        inverse = np.linalg.inv(rough[i])
        S, change, noise = *np.zeros((2, len(i), d * d, 1), np.longdouble), right[i][..., None]
        with np.errstate(all="ignore"):
            for _ in range(REFINEMENTS):
                S = S + (change := inverse @ (noise - left[i] @ S))
            lost = ROUNDOFF * np.abs(inverse) @ (np.abs(self._moments[i]) @ np.abs(S) + noise)
            off, S = (x.reshape(-1, d, d).astype(np.float64) for x in (lost + np.abs(change), S))
            size = np.sqrt(np.abs(np.diagonal(S, axis1=1, axis2=2)))
            unit = size[:, :, None] * size[:, None, :]
        known = np.all(off <= UNKNOWN_FROM * unit, axis=(1, 2))
        out[i[~known]] = np.nan
        # it is one where the step is stable, and only there (Lyapunov)
        known[known] = np.linalg.eigvalsh((S / unit)[known])[:, 0] > 0
        out[i[known]] = S[known]
        return out

    @cached_property
    def _covariance(self) -> Floats:
        """The same in units of the scene."""
        with np.errstate(over="ignore"):
            return np.asarray(self._even * self._scale[:, :, None] * self._scale[:, None, :], np.float64)

    @cached_property
    def _moments(self) -> Extended:
        """The map of second moments of (q, p, carried draws), without noise (n, d d, d d)."""
        return np.asarray(sum(chance * _squared(a) for chance, a, _ in self._scaled))

    @cached_property
    def _scaled(self) -> list[tuple[Any, Extended, Extended]]:
        """The maps of `_maps` in units of `_scale`."""
        scale = self._scale[:, :, None]
        return [(chance, A * self._scale[:, None, :] / scale, G / scale) for chance, A, G in self._maps]

    @property
    def _excess(self) -> Floats:
        """Stationary <z_i z_j z_k z_l> beyond a Gaussian's (n, d d, d d), in units of `_scale`; NaN where it
        is unbounded.  A map leaves a Gaussian motion Gaussian, with its own covariance S_b: a mixture has
        K = sum chance (A x A x A x A K + Gaussian(S_b)) - Gaussian(S), less 6/5 G x G x G x G of uniform
        draws, of fourth moment 9/5 for 3.
        """
        S, (n, d) = self._even, self._scale.shape
        if len(self._scaled) == 1 and not self.scheme.uniform:
            return np.zeros((n, d * d, d * d))
        kept, added, out = 0 * np.eye(d**4), -_gaussian(S), np.full((n, d**4, 1), np.nan)
        for chance, a, g in self._scaled:
            kept = kept + chance * _squared(_squared(a))
            added = added + chance * _gaussian(a @ S @ a.transpose(0, 2, 1) + g @ g.transpose(0, 2, 1))
            if self.scheme.uniform:
                both = np.einsum("nix,njx->nijx", g, g).reshape(n, d * d, -1)
                added = added - 1.2 * chance * (both @ both.transpose(0, 2, 1))
        kept, added = np.asarray(kept, np.float64), np.asarray(added, np.float64).reshape(n, d**4, 1)
        i = np.flatnonzero(np.isfinite(S).all(axis=(1, 2)))
        i = i[np.max(np.abs(np.linalg.eigvals(kept[i])), axis=-1, initial=0) < 1]
        out[i] = np.linalg.solve(np.eye(d**4) - kept[i], added[i])
        return out.reshape(n, d * d, d * d)

    @property
    def growth(self) -> Floats:
        """Spectral radius of the map of second moments (n,), stable below 1; infinite where it overflows."""
        moments = self._moments.astype(np.float64)
        out = np.full(len(moments), np.inf)
        finite = np.isfinite(moments).all(axis=(1, 2))
        out[finite] = np.max(np.abs(np.linalg.eigvals(moments[finite])), axis=-1)
        return out

    @property
    def slowest(self) -> float:
        """Spectral radius of the mean map: what a step leaves of the slowest part of the motion."""
        return float(np.max(np.abs(np.linalg.eigvals(self.A.astype(np.float64)))))

    @cached_property
    def _scale(self) -> Extended:
        """Sizes of q, p and draws in thermal motion (n, d)."""
        m, k, thermal = (np.atleast_1d(np.asarray(x, np.longdouble)) for x in (self.m, self.k, self.thermal))
        q = np.sqrt(thermal / np.where(k > 0, k, m / np.longdouble(self.h) ** 2))
        return np.stack([q, np.sqrt(m * thermal), *[np.ones_like(q)] * self.scheme.carried], axis=-1)

    @property
    def covariance(self) -> Floats:
        """Stationary covariance of (q, p), (n, 2, 2); infinite where the step has none."""
        return self._covariance[:, :2, :2]

    @cached_property
    def _mean(self) -> Floats:
        """The map of the means of (q, p, carried draws), (n, d, d)."""
        return np.asarray(sum(chance * A for chance, A, _ in self._maps), np.float64)

    @cached_property
    def _noise(self) -> Floats:
        """Covariance (n, d, d) of what a step adds to that: by its draws, and by the choice of its map."""
        S, mean, total = self._covariance, self._mean, 0 * self._mean
        for chance, A, G in self._maps:
            # of one map alone none of the latter, whether it has a covariance or not
            choice = (A - mean) @ S @ (A - mean).transpose(0, 2, 1) if self.scheme.collides else 0
            total += np.asarray(chance * (G @ G.transpose(0, 2, 1) + choice), np.float64)
        return total

    def apart(self, steps: Any) -> tuple[Floats, Floats]:
        """Map (n, 2, 2) of so many steps (n,), and covariance of their noise (n, 2, 2), with the part of the
        carried draws that is uncorrelated with q and p."""
        # noise of collisions is not normal, but has these second moments
        A, W, every = self._mean, self._noise, np.asarray(steps)[:, None, None]
        B, Q = A, W
        for j in range(1, int(np.max(every))):
            B = np.where(j < every, A @ B, B)
            Q = np.where(j < every, A @ Q @ A.transpose(0, 2, 1) + W, Q)
        if not self.scheme.carried:
            return B, Q
        S = self._covariance
        known = S[:, 2:, :2] @ np.linalg.inv(S[:, :2, :2])
        unknown = S[:, 2:, 2:] - known @ S[:, :2, 2:]
        D = B[:, :2, 2:]
        return B[:, :2, :2] + D @ known, Q[:, :2, :2] + D @ unknown @ D.transpose(0, 2, 1)

    @property
    def configurational(self) -> Floats:
        """k <q**2> / kT (n,): the configurational temperature over that of the bath."""
        return np.where(np.atleast_1d(self.k) > 0, self._even[:, 0, 0], np.nan)

    @property
    def kinetic(self) -> Floats:
        """<p**2> / m kT (n,): the kinetic temperature over the bath's, by the momenta that are stored."""
        return self._even[:, 1, 1]

    @property
    def diffusion(self) -> Floats:
        """D m gamma / kT of particles that no spring holds (n,); 1 is exact.

        Half of what a step adds to <q**2> in the long run, the spectral density of q' - q at frequency 0:
        C(0) + 2 sum C(j), with momenta that forget as the mean of A has it.
        """
        # nothing depends on q itself: all is a map of (p, carried draws), in extended precision where next to
        # nothing is lost in a step
        free = replace(self, k=np.zeros_like(self.m))
        maps = [(chance, A[:, :, 1:], G) for chance, A, G in free._maps]
        mean = sum(chance * A for chance, A, _ in maps)
        noise = sum(chance * (G @ G.transpose(0, 2, 1)) for chance, _, G in maps)
        n, _, d = mean.shape
        pairs = sum(chance * _squared(A[:, 1:]) for chance, A, _ in maps)

        def without(map_: Any, right: Any) -> Floats:
            """What adds up to the right-hand side where a step keeps so much of it."""
            left = np.eye(map_.shape[-1]) - map_
            return np.linalg.solve(left.astype(np.float64), right.astype(np.float64))

        S = without(pairs, noise[:, 1:, 1:].reshape(n, d * d, 1)).reshape(n, d, d)
        # moments of q' - q and (p', carried draws)
        N = sum(chance * (A @ S @ A.transpose(0, 2, 1)) for chance, A, _ in maps) + noise
        rate = (N[:, :1, :1] + 2 * mean[:, :1] @ without(mean[:, 1:], N[:, 1:, :1]))[:, 0, 0]
        return np.asarray(rate * self.m * self.rate / (2 * self.h * self.thermal), np.float64)

    def error_of_variances(self, frames: int, every: int = 1) -> Floats:
        """Relative standard errors of <q**2> and <p**2> over so many frames, `every` steps apart, (n, 2).

        Var of the mean of x**2 is 1/N sum (1 - |j|/N) c(j), c(j) the covariance of squares j frames apart:
        what M**j, of second moments, makes of c(0), 2 C(0)**2 of a Gaussian x.  The sums go by doubling.
        """
        with np.errstate(all="ignore"):
            n, d = self._mean.shape[:2]
            M = np.linalg.matrix_power(self._moments, every).astype(np.float64)
            total, by_lag, power, count = np.eye(d * d) + 0 * M, 0 * M, M, 1
            for bit in f"{frames:b}"[1:]:
                by_lag = by_lag + power @ (by_lag + count * total)
                total, power, count = total + power @ total, power @ power, 2 * count
                if bit == "1":
                    total, by_lag, power, count = total + power, by_lag + count * power, power @ M, count + 1
            S, K, out = self._even, self._excess, np.empty((n, 2))
            for i in range(2):
                j = i * d + i
                pair = 2 * np.einsum("ni,nj->nij", S[:, :, i], S[:, :, i]).reshape(n, d * d) + K[:, :, j]
                lags = ((total - by_lag / frames) @ pair[..., None])[:, j, 0]
                out[:, i] = np.sqrt((2 * lags - pair[:, j]) / frames) / S[:, i, i]
        return out
