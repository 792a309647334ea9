"""The result of an identification: frozen data, a JSON document, text."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from springcheck.text.wording import count

if TYPE_CHECKING:
    from springcheck.text.lines import Lines

Verdict: TypeAlias = Literal["named", "not told apart", "none", "adaptive"]
UNTOLD = "cannot tell"
"""Precision if none is identified."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A scheme that the states do not exclude, and the numbers that they would then have.

    Rows of numbers hold one for each oscillator that moves, as in `Identification`.
    """

    scheme: str
    aliases: tuple[str, ...]
    stride: int
    step: float
    turns: int
    """Whole turns between two frames."""
    omega: tuple[float, ...]
    stiffness: tuple[float, ...] | None
    friction: tuple[float, ...]
    law: str = ""
    """Discretisation and place of the friction that the numbers assume; "" without friction."""

    def __str__(self) -> str:
        return f"{self.scheme}, {count(self.stride, 'step')} per frame"


@dataclass(frozen=True, slots=True)
class Explanation:
    """A possible cause, as a sentence, and what to do about it; "" where nothing is known."""

    cause: str
    remedy: str = ""
    misfit: float = 0.0
    """What it leaves over, relative to the state."""
    local: bool = False
    """Whether it leaves no noise to explain: it accounts for every frame to rounding."""
    shown: bool = True
    """Whether the states show it: else it says why they show none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """Result of an identification.  Rows of numbers hold one for each oscillator that moves.

    A scheme is named only where the states exclude every other.  Where several explain them equally well the
    verdict is "not told apart", `scheme` is None, `candidates` are all of them, and a number is given only if
    it is the same for all.  Where none does it is "none"; and "adaptive" where one of our own stores says so.
    """

    verdict: Verdict
    statement: str
    """One sentence: scheme and arithmetic, or the cause."""
    scheme: str | None = None
    aliases: tuple[str, ...] = ()
    """Other schemes of the same map, which no states on a spring tell apart."""
    candidates: tuple[Candidate, ...] = ()
    """Schemes that the states do not exclude, the simplest first."""
    step: float = math.nan
    """[T]; negative where time runs backwards, NaN where candidates differ."""
    stride: int | None = None
    """Steps from frame to frame; None where candidates differ."""
    omega: tuple[float, ...] = ()
    """sqrt(k/m) [1/T], not the frequency of the discrete motion; NaN for an inverted spring."""
    stiffness: tuple[float, ...] | None = None
    """[M/T2]; None where no mass is known."""
    friction: tuple[float, ...] = ()
    """Rate c/m [1/T]."""
    velocity_offset: float = math.nan
    """Time of the velocities minus that of the positions, in steps."""
    determinant: tuple[float, ...] = ()
    """Determinant of the measured map, for one step."""
    symplectic_defect: float = math.nan
    """Largest |M^T J M - J| of the measured map between frames."""
    defect_ulp: float = math.nan
    """Largest difference of a recorded frame from that of the scheme, in units of 2**-52 of the state."""
    precision: str = "unknown"
    fits: bool = False
    """Whether a known scheme and arithmetic explain every step, and all that is stated agrees."""
    undecided: bool = False
    """Whether the scheme is known, but not the arithmetic or the noise.  `fits` is False then."""
    nearest: str | None = None
    """The scheme, or if none fits that of the closest map; None if several fit."""
    difference: tuple[float, ...] = (math.nan,) * 4
    """Measured minus predicted M11, M12, M21, M22 on (q, v T) between frames, of the first oscillator."""
    notes: tuple[str, ...] = ()
    explanations: tuple[Explanation, ...] = ()
    """Causes if no scheme fits, or what is stated does not, the likeliest first."""

    def __repr__(self) -> str:
        return f"Identification({self.verdict}: {self.statement})"

    def __str__(self) -> str:
        """What the command prints."""
        return "\n".join(map(str, identification("the states", self)))

    @property
    def choice(self) -> list[str]:
        """Schemes of the candidates, each once with its numbers of steps: "rk4, 5 to 9 steps per frame"."""
        strides: dict[str, set[int]] = {}
        for x in self.candidates:
            strides.setdefault(x.scheme, set()).add(x.stride)
        return [
            name if found == {1} else f"{name}, {_ranges(sorted(found))} steps per frame"
            for name, found in strides.items()
        ]

    def noting(self, *more: str) -> Identification:
        """Copy with further remarks."""
        return replace(self, notes=(*self.notes, *more))

    def refuted(self, statement: str, *because: Explanation) -> Identification:
        """Copy without candidates, since something else made the states."""
        unknown = (math.nan,) * len(self.omega)
        return replace(
            self, verdict="none", scheme=None, aliases=(), candidates=(), fits=False, statement=statement,
            explanations=because, omega=unknown, stiffness=None, friction=unknown,
        )  # fmt: skip

    def document(self) -> dict[str, Any]:
        """As a JSON document: numbers for one oscillator, lists for several, null for unknown values."""
        return dict(_plain(asdict(self)))


def nothing(because: Sequence[Explanation], n: int = 1, **known: Any) -> Identification:
    """Identification of n oscillators without a scheme, and why."""
    unknown = (math.nan,) * n
    fields: dict[str, Any] = {"omega": unknown, "friction": unknown, "determinant": unknown, **known}
    return Identification(verdict="none", statement=because[0].cause, explanations=tuple(because), **fields)


def _ranges(strides: list[int]) -> str:
    starts = [s for s in strides if s - 1 not in strides]
    ends = [s for s in strides if s + 1 not in strides]
    return ", ".join(f"{a}" if a == b else f"{a} to {b}" for a, b in zip(starts, ends, strict=True))


SCALARS = ("omega", "stiffness", "friction", "determinant")
"""Rows that a document gives as one number where one oscillator moves."""


def _plain(x: Any, name: str = "") -> Any:
    if isinstance(x, dict):
        return {key: _plain(value, key) for key, value in x.items()}
    if isinstance(x, float):
        return x if math.isfinite(x) else None
    if isinstance(x, tuple | list):
        return _plain(x[0]) if name in SCALARS and len(x) == 1 else [_plain(y) for y in x]
    return x


HEADS = {
    "not told apart": "several schemes, which the data cannot tell apart",
    "adaptive": "adaptive solver, no fixed scheme to find",
}
"""Phrases of the report for verdicts that name no scheme."""


def headline(found: Identification) -> str:
    """The answer in one line: the name and the steps per frame, or the cause."""
    if found.explanations:
        return found.explanations[0].cause
    unsure = ", or a scheme that is not known here" if "not known here" in found.statement else ""
    if found.scheme is None:
        return HEADS[found.verdict] + unsure if found.verdict in HEADS else found.statement
    often = "" if found.stride is None else f", {count(found.stride, 'step')} per frame"
    misfit = "" if found.fits else ", but whether it fits cannot be judged"
    return f"{found.scheme}{often}{unsure}{misfit}"


def identification(label: str, found: Identification) -> Lines:
    """Format an identification as text: the answer, what to do, numbers, notes."""
    from springcheck.text.lines import hanging, plain

    style = "bold" if found.fits or found.verdict == "adaptive" else "bold red"
    several = found.candidates if len(found.candidates) > 1 else ()
    lines = textwrap.wrap(f"{label}: {headline(found)}", 80, subsequent_indent="  ", break_on_hyphens=False)
    out: Lines = [plain(line, style) for line in lines]
    for one in found.explanations[:1]:
        out += hanging("  what to do: ", one.remedy) if one.remedy else []
    for one in found.explanations[1:3]:
        out += hanging("  or: ", f"{one.cause}{f'; {one.remedy}' if one.remedy else ''}")
    if several and found.choice != [found.scheme]:
        out += hanging("  one of: ", "; ".join(found.choice))
    rows = [
        ("same map on a spring", ", ".join(found.aliases)),
        ("friction law", found.candidates[0].law if len(found.candidates) == 1 else ""),
        ("step", f"{found.step:.9g}"),
        ("angular frequency", _numbers(found.omega, [x.omega for x in several])),
        ("stiffness", _numbers(found.stiffness, [x.stiffness or () for x in several])),
        ("determinant of a step", _numbers(found.determinant, ())),
        ("defect of a step", f"{found.defect_ulp:.3g} ulp: {found.precision}"),
    ]
    for name, text in rows:
        if text and "nan" not in text:
            out += hanging(f"  {name + ':':24}", text)
    for note in found.notes:
        out += hanging("  note: ", note)
    return out


def _numbers(values: tuple[float, ...] | None, several: Sequence[tuple[float, ...]]) -> str:
    """The values of all oscillators, or the range of those (s, n) of several schemes for one oscillator."""
    if several:
        each = [f"{x:.9g}" for x in sorted(row[0] for row in several if len(row) == 1)]
        return " to ".join(dict.fromkeys([*each[:1], *each[-1:]]))
    if not values:
        return ""
    text = ", ".join(f"{x:.12g}" for x in values[:3])
    return text + (f" ... ({len(values)} oscillators)" if len(values) > 3 else "")
