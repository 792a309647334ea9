"""Positions alone tell trace and determinant of a step: schemes that share these are said together."""

from __future__ import annotations

import json
from pathlib import Path

import MDAnalysis
import numpy as np
import pytest

from springcheck.cli import main
from springcheck.errors import IdentificationError
from springcheck.identify import identify
from springcheck.physics.arrays import Floats

K, M, H = 2.9, 1.3, 0.31
STOERMER = {"velocity-verlet", "semi-implicit-euler", "semi-implicit-euler-drift-kick", "position-verlet"}


def positions(name: str, frames: int = 200, every: int = 1, noise: float = 0.0) -> tuple[Floats, Floats]:
    """Times and positions of a scheme in plain floats."""
    q, v = 1.1, 0.4
    x = K / M * H * H
    kept = [q]
    rng = np.random.default_rng(3)
    for i in range(frames * every):
        if name == "velocity-verlet":
            v = v - H / 2 * K / M * q
            q = q + H * v
            v = v - H / 2 * K / M * q
        elif name == "explicit-euler":
            q, v = q + H * v, v - H * K / M * q
        elif name == "implicit-euler":
            v = (v - H * K / M * q) / (1 + x)
            q = q + H * v
        elif name == "damped":
            v = (v - H * K / M * q) * 0.97
            q = q + H * v
        elif name == "implicit-midpoint":
            old = v
            v = (v * (1 - x / 4) - H * K / M * q) / (1 + x / 4)
            q = q + H * (old + v) / 2
        q += noise * rng.standard_normal()
        if (i + 1) % every == 0:
            kept.append(q)
    return H * every * np.arange(frames + 1), np.array(kept)


@pytest.mark.parametrize(
    ("name", "every"), [("explicit-euler", 1), ("explicit-euler", 3), ("implicit-euler", 2)]
)
def test_a_scheme_that_changes_areas_is_named(name: str, every: int) -> None:
    t, q = positions(name, every=every)
    found = identify(t, q, mass=M, friction=0.0)
    assert (found.scheme, found.stride, found.fits) == (name, every, True)
    assert found.stiffness == pytest.approx((K,), rel=1e-9)


@pytest.mark.parametrize("every", [1, 3])
def test_schemes_of_the_same_positions_are_said_together_where_the_stiffness_is_known(every: int) -> None:
    t, q = positions("velocity-verlet", every=every)
    found = identify(t, q, mass=M, stiffness=K)
    assert (found.verdict, found.fits, found.stride) == ("not told apart", True, every)
    assert {x.scheme for x in found.candidates} == STOERMER
    midpoint = identify(*positions("implicit-midpoint"), mass=M, stiffness=K)
    assert (midpoint.scheme, midpoint.aliases) == ("implicit-midpoint", ("trapezoidal",))


def test_without_the_stiffness_all_that_keep_areas_are_left() -> None:
    found = identify(*positions("velocity-verlet"), mass=M)
    schemes = {x.scheme for x in found.candidates}
    assert schemes >= STOERMER | {"implicit-midpoint", "exact"}
    assert not schemes & {"explicit-euler", "implicit-euler"}
    assert found.fits
    assert "unknown number of steps" in found.statement


ANOTHER_SPRING = "a damped spring of another stiffness may have the same positions"


@pytest.mark.parametrize("friction", [None, 0.0], ids=str)
def test_a_damped_spring_may_have_the_positions_of_an_implicit_scheme_unless_no_friction_is_stated(
    friction: float | None,
) -> None:
    """It was said, and the friction asked for, where a friction of 0 was stated as well."""
    found = identify(*positions("implicit-euler"), mass=M, friction=friction)
    assert found.scheme == "implicit-euler"
    assert (ANOTHER_SPRING in found.notes) == (friction is None)
    more = "the stiffness, where known, the friction, or velocities"
    wanted = more if friction is None else "the stiffness, where known, or velocities"
    assert f"what would tell more: {wanted}" in found.notes


def test_a_stiffness_without_the_mass_is_said_to_be_of_no_use() -> None:
    found = identify(*positions("velocity-verlet"), stiffness=K)
    assert any(
        note.startswith("the stiffness says nothing of positions without the mass") for note in found.notes
    )


def test_a_coordinate_that_shows_no_force_is_counted_and_left_out() -> None:
    t, q = positions("velocity-verlet")
    found = identify(t, np.column_stack([q, 0.4 + 0.7 * t]), mass=M, stiffness=K)
    assert {x.scheme for x in found.candidates} == STOERMER
    assert "1 of 2 coordinates show no force, and are left out" in found.notes


def verlet(springs: list[float], every: int) -> tuple[Floats, Floats]:
    """Times and positions of oscillators of unlike stiffness, 150 frames by velocity Verlet."""
    k, q, v = np.array(springs), np.linspace(1.1, 0.7, len(springs)), np.linspace(0.4, -0.3, len(springs))
    kept = [q]
    for i in range(150 * every):
        v = v - H / 2 * k / M * q
        q = q + H * v
        v = v - H / 2 * k / M * q
        kept += [q] if i % every == every - 1 else []
    return H * every * np.arange(151), np.array(kept)


@pytest.mark.parametrize("springs", [[19.0], [2.9, 19.0], [19.0, 15.0]], ids=str)
def test_springs_that_turn_more_than_frames_show_keep_their_stated_stiffness(springs: list[float]) -> None:
    """A turn to the left and one to the right share their number of turns: one of them was lost, and explicit
    Euler with a friction of h k, which has the positions of velocity Verlet, was left."""
    for every in (3, 4, 5, 6, 7, 8):
        found = identify(*verlet(springs, every), mass=M, stiffness=np.array(springs))
        assert {(x.scheme, x.stride) for x in found.candidates} == {(x, every) for x in STOERMER}, every
        assert found.stiffness == pytest.approx(springs, rel=1e-9)


def test_a_held_force_is_no_explicit_euler_with_friction_where_frames_hide_turns() -> None:
    """Over 2 substeps it has the positions of explicit Euler with a friction of 3/4 h k."""
    k, q, v, kept = 7.4, 1.1, 0.4, []
    for i in range(600):
        kept += [q] if i % 6 == 0 else []
        held = -k / M * q
        for _ in range(2):
            v += H / 2 * held
            q += H / 2 * v
    found = identify(6 * H * np.arange(100), np.array(kept), mass=M, stiffness=k)
    assert (found.scheme, found.stride) == ("held-force", 6)


@pytest.mark.parametrize("every", range(1, 9))
def test_a_second_spring_of_the_same_phase_does_not_hide_the_stated_one(every: int) -> None:
    found = identify(*positions("implicit-midpoint", every=every), mass=M, stiffness=K)
    assert (found.scheme, found.stride) == ("implicit-midpoint", every)


@pytest.mark.parametrize("every", [1, 3])
def test_a_scheme_is_named_whose_friction_may_be_of_several_laws(every: int) -> None:
    """Of implicit midpoint, friction in the force and friction at the end of the step share positions."""
    x, q, v = K / M * H * H, 1.1, 0.4
    kept = [q]
    for i in range(150 * every):
        old = v
        v = (v * (1 - x / 4) - H * K / M * q) / (1 + x / 4)
        q += H * (old + v) / 2
        v *= 0.97
        kept += [q] if i % every == every - 1 else []
    found = identify(H * every * np.arange(151), np.array(kept), mass=M, stiffness=K)
    assert (found.scheme, found.stride, found.fits) == ("implicit-midpoint", every, True)
    assert found.statement.startswith("Implicit midpoint with friction,")
    assert len({x.law for x in found.candidates}) == 4
    assert any("the law is an assumption" in note for note in found.notes)


def test_a_spring_of_another_stiffness_does_not_fit() -> None:
    found = identify(*positions("velocity-verlet"), mass=M, stiffness=1.01 * K)
    assert (found.verdict, found.fits) == ("none", False)
    assert "another spring" in found.statement


@pytest.mark.parametrize(("name", "areas"), [("velocity-verlet", "are kept"), ("damped", "shrink")])
def test_what_areas_do_and_what_would_tell_more_is_said_with_the_mass_and_without(
    name: str, areas: str
) -> None:
    without = identify(*positions(name))
    assert f"areas {areas}" in without.statement
    assert any(note.startswith("what would tell more: mass and stiffness") for note in without.notes)
    known = identify(*positions(name), mass=M)
    assert any(note.startswith("what would tell more: the stiffness") for note in known.notes)
    stated = identify(*positions(name), mass=M, stiffness=K)
    assert not any(note.startswith("what would tell more") for note in stated.notes)
    if name == "damped":
        assert any("every scheme has a spring that fits" in note for note in known.notes)


def test_damped_motion_names_no_scheme() -> None:
    found = identify(*positions("damped"), mass=M)
    assert found.verdict == "not told apart"
    assert "areas shrink" in found.statement
    assert not identify(*positions("damped"), mass=M, friction=0.0).fits


def written(q: Floats, digits: int) -> Floats:
    return np.array([float(f"{x:.{digits}g}") for x in q])


def test_an_orbit_written_to_few_digits_names_a_scheme_that_neighbouring_frames_do_not() -> None:
    """Implicit midpoint with friction at the end of each step, on its stated spring."""
    k, h, q, v, kept = 2.9, 0.05, 1.1, 0.4, [1.1]
    x = k / M * h * h
    for _ in range(100):
        old = v
        v = (v * (1 - x / 4) - h * k / M * q) / (1 + x / 4)
        q += h * (old + v) / 2
        v *= 0.99
        kept.append(q)
    found = identify(h * np.arange(101), written(np.array(kept), 6), mass=M, stiffness=k)
    assert (found.scheme, found.fits, found.precision) == ("implicit-midpoint", True, "text, 6 digits")


@pytest.mark.parametrize("form", ["text", "single"])
def test_positions_of_few_digits_under_a_force_that_is_not_linear_are_no_scheme_s(form: str) -> None:
    q, v, kept = 1.1, 0.4, []
    for _ in range(200):
        kept.append(q)
        v -= H * K / M * (q + 0.02 * q**3)
        q += H * v
    x = np.array(kept)
    found = identify(H * np.arange(200), written(x, 6) if form == "text" else np.float32(x), mass=M)
    assert not found.fits
    assert found.statement.startswith("The positions are not those of one linear scheme")


@pytest.mark.parametrize("noise", [1e-13, 1e-6])
def test_noise_is_no_scheme(noise: float) -> None:
    found = identify(*positions("velocity-verlet", noise=noise), mass=M)
    assert (found.verdict, found.fits) == ("none", False)


def test_positions_that_show_nothing_are_refused() -> None:
    t, q = positions("velocity-verlet")
    for bad, said in (
        (t, "no force"),
        (0 * q + 1, "nothing moves"),
        (np.exp(-t) + np.exp(-t / 9), "does not turn"),
    ):
        with pytest.raises(IdentificationError, match=said):
            identify(t, bad)
    with pytest.raises(IdentificationError, match="too few"):
        identify(t[:7], q[:7])


def test_a_table_of_two_columns_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    np.savetxt("x.txt", np.stack(positions("velocity-verlet"), axis=1), fmt="%.17g", header="t q")
    stated = ["--mass", str(M), "--stiffness", str(K)]
    assert main(["identify", "x.txt", *stated]) == 0
    assert "positions alone" in capsys.readouterr().out
    assert main(["identify", "x.txt", "--mass", str(M), "--stiffness", str(2 * K)]) == 1
    # what needs velocities still says so
    assert main(["judge", "x.txt", "--scene", "spring", "--scheme", "rk4"]) == 2
    assert "holds no momenta or velocities" in capsys.readouterr().err


@pytest.mark.campaign
@pytest.mark.usefixtures("tried_here")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("ending", ["xtc", "dcd"])
@pytest.mark.parametrize("name", ["velocity-verlet", "explicit-euler"])
def test_files_of_positions_are_read_to_their_precision(
    ending: str,
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    t, q = positions(name, 60)
    universe = MDAnalysis.Universe.empty(1, trajectory=True)
    universe.dimensions = [90, 90, 90, 90, 90, 90]
    with MDAnalysis.Writer(f"x.{ending}", 1, **({"dt": H} if ending == "dcd" else {})) as writer:
        for time, x in zip(t, q, strict=True):
            # in nm, whose thousandths XTC keeps
            universe.atoms.positions = 10 * x * np.array([[0.6, 0.0, 0.8]])
            universe.trajectory.ts.time = time
            writer.write(universe.atoms)
    stated = ["--mass", str(M), "--stiffness", str(K), "--friction", "0", "--json"]
    assert main(["identify", f"x.{ending}", *stated]) == 0
    found = json.loads(capsys.readouterr().out)
    schemes = {one["scheme"] for one in found["candidates"]}
    assert schemes == (STOERMER if name == "velocity-verlet" else {name})
    assert main(["identify", f"x.{ending}", "--mass", str(M), "--stiffness", str(1.1 * K)]) == 1


def test_steps_that_follow_an_accumulated_clock_are_one_linear_scheme_of_positions_too() -> None:
    """RK2, five steps to a frame: each step is as long as two of its times are apart."""
    h, k, m, q, v = 0.005087067370272234, 88.64693547804737, 0.01770958188009272, 0.6247790782384479, -315.5
    t = np.concatenate([[0.0], np.cumsum(np.full(500, h))])
    kept = [q]
    for i, s in enumerate(np.diff(t).tolist()):
        x, u = q + s / 2 * v, v - s / 2 * (k * q / m)
        q, v = q + s * u, v - s * (k * x / m)
        kept += [q] if i % 5 == 4 else []
    found = identify(t[::5], np.array(kept), mass=m)
    assert (found.scheme, found.stride) == ("rk2-midpoint", 5)
