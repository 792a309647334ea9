"""One-step maps of a method on springs: measured on its engine, and in theory.

A scan is one scene of many independent springs, each started twice, so that thousands of frequencies cost one
step.  All is in scaled coordinates (q/A, p/(m w A)): entries are of the order of h w and its powers, in any
units.  A is chosen so that the largest force of every spring is `FORCE`, at which fixed-point sums of forces
have digits to spare on both sides.
"""

from __future__ import annotations

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label, Need
from springcheck.errors import MethodError
from springcheck.physics.arrays import Extended, Floats
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene

FORCE = 1024.0
"""Largest force on a scanned spring, in the scene's unit of force."""

MASS = 3.75
"""Mass of every scanned spring: not 1, and exact in single precision."""

STEP = 0.125
"""Step of every scan: a power of 2, so that h w is known to a rounding of sqrt(k/m)."""


def scheme_of(label: Label) -> schemes.Scheme:
    """The scheme that a method declares."""
    return schemes.scheme(engines.method(label).scheme)


def noise(label: Label) -> float:
    """Relative rounding of an entry of a map: all roundings of one step, with one sign."""
    how = engines.arithmetic(label)
    return schemes.roundings(scheme_of(label)) * (how.unit + how.quantum / FORCE)


def stiffness(label: Label, turn: Floats) -> Floats:
    """Stiffness of springs of these h w (j,), rounded to single precision where the engine does so."""
    k = MASS * (turn / STEP) ** 2
    single = engines.arithmetic(label).parameters == "single"
    return np.asarray(k.astype(np.float32).astype(np.float64) if single else k)


def springs(label: Label, k: Floats, q: Floats, p: Floats, *, steps: int = 1) -> Scene:
    """A scene of independent springs (n,) in the form that the method needs."""
    requires = engines.method(label).requires
    return spring(
        MASS, k, q, p, STEP, steps, c=np.zeros(len(k)) if Need.DAMPING in requires else None,
        fast=Need.FAST_SPRINGS in requires, quantities=("q", "p"), name="scan",
    )  # fmt: skip


def measured(label: Label, turn: Floats) -> Floats:
    """The engine's own one-step maps (j, 1, 2, 2) at these h w (j,); infinite where a step does not end
    finite, NaN where the engine stops."""
    k, n = stiffness(label, turn), len(turn)
    of_q = FORCE / k
    of_p, nothing = np.sqrt(MASS * k) * of_q, np.zeros(n)
    starts = np.concatenate([of_q, nothing]), np.concatenate([nothing, of_p])
    run = driver.run(springs(label, np.tile(k, 2), *starts), label)
    if len(run.t) > 1:
        ends = (run.q[1].reshape(2, n) / of_q, run.p[1].reshape(2, n) / of_p)
        return np.stack([x.T for x in ends], axis=1)[:, None]
    if n > 1:
        # an engine that stops over one spring loses all the others: bisect to find it
        return np.concatenate([measured(label, half) for half in (turn[: n // 2], turn[n // 2 :])])
    return np.full((1, 1, 2, 2), np.nan if run.outcome.status == "stopped" else np.inf)


def theory(label: Label, turn: Floats) -> Extended:
    """The maps (j, 1, 2, 2) of its scheme on the same springs, in extended precision."""
    k = stiffness(label, turn).astype(np.longdouble)
    out = schemes.matrix(scheme_of(label), h=STEP, m=np.full(len(k), MASS), k=k)
    out[:, 0, 1] *= np.sqrt(MASS * k)
    out[:, 1, 0] /= np.sqrt(MASS * k)
    return out[:, None]


def absence(label: Label, *turns: float) -> str | None:
    """Why a label cannot be measured on springs of these h w: its library or platform is missing, or it
    refuses them."""
    if reason := engines.absence(label.engine):
        return reason
    try:
        k = stiffness(label, np.array(turns))
        driver.run(springs(label, k, FORCE / k, np.zeros(len(k))), label)
    except MethodError as error:
        if len(turns) == 1 or (alone := absence(label, 1.0)):
            return str(error) if len(turns) == 1 else alone
        # advice behind it is on a user's scene, and these springs are not
        why, _, _ = str(error).removeprefix(f"{label}: ").partition("; ")
        return f"it refuses springs of h w = {turns[0]:g} to {turns[-1]:g}: {why}"
    return None
