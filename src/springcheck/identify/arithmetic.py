"""The arithmetic of a known scheme, from the defects of its single steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.identify import coarse
from springcheck.identify.coarse import EPSILON
from springcheck.identify.families import FAMILIES, substeps
from springcheck.identify.fit import LEAST_NOISE, Map
from springcheck.identify.hypothesis import SURE, Match
from springcheck.identify.maps import MapTable, power, powers, table
from springcheck.identify.record import Record
from springcheck.physics.arrays import Extended, Floats, Integers

REBUILT_NOTE = (
    "velocities carry the rounding of positions over the step: rebuilt as a difference of them, or of a "
    "stiff spring's force"
)

STORED_IN_SINGLE = {
    True: "double, stored in single", False: "single", None: "single, or double stored in single",
}  # fmt: skip
"""The arithmetic of states in single precision, by whether they were rounded once only; None if unknown."""

SINGLE = 2.0**-24
"""Unit roundoff of single precision."""

SPREAD = 16.0
"""Ratio of the largest rounding to the median of all, which is below 7 in 10**5 normal numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Defect:
    """Largest residual of a step, and the arithmetic that explains it; `precision` is "" where none does."""

    ulp: float
    precision: str
    note: str = ""
    miss: float = 0.0
    """Largest residual relative to the state; infinite where a few are far larger than all others."""
    certain: bool = True
    """Whether the arithmetic is identified, rather than an error of its size."""


def _predicted(matches: list[Match]) -> Extended:
    """The maps (c, 2, 2) between frames that matches predict."""
    return np.array([match.predicted for match in matches]).reshape(-1, 2, 2)


def _numbers(matches: list[Match], kind: type[Any]) -> tuple[MapTable, Integers, Any]:
    """Table of the matches' families, the index of each, and rows of a, g, log of the mass, stride (4, c)."""
    families = tuple(FAMILIES[x] for x in dict.fromkeys(match.family for match in matches))
    which = np.array([families.index(FAMILIES[match.family]) for match in matches])
    rows = [(match.a, match.g, match.log_mass, match.stride) for match in matches]
    return table(families), which, np.array(rows, kind).T


def _maps(
    matches: list[Match], found: Map, *, between: bool, longer: Any = 0.0, a: Any = 0.0, g: Any = 0.0
) -> Extended:
    """Predicted maps (c, 2, 2) between frames, or of one step if not `between`, with a step longer by the
    share `longer`, and a and g increased."""
    every, which, (own_a, own_g, log_mass, stride) = _numbers(matches, np.longdouble)
    own_g = own_g + g
    out = every.frame(
        which,
        (own_a + a) * (1 + longer) ** 2,
        np.where(every.held[which], own_g, own_g * (1 + longer)),
        log_mass - np.log1p(longer) + (0 if between else np.log(stride)),
        stride.astype(np.float64) if between else np.ones(len(matches)),
        found.size[1] / found.size[0] * np.ones(len(matches), np.longdouble),
    )
    return np.asarray(out.T.reshape(-1, 2, 2))


def _derivative(matches: list[Match], found: Map, name: str, *, between: bool = True) -> Extended:
    """Central-difference derivatives (c, 2, 2) of `_maps` with respect to one of its numbers."""
    d = np.array([1e-7 * (abs(match.a) if name == "a" else 1.0) for match in matches], np.longdouble)
    up, down = (_maps(matches, found, between=between, **{name: x}) for x in (d, -d))
    return np.asarray((up - down) / (2 * d)[:, None, None])


FREE = 1e6
"""Prior standard deviation of the equilibrium, in units of the residuals: it is free."""


def _refitted(
    record: Record, found: Map, matches: list[Match], signed: Floats, unit: Floats, *, numbers: bool = False
) -> Floats:
    """Residuals (c, f - 1, 2), with errors `unit`, minus the part that uncertain parameters explain: the
    interval, by the rounding of the times; the equilibrium, of which each scheme has its own; and with
    `numbers` h w and the friction of each match.

    The fit weights a pair by the size of the state, so that its error in a small component may exceed that
    component's rounding.
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
        room = SURE * np.array([getattr(match, f"{name}_error") for match in matches])
        slope = room[:, None, None] * _derivative(matches, found, name).astype(np.float64)
        columns.append(z @ np.swapaxes(slope, 1, 2))
    if not columns:
        return signed
    weight = 1 / np.maximum(unit, LEAST_NOISE * np.max(unit))
    rows = np.stack(columns, axis=-1)
    flat = (rows * weight[..., None]).reshape(len(matches), -1, len(columns))
    square = np.swapaxes(flat, 1, 2) @ flat + np.eye(len(columns))
    wanted = np.swapaxes(flat, 1, 2) @ (signed * weight).reshape(len(matches), -1, 1)
    if not np.all(np.isfinite(square)):
        return signed
    try:
        shift = np.clip(np.linalg.solve(square, wanted), -1, 1)
    except np.linalg.LinAlgError:
        # of numbers that hardly any state shows the columns are parallel to the last bit
        shift = np.clip(np.linalg.pinv(square, hermitian=True) @ wanted, -1, 1)
    return np.asarray(signed - (rows @ shift[:, None])[..., 0])


def _sums(matches: list[Match], found: Map) -> tuple[Floats, Floats]:
    """Sums (c, 2, 2) of the absolute values of all terms of a step, and those of a frame's first step
    propagated to the frame's end, in the units of `found`."""
    every, which, (a, g, log_mass, stride) = _numbers(matches, np.float64)
    step = every.sums(which, a, g)
    first = step
    if np.any(stride > 1):
        first = np.abs(power(every.unit(which, a, g), stride - 1)) @ step
    up = np.exp(-log_mass) / stride * float(found.size[1] / found.size[0])
    scale = np.ones((len(up), 2, 2))
    scale[:, 0, 1], scale[:, 1, 0] = up, 1 / up
    return step * scale, first * scale


def _unlike(record: Record, found: Map, matches: list[Match]) -> Floats:
    """Bound (c, f - 1, 2) on the effect of unequal steps within a frame, of which the times show only the
    sum.

    Step i, longer by a share d, changes the map of s steps by d M**(s - 1 - i) M' M**i.  The sum of all d is
    known; what remains is the deviation of these terms from their mean, times the rounding of a step.
    """
    one = _maps(matches, found, between=False).astype(np.float64)
    change = _derivative(matches, found, "longer", between=False).astype(np.float64)
    lengths = np.sqrt(np.sum(found.z[:-1].astype(np.float64) ** 2, axis=1))
    out = np.zeros((len(matches), len(lengths), 2))
    steps = {stride: float(record.interval) / stride for stride in {match.stride for match in matches}}
    # every time is a multiple of the step, to the last bit
    even = {s for s, h in steps.items() if np.all(np.diff(h * np.arange(len(lengths) * s + 1)) == h)}
    for i, match in enumerate(matches):
        if match.stride in even:
            continue
        ways = powers(one[i], match.stride)
        each = ways[::-1] @ change[i] @ ways
        apart = np.sum(np.abs(each - np.mean(each, axis=0)), axis=(0, 2))
        # where steps differ alike in every frame another stiffness takes a part of it, and is off by as much
        out[i] = match.stride * record.unlike * lengths[:, None] * apart
    return out


CLOCK_ROUNDINGS = 4.0
"""Roundings of a time by which a step may differ from the difference of the times: a program that steps to i
h splits the last step, or adds a tiny one, and rounds each."""


def _stepped_to(record: Record, found: Map, matches: list[Match], signed: Floats, unit: Floats) -> Floats:
    """Residuals (c, f - 1, 2), with errors `unit`, minus what `CLOCK_ROUNDINGS` of the times explain."""
    change = _derivative(matches, found, "longer").astype(np.float64)
    way = found.z[:-1].astype(np.float64) @ np.swapaxes(change, 1, 2)
    weight = way / np.maximum(unit, LEAST_NOISE * np.max(unit)) ** 2
    longer = np.sum(weight * signed, axis=2) / np.maximum(np.sum(weight * way, axis=2), 1e-300)
    room = CLOCK_ROUNDINGS * record.clock
    return np.asarray(signed - np.clip(longer, -room, room)[:, :, None] * way)


TOGETHER = 128
"""Matches that are evaluated at once, to limit the size of arrays."""


def defects(
    record: Record, j: int, found: Map, matches: list[Match], visible: Callable[[], bool]
) -> list[Defect]:
    """Defect of every step of oscillator j under each scheme, in units of double precision (2**-52).

    `visible` tells whether the scheme's truncation error is far above the defect and no other scheme has the
    same map.  Only then is a defect attributed to coarse forces, and never for the exact solution.
    """
    chunks = (matches[i : i + TOGETHER] for i in range(0, len(matches), TOGETHER))
    # numbers of a match that hardly any state shows may be none
    with np.errstate(invalid="ignore", over="ignore"):
        return [x for chunk in chunks for x in _defects(record, j, found, chunk, visible)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roundings:
    """Sizes to which the roundings of a frame are relative, and how many there are, for each match (c,)."""

    size: Floats
    """Sums (c, f - 1, 2) of the absolute values of all terms between two frames."""
    difference: Floats
    """Further terms of a velocity that is a difference of positions over the step."""
    turned: Floats
    """What the rounding of times turns (c, 1, 1), in units of double precision whatever the states have."""
    stride: Floats
    path: Floats
    usual: Floats
    """Expected roundings if they add up at random; `path` is their largest possible sum."""


def _roundings(record: Record, j: int, found: Map, matches: list[Match]) -> Roundings:
    schemes = [FAMILIES[match.family] for match in matches]
    z, centre = found.z.astype(np.float64), np.abs(found.centre / found.size).astype(np.float64)
    step, first = _sums(matches, found)
    stride = np.array([float(match.stride) for match in matches])
    # a force is that of the whole position, whose rounding it carries into the velocity
    at = centre + np.maximum(step, first) @ centre
    size = np.abs(z[:-1]) @ np.swapaxes(first, 1, 2) + np.abs(z[1:]) + 2 * at[:, None, :]
    # states between two frames lie on the same orbit: either component may be as large as the whole, and a
    # frame's last step rounds by what it adds up
    lengths = np.sqrt(np.sum(z**2, axis=1))
    later = np.abs(z[1:]) @ np.swapaxes(step, 1, 2) + (lengths[:-1] + lengths[1:])[:, None]
    size += np.where(stride > 1, 1.0, 0.0)[:, None, None] * later
    position = np.abs(z[1:, 0] + float(found.centre[0] / found.size[0]))
    if record.parts is not None:
        summed = record.summed(j)
        size += 2 * (summed[1:] + summed[:-1]) / found.size.astype(np.float64)
        position = summed[1:, 0] / float(found.size[0])
    # a solution is evaluated at times, and their rounding turns the phase
    turned = np.sqrt([abs(match.a) for match in matches]) * record.clock * stride / EPSILON
    turned = np.where([scheme.flow for scheme in schemes], turned, 0.0)[:, None, None] * np.max(lengths)
    difference = np.zeros_like(size)
    difference[:, :, 1] = 2 * (float(found.size[0] / found.size[1]) * stride)[:, None] * position
    # substeps of one force round alike
    held = [substeps(x.g, x.g_error)[0] if FAMILIES[x.family].held else range(0) for x in matches]
    parts = np.array([max(numbers, default=1) for numbers in held])
    return Roundings(
        size=size, difference=difference, turned=turned, stride=stride, usual=4 + 2 * np.sqrt(stride) * parts,
        path=stride * parts * [4 if scheme.flow else scheme.path for scheme in schemes],
    )  # fmt: skip


def _defects(
    record: Record, j: int, found: Map, matches: list[Match], visible: Callable[[], bool]
) -> list[Defect]:
    sizes = _roundings(record, j, found, matches)
    ulp, plain, signed = _in_double(record, found, matches, sizes)
    half, even = np.zeros_like(signed), np.ones_like(plain)
    stored = single = np.zeros_like(plain)
    if not record.fine:
        signed, half, stored, single, even = _in_file(record, j, found, matches, sizes, signed)
    missing = np.abs(signed)
    lengths = np.sqrt(np.sum(found.z[:-1].astype(np.float64) ** 2, axis=1))
    share = _largest(missing, np.repeat(lengths[None, :, None], 2, axis=2))
    stored_as = [record.q_storage.name, record.v_storage.name]
    short, texts = sorted({*stored_as} - {"double"}), [x for x in stored_as if x.startswith("text")]
    exact = f"the numbers happen to be exact as {' and '.join(short)}" if short else ""
    out = []
    for i, match in enumerate(matches):
        precision, note, certain = "", "", True
        if plain[i]:
            precision, note = "double", exact
        elif not stored[i] and coarse.is_rebuilt(
            match, missing[i], half[i], sizes.size[i] + sizes.turned[i], sizes.difference[i]
        ):
            precision, note = "double", REBUILT_NOTE
        elif record.fine:
            if visible() and not FAMILIES[match.family].flow:
                # forces may lie beyond the range of single precision
                with np.errstate(over="ignore", invalid="ignore"):
                    precision, note, certain = coarse.coarse_forces(record, j, found, match, signed[i])
        elif stored[i]:
            precision = " and ".join(dict.fromkeys(texts)) or STORED_IN_SINGLE[found.once]
        elif single[i]:
            # an orbit that was rounded once has no larger errors: single-precision steps are excluded
            precision = texts[0] if texts else "" if found.once else "single"
        miss = float(share[i]) if even[i] or np.any(stored) else np.inf
        out.append(Defect(ulp=float(ulp[i]), precision=precision, note=note, miss=miss, certain=certain))
    return out


def _in_double(
    record: Record, found: Map, matches: list[Match], sizes: Roundings
) -> tuple[Floats, Any, Floats]:
    """Largest residuals (c,) in ulps, whether double precision and the rounding of times explain them, and
    the residuals (c, f - 1, 2)."""
    stride, size = sizes.stride, sizes.size + sizes.turned
    unit = EPSILON * size

    def missed(deviations: Extended | None) -> Floats:
        """Each frame minus the prediction from the frame before, whose steps follow these `deviations`."""
        out = found.z[1:] - found.z[:-1] @ np.swapaxes(_predicted(matches), 1, 2)
        if deviations is not None:
            change = _derivative(matches, found, "longer")
            out = out - deviations[:, None] * (found.z[:-1] @ np.swapaxes(change, 1, 2))
        return _refitted(record, found, matches, out.astype(np.float64), unit)

    def ulps(x: Floats, slack: Floats | float = 0.0) -> Floats:
        return _largest(np.maximum(np.abs(x) - slack, 0), unit)

    signed = other = missed(found.deviations)
    ulp = ulps(signed)
    follows = np.full(len(matches), found.deviations is not None)
    if record.deviations is not None and found.deviations is None:
        # too small to show by themselves: steps may follow the clock, or its rounding may be all there is
        other = missed(record.deviations)
        follows = ulps(other) < 0.7 * ulp
        signed = np.where(follows[:, None, None], other, signed)
        ulp = ulps(signed)
    # roundings of an uneven clock follow its times
    most_ulp = np.where(follows, sizes.path, np.minimum(sizes.path, sizes.usual))
    rounded, slack = ulp, np.zeros_like(signed)
    if record.deviations is not None and np.any((stride == 1) & (ulp > most_ulp)):
        rounded = np.where(stride == 1, ulps(_stepped_to(record, found, matches, signed, size)), ulp)
    if np.any((stride > 1) & (ulp > sizes.usual)):
        slack = np.where((stride > 1)[:, None, None], _unlike(record, found, matches), 0.0)
        rounded = np.where(stride > 1, ulps(signed, slack), rounded)
    plain = rounded <= most_ulp
    if record.fine and not np.all(plain):
        for way in (signed, other)[: 1 + (other is not signed)]:
            plain |= ulps(_refitted(record, found, matches, way, unit, numbers=True), slack) <= most_ulp
    return ulp, plain, signed


def _in_file(
    record: Record, j: int, found: Map, matches: list[Match], sizes: Roundings, signed: Floats
) -> tuple[Floats, Floats, Any, Any, Any]:
    """Residuals (c, f - 1, 2), refitted under the errors of the storage format; the bound of these; whether
    they explain the residuals (c,) in double, or in single precision arithmetic; and whether these are alike
    in all steps, but for `SPREAD`."""
    b = np.abs(_predicted(matches)).astype(np.float64)
    quanta = record.quanta(j) / found.size.astype(np.float64)
    half = (quanta[1:] + quanta[:-1] @ np.swapaxes(b, 1, 2)) / 2
    signed = _refitted(record, found, matches, signed, half)
    # the map is known from rounded states that move, to a few parts in sqrt(pairs) of their rounding
    moving = np.count_nonzero(np.all(np.diff(found.z.astype(np.float64), axis=0) != 0, axis=1)) + 1
    half = (1 + 10 / np.sqrt(moving)) * half
    most = np.minimum(sizes.path, sizes.usual)[:, None, None]

    def explained(rounding: float, size: Floats) -> Any:
        return _largest(np.abs(signed), half + (rounding * size + EPSILON * sizes.turned) * most) <= 1

    # what shows roundings of single precision has none that hide, and they are in every step: in text a few
    # that are far larger than the others have another cause
    each = np.abs(signed) / (half + SINGLE * sizes.size * most)
    even = np.max(each, axis=(1, 2)) <= SPREAD * np.max(np.median(each, axis=1), axis=1)
    even |= not record.text
    single = explained(SINGLE, sizes.size) & (not record.deep) & even
    # velocities are differences of positions in some schemes alone, and their roundings are irregular
    differs = explained(SINGLE, sizes.size + sizes.difference) & ~single & (not record.deep)
    for i in np.flatnonzero(differs).tolist():
        single[i] = coarse.differences(matches[i]) and coarse.is_white(signed[i])
    return signed, half, explained(EPSILON, sizes.size), single, even


def _largest(missing: Floats, unit: Floats) -> Floats:
    return np.asarray(np.max(missing / np.maximum(unit, np.finfo(np.float64).tiny), axis=(1, 2)))
