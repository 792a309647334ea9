"""Files at temperature name themselves: by what no noise reaches, to rounding, and by likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import driver
from springcheck.bath import THERMOSTATS, Law
from springcheck.cli import main
from springcheck.identify import identify
from springcheck.identify.bath_collisions import between_collisions
from springcheck.identify.bath_likelihood import likely_apart
from springcheck.identify.bath_states import Thermal, identify_thermal
from springcheck.identify.clock import clock_of
from springcheck.identify.result import Candidate, Explanation, nothing
from springcheck.physics import scenefile
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring

M, K, RATE, THERMAL = 3.7, 2.9, 0.8, 1.7
OMEGA = np.sqrt(K / M)


def scene(steps: int) -> Scene:
    spring = WallSpring(i=np.array([0]), k=np.array([K]), at=np.array([0.4]))
    return Scene(
        m=np.array([M]), q=np.array([0.3]), p=np.array([0.2]), terms=(spring,), step=0.35, steps=steps,
        bath=Bath(temperature=THERMAL, friction=RATE), name="spring",
    )  # fmt: skip


def run(name: str, steps: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    made = driver.run(scene(steps), f"own:{name}", seed=seed)
    return made.t, made.q[:, 0], made.p[:, 0] / M


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("baoab", "baoab"), ("baoa", "baoa"), ("aboba", "aboba"), ("aoboa", "aoboa"), ("gj-i", "gj-i"),
        ("gj-vi", "gj-vi"), ("gj-i-half", "gj-i-half"), ("bbk", "bbk"),
        ("lammps-langevin", "lammps-langevin"),
        ("euler-maruyama", "euler-maruyama"), ("brownian", "brownian"), ("andersen", "andersen"),
        ("andersen-after-kick", "andersen-after-kick"), ("andersen-after", "andersen-after"),
        ("vanden-eijnden-ciccotti", "vanden-eijnden-ciccotti"),
    ],
)  # fmt: skip
@pytest.mark.campaign
@pytest.mark.parametrize("seed", [3, 4])
def test_a_thousand_frames_name_the_scheme_or_list_it_among_those_that_share_its_states(
    name: str, expected: str, seed: int
) -> None:
    found = identify_thermal(*run(name, 1000, seed))
    assert found is not None
    assert expected in [one.scheme for one in found.candidates if one.nats < 14]
    if found.named:
        assert found.candidates[0].scheme == expected


def test_one_oscillator_in_a_bath_is_seen_in_rows_and_in_columns_alike() -> None:
    """A mass in a list ended in a traceback, and one row beside one column in noise without a name."""
    t, q, v = run("baoab", 1000)
    wanted = identify(t, q, v=v, mass=M)
    assert wanted.statement.startswith("each step takes noise: a thermostat, baoab or ")
    column = q[:, None]
    for positions, velocities, mass in ((q, v, [M]), (column, v, M), (q, v[:, None], [M])):
        assert identify(t, positions, v=velocities, mass=mass).statement == wanted.statement


def test_times_of_few_digits_leave_no_room_for_noise() -> None:
    """Steps of a frame were taken to be as unlike as the times are rounded: "Several schemes fit: exact,
    velocity Verlet"."""
    step = float(0.621 / OMEGA)
    for name, rate in (("baoab", 0.774 / step), ("baoab", 0.758 / step)):
        still = scene(616)
        bath = replace(still.bath, friction=rate)  # type: ignore[type-var]
        made = driver.run(replace(still, step=step, bath=bath), f"own:{name}", seed=3)
        t, q, v = (np.vectorize(lambda x: float(f"{x:.6g}"))(x) for x in (made.t, made.q, made.p / M))
        assert clock_of(t).unlike < 1e-12 < clock_of(t).quantum
        assert not {x.scheme for x in identify(t, q, v=v, mass=M).candidates} & {"exact", "velocity-verlet"}


def test_what_would_tell_thermostats_apart_is_noted_and_what_is_free_of_noise() -> None:
    t, q, v = run("baoab", 1000)
    of_every_step, of_every_third = identify(t, q, v=v, mass=M), identify(t[::3], q[::3], v=v[::3], mass=M)
    more = "a stated stiffness or more frames may tell them apart"
    for found, told in ((of_every_step, more), (of_every_third, f"frames of every step, {more}")):
        assert found.verdict == "not told apart"
        assert any(note.endswith(f"by a factor of 1e6; {told}") for note in found.notes), found.notes
    assert any(note.startswith("free of noise at every step: (1, ") for note in of_every_step.notes)
    turns = "of frames several steps apart whole turns between two of them do not show"
    assert [turns in found.notes for found in (of_every_step, of_every_third)] == [False, True]
    # gj-v and gj-vi stretch the step, and with it the frequency
    stated = identify(t, q, v=v, mass=M, stiffness=K, friction=M * RATE)
    left = {x.scheme for x in of_every_step.candidates} - {x.scheme for x in stated.candidates}
    assert left == {"gj-v", "gj-vi"}
    assert stated.fits


@pytest.mark.parametrize("name", ["baoab", "obabo", "andersen"])
def test_what_is_stated_of_a_bath_is_held_against_its_states(name: str) -> None:
    t, q, v = run(name, 1000)
    told = identify(t, q, v=v, mass=M, stiffness=K, step=0.35)
    assert name in [one.scheme for one in told.candidates]
    assert told.fits
    stated: list[tuple[dict[str, float], str]] = [
        ({"stiffness": 900.0}, "where 900 is stated"), ({"step": 0.7}, "step 0.35 where 0.7 is stated"),
        *([] if name == "andersen" else [({"friction": 90.0}, "where 90 is stated")]),
    ]  # fmt: skip
    for wrong, words in stated:
        found = identify(t, q, v=v, mass=M, **wrong)
        assert (found.fits, words in found.statement) == (False, True), found


@pytest.mark.parametrize("name", ["baoab", "baoa", "andersen"])
def test_the_spring_is_known_to_rounding_at_any_temperature(name: str) -> None:
    found = identify_thermal(*run(name, 1000))
    assert found is not None
    assert found.candidates[0].omega == pytest.approx(OMEGA, rel=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["obabo", "oabao", "boaob"])
def test_two_draws_a_step_are_told_apart_by_likelihood(name: str) -> None:
    few, many = (identify_thermal(*run(name, steps)) for steps in (1000, 20000))
    assert few is not None
    assert many is not None
    assert not few.named or few.candidates[0].scheme == name
    assert many.named
    best = many.candidates[0]
    assert best.scheme == name
    assert abs(best.friction - RATE) < 5 * best.friction_error < 0.2
    assert abs(best.thermal - THERMAL / M) < 5 * best.thermal_error < 0.1
    assert abs(best.omega - OMEGA) < 5 * best.omega_error < 0.1


@pytest.mark.campaign
@pytest.mark.parametrize(
    "label", ["own:semi-implicit-euler", "own:velocity-verlet", "own:position-verlet", "own:rk4"]
)
@pytest.mark.parametrize("name", ["spring", "chain", "anharmonic", "two-scales", "pendulum", "detest-b1"])
def test_what_is_not_random_is_no_thermostat(name: str, label: str) -> None:
    made = driver.run(scenefile.load_scene(name), label)
    for j in range(min(made.q.shape[1], 2)):
        assert identify_thermal(made.t, made.q[:, j], made.p[:, j]) is None


def test_single_precision_and_text_say_less_and_nothing_wrong() -> None:
    t, q, v = run("baoa", 2000)
    for less in (lambda x: x.astype(np.float32).astype(float), lambda x: np.round(x, 6)):
        found = identify_thermal(t, less(q), less(v))
        assert found is not None
        assert [one.scheme for one in found.candidates] == ["baoa"]
        assert found.candidates[0].omega == pytest.approx(OMEGA, rel=1e-3)
        assert found.misfit > 1e-9


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["baoab", "obabo", "gj-ii-half"])
def test_frames_several_steps_apart_list_their_scheme_and_their_stride(name: str) -> None:
    t, q, v = run(name, 8000)
    found = identify_thermal(t[::4], q[::4], v[::4])
    assert found is not None
    assert not found.named
    (one,) = [x for x in found.candidates if x.scheme == name]
    assert 4 in one.strides
    # at any stride that fits, few turns apart, the friction and the temperature are those of the bath
    if one.strides[0] == 4:
        assert abs(one.friction - RATE) < 5 * one.friction_error < 0.4
        assert abs(one.thermal - THERMAL / M) < 5 * one.thermal_error < 0.2


def test_several_steps_of_a_law_are_its_autocovariance() -> None:
    """A**s and the noise of s steps, by steps taken one by one and by the stationary covariance."""
    about: dict[str, Any] = {"h": 0.31, "m": np.array([1.7, 0.4]), "k": np.array([3.3, 2.1]), "thermal": 0.6}
    for name in ("obabo", "bbk", "gj-iii-half"):
        law = Law(scheme=THERMOSTATS[name], rate=0.9, **about)
        B, Q = law.apart([3, 1])
        S, (_, A, G) = law.covariance, law._maps[0]
        whole = np.linalg.solve(
            np.eye(A.shape[1] ** 2) - np.array([np.kron(a, a) for a in A], float),
            np.array(G @ G.transpose(0, 2, 1), float).reshape(2, -1, 1),
        ).reshape(A.shape)
        for i, steps in enumerate((3, 1)):
            lag = (np.linalg.matrix_power(A[i].astype(float), steps) @ whole[i])[:2, :2]
            assert np.allclose(B[i] @ S[i], lag, rtol=1e-12, atol=1e-13)
            assert np.allclose(Q[i], S[i] - B[i] @ S[i] @ B[i].T, rtol=1e-12, atol=1e-13)


def test_the_public_function_and_the_command_say_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = driver.run(scene(1500), "openmm:langevin-middle-bath", seed=3)
    found = springcheck.identify(made.t, made.q, made.p, mass=M)
    assert found.scheme == "baoa"
    assert found.omega[0] == pytest.approx(OMEGA, rel=1e-12)
    assert found.stiffness is not None
    assert found.stiffness[0] == pytest.approx(K, rel=1e-12)
    assert "its velocities are of another time" in found.statement
    path = tmp_path / "x.h5"
    arguments = ["bath-spring", "--method", "own:obabo", "--seed", "3", "-o", str(path)]
    assert main(["run", *arguments]) == 0
    capsys.readouterr()
    main(["identify", str(path)])
    said = capsys.readouterr()
    assert "one of: obabo" in said.out
    # a rate, where --friction states c
    assert "friction c/m " in said.out
    assert "does not fit" not in said.out
    assert "do not span" not in said.out + said.err


def test_an_engine_that_is_no_thermostat_keeps_its_words() -> None:
    made = driver.run(replace(scenefile.load_scene("spring"), steps=400), "own:velocity-verlet")
    assert springcheck.identify(made.t, made.q, made.p, mass=1.0).scheme == "velocity-verlet"


@pytest.mark.parametrize("scheme", ["bussi", "bussi-unsigned", "bussi-after"])
def test_one_spring_whose_momentum_is_rescaled_lists_it(scheme: str) -> None:
    t, q, v = run(scheme, 1000)
    found = identify_thermal(t, q, v)
    assert found is not None
    assert scheme in [one.scheme for one in found.candidates]
    assert found.candidates[0].omega == pytest.approx(OMEGA, rel=1e-9)


def test_gromacs_sd_names_itself_in_single_precision() -> None:
    """Frames of GROMACS 2022.5: BAOA, its velocities half a step early (`validation/gromacs_sd.py`)."""
    path = Path(__file__).parents[1] / "data" / "reference" / "thermostats" / "gromacs-sd.csv"
    named: Any = springcheck.identify(path, mass=12.011)
    (found,) = named.values()
    assert (found.verdict, found.scheme, found.velocity_offset) == ("named", "baoa", -0.5)
    assert found.omega[0] == pytest.approx(np.sqrt(20000 / 12.011), rel=2e-5)
    assert found.friction[0] == pytest.approx(10, rel=0.5)


@pytest.mark.parametrize("name", ["andersen", "andersen-after", "andersen-leapfrog"])
def test_frames_without_a_collision_between_them_tell_the_spring_and_the_stride_to_rounding(
    name: str,
) -> None:
    t, q, v = run(name, 4000)
    found = identify_thermal(t[::4], q[::4], v[::4])
    assert found is not None
    (one,) = [x for x in found.candidates if x.scheme == name]
    assert one.strides == (4,)
    assert one.omega == pytest.approx(OMEGA, rel=1e-9)
    assert abs(one.friction - RATE) < 5 * one.friction_error < 0.5 * RATE
    assert abs(one.thermal - THERMAL / M) < 5 * one.thermal_error < 0.5


@pytest.mark.parametrize("name", ["andersen", "andersen-leapfrog"])
def test_steps_that_turn_little_are_counted_as_well(name: str) -> None:
    few = replace(scene(10000), step=0.002 / OMEGA, every=5, bath=Bath(temperature=THERMAL, friction=8.0))
    made = driver.run(few, f"own:{name}", seed=3)
    (one, *_) = between_collisions(made.q[:, 0], made.p[:, 0] / M, 5 * few.step)
    assert (one.scheme, one.strides) == (name, (5,))
    # digits leave open how many steps a frame has
    short = [np.round(x, 7) for x in (made.q[:, 0], made.p[:, 0] / M)]
    (one, *_) = between_collisions(*short, 5 * few.step)
    assert {4, 5, 6} <= set(one.strides)


@cache
def in_units_of_one(name: str) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], Thermal | None]:
    made = run(name, 1000)
    return made, identify_thermal(*made)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["obabo", "baoab"])
@pytest.mark.parametrize(("length", "time"), [(1e-10, 1e-13), (1e-80, 1.0), (1e60, 1e-6)])
def test_a_unit_is_of_no_account(name: str, length: float, time: float) -> None:
    (t, q, v), wanted = in_units_of_one(name)
    found = identify_thermal(t * time, q * length, v * length / time)
    assert wanted is not None
    assert found is not None
    assert [x.scheme for x in found.candidates] == [x.scheme for x in wanted.candidates]
    assert len(found.candidates) > 0
    for x, y in zip(found.candidates, wanted.candidates, strict=True):
        assert (x.omega * time, x.friction * time) == pytest.approx((y.omega, y.friction), rel=1e-6)
        assert x.thermal * (time / length) ** 2 == pytest.approx(y.thermal, rel=1e-6, nan_ok=True)


@pytest.mark.parametrize("start", [0.7, 1.3])
def test_dry_friction_is_no_collision(start: float) -> None:
    """A force that changes sign with the velocity moves frames by one of few numbers, and no draw: it was a
    thermostat, Andersen's."""
    h, q, v, frames = 1.33, start, -1.1, []
    for _ in range(400):
        frames.append((q, v))
        v -= h / 2 * (K / M * q + 0.02 * np.sign(v))
        q += h * v
        v -= h / 2 * (K / M * q + 0.02 * np.sign(v))
    q, v = np.array(frames).T
    assert between_collisions(q, v, h) is None
    assert not identify(h * np.arange(400), q, v=v).fits


ALTERNATING: dict[str, Callable[[int], float]] = {
    "alternating": lambda i: 0.3 * (-1) ** i,
    "in pairs": lambda i: 0.3 * (-1) ** (i // 2),
    "in fives": lambda i: 0.3 * (-1) ** (i // 5),
    "of changing size": lambda i: 0.3 * (-1) ** i * (1 + 0.3 * np.sin(0.7 * i)),
    "at some steps": lambda i: 0.3 * (-1) ** i * (1 + 0.3 * np.sin(0.7 * i)) * ((i**3 + 3 * i) % 11 < 4),
    "by the sign of a wave": lambda i: 0.3 * np.sign(np.cos(1.3 * i)),
}


@pytest.mark.parametrize("frames", [400, 2000])
@pytest.mark.parametrize("at", ["start", "half", "end"])
@pytest.mark.parametrize("name", ALTERNATING)
def test_forces_that_alternate_are_no_draws(name: str, at: str, frames: int) -> None:
    """A push at every step leaves the combination free of noise that a collision leaves, or a factor of all
    momenta: they were Andersen's and Bussi's."""
    h, q, v, rows = 0.35, 0.7, -1.1, []
    for i in range(frames):
        rows.append((q, v))
        push = ALTERNATING[name](i)
        v += push * (at == "start") - h / 2 * K / M * q + push * (at == "half")
        q += h * v
        v += push * (at == "end") - h / 2 * K / M * q
    q, v = np.array(rows).T
    assert between_collisions(q, v, h) is None
    found = identify_thermal(h * np.arange(frames), q, v)
    assert found is None or not found.candidates
    assert "thermostat" not in identify(h * np.arange(frames), q, v=v).statement


@pytest.mark.parametrize(
    "name", ["andersen", "andersen-after-kick", "andersen-after", "bussi", "bussi-unsigned", "bussi-after"]
)
@pytest.mark.parametrize("rate", [0.4, 8.0])
def test_draws_of_collisions_and_of_factors_are_white(name: str, rate: float) -> None:
    for seed in range(1, 5):
        bath = Bath(temperature=THERMAL, friction=rate)
        made = driver.run(replace(scene(1000), bath=bath), f"own:{name}", seed=seed)
        found = identify_thermal(made.t, made.q[:, 0], made.p[:, 0] / M)
        assert found is not None
        assert name in [one.scheme for one in found.candidates]


def test_a_stop_of_all_noise_halfway_is_no_collision() -> None:
    t, q, v = run("obabo", 1000)
    still = driver.run(replace(scene(1000), bath=None), "own:velocity-verlet")
    q, v = np.concatenate([q, still.q[:, 0]]), np.concatenate([v, still.p[:, 0] / M])
    assert between_collisions(q, v, float(t[1] - t[0])) is None


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["baoa", "gj-iii", "lammps-langevin", "obabo"])
def test_joined_particles_are_told_by_their_modes(name: str) -> None:
    m, k, joint = np.array([0.7, 2.9]), np.array([1.3, 2.1]), 1.7
    terms = (
        WallSpring(i=np.arange(2), k=k, at=np.zeros(2)),
        Spring(a=np.array([0]), b=np.array([1]), k=np.array([joint]), rest=np.zeros(1)),
    )
    pair = Scene(
        m=m, q=np.array([0.4, -0.3]), p=np.array([0.2, 0.5]), terms=terms, step=0.3, steps=1000,
        bath=Bath(temperature=0.8, friction=1.1), name="pair",
    )  # fmt: skip
    made = driver.run(pair, f"own:{name}", seed=5)
    found = springcheck.identify(made.t, made.q, made.p, mass=m)
    assert name in [one.scheme for one in found.candidates]
    assert found.scheme in (None, name)
    if name == "baoa":
        K = np.diag(k) + joint * np.array([[1, -1], [-1, 1]])
        omega = np.sqrt(np.linalg.eigvalsh(K / np.sqrt(np.outer(m, m))))
        assert found.scheme == name
        assert sorted(found.omega) == pytest.approx(omega, rel=1e-9)


def test_draws_that_are_carried_on_are_no_reason_to_be_silent() -> None:
    found = identify_thermal(*run("gj-iii-half", 1000, 4))
    assert found is not None
    assert not found.named
    assert [one.scheme for one in found.candidates] == ["gj-iii-half"]
    t, q, v = run("bbk", 2000, 4)
    schemes = {x.scheme: x for x in likely_apart(q[::2], v[::2], float(t[2] - t[0]), white=False)}
    assert 2 in schemes["bbk"].strides
    # what carries nothing on leaves white frames of every step
    at_once = {name for name, one in THERMOSTATS.items() if one.full_rank and not one.carried}
    assert not [x for x in schemes if x in at_once and 1 in schemes[x].strides]


@pytest.mark.parametrize("name", ["bbk", "lammps-langevin"])
def test_the_numbers_of_two_halves_are_off_by_their_errors(name: str) -> None:
    """Of 12 files with a step far from 1: squares over those of the errors are 1 on the average."""
    w, rate, thermal, m = 126.0, 20.0, 1.7, 3.7
    fast = Scene(
        m=np.array([m]), q=np.array([0.003]), p=np.array([0.7]), step=0.001, steps=1500, name="fast",
        terms=(WallSpring(i=np.array([0]), k=np.array([m * w * w]), at=np.zeros(1)),),
        bath=Bath(temperature=thermal, friction=rate),
    )  # fmt: skip
    off = []
    for seed in range(12):
        run = driver.run(fast, f"own:{name}", seed=seed + 1)
        found = identify_thermal(run.t, run.q[:, 0], run.p[:, 0] / m)
        assert found is not None
        one = found.candidates[0]
        assert one.scheme == name
        off.append(
            [
                (one.omega - w) / one.omega_error,
                (one.friction - rate) / one.friction_error,
                (one.thermal - thermal / m) / one.thermal_error,
            ]
        )
    assert np.all(np.mean(np.square(off), axis=0) < 3)
    assert np.all(np.mean(np.square(off), axis=0) > 0.2)


def test_of_schemes_that_a_count_tells_apart_one_entry_is_said() -> None:
    one = Candidate(scheme="", aliases=(), stride=1, step=0.1, turns=0, omega=(), stiffness=None, friction=())
    names = [("baoab", 1), ("obabo", 2), ("obabo", 3)]
    found = nothing(
        (Explanation(cause="", remedy="", misfit=0.0),), determinant=(), symplectic_defect=0.0,
        defect_ulp=0.0, notes=[],
    )  # fmt: skip
    several = replace(found, candidates=tuple(replace(one, scheme=x, stride=n) for x, n in names))
    assert several.choice == ["baoab", "obabo, 2 to 3 steps per frame"]


@pytest.mark.parametrize(("decays", "shows"), [(0, False), (5, False), (200, True)])
def test_a_friction_that_does_not_show_leaves_bare_kicks_open(decays: int, shows: bool) -> None:
    """Kicks without a friction were baoab's and twelve others'."""
    rng, q, v, h, rows = np.random.default_rng(0), 1.0, 0.3, 0.2, []
    kept = np.exp(-decays / 1000)
    size = np.sqrt(0.6 * (1 - kept**2)) or 0.02
    for _ in range(1000):
        rows.append((q, v))
        v -= h / 2 * q
        q += h / 2 * v
        v = kept * v + size * rng.standard_normal()
        q += h / 2 * v
        v -= h / 2 * q
    q, v = np.array(rows).T
    statement = identify(h * np.arange(1000), q, v=v, mass=1.0).statement
    assert ("random kicks without" not in statement) == shows


@pytest.mark.parametrize("frames", [300, 3000])
def test_friction_and_noise_before_velocity_verlet_are_no_scheme_that_is_known(frames: int) -> None:
    """OBAB: a step leaves of the momentum that it begins with what a collision or a factor would as well."""
    rng, h, w2, c, q, v = np.random.default_rng(6), 0.35, 1.3, 0.9, 0.4, 0.2
    states = np.empty((frames, 2))
    for i in range(frames):
        v = c * v + np.sqrt(1 - c * c) * rng.standard_normal() - h / 2 * w2 * q
        q += h * v
        v -= h / 2 * w2 * q
        states[i] = q, v
    found = springcheck.identify(h * np.arange(frames), states[:, :1], v=states[:, 1:], mass=1.0)
    assert found.verdict == "not told apart"
    assert "or one that is not known here" in found.statement
    assert not found.fits
    # steps without a collision have no factor either, wherever the spring is at rest
    found = springcheck.identify(*run("andersen", frames)[:2], v=run("andersen", frames)[2], mass=M)
    assert [one.scheme for one in found.candidates] == ["andersen", "andersen-after-kick"]
    assert found.fits


@pytest.mark.parametrize("stride", [1, 2, 3])
@pytest.mark.parametrize("often", [0.1, 0.3])
@pytest.mark.parametrize("kind", ["shot", "collision"])
def test_shots_of_noise_that_add_to_a_momentum_are_no_collisions_that_draw_it_anew(
    kind: str, often: float, stride: int
) -> None:
    """Both act in some steps alone, by what is drawn: shots were said to be Andersen's thermostat."""
    rng, m, k, h, q, v, rows = np.random.default_rng(5), 2.3, 1.7, 0.35, 1.0, 0.3, []
    for _ in range(1000 * stride):
        rows.append((q, v))
        if rng.random() < often:
            v = 0.3 * rng.normal() + v if kind == "shot" else rng.normal()
        v -= h / 2 * k / m * q
        q += h * v
        v -= h / 2 * k / m * q
    x, u = np.array(rows[::stride]).T
    found = identify(stride * h * np.arange(1000), x, v=u, mass=m)
    assert ("andersen" in [one.scheme for one in found.candidates]) == (kind == "collision")


@pytest.mark.parametrize("off", [0.1, 0.3])
def test_forces_off_by_a_random_factor_are_no_noise_of_a_scheme(off: float) -> None:
    """Such a force acts in two half kicks, as BBK's noise does, and was named BBK."""
    rng, m, k, h, q, v, rows = np.random.default_rng(1), 2.3, 1.7, 0.35, 1.0, 0.3, []
    force = -k * q
    for _ in range(1000):
        rows.append((q, v))
        v += h / 2 * force / m
        q += h * v
        force = -k * q * (1 + off * rng.normal())
        v += h / 2 * force / m
    x, u = np.array(rows).T
    found = identify(h * np.arange(1000), x, v=u, mass=m)
    assert found.verdict != "named"
    assert found.candidates == ()


@pytest.mark.parametrize("name", ["gj-ii", "gj-iii", "gj-iv", "gj-vii"])
def test_numbers_of_a_stretched_step_have_the_errors_of_its_decay(name: str) -> None:
    """Frequency and friction of GJ schemes had twelve digits, of which none or one was right."""
    of = scene(3000)
    off = []
    for seed in (1, 2, 3):
        made = driver.run(of, f"own:{name}", seed=seed)
        found = identify_thermal(made.t, made.q[:, 0], made.p[:, 0] / M)
        one = next(x for x in found.candidates if x.scheme == name)
        off += [(one.omega - OMEGA) / one.omega_error, (one.friction - RATE) / one.friction_error]
    assert 0.05 < np.sqrt(np.mean(np.square(off))) < 2.5


def test_what_is_stated_contradicts_a_stretched_step() -> None:
    of = scene(3000)
    made = driver.run(of, "own:gj-iv", seed=4)
    k, c = K, M * RATE
    right = identify(made.t, made.q, made.p, mass=of.m, stiffness=k, friction=c)
    assert right.scheme == "gj-iv"
    assert right.fits
    wrong = identify(made.t, made.q, made.p, mass=of.m, stiffness=30 * k, friction=3 * c)
    assert not wrong.fits
    assert f"where {30 * k:g} is stated" in wrong.statement
    assert f"where {3 * c:.6g} is stated" in wrong.statement


def test_a_frequency_has_no_more_digits_than_the_file() -> None:
    of = scene(3000)
    made = driver.run(of, "own:baoab", seed=5)
    q, v = (np.round(x, 6) for x in (made.q, made.p / of.m))
    found = next(x for x in identify(made.t, q, v=v, mass=of.m).candidates if x.scheme == "baoab")
    digits = len(f"{found.omega[0]!r}".replace(".", "").lstrip("0"))
    assert digits <= 7
    assert np.isclose(found.omega[0], OMEGA, rtol=1e-4)


def after_verlet(kind: str, axes: int = 1, steps: int = 1000) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities (f, axes) of a loop of one's own: velocity Verlet, then something drawn."""
    rng, h, w2 = np.random.default_rng(1), 0.35, 0.78
    q, v, rows = np.full(axes, 0.4), np.full(axes, 0.2), []
    for i in range(steps):
        rows.append((q, v))
        v = v - h / 2 * w2 * q
        q = q + h * v
        v = v - h / 2 * w2 * q
        xi, hit = rng.normal(size=axes), i % 10 == 0 if kind == "in time" else rng.random(axes) < 0.2
        what = {"shot": v + 0.3 * xi, "half": 0.7 * (v + xi), "size": abs(xi) * np.sign(v)}.get(kind, xi)
        v = np.where(hit, what, v)
    return tuple(np.array(rows).transpose(1, 0, 2))  # type: ignore[return-value]


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_collisions_that_end_a_step_have_a_name_at_every_step_and_a_list_in_few(axes: int) -> None:
    """They had none: no known cause.  Three steps a frame: many frames' last step has the only collision."""
    q, v = after_verlet("", axes, 4000)
    found = springcheck.identify(0.35 * np.arange(1000), q[:1000], v=v[:1000], mass=1.0)
    assert (found.verdict, found.scheme, found.fits) == ("named", "andersen-after", True)
    assert found.omega == pytest.approx([np.sqrt(0.78)] * axes, rel=1e-9)
    few = springcheck.identify(1.05 * np.arange(len(q[::3])), q[::3], v=v[::3], mass=1.0)
    assert (few.verdict, few.fits) == ("not told apart", True)
    names = [one.scheme for one in few.candidates]
    assert names == ["andersen", "andersen-after-kick", "andersen-after"]


@pytest.mark.parametrize("kind", ["shot", "half", "size", "in time"])
def test_what_ends_a_step_and_is_not_drawn_anew_at_random_times_is_no_collision(kind: str) -> None:
    q, v = after_verlet(kind)
    found = springcheck.identify(0.35 * np.arange(1000), q, v=v, mass=1.0)
    assert "andersen-after" not in [one.scheme for one in found.candidates], found.statement
    assert not found.fits


def written(
    name: str, digits: str, step: float, frames: int = 1500
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, positions and velocities of two springs in a bath, as text of so many digits keeps them."""
    springs = WallSpring(i=np.array([0, 1]), k=np.array([K, 5.3]), at=np.zeros(2))
    bath = Bath(temperature=THERMAL, friction=RATE)
    made = driver.run(
        Scene(m=np.full(2, M), q=np.array([0.3, 0.1]), p=np.array([0.2, -0.4]), terms=(springs,), step=step,
              steps=frames, bath=bath, name="two"), f"own:{name}", seed=3,
    )  # fmt: skip
    t, q, v = (np.array([float(f"{x:{digits}}") for x in y.ravel()]) for y in (made.t, made.q, made.p / M))
    return t, q.reshape(made.q.shape), v.reshape(made.q.shape)


@pytest.mark.parametrize("digits", [".8f", ".6f", ".8g"])
def test_a_bath_at_rounded_times_is_named_and_is_no_exact_flow(digits: str) -> None:
    """The phase that rounded times turn was allowed in single precision: every scheme fitted the noise."""
    t, q, v = written("obabo", digits, 0.0724188843)
    found = identify(t, q, v=v, mass=M)
    assert "obabo" in [x.scheme for x in found.candidates]
    assert "exact" not in [x.scheme for x in found.candidates]


def test_a_bath_at_times_of_single_precision_is_named() -> None:
    t, q, v = (x.astype(np.float32).astype(float) for x in written("baoab", ".17g", 0.35))
    assert "baoab" in [x.scheme for x in identify(t, q, v=v, mass=M).candidates]


def test_noise_of_coordinates_alike_is_no_exchange_of_their_velocities() -> None:
    rng = np.random.default_rng(907)
    names, said = ("obabo", "baoab"), []
    for name in names:
        t, q, v = written(name, ".8g", 0.0311 * (1 + rng.random()), 900)
        said.append(identify(t, q, v=v, mass=M).statement)
    assert not any("changed places" in x for x in said)
    assert len(said) == len(names)


def test_a_friction_that_hardly_shows_is_no_number_and_kt_none_beside_it() -> None:
    """kT was 22 of its standard errors off, where its product with the friction alone is known."""
    spring = WallSpring(i=np.array([0]), k=np.array([K]), at=np.zeros(1))
    weak = Scene(
        m=np.array([M]), q=np.array([0.3]), p=np.array([0.2]), terms=(spring,), step=0.035, steps=400,
        bath=Bath(temperature=THERMAL, friction=0.003), name="weak",
    )  # fmt: skip
    made = driver.run(weak, "own:baoab", seed=3)
    said = " ".join(identify(made.t, made.q, v=made.p / M, mass=M).notes)
    assert "friction c/m too little known to tell kT from it" in said


def of_letters(word: str, frames: int = 1500, h: float = 0.5) -> tuple[np.ndarray, ...]:
    """Times, positions and velocities of a loop of one's own: letters of a splitting in another order."""
    rng, times = np.random.default_rng(3), {x: h / word.count(x) for x in "ABO"}
    x, v, states = 0.9, 0.4, np.empty((frames, 2))
    for i in range(frames):
        for letter in word:
            if letter == "A":
                x += times["A"] * v
            elif letter == "B":
                v -= times["B"] * K / M * (x - 0.7)
            else:
                e = np.exp(-RATE * times["O"])
                v = e * v + np.sqrt((1 - e * e) * THERMAL / M) * rng.standard_normal()
        states[i] = x, v
    return h * np.arange(frames), *states.T


@pytest.mark.parametrize(("word", "said"), [
    ("BAOBA", "by no scheme known here"), ("BABOA", "by no scheme known here"),
    ("ABO", "euler-maruyama or "), ("AOB", "euler-maruyama or "), ("ABOA", "aboba or aoboa or "),
    ("AOBA", "aboba or aoboa or "),
])  # fmt: skip
def test_letters_in_an_order_that_is_not_known_have_no_name_and_no_stiffness(word: str, said: str) -> None:
    """BAOBA was BAOA at half the stiffness to 12 digits, and ABO was Euler-Maruyama at twice the friction."""
    t, q, v = of_letters(word)
    found = identify(t, q, v=v, mass=M)
    assert (found.scheme, found.stiffness, found.fits) == (None, None, False)
    assert said in found.statement
    assert said.startswith("by no") or found.statement.endswith("or one that is not known here")


def test_a_collision_leaves_no_kick_undone() -> None:
    """OAB has Andersen's null vector of twice its stiffness."""
    t, q, v = of_letters("OAB")
    assert identify(t, q, v=v, mass=M).candidates == ()


def test_a_drift_before_the_kick_has_its_own_friction_and_temperature_beside_euler_maruyama() -> None:
    rng, h, x, v, states = np.random.default_rng(5), 0.31, 0.9, 0.4, []
    for _ in range(2000):
        x += h * v
        v += h * (-K / M * x - RATE * v) + np.sqrt(2 * RATE * THERMAL / M * h) * rng.standard_normal()
        states.append((x, v))
    q, v = np.array(states).T
    notes = identify(h * np.arange(2000), q, v=v, mass=M).notes
    (own,) = (x for x in notes if x.startswith("the same states, if x moves first"))
    for word, right in (("friction c/m", RATE), ("kT", THERMAL)):
        value, error = own.partition(f"{word} ")[2].partition(",")[0].split(" +- ")
        assert abs(float(value) - right) < 4 * float(error) < 0.5 * right


@pytest.mark.parametrize("letters", ["BAOA", "BAOAB"])
@pytest.mark.parametrize("kind", ["normal", "uniform", "signs"])
def test_draws_that_are_not_normal_are_noted(letters: str, kind: str) -> None:
    """Draws of +-1 were uniform, and those of collisions were of no shape at all."""
    rng, h, m, k, c = np.random.default_rng(4), 0.13, 1.7, 2.9, 0.9
    x, v, rows = 0.3, 0.1, []
    for _ in range(4000):
        rows.append((x, v))
        draw = {"normal": rng.normal(), "uniform": rng.uniform(-3, 3) / np.sqrt(3)}.get(kind, 1.0)
        draw *= rng.choice([-1, 1])
        hit = rng.random() < 0.15
        for one in "BAB" if letters == "collisions" else letters:
            if one == "A":
                x += h * v / letters.count("A") if letters != "collisions" else h * v
            elif one == "B":
                v -= h * k / m * x / (1 if letters == "BAOA" else 2)
            else:
                v = c * v + np.sqrt((1 - c * c) * 0.4) * draw
        if letters == "collisions" and hit:
            v = 0.6 * draw
    q, u = np.array(rows).T
    found = identify(h * np.arange(4000), q, v=u, mass=m)
    name = {"collisions": "andersen-after"}.get(letters, letters.lower())
    assert name in [one.scheme for one in found.candidates]
    notes = [note for note in found.notes if note.startswith("the draws are")]
    wanted = {"normal": [], "uniform": ["the draws are uniform, not normal"]}.get(kind)
    assert notes == wanted if wanted is not None else "not normal: third moment" in "".join(notes)
