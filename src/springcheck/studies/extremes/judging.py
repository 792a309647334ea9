"""Outcome of a cell: each step compared with the scheme's own, and a named reason where one deviates.

Every step from a finite state is judged separately, in extended precision, whose range (1e4932) holds numbers
that overflow double precision.  A step beyond its bound needs a reason that applies to this very cell: an
intermediate result outside the range of the engine's numbers, or its fixed-point sum of forces.  A deviation
without a reason makes the cell silently wrong.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from springcheck import checks, engines, schemes
from springcheck.checks.case import keeps, least_moved, overflows
from springcheck.engines.contract import Label, Stopped
from springcheck.physics.arrays import Arithmetic, Extended, Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory, of_scene
from springcheck.studies.extremes.grid import Spec

Outcome: TypeAlias = Literal[
    "right", "unstable, as theory says", "engine's limit", "silently wrong", "not measured"
]

UNSTABLE_GROWTH = 2.0
"""Growth of the amplitude over a run from which a cell is called unstable."""

FORCE_RESOLUTION = 2.0**-24
"""Relative resolution that a fixed-point sum must reach to represent a force: single precision's."""

TOO_COARSE = "fixed-point forces: a quantum of {:.1e} leaves too few digits"

RANGES = {
    "double": (2.0**-1022, float(np.finfo(np.float64).max)),
    "single": (2.0**-126, 3.4028234663852886e38),
}
"""Smallest normal and largest number of each precision."""


PARAMETERS = ("m", "k", "q", "p", "h", "steps", "h_w", "force")


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One cell of the atlas."""

    method: str
    block: str
    parameters: dict[str, float] = field(metadata={"keys": PARAMETERS})
    outcome: Outcome
    reason: str
    value: float
    """Largest distance of a step from the scheme's own, in roundings."""
    bound: float

    @property
    def decade(self) -> int:
        """Power of ten of the largest force at the start."""
        # compared as logarithms: the product itself may leave the range
        return int(np.round(np.log10(self.parameters["k"]) + np.log10(self.parameters["q"])))


def cell(
    label: Label, spec: Spec, outcome: Outcome, reason: str, value: float = np.nan, bound: float = np.nan,
    **more: float,
) -> Cell:  # fmt: skip
    """The cell of a spring, with `more` of its parameters."""
    return Cell(
        method=str(label), block=spec.block, outcome=outcome, reason=reason, value=float(value),
        bound=float(bound), parameters={name: getattr(spec, name) for name in PARAMETERS} | more,
    )  # fmt: skip


def sizes(label: Label, case: checks.Case, q: Floats, p: Floats) -> tuple[Extended, Extended, Extended]:
    """The largest and the smallest magnitude of intermediate results, and the force, (f-1, n) each, of the
    scheme's steps from all states q, p (f, n) but the last.

    In whatever order an engine works, it forms positions, momenta, velocities, forces, accelerations and
    their increments.  An engine that squares lengths of bonds also forms 1/m and 1/h.
    """
    scene, (end_q, end_p) = case.judged, case.next_states
    places: list[Reals] = [q[:-1], end_q]
    m = scene.m.astype(np.longdouble)
    h = np.abs(np.longdouble(scene.step))
    k = np.abs(scene.system.hessian_diagonal(scene.q))
    # a stage may reach farther than both ends of its step
    case.step(q[:-1].astype(np.longdouble), p[:-1].astype(np.longdouble), met=places)
    x, y = np.max(np.abs(np.stack(places)), axis=0), np.maximum(np.abs(p[:-1]), np.abs(end_p))
    force = k * x
    parts = [x, y, y / m, force, force / m, h * force, h * force / m, h * y / m]
    parts += [np.broadcast_to(part, x.shape) for part in (k, k / m, h * h * k / m)]
    if engines.engine(label.engine).squares_lengths:
        parts += [np.broadcast_to(part, x.shape) for part in (1 / m, m, h, 1 / h)]
        # the length of a bond is the root of a square, and the force is divided by it
        parts += [x * x, y / m * (y / m) * h * h]
    whole = np.stack([np.asarray(part, np.longdouble) for part in parts])
    nonzero = np.where(whole > 0, whole, np.inf)
    return np.max(whole, axis=0), np.min(nonzero, axis=0), force


def judge(
    label: Label, specs: Sequence[Spec], scene: Scene, q: Floats, p: Floats, stop: Stopped | None
) -> list[Cell]:
    """Cells of one run: q, p (f, n) as the engine left them, non-finite where it overflowed or stopped."""
    how, alone = engines.arithmetic(label), len(specs) == 1
    if stop and not alone:
        # which cell stopped the engine is unknown
        q, p = q[:-1], p[:-1]
    with np.errstate(all="ignore"):
        case = checks.Case(trajectory=as_trajectory(label, scene, q, p, how), scene=scene)
        exact_q, exact_p = case.next_states
        of_q, of_p = case.allowance
        dq, dp = np.abs(exact_q - q[1:]), np.abs(exact_p - p[1:])
        ratio = _largest(dq, dp, of_q, of_p)
        strict = _largest(dq, dp, *case.allowance_at(q[:-1], p[:-1], smallest=np.longdouble(0)))
        from_finite = np.isfinite(q[:-1]) & np.isfinite(p[:-1])
        largest, smallest, force = sizes(label, case, q, p)
        growth, bound = growth_of(case, scene), float(case.roundings)
        low, high = RANGES["single" if how.force >= 2.0**-24 else "double"]
        peaks, too_coarse = np.max(force, axis=0, initial=0), TOO_COARSE.format(how.quantum)
        # the engine's own displacement, as its forces may be cached
        moved = np.apply_along_axis(least_moved, 0, np.abs(np.diff(q, axis=0)))
        reasons = {
            overflows(how): force >= how.overflow,
            too_coarse: np.broadcast_to(how.quantum > FORCE_RESOLUTION * peaks, moved.shape),
            keeps(how): (how.stale > 0) & (moved <= 2 * how.stale),
            f"a step forms numbers beyond {high:.1e}": ~(largest <= high),
            f"a step forms numbers below {low:.1e}": smallest < low,
        }
    cells = []
    for i, spec in enumerate(specs):
        here = from_finite[:, i]
        bad = here & ~(ratio[:, i] <= bound)
        value = float(np.max(np.where(here, np.minimum(ratio[:, i], 1e300), 0), initial=0.0))
        unstable = bool(growth[i] * spec.steps >= np.log(UNSTABLE_GROWTH)) and spec.k > 0
        j = int(np.argmax(bad)) if bad.any() else len(bad)
        outcome: Outcome = "silently wrong"
        reason = f"step {j + 1} is wrong by {value:.3g} roundings (bound {bound:g})"
        if stop and j >= len(bad) - alone:
            reason = f"stopped for no reason that is known here: {stop}"
        if not bad.any() and not stop:
            outcome, reason = "unstable, as theory says" if unstable else "right", ""
            # an unstable force is small at first
            peak = float(force[0, i] if unstable else peaks[i])
            if np.any(here & ~(strict[:, i] <= bound)):
                outcome, reason = "engine's limit", f"numbers below {low:.1e} lose digits to underflow"
            elif how.quantum > FORCE_RESOLUTION * peak > 0:
                outcome, reason = "engine's limit", too_coarse
        elif bad.any():
            named = _reason(how, spec, {text: holds[bad, i] for text, holds in reasons.items()})
            if named and unstable and "beyond" in named and j > 0:
                outcome, reason = "unstable, as theory says", f"grown out of range by step {j + 1}: {named}"
            elif named:
                outcome, reason = "engine's limit", named
            elif stop and stop.is_limit and alone and j == len(bad) - 1:
                outcome, reason = "engine's limit", str(stop)
        cells.append(cell(label, spec, outcome, reason, value, bound))
    return cells


def _reason(how: Arithmetic, spec: Spec, reasons: Mapping[str, np.ndarray]) -> str | None:
    """A reason that applies to every step that deviates, of those that hold for each, or None."""
    if how.parameters == "single":
        with np.errstate(over="ignore", under="ignore"):
            kept = abs(np.float32(spec.k))
        if spec.k and not RANGES["single"][0] <= kept <= RANGES["single"][1]:
            return f"the force constant {spec.k:.3g} is beyond single precision, in which it is stored"
    for text, holds in reasons.items():
        if np.all(holds):
            return text
    if np.all(np.any(np.stack(list(reasons.values())), axis=0)):
        return " and ".join(text for text, holds in reasons.items() if np.any(holds))
    return None


def _largest(dq: Extended, dp: Extended, of_q: Extended, of_p: Extended) -> Extended:
    """The larger of dq/of_q and dp/of_p; 0/0 counts as 0, and NaN as infinite."""
    parts = [np.where(d == 0, 0, d / np.where(of > 0, of, 0)) for d, of in ((dq, of_q), (dp, of_p))]
    ratio = np.maximum(*parts)
    return np.asarray(np.where(np.isnan(ratio), np.inf, ratio))


def growth_of(case: checks.Case, scene: Scene) -> Floats:
    """Logarithm of the spectral radius of each cell's own one-step matrix."""
    k = scene.system.hessian_diagonal(scene.q)
    w = np.sqrt(np.abs(k) / scene.m.astype(np.longdouble))
    # in units of the period, so that no entry overflows
    turn = np.abs(np.longdouble(scene.step)) * w
    matrices = schemes.matrix(case.scheme, h=1.0, m=np.ones(scene.n), k=turn * turn * np.sign(k))
    found = schemes.rotation(matrices)
    smallest = np.finfo(np.longdouble).tiny
    return np.asarray(np.log(np.maximum(np.abs(found.determinant), smallest)) / 2 + found.growth, np.float64)


def as_trajectory(label: Label, scene: Scene, q: Floats, p: Floats, how: Arithmetic) -> Trajectory:
    """Frames as a trajectory for `checks.Case`, with non-finite numbers too."""
    method = engines.method(label)
    return of_scene(
        scene, q, p, label=str(label), scheme=method.scheme, arithmetic=how,
        rebuilds_velocity=method.rebuilds_velocity,
    )  # fmt: skip
