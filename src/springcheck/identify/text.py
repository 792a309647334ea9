"""What a trajectory says of the scheme that made it, as text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np

from springcheck.identify.result import Identification
from springcheck.text.lines import Lines, hanging, plain

IDENTIFIED = {
    "not told apart": "several schemes, which the data cannot tell apart",
    "adaptive": "adaptive solver, no fixed scheme to find",
}
"""What is said where no scheme is named."""


def identification(label: str, found: Identification) -> Lines:
    """What a trajectory says of the scheme that made it."""
    style = "bold" if found.fits or found.verdict == "adaptive" else "bold red"
    recorded = "" if found.stride in (None, 1) else f", {found.stride} steps from frame to frame"
    several = found.candidates if len(found.candidates) > 1 else ()
    rows = [
        ("same map on a spring", ", ".join(found.aliases)),
        ("friction law", found.candidates[0].law if len(found.candidates) == 1 else ""),
        ("step", f"{found.step:.9g}{recorded}"),
        ("angular frequency", _numbers(found.omega) if not several else _range([x.omega for x in several])),
        (
            "stiffness",
            _numbers(found.stiffness) if not several else _range([x.stiffness or () for x in several]),
        ),
        ("velocities", _offset(found.velocity_offset)),
        ("determinant of a step", _numbers(found.determinant)),
        ("symplectic defect", f"{found.symplectic_defect:.1e}"),
        ("defect of a step", f"{found.defect_ulp:.3g} ulp: {found.precision}"),
    ]
    unfit = found.candidates and not (found.fits or found.undecided)
    misfit = ", but what is stated does not fit" if unfit else ""
    if found.undecided and found.scheme:
        misfit = ", but whether it fits cannot be judged"
    said = IDENTIFIED.get(found.verdict, found.scheme)
    if found.explanations:
        # the diagnosis is the headline, and what to do stands below it
        said, misfit = found.explanations[0].cause, ""
    first = textwrap.wrap(f"{label}: {said}{misfit}", 80, subsequent_indent="  ", break_on_hyphens=False)
    out: Lines = [plain(line, style) for line in first]
    for one in found.explanations[:1]:
        out += hanging("  what to do: ", one.remedy)
    for one in found.explanations[1:3]:
        out += hanging("  or: ", f"{one.cause}; {one.remedy}")
    if several:
        out += hanging("  one of: ", "; ".join(found.choice))
    for name, text in rows:
        if text and "nan" not in text:
            out += hanging(f"  {name + ':':24}", text)
    notes = [found.statement, *found.notes] if found.undecided else found.notes
    for note in notes:
        out += hanging("  note: ", note)
    return out


def _numbers(values: tuple[float, ...] | None) -> str:
    if not values:
        return ""
    text = ", ".join(f"{x:.12g}" for x in values[:3])
    return text + (f" ... ({len(values)} oscillators)" if len(values) > 3 else "")


def _range(rows: Sequence[tuple[float, ...]]) -> str:
    """The values (s, n) that several schemes give one oscillator, from the least to the largest."""
    values = [f"{x:.9g}" for x in sorted(row[0] for row in rows if len(row) == 1)]
    ends = list(dict.fromkeys([values[0], values[-1]] if values else []))
    return " to ".join(ends)


def _offset(steps: float) -> str:
    if np.isnan(steps):
        return ""
    if steps == 0:
        return "synchronised with the positions"
    return f"{abs(steps):g} of a step {'early' if steps < 0 else 'late'}"
