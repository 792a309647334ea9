"""What is not needed is not imported.  Which package may import which is a contract of import-linter."""

from __future__ import annotations

import ast
import importlib
import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def _loaded(code: str) -> set[str]:
    """Modules that are loaded after running code in a fresh interpreter, and their packages."""
    script = f"import sys\n{code}\nimport json; print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    every = json.loads(done.stderr.splitlines()[-1])
    return {name.split(".")[0] for name in every} | {*every}


FOREIGN = {"openmm", "ase", "sksundae", "numba", "matplotlib", "scipy"}


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("import springcheck", FOREIGN | {"h5py", "numpy", "rich", "msgspec", "jinja2"}),
        ("import springcheck.cli", FOREIGN | {"h5py", "numpy", "rich", "msgspec", "jinja2"}),
        ("from springcheck.cli import main; main(['list'])", FOREIGN | {"h5py", "rich", "jinja2"}),
        ("from springcheck.cli import main; main(['show', 'spring'])", FOREIGN | {"h5py", "rich", "jinja2"}),
        ("from springcheck.cli import main; main(['explain', 'rk4'])", FOREIGN | {"h5py", "rich", "jinja2"}),
        (
            "from springcheck import engines; engines.match(('own:*',))",
            FOREIGN | {"importlib.metadata", "springcheck.engines.lammps", "springcheck.engines.ase"},
        ),
        ("import springcheck; springcheck.simulate(springcheck.load_scene('spring'), 'own:euler')", FOREIGN),
    ],
)
def test_what_is_not_needed_is_not_imported(code: str, absent: set[str]) -> None:
    assert not _loaded(code) & absent


def test_a_run_without_a_bath_imports_no_law_of_noise(tmp_path: Path) -> None:
    lines = ["run", "spring", "--steps", "5", "--method", "own:euler", "-o", str(tmp_path / "a.h5")]
    script = f"import sys\nfrom springcheck.cli import main\nmain({lines})\nprint(*sys.modules, sep='\\n')"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = {name for name in done.stdout.splitlines() if name.startswith("springcheck.bath.")}
    assert loaded == {f"springcheck.bath.{name}" for name in ("catalogue", "decays")}


def test_whatever_stands_beside_the_package_imports_only_what_the_package_has() -> None:
    beside = [*(ROOT / "validation").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    wanted = {
        (node.module, name.name)
        for path in beside
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "springcheck"
        for name in node.names
    }
    lost = []
    for module, name in sorted(wanted):
        home = importlib.import_module(module)
        if not hasattr(home, name) and not (hasattr(home, "__path__") and find_spec(f"{module}.{name}")):
            lost.append(f"{module}.{name}")
    assert len(wanted) > 100
    assert lost == []
