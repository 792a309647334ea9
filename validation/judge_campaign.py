"""Random scenes, legal engines and faulty ones: false alarms and misses of the judge, counted.

    python validation/judge_campaign.py [FIRST COUNT [FILE [thorough]]]

Scenes of every term and of several at once, one to four particles, steps from h w = 1e-3 to 1.2, linear
ones of implicit schemes up to 1e4; two in five are hard ones: stiffnesses 10 decades apart, walls 1e9
amplitudes away, hubs, 33 to 48 particles; every scheme with a step of its own; every 1 to 2000 steps; twelve
legal orders of operation (as written, in extended precision and rounded once a step or never, velocities
instead of momenta, terms in another order, row by row, fused products, the one-step matrix less 1 and
whole, the force as f0 - K q, positions counted from where particles rest, velocities rebuilt from positions),
four forms of an implicit step (`implicit_forms.py`), and five of an explicit one (`explicit_forms.py`); and
faults of more than a hundred kinds: every parameter of every term and of the grid, coefficients of the
schemes, every other scheme, and what happens to states on their way.

A set is all verdicts on one trajectory; a scene has two or three of legal engines and two of faulty ones.
A false alarm is a failed verdict on a legal engine.

How large a fault is follows from no allowance of the judge.  The defect of a coordinate is how far recorded
frames are from the scheme's own steps, in extended precision, from the frame before; its noise is the
largest defect that any legal engine has in it on that scene, all forms tried, of few frames also from starts
beside the scene's, and half an ulp of it at least.  A fault counts where its defect in some coordinate is
more than 20 times the noise.  It is told where a verdict fails, or where each such coordinate is named as one
that cannot be judged, or to no better than what it is off by, or the step defect says that it cannot tell;
else it is missed, and by which factor of the noise is counted in decades.

With `thorough` a set is all experiments of `run --thorough` with one own method on one such scene; FILE,
which holds blocks of one kind, may be - for none.

With FILE every block of 50 scenes is kept in it, a line of JSON each: blocks that are there are not run
again, and what is printed is the sum of all blocks of the file.  It may be stopped at any time; files of
several processes, each with scenes of its own, are added up by

    cat a.jsonl b.jsonl > all.jsonl; python validation/judge_campaign.py 0 0 all.jsonl
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

import clean
import explicit_forms
import implicit_forms
import textbook as steppers
from arguments import arguments, script
from springcheck import checks, driver, engines, schemes
from springcheck.checks import steps
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.physics.terms import Cosine, Damping, Morse, Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory, Verdict

FIXED = tuple(name for name, s in schemes.SCHEMES.items() if s.has("one-step") and not s.has("flow"))
COUNTED = 20.0
"""Times the noise of right engines from which a fault counts."""

FRAMES = 12
"""Fewer of them tell little of what the noise is: then there are more runs."""
STARTS, STEPS = 24, 2000
"""So many, from starts beside the scene's: most forms round alike, and few draws tell no largest one.  Of
runs of many steps no more than so many steps together, and six runs."""

State: TypeAlias = tuple[Floats, Floats]
Step: TypeAlias = Callable[[int, Floats, Floats], State]


def spread(rng: np.random.Generator, decades: float, n: int = 1) -> Floats:
    """Numbers over twice so many decades (n,)."""
    return np.asarray(10 ** rng.uniform(-decades, decades, n))


def random_scene(rng: np.random.Generator, scheme: schemes.Scheme) -> Scene:
    """One to four particles under one to three kinds of terms, started at random."""
    n = int(rng.integers(1, 5))
    size, rate = float(spread(rng, 2)[0]), float(spread(rng, 2)[0])
    m = spread(rng, 1.5, n)
    k = float(np.median(m)) * rate**2
    each = np.arange(n)
    kinds = ["wall", "wall", "chain", "quartic", "double", "cosine", "morse", "inverted", "free"]
    chosen = {str(x) for x in rng.choice(kinds, int(rng.integers(1, 3)))}
    if scheme.has("mixes"):
        chosen |= {"wall", "fast"}
    at = size * rng.normal(size=n) * (rng.random() < 0.5)
    terms: list[Term] = []
    if "wall" in chosen:
        rows = np.sort(rng.integers(0, n, int(rng.integers(1, 2 * n + 1))))
        terms.append(WallSpring(i=rows, k=k * spread(rng, 0.7, len(rows)), at=at[rows]))
    if "fast" in chosen:
        terms.append(WallSpring(i=each, k=30 * k * spread(rng, 0.3, n), at=at, fast=True))
    if "inverted" in chosen:
        terms.append(WallSpring(i=each[:1], k=-0.3 * k * spread(rng, 0.3), at=at[:1]))
    if {"chain", "morse"} & chosen and n > 1:
        a, rest = each[:-1], size * rng.uniform(0, 2, n - 1)
        if "chain" in chosen:
            terms.append(Spring(a=a, b=a + 1, k=k * spread(rng, 1, n - 1), rest=rest))
        else:
            steep = rng.uniform(0.3, 1.5, n - 1) / size
            terms.append(Morse(a=a, b=a + 1, depth=k / steep**2, steepness=steep, rest=rest))
    if {"quartic", "double"} & chosen:
        terms.append(Quartic(i=each, b=k / size**2 * spread(rng, 0.5, n), at=at))
    if "double" in chosen:
        terms.append(WallSpring(i=each, k=-k * spread(rng, 0.3, n), at=at))
    if "cosine" in chosen:
        wave = rng.uniform(0.5, 2, n) / size
        terms.append(Cosine(i=each, depth=k / wave**2, wave=wave, at=at))
    damped = scheme.name not in ("langevin-middle", "langevin-middle-early") and rng.random() < 0.2
    if damped:
        terms.append(Damping(i=each, c=m * rate * spread(rng, 1, n) * 0.1))
    if not terms:
        terms.append(WallSpring(i=each, k=0 * m, at=0 * at))
    stretched = np.concatenate([[0.0], np.cumsum(size * rng.uniform(0.5, 1.5, n - 1))])
    q = stretched + size * rng.normal(size=n) * 10 ** rng.uniform(-3, 0.3)
    p = m * rate * size * rng.normal(size=n) * 10 ** rng.uniform(-3, 0.3)
    made = clean.scene(m, tuple(terms), q, p, step=1.0, steps=2)
    w = float(np.sqrt(np.max(made.system.gershgorin(q) / m)) + np.max(made.system.friction_rates)) or rate
    hw = float(rng.choice([rng.uniform(0.02, 1.2), 10 ** rng.uniform(-3, -0.5)]))
    if scheme.has("implicit") and made.system.is_linear and rng.random() < 0.5:
        hw = float(10 ** rng.uniform(0, 4))
    every, frames = grid(rng)
    sign = -1 if rng.random() < 0.15 and not damped else 1
    return replace(made, step=sign * hw / w, every=every, steps=every * frames, quantities=("q", "p"))


def hard_scene(rng: np.random.Generator, scheme: schemes.Scheme) -> Scene:
    """Stiffnesses decades apart, far walls, hubs, or many particles, under linear terms or hardening ones."""
    kind = str(rng.choice(["stiff", "stiff", "far", "hub", "many"]))
    n = int({"stiff": rng.integers(2, 5), "far": rng.integers(1, 4), "hub": rng.integers(4, 13)}.get(
        kind, rng.integers(33, 49)
    ))  # fmt: skip
    each, ends = np.arange(n), np.arange(n - 1)
    m, soft = spread(rng, 1, n), float(spread(rng, 1)[0])
    at, rest = np.zeros(n), rng.uniform(0, 2, n - 1)
    terms: list[Term] = []
    if kind == "far":
        at = 10 ** rng.uniform(0, 9, n) * rng.choice([-1, 1], n) * (rng.random(n) < 0.6)
        terms.append(WallSpring(i=each, k=soft * spread(rng, 0.5, n), at=at))
    else:
        ratio = 10 ** rng.uniform(0, 10, n - 1) if kind == "stiff" else spread(rng, 1, n - 1)
        terms.append(Spring(a=0 * ends if kind == "hub" else ends, b=ends + 1, k=soft * ratio, rest=rest))
        held = each if kind == "many" and rng.random() < 0.5 else each[:1]
        terms.append(WallSpring(i=held, k=soft * np.ones(len(held)), at=np.zeros(len(held))))
    if kind == "many" and rng.random() < 0.5 and not scheme.has("implicit"):
        terms.append(Quartic(i=each, b=soft * spread(rng, 0.5, n), at=np.zeros(n)))
    if scheme.has("mixes"):
        terms.append(WallSpring(i=each, k=30 * soft * np.ones(n), at=at, fast=True))
    damped = scheme.name not in ("langevin-middle", "langevin-middle-early") and rng.random() < 0.2
    if damped:
        terms.append(Damping(i=each, c=m * np.sqrt(soft) * spread(rng, 2, n)))
    q = at + rng.normal(size=n)
    if kind in ("stiff", "many"):
        q = np.concatenate([[0.0], np.cumsum(rest)]) + 10 ** rng.uniform(-9, 0) * rng.normal(size=n)
    made = clean.scene(m, tuple(terms), q, m * np.sqrt(soft) * rng.normal(size=n), step=1.0, steps=2)
    w = float(np.sqrt(np.max(made.system.gershgorin(q) / m)) + np.max(made.system.friction_rates))
    hw = float(rng.choice([rng.uniform(0.02, 1.2), 10 ** rng.uniform(-3, -0.5)]))
    if scheme.has("implicit"):
        hw = float(10 ** rng.uniform(-1, 5.5))
    every, frames = grid(rng)
    if kind == "many":
        every, frames = min(every, 20), min(frames, 12)
    return replace(made, step=hw / w, every=every, steps=every * frames, quantities=("q", "p"))


def grid(rng: np.random.Generator) -> tuple[int, int]:
    """Steps between frames and frames after the start: one run in 60 goes up to 2000 steps a frame."""
    x = rng.random()
    if x < 0.6:
        return 1, int(10 ** rng.uniform(0.3, 1.9))
    if x < 0.98:
        every = int(10 ** rng.uniform(0.3, 1.6))
        return every, max(1, int(10 ** rng.uniform(0.3, 1.9)) // every)
    return int(10 ** rng.uniform(1.6, 3.302)), int(rng.integers(1, 4))


# legal engines


def written(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """The textbook engine."""
    return steppers.textbook(scene, scheme)


def wide(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """In extended precision, as x87 registers are, and rounded once a step."""
    right = extended(scene, scheme)

    def step(i: int, q: Floats, p: Floats) -> State:
        a, b = right(q, p)
        return a.astype(np.float64), b.astype(np.float64)

    return step


def compensated(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """In extended precision throughout, as compensated sums are: recorded states alone are rounded."""
    right = extended(scene, scheme)
    kept: list[Any] = [scene.q.astype(np.longdouble), scene.p.astype(np.longdouble)]

    def step(i: int, q: Floats, p: Floats) -> State:
        kept[:] = right(*kept)
        return kept[0].astype(np.float64), kept[1].astype(np.float64)

    return step


def rebuilt(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """Velocities rebuilt from the way of a step, times the rounded reciprocal of the step."""
    h, m = scene.step, scene.m
    inverse = 1 / h

    def step(i: int, q: Floats, p: Floats) -> State:
        v = p / m + h * (scene.system.force(q, p) / m)
        new = q + h * v
        return new, np.asarray(m * ((new - q) * inverse), np.float64)

    return step


def velocities(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """v and a instead of p and F: the same scheme for unit masses."""
    system, m = scene.system, scene.m
    one = np.ones_like(m)

    def pull(q: Any, v: Any) -> Any:
        return system.force(q, v * m) / m

    parts = tuple((lambda q, v, part=part: part(q, v * m) / m) for part in system.parts)
    slope = (lambda q: (system.hessian(q) / m[:, None], True)) if scheme.has("implicit") else None

    rate = system.friction_rates if system.is_damped else None

    def step(i: int, q: Floats, p: Floats) -> State:
        a, v = schemes.step(
            scheme,
            q,
            p / m,
            h=scene.step,
            m=one,
            force=pull,
            stiffness=slope,
            rate=rate,
            parts=(parts[0], parts[1]),
        )
        return np.asarray(a, np.float64), np.asarray(v * m, np.float64)

    return step


def reversed_terms(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """The terms added up in the other order."""
    return steppers.textbook(scene, scheme, force=scene.system.force_of(scene.terms[::-1]))


def row_by_row(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """Every row of every term a term of its own."""
    rows: list[Term] = []
    for term in scene.terms:
        for j in range(len(term)):
            only = {name: getattr(term, name)[j : j + 1] for name in term.ends}
            only |= {c.field: getattr(term, c.field)[j : j + 1] for c in term.columns}
            rows.append(replace(term, **only))  # type: ignore[type-var]
    return steppers.textbook(scene, scheme, force=scene.system.force_of(rows))


def fused(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """Every kick and drift with one rounding, as a fused multiply-add has."""
    if not scheme.stages or {kind for kind, _ in scheme.stages} - {"kick", "drift"}:
        return written(scene, scheme, rng)
    h, m = np.longdouble(scene.step), scene.m

    def step(i: int, q: Floats, p: Floats) -> State:
        for kind, c in scheme.stages:
            ch = np.longdouble(float(schemes.number(c, np.float64)) * float(h))
            if kind == "kick":
                p = (p + ch * scene.system.force(q, p)).astype(np.float64)
            else:
                q = (q + ch * (p / m)).astype(np.float64)
        return q, p

    return step


def affine(scene: Scene, scheme: schemes.Scheme) -> tuple[Any, Any]:
    """The one-step matrix (2n, 2n) of a linear scene and what the origin becomes (2n,), extended."""
    right = extended(scene, scheme)
    none = np.zeros(scene.n, dtype=np.longdouble)
    o = np.concatenate(right(none, none))
    # as large as walls are far, or the difference would be of their roundings
    rows = np.eye(2 * scene.n).astype(np.longdouble) * FAR
    return np.stack([(np.concatenate(right(*np.split(row, 2))) - o) / FAR for row in rows], axis=1), o


FAR = 2.0**40


def matrix(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """The one-step matrix less 1 and what the origin becomes, for linear scenes."""
    if not scene.system.is_linear or scheme.has("implicit"):
        return written(scene, scheme, rng)
    right, origin = affine(scene, scheme)
    less, constant = (right - np.eye(2 * scene.n)).astype(np.float64), origin.astype(np.float64)

    def step(i: int, q: Floats, p: Floats) -> State:
        z = np.concatenate([q, p])
        z = z + (less @ z + constant)
        return z[: scene.n], z[scene.n :]

    return step


def whole_matrix(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """The one-step matrix as it is, its elements near 1 rounded: of scenes without constant forces."""
    if not scene.system.is_linear or scheme.has("implicit"):
        return written(scene, scheme, rng)
    right, origin = affine(scene, scheme)
    if np.any(origin != 0):
        return written(scene, scheme, rng)
    rounded = right.astype(np.float64)

    def step(i: int, q: Floats, p: Floats) -> State:
        z = rounded @ np.concatenate([q, p])
        return z[: scene.n], z[scene.n :]

    return step


def matrix_force(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """The force of a linear scene as f0 - K q - C v, as finite elements have it."""
    if not scene.system.is_linear or scheme.has("mixes"):
        return written(scene, scheme, rng)
    parts = implicit_forms.parts(scene, per_row=False)
    return steppers.textbook(
        scene, scheme, force=lambda q, p: parts.force(np.asarray(q), np.asarray(p / scene.m))
    )


def from_rest(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
    """Positions counted from where each particle rests: from its wall, or along springs of their rest
    lengths."""
    rest = scene.system.rest_positions
    o = np.zeros(scene.n) if rest is None else rest.copy()
    for term in scene.terms:
        if isinstance(term, WallSpring | Quartic | Cosine):
            o[term.i] = term.at
    moved: list[Term] = []
    for term in scene.terms:
        if isinstance(term, WallSpring | Quartic | Cosine):
            moved.append(replace(term, at=term.at - o[term.i]))
        elif isinstance(term, Spring | Morse):
            moved.append(replace(term, rest=term.rest - (o[term.b] - o[term.a])))
        else:
            moved.append(term)
    right = steppers.textbook(replace(scene, terms=tuple(moved)), scheme)
    kept: list[Any] = [scene.q - o, scene.p]

    def step(i: int, q: Floats, p: Floats) -> State:
        kept[:] = right(i, *kept)
        return kept[0] + o, kept[1]

    return step


def form(name: str) -> Callable[[Scene, schemes.Scheme, np.random.Generator], Step]:
    """An implicit step of a linear scene as some engines write it."""

    def made(scene: Scene, scheme: schemes.Scheme, rng: np.random.Generator) -> Step:
        if scheme.name not in implicit_forms.THETA or not scene.system.is_linear:
            return written(scene, scheme, rng)
        return implicit_forms.step(scene, scheme, name, per_row=bool(rng.random() < 0.5))

    return made


LEGAL: dict[str, Callable[[Scene, schemes.Scheme, np.random.Generator], Step]] = {
    "as written": written,
    "extended": wide,
    "velocities": velocities,
    "reversed": reversed_terms,
    "row by row": row_by_row,
    "fused": fused,
    "matrix": matrix,
    "compensated": compensated,
    "rebuilt": rebuilt,
    "whole matrix": whole_matrix,
    "matrix force": matrix_force,
    "from rest": from_rest,
    **{name: form(name) for name in implicit_forms.FORMS},
}


def extended(scene: Scene, scheme: schemes.Scheme) -> Callable[[Any, Any], tuple[Any, Any]]:
    """The scheme's own step in extended precision."""
    system = scene.system
    rate = system.friction_rates if system.is_damped else None

    def stiff(q: Any) -> tuple[Any, bool]:
        rows = [system.hessian(row) for row in np.atleast_2d(q)]
        return np.stack(rows).reshape(*q.shape, scene.n), True

    def step(q: Any, p: Any) -> tuple[Any, Any]:
        return schemes.step(
            scheme, q.astype(np.longdouble), p.astype(np.longdouble), h=scene.step, m=scene.m,
            force=system.force, stiffness=stiff if scheme.has("implicit") else None, parts=system.parts,
            rate=rate,
        )  # fmt: skip

    return step


# faults: each makes the run of an engine that is wrong in one way, by the size eps

Fault: TypeAlias = Callable[[Scene, schemes.Scheme, float, np.random.Generator], Trajectory | None]


def run(scene: Scene, scheme: schemes.Scheme, step: Step, start: State | None = None) -> Trajectory:
    """A recorded run."""
    return steppers.record(scene, scheme, step, start=start)


def parameter(key: str, name: str, whole: bool) -> Fault:
    """A parameter of a term is off, in one row or in all."""

    def made(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Trajectory | None:
        found = [j for j, term in enumerate(scene.terms) if term.key == key]
        if not found:
            return None
        j = int(rng.choice(found))
        values = getattr(scene.terms[j], name).copy()
        row = slice(None) if whole else int(rng.integers(len(values)))
        length = np.max(np.abs(scene.q)) if name in ("at", "rest") else 0
        values[row] += eps * (np.abs(values[row]) + length)
        terms = list(scene.terms)
        terms[j] = replace(terms[j], **{name: values})  # type: ignore[type-var]
        return run(scene, scheme, steppers.textbook(replace(scene, terms=tuple(terms)), scheme))

    return made


def stepping(change: Callable[..., Step | None]) -> Fault:
    """The engine takes another step."""

    def made(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Trajectory | None:
        step = change(scene, scheme, eps, rng)
        return None if step is None else run(scene, scheme, step)

    return made


def after(change: Callable[..., State]) -> Fault:
    """Something happens to the state after every right step."""

    def broken(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Step:
        right = steppers.textbook(scene, scheme)
        return lambda i, q, p: change(scene, eps, i, q, p, *right(i, q, p))

    return stepping(broken)


def pulling(change: Callable[..., Any]) -> Fault:
    """Another force."""

    def broken(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Step:
        right = scene.system.force
        return steppers.textbook(scene, scheme, force=lambda q, p: change(scene, eps, q, p, right(q, p)))

    return stepping(broken)


def reporting(change: Callable[..., State]) -> Fault:
    """The motion is right, its record is not."""

    def made(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Trajectory:
        right = run(scene, scheme, steppers.textbook(scene, scheme))
        q, p = change(scene, eps, right.q.copy(), right.p.copy(), rng)
        return replace(right, q=np.asarray(q, np.float64), p=np.asarray(p, np.float64))

    return made


def other(name: str) -> Fault:
    """Another scheme runs under the name that is claimed."""

    def broken(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Step | None:
        return None if scheme.name == name else steppers.textbook(scene, schemes.SCHEMES[name])

    return stepping(broken)


def coefficient(number: int) -> Fault:
    """One coefficient of the scheme is off."""

    def broken(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Step | None:
        def wrong(x: Any) -> str:
            return str(schemes.number(x, np.longdouble) * (1 + np.longdouble(eps)))

        if scheme.stages:
            if number >= len(scheme.stages):
                return None
            stages = list(scheme.stages)
            stages[number] = (stages[number][0], wrong(stages[number][1]))
            return steppers.textbook(scene, replace(scheme, stages=tuple(stages)))
        weights = [j for j, x in enumerate(scheme.b) if x]
        if number >= len(weights):
            return None
        b = list(scheme.b)
        b[weights[number]] = b[weights[number]] * type(b[0])(1 + eps)
        return steppers.textbook(scene, replace(scheme, b=tuple(b)))

    return stepping(broken)


def bit(number: int, momentum: bool) -> Fault:
    """One bit of one number is wrong."""

    def change(scene: Scene, eps: float, q: Floats, p: Floats, rng: np.random.Generator) -> State:
        x = p if momentum else q
        if len(x) < 2:
            return q, p
        bits = x.view(np.uint64)
        bits[int(rng.integers(1, len(x))), int(rng.integers(scene.n))] ^= np.uint64(1 << number)
        return q, p

    return reporting(change)


def cut(x: Floats, digits: float) -> Floats:
    """Rounded to a relative spacing."""
    with np.errstate(divide="ignore"):
        unit = np.where(x == 0, 1, 10 ** np.floor(np.log10(np.abs(np.where(x == 0, 1, x))))) * digits
    return np.asarray(np.round(x / unit) * unit)


def moved(x: Floats, rows: int) -> Floats:
    """Rows but the first moved on."""
    return np.concatenate([x[:1], np.roll(x[1:], rows, axis=0)])


def changed(change: Callable[[Scene, float], Scene]) -> Fault:
    """The engine moves another scene."""
    return stepping(lambda s, scheme, eps, rng: steppers.textbook(change(s, eps), scheme))


def stale(scene: Scene, scheme: schemes.Scheme, eps: float, rng: np.random.Generator) -> Step:
    """Forces from a buffer one evaluation old."""
    old = [scene.system.force(scene.q, scene.p)]

    def force(q: Any, p: Any) -> Any:
        before, old[0] = old[0], scene.system.force(q, p)
        return before

    return steppers.textbook(scene, scheme, force=force)


def at_step(when: str, change: Callable[..., State]) -> Fault:
    """Something happens once, early, late or every hundredth step."""

    def here(scene: Scene, eps: float, i: int, q0: Floats, p0: Floats, q: Floats, p: Floats) -> State:
        hit = {"early": i == 1, "late": i == scene.steps - 1, "often": i % 100 == 99}[when]
        return change(eps, q0, p0, q, p) if hit else (q, p)

    return after(here)


COLUMNS = {
    "wall-spring": ("k", "at"), "spring": ("k", "rest"), "quartic": ("b", "at"),
    "cosine": ("depth", "wave", "at"), "morse": ("depth", "steepness", "rest"), "damping": ("c",),
}  # fmt: skip

FAULTS: dict[str, Fault] = {}
for _key, _names in COLUMNS.items():
    for _name in _names:
        for _whole in (True, False):
            FAULTS[f"{_key}.{_name}{'' if _whole else ' of one'}"] = parameter(_key, _name, _whole)
FAULTS |= {f"{name} under another name": other(name) for name in FIXED}
FAULTS |= {f"coefficient {j}": coefficient(j) for j in range(7)}
for _bit in (8, 20, 40, 51, 55, 63):
    FAULTS |= {f"bit {_bit} of q": bit(_bit, False), f"bit {_bit} of p": bit(_bit, True)}
FAULTS |= {
    "step": changed(lambda s, x: replace(s, step=s.step * (1 + x))),
    "mass": changed(lambda s, x: replace(s, m=s.m * (1 + x))),
    "mass of one": changed(lambda s, x: replace(s, m=s.m * np.where(np.arange(s.n) == 0, 1 + x, 1))),
    "all forces": pulling(lambda s, x, q, p, f: f * (1 + x)),
    "constant force": pulling(lambda s, x, q, p, f: f + x * np.max(np.abs(f))),
    "cubic force": pulling(lambda s, x, q, p, f: f + x * f * q * q / np.max(s.q * s.q + 1e-300)),
    "friction": pulling(lambda s, x, q, p, f: f - x * np.abs(1 / s.step) * p),
    "heating": pulling(lambda s, x, q, p, f: f + x * np.abs(1 / s.step) * p),
    "force cut off": pulling(lambda s, x, q, p, f: np.where(np.abs(f) > (1 - x) * np.max(np.abs(f)), 0, f)),
    "force clamped": pulling(lambda s, x, q, p, f: np.clip(f, -abs(f).mean(), abs(f).mean())),
    "force in single": pulling(lambda s, x, q, p, f: np.asarray(f, np.float32).astype(f.dtype)),
    "force of digits": pulling(lambda s, x, q, p, f: cut(np.asarray(f, np.float64), x)),
    "force in fixed point": pulling(lambda s, x, q, p, f: np.round(f / x) * x),
    "force on the first alone": pulling(lambda s, x, q, p, f: f * (np.arange(s.n) == 0)),
    "force off in the first": pulling(lambda s, x, q, p, f: f * (1 + x * (np.arange(s.n) == 0))),
    "forces swapped": pulling(lambda s, x, q, p, f: f[..., ::-1]),
    "sign of the force": pulling(lambda s, x, q, p, f: -f),
    "force at a shifted place": pulling(lambda s, x, q, p, f: s.system.force(q * (1 + x), p)),
    "stale force": stepping(stale),
    "drift by p": changed(lambda s, x: replace(s, m=np.ones(s.n))),
    "friction afterwards": after(lambda s, x, i, a, b, q, p: (q, p * (1 - x))),
    "thermostat": after(lambda s, x, i, a, b, q, p: (q, p * (1 + x * np.sign(b @ b - p @ p)))),
    "noise of q": after(lambda s, x, i, a, b, q, p: (q * (1 + x * np.cos(i * i)), p)),
    "noise of p": after(lambda s, x, i, a, b, q, p: (q, p * (1 + x * np.cos(i * i)))),
    "centre taken off": after(lambda s, x, i, a, b, q, p: (q, p - np.mean(p))),
    "q in single": after(lambda s, x, i, a, b, q, p: (q.astype(np.float32).astype(float), p)),
    "p in single": after(lambda s, x, i, a, b, q, p: (q, p.astype(np.float32).astype(float))),
    "state of digits": after(lambda s, x, i, a, b, q, p: (cut(q, x), cut(p, x))),
    "box": after(lambda s, x, i, a, b, q, p: (np.where(np.abs(q) > np.max(np.abs(s.q)), -q, q), p)),
    "drift of q": after(lambda s, x, i, a, b, q, p: (q + x * np.max(np.abs(q)), p)),
    "small is nothing": after(lambda s, x, i, a, b, q, p: (np.where(np.abs(q) < x, 0, q), p)),
    "momentum of the step before": after(lambda s, x, i, a, b, q, p: (q, b)),
    "place of the step before": after(lambda s, x, i, a, b, q, p: (a, p)),
    "the first stands still": after(
        lambda s, x, i, a, b, q, p: (np.r_[a[:1], q[1:]], np.r_[b[:1], p[1:]])
    ),
    "units of q": reporting(lambda s, x, q, p, rng: (q * (1 + x), p)),
    "units of p": reporting(lambda s, x, q, p, rng: (q, p * (1 + x))),
    "offset of q": reporting(lambda s, x, q, p, rng: (q + x * np.max(np.abs(q)), p)),
    "sign of p": reporting(lambda s, x, q, p, rng: (q, -p)),
    "sign of q": reporting(lambda s, x, q, p, rng: (-q, p)),
    "particles swapped": reporting(lambda s, x, q, p, rng: (q[:, ::-1], p[:, ::-1])),
    "frames late": reporting(lambda s, x, q, p, rng: (moved(q, 1), moved(p, 1))),
    "momenta late": reporting(lambda s, x, q, p, rng: (q, moved(p, 1))),
    "places late": reporting(lambda s, x, q, p, rng: (moved(q, 1), p)),
    "frames backwards": reporting(lambda s, x, q, p, rng: (np.r_[q[:1], q[:0:-1]], np.r_[p[:1], p[:0:-1]])),
    "a frame twice": reporting(lambda s, x, q, p, rng: (np.r_[q[:2], q[1:-1]], np.r_[p[:2], p[1:-1]])),
    "stands still": reporting(lambda s, x, q, p, rng: (0 * q + q[0], 0 * p + p[0])),
    "nothing": reporting(lambda s, x, q, p, rng: (np.r_[q[:1], 0 * q[1:]], np.r_[p[:1], 0 * p[1:]])),
    "file in single": reporting(lambda s, x, q, p, rng: (q.astype(np.float32), p.astype(np.float32))),
    "file of digits": reporting(lambda s, x, q, p, rng: (cut(q, x), cut(p, x))),
    "velocities for momenta": reporting(lambda s, x, q, p, rng: (q, p / s.m)),
    "half a kick early": reporting(
        lambda s, x, q, p, rng: (q, np.r_[p[:1], (p - s.step / 2 * s.system.force(q, p))[1:]])
    ),
    "half a drift late": reporting(lambda s, x, q, p, rng: (np.r_[q[:1], (q + s.step / 2 * p / s.m)[1:]], p)),
}  # fmt: skip
for _when in ("early", "late", "often"):
    FAULTS |= {
        f"a step left out, {_when}": at_step(_when, lambda x, a, b, q, p: (a, b)),
        f"a kick, {_when}": at_step(_when, lambda x, a, b, q, p: (q, p * (1 + x))),
        f"a jump, {_when}": at_step(_when, lambda x, a, b, q, p: (q * (1 + x), p)),
        f"restart from text, {_when}": at_step(_when, lambda x, a, b, q, p: (cut(q, x), cut(p, x))),
        f"momentum reversed, {_when}": at_step(_when, lambda x, a, b, q, p: (q, -p)),
    }


@dataclass
class Counts:
    """What the campaign has found so far."""

    sets: int = 0
    verdicts: int = 0
    legal: int = 0
    alarms: list[str] = field(default_factory=list)
    faults: int = 0
    large: int = 0
    seen: int = 0
    seen_below: int = 0
    untold: int = 0
    missed: list[str] = field(default_factory=list)
    """Faults above 20 times the noise that no check reports."""
    decades: dict[str, int] = field(default_factory=dict)
    """Number of these by the decade of that factor."""
    numbers: list[str] = field(default_factory=list)
    """Verdicts whose value or bound is no finite number."""
    kinds: dict[str, int] = field(default_factory=dict)
    """Faults above `COUNTED` times the noise of each kind."""
    noise: dict[str, float] = field(default_factory=dict)
    """The largest part of its bound that each check has seen in a legal engine."""

    def add(self, other: Counts) -> None:
        """Another block's counts to these."""
        for one in fields(self):
            mine, more = getattr(self, one.name), getattr(other, one.name)
            if one.name in ("kinds", "decades"):
                more = {key: mine.get(key, 0) + value for key, value in more.items()}
            elif one.name == "noise":
                more = {key: max(mine.get(key, 0.0), value) for key, value in more.items()}
            setattr(self, one.name, {**mine, **more} if isinstance(mine, dict) else mine + more)

    def __str__(self) -> str:
        noise = ", ".join(f"{name} {x:.2g}" for name, x in sorted(self.noise.items()))
        return (
            f"{self.sets} sets, {self.verdicts} verdicts; {self.legal} runs of legal engines: "
            f"{len(self.alarms)} false alarms, at most of the bound: {noise}; "
            f"{self.faults} faults, {self.large} of {len(self.kinds)} kinds above {COUNTED:g} times the "
            f"noise: {self.seen} seen, {self.untold} named as not told, {len(self.missed)} missed "
            f"({', '.join(f'{n} below {x}' for x, n in sorted(self.decades.items()))}); {self.seen_below} "
            f"smaller ones seen; {len(self.numbers)} verdicts without a number"
        )


def judged(counts: Counts, scene: Scene, made: Trajectory, what: str) -> list[Verdict]:
    """The verdicts, counted."""
    return _counted(counts, checks.judge(scene, made), what)


def _counted(counts: Counts, verdicts: list[Verdict], what: str) -> list[Verdict]:
    counts.sets += 1
    counts.verdicts += sum(v.passed is not None for v in verdicts)
    counts.numbers += [
        f"{what}: {v.check} {v.value} of {v.bound}"
        for v in verdicts
        if v.passed is not None and not np.isfinite([v.value, v.bound]).all()
    ]
    return verdicts


def one(seed: int, counts: Counts) -> None:
    """One scene: two legal engines, and two faults."""
    rng = np.random.default_rng([12, seed])
    scheme = schemes.SCHEMES[str(rng.choice(FIXED))]
    if rng.random() < 0.2:
        scheme = schemes.SCHEMES[str(rng.choice(list(implicit_forms.THETA)))]
    scene = (hard_scene if rng.random() < 0.4 else random_scene)(rng, scheme)
    forms = scheme.name in implicit_forms.THETA and scene.system.is_linear
    mine = [x for x in LEGAL if x != "rebuilt" or scheme.name == "semi-implicit-euler"]
    mine = [x for x in mine if x not in implicit_forms.FORMS or forms]
    chosen = [str(x) for x in rng.choice(mine, 2, replace=False)]
    with np.errstate(all="ignore"):
        noise: Floats | None = None
        for order in mine:
            try:
                right = run(scene, scheme, LEGAL[order](scene, scheme, rng))
            except np.linalg.LinAlgError:
                continue
            rebuilds = order == "rebuilt" or (forms and order in implicit_forms.REBUILDS)
            right = replace(right, rebuilds_velocity=rebuilds)
            if _subnormal(right):
                return
            found = _defect(scene, right)
            if found is not None and not rebuilds:
                noise = found if noise is None else np.maximum(noise, found)
            if order in chosen:
                what = f"seed {seed}, {scheme.name}, {order}, every {scene.every}"
                _legal(counts, checks.judge(scene, right), what)
        # one of those that this scheme and scene have, of a stream of its own
        others = {name: form(scene, scheme) for name, form in explicit_forms.FORMS.items()}
        fitting = [(name, step) for name, step in others.items() if step is not None]
        if fitting:
            order, step = fitting[int(np.random.default_rng([15, seed]).integers(len(fitting)))]
            right = run(scene, scheme, step)
            if _subnormal(right):
                return
            found = _defect(scene, right)
            if found is not None:
                noise = found if noise is None else np.maximum(noise, found)
            _legal(
                counts,
                checks.judge(scene, right),
                f"seed {seed}, {scheme.name}, {order}, every {scene.every}",
            )
        near = np.random.default_rng([14, seed])
        for _ in range(min(STARTS, max(6, STEPS // scene.steps)) if len(right.t) < FRAMES else 0):
            start = tuple(x * (1 + 1e-6 * near.normal(size=scene.n)) for x in (scene.q, scene.p))
            found = _defect(scene, run(scene, scheme, written(scene, scheme, rng), (start[0], start[1])))
            if found is not None:
                noise = found if noise is None else np.maximum(noise, found)
        for name in rng.choice(list(FAULTS), 2, replace=False):
            eps = float(10 ** rng.uniform(-16, -0.3))
            wrong = FAULTS[str(name)](scene, scheme, eps, rng)
            if wrong is None or len(wrong.t) < 2:
                continue
            what = f"seed {seed}, {scheme.name}, {name} by {eps:.2g}, every {scene.every}"
            _fault(counts, scene, wrong, noise, str(name), what)


def _subnormal(run: Trajectory) -> bool:
    """Whether a motion decays to where doubles lose digits: the textbook engine's solver stops there."""
    sizes = np.abs(np.concatenate([run.q, run.p]))
    return bool(np.any((sizes > 0) & (sizes < 1e-290)))


def _defect(scene: Scene, run: Trajectory) -> Floats | None:
    """The largest defect of each q and p (2, n) over the frames, half an ulp of it at least."""
    ahead = checks.Case(trajectory=run, scene=scene).ahead if len(run.t) > 1 else None
    if ahead is None:
        return None
    states = np.stack([run.q, run.p])
    off = np.abs(ahead.end - states[:, 1:])
    return np.asarray(
        np.max(np.maximum(off, np.spacing(np.abs(states[:, 1:])) / 2), axis=1, initial=0.0), np.float64
    )


def _legal(counts: Counts, verdicts: list[Verdict], what: str) -> None:
    """Verdicts on a legal engine."""
    counts.legal += 1
    for v in _counted(counts, verdicts, what):
        if v.passed is False:
            counts.alarms.append(f"{what}: {v.check} {v.value:.3g} of {v.bound:.3g}: {v.why}")
        if v.passed is not None and v.bound > 0:
            counts.noise[v.check] = max(counts.noise.get(v.check, 0.0), v.value / v.bound)


def _fault(
    counts: Counts, scene: Scene, wrong: Trajectory, noise: Floats | None, kind: str, what: str
) -> None:
    counts.faults += 1
    defect = _defect(scene, wrong)
    effect = np.zeros((2, scene.n))
    if defect is not None and noise is not None:
        effect = np.nan_to_num(defect / noise, nan=0.0, posinf=np.inf)
    verdicts = judged(counts, scene, wrong, what)
    seen = any(v.passed is False for v in verdicts)
    largest = float(np.max(effect))
    if largest <= COUNTED:
        counts.seen_below += seen
        return
    counts.large += 1
    counts.kinds[kind] = counts.kinds.get(kind, 0) + 1
    step = next(v for v in verdicts if v.check == "step-defect")
    if seen:
        counts.seen += 1
    elif step.passed is None or "may grow to all" in step.why or _named(step.why, effect > COUNTED):
        counts.untold += 1
    else:
        counts.missed.append(f"{what}: {largest:.3g} times the noise")
        decade = f"1e{int(np.ceil(np.log10(min(largest, 1e300))))}"
        counts.decades[decade] = counts.decades.get(decade, 0) + 1


def _named(why: str, off: Any) -> bool:
    """Whether every coordinate that is off (2, n) is named as one that cannot be judged, or no better."""
    said = [part for part in why.split("; ") if part.endswith((steps.BLIND, steps.NO_BETTER))]
    names = [f"{'qp'[i]} of particle {j}" for i, j in np.argwhere(off)]
    return all(any(re.search(rf"{name}\b", part) for part in said) for name in names)


def experiments(seed: int, counts: Counts) -> None:
    """One scene: every experiment with one own method."""
    rng = np.random.default_rng([13, seed])
    # of `own:*` alone are those that run unasked
    labels = engines.match(("own:?*",))
    label = labels[int(rng.integers(len(labels)))]
    scene = random_scene(rng, schemes.scheme(engines.method(label).scheme))
    if engines.refusal(scene, label):
        return
    what = f"seed {seed}, {label}, every {scene.every}"
    _legal(counts, checks.judge_thoroughly(scene, str(label), driver.run), what)


steps.MOST_LISTED = 10**6
"""Every name is told, not the first few."""

BLOCK = 50
"""Scenes of one line of the file."""


def campaign(first: int, count: int, of: Callable[[int, Counts], None] = one) -> Counts:
    """So many scenes: two legal engines and two faults of each, or what `of` does with each."""
    counts = Counts()
    for seed in range(first, first + count):
        of(seed, counts)
    return counts


def kept(file: Path) -> dict[int, Counts]:
    """The blocks of a file by their first scene; a line that was cut off is none."""
    lines = file.read_text().splitlines() if file.is_file() else []
    lines = [line for line in lines if line.endswith("}")]
    return {found.pop("first"): Counts(**found) for found in map(json.loads, lines)}


def main() -> int:
    """Count the cases in blocks, and print what is wrong; 1 where anything is."""
    asked = arguments(__doc__, first=0, count=500, file="-", part=("", "thorough"))
    total = Counts()
    keeps = asked.file != "-"
    blocks = kept(Path(asked.file)) if keeps else {}
    for block in blocks.values():
        total.add(block)
    for start in range(asked.first, asked.first + asked.count, BLOCK):
        if start in blocks:
            continue
        of = experiments if asked.part == "thorough" else one
        found = campaign(start, min(BLOCK, asked.first + asked.count - start), of)
        total.add(found)
        if keeps:
            with Path(asked.file).open("a") as out:
                out.write("\n" + json.dumps({"first": start, **asdict(found)}))
        print(total, flush=True)
    if not asked.count:
        print(total)
    for line in (*total.alarms, *total.missed, *total.numbers):
        print(" ", line)
    return int(bool(total.alarms or total.missed or total.numbers))


if __name__ == "__main__":
    script(main)
