"""What a check is: one object that names itself, says what it needs, and judges; and what passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeAlias, TypeVar

import numpy as np

from springcheck.physics.arrays import WIDE
from springcheck.physics.trajectory import NOT_KNOWN, Limits, Verdict

BEYOND = 2.0**511
"""Stands for every value that fails and is no number or larger: a verdict and its ratio are numbers."""


class Subject(Protocol):
    """What is judged: a `Case`, or a `Bench`."""

    @property
    def label(self) -> str:
        """The label of the method."""
        ...


Subject_contra = TypeVar("Subject_contra", bound=Subject, contravariant=True)

Family: TypeAlias = Literal["record", "motion", "repeat", "map", "law"]
"""Facts of the record, to the bit; the recorded motion; two runs against each other, to the bit; the one-step
map; laws over many runs, which do not look at the scene."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A value, the bound that it must keep, their unit, the bound's reason, and what would have been seen."""

    value: float | np.number
    bound: float | np.number
    unit: str
    why: str
    sees: Limits = NOT_KNOWN
    holds: bool = True
    """What else must be for it to pass."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Check(Generic[Subject_contra]):
    """One check: call it with a `Case`, or an experiment with a `Bench`, and it returns its verdict."""

    name: str
    short: str
    """Its name in a narrow column."""
    family: Family
    needs: str
    """What must be there for it to apply."""
    sentence: str
    """What holds where it passes."""
    judge: Callable[[Subject_contra], Finding | str]
    """What it finds, or why it does not apply."""
    unless: Callable[[Any], str | None]
    """Why it does not apply to a subject, or None; `judge` may find further reasons."""

    def __call__(self, subject: Subject_contra) -> Verdict:
        return verdict(subject.label, self.name, self.unless(subject) or self.judge(subject))


def check(
    short: str,
    *,
    family: Family,
    needs: str,
    unless: Callable[[Any], str | None] = lambda subject: None,
) -> Callable[[Callable[[Subject_contra], Finding | str]], Check[Subject_contra]]:
    """Make a check of a function: its name and the first line of its docstring are the check's own."""

    def made(judge: Callable[[Subject_contra], Finding | str]) -> Check[Subject_contra]:
        return Check(
            name=judge.__name__.replace("_", "-"),
            short=short,
            family=family,
            needs=needs,
            sentence=(judge.__doc__ or "").partition("\n")[0],
            judge=judge,
            unless=unless,
        )

    return made


def verdict(method: str, check: str, found: Finding | str) -> Verdict:
    """Passed only if the value is a number within the bound.  A bound that is infinite says nothing, and a
    reason why the check does not apply is reported as such, never as passed.

    The verdict's value and bound are finite numbers: `BEYOND` stands for a value that is none, and fails.
    """
    if isinstance(found, Finding) and float(found.bound) == np.inf and not np.isnan(float(found.value)):
        found = "what rounding or the tolerance allows is beyond all numbers"
    if isinstance(found, str):
        nan = float("nan")
        return Verdict(method=method, check=check, value=nan, bound=nan, unit="", passed=None, why=found)
    value, bound, why = float(found.value), float(found.bound), found.why
    if found.unit == "roundings" and not WIDE:
        why += "; the reference rounds like the engine here, which a rounding of both allows for"
    passed = bool(found.holds and -np.inf < value <= bound < np.inf)
    if not passed and not (np.isfinite(bound) and bound >= 0):
        value, bound, why = BEYOND, 0.0, f"what is allowed is no number; {why}"
    elif not passed and not np.isfinite(value):
        why = f"what was found is no finite number; {why}"
    if not passed and not abs(value) <= BEYOND:
        value, bound = BEYOND, min(bound, BEYOND / 2)
    return Verdict(
        method=method, check=check, value=value, bound=bound, unit=found.unit, passed=passed, why=why,
        sees=found.sees,
    )  # fmt: skip
