"""The exact solution of a charge in a magnetic field, on an isotropic spring or free, with friction or not.

In its plane z = x + i y moves by z'' + (r + i W) z' + w2 z = 0, W the field's strength over the mass: the
sum of two exponentials (Fock-Darwin, or Foucault's pendulum, where w2 > 0).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from springcheck.physics.arrays import Extended, Integers, by_identity
from springcheck.physics.exact.digits import digits, exactly, extended
from springcheck.physics.exact.normal import exact_sums, normal_modes
from springcheck.physics.exact.response import first_difference
from springcheck.physics.exact.well import CANCELS, LAST, States, Well
from springcheck.physics.system import System


@by_identity
class _Planes(NamedTuple):
    """Particles (s,) in planes of coordinates a and b: their roots, start and centres."""

    a: Integers
    b: Integers
    one: NDArray[Any]
    other: NDArray[Any]
    z: NDArray[Any]
    v: NDArray[Any]
    centre: NDArray[Any]


def prepare(system: System[Any]) -> _Planes | None:
    """None where something else acts, or acts unlike on both coordinates of a plane, or beside them."""
    planes = [term for term in system.terms if term.key == "magnetic"]
    if len(planes) != 1 or {term.key for term in system.terms} - {"magnetic", "wall-spring", "damping"}:
        return None
    a, b = planes[0].particles
    if len(np.unique(np.append(a, b))) != system.n or len(a) * 2 != system.n:
        return None
    modes = normal_modes(system.without("magnetic"))
    if np.any(modes.w2[a] != modes.w2[b]) or np.any(modes.rate[a] != modes.rate[b]):
        return None
    turn = np.zeros(system.n, np.longdouble)
    turn[a] = planes[0].parameters[0] / system.m[a].astype(np.longdouble)
    half = (modes.rate[a] + 1j * turn[a]) / 2
    square = half * half - modes.w2[a]
    # where a field just holds what a spring pushes away, time makes its cube of what is lost here
    lost = CANCELS * np.abs(square) < np.abs(half * half) + np.abs(modes.w2[a])
    # and an orbit may be small beside how far from 0 its centre is
    with digits():
        k, pull, rate = exact_sums(system.without("magnetic"), np.diagonal)
        centre = np.where(k == 0, 0 * k, pull / np.where(k == 0, 1, k))
        q = extended(exactly(system.q) - centre)
        if np.any(lost):
            m, field = exactly(system.m)[a], exactly(planes[0].parameters[0])
            real, imag = (rate[a] ** 2 - (field / m) ** 2) / 4 - k[a] / m, rate[a] * field / m / 2
            square = np.where(lost, extended(real) + 1j * extended(imag), square)
    root = np.sqrt(square)
    # the larger root without cancellation, the other by their product
    far = -half - np.where((half.conjugate() * root).real < 0, -root, root)
    near = np.where(far == 0, 0, modes.w2[a] / np.where(far == 0, 1, far))
    v = system.p / system.m.astype(np.longdouble)
    return _Planes(a, b, near, far, q[a] + 1j * q[b], v[a] + 1j * v[b], extended(centre))


def motion(system: System[Any], found: _Planes, t: Extended) -> States:
    """Exact q and p (f, n) at times t (f, 1) [T]."""
    part = first_difference(found.one, found.other, t)
    slope = np.exp(found.one * t) + found.other * part
    z = found.z * (np.exp(found.one * t) - found.one * part) + found.v * part
    v = -found.z * found.one * found.other * part + found.v * slope
    q, p = np.empty((2, len(t), system.n), np.longdouble)
    q[:, found.a], q[:, found.b] = z.real, z.imag
    p[:, found.a], p[:, found.b] = v.real, v.imag
    return q + found.centre, p * system.m


def doubt(system: System[Any], found: _Planes, t: np.longdouble) -> States:
    """Bounds (n,) of the errors of `motion`: roundings of its angles, times the largest state."""
    grown = np.exp(np.maximum(np.maximum((found.one * t).real, (found.other * t).real), 0))
    rate = np.maximum(np.abs(found.one), np.abs(found.other))
    hold = np.minimum(
        np.abs(t), 2 / np.where(np.abs(found.one - found.other) > 0, np.abs(found.one - found.other), 1e-300)
    )
    far = np.abs(found.z) * (1 + np.abs(found.one) * hold) + np.abs(found.v) * hold
    fast = np.abs(found.z * found.one * found.other) * hold + np.abs(found.v) * (
        1 + np.abs(found.other) * hold
    )
    q, p = np.empty((2, system.n), np.longdouble)
    q[found.a] = q[found.b] = LAST * (1 + rate * np.abs(t)) * grown * far
    p[found.a] = p[found.b] = LAST * (1 + rate * np.abs(t)) * grown * fast
    return q + LAST * np.abs(found.centre), p * system.m


GYRATION = Well(key="magnetic", terms=frozenset(), prepare=prepare, motion=motion, doubt=doubt)
"""A whole scene of charges in a field, each on an isotropic spring or on none."""
