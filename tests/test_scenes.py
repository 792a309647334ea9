"""Every scene is run by every method that can serve it, judged, and true to an independent route.

The references in data/reference/motion are power series of the equations of motion in 40 digits, made
without springcheck (validation/references.py).
"""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from springcheck import checks, driver, engines
from springcheck.checks.steps import fastest
from springcheck.cli import listing, main
from springcheck.engines.own import simulation as own
from springcheck.errors import MethodError, SceneError
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Morse, Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.run import measure as session

Need = Callable[[str], None]

REFERENCES = Path(__file__).parents[1] / "data" / "reference" / "motion"
SHORT = 48


def shortened(name: str) -> Scene:
    """A shipped scene of fewer masses and steps where it has many: some methods take seconds for them."""
    text = (scenes.folder() / f"{name}.toml").read_text(encoding="utf-8")
    if "[chain]" in text:
        table = tomllib.loads(text)
        for field, value in (("masses", table["chain"]["masses"]), ("steps", table["time"]["steps"])):
            text = text.replace(f"{field} = {value}", f"{field} = {SHORT if field == 'masses' else 200}")
        text = text.replace("mode = 400", "mode = 40")
    scene = scenes.parse(text, name=name)
    return replace(scene, steps=min(scene.steps, 200))


SHIPPED = {name: scenes.load_scene(name) for name in scenes.names()}
CASES = [
    (name, str(label))
    for name, scene in SHIPPED.items()
    for label in engines.match(scene.include, bath=scene.bath is not None)
    if engines.refusal(scene, label) is None
]


LEFT_OUT_AT_START = {
    ("detest-b1", "openmm:langevin-middle"): "one friction rate",
}
"""What an engine cannot serve, and only finds out as it starts."""


@pytest.mark.campaign
@pytest.mark.parametrize(("name", "label"), CASES, ids=[f"{name}-{label}" for name, label in CASES])
def test_every_method_that_serves_a_scene_runs_it_and_passes(name: str, label: str, need: Need) -> None:
    need(label)
    scene = shortened(name)
    if (name, label) in LEFT_OUT_AT_START:
        with pytest.raises(MethodError, match=LEFT_OUT_AT_START[name, label]):
            driver.run(scene, label)
        return
    run = driver.run(scene, label)
    verdicts = checks.judge(scene, run)
    assert [(v.check, v.value, v.bound) for v in verdicts if v.passed is False] == []
    assert sum(v.passed is True for v in verdicts) >= 4


@pytest.mark.parametrize("name", scenes.names())
def test_every_scene_is_served_by_own_methods_and_has_a_known_motion(name: str) -> None:
    scene = scenes.load_scene(name)
    assert any(label.startswith("own:") for scene_name, label in CASES if scene_name == name)
    assert exact.has_true_motion(scene) == (scene.bath is None)
    assert scene.source


@pytest.mark.parametrize("path", sorted(REFERENCES.glob("*.json")), ids=lambda path: path.stem)
def test_the_true_motion_solves_the_equations_of_motion(path: Path) -> None:
    scene = scenes.load_scene(path.stem)
    found = json.loads(path.read_text(encoding="utf-8"))
    steps = np.array([row["steps"] for row in found["motion"]])
    assert steps[-1] == scene.steps, "the reference was to reach the end of the scene"
    for states, key in zip(exact.true_motion(scene, steps, scene.step), "qp", strict=True):
        wanted = np.array([[np.longdouble(x) for x in row[key]] for row in found["motion"]])
        size = np.max(np.abs(wanted), axis=0)
        off = np.max(np.abs(states[:, :: found["every"]] - wanted), axis=0)
        assert np.max(off / np.where(size > 0, size, 1)) <= 1e-13


def test_a_method_that_cannot_start_is_left_out_unless_it_was_asked_for(tmp_path: Path, need: Need) -> None:
    need("openmm:langevin-middle")
    scene = replace(scenes.load_scene("detest-b1"), steps=20)
    found = session.run(scene, tmp_path / "x.h5", methods=["own:*euler", "openmm:langevin*"])
    assert [run.method for run in found.runs] == [
        "own:euler",
        "own:semi-implicit-euler",
        "own:implicit-euler",
    ]
    assert any("one friction rate" in left.reason for left in found.left_out)
    with pytest.raises(MethodError, match="one friction rate"):
        session.run(scene, tmp_path / "y.h5", methods=["own:euler", "openmm:langevin-middle"])


def test_every_scene_has_a_reference() -> None:
    stiff = {path.stem for path in (REFERENCES.parent / "stiff").glob("*.json")}
    in_a_bath = {name for name in scenes.names() if scenes.load_scene(name).bath}
    missing = set(scenes.names()) - in_a_bath - {path.stem for path in REFERENCES.glob("*.json")} - stiff
    assert not missing, "python validation/references.py --write NAME"


def well(q: float, p: float, *, k: float, b: float, m: float = 3.7) -> Scene:
    return Scene(
        name="well", title="", source="", m=np.array([m]), q=np.array([q]), p=np.array([p]),
        terms=(
            WallSpring(i=np.array([0]), k=np.array([k]), at=np.array([0.4])),
            Quartic(i=np.array([0]), b=np.array([b]), at=np.array([0.4])),
        ),
        step=0.1, steps=400,
    )  # fmt: skip


def pendulum(q: float, p: float, *, depth: float = 2.3, m: float = 1.3) -> Scene:
    term = Cosine(i=np.array([0]), depth=np.array([depth]), wave=np.array([0.6]), at=np.array([0.1]))
    return Scene(
        name="pendulum", title="", source="", m=np.array([m]), q=np.array([q]), p=np.array([p]),
        terms=(term,), step=0.1, steps=400,
    )  # fmt: skip


def bond(q: float, p: float, *, steepness: float = 0.7) -> Scene:
    term = Morse(
        a=np.array([0]), b=np.array([1]), depth=np.array([4.1]), steepness=np.array([steepness]),
        rest=np.array([1.1]),
    )  # fmt: skip
    return Scene(
        name="bond", title="", source="", m=np.array([1.3, 2.9]), q=np.array([-0.2, q]), p=np.array([0.4, p]),
        terms=(term,), step=0.1, steps=400,
    )  # fmt: skip


MOTIONS = {
    "stiffening": well(0.7, 0.7, k=2.9, b=1.3),
    "quartic alone": well(0.9, 0.9, k=0.0, b=2.1),
    "across a double well": well(0.7, 2.9, k=-2.9, b=1.3),
    "caught on the right": well(1.9, 0.7, k=-2.9, b=1.3),
    "caught on the left": well(-1.2, -0.7, k=-2.9, b=1.3),
    "at the bottom of one of two wells": well(0.4 + np.sqrt(2.9 / 1.3), 0.0, k=-2.9, b=1.3),
    "on the barrier between two wells": well(0.4, 0.0, k=-2.9, b=1.3),
    "softening, below its barriers": well(0.1, -0.7, k=2.9, b=-1.3),
    "small swing": pendulum(0.2, 0.03),
    "wide swing": pendulum(-4.4, -0.3),
    "many turns from 0": pendulum(31.0, 0.9),
    "over the top": pendulum(0.2, 5.3),
    "over the top, backwards": pendulum(0.2, -5.3),
    "upside down": pendulum(0.2, 1.3, depth=-2.3),
    "bond": bond(1.3, -0.9),
    "bond near dissociation": bond(3.3, -0.9),
    "bond of negative steepness": bond(0.93, -0.9, steepness=-0.7),
    "dissociating": bond(1.3, 4.9),
    "collision": bond(9.3, -5.9),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_closed_form_starts_at_the_start_and_obeys_newton(name: str) -> None:
    """Energy stays, and dq/dt and dp/dt, by differences of eighth order, are p/m and the force.

    A step e of a difference costs EPS/e in rounding and (e w)**8 in truncation; e = 2**-8 leaves 1e-15,
    and 1e-12 where references round like doubles.
    """
    scene = MOTIONS[name]
    assert exact.has_true_motion(scene)
    e = 2.0**-8
    weights = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280], np.longdouble)
    norm = scene.system.norm
    start = exact.true_motion(scene, np.array([0]), e)
    assert norm(start[0] - scene.q, start[1] - scene.p)[0] < 64 * exact.EPS
    for centre in (4, 100, 1000, 9000):
        q, p = exact.true_motion(scene, centre + np.arange(-4, 5), e)
        dq, dp = weights @ q / e, weights @ p / e
        force = scene.system.force(q[4:5], p[4:5])[0]
        scale = np.max(np.abs(q)) + np.max(np.abs(p)) + np.max(np.abs(force))
        rounding = 64 * exact.EPS / e
        assert np.max(np.abs(dq - p[4] / scene.m)) < max(1e-14, rounding) * scale
        assert np.max(np.abs(dp - force)) < max(1e-13, rounding) * scale
        energy = scene.system.energy(q[4:5], p[4:5])[0] - scene.system.energy(*start)[0]
        assert abs(energy) <= max(1e-14, rounding) * float(norm.unit) ** 2


@pytest.mark.parametrize(
    "scene",
    [
        well(2.9, 0.0, k=2.9, b=-1.3),
        well(0.1, 9.0, k=2.9, b=-1.3),
    ],
    ids=["beyond the barrier", "over the barrier"],
)
def test_a_motion_that_ends_at_infinity_has_no_reference(scene: Scene) -> None:
    assert "singular" in exact.no_reference(scene)
    with pytest.raises(ValueError, match="no reference solution"):
        exact.true_motion(scene, np.array([1]), 0.1)


def test_groups_of_different_laws_move_as_each_does_alone() -> None:
    parts = [
        MOTIONS["stiffening"],
        MOTIONS["wide swing"],
        MOTIONS["bond"],
        scenes.load_scene("spring-uneven"),
    ]
    offset, terms = 0, []
    for part in parts:
        for term in part.terms:
            moved = {name: getattr(term, name) + offset for name in term.ends}
            terms.append(replace(term, **moved))  # type: ignore[type-var]
        offset += part.n
    whole = replace(
        parts[0],
        terms=tuple(terms),
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in ("m", "q", "p")},
    )
    steps = np.array([0, 17, 400])
    q, p = exact.true_motion(whole, steps, 0.1)
    alone = [exact.true_motion(part, steps, 0.1) for part in parts]
    for row, step in enumerate(steps):
        stated = whole.system.solution.doubt(0.1 * float(step))
        for together, each, bound in zip((q, p), zip(*alone, strict=True), stated, strict=True):
            assert np.all(np.abs(together[row] - np.concatenate(each, axis=1)[row]) <= 2 * bound)


@pytest.mark.parametrize("name", [name for name in scenes.names() if scenes.load_scene(name).bath is None])
def test_own_methods_compiled_and_interpreted_agree_to_the_last_bit(name: str) -> None:
    pytest.importorskip("numba")
    scene = shortened(name)
    own_methods = engines.engine("own").methods.values()
    able = [one for one in own_methods if not engines.refusal(scene, engines.parse(f"own:{one.name}"))]
    assert able
    for method in able:
        states = []
        for compiled in (False, True):
            q, p = np.empty((2, 8, scene.n))
            with np.errstate(all="ignore"):
                own.prepare(scene, method.scheme, scene.step, compiled=compiled).advance(3, q, p)
            states.append((q, p))
        assert np.array_equal(states[0][0], states[1][0], equal_nan=True)
        assert np.array_equal(states[0][1], states[1][1], equal_nan=True)


WAVE_NUMBERS = {"carbon-monoxide": (2169.81358, 1e-7), "ch-bond": (2936.43, 2e-6)}
"""1/cm and how precisely it is known: the scene's stiffness has ten digits; CH by sqrt(k/mass)/2 pi c."""

LIGHT = 299792458.0 * 100 * 1e-12
"""Speed of light in cm/ps, exact since 1983."""


def length(run: Trajectory) -> Floats:
    return np.asarray(run.q[:, 1] - run.q[:, 0])


@pytest.mark.parametrize("name", WAVE_NUMBERS)
@pytest.mark.parametrize(
    "label", ["openmm:verlet", "openmm:leapfrog", "ase:velocity-verlet", "own:semi-implicit-euler"]
)
def test_engines_give_a_molecule_its_wave_number(name: str, label: str, need: Need) -> None:
    """From u(n+1) + u(n-1) = 2 cos(W h) u(n), as for every Verlet; sin(W h/2) = w h/2 undoes it."""
    need(label)
    scene = scenes.load_scene(name)
    term = scene.terms[0]
    assert isinstance(term, Spring)
    u = length(driver.run(scene, label)) - term.rest[0]
    twice = float(u[1:-1] @ (u[2:] + u[:-2]) / (u[1:-1] @ u[1:-1]))
    w = 2 * np.sqrt((2 - twice) / 4) / scene.step
    wanted, digits = WAVE_NUMBERS[name]
    assert w / (2 * np.pi * LIGHT) == pytest.approx(wanted, rel=digits)


@pytest.mark.parametrize("name", ["carbon-monoxide", "ch-bond", "morse-bond"])
def test_a_molecule_moves_alike_in_nanometres_and_in_angstroms(name: str, need: Need) -> None:
    """Each conversion rounds once; errors of each step are carried on for the rest of the run."""
    need("openmm:verlet")
    need("ase:velocity-verlet")
    scene = scenes.load_scene(name)
    one, other = driver.run(scene, "openmm:verlet"), driver.run(scene, "ase:velocity-verlet")
    case = checks.Case(trajectory=other, scene=scene)
    hw = scene.step * fastest(case)
    rounding = float(np.max(scene.system.norm(*case.allowance)))
    allowed = 2 * case.roundings * rounding * scene.steps * (1 + scene.steps * hw)
    assert np.max(scene.system.norm(one.q - other.q, one.p - other.p)) <= allowed
    assert allowed < 1e-6


def test_the_bond_of_hydrogen_chloride_has_its_spectroscopic_constants() -> None:
    term = scenes.load_scene("morse-bond").terms[0]
    m = scenes.load_scene("morse-bond").m
    assert isinstance(term, Morse)
    mass = m[0] * m[1] / np.sum(m)
    w = term.steepness[0] * np.sqrt(2 * term.depth[0] / mass)
    assert w / (2 * np.pi * LIGHT) == pytest.approx(2990.9463, rel=1e-7)
    planck, u = 6.62607015e-34, 1.66053906892e-27
    per_cm = planck * LIGHT * 1e12 / (u * 1e6)
    assert (w / (2 * np.pi * LIGHT)) ** 2 / (4 * term.depth[0] / per_cm) == pytest.approx(52.8186, rel=1e-6)


def test_a_circuit_is_an_oscillator_of_charge_and_flux() -> None:
    scene = scenes.load_scene("rlc-circuit")
    assert scene.kind == "circuit"
    assert scene.units == "si"
    assert scene.m.tolist() == [3.3e-3]
    modes = scene.system.modes
    assert float(modes.w2[0]) == pytest.approx(1 / (3.3e-3 * 47e-9), rel=1e-15)
    assert float(modes.rate[0]) == pytest.approx(22.0 / 3.3e-3, rel=1e-15)
    left = {one.method: one.reason for one in session.choose(scene, ())[1]}
    assert left["openmm:verlet"] == "OpenMM moves particles, not circuits"
    assert left["ase:velocity-verlet"] == "ASE moves particles, not circuits"


def test_two_loops_share_a_capacitor() -> None:
    """Equal loops: in phase the shared capacitor carries nothing, against each other twice the charge."""
    text = (scenes.folder() / "lc-circuit.toml").read_text(encoding="utf-8")
    second = "[[inductor]]\ninductance = 3.3e-3\n\n[[capacitor]]\nloops = [1]\ncapacitance = 47e-9\n\n"
    shared = "[[capacitor]]\nloops = [0, 1]\ncapacitance = 10e-9\n\n"
    scene = scenes.parse(text.replace("[time]", second + shared + "[time]"), name="two")
    w2 = np.sort(scene.system.modes.w2)
    expected = np.array([1 / 47e-9, 1 / 47e-9 + 2 / 10e-9]) / 3.3e-3
    assert np.max(np.abs(w2 / expected - 1)) < 1e-15


FREE = 'title = "x"\n[[particle]]\nmass = 1.3\n[time]\nstep = 0.1\nsteps = 10\n'
BOND = "[[morse]]\nends = [0, 0]\ndepth = 1.0\nsteepness = 1.0\nrest = 1.0\n"
PENDULUM = "[[cosine]]\nparticle = 0\ndepth = 1.0\nwave = 0.0\n"
MISTAKES = {
    "an unknown field of a term": (
        "[[quartic]]\nparticle = 0\nstrength = 1.0\n",
        ("quartic[0]", "strength", "coefficient, at"),
    ),
    "a missing field of a term": ("[[cosine]]\nparticle = 0\n", ("cosine[0]", "depth")),
    "a particle that is not there": (
        "[[quartic]]\nparticle = 3\ncoefficient = 1.0\n",
        ("quartic[0].particle = 3", "0 to 0"),
    ),
    "a wave of zero": (PENDULUM, ("cosine[0].wave", "0.0", "> 0")),
    "a bond to itself": (BOND, ("morse[0].ends", "same particle")),
    "a bond that pushes": (BOND.replace("depth = 1", "depth = -1"), ("morse[0].depth", "-1.0", "> 0")),
    "a capacitor in a mechanical scene": (
        "[[capacitor]]\nloops = [0]\ncapacitance = 1.0\n",
        ("circuit", "[[inductor]]"),
    ),
    "two kinds of things that move": ("[[inductor]]\ninductance = 1.0\n", ("[[particle]]", "[[inductor]]")),
    "a kind that the tables deny": ('kind = "circuit"\n', ("kind = 'circuit'", "[[particle]]")),
    "a term that is not there": ("[[magnet]]\nparticle = 0\n", ("magnet", "quartic", "spring")),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_term_is_answered_with_its_field_and_what_is_accepted(name: str) -> None:
    table, words = MISTAKES[name]
    text = table + FREE if table.startswith("kind") else FREE + table
    with pytest.raises(SceneError) as caught:
        scenes.parse(text, name="bad", where="bad.toml")
    for word in ("bad.toml", *words):
        assert word in str(caught.value), str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("masses = 1000", "masses = 0", ("chain.masses", "0", ">= 1")),
        ("mode = 400", "mode = 4000", ("chain.wave[2].mode = 4000", "the highest of this chain is 1000")),
        ("mode = 400", "mode = 0", ("chain.wave[2].mode", ">= 1")),
    ],
)
def test_a_mistake_in_a_chain_is_answered(old: str, new: str, words: tuple[str, ...]) -> None:
    text = (scenes.folder() / "long-chain.toml").read_text(encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        scenes.parse(text.replace(old, new), name="bad", where="bad.toml")
    for word in ("bad.toml", *words):
        assert word in str(caught.value), str(caught.value)


def test_a_chain_of_any_length_stands_between_walls() -> None:
    text = (scenes.folder() / "long-chain.toml").read_text(encoding="utf-8").split("[[chain.wave]]")
    for masses in (1, 2, 5):
        wave = "[[chain.wave]]\nmode = 1\namplitude = 0.7\n\n[time]\nstep = 0.1\nsteps = 10\n"
        scene = scenes.parse(text[0].replace("1000", str(masses)) + wave, name="x")
        w2 = np.sort(scene.system.modes.w2)
        wanted = 4 * 2.9 / 1.3 * np.sin(np.pi * np.arange(1, masses + 1) / (2 * (masses + 1))) ** 2
        assert np.max(np.abs(w2 - wanted)) < 1e-14


def test_a_new_file_in_the_folder_is_a_scene_with_no_other_edit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(scenes.folder(), tmp_path / "scenes")
    text = (scenes.folder() / "anharmonic.toml").read_text(encoding="utf-8")
    (tmp_path / "scenes" / "harder.toml").write_text(
        text.replace("coefficient = 1.7", "coefficient = 5.9"), encoding="utf-8"
    )
    monkeypatch.setattr(scenes, "folder", lambda: tmp_path / "scenes")
    monkeypatch.chdir(tmp_path)
    assert "harder" in [scene["name"] for scene in listing.listing()["scenes"]]
    assert main(["run", "harder", "--method", "own:*euler", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["scene"] == "harder"
    assert all(v["passed"] is not False for v in found["verdicts"])
    assert (tmp_path / "harder.h5").is_file()


def test_the_heaviest_mass_has_its_energy() -> None:
    text = (scenes.folder() / "spring.toml").read_text()
    scene = scenes.parse(text.replace("mass = 1.0", "mass = 1.6e308"), name="heavy")
    assert float(scene.system.kinetic_energy(np.array([3e10]))) == 9e20 / 1.6e308 / 2
