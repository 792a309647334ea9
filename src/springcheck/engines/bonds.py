"""Springs as the bonds of molecular programs, which have a length without a sign."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics import graph
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.terms import Distances, Morse, RadialSpring, Spring, WallSpring
from springcheck.schemes import scheme

Tie: TypeAlias = tuple[tuple[int, ...], float, float, tuple[float, ...] | None]
"""A spring: its particle or both, k [M/T2], rest length [L], and where the wall of one stands [L]."""

Bond: TypeAlias = tuple[int, int, float, float, tuple[float, ...] | None]
"""Both ends, k, rest length, and where an end that is an anchor stands."""


@np.errstate(over="ignore")
def origins(scene: Scene, scheme_name: str) -> Floats:
    """Origin of each particle's coordinate in such a program, (n,) [L].

    A bond of a rest length is the scene's spring only while it does not invert.  Where the energy that the
    scheme can reach rules that out, real positions are used (origins 0).  Elsewhere each particle is counted
    from its own rest position, so that every bond has rest length 0 and the two laws are one.  Every group of
    joined particles is treated by itself, so that it does not depend on others.  Raises MethodError where
    springs in a ring have no common rest, or a bond of another law joins their particles.
    """
    of_length = [t for t in scene.terms if isinstance(t, WallSpring | Spring | RadialSpring | Morse)]
    # Gershgorin's bound of the squared frequencies
    w2 = np.max(scene.derived(terms=tuple(of_length)).system.gershgorin(scene.q) / scene.m)
    hw = abs(scene.step) * float(np.sqrt(w2))
    bounded = scheme(scheme_name).has("symplectic") and hw < 2 and gains_nothing(scene, "morse")
    group = graph.lowest_joined(scene.n, scene.terms)
    # the energy that a symplectic Euler conserves differs from the true one by hw/2 of it at most
    energy = _energies(scene, group) * (2 + hw) / (2 - hw) if bounded else np.full(scene.n, np.inf)
    turning = np.zeros(scene.n, dtype=bool)
    for term in (t for t in of_length if isinstance(t, Spring)):
        u = (scene.q[term.b] - scene.q[term.a]) * np.sign(term.rest)
        safe = (term.rest == 0) | ((u > 0) & (0.5 * term.k * term.rest**2 > 1.01 * energy[group[term.a]]))
        turning[group[term.a[~safe]]] = True
    rest = scene.system.rest_positions if np.any(turning) else np.zeros(scene.n)
    others = (t for t in scene.terms if t.bodies == 2 and not isinstance(t, Spring))
    if rest is None or any(np.any(turning[group[t.particles[0]]]) for t in others):
        raise MethodError(
            f"{scene.name}: {'springs in a ring' if rest is None else 'a spring and another bond'} have no "
            "common rest, and a bond that may turn over is known by its length alone"
        )
    return np.where(turning[group], rest, 0.0)


def gains_nothing(scene: Scene, *others: str) -> bool:
    """Whether nothing adds to the energy: all terms are springs, friction or of other keys, none negative."""
    known = {"wall-spring", "spring", "bond", "damping", *others}
    return all(t.key in known and np.all(getattr(t, t.columns[0].field) >= 0) for t in scene.terms)


@np.errstate(over="ignore")
def within(label: Label, sizes: Iterable[tuple[float, str, float, float]]) -> None:
    """MethodError where a number (least, its name, number, most) is none that an engine computes with."""
    for lowest, what, size, highest in sizes:
        if not lowest <= size <= highest:
            raise MethodError(
                f"{label}: a {what} of {size:.3g} is outside what it computes with, {lowest:.3g} to "
                f"{highest:.3g}; the scene in other units, its numbers nearer to 1, is inside"
            )


def rests(scene: Scene, label: Label) -> Floats:
    """Origin of each particle for which every bond has rest length 0, (n,) [L].

    Such a bond pulls along each axis by itself, independent of noise across the line.  MethodError where
    springs have no common rest, or that noise turns a bond.
    """
    if scene.n < 3 * scene.particles and any(isinstance(term, Distances) for term in scene.terms):
        raise MethodError(
            f"{label}: its noise acts along x, y and z, and turns a bond; the scene's particles move "
            f"along {' and '.join(scene.axes)}"
        )
    pairs = [term for term in scene.terms if isinstance(term, Spring)]
    found = scene.system.rest_positions
    if found is None or any(np.any(lengths(term, found)) for term in pairs):
        raise MethodError(f"{label}: noise across the line needs springs with a common rest point")
    return found


def _energies(scene: Scene, group: Integers) -> Floats:
    """Energy of every group of joined particles at the start, where its lowest particle stands (n,)."""
    found = np.asarray(np.bincount(group, scene.p**2 / (2 * scene.m), scene.n), np.float64)
    for term in scene.terms:
        found += np.bincount(group[term.particles[0]], term.energies(scene.q), scene.n)
    return found


def joints(scene: Scene, term: Term, origins: Floats) -> list[Tie]:
    """A term's springs as programs have them, which pull alike along every axis; none of another term.

    Raises MethodError where a spring does not act alike along all axes of its particles, or where a bond
    between particles of several axes has a rest length: such a bond is no spring along each.
    """
    of, axis = (x.tolist() for x in np.divmod(scene.all_places, 3))
    if isinstance(term, RadialSpring):
        # a row for each axis of one bond, which has one number
        each = {number: row for *row, number in term.rows()}.values()
        return [((of[a], of[b]), k, rest, None) for a, b, k, rest in each]
    if not isinstance(term, WallSpring | Spring):
        return []
    at = lengths(term, origins) if isinstance(term, Spring) else term.at - origins[term.i]
    rows = zip(*(index.tolist() for index in term.particles), term.k.tolist(), at.tolist(), strict=True)
    if scene.places is None:
        return [(tuple(i), k, x, None) if term.bodies == 2 else (tuple(i), k, 0.0, (x, 0.0, 0.0))
                for *i, k, x in rows]  # fmt: skip
    axes = [{a for i, a in zip(of, axis, strict=True) if i == one} for one in range(scene.particles)]
    found: list[Tie] = []
    begun: dict[tuple[int, ...], dict[int, tuple[float, float]]] = {}
    for *coordinates, k, x in rows:
        key, along = tuple(of[j] for j in coordinates), axis[coordinates[0]]
        each_axis = begun.setdefault(key, {})
        if along in each_axis:
            break
        each_axis[along] = k, x
        if all(set(each_axis) == axes[i] for i in key):
            point = tuple(each_axis.get(a, (0.0, 0.0))[1] for a in range(3))
            if len({k for k, _ in each_axis.values()}) > 1 or (term.bodies == 2 and any(point)):
                break
            del begun[key]
            found.append((key, k, 0.0, None if term.bodies == 2 else point))
    if begun:
        which = " and ".join(map(str, next(iter(begun))))
        raise MethodError(
            f"{scene.name}: a program's spring has one stiffness along every axis and one rest point; that "
            f"of particle {which} has not"
        )
    return found


def lengths(term: Spring, origins: Floats) -> Floats:
    """Rest lengths of bonds between coordinates that are counted from these origins [L]."""
    return np.asarray(np.abs(term.rest - (origins[term.b] - origins[term.a])))


def off_axis(positions: Floats, elsewhere: NDArray[np.bool_]) -> float:
    """Largest |position| along axes that are no coordinates of the scene, of positions (particles or more,
    3)."""
    return float(np.max(np.abs(positions.reshape(-1)[: len(elsewhere)][elsewhere]), initial=0.0))
