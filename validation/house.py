"""The size of the code, how its rooms hang together, and what a command costs beside what it needs.

A room is a module or a package directly below src/springcheck; an arrow is one room that imports another,
however often, inside functions too; a chain is a path of arrows.  The two ratios are of CPU seconds (user and
system), the smallest of interleaved repetitions, with compiled modules in place:

* the smallest run: two own methods with --quiet, over a process that imports numpy and h5py alone;
* `run spring`, all of its methods, over a process that imports the libraries that these use, plus what the
  engines alone take to start, to run and to be read (`driver.bare`).

Command: python validation/house.py [repeats]        (40 s for 5; on two idle cores)

It prints the lines of each room and the largest modules; rooms, arrows, longest chain and circles of modules;
the CPU milliseconds and the two ratios.

The speed of the own engine beside C is measured by kernel_speed.py.
"""

from __future__ import annotations

import ast
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections import Counter
from functools import cache
from pathlib import Path

from arguments import arguments, script

HOME = Path(__file__).parents[1] / "src" / "springcheck"
LIBRARIES = "numpy, h5py, openmm, ase.md.verlet, sksundae.cvode"

SMALLEST = ("--method", "own:euler", "--method", "own:semi-implicit-euler", "--quiet")

BARE = """
import time
from springcheck import engines, driver
from springcheck.physics.scenefile import load_scene
from springcheck.studies.choose import choose
scene = load_scene("spring")
labels, _, _ = choose(scene, ())
for label in labels:
    engines.load(label.engine)
began = time.process_time()
for label in labels:
    driver.bare(scene, label, read=True)
print(time.process_time() - began)
"""
"""What all methods of the scene take without springcheck around them, after their imports."""


def modules() -> list[Path]:
    """Every module but the package itself."""
    return sorted(path for path in HOME.rglob("*.py") if path != HOME / "__init__.py")


def room(path: Path) -> str:
    """The room of a module."""
    return path.relative_to(HOME).parts[0].removesuffix(".py")


@cache
def imports(path: Path) -> set[str]:
    """What a module imports anywhere in it, by full names."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def arrows() -> dict[str, set[str]]:
    """Each room, and those that it imports."""
    found: dict[str, set[str]] = {}
    for path in modules():
        parts = [name.split(".") for name in imports(path) if name.startswith("springcheck.")]
        found.setdefault(room(path), set()).update(x[1] for x in parts if x[1] != room(path))
    return {name: {x for x in others if x in found} for name, others in found.items()}


def longest(found: dict[str, set[str]]) -> list[str]:
    """The longest chain of rooms, each of which imports the next."""
    known: dict[str, list[str]] = {}

    def chain(name: str) -> list[str]:
        if name not in known:
            known[name] = [name, *max((chain(x) for x in sorted(found[name])), key=len, default=[])]
        return known[name]

    return max((chain(name) for name in sorted(found)), key=len)


def _within(path: Path) -> set[Path]:
    """Modules of ours that a module imports anywhere in it, for their types too; of the package itself its
    version alone."""
    found = set()
    for name in imports(path):
        place = HOME.parent.joinpath(*name.split("."))
        for one in (place, place.parent):
            files = [one.with_suffix(".py"), one / "__init__.py"]
            there = [
                file
                for file in files
                if file.is_file() and HOME in file.parents and file != HOME / "__init__.py"
            ]
            if there:
                found.add(there[0])
                break
    return found - {path}


def circles() -> list[set[str]]:
    """Modules that import each other, directly or by others: the strongly connected parts of the picture."""
    arrows = {path: _within(path) for path in modules()}

    def reached(start: Path) -> set[Path]:
        found: set[Path] = set()
        left = [start]
        while left:
            left += arrows[(one := left.pop())] - found
            found |= arrows[one]
        return found

    beyond = {path: reached(path) for path in arrows}
    parts = {frozenset(other for other in beyond[path] if path in beyond[other]) for path in arrows}
    return [{path.relative_to(HOME).as_posix() for path in part} for part in parts if part]


def cpu(command: list[str]) -> float:
    """CPU seconds of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=False, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Print all of it."""
    repeats = arguments(__doc__, repeats=5).repeats
    lines = {path: len(path.read_text().splitlines()) for path in HOME.rglob("*.py")}
    largest = sorted(lines, key=lambda path: -lines[path])[:5]
    print(
        f"lines {sum(lines.values())} in {len(lines)} modules, median {statistics.median(lines.values()):g}"
    )
    rooms = Counter[str]()
    for path, count in lines.items():
        rooms[room(path)] += count
    print("rooms " + ", ".join(f"{name} {count}" for name, count in rooms.most_common()))
    print("largest " + ", ".join(f"{path.relative_to(HOME)} {lines[path]}" for path in largest))
    found = arrows()
    chain = longest(found)
    print(f"rooms {len(found)}, arrows {sum(map(len, found.values()))}, longest chain {len(chain)}:")
    print("  " + " > ".join(chain))
    print(f"circles of modules {len(circles())}")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    python = [sys.executable, "-m", "springcheck", "run", "spring", "--force"]
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        commands = {
            "imports of numpy and h5py": [sys.executable, "-c", "import numpy, h5py"],
            "the smallest run": [*python, *SMALLEST],
            "imports of the libraries": [sys.executable, "-c", f"import {LIBRARIES}"],
            "run spring": python,
        }
        times: dict[str, list[float]] = {name: [] for name in commands}
        for i in range(repeats + 1):
            for name, command in commands.items():
                seconds = cpu(command)
                if i:
                    times[name].append(seconds)
        bare = [
            float(subprocess.run([sys.executable, "-c", BARE], capture_output=True, check=True).stdout)
            for _ in range(repeats)
        ]
    engines = min(bare)
    best = {name: min(values) for name, values in times.items()}
    for name, seconds in best.items():
        print(f"{name:28} {seconds * 1e3:6.0f} ms")
    print(f"{'its engines alone':28} {engines * 1e3:6.0f} ms")
    small = best["the smallest run"] / best["imports of numpy and h5py"]
    whole = best["run spring"] / (best["imports of the libraries"] + engines)
    print(f"smallest run / imports {small:.2f}; run spring / (imports + engines) {whole:.2f}")
    return 0


if __name__ == "__main__":
    script(main)
