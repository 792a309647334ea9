"""False alarms and wrong names at temperature, counted over as many random cases as one likes.

Claim: right thermostats raise no alarm beyond the stated 1e-6 a command, on random scenes whose masses,
stiffnesses and temperatures are spread over twelve decades; and no random file of a thermostat gets a wrong
name, whether whole, of every few steps, in single precision, in text, or of two coupled particles.

Command: python validation/thermal_campaign.py alarms|engines|files|wide [COUNT [FIRST]]
         python validation/thermal_campaign.py merge

`files` are of frictions and steps as one would choose them; `wide` are of gamma h from 0.001 to 4 and h omega
from 0.003 to 1.6, of free particles too, 300 to 3,000 frames.

Each call adds COUNT cases (1,000) to those that data/reference/thermostats has, in the order of their
numbers, none left out, and prints what they come to; what is done is kept every 50 cases and by Ctrl-C.  A
case is its number: the same cases are made again by a seeded part of the tests.

With FIRST the cases are FIRST to FIRST + COUNT - 1, kept in a file of their own: processes side by side take
ranges that do not meet, each goes on where it stopped when it is called again, and `merge` adds their files.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import springcheck
from arguments import arguments, script
from clean import clean_bath
from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS
from springcheck.engines.contract import Label
from springcheck.errors import SpringcheckError
from springcheck.identify.thermal import of_bath
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring

HERE = Path(__file__).parents[1] / "data" / "reference" / "thermostats"
EVERY = 50
"""Cases after which a campaign is written down."""

OUT_OF_BOUNDS = 1e9
"""Times the start's largest position from which on a run is one that its scheme has no limit for."""

KINDS = ("whole", "strided", "single", "text", "coupled")


def alarms(case: int) -> dict[str, int]:
    """A random scene by a right thermostat, one of all, through every check."""
    found = clean_bath(case)
    return {"runs": found.runs, "verdicts": found.verdicts, "alarms": len(found.alarms)}


DRAWN = [name for name, one in THERMOSTATS.items() if one.draws]

LINEAR = [name for name, one in THERMOSTATS.items() if not one.rescales]

LABELS = [
    f"{name}:{method}"
    for name in ("openmm", "ase", "lammps")
    if not engines.absence(name)
    for method in engines.engine(name).thermostats
]


def scene_of(
    rng: np.random.Generator, scheme: str, *, coupled: bool, steps: int, wide: bool = False
) -> Scene:
    """One spring, or two particles that share one; nothing is 1."""
    x, turn = rng.uniform(0.02, 0.9), rng.uniform(0.1, 1)
    if wide:
        x, turn = 10 ** rng.uniform(-3, 0.6), 10 ** rng.uniform(-2.5, 0.2)
        # that scheme has no noise of real size from 2 on
        x = min(x, 1.9) if scheme.startswith("gj-iii") else x
    if scheme == "euler-maruyama":
        turn = min(turn, 0.5 * x)
    if scheme == "brownian":
        turn = min(turn, np.sqrt(x) * 0.9)
    n = 2 if coupled else 1
    m, w = rng.uniform(0.3, 9, n), np.exp(rng.uniform(-2, 3))
    k = m * w * w
    thermal = 10 ** rng.uniform(-3, 3)
    terms: list[Any] = [WallSpring(i=np.arange(n), k=k, at=np.zeros(n))]
    if coupled:
        terms.append(Spring(a=np.array([0]), b=np.array([1]), k=np.array([0.3 * k[0]]), rest=np.zeros(1)))
        turn /= 1.6
    size = np.sqrt(thermal / k)
    return Scene(
        m=m, q=size * rng.normal(size=n), p=m * w * size * rng.normal(size=n), terms=tuple(terms),
        step=turn / w, steps=steps, bath=Bath(temperature=thermal, friction=x * w / turn), name="random",
    )  # fmt: skip


def by_engine(case: int) -> dict[str, int]:
    """A spring or a pair in a bath by a method of another library, through every check."""
    rng = np.random.default_rng([26, case])
    label = LABELS[case % len(LABELS)]
    scheme = engines.method(engines.parse(label)).scheme
    scene = scene_of(rng, scheme, coupled=bool(rng.integers(2)), steps=300)
    try:
        verdicts = checks.judge(scene, driver.run(scene, label, seed=case + 1))
        verdicts += checks.judge_thoroughly(scene, label, driver.run, seed=case + 1)
    except SpringcheckError as error:
        return {f"refused: {error}"[:90]: 1}
    failed = [v for v in checks.shared(verdicts) if v.passed is False]
    return {
        "runs": 1, "verdicts": sum(v.passed is not None for v in verdicts), "alarms": len(failed),
        **{f"alarm of {v.check} by {label}": 1 for v in failed},
    }  # fmt: skip


def file_of(case: int, name: str = "", kind: str = "", *, wide: bool = False) -> tuple[str, str, Any]:
    """Scheme, kind and (t, q, p, scene) of a random file of 1,000 frames; of another scheme or kind if given,
    by which a case stays what it is when the catalogue grows."""
    schemes, kinds = (DRAWN, (*KINDS, "free")) if wide else (LINEAR, KINDS)
    rng, many = np.random.default_rng([27, case]), len(schemes)
    name, kind = name or schemes[case % many], kind or kinds[case // many % len(kinds)]
    every = int(rng.integers(2, 6)) if kind == "strided" else 1
    frames = int(10 ** rng.uniform(2.5, 3.5)) if wide else 1000
    scene = scene_of(rng, name, coupled=kind == "coupled", steps=frames * every, wide=wide)
    scene = scene.derived(every=every, **({"terms": ()} if kind == "free" else {}))
    run = driver.run(scene, Label(engine="own", method=name), seed=case + 1)
    q, p = run.q, run.p
    if kind == "single":
        q, p = q.astype(np.float32).astype(float), p.astype(np.float32).astype(float)
    if kind == "text":
        digits = int(rng.integers(5, 13))
        q, p = (np.array([[float(f"{x:.{digits}g}") for x in row] for row in y]) for y in (q, p))
    return name, kind, (run.t, q, p, scene)


def files(case: int, *, wide: bool = False) -> dict[str, int]:
    """What is said of a random file, nothing stated but the masses: by what looks for noise, and of every
    eighth by the whole of identify."""
    name, kind, (t, q, p, scene) = file_of(case, wide=wide)
    if not np.max(np.abs(q)) < OUT_OF_BOUNDS * np.max(np.abs(scene.q)):
        return {f"{kind}: runs away": 1}
    try:
        whole = case // 5 % 8 == 0
        found: Any = springcheck.identify(t, q, p, mass=scene.m) if whole else of_bath(t, q, p, None, scene.m)
    except SpringcheckError:
        found = None
    if found is None:
        return {kind: 1, f"{kind}: nothing said": 1}
    schemes = [one.scheme for one in found.candidates]
    if found.verdict == "named":
        word = "named" if found.scheme == name else "WRONG NAME"
    elif not schemes:
        word = "nothing said"
    else:
        hedged = "or one that is not known here" in found.statement
        word = (
            "listed" if name in schemes else "listed as not known here" if hedged else "MISSING IN THE LIST"
        )
    out = {kind: 1, f"{kind}: {word}": 1}
    if word.isupper():
        out[f"case {case}: {name} {kind}, said {', '.join(schemes[:4])}"] = 1
    return out


PARTS: dict[str, Callable[[int], dict[str, int]]] = {
    "alarms": alarms, "engines": by_engine, "files": files, "wide": partial(files, wide=True)
}  # fmt: skip


def add(part: str, count: int, first: int | None = None) -> dict[str, Any]:
    """Add so many cases to those that are stored, or those from a first one on to a file of their own."""
    path = HERE / (f"{part}.json" if first is None else f"{part}-{first}.json")
    known: dict[str, Any] = {"cases": first or 0, "found": {}}
    if path.exists():
        known = json.loads(path.read_text())
    found: Counter[str] = Counter(known["found"])
    begin = known["cases"]
    try:
        for case in range(begin, (begin if first is None else first) + count):
            one = PARTS[part](case)
            found.update(one)
            if part == "alarms" and one["alarms"]:
                found[f"alarm in case {case}"] += 1
            known["cases"] = case + 1
            if (case + 1) % EVERY == 0:
                _write(path, known, found)
    finally:
        _write(path, known, found)
    return known


def merge() -> int:
    """Add the files of ranges to those of their parts; refuses one that meets cases that are counted."""
    for part in PARTS:
        for path in sorted(HERE.glob(f"{part}-[0-9]*.json")):
            whole, one = HERE / f"{part}.json", json.loads(path.read_text())
            known: dict[str, Any] = {"cases": 0, "found": {}}
            if whole.exists():
                known = json.loads(whole.read_text())
            first, end = int(path.stem.partition("-")[2]), one["cases"]
            if any(first < b and a < end for a, b in [(0, known["cases"]), *known.get("more", [])]):
                print(f"{path}: some of its cases are counted already", file=sys.stderr)
                return 1
            known["more"] = [*known.get("more", []), [first, end]]
            found = Counter(known["found"])
            found.update(one["found"])  # a sum of counters would drop what is 0
            _write(whole, known, found)
            path.unlink()
            print(f"{part}: cases {first} to {end - 1} added")
    return 0


def _write(path: Path, known: dict[str, Any], found: Counter[str]) -> None:
    known["found"] = dict(sorted(found.items()))
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.write_text(json.dumps(known, indent=1) + "\n")
    new.replace(path)


def main() -> int:
    """Add cases and print what all of them come to."""
    given = arguments(__doc__, part=(*PARTS, "merge"), count=1000, first=int)
    part = given.part
    if part == "merge":
        return merge()
    warnings.simplefilter("ignore")
    known = add(part, given.count, given.first)
    done = known["cases"] - (given.first or 0)
    print(f"{part}: {done} cases")
    wrong = 0
    for word, number in known["found"].items():
        print(f"  {number:8} {word}")
        wrong += number if word == "alarms" or word.endswith(("WRONG NAME", "IN THE LIST")) else 0
    return 1 if wrong else 0


if __name__ == "__main__":
    script(main)
