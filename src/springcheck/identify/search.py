"""The search: hypotheses in order of simplicity, those that the states do not exclude, and of these those
whose every step a known arithmetic explains."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from typing import TypeAlias

import numpy as np

from springcheck.identify.arithmetic import SINGLE, Defect, defects
from springcheck.identify.coarse import over_single
from springcheck.identify.compare import nearest
from springcheck.identify.evidence import FIXED, Measured
from springcheck.identify.families import DAMPED_ELSEWHERE, FAMILIES, HELD, KNOWN_ELSEWHERE, Family
from springcheck.identify.fit import Map, fit
from springcheck.identify.guesses import roots_of
from springcheck.identify.hypothesis import EXCLUDED, FEW, MANY, STRIDES, Joint, Terms, distinct, likely
from springcheck.identify.interrupted import remembered
from springcheck.identify.maps import unit
from springcheck.identify.record import Record
from springcheck.identify.storage import ROUNDING
from springcheck.physics.arrays import Floats

BIAS = 3.0
"""Bias of an entry by truncated forces, in units of the residual.  Truncation has a mean of half an ulp and a
standard deviation of 0.29; the rest is for roundings that recur with the motion."""

POOR = 8.0
"""Chi-squared of three degrees of freedom that is exceeded with a probability of 5 %."""

ONE_MORE = 4.0
"""Decrease of chi-squared by one more unknown that is exceeded with a probability of 5 %."""

LEAST_OF_SINGLE = 2.0**-27
"""Least residual, relative to the state, of states that are computed in single precision: one rounding has a
root mean square of 2**-24.8 to 2**-25.8 of a number, and most numbers are below the size of the state."""

PLAIN = 30.0
"""Distance of the exact solution's map, in residuals, from which a scheme's truncation error is visible."""

AS_NEAR = 1.5
"""Ratio of residuals up to which the arithmetic of one scheme explains those of another."""

SAME_MAP = 1e-12
"""Largest difference of the entries of equal maps in double precision."""

Explained: TypeAlias = dict[Joint, list[Defect]]
"""Hypotheses, the simplest first, with the defect of each oscillator, which a known arithmetic explains."""


@cache
def coincident(name: str) -> tuple[str, ...]:
    """Damped families with the undamped map of this scheme, on springs of another stiffness."""
    wanted = np.asarray(unit(FAMILIES[name], np.array([0.3, 0.7, 1.1]), np.zeros(3)), np.float64)
    if not np.all(np.log(np.abs(np.linalg.det(wanted))) < -1e-9):
        return ()
    every = distinct(damped=True)
    which, root, _, g = roots_of(every, wanted, SAME_MAP)
    good = {(i, j) for i, j, x in zip(which.tolist(), root.tolist(), g.tolist(), strict=True) if x > 1e-6}
    return tuple(f.name for i, f in enumerate(every) if all((i, j) in good for j in range(3)))


def identical(one: Joint, other: Joint, *, free_scale: bool) -> bool:
    """Whether two hypotheses have the same one-step maps, so that no number of digits tells them apart."""
    if one.stride != other.stride:
        return False
    both = FAMILIES[one.family], FAMILIES[other.family]
    wanted = np.concatenate(
        [unit(both[0], np.array([x.a]), np.array([x.g])).astype(np.float64) for x in one.parts]
    )
    roots = roots_of(both[1:], wanted, SAME_MAP, free_scale=free_scale)[1]
    return len(set(roots.tolist())) == len(wanted)


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One round of the search: families, tolerances beside standard errors, and ranges of strides."""

    damped: bool = False
    rounding: float = ROUNDING
    bias: float = 0.0
    strides: tuple[range, ...] = (FEW,)

    @property
    def families(self) -> tuple[Family, ...]:
        return (*distinct(damped=True), HELD) if self.damped else distinct(damped=False)


def accounted(seen: Measured) -> tuple[Measured, Explained, bool]:
    """The data as fitted, the hypotheses whose every step a known arithmetic explains, and whether any
    hypothesis fits, explained or not.

    In turn: the schemes of the catalogue, in coarse files also with a fitted equilibrium; Verlet with another
    first step; schemes of the stated stiffness; schemes elsewhere; step or mass in single precision.
    """
    fine = seen.record.fine
    joints, wide = find(seen)
    way, found, fitting = seen, explained(wide, joints), bool(joints)
    apart = seen
    if not (fine or any(_agrees(seen, x) for x in found)):
        # an equilibrium beside 0 that a short or coarse file does not show may still be there
        each = zip(seen.moving, seen.maps, strict=True)
        apart = replace(
            seen, maps=[x if np.any(x.centre) else fit(seen.record, j, constant=True) for j, x in each]
        )
    if not (found or fine):
        joints, wide = find(apart)
        found = explained(wide, joints)
        way = apart if found else seen
    if not found:
        later, joints = remembered(seen)
        if found := explained(later, joints):
            way = later.noting(
                "the first step has the friction of the first velocity: none is half a step old"
            )
    if found and seen.stiffness is not None and not (fine or any(_agrees(way, x) for x in found)):
        # friction, or an equilibrium beside 0, is as simple as another spring than the stated one
        ways = ((x, damped) for x in (way, apart) for damped in (False, True))
        for other, damped in ways:
            of_stated = (x for x in other.compare(distinct(damped=damped), FEW) if _agrees(other, x))
            if more := explained(other, likely(list(of_stated))):
                way, found = other, more
                break
    found = _or_elsewhere(way, found)
    if not _of_few_steps(found):
        # few steps, one of them rounded, are simpler than many
        joints, remark = _single_parameters(way)
        if rounded := explained(way, joints):
            way, found = way.noting(remark), rounded
    return way, found, fitting


def _agrees(seen: Measured, x: Joint) -> bool:
    """Whether a hypothesis has the stated step and stiffness."""
    return seen.stride in (None, x.stride) and (seen.stiffness is None or not seen.disagreements(x))


def _of_few_steps(found: Explained) -> bool:
    return any(x.stride in FEW for x in found)


def _or_elsewhere(seen: Measured, found: Explained) -> Explained:
    """The hypotheses found, and the schemes that springcheck does not run and the states do not exclude."""

    def elsewhere(strides: range) -> Explained:
        joints = seen.compare(KNOWN_ELSEWHERE, strides) or seen.compare(DAMPED_ELSEWHERE, strides)
        return explained(seen, likely(joints))

    if not _of_few_steps(found):
        # few steps of a scheme elsewhere are simpler than many of one in the catalogue
        return {**elsewhere(FEW), **found}
    if seen.stride is not None or seen.stiffness is not None:
        right = {x.scheme for x in found if _agrees(seen, x)}
        if right and (seen.record.fine or (seen.stride is None and len(right - {"exact"}) == 1)):
            return found
        # agreement with what is stated counts more than a simple scheme
        others = elsewhere(FEW if seen.stride is None else range(seen.stride, seen.stride + 1))
        others = {x: ds for x, ds in others.items() if _agrees(seen, x)}
        return {**(found if right or not others else {}), **others}
    if seen.record.fine:
        return found
    # coarse numbers that leave several schemes leave schemes elsewhere too
    alone = len({(x.scheme, x.stride) for x in found}) == 1
    strides = range(1, min(x.stride for x in found)) if alone else FEW
    others = {**found, **(elsewhere(strides) if strides else {})}
    return {x: others[x] for x in likely(list(others))}


def _single_parameters(seen: Measured) -> tuple[list[Joint], str]:
    """Schemes that fit if step, mass or both were rounded to single precision, and a note on which."""
    record, stride = seen.record, seen.stride
    if record.momenta or record.vague:
        return [], ""
    masses = [1.0 if record.mass is None else float(record.mass[j]) for j in seen.moving]
    heavier = [_shortened(m) for m in masses]
    strides = range(stride, stride + 1) if stride is not None and stride > 0 else FEW
    longer = [0.0, *(_shortened(record.interval / s) for s in range(1, strides.stop))]
    for families in (distinct(damped=False), (*distinct(damped=True), HELD)):
        for what, of_mass, of_step in (("step", 0, 1), ("mass", 1, 0), ("step and the mass", 1, 1)):
            scales = [tuple(of_mass * m - of_step * h for h in longer) for m in heavier]
            if not any(any(row[1:]) for row in scales):
                continue
            loose = [replace(x, scales=row) for x, row in zip(seen.terms, scales, strict=True)]
            if joints := replace(seen, terms=loose).compare(families, strides):
                return joints, f"the {what} was rounded to single precision in double arithmetic"
    return [], ""


def _shortened(x: np.longdouble | float) -> float:
    """Log of the ratio of a number in single precision to the number."""
    return -float(np.log(over_single(x)))


def find(seen: Measured) -> tuple[list[Joint], Measured]:
    """Hypotheses that the states do not exclude, the simplest first, and the data with the terms on which
    they fit.  The first round of `_plan` with a fit ends the search."""
    fine, stride = seen.record.fine, seen.stride
    first = (range(stride, stride + 1),) if stride is not None and stride > 0 else ()
    for trials in _plan(seen):
        accepted: list[Joint] = []
        for trial in trials:
            terms = [replace(what, rounding=trial.rounding, bias=trial.bias) for what in seen.terms]
            wide = replace(seen, terms=terms)
            for strides in (*first, *trial.strides):
                fitting = wide.compare(trial.families, strides)
                if fitting:
                    accepted += fitting
                    if strides is FEW and (MANY in trial.strides or not trial.bias):
                        accepted += _further(wide, fitting, trial)
                    if not (fine or trial.damped):
                        accepted += _rivals(wide, fitting, many=strides is MANY)
                    break
        if accepted:
            return likely(accepted), wide
    return [], seen


def explained(seen: Measured, accepted: list[Joint]) -> Explained:
    """The hypotheses of which a known arithmetic explains every step, with the defects of their steps."""
    left = [x for x in accepted if not FAMILIES[x.family].held or x.substeps[0]]
    of_each: list[list[Defect]] = [[] for _ in left]
    for i, (j, found, what) in enumerate(zip(seen.moving, seen.maps, seen.terms, strict=True)):
        if not left:
            break
        shows = cache(partial(_stands_out, seen, accepted, found, what, damped=left[0].damped))
        new = defects(seen.record, j, found, [x.parts[i] for x in left], shows)
        # what explains one scheme's residuals does not exclude others of no larger residuals
        good = [x for x in new if x.precision]
        new = [
            next((y for y in good if x.miss <= AS_NEAR * y.miss), x) if not x.precision else x for x in new
        ]
        kept = [k for k, x in enumerate(new) if x.precision]
        of_each = [[*of_each[k], new[k]] for k in kept]
        left = [left[k] for k in kept]
    return dict(zip(left, of_each, strict=True))


def _stands_out(seen: Measured, accepted: list[Joint], found: Map, terms: Terms, *, damped: bool) -> bool:
    """Whether all fitting hypotheses have one map, and the truncation error of its scheme is visible."""
    one, free_scale = accepted[0], terms.mass_unknown or terms.vague
    alone = all(
        (x.scheme, x.stride) == (one.scheme, one.stride) or identical(one, x, free_scale=free_scale)
        for x in accepted
    )
    return alone and visible(found, terms, damped=damped)


def _plan(seen: Measured) -> list[list[Trial]]:
    """Rounds of the search, the simplest first; those of one list are equally simple.

    Undamped before damped.  Coefficients are rounded in double precision, unless the states show a coarser
    arithmetic or are too few to exclude it; text does not show it, so that single precision is as simple as
    friction there.  A bias of the size of the residuals comes last: one orbit, rounded once, has none. Coarse
    numbers admit few steps of other schemes, so that many steps are tried before a wider tolerance; with a
    bias too many would fit.
    """
    record, whole = seen.record, all(found.whole for found in seen.maps)
    residual = max(float(np.max(found.residual)) for found in seen.maps)
    biased = [BIAS] if residual > FIXED and not whole else []
    if record.fine:
        trials = [[Trial(damped=d, bias=bias)] for d in (False, True) for bias in (0.0, *biased)]
        return [*trials, [Trial(strides=(MANY,))]]
    near = (FEW, MANY)
    double, double_damped, single, single_damped = (
        Trial(damped=damped, rounding=rounding, strides=near)
        for rounding in (ROUNDING, SINGLE)
        for damped in (False, True)
    )
    coarse = residual > LEAST_OF_SINGLE and not record.deep
    out: list[list[Trial]] = []
    if whole or not coarse:
        out += [[double], [double_damped, single] if record.text and coarse else [double_damped]]
    if coarse:
        out += [[single], [single_damped]]
    return out + [
        [Trial(damped=damped, bias=bias, strides=near)] for bias in biased for damped in (False, True)
    ]


def _further(seen: Measured, accepted: list[Joint], trial: Trial) -> list[Joint]:
    """Further hypotheses that the states do not exclude, beside those accepted of few steps to a frame.

    The truncation error falls with the number of steps, so that larger numbers may fit too; where the exact
    solution fits, so does any scheme of enough steps.  In double precision many steps are tried only where
    few leave a choice.  Friction may be there without being significant.
    """
    out: list[Joint] = []
    open_ended = len(accepted) > 1 or any(x.scheme == "exact" or x.stride == STRIDES[0] for x in accepted)
    if open_ended or not (seen.record.fine or trial.damped):
        out += seen.compare(trial.families, MANY)
    if not trial.damped and min(x.chi2 for x in accepted) > EXCLUDED:
        out += seen.compare(distinct(damped=True), FEW)
    return out


def _rivals(seen: Measured, fitting: list[Joint], *, many: bool) -> list[Joint]:
    """Rival hypotheses in coarse files: a force held over substeps resembles many steps, and friction may
    explain a loss of area.  A family that contains a fitting scheme's map must fit better than it."""
    losing = many or not any(x.keeps_area and x.chi2 < POOR for x in fitting)
    others = distinct(damped=True) if losing else ()
    same = {name: x.chi2 for x in fitting for name in coincident(x.family)}
    found = seen.compare((*others, HELD), FEW)
    return [x for x in found if x.chi2 < same.get(x.family, math.inf) - ONE_MORE]


@lru_cache(maxsize=64)
def visible(found: Map, terms: Terms, *, damped: bool) -> bool:
    """Whether the truncation error of a step is far above the residuals.

    The map of an adaptive solver differs from the exact one by the scatter of its steps, within which many
    schemes of many small steps fit; coarse arithmetic does not bring a map nearer to the exact one.
    """
    flow = FAMILIES["exact, damped" if damped else "exact"]
    near = nearest([found], [replace(terms, bias=1.0)], (flow,), range(1, 2))
    return all(m.chi2 > PLAIN**2 for m in near)


def terms_of(record: Record, j: int, stated: Floats | None) -> Terms:
    """The terms on which the map of oscillator j is compared."""
    log_stiffness = None
    if record.momenta and not record.vague and stated is not None and stated[j] > 0:
        log_stiffness = math.log(stated[j] * float(record.interval) ** 2)
    # in a coarse file a step or a mass may be in single precision as well
    jitter = math.hypot(record.jitter, 0.0 if record.deep else SINGLE)
    vague = record.vague and not record.momenta
    return Terms(mass_unknown=record.momenta, jitter=jitter, vague=vague, log_stiffness=log_stiffness)
