"""Particles on rods along one line: each group of them is one mass on the springs of all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from springcheck.physics import graph
from springcheck.physics.arrays import EPS, Extended, Floats, Integers
from springcheck.physics.exact.digits import Wide, digits, exactly, extended
from springcheck.physics.exact.well import LAST, States, Well, wide
from springcheck.physics.system import System
from springcheck.physics.term import Term


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Lumped:
    """Arrays by particle (n,): its group in the scene without rods, its offset [L], its share of the mass."""

    one: Any
    """The facts of that scene, its exact motion among them."""
    of: Integers
    off: Extended
    share: Extended
    rounded: np.longdouble
    """The largest relative error of a mass or momentum there, sums that are rounded to doubles."""
    shifts: tuple[Extended, Extended]
    """Stiffness (s,) of each row that rests somewhere, and by what that was rounded [L]."""


def _moved(term: Term, of: Integers, off: Wide) -> tuple[Term, Extended]:
    """The same rows on the groups, and by what their origins are rounded."""
    rows, shift = {name: of[getattr(term, name)] for name in term.ends}, np.zeros(0, np.longdouble)
    if term.origin:
        at = exactly(getattr(term, term.origin)) - term.stretch(off)  # type: ignore[arg-type]
        rows[term.origin], shift = _rounded(at)
    return replace(term, **rows), shift  # type: ignore[type-var]


def _rounded(x: Wide) -> tuple[Floats, Extended]:
    """Rounded to doubles, and the absolute rounding errors."""
    out = x.astype(np.float64)
    return out, extended(np.abs(x - exactly(out)))


def _lumps(system: System[Any]) -> _Lumped | None:
    """None where the masses have no modes."""
    assert system.rods is not None
    rods = [term for term in system.terms if term.kind == "constraint"]
    others = [term for term in system.terms if term.kind != "constraint"]
    first, of = np.unique(graph.lowest_joined(system.n, rods), return_inverse=True)
    if any(rod.bodies == 1 for rod in rods) or not all(term.is_linear for term in others):
        return None
    if any(np.any(of[term.particles[0]] == of[term.particles[1]]) for term in others if term.bodies == 2):
        # a spring beside a rod, which nothing stretches
        return None
    with digits():
        off = exactly(system.q) - exactly(system.q[first][of])
        terms, shifts = zip(*(_moved(term, of, off) for term in others), strict=True) if others else ((), ())
        sums = exactly(np.zeros((2, len(first))))
        np.add.at(sums[0], of, exactly(system.m))
        np.add.at(sums[1], of, exactly(system.rods.projected(wide(system.q), wide(system.p))))
        (m, p), less = _rounded(sums)
        away = extended(off)
    one: Any = system.beside(system.scene.derived(m=m, q=system.q[first], p=p, terms=terms))
    if not one.solution:
        return None
    k = [np.zeros(0), *(term.rigidity for term in terms if term.origin)]
    part = less / np.where(less > 0, np.abs([m, p]), 1)
    return _Lumped(
        one=one, of=of, off=away, share=wide(system.m) / m[of], rounded=np.max(part),
        shifts=(wide(np.concatenate(k)), wide(np.concatenate([np.zeros(0), *shifts]))),
    )  # fmt: skip


def _motion(system: System[Any], lumped: _Lumped, t: Extended) -> States:
    q, p = lumped.one.solution.at(t)
    return wide(q[:, lumped.of] + lumped.off), wide(p[:, lumped.of] * lumped.share)


def _doubt(system: System[Any], lumped: _Lumped, t: np.longdouble) -> States:
    """The bounds of the groups, in which each number counts some four times its rounding by `EPS`.

    A spring that rests off by d sets free k d**2/2 of energy, which moves no particle by more than it can
    stretch all springs in turn; friction makes it grow backwards in time, a hill always.
    """
    one, of, time = lumped.one, lumped.of, np.abs(t)
    q, p = ((1 + lumped.rounded / (4 * EPS)) * x for x in one.solution.doubt(float(t)))
    k, shift = (x[lumped.shifts[1] > 0] for x in lumped.shifts)
    free = np.sqrt(np.sum(k * shift**2))
    rate = np.max(one.friction_rates) if t < 0 else np.longdouble(0)
    if np.any(one.modes.w2 < 0 if one.has_modes else one.hessian_diagonal(one.q) < 0):
        rate = rate + np.sqrt(np.max(one.gershgorin(one.q) / one.m))
    free = free * np.exp(rate * time)
    q = q + np.minimum(time * free / np.sqrt(one.m), 2 * free * np.sum(1 / np.sqrt(k)))
    p = p + free * np.sqrt(one.m)
    return wide(q[of] + LAST * (np.abs(system.q) + np.abs(lumped.off))), wide(p[of] * lumped.share)


LUMPED = Well(key="rod", terms=frozenset(), prepare=_lumps, motion=_motion, doubt=_doubt)
