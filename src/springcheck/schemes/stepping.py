"""One step of any scheme, in the width of the numbers it is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from springcheck.physics.arrays import Floats, Force, Reals
from springcheck.physics.rods import Rods, Variation
from springcheck.schemes.catalogue import Scheme, number
from springcheck.schemes.kinds import Acting, Setting

Slope: TypeAlias = Callable[[Reals], tuple[Reals, bool]]
"""Positions (..., n) -> second derivatives there, and whether as matrices (..., n, n) instead of (..., n)."""


def weighted_sum(start: Reals, coefficients: Iterable[Any], values: Sequence[Reals]) -> Reals:
    """start plus the sum of c x; a coefficient of 0 adds nothing, whatever x is."""
    for c, x in zip(coefficients, values, strict=True):
        if c:
            start = start + c * x
    return start


def step(
    scheme: Scheme,
    q: Reals,
    p: Reals,
    *,
    h: Any,
    m: Reals,
    force: Force,
    stiffness: Reals | Slope | None = None,
    rate: Reals | None = None,
    parts: tuple[Force, ...] | None = None,
    turns: Reals | None = None,
    met: list[Reals] | None = None,
    near: Reals | None = None,
    draws: Sequence[Reals] | None = None,
    kT: Any = 0,
    hold: Rods | Variation | None = None,
) -> tuple[Reals, Reals]:
    """One step from (q, p), each (..., n), in the width of q.

    Implicit schemes need `stiffness`, the second derivatives of the potential: (n, n), or (n,) where no
    particle is joined to another; or a function of the position, where that bends.  Double precision is
    enough, because it only steers an iteration whose residual has the full width.  `rate` is
    `System.friction_rates`, left out where nothing is damped; `parts` are the forces of the slow and the fast
    springs, for the schemes that part them, and of magnetic fields, which turn velocities at the rates
    `turns` (n,).  `met` takes the position (..., n) of each evaluation of the
    force, in their order.  `near` (..., n) is where the step ends, as far as that is known: of several
    solutions of an implicit stage the one there is found; a force after the last drift is taken there, at the
    position that an engine has rounded.  `draws` are the standard normal numbers of each random stage in
    turn, `Scheme.draws` of (..., n), and kT [M L2/T2] is what they are drawn at; without them nothing random
    happens.  `hold` are the rods of a scene, which hold after every stage of a splitting.
    """
    width = q.dtype.type
    h, m = width(h), m.astype(width)
    if scheme.stages:
        rate = None if rate is None else rate.astype(width)
        last, each = np.zeros_like(p), iter(() if draws is None else draws)
        drifts = [kind.drifts for kind in scheme.kinds]
        for i, (kind, (_, c)) in enumerate(zip(scheme.kinds, scheme.stages, strict=True)):
            if kind.evaluates:
                there = near is not None and not any(drifts[i:])
                at = np.where(np.isfinite(near), near, q) if near is not None and there else q
                if met is not None:
                    met.append(at)
                last = acting(kind.evaluates, force, parts)(at, p)
            mine = next(each) if kind.random and draws is not None else None
            setting = Setting(m=m, rate=rate, force=last, draws=mine, kT=kT, turns=turns)
            before, part = q, number(c, width) * h
            q, p = kind.act(q, p, part, setting)
            if hold is not None:
                q, p = hold.drifted(before, q, p, part) if kind.drifts else (q, p)
                p = hold.projected(q, p)
        return q, p
    if not scheme.b:
        raise ValueError(f"{scheme.name} has no step that a force alone defines")
    forces: list[Reals] = []
    velocities: list[Reals] = []
    for row in scheme.a:
        past = [number(c, width) * h for c in row[: len(forces)]]
        qs, ps = weighted_sum(q, past, velocities), weighted_sum(p, past, forces)
        own: Any = row[len(forces)]
        if own:
            if stiffness is None:
                raise ValueError(f"{scheme.name} needs the stiffness of the scene")
            # the stage stands at its share of the step
            share = sum((number(c, width) for c in row), np.zeros((), width))
            guess = qs if near is None else np.where(np.isfinite(near), q + share * (near - q), qs)
            own = number(own, width) * h
            qs, ps = _implicit_stage(qs, ps, own, m, force, stiffness, rate, guess=guess)
        if met is not None:
            met.append(qs)
        forces.append(force(qs, ps))
        velocities.append(ps / m)
    weights = [number(c, width) * h for c in scheme.b]
    return weighted_sum(q, weights, velocities), weighted_sum(p, weights, forces)


def acting(terms: Acting, force: Force, parts: tuple[Force, ...] | None) -> Force:
    """The force of these terms."""
    if terms == "all":
        return force
    if terms == "potential":
        return lambda q, p: force(q, np.zeros_like(p))
    if terms == "magnetic":
        return parts[2] if parts is not None and len(parts) > 2 else lambda q, p: np.zeros_like(p)
    if parts is None:
        raise ValueError("this scheme needs the slow and the fast force apart")
    return parts[terms == "fast"]


def sparse_solver(stiffness: Any, factor: Reals) -> Callable[[Reals], Reals]:
    """x (..., n) -> (1 + factor K)**-1 x in double precision, for K a sparse array (n, n)."""
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    n = stiffness.shape[0]
    scaled = diags_array(np.broadcast_to(np.asarray(factor, np.float64), (n,))) @ stiffness
    factors = splu((diags_array(np.ones(n)) + scaled).tocsc())

    def solve(x: Reals) -> Reals:
        right = np.asarray(x, np.float64).reshape(-1, n)
        return np.asarray(factors.solve(np.ascontiguousarray(right.T)).T.reshape(x.shape))

    return solve


@lru_cache(maxsize=2)
def _inverse(matrix: bytes, n: int) -> Floats:
    """The inverse of a matrix (n, n), found once for all steps of a run."""
    return np.asarray(np.linalg.inv(np.frombuffer(matrix).reshape(n, n)))


def _implicit_stage(
    q: Reals,
    p: Reals,
    x: Any,
    m: Reals,
    force: Force,
    stiffness: Reals | Slope,
    rate: Reals | None,
    *,
    guess: Reals,
) -> tuple[Reals, Reals]:
    """Solve Q = q + x P/m, P = p + x F(Q, P) by Newton's iteration on Q.

    Friction is linear in P: P (1 + x rate) = p + x F(Q, 0), so it needs no iteration of its own.
    """
    none = np.zeros_like(p)
    slowed = 1 if rate is None else 1 + x * rate.astype(q.dtype)
    factor = x * x / (m * slowed)
    eps = np.finfo(q.dtype).eps
    scale = np.abs(q) + np.abs(x * p / m)
    last: Reals = np.full_like(q, np.inf)
    for _ in range(50):
        residual = guess - q - x * ((p + x * force(guess, none)) / slowed) / m
        k, joined = stiffness(guess) if callable(stiffness) else (stiffness, stiffness.ndim == 2)
        change = _newton(residual, k, joined, factor)
        guess = guess - change
        off = np.abs(change)
        # a component near 0 never has all its digits; at the last ones of what it is made of nothing shrinks
        going = (off > 4 * eps * np.abs(guess)) & (
            (off < last / 2) | (off > 1e3 * eps * (scale + np.abs(guess)))
        )
        if not np.any(going & np.isfinite(off)):
            break
        last = off
    return guess, np.asarray((p + x * force(guess, none)) / slowed)


def _newton(residual: Reals, stiffness: Reals, joined: bool, factor: Reals) -> Reals:
    """The residual (..., n) over 1 + factor K, with K (..., n, n) if joined, else its diagonal (..., n)."""
    if not joined:
        return np.asarray(residual / (1 + np.asarray(stiffness, residual.dtype) * factor))
    # it only steers: what counts is the residual, which may be of any size that no double has
    size = np.max(np.abs(residual), axis=-1, keepdims=True)
    size = np.where((size > 0) & np.isfinite(size), size, 1)
    residual = residual / size
    if not isinstance(stiffness, np.ndarray):
        solve = sparse_solver(stiffness, factor)
        return np.asarray(solve(residual) * size)
    matrix = np.eye(residual.shape[-1]) + np.asarray(stiffness * factor[:, None], np.float64)
    right = residual.astype(np.float64)
    try:
        if matrix.ndim == 2:
            found = right @ _inverse(np.ascontiguousarray(matrix).tobytes(), len(matrix)).T
            return np.asarray(found * size)
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0] * size)
    except np.linalg.LinAlgError:
        return np.full_like(residual, np.nan)
