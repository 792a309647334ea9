"""`judge FILE` says what it took from the file in place of the scene, and fails what is none of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import clean
import springcheck
import textbook as steppers
from springcheck import driver, schemes
from springcheck.cli import file, main
from springcheck.errors import StoreError
from springcheck.formats.digits import fixed, roundoff
from springcheck.physics import scenefile, terms
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory, Verdict

SCENE = scenefile.load_scene("spring-uneven")
RUN = driver.run(SCENE, "own:velocity-verlet")


def verdicts(
    tmp_path: Path, table: Floats, header: str = "t,q,p"
) -> tuple[dict[str, Verdict], tuple[str, ...]]:
    np.savetxt(tmp_path / "a.csv", table, fmt="%.17g", delimiter=",", header=header, comments="")
    found = file.judge(tmp_path / "a.csv", scene=SCENE, scheme="velocity-verlet")
    return {v.check: v for v in found.verdicts}, found.notes


def table(**off: float) -> Floats:
    """The right run's times, position and momentum (f, 3)."""
    t = RUN.t * (1 + off.get("clock", 0.0))
    q, p = RUN.q * (1 + off.get("start", 0.0)), RUN.p * (1 + off.get("start", 0.0))
    return np.c_[t, q, p]


@pytest.mark.parametrize("name", ["three frames", "every second frame", "the whole"])
def test_frames_that_the_scene_does_not_ask_for_are_no_fact_of_its_grid(tmp_path: Path, name: str) -> None:
    rows = {"three frames": slice(3), "every second frame": slice(None, None, 2), "the whole": slice(None)}[
        name
    ]
    found, notes = verdicts(tmp_path, table()[rows])
    assert found["step-defect"].passed is True
    assert found["grid"].passed is (True if name == "the whole" else None)
    assert bool(notes) is (name == "every second frame")
    if name != "the whole":
        assert f"the scene asks for {SCENE.frames}" in found["grid"].reason
        assert "any other value" not in found["grid"].reason


def test_twice_as_many_steps_are_none_either(tmp_path: Path) -> None:
    run = driver.run(replace(SCENE, steps=2 * SCENE.steps), "own:velocity-verlet")
    found, _ = verdicts(tmp_path, np.c_[run.t, run.q, run.p])
    assert found["grid"].passed is None


def test_a_part_of_the_scene_passes_where_that_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    np.savetxt(tmp_path / "a.csv", table()[:3], header="t,q,p", delimiter=",", comments="", fmt="%.17g")
    given = ["judge", str(tmp_path / "a.csv"), "--scene", SCENE.name, "--scheme", "velocity-verlet"]
    assert main(given) == 2
    said = capsys.readouterr().out
    assert said.startswith("NOT PASSED")
    assert f"2 of {SCENE.steps} steps" in said
    assert main([*given, "--partial"]) == 0
    assert f"2 of {SCENE.steps} steps" in capsys.readouterr().out
    assert main([*given, "--step", repr(2 * SCENE.step)]) == 2
    assert "--step" in capsys.readouterr().err


def test_a_start_that_is_a_little_off_is_told(tmp_path: Path) -> None:
    found, notes = verdicts(tmp_path, table(start=9e-10))
    assert found["start"].passed is None
    assert "of the amplitude off" in found["start"].reason
    assert notes


def test_a_clock_passes_where_it_adds_up_its_steps_and_not_where_it_is_another(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="is due"):
        verdicts(tmp_path, table(clock=9e-10))
    added = table()
    added[1:, 0] = np.cumsum(np.full(len(added) - 1, SCENE.step))
    assert np.any(added[:, 0] != RUN.t)
    assert verdicts(tmp_path, added)[0]["step-defect"].passed is True


def test_a_motion_beside_its_line_fails(tmp_path: Path) -> None:
    header = "t,q0,q1,q2,p0,p1,p2"
    for beside, passed in ((1e-7, False), (0.0, None)):
        none = np.zeros((len(RUN.t), 2))
        rows = np.c_[RUN.t, RUN.q, none, RUN.p, none]
        rows[:, 2] = beside * np.cos(np.arange(len(rows))) * np.max(np.abs(RUN.q))
        found, notes = verdicts(tmp_path, rows, header)
        assert found["line"].passed is passed
        assert "motion along" in notes[0]


def test_what_is_no_number_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = table()
    rows[-1, 1] = np.nan
    with pytest.raises(StoreError, match=r"row 201 (are|of)[^\n]*finite"):
        verdicts(tmp_path, rows)
    arguments = ["judge", str(tmp_path / "a.csv"), "--scene", "spring-uneven", "--scheme", "velocity-verlet"]
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "LinAlgError" not in said


@pytest.mark.parametrize("label", ["openmm:verlet", "openmm:verlet@OpenCL-single"])
def test_a_store_is_judged_by_the_arithmetic_that_its_run_declared(
    tmp_path: Path, label: str, need: Callable[[str], None]
) -> None:
    need(label)
    store = tmp_path / "run.h5"
    assert main(["run", "spring", "--method", label, "-o", str(store), "--quiet"]) == 0
    found = file.judge(store, scene="spring", scheme="velocity-verlet", trajectory=label)
    assert found.status == 0, found
    assert any("rebuilt from positions" in note for note in found.notes)
    other = file.judge(store, scene="spring", scheme="semi-implicit-euler", trajectory=label)
    assert other.status == 1, "what an engine declares excuses no other scheme"


@pytest.mark.parametrize("digits", ["%.17g", "%.5f"])
def test_numbers_that_no_step_rounds_are_no_sign_of_a_better_arithmetic(tmp_path: Path, digits: str) -> None:
    """Steps of 1/8 at a speed of 3/4: few digits are all there are."""
    t, one = 0.125 * np.arange(41), np.ones(1)
    scene = clean.scene(one, (clean.walls(0 * one, 0 * one),), 0.5 * one, 0.75 * one, step=0.125, steps=40)
    states = np.c_[t, 0.5 + 0.75 * t, np.full(41, 0.75)]
    np.savetxt(tmp_path / "a.csv", states, fmt=digits, delimiter=",", header="t,q,p", comments="")
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet").verdicts
    assert [v for v in found if v.passed is False] == []
    assert next(v for v in found if v.check == "step-defect").passed is True


def test_nine_digits_of_single_precision_are_judged_and_a_clock_beside_them_is_not(tmp_path: Path) -> None:
    def written(rows: Floats) -> Path:
        np.savetxt(tmp_path / "a.csv", rows, fmt="%.9g", delimiter=",", header="t,q,p", comments="")
        return tmp_path / "a.csv"

    found = file.judge(written(np.float32(table())), scene=SCENE, scheme="velocity-verlet")
    assert not [v.check for v in found.verdicts if v.passed is False]
    late = table()
    late[7:, 0] += 1e-5
    with pytest.raises(StoreError, match="row 8 is at t = "):
        file.judge(written(np.float32(late)), scene=SCENE, scheme="velocity-verlet")


def test_what_does_not_apply_is_said_once_for_each_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each check that did not apply had a row of its own, with no verdict and no value in it."""
    run = driver.run(scenefile.load_scene("spring"), "own:velocity-verlet")
    np.savetxt(tmp_path / "a.txt", np.column_stack([run.t, run.q, run.p]), header="t q p", fmt="%.17g")
    given = ["judge", str(tmp_path / "a.txt"), "--scene", "spring", "--scheme", "velocity-verlet"]
    assert main(given) == 0
    assert len(capsys.readouterr().out.splitlines()) <= 3
    assert main([*given, "--verdicts"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "Not applicable: drive: no force depends on the time" in said
    rows = [line.split()[0] for line in said if " passed " in line]
    assert "step-defect" in rows
    assert "drive" not in rows
    assert f"by {len(rows)} checks" in said[0]


H, FORCE = SCENE.step, SCENE.system.force(RUN.q, RUN.p).astype(np.float64)
M = float(SCENE.m[0])
T, Q, P = table().T


@pytest.mark.parametrize(
    ("header", "columns", "said"),
    [
        ("t,q,v", (T, 100 * Q, 100 * P / M), "positions are 100 times the scene's, and velocities 100 times"),
        ("t,q,p", (T, 10 * Q, 1000 * P), "positions are 10 times the scene's, and momenta 1000 times"),
        ("t,q,p", (T, Q, P / M), "name their columns v"),
        ("t,q,v", (T, Q, P), "its velocities are the scene's times the masses; name momenta p"),
        ("t,q,p", (T, Q, M * P), "its momenta are the scene's times the masses"),
        ("t,q,p", (T, Q, P - H / 2 * FORCE[:, 0]), "its momenta are half a kick before the scene's"),
        ("t,q,p", (T, Q, P + H / 2 * FORCE[:, 0]), "its momenta are half a kick after the scene's"),
        ("t,q,p", (T, Q + 0.01, P), r"q\[0\] is 0.31 there, and 0.3 in the scene"),
        # near the start a unit, a mass or a kick explains nothing
        ("t,q,p", (T, Q, P * (1 + 1e-6)), r"p\[0\] is 0.7000007 there, and 0.7 in the scene"),
        ("t,q,p", (T, Q + 1e-8, P), r"q\[0\] is 0.30000001 there, and 0.3 in the scene"),
    ],
)  # fmt: skip
def test_a_start_that_is_not_the_scenes_is_named(
    tmp_path: Path, header: str, columns: tuple[Floats, ...], said: str
) -> None:
    with pytest.raises(StoreError, match=f"off the start of spring-uneven: .*{said}"):
        verdicts(tmp_path, np.column_stack(columns), header)


def test_a_start_that_is_nearly_right_is_no_matter_of_a_mass_of_one(tmp_path: Path) -> None:
    """Of a mass of 1 momenta 1e-8 off were said to be divided by the mass."""
    rows = np.array([[0.0, 0.0, 1 + 1e-8], [0.1, 0.1, 1.0]])
    np.savetxt(tmp_path / "a.csv", rows, fmt="%.17g", delimiter=",", header="t,q,p", comments="")
    with pytest.raises(StoreError, match=r"p\[0\] is 1.00000001 there, and 1 in the scene"):
        file.judge(tmp_path / "a.csv", scene="spring", scheme="velocity-verlet")


def test_momenta_and_velocities_that_contradict_the_mass_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"p/v = 1, and the mass in scene spring-uneven is 3\.7"):
        verdicts(tmp_path, np.c_[T, Q, P, P], "t,q,v,p")
    found, _ = verdicts(tmp_path, np.c_[T, Q, P / M, P], "t,q,v,p")
    assert not [v for v in found.values() if v.passed is False]


def test_energies_under_capitals_are_no_times_and_no_velocities(tmp_path: Path) -> None:
    kinetic, potential = P**2 / 2 / M, 1.45 * Q**2
    rows = np.c_[T, Q, P, kinetic + potential, kinetic, potential]
    found, notes = verdicts(tmp_path, rows, "t,q,p,E,T,V")
    assert not [v for v in found.values() if v.passed is False]
    assert any(note.startswith("T, V left out") for note in notes)
    with pytest.raises(StoreError, match=r"columns of times: 2 \(t, time\).*--columns"):
        verdicts(tmp_path, np.c_[T, T, Q, P], "t,time,q,p")


def test_single_precision_in_the_digits_of_double_is_judged_as_single(tmp_path: Path) -> None:
    rows = np.c_[T, np.float32(Q), np.float32(P)]
    found, notes = verdicts(tmp_path, rows)
    assert not [v for v in found.values() if v.passed is False]
    assert "numbers are written to 6e-08, and judged to that" in notes
    np.savez(tmp_path / "a.npz", t=T, q=np.float64(np.float32(Q)), p=np.float64(np.float32(P)))
    assert file.judge(tmp_path / "a.npz", scene=SCENE, scheme="velocity-verlet").status == 0
    # what is larger than its roundings is seen all the same
    rows[1:, 1] *= 1 + 1e-5
    rows[:, 1] = np.float32(rows[:, 1])
    assert any(v.passed is False for v in verdicts(tmp_path, rows)[0].values())


def test_a_scheme_of_a_bath_is_refused_where_there_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, mine, text = tmp_path / "a.csv", tmp_path / "mine.py", tmp_path / "mine.toml"
    text.write_text(SCENE.to_toml())
    np.savetxt(path, np.c_[T, Q, P], fmt="%.17g", delimiter=",", header="t,q,p", comments="")
    mine.write_text("def step(q, p, h, force, mass):\n    return q, p\n")
    assert main(["judge", str(path), "--scene", str(text), "--scheme", "baoab"]) == 2
    assert "baoab needs a heat bath, and scene mine has none: add [bath] to it" in capsys.readouterr().err
    store = tmp_path / "s.h5"
    assert main(["run", "spring", "--stepper", f"{mine}:step", "--scheme", "baoab", "-o", str(store)]) == 2
    assert "for scenes with a bath" in capsys.readouterr().err
    assert not store.with_suffix(".h5.parts").exists()


def test_identify_says_which_mass_it_took(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    np.savetxt(path, np.c_[T, Q, P, P], fmt="%.17g", delimiter=",", header="t,q,v,p", comments="")
    main(["identify", str(path)])
    assert "the mass 1 was taken from momenta over velocities" in " ".join(capsys.readouterr().out.split())
    main(["identify", str(path), "--mass", "3.7"])
    said = " ".join(capsys.readouterr().out.split())
    assert "momenta over velocities are 1, and the mass is stated as 3.7" in said
    main(["identify", str(path), "--mass", "1"])
    assert "momenta over velocities" not in " ".join(capsys.readouterr().out.split())
    np.savetxt(path, np.c_[T, Q, P, 1 + 0 * T], fmt="%.17g", delimiter=",", header="t,q,p,m", comments="")
    for mass, told in (("3.7", True), ("1", False)):
        main(["identify", str(path), "--mass", mass])
        said = " ".join(capsys.readouterr().out.split())
        assert ("the file has mass 1, and the stated one, 3.7, was taken" in said) == told


def test_a_table_of_an_adaptive_solver_is_no_failure_and_cannot_be_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], need: Callable[[str], None]
) -> None:
    """CVODE failed `grid`, since its tolerance "is None": a table has no place for it."""
    need("sundials:adams")
    table = driver.run(scenefile.load_scene("spring-uneven"), "sundials:adams").save(tmp_path / "a.csv")
    given = ["judge", str(table), "--scene", "spring-uneven", "--scheme", "adams", "--verdicts"]
    assert main(given) == 2
    text = " ".join(capsys.readouterr().out.split())
    assert text.startswith("NOT JUDGED")
    assert "tolerance: the file does not say what tolerance its solver has" in text


PULLED = clean.walls(np.array([2.9, 4.1]), np.zeros(2))
DECIMALS = {
    "verlet": ("velocity-verlet", (), 1),
    "every third frame": ("velocity-verlet", (), 3),
    "joined": (
        "velocity-verlet",
        (terms.Spring(a=PULLED.i[:1], b=PULLED.i[1:], k=np.array([3.1]), rest=np.array([0.2])),),
        1,
    ),
    "damped": ("langevin-middle", (terms.Damping(i=PULLED.i, c=np.array([0.9, 2.0])),), 1),
    "implicit": ("implicit-midpoint", (), 1),
    "quartic": ("rk4", (terms.Quartic(i=PULLED.i, b=np.ones(2), at=np.zeros(2)),), 1),
}


def in_text(path: Path, run: Trajectory, of_q: str, of_v: str, m: Floats, wrong: float = 0.0) -> Path:
    """A table of positions and velocities in these formats; one position is off in one frame."""
    rows = np.c_[run.t, run.q, run.p / m]
    rows[30, 1] += wrong
    n = len(m)
    names = ",".join(["t", *(f"q{i}" for i in range(n)), *(f"v{i}" for i in range(n))])
    np.savetxt(path, rows, fmt=["%.17g"] + n * [of_q] + n * [of_v], delimiter=",", header=names, comments="")
    return path


def failing(path: Path, scene: Scene, scheme: str) -> list[str]:
    found = file.judge(path, scene=scene, scheme=scheme).verdicts
    return [v.reason for v in found if v.passed is False and v.check in ("step-defect", "noise-direction")]


@pytest.mark.parametrize("name", DECIMALS)
def test_decimals_are_half_a_unit_off_however_small_a_number_is(tmp_path: Path, name: str) -> None:
    """Relative to each number, right files failed at turning points, by 2 to 10 times what was allowed."""
    scheme, more, every = DECIMALS[name]
    m, q, p = np.array([3.7, 1.3]), np.array([0.83, -0.47]), np.array([0.7, 0.2])
    scene = clean.scene(m, (PULLED, *more), q, p, step=0.07, steps=60 * every, every=every)
    run = steppers.record(scene, schemes.scheme(scheme), steppers.textbook(scene, schemes.scheme(scheme)))
    for of_v in ("%.10f", "%.17g"):
        assert failing(in_text(tmp_path / "a.csv", run, "%.10f", of_v, m), scene, scheme) == []
        assert failing(in_text(tmp_path / "a.csv", run, "%.10f", of_v, m, 4e-10), scene, scheme), of_v
    # of few digits the other numbers have a relative rounding beside it
    assert failing(in_text(tmp_path / "a.csv", run, "%.10f", "%.9e", m), scene, scheme) == []


@pytest.mark.parametrize("scheme", ["baoab", "gj-i"])
def test_decimals_of_a_bath_are_half_a_unit_off(tmp_path: Path, scheme: str) -> None:
    scene = replace(scenefile.load_scene("bath-spring"), steps=100, every=1)
    run = driver.run(scene, f"own:{scheme}")
    assert failing(in_text(tmp_path / "a.csv", run, "%.9f", "%.9f", scene.m), scene, scheme) == []
    wrong = in_text(tmp_path / "a.csv", run, "%.9f", "%.9f", scene.m, 5e-9)
    assert failing(wrong, scene, scheme)


def test_a_program_in_single_precision_may_print_decimals_that_hold_its_numbers(tmp_path: Path) -> None:
    rows = np.c_[RUN.t, np.float32(RUN.q), np.float32(RUN.p)].astype(np.float64)
    for digits, state in (("%.6f", 2.0**-24), ("%.10f", 2.0**-24), ("%.17g", None)):
        np.savetxt(tmp_path / "a.csv", rows, fmt=digits, delimiter=",", header="t,q,p", comments="")
        found = file.states_in(tmp_path / "a.csv").fixed
        assert (found and found.beside) == state
        assert failing(tmp_path / "a.csv", SCENE, "velocity-verlet") == []


def test_which_columns_have_fixed_decimals() -> None:
    def of(*cells: str) -> tuple[float, float, float] | None:
        found = fixed([[x, y] for x, y in zip(cells[::2], cells[1::2], strict=True)], [0], [1])
        return found and (found.q, found.v, found.beside)

    assert of("0.12345678", "1.00", "-0.02345678", "0.25", "2.10000000", "2.50") == (5e-9, 5e-3, 2.0**-53)
    # the start is written otherwise, and a number that does not change has the decimals of those that do
    assert of("0.5", "0.00000000", "0.49876543", "0.00000000", "0.01234567", "0.00000000") == (
        5e-9, 5e-9, 2.0**-53,
    )  # fmt: skip
    assert of("0.5", "0.0", "0.49876543", "0.0", "0.01234567", "0.0") == (5e-9, 0.0, 2.0**-53)
    # of one decade they may be digits
    assert of("0.5", "1", "0.4987654", "2", "0.1234567", "3") == (5e-8, 0.5, 0.5)
    # digits are relative, and so are exponents
    assert of("0.12345678", "1", "1.2345678", "2", "0.012345678", "3e-3") is None
    assert of("1.2345678e-01", "1e0", "2.2345678e+00", "2e1", "1.2345678e+01", "3e0") is None
    full = [repr(x) for x in np.random.default_rng(0).normal(size=40).tolist()]
    assert of(*full) is None
    assert of("-0.0", "0.0", "0.0", "-0.0", "0.0", "0.0") is None


def test_energies_in_a_table_are_said_to_be_left_unread(tmp_path: Path) -> None:
    """Half of them was missing, and `the scene keeps no energies` was the answer."""
    scene = replace(SCENE, quantities=("q", "p", "energy"))
    wrong = 2 * scene.system.energy(RUN.q, RUN.p)
    np.savetxt(tmp_path / "a.csv", np.c_[table(), wrong], delimiter=",", header="t,q,p,energy", comments="")
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet")
    (energies,) = (v for v in found.verdicts if v.check == "energies")
    assert energies.passed is None
    assert "is read from a store alone" in energies.reason


def test_text_of_sixteen_digits_is_no_double_and_shortest_text_of_singles_is_single() -> None:
    """Excel keeps 16 digits, off by up to 4.5 roundings of a double, and pandas writes singles as 0.0796864
    and as 0.007968642: right files of both failed."""
    x = np.random.default_rng(2).normal(size=300)
    full, half = 2.0**-53, 0.5 * 10.0**-15
    assert roundoff([[repr(y)] for y in x.tolist()], [0]) == full
    assert roundoff([[f"{y:.16g}"] for y in x], [0]) == roundoff([[f"{y:.15e}"] for y in x], [0]) == half
    # of a few numbers no double may need 17 digits
    assert roundoff([[f"{y:.16g}"] for y in x[:5]], [0]) == full
    assert roundoff([[str(y)] for y in x.astype(np.float32)], [0]) == 2.0**-24
    assert roundoff([[f"{y:.9g}"] for y in x], [0]) == 0.5 * 10.0**-8


def test_a_right_file_of_sixteen_digits_passes(tmp_path: Path) -> None:
    for seed in range(12):
        m, k, q, p = np.random.default_rng(seed).uniform(0.3, 9, 4)[:, None]
        walls = (clean.walls(k, np.zeros(1)),)
        scene = clean.scene(m, walls, q, p, step=0.11, steps=200)
        made = schemes.scheme("semi-implicit-euler")
        run = steppers.record(scene, made, steppers.textbook(scene, made))
        path = in_text(tmp_path / "a.csv", run, "%.16g", "%.16g", m)
        assert failing(path, scene, "semi-implicit-euler") == []
        wrong = in_text(tmp_path / "a.csv", run, "%.16g", "%.16g", m, 1e-13)
        assert failing(wrong, scene, "semi-implicit-euler")


def test_times_of_a_smaller_unit_are_refused_with_what_they_may_be(tmp_path: Path) -> None:
    scene = scenefile.load_scene("spring-uneven")
    run = driver.run(scene, "own:velocity-verlet")
    np.savetxt(
        tmp_path / "a.csv", np.c_[run.t / 1000, run.q, run.p], header="t,q,p", delimiter=",", comments=""
    )
    with pytest.raises(StoreError, match=r"0\.1 is due.*lie 0\.001 times as far apart.*another unit"):
        file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet")


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"stiffness": 7.7}, "stiffness could not be compared: give the mass"),
        ({"friction": 5.0}, "friction could not be compared: give the mass"),
        ({"stiffness": 7.7, "friction": 5.0}, "stiffness and friction could not be compared"),
        ({"stiffness": 2.9, "mass": 3.7}, ""),
        ({"friction": 0.0}, ""),
    ],
)
def test_a_stated_number_that_cannot_be_compared_is_named(stated: dict[str, float], said: str) -> None:
    run = driver.run(scenefile.load_scene("spring-uneven"), "own:velocity-verlet")
    found = springcheck.identify(run.t, run.q, v=run.p / 3.7, **stated)
    assert [said in note for note in found.notes if "compared" in note] == [True] * bool(said)
