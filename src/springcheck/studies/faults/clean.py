"""Random scenes for right engines: every alarm on them is a false one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, Term, WallSpring


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
