"""A term takes one class, and its key where an engine serves it: pasted into a copy of the package, it runs."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import springcheck
from springcheck import engines

BELL = """
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bell:
    key: ClassVar[str] = "bell"
    bodies: ClassVar[int] = 1
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth", "depth"),
        Column("width", "width", positive=True),
        Column("at", "at", 0.0),
    )
    i: Integers
    depth: Floats
    width: Floats
    at: Floats

    def _in_widths(self, q: Reals) -> Reals:
        return np.asarray((gather(q, self.i) - self.at) / self.width)

    def energy(self, q: Reals) -> Reals:
        u = self._in_widths(q)
        return np.asarray(-np.sum(self.depth * np.expm1(-u * u / 2), axis=-1))

    def add_force(self, q: Reals, p: Reals, out: Reals) -> None:
        u = self._in_widths(q)
        scatter(out, self.i, -self.depth / self.width * u * np.exp(-u * u / 2))

    def add_magnitude(self, q: Reals, p: Reals, out: Reals, near: Reals | None) -> None:
        size = 1 + (np.abs(gather(q, self.i)) + np.abs(self.at)) / self.width
        scatter(out, self.i, np.abs(self.depth) / self.width * size)

    def curvature(self, q: Reals) -> Reals:
        u = self._in_widths(q)
        return np.asarray(self.depth / self.width**2 * (1 - u * u) * np.exp(-u * u / 2))

    @property
    def rigidity(self) -> Floats:
        return np.asarray(np.abs(self.depth) / self.width**2)


"""

SCENE = """title = "A mass in a bell-shaped well"

[[particle]]
mass = 1.3
position = 0.9
momentum = 0.4

[[bell]]
particle = 0
depth = 2.7
width = 0.8

[time]
step = 0.05
steps = 400
"""


def test_a_pasted_term_is_read_run_judged_and_refused_where_it_is_not_served(tmp_path: Path) -> None:
    copy = tmp_path / "springcheck"
    shutil.copytree(Path(springcheck.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    mechanics = (copy / "mechanics.py").read_text(encoding="utf-8")
    assert "Morse, Damping)" in mechanics
    mechanics = mechanics.replace("\nTERMS:", f"{BELL}TERMS:", 1)
    mechanics = mechanics.replace("Morse, Damping)", "Morse, Damping, Bell)", 1)
    (copy / "mechanics.py").write_text(mechanics, encoding="utf-8")
    served = [name for name in ("ase", "sundials") if engines.absence(name) is None]
    for name in ("ase", "sundials"):
        file = copy / "engines" / name / "__init__.py"
        text = file.read_text(encoding="utf-8")
        assert '"quartic"' in text
        file.write_text(text.replace('"quartic"', '"quartic", "bell"'), encoding="utf-8")
    (tmp_path / "bell.toml").write_text(SCENE, encoding="utf-8")
    patterns = [word for name in ("own", *served) for word in ("--method", f"{name}:*")]
    done = subprocess.run(
        [sys.executable, "-m", "springcheck", "run", "bell.toml", "--json", *patterns],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    if not served:
        assert "it has no bell term" in done.stderr
        return
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {run["method"].partition(":")[0] for run in found["runs"]} == set(served)
    assert {run["outcome"] for run in found["runs"]} == {"complete"}
    assert [left["reason"] for left in found["left_out"] if left["method"] == "own:euler"] == [
        "it has no bell term"
    ]
    if "ase" in served:
        step = [
            v
            for v in found["verdicts"]
            if v["method"] == "ase:velocity-verlet" and v["check"] == "step-defect"
        ]
        assert step[0]["passed"] is True
