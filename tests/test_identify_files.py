"""`springcheck identify` on files that another program wrote with plain h5py, and on a student's module."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

import springcheck
from springcheck.cli import main
from springcheck.identify import files
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES, step

pytestmark = pytest.mark.usefixtures("own_folder", "tried_here")

M, K, H = 3.7, 2.9, 0.31
FIELDS = {
    *("scheme", "aliases", "step", "stride", "omega", "stiffness", "velocity_offset", "determinant"),
    *("symplectic_defect", "defect_ulp", "precision", "fits", "nearest", "notes", "verdict", "candidates"),
}


def motion(name: str = "velocity-verlet", stride: int = 2) -> tuple[Floats, Floats, Floats]:
    """Times, positions and velocities (101, 1) by a scheme in double precision."""
    q, p = np.array([1.3]), np.array([0.9])
    qs, ps = [q], [p]
    for _ in range(100):
        for _ in range(stride):
            q, p = (
                np.asarray(x, dtype=np.float64)
                for x in step(SCHEMES[name], q, p, h=H, m=np.array([M]), force=lambda q, p: -K * q)
            )
        qs.append(q)
        ps.append(p)
    return np.asarray(np.arange(101) * (stride * H), dtype=np.float64), np.array(qs), np.array(ps) / M


def written(
    t: Floats, q: Floats, v: Floats, *, kind: str = "f8", units: tuple[str, str, str] = ("", "", "")
) -> str:
    """A file as a student writes it: no masses, no more than H5MD asks for."""
    path = Path("trajectory.h5")
    with h5py.File(path, "w") as file:
        file.create_group("h5md").attrs["version"] = [1, 1]
        for name, x, unit in (("position", q, units[0]), ("velocity", v, units[2])):
            group = file.create_group(f"particles/bead/{name}")
            group["step"] = np.arange(len(t))
            time = group.create_dataset("time", data=t)
            value = group.create_dataset("value", data=x.astype(kind)[:, :, None])
            if unit:
                time.attrs["unit"], value.attrs["unit"] = units[1], unit
    return str(path)


def document(capsys: pytest.CaptureFixture[str]) -> dict:
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def test_an_h5md_file_of_positions_alone_says_what_they_leave_open(
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(*motion())
    with h5py.File(path, "a") as file:
        del file["particles/bead/velocity"]
    assert main(["identify", path]) == 0
    assert "positions alone show a frequency" in " ".join(capsys.readouterr().out.split())
    assert main(["judge", path, "--scene", "spring", "--scheme", "velocity-verlet"]) == 2
    assert "holds no momenta or velocities" in capsys.readouterr().err


def test_a_file_of_single_precision_without_masses_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    path = written(*motion(), kind="f4")
    assert main(["identify", path, "--json"]) == 0
    found = document(capsys)
    assert set(found) >= FIELDS
    told = found["scheme"], found["stride"], found["precision"], found["fits"], found["stiffness"]
    assert told == ("velocity-verlet", 2, "double, stored in single", True, None)
    assert found["omega"] == pytest.approx(np.sqrt(K / M), rel=1e-7)
    assert found["step"] == pytest.approx(H)


@pytest.mark.parametrize("workers", ["1", "2"])
def test_many_files_are_answered_in_their_order(workers: str, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["a.h5md", "nothing.csv", "c.h5md"]
    for name, steps in ((names[0], 2), (names[2], 3)):
        Path(written(*motion("velocity-verlet", steps), kind="f4")).rename(name)
    if workers == "1":
        assert main(["identify", *names, "--workers", workers]) == 2
        shown = capsys.readouterr()
        assert shown.err.count("springcheck: ") == 1
        assert "nothing.csv" in shown.err
        assert shown.out.index("a.h5md") < shown.out.index("c.h5md")
    assert main(["identify", *names, "--workers", workers, "--json"]) == 2
    found = json.loads(capsys.readouterr().out)["files"]
    assert [one["file"] for one in found] == names
    assert [one.get("stride") for one in found] == [2, None, 3]
    assert "nothing.csv" in found[1]["error"]


def test_what_is_stated_is_held_against_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    path = written(*motion(), kind="f4")
    stated = ["--mass", str(M), "--step", str(H), "--json"]
    assert main(["identify", path, "--stiffness", str(K), *stated]) == 0
    assert document(capsys)["stiffness"] == pytest.approx(K, rel=1e-7)
    assert main(["identify", path, "--stiffness", "2.8", *stated]) == 1
    found = document(capsys)
    assert (found["scheme"], found["fits"]) == (None, False)
    assert "stiff" in found["statement"]


def test_text_of_six_digits_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    t, q, v = motion("semi-implicit-euler", 3)
    q, v = (np.array([[float(f"{x:.6g}")] for x in y.ravel()]) for y in (q, v))
    assert main(["identify", written(t, q, v), "--json"]) == 0
    found = document(capsys)
    assert (found["scheme"], found["stride"], found["precision"]) == (
        "semi-implicit-euler",
        3,
        "text, 6 digits",
    )
    assert found["velocity_offset"] == -0.5


@pytest.mark.parametrize(
    ("units", "length", "time", "velocity"),
    [
        (("nm", "ps", "nm ps-1"), 1, 1, 1),
        (("Angstrom", "fs", "Angstrom fs-1"), 10, 1000, 0.01),
        (("nm", "ps", "m s-1"), 1, 1, 1000),
        (("nm", "ps", "Angstrom fs-1"), 1, 1, 0.01),
    ],
)
def test_velocities_in_other_units_are_turned_into_those_of_position_and_time(
    units: tuple[str, str, str],
    length: float,
    time: float,
    velocity: float,
    capsys: pytest.CaptureFixture[str],
) -> None:
    t, q, v = motion()
    assert main(["identify", written(t * time, q * length, v * velocity, units=units), "--json"]) == 0
    found = document(capsys)
    assert (found["scheme"], found["stride"], found["precision"]) == ("velocity-verlet", 2, "double")
    assert found["omega"] * time == pytest.approx(np.sqrt(K / M), rel=1e-11)


@pytest.mark.parametrize(
    ("units", "said"),
    [
        (("sigma", "tau", "sigma tau-1"), False),
        (("sigma", "tau", "m s-1"), True),
        (("nm", "ps", "cells ps-1"), True),
        (("", "", ""), False),
    ],
)
def test_units_that_are_not_known_are_said_to_be_taken_as_consistent_unless_they_are(
    units: tuple[str, str, str], said: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["identify", written(*motion(), units=units), "--json"]) == 0
    found = document(capsys)
    q, t, v = units
    note = f"units of position {q!r}, time {t!r} and velocity {v!r} are taken as consistent"
    assert (found["scheme"], note in found["notes"]) == ("velocity-verlet", said)


@pytest.mark.parametrize(
    ("most", "number", "said"),
    [
        ("MOST_FRAMES", 60, "the first 60 frames were looked at"),
        ("MOST_FRAMES", 101, None),
        ("MOST_OSCILLATORS", 2, "2 of 3 moving coordinates were looked at"),
        ("MOST_OSCILLATORS", 3, None),
    ],
)
def test_what_a_file_has_beyond_what_is_looked_at_is_said_to_be_left_out(
    most: str,
    number: int,
    said: str | None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(files, most, number)
    t, q, v = motion()
    assert main(["identify", written(t, q * [1, 2, 3], v * [1, 2, 3]), "--json"]) == 0
    found = document(capsys)
    assert found["scheme"] == "velocity-verlet"
    assert [note for note in found["notes"] if "were looked at" in note] == ([said] if said else [])


def test_velocities_that_do_not_belong_to_the_positions_fit_nothing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    t, q, v = motion()
    assert main(["identify", written(t, q, 1.7 * v)]) == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "keeps areas and is symmetric in time" in text
    t, q, v = motion("semi-implicit-euler", 3)
    assert main(["identify", written(t, q, 1.7 * v)]) == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "not known here" in text or "velocities" in text


def test_the_report_keeps_to_80_columns_and_its_notes_hang(capsys: pytest.CaptureFixture[str]) -> None:
    t, _, _ = motion("rk4", 1)
    # a thousandth of the step's length: what RK4 leaves out is far below single precision
    slow = np.cos(0.01 * t)[:, None], -0.01 * np.sin(0.01 * t)[:, None]
    assert main(["identify", written(t, *slow, kind="f4")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(len(line) <= 80 for line in lines)
    text = " ".join(" ".join(lines).split())
    doubt = "or a scheme that is not known here"
    assert text.startswith(f"bead: several schemes, which the data cannot tell apart, {doubt} one of: exact;")
    assert "; rk4, 1 to 12" in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t, q, v: (t, 0 * q, 0 * v), "nothing moves"),
        (lambda t, q, v: (t[:4], q[:4], v[:4]), "too few"),
        (lambda t, q, v: (t**1.2, q, v), "constant interval"),
        (lambda t, q, v: (t, q, np.where(t[:, None] > 9, np.nan, v)), "not finite"),
    ],
)
def test_states_that_show_nothing_are_one_line_and_status_2(
    change, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(*change(*motion()))
    assert main(["identify", path]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error
    assert path in error


def test_an_adaptive_solver_of_our_own_store_is_called_that_and_is_no_failure(
    capsys: pytest.CaptureFixture[str], need: Callable[[str], None]
) -> None:
    need("sundials:adams")
    assert main(["run", "spring", "--method", "own:euler", "--method", "sundials:adams", "--quiet"]) == 0
    assert main(["identify", "spring.h5"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "own:euler: explicit-euler" in text
    assert "sundials:adams: adaptive solver, no fixed scheme to find" in text
    assert main(["identify", "spring.h5", "--trajectory", "sundials:adams", "--json"]) == 0
    found = document(capsys)
    assert (found["verdict"], found["scheme"], found["fits"]) == ("adaptive", None, False)
    assert main(["export", "spring.h5", "sundials:adams", "kept.h5md"]) == 0
    assert main(["identify", "kept.h5md"]) == 0
    # the label of a store of ours is what excuses it; the same numbers from elsewhere fit nothing
    springcheck.read("spring.h5")["sundials:adams"].save("away.csv")
    assert main(["identify", "away.csv"]) == 1
    assert "an adaptive solver or one of high order" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("method", ["own:aboba", "own:bbk"])
def test_a_thermostat_of_our_own_store_is_no_adaptive_solver(
    method: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of joined particles neither is found, and the store knows both for schemes of a fixed step."""
    assert main(["run", "bath-uneven", "--method", method, "--seed", "1", "--quiet"]) == 0
    assert main(["identify", "bath-uneven.h5", "--json"]) == 1
    assert document(capsys)["verdict"] == "none"


def test_a_trajectory_that_is_not_in_the_file_is_one_line_with_those_that_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = written(*motion())
    assert main(["identify", path, "--trajectory", "bead"]) == 0
    capsys.readouterr()
    assert main(["identify", path, "--trajectory", "atom"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "bead" in error


def test_a_stepper_of_a_module_is_judged_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    Path("student_4c1.py").write_text(
        "def kick_drift(q, p, h, force, mass):\n    p = p + h * force(q)\n    return q + h * p / mass, p\n\n"
        "def massless(q, p, h, force, mass):\n    p = p + h * force(q)\n    return q + h * p, p\n"
    )
    assert main(["identify", "--stepper", "student_4c1:kick_drift", "--json"]) == 0
    assert document(capsys)["scheme"] == "semi-implicit-euler"
    assert main(["identify", "--stepper", "student_4c1:massless", "--json"]) == 1
    assert "mass is left out" in document(capsys)["statement"]
    assert main(["identify", "--stepper", "student_4c1:none"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize(("stated", "status"), [(0.4, 0), (0.41, 1)])
def test_the_friction_of_the_command_line_is_held_against_the_states(
    stated: float, status: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    m, k, c, h = 1.3, 2.9, 0.4, 0.11
    q, v, rows = 1.1, 0.4, [(0.0, 1.1, 0.4)]
    for i in range(120):
        v = (v - h * k / m * q) * np.exp(-h * c / m)
        q = q + h * v
        rows.append((h * (i + 1), q, v))
    path = tmp_path / "x.txt"
    np.savetxt(path, rows, fmt="%.17g", header="t q v")
    assert main(["identify", str(path), "--mass", str(m), "--friction", str(stated)]) == status
    said = capsys.readouterr().out
    assert ("times the stated" in said) == bool(status)
    assert "emi-implicit" in said


def edited(change: Callable[[h5py.File], None]) -> str:
    """A store of ours that somebody has changed."""
    assert main(["run", "spring-uneven", "--method", "own:euler", "--quiet", "-o", "s.h5"]) == 0
    with h5py.File("s.h5", "r+") as file:
        change(file)
    return "s.h5"


def test_a_store_that_lost_its_mark_is_read_through_its_views(capsys: pytest.CaptureFixture[str]) -> None:
    file = edited(lambda file: file.attrs.__delitem__("format"))
    assert main(["identify", file, "--json"]) == 0
    assert document(capsys)["scheme"] == "explicit-euler"


def test_what_is_wrong_with_a_store_is_said_of_it_and_the_program_ends_in_order() -> None:
    file = edited(lambda file: file["parameters/own:euler"].attrs.__setitem__("frames", "x"))
    command = [sys.executable, "-m", "springcheck", "identify", file]
    done = subprocess.run(command, capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"frames" in done.stderr
    assert done.stderr.count(b"\n") == 1


def test_a_view_of_another_file_is_refused_and_the_program_ends_in_order() -> None:
    t, q, v = motion()
    file = written(t, q, v)
    with h5py.File(file, "r+") as opened:
        view = h5py.VirtualLayout((101, 1, 1), "<f8")
        view[:, :, 0] = h5py.VirtualSource("other.h5", "x", (101, 1), "<f8")
        del opened["particles/bead/position/value"]
        opened.create_virtual_dataset("particles/bead/position/value", view)
    command = [sys.executable, "-m", "springcheck", "identify", file]
    done = subprocess.run(command, capture_output=True, check=False)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"shows another file, other.h5" in done.stderr
    assert done.stderr.count(b"\n") == 1


def test_decimals_of_momenta_are_known_where_velocities_are_made_of_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """ASE's velocities are momenta over masses in other units, and seemed to be doubles of no scheme."""
    ase, extxyz = pytest.importorskip("ase"), pytest.importorskip("ase.io.extxyz")
    q, p = np.array([[0.83, -0.2, 0.4], [-0.47, 0.3, 0.1]]), np.array([[0.7, 0.1, -0.3], [0.2, -0.4, 0.5]])
    m, k, c, h = (np.array([[x], [y]]) for x, y in ((3.7, 9.2), (2.9, 4.1), (0.9, 1.3), (0.07, 0.07)))
    v, frames = p / m, []
    for i in range(401):
        atoms = ase.Atoms("He2", positions=q, masses=m[:, 0], info={"time": i * 0.07 / ase.units.fs})
        atoms.set_velocities(v)
        frames.append(atoms)
        v = v - h / 2 * k * q / m
        q = q + h / 2 * v
        v = np.exp(-c / m * h) * v
        q = q + h / 2 * v
        v = v - h / 2 * k * q / m
    with Path("x.xyz").open("w") as out:
        extxyz.write_xyz(out, frames)
    assert main(["identify", "x.xyz"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("x.xyz: langevin-middle, 1 step")
    assert "text, 8 decimals" in said


@pytest.mark.parametrize("name", ["velo", "Velocity", "v"])
def test_velocities_of_extended_xyz_are_taken(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`velo` was dropped without a word: positions alone."""
    q, v, m, k, h = 0.83, 0.7, 12.011, 4.1, 0.31
    with Path("x.xyz").open("w") as out:
        for i in range(61):
            out.write(f"1\nProperties=species:S:1:pos:R:3:{name}:R:3 time={i * h}\nC {q!r} 0 0 {v!r} 0 0\n")
            v -= h / 2 * k * q / m
            q += h * v
            v -= h / 2 * k * q / m
    assert main(["identify", "x.xyz"]) == 0
    assert " ".join(capsys.readouterr().out.split()).startswith("x.xyz: velocity-verlet,")


def test_frictions_of_one_scheme_are_no_choice_of_schemes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    q, v, rows = 0.3, 0.7, ["t,q,v"]
    for i in range(60):
        rows.append(f"{0.1 * i!r},{q!r},{v!r}")
        v -= 0.05 * 2.9 * q
        q += 0.1 * v
        v = (v - 0.05 * 2.9 * q) * (1 - 1e-3)
    (tmp_path / "a.csv").write_text("\n".join(rows))
    main(["identify", str(tmp_path / "a.csv")])
    said = capsys.readouterr().out
    assert said.startswith("a.csv: velocity-verlet, 1 step")
    assert "is an assumption" in said
    assert "one of:" not in said
