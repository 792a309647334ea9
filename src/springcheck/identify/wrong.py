"""Linear maps of faulty schemes: mistakes in a step, friction of the wrong sign, wrong units."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np

from springcheck.identify.compare import compare
from springcheck.identify.evidence import AGREES, Evidence, Measured, matched
from springcheck.identify.families import (
    FAMILIES,
    FAULTS,
    G_ROUNDING,
    KNOWN_ELSEWHERE,
    MOST_TITLES,
    SUBTRACTED,
    Family,
    title,
    titles,
)
from springcheck.identify.hypothesis import SURE, Joint, Match, distinct, same_map
from springcheck.identify.notes import DIVIDED, FACTORS, MARK, MOMENTUM, MOST_PARTS, by_mass
from springcheck.identify.result import Explanation
from springcheck.identify.storage import ROUNDING
from springcheck.identify.unknown import MAP_OF, ONE_MAP, by_parameter, misfit
from springcheck.text.wording import few


@cache
def _faults() -> tuple[Family, ...]:
    """Faults that have no scheme's map; kick-drift with velocities a step ahead, say, is drift-kick."""
    return tuple(f for f in FAULTS if not any(same_map(f, scheme) for scheme in distinct(damped=False)))


@cache
def faults_like(scheme: str) -> tuple[Family, ...]:
    """Faults that have this scheme's map."""
    return tuple(f for f in FAULTS if same_map(f, FAMILIES[scheme]))


def wrong_map(e: Evidence) -> list[Explanation]:
    """Faulty schemes, negative friction, wrong scales of the velocities; the likeliest first.

    A fault that has a scheme's map is that scheme on another spring, unless the stiffness is stated.
    """
    ranked: list[tuple[int, Explanation]] = []
    fitting = matched(e.found, e.terms)
    for joint in compare([e.found], [e.terms], _faults(), range(1, 5)):
        family = FAMILIES[joint.family]
        steps = "" if joint.stride == 1 else f", {joint.stride} steps to a frame"
        cause = f"{family.cause}{steps}"
        rank = _rank(e, joint)
        if rank == OF_ANOTHER_SPRING and e.stated:
            ratio = joint.parts[0].a * joint.stride**2 / e.stated
            cause += f", but of a spring {ratio:.6g} times as stiff as stated"
        ranked.append((rank, Explanation(cause, family.remedy, joint.misfit, hypothesis=joint.parts[0])))
    if fitting:
        each = {x: Joint(family=x.family, stride=x.stride, parts=(x,)) for x in fitting}
        of_stated = [x for x, joint in each.items() if _rank(e, joint) == 0]
        # a fault explains no more than a scheme of the stated stiffness does
        own = [x for rank, x in ranked if rank == 0 and e.stiffness is not None and not of_stated]
        return own or [_unlike(e, fitting) or _departing(e, of_stated or fitting)]
    ranked += [(2, x) for x in _negative_friction(e)]
    scaled, certain = _scales(e)
    if certain and (other := by_parameter(e)):
        # on a spring another mass and the parameter of a method may be one map
        scaled = [replace(x, cause=f"{ONE_MAP}: {MAP_OF}{other}; or {x.cause}") for x in scaled]
    if certain and ranked and min(ranked, key=lambda pair: pair[0])[0] == 0:
        # a drift of half the step, say, is one in twice the mass
        also = f"; or {scaled[0].cause}"
        ranked = [(r, replace(x, cause=x.cause + also, hypothesis=None) if r == 0 else x) for r, x in ranked]
    # factors that mean nothing, one for each of several schemes, say less than the kind of the map
    ranked += (
        [(1, x) for x in scaled] if certain else [(4, x) for x in (misfit(e), *scaled)] if scaled else []
    )
    ranked.sort(key=lambda pair: pair[0])
    if len(ranked) > 1 and ranked[0][0] == ranked[1][0]:
        # causes that are as likely have each a stiffness of its own
        ranked[0] = ranked[0][0], replace(ranked[0][1], hypothesis=None)
    return [x for _, x in ranked]


def exchanged(e: Evidence) -> Explanation | None:
    """Positions and velocities, or momenta, in each other's place, if a scheme has their map once they are
    put right."""
    mass = None if e.record.mass is None else float(e.record.mass[e.j])
    for rates, m in (("velocities", 1.0), ("momenta", mass or 1.0)):
        found, per = e.found, np.array([m, 1 / m]) * e.record.interval ** np.array([-1, 1])
        right = replace(
            found, entries=found.entries[::-1, ::-1], covariance=found.covariance[::-1, ::-1],
            size=found.size[::-1] * per, centre=found.centre[::-1] * per, z=found.z[:, ::-1],
        )  # fmt: skip
        if fitting := matched(right, e.terms):
            whose = titles(x.scheme for x in fitting)
            return Explanation(
                f"Positions and {rates} are exchanged: put right they are those of {whose}",
                "write each number in the column of its name",
                hypothesis=fitting[0] if len({x.scheme for x in fitting}) == 1 else None,
            )
    return None


def _unlike(e: Evidence, fitting: list[Match]) -> Explanation | None:
    """The cause where each coordinate's map may be a scheme's, and no scheme has all of them."""
    names = {x.scheme for x in fitting}
    for found in e.others:
        names &= {x.scheme for x in matched(found, e.terms)}
    if names:
        return None
    return Explanation(
        f"The map of coordinate {e.j} alone may be that of {titles(x.scheme for x in fitting)}, but no known "
        "scheme has the maps of all coordinates: one that takes some forces in other steps, as r-RESPA, or "
        "an unknown one",
        "compare the order of its stages and their coefficients with the scheme's; give one coordinate alone",
    )


def _departing(e: Evidence, fitting: list[Match]) -> Explanation:
    size, names = float(np.max(np.abs(e.residuals))), {x.scheme for x in fitting}
    whose = f"that of {titles(x.scheme for x in fitting)}" if len(names) > 1 else f"{title(*names)}'s"
    return Explanation(
        f"The map is {whose}, but single steps depart from it by up to {size:.1e} of the state's size, which "
        "no arithmetic that is known explains",
        "look at what is rounded, rescaled or added in a step beside positions, velocities and forces",
        size,
        hypothesis=fitting[0] if len(names) == 1 else None,
    )


OF_ANOTHER_SPRING = 3
"""Rank of a cause on another spring than the stated one."""


def _rank(e: Evidence, joint: Joint) -> int:
    """0 for a fault of the stated stiffness, or if none is stated of one step to a frame; 2 of more steps, 3
    of another stiffness."""
    if (stated := e.stated) is None:
        return 0 if joint.stride == 1 else 2
    part = joint.parts[0]
    room = 1e-7 + part.a_room + 2 * e.record.jitter
    return 0 if abs(part.a * joint.stride**2 - stated) <= room * abs(stated) else OF_ANOTHER_SPRING


def _negative_friction(e: Evidence) -> list[Explanation]:
    joints = [
        x
        for x in compare([e.found], [replace(e.terms, growing=True)], distinct(damped=True), range(1, 3))
        if x.parts[0].g < -SURE * (x.parts[0].g_error + G_ROUNDING)
        and not (e.stated and _rank(e, x) == OF_ANOTHER_SPRING)
    ]
    if not joints:
        return []
    best = min(joints, key=lambda x: x.simplicity)
    rate = best.parts[0].g * best.stride / float(e.record.interval)
    part, mass = best.parts[0], math.nan if e.record.mass is None else float(e.record.mass[e.j])
    gains = -part.g, math.expm1(-part.g), -math.expm1(part.g)
    cause = f"{title(best.scheme)} with a negative friction, c/m = {rate:.4g}, which feeds energy in"
    remedy = "change the sign of the damping force"
    if any(abs(x * n / part.a - 1) < MARK for x in gains for n in range(1, MOST_PARTS + 1)):
        cause += ", by a share of h k/m: the mark of a scheme that is written down wrongly"
        remedy = FACTORS
    elif by_mass(part.g, mass):
        cause, remedy = f"{title(best.scheme)}{DIVIDED}", MOMENTUM
    return [Explanation(cause, remedy, best.misfit, hypothesis=part)]


def _either_way(factor: float, meaning: str) -> tuple[tuple[float, str], tuple[float, str]]:
    return (factor, meaning), (1 / factor, meaning)


MIXED = "kcal and kJ are mixed up"

TIMES = ", but times are "
"""Beginning of the meaning of a step that is another than the times say."""

NEARLY = 32.0
"""Ratio of distances from a factor up to which schemes mean it alike: rounding differs by less."""

CONSTANTS = (
    (math.degrees(1), "positions are in degrees, velocities in radians"),
    (math.radians(1), "positions are in radians, velocities in degrees"),
    # times [fs] of A sqrt(u/eV), and of A sqrt(u mol/kcal)
    *_either_way(10.180505710759414, "1 unit of time of ASE is 10.1805 fs"),
    *_either_way(48.88821290839616, "1 unit of time of CHARMM (AKMA) is 48.888 fs"),
    *_either_way(4.184, MIXED), *_either_way(math.sqrt(4.184), MIXED),
    *_either_way(2 * math.pi, "a factor 2 pi"),
    *((10.0**n, f"a factor {10.0**n:g}, as between two units") for n in (-6, -3, -2, -1, 1, 2, 3, 6)),
    (2.0, "a factor 2"), (0.5, "a factor 1/2"),
)  # fmt: skip
"""Known factors between the units of velocities and positions, and their meaning."""


def _times(factor: float) -> str:
    return f"{factor:.{6 if abs(factor - 1) > 1e-4 else 12 if abs(factor - 1) > 1e-10 else 15}g}"


def _scales(e: Evidence) -> tuple[list[Explanation], bool]:
    """Schemes that fit at another scale of the velocities, with its meaning, and whether it has one: a known
    factor, or agreement with the stated stiffness."""
    if e.terms.mass_unknown:
        return [], False
    loose = replace(e.terms, mass_unknown=True, vague=False)
    fitting = compare([e.found], [loose], (*distinct(damped=False), *KNOWN_ELSEWHERE), range(1, 4))
    fitting = [x for x in fitting if abs(x.parts[0].log_mass) > SURE * x.parts[0].mass_error + 4 * ROUNDING]
    of_stated = [x for x in fitting if e.stated is not None and _rank(e, x) == 0]
    fitting = of_stated or fitting
    meant = [(x, *meaning) for x in fitting if (meaning := _meaning(e, x))]
    # a factor that agrees with the stated stiffness says more than one that is well known
    meant = [x for x in meant if x[1]] or meant
    # another scheme comes near a factor in several steps, or with a factor of its own; the right one has it
    least = min((x[4] for x in meant), default=0.0)
    if least <= AGREES:
        meant = [x for x in meant if x[4] <= NEARLY * least + ROUNDING]
    elif len({x.scheme for x, *_ in meant}) > 1 and all(said.startswith(TIMES) for _, _, said, *_ in meant):
        return [], False
    if meant:
        # schemes that differ by less than the numbers show would each mean the same
        names: dict[str, list[str]] = {}
        for x, _, said, *_ in meant:
            names.setdefault(said, []).append(x.scheme)
        x, _, _, remedy, _ = meant[0]
        cause = "; or ".join(f"{titles(schemes)}{said}" for said, schemes in names.items())
        return [Explanation(cause, remedy, x.misfit)], True
    if not fitting:
        return [], False
    x = fitting[0]
    scale = {str(y): math.exp(-y.parts[0].log_mass) for y in fitting}
    one = scale[str(x)]
    larger = f"{one:.6g} times as large" if abs(one - 1) > 1e-5 else f"larger by {one - 1:+.1e} of their size"
    of_mass = (
        ""
        if e.stiffness is not None or e.record.mass is None
        else f", or if the mass were {_times(1 / one)} times as large"
    )
    cause = f"{str(x).replace(x.scheme, title(x.scheme))} would fit if velocities were {larger}{of_mass}"
    if len(fitting) > 1:
        # symmetric schemes have the same map but for the scale, so each has one of its own
        each = few([f"{name}: {value:.6g}" for name, value in scale.items()], MOST_TITLES, "; ")
        cause = f"Several schemes would fit at a scale of velocities, each at a factor of its own: {each}"
    advice = "look at the mass, at the units of velocities and times, and at whether dq/dt = p/m"
    alone = of_stated if e.stated is not None else fitting if e.record.fine else []
    return [Explanation(cause, advice, x.misfit)], len(alone) == 1 and abs(one - 1) > AGREES


def _meaning(e: Evidence, x: Joint) -> tuple[bool, str, str, float] | None:
    """Agreement of a velocity scale with the stated stiffness, its meaning, what to do, and the relative
    distance, beyond errors, from the factor that means it: if that may be any, from one, or from a step, of
    few digits.  None without a meaning."""
    part = x.parts[0]
    scale = math.exp(-part.log_mass)
    known = SURE * part.mass_error + part.a_room + e.record.jitter + 32 * ROUNDING
    h = float(e.record.interval) / x.stride
    mass = math.nan if e.record.mass is None else float(e.record.mass[e.j])
    stiffer = part.a * x.stride**2 / e.stated if e.stated else math.nan
    agrees = any(abs(stiffer / scale**n - 1) <= known for n in range(3))
    for factor, power, meaning, remedy in _meanings(scale, mass, h, stated=bool(e.stated)):
        room = known + (AGREES if power in (None, 0) else 0.0)
        if (factor is None or abs(scale / factor - 1) <= AGREES + known) and (
            power is None or abs(stiffer / scale**power - 1) <= room
        ):
            off = [abs(y / float(f"{y:.3g}") - 1) for y in (scale, 1 / scale, abs(h) * scale)]
            return agrees, meaning, remedy, max((abs(scale / factor - 1) if factor else min(off)) - known, 0)
    return None


def _meanings(
    scale: float, mass: float, h: float, *, stated: bool
) -> list[tuple[float | None, int | None, str, str]]:
    """Possible meanings of a scale of the velocities: the scale, and the power of it by which the stiffness
    differs from the stated one, None where either may be any; the meaning, and what to do."""
    large, factor = f", but velocities would have to be {scale:.6g} times as large: ", _times(1 / scale)
    taken = f"{1 / scale:.6g} times what was stepped: the step taken is {scale:.6g} times theirs"
    if abs(scale - 1) <= 1e-2:
        taken = f"not what was stepped: the step taken is longer than theirs by {scale - 1:.3g} of it"
    known = not math.isnan(mass)
    of_mass = f"; or the mass {factor} times as large" if known and not stated else ""
    units = "look at the units of positions, velocities and times"
    return [
        (1 / h**2, 2, ", but the step taken is 1/h: it divides by the step", "multiply by the step"),
        (None, 2, f"{TIMES}{taken}",
         "look at how time is counted: the times are wrong by that factor"),
        (mass, 0, ", but p is treated as a velocity: dq/dt = p and dp/dt = F/m",
         "divide p by the mass in the drift only"),
        (mass, None, ", but the mass is left out: dq/dt = p", "divide the momentum by the mass in the drift"),
        (1 / mass, None, ", but velocities are divided by the mass once more",
         "divide the momentum by the mass once"),
        (1 / h**2, 1, f"{large}the drift divides by the step", "multiply by the step"),
        # what divides momenta and forces alike
        (None if known else mass, 1, f" in a mass {factor} times the stated one",
         "look at the mass and its units: dq/dt = p/m and (h w)**2 = h**2 k/m show the same other one"),
        *((value, None, f"{large}{meaning}{of_mass}", units) for value, meaning in CONSTANTS),
    ]  # fmt: skip


def faults_of(seen: Measured, friction: float | None) -> list[Explanation]:
    """Faulty schemes of the stated stiffness and friction."""
    e = seen.evidence(0)
    rate = None if friction is None or e.record.mass is None else friction / float(e.record.mass[e.j])
    joints = compare([e.found], [e.terms], _faults(), range(1, 3))
    for x in compare([e.found], [e.terms], SUBTRACTED, range(1, 3)):
        is_, error = (y * x.stride / float(e.record.interval) for y in (x.parts[0].g, x.parts[0].g_error))
        if is_ > SURE * error and (rate is None or abs(is_ - rate) <= SURE * error + 1e-9 * rate):
            joints.append(x)
    return [
        Explanation(FAMILIES[x.family].cause, FAMILIES[x.family].remedy, x.misfit)
        for x in joints
        if _rank(e, x) == 0
    ]


def stiffness_ratio(ratio: float, mass: float | None, stiffness: float) -> str:
    """Meanings of a stiffness that is `ratio` times the stated one; "" where there is none."""
    if ratio < 0:
        also = "" if abs(ratio + 1) < 1e-5 else stiffness_ratio(-ratio, mass, stiffness)
        return "the force has the wrong sign" + f", and {also}" * bool(also)
    m, k = math.nan if mass is None else mass, stiffness or math.nan
    known = (
        (1 / 4.184, "kcal taken for kJ"), (4.184, "kJ taken for kcal"),
        *_either_way(4.814 / 4.184, "4.814 kJ to a kcal instead of 4.184"),
        (2.0, "k q**2 taken for k/2 q**2"), (0.5, "k/2 q**2 taken for k q**2"),
        *((10.0**n, "another unit of length or energy") for n in (-6, -4, -3, -2, -1, 1, 2, 3, 4, 6)),
        (1 / m, "the force is divided by the mass although p is a momentum"), (m, "the mass is left out"),
        (1 / k, "the stiffness is left out"), (k, "the stiffness is squared"),
        ((m / k) ** 2, "mass and stiffness are exchanged"),
        (math.radians(1), "the force takes positions for degrees"),
    )  # fmt: skip
    return ", or ".join(dict.fromkeys(text for value, text in known if abs(ratio / value - 1) < 1e-5))
