"""Implicit steps as engines write them: for the velocity, its change, the position, its change.

They are one map, and each rounds it in its own way.  Linear scenes alone: theta = 1 is implicit Euler, 1/2
the implicit midpoint and, the same map on linear scenes, the trapezoidal rule (average acceleration).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from springcheck import schemes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

State: TypeAlias = tuple[Floats, Floats]
THETA = {"implicit-euler": 1.0, "implicit-midpoint": 0.5, "trapezoidal": 0.5}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parts:
    """What such an engine assembles once: masses, stiffness and friction (n, n), constant forces (n,)."""

    m: Floats
    stiffness: Floats
    friction: Floats
    constant: Floats
    scene: Scene
    per_row: bool
    """Whether the force is summed spring by spring, or is f0 - K q - C v."""

    def force(self, q: Floats, v: Floats) -> Floats:
        """The force (n,), friction included."""
        if self.per_row:
            return np.asarray(self.scene.system.force(q, v * self.m), np.float64)
        return np.asarray(self.constant - self.stiffness @ q - self.friction @ v)


def parts(scene: Scene, *, per_row: bool) -> Parts:
    """The matrices of a linear scene in double precision."""
    zero = np.zeros(scene.n)
    return Parts(
        m=scene.m,
        stiffness=scene.system.hessian(zero).astype(np.float64),
        friction=np.diag((scene.system.friction_rates * scene.m).astype(np.float64)),
        constant=np.asarray(scene.system.force(zero, zero), np.float64),
        scene=scene,
        per_row=per_row,
    )


def change_of_velocity(of: Parts, h: float, theta: float) -> Callable[[Floats, Floats], State]:
    """(M + x C + x^2 K) dv = h (F(q, v) - x K v), x = theta h (Baraff & Witkin, SIGGRAPH 1998)."""
    x = theta * h
    left = np.diag(of.m) + x * of.friction + x * x * of.stiffness

    def step(q: Floats, v: Floats) -> State:
        dv = np.linalg.solve(left, h * (of.force(q, v) - x * (of.stiffness @ v)))
        return q + h * (v + theta * dv), v + dv

    return step


def velocity(of: Parts, h: float, theta: float) -> Callable[[Floats, Floats], State]:
    """(M + x C + x^2 K) v' = M v + h F(q, 0) less what the old velocity has of both, x = theta h."""
    x, rest = theta * h, (1 - theta) * h
    left = np.diag(of.m) + x * of.friction + x * x * of.stiffness

    def step(q: Floats, v: Floats) -> State:
        right = of.m * v + h * of.force(q, 0 * v)
        if rest:
            right = right - rest * (of.friction @ v) - x * rest * (of.stiffness @ v)
        new = np.linalg.solve(left, right)
        return np.asarray(q + (rest * v + x * new)), np.asarray(new, np.float64)

    return step


def positions_first(of: Parts, h: float, theta: float) -> Callable[[Floats, Floats], State]:
    """(M/x^2 + C/x + K) Q = (M/x^2)(q + x v) + (C/x) q + f0; V = (Q - q)/x (position-based dynamics)."""
    x = theta * h
    left = np.diag(of.m) / x**2 + of.friction / x + of.stiffness

    def step(q: Floats, v: Floats) -> State:
        new = np.linalg.solve(left, of.m / x**2 * (q + x * v) + of.friction @ q / x + of.constant)
        return onwards(q, v, np.asarray(new, np.float64), x, theta)

    return step


def change_of_position(of: Parts, h: float, theta: float) -> Callable[[Floats, Floats], State]:
    """Newton from the guess s = q + x v: (M/x^2 + C/x + K) d = F(s, v), Q = s + d; V = (Q - q)/x (projective
    dynamics, Bouaziz et al. 2014, of linear springs)."""
    x = theta * h
    left = np.diag(of.m) / x**2 + of.friction / x + of.stiffness

    def step(q: Floats, v: Floats) -> State:
        guess = q + x * v
        return onwards(q, v, guess + np.linalg.solve(left, of.force(guess, v)), x, theta)

    return step


def onwards(q: Floats, v: Floats, new: Floats, x: float, theta: float) -> State:
    """The end of a step whose stage stands at `new`, theta of it on."""
    there = (new - q) / x
    return (new, there) if theta == 1 else (2 * new - q, 2 * there - v)


FORMS = {
    "change of velocity": change_of_velocity,
    "velocity": velocity,
    "positions first": positions_first,
    "change of position": change_of_position,
}
REBUILDS = frozenset({"positions first", "change of position"})
"""Forms whose velocity is a difference of positions over the step."""


def step(
    scene: Scene, scheme: schemes.Scheme, form: str, *, per_row: bool = True
) -> Callable[[int, Floats, Floats], State]:
    """A step (i, q, p) -> (q, p) of one of the schemes of `THETA` on a linear scene, in one of `FORMS`."""
    made = FORMS[form](parts(scene, per_row=per_row), scene.step, THETA[scheme.name])

    def whole(i: int, q: Floats, p: Floats) -> State:
        q, v = made(q, p / scene.m)
        return q, v * scene.m

    return whole
