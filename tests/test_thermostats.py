"""Thermostats of every engine: the right ones pass, to rounding and by chance; what is broken is rejected.

Seeds here are those at which a test was written, none of them chosen; a chance of 1e-6 a call is what the
checks allow themselves.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import bathed as baths
import springcheck
from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS, Stepper
from springcheck.bath.heat import Heat
from springcheck.bath.stepper import forces
from springcheck.cli import file, main
from springcheck.engines import Label
from springcheck.engines.own import thermal as own_thermal
from springcheck.errors import MethodError, SceneError, SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.physics.trajectory import Trajectory, of_scene
from springcheck.studies.run import measure

LABELS = [
    f"{name}:{method}"
    for name in ("own", "openmm", "ase", "lammps")
    for method, declared in engines.engine(name).thermostats.items()
]


def pair(steps: int = 400, step: float = 0.35) -> Scene:
    """Two unlike particles, one on a wall, joined, in a bath: nothing is 1."""
    return Scene(
        m=np.array([3.7, 1.3]), q=np.array([0.3, -0.2]), p=np.array([0.7, 0.4]),
        terms=(WallSpring(i=np.array([0]), k=np.array([2.9]), at=np.array([0.1])),
               Spring(a=np.array([0]), b=np.array([1]), k=np.array([1.7]), rest=np.array([0.6]))),
        step=step, steps=steps, bath=Bath(temperature=1.7, friction=0.8), name="pair",
    )  # fmt: skip


def here(label: str) -> None:
    if reason := engines.absence(label.partition(":")[0]):
        pytest.skip(reason)


@pytest.mark.parametrize("label", LABELS)
def test_a_thermostat_passes_its_checks_and_says_its_seed(label: str) -> None:
    here(label)
    scene = pair(step=0.1 if "euler" in label else 0.35)
    run = driver.run(scene, label, seed=271828)
    verdicts = springcheck.judge(scene, run)
    assert [f"{v.check}: {v.why}" for v in verdicts if v.passed is False] == []
    assert sum(v.passed is True for v in verdicts) >= 6
    assert run.origin["seed"] == "271828"
    assert run.origin["generator"]


@pytest.mark.parametrize("name", ["baoab", "obabo", "andersen", "bbk"])
def test_numbers_do_not_depend_on_how_many_steps_are_asked_for_at_once(name: str) -> None:
    scene, label = pair(steps=60), Label(engine="own", method=name)
    whole = driver.run(scene, label, seed=3)
    simulation = engines.Started(scene, label, 3)
    q, p = np.empty((2, 60, 2))
    for row in range(0, 60, 4):
        simulation.advance(1, q[row : row + 4], p[row : row + 4])
    assert np.array_equal(q, whole.q[1:])
    assert np.array_equal(p, whole.p[1:])


@pytest.mark.parametrize(
    "label", ["own:baoab", "own:aboba", "own:gj-i", "own:andersen", "openmm:langevin-middle-bath"]
)
def test_an_anharmonic_well_leaves_the_direction_of_the_noise_to_rounding(label: str) -> None:
    scene = scenefile.load_scene("bath-well")
    run = driver.run(replace(scene, steps=500), label, seed=11)
    verdicts = {v.check: v for v in springcheck.judge(replace(scene, steps=500), run)}
    assert verdicts["noise-direction"].passed
    assert all(v.passed is not False for v in verdicts.values())


DRAG_ALONE = ("baoab", "baoa", "gj-i", "gj-i-half", "bbk", "obabo", "vanden-eijnden-ciccotti", "bussi")


@pytest.mark.parametrize("name", DRAG_ALONE)
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_a_drag_of_another_friction_than_the_noise_is_seen_in_the_states(name: str, factor: float) -> None:
    """It makes half of the temperature, or twice as much, of draws that are right one by one."""
    scene = replace(scenefile.load_scene("bath-spring"), p=np.array([3.0]), steps=9000)
    scheme = THERMOSTATS[name]
    steppers = [Stepper.of(scheme, x, width=np.float64) for x in (scene, _with(scene, factor))]
    wrong = steppers[1]
    # the coefficients of the one, the noise of the other
    both = zip(*(one._acts for one in steppers), strict=True)
    wrong._acts = [
        (kind, right if kind in ("noise", "jump") else c, noise, number)
        for (_, right, noise, _), (kind, c, _, number) in both
    ]
    found = {v.check: v for v in checks.judge(scene, _stepped(scene, wrong))}
    assert found["draws-independent"].passed is (factor == 1)
    assert factor != 1 or all(v.passed is not False for v in found.values())


@pytest.mark.parametrize("name", ["obabo", "oabao", "vanden-eijnden-ciccotti"])
def test_a_wrong_force_is_seen_where_draws_reach_every_state(name: str) -> None:
    scene = replace(scenefile.load_scene("bath-spring"), steps=9000)
    wrong = scene.derived(terms=scene.system.scaled(1.3).terms)
    for other, passed in ((scene, True), (wrong, False)):
        run = _stepped(other, Stepper.of(THERMOSTATS[name], other, width=np.float64))
        run = replace(run, energy=np.asarray(scene.system.energy(run.q, run.p)))
        (found,) = (v for v in checks.judge(scene, run) if v.check == "draws-independent")
        assert found.passed is passed
        assert passed or "the force" in found.why


@pytest.mark.parametrize("name", ["baoab", "gj-i", "andersen"])
@pytest.mark.parametrize("at", [1e9, 1e13, 1e17])
def test_what_stands_still_so_far_out_that_nothing_shows_is_not_judged(name: str, at: float) -> None:
    """Nor does a right engine fail there, whose collisions nobody can see."""
    near = replace(scenefile.load_scene("bath-spring"), steps=400, p=np.array([3.0]))
    scene = replace(near.derived(terms=tuple(x.shifted(at) for x in near.terms)), q=near.q + at)
    right = driver.run(scene, f"own:{name}", seed=3)
    still = replace(
        right,
        p=0 * right.p,
        q=0 * right.q + right.q[0],
        energy=np.full(401, scene.system.energy(right.q[:1], 0 * right.p[:1])[0]),
    )
    wanted = {1e9: {0}, 1e13: {2}, 1e17: {2}}[at]
    assert checks.status(checks.judge(scene, right)) in wanted
    assert checks.status(checks.judge(scene, still)) != 0


def _with(scene: Scene, factor: float) -> Scene:
    assert scene.bath is not None
    return replace(scene, bath=replace(scene.bath, friction=factor * scene.bath.friction))


def _stepped(scene: Scene, stepper: Stepper) -> Trajectory:
    rng, scheme = np.random.default_rng(1), stepper.scheme
    force, states = forces(scene.system), [(scene.q, scene.p)]
    carried = list(rng.standard_normal((scheme.carried, scene.n)))
    for fresh in rng.standard_normal((scene.steps, scheme.fresh, scene.n)):
        draws = [*carried, *fresh]
        states.append(stepper(*states[-1], force, draws))  # type: ignore[arg-type]
        carried = draws[len(draws) - scheme.carried :]
    q, p = np.array(states).transpose(1, 0, 2)
    energy = np.asarray(scene.system.energy(q, p))
    return of_scene(scene, q, p, label="drag", scheme=scheme.name, energy=energy)


@pytest.mark.parametrize("name", THERMOSTATS)
def test_own_thermostats_count_the_forces_that_they_ask_for(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []

    def counting(*given: Any) -> Any:
        force = forces(*given)
        return lambda q, p: (calls.append(1), force(q, p))[1]

    monkeypatch.setattr(own_thermal, "forces", counting)
    scene = baths.springs(2, steps=7)
    assert driver.run(scene, f"own:{name}", seed=3).force_calls == len(calls) > 0


def test_collisions_and_what_they_draw_are_of_unlike_numbers() -> None:
    """Of one sequence, a number small enough for a collision would be a small draw as well."""
    begun = own_thermal.Random(baths.springs(1), "andersen", 0.1, 3)
    assert not {*begun._hits.random(1000)} & {*np.random.Generator(np.random.PCG64(3)).random(10_000)}


@pytest.mark.parametrize("name", [name for name, one in THERMOSTATS.items() if one.carried])
def test_draws_that_do_not_act_again_in_the_next_step_are_rejected(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a draw and the next reach one number alone, by the correlation of what follows each other."""
    scene = baths.springs(2, steps=300)
    with monkeypatch.context() as patch:
        patch.setitem(THERMOSTATS, name, replace(THERMOSTATS[name], carried=0))
        wrong = driver.run(scene, f"own:{name}", seed=3)
    seen = checks.judge(scene, wrong, [checks.bath.noise_direction, checks.bath.draws_independent])
    first = "draws-independent" if name.endswith("-half") else "noise-direction"
    assert first in {v.check for v in seen if v.passed is False}


BAD = {
    "temperature = -3.0\nfriction = 1.0": r"bath.temperature = -3.0: a number > 0 is needed",
    "temperature = 3.0\nfriction = 0.0": r"bath.friction = 0.0: a number > 0 is needed",
    "temperature = 3.0": r"bath: it lacks the field `friction`",
}


@pytest.mark.parametrize("text", BAD)
def test_a_bath_that_makes_no_sense_is_one_line(text: str) -> None:
    whole = scenefile.text_of("spring") + f"\n[bath]\n{text}\n"
    with pytest.raises(SceneError, match=BAD[text]):
        scenefile.parse(whole, name="spring")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--temperature", "-3"], "--temperature -3: a finite number >= 0 is needed"),
        (["--temperature", "nanK"], "--temperature nanK: a finite number >= 0 is needed"),
        (["--temperature", "warm"], "--temperature warm: a number is needed"),
        (["--temperature", "300K", "--method", "own:euler"],
         "explicit-euler has no noise, and the scene has a bath"),
        (["--temperature", "1", "--command", "c=false {scene} {out}", "--scheme", "baoab"],
         "add your thermostat with --engine, or let `springcheck identify` find friction and kT"),
        (["--method", "own:baoab"], "it is a thermostat, for scenes with a bath"),
        (["--temperature", "300K", "--method", "openmm:verlet"],
         "the thermostats of OpenMM are openmm:langevin-middle-bath, "),
        (["--temperature", "0K", "--seed", "3"], "at 0 K there is none, and nothing is drawn"),
        (["--seed", "3"], "--seed goes with a scene that has a bath"),
        (["--temperature", "1", "--seed", "0"], "seed = 0: a whole number from 1"),
        (["--friction", "2"], "--friction goes with --temperature"),
    ],
)  # fmt: skip
def test_a_users_mistake_is_one_line_and_exit_status_2(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["run", "spring", "-o", str(tmp_path / "x.h5"), *arguments]) == 2
    shown = capsys.readouterr()
    assert said in " ".join(shown.err.split())
    assert "Traceback" not in shown.err


def test_a_seed_that_is_no_integer_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["run", "spring", "--temperature", "1", "--seed", "lucky"])
    assert stopped.value.code == 2
    with pytest.raises(MethodError, match=r"seed = 1\.5: a whole number"):
        driver.run(pair(), "own:baoab", seed=1.5)  # type: ignore[arg-type]
    with pytest.raises(MethodError, match="takes no seed"):
        driver.run(scenefile.load_scene("spring"), "own:euler", seed=1)
    with pytest.raises(SpringcheckError, match="seed= goes with"):
        springcheck.run("spring", methods=["own:euler"], seed=1)


def test_a_generator_is_no_seed_that_a_run_could_keep() -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(SpringcheckError, match=r"seed = Generator\(PCG64\).*: a whole number is needed"):
        springcheck.simulate(pair(), "own:baoab", seed=rng)  # type: ignore[arg-type]
    with pytest.raises(SpringcheckError, match="a whole number is needed"):
        springcheck.simulate(pair(), "own:euler", seed=rng)  # type: ignore[arg-type]
    kept = driver.run(pair(), "own:baoab", seed=rng).origin
    assert kept["seed"].startswith("none")


def test_a_store_without_a_seed_is_not_run_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = str(tmp_path / "x.h5")
    assert main(["run", "spring", "--temperature", "1", "--method", "own:baoab", "--quiet", "-o", store]) == 0
    with h5py.File(store, "r+") as file:
        found: list[Any] = []
        file.visititems(lambda _, node: found.append(node) if "origin.seed" in node.attrs else None)
        found[0].attrs["origin.seed"] = "lucky"
    capsys.readouterr()
    assert main(["run", "--from", store]) == 2
    said = capsys.readouterr().err
    assert "own:baoab" in said
    assert "its seed is 'lucky'" in said
    assert "Traceback" not in said


def test_a_thorough_run_in_a_bath_reports_its_progress_to_the_end(tmp_path: Path) -> None:
    heard: list[tuple[float, int]] = []
    labels = ["own:baoab", "own:obabo"]
    measure.run(
        pair(40), tmp_path / "x.h5", methods=labels, thorough=True, seed=3,
        progress=lambda done, parts, *what: heard.append((done, parts)),
    )  # fmt: skip
    assert heard[-1] == (4, 4)
    assert [done for done, _ in heard] == sorted(done for done, _ in heard)


def test_a_spring_at_300_kelvin_runs_and_repeats(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = ["--method", "own:ba*", "--method", "openmm:*"]
    assert main(["run", "spring", "--temperature", "300K", "--seed", "7", *arguments]) == 0
    shown = capsys.readouterr().out
    assert "at temperature 300K" in shown
    assert "Temperatures over that of the bath" in shown
    assert main(["run", "--from", "spring.h5"]) == 0
    assert "NOT equal" not in capsys.readouterr().out
    again = ["--force", "--json", "--method", "own:baoab"]
    assert main(["run", "spring", "--temperature", "300K", *again]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["temperatures"][0]["configurational_law"] == pytest.approx(1, abs=1e-9)
    kept = springcheck.read("spring.h5")["own:baoab"]
    assert 1 <= int(kept.origin["seed"]) <= driver.MOST_SEED


@pytest.mark.parametrize("name", ["bath-spring", "bath-uneven", "bath-free", "bath-brownian", "bath-well"])
def test_a_bath_is_read_back_as_it_was_written(name: str) -> None:
    scene = scenefile.load_scene(name)
    again = scenefile.parse(scene.to_toml(), name=name)
    assert again.bath == scene.bath
    assert again.digest == scene.digest
    assert replace(scene, bath=Bath(temperature=1.0, friction=1.0)).digest != scene.digest


@pytest.mark.parametrize("letters", ["BAOAB", "BAOA", "ABOBA", "OBABO", "OABAO", "AOBOA", "BOAOB"])
def test_map_and_noise_of_letters_are_those_of_the_stages_multiplied_by_hand(letters: str) -> None:
    from springcheck.bath import Law

    h, m, k, rate, thermal = 0.35, 3.7, 2.9, 0.8, 1.7
    a, columns = np.eye(2), []
    for letter in letters:
        x = h / letters.count(letter)
        c = np.exp(-rate * x)
        one = np.array({"B": [[1, 0], [-x * k, 1]], "A": [[1, x / m], [0, 1]], "O": [[1, 0], [0, c]]}[letter])
        a, columns = one @ a, [one @ g for g in columns]
        if letter == "O":
            columns.append(np.array([0, np.sqrt((1 - c * c) * m * thermal)]))
    law = Law(
        scheme=THERMOSTATS[letters.lower()], h=h, m=np.array([m]), k=np.array([k]), rate=rate, thermal=thermal
    )
    # both are rounded: a handful of products a stage
    assert a == pytest.approx(law.A[0].astype(float), rel=32 * 2.0**-52)
    assert pytest.approx(law.G[0].astype(float), rel=32 * 2.0**-52) == np.array(columns).T


@pytest.mark.parametrize(
    "name", [*THERMOSTATS, "noise-direction", "draws-variance", "noise-map", "openmm:andersen"]
)
def test_thermostats_and_their_checks_are_explained(name: str) -> None:
    from springcheck.cli import explain

    said = list(explain.lines(name))
    assert len(said) >= 3
    if name in THERMOSTATS:
        law = "noncentral chi-squared" if THERMOSTATS[name].rescales else "k<q**2>/kT"
        assert any(law in line for line in said)
        assert not any("chooses its own steps" in line for line in said)


def test_a_deterministic_run_imports_no_generator() -> None:
    import subprocess
    import sys

    code = "import springcheck as s, sys\n"
    code += "s.simulate('spring', 'own:euler'); print('numpy.random' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_bath_of_temperature_zero_is_friction_without_noise() -> None:
    from argparse import Namespace

    from springcheck.errors import SpringcheckError
    from springcheck.studies.run.changes import bathed

    scene = scenefile.load_scene("bath-uneven")
    cold = bathed(scene, Namespace(temperature="0K", friction=None))
    assert cold.bath is None
    assert cold.system.friction_rates == pytest.approx(20.0, rel=1e-15)
    assert cold.title.endswith("at temperature 0: friction 20 without noise")
    short = replace(cold, steps=100)
    verdicts = springcheck.judge(short, driver.run(short, "own:langevin-middle"))
    assert not [v for v in verdicts if v.passed is False]
    with pytest.raises(SpringcheckError, match="a number > 0 is needed"):
        bathed(scene, Namespace(temperature="0", friction=-1.0))
    with pytest.raises(SpringcheckError, match="has a friction of its own"):
        bathed(cold, Namespace(temperature="0", friction=1.0))


def test_a_scene_file_may_say_temperature_zero_as_the_command_may(tmp_path: Path) -> None:
    text = """
        title = "Cold"
        particle = [{mass = 3.7, position = 0.3}]
        spring = [{ends = ["wall", 0], stiffness = 2.9}]
        bath = {temperature = 0, friction = 0.5}
        time = {step = 0.1, steps = 20}
    """
    scene = scenefile.parse(text, name="cold")
    assert scene.bath is None
    assert scene.system.friction_rates == pytest.approx(0.5, rel=1e-15)
    assert scene.title.endswith("at temperature 0: friction 0.5 without noise")
    (tmp_path / "cold.toml").write_text(scene.to_toml())
    again = scenefile.load_scene(tmp_path / "cold.toml")
    assert again.system.friction_rates == pytest.approx(0.5, rel=1e-15)
    with pytest.raises(SceneError, match=r"bath.friction = 0\.0: a number > 0 is needed"):
        scenefile.parse(text.replace("0.5", "0.0"), name="cold")
    with pytest.raises(SceneError, match="friction of its own"):
        scenefile.parse(text + "damping = [{particle = 0, coefficient = 0.1}]", name="cold")


BOTH_KINDS = """
from dataclasses import replace
from springcheck import engines
ENGINE = replace(engines.engine("own"), name="mine", title="mine", methods=engines.engine("own").methods,
    thermostats={"baoab": engines.engine("own").thermostats["baoab"]})
"""


def test_an_engine_of_a_file_runs_its_thermostats_in_a_bath_and_its_methods_without(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(BOTH_KINDS)
    for scene, runs, not_run in (
        ("bath-spring", "mine:baoab", "mine:euler"),
        ("spring", "mine:euler", "mine:baoab"),
    ):
        words = [scene, "--steps", "20", "--engine", str(tmp_path / "mine.py"), "-o", str(tmp_path / "a.h5")]
        assert main(["run", *words, "--force", "--method", "own:*"]) == 0
        out = capsys.readouterr().out
        assert runs in out
        assert not_run not in out


def test_splittings_of_openmmtools_are_those_of_their_letters() -> None:
    found = engines.from_file(Path(__file__).parents[1] / "validation" / "engines" / "openmmtools_.py")
    assert found is not None
    if reason := engines.absence("openmmtools"):
        pytest.skip(reason)
    scene = pair(steps=100)
    for name in found.thermostats:
        run = driver.run(scene, f"openmmtools:{name}", seed=3)
        verdicts = springcheck.judge(scene, run) + checks.judge_thoroughly(
            scene, f"openmmtools:{name}", driver.run, seed=3
        )
        assert [f"{name} {v.check}: {v.why}" for v in verdicts if v.passed is False] == []
        assert sum(v.passed is True for v in verdicts) >= 9


def test_the_error_of_a_temperature_is_that_of_the_frames_it_is_of() -> None:
    scene = replace(scenefile.load_scene("bath-spring"), steps=2000)
    run = driver.run(scene, "own:baoab")
    thin = replace(run, t=run.t[::10], q=run.q[::10], p=run.p[::10], every=10 * run.every)
    near = replace(run, t=run.t[-len(thin.t) :], q=run.q[-len(thin.t) :], p=run.p[-len(thin.t) :])
    errors = []
    for some in (thin, near):
        heat = Heat(scene)
        heat.add(some)
        errors.append(heat.line(run.label).configurational_error)
    assert errors[0] < errors[1] / 1.5, "as many frames further apart tell more"


def textbook(
    scene: Scene, steps: int, *, at: str = "end", size: Any = 1.0, rate: float = 1.0, uniform: bool = False
) -> np.ndarray:
    """Rows of t, q, v of a loop of one's own: velocity Verlet, then Andersen's collisions (Frenkel & Smit,
    algorithm 14); collisions at another place of the step, of another size or rate, of uniform draws."""
    rng, h, m = np.random.default_rng(8), scene.step, scene.m
    assert scene.bath is not None
    chance_of_one, kT = -rate * np.expm1(-scene.bath.friction * h), scene.thermal
    q, v, rows = scene.q.copy(), scene.p / m, [np.r_[0.0, scene.q, scene.p / m]]

    def collided(v: Any, here: bool) -> Any:
        xi = np.sqrt(12) * (rng.random(len(m)) - 0.5) if uniform else rng.standard_normal(len(m))
        hit = (rng.random(len(m)) < chance_of_one) & here
        return np.where(hit, size * np.sqrt(kT / m) * xi, v)

    none, each = np.zeros((len(m), len(m))), np.eye(len(m))
    at_0, at_1 = (np.asarray(scene.system.potential_force(x, none), float) for x in (none, each))

    def pull(q: Any) -> Any:
        return at_0[0] + q @ (at_1 - at_0)

    for i in range(1, steps + 1):
        v = collided(v, at == "start") + h / 2 * pull(q) / m
        v = collided(v, at == "middle")
        q = q + h * v
        v = collided(v + h / 2 * pull(q) / m, at == "end")
        rows.append(np.r_[i * h, q, v])
    return np.array(rows)


def failed_of(tmp_path: Path, rows: np.ndarray, scene: Scene) -> set[str]:
    """Checks that a table of t, q, v fails as `andersen-after`."""
    n = len(scene.m)
    names = ["t", *(f"{x}{i}" for x in "qv" for i in range(n))] if n > 1 else ["t", "q", "v"]
    np.savetxt(tmp_path / "a.csv", rows, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    scene = replace(scene, steps=len(rows) - 1, every=1)
    found = file.judge(tmp_path / "a.csv", scene=scene, scheme="andersen-after").verdicts
    assert sum(v.passed is True for v in found) >= 6
    return {v.check for v in found if v.passed is False}


def alone(m: list[float], k: list[float], **more: Any) -> Scene:
    """Springs of their own in a bath."""
    n = len(m)
    return Scene(
        m=np.array(m), q=np.full(n, 0.3), p=np.full(n, 0.2), step=0.2, steps=1, name="alone",
        terms=(WallSpring(i=np.arange(n), k=np.array(k), at=np.full(n, 0.1)),),
        bath=Bath(temperature=1.7, friction=0.8), **more,
    )  # fmt: skip


@pytest.mark.parametrize("of", ["one", "two", "joined", "2 axes", "3 axes"])
def test_a_textbook_loop_whose_collisions_end_the_step_is_andersen_after(tmp_path: Path, of: str) -> None:
    """It failed as `andersen` in noise-direction and draws-state, and had no name."""
    scene = {
        "one": alone([3.7], [2.9]), "two": alone([3.7, 0.41], [2.9, 1.3]), "joined": pair(),
        "2 axes": alone([3.7] * 2, [2.9, 1.3], places=[0, 1]),
        "3 axes": alone([3.7] * 3 + [0.41] * 3, [2.9] * 3 + [1.3] * 3, places=[0, 1, 2, 3, 4, 5]),
    }[of]  # fmt: skip
    assert failed_of(tmp_path, textbook(scene, 600), scene) == set()
    for at in ("start", "middle"):
        assert "noise-direction" in failed_of(tmp_path, textbook(scene, 600, at=at), scene)


@pytest.mark.parametrize(
    ("wrong", "seen"),
    [
        ({}, ""), ({"size": np.sqrt(1.05)}, "draws-variance"), ({"size": np.sqrt(0.95)}, "draws-variance"),
        ({"size": np.sqrt([3.7, 0.41])}, "draws-variance"), ({"rate": 1.1}, "collisions"),
        ({"rate": 0.9}, "collisions"), ({"uniform": True}, "draws-shape"),
    ],
)  # fmt: skip
def test_a_long_textbook_loop_of_a_wrong_bath_fails(wrong: dict[str, Any], seen: str) -> None:
    scene = replace(alone([3.7, 0.41], [2.9, 1.3]), bath=Bath(temperature=1.7, friction=4.0))
    scene = replace(scene, steps=40_000)
    rows = textbook(scene, scene.steps, **wrong)
    run = driver.run(scene, "own:andersen-after", seed=1)
    run = replace(run, q=rows[:, 1:3], p=rows[:, 3:] * scene.m, energy=None)
    # a loop of one's own records no energies
    failed = {v.check for v in springcheck.judge(scene, run) if v.passed is False} - {"grid"}
    assert (seen in failed) if seen else failed == set()
