"""Explicit steps as engines write them: legal orders of operation that only some schemes and scenes have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

import textbook as steppers
from springcheck import schemes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

State: TypeAlias = tuple[Floats, Floats]
Step: TypeAlias = Callable[[int, Floats, Floats], State]


def plain(scene: Scene, scheme: schemes.Scheme) -> bool:
    """Whether a scheme kicks and drifts, and nothing else."""
    return bool(scheme.stages) and {kind for kind, _ in scheme.stages} <= {"kick", "drift"}


def parts(scene: Scene, scheme: schemes.Scheme) -> list[tuple[bool, float]]:
    """Whether each stage is a kick, and how long it is [T]."""
    return [(kind == "kick", float(schemes.number(c, np.float64)) * scene.step) for kind, c in scheme.stages]


def reciprocal(scene: Scene, scheme: schemes.Scheme) -> Step | None:
    """Velocities are kept, and forces multiplied by the rounded reciprocals of the masses."""
    if not plain(scene, scheme):
        return None
    inverse, kept, each = 1 / scene.m, [scene.p / scene.m], parts(scene, scheme)

    def step(i: int, q: Floats, p: Floats) -> State:
        v = kept[0]
        for kicks, x in each:
            if kicks:
                v = v + scene.system.force(q, scene.m * v) * inverse * x
            else:
                q = q + v * x
        kept[0] = v
        return np.asarray(q, np.float64), np.asarray(scene.m * v, np.float64)

    return step


def constants(scene: Scene, scheme: schemes.Scheme) -> Step | None:
    """The step is multiplied into stiffnesses and reciprocal masses beforehand."""
    if not plain(scene, scheme) or scene.system.is_damped:
        return None
    each = parts(scene, scheme)
    made = [
        scene.system.force_of([t.scaled(abs(x)) for t in scene.terms]) if k else x / scene.m for k, x in each
    ]

    def step(i: int, q: Floats, p: Floats) -> State:
        for (_, x), mine in zip(each, made, strict=True):
            if callable(mine):
                p = p + np.sign(x) * mine(q, p)
            else:
                q = q + mine * p
        return np.asarray(q, np.float64), np.asarray(p, np.float64)

    return step


def taylor(scene: Scene, scheme: schemes.Scheme) -> Step | None:
    """Velocity Verlet as textbooks print it: x + v h + a h**2/2, and v + (a + a') h/2."""
    if scheme.name != "velocity-verlet" or scene.system.is_damped:
        return None
    m, h = scene.m, scene.step
    kept = [scene.p / m, scene.system.force(scene.q, scene.p) / m]

    def step(i: int, q: Floats, p: Floats) -> State:
        v, a = kept
        q = np.asarray(q + v * h + 0.5 * a * h**2, np.float64)
        new = scene.system.force(q, p) / m
        kept[:] = v + 0.5 * (a + new) * h, new
        return q, np.asarray(m * kept[0], np.float64)

    return step


def runge(scene: Scene, scheme: schemes.Scheme) -> Step | None:
    """The whole state (q, v) at once, its slopes added up before they are multiplied by the step."""
    m, h = scene.m, scene.step

    def slope(y: Any) -> Any:
        return np.stack([y[1], scene.system.force(y[0], m * y[1]) / m])

    def rk4(y: Any) -> Any:
        a = slope(y)
        b = slope(y + h / 2 * a)
        c = slope(y + h / 2 * b)
        return y + h / 6 * (a + 2 * b + 2 * c + slope(y + h * c))

    sums: dict[str, Callable[[Any], Any]] = {
        "rk4": rk4,
        "rk2-midpoint": lambda y: y + h * slope(y + 0.5 * h * slope(y)),
        "explicit-euler": lambda y: y + h * slope(y),
    }
    if scheme.name not in sums:
        return None
    kept = [np.stack([scene.q, scene.p / m])]

    def step(i: int, q: Floats, p: Floats) -> State:
        kept[0] = sums[scheme.name](kept[0])
        return kept[0][0], m * kept[0][1]

    return step


def incidence(scene: Scene, scheme: schemes.Scheme) -> Step | None:
    """The force of linear springs as -B' k (B q - rest), B the matrix of their ends, by einsum and sums."""
    if not scene.system.is_linear or scene.system.is_damped or scheme.has("implicit") or scheme.has("mixes"):
        return None
    ends, k, rest = [], [], []
    for term in scene.terms:
        for row in range(len(term)):
            one = np.zeros(scene.n)
            # of a spring from a to b, and of one from a wall
            one[[index[row] for index in term.particles]] = [1.0] if term.bodies == 1 else [-1.0, 1.0]
            ends.append(one)
            k.append(term.parameters[0][row])
            rest.append(getattr(term, term.origin)[row])
    b, stiff, lengths = np.array(ends), np.array(k), np.array(rest)

    def force(q: Any, p: Any) -> Any:
        return -np.sum(b * (stiff * (np.einsum("ij,j->i", b, q) - lengths))[:, None], axis=0)

    return steppers.textbook(scene, scheme, force=force)


FORMS: dict[str, Callable[[Scene, schemes.Scheme], Step | None]] = {
    "reciprocal masses": reciprocal,
    "constants first": constants,
    "Taylor": taylor,
    "Runge": runge,
    "incidence": incidence,
}
"""None where a scheme or a scene has no such form."""
