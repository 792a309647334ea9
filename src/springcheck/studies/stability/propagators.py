"""One-step propagators measured on an engine: springs of any frequency, two starts each, one step.

A scan is one scene of many independent springs, so that thousands of frequencies cost one run.  All is in
scaled coordinates (q/A, p/(m w A)): entries are of the order of h w and its powers, in any units.  A is
chosen so that the largest force of every spring is `FORCE`, at which fixed-point sums of forces have digits
to spare on both sides.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label, Need
from springcheck.errors import MethodError
from springcheck.physics.arrays import Extended, Floats, Reals
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene

FORCE = 1024.0
"""Largest force on a scanned spring, in the scene's unit of force."""

MASS = 3.75
"""Mass of every scanned spring: not 1, and exact in single precision."""

STEP = 0.125
"""Step of every scan: a power of 2, so that h w is known to a rounding of sqrt(k/m)."""


EQUAL_ANGLES = 1e-6
"""Difference of two angles of eigenvalues below which they count as equal throughout."""

CLOSING_ROUNDS = 9
"""Times that the interval about a meeting is divided by 4, to 4e-6 of the grid's spacing."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Springs:
    """Uncoupled springs under one method: h w (n,), and friction rate times step, one number or (n,)."""

    label: Label
    turn: Floats
    brake: Floats | float = 0.0

    @property
    def single(self) -> bool:
        """Whether the engine keeps force constants in single precision."""
        return engines.arithmetic(self.label).parameters == "single"

    @property
    def k(self) -> Floats:
        """Stiffness of each spring; rounded to single precision where the engine does so."""
        k = MASS * (self.turn / STEP) ** 2
        return np.asarray(k.astype(np.float32).astype(np.float64) if self.single else k)

    @property
    def true_turn(self) -> Extended:
        """h w of the stiffnesses given to the engine."""
        return np.asarray(STEP * np.sqrt(self.k.astype(np.longdouble) / MASS))


def noise(label: Label) -> float:
    """Relative rounding of an entry of a propagator: all roundings of one step, with one sign."""
    how = engines.arithmetic(label)
    scheme = schemes.scheme(engines.method(label).scheme)
    return schemes.roundings(scheme) * (how.unit + how.quantum / FORCE)


def scene(springs: Springs, q: Floats, p: Floats, *, steps: int = 1) -> Scene:
    """A scene of these uncoupled springs, started at q, p (n,)."""
    requires = engines.method(springs.label).requires
    has_friction = np.any(springs.brake) or Need.DAMPING in requires
    c = np.broadcast_to(springs.brake, springs.turn.shape) * (MASS / STEP)
    return spring(
        MASS, springs.k, q, p, STEP, steps, c=c if has_friction else None,
        fast=Need.FAST_SPRINGS in requires, quantities=("q", "p"), name="scan",
    )  # fmt: skip


def units(springs: Springs, *, slow: bool = False) -> tuple[Floats, Floats]:
    """Units of position and momentum of each spring: A = FORCE/k and m w A; `slow`: so small that a kick
    and a friction of one step leave velocities of about 1."""
    turn = np.asarray(springs.true_turn, np.float64)
    a = STEP / (turn * np.maximum(np.maximum(turn, springs.brake), 1)) if slow else FORCE / springs.k
    return a, MASS * (turn / STEP) * a


def measured(springs: Springs) -> Floats:
    """The engine's own one-step matrices (n, 2, 2); infinite where a step does not end finite, NaN where the
    engine stops."""
    n = len(springs.turn)
    # an engine may stop at a speed; the digits of a fixed-point sum need the large forces
    for slow in (False, True)[: 1 + (engines.arithmetic(springs.label).quantum == 0)]:
        of_q, of_p = units(springs, slow=slow)
        out = matrices(scene(springs, of_q, of_p), springs.label, of_q[:, None], of_p[:, None])
        if np.isfinite(out).any():
            return out
    if n > 1:
        # an engine that stops over one spring loses all the others: bisect to find it
        for half in (slice(None, n // 2), slice(n // 2, None)):
            brake = springs.brake if np.ndim(springs.brake) == 0 else np.asarray(springs.brake)[half]
            out[half] = measured(Springs(label=springs.label, turn=springs.turn[half], brake=brake))
    return out


Stepper = Callable[[Scene, Label], tuple[Reals, Reals]]
"""The states (n,) after one step of a scene."""


def by_engine(scene: Scene, label: Label) -> tuple[Floats, Floats]:
    """The engine's own step; infinite where it does not end finite, NaN where the engine stops."""
    run = driver.run(scene, label)
    if len(run.t) < 2:
        lost = np.full(scene.n, np.nan if run.outcome.status == "stopped" else np.inf)
        return lost, lost
    return run.q[1], run.p[1]


def matrices(scene: Scene, label: Label, of_q: Floats, of_p: Floats, step: Stepper = by_engine) -> Floats:
    """One-step matrices (g, 2n, 2n) of g groups of n particles side by side, in these units (g, n)."""
    g, n = of_q.shape
    # one set of groups for each unit vector
    q, p = np.zeros((2 * n, g, n)), np.zeros((2 * n, g, n))
    for i in range(n):
        q[i, :, i], p[n + i, :, i] = of_q[:, i], of_p[:, i]
    ends = step(scene.system.from_states(q.reshape(2 * n, -1), p.reshape(2 * n, -1)), label)
    x, y = (np.asarray(end).reshape(2 * n, g, n) / unit for end, unit in zip(ends, (of_q, of_p), strict=True))
    return np.concatenate([x, y], axis=-1).transpose(1, 2, 0).astype(np.float64)


def theory(springs: Springs) -> Extended:
    """The scheme's one-step matrices (n, 2, 2), extended precision."""
    scheme = schemes.scheme(engines.method(springs.label).scheme)
    k = springs.k.astype(np.longdouble)
    friction = np.broadcast_to(springs.brake, springs.turn.shape) * np.longdouble(MASS / STEP)
    out = schemes.matrix(scheme, h=STEP, m=np.full(len(k), MASS), k=k, c=friction)
    w = springs.true_turn / STEP
    out[:, 0, 1] *= MASS * w
    out[:, 1, 0] /= MASS * w
    return out


def radius(matrices: Floats | Extended, rounding: float) -> tuple[Floats, Floats]:
    """Spectral radii (n,) of 2 x 2 matrices, and bounds on the effect of rounding of the entries.

    Where the discriminant is within its rounding of 0 the two eigenvalues count as equal: at a limit of
    stability a change of eps in the trace would move them by sqrt(eps).
    """
    a, b = matrices[:, 0, 0], matrices[:, 0, 1]
    c, d = matrices[:, 1, 0], matrices[:, 1, 1]
    with np.errstate(over="ignore", invalid="ignore"):
        half, size = (a + d) / 2, np.abs(a * d) + np.abs(b * c)
        determinant = a * d - b * c
        discriminant = half * half - determinant
        near = np.abs(discriminant) <= 4 * rounding * (half * half + size)
        root = np.sqrt(np.where(near, 0, np.abs(discriminant)))
        turning = near | (discriminant < 0)
        found = np.where(turning, np.sqrt(np.abs(determinant)), np.abs(half) + root)
        safe = np.maximum(found, np.finfo(np.float64).tiny)
        of_turning = rounding * size / safe
        of_real = rounding * (np.abs(a) + np.abs(d)) + rounding * (half * half + size) / np.maximum(
            root, 1e-300
        )
        moved = np.where(turning, of_turning, of_real)
    return np.asarray(found, np.float64), np.asarray(moved, np.float64)


def bounded(matrices: Floats | Extended, rounding: float) -> np.ndarray:
    """Whether powers of each matrix stay bounded, to rounding of its entries; False for non-finite ones."""
    found, moved = radius(matrices, rounding)
    with np.errstate(invalid="ignore"):
        return np.asarray(found <= 1 + np.where(np.isfinite(moved), np.minimum(moved, 1), 0))


def first(
    grows: Callable[[Floats], tuple[np.ndarray, Floats]], grid: Floats, fine: int, rounds: int,
    enough: float = 1e-10,
) -> float:  # fmt: skip
    """Where growth begins on a grid (j,), refined `rounds` times by `fine` points to a relative `enough`.

    `grows` returns at which points, and their exact positions.  0: at the first; infinity: nowhere.
    """
    for _ in range(rounds):
        wild, at = grows(grid)
        if not wild.any():
            return float("inf")
        j = int(np.argmax(wild))
        if j == 0:
            return 0.0
        low, high = at[j - 1], at[j]
        if high - low <= enough * high:
            break
        grid = np.linspace(low, high, fine)
    return float((low + high) / 2)


def meetings(values: Callable[[Floats], Floats | np.ndarray], grid: Floats) -> Floats:
    """Points (c,) between those of a grid (j,) at which angles of eigenvalues `values` (j, 2n) come nearest.

    Eigenvalues of a symplectic map leave the unit circle only where two of them meet, so that a band of
    growth narrower than the grid's spacing lies there or nowhere (Krein).
    """

    def gaps(x: Floats) -> tuple[Floats, Floats]:
        # real matrices: each angle from 0 to pi is there twice, with its conjugate or with its inverse
        found = values(x)
        angle = np.sort(np.abs(np.angle(found)), axis=-1)[:, ::2]
        return np.diff(angle, axis=-1, prepend=0.0, append=np.pi), np.max(np.abs(found), axis=-1) - 1

    found, _ = gaps(grid)
    before, here, after = found[:-2], found[1:-1], found[2:]
    # equal frequencies have no gap to close
    apart = np.maximum(before, after) > EQUAL_ANGLES
    at, which = np.nonzero((here <= np.minimum(before, after)) & apart)
    low, middle, high, each = grid[at], grid[at + 1], grid[at + 2], np.arange(len(at))
    for _ in range(CLOSING_ROUNDS if len(at) else 0):
        x = np.linspace(low, high, 9)
        gap, growth = gaps(x.ravel())
        # where the gap is closed, the point of most growth
        least = gap.reshape(*x.shape, -1)[:, each, which] - growth.reshape(x.shape)
        best = np.argmin(least, axis=0)
        low, middle, high = (x[np.clip(best + i, 0, 8), each] for i in (-1, 0, 1))
    return middle


def absence(label: Label, *turns: float) -> str | None:
    """Why a label cannot be measured here at these h w: its library or its platform is missing, or it refuses
    such springs."""
    reason = engines.absence(label.engine)
    if reason:
        return reason
    try:
        springs = Springs(label=label, turn=np.array(turns))
        a, _ = units(springs)
        driver.run(scene(springs, a, np.zeros(len(turns))), label)
    except MethodError as error:
        if len(turns) == 1 or (alone := absence(label, 1.0)):
            return str(error) if len(turns) == 1 else alone
        # advice behind it is on a user's scene, and these springs are not
        why, _, _ = str(error).removeprefix(f"{label}: ").partition("; ")
        return f"springs of h w = {turns[0]:g} to {turns[-1]:g}, which a limit is searched among: {why}"
    return None


def unstarted(given: Scene, label: Label) -> str | None:
    """Why an engine does not start a scene that its method serves by what it declares, or None."""
    try:
        if engines.refusal(given, label) is None:
            engines.Started(given, label)
    except MethodError as error:
        return str(error)
    return None
