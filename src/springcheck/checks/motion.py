"""The recorded motion as a whole: closed form, shadow energy, frequency, momentum, rotation in a field."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck import schemes
from springcheck.checks import sight
from springcheck.checks.case import Case
from springcheck.checks.check import Finding, check, largest
from springcheck.checks.requires import CLOSED, MAP
from springcheck.checks.steps import STILL
from springcheck.physics.arrays import WIDE, Extended, Integers, Reals
from springcheck.physics.trajectory import Limits
from springcheck.text.wording import count


@check("closed", family="motion", requires=MAP | {"unmixed", "closed"})
def closed_form(case: Case) -> Finding | str:
    """The trajectory is the scheme's own discrete solution, phase included, as 2 asin(h w/2) per step."""
    modes = case.undriven.system.modes
    q, p = modes.from_centres(*case.closed_states)
    distance = case.system.norm.size(case.trajectory.q - q, case.trajectory.p - p)
    moved = case.system.norm.size(q - case.scene.q, p - case.scene.p)
    bound, unit = case.growth
    late = (case.steps > 0) & ~_beyond(case, bound * unit, distance)
    allowed = np.where(late, bound * unit, 1)
    ratio = np.where(late, distance / allowed, 0)
    (worst,) = largest(ratio)
    if ratio[worst] <= 1 and np.any(moved > 0) and not np.any(late & (moved > allowed)):
        return f"{STILL} the motion"

    def part(at: Integers, right: sight.States, change: sight.States) -> Reals:
        return np.where(late[at], case.system.norm.size(*modes.out_of(*change)) / allowed[at], 0)

    why = (
        f"roundings of {count(int(case.steps[worst]), 'step')}, accumulated by the map: {_how(case)}"
        + _untold(case, np.maximum.accumulate(moved) <= allowed, "motion")
    )
    return Finding(distance[worst] / unit[worst], bound[worst], "roundings", why, sight.of_modes(case, part))


def _how(case: Case) -> str:
    """How the roundings of many steps add up."""
    if np.all(np.isfinite(case.walk(case.steps))):
        return "5 standard deviations of a random walk, and those of the coefficients, at every step alike"
    return "all of one sign"


def _beyond(case: Case, allowed: Extended, *sizes: Extended) -> NDArray[np.bool_]:
    """Frames (f,) at which finite states have no reference in the range of numbers.

    That is where `allowed`, the effect of rounding, leaves it; where a reference has the engine's own range
    also where one of these sizes does.
    """
    finite = np.isfinite(case.trajectory.q).all(axis=1) & np.isfinite(case.trajectory.p).all(axis=1)
    out = np.isinf(allowed)
    for size in () if WIDE else sizes:
        out |= ~np.isfinite(size)
    return np.asarray(out & finite)


def _untold(case: Case, drowned: NDArray[np.bool_], what: str) -> str:
    """From where on a check is inconclusive, its bound being as large as the quantity itself, in words."""
    late = np.flatnonzero(~drowned)
    if not len(late) or late[-1] == len(drowned) - 1:
        return ""
    return f"; says nothing from step {case.steps[late[-1] + 1]} on, where that may be all of the {what}"


@check("shadow", family="motion", requires=CLOSED)
def shadow_energy(case: Case) -> Finding | str:
    """The scheme's own energy of each mode is conserved, or changes by its exact factor, to rounding."""
    run = case.trajectory
    form = schemes.invariant(case.law.propagator, h=run.step)
    turn = schemes.rotation(case.law.propagator)
    factor = np.ones_like(turn.determinant) if case.area_preserving else turn.determinant
    (u0, v0), rest = case.mode_start, np.asarray(case.system.modes.rest, np.float64)
    first = form[:, 0] * u0 * u0 + form[:, 1] * u0 * v0 + form[:, 2] * v0 * v0
    u, v = case.system.modes.about_centres(run.q, run.p)
    stored = form[:, 0] * u * u + form[:, 1] * u * v + form[:, 2] * v * v
    expected = first * factor ** case.steps[:, None].astype(np.longdouble)
    # |dE| <= 2 |z| |dz| in the form's own norm, `shape` times the energy's; |z| is known to its rounding
    shape = np.max(np.abs(form[:, 0]) / case.w**2 + np.abs(form[:, 1]) / case.w + np.abs(form[:, 2]))
    _, unit = case.growth
    size = np.maximum.accumulate(case.system.norm.size(run.q - rest, run.p))
    if case.steps[0] != 0:
        most_q, most_p = case.envelope
        size = np.maximum(size, case.system.norm.size(most_q - np.abs(rest), most_p))
    scale = 2 * shape * np.maximum(size, unit) * unit
    off = np.max(np.abs(stored - expected), axis=1)
    late = (case.steps > 0) & ~_beyond(case, scale, shape * size * size, np.max(np.abs(expected), axis=1))
    seen = np.where(late & (off != 0), off / scale, 0)
    limit = np.where(late, np.minimum(case.roundings * case.steps, case.walk(case.steps)), 1)
    worst = int(np.argmax(np.where(np.isfinite(seen), seen / limit, np.inf)))
    energy = np.max(np.abs(expected), axis=1)
    drowned = energy <= limit * scale
    if seen[worst] <= limit[worst] and np.any(energy > 0) and not np.any(late & ~drowned):
        return "rounding may be as large as the energy"

    def part(at: Integers, right: sight.States, change: sight.States) -> Reals:
        (u, v), (du, dv) = right, change
        of_u = form[:, 0] * (2 * u + du) + form[:, 1] * v
        of_v = form[:, 1] * (u + du) + form[:, 2] * (2 * v + dv)
        most = np.max(np.abs(of_u * du + of_v * dv), axis=1)
        return np.where(late[at], most / (limit * scale)[at], 0)

    why = f"roundings of {count(int(case.steps[worst]), 'step')}: {_how(case)}" + _untold(
        case, drowned, "energy"
    )
    return Finding(seen[worst], limit[worst], "roundings", why, sight.of_modes(case, part))


@check("freq", family="motion", requires=CLOSED | {"undamped"})
def frequency(case: Case) -> Finding | str:
    """The phase advances with the scheme's own frequency, to rounding."""
    turn = schemes.rotation(case.law.propagator)
    u0, v0 = case.mode_start
    strength = np.where(turn.angle > 0, np.hypot(case.w * u0, v0), -1)
    j = int(np.argmax(strength))
    if strength[j] <= 0:
        return "no mode oscillates"
    form = schemes.invariant(case.law.propagator, h=case.trajectory.step)[j]
    u, v = case.system.modes.about_centres(case.trajectory.q[-1], case.trajectory.p[-1])
    steps = int(case.steps[-1])
    if steps == 0:
        return "nothing has moved yet"
    # in the coordinates of the invariant form a step is a plain rotation by -angle
    phase = _phase(form, u[j], v[j]) - _phase(form, u0[j], v0[j])
    # on an inverted spring a scheme with a backward substep can rotate the other way
    backwards = np.sign(case.law.propagator[j, 0, 1])
    expected = backwards * turn.angle[j] * np.longdouble(steps)
    off = phase - expected
    off -= 2 * np.pi * np.round(off / (2 * np.pi)) if np.isfinite(off) else 0
    off -= _LOW_TWO_PI * np.round((phase - expected) / (2 * np.pi))
    bound, unit = case.growth
    # the size of the right mode: a mode that has vanished would excuse any phase
    own_y, own_v = case.closed_states
    # extended: a motion that spirals out is squared here, up to the end of double's range
    mode = np.abs(np.hypot(case.w[j] * own_y[-1, j], own_v[-1, j]))
    wide = unit[-1] * np.sqrt(np.longdouble(2))
    if not np.isfinite(mode) or not np.isfinite(wide):
        return "what rounding may do is beyond all numbers"
    # an error e of a state of size z turns its phase by e/z, times the ratio of the ellipse's axes
    shape = schemes.condition(case.law.propagator, case.w)[j]
    angle = bound[-1] * (wide / mode) * shape
    if angle >= 1:
        return "rounding may be as large as the mode, which then has no phase"
    if angle >= abs(expected):
        return f"{STILL} the whole turn"
    limit = float(angle / abs(expected))

    def part(at: Integers, right: sight.States, change: sight.States) -> Reals:
        # the component of the last frame's change at right angles to its place on the ellipse
        (u, v), (du, dv) = ((x[-1, j], y[-1, j]) for x, y in (right, change))
        x, y = _on_circle(form, u, v)
        dx, dy = _on_circle(form, du, dv)
        return np.asarray(abs(x * dy - y * dx) / (x * x + y * y) / angle)

    true = float(turn.angle[j] / (abs(np.longdouble(case.trajectory.step)) * case.w[j]) - 1)
    more = "" if abs(off) <= angle else "; whole turns are not counted, the error may be larger"
    own = f"the scheme's own frequency error is {true:.2e}"
    why = f"the closed form's bound as an angle; {own}{more}"
    return Finding(abs(off) / abs(expected), limit, "relative", why, sight.of_modes(case, part))


_LOW_TWO_PI = 2.4492935982947064e-16
"""2 pi less its rounding to a double."""


def _phase(form: Extended, u: np.longdouble, v: np.longdouble) -> np.longdouble:
    if not (np.isfinite(u) and np.isfinite(v)):
        return np.longdouble(np.nan)
    x, y = _on_circle(form, u, v)
    return np.longdouble(np.arctan2(-y, x))


def _on_circle(form: Extended, u: np.longdouble, v: np.longdouble) -> tuple[np.longdouble, np.longdouble]:
    """Coordinates in which a step is a rotation."""
    x = np.sqrt(np.abs(form[0] - form[1] ** 2 / (4 * form[2]))) * u
    return x, np.sqrt(np.abs(form[2])) * (v + form[1] / (2 * form[2]) * u)


@check("moment", family="motion", requires=MAP | {"unheld"}, telling=False)
def momentum(case: Case) -> Finding | str:
    """Without external forces the total momentum along every axis is conserved."""
    run, places = case.trajectory, case.scene.all_places % 3
    axes = np.unique(places)
    # for one axis the coordinates in their own order, on which the rounding of a sum depends
    each: list[Any] = [slice(None)] if len(axes) == 1 else [np.flatnonzero(places == axis) for axis in axes]

    def summed(x: Reals) -> Reals:
        return np.stack([np.sum(x[..., one], axis=-1) for one in each], axis=-1)

    total = summed(run.p.astype(np.longdouble))
    steps, first = case.steps, case.scene.p.astype(np.longdouble)
    # at both ends of each stretch between frames, since the motion may grow along it
    _, of_p = case.allowance_at(run.q, run.p)
    unit = np.maximum.accumulate(summed(of_p))[1:]
    if steps[0] != 0 and case.linear:
        unit = np.maximum(unit, summed(case.allowance_at(*case.envelope)[1]))
    else:
        steps, (_, first) = case.begun
    off = np.abs(total - summed(first))[1:]
    limit = (case.roundings * steps[1:].astype(np.float64))[:, None]
    # a step from a state near the overflow threshold may exceed even its own bound
    finite = np.all(np.isfinite(run.q) & np.isfinite(run.p), axis=1)
    beyond = np.asarray(finite)[1:, None] & ~np.isfinite(unit)
    seen = np.asarray(off / np.where(beyond, np.inf, unit), np.float64)
    worst, axis = np.unravel_index(int(np.argmax(seen / limit)), seen.shape)
    size = np.maximum.accumulate(summed(np.abs(run.p)))[1:]
    told = ~beyond & (size > limit * unit)
    if seen[worst, axis] <= limit[worst, 0] and np.any(size > 0) and not np.any(told):
        return "rounding may be as large as all momenta together"
    # a force too large by x gains x times what its particle has gained
    change = np.abs(run.p[1:] - first)
    gained = np.stack([np.max(change[:, one], axis=1) for one in each], axis=1)
    known = gained > limit * unit
    off_by = np.min((limit * unit)[known] / gained[known], initial=np.inf)
    along = "" if len(axes) == 1 else f" along {'xyz'[axes[axis]]}"
    why = f"forces cancel in pairs{along}; {count(int(steps[worst + 1]), 'step')}, each rounded, of one sign"
    sees = Limits(reaction=float(off_by) if np.isfinite(off_by) else None)
    return Finding(float(seen[worst, axis]), float(limit[worst, 0]), "roundings", why, sees)


@check("angular", family="motion", requires=MAP | {"alike", "one-area"}, telling=False)
def angular_momentum(case: Case) -> Finding | str:
    """Angular momentum q_x p_y - q_y p_x changes by the determinant of a step: 1 for symplectic ones."""
    # a step that is one linear map A on both axes changes the area that they span, summed over particles, by
    # det A, or not at all where A is symplectic: Hairer, Lubich & Wanner, chapter VI.2
    run, (steps, start) = case.trajectory, case.begun
    noise = case.allowance_at(run.q, run.p)
    parts = [_areas(case, pair, (run.q, run.p), start, noise, steps) for pair in case.scene.system.alike]
    off, unit, size = (np.concatenate(x) for x in zip(*parts, strict=True))
    limit = np.tile(case.roundings * np.maximum(steps[1:], 1).astype(np.float64), len(parts))
    seen = np.asarray(off / np.where(unit > 0, unit, 1), np.float64)
    worst = int(np.argmax(np.where(np.isfinite(seen), seen / limit, np.inf)))
    told = np.isfinite(unit) & (size > limit * unit)
    if seen[worst] <= limit[worst] and not np.any(told):
        return "rounding may be as large as all of it"
    share = (limit * unit)[told] / (size * np.tile(np.maximum(steps[1:], 1), len(parts)))[told]
    why = f"roundings of {count(int(np.tile(steps[1:], len(parts))[worst]), 'step')}, all of one sign"
    sees = Limits(area=float(np.min(share, initial=np.inf))) if np.any(told) else Limits()
    return Finding(seen[worst], limit[worst], "roundings", why, sees)


def _areas(
    case: Case, pair: tuple[Integers, Integers], states: tuple[Reals, Reals],
    start: tuple[Extended, Extended], noise: tuple[Extended, Extended], steps: Integers,
) -> tuple[Extended, Extended, Extended]:  # fmt: skip
    """Error of the angular momentum in the plane of two axes, its largest change in one step by a rounding of
    each coordinate, and its right size, at every frame but the first, (f-1,) each."""
    x, y = pair
    (q, p), (dq, dp) = (tuple(one.astype(np.longdouble) for one in two) for two in (states, noise))
    factor: Extended | int = 1
    if not case.area_preserving:
        d = schemes.rotation(case.law.propagator).determinant[x]
        factor = d ** steps[:, None].astype(np.longdouble)
    first = start[0][x] * start[1][y] - start[0][y] * start[1][x]
    expected = np.sum(first * factor * np.ones((len(steps), 1)), axis=1)
    found = np.sum(q[:, x] * p[:, y] - q[:, y] * p[:, x], axis=1)
    each = np.abs(q[:, x]) * dp[:, y] + np.abs(p[:, y]) * dq[:, x] + np.abs(q[:, y]) * dp[:, x]
    unit = np.maximum.accumulate(np.sum(each + np.abs(p[:, x]) * dq[:, y], axis=1))
    return np.abs(found - expected)[1:], unit[1:], np.abs(expected)[1:]
