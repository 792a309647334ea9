"""What one step of a scheme can round: running error bounds, and how many roundings there are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.physics.arrays import Force, Reals
from springcheck.schemes.catalogue import Scheme, number
from springcheck.schemes.stepping import sparse_solver, weighted_sum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Met:
    """One evaluation of the force within a step: what bounds its rounding there, and its slope.

    `magnitude` is made by `System.magnitude`, near the position `q` (..., n) of the evaluation.
    `stiffness` are the second derivatives of the potential there, (..., n) where no particle is joined to
    another, else (..., n, n) or (n, n); only an implicit stage needs them.  Without `q` the scene is
    linear, and what bounds the solution stands for it.
    """

    magnitude: Force
    stiffness: Any = None
    joined: bool = False
    q: Reals | None = None


def magnitude_step(
    scheme: Scheme,
    q: Reals,
    p: Reals,
    *,
    h: float,
    m: Reals,
    met: Iterable[Met],
    rate: Reals | None = None,
) -> tuple[Reals, Reals]:
    """What bounds the rounding of `step`: the same step with every difference taken as a sum.

    `met` has one entry for each evaluation of the force, in their order.
    """
    direction = np.sign(h)
    # in extended precision: the square of a step may leave the range of a double
    q, p, size = np.abs(q), np.abs(p), np.abs(np.longdouble(h))
    each = iter(met)
    if scheme.stages:
        stages: list[tuple[str, float]] = [(kind, abs(number(c, np.float64))) for kind, c in scheme.stages]
        last = np.zeros_like(p)
        for kind, c in stages:
            if kind == "drift":
                q = q + c * size * p / m
            elif kind == "friction":
                # a rounding of x in exp(-x) costs x exp(-x) p, and the decayed p is exp(-x) p: the sum is
                # below p forwards in time; backwards p grows first
                x = np.zeros_like(m) if rate is None else -c * direction * size * rate
                p = p * np.where(x > 0, (1 + x) * np.exp(x), 1)
            elif kind == "implicit-friction":
                # backwards in time 1 - h c/m cancels
                x = np.zeros_like(m) if rate is None else c * direction * size * rate
                p = p * (1 + np.abs(x)) / np.abs(1 + x)
            else:
                if kind != "held":
                    last = next(each).magnitude(q, np.zeros_like(p) if kind == "pull" else p)
                p = p + c * size * last
        return q, p
    forces: list[Reals] = []
    velocities: list[Reals] = []
    for row in scheme.a:
        here = next(each)
        past = [abs(float(c)) * size for c in row[: len(forces)]]
        qs, ps = weighted_sum(q, past, velocities), weighted_sum(p, past, forces)
        own = abs(float(row[len(forces)])) * size
        if own:
            slowed = np.ones_like(m) if rate is None else np.abs(1 + direction * own * rate)
            qs, ps = _implicit_stage(here, qs, ps, own, m, slowed)
        forces.append(here.magnitude(qs, ps))
        velocities.append(ps / m)
    weights = [abs(float(c)) * size for c in scheme.b]
    return weighted_sum(q, weights, velocities), weighted_sum(p, weights, forces)


def _implicit_stage(here: Met, q: Reals, p: Reals, x: Reals, m: Reals, slowed: Reals) -> tuple[Reals, Reals]:
    """What bounds the rounding of the solution of Q = q + x P/m, slowed P = p + x F(Q).

    Whatever solver finds Q leaves a residual of a few roundings of what the equation adds up, at Q; the
    inverse of its Jacobian A = 1 + x**2 K/(m slowed) carries that into Q (Higham, Accuracy and Stability of
    Numerical Algorithms, 7.2).  An engine may as well find P first, and drift.
    """
    if here.stiffness is None:
        raise ValueError("an implicit stage needs the stiffness of the scene")
    none = np.zeros_like(p)
    factor = x * x / (m * slowed)
    solve: _Separate | _Joined | _Sparse
    if not here.joined:
        solve = _Separate(here.stiffness, factor)
    elif isinstance(here.stiffness, np.ndarray):
        solve = _Joined(here.stiffness, factor)
    else:
        solve = _Sparse(here.stiffness, factor)
    right = q + x * p / (m * slowed)
    if here.q is None:
        right = right + factor * here.magnitude(np.zeros_like(q), none)
        found = solve.inverse(right)
    else:
        found = np.abs(here.q)
    residual = right + found + factor * here.magnitude(found, none)
    of_q = np.maximum(solve.inverse(residual), found)
    # the same equation for P, and what an error of Q does to the force
    of_p = np.maximum(
        solve.turned((p + x * here.magnitude(q, none)) / slowed, m),
        (p + x * here.magnitude(found, none)) / slowed + solve.kicked(residual) * m / x,
    )
    return np.maximum(of_q, q + x * of_p / m), of_p


class _Separate:
    """|A^-1| and its relatives for A = 1 + factor K, all (..., n)."""

    def __init__(self, stiffness: Reals, factor: Reals) -> None:
        self._change = np.abs(factor * stiffness)
        with np.errstate(divide="ignore"):
            self._inverse = 1 / np.abs(1 + factor * stiffness)

    def inverse(self, x: Reals) -> Reals:
        return np.asarray(self._inverse * x)

    def kicked(self, x: Reals) -> Reals:
        """|factor K A^-1| x."""
        return np.asarray(self._change * self._inverse * x)

    def turned(self, x: Reals, m: Reals) -> Reals:
        """|M A^-1 M^-1| x."""
        return np.asarray(self._inverse * x)


class _Joined:
    """The same for matrices (..., n, n)."""

    def __init__(self, stiffness: Reals, factor: Reals) -> None:
        wide = np.asarray(factor, np.float64)[..., :, None] * np.asarray(stiffness, np.float64)
        try:
            found = np.linalg.inv(np.eye(wide.shape[-1]) + wide)
        except np.linalg.LinAlgError:
            found = np.full(wide.shape, np.inf)
        self._inverse = np.abs(found)
        self._change = np.abs(wide @ found)

    def inverse(self, x: Reals) -> Reals:
        return _product(self._inverse, x)

    def kicked(self, x: Reals) -> Reals:
        return _product(self._change, x)

    def turned(self, x: Reals, m: Reals) -> Reals:
        return np.asarray(m * _product(self._inverse, x / m))


class _Sparse:
    """The same for a sparse K whose elements off the diagonal are none of them > 0.

    A is then an M-matrix, and its inverse has no element < 0 (Berman & Plemmons, Nonnegative Matrices in the
    Mathematical Sciences, chapter 6), so that |A^-1| x is A^-1 x; `kicked` is an upper bound.
    """

    def __init__(self, stiffness: Any, factor: Reals) -> None:
        self._factor = factor
        self._size = abs(stiffness)
        self._solve = sparse_solver(stiffness, factor)

    def inverse(self, x: Reals) -> Reals:
        # 0 up to rounding may come out below 0
        return np.maximum(self._solve(x), 0)

    def kicked(self, x: Reals) -> Reals:
        inner = np.asarray(self.inverse(x), np.float64)
        product = (self._size @ inner.reshape(-1, inner.shape[-1]).T).T.reshape(x.shape)
        # factor K A^-1 is 1 - A^-1 as well: the one bound is good for small steps, the other for large ones
        return np.asarray(np.minimum(self._factor * product, x + inner))

    def turned(self, x: Reals, m: Reals) -> Reals:
        return np.asarray(m * self.inverse(x / m))


def _product(matrix: Reals, x: Reals) -> Reals:
    """matrix (..., n, n) times x (..., n); an infinite entry times nothing is nothing."""
    if np.all(np.isfinite(matrix)):
        return np.asarray(x @ matrix.T if matrix.ndim == 2 else (matrix @ x[..., None])[..., 0])
    with np.errstate(invalid="ignore"):
        terms = matrix * x[..., None, :]
    return np.asarray(np.sum(np.where(np.isnan(terms), 0, terms), axis=-1))


ROUNDINGS = {"drift": 3, "friction": 3, "implicit-friction": 3, "held": 2}


def roundings(scheme: Scheme) -> int:
    """Roundings on the longest path through one step: a force 4, a kick 2, a drift 3, in and out 4.

    Friction takes 3: its exponent, the exponential and the product, or the sum and the quotient.
    """
    if scheme.stages:
        return 4 + sum(ROUNDINGS.get(kind, 6) for kind, _ in scheme.stages)
    return 4 + sum(6 + 3 + 2 * len(row) for row in scheme.a) + 2 * len(scheme.b)
