"""The study of the faults: what rejects each of them, how small it may be, and no alarm without one."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Unpack

import numpy as np

from springcheck import checks, driver, engines, schemes
from springcheck.checks import Experiment, Run
from springcheck.checks.seeds import SEEDED
from springcheck.errors import MethodError
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.terms import Drive, Spring
from springcheck.physics.trajectory import Trajectory, Verdict
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.faults import baths, clean, space, steppers
from springcheck.studies.faults.result import CLEANS, RESULTS, SEEN, Clean, FaultReport, Result, seen
from springcheck.studies.faults.seeded import Fault, Where
from springcheck.studies.faults.table import FAULTS
from springcheck.studies.keeper import How, Keeper, Piece
from springcheck.studies.tables import Documents
from springcheck.thermal import THERMOSTATS

SHIPPED = {
    "dumbbell": ("dumbbell", 200), "triangle": ("rigid-triangle", 40), "field": ("foucault", 200),
    "hot rod": ("bath-dumbbell", 400),
}  # fmt: skip
"""Scenes of the faults that are shipped ones, of so many steps."""


@cache
def scene(where: Where) -> Scene:
    """The scenes of the faults: no mass, stiffness, rest point or step that is 1, h w about 0.1."""
    if where == "chain":
        springs = Spring(
            a=np.array([0, 1]), b=np.array([1, 2]), k=np.array([1.1, 3.7]), rest=np.array([0.9, 1.2])
        )
        return Scene(
            m=np.array([1.3, 0.7, 2.1]),
            terms=(springs,),
            q=np.array([0.2, 1.0, 1.9]),
            p=np.array([0.4, -0.3, 0.5]),
            step=0.05,
            steps=200,
            name=where,
        )
    if where == "orbit":
        q, p = [0.3, -0.5, 0.8], [0.7, 1.1, -0.4]
        return spring(m=3.7, k=2.9, q=q, p=p, places=np.arange(3), name=where, title="")
    if where == "driven":
        drive = Drive(
            i=np.array([0]), amplitude=0.43 * np.ones(1), frequency=0.87 * np.ones(1), phase=0.6 * np.ones(1)
        )
        alone = spring(m=3.7, k=2.9, q=0.3, p=0.7, c=0.11, step=0.1, steps=200, name=where, title="")
        return replace(alone, terms=(*alone.terms, drive))
    if where == "box":
        return space.pair_in_a_box(name=where)
    if where in ("bath", "wide bath"):
        return baths.springs({"bath": 40, "wide bath": 250}[where], name=where)
    if where in SHIPPED:
        name, steps = SHIPPED[where]
        return replace(load_scene(name), steps=steps, name=where)
    if where == "varying steps":
        return replace(scene("spring"), steps=60, tolerance=1e-3, name=where)
    steps = 2100 if where == "long spring" else 200
    return spring(m=3.7, k=2.9, q=0.3, p=0.7, step=0.1, steps=steps, name=where, title="")


SLOW = frozenset(check.name for check in checks.THOROUGH if check.family == "law")
"""Experiments that do not look at the scene, and take most of the time."""
CLEAN = 320
"""Random scenes for the plain engine; each meets one scheme."""
RESCALING = 0.1
"""Share of random baths whose thermostat has one factor for all momenta."""

BATHS = 160
"""Random scenes in a bath; each meets one thermostat."""
BY_ENGINES = 40
"""Random scenes for each method of the engines."""
SMALLEST, LARGEST = 1e-20, 0.3
"""Sizes between which a detection limit is looked for."""
HALVINGS = 4
"""Of a decade: limits are known to a factor 10**(1/16) = 1.15."""


Passed = Callable[[str, float | None], bool | None]
"""Whether a fault of this size passes this check; None where that does not apply."""


def checks_of(fault: Fault) -> tuple[str, ...]:
    """By name: those of thermostats, or those of everything else."""
    return baths.OF_THERMOSTATS if fault.random else tuple(one.name for one in checks.ALL)


def probe(fault: Fault) -> Passed:
    """One fault on its scene, judged at any size; what is computed once is kept."""
    where = scene(fault.scene)

    @cache
    def recorded(size: float | None) -> dict[str, bool | None]:
        return {v.check: v.passed for v in checks.judge(where, fault.run(where, size=size))}

    @cache
    def subject(size: float | None) -> Any:
        if fault.random:
            return baths.subject(fault, size, where if where.system.rods else None)
        return checks.Bench(scene=where, label=fault.name, run=partial(fault.run, size=size))

    @cache
    def passed(check: str, size: float | None) -> bool | None:
        if check in RECORDED:
            return recorded(size).get(check)
        return _EXPERIMENTS[check](subject(size)).passed if check in checks_of(fault) else None

    return passed


def passes(fault: Fault, check: str) -> bool | None:
    """Whether a check of recorded states passes a fault of its size; None where it does not apply."""
    known = checks.RANDOM if fault.random else checks.CHECKS
    if check not in {one.name for one in known}:
        return None
    return probe(fault)(check, fault.size)


def smallest(passed: Passed, check: str, size: float) -> float | None:
    """The smallest size that the check rejects, by bisection from one on; None where it rejects none."""
    seen = passed(check, size) is False
    while SMALLEST < size < LARGEST:
        following = size / 10 if seen else size * 10
        if (passed(check, following) is False) != seen:
            break
        size = following
    else:
        return None
    low, high = sorted((size, following))
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        if passed(check, middle) is False:
            high = middle
        else:
            low = middle
    return high


RECORDED = {check.name: check for check in (*checks.CHECKS, *checks.RANDOM)}
_EXPERIMENTS: dict[str, Any] = {
    **{check.name: check for check in checks.THOROUGH},
    **{check.name: check for check in SEEDED},
}


def examine(fault: Fault, *, limits: bool = True) -> Result:
    """What the checks say of a fault at its size in the table, and down to which size they see it."""
    passed, every = probe(fault), checks_of(fault)
    rejected = tuple(name for name in every if passed(name, fault.size) is False)
    found: dict[str, float] = {}
    if limits and fault.size is not None:
        for name in every:
            if passed(name, fault.size) is None or (name in SLOW and name not in fault.caught_by):
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


def clean_scene(seed: int) -> Clean:
    """A random scene by the plain engine, one of all schemes, through every check that looks at it."""
    rng = np.random.default_rng([2026, seed])
    where = clean.random_scene(rng)
    scheme = schemes.SCHEMES[str(rng.choice(_FIXED))]
    return _judged(where, f"plain:{scheme.name}", _plain(scheme), seed, _QUICK)


def clean_bath(seed: int) -> Clean:
    """A random scene in a bath by a right thermostat, one of all, through every check of thermostats."""
    rng = np.random.default_rng([2028, seed])
    where = baths.random_scene(rng)
    linear, others = ([x for x, one in THERMOSTATS.items() if one.rescales == kind] for kind in (False, True))
    scheme = str(rng.choice(linear))
    right = Fault(
        "thermostat", "", (), baths.broken(),
        scheme=str(rng.choice(others)) if rng.random() < RESCALING and np.any(where.p) else scheme,
    )  # fmt: skip
    subject = baths.subject(right, None, where, seed + 1)
    verdicts = checks.judge(where, right.run(where, seed=seed + 1)) + [one(subject) for one in SEEDED]
    return _counted(checks.shared(verdicts), f"plain:{right.scheme}", seed)


def clean_laws(name: str) -> Clean:
    """The laws that hold over many runs, for the plain engine and one scheme."""
    slow = tuple(check for check in checks.THOROUGH if check.name in SLOW)
    return _judged(scene("spring"), f"plain:{name}", _plain(schemes.SCHEMES[name]), -1, slow)


def clean_engine(run: Run, label: str, seed: int) -> Clean:
    """A random scene by a method of an engine."""
    where = clean.random_scene(np.random.default_rng([2027, seed]))
    return _judged(where, label, run, seed, _QUICK)


_FIXED = tuple(
    name
    for name, scheme in schemes.SCHEMES.items()
    if scheme.has("one-step") and not scheme.has("flow") and not scheme.has("mixes")
)
_QUICK = tuple(check for check in checks.THOROUGH if check.name not in SLOW)


def _plain(scheme: schemes.Scheme) -> Run:
    def run(s: Scene, label: str) -> Trajectory:
        return steppers.record(s, scheme, steppers.textbook(s, scheme), label=label)

    return run


def _judged(where: Scene, label: str, run: Run, seed: int, experiments: tuple[Experiment, ...]) -> Clean:
    try:
        verdicts = checks.judge(where, run(where, label))
    except MethodError:
        return Clean(runs=0, verdicts=0, alarms=())
    return _counted(verdicts + checks.judge_thoroughly(where, label, run, experiments), label, seed)


def _counted(verdicts: Sequence[Verdict], label: str, seed: int) -> Clean:
    return Clean(
        runs=1,
        verdicts=sum(verdict.passed is not None for verdict in verdicts),
        alarms=tuple(
            f"{label}, scene {seed}: {v.check} {v.value:.3g} of {v.bound:.3g}"
            for v in verdicts
            if v.passed is False
        ),
    )


def judged_labels() -> list[str]:
    """Default methods of fixed step that are here: their right runs are judged too."""
    return [
        str(label)
        for label in engines.match(("*",))
        if engines.absence(label.engine) is None and not engines.method(label).adaptive
    ]


def perform(options: Namespace, progress: Progress | None) -> FaultReport:
    """What `springcheck faults` does."""
    return record(options.output, **keeper.how(options, progress))


def record(path: str | Path | None, **how: Unpack[How]) -> FaultReport:
    """The whole study, by the engines that are here too, kept in a store where there is a path."""
    labels = judged_labels()
    command = keeper.command("faults", list(map(engines.parse, labels)))
    with keeper.kept(path, command, **how) as kept:
        found = study(driver.run, labels, kept=kept)
        keep(kept, found)
    return found


def keep(kept: Keeper, found: FaultReport) -> None:
    """Keep a study in a store."""
    kept.keep(SEEN, "limits", seen(found))
    kept.commit("faults", found.document())


@keeper.restoring("faults")
def stored(kept: keeper.Kept) -> FaultReport:
    """The study that a store holds: its document has everything."""
    known = kept.document
    limits = known["limits"]
    results = tuple(Result(**one, limits=limits.get(one["name"], {})) for one in known["faults"])
    clean = Clean(
        runs=known["clean_runs"], verdicts=known["clean_verdicts"], alarms=tuple(known["false_alarms"])
    )
    return FaultReport(results=results, clean=clean, path=kept.path)


def study(run: Run | None = None, labels: Sequence[str] = (), *, kept: Keeper | None = None) -> FaultReport:
    """All faults, their limits, and the clean runs; `run` and `labels` add those of the engines.

    `run` must be a function that another process can import.
    """
    faults = [_piece(RESULTS, fault.name, partial(_examine, fault.name)) for fault in FAULTS]
    cleans = [_piece(CLEANS, f"laws of {name}", partial(clean_laws, name)) for name in _FIXED]
    scenes: list[tuple[str, Callable[[int], Clean], int]] = [
        ("random scenes", clean_scene, CLEAN), ("random baths", clean_bath, BATHS),
    ]  # fmt: skip
    if run is not None:
        scenes += [(label, partial(clean_engine, run, label), BY_ENGINES) for label in labels]
    cleans += [
        _piece(CLEANS, f"{what} {first}", partial(_batch, judged, first))
        for what, judged, count in scenes
        for first in range(0, count, _BATCH)
    ]
    kept = kept or Keeper()
    found = kept.results([*faults, *cleans])
    clean = _together(found[len(faults) :])
    return FaultReport(results=tuple(found[: len(faults)]), clean=clean, resumed=kept.resumed, path=kept.path)


_BATCH = 20


def _piece(form: Documents[Any], key: str, measure: Callable[[], Result | Clean]) -> Piece:
    return Piece(key=key, what=key, measure=measure, form=form)


def _examine(name: str) -> Result:
    return examine(next(fault for fault in FAULTS if fault.name == name))


def _batch(judged: Callable[[int], Clean], first: int) -> Clean:
    return _together([judged(seed) for seed in range(first, first + _BATCH)])


def _together(parts: Sequence[Clean]) -> Clean:
    return Clean(
        runs=sum(part.runs for part in parts),
        verdicts=sum(part.verdicts for part in parts),
        alarms=tuple(alarm for part in parts for alarm in part.alarms),
    )
