"""A module imports only from rows above it, and a foreign library only where it belongs."""

from __future__ import annotations

import ast
import importlib
import json
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import house
from house import HOME, imports, modules, room

ROWS = [
    "interrupts", "processes", "errors", "physics", "schemes", "thermal", "engines",
    "store", "formats", "text", "driver", "checks", "identify", "conformance",
    "doors", "figures", "plot", "studies", "cli", "api", "__main__",
]  # fmt: skip

STUDIES = sorted(path.parent.name for path in HOME.glob("studies/*/__init__.py"))

HOMES = {
    "h5py": ("store",),
    "matplotlib": ("plot.py", "cli/drawing.py", "figures"),
    "openmm": tuple(f"engines/openmm/{name}.py" for name in ("simulation", "thermostats")),
    "ase": ("engines/ase/simulation.py", "formats/libraries.py"),
    "sksundae": ("engines/sundials/simulation.py",),
    "numba": ("engines/own",),
    "jinja2": ("cli/page/writing.py",),
    "markupsafe": ("cli/page/writing.py",),
    "rich": ("text/lines.py", "cli/output.py"),
    "msgspec": ("physics/scenefile", "studies/keeper.py", "studies/tables.py", "store", "formats"),
}


def test_every_module_has_aroom() -> None:
    assert {room(path) for path in modules()} <= set(ROWS)


def test_a_module_imports_only_from_rows_above_it() -> None:
    wrong = []
    for path in modules():
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == "springcheck" and len(parts) > 1 and parts[1] != room(path):
                assert parts[1] in ROWS, name
                if ROWS.index(parts[1]) >= ROWS.index(room(path)):
                    wrong.append(f"{path.relative_to(HOME)} imports {name}, which is not above it")
    assert wrong == []


def test_a_foreign_library_is_imported_only_where_it_belongs() -> None:
    places = {path.relative_to(HOME).as_posix(): imports(path) for path in modules()}
    libraries = {(place, name.split(".")[0]) for place, names in places.items() for name in names}
    assert [x for x in libraries if x[1] in HOMES and not x[0].startswith(HOMES[x[1]])] == []


def test_arrows_between_rooms_are_few() -> None:
    found = house.arrows()
    count, chain = sum(map(len, found.values())), house.longest(found)
    assert count <= 94, f"{len(found)} rooms, {count} arrows, longest chain {' > '.join(chain)}"


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
    loaded = {name for name in done.stdout.splitlines() if name.startswith("springcheck.thermal.")}
    assert loaded == {f"springcheck.thermal.{name}" for name in ("catalogue", "decays")}


def test_the_keeper_alone_of_the_studies_knows_the_store() -> None:
    uses = {
        path.relative_to(HOME).as_posix()
        for path in HOME.glob("studies/**/*.py")
        if any(name.startswith("springcheck.store") for name in imports(path))
    }
    # study.py names a type of it for the reader
    assert uses <= {"studies/keeper.py", "studies/tables.py", "studies/study.py"}


@pytest.mark.parametrize(
    "place", ["cli/__init__.py", "cli/commands.py", "cli/inspect.py", "cli/drawing.py", "plot.py"]
)
def test_no_study_is_named_outside_of_the_list(place: str) -> None:
    assert "run" in STUDIES
    named = {name for name in imports(HOME / place) if name.startswith("springcheck.studies.")}
    for study in STUDIES:
        assert not any(name.startswith(f"springcheck.studies.{study}") for name in named), named


def test_no_test_imports_another() -> None:
    """What several tests make stands beside them: importing a test would run its fixtures and marks."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    assert len(files) > 50
    found = [
        (file.name, line)
        for file in files
        for line in file.read_text(encoding="utf-8").splitlines()
        if re.match(r"\s*(from|import) test_", line)
    ]
    assert found == []


def test_no_modules_import_each_other() -> None:
    assert house.circles() == []


def test_whatever_stands_beside_the_package_imports_only_what_the_package_has() -> None:
    beside = [*Path(house.__file__).parent.rglob("*.py"), *Path(__file__).parent.rglob("*.py")]
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
