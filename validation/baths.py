"""False alarms and wrong names at temperature, counted over random cases.

Claim: right thermostats raise no alarm beyond the stated 1e-6 a command, on random scenes whose masses,
stiffnesses and temperatures are spread over twelve decades, by own methods and by OpenMM, ASE and LAMMPS; and
no random file of one oscillator, every step stored, gets the name of another thermostat.

Command: python validation/baths.py alarms|engines|names [COUNT [FIRST]]

A case is its number; none is left out and none is tried again.  Printed by 1,500, 600 and 210 cases:

    alarms: 1500 cases             engines: 600 cases             names: 210 cases
             0 alarms                       0 alarms                     210 files
          1500 runs                       600 runs                       126 listed
         15321 verdicts                    88 runs of ase                 66 named
                                          380 runs of lammps              18 noise of no scheme that is known
                                          132 runs of openmm
                                         6577 verdicts
"""

from __future__ import annotations

import sys
import warnings
from collections import Counter
from collections.abc import Callable

import numpy as np

from arguments import arguments, script
from clean import clean_bath
from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS, naming
from springcheck.engines.contract import Label
from springcheck.errors import SpringcheckError
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring

LABELS = [
    f"{name}:{method}"
    for name in ("openmm", "ase", "lammps")
    if not engines.absence(name)
    for method in engines.engine(name).thermostats
]

DIGITS = (0, 0, 0, 24, 12, 8)
"""How frames are stored: whole, in single precision (24 bits), or as text of so many digits."""


def alarms(case: int) -> dict[str, int]:
    """A random scene by a right thermostat, one of all, through every check."""
    found = clean_bath(case)
    return {"runs": found.runs, "verdicts": found.verdicts, "alarms": len(found.alarms)}


def scene_of(rng: np.random.Generator, scheme: str, n: int, steps: int) -> Scene:
    """One spring, or more particles of which neighbours share one; nothing is 1."""
    x, turn = rng.uniform(0.02, 0.9), rng.uniform(0.1, 1) / (1.6 if n > 1 else 1)
    if scheme == "euler-maruyama":
        turn = min(turn, 0.5 * x)
    if scheme == "brownian":
        turn = min(turn, np.sqrt(x) * 0.9)
    m, w, thermal = rng.uniform(0.3, 9, n), np.exp(rng.uniform(-2, 3)), 10 ** rng.uniform(-3, 3)
    k, i = m * w * w, np.arange(n)
    joint = Spring(a=i[:-1], b=i[1:], k=np.full(n - 1, 0.3 * np.min(k)), rest=np.zeros(n - 1))
    size = np.sqrt(thermal / k)
    return Scene(
        m=m, q=size * rng.normal(size=n), p=m * w * size * rng.normal(size=n),
        terms=(WallSpring(i=i, k=k, at=np.zeros(n)), *[joint] * (n > 1)), step=turn / w, steps=steps,
        bath=Bath(temperature=thermal, friction=x * w / turn), name="random",
    )  # fmt: skip


def by_engine(case: int) -> dict[str, int]:
    """Springs in a bath by a method of another library, through every check."""
    rng, label = np.random.default_rng([26, case]), LABELS[case % len(LABELS)]
    scheme = engines.method(engines.parse(label)).scheme
    scene = scene_of(rng, scheme, int(rng.integers(1, 4)), steps=int(rng.choice([100, 300, 2000])))
    try:
        verdicts = checks.judge(scene, driver.run(scene, label, seed=case + 1))
        verdicts += checks.judge_thoroughly(scene, label, driver.run, seed=case + 1)
    except SpringcheckError as error:
        return {f"refused: {error}"[:90]: 1}
    failed = [v for v in checks.shared(verdicts) if v.passed is False]
    return {
        "runs": 1, f"runs of {label.partition(':')[0]}": 1, "alarms": len(failed),
        "verdicts": sum(v.passed is not None for v in verdicts),
        **{f"alarm of {v.check} by {label}": 1 for v in failed},
    }  # fmt: skip


def names(case: int) -> dict[str, int]:
    """What frames of one oscillator are named, nothing stated; of Bussi's factor no scheme is known."""
    rng, scheme = np.random.default_rng([27, case]), list(THERMOSTATS)[case % len(THERMOSTATS)]
    scene = scene_of(rng, scheme, 1, steps=int(rng.choice([400, 1000, 4000])))
    run, digits = driver.run(scene, Label(engine="own", method=scheme), seed=case + 1), rng.choice(DIGITS)
    q, v = run.q[:, 0], run.p[:, 0] / scene.m
    if digits == 24:
        q, v = (x.astype(np.float32).astype(float) for x in (q, v))
    elif digits:
        q, v = (np.array([float(f"{y:.{digits}g}") for y in x]) for x in (q, v))
    found = naming.thermostats(q, v, scene.step)
    one = naming.named(found) if found else None
    if one:
        word = "named" if one.scheme == scheme else "WRONG NAME"
    elif not found:
        word = "nothing said" if found is None else "noise of no scheme that is known"
    else:
        word = "listed" if scheme in [y.scheme for y in found] else "listed without it"
    wrong = {f"case {case}: {scheme}, said {one.scheme}": 1} if one and one.scheme != scheme else {}
    return {"files": 1, word: 1, **wrong}


PARTS: dict[str, Callable[[int], dict[str, int]]] = {"alarms": alarms, "engines": by_engine, "names": names}


def main() -> int:
    """Count cases and print what they come to."""
    given = arguments(__doc__, part=tuple(PARTS), count=500, first=int)
    warnings.simplefilter("ignore")
    first, found = given.first or 0, Counter[str]()
    for case in range(first, first + given.count):
        one = PARTS[given.part](case)
        found.update(one)
        if one.get("alarms"):
            print(f"case {case}: an alarm", file=sys.stderr)
    print(f"{given.part}: {given.count} cases")
    for word, number in sorted(found.items()):
        print(f"  {number:8} {word}")
    return int(bool(found["alarms"] or found["WRONG NAME"]))


if __name__ == "__main__":
    script(main)
