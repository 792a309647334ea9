"""Identification of arrays: every stage in its order."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from springcheck.bath import THERMOSTATS
from springcheck.errors import IdentificationError
from springcheck.identify.candidates import either_way
from springcheck.identify.compare import nearest
from springcheck.identify.evidence import Measured
from springcheck.identify.explain import explain
from springcheck.identify.hypothesis import FEW, Joint, distinct
from springcheck.identify.judged import coupled, judged
from springcheck.identify.misplaced import turned
from springcheck.identify.named import determinants, difference, named
from springcheck.identify.notes import CERTAIN_STEPS, of_few
from springcheck.identify.positions import identify_positions
from springcheck.identify.record import Record, read
from springcheck.identify.result import Identification, nothing
from springcheck.identify.search import accounted
from springcheck.identify.thermal import explained, of_bath
from springcheck.identify.together import at_rest, distance, of_a_pair, of_rotation


def identify_arrays(
    t: ArrayLike,
    q: ArrayLike,
    p: ArrayLike | None = None,
    *,
    v: ArrayLike | None = None,
    mass: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    friction: float | None = None,
    step: float | None = None,
    last: ArrayLike | None = None,
) -> Identification:
    """The scheme that made a trajectory of oscillators, from its states alone.

    t (f,) [T]; q (f, n) or (f,) [L]; p [M L/T] or v [L/T] or both, like q.  Where both are given the mass
    follows from them; where neither is, `positions` reports what is left open.  With momenta alone and no
    mass, symmetric schemes look alike on a spring, which the notes report.  Coupled oscillators are replaced
    by their normal modes.  `mass` [M], `stiffness` [M/T2], `friction` c [M/T] and `step` [T] are stated
    values, which the states are tested against; `last` is the unit of the last decimal of velocities (n,)
    that were written in other units. Raises IdentificationError where the states cannot show a map: too few,
    not finite, at rest, at uneven times, or not spanning the plane.
    """
    if p is None and v is None:
        return identify_positions(read(t, q, None, np.zeros(np.shape(q)), mass), stiffness, friction, step)
    stated: dict[str, Any] = {"mass": mass, "stiffness": stiffness, "friction": friction, "step": step}
    times = np.asarray(t, dtype=np.float64)
    if not (times.ndim == 1 and len(times) > 1 and times[-1] < times[0]):
        return _of_states(t, q, p, v, last, **stated)
    # steps back in time, or frames that stand in reverse order
    given, turned = (x is None or np.sign(x) == side for x, side in ((step, -1), (step, 1)))
    reverse: list[Any] = [*(None if x is None else np.asarray(x)[::-1] for x in (t, q, p, v)), last]
    ways = [_of_states(t, q, p, v, last, **stated)] if given or not turned else []
    return either_way([*ways, *([_of_states(*reverse, **stated)] if turned else [])])


def _of_states(
    t: Any, q: Any, p: Any, v: Any, last: Any, *, mass: ArrayLike | None, **stated: Any
) -> Identification:
    """Identify the scheme from times, positions, momenta or velocities, of which one may be None."""
    record = read(t, q, p, v, mass, last)
    try:
        found = of_few(record, _of_record(record, **stated))
        found = found if found.fits and stated["stiffness"] is not None else of_rotation(record, found)
    except IdentificationError:
        if in_a_bath := of_bath(t, q, p, v, mass, **stated):
            return in_a_bath
        raise
    if found.candidates:
        return found
    bath = explained(found, t, q, p, v, mass, **stated)
    local = any(x.local for x in found.explanations)
    # of noise, where a mistake in the record explains the states, only counted collisions are as sharp
    sharp = any(THERMOSTATS[x.scheme].collides and np.all(np.isfinite(x.friction)) for x in bath.candidates)
    return bath if sharp or not local else found


def _of_record(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> Identification:
    found = _of_coordinates(record, stiffness, friction, step)
    named = found.fits and found.scheme is not None
    if named and stiffness is None:
        return at_rest(record, found)
    if named or stiffness is not None or (pair := distance(record)) is None:
        return found
    other = _of_coordinates(pair, None, friction, step)
    # a coordinate of a pair is no oscillator, and what is said of it alone is wrong
    return of_a_pair(record, other) if other.fits or not other.defect_ulp >= found.defect_ulp else found


def _of_coordinates(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> Identification:
    """Fit maps, compare them with the schemes, and interpret the hypotheses that remain."""
    seen = judged(record, stiffness, friction, step)
    if any(found.drifts for found in seen.maps):
        return _unknown(seen, range(1, 2))
    way, left, fitting = accounted(seen)
    # in many steps to a frame some scheme fits coarse numbers by chance, on another spring than the stated
    if seen.stiffness is not None and not record.deep and all(x.stride > CERTAIN_STEPS for x in left):
        left = {x: left[x] for x in left if not seen.disagreements(x)}
    if not left:
        # where nothing fits, the nearest scheme may take several steps to a frame
        unknown = _unknown(seen, range(1, 2) if fitting else FEW)
        if seen.record.fine and not unknown.explanations[0].shown:
            # approximate roots and quotients err alike where the motion comes back, as on a graphics card
            way, left, _ = accounted(replace(seen, record=replace(seen.record, rough=True)))
        if not left:
            return unknown
    return named(way, left, step)


def _unknown(seen: Measured, strides: range) -> Identification:
    """Identification without a scheme: causes, with the numbers of the one scheme that the first names, and
    the nearest scheme of these strides unless velocities have the wrong sign."""
    maps = seen.maps

    def distance(joint: Joint) -> float:
        return max(max(map(abs, difference(found, m))) for found, m in zip(maps, joint.parts, strict=True))

    near: dict[str, Any] = {}
    if coupled(seen.record, dict(zip(seen.moving, maps, strict=True))) is not None:
        # what one coordinate's map shows of a motion of several is no number of a scheme
        return nothing(explain(seen), determinant=(math.nan,) * len(maps), notes=seen.notes)
    tried = nearest(maps, seen.terms, distinct(damped=False), strides)
    if tried and not turned(seen.record, seen.moving):
        least = min(map(distance, tried))
        # many schemes and strides come close by chance; the simplest of the close ones is the better guess
        close = min((x for x in tried if distance(x) <= 10 * least), key=lambda x: x.simplicity)
        near = {"nearest": str(close), "difference": difference(maps[0], close.parts[0])}
    causes = explain(seen)
    if (of := causes[0].hypothesis) and len(maps) == 1:
        # what is only near has none of the states' numbers
        own = Joint(family=of.family, stride=of.stride, parts=(of,))
        near["omega"], near["stiffness"], _ = seen.numbers(own)
    determinant, symplectic = determinants(maps, 1)
    return nothing(
        causes,
        determinant=determinant,
        symplectic_defect=symplectic,
        defect_ulp=max(float(np.max(found.residual)) for found in maps) / 2.0**-52,
        notes=seen.notes,
        **near,
    )
