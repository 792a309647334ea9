"""What is reported to the authors of other engines is still there, and has the size that its law gives.

Each reproducer prints one line: measured, law, uncertainty, promised.  The seeds were fixed once.  At five
standard errors one of the four statistical ones is off its law by chance once in 430,000 sets of draws.
"""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
import warnings
from contextlib import redirect_stdout
from importlib.metadata import PackageNotFoundError, distribution
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[1] / "validation" / "upstream"

NEEDS = {
    "ase": "ase", "cannon": "cannon-es", "dart": "dartpy", "jaxmd": "jax-md", "lammps": "mpich",
    "mujoco": "mujoco", "openmm": "openmm", "p2": "p2", "pybullet": "pybullet", "pymunk": "pymunk",
    "rebound": "rebound", "roadrunner": "libroadrunner",
}  # fmt: skip

STANDARD_ERRORS = 5

LINE = re.compile(r"measured (\S+) law (\S+) uncertainty (\S+) promised (\S+)\s*$")

LIBRARIES = {"gsl": "gsl gslcblas", "sundials": "sundials_arkode sundials_nvecserial sundials_generic"}

SCRIPTS = sorted(x for x in FOLDER.iterdir() if x.suffix in (".py", ".cjs", ".c", ".R"))

HARMLESS = "**harmless**"

FEWER = {
    "ase_nose_hoover_fixed": ("units.fs, 2000", "units.fs, 500"),
    "ase_andersen": ("N, M, K, H, T, P = 20_000", "N, M, K, H, T, P = 4_000"),
    "lammps_langevin": ("N, H, G, FRAMES = 30", "N, H, G, FRAMES = 20"),
    "openmm_andersen_gpu": ("N, STEPS, H, RATE = 100_000", "N, STEPS, H, RATE = 10_000"),
    "openmm_andersen": ("N, T, H, RATE = 6000", "N, T, H, RATE = 1500"),
}
"""Particles of the statistical ones here, and steps of another: their effects are 8 standard errors and more
with a quarter."""


def command(script: Path, folder: Path) -> list[str]:
    """How to run a reproducer; skips where its engine is not here."""
    if script.suffix == ".c":
        built, name = folder / script.stem, script.stem.partition("_")[0]
        cc = ["cc", str(script), "-o", str(built), *(f"-l{x}" for x in LIBRARIES[name].split()), "-lm"]
        if shutil.which("cc") is None or subprocess.run(cc, capture_output=True, check=False).returncode:
            pytest.skip(f"no {name} of the finding's time is here")
        return [str(built)]
    if script.suffix == ".R":
        has = ["Rscript", "-e", "library(deSolve)"]
        if shutil.which(has[0]) is None or subprocess.run(has, capture_output=True, check=False).returncode:
            pytest.skip("deSolve is not installed for R")
        return ["Rscript", str(script)]
    if script.stem.startswith("gromacs"):
        if shutil.which("gmx") is None:
            pytest.skip("no gmx here")
        return [sys.executable, str(script)]
    needs = NEEDS[script.stem.partition("_")[0]]
    if script.suffix == ".py":
        try:
            distribution(needs)
        except PackageNotFoundError:
            pytest.skip(f"{needs} is not installed")
        return [sys.executable, str(script)]
    has = ["node", "-e", f"require('{needs}')"]
    if shutil.which("node") is None or subprocess.run(has, capture_output=True, check=False).returncode:
        pytest.skip(f"{needs} is not installed for node")
    return ["node", str(script)]


HERE = ("ase", "openmm")
"""Engines that other tests have imported: a process of its own takes longer to start than most of them."""


def printed(script: str) -> str:
    """What a script prints, run in this process; skips where OpenMM has no OpenCL."""
    with redirect_stdout(StringIO()) as out, warnings.catch_warnings(), pytest.MonkeyPatch.context() as patch:
        warnings.simplefilter("ignore")
        patch.setattr(sys, "argv", [script])
        try:
            runpy.run_path(script, run_name="__main__")
        except Exception as error:
            if "no registered Platform" in str(error):
                pytest.skip("OpenMM finds no OpenCL here")
            raise
    return out.getvalue()


@pytest.mark.campaign
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda x: x.stem)
def test_a_finding_is_still_there(script: Path, tmp_path: Path) -> None:
    words = command(script, tmp_path)
    if script.stem in FEWER:
        text = script.read_text()
        assert text.count(FEWER[script.stem][0]) == 1
        words[-1] = str(tmp_path / script.name)
        Path(words[-1]).write_text(text.replace(*FEWER[script.stem]))
    if script.suffix == ".py" and script.stem.startswith(HERE):
        out = printed(words[-1])
    else:
        ran = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
        assert ran.returncode == 0, ran.stderr
        out = ran.stdout
    found = LINE.search(out)
    assert found, out
    measured, law, uncertainty, promised = map(float, found.groups())
    reach = STANDARD_ERRORS * uncertainty
    gone = f"{script.stem}: the engine now does what it promises; take the finding from the table"
    assert abs(measured - promised) > reach, gone
    assert abs(measured - law) <= reach, (
        f"{script.stem}: off its law by {(measured - law) / uncertainty:.1f} standard errors"
    )


def test_every_finding_has_its_note_its_row_and_a_short_program() -> None:
    table = (FOLDER / "README.md").read_text()
    notes = {x.stem for x in FOLDER.glob("*.md")} - {"README"}
    assert notes == {x.stem for x in SCRIPTS}
    for script in SCRIPTS:
        assert len([line for line in script.read_text().splitlines() if line.strip()]) <= 30, script.name
        assert "springcheck" not in script.read_text()
        assert table.count(f"({script.stem}.md)") == 1
        note = (FOLDER / f"{script.stem}.md").read_text()
        for part in (
            "Versions",
            "Reproduce",
            "Law",
            "Measured",
            "Where",
            "Possible fix",
            "Does its tracker know",
        ):
            assert f"* **{part}**" in note, (script.stem, part)
        harmless = table.index(f"({script.stem}.md)") > table.index(HARMLESS)
        assert (HARMLESS in note) == harmless, script.stem


def second_moments(order: str, h: float, p: float) -> np.ndarray:
    """Stationary <x2>, <xv>, <v2> of kicks (b half, B whole), drifts A and draws R; m = k = kT = 1."""

    def lifted(a: float, b: float, c: float, d: float) -> np.ndarray:
        return np.array([[a * a, 2 * a * b, b * b], [a * c, a * d + b * c, b * d], [c * c, 2 * c * d, d * d]])

    parts = {
        "A": lifted(1, h, 0, 1),
        "b": lifted(1, 0, -h / 2, 1),
        "B": lifted(1, 0, -h, 1),
        "R": np.diag([1, 1 - p, 1 - p]),
    }
    step, added = np.eye(3), np.zeros(3)
    for part in order:
        step, added = parts[part] @ step, parts[part] @ added + (part == "R") * np.array([0, 0, p])
    return np.asarray(np.linalg.solve(np.eye(3) - step, added))


@pytest.mark.parametrize("h", [0.1, 0.5, 1.2])
@pytest.mark.parametrize("p", [0.002, 0.1, 0.6])
def test_the_laws_of_andersens_thermostat_follow_from_its_second_moments(h: float, p: float) -> None:
    a = h * h
    x2 = (1 - p / 2) / ((1 - p) * (1 - a / 2))
    assert second_moments("bRAb", h, p) == pytest.approx(
        [x2, h / 2 / (1 - a / 2) - h * x2 / 2, 1 + a * x2 / 4]
    )
    assert second_moments("RBA", h, p)[[0, 2]] == pytest.approx([(1 - p / 2) / (1 - a / 2), 1 / (1 - a / 2)])
    assert second_moments("RbAb", h, p) == pytest.approx([1 / (1 - a / 4), 0, 1], abs=1e-12)


@pytest.mark.parametrize(("h", "gamma"), [(0.3, 2.0), (0.9, 0.4), (0.05, 9.0)])
def test_the_law_of_lammps_langevin_solves_its_lyapunov_equation(h: float, gamma: float) -> None:
    a, u = h * h, gamma * h / 2
    step = np.array([[1 - a, h * (1 - gamma * h)], [-h, 1 - gamma * h]])
    noise = np.array([h * h, h]) * np.sqrt(2 * gamma / h)
    covariance = np.linalg.solve(np.eye(4) - np.kron(step, step), np.outer(noise, noise).ravel())
    assert covariance[0] == pytest.approx((1 - u) / (1 - u - a / 4))


@pytest.mark.parametrize("n", [1, 4, 5])
def test_the_law_of_a_held_force_is_its_substeps_one_after_another(n: int) -> None:
    h, m, k = 0.3, 3.7, 2.9
    step = np.array([[1, h / n / m, -((h / n) ** 2) * k / m], [0, 1, -h / n * k], [0, 0, 1]])
    held = np.linalg.matrix_power(step, n) @ np.array([[1, 0], [0, 1], [1, 0]])
    assert np.linalg.det(held[:2]) == pytest.approx(1 + h * h * k / m * (n - 1) / (2 * n), rel=1e-14)


@pytest.mark.parametrize(("damp", "c2"), [(1.0, 0.95), (0.3, 0.5)])
def test_gj_vii_leaves_no_step_to_choose(damp: float, c2: float) -> None:
    h = (1 + c2) / (1 - c2) * np.log(c2) ** 2 * damp / 2
    q = np.sqrt(2 * (1 - c2) / ((1 + c2) * h / damp))
    assert np.exp(-q * h / damp) == pytest.approx(c2)


def test_a_reproducer_whose_effect_has_gone_is_noticed(tmp_path: Path) -> None:
    script = tmp_path / "ase_mended.py"
    script.write_text("print('measured 1.0001 law 1.05 uncertainty 0.001 promised 1')")
    with pytest.raises(AssertionError, match="take the finding from the table"):
        test_a_finding_is_still_there(script, tmp_path)
    script.write_text("print('measured 1.04 law 1.05 uncertainty 0.001 promised 1')")
    with pytest.raises(AssertionError, match=r"off its law by -10\.0 standard errors"):
        test_a_finding_is_still_there(script, tmp_path)
