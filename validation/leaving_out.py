"""What a scene does not need costs nothing: the smallest run beside the fullest, and beside its libraries.

Claim: the smallest run (`spring`, own methods, 200 steps) takes at most 1.5 times the memory of `import
numpy, h5py`, and imports no engine's library, no numba, no scipy and no matplotlib; its store holds no more
than what was asked for.

Command: python validation/leaving_out.py

Expected, on one core of a shared machine of 2025: memory 1.46 times, time 2.7 times that of the two imports.

Each figure is the least of seven runs, taken in turn; compiled bytecode is there from a run before.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from arguments import arguments, script

REPEATS = 7

LIBRARIES = ("openmm", "ase", "sksundae", "numba", "scipy", "matplotlib", "rich", "msgspec", "h5py", "numpy")

RUN = "import sys; from springcheck.cli import main; sys.exit(main({arguments!r}))"

REPORT = """
import json, resource, sys, time
began = time.perf_counter()
try:
    exec(sys.argv[1])
except SystemExit as end:
    assert not end.code, end.code
names = {name.partition(".")[0] for name in sys.modules}
print(json.dumps({"modules": sorted(sys.modules), "libraries": sorted(names),
                  "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}), file=sys.stderr)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """Least wall time [s] and peak memory [MB] of several runs, modules imported, bytes written."""

    name: str
    seconds: float
    memory: float
    modules: int
    libraries: tuple[str, ...]
    written: int


def once(code: str, folder: Path) -> tuple[float, float, list[str], list[str]]:
    """Wall time of a fresh interpreter, its peak memory [MB], modules and top-level names."""
    # the clock runs around the whole process: starting Python and leaving it are part of the cost
    from time import perf_counter

    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(Path(tempfile.gettempdir()) / "springcheck-bytecode")
    began = perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", REPORT, code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    seconds = perf_counter() - began
    found = json.loads(done.stderr.splitlines()[-1])
    return seconds, found["memory"] / 1024, found["modules"], found["libraries"]


def measure(codes: dict[str, str]) -> list[Cost]:
    """The cost of each piece of code, measured in turn so that all see the same machine."""
    seconds: dict[str, list[float]] = {name: [] for name in codes}
    last: dict[str, tuple[float, list[str], list[str], int]] = {}
    for repeat in range(REPEATS + 1):
        for name, code in codes.items():
            with tempfile.TemporaryDirectory() as folder:
                wall, memory, modules, libraries = once(code, Path(folder))
                written = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
            # the first writes the bytecode
            if repeat:
                seconds[name].append(wall)
                memory = min(memory, last[name][0])
            last[name] = memory, modules, libraries, written
    return [
        Cost(
            name=name,
            seconds=min(seconds[name]),
            memory=memory,
            modules=len(modules),
            libraries=tuple(library for library in LIBRARIES if library in libraries),
            written=written,
        )
        for name, (memory, modules, libraries, written) in last.items()
    ]


def main() -> int:
    """Print the costs; returns 1 where the smallest run misses its memory, or imports what it must not."""
    arguments(__doc__)
    small = ["run", "spring", "--method", "own:*", "--quiet"]
    codes = {
        "import numpy, h5py": "import numpy, h5py",
        "load a scene": "import springcheck; springcheck.load_scene('spring')",
        "one run in memory": "from springcheck import *; simulate(load_scene('spring'), 'own:euler')",
        "run spring --method 'own:*' --quiet": RUN.format(arguments=small),
        "run spring --method 'own:*'": RUN.format(arguments=small[:-1]),
        "run lc-circuit": RUN.format(arguments=["run", "lc-circuit"]),
        "run spring": RUN.format(arguments=["run", "spring"]),
        "run carbon-monoxide": RUN.format(arguments=["run", "carbon-monoxide"]),
    }
    costs = measure(codes)
    base = costs[0]
    print(f"{'':36}{'time':>9}{'times':>7}{'memory':>10}{'times':>7}{'modules':>9}{'written':>9}")
    for cost in costs:
        print(
            f"{cost.name:36}{cost.seconds:7.3f} s{cost.seconds / base.seconds:7.2f}"
            f"{cost.memory:7.1f} MB{cost.memory / base.memory:7.2f}{cost.modules:9}{cost.written:9}"
        )
        print(f"    {', '.join(cost.libraries)}")
    smallest = costs[3]
    unwanted = set(smallest.libraries) - {"numpy", "h5py", "msgspec"}
    print(f"the smallest run imports beside what it must: {', '.join(sorted(unwanted)) or 'nothing'}")
    return int(bool(unwanted) or smallest.memory > 1.5 * base.memory)


if __name__ == "__main__":
    script(main)
