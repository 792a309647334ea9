"""Connections between particles, and their positions at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.distance import Distances
from springcheck.physics.term import Term
from springcheck.physics.terms import Spring, WallSpring, Weight


def is_uniform_chain(system: Any) -> bool:
    """Whether equal masses between two walls are joined to their neighbours by equal springs."""
    m = system.m
    walls = [term for term in system.terms if isinstance(term, WallSpring)]
    links = [term for term in system.terms if isinstance(term, Spring)]
    if len(walls) != 1 or len(links) != 1 or len(m) < 2 or np.any(m != m[0]):
        return False
    wall, link = walls[0], links[0]
    row = np.arange(len(m) - 1)
    joined = np.array_equal(wall.i, [0, len(m) - 1]) and np.array_equal([link.a, link.b], [row, row + 1])
    return bool(joined and np.all(np.append(wall.k, link.k) == wall.k[0]))


def free_groups(system: Any) -> tuple[Integers, ...]:
    """Groups of connected particles that no stiffness holds, so that they can drift."""
    n, terms = system.n, system.terms
    held = np.zeros(n, dtype=bool)
    for term in terms:
        if term.bodies == 1:
            held[term.particles[0][term.joins]] = True
    if np.all(held):
        return ()
    lowest = lowest_joined(n, terms)
    loose = np.setdiff1d(lowest, lowest[held])
    return tuple(np.flatnonzero(lowest == r) for r in loose)


def lowest_joined(n: int, terms: Sequence[Term]) -> Integers:
    """The lowest particle to which each is connected, directly or not (n,)."""
    lowest = np.arange(n)
    # a bond without stiffness joins nothing
    bonds = [[end[term.joins] for end in term.particles] for term in terms if term.bodies == 2]
    while True:
        before = lowest.copy()
        for a, b in bonds:
            low = np.minimum(lowest[a], lowest[b])
            for end in (a, b):
                np.minimum.at(lowest, lowest[end], low)
        # pointer jumping: each points to where its target points, which halves all paths in a round
        while np.any(lowest[lowest] != lowest):
            lowest = lowest[lowest]
        if np.array_equal(lowest, before):
            return lowest


def rest_positions(system: Any) -> Floats | None:
    """Positions (n,) [L] at which every spring between particles has its rest length.

    The lowest particle of each connected group is at 0.  None where springs in a ring are inconsistent.
    """
    springs = [term for term in system.terms if isinstance(term, Spring)]
    if not any(np.any(term.rest) for term in springs):
        return np.zeros(system.n)
    neighbours: dict[int, list[tuple[int, float]]] = {}
    for term in springs:
        for a, b, rest in zip(term.a.tolist(), term.b.tolist(), term.rest.tolist(), strict=True):
            neighbours.setdefault(a, []).append((b, rest))
            neighbours.setdefault(b, []).append((a, -rest))
    placed: dict[int, float] = {}
    for root in sorted(neighbours):
        front = [] if root in placed else [root]
        placed.setdefault(root, 0.0)
        while front:
            a = front.pop()
            for b, rest in neighbours[a]:
                if b not in placed:
                    placed[b] = placed[a] + rest
                    front.append(b)
                elif placed[b] != placed[a] + rest and placed[a] != placed[b] - rest:
                    return None
    found = np.zeros(system.n)
    found[list(placed)] = list(placed.values())
    return found


def alike(system: Any) -> tuple[tuple[Integers, Integers], ...]:
    """Coordinates, by particle, along each pair of axes on which all terms act alike.

    Linear terms and bonds that act on both alike and rest in 0 conserve the angular momentum about 0 in
    their plane.
    """
    places, parts = system.scene.places, system.terms
    kept = ((x.is_linear and not isinstance(x, Weight)) or isinstance(x, Distances) for x in parts)
    if places is None or not all(kept) or any(x.origin and np.any(getattr(x, x.origin)) for x in parts):
        return ()
    found = []
    for a, b in ((0, 1), (1, 2), (0, 2)):
        one, other = (np.flatnonzero(places % 3 == axis) for axis in (a, b))
        if len(one) and np.array_equal(places[one] // 3, places[other] // 3):
            rows = []
            for own in (one, other):
                number = np.full(len(places), -1)
                number[own] = np.arange(len(own))
                rows.append([(term.key, *sorted(term.restricted(number).rows())) for term in parts])
            if rows[0] == rows[1]:
                found.append((one, other))
    return tuple(found)
