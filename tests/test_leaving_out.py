"""A run imports, computes and stores only what its scene and methods ask for."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from springcheck import driver
from springcheck.engines.own import kernels
from springcheck.engines.own import loops as own_loops
from springcheck.engines.own import simulation as own
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Reals
from springcheck.physics.terms import Damping, Spring
from springcheck.studies.run import measure as session

Need = Callable[[str], None]

ENGINES = {"openmm", "ase", "sksundae"}
HEAVY = {"numba", "matplotlib", "scipy"}


def imported(folder: Path, *calls: str) -> list[set[str]]:
    """Modules that are there after each of these commands and imports, carried out in one interpreter."""
    code = (
        "import sys; from springcheck.cli import main\n"
        "for call in sys.argv[1:]:\n"
        "    if call.startswith('import '): exec(call)\n"
        "    elif status := main(call.split()): sys.exit(status)\n"
        "    print('modules:', *sys.modules, file=sys.stderr)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *calls], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    # scenes have their notes beside
    return [set(line.split()[1:]) for line in done.stderr.splitlines() if line.startswith("modules: ")]


@pytest.fixture(scope="module")
def after(tmp_path_factory: pytest.TempPathFactory, whole: bool) -> dict[str, set[str]]:
    """What is imported after kinds of runs, one kind after another in one interpreter."""
    # in a bath thermostats move, and draw numbers
    short = [name for name in scenes.names() if name != "long-chain" and scenes.load_scene(name).bath is None]
    calls = {
        "a small run in a pipe": ["run spring --method own:euler --force"],
        "own methods": [
            *(f"run {name} --method own:*semi* --force --quiet" for name in short[:: 1 if whole else 4]),
            # what every worker imports where a call brings a function or an engine
            "import springcheck.doors",
        ],
        "a circuit": ["run lc-circuit --force --quiet"],
        "every engine": ["run spring --force --quiet"],
    }
    found = iter(
        imported(tmp_path_factory.mktemp("runs"), *(call for some in calls.values() for call in some))
    )
    return {kind: [next(found) for _ in some][-1] for kind, some in calls.items()}


def test_own_methods_import_no_engine_and_nothing_heavy(after: dict[str, set[str]]) -> None:
    assert not after["own methods"] & (ENGINES | HEAVY)
    assert "h5py" in after["own methods"]


def test_enough_spring_steps_for_compiling_to_pay_import_the_compiler_and_no_engine(tmp_path: Path) -> None:
    text = scenes.text_of("spring").replace("steps = 200", f"steps = {own.WORTH}")
    (tmp_path / "long.toml").write_text(f"{text}\n[record]\nevery = {own.WORTH // 100}\n")
    (found,) = imported(tmp_path, "run long.toml --method own:semi-implicit-euler --quiet")
    assert "numba" in found
    assert not found & (ENGINES | {"matplotlib"})


def test_a_circuit_starts_no_particle_engine(after: dict[str, set[str]], need: Need) -> None:
    need("sundials:bdf")
    assert "sksundae" in after["a circuit"]
    assert not after["a circuit"] & {"openmm", "ase", "numba", "matplotlib"}


def test_two_hundred_steps_of_a_spring_compile_and_draw_nothing(
    after: dict[str, set[str]], need: Need
) -> None:
    assert not after["every engine"] & {"numba", "matplotlib"}
    need("ase:velocity-verlet")
    assert "ase" in after["every engine"]


def test_a_run_in_a_pipe_draws_no_text_and_a_small_one_imports_what_it_needs(
    after: dict[str, set[str]],
) -> None:
    found = after["a small run in a pipe"]
    # numpy.unique imports masked arrays, 8 ms
    assert not found & {"rich", "numpy.ma"}
    ours = {name.removeprefix("springcheck.") for name in found}
    assert not ours & {"studies.tables", "studies.stability.longest", "identify"}
    assert "store.journal" in ours


def stored(name: str, folder: Path, **changes: Any) -> dict[str, tuple[int, ...]]:
    """The arrays that take bytes in the store of a scene run by an own method: path and shape.

    Virtual arrays show numbers that lie elsewhere, and y and z as 0, and hold none of their own.
    """
    scene = replace(scenes.load_scene(name), **changes)
    session.run(scene, folder / "store.h5", methods=["own:semi-implicit-euler"])
    found: dict[str, tuple[int, ...]] = {}

    def look(path: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and not node.is_virtual:
            found[path] = node.shape

    with h5py.File(folder / "store.h5") as file:
        file.visititems(look)
    return found


def test_energies_are_stored_only_where_they_are_asked_for(tmp_path: Path) -> None:
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    assert any("energy" in path for path in stored("spring", tmp_path / "with"))
    without = stored("spring", tmp_path / "without", quantities=("q", "p"))
    assert not any("energy" in path for path in without)


@pytest.mark.parametrize(("name", "n"), [("carbon-monoxide", 2), ("lc-circuit", 1)])
def test_neither_y_nor_z_is_stored_and_no_velocity_of_what_is_no_particle(
    name: str, n: int, tmp_path: Path
) -> None:
    arrays = stored(name, tmp_path)
    frames = scenes.load_scene(name).frames
    wide = {path: shape for path, shape in arrays.items() if "own:" in path and shape[:1] == (frames,)}
    assert wide
    assert all(int(np.prod(shape[1:])) in (1, n) for shape in wide.values()), wide
    assert any("velocity" in path for path in wide) == (name == "carbon-monoxide")


def test_a_frame_is_recorded_only_as_often_as_asked(tmp_path: Path) -> None:
    arrays = stored("spring", tmp_path, every=50)
    assert {shape[0] for path, shape in arrays.items() if path.startswith("observables")} == {5}


@pytest.mark.parametrize(
    ("name", "loops"),
    [
        ("spring", []),
        ("free", []),
        ("anharmonic", ["wall-spring", "quartic"]),
        ("pendulum", ["cosine"]),
        ("morse-bond", ["morse"]),
        ("carbon-monoxide", ["tensions"]),
        ("chain", ["tensions"]),
        ("rlc-circuit", ["held", "slowed"]),
    ],
)
def test_own_methods_evaluate_the_terms_of_the_scene_and_no_others(
    name: str, loops: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Rows have loops of their own, index lists are walked where they hold something; a spring needs none."""
    called: list[str] = []

    def watch(loop: str) -> None:
        original = getattr(own_loops, loop)

        def watched(*arguments: Any) -> None:
            called.append(loop)
            original(*arguments)

        for module in (own_loops, kernels):
            if hasattr(module, loop):
                monkeypatch.setattr(module, loop, watched)

    def by_index(terms: Any, *arguments: Any) -> None:
        called.extend(key for key, rows in zip(own_loops.KINDS, terms, strict=False) if len(rows[0]))
        indexed(terms, *arguments)

    indexed = own_loops.indexed
    monkeypatch.setattr(own_loops, "indexed", by_index)
    for loop in ("held", "tensions", "slowed"):
        watch(loop)
    scene = scenes.load_scene(name)
    q, p = np.empty((2, 1, scene.n))
    own.prepare(scene, "explicit-euler", scene.step, compiled=False).advance(1, q, p)
    assert called == loops


def test_a_term_is_evaluated_once_a_step(monkeypatch: pytest.MonkeyPatch, need: Need) -> None:
    need("ase:velocity-verlet")
    counted = {"spring": 0, "damping": 0}
    for key, term in (("spring", Spring), ("damping", Damping)):
        original = term.add_force

        def counting(self: Any, q: Reals, p: Reals, out: Reals, key: str = key, f: Any = original) -> None:
            counted[key] += 1
            f(self, q, p, out)

        monkeypatch.setattr(term, "add_force", counting)
    driver.run(scenes.load_scene("carbon-monoxide"), "ase:velocity-verlet")
    assert counted == {"spring": 401, "damping": 0}


def test_what_was_left_out_is_said_in_one_line_for_each_reason() -> None:
    from springcheck.studies.choose import choose, left_out

    _, left, _ = choose(scenes.load_scene("lc-circuit"), ())
    lines = [str(line) for line in left_out(left) if str(line)]
    assert len(lines) == len({one.reason for one in left})
    assert any("OpenMM moves particles, not circuits" in line for line in lines)
