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
       python validation/census.py states (of the engines that no CI has, on `spring-uneven`, into
                                           data/reference/engines.npz)
       python validation/census.py table  (and `validation/engines`, OpenMM by platform, in 20 minutes; writes
                                           validation/engines/engines.json, .csv, .html and .lock)
       python validation/census.py table own:baoab ...
                                          (these rows alone, the others kept as they are)
"""

import json
import os
import runpy
import shutil
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import claims
import engines_table
from arguments import arguments, script
from springcheck import driver, engines, schemes
from springcheck.cli import main as springcheck
from springcheck.engines import Label, registry
from springcheck.figures.looks import title
from springcheck.physics.scenefile import load_scene
from springcheck.studies.census.measure import agrees, record
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
"""Growth of `spring-uneven` in 400 steps under a force that is held over 5 substeps."""


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
ROOT, HERE = FOLDER.parents[1], "validation/engines"

LIBRARIES = {
    "jaxmd.py": "jaxmd", "bullet.py": "bullet", "diffrax_.py": "diffrax", "mjx_.py": "mjx",
    "torchdiffeq_.py": "torchdiffeq", "torchsim.py": "torchsim", "gromacs.py": "gromacs",
    "ipi_.py": "ipi", "newton_.py": "newton",
    "cp2k.py": "cp2k",
}  # fmt: skip
"""Plug-ins of that folder and the engines in them."""

PLATFORMS = ("Reference", "CPU", "OpenCL-single", "OpenCL-mixed", "OpenCL-double")

NODE = {
    "cannon-es": "a force before each step", "cannon-es-spring": "Spring, its length far from 0",
    "p2": "a force before each step", "p2-spring": "LinearSpring of length 0",
    "planck": "a force before each step", "planck-joint": "DistanceJoint by frequency, its length far from 0",
    "matter-js": "a force before each step",
}  # fmt: skip
"""Engines of npm and attachments that `spring.cjs` runs."""

PROGRAMS = {
    "gsl": ("-lgsl -lgslcblas", "rk2 rk4 rkf45 rkck rk8pd rk1imp rk2imp rk4imp", "gsl_odeiv2_step_apply"),
    "odeint": ("", "euler modified-midpoint runge-kutta4 cash-karp54 dopri5 fehlberg78 symplectic-euler "
               "mclachlan m4-mclachlan velocity-verlet implicit-euler", "do_step"),
    "ode": ("$(pkg-config --cflags --libs ode) -DVERSION='\"'$(pkg-config --modversion ode)'\"'",
            "force quick slider", "dWorldStep, dWorldQuickStep, or a slider's stops as a spring"),
    "simbody": ("-I/usr/include/simbody -lSimTKsimbody -lSimTKmath -lSimTKcommon",
                "explicit-euler semi-explicit-euler verlet runge-kutta2 runge-kutta3 runge-kutta-merson",
                "a slider's linear spring, at a fixed step"),
    "petsc": ("$(pkg-config --cflags --libs PETSc ompi-cxx)",
              "euler rk-1fe rk-2a rk-2b rk-3 rk-3bs rk-4 rk-5f rk-5dp beuler cn theta alpha "
              "basicsymplectic-1 basicsymplectic-2 basicsymplectic-3 basicsymplectic-4",
              "TSStep without adaptation"),
}  # fmt: skip
"""By program in C++: flags beside `g++ -std=c++17 -O1`, its methods, and the functions that they call."""

HALVES = "two half steps inside, by which it estimates its error"
NOTES = {
    **{f"gsl-{name}": HALVES for name in ("rk4", "rk1imp", "rk2imp", "rk4imp")},
    "ode-slider": "the manual's spring: ERP = h k/(h k + c), CFM = 1/(h k + c)",
    "cannon-es-spring": "damping 1e-300: 0 is taken for 1",
    "xpbd": "newton#2933 asks whether its multipliers survive an iteration; of one spring they do",
    "nvt-baoab": "i-pi#374 doubts BAOAB with a barostat or several time steps, not this",
}
"""What the authors of programs would want to be said beside their rows."""


def everything(only: list[str]) -> int:
    """Write the table of all that is here, or these of its rows; commands run in the root of the checkout."""
    sys.path.insert(0, str(FOLDER))
    os.chdir(ROOT)
    kept = str(FOLDER / "engines.h5")
    words = ["census", "--force", "--quiet", "--thermostats", "-o", kept]
    for name in engines.names():
        found = engines.engine(name)
        for method in found.methods:
            # one that chooses its steps does so in single precision on the others
            here = PLATFORMS[:2] if found.methods[method].adaptive else PLATFORMS
            places = [f"@{place}" for place in here] if name == "openmm" else [""]
            words += [word for place in places for word in ("--method", f"{name}:{method}{place}")]
        # one platform: noise is no matter of precision
        place = "@Reference" if name == "openmm" else ""
        words += [word for method in found.thermostats for word in ("--method", f"{name}:{method}{place}")]
    for file, name in LIBRARIES.items():
        if only and not any(one.startswith(f"{name}:") for one in only):
            # whose default methods would be measured
            continue
        words += ["--engine", f"{HERE}/{file}"]
        known = runpy.run_path(str(FOLDER / file))["ENGINE"]
        words += [x for one in (*known.methods, *known.thermostats) for x in ("--method", f"{name}:{one}")]
    with tempfile.TemporaryDirectory() as folder:
        programs = not only or any(name.startswith("command:") for name in only)
        for name, command in {**of_node(), **built(Path(folder))}.items() if programs else ():
            words += ["--command", f"{name}={command} {{scene}} {{out}}", "--method", f"command:{name}"]
        order = [word for flag, word in pairwise(words) if flag == "--method"]
        if unknown := set(only) - set(order):
            print(f"no row of the table: {', '.join(sorted(unknown))}", file=sys.stderr)
            return 2
        for name in order if only else []:
            if name not in only:
                at = words.index(name)
                del words[at - 1 : at + 1]
        status = springcheck(words)
        if status not in (0, 1):
            return status
        from springcheck.studies.census.measure import stored

        document = told(stored(kept).document(), Path(folder))
    if only:
        old = json.loads((FOLDER / "engines.json").read_text())
        new = [entry for entry in document["entries"] if entry["method"] in only]
        document = {**old, "entries": beside(old["entries"], new, order)}
    (FOLDER / "engines.json").write_text(json.dumps(document, indent=1) + "\n")
    rows = engines_table.rows(document)
    (FOLDER / "engines.csv").write_text(engines_table.as_csv(rows))
    (FOLDER / "engines.html").write_text(engines_table.html(rows, [document]))
    lock = sorted({part.strip() for row in rows for part in row["version"].split(",")})
    (FOLDER / "engines.lock").write_text("\n".join(lock) + "\n")
    wrong = [row["method"] for row in rows if "DECLARED" in row["note"]]
    makers = len(set(map(engines_table.engine, rows)))
    print(f"{len(rows)} rows of {makers} engines, {len(wrong)} wrong: {wrong}")
    return status


def beside(old: list[dict[str, Any]], new: list[dict[str, Any]], order: list[str]) -> list[dict[str, Any]]:
    """Entries with new ones in their places: behind the nearest that stands before them in this order."""
    out = list(old)
    for entry in new:
        names = [one["method"] for one in out]
        if entry["method"] in names:
            out[names.index(entry["method"])] = entry
            continue
        before = [name for name in order[: order.index(entry["method"])] if name in names]
        out.insert(names.index(before[-1]) + 1 if before else 0, entry)
    return out


STATES = ROOT / "data" / "reference" / "engines.npz"
HEAVY = ("gromacs.py", "cp2k.py", "ipi_.py", "newton_.py")
"""Plug-ins whose engines no CI installs: their states are kept, so that a test can name them again."""


def states() -> int:
    """Keep the states of `spring-uneven` by every method of the heavy engines that needs no rods."""
    sys.path.insert(0, str(FOLDER))
    scene, found = load_scene("spring-uneven"), {}
    for file in HEAVY:
        engine = registry.from_file(FOLDER / file)
        assert engine is not None
        for name, method in engine.methods.items():
            if not method.requires:
                run = driver.run(scene, Label(engine=engine.name, method=name))
                found[f"{engine.name}:{name}"] = np.stack([run.q[:, 0], run.p[:, 0]])
    np.savez_compressed(STATES, **found)  # type: ignore[arg-type]
    print(f"{len(found)} runs in {STATES.stat().st_size} bytes")
    return 0


def called(*words: str) -> str:
    """What a program prints; "" where it fails."""
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    return "" if ran.returncode else ran.stdout.strip()


def package(name: str) -> str:
    """The package of npm that an engine or attachment is in."""
    return name.removesuffix("-spring").removesuffix("-joint")


def of_node() -> dict[str, str]:
    """Commands of the engines of npm that are here."""
    node = shutil.which("node")
    here = [x for x in NODE if node and called(node, "-e", f"require('{package(x)}');console.log(1)")]
    return {name: f"node {HERE}/spring.cjs {name}" for name in here}


def built(folder: Path) -> dict[str, str]:
    """Commands of the programs in C++ whose libraries are here."""
    out: dict[str, str] = {}
    for name, (flags, methods, _) in PROGRAMS.items():
        line = f"g++ -std=c++17 -O1 -w {HERE}/{name}.cpp -o {folder / name} {flags}"
        if subprocess.run(line, shell=True, capture_output=True, check=False).returncode:
            print(f"{name} is not here: {line}", file=sys.stderr)
            continue
        out |= {f"{name}-{method}": f"{folder / name} {method}" for method in methods.split()}
    return out


def told(document: dict[str, Any], folder: Path) -> dict[str, Any]:
    """A census without what is of this machine alone, with the command that makes each row."""
    files = {name: file for file, name in LIBRARIES.items()}
    for entry in document["entries"]:
        entry.pop("partners", None)
        entry.pop("seconds", None)
        engine, _, method = entry["method"].partition(":")
        command = f"springcheck census --method {entry['method']}"
        if engine == "command" and method in NODE:
            # packages need not export their own description
            code = (
                f"const p=require('path');let d=require.resolve('{package(method)}');while(p.basename(d)!="
                f"'{package(method)}')d=p.dirname(d);console.log(require(p.join(d,'package.json')).version)"
            )
            entry["version"] = f"{package(method)} {called('node', '-e', code)}".strip()
            entry["about"] = f"{NODE[method]}, by validation/engines/spring.cjs"
            command += f" --command '{method}=node {HERE}/spring.cjs {method} {{scene}} {{out}}'"
        elif engine == "command":
            name, _, what = method.partition("-")
            flags, _, calls = PROGRAMS[name]
            entry["version"] = called(str(folder / name))
            entry["about"] = f"{calls}, by validation/engines/{name}.cpp"
            command = (
                f"g++ -std=c++17 -O1 {HERE}/{name}.cpp -o /tmp/{name} {flags} && {command} "
                f"--command '{method}=/tmp/{name} {what} {{scene}} {{out}}'"
            )
        elif engine in files:
            command = f"PYTHONPATH={HERE} {command} --engine {HERE}/{files[engine]}"
        claimed(entry)
        if entry["thermostat"]:
            command = command.replace("springcheck census", "springcheck census --thermostats")
        if entry["claimed"] in schemes.SCHEMES and engine == "command":
            command += f" --scheme {entry['claimed']}"
        entry["note"] = entry["note"] or NOTES.get(method, "")
        entry["command"] = command
    return document


def claimed(entry: dict[str, Any]) -> None:
    """Hold a program's row against what its documentation claims; that of an engine has been already."""
    name, scene = entry["method"].removeprefix("command:"), load_scene("spring-uneven")
    if known := claims.NAMED.get(name):
        entry.update(claimed=known, agrees=agrees(scene, known, entry["found"]))
    elif name in claims.MAPS:
        said, of = claims.MAPS[name]
        h_omega = scene.step * float(np.sqrt(scene.system.hessian_diagonal(scene.q)[0] / scene.m[0]))
        entry.update(claimed=said, agrees=claims.agrees(entry, of(h_omega)))
        if entry["agrees"]:
            # its map is that one, to rounding of trace and determinant
            entry["found"] = said


def main() -> int:
    """Print the table; the exit status says whether every engine is what it is declared as."""
    given = arguments(__doc__, what=("compare", "table", "states"), methods=[])
    if given.what in ("table", "states"):
        return everything(given.methods) if given.what == "table" else states()
    found = record()
    for line in table(found):
        print(line)
    wrong = differences(found)
    here = [name for name in MEASURED if name in {x.method for x in found.entries}]
    print(f"\n{len(here)} of {len(MEASURED)} methods measured by hand are here; {len(wrong)} differences")
    for line in wrong:
        print(line)
    return found.status or int(bool(wrong))


if __name__ == "__main__":
    script(main)
