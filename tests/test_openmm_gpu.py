"""OpenMM on GPU-type platforms: what CUDA wrote on an H200, and what OpenCL writes here, in a bath too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import checks, driver, engines
from springcheck.cli import file
from springcheck.errors import MethodError
from springcheck.identify import identify
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

STATES = Path(__file__).parents[1] / "data" / "reference" / "openmm-cuda" / "states.npz"

MODES = {"single": "single", "mixed": "mixed", "double": "fixed-point force"}

SCHEMES = {
    "verlet": "velocity-verlet",
    "leapfrog": "semi-implicit-euler",
    "euler": "explicit-euler",
    "semi-implicit-euler": "semi-implicit-euler",
}


def scene_of(name: str, *, bath: bool = False) -> Scene:
    scene = replace(springcheck.load_scene(name), every=1)
    if bath:
        chosen = scene.bath or Bath(temperature=0.7, friction=0.6 / scene.step)
        scene = replace(scene, steps=400, bath=chosen)
    return scene


def recorded(mode: str, method: str, scene: Scene) -> Trajectory:
    """What `openmm:method@CUDA-mode` wrote, as the driver would have it."""
    label = engines.parse(f"openmm:{method}@CUDA-{mode}")
    with np.load(STATES) as states:
        q, p = (states[f"{mode}/{method}/{scene.name}/{x}"] for x in "qp")
    like = driver.run(scene, engines.parse(f"openmm:{method}"), seed=7 if scene.bath else None)
    return replace(
        like, label=label, q=q, p=p, t=like.t[: len(q)], arithmetic=engines.arithmetic(label), off_axis=None,
        energy=np.asarray(scene.system.energy(q, p)),
    )  # fmt: skip


def failed(scene: Scene, run: Trajectory) -> dict[str, str]:
    return {v.check: v.why for v in checks.judge(scene, run) if v.passed is False}


@pytest.mark.campaign
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("method", SCHEMES)
@pytest.mark.parametrize("name", ["spring", "spring-uneven"])
def test_what_cuda_wrote_passes_and_gets_no_other_name(name: str, method: str, mode: str) -> None:
    scene = scene_of(name)
    run = recorded(mode, method, scene)
    assert failed(scene, run) == {}
    for every in (1, 2, 5, 10):
        found = identify(run.t[::every], run.q[::every], run.p[::every], mass=scene.m)
        # forces in less than double precision are no row of identify: it names the scheme, or none
        assert found.scheme in (None, SCHEMES[method]), found.statement
        assert "less than double precision" in found.statement or not found.statement.startswith("Noise")


@pytest.mark.parametrize("mode", MODES)
def test_a_file_from_cuda_is_judged_by_the_arithmetic_that_is_stated(mode: str, tmp_path: Path) -> None:
    scene = scene_of("spring-uneven")
    path = recorded(mode, "verlet", scene).save(tmp_path / "run.csv")
    given: dict[str, Any] = {"scene": scene, "scheme": "velocity-verlet"}
    plain = file.judge(path, **given)
    assert plain.status == 1
    assert any(f"--arithmetic openmm:verlet@CUDA-{mode} " in note for note in plain.notes), plain.notes
    stated = file.judge(path, **given, arithmetic=f"openmm:verlet@CUDA-{mode}")
    assert stated.status == 0
    assert any(f"judged with the arithmetic of openmm:verlet@CUDA-{mode}" in note for note in stated.notes)
    with pytest.raises(MethodError, match="is not of the form"):
        file.judge(path, **given, arithmetic="")
    # another scheme, and a force that is wrong by more than single precision, fail all the same
    other = file.judge(path, scene=scene, scheme="semi-implicit-euler", arithmetic="openmm:verlet@CUDA-mixed")
    assert other.status == 1
    heavy = replace(scene, m=scene.m * (1 + 1e-4))
    assert file.judge(path, **given | {"scene": heavy}, arithmetic="openmm:verlet@CUDA-single").status == 1


@pytest.mark.parametrize("number", ["q", "p"])
@pytest.mark.parametrize("method", SCHEMES)
def test_an_error_above_single_precision_is_seen_in_mixed(method: str, number: str) -> None:
    """A coarse force is no size to which the next one's error is proportional: in velocity Verlet the bound
    on a momentum was 1e5 times too wide."""
    scene = scene_of("spring-uneven")
    run = recorded("mixed", method, scene)
    moved = np.copy(getattr(run, number))
    moved[100] *= 1 + 1e-6
    off = replace(run, **{number: moved})
    assert "step-defect" in failed(scene, replace(off, energy=np.asarray(scene.system.energy(off.q, off.p))))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("method", ["langevin-middle-bath", "langevin-middle-synchronised", "andersen"])
@pytest.mark.parametrize("name", ["spring-uneven", "bath-spring"])
def test_noise_that_cuda_wrote_passes_but_for_the_collisions(name: str, method: str, mode: str) -> None:
    scene = scene_of(name, bath=True)
    run = recorded(mode, method, scene)
    # of 400 steps at p = 0.04 two thirds of the collisions are no sure sign yet
    few = method == "andersen" and name == "spring-uneven"
    assert list(failed(scene, run)) == (["collisions"] if few else [])
    if mode == "double":
        finer = replace(run, arithmetic=replace(run.arithmetic, quantum=0.0))
        # a step that is no longer known to rounding is one with a collision
        seen = "collisions" if method == "andersen" else "noise-direction"
        assert failed(scene, finer)[seen] != failed(scene, run).get(seen)


@pytest.mark.parametrize(
    ("method", "number", "error"),
    [
        ("brownian", "p", 1e-7), ("langevin-middle-bath", "q", 1e-7), ("langevin-middle-bath", "p", 3e-6),
    ],
)  # fmt: skip
def test_an_error_above_the_rounding_of_forces_is_seen_in_mixed_in_a_bath(
    method: str, number: str, error: float, need: Callable[[str], None]
) -> None:
    """There forces are floats, and the weights of a chain's step, and nothing else: three times what is just
    seen, and what single precision hides."""
    label = f"openmm:{method}@OpenCL-mixed"
    need(label)
    scene = scene_of("spring-uneven", bath=True)
    run = driver.run(scene, engines.parse(label), seed=7)
    assert failed(scene, run) == {}
    moved = np.copy(getattr(run, number))
    moved[100] *= 1 + error
    off = replace(run, **{number: moved})
    off = replace(off, energy=np.asarray(scene.system.energy(off.q, off.p)))
    assert "noise-direction" in failed(scene, off)
    single = engines.arithmetic(engines.parse(f"openmm:{method}@OpenCL-single"))
    assert "noise-direction" not in failed(scene, replace(off, arithmetic=single))


@pytest.mark.parametrize("method", ["mts-langevin", "langevin-middle-bath"])
def test_a_bath_on_opencl_is_judged_to_rounding(method: str, need: Callable[[str], None]) -> None:
    """MTSLangevinIntegrator is a CustomIntegrator, and a chain's kernel takes step and rate as floats."""
    label = f"openmm:{method}@OpenCL-double"
    need(label)
    scene = scene_of("spring-uneven", bath=True)
    run = driver.run(scene, engines.parse(label), seed=7)
    assert failed(scene, run) == {}
    worse = {"excess": 0.0} if method == "mts-langevin" else {"parameters": "double"}
    plain = replace(run, arithmetic=replace(run.arithmetic, quantum=0.0, **worse))  # type: ignore[arg-type]
    assert "noise-direction" in failed(scene, plain)


@pytest.mark.parametrize("method", ["andersen", "langevin-middle-bath"])
def test_a_bath_whose_forces_leave_the_fixed_point_fails_with_that_reason(
    method: str, need: Callable[[str], None]
) -> None:
    label = f"openmm:{method}@OpenCL-double"
    need(label)
    scene = springcheck.load_scene("multiple-time-steps")
    scene = replace(scene, bath=Bath(temperature=0.7, friction=0.6 / scene.step))
    told = failed(scene, driver.run(scene, engines.parse(label), seed=7))
    assert list(told) == ["noise-direction"]
    assert "fixed-point sum of forces overflows beyond 2**31, and a force is" in told["noise-direction"]
