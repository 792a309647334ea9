"""What the schemes that fit would mean: names, friction laws, and what is stated held against them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from springcheck.arrays import Floats
from springcheck.identify import arithmetic
from springcheck.identify.evidence import title
from springcheck.identify.families import FAMILIES
from springcheck.identify.notes import LEAPFROG
from springcheck.identify.record import Record
from springcheck.identify.result import Candidate, Explanation
from springcheck.identify.search import Joint, aliases, coincident, disagreements, frictionless, numbers
from springcheck.identify.wrong import stiffness_ratio
from springcheck.schemes import SCHEMES

T = TypeVar("T")

SINGLE_CONSTANTS = ("fixed-point force", "mixed", "single")
"""Precisions of GPU-type platforms, which keep force constants in single precision in every mode."""


def rows(rows: list[tuple[float, ...]]) -> tuple[float, ...] | None:
    """The numbers that all candidates share, to 1e-9, or None."""
    if len({len(row) for row in rows}) > 1:
        return None
    same = np.allclose(np.array(rows), np.array(rows[0]), rtol=1e-9, atol=0, equal_nan=True)
    return rows[0] if same else None


def stated_stiffness(
    record: Record, moving: list[int], plainest: Joint, stated: Floats, precision: str
) -> tuple[bool, list[str], list[Explanation]]:
    """Whether the stated stiffness is that of the states, notes, and what may be wrong with it."""
    against = disagreements(record, moving, plainest, stated)
    if not against:
        return True, [], []
    with np.errstate(over="ignore"):
        single = stated.astype(np.float32).astype(np.float64)
    quantum = arithmetic.QUANTUM if precision in SINGLE_CONSTANTS else 0.0
    room = max(6 * part.a_error / abs(part.a) for part in plainest.parts)
    resolved = quantum > 0 or room < 0.1 * float(np.max(np.abs(single / stated - 1)))
    if resolved and not disagreements(record, moving, plainest, single, quantum):
        why = ", as GPU-type platforms keep it" if quantum else ""
        return True, [f"the stiffness is the stated one in single precision{why}"], []
    _, stiffness, _ = numbers(record, moving, plainest)
    j = moving[0]
    ratio = (stiffness or (math.nan,))[0] / float(stated[j])
    mass = None if record.mass is None else float(record.mass[j])
    meaning = stiffness_ratio(ratio, mass)
    cause = f"{title(plainest.scheme)}, but of a spring {ratio:.9g} times as stiff as stated"
    return (
        False,
        against,
        [
            Explanation(
                cause=f"{cause}: {meaning}" if meaning else cause,
                remedy="look at the units of the force constant, and at whether V is k/2 q**2",
                misfit=abs(ratio - 1),
            )
        ],
    )


def other_names(scheme: str, *, damped: bool) -> tuple[str, ...]:
    """Other names of a scheme's map, and what has it on a spring of another stiffness."""
    if scheme not in SCHEMES:
        return ()
    leapfrog = [LEAPFROG[scheme]] if scheme in LEAPFROG else []
    still = [] if damped else [f"{name} without friction" for name in frictionless(scheme)]
    same = (
        []
        if damped
        else list(dict.fromkeys(f"{FAMILIES[x].scheme} with friction" for x in coincident(scheme)))
    )
    return (*aliases(scheme), *leapfrog, *still, *same)


def common(values: Sequence[T]) -> T | None:
    """The value that all are, or None."""
    return values[0] if len(set(values)) == 1 else None


def candidates_of(
    record: Record, moving: list[int], joint: Joint, stated: float | None = None
) -> list[Candidate]:
    """What a family would mean: one candidate, or one for each friction law that has its map, if it has the
    stated friction c."""
    family = FAMILIES[joint.family]
    out = []
    for law in family.laws if joint.damped else ("",):
        omega, stiffness, friction = numbers(record, moving, joint, law)
        if stated is not None and record.mass is not None:
            rates = [stated / float(record.mass[j]) for j in moving]
            room = [
                8 * part.g_error * joint.stride / abs(float(record.interval)) + 1e-9 * rate
                for part, rate in zip(joint.parts, rates, strict=True)
            ]
            if any(abs(x - y) > z for x, y, z in zip(friction, rates, room, strict=True)):
                continue
        out.append(
            Candidate(
                scheme=joint.scheme,
                aliases=other_names(joint.scheme, damped=joint.damped),
                stride=joint.stride,
                step=float(record.interval) / joint.stride,
                turns=max(part.turns for part in joint.parts),
                omega=omega,
                stiffness=stiffness,
                friction=friction,
                law=f"{law} {family.place}".strip(),
            )
        )
    return out
