"""What the defect of single steps says of the arithmetic, once the scheme is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.identify import coarse, quantised
from springcheck.identify.coarse import QUANTUM
from springcheck.identify.families import FAMILIES, G_ROUNDING, substeps
from springcheck.identify.fit import Map
from springcheck.identify.hypothesis import SURE, Match
from springcheck.identify.maps import MapTable, power, powers, table, unit
from springcheck.identify.record import Record
from springcheck.physics.arrays import Extended, Floats, Integers

__all__ = ["QUANTUM", "Defect", "defects"]

REBUILT = 1 / 32, 1.0
"""Range of the root mean square of a rebuilt velocity's error in units of what a step adds to it."""

REBUILT_NOTE = (
    "velocities carry the rounding of positions over the step: rebuilt as a difference of them, or of a "
    "stiff spring's force"
)

STORED = "double, stored in single"
EITHER = "single, or double stored in single"
"""Where the states are too few to tell an orbit that was rounded once from one rounded in every step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """Largest residual of a step and the arithmetic that explains it.  `precision` is "" where none does."""

    ulp: float
    precision: str
    note: str = ""
    miss: float = 0.0
    """Largest residual, as a share of the state."""
    certain: bool = True
    """Whether the arithmetic itself shows, and not only an error of its size."""


def _predicted(matches: list[Match]) -> Extended:
    """The maps (c, 2, 2) between frames that matches predict."""
    return np.array([match.predicted for match in matches]).reshape(-1, 2, 2)


def _misses(matches: list[Match], found: Map, slips: Extended | None) -> Extended:
    """Difference (c, f - 1, 2) between each frame and the predicted step from the frame before, in the
    units of `found`; steps follow the clock's `slips`."""
    b = _predicted(matches)
    out = found.z[1:] - found.z[:-1] @ np.swapaxes(b, 1, 2)
    if slips is not None:
        d = np.longdouble(1e-7)
        change = (_slipped(matches, found, d) - _slipped(matches, found, -d)) / (2 * d)
        out = out - slips[:, None] * (found.z[:-1] @ np.swapaxes(change, 1, 2))
    return np.asarray(out)


FREE = 1e6
"""Multiple of the residuals by which the equilibrium may be elsewhere: the prior that leaves it free."""


def _refitted(
    record: Record, found: Map, matches: list[Match], signed: Floats, unit: Floats, *, numbers: bool = False
) -> Floats:
    """Residuals (c, f - 1, 2), of errors `unit`, less what uncertain parameters explain: the interval, by the
    rounding of the times; the equilibrium, of which each scheme has its own; and with `numbers` h w and the
    friction of each match.

    A map is read with the rounding of whole states, and so its numbers may miss more of a small component
    than that is rounded by.
    """
    b = _predicted(matches).astype(np.float64)
    z = found.z[:-1].astype(np.float64)
    columns = []
    if record.jitter > 2.0**-50:
        # velocities count in positions an interval: where that is long M12 is small, and M21 large; times
        # that began at 0 are rounded no more than a step
        change = np.stack([b[:, 0, 1, None] * z[:, 1], -b[:, 1, 0, None] * z[:, 0]], axis=2)
        columns.append(record.jitter * change)
    if np.any(found.centre != 0):
        away = np.eye(2)[:, 0] - b[:, None, :, 0]
        largest = np.max(np.abs(away), axis=(1, 2), keepdims=True)
        columns.append(FREE * np.max(np.abs(signed)) * (away / largest + 0 * signed))
    for name in ("a", "g") if numbers else ():
        errors = np.array([getattr(match, f"{name}_error") for match in matches])
        moved = 1e-7 * np.array([abs(match.a) if name == "a" else 1.0 for match in matches])
        up, down = (_slipped(matches, found, 0.0, more={name: x}) for x in (moved, -moved))
        share = SURE * errors / (2 * moved)
        slope = share[:, None, None] * (up - down).astype(np.float64)
        columns.append(z @ np.swapaxes(slope, 1, 2))
    if not columns:
        return signed
    weight = 1 / np.maximum(unit, 1e-30 * np.max(unit))
    rows = np.stack(columns, axis=-1)
    flat = (rows * weight[..., None]).reshape(len(matches), -1, len(columns))
    square = np.swapaxes(flat, 1, 2) @ flat + np.eye(len(columns))
    wanted = np.swapaxes(flat, 1, 2) @ (signed * weight).reshape(len(matches), -1, 1)
    shift = np.clip(np.linalg.solve(square, wanted), -1, 1)
    return np.asarray(signed - (rows @ shift[:, None])[..., 0])


def _numbers(matches: list[Match], kind: type[Any]) -> tuple[MapTable, Integers, Any]:
    """The table of the matches' families, the number of each one's, and a, g, log of the mass and strides."""
    families = tuple(FAMILIES[x] for x in dict.fromkeys(match.family for match in matches))
    which = np.array([families.index(FAMILIES[match.family]) for match in matches])
    rows = [(match.a, match.g, match.log_mass, match.stride) for match in matches]
    return table(families), which, np.array(rows, kind).T


def _slipped(
    matches: list[Match],
    found: Map,
    slip: np.longdouble | float,
    *,
    between: bool = True,
    more: dict[str, Floats] | None = None,
) -> Extended:
    """The maps (c, 2, 2) that matches predict `between` frames, or for one step, for steps longer by the
    share `slip`, and for `more` of a or g."""
    every, which, (a, g, log_mass, stride) = _numbers(matches, np.longdouble)
    a, g = (x + (more or {}).get(name, 0.0) for name, x in (("a", a), ("g", g)))
    held = every.held[which]
    out = every.frame(
        which,
        a * (1 + slip) ** 2,
        np.where(held, g, g * (1 + slip)),
        log_mass - np.log1p(slip) + (0 if between else np.log(stride)),
        stride.astype(np.float64) if between else np.ones(len(matches)),
        found.size[1] / found.size[0] * np.ones(len(matches), np.longdouble),
    )
    return np.asarray(out.T.reshape(-1, 2, 2))


def _sums(matches: list[Match], found: Map) -> tuple[Floats, Floats]:
    """Sums (c, 2, 2) of the sizes of all that a step adds up, and what a frame's first step adds up to at
    its end, in the frame of `found`."""
    every, which, (a, g, log_mass, stride) = _numbers(matches, np.float64)
    step = every.sums(which, a, g)
    first = step
    if np.any(stride > 1):
        first = np.abs(power(every.unit(which, a, g), stride - 1)) @ step
    up = np.exp(-log_mass) / stride * float(found.size[1] / found.size[0])
    scale = np.ones((len(up), 2, 2))
    scale[:, 0, 1], scale[:, 1, 0] = up, 1 / up
    return step * scale, first * scale


def _substeps(match: Match) -> int:
    """Substeps of a step whose force is held, 1 of any other."""
    if not FAMILIES[match.family].held:
        return 1
    return max(substeps(match.g, match.g_error + G_ROUNDING)[0], default=1)


def _unlike(record: Record, found: Map, matches: list[Match]) -> Floats:
    """Bound (c, f - 1, 2) of the effect on a frame of steps of unlike length, of which the clock shows the
    sum.

    A step that is longer by the share d does d M**(s - 1 - i) M' M**i to the map of s steps; what the steps'
    sum does is known, so the departures of these from their mean are left, times the rounding of a step.
    """
    d = 1e-6
    one = _slipped(matches, found, 0.0, between=False).astype(np.float64)
    change = _slipped(matches, found, d, between=False) - _slipped(matches, found, -d, between=False)
    lengths = np.sqrt(np.sum(found.z[:-1].astype(np.float64) ** 2, axis=1))
    out = np.zeros((len(matches), len(lengths), 2))
    steps = {stride: float(record.interval) / stride for stride in {match.stride for match in matches}}
    # every time is a multiple of the step, to the last bit
    even = {s for s, h in steps.items() if np.all(np.diff(h * np.arange(len(lengths) * s + 1)) == h)}
    for i, match in enumerate(matches):
        if match.stride in even:
            continue
        ways = powers(one[i], match.stride).astype(np.float64)
        each = ways[::-1] @ (change[i] / (2 * d)).astype(np.float64) @ ways
        apart = np.sum(np.abs(each - np.mean(each, axis=0)), axis=(0, 2))
        # where steps differ alike in every frame another stiffness takes a part of it, and is off by as much
        out[i] = match.stride * record.clock * lengths[:, None] * apart
    return out


CLOCK_ROUNDINGS = 4.0
"""Roundings of a time by which each step may be longer or shorter than the times show: a program that steps
to i h halves the last step, or adds one of a rounding, and its clock rounds each of them."""


def _stepped_to(record: Record, found: Map, matches: list[Match], signed: Floats, unit: Floats) -> Floats:
    """Residuals (c, f - 1, 2), of errors `unit`, less the part that rounding of the clock explains."""
    d = 1e-6
    change = _slipped(matches, found, d) - _slipped(matches, found, -d)
    way = found.z[:-1].astype(np.float64) @ np.swapaxes(change.astype(np.float64) / (2 * d), 1, 2)
    weight = way / np.maximum(unit, 1e-30 * np.max(unit)) ** 2
    longer = np.sum(weight * signed, axis=2) / np.maximum(np.sum(weight * way, axis=2), 1e-300)
    room = CLOCK_ROUNDINGS * record.clock
    return np.asarray(signed - np.clip(longer, -room, room)[:, :, None] * way)


TOGETHER = 128
"""Matches whose defects are worked out at once, so that their arrays stay small."""


def defects(
    record: Record, j: int, found: Map, matches: list[Match], visible: Callable[[], bool]
) -> list[Defect]:
    """Defect of every step of oscillator j against each scheme, in units of double precision (2**-52).

    `visible` says that the scheme's own error stands far above the defect, and no other scheme has it;
    only then is more than plain rounding explained, and never to an exact flow.
    """
    chunks = (matches[i : i + TOGETHER] for i in range(0, len(matches), TOGETHER))
    # numbers of a match that hardly any state shows may be none
    with np.errstate(invalid="ignore"):
        return [x for chunk in chunks for x in _defects(record, j, found, chunk, visible)]


def _defects(
    record: Record, j: int, found: Map, matches: list[Match], visible: Callable[[], bool]
) -> list[Defect]:
    schemes = [FAMILIES[match.family] for match in matches]
    z, centre = found.z.astype(np.float64), np.abs(found.centre / found.size).astype(np.float64)
    b = np.abs(_predicted(matches)).astype(np.float64)
    step, first = _sums(matches, found)
    stride = np.array([float(match.stride) for match in matches])
    # a force is that of the whole position, whose rounding it carries into the velocity
    at = centre + np.maximum(step, first) @ centre
    # sums of absolute values: a rounding of either term is relative to them
    size = np.abs(z[:-1]) @ np.swapaxes(first, 1, 2) + np.abs(z[1:]) + 2 * at[:, None, :]
    # states between two frames lie on the same orbit: either component may be as large as the whole, and a
    # frame's last step rounds by what it adds up
    lengths = np.sqrt(np.sum(z**2, axis=1))
    later = np.abs(z[1:]) @ np.swapaxes(step, 1, 2) + (lengths[:-1] + lengths[1:])[:, None]
    size += np.where(stride > 1, 1.0, 0.0)[:, None, None] * later
    # a solution is evaluated at times, and their rounding turns the phase
    turned = np.sqrt([abs(match.a) for match in matches]) * record.clock * stride / 2.0**-52
    flow = np.array([scheme.flow for scheme in schemes])
    size += np.where(flow, turned, 0.0)[:, None, None] * np.max(lengths)
    position = np.abs(z[1:, 0] + float(found.centre[0] / found.size[0]))
    if record.parts is not None:
        summed = np.stack(
            [record.parts[0][:, j], record.parts[1][:, j] * abs(float(record.interval))], axis=1
        )
        size += 2 * (summed[1:] + summed[:-1]) / found.size.astype(np.float64)
        position = summed[1:, 0] / float(found.size[0])
    # a velocity that is a difference of positions over the step carries their rounding, eps q / h
    ratio = float(found.size[0] / found.size[1]) * stride
    difference = np.zeros_like(size)
    difference[:, :, 1] = 2 * ratio[:, None] * position
    # substeps of one force round alike
    parts = np.array([_substeps(match) for match in matches])
    path = stride * parts * [4 if scheme.flow else scheme.path for scheme in schemes]

    def missed(slips: Extended | None) -> Floats:
        signed = _misses(matches, found, slips).astype(np.float64)
        return _refitted(record, found, matches, signed, 2.0**-52 * size)

    def ulps(x: Floats, slack: Floats | float = 0.0) -> Floats:
        return _largest(np.maximum(np.abs(x) - slack, 0), 2.0**-52 * size)

    signed = other = missed(found.slips)
    ulp = ulps(signed)
    follows = np.full(len(matches), found.slips is not None)
    if record.slips is not None and found.slips is None:
        # too small to show by themselves: steps may follow the clock, or its rounding may be all there is
        other = missed(record.slips)
        follows = ulps(other) < 0.7 * ulp
        signed = np.where(follows[:, None, None], other, signed)
        ulp = ulps(signed)
    missing = np.abs(signed)
    # what rounds at random stays far below the sum of all roundings; what comes near it must stand out
    usual = 4 + 2 * np.sqrt(stride) * parts
    # those of an uneven clock follow its times
    most_ulp = np.where(follows, path, np.minimum(path, usual))
    rounded, slack = ulp, np.zeros_like(missing)
    if record.slips is not None and np.any((stride == 1) & (ulp > most_ulp)):
        rounded = np.where(stride == 1, ulps(_stepped_to(record, found, matches, signed, size)), ulp)
    if np.any((stride > 1) & (ulp > usual)):
        slack = np.where((stride > 1)[:, None, None], _unlike(record, found, matches), 0.0)
        rounded = np.where(stride > 1, ulps(signed, slack), rounded)
    plain = rounded <= most_ulp
    if record.fine and not np.all(plain):
        for way in (signed, other)[: 1 + (other is not signed)]:
            again = _refitted(record, found, matches, way, 2.0**-52 * size, numbers=True)
            plain |= ulps(again, slack) <= most_ulp
    stored = coarse_file = np.zeros(len(matches), dtype=bool)
    if not record.fine:
        quanta = record.quanta(j) / found.size.astype(np.float64)
        half = (quanta[1:] + quanta[:-1] @ np.swapaxes(b, 1, 2)) / 2
        signed = _refitted(record, found, matches, signed, half)
        missing = np.abs(signed)
        # roundings of many steps are random
        most = np.minimum(path, usual)[:, None, None]
        # the map is known from rounded states that move, to a few parts in sqrt(pairs) of their rounding
        moving = np.count_nonzero(np.all(np.diff(z, axis=0) != 0, axis=1)) + 1
        half = (1 + 10 / np.sqrt(moving)) * half
        stored = _largest(missing, half + 2.0**-52 * size * most) <= 1
        coarse_file = _largest(missing, half + 2.0**-24 * size * most) <= 1
        # velocities are differences of positions in some schemes alone, and their roundings are irregular
        differs = _largest(missing, half + 2.0**-24 * (size + difference) * most) <= 1
        # what shows roundings of single precision has none that hide
        coarse_file &= not record.deep
        for i in np.flatnonzero(differs & ~coarse_file & (not record.deep)).tolist():
            coarse_file[i] = _differences(matches[i]) and coarse.irregular(signed[i])
    share = _largest(missing, np.repeat(lengths[None, :-1, None], 2, axis=2))
    out = []
    for i, match in enumerate(matches):
        precision, note, certain = "", "", True
        if plain[i]:
            precision, note = "double", _written(record)
        elif _is_rebuilt(match, missing[i], size[i], difference[i]):
            precision = "double"
            note = REBUILT_NOTE
        elif record.fine:
            if visible() and not schemes[i].flow:
                # forces may lie beyond the range of single precision
                with np.errstate(over="ignore", invalid="ignore"):
                    precision, note, certain = _coarse(record, j, found, match, signed[i])
        elif stored[i]:
            precision = _stored(record, found)
        elif coarse_file[i]:
            texts = [s.name for s in (record.q_storage, record.v_storage) if s.name.startswith("text")]
            # an orbit that was rounded once has no larger errors: single-precision steps are excluded
            precision = texts[0] if texts else "" if found.once else "single"
        miss = float(share[i])
        out.append(Defect(ulp=float(ulp[i]), precision=precision, note=note, miss=miss, certain=certain))
    return out


def _coarse(record: Record, j: int, found: Map, match: Match, signed: Floats) -> tuple[str, str, bool]:
    """Precision of coarse forces, a note, and whether it is certain; "" where none explains the misses."""
    name, note = coarse.sized(record, j, found, match, signed)
    names = quantised.FORCES if name == "mixed" else [name] if name else []
    for each in names:
        if quantised.reproduced(record, j, found, match, each, coarse.QUANTUM, coarse.EXCESS):
            return each, "states are double, and the steps redone with such forces are those recorded", True
    seen = coarse.kinematic(record, j, found, match)
    if seen is not None:
        return *seen, record.mass is not None
    return (name, note, False) if name and coarse.white(found, match, signed) else ("", "", True)


def _is_rebuilt(match: Match, missing: Floats, size: Floats, difference: Floats) -> bool:
    """Whether velocities alone are off, and by eps q / h, as differences of positions over the step are.

    Rounding of a position enters the leapfrog's velocity in every step, and the position itself through it:
    it walks at random, with the root of the steps and their power of 3/2.
    """
    steps = np.sqrt(match.stride)
    if np.any(missing[:, 0] > 2.0**-52 * (4 + 2 * steps**3) * size[:, 0]):
        return False
    unit = 2.0**-52 * steps * difference[:, 1]
    if np.any(missing[:, 1] > 2.0**-52 * (4 + 2 * steps) * size[:, 1] + 4 * unit):
        return False
    least, most = REBUILT
    share = float(np.sqrt(np.mean(missing[:, 1] ** 2) / np.mean(unit**2)))
    return least <= share <= most and _differences(match)


def _differences(match: Match) -> bool:
    """Whether the velocity may be a difference of positions: their mean difference, as Stoermer's are, or
    that of the step, where the position is moved by the new velocity."""
    if match.scheme in coarse.STOERMER:
        return True
    (q, v), (x, u) = unit(FAMILIES[match.family], np.array([match.a]), np.array([match.g]))[0]
    return bool(abs(q - x - 1) < G_ROUNDING and abs(v - u) < G_ROUNDING)


def _largest(missing: Floats, unit: Floats) -> Floats:
    return np.asarray(np.max(missing / np.maximum(unit, np.finfo(np.float64).tiny), axis=(1, 2)))


def _written(record: Record) -> str:
    short = {s.name for s in (record.q_storage, record.v_storage)} - {"double"}
    return f"the numbers happen to be exact as {' and '.join(sorted(short))}" if short else ""


def _stored(record: Record, found: Map) -> str:
    """The storage's name; for single precision, whether the arithmetic was finer than the file."""
    texts = [s.name for s in (record.q_storage, record.v_storage) if s.name.startswith("text")]
    if texts:
        return texts[0] if len(set(texts)) == 1 else " and ".join(dict.fromkeys(texts))
    return {True: STORED, False: "single", None: EITHER}[found.once]
