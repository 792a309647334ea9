"""Files at temperature name themselves: by what no noise reaches, to rounding, and by likelihood."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import driver
from springcheck.bath import THERMOSTATS, Law
from springcheck.cli import main
from springcheck.identify import identify
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


def test_gromacs_sd_names_itself_in_single_precision() -> None:
    """Frames of GROMACS 2022.5: BAOA, its velocities half a step early (`validation/gromacs_sd.py`)."""
    path = Path(__file__).parents[1] / "data" / "reference" / "thermostats" / "gromacs-sd.csv"
    named: Any = springcheck.identify(path, mass=12.011)
    (found,) = named.values()
    assert (found.verdict, found.scheme, found.velocity_offset) == ("named", "baoa", -0.5)
    assert found.omega[0] == pytest.approx(np.sqrt(20000 / 12.011), rel=2e-5)
    assert found.friction[0] == pytest.approx(10, rel=0.5)


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
    assert not identify(h * np.arange(400), q, v=v).fits


ALTERNATING: dict[str, Callable[[int], float]] = {
    "alternating": lambda i: 0.3 * (-1) ** i,
    "in pairs": lambda i: 0.3 * (-1) ** (i // 2),
    "in fives": lambda i: 0.3 * (-1) ** (i // 5),
    "of changing size": lambda i: 0.3 * (-1) ** i * (1 + 0.3 * np.sin(0.7 * i)),
    "at some steps": lambda i: 0.3 * (-1) ** i * (1 + 0.3 * np.sin(0.7 * i)) * ((i**3 + 3 * i) % 11 < 4),
    "by the sign of a wave": lambda i: 0.3 * np.sign(np.cos(1.3 * i)),
}


@pytest.mark.parametrize("at", ["start", "half", "end"])
@pytest.mark.parametrize("name", ALTERNATING)
def test_forces_that_alternate_are_no_draws(name: str, at: str) -> None:
    """A push at every step leaves the combination free of noise that a collision leaves, or a factor of all
    momenta."""
    h, q, v, rows, frames = 0.35, 0.7, -1.1, [], 400
    for i in range(frames):
        rows.append((q, v))
        push = ALTERNATING[name](i)
        v += push * (at == "start") - h / 2 * K / M * q + push * (at == "half")
        q += h * v
        v += push * (at == "end") - h / 2 * K / M * q
    q, v = np.array(rows).T
    assert not identify(h * np.arange(frames), q, v=v).candidates
    assert "thermostat" not in identify(h * np.arange(frames), q, v=v).statement


def test_of_schemes_that_a_count_tells_apart_one_entry_is_said() -> None:
    one = Candidate(scheme="", aliases=(), stride=1, step=0.1, turns=0, omega=(), stiffness=None, friction=())
    names = [("baoab", 1), ("obabo", 2), ("obabo", 3)]
    found = nothing(
        (Explanation(cause="", remedy="", misfit=0.0),), determinant=(), symplectic_defect=0.0,
        defect_ulp=0.0, notes=[],
    )  # fmt: skip
    several = replace(found, candidates=tuple(replace(one, scheme=x, stride=n) for x, n in names))
    assert several.choice == ["baoab", "obabo, 2 to 3 steps per frame"]


@pytest.mark.parametrize("often", [0.1, 0.3])
@pytest.mark.parametrize("kind", ["shot", "collision"])
def test_shots_of_noise_that_add_to_a_momentum_are_no_collisions_that_draw_it_anew(
    kind: str, often: float
) -> None:
    """Both act in some steps alone, by what is drawn: shots were said to be Andersen's thermostat."""
    rng, m, k, h, q, v, rows = np.random.default_rng(5), 2.3, 1.7, 0.35, 1.0, 0.3, []
    for _ in range(1000):
        rows.append((q, v))
        if rng.random() < often:
            v = 0.3 * rng.normal() + v if kind == "shot" else rng.normal()
        v -= h / 2 * k / m * q
        q += h * v
        v -= h / 2 * k / m * q
    x, u = np.array(rows).T
    found = identify(h * np.arange(1000), x, v=u, mass=m)
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


def test_a_friction_that_hardly_shows_is_no_number_and_kt_none_beside_it() -> None:
    """kT was 22 of its standard errors off, where its product with the friction alone is known."""
    spring = WallSpring(i=np.array([0]), k=np.array([K]), at=np.zeros(1))
    weak = Scene(
        m=np.array([M]), q=np.array([0.3]), p=np.array([0.2]), terms=(spring,), step=0.035, steps=400,
        bath=Bath(temperature=THERMAL, friction=0.003), name="weak",
    )  # fmt: skip
    made = driver.run(weak, "own:baoab", seed=3)
    said = " ".join(identify(made.t, made.q, v=made.p / M, mass=M).notes)
    assert "friction c/m too uncertain to determine kT" in said


def test_two_oscillators_in_one_bath_are_named_and_joined_ones_are_not() -> None:
    m, k, said = np.array([0.7, 2.9]), np.array([1.3, 2.1]), []
    for joint in (0.0, 1.7):
        walls = WallSpring(i=np.arange(2), k=k, at=np.zeros(2))
        spring = Spring(a=np.array([0]), b=np.array([1]), k=np.array([joint]), rest=np.zeros(1))
        pair = Scene(
            m=m, q=np.array([0.4, -0.3]), p=np.array([0.2, 0.5]), step=0.3, steps=1000, name="pair",
            terms=(walls, spring) if joint else (walls,), bath=Bath(temperature=0.8, friction=1.1),
        )  # fmt: skip
        made = driver.run(pair, "own:baoa", seed=5)
        said.append(identify(made.t, made.q, made.p, mass=m))
    assert (said[0].scheme, said[0].fits, said[1].scheme, said[1].fits) == ("baoa", True, None, False)
    assert sorted(said[0].omega) == pytest.approx(sorted(np.sqrt(k / m)), rel=1e-9)


def test_frames_several_steps_apart_have_no_name() -> None:
    t, q, v = run("baoab", 3000)
    found = identify(t[::3], q[::3], v=v[::3], mass=M)
    assert found.scheme is None
    assert not found.fits
