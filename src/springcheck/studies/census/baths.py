"""The row of a thermostat: identified by the states of one spring, its two temperatures measured on many."""

from __future__ import annotations

import hashlib
from math import nan

import numpy as np

from springcheck import checks, driver, engines, schemes
from springcheck.engines.contract import Label
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.studies.census.result import Entry

MASS, STIFFNESS, KT = 3.7, 2.9, 1.7
"""Mass, stiffness and kT, none of them 1."""

H_OMEGA, GAMMA_H = 0.5, 0.4
"""h omega, at which schemes differ by several percent, and gamma h, above h omega squared: below that
Euler-Maruyama is not stable."""

SIDE_BY_SIDE, COUNTED, UNCOUNTED = 1000, 1000, 100
"""Springs side by side, steps averaged over, and steps discarded before: exp(-20) of a start is left then."""

NAMED_BY = 2000
"""Number of steps of the spring from which the scheme is identified."""

BLOCKS_OF_STEPS = 20
"""Blocks of steps whose means give the standard error of what all springs share."""

SEED_OF_ROWS = 26
"""Seed of every row; not tuned."""


def springs(n: int, steps: int) -> Scene:
    """Equal springs in a bath, at typical thermal states."""
    w = np.sqrt(STIFFNESS / MASS)
    walls = WallSpring(i=np.arange(n), k=np.full(n, STIFFNESS), at=np.zeros(n))
    start = np.random.default_rng(SEED_OF_ROWS).standard_normal((2, n))
    return Scene(
        m=np.full(n, MASS), q=np.sqrt(KT / STIFFNESS) * start[0], p=np.sqrt(MASS * KT) * start[1],
        terms=(walls,), step=H_OMEGA / w, steps=steps,
        bath=Bath(temperature=KT, friction=GAMMA_H * w / H_OMEGA), quantities=("q", "p"), name="springs",
    )  # fmt: skip


def temperatures(q: Floats, p: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """k <q**2>/kT and <p**2>/m kT of frames (f, n) of `springs`, each with its standard error.

    The standard error is the larger of two: across springs as if independent, and across blocks of steps.
    """
    out = []
    for square in (STIFFNESS * q * q / KT, p * p / (MASS * KT)):
        alone = np.std(np.mean(square, axis=0)) / np.sqrt(square.shape[1])
        blocks = np.array([np.mean(block) for block in np.array_split(square, BLOCKS_OF_STEPS)])
        error = max(float(alone), float(np.std(blocks, ddof=1)) / np.sqrt(BLOCKS_OF_STEPS))
        out.append((float(np.mean(square)), error))
    return out[0], out[1]


def entry(label: Label) -> Entry:
    """Identify one thermostat by its states, and time a step of a thousand springs."""
    from springcheck.identify.thermal import of_bath

    one, many = springs(1, NAMED_BY), springs(SIDE_BY_SIDE, UNCOUNTED + COUNTED)
    method = engines.method(label)
    run, hot = (driver.run(x, label, seed=SEED_OF_ROWS) for x in (one, many))
    found = of_bath(run.t, run.q, run.p, None, np.full(1, MASS))
    names = tuple(dict.fromkeys(x.scheme for x in found.candidates)) if found is not None else ()
    named = found is not None and found.verdict == "named"
    # a single spring may not determine the scheme: the declared one is judged as well
    kept = all(v.passed is not False for v in checks.shared(checks.judge(one, run)))
    whole = hot.outcome.status == "complete"
    both = temperatures(*(x[UNCOUNTED:] for x in (hot.q, hot.p))) if whole else ((nan, nan), (nan, nan))
    configurational, kinetic = both
    steps = [max(x.outcome.step, 1) for x in (run, hot)]
    ends = "" if whole else f"{SIDE_BY_SIDE} springs: {hot.outcome.status} after step {hot.outcome.step}"
    return Entry(
        method=str(label), about=method.about, note="; ".join(filter(None, (method.note, ends))),
        version=", ".join(f"{key} {value}" for key, value in engines.load(label.engine).version().items()),
        claimed=method.scheme, found=" or ".join(names[:1] if named else names) or "none that is known",
        agrees=kept and (not names or method.scheme in names),
        substeps=1 if named else 0, velocity_offset=found.velocity_offset if found is not None else nan,
        precision=run.arithmetic.name, thermostat=schemes.title(method.scheme),
        along="x",
        configurational=configurational[0], configurational_error=configurational[1],
        kinetic=kinetic[0], kinetic_error=kinetic[1], force_calls=run.force_calls / steps[0],
        seconds=hot.timing.run / steps[1],
        digest=hashlib.sha256(np.concatenate([run.q, run.p]).tobytes()).hexdigest()[:16],
    )  # fmt: skip
