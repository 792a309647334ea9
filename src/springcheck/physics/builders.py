"""Scenes from numbers in Python: uncoupled springs, and chains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import SceneError
from springcheck.physics import memory
from springcheck.physics.arguments import typed
from springcheck.physics.arrays import Floats, reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Spring, Term, WallSpring

SCENE_BYTES = 150
"""Bytes for each mass of a chain, before anything is run; see `need`."""


@typed
def spring(
    m: ArrayLike = 1.0,
    k: ArrayLike = 1.0,
    q: ArrayLike = 0.0,
    p: ArrayLike = 1.0,
    step: float = 0.1,
    steps: int = 200,
    *,
    at: ArrayLike = 0.0,
    c: ArrayLike | None = None,
    fast: bool = False,
    **rest: Any,
) -> Scene:
    """A mass on a spring, or several uncoupled ones.

    >>> spring(m=2.0, k=[1.0, 4.0], p=[1.0, 0.5]).n
    2

    Parameters
    ----------
    m, k, q, p, at, c
        Mass [M], stiffness [M/T2], initial position [L], initial momentum [M L/T], rest position [L] and
        friction coefficient of a force -c p/m [M/T]: numbers, or arrays (n,).
    step, steps, fast, **rest
        Time step [T], number of steps, whether r-RESPA takes small steps here; further fields of `Scene`.

    Raises
    ------
    SceneError
        A value that is not accepted, or arrays that do not broadcast together.
    """
    m, k, q, p, at, friction = _together("spring", m=m, k=k, q=q, p=p, at=at, c=0.0 if c is None else c)
    index = np.arange(len(m))
    terms: list[Term] = [WallSpring(i=index, k=k, at=at, fast=fast)]
    if c is not None:
        terms.append(Damping(i=index, c=friction))
    found = Scene(m=m, q=q, p=p, terms=tuple(terms), step=step, steps=steps, name="spring")
    return found.replace(**({"title": "Mass on a spring"} | rest))


@typed
def chain(
    masses: int = 10,
    m: ArrayLike = 1.0,
    k: ArrayLike = 1.0,
    *,
    waves: Sequence[tuple[int, float]] = (),
    q: ArrayLike = 0.0,
    p: ArrayLike = 0.0,
    step: float = 0.1,
    steps: int = 200,
    **rest: Any,
) -> Scene:
    """Masses in a row between two walls, neighbours joined by springs.

    >>> chain(3, waves=[(1, 0.5)]).q.round(3)
    array([0.354, 0.5  , 0.354])

    Parameters
    ----------
    masses
        Number of masses.
    m, k
        Masses [M], one number or (masses,), and stiffnesses [M/T2], one or (masses + 1,) from wall to wall.
    waves
        Standing waves added to q, each (mode, amplitude [L]); mode 1 is the slowest.  Without waves, q and p
        the chain starts in mode 1 with amplitude 1.
    q, p
        Initial displacements from rest [L] and momenta [M L/T].
    step, steps, **rest
        As in `spring`.

    Raises
    ------
    SceneError
        A value that is not accepted.
    """
    if masses < 1:
        raise SceneError(f"masses = {masses}: a whole number >= 1 is needed")
    memory.need(masses * SCENE_BYTES, f"{masses} masses", "a shorter chain has the same waves")
    _, m, q, p = _together("chain", masses=np.zeros(masses), m=m, q=q, p=p)
    links, walls = _between(masses, reals("chain", k=k)[0])
    try:
        waves = [(mode, float(amplitude)) for mode, amplitude in waves]
    except (TypeError, ValueError):
        raise SceneError(f"waves = {waves!r}: pairs of a mode and an amplitude are needed") from None
    if not (waves or np.any(q) or np.any(p)):
        waves = [(1, 1.0)]
    title, q = f"Chain of {masses:,} masses between two walls", q + standing(masses, waves)
    found = Scene(m=m, q=q, p=p, terms=(walls, links), step=step, steps=steps, name="chain", title=title)
    return found.replace(**rest)


@typed
def cold(scene: Scene, friction: float) -> Scene:
    """The scene in a bath of temperature 0: friction alone, of one rate for every particle [1/T].

    SceneError where the rate is no number > 0, or the scene has a friction of its own.
    """
    if not 0 < friction < np.inf:
        raise SceneError(f"bath.friction = {friction!r}: a number > 0 is needed")
    if any(term.key == "damping" for term in scene.terms):
        raise SceneError("bath.temperature = 0: the scene has a friction of its own; leave one out")
    term = Damping(i=np.arange(scene.n), c=friction * scene.m)
    title = f"{scene.title}, at temperature 0: friction {friction:g} without noise"
    return replace(scene, bath=None, terms=(*scene.terms, term), title=title)


def _between(masses: int, k: Floats) -> tuple[Spring, WallSpring]:
    """The springs of a chain: those between neighbours, and those to the two walls."""
    if k.shape not in ((), (masses + 1,)):
        raise SceneError(f"k has the shape {k.shape}: springs are one more than masses, ({masses + 1},)")
    each, row, none = np.broadcast_to(k, masses + 1), np.arange(masses - 1), np.zeros(masses - 1)
    walls = WallSpring(i=np.array([0, masses - 1]), k=each[[0, -1]], at=np.zeros(2))
    if masses == 1 and not k.ndim:
        # the only mass of a chain is joined to both walls
        walls = WallSpring(i=np.zeros(1, np.int64), k=2 * each[:1], at=np.zeros(1))
    return Spring(a=row, b=row + 1, k=each[1:-1], rest=none), walls


def standing(masses: int, waves: Sequence[tuple[int, float]]) -> Floats:
    """Positions (n,) of standing waves (mode, amplitude) in a chain of n masses.  Raises SceneError."""
    q = np.zeros(masses)
    for mode, amplitude in waves:
        if mode not in range(1, masses + 1):
            raise SceneError(f"waves: mode {mode}: a chain of {masses} has modes 1 to {masses}")
        # whole turns are subtracted while the phase is still an integer multiple of 1/(n + 1) half turns
        phase = mode * np.arange(1, masses + 1) % (2 * (masses + 1))
        q += amplitude * np.sin(np.pi * phase / (masses + 1))
    return q


def _together(where: str, **given: ArrayLike) -> list[Floats]:
    rows = reals(where, **given)
    try:
        return [np.array(row) for row in np.broadcast_arrays(*map(np.atleast_1d, rows))]
    except ValueError:
        shapes = ", ".join(f"{name} {row.shape}" for name, row in zip(given, rows, strict=True))
        raise SceneError(f"numbers that do not broadcast together: {shapes}") from None
