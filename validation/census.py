"""Which integrator every installed engine really runs, as a table in Markdown.

Claim: the same engine is explicit, semi-implicit or implicit Euler depending on how the spring is attached;
every scheme is named by its states alone, and agrees with the one that the engine is declared with.  What
hand-written loops had measured before there was a census stands in `MEASURED`, and is found again: schemes,
amplitudes to 3 decimals, and that a force held over 5 substeps makes the motion of `spring-uneven` 1.87 times
as large in 400 steps.  Two rows are told more exactly here: LAMMPS, which was half a unit in the last place
off velocity Verlet, is that loop bit for bit once it keeps velocities and not momenta; and MuJoCo's RK4 is
RK4 where the spring is a joint's, and a constant force where a motor sets it.  Friction that MuJoCo takes
implicitly needs a scene with friction, and is in the tests.
Run:   python validation/census.py        (about a minute; with the extras `established` and `lammps`)
       python validation/census.py table  (and `validation/engines`, OpenMM by platform, in 10 minutes; writes
                                           validation/engines/engines.json, .csv and .html)
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments
from springcheck import engines
from springcheck.cli import main as springcheck
from springcheck.figures.looks import title
from springcheck.studies.census import table as as_table
from springcheck.studies.census.measure import measure
from springcheck.studies.census.result import Census

MEASURED = {
    "mujoco:joint-spring": ("semi-implicit-euler", 1.020),
    "mujoco:joint-spring-implicit": ("semi-implicit-euler", 1.020),
    "mujoco:joint-spring-implicitfast": ("semi-implicit-euler", 1.020),
    "mujoco:joint-spring-rk4": ("rk4", None),
    "mujoco:motor-frame-skip-5": ("force-held-5", None),
    "mujoco:motor-rk4": ("force-held-rk4", None),
    "pymunk:force": ("explicit-euler", 2.705),
    "pymunk:damped-spring": ("semi-implicit-euler-drift-kick", 0.984),
    "rebound:leapfrog": ("position-verlet", None),
    "dart:force": ("semi-implicit-euler", 1.020),
    "dart:joint-spring": ("implicit-euler", 0.370),
    "box2d:force": ("semi-implicit-euler", 1.020),
    "box2d:distance-joint": ("implicit-euler", 0.370),
    "rapier:force": ("force-held-4", 1.472),
    "rapier:spring-joint": ("implicit-euler-4", 0.779),
    "drake:prismatic-spring": ("semi-implicit-euler", 1.020),
    "lammps:spring-self": ("velocity-verlet", None),
}
"""Scheme and amplitude of the blog's spring after 200 steps, by loops written by hand for each engine."""

BIT_EQUAL = {"mujoco:joint-spring": "own:semi-implicit-euler", "pymunk:force": "own:euler"}

HELD_GROWTH = 1.87
"""Of `spring-uneven` in 400 steps by a force held over 5 substeps."""


def differences(found: Census) -> list[str]:
    """What is not as it was measured by hand, of the engines that are here."""
    here = {x.method: x for x in found.entries}
    out = []
    for name, (scheme, amplitude) in MEASURED.items():
        x = here.get(name)
        if x is not None and x.found != scheme:
            out.append(f"{name} is {x.found}, and was {scheme}")
        if x is not None and amplitude is not None and not abs(x.amplitude - amplitude) <= 6e-4:
            out.append(f"{name} has the amplitude {x.amplitude:.4f}, and had {amplitude}")
    for name, own in BIT_EQUAL.items():
        if {name, own} <= set(here) and own not in found.partners[name]:
            out.append(f"{name} is not {own} bit for bit, and was")
    held = here.get("mujoco:motor-frame-skip-5")
    if held is not None and not abs((1 + held.area) ** 200 - HELD_GROWTH) <= 6e-3:
        out.append(f"a held force grows the motion {(1 + held.area) ** 200:.3f} times, and did {HELD_GROWTH}")
    return out


def table(found: Census) -> list[str]:
    """The census in Markdown, grouped by scheme."""
    out = [
        "| scheme, from the states | engine and attachment | amplitude | det - 1 | arithmetic "
        "| forces a step | time a step | same bits as |",
        "|---|---|---:|---:|---|---:|---:|---|",
    ]
    partners = found.partners
    for name, members in found.grouped.items():
        for x in members:
            area = "" if np.isnan(x.area) else "0" if abs(x.area) < 1e-13 else f"{x.area:+.2e}"
            same = ", ".join(f"`{y}`" for y in partners[x.method][:2]) + (
                f" and {len(partners[x.method]) - 2} more" if len(partners[x.method]) > 2 else ""
            )
            out.append(
                f"| {title(name)} | `{x.method}` | {x.amplitude:.4f} | {area} | {x.precision} "
                f"| {x.force_calls:.3g} | {x.seconds * 1e6:.3g} us | {same} |"
            )
    versions = sorted({(x.method.partition(":")[0], x.version) for x in found.entries})
    return [*out, "", "; ".join(f"{engines.engine(name).title}: {version}" for name, version in versions)]


FOLDER = Path(__file__).parent / "engines"

LIBRARIES = {"jaxmd.py": "jaxmd", "bullet.py": "bullet", "diffrax_.py": "diffrax"}
"""Plug-ins of that folder and the engines in them."""

PLATFORMS = ("Reference", "CPU", "OpenCL-single", "OpenCL-mixed", "OpenCL-double")

NODE = ("cannon-es", "p2", "planck", "matter-js")
"""Engines of npm that `spring.cjs` runs."""


def everything() -> int:
    """Write the table of all that is here."""
    sys.path.insert(0, str(FOLDER))
    os.chdir(FOLDER)
    words = [
        "census",
        "--force",
        "--quiet",
        "-o",
        "engines.h5",
        "--csv",
        "engines.csv",
        "--page",
        "engines.html",
    ]
    for name in engines.names():
        for method in engines.engine(name).methods:
            places = [f"@{place}" for place in PLATFORMS] if name == "openmm" else [""]
            words += [word for place in places for word in ("--method", f"{name}:{method}{place}")]
    for file, name in LIBRARIES.items():
        words += ["--engine", file, "--method", f"{name}:*"]
    node = shutil.which("node")
    for name in NODE if node else ():
        if (
            subprocess.run(
                [str(node), "-e", f"require('{name}')"], capture_output=True, check=False
            ).returncode
            == 0
        ):
            words += ["--command", f"{name}=node spring.cjs {name} {{scene}} {{out}}"]
            words += ["--method", f"command:{name}"]
    status = springcheck(words)
    from springcheck.studies.census.measure import stored

    document = told(stored("engines.h5").document())
    Path("engines.json").write_text(json.dumps(document, indent=1) + "\n")
    rows = as_table.rows(document)
    Path("engines.csv").write_text(as_table.as_csv(rows))
    Path("engines.html").write_text(as_table.html(rows, [document]))
    print(f"{len(rows)} rows")
    return status


def told(document: dict[str, Any]) -> dict[str, Any]:
    """A census without what is of this machine alone, with the command that makes each row."""
    files = {name: file for file, name in LIBRARIES.items()}
    for entry in document["entries"]:
        entry.pop("partners", None)
        entry.pop("seconds", None)
        engine, _, method = entry["method"].partition(":")
        command = f"springcheck census --method {entry['method']}"
        if engine == "command":
            code = f"process.stdout.write(require('{method}/package.json').version)"
            ran = subprocess.run(["node", "-e", code], capture_output=True, text=True, check=False)
            entry["version"] = f"{method} {ran.stdout}".strip()
            entry["about"] = "a force before each step, by validation/engines/spring.cjs"
            command += f" --command '{method}=node spring.cjs {method} {{scene}} {{out}}'"
        elif engine in files:
            command += f" --engine validation/engines/{files[engine]}"
        entry["command"] = command
    return document


def main() -> int:
    """Print the table; the exit status says whether every engine is what it is declared as."""
    if arguments(__doc__, what="compare").what == "table":
        return everything()
    found = measure()
    for line in table(found):
        print(line)
    wrong = differences(found)
    here = [name for name in MEASURED if name in {x.method for x in found.entries}]
    print(f"\n{len(here)} of {len(MEASURED)} methods measured by hand are here; {len(wrong)} differences")
    for line in wrong:
        print(line)
    return found.status or int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
