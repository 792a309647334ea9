"""Alternatives to an identification, and which further data would exclude them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.identify.clock import FEWEST_STATES
from springcheck.identify.compare import Target, compare
from springcheck.identify.evidence import Measured
from springcheck.identify.families import FAMILIES, title, titles
from springcheck.identify.fit import Map
from springcheck.identify.guesses import Guesses
from springcheck.identify.hypothesis import ERRORS, SURE, Joint, Terms
from springcheck.identify.maps import table
from springcheck.identify.record import DEEP, Record
from springcheck.identify.result import OR_UNKNOWN, Explanation, Identification
from springcheck.identify.search import coincident, identical
from springcheck.text.wording import count, either

APART = 10.0
"""Standard errors between schemes that are always told apart: five to exclude one, five for chance."""

MOST_DIGITS = 9
"""Most additional digits that are asked for, those of double over single precision."""

FEWEST_OF_TEXT, FEWEST_DIGITS = 12, 40.0
"""Fewest frames of text that show the motion, and fewest digits of it in all frames of text or single
precision, from which a scheme is named: some 24 frames of 3 digits, or 6 of 7.  A map, its equilibrium and a
start have seven unknowns."""

CERTAIN_STEPS = 12
"""Most steps to a frame from which coarse numbers name a scheme: truncation errors of more are too alike."""

MOST_PARTS, MARK = 6, 1e-9
"""Largest n of a friction h k/(n m) that is a fault's, and the relative difference up to which it is that."""

DIVIDED = " whose velocity is divided by the mass in every step"
MOMENTUM = "return the momentum, m v, where momenta are passed on"
"""The cause of a step from p that returns v, and its remedy."""

FACTORS = "compare the factors 1/2 of the step with the scheme's"
"""Remedy of a scheme that is written down wrongly."""

LEAPFROG = {
    "semi-implicit-euler": "leapfrog with velocities half a step early",
    "semi-implicit-euler-drift-kick": "leapfrog with velocities half a step late",
}


def separation(seen: Measured, one: Joint, other: Joint) -> float:
    """Mahalanobis distance between two schemes' best maps, by the other's errors."""
    total = 0.0
    for found, terms, a, b in zip(seen.maps, seen.terms, one.parts, other.parts, strict=True):
        target, first = Target(found, terms), np.zeros(1, np.int64)
        at = Guesses(which=first, root=first, a=np.array([b.a]), g=np.array([b.g]))
        weight = target.weight(table((FAMILIES[b.family],)), at, np.array([float(b.stride)]))[:, 0]
        off = target.axes.T @ (np.array(a.predicted) - np.array(b.predicted)).astype(np.float64)
        total += float(np.sum((weight * off) ** 2))
    return math.sqrt(total)


def of_few(record: Record, found: Identification) -> Identification:
    """Withhold the name where the frames of text or single precision are too few to exclude other schemes.
    Raises IdentificationError where no scheme fits so few."""
    if record.fine:
        return found
    fewest, of_text = (FEWEST_OF_TEXT, " of text") if record.text else (FEWEST_STATES - 1, "")
    # a motion that has died down to its equilibrium shows nothing any more
    rounded = ((record.q, record.q_quantum), (record.v, record.v_quantum))
    shown = [np.abs(x - np.median(x, axis=0)) / np.where(unit > 0, unit, 1) for x, unit in rounded]
    seen = [np.max(np.clip(x, 1.0, 1e99), axis=1).astype(np.float64) for x in shown]
    frames = min(int(np.count_nonzero(x > 1)) for x in seen)
    digits = min(float(np.sum(np.log10(x))) for x in seen)
    if frames >= fewest and digits >= FEWEST_DIGITS:
        return found
    fewest = max(fewest, math.ceil(FEWEST_DIGITS * frames / max(digits, 1.0)))
    more = f"give {fewest} frames or more that show it, or more digits"
    few = f"motion shows in {count(frames, 'frame')}{of_text}, too few to exclude a scheme"
    if not found.candidates:
        raise IdentificationError(f"no known scheme fits, but the {few}: {more}")
    return found.doubted(f"The {few}; what fits: {found.statement}", f"what would tell: {more}")


def beside_unknown(record: Record, found: Identification, *, stated: bool, seen: bool) -> Identification:
    """Add "or a scheme that is not known here" where the numbers or times do not exclude one.

    With an unknown number of steps, maps between two schemes fit as well, and above `CERTAIN_STEPS` none is
    named, except for `deep` records.  Where the exact flow fits, so does any scheme of invisible error; and
    where the error of the scheme's step, or the law of its friction, is not `seen`, another fits as well.
    """
    few = found.scheme or any(x.stride <= CERTAIN_STEPS for x in found.candidates)
    clear = record.jitter < DEEP
    # numbers that do not separate two schemes do not exclude an unknown one between them
    one = found.scheme and len({x.stride for x in found.candidates}) == 1
    near = not (one and seen) or any(x.scheme == "exact" for x in found.candidates)
    certain = stated or found.stride == 1 or (record.deep and clear and few) or found.scheme == "exact"
    if not found.fits or (certain and not near):
        return found
    more = "more digits" if near else "the step, stated"
    tells = [f"what would tell: {more}"] if found.scheme or not near else []
    out = replace(found.noting(*tells), statement=found.statement + OR_UNKNOWN)
    if found.scheme in (None, "exact") or min(x.stride for x in found.candidates) <= CERTAIN_STEPS:
        return out
    return replace(out, verdict="not told apart", scheme=None, aliases=())


def of_either_sign(found: Identification, against: Explanation | None) -> Identification:
    """Withhold the name where coarse positions move `against` the velocities: a spring that nearly completes
    a turn between two frames looks like a slow one with -v."""
    if not (found.candidates and against):
        return found
    cause = f"{against.cause}; or the motion nearly comes round between two frames: {found.statement}"
    remedy = f"{against.remedy}; if they are right, state the stiffness, which tells the two apart"
    return found.doubted(cause, because=(Explanation(cause, remedy, local=True),))


def of_stated_friction(found: Identification, stated: float, mass: float) -> Identification:
    """The cause where no law gives the stated friction c [M/T]; of a stated 0 the mark of a fault."""
    rates = sorted(mass * x.friction[0] for x in found.candidates)
    whose = titles(x.scheme for x in found.candidates)
    low, high = rates[0], rates[-1]
    if not (low or high):
        cause = f"{whose}, but without friction, where c = {stated:g} is stated"
    elif not stated:
        cause = f"{whose}, but with a friction, c = {_between(low, high)} where 0 is stated"
    else:
        share = _between(*sorted((low / stated, high / stated)))
        cause = f"{whose}, but with a friction {share} times the stated"
    remedy = "look at the unit of the friction, c or c/m, and at how often a step applies it"
    if not stated:
        remedy = "look for a friction that the program has, and for a scheme that is written down wrongly"
        if (fault := _fault(found, stated=True)) is not None:
            cause, remedy = fault.cause, fault.remedy
    return replace(
        found.noting("the stated friction does not fit by any of the laws that are known"),
        statement=found.statement if found.explanations else cause,
        explanations=(*found.explanations, Explanation(cause, remedy)),
    )


def _between(low: float, high: float) -> str:
    """One number, or the range of the values under several friction laws."""
    if abs(high - low) <= 1e-6 * abs(high):
        return f"{high:.6g}"
    return f"{low:.5g} to {high:.5g} (by its law)"


def of_unasked_friction(found: Identification, mass: float) -> Identification:
    """Reject the friction of a faulty or implicit scheme, or a decay by the mass [M], unless a scheme without
    friction has the stated stiffness."""
    fault = (divided(found, mass) or _fault(found)) if found.fits else None
    return found if fault is None else found.refuted(fault.cause, fault)


def by_mass(g: float, mass: float) -> bool:
    """Whether a velocity that decays by exp(-g) is divided by the mass [M], which may be NaN."""
    return mass > 0 and mass != 1 and abs(g / math.log(mass) - 1) < MARK


def divided(found: Identification, mass: float) -> Explanation | None:
    """The cause of a decay of the velocity by the factor 1/m in a step; None of another motion."""
    for x in found.candidates:
        if x.law and len(x.friction) == 1 and by_mass(x.friction[0] * x.step, mass):
            return Explanation(f"{title(x.scheme)}{DIVIDED}", MOMENTUM)
    return None


def _fault(found: Identification, *, stated: bool = False) -> Explanation | None:
    """A friction c/m = h k/(n m), n an integer: the mark of a faulty or implicit scheme; None for another.
    `stated` is whether a friction of 0 is."""
    if not all(x.law for x in found.candidates):
        return None
    for one in found.candidates:
        for w, rate, det in zip(one.omega, one.friction, found.determinant, strict=True):
            a = (w * one.step) ** 2
            # every law of friction gives the same loss of area in a step; an inverted spring has no a
            lost = [rate * one.step, 1 - det, 1 / det - 1] if a > 0 and det > 0 else []
            lost = [x for x in lost if abs(x - lost[0]) <= a * lost[0]]
            parts = [n for x in lost for n in range(1, MOST_PARTS + 1) if abs(x * n / a - 1) < MARK]
            if not parts:
                continue
            n = parts[0]
            part = "h k/m" if n == 1 else f"h k/({n} m)"
            unasked = "where 0 is stated, which" if stated else "that was not stated and"
            cause = (
                f"{titles([one.scheme])} with a friction c/m = {rate:.6g} {unasked} loses as much area as "
                f"{part}: the mark of a scheme that is written down wrongly, or of an implicit one"
            )
            cause += "" if stated else "; state the friction if not"
            return Explanation(cause, "compare the factors 1/2 of the step with the scheme's")
    return None


def hidden_friction(record: Record, found: Map) -> float:
    """Largest friction rate c/m [1/T] that the determinant and its standard error admit."""
    gradient = np.linalg.inv(found.entries.astype(np.float64)).T.reshape(4)
    error = math.sqrt(float(gradient @ found.covariance @ gradient))
    loss = abs(math.log(abs(float(np.linalg.det(found.entries.astype(np.float64))))))
    return (loss + ERRORS * error) / abs(float(record.interval))


def same_maps(seen: Measured, joint: Joint) -> list[str]:
    """Note on a damped spring of the same map, and what tells it from the undamped scheme."""
    names, record = coincident(joint.scheme), seen.record
    if not names or joint.stride != 1:
        return []
    terms = [Terms(mass_unknown=record.momenta, jitter=record.jitter) for _ in seen.maps]
    found = compare(seen.maps, terms, tuple(FAMILIES[x] for x in names), range(1, 2))
    out = []
    for x in found[:1]:
        omega, stiffness, friction = seen.numbers(x)
        of = f"stiffness {stiffness[0]:.9g}" if stiffness else f"angular frequency {omega[0]:.9g}"
        out.append(
            f"the same map is {x.scheme} on a damped spring of {of} and friction c/m {friction[0]:.6g}: "
            "the stiffness or the friction, where known, tells the two apart"
        )
    return out


def untold(seen: Measured, joints: list[Joint]) -> list[str]:
    """Why several schemes or numbers of steps remain, and what further data would distinguish them."""
    simplest, record = joints[0], seen.record
    if seen.vague:
        why = f"the times leave the interval open by {record.jitter:.1e} of it, and each scheme has its own"
        told = ["more digits of the times", "the step with all of its digits"]
    elif simplest.scheme == "exact":
        why = "no error of a step is visible: fine steps of many schemes come as near to the exact flow"
        told = ["more digits", "a larger step"]
    else:
        others = [x for x in joints[1:] if (x.scheme, x.stride) != (simplest.scheme, simplest.stride)]
        apart = ((separation(seen, simplest, x), x) for x in others)
        least, nearest = min(apart, key=lambda pair: pair[0])
        digits = math.ceil(math.log10(APART / least)) if least > 0 else MOST_DIGITS + 1
        pair = f"the data cannot tell these apart: the maps of {simplest} and {nearest}"
        if digits > MOST_DIGITS or identical(simplest, nearest, free_scale=record.momenta):
            other = "mass" if record.momenta else "stiffness"
            friction = " and friction" if simplest.damped or nearest.damped else ""
            why, told = f"{pair} are the same, on springs of different {other}{friction}", []
        else:
            why = f"{pair} are {least:.1g} standard errors of the numbers' rounding from each other"
            told = [f"about {count(digits, 'more digit')}", "a larger step"] if digits > 0 else []
            told += ["more frames"] if digits <= 2 else []
    if record.momenta:
        told.append("the mass")
    elif seen.stiffness is None and any(_stiffer(x, simplest) for x in joints):
        told.append(f"the {'mass and the ' * (record.mass is None)}stiffness, where known: they differ in it")
    return [why, *([f"what would tell them apart: {either(told)}"] if told else [])]


def _stiffer(one: Joint, other: Joint) -> bool:
    """Whether two schemes imply significantly different stiffnesses."""
    return any(
        abs(a.a * one.stride**2 - b.a * other.stride**2)
        > SURE * (a.a_error * one.stride**2 + b.a_error * other.stride**2)
        for a, b in zip(one.parts, other.parts, strict=True)
    )
