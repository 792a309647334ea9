"""One step of any scheme, in the width of the numbers it is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np

from springcheck.physics.arrays import Force, Reals
from springcheck.schemes.catalogue import Scheme, number
from springcheck.schemes.kinds import Acting, Setting

Slope: TypeAlias = Callable[[Reals], tuple[Reals, bool]]
"""Positions (..., n) -> second derivatives there, and whether as matrices (..., n, n) instead of (..., n)."""

Rate: TypeAlias = "Reals | Callable[[Reals, Reals], tuple[Reals, Reals, Reals]]"
"""Rates of friction (n,) [1/T], or a function of an implicit stage's end and start: see `Law.rates`."""


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
    rate: Rate | None = None,
    parts: tuple[Force, Force] | None = None,
    met: list[Reals] | None = None,
    near: Reals | None = None,
) -> tuple[Reals, Reals]:
    """One step from (q, p), each (..., n), in the width of q.

    Implicit schemes need `stiffness`, the second derivatives of the potential: (n, n), or (n,) where no
    particle is joined to another; or a function of the position, where that bends.  Double precision is
    enough, because it only steers an iteration whose residual has the full width.  `rate` is
    `System.friction_rates`, left out where nothing is damped, or for stages without an exponential of it a
    function of the position; `parts` are the forces of the slow and the fast springs, for the schemes that
    part them.  `met` takes the position (..., n) of each evaluation of the force, in their order.  `near`
    (..., n) is where the step ends, as far as that is known: of several solutions of an implicit stage the
    one there is found; a force after the last drift is taken there, at the position that an engine has
    rounded.
    """
    width = q.dtype.type
    h, m = width(h), m.astype(width)
    if scheme.stages:
        rate = None if rate is None or callable(rate) else rate.astype(width)
        last = np.zeros_like(p)
        drifts = [kind.drifts for kind in scheme.kinds]
        for i, (kind, (_, c)) in enumerate(zip(scheme.kinds, scheme.stages, strict=True)):
            if kind.evaluates:
                there = near is not None and not any(drifts[i:])
                at = np.where(np.isfinite(near), near, q) if near is not None and there else q
                if met is not None:
                    met.append(at)
                last = acting(kind.evaluates, force, parts)(at, p)
            setting = Setting(m=m, rate=rate, force=last)
            q, p = kind.act(q, p, number(c, width) * h, setting)
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
            own, begun = number(own, width) * h, ps
            qs, ps = _implicit_stage(qs, ps, own, m, force, stiffness, rate, guess=guess)
        if met is not None:
            met.append(qs)
        # a friction that depends on the position may be far larger than the momentum that it leaves
        forces.append((ps - begun) / own if own and callable(rate) else force(qs, ps))
        velocities.append(ps / m)
    weights = [number(c, width) * h for c in scheme.b]
    return weighted_sum(q, weights, velocities), weighted_sum(p, weights, forces)


def acting(terms: Acting, force: Force, parts: tuple[Force, Force] | None) -> Force:
    """The force of these terms."""
    if terms == "all":
        return force
    if terms == "potential":
        return lambda q, p: force(q, np.zeros_like(p))
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


Made = TypeVar("Made")


class OfLast(Generic[Made]):
    """What is made of a stiffness (n, n) and a factor (n,), kept for the two that were asked for last: of a
    linear scene all steps have the same."""

    def __init__(self, make: Callable[[Any, Reals], Made]) -> None:
        self._make = make
        self._last: list[tuple[Any, Reals, Made]] = []

    def __call__(self, stiffness: Any, factor: Reals) -> Made:
        of = np.array(np.broadcast_to(factor, stiffness.shape[-1:]))
        for known, its, made in self._last:
            if known is stiffness and np.array_equal(its, of):
                return made
        found = self._make(stiffness, of)
        self._last = [(stiffness, of, found), *self._last[:1]]
        return found


@OfLast
def _inverse(stiffness: Reals, factor: Reals) -> Callable[[Reals], Reals]:
    """x (..., n) -> (1 + factor K)**-1 x in double precision."""
    if len(factor) > MOST_INVERTED:
        from scipy.sparse import csr_array

        return sparse_solver(csr_array(np.asarray(stiffness, np.float64)), factor)
    inverse = np.linalg.inv(np.eye(len(factor)) + np.asarray(stiffness * factor[:, None], np.float64))
    return lambda x: np.asarray(x.astype(np.float64) @ inverse.T)


MOST_INVERTED = 256
"""Joined particles up to which a step multiplies by the inverse of a matrix; of more it is sparse mostly."""


def _implicit_stage(
    q: Reals,
    p: Reals,
    x: Any,
    m: Reals,
    force: Force,
    stiffness: Reals | Slope,
    rate: Rate | None,
    *,
    guess: Reals,
) -> tuple[Reals, Reals]:
    """Solve Q = q + x P/m, P = p + x F(Q, P) by Newton's iteration on Q.

    Friction is linear in P: P (1 + x rate) = p + x F(Q, 0), so it needs no iteration of its own.  One that
    depends on Q has that equation multiplied by 1 + x rate, which may vanish on the way: a polynomial in Q.
    """
    none = np.zeros_like(p)
    slowed: Any = 1
    if rate is not None and not callable(rate):
        slowed = 1 + x * rate.astype(q.dtype)
    factor = x * x / (m * slowed)
    eps = np.finfo(q.dtype).eps
    scale = np.abs(q) + np.abs(x * p / m)
    last: Reals = np.full_like(q, np.inf)
    done = np.zeros(np.shape(q), bool)
    for count in range(MOST_NEWTON_STEPS):
        if callable(rate):
            if count == MOST_NEWTON_STEPS // 2:
                guess = _bracketed(lambda at: _braked(at, q, p, x, m, force, rate)[0], guess)
            lacks, steep, size = _braked(guess, q, p, x, m, force, rate)
            residual, factor = lacks / steep, x * x / (m * steep)
            done = np.abs(lacks) <= 2 * eps * size
        else:
            residual = guess - q - x * ((p + x * force(guess, none)) / slowed) / m
        k, joined = stiffness(guess) if callable(stiffness) else (stiffness, stiffness.ndim == 2)
        change = _newton(residual, k, joined, factor)
        guess = guess - change
        off = np.abs(change)
        # a component near 0 never has all its digits: its change stalls at the rounding of its terms
        going = (off > 4 * eps * np.abs(guess)) & (
            (off < last / 2) | (off > 1e3 * eps * (scale + np.abs(guess)))
        )
        if not np.any(going & np.isfinite(off) & ~done):
            break
        last = off
    if callable(rate):
        braked, bent, lost = rate(guess, q)
        slowed, moved, p = 1 + x * braked, guess - q, p - m * lost
        # near a zero of 1 + x rate, in a jump, the displacement determines the velocity better than forces
        felt = (1 + np.abs(x * braked)) * np.abs(moved) + np.abs(x * bent * guess)
        by_way = felt > np.abs(slowed) * (np.abs(guess) + np.abs(q))
        with np.errstate(all="ignore"):
            by_force = (p + x * force(guess, none)) / slowed
        return guess, np.where(by_way, moved * m / x, by_force)
    return guess, np.asarray((p + x * force(guess, none)) / slowed)


MOST_NEWTON_STEPS = 50


def _braked(
    at: Reals, q: Reals, p: Reals, x: Any, m: Reals, force: Force, rate: Callable[..., Any]
) -> tuple[Reals, Reals, Reals]:
    """Residual of an implicit stage that ends in `at`, its derivative without the stiffness, and the size of
    the terms that cancel in it, (..., n)."""
    braked, bent, lost = rate(at, q)
    slowed, moved, kick = 1 + x * braked, at - q, x * force(at, np.zeros_like(p))
    lacks = moved * slowed + x * (lost - (p + kick) / m)
    felt = np.abs(slowed) * (np.abs(at) + np.abs(q)) + np.abs(moved) * (1 + np.abs(x * braked))
    size = felt + np.abs(x) * (np.abs(lost) + (np.abs(p) + np.abs(kick)) / m)
    return np.asarray(lacks), np.asarray(slowed + x * bent), np.asarray(size)


def _bracketed(lacks: Callable[[Reals], Reals], guess: Reals) -> Reals:
    """A zero of a function that increases at large arguments, component by component: the next one downhill.

    Where a solution ceases to exist, as at a fold, Newton's iteration started there oscillates.
    """
    sign, near = np.sign(lacks(guess)), guess
    width: Reals = np.maximum(np.abs(guess), np.finfo(guess.dtype).tiny) / 1024
    for _ in range(64):
        on = np.sign(lacks(guess - sign * width)) == sign
        near, width = np.where(on, guess - sign * width, near), np.where(on, 2 * width, width)
    far = guess - sign * width
    for _ in range(64):
        middle = (near + far) / 2
        on = np.sign(lacks(middle)) == sign
        near, far = np.where(on, middle, near), np.where(on, far, middle)
    return np.asarray(far)


def _newton(residual: Reals, stiffness: Reals, joined: bool, factor: Reals) -> Reals:
    """The residual (..., n) over 1 + factor K, with K (..., n, n) if joined, else its diagonal (..., n)."""
    if not joined:
        return np.asarray(residual / (1 + np.asarray(stiffness, residual.dtype) * factor))
    # this quotient only steers the iteration: the residual decides, and may lie beyond the range of doubles
    size = np.max(np.abs(residual), axis=-1, keepdims=True)
    size = np.where((size > 0) & np.isfinite(size), size, 1)
    residual = residual / size
    if not isinstance(stiffness, np.ndarray):
        solve = sparse_solver(stiffness, factor)
        return np.asarray(solve(residual) * size)
    try:
        if stiffness.ndim == np.ndim(factor) + 1 == 2:
            return np.asarray(_inverse(stiffness, factor)(residual) * size)
        matrix = np.eye(residual.shape[-1]) + np.asarray(stiffness * factor[..., None], np.float64)
        right = residual.astype(np.float64)
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0] * size)
    except (np.linalg.LinAlgError, RuntimeError):
        # singular, as dense and as sparse solvers say it
        return np.full_like(residual, np.nan)
