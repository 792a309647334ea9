"""Identification of thermostats, by `springcheck.bath.naming`: their scheme, friction and noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from springcheck.bath.catalogue import THERMOSTATS
from springcheck.bath.naming import FEWEST, ONE_DRAW, Fitted, named, noise_of, thermostats
from springcheck.errors import IdentificationError
from springcheck.identify.clock import clock_of
from springcheck.identify.result import Candidate, Explanation, Identification
from springcheck.text.wording import either

MOST = 8
"""Most oscillators in a bath that are identified."""

SURE, AGREES, UNKNOWN = 6.0, 1e-6, 3.0
"""Standard errors of what is sure, the relative difference that agrees, and the standard errors of a friction
up to which it is no number, and kT none next to it."""

FREE_OF_NOISE = 1e-9
"""Part of a combination that is free of noise, relative to the noise, that double precision leaves."""

MOST_LISTED = 3
"""Schemes whose numbers are noted."""

HEAD = "each step takes noise: a thermostat"


def of_bath(t: Any, q: Any, p: Any, v: Any, mass: Any, **stated: Any) -> Identification | None:
    """Identification of the thermostat of states (f, n) at times t (f,); None where none that is known shows.

    The stated `stiffness`, `friction` c and `step` are compared with what each scheme implies.
    """
    positions, moving = (
        np.reshape(np.asarray(x, np.float64), (len(t), -1)) for x in (q, p if v is None else v)
    )
    if len(t) < FEWEST or positions.shape[1] > MOST:
        return None
    m = np.broadcast_to(1.0 if mass is None else np.ravel(np.asarray(mass, np.float64)), positions.shape[1:])
    try:
        # of one interval but for the rounding of the times, as of single precision in a .trr
        h = float(clock_of(np.asarray(t, np.float64)).interval)
    except IdentificationError:
        return None
    velocities = moving / m if v is None else moving
    if _joined(positions, velocities):
        return None
    each = [_of_digits(x, u, h) for x, u in zip(positions.T, velocities.T, strict=True)]
    if any(one is None for one in each):
        return None
    found = [one for one in each if one is not None]
    rows = {x.scheme: [x] for x in found[0]}
    for one in found[1:]:
        of = {x.scheme: x for x in one}
        rows = {name: [*before, of[name]] for name, before in rows.items() if name in of}
    if not rows:
        return None
    only = named(found[0])
    alone = only is not None and all(
        (x := named(one)) is not None and x.scheme == only.scheme for one in found
    )
    return _said(rows, only.scheme if alone and only else None, h, None if mass is None else m, stated)


def _joined(q: Any, v: Any) -> bool:
    """Whether what a coordinate's own map leaves of its velocity depends on the positions of others."""
    for j in range(q.shape[1]):
        known = np.column_stack([q[:-1, j], v[:-1, j], np.ones(len(q) - 1)])
        both = np.column_stack([v[1:, j], np.delete(q, j, axis=1)[:-1]])
        left, *others = (both - known @ np.linalg.lstsq(known, both, rcond=None)[0]).T
        sizes = [float(np.linalg.norm(x) * np.linalg.norm(left)) for x in others]
        alike = (abs(float(x @ left)) / size for x, size in zip(others, sizes, strict=True) if size)
        if max(alike, default=0.0) > SURE / math.sqrt(len(left)):
            return True
    return False


def _of_digits(q: Any, v: Any, h: float) -> list[Fitted] | None:
    """The schemes of an oscillator, whose frequency is no more exact than the digits of its states."""
    found, seen = thermostats(q, v, h), noise_of(q, v, h)
    if not found or seen is None or seen.misfit < FREE_OF_NOISE or seen.misfit > ONE_DRAW:
        return found
    least = seen.misfit / (2 * h * np.maximum([x.omega * h for x in found], math.sqrt(seen.misfit)))
    return [replace(x, omega_error=max(x.omega_error, float(y))) for x, y in zip(found, least, strict=True)]


def _said(
    rows: dict[str, list[Fitted]], name: str | None, h: float, m: Any, stated: Mapping[str, Any]
) -> Identification:
    """Identification by the schemes that fit every oscillator, of masses m (n,) if known."""
    differ = {x: _against(fitted, h, m, stated) for x, fitted in rows.items()}
    agreeing = [x for x in rows if not differ[x]]
    kept = agreeing or list(rows)
    sure = name is not None or all(rows[x][0].known for x in kept)
    if name is None and len(agreeing) == 1 < len(rows) and sure:
        name = agreeing[0]
    against = next(iter(differ.values()), []) if not agreeing else []
    candidates = tuple(_candidate(x, rows[x], h, m) for x in kept)
    if name:
        late = "" if THERMOSTATS[name].synchronised else "; its velocities are of another time"
        statement = f"{HEAD}, {THERMOSTATS[name].title}{late}"
    else:
        statement = f"{HEAD}, {' or '.join(kept)}{'' if sure else ' or one that is not known here'}"
    if all(x.friction <= SURE * x.friction_error for x in rows[kept[0]]):
        statement += "; no friction shows: random kicks without friction fit so few frames equally"
    if against:
        statement = f"{statement}, but of {', '.join(against)}"
    remedy = "look at the units of what is stated, and at what the engine was given"
    known = candidates[0] if name else None
    unknown = (math.nan,) * len(rows[kept[0]])
    notes = [_numbers(x, rows[x][0], None if m is None else float(m[0])) for x in kept[:MOST_LISTED]]
    if len(kept) > 1:
        more = ["a stated stiffness"] * (stated.get("stiffness") is None)
        notes.append(f"{either([*more, 'more frames'])} may tell them apart")
    return Identification(
        verdict="named" if name else "not told apart", statement=statement, scheme=name,
        candidates=candidates, step=h, stride=1 if name else None, omega=known.omega if known else unknown,
        stiffness=known.stiffness if known else None, friction=known.friction if known else unknown,
        velocity_offset=math.nan if not name else 0.0 if THERMOSTATS[name].synchronised else -0.5,
        determinant=unknown, fits=bool(agreeing) and sure, undecided=not sure, nearest=name,
        notes=tuple(notes),
        explanations=(Explanation(statement, remedy, math.nan),) if against else (),
    )  # fmt: skip


def _candidate(name: str, fitted: list[Fitted], h: float, m: Any) -> Candidate:
    stiff = None
    if m is not None:
        stiff = tuple(
            _rounded(float(k) * x.omega**2, 2 * float(k) * x.omega * x.omega_error)
            for k, x in zip(m, fitted, strict=True)
        )
    return Candidate(
        scheme=name, aliases=(), stride=1, step=h, turns=0, law="of the bath", stiffness=stiff,
        omega=tuple(_rounded(x.omega, x.omega_error) for x in fitted),
        friction=tuple(_rounded(x.friction, x.friction_error) for x in fitted),
    )  # fmt: skip


def _against(fitted: list[Fitted], h: float, m: Any, stated: Mapping[str, Any]) -> list[str]:
    """Stated numbers that a scheme contradicts, as phrases."""
    found = [("step", h, 0.0, stated.get("step"))]
    stiffness = np.broadcast_to(np.asarray(stated.get("stiffness"), object), len(fitted))
    for x, mass, k in zip(fitted, m if m is not None else (), stiffness, strict=False):
        found.append(("stiffness", mass * x.omega**2, 2 * mass * x.omega * x.omega_error, k))
        found.append(("friction c", mass * x.friction, mass * x.friction_error, stated.get("friction")))
    return [
        f"{name} {_rounded(x, error):.9g} where {given:.6g} is stated"
        for name, x, error, given in found
        if given is not None and abs(x - given) > SURE * np.nan_to_num(error) + AGREES * abs(x)
    ]


def _numbers(name: str, x: Fitted, m: float | None) -> str:
    """The numbers that a scheme implies, each with its standard error."""
    scale = 1.0 if m is None else m
    vague = x.friction <= UNKNOWN * x.friction_error
    # the states show the product of friction and kT better than either
    numbers = [("omega", x.omega, x.omega_error)]
    if not vague:
        numbers.append(("friction c/m", x.friction, x.friction_error))
        numbers.append(("kT/m" if m is None else "kT", x.thermal * scale, x.thermal_error * scale))
    each = [f"{word} {_measured(y, error)}" for word, y, error in numbers if math.isfinite(y)]
    return f"{name}: " + ", ".join([*each, *["friction c/m too uncertain to determine kT"] * vague])


def _rounded(x: float, error: float) -> float:
    """A number to one digit beyond its error."""
    return float(_measured(x, error).partition(" ")[0])


def _measured(x: float, error: float) -> str:
    """A number to one digit beyond its error, and the error."""
    if math.isnan(error):
        return f"{x:.2g}"
    if not (0 < error < abs(x)):
        return f"{x:.12g}" + (f" +- {error:.1g}" if error > 0 else "")
    digits = math.floor(math.log10(abs(x))) - math.floor(math.log10(error)) + 2
    return f"{x:.{min(digits, 12)}g} +- {error:.1g}"
