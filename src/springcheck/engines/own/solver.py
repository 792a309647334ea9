"""The factors of an implicit step of a linear scene: (1 + x c/m + x**2 K/m) P = p + x F(q)."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from springcheck.engines.own.layout import NO_INDEX, NOTHING
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring

Factors: TypeAlias = tuple[Floats, tuple[Floats, Floats, Floats], tuple[Any, ...]]
"""See `loops.solve`: what is empty is not used."""

_NO_THREE = (NOTHING, NOTHING, NOTHING)
_NO_BAND = (np.empty((0, 0)), NO_INDEX, NO_INDEX, NOTHING, 0)
NONE: Factors = (NOTHING, _NO_THREE, _NO_BAND)

MOST_BYTES = 1 << 29
"""Memory that the factors of one scene may take: 512 MiB, a band of 60 elements for 1e6 particles."""

NATURAL = 3
"""Width of the band up to which particles keep the order of the scene, without a search for a better one."""


def factors(scene: Scene, x: float) -> Factors:
    """Solver of the implicit step of length x; it gives NaN throughout where no solution exists.

    Raises:
        MethodError: the factors would take more than `MOST_BYTES`.
    """
    walls = [term for term in scene.terms if isinstance(term, WallSpring)]
    links = [term for term in scene.terms if isinstance(term, Spring)]
    slowed = 1 + x * scene.system.friction_rates.astype(np.float64)
    total = np.zeros(scene.n)
    for wall in walls:
        np.add.at(total, wall.i, wall.k)
    with np.errstate(all="ignore"):
        if not links:
            return 1 / (slowed + x * (x * (total / scene.m))), _NO_THREE, _NO_BAND
        a, b = (np.concatenate([getattr(link, end) for link in links]) for end in ("a", "b"))
        k = np.concatenate([link.k for link in links])
        for end in (a, b):
            np.add.at(total, end, k)
        return _banded(scene, slowed + x * (x * (total / scene.m)), a, b, k, x)


def _banded(scene: Scene, diagonal: Floats, a: Integers, b: Integers, k: Floats, x: float) -> Factors:
    from scipy.linalg.lapack import dgbtrf

    n = scene.n
    place = np.arange(n)
    if np.max(np.abs(a - b)) > NATURAL:
        place = _narrow(n, a, b)
    left, right = place[a], place[b]
    wide = int(np.max(np.abs(left - right)))
    if 8 * n * (3 * wide + 1) > MOST_BYTES:
        raise MethodError(
            f"own: scene {scene.name!r} joins its {n} particles so widely that an implicit step would take "
            f"{8 * n * (3 * wide + 1) / 1e9:.2g} GB; leave the implicit methods out, or take sundials:bdf"
        )
    band = np.zeros((3 * wide + 1, n))
    band[2 * wide, place] = diagonal
    # element (i, j) of a band stands in row 2 wide + i - j, column j
    np.add.at(band, (2 * wide + left - right, right), -(x * (x * (k / scene.m[b]))))
    np.add.at(band, (2 * wide + right - left, left), -(x * (x * (k / scene.m[a]))))
    found, swaps, singular = dgbtrf(band, wide, wide)
    if singular:
        found[:] = np.nan
    found[2 * wide] = 1 / found[2 * wide]
    swaps = swaps.astype(np.int64)
    if wide == 1 and np.array_equal(swaps, place):
        below, above = np.append(0.0, found[3, :-1]), np.append(found[1, 1:], 0.0)
        return NOTHING, (below, found[2].copy(), above), _NO_BAND
    order = np.empty(n, np.int64)
    order[place] = np.arange(n)
    return NOTHING, _NO_THREE, (np.ascontiguousarray(found.T), swaps, order, np.zeros(n), wide)


def _narrow(n: int, a: Integers, b: Integers) -> Integers:
    """The place of each particle in an order in which those that are joined stand close together.

    Cuthill & McKee, Proc. 24th ACM Conf. (1969) 157, reversed.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    joined = coo_array((np.ones(2 * len(a)), (np.append(a, b), np.append(b, a))), shape=(n, n)).tocsr()
    place = np.empty(n, np.int64)
    place[reverse_cuthill_mckee(joined, symmetric_mode=True)] = np.arange(n)
    return place
