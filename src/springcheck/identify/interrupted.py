"""A motion with a few bad frames: which they are, and what happened at them."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from springcheck.identify.coarse import is_white
from springcheck.identify.compare import compare
from springcheck.identify.evidence import (
    AGREES,
    FALLS,
    LEFT_BY_ROUNDING,
    SINGLE_ROOM,
    SPARE,
    Evidence,
    Measured,
    matched,
)
from springcheck.identify.families import FAMILIES, OF_HALF_A_STEP_AGO, VERLET, titles
from springcheck.identify.fit import Map, fit, of_pairs
from springcheck.identify.hypothesis import FEW, Joint, Match, distinct
from springcheck.identify.maps import powers, unit
from springcheck.identify.result import Explanation
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Extended, Floats
from springcheck.text.wording import count, few, regularly

FEW_BAD = 0.06
"""Largest share of bad pairs."""

APART = 2.0
"""Smallest ratio of the least residual of a bad pair to the largest of the others, in units of rounding."""

LARGER = 10.0
"""Ratio of sizes of frames from which an anharmonic force, or noise of one size, shows in some alone."""

HALF_STEP = 1e-3
"""Relative difference up to which a residual is half a step's kick, or kicks are one."""

AT_AN_END = 3
"""Bad pairs among the smallest, or largest, `AT_AN_END` times as many pairs are there by no chance."""

OF_ROUNDING = 8.0
"""Largest residual of a pair, in units of `Evidence.unit`, of a part that is one map to rounding."""

LEFT_BY_ALL = 1e-10
"""Largest residual of a map of all coordinates, relative to their sizes, that is rounding."""

OFTEN_BAD = 0.25
"""Largest share of bad pairs that are single ones, equally far apart: that is no chance."""

DRAWS = 256
"""Most draws of pairs of a coupled motion: of 13 pairs, a tenth of all bad, one in 4 has no bad one."""

NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]\d+)?")
"""Numbers in a cause, without which interruptions of one kind are the same."""

FEWEST_REPEATED = 2
"""Fewest repeated frames at the end of a motion that has ended."""

FEWEST_PAIRS = 8
"""Fewest pairs beside the bad ones, and of those that move."""


def remembered(seen: Measured) -> tuple[Measured, list[Joint]]:
    """The data without frame 0, and the fits of Verlet with the friction of the velocity half a step ago,
    whose first step has that of the first velocity."""
    record = seen.record
    if not record.fine or len(record.q) <= FEWEST_PAIRS or any(_first_off(x) < FALLS for x in seen.maps):
        return seen, []
    parts = None if record.parts is None else (record.parts[0][1:], record.parts[1][1:])
    uneven = None if record.deviations is None else record.deviations[1:]
    later = replace(
        record, q=record.q[1:], v=record.v[1:], q_quantum=record.q_quantum[1:], parts=parts,
        v_quantum=record.v_quantum[1:], deviations=uneven,
    )  # fmt: skip
    if set(seen.moving) - set(later.moving):
        return seen, []
    rest = replace(seen, record=later, maps=[fit(later, j) for j in seen.moving])
    joints = rest.compare((FAMILIES[OF_HALF_A_STEP_AGO],), FEW)
    return rest, [x for x in joints if _begins(seen, rest.maps, x)]


def _first_off(found: Map) -> float:
    """Ratio of the first pair's residual to the largest in the second half."""
    off = np.max(np.abs(found.residuals()), axis=1) * found.weight
    return float(off[0] / max(np.max(off[len(off) // 2 :]), 1e-300))


def _begins(seen: Measured, maps: list[Map], joint: Joint) -> bool:
    """Whether a first step with the friction of the first velocity leads to the second frame."""
    record = seen.record
    for j, found, part in zip(seen.moving, maps, joint.parts, strict=True):
        a, g = np.array([part.a], np.longdouble), np.array([part.g], np.longdouble)
        first, later = (unit(FAMILIES[name], a, g) for name in (f"{VERLET}, damped", OF_HALF_A_STEP_AGO))
        b = powers(later[0], part.stride)[-1] @ first[0]
        step = record.interval / part.stride
        z = np.stack([record.q[:2, j] - found.centre[0], record.v[:2, j] * step], axis=1)
        size = np.abs(z[0]) @ np.abs(b.T) + np.abs(z[1]) + abs(found.centre[0])
        if np.any(np.abs(z[1] - z[0] @ b.T) > LEFT_BY_ROUNDING * part.stride * ROUNDING * np.max(size)):
            return False
    return True


def few_bad_frames(e: Evidence) -> Explanation | None:
    """The cause of a few bad pairs in a motion of one map."""
    kept = np.ones(e.pairs, dtype=bool)
    found = e.found
    for _ in range(8):
        off = e.excess(found)
        limit = max(8 * float(np.median(off[kept])), 2.0)
        now = off <= limit
        if np.count_nonzero(~now) > max(3, FEW_BAD * e.pairs) or np.array_equal(now, kept):
            break
        kept = now
        found = fit(e.record, e.j, kept=kept)
    bad = np.flatnonzero(~kept)
    if not len(bad) or np.count_nonzero(kept) < FEWEST_PAIRS:
        return None
    if float(np.min(off[bad])) < APART * float(np.max(off[kept])):
        # what falls off from frame to frame has no few bad ones
        return None
    before = float(np.max(e.weight[:, None] * np.abs(e.residuals)))
    rest = (e.weight[:, None] * found.residuals())[kept]
    after = float(np.sqrt(np.mean(rest**2)))
    if before < FALLS * after:
        return None
    fitting = matched(found, e.terms)
    size = np.sqrt(np.sum(np.square(found.z[:-1].astype(np.float64)), axis=1))
    rough = after > 8 * float(np.median(e.weight * e.unit))
    if rough and not fitting:
        # the rest is no single motion either, as a solver's that begins with small steps
        return None
    if np.count_nonzero(kept & (size > FALLS * e.unit)) < FEWEST_PAIRS:
        # too few of the rest are not at rest
        return None
    middle = float(np.median(size))
    if float(np.max(size[bad])) < min(2 * float(np.min(size[kept])), middle / LARGER):
        # an error of one size shows where a motion that grows or dies is smallest
        return None
    whose = f" of {titles(x.scheme for x in fitting)}" if fitting else _damped(found, e)
    if rough and not (after < SINGLE_ROOM * float(np.median(e.weight * size)) and is_white(rest)):
        # what is left of the rest is no arithmetic's, and makes its map so uncertain that wrong schemes fit
        whose = ""
    runs = np.split(bad, np.flatnonzero(np.diff(bad) > 1) + 1)
    ranks = np.argsort(np.argsort(size))[bad]
    several = len(runs) > 1 and float(np.max(size)) > LARGER * float(np.min(size))
    if several and float(np.max(ranks)) < AT_AN_END * len(bad):
        # several interruptions, all where the motion is smallest: an error of one size, which shows there
        return None
    # what happens at the last frame does not show
    known = runs[:-1] if len(runs) > 1 and bad[-1] == e.pairs - 1 else runs
    told = [_interruption(e, found, [run], whose, fitting) for run in known]
    alike = len({NUMBER.sub("", one) for one, _ in told}) == 1
    cause, remedy = _interruption(e, found, runs, whose, fitting) if alike else told[0]
    at = ", ".join(str(run[0] + 1) for run in runs[1:5])
    more = f", and {len(runs) - 1} more{' like it' if alike else ', not all like it'}, at frame"
    regular = regularly([int(run[0]) for run in runs]) if alike else ""
    cause += regular or f"{more}{'s' * (len(runs) > 2)} {at}" * (len(runs) > 1)
    largest = float(np.min(size[bad])) > max(float(np.max(size[kept])) / 2, LARGER * middle)
    if (len(bad) > 1 and largest) or (several and float(np.min(ranks)) >= e.pairs - AT_AN_END * len(bad)):
        cause = (
            f"The motion is one{whose}, but not in frames {bad[0]} to {bad[-1] + 1}, where it is largest: "
            "too few to tell whether the force is anharmonic, or the step or a force changes in time"
        )
    own = fitting[0] if len(fitting) == 1 and whose else None
    return Explanation(cause, remedy, after / before, local=True, hypothesis=own)


def ended(e: Evidence) -> Explanation | None:
    """The cause where all later frames repeat one, which its velocity, or the map of those before, moves."""
    states = np.concatenate([e.record.q[:, e.record.moving], e.record.v[:, e.record.moving]], axis=1)
    at = int(np.max(np.flatnonzero(np.any(states[1:] != states[-1], axis=1)), initial=-2)) + 2
    # what a start leaves behind has faded in the second half
    kept = (np.arange(e.pairs) < at - 1) & (np.arange(e.pairs) >= (at - 1) // 2)
    if len(states) - at < FEWEST_REPEATED or np.count_nonzero(kept) < FEWEST_PAIRS:
        return None
    found = fit(e.record, e.j, kept=kept)
    off = np.max(np.abs(found.residuals()), axis=1)
    left, rounding = float(np.max(off[kept])), LARGER * float(np.max(e.unit))
    moves = abs(float(e.found.z[-1, 1] * e.found.size[1] / e.found.size[0]))
    if not (moves > rounding or np.max(off[at - 1 : at + 1]) > max(LARGER * left, rounding)):
        return None
    whose = titles(x.scheme for x in matched(found, e.terms)) if left <= rounding else ""
    zero = not np.any(states[-1])
    what = "all numbers are 0" if zero else f"all frames are frame {at}"
    return Explanation(
        f"The motion{f' of {whose}' if whose else ''} ends: from frame {at + (not zero)} on {what}",
        "look for a loop that ends early, or for rows that are never written or written again",
        local=True,
    )


def two_parts(e: Evidence) -> Explanation | None:
    """One map up to a frame and another from there on, each to rounding."""
    if e.pairs < 2 * FEWEST_PAIRS:
        return None
    frames = np.arange(e.pairs)
    for half in (frames < e.pairs // 2, frames >= e.pairs // 2):
        one = fit(e.record, e.j, kept=half)
        left = e.excess(one)
        bad = np.flatnonzero(left > OF_ROUNDING)
        # of what changes slowly a half that is one map to rounding shows too little in the other
        if len(bad) < FEWEST_PAIRS or np.any(half[bad]) or np.max(left) < LARGER**2 * OF_ROUNDING:
            continue
        at = int(bad[0] if half[0] else bad[-1] + 1)
        rest = (frames >= at) == half[0]
        other = fit(e.record, e.j, kept=rest)
        if one.conditioned and other.conditioned and np.all(e.excess(other)[rest] <= OF_ROUNDING):
            parts = (one, other) if half[0] else (other, one)
            fits = (titles(x.scheme for x in matched(part, e.terms)) for part in parts)
            before, after = (f" of {x}" if x else "" for x in fits)
            return Explanation(
                f"The motion is one{before} up to frame {at}, another{after} from there on: the step, the "
                "stiffness or the friction changes there",
                "look for what changes there, as a restart with another step, or give one of the parts",
                local=True,
            )
    return None


def broken(e: Evidence) -> Explanation | None:
    """A few bad pairs of a coupled motion: one map of all coordinates takes every other frame to the next.
    It is that of a few pairs drawn at random, none of which is bad."""
    moving, record = e.record.moving, e.record
    z = np.concatenate([record.q[:, moving], record.v[:, moving]], axis=1).astype(np.float64)
    quanta = np.concatenate([record.q_quantum[:, moving], record.v_quantum[:, moving]], axis=1)
    size = np.maximum(np.max(np.abs(z), axis=0), np.finfo(np.float64).tiny)
    # of a motion that grows each pair is weighted by its own size
    each = of_pairs(np.max(np.abs(z / size), axis=1))
    columns, ends = np.column_stack([z[:-1] / size, np.ones(e.pairs)]) / each, z[1:] / size / each
    part, room = columns.shape[1] + SPARE, LEFT_BY_ALL + 32 * float(np.max(quanta / size))
    if len(moving) < 2 or e.pairs < 2 * part:
        return None
    rng = np.random.default_rng(0)
    for _ in range(DRAWS):
        kept = np.isin(np.arange(e.pairs), rng.choice(e.pairs, part, replace=False))
        for _ in range(3):
            x = np.linalg.lstsq(columns[kept], ends[kept])[0]
            missed = ends - columns @ x
            off = np.max(np.abs(missed), axis=1)
            if not (left := float(np.max(off[kept]))) < room:
                break
            kept = off <= LARGER**2 * max(left, ROUNDING)
        # of two maps one has most pairs, and no other draw finds that of more
        if left < room and 2 * np.count_nonzero(kept) > e.pairs:
            break
    else:
        return None
    bad = np.flatnonzero(~kept)
    runs = np.split(bad, np.flatnonzero(np.diff(bad) > 1) + 1)
    single = len(bad) == len(runs)
    often = regularly(bad.tolist()) if single else ""
    most = OFTEN_BAD * e.pairs if often else max(3, FEW_BAD * e.pairs)
    if not 0 < len(bad) <= most:
        return None
    at = [f"from frame {x[0]} to {x[-1] + 1}" for x in runs]
    where = at[0] + often if often else few(at, 3)
    what = _at_once(z[bad + 1], missed[bad] * each[bad] * size) if single else ""
    return Explanation(
        f"The coupled motion is that of one map of all coordinates, but not {where}{what}",
        "look at what happens there: a restart, how those frames are written, or what acts at them alone, as "
        "a removed drift of the centre of mass; or leave them out",
        local=True,
    )


def _at_once(states: Floats, off: Floats) -> str:
    """What happens to all velocities in states (r, 2n) that are `off` one map by this much; "" if nothing is
    common to them."""
    (q, v), (dq, dv) = (np.split(x, 2, axis=1) for x in (states, off))
    v, moved = v - dv, AGREES * np.max(np.abs(dv), axis=1, keepdims=True)
    factor = float(np.sum(dv * v)) / max(float(np.sum(v * v)), 1e-300)
    if np.max(np.abs(dq)) * np.max(np.abs(v)) > np.max(moved) * np.max(np.abs(q)):
        return ""
    if np.all(np.abs(dv - factor * v) <= moved):
        return f": there all velocities are multiplied by {1 + factor:.6g}"
    alike = np.all(np.abs(dv - np.mean(dv, axis=1, keepdims=True)) <= moved)
    removed = "all velocities change by the same, as where the drift of the centre of mass is removed"
    return f": there {removed}" if alike else ""


def _damped(found: Map, e: Evidence) -> str:
    """Phrase that names the scheme with friction that fits the rest of a motion; "" where none does."""
    joints = compare([found], [e.terms], distinct(damped=True), range(1, 2))
    if not joints:
        return ""
    every = [FAMILIES[x.family] for x in joints]
    law = f"{every[0].laws[0]} {every[0].place}".strip() if len(every) == 1 else "friction"
    return f" of {titles(x.scheme for x in every)} with {law}"


WITHOUT_A_GAP = "write every frame, or give a part without a gap"

FOLLOWING = (
    (1, 0, "The motion{whose} stands still for a step: it is repeated at frame {at}",
     "write each frame once, or look for a step that is left out"),
    (1, 2, "{but} frame {at} is missing", WITHOUT_A_GAP),
    *((1, n, f"{{but}} {n - 1} frames are missing from frame {{at}} on", WITHOUT_A_GAP) for n in range(3, 9)),
    (2, 2, "{but} frame {at} is wrong: {amount}{begins}", "look at how that frame is written"),
    (3, 1, "{but} frames {at} and {last} have changed places", "sort the frames by time"),
)  # fmt: skip
"""Bad pairs in a row, the power of the map that leads from the frame before them to the second after it (of
one pair to the first), what has happened, and what to do."""


def _interruption(
    e: Evidence, found: Map, runs: list[NDArray[np.intp]], whose: str, fitting: list[Match]
) -> tuple[str, str]:
    """Cause and remedy of the first of several runs of consecutive bad pairs, by the map of the other frames,
    which is that of `fitting` schemes; of kicks, those of all of them."""
    z, b, run = found.z, found.entries, runs[0]
    first, last = int(run[0]), int(run[-1])
    from_, to, at = z[first], z[first + 1], first + 1
    # as near as the other pairs, or a thousandth of what is missing
    missing = float(np.max(np.abs(z[last + 1] - b @ z[last])))
    room = max(4 * float(np.max(e.unit[run])), 1e-3 * missing)
    off, but = (to - b @ from_).astype(np.float64), f"The motion is one{whose}, but"
    amount, begins = _amount(off, to), "; or a scheme of several steps begins so" * (first == 0)
    known = {"whose": whose, "but": but, "at": at, "last": last, "amount": amount, "begins": begins}
    of_map = powers(b, 1 + max(power for _, power, _, _ in FOLLOWING))
    for pairs, power, cause, remedy in FOLLOWING:
        if len(run) == pairs and np.max(np.abs(z[first + min(pairs, 2)] - of_map[power] @ from_)) <= room:
            return cause.format(**known), remedy
    if len(run) > 1:
        part, so = ("before", "") if first else ("after", ": a solver of several orders or steps begins so")
        cause = f"{but} not from frame {first} to frame {last + 1}{so}"
        return cause, f"look at what happens there, or give the part {part} it"
    back = np.linalg.lstsq(b.astype(np.float64), off)[0]
    if first == 0:
        box = f" positions wrapped into a box of {abs(back[0]) * float(found.size[0]):.6g},"
        box = box if abs(back[0]) > max(np.ptp(z[1:, 0]), 1e2 * abs(back[1])) else ""
        return (
            f"{but} frame 0 does not belong to it: a wrong start,{box} a scheme with memory, whose force "
            "or velocity is that of the step before, or a solver that begins with steps of its own",
            "look at how the start is set and recorded, or leave frame 0 out",
        )
    if at == len(z) - 1:
        return f"{but} frame {at}, the last, is wrong: {amount}", "look at how the last frame is written"
    # a kick leaves the position of a motion of one map to rounding, and another run's start is only near
    still = LARGER * max(float(np.max(e.unit[run])), float(np.max(found.residual)))
    for kick, later in ((back, False), (off, True)):
        if abs(kick[0]) < min(1e-2 * abs(kick[1]), still):
            return _kicked(e, found, np.array([x[0] for x in runs]), later, whose, fitting)
    size = max(float(np.max(np.abs(back))), 1e-16)
    jumps = f"The motion{whose} jumps by {size:.1e} of its size between frames {first} and {at}, as"
    if (digits := round(-math.log10(size))) < 1:
        return f"{jumps} where another run begins", "give each run a file of its own"
    restart = f"after a restart from numbers of {count(digits, 'digit')}"
    return f"{jumps} {restart}", "write restarts in full precision"


def _kicked(
    e: Evidence, found: Map, bad: NDArray[np.intp], later: bool, whose: str, fitting: list[Match]
) -> tuple[str, str]:
    """Cause and remedy of kicks of the velocity in the `bad` pairs (r,), after their steps if `later`, else
    before: what they have in common, or their range."""
    begin, ends = found.z[bad], found.z[bad] @ found.entries.T
    off = (found.z[bad + 1] - ends).astype(np.float64)
    kick = (off if later else np.linalg.solve(found.entries.astype(np.float64), off.T).T)[:, 1]
    q, v = found.z[bad + later, 0].astype(np.float64), (ends if later else begin)[:, 1].astype(np.float64)
    at, room = int(bad[0]) + later, np.maximum(e.unit[bad], HALF_STEP * np.abs(kick))
    but, look = f"The motion is one{whose}, but", "look for what acts at that step alone"
    for match in fitting:
        # half a step of the force there, T h F/m = -a s q of s steps: what a leapfrog is early by
        half = match.a * match.stride * q * float(found.size[0] / found.size[1]) / 2
        side = np.sign(kick[0] * half[0])
        if np.all(np.abs(kick - side * half) < HALF_STEP * np.abs(half)):
            return (
                f"{but} from frame {at} on its velocity is that of half a step "
                f"{'before' if side > 0 else 'after'}, as after a restart from a leapfrog's velocities",
                "move a leapfrog's velocities by half a kick where they are read, or restart with one scheme",
            )
    sizes = kick * float(found.size[1] / e.record.interval)
    factor = float(kick @ v) / max(float(v @ v), 1e-300)
    if len(kick) == 1 or np.all(np.abs(kick - np.mean(kick)) <= room):
        return f"{but} for one kick of {sizes[0]:+.3g} of the velocity at frame {at}", look
    if np.all(np.abs(kick - factor * v) <= room):
        return f"{but} its velocity is multiplied by {1 + factor:.6g} at frame {at}", look
    least, most = np.min(sizes), np.max(sizes)
    return f"{but} for kicks of {least:+.3g} to {most:+.3g} of the velocity at frame {at}", look


def _amount(off: Floats, state: Extended) -> str:
    share = np.abs(off) / float(np.max(np.abs([state, state - off])))
    name = "velocity" if share[1] > share[0] else "position"
    return f"its {name} is off by {float(np.max(share)):.2g} of the state's size"
