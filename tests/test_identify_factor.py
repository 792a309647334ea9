"""One factor a step for all momenta: told of two particles or more, in linear forces, and of nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import springcheck
from springcheck import driver
from springcheck.identify.thermal import one_factor
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic, Spring, WallSpring

PLACE = {
    "bussi": "before", "bussi-unsigned": "before", "bussi-after": "after",
}  # fmt: skip


def particles(n: int, *, joined: bool = False, steps: int = 500) -> Scene:
    """So many unlike particles on walls, joined or not; nothing is 1."""
    i = np.arange(n)
    walls = WallSpring(i=i, k=np.linspace(2.9, 1.7, n), at=np.full(n, 0.1))
    bonds = Spring(a=i[:-1], b=i[1:], k=np.full(n - 1, 2.2), rest=np.full(n - 1, 0.6))
    return Scene(
        m=np.linspace(3.7, 1.3, n), q=np.linspace(0.3, 0.9, n), p=np.linspace(0.7, -0.4, n),
        terms=(walls, bonds) if joined else (walls,), step=0.35, steps=steps,
        bath=Bath(temperature=1.7, friction=0.8), name="particles",
    )  # fmt: skip


@pytest.mark.parametrize("joined", [False, True], ids=["apart", "joined"])
@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("name", PLACE)
@pytest.mark.parametrize(("step", "bound"), [(0.35, 1e-13), (0.01, 1e-10)])
def test_the_place_and_the_factors_are_found_to_rounding(
    name: str, n: int, joined: bool, step: float, bound: float
) -> None:
    """Over few turns all particles move nearly alike, and the factor is as sharp."""
    scene = replace(particles(n, joined=joined), step=step)
    run = driver.run(scene, f"own:{name}", seed=4)
    found = one_factor(scene.step, run.q, run.p / scene.m)
    assert found is not None
    place, misfit, factor = found
    assert place.split()[0] == PLACE[name]
    assert misfit < bound
    # the sign of Bussi's is drawn too
    assert np.all(factor > 0) or name == "bussi"
    if step > 0.1:
        rounded = (x.astype(np.float32).astype(float) for x in (run.q, run.p / scene.m))
        single = one_factor(scene.step, *rounded)
        assert single is not None
        assert single[0] == place


@pytest.mark.parametrize("name", ["andersen", "andersen-leapfrog", "baoab", "obabo", "brownian"])
@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("step", [0.35, 0.01])
def test_draws_of_each_particle_are_no_factor(name: str, n: int, step: float) -> None:
    scene = replace(particles(n, joined=True), step=step)
    run = driver.run(scene, f"own:{name}", seed=4)
    assert one_factor(scene.step, run.q, run.p / scene.m) is None


def test_two_baths_and_a_force_that_is_not_linear_are_none() -> None:
    first, other = (driver.run(particles(1), "own:bussi", seed=4), particles(2))
    second = driver.run(replace(particles(1), q=np.array([0.7])), "own:bussi", seed=4)
    q, v = (np.column_stack([getattr(x, y) for x in (first, second)]) for y in "qp")
    assert one_factor(other.step, q, v / 3.7) is None
    bent = Quartic(i=np.arange(2), b=np.array([1.5, 2.0]), at=np.zeros(2))
    scene = replace(other, terms=(*other.terms, bent))
    run = driver.run(scene, "own:bussi", seed=4)
    assert one_factor(scene.step, run.q, run.p / scene.m) is None
    # two particles that move alike say no more than one
    assert one_factor(other.step, *(np.repeat(x, 2, axis=1) for x in (first.q, first.p / 3.7))) is None


def test_identify_says_that_all_momenta_have_one_factor() -> None:
    scene = particles(3, steps=500)
    rescaled = springcheck.identify(driver.run(scene, "own:bussi", seed=4), mass=scene.m)
    assert rescaled.statement.startswith("One factor a step multiplies the momenta of all 3 coordinates, bef")
    assert [x.scheme for x in rescaled.candidates] == ["bussi", "bussi-unsigned"]


@pytest.mark.parametrize("name", ["orbit", "lissajous"])
@pytest.mark.parametrize("noise", [3e-15, 1e-12, 1e-9, 0.0], ids=["3e-15", "1e-12", "1e-9", "a frame twice"])
def test_noise_or_a_frame_that_stands_twice_is_no_factor(name: str, noise: float) -> None:
    """Velocities that are linear in the positions leave the constants of the forces open: any would do."""
    scene = springcheck.load_scene(name)
    run = driver.run(scene, "own:velocity-verlet")
    q, v = run.q * (1 + noise * np.random.default_rng(1).normal(size=run.q.shape)), run.p / scene.m
    if not noise:
        q[40], v[40] = q[39], v[39]
    assert one_factor(scene.step, q, v) is None


@pytest.mark.parametrize("amplitude", [1e-4, 1e-5, 1e-6])
def test_a_pendulum_that_hardly_swings_is_in_no_bath(amplitude: float) -> None:
    """Along an arc there is one freedom, of which any factor may be: it was a Nose-Hoover chain."""
    m, g, length, h = 1.7, 2.9, 1.3, 0.13
    angle, rate, states = amplitude, 0.3 * amplitude, []
    for _ in range(401):
        around = np.array([np.cos(angle), np.sin(angle)])
        states.append((length * around[::-1] * [1, -1], length * rate * around))
        rate -= h / 2 * g / length * np.sin(angle)
        angle += h * rate
        rate -= h / 2 * g / length * np.sin(angle)
    q, v = (np.array(x) for x in zip(*states, strict=True))
    for order in ([0, 1], [1, 0]):
        found = springcheck.identify(h * np.arange(401), q[:, order], v=v[:, order], mass=m)
        assert "anharmonic" in found.statement
