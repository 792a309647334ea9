"""Springs as the bonds of molecular programs, which know their length but not its sign."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics import graph
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.schemes import scheme


def origins(scene: Scene, scheme_name: str) -> Floats:
    """Where each particle's coordinate in such a program is counted from, (n,) [L].

    A bond of a rest length is the scene's spring only while it does not turn over.  Where the energy that the
    scheme can reach rules that out, real positions are used (origins 0).  Elsewhere each particle is counted
    from its own rest position, so that every bond has rest length 0 and the two laws are one.  Every group of
    joined particles is looked at by itself: what stands beside it changes no number of it.

    Raises MethodError where springs in a ring have no common rest.
    """
    pairs = [term for term in scene.terms if isinstance(term, Spring)]
    springs = [t for t in scene.terms if isinstance(t, WallSpring | Spring)]
    with np.errstate(over="ignore"):
        # Gershgorin's bound of the squared frequencies
        w2 = np.max(scene.derived(terms=tuple(springs)).system.gershgorin(scene.q) / scene.m)
    hw = abs(scene.step) * float(np.sqrt(w2))
    bounded = scheme(scheme_name).symplectic and hw < 2 and all(np.all(t.k >= 0) for t in springs)
    group = graph.lowest_joined(scene.n, scene.terms)
    # the energy that a symplectic Euler conserves differs from the true one by hw/2 of it at most
    energy = _energies(scene, group) * (2 + hw) / (2 - hw) if bounded else np.full(scene.n, np.inf)
    turning = np.zeros(scene.n, dtype=bool)
    for term in pairs:
        u = (scene.q[term.b] - scene.q[term.a]) * np.sign(term.rest)
        own = group[term.a]
        safe = (term.rest == 0) | ((u > 0) & (0.5 * term.k * term.rest**2 > 1.01 * energy[own]))
        turning[own[~safe]] = True
    if not np.any(turning):
        return np.zeros(scene.n)
    rest = scene.system.rest_positions
    if rest is None:
        raise MethodError(
            f"{scene.name}: springs in a ring have no common rest, and a bond that may turn over is known by "
            "its length alone"
        )
    return np.where(turning[group], rest, 0.0)


def _energies(scene: Scene, group: Integers) -> Floats:
    """Energy of every group of joined particles at the start, where its lowest particle stands (n,)."""
    found = np.asarray(np.bincount(group, scene.p**2 / (2 * scene.m), scene.n), np.float64)
    for term in scene.terms:
        if term.is_potential:
            rows = term.potential(term.elongation(scene.q), *term.parameters)
            found += np.bincount(group[term.particles[0]], np.broadcast_to(rows, (len(term),)), scene.n)
    return found


def lengths(term: Spring, origins: Floats) -> Floats:
    """Rest lengths of bonds between coordinates that are counted from these origins [L]."""
    return np.asarray(np.abs(term.rest - (origins[term.b] - origins[term.a])))


def far(scene: Scene) -> float:
    """A length beyond all of the motion, for a spring that knows its length alone, which has no sign [L].

    A power of 2, so that adding it rounds and nothing else; every rounding of a force is k eps times this.
    """
    q, _ = scene.system.amplitudes
    reach = float(np.max(np.abs(scene.q)) + np.max(q))
    return float(2.0 ** np.ceil(np.log2(4 * reach))) if 0 < reach < 2.0**500 else 1.0


def walls(scene: Scene, label: Label) -> Iterator[tuple[int, float, float]]:
    """Particle, stiffness [M/T2] and rest position [L] of each wall spring, for joints that have one spring.

    Raises MethodError where a particle has two, or a stiffness is negative.
    """
    taken: set[int] = set()
    for term in scene.terms:
        if isinstance(term, WallSpring):
            for i, k, at in term.rows():
                if i in taken or k < 0:
                    raise MethodError(
                        f"{label}: a joint has one spring, of stiffness 0 or more; particle {i}"
                    )
                taken.add(i)
                yield i, k, at
