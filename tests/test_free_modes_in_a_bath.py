"""Configurational temperature where something drifts: the virial of a motion that nothing holds is 0, so the
mean is over the freedoms in which forces change, k <u**2> / kT = 1 of each (equipartition)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import springcheck
from springcheck import driver
from springcheck.bath.heat import bound_freedoms, heated_of
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import parse

THREE = """
title = "three free masses, two springs"
particle = [{mass = 1.3, position = 0.0, momentum = 0.2}, {mass = 0.7, position = 1.1, momentum = -0.1},
            {mass = 2.1, position = 2.3, momentum = 0.3}]
spring = [{ends = [0, 1], stiffness = 1.7, rest = 1.0}, {ends = [1, 2], stiffness = 2.9, rest = 1.2}]
bath = {temperature = 1.3, friction = 0.7}
time = {step = 0.2, steps = 20000}
"""


def three() -> Scene:
    return parse(THREE, name="three", where="here")


def test_two_springs_between_three_free_masses_have_two_bound_modes_with_a_law() -> None:
    scene = three()
    run = driver.run(scene, "own:obabo", seed=5)
    found = heated_of(scene, [run])
    # the elongations themselves, and not the modes
    u = np.diff(run.q[100:], axis=1) - [1.0, 1.2]
    equipartition = float(np.mean(u**2 * [1.7, 2.9])) / scene.thermal
    assert found.configurational == pytest.approx(equipartition, rel=0.02)
    # 1/(1 - (h w)**2/4) of each mode, w**2 the eigenvalues of M**-1/2 K M**-1/2
    k = np.array([[1.7, -1.7, 0], [-1.7, 4.6, -2.9], [0, -2.9, 2.9]])
    root = np.sqrt([1.3, 0.7, 2.1])
    w2 = np.linalg.eigvalsh(k / root / root[:, None])[1:]
    assert found.configurational_law == pytest.approx(np.mean(1 / (1 - 0.04 * w2 / 4)), rel=1e-9)
    assert abs(found.configurational - found.configurational_law) < 5 * found.configurational_error < 0.15
    # the momentum of the whole has no stationary law with positions
    assert np.isnan(found.kinetic_law)


@pytest.mark.parametrize(
    ("name", "bound"),
    [("ch-bond", 1), ("morse-bond", 1), ("diatomic", 3), ("bath-well", 1), ("bath-free", 0), ("chain", 3),
     ("orbit", 3)],
)  # fmt: skip
def test_what_nothing_holds_is_not_counted(name: str, bound: int) -> None:
    scene = springcheck.load_scene(name)
    # places as a bath makes them: no symmetry, and each distance another one
    q = scene.q * (1 + 0.1 * np.random.default_rng(3).standard_normal((9, scene.n))) + 1e-3
    assert bound_freedoms(scene, q) == bound


def test_a_start_far_hotter_than_the_bath_is_left_out_until_it_has_decayed() -> None:
    scene = springcheck.load_scene("bath-spring").derived(steps=4000)
    hot = scene.derived(q=scene.q * 1e4, p=scene.p * 1e4)
    for each in (scene, hot):
        found = heated_of(each, [driver.run(each, "own:obabo", seed=3)])
        assert abs(found.configurational - found.configurational_law) < 5 * found.configurational_error
        assert abs(found.kinetic - found.kinetic_law) < 5 * found.kinetic_error < 1


def test_collisions_of_particles_mix_modes_which_then_have_no_law_of_their_own() -> None:
    """Leapfrog's momenta of two particles are correlated by (h w)**2 where a spring joins them, and a
    collision of one of them ends that: 2 x 2 moments of a mode alone miss it."""
    scene = springcheck.load_scene("chain").derived(step=0.3, steps=3000)
    scene = scene.derived(bath=replace(three().bath, friction=0.7))
    for name, known in (("own:andersen-leapfrog", False), ("own:baoa", True)):
        found = heated_of(scene, [driver.run(scene, name, seed=4)])
        assert np.isfinite([found.configurational, found.kinetic]).all()
        laws = [found.configurational_law, found.kinetic_law, found.configurational_error]
        assert np.array_equal(np.isfinite(laws), [known] * 3)
    alone = springcheck.load_scene("bath-spring")
    found = heated_of(alone, [driver.run(alone, "own:andersen-leapfrog", seed=4)])
    assert abs(found.kinetic - found.kinetic_law) < 5 * found.kinetic_error < 1


def test_what_is_held_is_seen_where_a_run_that_diverges_still_is() -> None:
    """`run bath-well --all` ended in a LinAlgError: Euler-Maruyama leaves a quartic well."""
    scene = springcheck.load_scene("bath-well")
    run = driver.run(scene, "own:euler-maruyama", seed=1)
    assert run.outcome.status == "diverged"
    assert bound_freedoms(scene, run.q) == 1
    assert heated_of(scene, [run]).method == "own:euler-maruyama"
