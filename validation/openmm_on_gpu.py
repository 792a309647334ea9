"""OpenMM on a graphics card: every method, every scene that it can serve, every precision mode, judged.

Command: python validation/openmm_on_gpu.py [PLATFORM [FILE]]    (CUDA by default; HIP or OpenCL as well)

* runs: the shipped scenes by every method of OpenMM on that platform in `single`, `mixed` and `double`, and
  in a bath (kT = 0.7 of the scene's units, friction 0.6/step, seed 7, where the scene has none) by every
  thermostat; a verdict that fails is printed unless it says that forces have left the fixed point;
* atlas: the cells of `springcheck extremes` by Verlet and leapfrog in each mode;
* limits: what becomes of a force beyond the fixed point's range;
* cost: time a step of Verlet for one spring and for the chain of 33, beside the platform Reference.

FILE keeps it as JSON.  Exit status 1 where a verdict fails or a cell is silently wrong.

On an H200 (OpenMM 8.6.1, CUDA 13, driver 580; 7 minutes with 16 processes; `data/reference/openmm-cuda`):

    single  326 runs, 2860 verdicts passed, 2820 cannot tell, 31 runs failed, 20 where the fixed point ends
    mixed   326 runs, 2851 verdicts passed, 2823 cannot tell, 34 runs failed, 20 where the fixed point ends
    double  338 runs, 3135 verdicts passed, 2799 cannot tell, 33 runs failed, 17 where the fixed point ends

What fails else is three of OpenMM's own deviations, on OpenCL as on CUDA and by the same numbers: SHAKE's
masses in single precision, Andersen's collisions (`upstream/openmm_andersen_gpu.py`) and Nose-Hoover chains
of hardly any kinetic energy (`upstream/openmm_nose_hoover_rest.py`).  No cell is silently wrong.  A force
beyond 2^31 becomes 2^31 there, where OpenCL on a processor makes -2^31 or 0 of it.  A step takes 13 to 21 us
on an H100, of one spring as of the chain of 33; on Reference 0.2 us, and 33 us of the chain.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck import checks, driver, engines
from springcheck.errors import MethodError, SpringcheckError
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene, names
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.extremes.result import windows

MODES = ("single", "mixed", "double")
FORCES = (-1e12, -3e9, -2.2e9, -2.1e9, 2.1e9, 2.2e9, 3e9, 1e12)
"""Forces about 2^31, beyond which the platform's fixed point has no number."""


def scene_of(name: str, *, random: bool) -> Scene | None:
    """A shipped scene, where asked in a bath that leaves nothing at 1; None where it takes none."""
    scene = load_scene(name)
    if not random or scene.bath:
        return scene if random == bool(scene.bath) else None
    try:
        return replace(scene, bath=Bath(temperature=0.7, friction=0.6 / scene.step))
    except SpringcheckError:
        return None


def runs(platform: str) -> list[tuple[str, str, bool]]:
    """Scene, label and whether in a bath, of all that the platform serves."""
    found = []
    for random in (False, True):
        known = engines.engine("openmm").thermostats if random else engines.engine("openmm").methods
        labels = [engines.parse(f"openmm:{x}@{platform}-{mode}") for mode in MODES for x in known]
        for name in names():
            scene = scene_of(name, random=random)
            if scene is not None:
                found += [(name, str(x), random) for x in labels if engines.obstacle(scene, x) is None]
    return found


def judged(one: tuple[str, str, bool]) -> dict[str, Any]:
    """The verdicts on one run: by check the largest fraction of its bound, and what failed."""
    name, label, random = one
    scene = scene_of(name, random=random)
    assert scene is not None
    row: dict[str, Any] = {"scene": name, "label": label, "bath": random}
    try:
        run = driver.run(scene, engines.parse(label), seed=7 if random else None)
        verdicts = checks.judge(scene, run)
    except MethodError as error:
        return row | {"refused": str(error)}
    return row | {
        "outcome": run.outcome.status,
        "passed": sum(v.passed is True for v in verdicts),
        "skipped": sum(v.passed is None for v in verdicts),
        "failed": [[v.check, v.value, v.bound, v.why] for v in verdicts if v.passed is False],
        "used": {v.check: v.value / v.bound for v in verdicts if v.passed is not None and v.bound},
    }


def beyond(row: dict[str, Any]) -> bool:
    """Whether a run failed because its forces leave the platform's fixed point."""
    return any("fixed-point sum of forces overflows" in why for *_, why in row.get("failed", ()))


def counted(rows: list[dict[str, Any]]) -> dict[str, int]:
    """Runs and verdicts of one precision mode."""
    failed = [x for x in rows if x["failed"]]
    return {
        "runs": len(rows),
        "verdicts passed": sum(x["passed"] for x in rows),
        "verdicts that cannot tell": sum(x["skipped"] for x in rows),
        "runs failed": len(failed),
        "of them where the platform's fixed point ends, as the verdict says": sum(map(beyond, failed)),
    }


def alone(label: str, force: float) -> Any:
    """OpenMM's context of one particle at 0 that is pulled by a force, on the platform of a label."""
    import openmm as mm

    # as engines.Started makes it: what a platform prints is caught, and its absence one line
    from springcheck.engines.openmm.simulation import _context

    system, pull = mm.System(), mm.CustomExternalForce(f"-({force!r})*x")
    system.addParticle(1.0)
    pull.addParticle(0, [])
    system.addForce(pull)
    context = _context(system, mm.VerletIntegrator(1.0), engines.parse(label))
    context.setPositions([(0, 0, 0)])
    return context


def at_fixed_point(label: str) -> list[float]:
    """What each of `FORCES` comes out as."""
    contexts = (alone(label, force) for force in FORCES)
    return [x.getState(forces=True).getForces(asNumpy=True)._value[0, 0] for x in contexts]


def atlas(label: str) -> dict[str, Any]:
    """How the cells of `springcheck extremes` come out by a method, and its window of forces."""
    cells = extremes.of_method(engines.parse(label))
    wrong = [[x.parameters, x.reason, x.value, x.bound] for x in cells if x.outcome == "silently wrong"]
    found = [[float(x.low), float(x.high)] for x in windows(cells)]
    return {"outcomes": Counter(x.outcome for x in cells), "windows": found, "wrong": wrong}


def cost(platform: str) -> dict[str, dict[str, float]]:
    """Seconds a step, the least of three runs of 20,000 steps recorded once."""
    found: dict[str, dict[str, float]] = {}
    for name in ("spring-uneven", "long-chain"):
        plain = load_scene(name)
        scene = replace(plain, steps=20_000, every=20_000)
        for label in ("openmm:verlet", *(f"openmm:verlet@{platform}-{mode}" for mode in MODES)):
            best = np.inf
            for _ in range(3):
                simulation = engines.Started(scene, engines.parse(label))
                q, p = np.empty((2, 1, len(scene.q)))
                began = perf_counter()
                simulation.advance(scene.every, q, p)
                best = min(best, perf_counter() - began)
            found.setdefault(name, {})[label] = best / scene.steps
    return found


def card(platform: str) -> dict[str, str]:
    """The device as OpenMM names it, and OpenMM's version.  MethodError where there is none."""
    on = alone(f"openmm:verlet@{platform}", 0.0)
    device = on.getPlatform().getPropertyValue(on, "DeviceName")
    return {**engines.load("openmm").version(), "platform": platform, "device": device}


def main() -> int:
    """Judge, print, keep; status 1 where something failed."""
    given = arguments(__doc__, platform=("CUDA", "HIP", "OpenCL"), file=str)
    about = card(given.platform)
    print(", ".join(about.values()), flush=True)
    began = perf_counter()
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as workers:
        labels = [f"openmm:{x}@{given.platform}-{mode}" for mode in MODES for x in ("verlet", "leapfrog")]
        cells = workers.map(atlas, labels)
        for row in workers.map(judged, runs(given.platform)):
            rows.append(row)
            for check, value, bound, why in () if beyond(row) else row.get("failed", ()):
                print(
                    f"  FAILED {row['scene']} {row['label']} {check}: {value:.3g} of {bound:.3g}; {why}",
                    flush=True,
                )
        extreme = dict(zip(labels, cells, strict=True))
    refused = [x for x in rows if "refused" in x]
    rows = [x for x in rows if "refused" not in x]
    counts = {mode: counted([x for x in rows if x["label"].endswith(mode)]) for mode in MODES}
    for mode, of in counts.items():
        print(f"  {mode:6}  " + ", ".join(f"{n} {what}" for what, n in of.items()))
    print(f"  {len(refused)} runs refused before they began")
    for label, found in extreme.items():
        outcomes = ", ".join(f"{n} {word}" for word, n in found["outcomes"].items())
        print(f"  {label}: {outcomes}; right for forces {found['windows']}; silently wrong {found['wrong']}")
    print(f"  {perf_counter() - began:.0f} s", flush=True)
    forces = {mode: at_fixed_point(f"openmm:verlet@{given.platform}-{mode}") for mode in MODES}
    for mode, values in forces.items():
        pairs = zip(FORCES, values, strict=True)
        print(f"  forces {mode}: " + ", ".join(f"{f:.1e} -> {x:.10g}" for f, x in pairs))
    seconds = cost(given.platform)
    for name, found in seconds.items():
        print(f"  {name}: " + ", ".join(f"{label} {s * 1e6:.3g} us a step" for label, s in found.items()))
    if given.file:
        failed = [[x["scene"], x["label"], *told[:3]] for x in rows if not beyond(x) for told in x["failed"]]
        kept = about | {"modes": counts, "failed": failed, "refused": len(refused), "extremes": extreme}
        kept |= {"asked for": FORCES, "forces": forces, "seconds a step": seconds}
        Path(given.file).write_text(json.dumps(kept, indent=1) + "\n")
    return int(any(x["failed"] for x in rows) or any(x["wrong"] for x in extreme.values()))


if __name__ == "__main__":
    script(main)
