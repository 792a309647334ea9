"""Identification of thermostats, by `springcheck.bath`: their map, friction and noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.bath.catalogue import THERMOSTATS
from springcheck.errors import IdentificationError
from springcheck.identify.bath_modes import FREE_OF_NOISE, modes
from springcheck.identify.bath_residuals import FEWEST
from springcheck.identify.bath_states import Thermal, identify_thermal
from springcheck.identify.clock import clock_of
from springcheck.identify.result import Candidate, Explanation, Identification
from springcheck.physics.arrays import Floats
from springcheck.text.wording import either

MOST = 8
"""Most oscillators in a bath that are identified."""

OF_UNITS = "look at the units of what is stated, and at what the engine was given"

REMEDY = "record every step, each oscillator by itself, with the velocities that the engine stores"

SURE, ERRORS, AGREES = 6.0, 5.0, 1e-6
"""Standard errors of what is sure and of what is likely, and the relative difference that agrees."""


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
            return _said(known, h, np.ones(len(m)), stated, joined=True)
    if None in found:
        return None
    known = [one for one in found if one is not None]
    return _said(known, h, None if mass is None else m, stated)


def _given(t: Any, q: Any, p: Any, v: Any, mass: Any) -> tuple[Floats, Floats, Floats, Floats] | None:
    """Times (f,), positions and velocities (f, n) and masses (n,) in which a bath may show, or None."""
    times = np.asarray(t, np.float64)
    positions, u = (
        np.reshape(np.asarray(x, np.float64), (len(times), -1)) for x in (q, p if v is None else v)
    )
    if len(times) < FEWEST or positions.shape[1] > MOST:
        return None
    m = np.broadcast_to(1.0 if mass is None else np.ravel(np.asarray(mass, np.float64)), positions.shape[1:])
    try:
        # of one interval but for the rounding of the times, as of single precision in a .trr
        times = np.arange(len(times), dtype=np.float64) * float(clock_of(times).interval)
    except IdentificationError:
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
    found["friction c"] = (m * friction[0], m * friction[1])
    return [
        f"{name} {_rounded(x, error):.9g} where {given:.6g} is stated"
        for name, (x, error) in found.items()
        if (given := stated.get(name.partition(" ")[0])) is not None and (m or name == "step")
        if abs(x - given) > SURE * error + AGREES * abs(x)
    ]


def _said(
    found: list[Thermal], h: float, m: Floats | None, stated: Mapping[str, Any], *, joined: bool = False
) -> Identification:
    """Identification by what each oscillator shows, of masses m (n,) if known, in frames h [T] apart."""
    first = found[0]
    each = [{y.scheme: _of_digits(y, one.misfit, h) for y in one.candidates} for one in found]
    rows = {name: [x[name] for x in each] for name in each[0] if all(name in x for x in each)}
    best = next(iter(rows), None)
    named = best is not None and all(one.named and one.candidates[0].scheme == best for one in found)
    kept = [name for name in rows if all(y.nats < math.inf for y in rows[name])]
    masses = None if joined else m
    scales = np.zeros(len(found)) if masses is None else masses
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
    unknown = (math.nan,) * len(found)

    def shown(name: str, stride: int, number: str) -> tuple[float, ...]:
        """A number of each oscillator, by the likeliest number of steps to a frame alone."""
        of = rows[name] if stride == rows[name][0].strides[0] else []
        return tuple(_rounded(getattr(y, number), getattr(y, f"{number}_error")) for y in of) or unknown

    candidates = tuple(
        Candidate(
            scheme=name, aliases=(), stride=stride, step=h / stride, turns=0,
            omega=shown(name, stride, "omega"), friction=shown(name, stride, "friction"), law="of the bath",
            stiffness=None if masses is None or stride != rows[name][0].strides[0] else tuple(
                _rounded(float(k) * y.omega**2, 2 * float(k) * y.omega * y.omega_error)
                for k, y in zip(masses, rows[name], strict=True)
            ),
        )
        for name in kept
        for stride in rows[name][0].strides[: None if len(kept) > 1 else 1]
    )  # fmt: skip
    statement = _statement(found, {name: rows[name][0].strides for name in kept}, best, named=named)
    mass = None if m is None else m[0]
    numbers = [_numbers(name, rows[name][0], mass) for name in kept[:3]]
    if "euler-maruyama" in kept:
        words = "the same states, if x moves first and the force is that at the new x"
        numbers.append(_numbers(words, _moved_first(rows["euler-maruyama"][0], h), mass))
    notes = _remarks(found, numbers, stated, named=named, joined=joined)
    rates = [one.candidates[0] for one in found if best and one.candidates]
    if rates and all(y.friction <= ERRORS * y.friction_error for y in rates):
        statement += "; no friction shows: random kicks without friction fit so few frames equally"
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
            Explanation(statement, OF_UNITS if against else REMEDY, math.nan),
        ),
    )  # fmt: skip


def _remarks(
    found: list[Thermal], numbers: list[str], stated: Mapping[str, Any], *, named: bool, joined: bool
) -> list[str]:
    """Notes: the numbers of the likeliest schemes, and what would tell these apart."""
    first = found[0]
    notes = [x for x in numbers if not x.endswith(": ")]
    if joined:
        notes.append("joined particles: omega is that of each mode, and the numbers are those of the first")
    if first.draws:
        notes.append(f"the draws are {first.draws}")
    apart = any(s > 1 for one in found for y in one.candidates for s in y.strides)
    if first.candidates and not named and (apart or first.candidates[1:]):
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
    return notes


def _statement(
    found: list[Thermal], strides: Mapping[str, tuple[int, ...]], best: str | None, *, named: bool
) -> str:
    """The thermostat, or those that are left with their steps to a frame, in a sentence."""
    head = "each step takes noise: a thermostat"
    if named and best:
        late = "" if THERMOSTATS[best].synchronised else "; its velocities are of another time"
        return f"{head}, {THERMOSTATS[best].title}{late}"
    if best:
        which = [_with_strides(name, tuple(set(x))) for name, x in strides.items()]
        return f"{head}, {' or '.join(which)}{'' if found[0].known else ' or one that is not known here'}"
    if all(one.added for one in found):
        return (
            "each step takes noise, added to the momenta after velocity Verlet, and no friction shows: "
            "random kicks without one, or a bath that hardly acts in so few frames"
        )
    return f"{head}, by no scheme known here, or of joined particles, or frames lie several steps apart"


def _with_strides(name: str, strides: tuple[int, ...]) -> str:
    """A scheme's name with the range of its steps per frame."""
    if strides == (1,):
        return name
    low, high = min(strides), max(strides)
    return f"{name} ({low}{f' to {high}' if high > low else ''} step{'s' * (high > 1)} a frame)"


LEAST_KNOWN = 3.0
"""Standard errors of a friction up to which it is no number, and kT none beside it."""


def _numbers(name: str, one: Any, m: float | None) -> str:
    """The numbers that a candidate implies, each with its standard error."""
    scale = 1.0 if m is None else m
    # the states show the product of friction and kT better than either; at an end of the range of frictions
    # no error of it is known, where omega has one
    at_an_end = math.isnan(one.friction_error) and one.omega_error > 0
    open_ended = at_an_end or one.friction <= LEAST_KNOWN * one.friction_error
    if open_ended:
        one = replace(one, friction=math.nan, thermal=math.nan)
    of = (
        ("omega", one.omega, one.omega_error), ("friction c/m", one.friction, one.friction_error),
        ("kT/m" if m is None else "kT", one.thermal * scale, one.thermal_error * scale),
    )  # fmt: skip
    return f"{_with_strides(name, one.strides[:1])}: " + ", ".join(
        [f"{word} {_measured(x, error)}" for word, x, error in of if math.isfinite(x)]
        + ["friction c/m too little known to tell kT from it"] * open_ended
    )


def _moved_first(y: Any, h: float) -> Any:
    """Euler-Maruyama's numbers as those of its drift, then its kick: x' = x + h v adds h omega**2 to the
    friction that v' shows, and the noise is that of the product of friction and kT."""
    friction = y.friction - h * y.omega**2
    error = math.hypot(y.friction_error, 2 * h * y.omega * y.omega_error)
    thermal = y.thermal * y.friction / (friction or math.nan)
    share = math.hypot(y.thermal_error / y.thermal, error / (friction or math.nan))
    return replace(
        y, friction=friction, friction_error=error, thermal=thermal, thermal_error=abs(thermal) * share
    )


def _of_digits(y: Any, misfit: float, h: float) -> Any:
    """A candidate whose omega is no more exact than the digits of frames h [T] apart, by the `misfit` of what
    they leave free of noise."""
    if not misfit > FREE_OF_NOISE:
        return y
    step = h / y.strides[0]
    least = misfit / (2 * step * max(y.omega * step, math.sqrt(misfit)))
    return replace(y, omega_error=float(np.maximum(y.omega_error, least)))


def _rounded(x: float, error: float) -> float:
    """A number to one digit beyond its error."""
    return float(_measured(x, error).partition(" ")[0])


def _measured(x: float, error: float) -> str:
    """A number to one digit beyond its error."""
    if not (0 < error < abs(x)):
        return f"{x:.12g}" + (f" +- {error:.1g}" if error > 0 else "")
    digits = math.floor(math.log10(abs(x))) - math.floor(math.log10(error)) + 2
    return f"{x:.{min(digits, 12)}g} +- {error:.1g}"
