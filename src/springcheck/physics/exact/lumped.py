"""Particles on rods along one line: each group of them is one mass on the springs of all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from springcheck.physics import graph
from springcheck.physics.arrays import Extended, Floats, Integers
from springcheck.physics.exact.well import LAST, States, Well, wide
from springcheck.physics.system import System
from springcheck.physics.term import Term


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Lumped:
    """Of each particle (n,): its group in a scene without rods, how far it stands off that, and its share."""

    one: Any
    """The facts of that scene, its exact motion among them."""
    of: Integers
    off: Extended
    share: Extended


def _moved(term: Term, of: Integers, off: Floats) -> Term:
    """The same rows on the groups."""
    rows = {name: of[getattr(term, name)] for name in term.ends}
    if term.origin:
        rows[term.origin] = getattr(term, term.origin) - term.stretch(off)
    return replace(term, **rows)  # type: ignore[type-var]


def _lumps(system: System[Any]) -> _Lumped | None:
    """None where the masses have no modes."""
    assert system.rods is not None
    rods = [term for term in system.terms if term.kind == "constraint"]
    others = [term for term in system.terms if term.kind != "constraint"]
    first, of = np.unique(graph.lowest_joined(system.n, rods), return_inverse=True)
    off = system.q - system.q[first][of]
    if any(rod.bodies == 1 for rod in rods) or not all(term.is_linear for term in others):
        return None
    if any(np.any(of[term.particles[0]] == of[term.particles[1]]) for term in others if term.bodies == 2):
        # a spring beside a rod, which nothing stretches
        return None
    terms = tuple(_moved(term, of, off) for term in others)
    p = np.asarray(system.rods.projected(wide(system.q), wide(system.p)), np.float64)
    m = np.bincount(of, system.m)
    scene = system.scene.derived(m=m, q=system.q[first], p=np.bincount(of, p), terms=terms)
    one: Any = system.beside(scene)
    return _Lumped(one=one, of=of, off=wide(off), share=wide(system.m) / m[of]) if one.solution else None


def _motion(system: System[Any], lumped: _Lumped, t: Extended) -> States:
    q, p = lumped.one.solution.at(t)
    return wide(q[:, lumped.of] + lumped.off), wide(p[:, lumped.of] * lumped.share)


def _doubt(system: System[Any], lumped: _Lumped, t: np.longdouble) -> States:
    # masses, momenta and rest positions of a group are sums that are rounded to doubles: a part of the phase
    one, of = lumped.one, lumped.of
    q, p = one.solution.doubt(float(t))
    most_q, most_p = (np.abs(x) for x in one.amplitudes)
    phase = 2.0**-51 * (1 + np.abs(t) * np.sqrt(np.max(one.gershgorin(one.q) / one.m)))
    q, p = q + phase * (most_q + np.abs(one.q)), p + phase * most_p
    return wide(q[of] + LAST * (np.abs(system.q) + np.abs(lumped.off))), wide(p[of] * lumped.share)


LUMPED = Well(key="rod", terms=frozenset(), prepare=_lumps, motion=_motion, doubt=_doubt)
