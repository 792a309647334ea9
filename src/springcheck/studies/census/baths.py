"""The row of a thermostat: identified by the states of one spring, its two temperatures measured on many.

A thermostat for scenes with rods moves dumbbells in space, each of whose masses has its share of the springs.
Such springs exert no torque, so that the centre is a mass on a spring along each axis; its states are used.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from math import nan

import numpy as np

from springcheck import checks, driver, engines, schemes
from springcheck.engines.contract import Label, Need
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Rod, WallSpring
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.census import rigid
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

DUMBBELL, NEAR_PART = 12.0, 0.375
"""Length of a rod [L], which turns by 0.07 rad a step at kT, and the share of the mass at its near end."""

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


def rods(n: int, steps: int) -> Scene:
    """Dumbbells whose centres move as three times as many of these springs."""
    centres, parts = springs(3 * n, steps), np.array([[NEAR_PART], [1 - NEAR_PART]])
    way = np.random.default_rng(SEED_OF_ROWS).standard_normal((n, 1, 3))
    way *= DUMBBELL / np.linalg.norm(way, axis=2, keepdims=True)
    q = (centres.q.reshape(n, 1, 3) + way * (parts[::-1] * [[-1], [1]])).ravel()
    m, p = (np.ravel(x.reshape(n, 1, 3) * parts) for x in (centres.m, centres.p))
    i = np.arange(6 * n).reshape(n, 2, 3)
    joined = Rod(a=i[:, 0].ravel(), b=i[:, 1].ravel(), length=np.full(3 * n, DUMBBELL))
    walls = WallSpring(i=i.ravel(), k=STIFFNESS * m / MASS, at=np.zeros(6 * n))
    return centres.derived(m=m, q=q, p=p, terms=(walls, joined), places=i.ravel())


def scene_of(label: Label, n: int, steps: int) -> Scene:
    """Scene of a thermostat: n springs, or as many dumbbells as have at least n coordinates of a centre."""
    return rods(-(-n // 3), steps) if Need.RODS in engines.method(label).requires else springs(n, steps)


def read(run: Trajectory) -> tuple[Floats, Floats]:
    """Positions and momenta (f, n) of the springs; for dumbbells those of their centres."""
    assert run.scene is not None
    if not run.scene.system.rods:
        return run.q, run.p
    (near_q, far_q), (near_p, far_p) = (
        np.moveaxis(x.reshape(len(x), -1, 2, 3), 2, 0).reshape(2, len(x), -1) for x in (run.q, run.p)
    )
    return NEAR_PART * near_q + (1 - NEAR_PART) * far_q, near_p + far_p


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

    one = scene_of(label, 1, NAMED_BY)
    many = scene_of(label, SIDE_BY_SIDE, UNCOUNTED + COUNTED)
    method, joined = engines.method(label), one.system.rods
    run, hot = (replace(driver.run(x, label, seed=SEED_OF_ROWS), scene=x) for x in (one, many))
    q, p = read(run)
    found = of_bath(run.t, q, p, None, np.full(q.shape[1], MASS), mixed=joined is not None)
    names = tuple(dict.fromkeys(x.scheme for x in found.candidates)) if found is not None else ()
    named = found is not None and found.verdict == "named"
    # a single spring may not determine the scheme: the declared one is judged as well
    kept = all(v.passed is not False for v in checks.shared(checks.judge(one, run)))
    whole = hot.outcome.status == "complete"
    both = temperatures(*(x[UNCOUNTED:] for x in read(hot))) if whole else ((nan, nan), (nan, nan))
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
        along="x, y and z" if joined else "x",
        constraint=f"rod: length {rigid.to(np.max(np.abs(joined.strain(run.q))))}" if joined else "",
        configurational=configurational[0], configurational_error=configurational[1],
        kinetic=kinetic[0], kinetic_error=kinetic[1], force_calls=run.force_calls / steps[0],
        seconds=hot.timing.run / steps[1],
        digest=hashlib.sha256(np.concatenate([run.q, run.p]).tobytes()).hexdigest()[:16],
    )  # fmt: skip
