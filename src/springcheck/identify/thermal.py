"""Identification of thermostats: what `springcheck.thermal` finds, in the words of an identification."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.identify.factor import by_a_factor
from springcheck.identify.hypothesis import ERRORS, SURE
from springcheck.identify.result import Candidate, Explanation, Identification
from springcheck.physics.arrays import Floats
from springcheck.text.wording import either
from springcheck.thermal.catalogue import THERMOSTATS, family_of
from springcheck.thermal.likelihood import SUBSTEPS_TRIED
from springcheck.thermal.modes import FREE_OF_NOISE, modes
from springcheck.thermal.residuals import FEWEST
from springcheck.thermal.states import Thermal, identify_thermal

MOST = 8
"""Oscillators that are looked at, each by itself."""

STATED_AGREES = 1e-6
"""Relative difference up to which a measured number is the stated one, beside its standard errors."""

OF_UNITS = "look at the units of what is stated, and at what the engine was given"

REMEDY = "record every step, each oscillator by itself, with the velocities that the engine stores"


def explained(
    found: Identification, t: Any, q: Any, p: Any, v: Any, mass: Any, **stated: Any
) -> Identification:
    """Identification of a bath in states (f, n) at times t (f,) that no scheme explains, or `found`."""
    given = _given(t, q, p, v, mass)
    if given is None:
        return found
    times, positions, u, _ = given
    h = float(np.mean(np.diff(times)))
    return by_a_factor(of_bath(t, q, p, v, mass, **stated) or found, h, positions, u)


def of_bath(
    t: Any, q: Any, p: Any, v: Any, mass: Any, *, mixed: bool = False, **stated: Any
) -> Identification | None:
    """Identification of the thermostat of states (f, n) at times t (f,); None where nothing random shows.

    With `mixed` several draws act on each coordinate, whose distribution then does not show.  The stated
    `stiffness`, `friction` c and `step` are compared with what each scheme implies.
    """
    given = _given(t, q, p, v, mass)
    if given is None:
        return None
    times, positions, u, m = given
    found = [
        identify_thermal(times, x, y, np.delete(positions, j, axis=1), mixed=mixed)
        for j, (x, y) in enumerate(zip(positions.T, u.T, strict=True))
    ]
    h, joined = float(np.mean(np.diff(times))), None
    if mass is not None and len(m) > 1 and not all(one and one.candidates for one in found):
        joined = modes(positions, u, m)
    if joined:
        by_mode = zip(joined[0] @ positions.T, joined[0] @ u.T, strict=True)
        apart = [identify_thermal(times, x, y, mixed=True) for x, y in by_mode]
        # particles of which none shows its noise may take none, but for what modes say to rounding
        if all(one and (None not in found or one.misfit < FREE_OF_NOISE) for one in apart):
            # in a mode of sqrt(m) q the mass is 1
            known = [replace(one, known=one.known and joined[1]) for one in apart if one is not None]
            return _said(known, h, np.ones(len(m)), stated, with_mass=True, joined=True)
    if None in found:
        return None
    known = [one for one in found if one is not None]
    return _said(known, h, None if mass is None and v is None else m, stated, with_mass=mass is not None)


def _given(t: Any, q: Any, p: Any, v: Any, mass: Any) -> tuple[Floats, Floats, Floats, Floats] | None:
    """Times (f,), positions and velocities (f, n) and masses (n,) in which a bath may show, or None."""
    times, positions = np.asarray(t, np.float64), np.asarray(q, np.float64)
    u = np.asarray(p if v is None else v, np.float64)
    if times.ndim != 1 or len(times) < FEWEST or positions.shape != u.shape or len(positions) != len(times):
        return None
    m = np.broadcast_to(1.0 if mass is None else np.asarray(mass, np.float64), positions.shape[1:]).ravel()
    steps = np.diff(times)
    if not np.all(np.abs(steps - steps[0]) <= 1e-9 * abs(steps[0])):
        return None
    positions, u = (x.reshape(len(x), -1) for x in (positions, u))
    if positions.shape[1] > MOST or not np.all(m > 0):
        return None
    if v is None:
        u = u / m
    return times, positions, u, m


def _against(one: Any, first: Thermal, h: float, m: float, stated: Mapping[str, Any]) -> list[str]:
    """Stated numbers that this candidate contradicts, as phrases; m is 0 where no mass is known."""
    steps = [h / stride for stride in one.strides]
    step = min(steps, key=lambda x: abs(x - (stated.get("step") or x)))
    # a standard error that was not worked out, NaN, is the best candidate's, whose noise is the same
    share = first.candidates[0].friction_error / (first.candidates[0].friction or math.nan)
    omega, friction = (
        (x, share * x if math.isnan(error) else error)
        for x, error in ((one.omega, one.omega_error), (one.friction, one.friction_error))
    )
    # where noise leaves a combination of the states alone, omega is as exact as the digits of the states
    stiff = max(2 * omega[0] * omega[1], first.misfit / step**2)
    found = {"step": (step, 0.0), "stiffness": (m * omega[0] ** 2, m * stiff)}
    found["friction"] = (m * friction[0], m * friction[1])
    return [
        f"{name} {x:.6g} where {given:.6g} is stated"
        for name, (x, error) in found.items()
        if (given := stated.get(name)) is not None and (m or name == "step")
        if abs(x - given) > SURE * error + STATED_AGREES * abs(x)
    ]


def _said(
    found: list[Thermal],
    h: float,
    m: Any,
    stated: Mapping[str, Any],
    *,
    with_mass: bool,
    joined: bool = False,
) -> Identification:
    first = found[0]
    names = [y.scheme for y in first.candidates]
    schemes = [name for name in names if all(name in [y.scheme for y in one.candidates] for one in found)]
    best = schemes[0] if schemes else None
    named = best is not None and all(one.named and one.candidates[0].scheme == best for one in found)
    rows = {name: [next(y for y in one.candidates if y.scheme == name) for one in found] for name in schemes}
    kept = [name for name in schemes if all(y.nats < math.inf for y in rows[name])]
    every = {name: rows[name][0].strides[0] for name in kept}
    scales = m if with_mass and not joined else np.zeros(len(found))
    stiff = np.broadcast_to(np.asarray(stated.get("stiffness"), dtype=object), len(found))
    differ = {
        name: [
            word
            for y, scale, k in zip(rows[name], scales, stiff, strict=True)
            for word in _against(y, first, h, scale, {**stated, "stiffness": k})
        ]
        for name in kept
    }
    agreeing = [name for name in kept if not differ[name]]
    against = differ[kept[0]] if kept and not agreeing else []
    if agreeing and agreeing != kept:
        kept, best = agreeing, agreeing[0]
        named = len(kept) == 1 and all(one.known and rows[best][0].strides == (1,) for one in found)
    several = len(kept) > 1
    candidates = tuple(
        Candidate(
            scheme=name, aliases=(), stride=stride, step=h / stride, turns=0,
            omega=tuple(y.omega if stride == every[name] else math.nan for y in rows[name]),
            stiffness=tuple(float(k * y.omega**2) for k, y in zip(m, rows[name], strict=True))
            if with_mass and not joined and stride == every[name] else None,
            friction=tuple(y.friction if stride == every[name] else math.nan for y in rows[name]),
            law="of the bath",
        )
        for name in kept
        for stride in rows[name][0].strides[: None if several else 1]
    )  # fmt: skip
    numbers = [_numbers(name, rows[name][0], m[0] if with_mass else None) for name in kept[:3]]
    notes = [x for x in numbers if not x.endswith(": ")]
    if joined:
        notes.append("joined particles: omega is that of each mode, and the numbers are those of the first")
    if first.uniform:
        notes.append("the draws are uniform, not normal")
    apart = any(s > 1 for one in found for y in one.candidates for s in y.strides)
    if first.candidates and not named:
        more = ["frames of every step"] * apart + ["a stated stiffness"] * (stated.get("stiffness") is None)
        notes.append(
            "one scheme is named where it beats every other, of any number of steps between two frames, by a "
            f"factor of 1e6; {either([*more, 'more frames'])} may tell them apart"
        )
    if apart:
        notes.append("of frames several steps apart whole turns between two of them do not show")
    if first.free:
        combination = ", ".join(f"{x:.9g}" for x in first.free)
        notes.append(f"free of noise at every step: ({combination}) on (x', v', x, v), to {first.misfit:.0e}")
    unknown = (math.nan,) * len(found)
    head = "each step takes noise: a thermostat"
    if named and best:
        late = "" if THERMOSTATS[best].synchronised else "; its velocities are of another time"
        statement = f"{head}, {THERMOSTATS[best].title}{late}"
    elif best:
        every_count = [name for name in kept if family_of(name)[1]]
        of_counts = tuple({s for name in every_count for s in rows[name][0].strides})
        which = [
            _with_strides(name, rows[name][0].strides)
            if name not in every_count or len(every_count) == 1
            else _with_strides(_counts(every_count), of_counts)
            for name in kept
            if name not in every_count[1:]
        ]
        statement = f"{head}, {' or '.join(which)}{'' if first.known else ' or one that is not known here'}"
    elif all(one.added for one in found):
        statement = (
            "each step takes noise, added to the momenta after velocity Verlet, and no friction shows: "
            "random kicks without one, or a bath that hardly acts in so few frames"
        )
    else:
        statement = (
            f"{head}, by no scheme known here, or of joined particles, or frames lie several steps apart"
        )
    rates = [one.candidates[0] for one in found if best and one.candidates]
    if rates and all(y.friction <= ERRORS * y.friction_error for y in rates):
        statement += "; no friction shows: random kicks without one would do as well in so few frames"
    if against:
        statement = f"{statement}, but of {', '.join(against)}"
    only = candidates[0] if named else None
    return Identification(
        verdict="named" if named else "not told apart" if best else "none", statement=statement,
        scheme=best if named else None, candidates=candidates,
        step=h, stride=1 if named else None, omega=only.omega if only else unknown,
        stiffness=only.stiffness if only else None, friction=only.friction if only else unknown,
        velocity_offset=math.nan if not only else 0.0 if THERMOSTATS[only.scheme].synchronised else -0.5,
        determinant=unknown, fits=best is not None and first.known and not against, undecided=not first.known,
        nearest=best if named else None, notes=tuple(notes),
        explanations=() if best and not against else (
            Explanation(cause=statement, remedy=OF_UNITS if against else REMEDY, misfit=math.nan),
        ),
    )  # fmt: skip


def _counts(names: list[str]) -> str:
    """Name of a family of schemes that differ in their number of substeps, with the range."""
    (stem, _), counts = family_of(names[0]), sorted(family_of(x)[1] for x in names)
    return f"{stem}{counts[0]} to {counts[-1]}{' or more' if counts[-1] == SUBSTEPS_TRIED[-1] else ''}"


def _with_strides(name: str, strides: tuple[int, ...]) -> str:
    """A scheme's name with the range of its steps per frame."""
    if strides == (1,):
        return name
    low, high = min(strides), max(strides)
    return f"{name} ({low}{f' to {high}' if high > low else ''} step{'s' * (high > 1)} a frame)"


def _numbers(name: str, one: Any, m: float | None) -> str:
    """The numbers that a candidate implies, each with its standard error."""
    scale = 1.0 if m is None else m
    of = (
        ("omega", one.omega, one.omega_error), ("friction", one.friction, one.friction_error),
        ("kT/m" if m is None else "kT", one.thermal * scale, one.thermal_error * scale),
    )  # fmt: skip
    return f"{_with_strides(name, one.strides[:1])}: " + ", ".join(
        f"{word} {_measured(x, error)}" for word, x, error in of if math.isfinite(x)
    )


def _measured(x: float, error: float) -> str:
    """A number to one digit beyond its error."""
    if not (0 < error < abs(x)):
        return f"{x:.12g}" + (f" +- {error:.1g}" if error > 0 else "")
    digits = math.floor(math.log10(abs(x))) - math.floor(math.log10(error)) + 2
    return f"{x:.{min(digits, 12)}g} +- {error:.1g}"
