"""First limit of stability of a method on the spring, from its states alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck import driver
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory

FIRST_H_OMEGA, LAST_H_OMEGA, H_OMEGA_SPACING = 0.05, 4.0, 0.05
"""h omega of the first and the last run, and their spacing; no limit below the first is looked for."""

STEPS_OF_A_RUN = 8
"""Steps of each run: more pairs of states than a map of four entries needs, too few to leave a spring's
range."""

LEAST_STEPS = 3
"""Fewest steps that determine a map of four entries, with two residual degrees of freedom."""

LIMIT_HALVINGS = 12
"""Bisections of the bracket, to 0.05 / 4096."""

START_FACTOR = 0.1
"""Factor on the scene's start: near the limit a motion grows, and engines have a largest speed."""

GROWTH_ERRORS = 10
"""Standard errors of the growth that are allowed for: eight steps estimate it poorly."""

LOST_GROWTH = 0.1
"""Error of the growth from which states follow no linear map, as beyond the range of an engine's spring."""

STEEPEST_POWER = 4
"""Largest leading power of h omega in the growth of a scheme that always grows: RK2's."""


def first_limit(scene: Scene, label: Label) -> float:
    """Smallest h omega whose one-step map grows, to a part in 1e5; 0 where all grow, infinity where none up
    to 4.

    One mass on one spring.  NaN where the engine refuses a step, or stops within the first three, or where
    its rounding hides a growth that may begin below the first that is detected.
    """
    run = replace(scene, steps=STEPS_OF_A_RUN, every=1, quantities=("q", "p"))
    small = replace(run, q=scene.q * START_FACTOR, p=scene.p * START_FACTOR)
    omega = float(np.sqrt(scene.system.hessian_diagonal(scene.q)[0] / scene.m[0]))

    def growth(h_omega: float) -> tuple[float, float]:
        found = driver.run(replace(small, step=h_omega / omega), label)
        if found.outcome.step < LEAST_STEPS and found.outcome.status == "stopped":
            raise MethodError(found.outcome.message)
        return _growth(found)

    try:
        low, hidden = 0.0, 0.0
        for high in np.arange(FIRST_H_OMEGA, LAST_H_OMEGA + H_OMEGA_SPACING / 2, H_OMEGA_SPACING).tolist():
            size, error = growth(high)
            if size > error:
                break
            low, hidden = high, error
        else:
            return float("inf")
        if low == 0:
            return 0.0
        if hidden >= size * (low / high) ** STEEPEST_POWER:
            return float("nan")
        for _ in range(LIMIT_HALVINGS):
            middle = (low + high) / 2
            size, error = growth(middle)
            low, high = (low, middle) if size > error else (middle, high)
    except MethodError:
        return float("nan")
    return float((low + high) / 2)


def _growth(run: Trajectory) -> tuple[float, float]:
    """Spectral radius minus 1 of the map (2, 2) that fits the states best, and its error.  Where the whole
    run follows no linear map, its first steps are used: a rest length is passed later."""
    if run.outcome.step < LEAST_STEPS:
        return float("inf"), 0.0
    z = np.stack([run.q[:, 0], run.p[:, 0]])
    found = [_of_states(z[:, : steps + 1]) for steps in (STEPS_OF_A_RUN, STEPS_OF_A_RUN // 2, LEAST_STEPS)]
    return next((x for x in found if x[1] < LOST_GROWTH), found[0])


def _of_states(z: Floats) -> tuple[float, float]:
    if not np.isfinite(z).all():
        return float("inf"), 0.0
    z = z / np.abs(z).max(axis=1, keepdims=True)
    inverse = np.linalg.pinv(z[:, :-1])
    fitted = z[:, 1:] @ inverse
    left = z[:, 1:] - fitted @ z[:, :-1]
    noise = np.sqrt((left**2).sum() / (left.size - fitted.size)) + 2.0**-52
    values, vectors = np.linalg.eig(fitted)
    # where eigenvectors coincide, as at a limit, eigenvalues err by the root of the entries' error
    entries = noise * np.linalg.norm(inverse, 2)
    error = GROWTH_ERRORS * min(entries * np.linalg.cond(vectors), np.sqrt(entries))
    return float(np.abs(values).max()) - 1, max(1e-12, float(error))
