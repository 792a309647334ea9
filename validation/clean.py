"""Random scenes for right engines, and the verdicts on them: every alarm is a false one.

python validation/clean.py        (all of them, in several minutes; tests take some)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

import bathed as baths
import textbook as steppers
from arguments import arguments, script
from springcheck import checks, driver, engines, schemes
from springcheck.bath import THERMOSTATS
from springcheck.checks import Check, Run
from springcheck.checks.seeds import SEEDED
from springcheck.errors import MethodError
from springcheck.physics import builders
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, Term, WallSpring
from springcheck.physics.trajectory import Trajectory, Verdict
from textbook import Fault

CLEAN = 320
"""Random scenes for the plain engine; each meets one scheme."""

BATHS, RESCALING = 160, 0.1
"""Random scenes in a bath, each of which meets one thermostat; share of those whose thermostat has one factor
for all momenta."""

BY_ENGINES = 40
"""Random scenes for each method of the engines."""

BATCH = 20
"""Scenes that are judged together."""

FIXED = tuple(
    name
    for name, scheme in schemes.SCHEMES.items()
    if scheme.has("one-step") and not scheme.has("flow") and not scheme.has("mixes")
)
"""Schemes of the plain engine."""

SLOW = tuple(check for check in checks.THOROUGH if check.family == "law")
QUICK = tuple(check for check in checks.THOROUGH if check.family != "law")
"""Experiments that do not look at the scene, and those that do."""


def scene(
    m: Floats, terms: tuple[Term, ...], q: Floats, p: Floats, *, step: float, steps: int, every: int = 1
) -> Scene:
    """A scene made of numbers."""
    return Scene(m=m, terms=terms, q=q, p=p, step=step, steps=steps, every=every, name="random")


def walls(k: Floats, at: Floats) -> WallSpring:
    """One wall spring for each particle."""
    return WallSpring(i=np.arange(len(k)), k=np.asarray(k, np.float64), at=np.asarray(at, np.float64))


def random_scene(rng: np.random.Generator, *, steps: int = 200, decades: float = 6.0) -> Scene:
    """One of five kinds of scene: springs, a chain, a free chain, an inverted spring, free flight.

    Masses, stiffnesses and amplitudes are spread over twice so many decades; h w from 1e-3 to 1.99.
    """
    kind = rng.choice(["springs", "springs", "springs", "chain", "free chain", "inverted", "flight"])
    if kind in ("springs", "inverted", "flight"):
        made = _side_by_side(rng, kind, steps, decades)
    else:
        made = _chain(rng, steps, free=kind == "free chain")
    every = int(rng.choice([1, 1, 1, 2, 7]))
    backwards = rng.random() < 0.2
    return replace(
        made, every=every, steps=made.steps // every * every, step=-made.step if backwards else made.step
    )


def _spread(rng: np.random.Generator, decades: float, n: int) -> Floats:
    return np.asarray(10 ** rng.uniform(-decades, decades, n) * rng.uniform(1, 2, n))


def _hw(rng: np.random.Generator) -> float:
    """h w: anywhere below the limit, near the limit, or small."""
    return float(
        rng.choice([rng.uniform(0.01, 1.9), 2 - 10 ** rng.uniform(-2, -1), 10 ** rng.uniform(-3, -0.5)])
    )


def _side_by_side(rng: np.random.Generator, kind: str, steps: int, decades: float) -> Scene:
    n = int(rng.integers(1, 4))
    m, k = _spread(rng, decades, n), _spread(rng, decades, n)
    # the same frequency for all, up to a factor: one step has to serve them
    k = m * (k[0] / m[0]) * rng.uniform(0.3, 1, n)
    w = np.sqrt(k / m)
    h = _hw(rng) / float(np.max(w))
    amplitude = _spread(rng, decades, n)
    phase = rng.uniform(0, 2 * np.pi, n)
    at = np.where(rng.random(n) < 0.5, 0.0, amplitude * 10 ** rng.uniform(-1, 3, n))
    q, p = at + amplitude * np.cos(phase), m * w * amplitude * np.sin(phase)
    if kind == "inverted":
        # e-foldings enough to see growth, few enough not to leave the reference's range
        steps = max(2, min(steps, int(30 / (h * float(np.max(w))))))
        k = -k
    if kind == "flight":
        k = np.zeros(n)
    return scene(m, (walls(k, at),), q, p, step=h, steps=steps)


def _chain(rng: np.random.Generator, steps: int, *, free: bool) -> Scene:
    n = int(rng.integers(2, 6))
    size = 10 ** rng.uniform(-3, 3)
    m, k = _spread(rng, 1, n), _spread(rng, 1, n - 1)
    rest = np.where(rng.random(n - 1) < 0.5, 0.0, size * rng.uniform(0.5, 2, n - 1))
    terms: tuple[Term, ...] = (Spring(a=np.arange(n - 1), b=np.arange(1, n), k=k, rest=rest),)
    if not free:
        ends = np.array([0, n - 1])
        at = np.array([0.0, np.sum(rest)])
        terms = (WallSpring(i=ends, k=_spread(rng, 1, 2), at=at), *terms)
    q = np.concatenate([[0.0], np.cumsum(rest)]) + 0.1 * size * rng.normal(size=n)
    made = scene(m, terms, q, np.zeros(n), step=1.0, steps=steps)
    stiff = made.system.hessian(q).astype(np.float64)
    w = float(np.sqrt(np.max(np.linalg.eigvalsh(stiff / np.sqrt(m)[:, None] / np.sqrt(m)))))
    p = 0.1 * size * w * m * rng.normal(size=n)
    return replace(made, p=p, step=_hw(rng) / w)


def random_bath(rng: np.random.Generator) -> Scene:
    """A random scene in a bath of any temperature, of gamma h from 1e-3 to 0.9."""
    made = random_scene(rng, steps=300)
    h = abs(made.step)
    bath = Bath(temperature=10 ** rng.uniform(-6, 6), friction=np.exp(rng.uniform(-6.9, -0.1)) / h)
    return replace(made, every=1, step=h, bath=bath)


@dataclass(frozen=True, slots=True, kw_only=True)
class Clean:
    """Right engines: trajectories judged, verdicts passed on them, and those that were false alarms."""

    runs: int
    verdicts: int
    alarms: tuple[str, ...]


def clean_scene(seed: int) -> Clean:
    """A random scene by the plain engine, one of all schemes, through every check that looks at it."""
    rng = np.random.default_rng([2026, seed])
    where = random_scene(rng)
    scheme = schemes.SCHEMES[str(rng.choice(FIXED))]
    return _judged(where, f"plain:{scheme.name}", _plain(scheme), seed, QUICK)


def clean_bath(seed: int) -> Clean:
    """A random scene in a bath by a right thermostat, one of all, through every check of thermostats."""
    rng = np.random.default_rng([2028, seed])
    where = random_bath(rng)
    linear, others = ([x for x, one in THERMOSTATS.items() if one.rescales == kind] for kind in (False, True))
    scheme = str(rng.choice(linear))
    right = Fault(
        "thermostat", "", (), baths.played,
        scheme=str(rng.choice(others)) if rng.random() < RESCALING and np.any(where.p) else scheme,
    )  # fmt: skip
    subject = baths.subject(right, None, where, seed + 1)
    verdicts = checks.judge(where, right.run(where, seed=seed + 1)) + [one(subject) for one in SEEDED]
    return _counted(checks.shared(verdicts), f"plain:{right.scheme}", seed)


def clean_laws(name: str) -> Clean:
    """The laws that hold over many runs, for the plain engine and one scheme."""
    return _judged(
        builders.spring(m=3.7, k=2.9, q=0.3, p=0.7), f"plain:{name}", _plain(schemes.SCHEMES[name]), -1, SLOW
    )


def clean_engine(run: Run, label: str, seed: int) -> Clean:
    """A random scene by a method of an engine."""
    where = random_scene(np.random.default_rng([2027, seed]))
    return _judged(where, label, run, seed, QUICK)


def _plain(scheme: schemes.Scheme) -> Run:
    def run(s: Scene, label: str) -> Trajectory:
        return steppers.record(s, scheme, steppers.textbook(s, scheme), label=label)

    return run


def _judged(where: Scene, label: str, run: Run, seed: int, experiments: tuple[Check, ...]) -> Clean:
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
    """Default methods of fixed step that are here."""
    return [
        str(label)
        for label in engines.match(("*",))
        if engines.absence(label.engine) is None and not engines.method(label).adaptive
    ]


def parts() -> list[Callable[[], Clean]]:
    """All clean runs, in pieces that another process can carry out."""
    scenes: list[tuple[Callable[[int], Clean], int]] = [(clean_scene, CLEAN), (clean_bath, BATHS)]
    scenes += [(partial(clean_engine, driver.run, label), BY_ENGINES) for label in judged_labels()]
    return [
        *(partial(clean_laws, name) for name in FIXED),
        *(partial(_batch, judged, first) for judged, count in scenes for first in range(0, count, BATCH)),
    ]


def _batch(judged: Callable[[int], Clean], first: int) -> Clean:
    return together([judged(seed) for seed in range(first, first + BATCH)])


def together(found: Sequence[Clean]) -> Clean:
    """The sum of several."""
    return Clean(
        runs=sum(part.runs for part in found),
        verdicts=sum(part.verdicts for part in found),
        alarms=tuple(alarm for part in found for alarm in part.alarms),
    )


def main() -> int:
    """Judge all of them; 1 where a right engine is rejected."""
    arguments(__doc__)
    found = together([part() for part in parts()])
    print(
        f"{found.runs} runs, {found.verdicts} verdicts, {len(found.alarms)} false alarms",
        *found.alarms,
        sep="\n",
    )
    return int(bool(found.alarms))


if __name__ == "__main__":
    script(main)
