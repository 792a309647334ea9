"""What is wrong, where no known scheme explains the states: faults as explanations, the best first."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from springcheck.identify import driven
from springcheck.identify.coarse import CHANCE, irregular
from springcheck.identify.compare import nearest
from springcheck.identify.evidence import FALLS, Evidence, Measured, distance, matched
from springcheck.identify.families import title
from springcheck.identify.fit import Map, fit
from springcheck.identify.hypothesis import FEW, Terms, distinct
from springcheck.identify.interrupted import few_bad_frames
from springcheck.identify.misplaced import misplaced, turned
from springcheck.identify.result import Explanation
from springcheck.identify.unknown import memory, misfit
from springcheck.identify.wrong import wrong_map
from springcheck.physics.arrays import Floats
from springcheck.schemes import rotation
from springcheck.text.wording import count

FEWEST_MISSES = 24.0
"""Fewest pairs that count among the residuals for their pattern to show."""

FIXED = 2.0**-46
"""Residual of a map, relative to the state, that is still rounding: 64 units in the last place."""

DRIFTING = 64.0
"""Roundings that may be left over where a constant that is added to the position is the cause."""


def explain(seen: Measured) -> tuple[Explanation, ...]:
    """Explanations of what no scheme fits, the best first."""
    evidence = seen.evidence(max(range(len(seen.maps)), key=lambda i: float(np.max(seen.maps[i].residual))))
    out: list[Explanation] = turned(seen.record, seen.moving)
    off = np.max(np.abs(evidence.misses), axis=1) / evidence.unit
    rough, loud = float(np.median(off)), float(np.max(off))
    if evidence.found.drifts and not out:
        out += _drift(evidence)
    if loud > 4 and not out:
        for look in (misplaced, memory, few_bad_frames, _neighbours(seen.maps), _solver, _shape):
            out += look(evidence)
            if out:
                break
    if not out and rough <= 64:
        out += wrong_map(evidence)
    return (*out, *([] if out else [misfit(evidence)]))


def _solver(e: Evidence) -> list[Explanation]:
    """The exact solution, as near as a solver with an error of its own comes to it."""
    if min(_left(columns, e.misses) for columns in (_alternating(e), _powers(e))) < 1 / FALLS:
        # steps that alternate are no solver's, and its errors are no powers of the state
        return []
    residual = float(np.max(e.found.residual))
    # one step to a frame refutes most, and is found soon
    for strides in (range(1, 2), FEW):
        joints = nearest([e.found], [e.terms], distinct(damped=False), strides)
        joints += nearest([e.found], [e.terms], distinct(damped=True), strides)
        distances = {x: distance(e.found, x.parts[0]) for x in joints}
        near = min((x for x in joints if x.scheme == "exact"), key=lambda x: distances[x], default=None)
        if near is None or distances[near] > 0.05:
            return []
        # without friction every scheme is far from a damped motion, and says nothing of its steps
        alike = [(x, d) for x, d in distances.items() if x.scheme != "exact" and x.damped <= near.damped]
        others = min((d for x, d in alike if x.stride == 1), default=math.inf)
        if distances[near] > max(0.3 * others, 4 * residual) or others < 4 * distances[near]:
            return []
        # the error of a solver scatters: one that is the same in every frame may be that of fixed steps
        least = min((d for _, d in alike), default=math.inf)
        if distances[near] > 30 * residual and (least < 0.1 * distances[near] or residual < FIXED):
            return []
        size = max(residual, distances[near])
    return [
        Explanation(
            cause=f"The states are the exact solution to within {size:.1e} of their size in each frame: "
            "an adaptive solver or one of high order, which has no fixed scheme to find",
            remedy="compare its error with its tolerance; give a smaller tolerance, or none",
            misfit=size,
        )
    ]


def _drift(e: Evidence) -> list[Explanation]:
    back = (np.eye(2) - e.found.unscaled.astype(np.float64)) @ e.found.centre.astype(np.float64)
    if np.any(np.max(np.abs(e.misses), axis=1) > DRIFTING * e.unit):
        # what one map and a constant leave over is more than rounding: the constant may be of something else
        return []
    fitting = matched(e.found, e.terms)
    whose = title(fitting[0].scheme) if fitting else "The scheme"
    size = np.abs(back) / e.found.size.astype(np.float64)
    what, much = ("position", back[0]) if size[0] >= size[1] else ("velocity", back[1] / e.record.interval)
    cause = f"{whose} with a constant added to the {what} in every frame: {float(much):.6g}"
    remedy = "look for a drift that is not the velocity's, such as a removed centre-of-mass motion"
    if what == "velocity":
        remedy = "look for a constant force, or a Jacobian by differences, which rounds to one side"
    return [Explanation(cause=cause, remedy=remedy, misfit=float(np.max(e.found.residual)))]


def _left(columns: Floats, missing: Floats) -> float:
    """Root mean square of the residual of a regression on these columns, as a share of the total."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    columns = columns[:, scale > 0] / scale[scale > 0]
    fitted = columns @ np.linalg.lstsq(columns, missing, rcond=None)[0]
    total = float(np.sqrt(np.mean(missing**2)))
    share = len(missing) / max(len(missing) - columns.shape[1], 1)
    return float(np.sqrt(np.mean((missing - fitted) ** 2) * share)) / total if total else 1.0


def _hats(x: Floats, count: int) -> Floats:
    """Piecewise linear functions of x that add up to 1, (f, count)."""
    at = np.linspace(float(np.min(x)), float(np.max(x)), count)
    # a constant x has no such functions: NaN
    with np.errstate(invalid="ignore"):
        return np.asarray(np.maximum(0, 1 - np.abs(x[:, None] - at) / (at[1] - at[0])))


def _neighbours(maps: list[Map]) -> Callable[[Evidence], list[Explanation]]:
    def look(e: Evidence) -> list[Explanation]:
        if len(maps) < 2 or e.pairs < 4 * len(maps) + 12:
            return []
        # about an equilibrium that the map of one alone does not show
        others = np.concatenate([m.z[:-1].astype(np.float64) for m in maps], axis=1)
        others = np.concatenate([others, np.ones((e.pairs, 1))], axis=1)
        share = _left(others, e.misses)
        if share > 1 / FALLS:
            return []
        fitted = others @ np.linalg.lstsq(others, e.misses, rcond=None)[0]
        return [
            Explanation(
                cause=f"The oscillators are coupled: coordinate {e.j} follows from the states of all, "
                f"by {float(np.max(np.abs(fitted))):.1e} of its size in each frame",
                remedy="leave the coupling out, or give the normal modes, which are independent",
                misfit=share,
            )
        ]

    return look


def _shape(e: Evidence) -> list[Explanation]:
    """Regress the residuals on functions of position, velocity and time; irregular ones are noise."""
    z, missing = e.found.z[:-1].astype(np.float64), e.misses
    q, v = z.T
    # a motion that grows or decays is not judged by its largest states alone
    weight = (e.found.weight / np.max(e.found.weight))[:, None]
    t = np.linspace(-1, 1, e.pairs)
    count = min(14, max(4, e.pairs // 8))
    # what the map takes up, its own constant with it, is taken up by every explanation
    own = [np.ones_like(q)] if np.any(e.found.centre) else []
    linear = [q, v, *own]
    carriers = {"oscillation": q, "drive": np.ones_like(q)}
    tuned = {name: driven.frequency(linear, missing, weight[:, 0], x) for name, x in carriers.items()}
    groups: dict[str, list[Floats]] = {
        "constant": [q, v, np.ones_like(q)],
        "drag": [*linear, np.abs(v) * v],
        "parity": [*_alternating(e).T],
        "beat": [*_alternating(e).T, *(z * (t * (-1.0) ** np.arange(e.pairs))[:, None]).T],
        "quadratic": [q, v, np.ones_like(q), q * q],
        "cubic": [*linear, q**3],
        "oscillation": [*linear, *driven.waves(q, tuned["oscillation"])],
        "anharmonic": [*_powers(e).T],
        "position": [v, *_hats(q, 16).T],
        "velocity": [q, *_hats(v, 16).T],
        "stiffness in time": [v, *own, *(q[:, None] * _hats(t, count)).T],
        "friction in time": [q, *own, *(v[:, None] * _hats(t, count)).T],
        "map in time": [*own, *(q[:, None] * _hats(t, count)).T, *(v[:, None] * _hats(t, count)).T],
        "drive": [*linear, *driven.waves(np.ones_like(q), tuned["drive"])],
    }
    # residuals of a few pairs fit any law with as many parameters; a fitted frequency counts as a further
    # parameter, the map's own constant does not
    numbers = {"oscillation": 7, "drive": 7, "parity": 4}
    square = np.sum((weight * missing) ** 2, axis=1)
    counted = float(np.sum(square) ** 2 / np.sum(square**2)) if np.any(square) else 0.0
    left = {
        name: _left(weight * np.stack(columns, axis=1), weight * missing)
        for name, columns in groups.items()
        if counted > 3 * numbers.get(name, len(columns) - len(own))
    }
    # powers of the state are many numbers: of fewer pairs they show where they leave less than by chance
    spare = counted - len(groups["anharmonic"]) + len(own)
    powers = 1.0
    if "anharmonic" not in left and spare > 0:
        powers = _left(weight * _powers(e), weight * missing)
        left |= {"anharmonic": powers} if powers**spare < CHANCE else {}
    if left.get("constant", 1.0) < 0.35:
        # what a constant explains shows nothing of what has one beside it
        left = {
            name: share for name, share in left.items() if name == "constant" or 2 * share < left["constant"]
        }
    size = float(np.max(e.found.residual))
    fitting = [name for name, share in left.items() if share < 0.35]
    if not fitting:
        return [_noise(e, size, counted)]
    # of the laws that explain nearly as much per parameter, take the one of the fewest parameters
    best = min(left[name] * math.sqrt(len(groups[name])) for name in fitting)
    room = {name: max(3 * best / math.sqrt(len(groups[name])), 0.02) for name in fitting}
    good = [name for name in groups if name in fitting and left[name] <= room[name]]
    if "parity" in good:  # which is a beat without its slope, and a drive that alternates with the motion
        good = [name for name in good if name not in ("beat", "drive")]
    untried = counted < FEWEST_MISSES or (good[0] in tuned and "anharmonic" not in left)
    if untried and FALLS * left[good[0]] > 1 and good[0] != "constant":
        # what explains a part, a frequency that was looked for above all, may stand for what so few pairs
        # cannot show
        return [_too_few(size, counted)]
    angle = 2 * math.pi * _turns(e) / e.pairs
    away = {
        name: e.pairs * min(abs(math.remainder(w - n * angle, 2 * math.pi)) for n in HARMONICS)
        for name, w in tuned.items()
    }
    if {"quadratic", "cubic", "anharmonic"} & set(good):
        # a wave that is in step with the motion to a share of a turn over the run is its own power
        good = [name for name in good if away.get(name, math.inf) > IN_STEP]
    cause, remedy = _sentence(e, good[0], q, v, missing, size)
    cause += driven.said(e, good[0] == "drive", tuned[good[0]]) if good[0] in tuned else ""
    few = _turns(e) < FEW_TURNS
    if few and (good[0] in (*STATE, *TIME) or len({KIND[name] for name in good}) > 1):
        # where states hardly come back, any function of time is one of many powers of the state
        good = [*good, "anharmonic" if good[0] in TIME else "stiffness in time"]
    as_little = good[0] in TIME and powers * math.sqrt(len(groups["anharmonic"])) <= 3 * best
    if "anharmonic" not in left and (as_little or away.get(good[0], math.inf) < math.pi):
        # powers of the position, which so few pairs do not show, have frequencies that are the motion's own,
        # several times, and are as likely as a law of time where they leave as little
        good = [*good, "anharmonic"]
    kinds = list(dict.fromkeys(KIND[name] for name in good))
    if len(kinds) > 1:
        # over few periods position and velocity are functions of time, and of each other; states that
        # come back after a few frames show little else
        why = "the arc is too short" if few else "the states come back too much alike"
        cause = (
            f"The force {' or '.join(kinds)}, and {why} to tell which: it moves a frame by {size:.1e} of the "
            "state's size"
        )
        remedy = "record more periods, where positions come back at other times and velocities"
    return [Explanation(cause=cause, remedy=remedy, misfit=left[good[0]])]


KIND = {
    "constant": "has a constant beside it", "drag": "depends on the velocity",
    "velocity": "depends on the velocity",
    "quadratic": "is anharmonic", "cubic": "is anharmonic", "anharmonic": "is anharmonic",
    "position": "is anharmonic", "parity": "alternates from step to step", "oscillation": "changes in time",
    "stiffness in time": "changes in time", "friction in time": "changes in time",
    "map in time": "changes in time", "beat": "changes in time", "drive": "is driven",
}  # fmt: skip
"""Dependence of the force that each group of columns stands for."""

STATE = ("quadratic", "anharmonic", "position", "velocity")
"""Groups of functions of the state that follow most functions of time where states hardly come back."""

TIME = ("oscillation", "stiffness in time", "friction in time", "map in time", "beat", "drive")
"""Groups of functions of time, which the state follows there as well."""

IN_STEP = 0.1
"""Angle over the run by which a wave may be off the motion's harmonics where it is their own."""

HARMONICS = (-3, -2, -1, 0, 1, 2, 3)
"""Multiples of the motion's frequency at which a force that is not linear acts, or changes a stiffness."""

FEW_TURNS = 2.0
"""Turns of the motion from which states come back often enough to tell what goes with them from time."""


def _alternating(e: Evidence) -> Floats:
    """Columns (f - 1, c) of two maps in turn, and of the constant that was fitted."""
    z = e.found.z[:-1].astype(np.float64)
    constant = np.ones((len(z), int(np.any(e.found.centre != 0))))
    return np.concatenate([z, z * (-1.0) ** np.arange(len(z))[:, None], constant], axis=1)


def _powers(e: Evidence) -> Floats:
    """Columns (f - 1, 10) of powers of position and velocity, and their products, up to the third."""
    q, v = e.found.z[:-1].astype(np.float64).T
    powers = (q**i * v**k for i in range(4) for k in range(4) if 1 < i + k < 4)
    return np.stack([q, v, np.ones_like(q), *powers], axis=1)


def _two_maps(e: Evidence) -> tuple[str, str]:
    """Difference between the maps of even and odd frames, and what to do."""
    odd = np.arange(e.pairs) % 2 == 1
    halves = [fit(e.record, e.j, kept=mask) for mask in (~odd, odd)]
    left = max(float(np.max(x.residual)) for x in halves)
    dets = [float(np.linalg.det(x.entries.astype(np.float64))) - 1 for x in halves]
    loose = Terms(mass_unknown=True, rounding=e.terms.rounding, jitter=e.terms.jitter)
    found = [matched(x, loose) for x in halves]
    names = [m.scheme for m in found[0] if m.scheme in {n.scheme for n in found[1]}]
    what = "two maps take turns"
    if not names and abs(dets[0] - dets[1]) > 4 * left:
        what = f"a friction of changing sign multiplies areas by 1 {dets[0]:+.2e} and 1 {dets[1]:+.2e}"
        if dets[0] * dets[1] > 0:
            what = f"one multiplies areas by a share of {abs(dets[0] - dets[1]):.2e} more than the other"
    elif names:
        one, other = (next(m for m in ms if m.scheme == names[0]) for ms in found)
        share = abs(math.sqrt(one.a / other.a) - 1)
        whose = f"the steps of {title(names[0])}" if len(set(names)) == 1 else "steps"
        what = f"{whose} alternate by {share:.2g} of their length"
    return (
        f"Even and odd steps differ and alternate: {what}",
        "look for a buffer or a sign that is switched in every step",
    )


def _turns(e: Evidence) -> float:
    return e.pairs * float(rotation(e.found.entries[None]).angle[0]) / (2 * math.pi)


def _sentence(e: Evidence, name: str, q: Floats, v: Floats, missing: Floats, size: float) -> tuple[str, str]:
    record, found = e.record, e.found
    if name == "parity":
        return _two_maps(e)
    if name == "drag":
        columns = np.stack([q, v, np.abs(v) * v], axis=1)
        z = found.z.astype(np.float64)
        row = np.linalg.lstsq(columns, z[1:, 1], rcond=None)[0]
        mass = 1.0 if record.mass is None else float(record.mass[e.j])
        h, scale = abs(float(record.interval)), float(found.size[1])
        c1, c2 = mass * (1 - row[1]) / h, -mass * row[2] / scale
        unit = " of the mass" if record.mass is None else ""
        return (
            f"A drag c1 v + c2 |v| v acts, with c1 = {c1:.4g} and c2 = {c2:.4g}{unit}, explicit in the force",
            "leave the quadratic drag out, or judge against a scene that has it",
        )
    strength = f"{size:.1e} of the state's size in each frame"
    if name == "cubic":
        columns = np.stack([q, v, q**3], axis=1)
        row = np.linalg.lstsq(columns, found.z.astype(np.float64)[1:, 1], rcond=None)[0]
        share = row[2] / row[0] * float(np.max(q**2)) if row[0] else math.nan
        return (
            f"The force is anharmonic: a cubic part reaches {share:.2g} of the linear one where largest",
            "look for a bond or a geometry that is not a linear spring",
        )
    causes = {
        "constant": "A constant added to the position in every frame explains most of what a map misses: it",
        "quadratic": "The force is anharmonic: a quadratic part",
        "anharmonic": "The motion is anharmonic: the force is not linear in position or velocity, which",
        "position": "The force is not linear in the position, as one that is clipped or anharmonic, which",
        "velocity": "The friction is not linear in the velocity, which",
        "stiffness in time": "The stiffness changes in time, which",
        "oscillation": "The stiffness changes in time, up and down, which",
        "friction in time": "The friction changes in time, which",
        "map in time": "The step or the stiffness changes in time, which",
        "beat": "The step or the stiffness changes in time, up and down in nearly two frames, which",
        "drive": "A force from outside drives the motion, up and down in time, which",
    }
    remedies = {
        "constant": "look for a drift that is not the velocity's, and then for what else is left",
        "stiffness in time": "look for a parameter or a clock that moves during the run",
        "drive": "leave the external force out, or judge a part of the trajectory without it",
        "oscillation": "look for a parameter or a clock that moves during the run",
        "friction in time": "look for a thermostat or a damping that is switched during the run",
        "map in time": "look for a step that is adapted, or give a part of the trajectory",
        "beat": "look for a parameter or a clock that moves during the run",
    }
    return (
        f"{causes[name]} moves a frame by {strength}",
        remedies.get(name, "look for a force that is not that of a linear spring"),
    )


def _too_few(size: float, counted: float) -> Explanation:
    return Explanation(
        cause=f"What one map leaves over, {size:.1e} of the state's size, stands in about "
        f"{count(round(counted), 'frame')}: too few to show its cause",
        remedy="record more of the motion, before it dies down or after it has begun to grow; a solver "
        "that chooses its steps has no fixed scheme to find",
        misfit=size,
    )


def _noise(e: Evidence, size: float, counted: float) -> Explanation:
    """Explanation of residuals that are irregular, or follow no known law, or stand in too few frames."""
    if counted < FEWEST_MISSES:
        return _too_few(size, counted)
    rows = e.found.residual
    ratio = float(rows[0] / rows[1]) if rows[1] else math.inf
    where = "the velocity" if ratio < 0.2 else "the position" if ratio > 5 else "position and velocity"
    if not irregular(e.misses * e.found.weight[:, None]):
        return Explanation(
            cause="No known cause alone explains what one map leaves over, and it is no noise: it comes back "
            f"from frame to frame, {size:.1e} of the state's size in each, in {where}",
            remedy="look for several errors at once, and take them out one by one; a solver that chooses its "
            "steps has no fixed scheme to find"
            + "; a bath of one factor for all momenta, as a Nose-Hoover chain, shows in two particles or more"
            * (e.record.q.shape[1] == 1),
            misfit=size,
        )
    return Explanation(
        cause=f"Noise: what one map leaves over is irregular, {size:.1e} of the state's size in each frame, "
        f"in {where}, and has no quanta of a known arithmetic",
        remedy="look for a thermostat, an iteration that stops early, or a sum in changing order",
        misfit=size,
    )
