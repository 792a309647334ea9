"""The own methods are the blog's two Euler loops and the schemes of the catalogue, to the last bit.

What is compiled equals what is interpreted bit for bit; one
step is the scheme's own map up to rounding.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import mpmath
import numpy as np
import pytest

from springcheck import checks, driver, engines, schemes
from springcheck.engines import Need, parse
from springcheck.engines.own import ENGINE, compiled, kernels, laws, loops, simulation, solver
from springcheck.errors import MethodError
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import (
    Column,
    Cosine,
    Damping,
    LennardJones,
    Morse,
    OnParticles,
    Quartic,
    RadialMorse,
    RadialSpring,
    Spring,
    Term,
    WallSpring,
    Weight,
)
from springcheck.schemes.rounding import Met
from springcheck.studies.choose import choose

SCHEMES = tuple(x.scheme for x in ENGINE.methods.values() if x.scheme in schemes.SCHEMES)
IMPLICIT = tuple(name for name in SCHEMES if schemes.SCHEMES[name].has("implicit"))
LAYOUTS = ("one", "many", "chain", "held chain", "joined")


def scene(m: Any, q: Any, p: Any, *terms: Term, step: float = 0.1, steps: int = 200, every: int = 1) -> Scene:
    m, q, p = (np.array(x, dtype=np.float64, ndmin=1) for x in (m, q, p))
    return Scene(
        name="test", title="", source="", m=m, q=q, p=p, terms=terms, step=step, steps=steps, every=every
    )


def wall(k: Any, at: Any = 0.0, i: Any = None, *, fast: bool = False) -> WallSpring:
    k = np.array(k, dtype=np.float64, ndmin=1)
    at = np.broadcast_to(np.asarray(at, dtype=np.float64), k.shape)
    return WallSpring(i=np.arange(len(k)) if i is None else np.array(i), k=k, at=at, fast=fast)


def random_scene(layout: str, seed: int, scheme: str) -> Scene:
    """Random masses, springs (weak, absent, repelling) and steps (backwards too) that need this layout."""
    rng = np.random.default_rng(seed)
    n = 1 if layout == "one" else int(rng.integers(2, 9))
    m, q, p = rng.uniform(0.1, 9, n), rng.normal(size=n), rng.normal(size=n)
    h = float(rng.choice([-1, 1]) * rng.uniform(0.001, 0.3))
    k = rng.normal(1, 1, n) * (rng.random(n) < 0.8)
    mixes, linear = schemes.SCHEMES[scheme].has("mixes"), schemes.SCHEMES[scheme].has("implicit")
    friction = () if seed % 2 or layout == "one" else (Damping(i=np.arange(n), c=rng.uniform(0.01, 0.4, n)),)
    if layout == "one":
        return scene(m, q, p, wall(k, fast=mixes), step=h)
    if layout == "many":
        order = rng.permutation(n)
        return scene(m, q, p, wall(k, rng.normal(size=n), order, fast=mixes), *friction, step=h)
    if "chain" in layout:
        a, b = rng.permutation([np.arange(n - 1), np.arange(1, n)], axis=0)
        links = Spring(a=a, b=b, k=9 * rng.random(n - 1), rest=rng.normal(size=n - 1), fast=mixes)
        ends = rng.permutation(n) if layout == "held chain" else np.array([0, n - 1])[: rng.integers(0, 3)]
        walls = (wall(rng.random(len(ends)), rng.normal(size=len(ends)), ends),) if len(ends) else ()
        return scene(m, q, p, *walls, links, *friction, step=h)
    s = int(rng.integers(1, 12))
    a = rng.integers(0, n, s)
    b = (a + rng.integers(1, n, s)) % n
    links = Spring(a=a, b=b, k=rng.normal(1, 1, s), rest=rng.normal(size=s), fast=mixes)
    walls = wall([-0.3, 1.4, 2.3], rng.normal(size=3), rng.integers(0, n, 3))
    if linear:
        return scene(m, q, p, walls, links, *friction, step=h)
    bent = (
        Quartic(i=rng.integers(0, n, 2), b=rng.uniform(0, 0.1, 2), at=rng.normal(size=2)),
        Cosine(
            i=rng.integers(0, n, 2), depth=rng.normal(1, 1, 2), wave=rng.uniform(0.3, 2, 2), at=np.zeros(2)
        ),
        Morse(a=a[:1], b=b[:1], depth=np.array([0.7]), steepness=np.array([0.2]), rest=rng.normal(size=1)),
    )
    # explicit Euler's motion grows: kept where the bounds of bent laws are finite
    return scene(m, q / 5, p / 5, walls, links, *bent, *friction, step=h / 3)


def run(
    what: Scene,
    scheme: str,
    *,
    compiled: bool | None = None,
    every: int = 1,
    frames: int = 200,
) -> tuple[Floats, Floats]:
    q, p = np.empty((frames, what.n)), np.empty((frames, what.n))
    started = simulation.prepare(what, scheme, what.step, compiled=compiled)
    started.advance(every, q, p)
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
    ("scheme", "blog"), [("explicit-euler", blog_explicit), ("semi-implicit-euler", blog_semi_implicit)]
)
def test_all_200_steps_equal_the_loops_of_the_blog_bit_for_bit(
    scheme: str, blog: Any, m: float, k: float, q: float, p: float, compiled: bool
) -> None:
    expected = np.array(blog(m, k, q, p, 0.1))
    got_q, got_p = run(scene(m, q, p, wall(k)), scheme, compiled=compiled)
    assert np.all(got_q[:, 0] == expected[:, 0])
    assert np.all(got_p[:, 0] == expected[:, 1])
    other = np.array(blog(m, k, q, p, np.nextafter(0.1, 1)))
    assert not np.all(got_q[:, 0] == other[:, 0]), "a step longer by one bit must show"


def test_every_scheme_of_one_step_is_an_own_method_and_three_of_them_run_unasked() -> None:
    assert set(SCHEMES) == {name for name, scheme in schemes.SCHEMES.items() if scheme.has("one-step")}
    unasked = ["own:euler", "own:semi-implicit-euler", "own:implicit-euler"]
    assert [str(label) for label in engines.match(("own:*",))] == unasked
    assert [str(label) for label in engines.match(("*",))][:3] == unasked
    assert [str(label) for label in engines.match(("own:rk*",))] == [
        "own:rk2-midpoint",
        "own:rk2-heun",
        "own:rk4",
    ]
    assert len(engines.match(("own:?*",))) == len(SCHEMES)
    # in an argument a glob stands for all that it matches
    assert engines.match(("own:*",), every=True) == engines.match(("own:?*",))
    found, left, others = choose(scenefile.load_scene("spring"), ["own:*"])
    assert [str(label) for label in found][:5:4] == ["own:euler", "own:velocity-verlet"]
    assert len(found) + len(left) == len(SCHEMES)
    assert all(one.reason for one in left)
    assert others == ()
    assert [str(label) for label in engines.match(("own:yoshida4",))] == ["own:yoshida4"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_step_is_the_map_of_its_scheme_compiled_or_not_and_chunked_or_not(
    scheme: str, layout: str
) -> None:
    """Wilkinson's bound: roundings on the longest path, times eps, times the step on absolute values."""
    law = schemes.SCHEMES[scheme]
    for seed in range(3):
        what = random_scene(layout, seed, scheme)
        system = what.system
        q, p = run(what, scheme, compiled=False, frames=20)
        for is_compiled in (False, True):
            cut = simulation.prepare(what, scheme, what.step, compiled=is_compiled)
            assert cut.compiled == is_compiled
            # rows of a wider array and every other row: neither is contiguous
            wide_q, wide_p = np.full((5, what.n + 1), 99.0), np.full((10, what.n), 99.0)
            cut.advance(2, wide_q[:, : what.n], wide_p[::2])
            assert np.array_equal(wide_q[:, : what.n], q[1:10:2])
            assert np.array_equal(wide_p[::2], p[1:10:2])
            assert np.all(wide_q[:, what.n] == 99)
            assert np.all(wide_p[1::2] == 99)
            rest_q, rest_p = np.empty((2, 10, what.n))
            cut.advance(1, rest_q, rest_p)
            assert np.array_equal(rest_q, q[10:])
            assert np.array_equal(rest_p, p[10:])
        assert not np.array_equal(q[0], q[1])
        laws: dict[str, Any] = {
            "stiffness": system.hessian(what.q) if law.has("implicit") else None,
            "rate": system.friction_rates if system.is_damped else None,
        }
        before = tuple(np.vstack([a, b[:-1]]).astype(np.longdouble) for a, b in ((what.q, q), (what.p, p)))
        exact = schemes.step(
            law, *before, h=what.step, m=what.m, force=system.force, parts=system.parts, **laws
        )
        parts = {name: system.magnitude(terms=getattr(system, name)) for name in ("slow", "fast")}
        stiff, rate = laws["stiffness"], laws["rate"]
        met = [
            Met(magnitude=parts.get(terms, system.magnitude()), stiffness=stiff, joined=True)
            for terms, *_ in law.evaluations
        ]
        size = schemes.magnitude_step(law, *before, h=what.step, m=what.m, met=met, rate=rate)
        # a force is a sum over up to 17 terms: one more rounding for each
        count = schemes.roundings(law) + 17
        for got, true, scale in zip((q, p), exact, size, strict=True):
            assert np.all(np.abs(got - true) <= count * 2.0**-53 * scale)


@pytest.mark.campaign
@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_own_method_passes_its_verdicts_at_every_record_interval(scheme: str) -> None:
    method = next(method for method in ENGINE.methods.values() if method.scheme == scheme)
    implicit = schemes.SCHEMES[scheme].has("implicit")
    pair = Spring(a=np.array([0]), b=np.array([1]), k=np.array([2.9]), rest=np.array([0.7]))
    walls = wall([3.1], [-0.4], [0], fast=True)
    bent = () if implicit else (Quartic(i=np.array([1]), b=np.array([0.3]), at=np.array([0.2])),)
    friction = (Damping(i=np.arange(2), c=np.array([0.3, 0.9]) * 0.1),)
    for step, every in ((0.11, 1), (-0.11, 1), (0.11, 7)):
        slowed = friction if step > 0 else ()
        for terms in ((walls, pair, *slowed), (walls, pair, *bent, *slowed)):
            what = scene([1.7, 3.3], [0.3, 1.1], [0.7, -0.2], *terms, step=step, steps=84, every=every)
            if step < 0 and Need.DAMPING in method.requires:
                continue
            found = checks.judge(what, driver.run(what, f"own:{method.name}"))
            assert not [verdict for verdict in found if verdict.passed is False]
            defect = next(verdict for verdict in found if verdict.check == "step-defect")
            assert defect.passed, defect


@dataclass(frozen=True, kw_only=True, eq=False)
class Sextic(OnParticles):
    """V = c/6 u**6: a term that the compiled loops do not have."""

    key: ClassVar[str] = "sextic"
    formula: ClassVar[str] = "c/6 (q - at)**6"
    columns: ClassVar[tuple[Column, ...]] = (Column("c", "c"), Column("at", "at", 0.0))
    c: Floats

    @staticmethod
    def potential(u: Any, c: Any) -> Any:
        return c / 6 * u**6

    @staticmethod
    def slope(u: Any, c: Any) -> Any:
        return c * u**5

    @staticmethod
    def second(u: Any, c: Any) -> Any:
        return 5 * c * u**4

    @staticmethod
    def rounding(size: Any, u: Any, c: Any) -> Any:
        return 9 * np.abs(c * u**4) * size


@pytest.mark.parametrize("scheme", [name for name in SCHEMES if name not in IMPLICIT])
def test_a_term_that_the_loops_do_not_have_is_carried_out_by_arrays(scheme: str) -> None:
    law = schemes.SCHEMES[scheme]
    terms = (
        wall([2.3, 0.4], [0.1, -0.3], fast=True),
        Sextic(i=np.array([0, 1]), c=np.array([0.7, 0.2]), at=np.zeros(2)),
        Damping(i=np.arange(2), c=np.array([0.1, 0.2])),
    )
    what = scene([1.7, 0.6], [0.3, 0.8], [0.2, -0.5], *terms)
    system = what.system
    q, p = run(what, scheme, frames=20)
    before = tuple(np.vstack([a, b[:-1]]).astype(np.longdouble) for a, b in ((what.q, q), (what.p, p)))
    exact = schemes.step(
        law,
        *before,
        h=what.step,
        m=what.m,
        force=system.force,
        parts=system.parts,
        rate=system.friction_rates,
    )
    for got, true in zip((q, p), exact, strict=True):
        assert np.max(np.abs(got - true)) <= 16 * schemes.roundings(law) * 2.0**-53
    # and it is the same as the loops, where these have all terms
    both = scene([1.7, 0.6], [0.3, 0.8], [0.2, -0.5], *(term for term in terms if term.key != "sextic"))
    none = scene([1.7, 0.6], [0.3, 0.8], [0.2, -0.5], terms[0], replace(terms[1], c=np.zeros(2)), terms[2])
    assert np.array_equal(run(both, scheme)[0], run(none, scheme)[0])


def distances(steps: int) -> Scene:
    """Two particles in a plane, each on a tie to a wall, and a Lennard-Jones bond and a sextic well."""
    return Scene(
        m=[1.7, 1.7, 0.6, 0.6], q=[0.1, 0.3, 1.2, 0.9], p=[0.2, -0.5, 0.1, 0.3], places=[0, 1, 3, 4],
        step=0.01, steps=steps, name="test",
        terms=(
            RadialSpring.to_points(
                i=[0, 1, 2], at=[0.4, -1, 2], k=[2, 2, 3.1], rest=[1, 1, 0.7], number=[0, 0, 1]
            ),
            LennardJones(a=[0, 1], b=[2, 3], depth=[0.7] * 2, diameter=[0.9] * 2, number=[0, 0]),
            RadialMorse.to_points(
                i=[2, 3], at=[0, 0], depth=[0.2] * 2, steepness=[0.8] * 2, rest=[1, 1], number=[0, 0]
            ),
            Sextic(i=[0, 3], c=[0.7, 0.2], at=[0.1, 0]),
            Weight(i=[1], force=[-0.3], at=[0]),
            Damping(i=[2], c=[0.1]),
        ),
    )  # fmt: skip


@pytest.mark.parametrize("scheme", ["explicit-euler", "velocity-verlet", "rk4"])
def test_slopes_of_terms_that_the_loops_lack_are_compiled(scheme: str) -> None:
    """As NumPy computes them, but for roundings of an exponential."""
    pytest.importorskip("numba")
    what, found = distances(300), []
    for is_compiled in (False, True):
        own = simulation.prepare(what, scheme, what.step, compiled=is_compiled)
        assert (own.compiled, own.note) == (is_compiled, "")
        q, p = np.empty((2, 100, what.n))
        own.advance(3, q, p)
        found.append((q, p))
    for one, other in zip(*found, strict=True):
        assert np.max(np.abs(one - other)) <= 300 * 2.0**-52


def test_a_slope_is_compiled_where_a_run_is_long_or_its_note_says_why_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("numba")
    for steps in (simulation.WORTH_A_LAW // 4 - 1, simulation.WORTH_A_LAW // 4):
        own = simulation.prepare(distances(steps), "rk4", 0.01)
        assert own.compiled is (4 * steps >= simulation.WORTH_A_LAW)
        assert own.note == ""

    @dataclass(frozen=True, kw_only=True, eq=False)
    class Opaque(Sextic):
        key: ClassVar[str] = "opaque"
        slope: ClassVar[Any] = staticmethod(lambda u, c: {5: c}[5] * np.ldexp(u, 0) ** 5)

    what = scene(1.7, 0.3, 0.2, wall(2.3), Opaque(i=[0], c=[0.7], at=[0.1]), steps=10**6)
    own = simulation.prepare(what, "velocity-verlet", 0.1)
    assert not own.compiled
    assert "opaque is not compiled (numba" in own.note
    assert "\n" not in own.note
    monkeypatch.setattr(Opaque, "slope", "no function")
    assert laws.why_not(type("Other", (Opaque,), {})).startswith("numba: ")
    monkeypatch.undo()
    run = driver.run(replace(what, steps=10**5, every=10**4), "own:rk4")
    assert run.outcome.message == own.note


@pytest.mark.parametrize("changed", ["slope", "pull", "kind"])
def test_a_term_whose_force_is_not_that_of_its_slope_is_not_compiled(
    changed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("numba")

    @dataclass(frozen=True, kw_only=True, eq=False)
    class Odd(Sextic):
        key: ClassVar[str] = "odd"
        kind: ClassVar[Any] = "friction" if changed == "kind" else "potential"

        def add_force(self, q: Any, v: Any, out: Any) -> None:
            Term.add_force(self, q, v, out)
            out[..., self.i] -= 1e-9 * v[..., self.i] * (changed == "pull")

    if changed == "slope":
        right = laws._slope(Odd)[0]
        wrong = compiled_slope(lambda u, x, s: (1 + 1e-12) * right(u, x, s))
        monkeypatch.setattr(laws, "_slope", lambda kind: (wrong, ""))
    what = scene(1.7, 0.3, 0.2, wall(2.3), Odd(i=[0], c=[0.7], at=[0.1]), steps=10**6)
    own = simulation.prepare(what, "velocity-verlet", 0.1)
    assert not own.compiled
    assert "odd is not compiled" in own.note


def compiled_slope(function: Any) -> Any:
    import numba

    return numba.njit(function)


def test_without_numba_a_slope_is_numpys(monkeypatch: pytest.MonkeyPatch) -> None:
    laws._slope.cache_clear()
    monkeypatch.setitem(sys.modules, "numba", None)
    own = simulation.prepare(distances(10**6), "rk4", 0.01)
    assert not own.compiled
    assert "numba is not installed" in own.note


@pytest.mark.parametrize("scheme", SCHEMES)
def test_layouts_agree_bit_for_bit_where_they_serve_the_same_motion(scheme: str) -> None:
    m, k, q, p = 3.7, 2.9, 0.3, 0.7
    nothing = Spring(a=np.array([0, 1]), b=np.array([1, 0]), k=np.zeros(2), rest=np.zeros(2))
    one = run(scene(m, q, p, wall(k)), scheme)
    two = scene([m, 1.3], [q, 0.2], [p, 0.1], wall([k, 0.4]))
    beside = run(two, scheme)
    assert np.all(one[0] == beside[0][:, :1])
    assert np.all(one[1] == beside[1][:, :1])
    if scheme not in IMPLICIT:
        # the factors of joined particles are another sequence of operations
        for row in (two, chain(5), chain(5, held=True)):
            joined = run(replace(row, terms=(*row.terms, nothing)), scheme, frames=20)
            assert np.array_equal(run(row, scheme, frames=20), joined)


def chain(n: int, seed: int = 3, *, held: bool = False) -> Scene:
    rng = np.random.default_rng(seed)
    links = Spring(a=np.arange(n - 1), b=np.arange(1, n), k=rng.uniform(1, 3, n - 1), rest=np.ones(n - 1))
    walls = wall(rng.uniform(0.1, 1, n)) if held else wall([0.7, 1.9], [-1.0, n], [0, n - 1])
    q = np.arange(n) + rng.normal(size=n)
    return scene(rng.uniform(0.5, 4, n), q, rng.normal(size=n), walls, links)


def springs(n: int) -> Scene:
    rng = np.random.default_rng(3)
    m, k, at = rng.uniform(0.5, 4, n), rng.uniform(0.5, 4, n), rng.normal(size=n)
    return scene(m, rng.normal(size=n), rng.normal(size=n), wall(k, at))


@pytest.mark.parametrize("scheme", ["velocity-verlet", "yoshida4", "rk4", "trapezoidal"])
@pytest.mark.parametrize("make", [springs, chain])
def test_calls_of_few_and_of_many_steps_by_turns_change_no_number(
    scheme: str, make: Callable[[int], Scene]
) -> None:
    what = make(77)
    plain_q, plain_p = run(what, scheme, compiled=False, frames=60)
    started = simulation.prepare(what, scheme, what.step, compiled=True)
    done = 0
    for steps in (1, 9, 1, 20, 3, 8, 2, 16):
        q, p = np.empty((2, 1, what.n))
        started.advance(steps, q, p)
        done += steps
        assert np.array_equal(q[0], plain_q[done - 1])
        assert np.array_equal(p[0], plain_p[done - 1])


@pytest.mark.parametrize("scheme", SCHEMES)
def test_force_calls_are_the_evaluations_that_took_place(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    indexed = loops.indexed
    monkeypatch.setattr(loops, "indexed", lambda *args: (calls.append(1), indexed(*args))[1])
    for seed in (0, 1):
        calls.clear()
        what = random_scene("joined", seed, scheme)
        started = simulation.prepare(what, scheme, what.step, compiled=False)
        started.advance(3, *np.empty((2, 2, what.n)))
        started.advance(1, *np.empty((2, 5, what.n)))
        assert started.force_calls == len(calls)
        if scheme in ("semi-implicit-euler", "explicit-euler", "implicit-euler"):
            assert started.force_calls == 11
        if scheme == "velocity-verlet":
            assert started.force_calls == (12 if seed else 22), "one a step, and two where friction acts"


def test_nothing_is_compiled_within_advance() -> None:
    for layout in LAYOUTS:
        for scheme in ("yoshida4", "rk4"):
            what = random_scene(layout, 1, scheme)
            started = simulation.prepare(what, scheme, what.step, compiled=True)
            known: Any = list(compiled._COMPILED.values())
            before = [list(kernel.signatures) for kernel in known]
            for shape in ((1, what.n), (6, what.n), (0, what.n)):
                started.advance(2, np.empty(shape), np.empty(shape))
            started.advance(2, np.empty((6, what.n))[::2], np.empty((3, what.n), order="F"))
            assert known == list(compiled._COMPILED.values())
            assert [list(kernel.signatures) for kernel in known] == before != []


def grid(width: int, k: float, seed: int = 5) -> Scene:
    """A square lattice with a few springs across, numbered at random: nothing of it is a chain."""
    rng = np.random.default_rng(seed)
    n = width * width
    number = rng.permutation(n).reshape(width, width)
    a = np.concatenate([number[:, :-1].ravel(), number[:-1].ravel()])
    b = np.concatenate([number[:, 1:].ravel(), number[1:].ravel()])
    links = Spring(a=a, b=b, k=k * rng.uniform(0.5, 2, len(a)), rest=rng.normal(size=len(a)))
    return scene(rng.uniform(0.5, 3, n), rng.normal(size=n), rng.normal(size=n), wall(rng.random(n)), links)


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 1e8])
@pytest.mark.parametrize("shape", ["chain", "ring", "lattice", "repelling"])
def test_an_implicit_step_is_solved_as_well_as_its_matrix_allows(shape: str, stiffness: float) -> None:
    """The residual of (1 + x**2 K/m) P = p + x F(q) is a few roundings of its terms, and so is a step's."""
    n = 40
    rng = np.random.default_rng(6)
    what = chain(n)
    (walls, links) = what.terms
    if shape == "ring":
        links = Spring(a=np.arange(n), b=(np.arange(n) + 1) % n, k=rng.uniform(1, 2, n), rest=np.ones(n))
    if shape == "lattice":
        what = grid(7, 1.0)
        walls, links = what.terms
    if shape == "repelling":
        links = replace(links, k=links.k * rng.choice([-0.3, 1.0], n - 1))  # type: ignore[attr-defined]
    links = replace(links, k=stiffness * links.k)  # type: ignore[attr-defined]
    what = replace(what, terms=(walls, links))
    h = what.step
    (q,), (p,) = run(what, "implicit-euler", compiled=False, frames=1)
    wide = p.astype(np.longdouble)
    matrix = np.eye(what.n) + h * h * what.system.hessian(what.q) / what.m
    right = what.p + h * what.system.force(what.q.astype(np.longdouble), wide)
    sizes = np.abs(matrix) @ np.abs(wide) + np.abs(what.p) + h * what.system.magnitude()(np.abs(what.q), p)
    assert np.all(np.abs(matrix @ wide - right) <= 64 * 2.0**-53 * np.max(sizes))
    assert np.all(
        np.abs(q - (what.q + h * wide / what.m)) <= 4 * 2.0**-53 * (np.abs(q) + np.abs(h * wide / what.m))
    )
    for scheme in IMPLICIT:
        pair = [run(what, scheme, compiled=is_compiled, frames=9) for is_compiled in (False, True)]
        assert np.array_equal(*pair)


def test_a_stiff_midpoint_step_loses_nothing_to_the_stiffness() -> None:
    """At h w = 1e6 a step turns the state by almost pi: q' = -q, p' = -p to 4/(h w)."""
    what = scene(2.0, 0.3, 0.7, wall(2e12), step=1.0)
    q, p = run(what, "implicit-midpoint", frames=100)
    assert np.max(np.abs(np.abs(q[:, 0]) / 0.3 - 1)) < 1e-3
    energy = p[:, 0] ** 2 / 4 + 1e12 * q[:, 0] ** 2
    assert np.ptp(energy) <= 200 * 2.0**-52 * energy[0]


def test_an_implicit_step_refuses_what_its_factors_would_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver, "MOST_BYTES", 4096)
    with pytest.raises(
        MethodError, match="joins its 49 particles so widely that an implicit step would take"
    ):
        simulation.prepare(grid(7, 1.0), "implicit-euler", 0.1)
    assert simulation.prepare(chain(40), "trapezoidal", 0.1).compiled is False


def test_a_scheme_that_the_loops_do_not_have_is_carried_out_by_its_definition() -> None:
    twice = replace(
        schemes.SCHEMES["implicit-midpoint"],
        a=((Fraction(1, 4), Fraction(0)), (Fraction(1, 2), Fraction(1, 4))),
        b=(Fraction(1, 2), Fraction(1, 2)),
    )
    halves = [
        simulation.prepare(springs(2), name, h) for name, h in ((twice, 0.1), ("implicit-midpoint", 0.05))
    ]
    ends = np.empty((2, 2, 1, 2))
    for one, every, rows in zip(halves, (3, 6), ends, strict=True):
        one.advance(every, *rows)
    # six implicit stages, each solved to a few roundings
    np.testing.assert_allclose(ends[0], ends[1], rtol=64 * 2.0**-53)
    assert halves[0].force_calls == 6
    with pytest.raises(MethodError, match="no fixed step"):
        simulation.prepare(springs(2), "bdf", 0.1)


def test_sine_and_exponential_are_right_to_a_rounding_at_any_size() -> None:
    rng = np.random.default_rng(0)
    with mpmath.workprec(2400):
        for x in (*(rng.normal(size=50) * 10.0 ** rng.integers(-8, 20, 50)), 2.0**55, 1e111, 1.7e308):
            true = mpmath.sin(mpmath.mpf(float(x)))
            assert abs(mpmath.mpf(loops.sine(float(x))) - true) <= 2.0**-52 * abs(true)
        for x in rng.uniform(-740, 709.7, 50):
            true = mpmath.exp(mpmath.mpf(float(x)))
            assert abs(mpmath.mpf(loops.exponential(float(x))) - true) <= 2.0**-52 * true + 5e-324
    for x in (np.inf, -np.inf, np.nan):
        assert np.isnan(loops.sine(x))
    assert (loops.exponential(710.0), loops.exponential(np.inf), loops.exponential(-np.inf)) == (
        np.inf,
        np.inf,
        0,
    )
    assert np.isnan(loops.exponential(np.nan))


def test_far_out_pendulums_move_alike_compiled_and_interpreted() -> None:
    turns = Cosine(i=np.arange(4), depth=np.ones(4) * 1.3, wave=np.ones(4) * 1.7, at=np.zeros(4))
    what = scene(np.ones(4) * 2.1, [1e3, 2.0**55, 1e111, 1e300], np.ones(4), turns)
    pair = [run(what, "explicit-euler", compiled=is_compiled) for is_compiled in (False, True)]
    assert np.array_equal(*pair)
    kicks = np.abs(np.diff(pair[0][1], axis=0))
    assert np.max(kicks) <= 0.1 * 1.3 * 1.7 * (1 + 2.0**-40)


def test_a_scene_is_left_as_it_was() -> None:
    what = random_scene("joined", 2, "explicit-euler")
    before = what.q.copy(), what.p.copy()
    for is_compiled in (False, True):
        run(what, "explicit-euler", compiled=is_compiled)
    assert np.all(what.q == before[0])
    assert np.all(what.p == before[1])


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("layout", ["one", "many", "joined"])
@pytest.mark.parametrize("scheme", ["explicit-euler", "rk4", "yoshida4"])
def test_overflow_fills_the_rows_without_a_warning_or_an_exception(
    scheme: str, layout: str, compiled: bool
) -> None:
    terms: tuple[Term, ...] = (wall(1e200),)
    if layout == "many":
        terms = (wall([1e200], 0.5),)
    if layout == "joined":
        terms = (
            wall(1e200),
            Quartic(i=np.array([0]), b=np.array([1e200]), at=np.array([0.1])),
            Cosine(i=np.array([0]), depth=np.ones(1), wave=np.ones(1), at=np.zeros(1)),
        )
    q, p = run(scene(1.3, 1e-100, 1e-120, *terms), scheme, compiled=compiled, frames=30)
    assert np.isfinite(q[0, 0]) or scheme != "explicit-euler"
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
from springcheck.engines.own import simulation
from springcheck.physics.terms import WallSpring
from springcheck.physics.scene import Scene
wall = WallSpring(i=np.array([0]), k=np.array([2.9]), at=np.array([0.0]))
scene = Scene(name="spring", title="", source="", m=np.array([3.7]), q=np.array([0.3]),
              p=np.array([0.7]), terms=(wall,), step=0.1, steps=int(sys.argv[1]))
simulation.version()
simulation.prepare(scene, "explicit-euler", 0.1).advance(1, np.empty((200, 1)), np.empty((200, 1)))
print(sorted({name.partition(".")[0] for name in sys.modules} & {"numba", "llvmlite", "scipy"}))
"""


@pytest.mark.parametrize(("steps", "imported"), [(200, "[]"), (10**9, "['llvmlite', 'numba']")])
def test_200_steps_import_no_compiler_and_a_long_run_does(steps: int, imported: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(steps)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip().replace(", 'scipy'", "") == imported


def test_without_numba_a_long_run_is_interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled._COMPILED.clear()
    monkeypatch.setitem(sys.modules, "numba", None)
    spring = scene(3.7, 0.3, 0.7, wall(2.9), steps=10**9)
    assert simulation.prepare(spring, "explicit-euler", 0.1).compiled is False
    with pytest.raises(ImportError):
        simulation.prepare(spring, "explicit-euler", 0.1, compiled=True)


@pytest.mark.parametrize("error", [RuntimeError("no locator available"), OSError("disk full")])
def test_where_compiled_code_cannot_be_saved_it_is_compiled_for_the_process(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    numba = pytest.importorskip("numba")
    # numba has modules that use njit, which it imports as it first compiles
    numba.njit(lambda: 0)()
    compiled._COMPILED.clear()
    njit = numba.njit
    asked = []

    def full(*, cache: bool, **flags: Any) -> Any:
        asked.append(cache)
        if cache:
            raise error
        return njit(**flags)

    monkeypatch.setattr(numba, "njit", full)
    spring = scene(3.7, 0.3, 0.7, wall(2.9), steps=10**9)
    assert simulation.prepare(spring, "explicit-euler", 0.1).compiled is True
    assert asked == [True, False]
    compiled._COMPILED.clear()


def test_arguments_that_look_alike_are_of_one_type_to_the_compiler() -> None:
    """Else code compiled for the first of them would be called with the second."""
    numba = pytest.importorskip("numba")
    rows, fixed = np.zeros((4, 6)), np.zeros(4)
    fixed.flags.writeable = False
    kinds: list[Any] = [
        1, 1.0, True, np.zeros(4), np.zeros(4, np.int64), np.zeros(4, bool), rows, rows.T, rows[:, ::2],
        rows[0, ::2], fixed,
    ]  # fmt: skip
    kinds += [(), *((x,) for x in kinds), (1, 1), (1, 1.0), (1.0, 1), ((1,), 1), ((1.0,), 1), ((1.0, 1.0),)]
    types: dict[Any, Any] = {}
    for kind in kinds:
        assert types.setdefault(compiled._look(kind), numba.typeof(kind)) == numba.typeof(kind)
    assert len(set(types.values())) == len(kinds)


def doubled(factor: float, q: Floats, p: Floats) -> None:
    """A kernel that is quickly compiled."""
    for i in range(len(q)):
        q[i, 0] = factor * p[i, 0]


def test_damaged_compiled_code_is_compiled_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: bool
) -> None:
    """numba itself ends in EOFError, UnpicklingError or a killed process: each look is one of its own."""
    numba = pytest.importorskip("numba")
    # what the compiler learns at its first function is known to every look
    numba.njit(lambda q: q[0])(np.zeros((1, 1)))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))

    def look(into: int) -> None:
        compiled._COMPILED.clear()
        q, p = np.zeros((1, 1)), np.full((1, 1), 3.7)
        kernel: Any = compiled.compiled(doubled, (2.0, q, p))
        kernel(2.0, q, p)
        os.write(into, f"{q[0, 0]!r} {sum(kernel.stats.cache_hits.values())}".encode())

    def loaded() -> bool:
        """Whether a process of its own loads the saved code; its numbers must be right either way."""
        out, into = os.pipe()
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                look(into)
            os._exit(0)
        os.close(into)
        with os.fdopen(out) as pipe:
            said = pipe.read().split()
        os.waitpid(child, 0)
        assert said[:1] == ["np.float64(7.4)"]
        return said[1] == "1"

    assert not loaded()
    assert loaded(), "saved code is loaded"

    def cut(data: bytes) -> bytes:
        return data[: len(data) // 2]

    def zeroed(data: bytes) -> bytes:
        half = len(data) // 2
        return data[:half] + bytes(len(data) - half)

    damages: list[Callable[[bytes], bytes]] = [cut, zeroed, lambda data: b"", lambda data: bytes(len(data))]
    for number, suffix in enumerate(("nbi", "nbc", "seal")):
        for damage in damages if whole else damages[number : number + 2]:
            (path,) = tmp_path.rglob(f"*.{suffix}")
            path.write_bytes(damage(path.read_bytes()))
            assert not loaded(), (suffix, "is not used")
            assert loaded(), "and is mended"
    # numba watches the file of the kernel alone, and its helpers change as well
    (changed := tmp_path / "changed.py").write_text("# another source")
    for module in (compiled, loops, kernels):
        with monkeypatch.context() as patch:
            before = compiled._digest(path.parent, doubled)
            patch.setattr(module, "__file__", str(changed))
            assert compiled._digest(path.parent, doubled) != before


def test_what_the_engine_says_of_itself_is_its_method_table() -> None:
    for method in ENGINE.methods.values():
        assert "same time" in ENGINE.convention(method)
    assert ENGINE.arithmetic(parse("own:euler")).state == 2.0**-53
    assert simulation.version()["numpy"] == np.__version__
    assert {loops.indexed, loops.force_at, loops.kick, loops.solve} < set(compiled.HELPERS)
    assert kernels.many not in compiled.HELPERS
