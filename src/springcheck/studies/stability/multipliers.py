"""Floquet multipliers of methods on a spring of modulated stiffness, with a whole number of steps in a
period.

The state a period later is a matrix times the present one, for the exact motion and for every method whose
steps divide the period.  Its eigenvalues give the growth and the rotation angle (Nayfeh & Mook, Nonlinear
Oscillations, 1979, 5.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label
from springcheck.physics.driven import CLOCK, ModulatedSpring
from springcheck.physics.exact.mathieu import floquet
from springcheck.physics.scene import Scene

MOST_STEPS = 4096
"""Largest number of steps in a period: for a shorter step, multipliers are measured with this many."""

INVERTIBLE_NORM = 2.0**500
"""Largest norm of a matrix for which products of two elements, of it and of its inverse, are doubles."""

OVERFLOWING_SIZE = 2.0**60
"""Size of states from which an engine in single precision may overflow: their squares do."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Multiplier:
    """The multiplier of largest size of one method, as its size and its angle from 0 to pi [rad]."""

    method: str
    steps: int
    """Steps in a period of the modulation."""
    grown: float = nan
    """Growth factor over a period, measured from two starts."""
    turned: float = nan
    """Rotation angle over a period [rad], from 0 to pi, likewise measured; all are NaN where nothing was."""
    grown_predicted: float = nan
    """Growth factor of the scheme's own steps."""
    turned_predicted: float = nan
    off: float = nan
    """Distance of the two multipliers in the complex plane."""
    bound: float = nan
    """Rounding of each step, propagated to the end of the period, times the condition of the eigenvectors.
    States have size 1 + |rest position|, as each is rounded with its distance from 0."""
    why: str = ""
    """Why nothing was measured."""


def serves(scene: Scene, label: Label) -> bool:
    """Whether a method of fixed step can serve the scene, one modulated spring with a known exact motion."""
    one = scene.n == 1 and floquet(scene.system) is not None and not engines.refusal(scene, label)
    return one and _scheme(label).has("one-step")


def measure(scene: Scene, label: Label) -> Multiplier:
    """Run a period from two starts, with the whole number of steps, `MOST_STEPS` at most, that is nearest to
    the scene's step."""
    found = floquet(scene.system)
    spring = next(x for x in scene.terms if isinstance(x, ModulatedSpring))
    assert found is not None
    _, period, _ = found
    steps = int(np.clip(round(period / abs(scene.step)), 1, MOST_STEPS))
    scene = replace(scene, step=np.copysign(period / steps, scene.step), steps=steps, every=steps)
    rest, size = float(spring.at[0]), float(scene.m[0] * 2 * np.pi / period)
    starts = [(rest + 1, 0.0), (rest, size)]
    right = _powers(scene, label, starts, rest, size)
    largest_seen = np.max(np.abs(right), axis=(1, 2))
    try:
        if not np.all((largest_seen <= INVERTIBLE_NORM) & (largest_seen >= 1 / INVERTIBLE_NORM)):
            raise np.linalg.LinAlgError
        # a rounding of the state after each step, propagated to the end
        carried = [
            np.linalg.norm(right[-1] @ np.linalg.inv(one), 2) * np.linalg.norm(one, 2) for one in right
        ]
    except np.linalg.LinAlgError:
        return _unknown(label, steps, "the products of its scheme's steps are beyond what doubles can invert")
    runs = [driver.run(replace(scene, q=np.array([q]), p=np.array([p])), label) for q, p in starts]
    lost = next((run.outcome for run in runs if run.outcome.status != "complete"), None)
    if lost and np.max(largest_seen) > OVERFLOWING_SIZE:
        return _unknown(label, steps, f"its run {lost.status} as its scheme grows: {lost.message}")
    ends = np.array([[run.q[-1, 0] - rest, run.p[-1, 0] / size] for run in runs]).T
    values, vectors = np.linalg.eig(right[-1])
    own, largest = _largest(values), complex(np.nan) if lost else _largest(np.linalg.eigvals(ends))
    law, method = schemes.Law(scheme=_scheme(label), scene=scene, h=scene.step), engines.method(label)
    # a velocity rebuilt from positions has their rounding divided by the step
    each = law.roundings * (1 + steps / (2 * np.pi) * method.rebuilds_velocity)
    # each position is rounded as a whole, its displacement from the rest position being 1
    each *= 1 + abs(rest)
    allowed = engines.arithmetic(label).state * each * float(np.sum(carried)) * float(np.linalg.cond(vectors))
    return Multiplier(
        method=str(label),
        steps=steps,
        grown=abs(largest),
        turned=float(np.angle(largest)),
        grown_predicted=abs(own),
        turned_predicted=float(np.angle(own)),
        off=abs(largest - own),
        bound=allowed,
    )


def _scheme(label: Label) -> schemes.Scheme:
    return schemes.scheme(engines.method(label).scheme)


def _largest(values: np.ndarray) -> complex:
    """The largest eigenvalue; of a conjugate pair the one in the upper half plane."""
    return complex(max(values, key=lambda one: (round(abs(one), 12), one.imag)))


def _powers(
    scene: Scene, label: Label, starts: list[tuple[float, float]], rest: float, size: float
) -> np.ndarray:
    """Propagators of the scheme's own first j + 1 steps, (steps, 2, 2)."""
    law = schemes.Law(scheme=_scheme(label), scene=scene.system.clocked, h=scene.step)
    q, p = (
        np.array([[one[i], clock] for one in starts], np.longdouble) for i, clock in enumerate((0.0, CLOCK))
    )
    out = []
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        for _ in range(scene.steps):
            q, p = law.step(q, p)
            out.append([q[:, 0] - rest, p[:, 0] / size])
        return np.array(out, np.float64)


def _unknown(label: Label, steps: int, why: str) -> Multiplier:
    return Multiplier(method=str(label), steps=steps, why=f"its Floquet multiplier is not measured: {why}")
