"""The own methods are the two Euler loops of the blog and their relatives, to the last bit.

What is compiled equals what is interpreted bit for bit; one step is the scheme's own map up to rounding.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from springcheck import schemes
from springcheck.arrays import Floats
from springcheck.engines import parse
from springcheck.engines.own import ENGINE, kernels, simulation
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Spring, Term, WallSpring

METHODS = tuple(ENGINE.methods)
LAYOUTS = {"one": kernels.ONE, "many": kernels.MANY, "joined": kernels.JOINED, "chain": kernels.CHAIN}
KERNELS = [(layout, method) for layout in LAYOUTS for method in LAYOUTS[layout]]


def scene(m: Any, q: Any, p: Any, *terms: Term, step: float = 0.1, steps: int = 200) -> Scene:
    m, q, p = (np.array(x, dtype=np.float64, ndmin=1) for x in (m, q, p))
    return Scene(name="test", title="", source="", m=m, q=q, p=p, terms=terms, step=step, steps=steps)


def wall(k: Any, at: Any = 0.0, i: Any = None) -> WallSpring:
    k = np.array(k, dtype=np.float64, ndmin=1)
    at = np.broadcast_to(np.asarray(at, dtype=np.float64), k.shape)
    return WallSpring(i=np.arange(len(k)) if i is None else np.array(i), k=k, at=at)


def random_scene(layout: str, seed: int, *, linear: bool) -> Scene:
    """Random masses, springs (weak, absent, repelling) and steps (backwards too) that need this layout."""
    rng = np.random.default_rng(seed)
    n = 1 if layout == "one" else int(rng.integers(2, 9))
    m, q, p = rng.uniform(0.1, 9, n), rng.normal(size=n), rng.normal(size=n)
    h = float(rng.choice([-1, 1]) * rng.uniform(0.001, 0.4))
    k = rng.normal(1, 1, n) * (rng.random(n) < 0.8)
    if layout == "one":
        return scene(m, q, p, wall(k), step=h)
    if layout == "many":
        order = rng.permutation(n)
        return scene(m, q, p, wall(k, rng.normal(size=n), order), step=h)
    if layout == "chain":
        a, b = rng.permutation([np.arange(n - 1), np.arange(1, n)], axis=0)
        links = Spring(a=a, b=b, k=9 * rng.random(n - 1), rest=rng.normal(size=n - 1))
        return scene(m, q, p, wall(rng.random(3), rng.normal(size=3), rng.integers(0, n, 3)), links, step=h)
    s = int(rng.integers(1, 12))
    a = rng.integers(0, n, s)
    links = Spring(a=a, b=(a + rng.integers(1, n, s)) % n, k=rng.normal(1, 1, s), rest=rng.normal(size=s))
    walls = wall([-0.3, 1.4, 2.3], rng.normal(size=3), rng.integers(0, n, 3))
    wells = Quartic(i=rng.integers(0, n, 2), b=rng.normal(0.2, 0.2, 2), at=rng.normal(size=2))
    return scene(m, q, p, walls, links, *(() if linear else (wells,)), step=h)


def run(
    what: Scene, method: str, *, compiled: bool | None = None, every: int = 1, frames: int = 200
) -> tuple[Floats, Floats]:
    q, p = np.empty((frames, what.n)), np.empty((frames, what.n))
    simulation.prepare(what, method, what.step, compiled=compiled).advance(every, q, p)
    return q, p


def blog_explicit(m: float, k: float, q: float, p: float, dt: float) -> list[tuple[float, float]]:
    states = []
    for _ in range(200):
        new_q = q + (p / m) * dt
        new_p = p + (-k * q) * dt
        q, p = new_q, new_p
        states.append((q, p))
    return states


def blog_semi_implicit(m: float, k: float, q: float, p: float, dt: float) -> list[tuple[float, float]]:
    states = []
    for _ in range(200):
        p = p + (-k * q) * dt
        q = q + (p / m) * dt
        states.append((q, p))
    return states


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(("m", "k", "q", "p"), [(1.0, 1.0, 0.0, 1.0), (3.7, 2.9, 0.3, 0.7)])
@pytest.mark.parametrize(
    ("method", "blog"), [("euler", blog_explicit), ("semi-implicit-euler", blog_semi_implicit)]
)
def test_all_200_steps_equal_the_loops_of_the_blog_bit_for_bit(
    method: str, blog: Any, m: float, k: float, q: float, p: float, compiled: bool
) -> None:
    expected = np.array(blog(m, k, q, p, 0.1))
    got_q, got_p = run(scene(m, q, p, wall(k)), method, compiled=compiled)
    assert np.all(got_q[:, 0] == expected[:, 0])
    assert np.all(got_p[:, 0] == expected[:, 1])
    other = np.array(blog(m, k, q, p, np.nextafter(0.1, 1)))
    assert not np.all(got_q[:, 0] == other[:, 0]), "a step longer by one bit must show"


@pytest.mark.parametrize(("layout", "method"), KERNELS)
def test_compiled_equals_interpreted_bit_for_bit_for_every_kernel(layout: str, method: str) -> None:
    for seed in range(25):
        what = random_scene(layout, seed, linear=method == "implicit-euler")
        slow = simulation.prepare(what, method, what.step, compiled=False)
        fast = simulation.prepare(what, method, what.step, compiled=True)
        assert (slow.compiled, fast.compiled) == (False, True)
        assert simulation._layout(what, method, what.step).kernel is LAYOUTS[layout][method]
        states = np.empty((4, 40, what.n))
        slow.advance(3, states[0], states[1])
        fast.advance(3, states[2], states[3])
        assert states[:2].tobytes() == states[2:].tobytes()
        assert not np.array_equal(states[0, 0], states[0, 1])


@pytest.mark.parametrize(("layout", "method"), KERNELS)
def test_every_step_is_the_map_of_its_scheme_up_to_rounding(layout: str, method: str) -> None:
    """Wilkinson's bound: roundings on the longest path, times eps, times the step on absolute values."""
    name = ENGINE.methods[method].scheme
    scheme = schemes.SCHEMES[name]
    for seed in range(10):
        linear = method == "implicit-euler"
        what = random_scene(layout, seed, linear=linear)
        q, p = run(what, method, compiled=False, frames=20)
        before = np.vstack([what.q, q[:-1]]), np.vstack([what.p, p[:-1]])
        k = what.system.hessian(what.q) if linear else None
        h, m = what.step, what.m
        for old_q, old_p, new_q, new_p in zip(*before, q, p, strict=True):
            wide = old_q.astype(np.longdouble), old_p.astype(np.longdouble)
            exact = schemes.step(scheme, *wide, h=h, m=m, force=what.system.force, stiffness=k)
            sizes = what.system.magnitude()
            size = schemes.magnitude_step(scheme, old_q, old_p, h=h, m=m, magnitude=sizes, stiffness=k)
            # a joined force is a sum over up to 14 terms: one more rounding for each
            count = schemes.roundings(scheme) + 14
            for got, true, scale in zip((new_q, new_p), exact, size, strict=True):
                assert np.all(np.abs(got - true) <= count * 2.0**-53 * scale)


@pytest.mark.parametrize("method", METHODS)
def test_layouts_agree_bit_for_bit_where_they_serve_the_same_motion(method: str) -> None:
    m, k, q, p = 3.7, 2.9, 0.3, 0.7
    one = run(scene(m, q, p, wall(k)), method)
    beside = run(scene([m, 1.3], [q, 0.2], [p, 0.1], wall([k, 0.4])), method)
    assert np.all(one[0] == beside[0][:, :1])
    assert np.all(one[1] == beside[1][:, :1])
    if method != "implicit-euler":
        # the dense inverse is another sequence of operations
        nothing = Spring(a=np.array([0]), b=np.array([1]), k=np.zeros(1), rest=np.zeros(1))
        joined = run(scene([m, 1.3], [q, 0.2], [p, 0.1], wall([k, 0.4]), nothing), method)
        assert np.all(beside[0] == joined[0])
        assert np.all(beside[1] == joined[1])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_springs_in_blocks_move_as_each_would_alone(method: str, compiled: bool) -> None:
    n = 2 * kernels.BLOCK + 77
    rng = np.random.default_rng(3)
    m, k, at = rng.uniform(0.5, 4, n), rng.uniform(0.5, 4, n), rng.normal(size=n)
    q, p = rng.normal(size=n), rng.normal(size=n)
    all_q, all_p = run(scene(m, q, p, wall(k, at)), method, compiled=compiled, frames=5, every=7)
    for i in (0, 1, kernels.BLOCK - 1, kernels.BLOCK, n // 2, n - 2, n - 1):
        alone = scene(m[i], q[i], p[i], wall(k[i], at[i]))
        got_q, got_p = run(alone, method, compiled=False, frames=5, every=7)
        assert np.all(got_q[:, 0] == all_q[:, i])
        assert np.all(got_p[:, 0] == all_p[:, i])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize(("layout", "method"), KERNELS)
def test_chunks_and_every_change_no_number_and_one_force_is_counted_a_step(
    layout: str, method: str, compiled: bool
) -> None:
    what = random_scene(layout, 5, linear=True)
    whole_q, whole_p = run(what, method, compiled=compiled, frames=24)
    cut = simulation.prepare(what, method, what.step, compiled=compiled)
    # rows of a wider array and every other row: neither is contiguous
    wide_q, wide_p = np.full((5, what.n + 1), 99.0), np.full((10, what.n), 99.0)
    q, p = wide_q[:, : what.n], wide_p[::2]
    cut.advance(2, q, p)
    assert cut.force_calls == 10
    assert np.all(q == whole_q[1:10:2])
    assert np.all(p == whole_p[1:10:2])
    assert np.all(wide_q[:, what.n] == 99)
    assert np.all(wide_p[1::2] == 99)
    rest_q, rest_p = np.empty((14, what.n)), np.empty((14, what.n))
    cut.advance(1, rest_q, rest_p)
    assert cut.force_calls == 24
    assert np.all(rest_q == whole_q[10:])
    assert np.all(rest_p == whole_p[10:])


@pytest.mark.parametrize(("layout", "method"), KERNELS)
def test_nothing_is_compiled_within_advance(layout: str, method: str) -> None:
    simulation._jit.cache_clear()
    what = random_scene(layout, 1, linear=True)
    started = simulation.prepare(what, method, what.step, compiled=True)
    known: Any = started._kernel
    before = list(known.signatures)
    for shape in ((1, what.n), (6, what.n), (0, what.n)):
        started.advance(2, np.empty(shape), np.empty(shape))
    started.advance(2, np.empty((6, what.n))[::2], np.empty((3, what.n), order="F"))
    assert known.signatures == before != []


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e8])
def test_a_chain_is_solved_as_well_as_by_the_dense_matrix(stiffness: float) -> None:
    """Both solve with a backward error of about n eps, so they differ by that times the condition."""
    n = 50
    rng = np.random.default_rng(6)
    links = Spring(
        a=np.arange(n - 1), b=np.arange(1, n), k=stiffness * rng.uniform(1, 2, n - 1), rest=np.ones(n - 1)
    )
    m = rng.uniform(1, 4, n)
    what = scene(m, np.arange(n) + rng.normal(size=n), rng.normal(size=n), wall([stiffness, 0.7], 0.2), links)
    h = what.step
    lower, inverse, upper = simulation._factors(what, h)
    matrix = (np.eye(n) + np.diag(lower[1:], -1)) @ (np.diag(1 / inverse) + np.diag(upper[:-1], 1))
    exact = np.eye(n) + h * h * what.system.hessian(what.q) / m
    assert np.max(np.abs(matrix - exact)) <= 8 * 2.0**-53 * np.max(np.abs(exact))
    assert np.allclose(
        simulation._inverse(what, h).T @ matrix, np.eye(n), rtol=0, atol=n * 2.0**-52 * np.max(exact)
    )


def test_a_scene_is_left_as_it_was() -> None:
    what = random_scene("joined", 2, linear=False)
    before = what.q.copy(), what.p.copy()
    for compiled in (False, True):
        run(what, "euler", compiled=compiled)
    assert np.all(what.q == before[0])
    assert np.all(what.p == before[1])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("layout", ["one", "many", "joined"])
def test_overflow_fills_the_rows_without_a_warning_or_an_exception(layout: str, compiled: bool) -> None:
    terms: tuple[Term, ...] = (wall(1e200),)
    if layout == "many":
        terms = (wall([1e200], 0.5),)
    if layout == "joined":
        terms = (wall(1e200), Quartic(i=np.array([0]), b=np.array([1e200]), at=np.array([0.1])))
    q, p = run(scene(1.3, 0.7, 0.2, *terms), "euler", compiled=compiled, frames=30)
    assert np.isfinite(q[0, 0])
    assert not np.any(np.isfinite(q[20:]))
    assert not np.any(np.isfinite(p[20:]))


@pytest.mark.parametrize("compiled", [False, True])
def test_an_implicit_step_without_a_solution_is_not_a_number(compiled: bool) -> None:
    """1 + h**2 k/m = 0 for h = 0.5, k/m = -4."""
    one = scene(2.0, 0.3, 0.7, wall(-8.0), step=0.5)
    links = Spring(a=np.array([0]), b=np.array([1]), k=np.array([-4.0]), rest=np.zeros(1))
    pair = scene([2.0, 2.0], [0.3, 0.1], [0.7, 0.2], links, step=0.5)
    for what in (one, pair):
        q, p = run(what, "implicit-euler", compiled=compiled, frames=3)
        assert not np.any(np.isfinite(q))
        assert not np.any(np.isfinite(p))


def test_implicit_euler_refuses_more_joined_particles_than_its_matrix_holds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(simulation, "DENSE", 2)
    what = random_scene("joined", 4, linear=True)
    assert what.n > 2
    with pytest.raises(
        MethodError, match=f"at most 2 particles joined other than as a chain; scene 'test' has {what.n}"
    ):
        simulation.prepare(what, "implicit-euler", 0.1)
    for layout in ("many", "chain"):
        served = random_scene(layout, 4, linear=True)
        assert served.n > 2
        assert simulation.prepare(served, "implicit-euler", 0.1).compiled is False


def test_only_a_run_that_is_long_enough_is_compiled() -> None:
    spring = scene(3.7, 0.3, 0.7, wall(2.9), steps=simulation.WORTH - 1)
    label = parse("own:euler")
    method = ENGINE.methods["euler"]
    assert simulation.start(spring, method, label, 0.1).compiled is False
    assert simulation.start(replace(spring, steps=simulation.WORTH), method, label, 0.1).compiled is True
    wide = scene(np.ones(1000), np.ones(1000), np.ones(1000), wall(np.ones(1000)), steps=1000)
    assert simulation.start(wide, method, label, 0.1).compiled is True


PROGRAM = """
import sys
import numpy as np
from springcheck.engines.own import kernels, simulation
from springcheck.physics.terms import WallSpring
from springcheck.physics.scene import Scene
wall = WallSpring(i=np.array([0]), k=np.array([2.9]), at=np.array([0.0]))
scene = Scene(name="spring", title="", source="", m=np.array([3.7]), q=np.array([0.3]),
              p=np.array([0.7]), terms=(wall,), step=0.1, steps=int(sys.argv[1]))
simulation.version()
simulation.prepare(scene, "euler", 0.1).advance(1, np.empty((200, 1)), np.empty((200, 1)))
print(sorted({name.partition(".")[0] for name in sys.modules} & {"numba", "llvmlite"}))
"""


@pytest.mark.parametrize(("steps", "imported"), [(200, "[]"), (10**9, "['llvmlite', 'numba']")])
def test_200_steps_import_no_compiler_and_a_long_run_does(steps: int, imported: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(steps)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == imported


def test_without_numba_a_long_run_is_interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation._jit.cache_clear()
    monkeypatch.setitem(sys.modules, "numba", None)
    spring = scene(3.7, 0.3, 0.7, wall(2.9), steps=10**9)
    assert simulation.prepare(spring, "euler", 0.1).compiled is False
    with pytest.raises(ImportError):
        simulation.prepare(spring, "euler", 0.1, compiled=True)


@pytest.mark.parametrize("error", [RuntimeError("no locator available"), OSError("disk full")])
def test_where_compiled_code_cannot_be_saved_it_is_compiled_for_the_process(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    numba = pytest.importorskip("numba")
    simulation._jit.cache_clear()
    njit = numba.njit
    asked = []

    def full(*, cache: bool, **flags: Any) -> Any:
        asked.append(cache)
        if cache:
            raise error
        return njit(**flags)

    monkeypatch.setattr(numba, "njit", full)
    spring = scene(3.7, 0.3, 0.7, wall(2.9), steps=10**9)
    assert simulation.prepare(spring, "euler", 0.1).compiled is True
    assert asked == [True, False]
    simulation._jit.cache_clear()


def test_what_the_engine_says_of_itself_is_its_method_table() -> None:
    assert set(kernels.ONE) == set(kernels.MANY) == set(kernels.JOINED) == set(METHODS)
    for method in ENGINE.methods.values():
        assert method.terms <= set(simulation.FIELDS)
        assert "same time" in simulation.convention(method)
    assert simulation.arithmetic(parse("own:euler")).state == 2.0**-53
    assert simulation.version()["numpy"] == np.__version__
