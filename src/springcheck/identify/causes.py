"""Why no known scheme explains the states, where that shows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from springcheck.arrays import Floats
from springcheck.identify.fit import ROUNDING, Map
from springcheck.identify.match import Terms
from springcheck.identify.search import Joint, search

SHOWN = 4
"""Schemes that a note names of those that would fit at a scale of their own."""


def causes(maps: list[Map], terms: list[Terms], residual: float) -> list[str]:
    """Why no matrix explains the states, where that shows."""
    z = [found.z.astype(np.float64) for found in maps]
    out = []
    for found, states in zip(maps, z, strict=True):
        q, v = states[:-1].T
        missing = (found.z[1:] - found.z[:-1] @ found.entries.T).astype(np.float64)
        if len(q) > 20:
            powers = [q**i * v**k for i in range(4) for k in range(4) if 0 < i + k <= 3]
            if _left(np.stack(powers, axis=1), missing) < 0.1:
                out.append(
                    "the motion is anharmonic: the force is not linear in the position, so no matrix fits it"
                )
                break
    if len(maps) > 1 and len(z[0]) > 4 * len(maps) + 10:
        everything = np.concatenate([states[:-1] for states in z], axis=1)
        for found in maps:
            missing = (found.z[1:] - found.z[:-1] @ found.entries.T).astype(np.float64)
            if residual > 1e-12 and _left(everything, missing) < 0.01:
                out.append(
                    "the oscillators are coupled: each follows from the states of all; "
                    "give normal modes, which are independent"
                )
                break
    out = out or _other_units(maps, terms)
    if not out and residual > 64 * ROUNDING:
        out.append(
            f"one map leaves {residual:.1e} of the state unexplained in every step, as no known arithmetic "
            "or number format does: an adaptive solver, noise, or a force that changes"
        )
    if not out:
        out.append("one map explains the states to rounding, but it is none of the known schemes'")
    return out


def _other_units(maps: list[Map], terms: list[Terms]) -> list[str]:
    """Whether a scheme fits once velocities may have any scale: wrong masses, wrong units, dq/dt = p."""
    if terms[0].mass_unknown:
        return []
    free = [replace(what, mass_unknown=True, damped=False, rounding=ROUNDING) for what in terms]
    fitting = [x for x in search(maps, free, range(1, 4)) if x.accepted]
    if not fitting:
        return []
    fitting.sort(key=lambda x: x.plainness)
    # a scale that is nearly 1 is no change of units but the misfit itself
    if max(abs(part.log_mass) for part in fitting[0].parts) < 1e-3:
        return []
    advice = "look at the mass, at the units of velocities and times, and at whether dq/dt = p/m"
    if len(fitting) == 1:
        return [f"{fitting[0]} would fit if velocities were {_scale(fitting[0])} times as large: {advice}"]
    # symmetric schemes have the same map but for the scale, so each has one of its own
    each = "; ".join(f"{x}: {_scale(x)}" for x in fitting[:SHOWN])
    more = f"; and {len(fitting) - SHOWN} more" if len(fitting) > SHOWN else ""
    return [
        "several schemes would fit if velocities were some times as large, each at a factor of its own "
        f"({each}{more}): {advice}"
    ]


def _scale(joint: Joint) -> str:
    return ", ".join(f"{math.exp(-part.log_mass):.6g}" for part in joint.parts)


def _left(columns: Floats, missing: Floats) -> float:
    """Share of the residual that these columns leave over."""
    fitted = columns @ np.linalg.lstsq(columns, missing, rcond=None)[0]
    total = float(np.sqrt(np.mean(missing**2)))
    share = len(missing) / max(len(missing) - columns.shape[1], 1)
    return float(np.sqrt(np.mean((missing - fitted) ** 2) * share)) / total if total else 1.0
