"""A check: one object with a name, its requirements and a function that judges."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np

from springcheck.checks.requires import REQUIREMENTS, missing
from springcheck.errors import MethodError
from springcheck.physics.arrays import WIDE, Reals
from springcheck.physics.trajectory import NOT_KNOWN, Limits, Verdict
from springcheck.text.wording import described

if TYPE_CHECKING:
    from springcheck.bath.evidence import Statistic

BEYOND = 2.0**511
"""Stands for values that fail and are not finite, or larger, so that a verdict and its ratio are finite."""


def largest(values: Reals) -> tuple[np.intp, ...]:
    """Index of the largest value; NaN and infinity count as larger than all."""
    return np.unravel_index(np.argmax(np.where(np.isfinite(values), values, np.inf)), values.shape)


Family: TypeAlias = Literal["record", "motion", "repeat", "map", "law", "noise"]
"""Facts of the record, to the bit; the recorded motion; two runs against each other, to the bit; the one-step
map; laws over many runs, which do not look at the scene; the draws of a thermostat."""


class Finding(NamedTuple):
    """A value, the bound that it must keep, their unit, the bound's reason, and the limits of detection."""

    value: float | np.number
    bound: float | np.number
    unit: str
    why: str
    sees: Limits = NOT_KNOWN
    holds: bool = True
    """A further condition of a pass, next to the value within its bound."""


class Chance(NamedTuple):
    """A finding that only statistics can judge: the probability of a value as extreme if all is right."""

    chance: float
    why: str
    statistic: Statistic | None = None
    """What it is the chance of, where that adds up over the pieces of a run."""

    @classmethod
    def of(cls, statistic: Statistic) -> Chance:
        """That of a statistic of draws."""
        return cls(*statistic.found, statistic)

    @property
    def decades(self) -> float:
        """Minus the decimal logarithm of the chance; 308 of one that is too small for a number."""
        return float(-np.log10(np.maximum(self.chance, np.finfo(np.float64).tiny)))


FALSE_ALARMS = 1e-6
"""Probability of a false alarm of a whole command in which all is right."""

DECADES = "decades of chance"
"""Unit of verdicts on random numbers: a value of 3 comes about by chance once in 1000 times."""


def shared(verdicts: Sequence[Verdict], false_alarms: float = FALSE_ALARMS) -> list[Verdict]:
    """The verdicts of one command, with its probability of a false alarm shared evenly among the random ones.

    The sum of their chances is that of the command, however they depend on each other (Bonferroni).
    """
    random = [one.passed is not None and one.unit == DECADES for one in verdicts]
    bound = float(np.log10(max(sum(random), 1) / false_alarms))

    def by_chance(one: Verdict) -> Verdict:
        sees = one.statistic.sees(10.0**-bound) if one.statistic else one.sees
        return replace(one, bound=bound, passed=bool(one.value <= bound), sees=sees)

    return [by_chance(one) if is_random else one for one, is_random in zip(verdicts, random, strict=True)]


def over_pieces(worst: Verdict, judged: Sequence[Verdict]) -> Verdict:
    """The random verdict on a run of several pieces: that of the sums over all pieces, or else the worst of
    the pieces, whose chance is found so many times as often."""
    each = [one.statistic for one in judged]
    if len(judged) == 1 or None in each:
        return replace(worst, value=worst.value - float(np.log10(len(judged))))
    whole = Chance.of(sum(each[1:], each[0]))
    return replace(worst, value=min(whole.decades, BEYOND), why=whole.why, statistic=whole.statistic)


Judge: TypeAlias = Callable[[Any], Finding | Chance | str]
"""What a check finds of its subject, or the reason why the measurement is inconclusive."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Check:
    """One check: called with its subject, it returns a verdict.

    The subject is a `Case`, for an experiment a `Bench`, and for one with a thermostat a `Seeded`.
    """

    name: str
    short: str
    """Its name in a narrow column."""
    family: Family
    requires: frozenset[str]
    """Names of the requirements (`requires.REQUIREMENTS`) that a subject must meet for it to apply."""
    sentence: str
    """The statement that holds where it passes."""
    judge: Judge
    telling: bool
    """Whether a pass distinguishes the scheme that a method claims from others."""

    @property
    def needs(self) -> str:
        """Its requirements, in words."""
        words = [one.word for one in REQUIREMENTS.values() if one.name in self.requires]
        return ", ".join(words) or "every run"

    def __call__(self, subject: Any) -> Verdict:
        try:
            # NaN and infinity are judged like any value, without a warning
            with np.errstate(all="ignore"):
                found = missing(subject, self.requires) or self.judge(subject)
        except MethodError as error:
            # an experiment that the method cannot serve does not apply
            found = str(error)
        return verdict(subject.label, self.name, found)


def check(
    short: str, *, family: Family, requires: Collection[str] = (), telling: bool | None = None
) -> Callable[[Judge], Check]:
    """Make a check of a function, with its name and the first sentence of its docstring.

    `telling` states whether it distinguishes schemes; by default all do but those of records and repetitions.
    Raises ValueError for an unknown requirement.
    """
    if unknown := sorted(set(requires) - set(REQUIREMENTS)):
        raise ValueError(
            f"no requirement is called {' or '.join(unknown)}; known are {', '.join(REQUIREMENTS)}"
        )

    def made(judge: Judge) -> Check:
        first = " ".join(described(judge).partition("\n\n")[0].split()).partition(". ")[0]
        tells = family not in ("record", "repeat") if telling is None else telling
        return Check(
            name=judge.__name__.replace("_", "-"), short=short, family=family, requires=frozenset(requires),
            sentence=f"{first.rstrip('.')}.", judge=judge, telling=tells,
        )  # fmt: skip

    return made


def verdict(method: str, check: str, found: Finding | Chance | str) -> Verdict:
    """Passed only if the value is a number within the bound.

    An infinite bound is inconclusive, and a reason why the check does not apply is reported as such, never as
    passed.  The verdict's value and bound are finite: `BEYOND` stands for a value that is not, and fails.
    """
    statistic = found.statistic if isinstance(found, Chance) else None
    if isinstance(found, Chance):
        # the bound is that of the only random verdict of a command
        found = Finding(found.decades, -np.log10(FALSE_ALARMS), DECADES, found.why)
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
        sees=found.sees, statistic=statistic,
    )  # fmt: skip
