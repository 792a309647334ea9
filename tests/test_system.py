"""The facts of a scene agree with each other, and those of a large one take memory of its size."""

from __future__ import annotations

import subprocess
import sys
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from springcheck import checks, driver
from springcheck.physics import arrays, graph, system
from springcheck.physics import scenefile as scenes
from springcheck.physics.builders import chain, spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, Morse, Quartic, Spring, WallSpring
from springcheck.schemes import rounding


def mixed() -> Scene:
    """Five particles with a term of every law."""
    rng = np.random.default_rng(5)
    terms = (
        WallSpring(i=[0, 2, 2], k=[2.9, 1.3, -0.4], at=[0.1, -0.2, 0.3]),
        Spring(a=[0, 3, 1], b=[1, 2, 4], k=[1.7, 0.9, 2.3], rest=[1.0, -0.5, 0.2], fast=True),
        Quartic(i=[4, 1], b=[0.7, 1.1], at=[0.0, 0.4]),
        Morse(a=[2], b=[4], depth=[3.1], steepness=[0.6], rest=[0.7]),
        Damping(i=[3], c=[0.2]),
    )
    return Scene(
        m=rng.uniform(0.5, 2, 5), q=rng.normal(size=5), p=rng.normal(size=5), terms=terms, step=0.1, steps=9
    )


def test_the_hessian_is_the_derivative_of_the_force_and_the_force_that_of_the_energy() -> None:
    found = mixed().system
    q, p = found.scene.q.astype(np.longdouble), found.scene.p.astype(np.longdouble)
    h = np.longdouble(2.0**-12)
    each = np.eye(found.n, dtype=np.longdouble) * h
    by_energy = -(found.energy(q + each, 0 * each) - found.energy(q - each, 0 * each)) / (2 * h)
    # differences of second order leave h**2 times a third derivative of about 10
    assert np.max(np.abs(by_energy - found.potential_force(q, p))) < 10 * h**2
    by_force = -(found.potential_force(q + each, 0 * each) - found.potential_force(q - each, 0 * each)) / (
        2 * h
    )
    assert np.max(np.abs(by_force - found.hessian(q))) < 10 * h**2
    assert np.array_equal(np.diag(found.hessian(q)), found.hessian_diagonal(q))
    assert np.max(np.abs(found.sparse_hessian(q).toarray() - found.hessian(q))) < 1e-15
    assert np.all(np.sum(np.abs(found.hessian(q)), axis=-1) <= found.gershgorin(q))
    friction = found.force(q, p) - found.potential_force(q, p)
    assert friction == pytest.approx(-(found.friction_rates * p).astype(float))
    slow, fast = found.parts
    assert np.max(np.abs(slow(q, p) + fast(q, p) - found.force(q, p))) < 1e-17


def test_copies_and_parts_move_as_the_scene_does() -> None:
    scene = mixed()
    three = scene.system.tiled(3)
    q, p = np.tile(scene.q, 3), np.tile(scene.p, 3)
    assert np.array_equal(three.system.force(q, p), np.tile(scene.system.force(scene.q, scene.p), 3))
    assert three.system.energy(q, p) == pytest.approx(3 * scene.system.energy(scene.q, scene.p), rel=1e-15)
    again = three.system.part(np.arange(scene.n, 2 * scene.n))
    assert again.digest == scene.digest
    alone = scene.system.part(np.array([3, 2]))
    assert [(term.key, len(term)) for term in alone.terms] == [
        ("wall-spring", 2),
        ("spring", 1),
        ("damping", 1),
    ]
    assert alone.terms[0].particles[0].tolist() == [1, 1]


def test_a_harder_scene_pulls_harder_and_is_no_other_otherwise() -> None:
    scene = mixed()
    harder = scene.system.scaled(1.5)
    assert harder.system.potential_force(scene.q, scene.p) == pytest.approx(
        1.5 * scene.system.potential_force(scene.q, scene.p)
    )
    assert np.array_equal(harder.system.friction_rates, scene.system.friction_rates)
    single = scene.system.in_single
    assert single.terms[0].parameters[0].tolist() == np.float32([2.9, 1.3, -0.4]).astype(float).tolist()
    assert np.array_equal(getattr(single.terms[0], "at"), [0.1, -0.2, 0.3]), "a wall stays in its place"  # noqa: B009
    hard = spring(k=1e300)
    assert np.isinf(hard.system.in_single.system.force(np.ones(1), np.ones(1))), "beyond single precision"
    assert np.isinf(hard.system.in_single.system.part(np.array([0])).system.rigidity)


def test_rest_positions_are_the_same_however_springs_are_turned() -> None:
    rng = np.random.default_rng(2)
    for a in (np.arange(40), np.array([0, 1, 2, 5, 6, 9, 20, 21])):
        row = Spring(a=a, b=a + 1, k=np.ones(len(a)), rest=rng.normal(size=len(a)))
        turned = Spring(a=row.b, b=row.a, k=row.k, rest=-row.rest)
        quick, searched = (graph.rest_positions(SimpleNamespace(n=50, terms=[x])) for x in (row, turned))
        assert quick is not None
        assert searched is not None
        assert np.array_equal(quick, searched)
    ring = Spring(a=[0, 1, 2], b=[1, 2, 0], k=1.0, rest=[1.0, 1.0, 1.0])
    assert graph.rest_positions(SimpleNamespace(n=3, terms=[ring])) is None


def test_a_sparse_hessian_bounds_what_the_full_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same bounds but for `kicked`, which is an upper bound of the full one's, by a few times."""
    scene = chain(60, m=1.3, k=2.9, q=np.random.default_rng(1).normal(size=60), step=0.9)
    x, m = np.random.default_rng(2).uniform(size=(3, 60)), scene.m
    factor = scene.step**2 / m
    full, thin = scene.system.hessian(scene.q), scene.system.sparse_hessian(scene.q)
    (one, full_kicked), (other, kicked) = rounding._joined(full, factor), rounding._sparse(thin, factor)
    assert other(x) == pytest.approx(one(x), rel=1e-13)
    assert m * other(x / m) == pytest.approx(m * one(x / m), rel=1e-13)
    assert np.all(kicked(x) >= full_kicked(x) * (1 - 1e-13))
    assert np.median(kicked(x) / full_kicked(x)) < 4
    run = driver.run(scene, "own:implicit-euler")
    dense = {v.check: v for v in checks.judge(scene, run)}
    monkeypatch.setattr(system, "MOST_DENSE", 10)
    sparse = {v.check: v for v in checks.judge(replace(scene), run)}
    for name in ("step-defect", "closed-form"):
        assert sparse[name].passed is dense[name].passed is True
        assert sparse[name].value == pytest.approx(dense[name].value, rel=0.75)


LARGE = """
import resource, numpy as np
from springcheck import checks, driver
from springcheck.physics.builders import chain
scene = chain({n}, m=1.3, k=2.9, waves=[(2, 0.7), (37, 0.11)], step=0.03, steps=4, every=2)
for label in {labels}:
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run)
    assert [v.check for v in verdicts if v.passed is False] == [], verdicts
    assert sum(v.passed is True for v in verdicts) >= 6
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def test_a_chain_of_many_masses_is_judged_in_memory_that_grows_with_it() -> None:
    """10,000 masses: n x n doubles would take 0.8 GB; ru_maxrss is in kB."""
    labels = ["own:semi-implicit-euler", "own:implicit-euler"]
    # on Linux a child begins with the peak of its parent: a small process stands between
    between = "import subprocess, sys; raise SystemExit(subprocess.call([sys.executable, '-c', sys.argv[1]]))"
    done = subprocess.run(
        [sys.executable, "-c", between, LARGE.format(n=10_000, labels=labels)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    unit = 1 if sys.platform == "darwin" else 1024
    assert int(done.stdout) * unit < 400e6


def test_states_are_worked_out_in_pieces_to_the_last_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    """200 frames of 200,000 springs on one particle took 1.4 GB at once."""
    scene = scenes.load_scene("chain")
    q, p = np.random.default_rng(7).normal(size=(2, 3, 17, scene.n))
    facts = scene.system

    def everything() -> list[bytes]:
        found = (
            facts.force(q, p),
            facts.magnitude()(np.abs(q), np.abs(p)),
            facts.magnitude(q)(np.abs(q), np.abs(p)),
            facts.energy(q, p),
            facts.norm.size(q, p),
        )
        assert [x.shape for x in found] == [q.shape] * 3 + [q.shape[:-1]] * 2
        return [np.ascontiguousarray(x, np.float64).tobytes() for x in found]

    whole = everything()
    monkeypatch.setattr(arrays, "MOST_NUMBERS", 8)
    assert everything() == whole


def test_memory_does_not_grow_with_springs_times_frames() -> None:
    many = 100_000
    springs = WallSpring(i=np.zeros(many, np.int64), k=np.full(many, 1 / many), at=np.zeros(many))
    scene = Scene(
        name="many", m=np.ones(1), q=np.ones(1), p=np.zeros(1), terms=(springs,), step=0.1, steps=100
    )
    q, p = np.random.default_rng(8).normal(size=(2, 101, 1))
    tracemalloc.start()
    scene.system.norm.size(q, p)
    scene.system.force(q, p)
    scene.system.magnitude(q)(np.abs(q), np.abs(p))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200e6
