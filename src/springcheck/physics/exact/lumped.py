"""Particles on rods along one line: each group of them is one mass, on which all their springs act."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.physics import graph
from springcheck.physics.arrays import EPS, Extended, Floats, Integers
from springcheck.physics.exact.closedform import FORM_EPS, ClosedForm, States, wide
from springcheck.physics.exact.digits import Wide, digits, exactly, extended, summed
from springcheck.physics.system import System
from springcheck.physics.term import Term


class LumpedMotion(ClosedForm):
    """A whole scene: `one`, the facts of the scene without its rods, where each group is a particle; by
    particle (n,) its `group`, its offset `off` [L], and its `share` of the mass; the largest relative error
    of a mass or momentum there, sums that are `rounded` to doubles; and for each row with an origin (s,) the
    stiffness, and the rounding of that origin [L]."""

    one: Any

    def __init__(self, system: System[Any]) -> None:
        super().__init__(system)
        self.need(system.rods and system.scene.places is None)
        held: Any = system.rods
        rods = [term for term in system.terms if term.kind == "constraint"]
        others = [term for term in system.terms if term.kind != "constraint"]
        first, of = np.unique(graph.lowest_joined(system.n, rods), return_inverse=True)
        self.need(all(rod.bodies == 2 for rod in rods) and all(term.is_linear for term in others))
        # no spring may be parallel to a rod
        pairs = (of[np.stack(term.particles)] for term in others if term.bodies == 2)
        self.need(all(np.all(a != b) for a, b in pairs))
        with digits():
            off = exactly(system.q) - exactly(system.q[first][of])
            moved = [_moved(term, of, off) for term in others]
            terms, shifts = zip(*moved, strict=True) if moved else ((), ())
            each = system.m, held.projected(wide(system.q), wide(system.p))
            (m, p), less = _rounded(np.stack([summed(exactly(x), of, len(first)) for x in each]))
            self.off = extended(off)
        self.one = system.beside(system.scene.derived(m=m, q=system.q[first], p=p, terms=terms))
        self.need(self.one.solution)
        self.group, self.share = of, wide(system.m) / m[of]
        self.rounded = np.max(less / np.where(less > 0, np.abs([m, p]), 1))
        k = [np.zeros(0), *(term.rigidity for term in terms if term.origin)]
        self.stiffness = wide(np.concatenate(k))
        self.shift = wide(np.concatenate([np.zeros(0), *shifts]))

    def at(self, t: Extended) -> States:
        q, p = self.one.solution.at(t)
        return wide(q[:, self.group] + self.off), wide(p[:, self.group] * self.share)

    def doubt(self, t: np.longdouble) -> States:
        """The bounds of the groups, in which each number counts some four times its rounding by `EPS`.

        A rest point that is off by d releases an energy k d**2/2, which moves no particle by more than it can
        stretch all springs in turn; it grows by friction backwards in time, and by repulsive springs always.
        """
        one, of, time = self.one, self.group, np.abs(t)
        q, p = ((1 + self.rounded / (4 * EPS)) * x for x in one.solution.doubt(float(t)))
        k, shift = (x[self.shift > 0] for x in (self.stiffness, self.shift))
        free = np.sqrt(np.sum(k * shift**2))
        rate = np.max(one.friction_rates) if t < 0 else np.longdouble(0)
        if np.any(one.modes.w2 < 0 if one.has_modes else one.hessian_diagonal(one.q) < 0):
            rate = rate + np.sqrt(np.max(one.gershgorin(one.q) / one.m))
        free = free * np.exp(rate * time)
        q = q + np.minimum(time * free / np.sqrt(one.m), 2 * free * np.sum(1 / np.sqrt(k)))
        p = p + free * np.sqrt(one.m)
        return wide(q[of] + FORM_EPS * (np.abs(self.system.q) + np.abs(self.off))), wide(p[of] * self.share)


def _moved(term: Term, of: Integers, off: Wide) -> tuple[Term, Extended]:
    """The same rows on the groups, and the rounding of their origins."""
    rows, shift = {name: of[getattr(term, name)] for name in term.ends}, np.zeros(0, np.longdouble)
    if term.origin:
        at = exactly(getattr(term, term.origin)) - term.stretch(off)  # type: ignore[arg-type]
        rows[term.origin], shift = _rounded(at)
    return replace(term, **rows), shift  # type: ignore[type-var]


def _rounded(x: Wide) -> tuple[Floats, Extended]:
    """Rounded to doubles, and the absolute rounding errors."""
    out = x.astype(np.float64)
    return out, extended(np.abs(x - exactly(out)))
