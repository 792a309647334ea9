"""Exact solutions where what decides a motion is small beside what it is taken of, against mpmath.

A position far from 0, an energy close to a barrier's: each lost digits that its
stated error did not count.
"""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest

from springcheck.physics import exact
from springcheck.physics.scene import Scene
from springcheck.physics.terms import (
    Damping,
    RadialSpring,
    Spring,
    VanDerPol,
    WallSpring,
)


def exactly(x: Any) -> Any:
    high = float(x)
    return mp.mpf(high) + mp.mpf(float(np.longdouble(x) - np.longdouble(high)))


def over_stated(scene: Scene, q: Any, p: Any, part: float = 1e-6) -> float:
    """The largest error after one step, in units of the stated one; that is a small part of the motion."""
    solution = scene.system.solution
    assert solution is not None
    found = np.concatenate(exact.true_motion(scene, np.array([1]), scene.step), axis=1)[0]
    stated = np.concatenate(solution.doubt(scene.step))
    assert np.all(stated < part * np.max(np.abs(found)))
    return max(
        float(abs(exactly(x) - y) / exactly(most)) for x, y, most in zip(found, (*q, *p), stated, strict=True)
    )


def pair(ma: float, mb: float, drift: np.ndarray, way: np.ndarray, speed: np.ndarray, at: np.ndarray) -> Any:
    """A pair in a plane: the fields of its scene, and its centre and the velocity of that, exactly."""
    q = np.concatenate([at, at + way])
    p = np.concatenate([ma * drift, mb * (drift + speed)])
    a, b = exactly(ma), exactly(mb)
    centre = [(a * exactly(x) + b * exactly(y)) / (a + b) for x, y in zip(q[:2], q[2:], strict=True)]
    moves = [(exactly(x) + exactly(y)) / (a + b) for x, y in zip(p[:2], p[2:], strict=True)]
    fields = {"m": [ma, ma, mb, mb], "q": q, "p": p, "places": [0, 1, 3, 4], "steps": 1}
    return fields, centre, moves, (a, b)


def ends(centre: Any, moves: Any, masses: Any, t: Any, way: Any, speed: Any) -> tuple[list[Any], list[Any]]:
    (a, b), q, p = masses, [], []
    for m, share in ((a, -b / (a + b)), (b, a / (a + b))):
        q += [centre[i] + moves[i] * t + share * way[i] for i in (0, 1)]
        p += [m * (moves[i] + share * speed[i]) for i in (0, 1)]
    return q, p


@pytest.mark.parametrize(("ma", "mb"), [(1.3e-4, 811.0), (811.0, 1.3e-4), (0.75, 1.25)])
@pytest.mark.parametrize("t", [0.01, 3.0])
def test_a_bond_that_swings_little_beside_its_length(ma: float, mb: float, t: float) -> None:
    k, speed = 70.7, 2.0**-20
    along = np.array([0.75, 1.0]) * speed
    way = np.array([1.125, 1.5])
    rest = 1.875 + 2.0**-30
    bond = RadialSpring(a=[0, 1], b=[2, 3], k=[k] * 2, rest=[rest] * 2, number=[0, 0])
    with mp.workdps(60):
        fields, centre, moves, masses = pair(ma, mb, np.zeros(2), way, along, np.array([0.5, -7.0]))
        scene = Scene(**fields, step=t, terms=(bond,))
        a, b = masses
        w, time = mp.sqrt(exactly(k) * (a + b) / (a * b)), exactly(t)
        v = [exactly(x) / b - exactly(y) / a for x, y in zip(scene.p[2:], scene.p[:2], strict=True)]
        e = [mp.mpf(3) / 5, mp.mpf(4) / 5]
        u, rate = exactly(1.875) - exactly(rest), e[0] * v[0] + e[1] * v[1]
        length = exactly(rest) + u * mp.cos(w * time) + rate / w * mp.sin(w * time)
        slope = rate * mp.cos(w * time) - u * w * mp.sin(w * time)
        q, p = ends(centre, moves, masses, time, [x * length for x in e], [x * slope for x in e])
        assert over_stated(scene, q, p) < 1


def test_friction_on_one_of_two_far_away() -> None:
    m, k, c, t = [0.054, 0.00213], [1399.3, 286.6], 0.00047, 0.000363
    scene = Scene(
        m=m, q=[1e4 + 0.085, 1e4 - 0.257], p=[-0.044, -0.0003], step=t, steps=1,
        terms=(WallSpring(i=[0], k=k[:1], at=[1e4]), Spring(a=[0], b=[1], k=k[1:], rest=[0.0]),
               Damping(i=[1], c=[c])),
    )  # fmt: skip
    with mp.workdps(60):
        (ma, mb), (ka, kb) = map(exactly, m), map(exactly, k)
        slow = mp.matrix([
            [0, 0, 1 / ma, 0], [0, 0, 0, 1 / mb], [-ka - kb, kb, 0, 0], [kb, -kb, 0, -exactly(c) / mb]
        ])  # fmt: skip
        start = mp.matrix([*(exactly(x) - 10000 for x in scene.q), *map(exactly, scene.p)])
        end = mp.expm(slow * exactly(t), method="taylor") * start
        # 10 times the stated error
        assert over_stated(scene, (end[0] + 10000, end[1] + 10000), (end[2], end[3])) < 0.5


@pytest.mark.parametrize(
    ("m", "k", "c", "t"),
    [
        (7700.715921215284, 1.6567478353688883e-07, 0.07143708961943689, -21559433.5),
        (5.951897023595648e-07, 0.0037177356438791876, 9.407993226790962e-05, -1.265285),
    ],
)
def test_a_spring_of_nearly_critical_friction_back_in_time(m: float, k: float, c: float, t: float) -> None:
    terms = (WallSpring(i=[0], k=[k], at=[0.0]), Damping(i=[0], c=[c]))
    scene = Scene(m=[m], q=[0.8], p=[0.0], terms=terms, step=t, steps=1)
    with mp.workdps(120):
        b = exactly(c) / exactly(m) / 2
        s, time, q = mp.sqrt(mp.mpc(b * b - exactly(k) / exactly(m))), exactly(t), exactly(0.8)
        even, odd = (mp.cosh(s * time), mp.sinh(s * time) / s)
        u = q * mp.exp(-b * time) * (even + b * odd)
        # 14 and 10 times the stated error
        assert over_stated(scene, [u.real], [(-q * exactly(k) * odd * mp.exp(-b * time)).real]) < 0.5


@pytest.mark.parametrize(
    ("at", "width", "k"), [(-1e5, 0.0625, -415.1), (3.3, 23.35, 1.7835), (-1e5, 11.0, 0.0)]
)
def test_a_brake_by_place_far_from_0(at: float, width: float, k: float) -> None:
    m, c, t, q = 319.0, 0.69, 0.09, at + 1e-5
    terms = (VanDerPol(i=[0], c=[c], width=[width], at=[at]), WallSpring(i=[0], k=[k], at=[at]))
    scene = Scene(m=[m], q=[q], p=[1e-6], terms=terms[: 2 if k else 1], step=t, steps=1)
    with mp.workdps(60):
        g, w2 = exactly(c) / exactly(m), exactly(k) / exactly(m)
        a = [(exactly(q) - exactly(at)) / exactly(width), exactly(1e-6) / exactly(m) / exactly(width)]
        for j in range(40):
            # (1 - u**2) u' is the slope of u - u**3/3
            cube = mp.fsum(a[x] * a[y] * a[j + 1 - x - y] for x in range(j + 2) for y in range(j + 2 - x))
            a.append((g * (j + 1) * (a[j + 1] - cube / 3) - w2 * a[j]) / ((j + 1) * (j + 2)))
        u, v = (
            mp.polyval(x[::-1], exactly(t)) * exactly(width)
            for x in (a, [j * x for j, x in enumerate(a)][1:])
        )
        # up to 3e7 stated errors
        assert over_stated(scene, [u + exactly(at)], [v * exactly(m)]) < 0.5


@pytest.mark.parametrize(("off", "walls"), [(3.7e9, 1), (-(2.0**40), 0), (1e8, 2)])
def test_a_chain_at_rest_far_from_0(off: float, walls: int) -> None:
    m, rest = np.array([0.3, 1.0, 1.7]), 0.25
    q = off + rest * np.arange(3)
    held = WallSpring(i=[0, 2][:walls], k=[2.2, 0.7][:walls], at=q[[0, 2][:walls]])
    terms = (Spring(a=[0, 1], b=[1, 2], k=[1.0, 3.3], rest=[rest] * 2), *([held] if walls else []))
    scene = Scene(m=m, q=q, p=np.zeros(3), terms=terms, step=10.0, steps=1)
    # it was at rest to 1e-43 of the units, and said to 1e-58
    assert over_stated(scene, list(map(exactly, q)), [mp.mpf(0)] * 3) < 0.5
