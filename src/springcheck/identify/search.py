"""The rounds of hypotheses in order of simplicity, and what is left of them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from springcheck.identify.arithmetic import arithmetic
from springcheck.identify.catalogue import distinct
from springcheck.identify.compare import SINGLE, Freedom, Joint, compare, likely
from springcheck.identify.measure import Map
from springcheck.identify.record import Record
from springcheck.identify.repairs import turned
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats

FEW, MANY = range(1, 13), range(13, 101)
WIDTHS = float, np.float32


@dataclass(frozen=True, kw_only=True)
class Round:
    """Hypotheses that are equally simple: a group of rows, steps to a frame, and what is left open."""

    group: str
    strides: range = FEW
    scale: bool = False
    growing: bool = False
    only_stated: bool = False
    """Whether a stated stiffness has to agree: on any spring many maps are another scheme's."""
    fine_only: bool = False
    single: bool = False
    """Whether the step may be rounded to single precision, and the times not."""


ROUNDS = (
    Round(group="plain"), Round(group="friction"), Round(group="held"), Round(group="elsewhere"),
    Round(group="faults", strides=range(1, 5)), Round(group="damped elsewhere", strides=range(1, 5)),
    Round(group="plain", strides=MANY),
    Round(group="plain", single=True, fine_only=True),
    Round(group="friction", strides=range(13, 33), fine_only=True),
    Round(group="recorded", strides=range(1, 3)),
    Round(group="unequal", strides=range(1, 2), fine_only=True, only_stated=True),
    Round(group="wrong sign", strides=range(1, 3), only_stated=True),
    Round(group="parameters", strides=range(1, 2), fine_only=True),
    Round(group="friction", strides=range(1, 3), growing=True),
    Round(group="plain", strides=range(1, 4), scale=True),
    Round(group="elsewhere", strides=range(1, 2), scale=True),
)  # fmt: skip
"""The simplest first."""

WEAK = "damped elsewhere"
"""The group of two free numbers and many stages that fits some map on some spring by chance."""

STAND_TOGETHER = 4
"""Rounds whose hypotheses stand side by side in files of few digits."""

OF_DOUBLE = tuple(ROUNDS[i] for i in (0, 2, 3, 4, 1, *range(5, len(ROUNDS))))
"""The same for double precision, where a row that leaves friction open needs more than one that does not."""


@dataclass(eq=False, kw_only=True)
class Seen:
    """A record, its maps, and what is stated."""

    record: Record
    moving: list[int]
    maps: list[Map]
    stiffness: Floats | None
    friction: float | None
    stride: int | None
    notes: list[str] = field(default_factory=list)
    marked: list[Joint] = field(default_factory=list)
    """Hypotheses whose friction is the mark of a step that is written down wrongly."""

    @property
    def told(self) -> bool:
        """Whether a stiffness or a friction is stated that states can be held against."""
        known = self.stiffness is not None or self.friction is not None
        return known and self.record.mass is not None

    def ratio(self, x: Joint, i: int = 0) -> float:
        """Stiffness of an oscillator over the stated one; NaN where none is stated."""
        j, m = self.moving[i], self.record.mass
        if self.stiffness is None or m is None or not self.stiffness[j]:
            return math.nan
        return x.parts[i].a * x.stride**2 / float(self.stiffness[j] / m[j] * self.record.interval**2)

    def off(self, x: Joint) -> float:
        """Relative distance of a hypothesis' springs from the stated ones, beyond errors; 0 of none."""
        if self.stiffness is None or self.record.mass is None:
            return 0.0
        out, fine = 0.0, self.record.fine
        for j, part in zip(self.moving, x.parts, strict=True):
            k, m, h = self.stiffness[j], self.record.mass[j], float(self.record.interval) / x.stride
            if not k:
                continue
            room = 6 * part.a_error / abs(part.a) + 4 * self.record.jitter
            room += 1e-10 if fine else 1e-7 + 8 * SINGLE
            # any of the numbers may have been rounded to single precision
            ways = ((float(x(k)), float(y(m)), float(z(h))) for x in WIDTHS for y in WIDTHS for z in WIDTHS)
            out = max(out, min(abs(part.a / (y / z * w * w) - 1) for y, z, w in ways if y) - room)
        return out

    def rubs(self, x: Joint) -> float:
        """Relative distance of a hypothesis' friction from the stated one, beyond errors; 0 of none."""
        if self.friction is None or self.record.mass is None:
            return 0.0
        out = 0.0
        for j, part in zip(self.moving, x.parts, strict=True):
            h = abs(float(self.record.interval)) / x.stride
            wanted, error = self.friction / float(self.record.mass[j]) * h, 0.0
            g = 0.0
            if x.row.damped:
                g, error = part.g, 8 * part.g_error
            # friction may be implicit in v, a factor, or exponential: three rates of one map
            ways = (g, math.expm1(min(g, 50.0)), -math.expm1(-g)) if x.row.damped else (g,)
            room = error + (1e-9 + 8 * self.record.jitter) * wanted + 1e-13
            out = max(out, (min(abs(y - wanted) for y in ways) - room) / max(wanted, g, 1e-300))
        return out

    def agrees(self, x: Joint) -> bool:
        return self.off(x) <= 0 and self.rubs(x) <= 0 and self.stride in (None, x.stride)


def chosen(x: Joint) -> bool:
    """Whether a parameter is a number that somebody would choose."""
    ok = True
    for part in x.parts:
        room = 12 * part.g_error + 1e-9
        if x.row.free == "share":
            off = abs(2 * part.g - 1)
            n = 1 / off if off > 1 / 64 - room else math.inf
            whole = abs(off - 1 / round(n)) <= 2 * room if n < 1e3 and round(n) else False
            ok = ok and n < 1e3 and 2 <= round(n) <= 64 and whole
        elif x.row.free == "stages":
            ok = ok and part.g > 0 and abs(part.g - 1) > room and room < 1e-4
        elif x.row.free in ("theta", "beta"):
            near = abs(part.g * 1200 - round(part.g * 1200)) < 1200 * max(room, 1e-7)
            ok = ok and 1e-3 < part.g <= 1 and near and room < 1e-4
    return ok


def beyond(m: Map, fine: bool) -> bool:
    """Whether what one map leaves over is more than any arithmetic does."""
    if fine:
        return float(np.max(np.abs(m.left) / m.unit[:, None])) > 1e6
    w = 1 / np.hypot(m.unit / ROUNDING, np.max(m.noise[1:], 1))[:, None]
    noisy = float(np.sqrt(np.mean(m.left**2))) > 30 * float(np.sqrt(np.mean(m.noise**2)))
    return float(np.sqrt(np.mean((m.left * w) ** 2))) > 1e-4 and noisy


def marked(x: Joint) -> bool:
    """Whether the friction is a multiple of h k/m, the mark of a step that is written down wrongly."""
    return any(
        abs(n * lost / part.a - 1) < 1e-9 + 6 * part.g_error / part.g
        for part in x.parts
        for lost in (part.g, -math.expm1(-min(part.g, 50.0)), math.expm1(min(part.g, 50.0)))
        for n in (1, 2, 3, 4, 0.5)
    )


MOST_EXCESS = 1000.0
"""Largest residual of one map of states in double precision, in units of rounding, that a name may have."""

Found = list[tuple[Joint, str]]
"""Hypotheses with the arithmetic that explains each."""


def _exceeds(seen: Seen, stride: int) -> bool:
    """Whether one map leaves over more than roundings of so many steps."""
    most = MOST_EXCESS * math.sqrt(stride) + 10 * seen.record.clock / ROUNDING
    return seen.record.fine and max(m.excess for m in seen.maps) > most


def explained(seen: Seen, x: Joint) -> str:
    """The arithmetic by which every frame of every oscillator follows; "" where one does not."""
    if _exceeds(seen, x.stride):
        return ""
    found = [arithmetic(seen.record, m, part) for m, part in zip(seen.maps, x.parts, strict=True)]
    return " and ".join(dict.fromkeys(found)) if all(found) else ""


def _freedom(seen: Seen, one: Round) -> Freedom:
    record, fine, momenta = seen.record, seen.record.fine, seen.record.momenta
    rough = not fine and any(not m.stored for m in seen.maps)
    vague = (record.vague and not one.scale) or (one.single and not momenta)
    jitter = max(record.jitter, SINGLE * one.single)
    return Freedom(
        jitter=0.0 if vague else record.jitter if fine else math.hypot(record.jitter, SINGLE),
        scale=one.scale or momenta or vague, prior=jitter * vague,
        rounding=SINGLE if rough else ROUNDING, growing=one.growing,
    )  # fmt: skip


def _skipped(seen: Seen, one: Round, kept_area: bool) -> bool:
    """Whether a round has nothing to say of these states."""
    if _exceeds(seen, one.strides[-1]):
        return True
    fine, friction = seen.record.fine, one.group in ("friction", "damped elsewhere")
    out = (fine and kept_area and friction) or (one.fine_only and not fine)
    out = out or (one.scale and seen.record.momenta) or (seen.friction == 0 and friction and not one.growing)
    out = out or (one.only_stated and seen.stiffness is None)
    out = out or (one.scale and turned(seen.record, seen.moving) is not None)
    # of a stated number of steps
    many = seen.stride is not None and one.strides.start > FEW[-1] and seen.stride not in one.strides
    return (
        out or many or (seen.stride is not None and one.strides is not FEW and seen.stride not in one.strides)
    )


def _compared(seen: Seen, one: Round, kept: Found) -> list[Joint]:
    fine, free = seen.record.fine, _freedom(seen, one)
    stated = seen.stride is not None and seen.stride >= 1
    strides: Iterable[int] = [seen.stride] if stated and seen.stride else one.strides
    parts: list[Iterable[int]] = [strides]
    if fine and one.group == "friction" and one.strides is FEW and not stated:
        parts = [FEW[:4], FEW[4:]]
    joints: list[Joint] = []
    for part in parts:
        joints = joints or [x for x in compare(seen.maps, free, distinct(one.group), part) if chosen(x)]
    if one.group == "friction" and not one.growing and seen.friction is None and fine:
        seen.marked += [x for x in joints if marked(x)]
        joints = [x for x in joints if not marked(x)]
    if one.group == "friction" and not one.growing and kept:
        # friction that is not significant is none
        joints = [x for x in joints if any(p.g > 5 * p.g_error for p in x.parts)]
    if one.growing:
        joints = [x for x in joints if x.parts[0].g < -6 * (x.parts[0].g_error + 1e-13)]
    if one.scale:
        least = 1e-9
        joints = [x for x in joints if abs(x.parts[0].log_scale) > 6 * x.parts[0].scale_error + least]
    if joints and fine and one.strides.start >= MANY.start:
        # of many steps near the exact solution some scheme fits by chance
        exact = [row for row in distinct("plain") if row.scheme == "exact"]
        flow = compare(seen.maps, free, exact, range(1, 2), far=True)
        joints = joints if min((x.chi2 for x in flow), default=math.inf) > 900 else []
    return joints


def search(seen: Seen) -> tuple[Found, Round | None]:
    """Hypotheses with the arithmetic that explains each, and the round in which they were found."""
    fine = seen.record.fine
    if any(beyond(m, fine) for m in seen.maps):
        return [], None
    first: tuple[Found, Round | None] = ([], None)
    weak = first
    kept: Found = []
    kept_area = all(abs(_area(m) - 1) < 1e-12 for m in seen.maps)
    for i, one in enumerate(OF_DOUBLE if fine else ROUNDS):
        if _skipped(seen, one, kept_area):
            continue
        joints = _compared(seen, one, kept)
        good = [(x, a) for x in likely(joints) if (a := explained(seen, x))]
        if not good and (fine or i != STAND_TOGETHER - 1 or not kept):
            continue
        if not fine and i < STAND_TOGETHER:
            # few digits: hypotheses of all plain rounds stand beside each other, a number more costs 4
            kept += good
            agrees = seen.told and any(seen.agrees(x) for x, _ in kept)
            if i < STAND_TOGETHER - 1 and not agrees:
                continue
            good = kept
        agreeing = [(x, a) for x, a in good if seen.agrees(x)]
        if agreeing or not seen.told:
            return _best(agreeing or good, fine), one
        if one.group == WEAK:
            weak = weak if weak[0] else (good, one)
        elif not first[0]:
            first = good, one
    first = first if first[0] or seen.told else weak
    if kept and not first[0]:
        first = kept, ROUNDS[0]
    return _best(first[0], fine), first[1]


def _area(m: Map) -> float:
    return float(m.b[0, 0] * m.b[1, 1] - m.b[0, 1] * m.b[1, 0])


def _best(good: Found, fine: bool) -> Found:
    cost = {id(x): x.chi2 + 4 * len(x.parts) * bool(x.row.free) * (not fine) for x, _ in good}
    low = min(cost.values(), default=0.0)
    return sorted(((x, a) for x, a in good if cost[id(x)] <= low + 25), key=lambda y: y[0].simple)
