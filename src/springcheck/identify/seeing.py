"""A record measured: its oscillators, their maps, and what is stated of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from springcheck.identify.modes import oscillators
from springcheck.identify.record import Record, of_size, strides_of
from springcheck.identify.search import Seen


def see(record: Record, stiffness: Any, friction: float | None, step: float | None) -> Seen:
    """The oscillators of a record, measured, and what is stated of them.  Raises IdentificationError."""
    stiff = of_size("stiffness", stiffness, record.q.shape[1], zero=True)
    of_size("friction", friction, zero=True)
    stride, remarks = strides_of(record, step)
    if stiff is not None and record.mass is not None and (factor := bond(record)) is not None:
        stiff = stiff * factor
        remarks.append(
            "the two halves of the coordinates are two particles bound to each other, at rest as a whole: "
            "the stated stiffness is taken for that of the bond"
        )
    of, moving, maps, notes = oscillators(record)
    asked = {"stiffness": stiffness is not None and not record.momenta, "friction": bool(friction)}
    names = " and ".join(name for name, is_so in asked.items() if is_so and record.mass is None)
    remarks += [f"the stated {names} could not be compared: give the mass as well"] if names else []
    return Seen(
        record=of, moving=moving, maps=maps, stiffness=stiff if of is record else None, friction=friction,
        stride=stride, notes=[*notes, *remarks],
    )  # fmt: skip


def bond(record: Record) -> Any:
    """k m/mu over k of each coordinate (n,) of two particles bound to each other, at rest as a whole; None of
    other motions."""
    each, half = record.moving, len(record.moving) // 2
    if record.mass is None or len(each) % 2 or not half:
        return None
    p = (record.v * record.mass).astype(float)[:, each]
    if np.max(np.abs(p[:, :half] + p[:, half:])) > 1e-6 * np.max(np.abs(p)):
        return None
    m = record.mass[each]
    alike = np.ptp(m[:half]) == np.ptp(m[half:]) == 0
    return record.mass * (1 / m[0] + 1 / m[half]) if alike else None
