"""Bonds in space, which know their length and no direction: run, judged, identified, and read from files."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import textbook as steppers
from springcheck import checks, driver, engines, schemes
from springcheck.cli import main
from springcheck.errors import SceneError
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import RadialSpring, Spring, WallSpring

Need = Callable[[str], None]
VERLET = schemes.SCHEMES["velocity-verlet"]


def diatomic(**changes: Any) -> Scene:
    return replace(scenefile.load_scene("diatomic"), **{"steps": 200} | changes)


def turning() -> Scene:
    """Three unlike masses on three bonds, none along an axis, which swing, turn and drift."""
    text = scenefile.load_scene("diatomic").to_toml()
    more = "\n[[particle]]\nmass = 2.3\nposition = [4.9, 0.9, 5.1]\nmomentum = [0.3, 0.7, -0.9]\n\n[[bond]]\n"
    text = text.replace("\n[[bond]]\n", more, 1)
    for one in (0, 1):
        text += f"\n[[bond]]\nends = [{one}, 2]\nstiffness = {1.7 + one}\nrest = 0.9\n"
    return scenefile.parse(text, name="turning")


@pytest.mark.parametrize("every", [1, 5])
@pytest.mark.parametrize(
    "label",
    ["own:velocity-verlet", "own:semi-implicit-euler", "own:yoshida4", "openmm:verlet", "openmm:leapfrog",
     "lammps:bond", "lammps:external"],
)  # fmt: skip
def test_right_engines_pass_every_check_of_a_molecule(label: str, every: int, need: Need) -> None:
    need(label)
    scene = diatomic(every=every)
    verdicts = checks.judge(scene, driver.run(scene, label))
    assert [v for v in verdicts if v.passed is False] == []
    assert {"step-defect", "momentum", "angular-momentum"} <= {v.check for v in verdicts if v.passed}


@pytest.mark.parametrize("label", ["own:velocity-verlet", "own:rk4", "ase:velocity-verlet", "openmm:verlet",
                                   "openmm:euler", "lammps:bond"])  # fmt: skip
def test_right_engines_pass_where_bonds_turn_and_share_particles(label: str, need: Need) -> None:
    need(label)
    scene = replace(turning(), steps=60)
    verdicts = checks.judge(scene, driver.run(scene, label))
    assert [v for v in verdicts if v.passed is False] == []
    assert {"step-defect", "momentum"} <= {v.check for v in verdicts if v.passed}


@pytest.mark.parametrize("key", ["bond", "morse"])
def test_a_pair_of_which_one_end_is_on_a_spring_too_is_run_and_judged(key: str) -> None:
    lines = (
        ["rest = 0.7", "stiffness = 3.1"]
        if key == "bond"
        else ["rest = 0.7", "depth = 3.1", "steepness = 0.9"]
    )
    axes = (lambda x, y: [x, y]) if key == "bond" else (lambda x, y: x)
    text = "".join(
        f"[[particle]]\nmass = {m}\nposition = {axes(*q)}\nmomentum = {axes(0.3, -0.2)}\n"
        for m, q in ((1.3, (0.1, 0.2)), (0.9, (0.9, -0.1)))
    )
    text += "\n".join([f"[[{key}]]", "ends = [0, 1]", *lines])
    text += '\n[[spring]]\nends = ["wall", 0]\nstiffness = 2.3\n[time]\nstep = 0.05\nsteps = 40\n'
    scene = scenefile.parse(f'title = "held"\n{text}', name="held")
    verdicts = checks.judge(scene, driver.run(scene, "own:velocity-verlet"))
    assert {v.check: v.passed for v in verdicts}["step-defect"] is True
    assert [v for v in verdicts if v.passed is False] == []


def wrong(name: str, scene: Scene) -> Callable[[Reals, Reals], Reals]:
    """The force of one bond between particles 0 and 1, with a mistake."""
    (bond,) = scene.terms
    k, rest = float(bond.k[0]), float(bond.rest[0])  # type: ignore[attr-defined]
    first = scene.q[3:] - scene.q[:3]

    def force(q: Reals, p: Reals) -> Reals:
        d = q[3:] - q[:3]
        s = np.sqrt(d @ d)
        e, pull = d / s, k * (s - rest)
        if name == "a spring along each axis":
            pull, e = np.asarray(k), d - rest
        elif name == "a length without z":
            pull = k * (np.hypot(d[0], d[1]) - rest)
        elif name == "along the first direction":
            e = first / np.sqrt(first @ first) * (1 + 1e-9 * np.arange(3))
        elif name == "a rest length off by 1e-12":
            pull = k * (s - rest * (1 + 1e-12))
        elif name == "twice the force":
            pull = 2 * pull
        elif name == "the force over the length twice":
            e = e / s
        elif name == "z in single precision":
            e = np.append(e[:2], np.float64(np.float32(e[2])))
        return np.concatenate([pull * e, -pull * e * (1 + 1e-11 * (name == "no reaction"))])

    return force


WRONG = {
    "a spring along each axis": {"angular-momentum"},
    "a length without z": set[str](),
    "along the first direction": {"angular-momentum"},
    "a rest length off by 1e-12": set[str](),
    "twice the force": set[str](),
    "the force over the length twice": set[str](),
    "z in single precision": {"angular-momentum"},
    "no reaction": {"momentum"},
}


@pytest.mark.parametrize("name", ["", *WRONG])
@pytest.mark.parametrize("every", [1, 5])
def test_a_bond_that_is_wrong_is_rejected_by_the_checks_that_name_it(name: str, every: int) -> None:
    scene = diatomic(every=every)
    run = steppers.record(scene, VERLET, steppers.textbook(scene, VERLET, force=wrong(name, scene)))
    failed = {v.check for v in checks.judge(replace(scene, quantities=("q", "p")), replace(run, energy=None))
              if v.passed is False}  # fmt: skip
    assert failed >= {"step-defect", *WRONG[name]} if name else failed == set()


def test_forces_second_derivatives_and_changes_belong_to_the_energy() -> None:
    scene = turning()
    system, q = scene.system, scene.q.astype(np.longdouble)
    h = np.longdouble(2.0**-12)
    unit = np.eye(scene.n, dtype=np.longdouble) * h

    def slope(of: Callable[[Reals], Reals]) -> Any:
        # fourth order: the next term is h**4
        return np.stack(
            [(8 * (of(q + x) - of(q - x)) - of(q + 2 * x) + of(q - 2 * x)) / (12 * h) for x in unit]
        )

    def force(at: Reals) -> Reals:
        return system.force(at, np.zeros_like(at))

    assert np.max(np.abs(slope(lambda at: system.energy(at, 0 * at)) + force(q))) < 1e-11
    assert np.max(np.abs(slope(force) + system.hessian(q))) < 1e-11
    (term,) = scene.terms
    out = np.zeros((scene.n, scene.n), dtype=np.longdouble)
    for row, one in zip(out, np.eye(scene.n, dtype=np.longdouble), strict=True):
        term.add_change(q, q, one, one, row)
    assert np.max(np.abs(out + system.hessian(q))) < 1e-15
    bound = np.sum(np.abs(system.hessian(q)), axis=1)
    assert np.all(bound <= system.gershgorin(q) * (1 + 1e-12))


def test_copies_side_by_side_keep_their_bonds_apart() -> None:
    scene = turning()
    two = scene.system.tiled(2)
    one = scene.system.force(scene.q, scene.p)
    assert np.array_equal(two.system.force(two.q, two.p), np.tile(one, 2))
    part = two.system.part(np.arange(scene.n, 2 * scene.n))
    assert np.array_equal(part.system.force(part.q, part.p), one)
    (term,) = scene.terms
    joined: Any = term.joined(term)
    assert len(np.unique(joined.number)) == 2 * len(np.unique(term.number))  # type: ignore[attr-defined]


def test_a_rounding_of_the_force_is_bounded() -> None:
    scene = turning()
    rng = np.random.default_rng(1)
    q = scene.q + rng.normal(0, 0.3, (2000, scene.n))
    wide = q.astype(np.longdouble)
    off = np.abs(scene.system.force(q, q) - scene.system.force(wide, wide))
    bound = scene.system.magnitude(wide)(np.abs(wide), np.abs(wide)) * 2.0**-53
    assert np.all(off <= 4 * bound)
    if np.finfo(np.longdouble).eps < 1e-16:
        assert np.max(off / bound) > 0.1


FILE = """title = "t"
particle = [{mass = 1.3, position = [0, 0], momentum = [0, 0]},
  {mass = 2.1, position = [0.3, 0.4], momentum = [0.8, -0.6]}, {mass = 1.0, position = 1.0, momentum = 0}]
time = {step = 0.1, steps = 10}
bond = [%s]
"""


def test_a_scene_with_bonds_is_written_and_read_with_the_same_numbers() -> None:
    for scene in (
        diatomic(),
        turning(),
        scenefile.parse(FILE % "{ends = [1, 0], stiffness = 2.9}", name="a"),
    ):
        assert scenefile.parse(scene.to_toml(), name="a").digest == scene.digest
    assert any(isinstance(term, RadialSpring) for term in diatomic().terms)


@pytest.mark.parametrize(
    ("bond", "said"),
    [
        ("{ends = [0, 0], stiffness = 1}", "the two ends are the same particle"),
        ("{ends = [0, 3], stiffness = 1}", "bond[0].ends = 3: particles here are numbered from 0 to 2"),
        ("{ends = [0, 2], stiffness = 1}", "the two move along"),
        ("{ends = [0, 1]}", "stiffness"),
        ("{ends = [0, 1], stiffness = 1, rest = -1}", "rest"),
        ("{ends = ['wall', 'wall'], stiffness = 1}", "bond[0].ends: a bond between two walls"),
        ("{ends = ['wall', 1], stiffness = 1, wall = [1, 2, 3, 4]}", "wall"),
    ],
)
def test_mistakes_in_bonds_are_said_in_a_line(bond: str, said: str) -> None:
    with pytest.raises(SceneError) as caught:
        scenefile.parse(FILE % bond, name="a")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def dump(path: Path, q: Floats, v: Floats, m: Floats) -> Path:
    """As LAMMPS writes it, the atoms in another order."""
    with path.open("w") as file:
        for i, (at, speed) in enumerate(zip(q.reshape(len(q), -1, 3), v.reshape(len(v), -1, 3), strict=True)):
            file.write(f"ITEM: TIMESTEP\n{i}\nITEM: NUMBER OF ATOMS\n{len(m)}\n")
            file.write("ITEM: BOX BOUNDS ss ss ss\n" + 3 * "-20 20\n")
            file.write("ITEM: ATOMS id mass x y z vx vy vz\n")
            for j in reversed(range(len(m))):
                row = [j + 1, float(m[j]), *at[j].tolist(), *speed[j].tolist()]
                file.write(" ".join(map(repr, row)) + "\n")
    return path


def test_a_dump_of_a_molecule_along_no_axis_is_judged_and_identified(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = diatomic()
    run = driver.run(scene, "own:velocity-verlet")
    path = dump(tmp_path / "a.dump", run.q, run.p / scene.m, scene.masses)
    given = ["judge", str(path), "--scene", "diatomic", "--scheme", "velocity-verlet", "--step", "0.1"]
    assert main([*given, "--verdicts", "--partial"]) == 0
    assert "angular-momentum" in capsys.readouterr().out
    assert main([*given[:5], "semi-implicit-euler", *given[6:]]) == 1
    capsys.readouterr()
    assert main(["identify", str(path), "--step", "0.1"]) == 0
    said = capsys.readouterr().out
    assert "a.dump: velocity-verlet" in said
    assert "1.73624681844" in said
    # counters of the borders of a box
    rows = path.read_text().replace("vx vy vz", "vx vy vz ix iy iz")
    path.write_text(re.sub(r"(?m)^(\d+ [\d.]+( \S+){6})$", r"\1 0 0 0", rows))
    assert main(["identify", str(path), "--step", "0.1"]) == 0
    capsys.readouterr()
    path.write_text(path.read_text().replace(" 0 0 0\n", " 0 -1 0\n"))
    assert main(["identify", str(path), "--step", "0.1"]) == 2
    assert "wrapped into a box" in capsys.readouterr().err


def test_methods_without_bonds_say_so() -> None:
    for label in ("own:implicit-midpoint", "openmm:langevin-middle", "lammps:spring-self"):
        assert "has no bond term" in (engines.refusal(diatomic(), engines.parse(label)) or "") or label
    assert engines.refusal(diatomic(), engines.parse("lammps:spring-self")) == "it has no bond term"


def test_a_pair_along_no_axis_and_far_from_0_is_judged_by_a_scene_along_x(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same molecule as a spring of a rest length along one axis: what counts is its line."""
    text = FILE.partition("particle")[0] + (
        "particle = [{mass = 3.7, position = 0, momentum = 1.665}, "
        "{mass = 1.3, position = 1.2, momentum = -0.195}]\n"
        "spring = [{ends = [0, 1], stiffness = 2.9, rest = 1.05}]\ntime = {step = 0.1, steps = 200}\n"
    )
    (tmp_path / "line.toml").write_text(text)
    scene = diatomic()
    run = driver.run(scene, "own:velocity-verlet")
    path = dump(tmp_path / "a.dump", run.q, run.p / scene.m, scene.masses)
    given = ["judge", str(path), "--step", "0.1", "--scene", str(tmp_path / "line.toml"), "--scheme"]
    assert main([*given, "velocity-verlet"]) == 0
    said = capsys.readouterr().out
    assert "positions counted from" in said
    assert main([*given, "semi-implicit-euler"]) == 1
    q = run.q.copy()
    q[7:, 5] += 1e-9
    dump(path, q, run.p / scene.m, scene.masses)
    assert main([*given, "velocity-verlet"]) == 1


def test_a_file_of_points_in_space_is_judged_by_a_scene_in_a_plane(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = Scene(
        m=[3.7, 3.7, 1.3, 1.3], q=[4.0, 0.2, 4.3, -0.1], p=[2.9, -0.7, 0.4, -1.1], places=[0, 1, 3, 4],
        step=0.1, steps=100, terms=(Spring(a=[0, 1], b=[2, 3], k=[2.9, 2.9], rest=[0.0, 0.0]),),
    )  # fmt: skip
    (tmp_path / "plane.toml").write_text(scene.to_toml())
    run = driver.run(scene, "own:velocity-verlet")
    q, v = np.full((2, len(run.t), 6), 1.7)
    v[:] = 0
    q[:, scene.where], v[:, scene.where] = run.q, run.p / scene.m
    path = dump(tmp_path / "a.dump", q, v, scene.masses)
    plane = ["--scene", str(tmp_path / "plane.toml"), "--scheme", "velocity-verlet"]
    given = ["judge", str(path), "--step", "0.1", *plane]
    assert main([*given, "--verdicts"]) == 0
    assert "angular-momentum" in capsys.readouterr().out
    v[50:, 1] += 1e-9
    dump(path, q, v, scene.masses)
    assert main(given) == 1
    # a plane that drifts is no plane of the scene
    q[:, 2] += np.arange(len(q)) * 0.01
    dump(path, q, v, scene.masses)
    assert main(given) == 2
    assert "is along axes that scene plane leaves out" in capsys.readouterr().err


@pytest.mark.parametrize("label", ["lammps:bond", "lammps:external"])
def test_lammps_keeps_atoms_that_begin_far_apart(label: str, need: Any) -> None:
    """The margin of its box is a part of the box's first width, and was lost to rounding beyond 2**40."""
    need(label)
    wall = WallSpring(i=[0], k=[2.9], at=[0.0])
    scene = Scene(m=[1.3], q=[3e17], p=[0.1], terms=(wall,), step=0.1, steps=3)
    run = driver.run(scene, label)
    assert run.outcome.status == "complete"
    assert [v.check for v in checks.judge(scene, run) if v.passed is False] == []
