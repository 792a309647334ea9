"""What a factor means: numbers that people mix up, as a table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from springcheck.identify.compare import Joint

if TYPE_CHECKING:
    from springcheck.identify.search import Seen

UNITS: tuple[tuple[float, str], ...] = (
    (math.degrees(1), "degrees are taken for radians"),
    (10.180505710759414, "1 unit of time of ASE is 10.1805 fs"),
    (48.88821290839616, "1 unit of time of CHARMM (AKMA) is 48.888 fs"),
    (20.455, "1 unit of time of AMBER is 1/20.455 ps"),
    (4.184, "kcal and kJ are mixed up"), (math.sqrt(4.184), "kcal and kJ are mixed up"),
    (2 * math.pi, "a factor 2 pi, as of a frequency and an angular frequency"), (2.0, "a factor 2"),
    *((10.0**n, f"a factor {10.0**n:g}, as of another unit") for n in (1, 2, 3, 4, 6)),
)  # fmt: skip
"""Known factors, either way."""


def meaning(factor: float, room: float = 1e-6) -> str:
    """What a factor means, "" where nothing."""
    ways = ((text, y) for x, text in UNITS for y in (x, 1 / x))
    return next((text for text, y in ways if abs(factor / y - 1) <= room), "")


def of_stiffness(seen: Seen, x: Joint) -> str:
    """What the ratio of a hypothesis' stiffness to the stated one means, "" where nothing."""
    ratio, j = seen.ratio(x), seen.moving[0]
    if seen.stiffness is None or seen.record.mass is None or math.isnan(ratio):
        return ""
    m, k = float(seen.record.mass[j]), float(seen.stiffness[j])
    if ratio < 0:
        return "the force has the wrong sign"
    part = x.parts[0]
    room = 1e-6 + 6 * part.a_error / abs(part.a) + 2 * seen.record.jitter
    if abs(ratio - 1) <= 10 * room:
        return ""
    rows = (
        (1 / 4.184, "kcal taken for kJ"), (4.184, "kJ taken for kcal"),
        (2.0, "k q**2 taken for k/2 q**2"), (0.5, "k/2 q**2 taken for k q**2"),
        *((10.0**n, "another unit of length or energy") for n in (-6, -4, -3, -2, -1, 1, 2, 3, 4, 6)),
        (1 / m, "the force is divided by the mass although p is a momentum"), (m, "the mass is left out"),
        (1 / k, "the stiffness is left out"), (k, "the stiffness is squared"),
        ((m / k) ** 2, "mass and stiffness are exchanged"),
        (math.radians(1), "the force takes positions for degrees"),
    )  # fmt: skip
    return ", or ".join(dict.fromkeys(text for value, text in rows if abs(ratio / value - 1) < room))


BY_CHANCE = (6, 7, 9)
"""Rows of `of_velocities` whose factors may be equal by chance."""


def of_velocities(seen: Seen, x: Joint) -> str:
    """What a scale of the velocities means, recorded over true ones, "" where nothing."""
    part, record = x.parts[0], seen.record
    scale, stiffer = math.exp(part.log_scale), seen.ratio(x)
    m = float(record.mass[seen.moving[0]]) if record.mass is not None else math.nan
    h = abs(float(record.interval)) / x.stride
    room = 1e-6 + 6 * (part.scale_error + part.a_error / abs(part.a)) + record.jitter
    free = math.isnan(stiffer)

    def near(a: float, b: float) -> bool:
        return abs(a / b - 1) <= room

    steps = f"times are {scale:.6g} times what was stepped: the step taken is {1 / scale:.6g} times theirs"
    of_time = meaning(scale, room)
    rows = (
        (near(scale, 1 / m) and (free or near(stiffer, m)),
         "the mass is left out where the position moves: dq/dt = p"),
        (near(scale, 1 / m) and (free or near(stiffer, 1)), "the momentum is treated as a velocity"),
        (near(scale, m) and (free or near(stiffer, 1)),
         "velocities are momenta: they are multiplied by the mass"),
        (near(scale, m) and not free and near(stiffer, 1 / m), "the mass divides twice"),
        (near(scale, h * h),
         f"velocities would have to be {h**-2:.6g} times as large: the position moves by v / h, not by h v"),
        (near(scale, 1 / h**2), "a factor h**2: the step enters twice"),
        (near(scale, h), "velocities are divided by 1/h: they are displacements"),
        (near(scale, 1 / h), "the position moves by v, not by h v: divided by the step"),
        (not free and abs(scale - 1) > 1e-2 and near(stiffer, scale**-2),
         steps + (f" ({of_time})" if of_time else "")),
        (bool(of_time), f"velocities are {scale:.6g} times what they should be: {of_time}"),
    )  # fmt: skip
    found = [(i, text) for i, (is_so, text) in enumerate(rows) if is_so]
    # a step that happens to be a power of ten is one of two causes
    either = [text for i, text in found if i in BY_CHANCE]
    return "; or ".join(either) if found and found[0][0] in BY_CHANCE else found[0][1] if found else ""
