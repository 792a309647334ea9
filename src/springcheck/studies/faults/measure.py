"""The study of the faults: which checks reject each of them, and from which size on."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from springcheck import checks
from springcheck.checks.seeds import SEEDED
from springcheck.errors import SceneError, nearest
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Drive, Spring
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.faults import baths
from springcheck.studies.faults.result import RESULTS, FaultReport, Result
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.faults.table import FAULTS
from springcheck.studies.keeper import How, Keeper, Piece


def alone(**other: Any) -> Scene:
    """One mass on a spring."""
    return spring(**{"m": 3.7, "k": 2.9, "q": 0.3, "p": 0.7, "title": "", **other})


DRIVE = Drive(i=np.array([0]), amplitude=np.array([0.43]), frequency=np.array([0.87]), phase=np.array([0.6]))

SCENES: Mapping[str, Callable[[], Scene]] = {
    "spring": alone,
    "long spring": partial(alone, steps=2100),
    "orbit": partial(alone, q=[0.3, -0.5, 0.8], p=[0.7, 1.1, -0.4], places=np.arange(3)),
    "driven": lambda: replace(one := alone(c=0.11), terms=(*one.terms, DRIVE)),
    "chain": lambda: Scene(
        m=np.array([1.3, 0.7, 2.1]), q=np.array([0.2, 1.0, 1.9]), p=np.array([0.4, -0.3, 0.5]), step=0.05,
        terms=(Spring(a=np.arange(2), b=np.arange(1, 3), k=np.array([1.1, 3.7]), rest=np.array([0.9, 1.2])),),
        steps=200),
    "bath": lambda: baths.springs(40),
    "wide bath": lambda: baths.springs(250),
}  # fmt: skip
"""The scenes of the faults: no mass, stiffness, rest point or step is 1, and h w is about 0.1."""


@cache
def scene(where: str) -> Scene:
    """A scene by its name.  SceneError where there is none."""
    if where not in SCENES:
        raise SceneError(f"a fault's scene {where!r} is none of {', '.join(SCENES)}{nearest(where, SCENES)}")
    return replace(SCENES[where](), name=where)


SLOW_CHECKS = frozenset(check.name for check in checks.THOROUGH if check.family == "law")
"""Experiments that do not depend on the scene, and take most of the time."""
SMALLEST, LARGEST = 1e-20, 0.3
"""Sizes between which a detection limit is looked for."""
DECADE_HALVINGS = 4
"""Halvings of a decade: limits are known to a factor 10**(1/16) = 1.15."""


Passed = Callable[[str, float | None], bool | None]
"""Check and size -> whether a fault of this size passes; None where the check does not apply."""


def checks_of(fault: Fault) -> tuple[str, ...]:
    """Names of the checks that judge a fault: those of thermostats, or those of deterministic methods."""
    return baths.OF_THERMOSTATS if fault.random else tuple(one.name for one in checks.ALL)


def probe(fault: Fault) -> Passed:
    """Verdicts on one fault on its scene, at any size; cached."""
    where = scene(fault.scene)

    @cache
    def recorded(size: float | None) -> dict[str, bool | None]:
        return {v.check: v.passed for v in checks.judge(where, fault.run(where, size=size))}

    @cache
    def subject(size: float | None) -> Any:
        if fault.random:
            return baths.subject(fault, size)
        return checks.Bench(scene=where, label=fault.name, run=partial(fault.run, size=size))

    @cache
    def passed(check: str, size: float | None) -> bool | None:
        if check not in checks_of(fault):
            return None
        return recorded(size).get(check) if check in RECORDED else EXPERIMENTS[check](subject(size)).passed

    return passed


def smallest(passed: Passed, check: str, size: float) -> float | None:
    """Smallest size that the check rejects, by bisection from `size`; None where it rejects none."""
    seen = passed(check, size) is False
    while SMALLEST < size < LARGEST:
        following = size / 10 if seen else size * 10
        if (passed(check, following) is False) != seen:
            break
        size = following
    else:
        return None
    low, high = sorted((size, following))
    for _ in range(DECADE_HALVINGS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if passed(check, middle) is False else (middle, high)
    return high


RECORDED = dict.fromkeys(check.name for check in (*checks.CHECKS, *checks.RANDOM))
"""Names of the checks of recorded states, in their order."""

EXPERIMENTS: dict[str, Any] = {check.name: check for check in (*checks.THOROUGH, *SEEDED)}


def examine(fault: Fault, *, limits: bool = True) -> Result:
    """Verdicts on a fault at its size in the table, and the smallest size that is detected."""
    passed, every = probe(fault), checks_of(fault)
    rejected = tuple(name for name in every if passed(name, fault.size) is False)
    found: dict[str, float] = {}
    if limits and fault.size is not None:
        for name in every:
            if passed(name, fault.size) is None or (name in SLOW_CHECKS and name not in fault.caught_by):
                continue
            limit = smallest(passed, name, fault.size)
            if limit is not None:
                found[name] = limit
    return Result(
        name=fault.name,
        about=fault.about,
        size=fault.size,
        rejected_by=rejected,
        missed_by=tuple(name for name in fault.caught_by if name not in rejected),
        limits=found,
    )


def perform(options: Namespace, progress: Progress | None) -> FaultReport:
    """Carry out `springcheck faults`."""
    return record(options.output, **keeper.how(options, progress))


def record(path: str | Path | None = None, **how: Unpack[How]) -> FaultReport:
    """Examine all faults and their detection limits, with a store where there is a path."""
    pieces = [
        Piece(key=one.name, what=one.name, measure=partial(_examine, one.name), form=RESULTS)
        for one in FAULTS
    ]

    def measure(kept: Keeper) -> FaultReport:
        found = FaultReport(results=tuple(kept.results(pieces)))
        kept.add(found.limits())
        return found

    return keeper.study("faults", path, (), measure, **how)


@keeper.restoring("faults")
def stored(kept: keeper.Kept) -> FaultReport:
    """The study that a store holds, from its document alone."""
    known = kept.document
    limits = known["limits"]
    results = tuple(Result(**one, limits=limits.get(one["name"], {})) for one in known["faults"])
    return FaultReport(results=results, path=kept.path)


def _examine(name: str) -> Result:
    return examine(next(fault for fault in FAULTS if fault.name == name))
