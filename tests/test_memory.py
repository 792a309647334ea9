"""What a machine cannot hold is refused before it is begun, in one line with the bytes; the rest takes memory
linear in the number of particles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import springcheck
from springcheck.cli import main
from springcheck.errors import SceneError, StoreError
from springcheck.physics import builders, exact, memory, scenefile
from springcheck.store import draft

CHAIN = (scenefile.folder() / "long-chain.toml").read_text()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def has(monkeypatch: pytest.MonkeyPatch, size: float) -> None:
    """This much memory is there."""
    monkeypatch.setattr(memory, "available", lambda: int(size))


def machine(root: Path, **files: str) -> Path:
    for name, text in files.items():
        path = root / {"meminfo": "proc/meminfo"}.get(name, f"sys/fs/cgroup/{name.replace('_', '.', 1)}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


def test_what_is_available_is_the_least_of_machine_and_group(tmp_path: Path) -> None:
    said = "MemTotal: 9000 kB\nMemAvailable:    5000 kB\n"
    assert memory.available(machine(tmp_path / "a", meminfo=said)) == 5_120_000
    group = {"memory_max": "3000000\n", "memory_current": "1000000\n"}
    assert memory.available(machine(tmp_path / "b", meminfo=said, **group)) == 2_000_000
    group["memory_max"] = "max\n"
    assert memory.available(machine(tmp_path / "c", meminfo=said, **group)) == 5_120_000
    assert memory.available(machine(tmp_path / "d", memory_current="7")) is None


@pytest.mark.parametrize(
    ("masses", "size", "words"),
    [
        ("9223372036854775808", 1e10, ("9223372036854775808 masses", "10 GB are available")),
        ("1000000000", 1e10, ("1000000000 masses", "150 GB")),
        ("100000", 2e8, ("100000 particles by 2 methods", "0.3 GB of memory", "0.2 GB are available")),
    ],
)
def test_a_chain_that_memory_cannot_hold_is_refused_before_it_runs(
    masses: str,
    size: float,
    words: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    has(monkeypatch, size)
    Path("c.toml").write_text(CHAIN.replace("masses = 1000", f"masses = {masses}"))
    assert main(["run", "c.toml", "--method", "own:euler", "--method", "own:velocity-verlet"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert all(word in said for word in words), said
    assert [path.name for path in Path().iterdir()] == ["c.toml"]


def test_a_trajectory_that_memory_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = springcheck.load_scene("long-chain")
    has(monkeypatch, 1e6)
    with pytest.raises(SceneError, match=r"101 frames of 1000 particles take 0.00162 GB .* 0.001 GB are"):
        springcheck.simulate(scene, "own:euler")


def test_matrices_of_a_long_chain_are_refused_where_memory_does_not_hold_them() -> None:
    system = builders.chain(1_000_000).system
    with pytest.raises(SceneError, match="second derivatives of 1000000 particles"):
        system.hessian(np.zeros(1_000_000))


def test_figures_that_memory_cannot_hold_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "long-chain", "--steps", "20", "--method", "own:euler", "--quiet", "-o", "c.h5"]) == 0
    has(monkeypatch, 3e5)
    assert main(["plot", "c.h5"]) == 2
    assert "the figures of 1000 particles take 0.0" in capsys.readouterr().err
    assert not Path("figures").exists()


def test_exact_motion_in_blocks_is_that_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = springcheck.load_scene("chain")
    steps = np.arange(50)
    whole = exact.true_motion(scene, steps, scene.step)
    monkeypatch.setattr(exact, "MOST_NUMBERS", 7 * scene.n)
    for one, other in zip(whole, exact.true_motion(scene, steps, scene.step), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_scene_whose_text_no_store_keeps_is_refused_before_it_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draft, "LONGEST_TEXT", 100)
    with pytest.raises(StoreError, match="stores hold"):
        springcheck.run("spring", "own:euler", path=tmp_path / "x.h5")
    assert not (tmp_path / "x.h5").exists()
