"""A stepper with two unlike particles that a spring joins, which shows what one particle cannot."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import MethodError, told
from springcheck.identify.catalogue import title
from springcheck.identify.result import Explanation
from springcheck.identify.steps import takers
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.schemes import SCHEMES

M, K, BOND, Q, P, H = (3.7, 0.6), (2.9, 1.7), 0.8, (1.3, -0.4), (0.7, 0.5), 0.31
"""Masses, stiffnesses to the walls and between, state and step: nothing is equal or 1."""

ROOM = 2.0**-20
"""Distance from a scheme's step that may be rounding, of single precision too: a wrong mass or force moves
the step by a share of h**2 k/m."""


class Timeless:
    """A force that may be asked for at a time, of which it knows nothing."""

    t = 0.0

    def __init__(self, law: Callable[..., Any]) -> None:
        self._law = law

    def __call__(self, q: Any, p: Any = 0.0, t: float = 0.0) -> Any:
        return self._law(q, p)


def returned(step: Callable[..., Any], out: Any) -> tuple[Floats, Floats]:
    """The position and the momentum that a step returned, as doubles.  MethodError, with the place of the
    function, for anything but two real numbers or arrays."""
    several, unordered = isinstance(out, tuple | list), isinstance(out, dict | set | frozenset | str | bytes)
    what = f"{type(out).__name__}{f' of {len(out)}' if several or unordered else ''}"
    try:
        if unordered:
            # keys, letters and elements of a set may be two as well
            raise TypeError(what)
        q, p = out
        what = "no numbers"
        if not (np.iscomplexobj(q) or np.iscomplexobj(p)):
            both = np.asarray(q, np.float64), np.asarray(p, np.float64)
            if all(x.size for x in both):
                return both
        else:
            what = "complex numbers, and no real numbers"
    except (TypeError, ValueError):
        pass
    name, code = getattr(step, "__name__", "the function"), getattr(inspect.unwrap(step), "__code__", None)
    where = f" ({Path(code.co_filename).name}, line {code.co_firstlineno})" if code else ""
    raise MethodError(f"{name}: returned {what}; a step returns (q, p){where}")


def _pair(bond: float) -> Scene:
    both, m, k, q, p = np.arange(2), *map(np.array, (M, K, Q, P))
    walls = WallSpring(i=both, k=k, at=np.zeros(2))
    joined = Spring(a=both[:1], b=both[1:], k=np.array([bond]), rest=np.zeros(1))
    return Scene(m=m, q=q, p=p, terms=(walls, joined), step=H, steps=1)


def _step(step: Callable[..., Any], scene: Scene) -> Floats:
    """State (2, 2) after a step.  Raises MethodError where the stepper takes no arrays of two particles."""
    force = Timeless(lambda q, p: scene.system.force(*(np.array(x, np.float64) for x in (q, p + 0 * q))))
    try:
        out = step(scene.q.copy(), scene.p.copy(), H, force, scene.m.copy())
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        file = getattr(getattr(step, "__code__", None), "co_filename", "")
        raise MethodError(f"arrays of two end in {told(error, file)}") from error
    new = returned(step, out)
    if any(x.shape != (2,) or not np.all(np.isfinite(x)) for x in new):
        raise MethodError(f"of arrays of two it returns {[x.tolist() for x in new]}")
    return np.stack(new)


def on_a_pair(step: Callable[..., Any], names: Sequence[str]) -> list[Explanation]:
    """What a stepper, on one particle one of these schemes, does wrong with two.  Raises MethodError where it
    cannot be tried."""
    known = [name for name in names if name in SCHEMES and SCHEMES[name].has("one-step")]
    if not known:
        raise MethodError(f"springcheck runs no {names[0]}")
    joined, apart = _pair(BOND), _pair(0.0)
    made = _step(step, joined)

    def takes(scene: Scene, new: Floats) -> bool:
        q, p = np.stack([[scene.q, scene.p], new], axis=1)
        return bool(takers(known, scene, H, q, p, ROOM))

    if takes(joined, made):
        return []
    whose = f"{title(known[0])} of one particle, but"
    for m, which in zip(M, ("first", "last"), strict=True):
        if takes(replace(joined, m=np.full(2, m)), made):
            cause = f"{whose} of two both move with the mass of the {which}"
            return [
                Explanation(cause, "divide each momentum by its own mass: mass is an array, as q and p are")
            ]
    if takes(apart, _step(step, apart)):
        cause = f"{whose} of two that a spring joins a force is worked out when only one of them has moved"
        return [Explanation(cause, "work out the forces on all particles, then move all of them")]
    cause = f"{whose} not of two of unlike mass"
    return [Explanation(cause, "look for a number of one particle that is used for others")]
