"""What a check is: one object that names itself, says what it needs, and judges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, TypeAlias, TypeVar

from springcheck.trajectory import Verdict


class Subject(Protocol):
    """What is judged: a `Case`, or a `Bench`."""

    def not_applicable(self, check: str, why: str) -> Verdict:
        """The verdict of a check that does not apply."""
        ...


Subject_contra = TypeVar("Subject_contra", bound=Subject, contravariant=True)

Family: TypeAlias = Literal["record", "motion", "repeat", "map", "law"]
"""Facts of the record, to the bit; the recorded motion; two runs against each other, to the bit; the one-step
map; laws over many runs, which do not look at the scene."""


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
    judge: Callable[[Subject_contra], Verdict]
    unless: Callable[[Any], str | None]
    """Why it does not apply to a subject, or None; `judge` may find further reasons."""

    def __call__(self, subject: Subject_contra) -> Verdict:
        why_not = self.unless(subject)
        return subject.not_applicable(self.name, why_not) if why_not else self.judge(subject)


def check(
    short: str,
    *,
    family: Family,
    needs: str,
    unless: Callable[[Any], str | None] = lambda subject: None,
) -> Callable[[Callable[[Subject_contra], Verdict]], Check[Subject_contra]]:
    """Make a check of a function: its name and the first line of its docstring are the check's own."""

    def made(judge: Callable[[Subject_contra], Verdict]) -> Check[Subject_contra]:
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
