"""The true motion against mpmath, over long runs and for every kind of mode."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import mpmath
import numpy as np
import pytest

import references
import springcheck
from springcheck.cli import main
from springcheck.physics import builders, exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.exact import reference
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Spring, Term, WallSpring, Weight
from springcheck.studies import keeper


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
        # a phase of 1e6, known to the last digits of its width
        bound = max(1e-12, 4 * exact.EPS * float(phase))
        assert abs(mpmath.mpf(str(q[0, 0])) - expected_q) / amplitude < bound
        assert abs(mpmath.mpf(str(p[0, 0])) - expected_p) / (m * w * amplitude) < bound


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
        rows = scene.system.hessian(zero)
        stiffness = mpmath.matrix([[mpmath.mpf(str(x)) for x in row] for row in rows])
        wide = zero.astype(np.longdouble)
        pull = [mpmath.mpf(str(x)) for x in scene.system.force(wide, wide)]
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
    found = scene.system.modes
    expected = np.array([0, 3 * 1.7 / 2.3, 3 * 1.7 / 2.3])
    assert np.max(np.abs(np.sort(found.w2) - expected)) < max(1e-15, 16 * exact.EPS)
    inner = found.vectors.T @ found.vectors if found.vectors is not None else np.zeros((3, 3))
    assert np.max(np.abs(inner - np.eye(3))) < 32 * exact.EPS
    q, p = exact.true_motion(scene, np.array([0, 1000]), 0.1)
    energy = scene.system.energy(q, p)
    assert abs(energy[1] / energy[0] - 1) < max(1e-15, 32 * exact.EPS)
    assert np.sum(p[1]) == pytest.approx(0.4, abs=max(1e-15, 8 * exact.EPS))


def worked_out(scene: Scene, t: float, digits: int = 80) -> tuple[list[mpmath.mpf], list[mpmath.mpf]]:
    """q and p at time t of a linear scene, by the exponential of its equations in so many digits."""
    n = scene.n
    with mpmath.workdps(digits):
        a = mpmath.zeros(2 * n + 1, 2 * n + 1)
        zero = np.zeros(n, dtype=np.longdouble)
        k, pull = scene.system.hessian(zero), scene.system.force(zero, zero)
        rate = scene.system.friction_rates
        for i in range(n):
            a[i, n + i] = 1 / mpmath.mpf(float(scene.m[i]))
            a[n + i, n + i] = -wide(rate[i])
            a[n + i, 2 * n] = wide(pull[i])
            for j in range(n):
                a[n + i, j] = -wide(k[i, j])
        start = mpmath.matrix([float(x) for x in (*scene.q, *scene.p, 1.0)])
        end = mpmath.expm(a * mpmath.mpf(t)) * start
        return list(end[:n]), list(end[n : 2 * n])


def wide(x: np.longdouble) -> mpmath.mpf:
    """An extended number, to its last bit."""
    return mpmath.mpf(float(x)) + mpmath.mpf(float(x - np.longdouble(float(x))))


def made(m: list[float], terms: tuple[Term, ...], q: list[float], p: list[float], t: float) -> Scene:
    return Scene(
        name="made", title="", source="", m=np.array(m), q=np.array(q), p=np.array(p), terms=terms,
        step=t, steps=1,
    )  # fmt: skip


def held(k: list[float], at: list[float]) -> WallSpring:
    """Springs from particle 0 to walls."""
    return WallSpring(i=np.zeros(len(k), np.int64), k=np.array(k), at=np.array(at))


def friction(c: float) -> Damping:
    return Damping(i=np.array([0]), c=np.array([c]))


BOND = Spring(a=np.array([0]), b=np.array([1]), k=np.array([1.5]), rest=np.array([0.0]))
LINEAR = {
    "towards the top of a barrier": made([1.0], (held([-1.0], [0.0]),), [1.0], [-1.0], 50.0),
    "the same, backwards": made([1.0], (held([-1.0], [0.0]),), [1.0], [1.0], -50.0),
    "down a barrier": made([1.7], (held([-2.3], [0.4]),), [0.3], [0.1], 7.0),
    "a constant force against slow friction": made(
        [1.3], (held([1.0, -1.0], [0.7, 0.2]), friction(1e-10)), [0.3], [0.1], 1.0
    ),
    "a constant force against friction": made(
        [1.3], (held([1.0, -1.0], [0.7, 0.2]), friction(0.9)), [0.3], [0.1], 9.0
    ),
    "friction to the end": made([1.3], (friction(0.7),), [0.3], [0.1], 60.0),
    "a constant force on a pair": made(
        [1.0, 2.0], (BOND, held([1.0, -1.0], [0.3, 0.9])), [0.3, -0.2], [0.1, 0.7], 7.0
    ),
}


@pytest.mark.parametrize("name", LINEAR)
def test_linear_motions_that_cancel_keep_their_digits(name: str) -> None:
    scene = LINEAR[name]
    found = exact.true_motion(scene, np.array([1]), scene.step)
    with mpmath.workdps(40):
        for states, wanted in zip(found, worked_out(scene, scene.step), strict=True):
            for x, y in zip(states[0], wanted, strict=True):
                assert abs(wide(x) / y - 1) < 100 * exact.EPS


@pytest.mark.parametrize("kind", references.KINDS)
def test_random_scenes_lie_within_the_stated_error(kind: str) -> None:
    """By Taylor series in integers: `validation/references.py` takes 2,000 of them."""
    for j in range(2):
        scene = references.random(np.random.default_rng([3, j]), kind)
        assert exact.no_reference(scene) == ""
        assert max(references.ratios(scene, [scene.steps])) <= 1


def linear_ratio(scene: Scene, digits: int = 80) -> float:
    """The largest error after one step of a linear scene, in units of the stated one."""
    wanted = worked_out(scene, scene.step, digits)
    found = exact.true_motion(scene, np.array([1]), scene.step)
    assert scene.system.solution is not None
    bounds = scene.system.solution.doubt(scene.step)
    with mpmath.workdps(digits):
        return max(
            float(abs(wide(x) - y) / wide(most))
            for states, right, stated in zip(found, wanted, bounds, strict=True)
            for x, y, most in zip(states[0], right, stated, strict=True)
        )


def test_frames_of_unlike_friction_that_lie_evenly_are_those_of_their_times() -> None:
    """Evenly spaced frames come from one another, others each from the start: forwards and back."""
    rng, n = np.random.default_rng(4), 5
    link = Spring(
        a=np.arange(n - 1), b=np.arange(1, n), k=rng.uniform(0.5, 3, n - 1), rest=rng.normal(size=n - 1)
    )
    slow = Damping(i=np.arange(n), c=np.array([0.0, 0.3, 1.1, 0.02, 2.0]))
    scene = made(rng.uniform(0.3, 4, n), (link, slow), rng.normal(size=n), rng.normal(size=n), 0.07)
    assert not scene.system.has_modes
    for steps in (np.arange(101), -np.arange(3, 40), 7 * np.arange(1000, 1030)):
        together = exact.true_motion(scene, steps, 0.07)
        for i in (0, 1, len(steps) // 2, len(steps) - 1):
            one = exact.true_motion(scene, steps[i : i + 1], 0.07)
            assert scene.system.solution is not None
            bounds = scene.system.solution.doubt(0.07 * float(steps[i]))
            for x, y, bound in zip(together, one, bounds, strict=True):
                assert np.all(np.abs(x[i] - y[0]) <= bound)
    falls = replace(scene, terms=(*scene.terms, Weight(i=[0], force=[0.3], at=[0.0])))
    assert linear_ratio(falls) < 0.25


def test_a_solver_is_judged_where_friction_is_unlike(need: Any) -> None:
    need("sundials:bdf")
    link = Spring(a=np.array([0]), b=np.array([1]), k=np.array([1.7]), rest=np.ones(1))
    wall, slow = WallSpring(i=[0], k=[2.9], at=[0.0]), Damping(i=np.arange(2), c=np.array([0.4, 0.1]))
    scene = Scene(
        m=[1.3, 3.7], q=[0.3, 1.4], p=[0.2, -0.5], terms=(wall, link, slow), step=0.1, steps=100,
    )  # fmt: skip
    run = springcheck.simulate(scene, "sundials:bdf")
    other = replace(scene, terms=(wall, link, replace(slow, c=slow.c * (1 + 1e-5))))
    for of, passed in ((scene, True), (other, False)):
        assert [v.passed for v in springcheck.judge(of, run) if v.check == "tolerance"] == [passed]


def test_what_is_stated_of_a_free_chain_does_not_grow_as_if_something_held_it() -> None:
    """Nine particles, t = 1e5: a translation has no frequency that could be off once it said 0.09."""
    rng = np.random.default_rng(9)
    n, a = 9, np.arange(8)
    link = Spring(a=a, b=a + 1, k=rng.uniform(0.8, 1.4, n - 1), rest=rng.normal(size=n - 1))
    scene = made(rng.uniform(0.8, 1.2, n), (link,), rng.normal(size=n), rng.normal(size=n), 1e5)
    assert exact.uncertainty(scene, 1e5) < 1e15 * exact.EPS
    assert linear_ratio(scene) < 0.2


@pytest.mark.parametrize("m", [(3.7, 1e60, 1e-4), (1e-60, 2.0, 1e100), (1.3, 1e308, 1.0)])
def test_masses_over_hundreds_of_decades_keep_the_stated_error(m: tuple[float, ...]) -> None:
    """Each joined mode needs as many digits more as the masses differ by decades."""
    scene = replace(scenes.load_scene("chain"), m=np.array(m))
    w2 = np.asarray(scene.system.hessian(scene.q), np.float64) / np.sqrt(scene.m)[:, None] / np.sqrt(scene.m)
    step = 20 / float(np.sqrt(np.max(np.abs(w2))))
    assert linear_ratio(replace(scene, step=step, steps=1), 700) <= 1


def test_a_chain_over_thirteen_decades_keeps_the_digits_of_every_particle() -> None:
    rng = np.random.default_rng(11)
    n = 6
    spring = Spring(
        a=np.arange(n - 1),
        b=np.arange(1, n),
        k=10.0 ** np.linspace(-3, 3.5, n - 1),
        rest=rng.normal(size=n - 1),
    )
    m = 10.0 ** np.linspace(3, -3.5, n)
    q, p = rng.normal(size=n), m * rng.normal(size=n)
    scene = made(m.tolist(), (spring, held([1e-3], [0.3])), q.tolist(), p.tolist(), 1.0)
    w2 = np.sort(scene.system.modes.w2)
    assert w2[-1] / w2[0] > 1e13
    assert linear_ratio(scene) < 1
    assert exact.uncertainty(scene, 1.0) < 1e6 * exact.EPS
    solution = scene.system.solution
    assert solution is not None
    # each particle by itself: the fast ones do not spoil what is known of the slow ones
    assert np.all(solution.doubt(1.0)[0][:3] < 1e3 * exact.EPS)


def test_an_error_below_that_of_the_exact_solution_is_marked_so(tmp_path: Path) -> None:
    from springcheck.studies.run import measure
    from springcheck.studies.run.tally import Tally

    scene = builders.chain(40, 1.3, np.linspace(1, 3, 41), waves=[(1, 1.0)], step=0.3, steps=900)
    known = exact.uncertainty(scene, scene.step * scene.steps)
    assert known > 1e-15
    tally = Tally(scene)
    # the exact solution itself, in doubles
    tally.add(springcheck.exact(replace(scene, every=scene.steps)))
    assert tally.error < known <= tally.doubt
    report = measure.run(replace(scene, steps=1, every=1), tmp_path / "x.h5", methods=["own:rk4"])
    (line,) = report.runs
    said = replace(report, runs=(replace(line, error_below=True, max_error=known),))
    assert f"<{known:.2e}" in str(said)


@pytest.mark.parametrize("n", [40, 60_000])
def test_the_stated_error_of_a_long_chain_is_some_roundings_of_its_length(n: int) -> None:
    scene = builders.chain(n, 1.3, 2.9, waves=[(1, 1.0), (7, 0.3)], step=0.03, steps=2000)
    stated = exact.uncertainty(scene, scene.step * scene.steps)
    # what rounding leaves moves the fastest wave, whose energy is (n/7)**2 times that of the same slow one
    assert stated < 64 * 24 * np.log2(8 * n) * n / 7 * exact.EPS
    # another route: each standing wave by itself
    t = scene.step * scene.steps
    q = np.zeros(n, np.longdouble)
    for mode, size in ((1, 1.0), (7, 0.3)):
        w = 2 * np.sqrt(2.9 / 1.3) * np.sin(np.pi * mode / (2 * (n + 1)))
        q += size * np.cos(w * t) * builders.standing(n, [(mode, 1.0)])
    found, _ = exact.true_motion(scene, np.array([scene.steps]), scene.step)
    assert np.max(np.abs(found[0] - q)) < 1e-13


def test_a_reference_is_read_from_its_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What draws or reports does not integrate, and another scene's reference counts for nothing."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "kepler", "--method", "own:rk4", "-o", "k.h5", "--quiet"]) == 0
    scene = scenes.load_scene("kepler")
    steps = np.arange(0, scene.steps, 7)
    right, stated = exact.true_motion(scene, steps, scene.step), exact.uncertainty(scene, 32.0)
    with monkeypatch.context() as patch:
        patch.setattr(reference, "_STORED", {})
        patch.setattr(reference.Path, "extend", lambda self, end: pytest.fail("it is integrated again"))
        for command in ("inspect", "plot", "report"):
            assert main([command, "k.h5"]) == 0
        again = keeper.stored_scene(tmp_path / "k.h5")
        for one, other in zip(right, exact.true_motion(again, steps, scene.step), strict=True):
            assert np.array_equal(one, other)
        assert exact.uncertainty(again, 32.0) == stated
        # beyond its end it is integrated from the start
        patch.setattr(reference, "_STORED", {})
        with pytest.raises(pytest.fail.Exception):
            exact.true_motion(keeper.stored_scene(tmp_path / "k.h5"), 2 * steps, scene.step)
    for name, value in (("starts", 1.0), ("series", np.nan), ("powers", 1e300), ("dq", -1.0)):
        with h5py.File("k.h5", "r+") as file:
            before = file[f"reference/{name}"][0, 0]
            file[f"reference/{name}"][0, 0] = value * (1 + 1e-9)
        monkeypatch.setattr(reference, "_STORED", {})
        again = keeper.stored_scene(tmp_path / "k.h5")
        assert np.array_equal(exact.true_motion(again, steps, scene.step)[0], right[0])
        with h5py.File("k.h5", "r+") as file:
            file[f"reference/{name}"][0, 0] = before
