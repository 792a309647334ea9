"""Rounding of one step of a scheme: running error bounds, and the number of roundings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from springcheck.physics.arrays import Force, Reals
from springcheck.schemes.catalogue import Scheme, number
from springcheck.schemes.kinds import Setting
from springcheck.schemes.stepping import OfLast, sparse_solver, weighted_sum

Applied: TypeAlias = Callable[[Reals], Reals]
"""x (..., n) -> a matrix times x (..., n)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Met:
    """One evaluation of the force within a step: the bound on its rounding there, and its slope.

    `magnitude` is made by `System.magnitude`, near the position `q` (..., n) of the evaluation, and `pull` is
    the force of the potential there.  `stiffness` are the second derivatives of the potential there, (..., n)
    where no particle is joined to another, else (..., n, n) or (n, n); only an implicit stage needs them.
    Without `q` the scene is linear, and the bound of the solution takes its place.
    """

    magnitude: Force
    stiffness: Any = None
    joined: bool = False
    q: Reals | None = None
    pull: Reals | None = None
    joints: Any = 0.0
    """Rounding of a force by the lengths of joints, whose engine solves an implicit stage for velocities."""
    friction: tuple[Reals, Reals] | None = None
    """Rates of friction there, and their derivatives (..., n), where it depends on the position."""

    def bent_by(self, more: Reals) -> Met:
        """With more stiffness (..., n) [M/T2] of each particle by itself."""
        if not self.joined:
            return replace(self, stiffness=self.stiffness + more)
        return replace(self, stiffness=self.stiffness + more[..., None] * np.eye(more.shape[-1]))


def magnitude_step(
    scheme: Scheme,
    q: Reals,
    p: Reals,
    *,
    h: float,
    m: Reals,
    met: Iterable[Met],
    rate: Reals | None = None,
    lost: tuple[Any, Reals] | None = None,
) -> tuple[Reals, Reals]:
    """Running error bound of `step` from (q, p): the same step with every difference taken as a sum.

    `met` has one entry for each evaluation of the force, in their order.  `lost` is what underflow adds to
    the positions and momenta of each stage (n,), which the stages after it carry on.
    """
    start = q, p
    # of doubles too few digits do no harm, but the square of a step may leave their range
    q, p, wide = np.abs(q), np.abs(p), q.dtype.type(h)
    rate = None if rate is None else rate.astype(q.dtype)
    each = iter(met)
    if scheme.stages:
        last = np.zeros_like(p)
        for kind, (_, c) in zip(scheme.kinds, scheme.stages, strict=True):
            if kind.evaluates:
                here = next(each)
                last = here.magnitude(q, np.zeros_like(p) if kind.evaluates == "potential" else p)
                last = last + here.joints
            setting = Setting(m=m, rate=rate, force=last)
            q, p = kind.sizes(q, p, number(c, np.float64) * wide, setting)
            q, p = (q, p) if lost is None else (q + lost[0], p + lost[1])
        return q, p
    return _tableau(scheme, start, each, h=wide, m=m, rate=rate, lost=lost)


def _tableau(
    scheme: Scheme, start: tuple[Reals, Reals], each: Iterator[Met], *, h: Any, m: Reals, rate: Reals | None,
    lost: tuple[Any, Reals] | None,
) -> tuple[Reals, Reals]:  # fmt: skip
    """The same for a Butcher tableau.

    Next to the bounds it carries the states of the stages themselves, signs and all: the bound of a stiff
    force says nothing of the size of the state that the force leads to.
    """
    (q, p), size = (np.abs(x) for x in start), np.abs(h)
    slowing = np.zeros_like(m) if rate is None else rate
    forces: list[Reals] = []
    velocities: list[Reals] = []
    true_forces: list[Reals] = []
    for row in scheme.a:
        here = next(each)
        past = [float(c) * h for c in row[: len(forces)]]
        qs, ps = weighted_sum(q, np.abs(past), velocities), weighted_sum(p, np.abs(past), forces)
        least = 0.0 if lost is None else lost[0]
        qs, ps = (qs, ps) if lost is None else (qs + least, ps + lost[1])
        own = float(row[len(forces)]) * h
        if here.friction is not None:
            slowing = here.friction[0]
        if here.q is None or here.pull is None:
            end = None
        else:
            end = (weighted_sum(start[1], past, true_forces) + own * here.pull) / (1 + own * slowing)
            true_forces.append(here.pull - slowing * end)
        if own:
            way = None
            if end is not None:
                fastest = p + np.abs(end - start[1])
                way = np.abs(end), q + size * fastest / m, fastest
            if here.friction is not None and end is not None:
                here = here.bent_by(here.friction[1] * end)
            pull = _implicit_stage(here, way, qs, ps, np.abs(own), m, np.abs(1 + own * slowing), least)
            ps = (ps + np.abs(own) * pull) / np.abs(1 + own * slowing)
        else:
            pull = here.magnitude(qs, ps) + here.joints
        forces.append(pull)
        velocities.append(ps / m)
    weights = [abs(float(c)) * size for c in scheme.b]
    return weighted_sum(q, weights, velocities), weighted_sum(p, weights, forces)


def _implicit_stage(
    here: Met, way: tuple[Reals, Reals, Reals] | None, q: Reals, p: Reals, x: Reals, m: Reals, slowed: Reals,
    least: Any,
) -> Reals:  # fmt: skip
    """Bound of the rounding of the force behind the solution of Q = q + x P/m, slowed P = p + x F(Q).

    q and p bound what the stage starts from; `way` is |P|, and what positions and momenta the step goes
    through on its way there, where that is known; `least` is what underflow takes off Q.  With
    A = 1 + x**2 K/(m slowed):

    * An engine that solves for Q leaves a residual of a few roundings of what the equation adds up, at Q; the
      inverse of A carries it into Q (Higham, Accuracy and Stability of Numerical Algorithms, 7.2), and
      K A**-1 into the force.  As one matrix: a stiff bond turns an error of its ends alike into nothing,
      where |K| |A**-1| would make (x**2 K/m)**2 roundings of it.
    * One that solves for P, or for the change of velocity from p and F(q) (Baraff & Witkin, Large Steps in
      Cloth Simulation, 1998), adds up forces all along its way, before A makes them small.
    """
    if here.stiffness is None:
        raise ValueError("an implicit stage needs the stiffness of the scene")
    none = np.zeros_like(p)
    factor = x * x / (m * slowed)
    if not here.joined:
        inverse, kicked = _separate(here.stiffness, factor)
    elif isinstance(here.stiffness, np.ndarray):
        inverse, kicked = _joined(here.stiffness, factor)
    else:
        inverse, kicked = _sparse(here.stiffness, factor)

    def turned(of_p: Reals) -> Reals:
        """|M A^-1 M^-1| of_p."""
        return np.asarray(m * inverse(of_p / m)) if here.joined else inverse(of_p)

    right = q + x * p / (m * slowed)
    if here.q is None or way is None:
        found = inverse(right + factor * here.magnitude(none, none))
        end = turned((p + x * here.magnitude(q, none)) / slowed)
        way = end, q + x * (2 * p + end) / m, p + end
    else:
        found = np.abs(here.q)
    found = found + least
    there = here.magnitude(found, way[0])
    residual = right + found + factor * there
    of_velocity = turned(x * (here.magnitude(*way[1:]) + here.joints)) + kicked(q) * m / x
    return np.maximum(there + kicked(residual) * m * slowed / (x * x), of_velocity / x)


def _separate(stiffness: Reals, factor: Reals) -> tuple[Applied, Applied]:
    """|A^-1| x and |factor K A^-1| x of x (..., n), for A = 1 + factor K, K (..., n)."""
    change = np.abs(factor * stiffness)
    with np.errstate(divide="ignore"):
        inverse = 1 / np.abs(1 + factor * stiffness)
    return lambda x: np.asarray(inverse * x), lambda x: np.asarray(change * inverse * x)


def _joined(stiffness: Reals, factor: Reals) -> tuple[Applied, Applied]:
    """The same for matrices K (..., n, n)."""
    return (
        _of_one(stiffness, factor) if stiffness.ndim == np.ndim(factor) + 1 == 2 else _each(stiffness, factor)
    )


def _each(stiffness: Reals, factor: Reals) -> tuple[Applied, Applied]:
    wide = np.asarray(factor, np.float64)[..., :, None] * np.asarray(stiffness, np.float64)
    try:
        found = np.linalg.inv(np.eye(wide.shape[-1]) + wide)
    except np.linalg.LinAlgError:
        found = np.full(wide.shape, np.inf)
    return partial(_product, np.abs(found)), partial(_product, np.abs(wide @ found))


_of_one = OfLast(_each)


def _sparse(stiffness: Any, factor: Reals) -> tuple[Applied, Applied]:
    """The same for a sparse K whose elements off the diagonal are none of them > 0.

    A is then an M-matrix, and its inverse has no element < 0 (Berman & Plemmons, Nonnegative Matrices in the
    Mathematical Sciences, chapter 6), so that |A^-1| x is A^-1 x; the second is an upper bound.
    """
    size, solve = abs(stiffness), sparse_solver(stiffness, factor)

    def inverse(x: Reals) -> Reals:
        # 0 up to rounding may come out below 0
        return np.maximum(solve(x), 0)

    def kicked(x: Reals) -> Reals:
        inner = np.asarray(inverse(x), np.float64)
        product = (size @ inner.reshape(-1, inner.shape[-1]).T).T.reshape(x.shape)
        # factor K A^-1 is 1 - A^-1 as well: the one bound is good for small steps, the other for large ones
        return np.asarray(np.minimum(factor * product, x + inner))

    return inverse, kicked


def _product(matrix: Reals, x: Reals) -> Reals:
    """matrix (..., n, n) times x (..., n); an infinite entry times nothing is nothing."""
    if np.all(np.isfinite(matrix)):
        return np.asarray(x @ matrix.T if matrix.ndim == 2 else (matrix @ x[..., None])[..., 0])
    with np.errstate(invalid="ignore"):
        terms = matrix * x[..., None, :]
    return np.asarray(np.sum(np.where(np.isnan(terms), 0, terms), axis=-1))


def roundings(scheme: Scheme) -> int:
    """Roundings on the longest path through one step: force 4, kick 2, drift 3, in and out 4."""
    if scheme.stages:
        return 4 + sum(kind.roundings for kind in scheme.kinds)
    return 4 + sum(6 + 3 + 2 * len(row) for row in scheme.a) + 2 * len(scheme.b)
