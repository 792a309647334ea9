"""The oscillators of a record that can be judged: coordinates, or normal modes if these are coupled.

The blocks of every scheme's one-step matrix are functions of the springs' matrix, and share its eigenvectors,
along which each mode moves by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify.evidence import FALLS, FIXED, LEFT_BY_ROUNDING, SPARE, Measured
from springcheck.identify.fit import FLOOR, Map, fit, of_pairs
from springcheck.identify.hypothesis import SURE
from springcheck.identify.maps import powers
from springcheck.identify.noise import least_squares
from springcheck.identify.record import AT_REST, Record, stated
from springcheck.identify.search import terms_of
from springcheck.identify.storage import ROUNDING
from springcheck.identify.together import distance
from springcheck.physics.arrays import Extended, Floats


def judged(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> Measured:
    """Select the oscillators that can be judged, and check stated numbers.  Raises IdentificationError."""
    stiff, stride, remarks = stated(record, stiffness, friction, step)
    if step is not None and stride is not None and stride > 0 and record.vague:
        # momenta of an unknown mass show no interval that could be another
        jitter = 0.0 if record.momenta else record.jitter
        record = replace(record, interval=stride * np.longdouble(step), jitter=jitter)
    of, moving, maps, notes = _oscillators(record)
    if of is not record:
        stiff = None
    notes += remarks
    if of.momenta and stiff is None:
        notes.append(
            "neither mass nor velocities nor stiffness are known, so only three numbers of each map count: "
            "velocity and position Verlet, implicit midpoint and the exact flow look alike; give the mass"
        )
    if record.mass is None:
        asked = {"stiffness": stiffness is not None and not of.momenta, "friction": bool(friction)}
        names = " and ".join(name for name, is_so in asked.items() if is_so)
        notes += [f"the stated {names} could not be compared: give the mass as well"] if names else []
    return Measured(
        record=of, moving=moving, maps=maps, terms=[terms_of(of, j, stiff) for j in moving],
        stiffness=stiff, friction=friction, stride=stride, notes=tuple(notes),
    )  # fmt: skip


def _oscillators(record: Record) -> tuple[Record, list[int], list[Map], list[str]]:
    """Record of the oscillators that can be judged, of normal modes where these replace coordinates; their
    indices; their maps; and notes on the rest."""
    if not (moving := record.moving):
        raise IdentificationError(AT_REST)
    n = record.q.shape[1]
    notes = [f"{n - len(moving)} of {n} oscillators are at rest and left out"] if len(moving) < n else []
    free = [j for j in moving if _straight(record, j)]
    falls = [j for j in moving if j not in free and _falls(record, j)]
    maps = {j: fit(record, j) for j in moving if j not in (*free, *falls)}
    if len(maps) > 1 and (modes := _uncoupled(record, maps)) is not None:
        kept = {i: fit(modes, i) for i in range(modes.q.shape[1]) if not _straight(modes, i)}
        good = [i for i, found in kept.items() if found.conditioned and _forced(found)]
        # what no springs couple, as a field that turns velocities, has modes that are not alone either
        if good and not any(found.spans and not found.conditioned for found in kept.values()):
            whose = f"{modes.q.shape[1]} normal modes were judged instead of them"
            notes.append(f"the coordinates are coupled, and their {whose}")
            return modes, good, [kept[i] for i in good], notes
    good = [j for j, found in maps.items() if found.conditioned and _forced(found)]
    lost = [j for j in maps if j not in good]
    rough = [j for j in lost if maps[j].spans and not (maps[j].conditioned and maps[j].clean)]
    if rough:
        # the states span the plane, and what one map leaves over is larger than rounding: that has a cause,
        # whatever moves beside it
        every = [*rough, *good]
        return record, every, [maps[j] for j in every], notes
    if not good:
        if (lost and maps[lost[0]].conditioned) or not lost:
            if lost:
                why = f"velocities of oscillator {lost[0]} do not depend on its positions beyond their digits"
                raise IdentificationError(f"the {why}")
            if falls:
                why = f"oscillator {falls[0]} but a constant one, by which few schemes can be told apart"
                raise IdentificationError(f"no force acts on {why}: record a motion on a spring")
            raise IdentificationError(
                f"no force acts on oscillator {free[0]}: every scheme moves it in a straight line"
            )
        if proportion := _proportional(record, lost[0]):
            raise IdentificationError(f"the velocities of oscillator {lost[0]} {proportion}")
        raise IdentificationError(
            f"the states of oscillator {lost[0]} do not span its plane (a standing state, or whole or half "
            "periods between frames, or an arc shorter than the rounding): record more of the motion"
        )
    if free:
        notes.append(f"{_names(free)} moves freely, in a straight line as by every scheme, and is left out")
    if falls:
        notes.append(f"{_names(falls)} moves by a constant force alone, and is left out")
    if lost:
        notes.append(f"{_names(lost)} shows too little of its motion to be judged, and is left out")
    return record, good, [maps[j] for j in good], notes


ALIKE = 1e-9
"""Relative difference up to which velocities are a multiple of the positions."""


FEWEST_OF_A_FALL = 8
"""Frames that a constant acceleration explains by more than its own three numbers."""


def _proportional(record: Record, j: int) -> str:
    """Message for velocities that are constant or proportional to the positions, on an arc well above
    rounding; "" where they are not."""
    q, v = (x[:, j].astype(np.float64) for x in (record.q, record.v))
    q, v = q - np.mean(q), v - np.mean(v)
    size = float(np.max(np.abs(q)))
    coarse = max(float(np.max(record.q_quantum[:, j])), ROUNDING * float(np.max(np.abs(record.q[:, j]))))
    if size * ALIKE < coarse or not size:
        return ""
    slope = float(q @ v / (q @ q))
    if np.max(np.abs(v)) * abs(float(record.interval)) <= ALIKE * size:
        return "do not change while its positions do: look at what is written as velocity"
    if np.max(np.abs(v - slope * q)) > ALIKE * abs(slope) * size:
        return ""
    return (
        f"are {slope:.6g} times its positions, but for a constant: one exponential, as of an overdamped or "
        "unstable motion, half periods between frames, or velocities made from positions; they show no scheme"
    )


def _names(which: list[int]) -> str:
    return ("oscillator " if len(which) == 1 else "each of oscillators ") + ", ".join(map(str, which))


def _straight(record: Record, j: int) -> bool:
    """Whether a coordinate moves at constant velocity, to the rounding of its numbers and times."""
    q, v = record.q[:, j], record.v[:, j]
    size = np.max(np.abs(v))
    if np.ptp(v) > 64 * ROUNDING * size + 2 * np.max(record.v_quantum[:, j]):
        return False
    way = np.arange(len(q)) * record.interval * np.mean(v)
    unit = 2 * np.max(record.q_quantum[:, j]) + ROUNDING * 64 * np.sqrt(len(q)) * np.max(np.abs(q))
    return bool(np.max(np.abs(q - q[0] - way)) <= unit + np.abs(way[-1]) * (record.jitter + 64 * ROUNDING))


def _falls(record: Record, j: int) -> bool:
    """Whether a coordinate moves at constant acceleration, which its positions show, to the rounding of its
    numbers and times."""
    n = np.arange(len(record.q), dtype=np.longdouble) / len(record.q)
    rounding = 64 * ROUNDING * np.sqrt(len(n)) + record.jitter
    for x, quantum, degree in ((record.q[:, j], record.q_quantum, 2), (record.v[:, j], record.v_quantum, 1)):
        powers = np.vander(n, degree + 1)
        numbers = least_squares(powers, x[:, None])[:, 0]
        room = rounding * np.max(np.abs(x)) + 2 * np.max(quantum[:, j])
        if np.max(np.abs(x - powers @ numbers)) > room or not np.abs(numbers[0]) > room:
            return False
    return len(n) > FEWEST_OF_A_FALL


def _forced(found: Map) -> bool:
    return abs(float(found.entries[1, 0])) >= SURE * math.sqrt(found.covariance[2, 2])


def _uncoupled(record: Record, maps: dict[int, Map]) -> Record | None:
    """The record of the normal modes, if the coordinates are coupled and the modes are not."""
    chosen = list(maps)
    whole = coupled(record, maps, 1e-3 if record.fine else 1 / FALLS)
    basis = None if whole is None else _modes(whole.map)
    # of two particles that are bound to each other alone the distance is judged
    if whole is None or basis is None or (len(chosen) > len(basis) and distance(record) is not None):
        return None
    if not record.fine:
        own = _of_orbit(record, chosen, whole.parts @ basis)
        return None if own is None else _along(record, chosen, _inverse(own))
    uneven = np.max(whole.weight) > GROWN * np.min(whole.weight)
    rows = _parted(whole, basis) @ _inverse(whole.parts) if uneven else _inverse(whole.parts @ basis)
    return _along(record, chosen, rows)


@dataclass(frozen=True, slots=True, eq=False)
class JointMap:
    """The map (2m, 2m) of all moving parts (n, m) of the coordinates together, from their states (f, 2m), one
    unit for all positions and one for all velocities, and the weights (f - 1, 1) of the pairs."""

    parts: Extended
    states: Extended
    map: Extended
    weight: Extended


def coupled(record: Record, maps: dict[int, Map], share: float = 1 / FALLS) -> JointMap | None:
    """The map of all moving parts of the coordinates together, where that leaves a `share` at most of what
    the maps of single coordinates leave over; None where it leaves more."""
    single = max(float(np.max(found.residual)) for found in maps.values())
    if len(maps) < 2 or single < max(64 * FIXED, 1e-8):
        return None
    parts = _moving_parts(record, list(maps))
    z = np.concatenate([x[:, list(maps)] @ parts for x in (record.q, record.v * record.interval)], axis=1)
    frames, n = len(z), z.shape[1] // 2
    if frames - 1 < 2 * n + 1 + SPARE:
        return None
    size = np.sqrt(np.mean(z**2, axis=0)).astype(np.float64)
    # one size for all positions, one for all velocities: modes mix coordinates
    size = np.repeat([np.max(size[:n]), np.max(size[n:])], n)
    if not np.all(size > 0):
        return None
    scaled = z / size
    columns = np.concatenate([scaled[:-1], np.ones((frames - 1, 1), dtype=np.longdouble)], axis=1)
    # a motion that grows rounds its last frames far more coarsely than those that show the other modes
    each = of_pairs(np.max(np.abs(scaled), axis=1))
    if not record.fine:
        # frames count by their digits
        each = of_pairs(np.max(_digits(record, list(maps)) / size[[0, -1], None], axis=0), FLOOR)
        each = each * np.sqrt(np.mean((scaled[1:] / each) ** 2))
    weight = (1 / each).astype(np.longdouble)
    x = least_squares(columns * weight, scaled[1:] * weight)
    left = float(np.sqrt(np.mean((weight * (scaled[1:] - columns @ x)).astype(np.float64) ** 2)))
    return JointMap(parts, scaled, x[:-1].T, weight) if left <= share * single else None


def _digits(record: Record, chosen: list[int]) -> Floats:
    """Units (2, f) of the last digit of the positions and of the velocities times the interval."""
    units = record.q_quantum, record.v_quantum * abs(float(record.interval))
    return np.stack([np.max(x[:, chosen], axis=1) for x in units])


def _moving_parts(record: Record, chosen: list[int]) -> Extended:
    """Orthogonal combinations (n, m) of coordinates that move, beyond what roundings add up to: all that
    there are, unless one rests, as the centre of mass of a chain without walls."""
    q = record.q[:, chosen].astype(np.float64)
    off = q - np.mean(q, axis=0)
    if record.fine:
        # of a motion that grows the first frames show what moves beside it
        so_far = np.maximum.accumulate(np.max(np.abs(q), axis=1, keepdims=True))
        off = (q - q[0]) / np.where(so_far > 0, so_far, 1)
    _, sizes, ways = np.linalg.svd(off, full_matrices=False)
    coarse = 0.0 if record.fine else math.sqrt(len(q)) * float(np.max(record.q_quantum[:, chosen]))
    moving = sizes > LEFT_BY_ROUNDING * ROUNDING * len(q) * sizes[0] + coarse
    return (np.eye(len(chosen)) if np.all(moving) else ways[moving].T).astype(np.longdouble)


SAME_MODE = 1e-5
"""Relative difference of eigenvalues below which any combination of two modes is one."""

GROWN = 16.0
"""Ratio of the sizes of frames from which the forces' part of a map of all, which the small ones hardly show,
tells slow modes apart less well than each mode's own map."""

UNLIKE = 1e6
"""Largest condition number of the modes' basis."""


def _modes(whole: Extended) -> Extended | None:
    """Basis (m, m) of the eigenvectors of the forces' block of a map (2m, 2m), which for every scheme is
    proportional to the springs' matrix, to leading order in the step; None where they are not real."""
    block = whole[len(whole) // 2 :, : len(whole) // 2]
    values, vectors = np.linalg.eig(block.astype(np.float64))
    if np.max(np.abs(np.imag(vectors))) > 1e-6 or np.linalg.cond(np.real(vectors)) > UNLIKE:
        return None
    basis = np.real(vectors).astype(np.longdouble)
    spread = np.real(values)
    gap = spread[None, :] - spread[:, None]
    far = np.abs(gap) > SAME_MODE * np.max(np.abs(spread))
    for _ in range(3):
        # eigenvectors of double precision, corrected to first order with what they leave off the diagonal
        inside = _inverse(basis) @ block @ basis
        step = np.where(far, inside / np.where(far, gap, 1), 0) * (1 - np.eye(len(block)))
        basis = basis @ (np.eye(len(block)) + step)
    return np.asarray(basis)


def _along(record: Record, chosen: list[int], inverse: Extended) -> Record:
    """The record of the modes of the chosen coordinates, by the inverse (m, n) of their basis."""
    q, v, spreading = record.q[:, chosen], record.v[:, chosen], np.abs(inverse.T).astype(np.float64)
    return replace(
        record, q=q @ inverse.T, v=v @ inverse.T, mass=None, momenta=False,
        q_quantum=record.q_quantum[:, chosen] @ spreading,
        v_quantum=record.v_quantum[:, chosen] @ spreading,
        parts=(np.abs(q).astype(np.float64) @ spreading, np.abs(v).astype(np.float64) @ spreading),
    )  # fmt: skip


ROUNDS_OF_ORBIT = 3
"""Rounds of maps and modes: the errors of either are of second order in those of the other."""


def _of_orbit(record: Record, chosen: list[int], basis: Extended) -> Extended | None:
    """Basis (n, m) of the modes of a file of few digits, by all frames together: each coordinate is a sum of
    the motions that the modes' own maps give, whose amplitudes are fitted.  None where two modes are one, or
    where the sums are off by more than digits that are cut off are."""
    frames, unit = len(record.q), _digits(record, chosen)
    wanted = np.stack([record.q[:, chosen], record.v[:, chosen] * record.interval]).astype(np.float64)
    weight = 1 / np.maximum(unit, FLOOR * np.max(unit, axis=1, keepdims=True))[:, :, None]
    rest = np.stack([np.ones(frames), np.zeros(frames)])[:, :, None]
    off = np.inf
    for _ in range(ROUNDS_OF_ORBIT):
        modes = _along(record, chosen, _inverse(basis))
        straight = [_straight(modes, i) for i in range(basis.shape[1])]
        maps = [np.array([[1, 1], [0, 1]]) if x else fit(modes, i).unscaled for i, x in enumerate(straight)]
        ways = [powers(x.astype(np.float64), frames).transpose(1, 0, 2) for x in maps]
        columns = np.concatenate([*ways, rest], axis=2)
        size = np.max(np.abs(columns), axis=(0, 1))
        if not np.all(np.isfinite(size)):
            return None
        flat, right = ((x * weight).reshape(2 * frames, -1) for x in (columns / size, wanted))
        x = np.linalg.lstsq(flat, right)[0]
        off = float(np.mean((right - flat @ x) ** 2))
        rows = (x / size[:, None])[:-1].reshape(-1, 2, len(chosen))
        # the constant of a motion in a straight line is where the coordinates are
        shapes = [x[1] if free else np.linalg.svd(x)[2][0] for x, free in zip(rows, straight, strict=True)]
        basis = np.array(shapes, np.longdouble).T
        if np.linalg.cond(basis.astype(np.float64)) > UNLIKE:
            return None
    return basis if off <= 1 else None


def _parted(of: JointMap, basis: Extended) -> Extended:
    """Rows (n, n) that take coordinates to modes of one map each: in a row with a share d of another's, a
    step leaves over d times what the other's map has more."""
    z, whole, weight = of.states, of.map, of.weight
    inverse, n = _inverse(basis), len(basis)
    blocks = inverse @ whole.reshape(2, n, 2, n).swapaxes(1, 2) @ basis
    own = np.moveaxis(np.diagonal(blocks, axis1=2, axis2=3), 2, 0)
    y = np.moveaxis(z.reshape(-1, 2, n) @ inverse.T, 2, 0)
    shares = np.eye(n, dtype=np.longdouble)
    for i, one in enumerate(own):
        other = (weight * y[:, :-1]) @ np.swapaxes(own - one, 1, 2)
        mine = np.column_stack([y[i, :-1], np.ones(len(weight))]) * weight
        alone = np.stack([np.column_stack([mine, 0 * mine]), np.column_stack([0 * mine, mine])], axis=1)
        columns = np.concatenate([np.delete(np.moveaxis(other, 0, 2), i, axis=2), alone], axis=2)
        flat = columns.reshape(-1, n + 5).astype(np.float64)
        size = np.max(np.abs(flat), axis=0)
        left = (weight * (y[i, 1:] - y[i, :-1] @ one.T)).astype(np.float64).ravel()
        shares[i, np.arange(n) != i] = -(np.linalg.lstsq(flat / size, left)[0] / size)[: n - 1]
    return np.asarray(shares @ inverse)


def _inverse(x: Extended) -> Extended:
    """(Pseudo-)inverse in extended precision: that of double precision, refined by Newton's iteration."""
    by = np.linalg.inv if len(x) == len(x.T) else np.linalg.pinv
    out = by(x.astype(np.float64)).astype(np.longdouble)
    for _ in range(2):
        out = out @ (2 * np.eye(len(x)) - x @ out)
    return np.asarray(out)
