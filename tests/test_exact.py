"""The true motion against mpmath, over long runs and for every kind of mode."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from springcheck import exact, mechanics, scenes
from springcheck.model import Scene
from springcheck.terms import Spring, WallSpring


def spring(m: float, k: float, q: float, p: float, h: float) -> Scene:
    return Scene(
        name="spring", title="", source="", m=np.array([m]), q=np.array([q]), p=np.array([p]),
        terms=(WallSpring(i=np.array([0]), k=np.array([k]), at=np.array([0.0])),),
        step=h, steps=10,
    )  # fmt: skip


@pytest.mark.parametrize(("m", "k"), [(1.0, 1.0), (3.7, 2.9), (0.013, 870.0)])
def test_after_ten_million_steps_the_true_motion_is_right_to_1e_12(m: float, k: float) -> None:
    h, steps = 0.1 * np.sqrt(m / k), 10_000_000
    q, p = exact.true_motion(spring(m, k, 0.3, 0.7, h), np.array([steps]), h)
    with mpmath.workdps(40):
        w = mpmath.sqrt(mpmath.mpf(k) / mpmath.mpf(m))
        phase = w * mpmath.mpf(float(h)) * steps
        q0, p0 = mpmath.mpf(0.3), mpmath.mpf(0.7)
        expected_q = q0 * mpmath.cos(phase) + p0 / (m * w) * mpmath.sin(phase)
        expected_p = p0 * mpmath.cos(phase) - m * w * q0 * mpmath.sin(phase)
        amplitude = mpmath.hypot(q0, p0 / (m * w))
        assert abs(mpmath.mpf(str(q[0, 0])) - expected_q) / amplitude < 1e-12
        assert abs(mpmath.mpf(str(p[0, 0])) - expected_p) / (m * w * amplitude) < 1e-12


@pytest.mark.parametrize("k", [-2.9, 0.0])
def test_free_and_inverted_motion_have_their_closed_forms(k: float) -> None:
    h, steps = 0.31, np.arange(20)
    q, p = exact.true_motion(spring(3.7, k, 0.3, 0.7, h), steps, h)
    m = np.longdouble(3.7)
    t = steps * np.longdouble(h)
    if k == 0:
        expected = 0.3 + 0.7 * t / m, np.full_like(t, 0.7)
    else:
        w = np.sqrt(np.longdouble(-k) / m)
        expected = (
            0.3 * np.cosh(w * t) + 0.7 / (m * w) * np.sinh(w * t),
            0.7 * np.cosh(w * t) + 0.3 * m * w * np.sinh(w * t),
        )
    for found, wanted in zip((q[:, 0], p[:, 0]), expected, strict=True):
        assert np.max(np.abs(found - wanted) / np.abs(wanted)) < 64 * exact.EPS


def test_a_chain_moves_as_its_equations_solved_in_forty_digits_say() -> None:
    scene = scenes.load_scene("chain")
    steps = np.array([0, 1, 57, 200, 100_000])
    q, p = exact.true_motion(scene, steps, scene.step)
    with mpmath.workdps(40):
        m = [mpmath.mpf(float(x)) for x in scene.m]
        zero = np.zeros(scene.n)
        rows = mechanics.stiffness(scene, zero)
        stiffness = mpmath.matrix([[mpmath.mpf(str(x)) for x in row] for row in rows])
        wide = zero.astype(np.longdouble)
        pull = [mpmath.mpf(str(x)) for x in mechanics.force(scene.terms)(wide, wide)]
        root = mpmath.diag([mpmath.sqrt(x) for x in m])
        values, vectors = mpmath.eigsy(root**-1 * stiffness * root**-1)
        y0 = vectors.T * root * mpmath.matrix(scene.q.tolist())
        v0 = vectors.T * root**-1 * mpmath.matrix(scene.p.tolist())
        g = vectors.T * root**-1 * mpmath.matrix(pull)
        for row, count in enumerate(steps):
            t = int(count) * mpmath.mpf(scene.step)
            y, v = mpmath.matrix(scene.n, 1), mpmath.matrix(scene.n, 1)
            for j in range(scene.n):
                w = mpmath.sqrt(values[j])
                centre = g[j] / values[j]
                c, s = mpmath.cos(w * t), mpmath.sin(w * t)
                y[j] = centre + (y0[j] - centre) * c + v0[j] / w * s
                v[j] = v0[j] * c - w * (y0[j] - centre) * s
            expected_q, expected_p = root**-1 * vectors * y, root * vectors * v
            for i in range(scene.n):
                # modes are known to n EPS; the phase of 1e5 steps carries that on
                bound = 100 * exact.EPS * (1 + int(count))
                assert abs(mpmath.mpf(str(q[row, i])) - expected_q[i]) < bound
                assert abs(mpmath.mpf(str(p[row, i])) - expected_p[i]) < bound


def test_particles_of_equal_frequency_that_are_joined_keep_their_modes_apart() -> None:
    # a ring of three equal masses: two of its modes have one frequency
    scene = Scene(
        name="ring", title="", source="", m=np.full(3, 2.3), q=np.array([0.1, -0.4, 0.7]),
        p=np.array([0.2, 0.5, -0.3]),
        terms=(
            Spring(
                a=np.array([0, 1, 2]), b=np.array([1, 2, 0]), k=np.full(3, 1.7), rest=np.zeros(3)
            ),
        ),
        step=0.1, steps=10,
    )  # fmt: skip
    found = exact.modes(scene)
    expected = np.array([0, 3 * 1.7 / 2.3, 3 * 1.7 / 2.3])
    assert np.max(np.abs(np.sort(found.w2) - expected)) < 1e-15
    inner = found.vectors.T @ found.vectors if found.vectors is not None else np.zeros((3, 3))
    assert np.max(np.abs(inner - np.eye(3))) < 32 * exact.EPS
    q, p = exact.true_motion(scene, np.array([0, 1000]), 0.1)
    energy = mechanics.energy(scene, q, p)
    assert abs(energy[1] / energy[0] - 1) < 1e-15
    assert np.sum(p[1]) == pytest.approx(0.4, abs=1e-15)
