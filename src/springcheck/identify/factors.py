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


def of_velocities(seen: Seen, x: Joint) -> str:
    """What a scale of the velocities means, recorded over true ones, "" where nothing."""
    part, record = x.parts[0], seen.record
    scale, stiffer = math.exp(part.log_scale), seen.ratio(x)
    m = float(record.mass[seen.moving[0]]) if record.mass is not None else math.nan
    h = abs(float(record.interval)) / x.stride
    room = 1e-6 + 6 * (part.scale_error + part.a_error / abs(part.a)) + record.jitter

    def near(size: float, stiffness: float, *, stated: bool = False) -> bool:
        """Whether scale and stiffness are these; any where none is stated, but for `stated`."""
        other = not stated if math.isnan(stiffer) else abs(stiffer / stiffness - 1) <= room
        return abs(scale / size - 1) <= room and other

    steps = f"times are {scale:.6g} times what was stepped: the step taken is {1 / scale:.6g} times theirs"
    of_time = meaning(scale, room)
    # of a step that is a power of ten, its powers are factors of a unit by chance
    rows = (
        (near(1 / m, m), "the mass is left out where the position moves: dq/dt = p", False),
        (near(1 / m, 1), "the momentum is treated as a velocity", False),
        (near(m, 1), "velocities are momenta: they are multiplied by the mass", False),
        (near(m, 1 / m, stated=True), "the mass divides twice", False),
        (abs(scale - 1) > 1e-3 and near(scale, 1 / scale, stated=True) and not near(h**2, h**-2)
         and not near(h, 1 / h) and not near(1 / h, h),
         f"the position is moved by p / {scale * m:.6g}, where the mass is {m:.6g}", False),
        (near(h**2, h**-4, stated=True),
         "position and momentum move by v / h and F / h, not by h v and h F: divided by the step", False),
        (near(h**2, h**-2), "the position moves by v / h, not by h v: divided by the step", False),
        (near(h, h**-2, stated=True),
         "position and momentum move by v and F, not by h v and h F: the step is left out", False),
        (near(h, 1 / h, stated=True), "the position moves by v, not by h v: the step is left out", False),
        (near(1 / h, h, stated=True), "the position moves by h**2 v: the step enters twice", False),
        (near(h, 1), "velocities are multiplied by the step: they are displacements", True),
        (near(1 / h, 1), "velocities are divided by the step", True),
        (near(scale, scale**-2, stated=True) and abs(scale - 1) > 1e-2,
         steps + (f" ({of_time})" if of_time else ""), False),
        (bool(of_time), f"velocities are {scale:.6g} times what they should be: {of_time}", True),
    )  # fmt: skip
    found = [(text, by_chance) for is_so, text, by_chance in rows if is_so]
    if found and found[0][1]:
        return "; or ".join(text for text, by_chance in found if by_chance)
    return found[0][0] if found else ""
