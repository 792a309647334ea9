"""The terms of a scene as the lists of numbers that the kernels take."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.engines.own import laws
from springcheck.engines.own.loops import KINDS, Slot
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.terms import Damping, Spring, Term, WallSpring, known

FRICTIONS = ("damping", "van-der-pol")

NO_INDEX: Integers = np.empty(0, np.int64)
NOTHING: Floats = np.empty(0)

SCATTERED = 0.25
"""Fraction of the particles up to which wall springs are index lists; beyond, every particle has one, maybe
of stiffness 0."""


Row: TypeAlias = tuple[tuple[Floats, ...], ...]
_EMPTY: Row = ((NOTHING, NOTHING), (NOTHING, NOTHING, np.zeros(4)), (NOTHING, NOTHING))


def slots(parts: Sequence[Sequence[Term]], m: Floats) -> list[Slot]:
    """Each of these forces as the kernels take it: as a row, if all of them are rows, or by index lists."""
    rows = [_row(terms, m) for terms in parts]
    nothing = lists((), m)
    if any(row is None for row in rows):
        return [(True, lists(terms, m), *_EMPTY) for terms in parts]
    return [(False, nothing, *row) for row in rows if row is not None]


def lists(terms: Iterable[Term], m: Floats) -> tuple[tuple[Any, ...], ...]:
    """Ends and parameters of each kind of term, each (s,); s is 0 where there is none.  The last are `laws`.

    In the order of the term's columns; friction also takes the masses.
    """
    parts = tuple(terms)
    known = [_columns([term for term in parts if term.key == key], key, m) for key in KINDS]
    return *known, tuple(laws.compiled(term) for term in parts if term.key not in KINDS)


def _columns(found: list[Term], key: str, m: Floats) -> tuple[NDArray[Any], ...]:
    kind = known()[key]
    ends = [_joined(NO_INDEX, found, name) for name in kind.ends]
    parameters = [_joined(NOTHING, found, column.field) for column in kind.columns]
    return (*ends, *parameters, m[ends[0]]) if key in FRICTIONS else (*ends, *parameters)


def _joined(none: NDArray[Any], found: list[Term], name: str) -> NDArray[Any]:
    return np.concatenate([none, *(np.asarray(getattr(term, name), none.dtype) for term in found)])


def _row(terms: Sequence[Term], m: Floats) -> Row | None:
    """The terms as a row; None where they are of another kind or join others than neighbours."""
    n = len(m)
    if not all(isinstance(term, WallSpring | Spring | Damping) for term in terms):
        return None
    (i, k, at), (a, b, stiffness, rest), _, _, _, _, (slow, c, _), *_ = lists(terms, m)
    if len(np.unique(slow)) < len(slow) or len(np.unique(i)) < len(i):
        return None
    chain = _chain(a, b, stiffness, rest, n)
    if chain is None:
        return None
    held: tuple[Floats, Floats] = (NOTHING, NOTHING)
    ends = np.zeros(4)
    if chain[0].size and np.all((i == 0) | (i == n - 1)):
        for place, side in ((0, slice(0, 2)), (n - 1, slice(2, 4))):
            if np.any(i == place):
                ends[side] = k[i == place][0], at[i == place][0]
    elif len(i) > SCATTERED * n:
        held = np.zeros(n), np.zeros(n)
        held[0][i], held[1][i] = k, at
    elif len(i):
        return None
    slowed: tuple[Floats, Floats] = (NOTHING, NOTHING)
    if len(slow):
        slowed = np.zeros(n), m.copy()
        slowed[0][slow] = c
    return held, (*chain, ends), slowed


def _chain(a: Integers, b: Integers, k: Floats, rest: Floats, n: int) -> tuple[Floats, Floats] | None:
    """Stiffness and rest length between each particle and the next (n-1,); empty where nothing is joined."""
    if not len(k):
        return NOTHING, NOTHING
    low = np.minimum(a, b)
    if len(k) != n - 1 or np.any(np.abs(b - a) != 1) or len(np.unique(low)) < n - 1:
        return None
    order = np.argsort(low)
    # the same spring seen from its other end: its rest length changes sign, exactly
    return k[order], np.where(a < b, rest, -rest)[order]
