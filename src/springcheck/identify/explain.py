"""Causes of states that no known scheme explains, the likeliest first."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from springcheck.identify import laws
from springcheck.identify.coarse import is_white
from springcheck.identify.compare import nearest
from springcheck.identify.evidence import (
    FALLS,
    FIXED,
    LEFT_BY_ROUNDING,
    Evidence,
    Measured,
    distance,
    matched,
)
from springcheck.identify.families import title
from springcheck.identify.hypothesis import FEW, distinct
from springcheck.identify.interrupted import broken, ended, few_bad_frames, two_parts
from springcheck.identify.laws import Regression, alone, explained_by, regression
from springcheck.identify.misplaced import misplaced, turned
from springcheck.identify.result import Explanation
from springcheck.identify.unknown import lasting, memory, misfit, tied
from springcheck.identify.wrong import exchanged, wrong_map
from springcheck.text.wording import count

FEWEST_MISSES = 24.0
"""Fewest effective pairs from which the residuals show their cause."""

FEW_TURNS = 2.0
"""Fewest periods that separate functions of the state from functions of time."""

IN_STEP = 0.1
"""Phase over the run [rad] within which a fitted frequency is a harmonic of the motion."""

HARMONICS = range(-3, 4)
"""Harmonics at which an anharmonic force acts."""

LINEAR_LEAVES = 4
"""Largest residual of a linear map, in units of `Evidence.unit`."""


def explain(seen: Measured) -> tuple[Explanation, ...]:
    """Causes of states that no scheme fits, the likeliest first."""
    # a coordinate that hardly moves far from 0 has large residuals, all of rounding
    each = [seen.evidence(i) for i in range(len(seen.maps))]
    evidence = max(each, key=lambda e: float(np.mean(e.excess(e.found) ** 2)))
    if out := turned(seen.record, seen.moving) or _drift(evidence) or tied(evidence):
        return (out,)
    if np.max(evidence.excess(evidence.found)) <= LINEAR_LEAVES:
        first = exchanged(evidence)
        return (first,) if first else tuple(wrong_map(evidence)) or (misfit(evidence),)
    if out := ended(evidence):
        return (out,)
    found = (look(evidence) for look in SEARCHED)
    return (next(filter(None, found), None) or _law(evidence),)


def _solver(e: Evidence) -> Explanation | None:
    """The exact solution to within a tolerance: an adaptive or high-order solver."""
    if min(regression(e, law).left for law in (laws.PARITY, laws.POWERS)) < 1 / FALLS:
        # steps that alternate are no solver's, and its errors are no powers of the state
        return None
    residual = e.size
    # one step to a frame refutes most, and is found soon
    for strides in (range(1, 2), FEW):
        joints = nearest([e.found], [e.terms], distinct(damped=False), strides)
        joints += nearest([e.found], [e.terms], distinct(damped=True), strides)
        distances = {x: distance(e.found, x.parts[0]) for x in joints}
        near = min((x for x in joints if x.scheme == "exact"), key=lambda x: distances[x], default=None)
        if near is None or max(distances[near], residual) > 0.05:
            return None
        # without friction every scheme is far from a damped motion, and says nothing of its steps
        alike = [(x, d) for x, d in distances.items() if x.scheme != "exact" and x.damped <= near.damped]
        others = min((d for x, d in alike if x.stride == 1), default=math.inf)
        if distances[near] > max(0.3 * others, 4 * residual) or others < 4 * distances[near]:
            return None
        # the error of a solver scatters: one that is the same in every frame may be that of fixed steps
        least = min((d for _, d in alike), default=math.inf)
        if distances[near] > 30 * residual and (least < 0.1 * distances[near] or residual < FIXED):
            return None
        size, exact = max(residual, distances[near]), near.parts[0]
    return Explanation(
        f"The states are the exact solution to within {size:.1e} of their size in each frame: an adaptive "
        "solver or one of high order, which has no fixed scheme to find",
        "compare its error with its tolerance; give a smaller tolerance, or none",
        size,
        hypothesis=exact,
    )


def _drift(e: Evidence) -> Explanation | None:
    if not e.found.drifts or np.max(e.excess(e.found)) > LEFT_BY_ROUNDING:
        # where one map and a constant leave more than rounding, the constant may belong to something else
        return None
    back = (np.eye(2) - e.found.unscaled.astype(np.float64)) @ e.found.centre.astype(np.float64)
    fitting = matched(e.found, e.terms)
    whose = title(fitting[0].scheme) if fitting else "The scheme"
    size = np.abs(back) / e.found.size.astype(np.float64)
    what, much = ("position", back[0]) if size[0] >= size[1] else ("velocity", back[1] / e.record.interval)
    cause = f"{whose} with a constant added to the {what} in every frame: {float(much):.6g}"
    remedy = "look for a drift that is not the velocity's, such as a removed centre-of-mass motion"
    if what == "velocity":
        remedy = "look for a constant force, or a Jacobian by differences, which rounds to one side"
    return Explanation(cause, remedy, e.size, hypothesis=fitting[0] if fitting else None)


def _law(e: Evidence) -> Explanation:
    """The force law that explains the residuals with the fewest parameters, or those not told apart."""
    tried = [regression(e, law) for law in laws.LAWS]
    of = {x.law: x for x in tried}
    constant, powers, counted = of[laws.CONSTANT], of[laws.POWERS], of[laws.CONSTANT].counted
    shown = [x for x in tried if x.shows]
    if constant in shown and constant.left < laws.EXPLAINS:
        # where a constant explains the residuals, a law has to explain more than it
        shown = [x for x in shown if x is constant or 2 * x.left < constant.left]
    fitting = [x for x in shown if x.left < laws.EXPLAINS]
    if not fitting:
        return _unexplained(e, counted)
    # of the laws that explain nearly as much per parameter, take the one of the fewest parameters
    best = min(x.cost for x in fitting)
    good = [x for x in fitting if x.left <= max(3 * best / math.sqrt(x.rank), 0.02)]
    if of[laws.PARITY] in good:
        # a beat is two maps in turn that change, and a drive may alternate with the motion
        good = [x for x in good if x.law not in (laws.BEAT, laws.OUTER_DRIVE)]
    first = good[0]
    untried = counted < FEWEST_MISSES or (first.law.waves and powers not in shown)
    if untried and FALLS * first.left > 1 and first is not constant:
        # a law that explains a part, above all at a fitted frequency, may stand for one of more parameters
        return _too_few(e, counted)
    if any(x.law.kind == laws.ANHARMONIC for x in good):
        # a wave that is in step with the motion to a share of a turn over the run is its own power
        good = [x for x in good if not _out_of_step(e, x) <= IN_STEP]
        first = good[0]
    kinds = dict.fromkeys(x.law.kind for x in good)
    in_time, few = first.law.kind in (laws.IN_TIME, laws.IS_DRIVEN), e.turns < FEW_TURNS
    if few and (first.law.flexible or len(kinds) > 1):
        # where states hardly come back, any function of time is one of many powers of the state
        kinds[laws.ANHARMONIC if in_time else laws.IN_TIME] = None
    as_little = in_time and powers.counted > powers.parameters and powers.cost <= 3 * best
    if powers not in shown and (as_little or _out_of_step(e, first) < math.pi):
        # powers of the position, which so few pairs do not show, have frequencies that are the motion's own,
        # several times, and are as likely as a law of time where they leave as little
        kinds[laws.ANHARMONIC] = None
    if len(kinds) == 1:
        return explained_by(e, first)
    # over few periods position and velocity are functions of time, and of each other; states that
    # come back after a few frames show little else
    why = "the arc is too short" if few else "the states come back too much alike"
    return Explanation(
        f"The force {' or '.join(kinds)}, and {why} to tell which: it moves a frame by {e.size:.1e} of the "
        "state's size",
        "record more periods, where positions come back at other times and velocities",
        first.left,
    )


def _out_of_step(e: Evidence, x: Regression) -> float:
    """Phase over the run [rad] between a law's frequency and the nearest harmonic; NaN of a law without."""
    angle = float(e.found.turn.angle[0])
    return e.pairs * min(abs(math.remainder(x.turn - n * angle, 2 * math.pi)) for n in HARMONICS)


def _too_few(e: Evidence, counted: float) -> Explanation:
    return Explanation(
        f"What one map leaves over, {e.size:.1e} of the state's size, stands in about "
        f"{count(round(counted), 'frame')}: too few to show its cause",
        "record more of the motion, before it dies down or after it has begun to grow; a solver "
        "that chooses its steps has no fixed scheme to find",
        e.size,
        shown=False,
    )


def _unexplained(e: Evidence, counted: float) -> Explanation:
    """Residuals that are noise, follow no known law, or occur in too few frames."""
    if counted < FEWEST_MISSES:
        return _too_few(e, counted)
    rows = e.found.residual
    ratio = float(rows[0] / rows[1]) if rows[1] else math.inf
    where = "the velocity" if ratio < 0.2 else "the position" if ratio > 5 else "position and velocity"
    # what is left of the other number is rounding, which goes with the state
    left = e.residuals[:, rows >= 0.2 * np.max(rows)]
    # noise of a coarse number is white relative to a motion that grows, and noise of one size beside its map
    linear = np.column_stack([e.states[:-1], np.ones(e.pairs)])
    if not (is_white(left * e.weight[:, None]) or (left.shape[1] == 1 and is_white(left, linear))):
        return Explanation(
            "No known cause alone explains what one map leaves over, and it is no white noise: it "
            f"comes back from frame to frame, {e.size:.1e} of the state's size in each, in {where}",
            "look for several errors at once, and take them out one by one; a solver that chooses its "
            "steps has no fixed scheme to find"
            + "; a bath of one factor for all momenta, as a Nose-Hoover chain, shows in two particles or more"
            * (e.record.q.shape[1] == 1),
            e.size,
            shown=False,
        )
    # quanta of a force show in steps of a particle of known mass, and not in a normal mode
    single = " or forces in single precision" * (e.record.mass is None and ratio < 0.2 and e.size < 2.0**-24)
    return Explanation(
        f"Noise{single}: what one map leaves over is irregular, {e.size:.1e} of the state's size in each "
        f"frame, in {where}, and has no quanta of a known arithmetic",
        "look for a thermostat, an iteration that stops early, or a sum in changing order",
        e.size,
    )


SEARCHED = (
    misplaced, partial(alone, laws.DRY), memory, few_bad_frames, two_parts, broken,
    partial(alone, laws.COUPLED), lasting, _solver,
)  # fmt: skip
"""Causes of the map's residuals, in the order in which they are looked for; `_law` comes last."""
