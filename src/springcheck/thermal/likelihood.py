"""Thermostats by the Gaussian likelihood of an oscillator's states in (h w)**2, gamma h and kT/m.

The second moments of the frames are sufficient.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from typing import Any

import numpy as np

from springcheck.physics.arrays import Floats
from springcheck.thermal.catalogue import THERMOSTATS
from springcheck.thermal.laws import Law

ODDS = float(np.log(1e6))
"""Nats by which one scheme must beat every other to be named."""

TWO = ("obabo", "oabao", "boaob", "vanden-eijnden-ciccotti", "baoab-respa2")


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A scheme that may have made the states, and the numbers that it would mean, with standard errors; an
    error of 0 is rounding, and NaN is not known."""

    scheme: str
    omega: float = nan
    omega_error: float = nan
    friction: float = nan
    friction_error: float = nan
    thermal: float = nan
    """kT/m [L2/T2]."""
    thermal_error: float = nan
    fast: float = 0.0
    """Share of fast terms in omega**2."""
    nats: float = 0.0
    """By how much its likelihood falls short of the best one's."""


def likely(
    names: tuple[str, ...], q: Floats, v: Floats, h: float, *, turn: float | None = None
) -> list[Candidate]:
    """Schemes by the likelihood of their innovations; `turn` is (h w)**2 where it is known.

    None where every one falls short of a free map and a free noise by more than chance allows.
    """
    from scipy.optimize import minimize

    moments, n = _moments(q, v)
    single = names[0] not in TWO

    def share(at: Floats) -> float:
        # the last number of a scheme that takes them apart: fast terms over slow ones
        return float(1 / (1 + np.exp(-at[-1])))

    def minus(name: str, at: Floats) -> float:
        a = turn if turn is not None else float(np.exp(at[2]))
        k = a / h**2 * np.ones(1)
        fast = share(at) if THERMOSTATS[name].splits else 0.0
        law = Law(
            scheme=THERMOSTATS[name], h=h, m=np.ones(1), k=k, rate=float(np.exp(at[0])) / h,
            thermal=float(np.exp(at[1])), fast=fast * k,
        )  # fmt: skip
        A, G = law.A[0].astype(float), law.G[0].astype(float)
        Q = G @ G.T
        if not single:
            return _nats(A, Q, moments, n)
        # the position says what the momentum says
        over = np.concatenate([np.eye(2), -A], axis=1)
        value = np.log(Q[1, 1]) + (over @ moments @ over.T)[1, 1] / Q[1, 1]
        return n / 2 * float(value) if np.isfinite(value) else 1e300

    A = moments[:2, 2:] @ np.linalg.inv(moments[2:, 2:])
    decay = min(max(float(np.linalg.det(A)), 1e-6), 1 - 1e-6)
    a = min(max(2 * (1 - float(np.trace(A)) / (1 + decay)), 1e-6), 3.9)
    start: Any = np.log([-np.log(decay), np.var(v), a][: 2 if turn is not None else 3])
    found = []
    for name in names:
        with np.errstate(all="ignore"):
            of_name: Any = partial(minus, name)
            how = {"xatol": 1e-7, "fatol": 1e-7, "maxiter": 2000}
            first = [*start, 0.0] if THERMOSTATS[name].splits else start
            fit: Any = minimize(of_name, first, method="Nelder-Mead", options=how)  # type: ignore[call-overload]
            errors = _errors(of_name, fit.x)
        of_a = turn if turn is not None else float(np.exp(fit.x[2]))
        w, rate, thermal = float(np.sqrt(of_a) / h), float(np.exp(fit.x[0]) / h), float(np.exp(fit.x[1]))
        found.append(
            Candidate(
                scheme=name,
                omega=w,
                omega_error=0.0 if turn is not None else float(w * errors[2] / 2),
                friction=rate,
                friction_error=float(rate * errors[0]),
                thermal=thermal,
                thermal_error=float(thermal * errors[1]),
                fast=share(fit.x) if THERMOSTATS[name].splits else 0.0,
                nats=float(fit.fun),
            )
        )
    best = min(y.nats for y in found)
    if not single:
        free = moments[:2, :2] - A @ moments[2:, :2]
        floor = n / 2 * (float(np.log(np.linalg.det(free))) + 2)
        # seven numbers less three or four: 25 nats more come about by chance once in 1e9 times
        if not best - floor < 25:
            return []
    return sorted((replace(y, nats=y.nats - best) for y in found), key=lambda y: y.nats)


def sparser(best: Candidate, q: Floats, v: Floats, h: float) -> tuple[str, int] | None:
    """The first scheme of which every few steps fall short of the best candidate by less than `ODDS`.

    What several steps do is near the exact flow whatever the scheme, and two draws suffice for any of them.
    """
    from scipy.optimize import minimize

    moments, n = _moments(q, v)
    start = np.log([best.friction * h, best.thermal, (best.omega * h) ** 2])

    def minus(name: str, every: int, at: Floats, fast: float = 0.0) -> float:
        x, thermal, a = np.exp(at)
        k = a / h**2 * np.ones(1)
        law = Law(
            scheme=THERMOSTATS[name], h=h / every, m=np.ones(1), k=k, rate=float(x) / h,
            thermal=float(thermal), fast=fast * k,
        )  # fmt: skip
        S = law.covariance[0]
        if not np.isfinite(S).all():
            return 1e300
        A = law.autocovariance(every)[0] @ np.linalg.inv(S)
        return _nats(A, S - A @ S @ A.T, moments, n)

    least = minus(best.scheme, 1, start, best.fast)
    how = {"xatol": 1e-3, "fatol": 1e-2, "maxiter": 300}
    for every in (2, 3, 4, 8):
        for name in (x for x, one in THERMOSTATS.items() if not (one.rescales or one.splits)):
            with np.errstate(all="ignore"):
                fit: Any = minimize(partial(minus, name, every), start, method="Nelder-Mead", options=how)  # type: ignore[call-overload]
            if fit.fun - least < ODDS:
                return name, every
    return None


def _moments(q: Floats, v: Floats) -> tuple[Floats, int]:
    """Second moments of (x', v', x, v), (4, 4), and of how many frames."""
    z = np.stack([q - np.mean(q), v - np.mean(v)])
    n, both = z.shape[1] - 1, np.concatenate([z[:, 1:], z[:, :-1]])
    return np.asarray(both @ both.T / n), n


def _nats(A: Floats, Q: Floats, moments: Floats, n: int) -> float:
    """Minus the logarithm of the likelihood of n frames of these moments, of map A and covariance Q."""
    over = np.concatenate([np.eye(2), -A], axis=1)
    seen = over @ moments @ over.T
    value = np.log(np.linalg.det(Q)) + np.trace(np.linalg.solve(Q, seen))
    return n / 2 * float(value) if np.isfinite(value) else 1e300


def _errors(minus: Callable[[Floats], float], at: Floats) -> Floats:
    """Standard errors by the curvature of a log-likelihood."""
    step, n = 1e-3, len(at)
    unit = np.eye(n) * step
    curved = np.array(
        [
            [minus(at + e + g) - minus(at + e - g) - minus(at - e + g) + minus(at - e - g) for g in unit]
            for e in unit
        ]
    ) / (4 * step * step)
    try:
        return np.asarray(np.sqrt(np.abs(np.diag(np.linalg.inv(curved)))))
    except np.linalg.LinAlgError:
        return np.full(n, nan)
