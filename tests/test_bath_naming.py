"""Frames of one oscillator name their thermostat, or list those that would have made them as well."""

from __future__ import annotations

import numpy as np
import pytest

import baths as campaign
from springcheck import driver
from springcheck.bath import THERMOSTATS
from springcheck.bath.naming import DRAWN_ONCE, Fitted, fit, named, noise_of, thermostats
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring

M, K, RATE, THERMAL, H = 3.7, 2.9, 0.8, 1.7, 0.35
OMEGA = np.sqrt(K / M)


def frames(name: str, steps: int = 1000, step: float = H, seed: int = 3) -> tuple[Floats, Floats]:
    scene = Scene(
        m=[M], q=[0.3], p=[0.2], terms=(WallSpring(i=[0], k=[K], at=[0.4]),), step=step, steps=steps,
        bath=Bath(temperature=THERMAL, friction=RATE), name="spring",
    )  # fmt: skip
    run = driver.run(scene, f"own:{name}", seed=seed)
    return run.q[:, 0], run.p[:, 0] / M


def off(one: Fitted) -> list[float]:
    """Deviations of its numbers in their standard errors, of those that have one."""
    pairs = (one.omega, OMEGA, one.omega_error), (one.friction, RATE, one.friction_error)
    found = [*pairs, (one.thermal, THERMAL / M, one.thermal_error)]
    return [abs(x - right) / error for x, right, error in found if error > 1e-9 * right]


@pytest.mark.parametrize("name", [
    "baoab", "baoa", "aboba", "aoboa", "obabo", "boaob", "gj-i", "gj-iii", "gj-vi", "gj-i-half",
    "gj-iii-half", "bbk", "lammps-langevin", "vanden-eijnden-ciccotti", "brownian", "andersen",
    "andersen-after-kick", "andersen-after", "andersen-leapfrog",
])  # fmt: skip
def test_a_thousand_frames_name_their_scheme_or_list_it(name: str) -> None:
    found = thermostats(*frames(name), H)
    assert found is not None
    (one,) = [y for y in found if y.scheme == name]
    best = named(found)
    assert best is None or best is one
    # 5 standard errors, and none of the numbers that rounding alone moves
    assert max(off(one), default=0.0) < 5
    if name in ("baoab", "baoa", "andersen", "andersen-after"):
        assert one.omega == pytest.approx(OMEGA, rel=1e-9)


@pytest.mark.parametrize("name", ["baoa", "andersen-after", "andersen-leapfrog", "bbk", "gj-iii"])
def test_schemes_that_differ_to_rounding_are_named_in_a_thousand_frames(name: str) -> None:
    found = thermostats(*frames(name), H)
    best = named(found) if found else None
    assert best is not None
    assert best.scheme == name


def test_two_draws_a_step_are_told_apart_by_likelihood_in_twenty_thousand() -> None:
    for name in ("obabo", "oabao"):
        found = thermostats(*frames(name, 20_000), H)
        best = named(found) if found else None
        assert best is not None
        assert best.scheme == name
        assert max(off(best)) < 5


@pytest.mark.parametrize("name", ["spring", "chain", "anharmonic", "pendulum", "detest-b1"])
def test_what_is_not_random_is_no_thermostat(name: str) -> None:
    scene = scenefile.load_scene(name)
    run = driver.run(scene, "own:velocity-verlet")
    assert not thermostats(run.q[:, 0], run.p[:, 0] / scene.m[0], scene.step)


@pytest.mark.parametrize("name", ["baoab", "obabo", "bbk", "andersen"])
def test_frames_several_steps_apart_have_no_wrong_name(name: str) -> None:
    q, v = frames(name, 4000)
    found = thermostats(q[::3], v[::3], 3 * H)
    best = named(found) if found else None
    assert best is None or best.scheme == name


def loop(kind: str, steps: int = 1500) -> tuple[Floats, Floats]:
    """A loop that is no scheme's: letters in another order, or Verlet with other pushes."""
    rng, x, v, states = np.random.default_rng(3), 0.9, 0.4, []
    word = kind if kind.isupper() else "BAB"
    times = {letter: H / word.count(letter) for letter in word}
    for i in range(steps):
        for letter in word:
            if letter == "A":
                x += times["A"] * v
            elif letter == "B":
                v -= times["B"] * K / M * x
            else:
                e = np.exp(-RATE * times["O"])
                v = e * v + np.sqrt((1 - e * e) * THERMAL / M) * rng.standard_normal()
        v += {
            "alternating": 0.3 * (-1) ** i, "shots": 0.3 * rng.normal() * (rng.random() < 0.2),
            "random force": -0.1 * x * rng.normal(), "kicks": 0.2 * (i % 97 == 50),
        }.get(kind, 0.0)  # fmt: skip
        states.append((x, v))
    q, u = np.array(states).T
    return q, u


@pytest.mark.parametrize(
    "kind", ["BAOBA", "BABOA", "ABO", "AOB", "OAB", "OBAB", "alternating", "shots", "random force", "kicks"]
)
def test_a_loop_of_ones_own_that_is_no_scheme_has_no_name(kind: str) -> None:
    """BAOBA has BAOA's combination of half its stiffness, and ABO is Euler-Maruyama of twice its friction."""
    found = thermostats(*loop(kind), H)
    assert not (found and named(found))


def test_a_row_is_rejected_by_its_combination_or_by_its_likelihood() -> None:
    seen = noise_of(*frames("baoa"), H)
    assert seen is not None
    assert seen.misfit < 1e-12
    assert seen.free == pytest.approx([1, -0.5, -(1 - (H * OMEGA) ** 2 / 2), -0.5], abs=1e-9)
    assert {x.name for x in DRAWN_ONCE if fit(x, seen)} == {"baoa"}
    # twice the temperature in positions: the map is right, and the noise is not
    two = noise_of(*frames("obabo", 4000), H)
    assert two is not None
    assert fit(THERMOSTATS["vanden-eijnden-ciccotti"], two) is None


def test_digits_of_a_file_leave_less_and_nothing_wrong() -> None:
    q, v = frames("baoa", 2000)
    for less in (lambda x: x.astype(np.float32).astype(float), lambda x: np.round(x, 6)):
        found = thermostats(less(q), less(v), H)
        assert found is not None
        assert [y.scheme for y in found] == ["baoa"]
        assert found[0].omega == pytest.approx(OMEGA, rel=1e-3)


def test_random_files_and_right_runs_of_the_campaign_have_no_wrong_name_and_no_alarm() -> None:
    for case in range(0, 36, 4):
        assert "WRONG NAME" not in campaign.names(case)
    for seed in (4, 21, 110, 953, 3402, 5453):
        assert campaign.alarms(seed)["alarms"] == 0
    assert campaign.by_engine(0).get("alarms", 0) == 0
