"""Why no hypothesis fits: repairs, runs of bad frames, laws, the class of the map, the likeliest first."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.identify.catalogue import titles
from springcheck.identify.frames import bad_frames, changed, whose
from springcheck.identify.laws import law, of_a_solver
from springcheck.identify.measure import Map, measure
from springcheck.identify.repairs import EXCHANGED, FALLS, REPAIRS, turned
from springcheck.identify.result import Explanation
from springcheck.identify.shapes import SOLVED, accumulates, limited, not_opposite, other_times, sine, solved
from springcheck.identify.unknown import kind_of_map

if TYPE_CHECKING:
    from collections.abc import Callable

    from springcheck.identify.record import Record
    from springcheck.identify.result import Identification
    from springcheck.identify.search import Seen

MOST_PARTS = 6
"""Largest n of a friction h k/(n m) that is the mark of a mistake."""

COMPARE = "compare the order of its stages and their coefficients with the scheme's"


def drift(seen: Seen) -> Explanation:
    """A constant that is added in every frame."""
    m = next(x for x in seen.maps if x.drifts)
    back = (np.eye(2) - m.unscaled) @ m.centre.astype(float)
    size = np.abs(back) / m.size.astype(float)
    what, much = (
        ("position", back[0]) if size[0] >= size[1] else ("velocity", back[1] / float(seen.record.interval))
    )
    of = whose(seen.record, m)[4:] or "A scheme"
    cause = f"{of} with a constant added to the {what} in every frame: {float(much):.6g}"
    remedy = "look for a drift that is not the velocity's, such as a removed centre-of-mass motion"
    if what == "velocity":
        remedy = "look for a constant force, or a Jacobian by differences, which rounds to one side"
    return Explanation(cause, remedy, local=True)


def tied(m: Map) -> Explanation | None:
    """A velocity that is a multiple of the position from frame 1 on."""
    q, v = m.z[1:].astype(float).T
    slope = float(q @ v / max(q @ q, 1e-300))
    if not np.all(np.abs(v - slope * q) <= 16 * m.unit + 8 * m.noise[1:, 1]):
        return None
    if np.all(np.abs(v) <= 16 * m.unit + 8 * m.noise[1:, 1]):
        return Explanation(
            "The velocity is 0 from frame 1 on", "look at what is written as velocity", local=True
        )
    cause = "The velocity follows the position: it is a multiple of it from frame 1 on"
    return Explanation(cause, "look for a buffer that both share", local=True)


def explain(seen: Seen, again: Callable[[Record, Seen], Identification] | None) -> list[Explanation]:
    """Causes of states that no hypothesis explains; `again` identifies a repaired record."""
    record = seen.record
    worst = max(range(len(seen.maps)), key=lambda i: seen.maps[i].excess)
    m, j = seen.maps[worst], seen.moving[worst]
    level = m.excess
    clean = level <= 4 and float(np.max(np.abs(m.relative))) <= 64
    for other, said in EXCHANGED(record, j, clean):
        # one map already: exchanged, they have to be a scheme's
        if right := _repaired(other, seen, again):
            return [
                Explanation(f"{said.cause}: put right they are those of {right}", said.remedy, local=True)
            ]
    if found := turned(record, seen.moving) or tied(m):
        return [found]
    for repair in REPAIRS:
        for other, said in repair(record, j, clean):
            try:
                now = measure(other, j).excess
            except (ValueError, np.linalg.LinAlgError):
                continue
            if not clean and (now <= max(level / FALLS**2, 4) or (now < level / FALLS and now < 40)):
                return [said]
    shape = None if clean else limited(record, j) or (None if record.mixed else sine(record, j))
    if shape:
        return [shape]
    if clean and (found := _marked(seen)):
        return [found]
    if clean:
        if found := _solved(record, m):
            return [found]
        if record.fine and (solver := of_a_solver(m, m.size_left, record.jitter, clean=True)):
            return [solver]
        kind = kind_of_map(m)
        none = "One linear map explains the states, but it is none of the known schemes'"
        return [Explanation(kind or none, COMPARE)]
    stiff = None if seen.stiffness is None or record.mixed else float(seen.stiffness[j])
    found = not_opposite(record, seen.moving) or other_times(record, j, m, stiff) or accumulates(record, j)
    if found:
        return [found]
    found = changed(record, m, j) or bad_frames(record, m, j) or law(seen.maps, m, record.jitter)
    vague = not found.shown or found.cause.startswith("Noise")
    return [(_solved(record, m) if vague else None) or found]


def _solved(record: Record, m: Map) -> Explanation | None:
    """An implicit step that is solved to a tolerance."""
    return solved(m, record.jitter) if record.fine and m.size_left < SOLVED else None


def _marked(seen: Seen) -> Explanation | None:
    """A friction that is a part of h k/m: the mark of a step that is written down wrongly."""
    parts = [x for x in seen.marked if 1 <= round(x.parts[0].a / x.parts[0].g) <= MOST_PARTS]
    if not parts:
        return None
    x = parts[0]
    rate = x.parts[0].g * x.stride / abs(float(seen.record.interval))
    share = round(x.parts[0].a / x.parts[0].g)
    part = "h k/m" if share == 1 else f"h k/({share} m)"
    cause = (
        f"{titles([x.row.scheme])} with a friction c/m = {rate:.6g} that was not stated and loses as much "
        f"area as {part}: the mark of a scheme that is written down wrongly, or of an implicit one"
    )
    return Explanation(
        cause, "compare the factors 1/2 of the step with the scheme's; state the friction, if any"
    )


def _repaired(other: Record, seen: Seen, again: Callable[[Record, Seen], Identification] | None) -> str:
    """The statement on a repaired record that a scheme explains, "" where none does."""
    if again is None:
        return ""
    try:
        found = again(other, seen)
    except IdentificationError:
        return ""
    return found.statement if found.scheme and found.fits else ""
