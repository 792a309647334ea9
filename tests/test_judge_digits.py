"""Files of few digits: each step alone allows almost anything, and all steps together very little."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import clean
import springcheck
from springcheck import checks, driver, engines, schemes
from springcheck.cli import file
from springcheck.errors import StoreError
from springcheck.identify.steps import has_a_start, springs_of
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Damping, WallSpring
from springcheck.physics.trajectory import Verdict
from springcheck.schemes import SCHEMES, matrix


def spring(k: float = 4.9, c: float = 0.0, step: float = 0.02, every: int = 1) -> Scene:
    """A mass of 0.25 pulled out by 0.08, at 4.43 turns a unit of time."""
    one = np.array([0])
    terms = (WallSpring(i=one, k=np.array([k]), at=np.zeros(1)), Damping(i=one, c=np.array([c])))
    return clean.scene(
        np.array([0.25]), terms[: 1 + (c > 0)], np.array([0.08]), np.zeros(1), step=step, steps=250 * every,
        every=every,
    )  # fmt: skip


def old_force(scene: Scene) -> Floats:
    """q, v (f, 2) of a velocity Verlet whose second half kick takes the force of the old position."""
    (x, v), h = (0.08, 0.0), scene.step
    out = [(x, v)]
    for _ in range(scene.steps):
        a = -4.9 / 0.25 * x
        x, v = x + v * h + 0.5 * a * h * h, v + a * h
        out.append((x, v))
    return np.array(out)


def states(scene: Scene, label: str = "own:velocity-verlet") -> Floats:
    """q, v (f, 2 n) of an engine."""
    run = driver.run(scene, label)
    return np.c_[run.q, run.p / scene.m]


def identified(
    tmp_path: Path, scene: Scene, rows: Floats, form: str, scheme: str = "velocity-verlet"
) -> Verdict:
    t = scene.step * scene.every * np.arange(len(rows))
    head = ",".join(["t", *(f"{what}{i}" for what in "xv" for i in range(scene.n))])
    forms = ["%.8g"] + [form] * rows.shape[1]
    np.savetxt(tmp_path / "a.csv", np.c_[t, rows], fmt=forms, delimiter=",", header=head, comments="")
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme=scheme)
    return next(v for v in found.verdicts if v.check == "identified")


@pytest.mark.parametrize(
    ("form", "wrong", "said"),
    [
        ("%.4f", "old force", "second half kick uses the old force"),
        ("%.3f", "old force", "second half kick uses the old force"),
        ("%.4f", 5.2, "1.0612"),
        ("%.3f", 6.0, "1.2245"),
        ("%.5f", 4.905, "1.00102"),
    ],
)
def test_what_few_digits_refute_fails_with_its_cause(
    tmp_path: Path, form: str, wrong: float | str, said: str
) -> None:
    scene = spring()
    rows = old_force(scene) if isinstance(wrong, str) else states(spring(wrong))
    found = identified(tmp_path, scene, rows, form)
    assert found.passed is False
    assert said in found.why


@pytest.mark.parametrize("form", ["%.3f", "%.4f", "%.4g", "%.5e"])
@pytest.mark.parametrize("c", [0.0, 0.02])
@pytest.mark.parametrize("every", [1, 3])
def test_what_is_right_to_its_few_digits_does_not_fail(
    tmp_path: Path, form: str, c: float, every: int
) -> None:
    scene = spring(c=c, every=every)
    for label in ("own:velocity-verlet", "own:rk4"):
        scheme = engines.method(engines.parse(label)).scheme
        assert identified(tmp_path, scene, states(scene, label), form, scheme).passed is not False


def test_numbers_that_are_cut_off_instead_of_rounded_do_not_fail(tmp_path: Path) -> None:
    scene = spring()
    rows = np.trunc(states(scene) * 1e4) / 1e4
    assert identified(tmp_path, scene, rows, "%.4f").passed is not False


def test_a_motion_that_grows_has_no_cause_to_its_one_digit(tmp_path: Path) -> None:
    """Of explicit Euler to one decimal a thermostat was read: some start does lead to all of it."""
    scene = clean.scene(
        np.array([0.3]), (WallSpring(i=np.zeros(1, int), k=np.array([0.4]), at=np.zeros(1)),),
        np.array([0.7]), np.zeros(1), step=0.13, steps=300,
    )  # fmt: skip
    rows = states(scene, "own:euler")
    assert identified(tmp_path, scene, rows, "%.1f", "explicit-euler").passed is not False


@pytest.mark.parametrize("form", ["%.3f", "%.3g", "%.8g"])
@pytest.mark.parametrize(("label", "scheme", "turn"), [
    ("own:euler", "explicit-euler", 0.57), ("own:rk2-heun", "rk2-heun", 1.34),
    ("own:position-verlet", "position-verlet", 2.02),
])  # fmt: skip
def test_a_motion_that_grows_passes_or_fails_by_its_own_spring(
    tmp_path: Path, form: str, label: str, scheme: str, turn: float
) -> None:
    """Of a start at rest 0 has no digits, and states of a stiffness off by 5 % that show no scheme passed."""
    step = round(turn / float(np.sqrt(4.9 / 0.25)), 4)
    rows = states(spring(step=step), label)
    grown = len(rows) - np.count_nonzero(np.max(np.abs(rows), axis=1) > 1e4)
    assert identified(tmp_path, spring(step=step), rows[:grown], form, scheme).passed is not False
    other = states(spring(4.9 * 1.05, step=step), label)[:grown]
    assert identified(tmp_path, spring(step=step), other, form, scheme).passed is False


@pytest.mark.parametrize("digits", [4, 5])
def test_some_start_leads_to_the_right_states_and_none_to_those_of_another_stiffness(digits: int) -> None:
    """250 steps turn by 22 radians, half of the relative error of k times that."""
    steps, scheme, springs = np.arange(251), SCHEMES["velocity-verlet"], springs_of(spring())

    def found(k: float) -> bool:
        run = driver.run(spring(k), "own:velocity-verlet")
        q, p = (np.round(x, digits) for x in (run.q, run.p))
        return has_a_start(scheme, 0.02, springs, steps, q, p, 5e-4, np.zeros((2, 1)))

    assert found(4.9)
    assert not found(4.9 * (1 + 40 * 10.0**-digits))


def test_a_pass_does_not_claim_to_see_any_other_stiffness(tmp_path: Path) -> None:
    found = identified(tmp_path, spring(), states(spring()), "%.4f")
    assert found.passed
    assert "any other value" not in found.reason


@pytest.mark.parametrize("k", [4.9, 5.2])
def test_points_in_space_of_few_digits_are_those_of_the_scenes_axes(tmp_path: Path, k: float) -> None:
    """Along an axis, and along a line that is none: each of the three coordinates has the same spring."""
    scene = spring()
    rows = states(spring(k))
    for way in (np.array([0, 1, 0]), np.array([0.6, 0, 0.8])):
        space = np.c_[rows[:, :1] * way, rows[:, 1:] * way]
        t = scene.step * np.arange(len(rows))
        head = "t,x,y,z,vx,vy,vz"
        np.savetxt(tmp_path / "a.csv", np.c_[t, space], fmt="%.5f", delimiter=",", header=head, comments="")
        found = file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet")
        verdict = next(v for v in found.verdicts if v.check == "identified")
        assert verdict.passed is (k == 4.9)


@pytest.mark.parametrize(("k", "seen"), [(4.9, False), (4.9 * 1.02, False), (6.0, True)])
def test_what_single_steps_do_not_see_is_one_spring_and_its_step(
    tmp_path: Path, k: float, seen: bool
) -> None:
    """`2 springs could be off by any part` was said of one, of which 22 % are seen."""
    rows = states(spring(k))
    np.savetxt(
        tmp_path / "a.csv", np.c_[0.02 * np.arange(251), rows], fmt=["%.2f", "%.3g", "%.3g"], delimiter=",",
        header="t,x,v", comments="",
    )  # fmt: skip
    found = file.judge(tmp_path / "a.csv", scene=spring(), scheme="velocity-verlet").verdicts
    step = next(v for v in found if v.check == "step-defect")
    assert step.passed is not seen
    assert "any part" not in step.why
    assert seen or "1 spring and the step wrong by 3%" in step.why


@pytest.mark.parametrize(
    ("forms", "said"),
    [
        (("%.6f", "%.17g"), "positions are rounded to decimals, by up to 5e-07, and judged to that"),
        (("%.17g", "%.5f"), "velocities are rounded to decimals, by up to 5e-06, and judged to that"),
        (("%.6f", "%.5f"), "positions and velocities are rounded to decimals, by up to 5e-07 and 5e-06, and"),
    ],
)
def test_a_note_names_the_columns_that_are_rounded(tmp_path: Path, forms: tuple[str, str], said: str) -> None:
    """It said "positions and velocities are rounded to decimals, by up to 5e-07 and 0"."""
    scene = spring()
    rows = np.c_[scene.step * np.arange(251), states(scene)]
    np.savetxt(tmp_path / "a.csv", rows, ["%.8g", *forms], delimiter=",", header="t,x,v", comments="")
    notes = file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet").notes
    assert any(note.startswith(said) for note in notes), notes


@pytest.mark.parametrize(
    ("scheme", "other"),
    [
        ("langevin-middle", "position-verlet"),
        ("langevin-middle-early", "semi-implicit-euler-drift-kick"),
        ("respa8", "position-verlet"),
        ("force-held-4", "semi-implicit-euler"),
        ("semi-implicit-euler-implicit-friction", "semi-implicit-euler-drift-kick"),
        ("exact", "velocity-verlet"),
    ],
)
def test_a_scheme_is_known_by_its_steps_and_not_by_its_name_alone(
    tmp_path: Path, scheme: str, other: str
) -> None:
    """On one spring many of them are another scheme, by whose name the states are known."""
    scene = spring(step=0.05, every=2)

    def rows(name: str) -> Floats:
        one_step = matrix(
            schemes.scheme(name if name != "respa8" else "velocity-verlet"),
            h=scene.step, m=scene.m, k=np.array([4.9]),
        )[0]  # fmt: skip
        out = [np.array([0.08, 0.0], np.longdouble)]
        for _ in range(scene.steps):
            out.append(one_step @ out[-1])
        return (np.array(out[:: scene.every]) / [1, 0.25]).astype(np.float64)

    assert identified(tmp_path, scene, rows(scheme), "%.7g", scheme).passed is not False
    assert identified(tmp_path, scene, rows(other), "%.7g", scheme).passed is False


def test_times_of_fixed_decimals_are_not_off_by_their_last_digit(tmp_path: Path) -> None:
    """A period of 40 steps has no short step, and 4 decimals keep four digits of it."""
    scene = spring(step=0.03548)
    scene = replace(scene, step=2 * np.pi / 40 * np.sqrt(0.25 / 4.9))
    rows, t = states(scene), scene.step * np.arange(scene.frames)
    np.savetxt(
        tmp_path / "a.csv", np.c_[t, rows], fmt=["%.4f", "%.17g", "%.17g"], header="t x v", comments=""
    )
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet")
    assert found.status == 0
    late = t + 2e-3 * (t > 1)
    np.savetxt(
        tmp_path / "a.csv", np.c_[late, rows], fmt=["%.4f", "%.17g", "%.17g"], header="t x v", comments=""
    )
    with pytest.raises(StoreError, match="is due"):
        file.judge(tmp_path / "a.csv", scene=scene, scheme="velocity-verlet")


def test_the_exact_flow_is_judged_by_all_digits_too(tmp_path: Path) -> None:
    scene = spring()
    w = np.sqrt(4.9 / 0.25)
    t = scene.step * np.arange(scene.frames)
    x = np.c_[0.08 * np.cos(w * t), -0.08 * w * np.sin(w * t)]
    assert identified(tmp_path, scene, x, "%.17g", "exact").passed
    assert identified(tmp_path, scene, states(scene), "%.17g", "exact").passed is False


def grown(gain: float, frames: int = 200, k: float = 4.9, far: float = 0.0, bend: float = 0.0) -> Floats:
    """q, v (f, 2) of kick-drift Euler whose velocity grows in each step, on a hardening spring."""
    x, v, out = far + 0.08, 0.0, [(far + 0.08, 0.0)]
    for _ in range(frames):
        u = x - far
        v = (v - 0.02 * k / 0.25 * u * (1 + bend * u * u)) * (1 + gain)
        x += 0.02 * v
        out.append((x, v))
    return np.array(out)


def test_nine_digits_show_a_growth_that_single_precision_would_hide(tmp_path: Path) -> None:
    """Their rounding is far below that of single precision, which is in every step of what has it."""
    scene, scheme = spring(), "semi-implicit-euler"
    assert identified(tmp_path, scene, grown(0.0), "%.9g", scheme).passed
    assert identified(tmp_path, scene, grown(3e-8), "%.9g", scheme).passed is False
    # of seven digits no one scheme is read
    assert identified(tmp_path, scene, grown(3e-8), "%.7g", scheme).passed is None


def test_a_restart_from_six_digits_is_no_rounding_to_nine() -> None:
    """One jump of 2e-6 among 25 steps, which roundings of single precision in seven stages would allow."""
    scene = replace(spring(step=0.07, every=2), steps=26)
    first = driver.run(scene, "own:forest-ruth")
    p = np.array([float(f"{first.p[-1, 0]:.6g}")])
    later = driver.run(replace(scene, q=first.q[-1], p=p), "own:forest-ruth")
    q, v = (np.r_[x[:-1, 0], y[:, 0]] for x, y in ((first.q, later.q), (first.p / 0.25, later.p / 0.25)))
    q, v = (np.array([float(f"{x:.9g}") for x in y]) for y in (q, v))
    found = springcheck.identify(0.14 * np.arange(len(q)), q, v=v, mass=0.25, stiffness=4.9, step=0.07)
    assert not found.fits, found.statement


def test_a_wrong_force_far_from_the_origin_is_no_matter_of_differences(tmp_path: Path) -> None:
    """Positions of nine digits at 300 give velocities to 1e-3; the recorded ones have finer digits."""
    one = np.array([0])
    terms = (WallSpring(i=one, k=np.array([4.9]), at=np.array([300.0])),)
    scene = clean.scene(np.array([0.25]), terms, np.array([300.08]), np.zeros(1), step=0.02, steps=200)
    rows = grown(0.0, far=300.0, bend=3.0)
    np.savetxt(
        tmp_path / "a.csv", np.c_[0.02 * np.arange(201), rows], fmt="%.9g", header="t x v", comments=""
    )
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="semi-implicit-euler")
    assert found.status == 1
    assert "differences" not in checks.cause_of(found.verdicts)


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.h5", "a.json"])
def test_rounded_numbers_are_judged_to_their_digits_in_any_format(tmp_path: Path, name: str) -> None:
    scene = spring()
    rows, path = np.round(states(scene), 8), tmp_path / name
    for wrong in (False, True):
        rows[100, 0] += 1e-4 * wrong
        arrays = {"t": scene.step * np.arange(len(rows)), "q": rows[:, 0], "v": rows[:, 1]}
        if name.endswith("npz"):
            np.savez(path, **arrays)
        elif name.endswith("h5"):
            with h5py.File(path, "w") as store:
                for key, values in arrays.items():
                    store[key] = values
        elif name.endswith("json"):
            path.write_text(json.dumps({key: x.tolist() for key, x in arrays.items()}))
        else:
            np.savetxt(path, np.c_[*arrays.values()], fmt="%.8f", header="t x v", comments="")
        assert file.judge(path, scene=scene, scheme="velocity-verlet").status == wrong


def test_subnormal_numbers_of_single_precision_are_judged_to_what_they_hold(tmp_path: Path) -> None:
    """A damped motion below 1e-38 failed: such numbers are multiples of 1.4e-45."""
    scene = spring(c=1.3, step=0.2, every=1)
    rows = states(scene, "own:rk4")
    assert 0 < np.max(np.abs(rows[-1])) < 1e-39
    np.savetxt(tmp_path / "a.csv", np.c_[scene.step * np.arange(len(rows)), np.float32(rows)],
               delimiter=",", header="t,q,v", comments="")  # fmt: skip
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="rk4")
    assert [v.check for v in found.verdicts if v.passed is False] == []


def test_velocities_of_few_digits_in_another_mass_are_no_noise(tmp_path: Path) -> None:
    """Momenta made of them have all digits: what the text rounds was "noise" as the cause of a wrong step."""
    scene = springcheck.load_scene("spring-uneven")
    run = driver.run(scene.derived(step=1.001 * scene.step), "own:trapezoidal")
    rows = np.c_[scene.step * np.arange(len(run.t)), run.q, run.p / scene.m]
    np.savetxt(tmp_path / "a.csv", rows, "%.6g", ",", header="t,q,v", comments="")
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="trapezoidal")
    assert found.status == 1
    assert "noise" not in checks.cause_of(found.verdicts).casefold()
