"""Coupled motions in few digits: their normal modes are judged, and no number of one coordinate is given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from springcheck.identify import Identification, identify
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES, step

H = 0.1


def chain(n: int, seed: int, *, walls: bool = True, friction: float = 0.0, late: bool = False) -> Any:
    """t, q, v and the frequencies of a chain of unlike masses and springs by velocity Verlet; with a friction
    of the first mass alone, or with the old force in the second half kick."""
    random = np.random.default_rng(seed)
    m, k = random.uniform(0.5, 3, n), random.uniform(0.5, 4, n + 1)
    k[[0, -1]] *= walls
    springs = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    q, v = random.normal(size=(2, n))
    v = v - (0 if walls else np.sum(m * v) / np.sum(m))
    first = friction * np.eye(n)[0]
    states = [(q, v)]
    for _ in range(400):
        old = -(springs @ q + first * v) / m
        v = v + H / 2 * old
        q = q + H * v
        v = v + H / 2 * (old if late else -(springs @ q + first * v) / m)
        states.append((q, v))
    w = np.sqrt(np.maximum(np.linalg.eigvalsh(springs / np.sqrt(np.outer(m, m))), 0))
    return H * np.arange(401), *map(np.array, zip(*states, strict=True)), w[0 if walls else 1 :]


def few(x: Any, form: str) -> Any:
    return np.array([[float(form % y) for y in row] for row in x])


def identified(states: Any, form: str) -> Identification:
    t, q, v, *_ = states
    return identify(t, few(q, form), v=few(v, form))


@pytest.mark.parametrize(("form", "known"), [("%.3f", 1e-5), ("%.4g", 2e-6), ("%.6f", 2e-8), ("%.8f", 2e-10)])
@pytest.mark.parametrize(("n", "seed", "walls"), [(2, 200, True), (3, 301, True), (3, 300, False)])
def test_a_chain_in_few_digits_is_judged_by_its_modes(
    form: str, known: float, n: int, seed: int, walls: bool
) -> None:
    states = chain(n, seed, walls=walls)
    found = identified(states, form)
    assert (found.scheme, found.fits) == ("velocity-verlet", True)
    assert np.allclose(np.sort(found.omega), states[-1], rtol=known)


@pytest.mark.parametrize("seed", [300, 303])
def test_a_free_chain_whose_centre_rests_is_judged_by_the_modes_that_move(seed: int) -> None:
    """Its resting mode was read as an exact flow that a constant pushes, with a frequency of its own."""
    states = chain(3, seed, walls=False)
    found = identified(states, "%.17g")
    assert (found.scheme, found.fits) == ("velocity-verlet", True)
    assert np.allclose(np.sort(found.omega), states[-1], rtol=1e-12)


@pytest.mark.parametrize("form", ["%.3f", "%.6f"])
@pytest.mark.parametrize("wrong", [{"friction": 0.03}, {"late": True}])
def test_a_wrong_chain_in_few_digits_names_no_scheme(form: str, wrong: Any) -> None:
    found = identified(chain(2, 900, **wrong), form)
    assert (found.scheme, found.fits) == (None, False)
    assert wrong.get("late", False) == ("old force" in found.statement)
    if "coupled" in found.statement:
        # numbers of one coordinate's map are none of the motion's
        assert not np.isfinite([*found.omega, *found.determinant, found.defect_ulp]).any()
        assert found.nearest is None


def boris(strength: float, k: float) -> Any:
    turn = strength * H / 2
    c, s = (1 - turn**2) / (1 + turn**2), 2 * turn / (1 + turn**2)
    q, v = np.array([1.0, 0.2]), np.array([0.1, 0.8])
    states = [(q, v)]
    for _ in range(400):
        q = q + H / 2 * v
        v = v - H / 2 * k * q
        v = np.array([[c, s], [-s, c]]) @ v - H / 2 * k * q
        q = q + H / 2 * v
        states.append((q, v))
    return H * np.arange(401), *map(np.array, zip(*states, strict=True))


@pytest.mark.parametrize(
    ("form", "turned"),
    [("%.2f", "about -0.07 "), ("%.4g", "-0.07 "), ("%.6f", "-0.069971 "), ("%.8f", "-0.06997144 ")],
)
def test_a_boris_run_in_few_digits_is_one_with_the_digits_that_it_shows(form: str, turned: str) -> None:
    """The angle is 2 atan(0.035)."""
    found = identified(boris(0.7, 1.3), form)
    assert f"turns by {turned}" in found.statement
    assert "central force" in found.statement
    assert not np.isfinite(found.omega).any()


@pytest.mark.parametrize("form", ["%.3f", "%.6f"])
def test_a_velocity_that_turns_in_few_digits_does_not_grow_by_their_noise(form: str) -> None:
    found = identified(boris(0.7, 0.0), form)
    assert "only turns" in found.statement


def pair(name: str, frames: int, stiffness: float | None = None) -> Identification:
    """What is said of two masses between two walls, in all digits."""
    m, states = np.array([3.7, 1.9]), [(np.array([0.13, -0.7]), np.array([2.4, 0.2]))]

    def force(q: Floats, p: Floats) -> Floats:
        return np.array([5.3 * (q[1] - q[0]) - 2.9 * q[0], -5.3 * (q[1] - q[0]) - 0.7 * q[1]])

    for _ in range(frames - 1):
        q, p = step(SCHEMES[name], *states[-1], h=0.31, m=m, force=force)
        states.append((np.asarray(q, np.float64), np.asarray(p, np.float64)))
    q, p = (np.array(x) for x in zip(*states, strict=True))
    return identify(0.31 * np.arange(frames), q, v=p / m, mass=m, stiffness=stiffness)


def test_so_few_frames_that_any_map_of_all_coordinates_takes_each_to_the_next_show_no_modes() -> None:
    found = pair("velocity-verlet", 6)
    assert found.scheme is None
    assert not any("normal modes" in note for note in found.notes)


def test_a_stiffness_of_single_springs_is_none_of_the_modes() -> None:
    """Whatever is stated, the modes' own stiffnesses are open."""
    found, stated = pair("position-verlet", 61), pair("position-verlet", 61, stiffness=3.0)
    assert any("normal modes were judged" in note for note in stated.notes)
    assert (stated.statement, stated.notes) == (found.statement, found.notes)


def test_a_mode_in_which_the_coordinates_cancel_has_their_roundings() -> None:
    """Two like masses on like springs, of which one is nearly where the other is."""
    q, v, states = np.array([0.3, 0.3001]), np.array([0.2, 0.19997]), []

    def kick(q: Floats) -> Floats:
        bond = 5.3 * (q[1] - q[0])
        return H / 2 * (np.array([bond, -bond]) - 2.9 * q) / 3.7

    for _ in range(201):
        states.append((q, v))
        v = v + kick(q)
        q = q + H * v
        v = v + kick(q)
    q, v = (np.array(x) for x in zip(*states, strict=True))
    found = identify(H * np.arange(201), q, v=v, mass=3.7)
    assert (found.scheme, found.precision) == ("velocity-verlet", "double")
    assert any("2 normal modes were judged" in note for note in found.notes)
    v[60, 0] += 3000 * 2.0**-52
    assert not identify(H * np.arange(201), q, v=v, mass=3.7).fits
