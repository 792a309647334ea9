"""The thermostat behind the states of an oscillator, by a combination free of noise and by likelihood.

With one draw a step a combination of (x', v', x, v) is free of noise: a null vector of the recorded frames,
known to rounding at any temperature.  Where that is not enough, the likelihood decides.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, nan
from typing import Any

import numpy as np

from springcheck.bath.catalogue import THERMOSTATS
from springcheck.bath.decays import GJ
from springcheck.identify import bath_residuals as residuals
from springcheck.identify.bath_collisions import between_collisions, changed, is_a_factor
from springcheck.identify.bath_likelihood import ODDS, Candidate, likely, likely_apart
from springcheck.identify.bath_residuals import is_white, regressed, unlike_normal
from springcheck.physics.arrays import Floats

NOISE = 1e-3
"""Smallest noise of a step, relative to the motion, that is not taken for a file's rounding: that of gamma h
= 5e-7."""

COARSE = 0.01
"""Ratio of a file's rounding to the noise, from which on it hides whether a step had a collision."""

DECAY_ERRORS = 5.0
"""Standard errors of a fitted decay that bound its error."""

SMALL_CHANGE = 1e-4
"""Relative change of a friction over which its effect is linear."""

UNIT_ROOT = 20.0
"""Bias and spread of a root that is 1, in units of 1 over the number of frames."""

SPARSE = 0.1
"""Median of the draws, of variance 1, below which most steps have none: 0.67 for normal ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermal:
    """What the states of an oscillator in a bath show."""

    candidates: tuple[Candidate, ...] = ()
    """The best first; none where no known scheme fits."""
    free: tuple[float, ...] = ()
    """The combination of (x', v', x, v) that is free of noise, 1 on x'; () where there is none."""
    misfit: float = nan
    """Root mean square of that combination over that of the noise."""
    draws: str = ""
    """How the draws are not normal, "" where that does not show."""
    known: bool = True
    """Whether the kind of noise is known: one momentum shows no factor, but any change of it that begins or
    ends a step."""
    added: bool = False
    """Whether draws are added to momenta after velocity Verlet, without friction: no scheme's."""

    @property
    def named(self) -> bool:
        """Whether one scheme beats every other, and every one of smaller steps."""
        best = bool(self.candidates) and all(x.nats > ODDS for x in self.candidates[1:])
        return best and self.known and self.candidates[0].strides == (1,)


def identify_thermal(
    t: Floats, q: Floats, v: Floats, beside: Floats | None = None, *, mixed: bool = False
) -> Thermal | None:
    """The thermostat that made positions q and velocities v (f,) at times t (f,); None where none seems to
    have.

    In a mode of several particles the draws are mixed, and their distribution does not show.  For a particle
    coupled to those `beside` it (f, others) no scheme is inferred.  Deterministic motion, coupled or not,
    leaves no residual that is white from frame to frame.
    """
    if len(t) < residuals.FEWEST or not np.isfinite([q, v]).all():
        return None
    h = float((t[-1] - t[0]) / (len(t) - 1))
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.array([np.std(q), np.std(v)])
    if not np.all((sizes > 0) & (sizes < np.inf)) or not h > 0:
        return None
    # in a unit of length near that of the motion, a power of 2, no square underflows
    unit = float(2.0 ** np.round(np.log2(max(sizes[0], h * sizes[1]))))
    found = _identified(q / unit, v / unit, h, None if beside is None else beside / unit, mixed)
    return found and replace(
        found,
        candidates=tuple(
            replace(y, thermal=y.thermal * unit * unit, thermal_error=y.thermal_error * unit * unit)
            for y in found.candidates
        ),
    )


def _identified(q: Floats, v: Floats, h: float, beside: Floats | None, mixed: bool) -> Thermal | None:
    sizes = np.array([np.std(q), np.std(v)])
    x, u = (q - q[0]) / sizes[0], v / sizes[1]
    # a constant beside the state: the centre is not known
    frames = np.stack([x[1:], u[1:], x[:-1], u[:-1], np.ones(len(x) - 1)], axis=1)
    weights, turned = np.linalg.svd(frames, full_matrices=False)[1:]
    z = np.stack([x, u])
    sizes_left, left = residuals.left_of(z, np.empty((0, z.shape[1] - 1)))
    if weights[3] < NOISE * weights[0] or residuals.of_state(left[1], x[:-1], u[:-1]):
        return None
    # a nonlinear force is no scheme's draw
    known = np.stack([x[:-1], u[:-1], np.ones(len(x) - 1)], axis=1)
    bent = residuals.follows(left[1], np.stack([x**2, x**3], axis=1)[:-1], known)

    def clear(found: Thermal | None) -> Thermal | None:
        return found and replace(found, known=found.known and not bent)

    # the residual of a coordinate without noise is rounding
    added = partial(residuals.is_added, left[sizes_left > NOISE], sizes_left[1] * left[1], u[1:])
    even = added(1)
    rest = frames @ turned[4] / max(float(np.std(frames @ turned[4])), 1e-300)
    if beside is not None:
        moved = np.concatenate([beside[:-1], np.diff(beside, axis=0)], axis=1)
        joined = weights[4] > 1e-9 * weights[3] and residuals.follows(rest, moved, known)
        if joined or residuals.follows(left[1], moved, known):
            size, joint = residuals.left_of(z, moved.T)
            # of joined particles, as of one, what takes no noise leaves none that is white
            noisy = np.max(size) > NOISE and all(map(is_white, joint))
            return Thermal() if noisy else None
    if weights[4] < 1e-3 * weights[3]:
        free = turned[4][:4] / np.tile(sizes, 2)
        misfit = weights[4] / weights[3]
        # the residual of digits is white but for neighbours, which share a frame
        digits = misfit < 1e-9 or residuals.is_of_digits(rest[::2])
        # of one draw the position and the momentum leave the same; a joint to what is beside may not show
        several = mixed or (beside is not None and beside.size > 0)
        if not (free[0] and digits):
            return None
        return clear(_of_one(q, v, h, free / free[0], misfit, left[1], even, several))
    jump = (x[2:] - x[:-2]) - 2 * h * sizes[1] / sizes[0] * u[1:-1]
    off = float(np.std(jump))
    # and of what frames two steps apart share none three steps apart do
    if off < 1e-6 or (off < 1e-3 * sizes_left[0] and residuals.is_of_digits(jump[::3])):
        return clear(_of_two_halves(q, h, off, beside, mixed))
    collided, white = between_collisions(q, v, h), all(map(is_white, left))
    if collided or (white and collided is not None):
        return Thermal(candidates=tuple(collided))
    coloured = not (white and even)
    # draws that are carried on into the next frame are in no other
    if coloured and not (all(is_white(x[i::2]) for x in left for i in (0, 1)) and added(2)):
        return None
    found = tuple(likely_apart(q, v, h, white=white))
    if white and coloured and not any(THERMOSTATS[one.scheme].carried for one in found):
        return None
    # a factor of the momenta, of several steps, leaves what collisions do
    a_factor = any(THERMOSTATS[y.scheme].collides and y.strides != (1,) for y in found)
    return Thermal(
        candidates=found, draws=_shape(found, left[1], mixed),
        known=not (bent or a_factor) and white and not residuals.grows(left[1], x[:-1], x[1:]),
    )  # fmt: skip


def _of_one(
    q: Floats, v: Floats, h: float, free: Floats, misfit: float, left: Floats, even: bool, mixed: bool
) -> Thermal | None:
    """Schemes of one draw a step whose null vector this is."""
    _, b, c, d = free
    close = max(1e-9, 100 * misfit)
    # that combination is 0 of a centre at rest, and both half kicks are -h w**2/2 (q + q') about it
    centre = float(np.mean(q[1:] + b * v[1:] + c * q[:-1] + d * v[:-1])) / (1 + c or inf)
    kicks = h / 2 * (q[1:] + q[:-1] - 2 * centre)

    def near(value: float, wanted: float) -> bool:
        return bool(abs(value - wanted) <= close * max(abs(wanted), abs(d), h))

    # where the noise acts on the momentum: after both half kicks, or ahead of them
    after, ahead = bool(abs(b) <= close * h and near(d, -h)), bool(abs(d) <= close * h and near(b, h * c))

    def acted(w: float) -> tuple[Floats, Floats]:
        """Momenta before and after what acts there, (f - 1,) each, beside kicks of frequency w."""
        return (v[:-1] - w**2 * kicks, v[1:]) if after else (v[:-1], v[1:] + w**2 * kicks)

    state = np.stack([(q[:-1] - q[0]) / np.std(q), v[:-1] / np.std(v), np.ones(len(v) - 1)], axis=1)
    if (after or ahead) and (counted := between_collisions(q, v, h)):
        # of several steps no combination is free of noise, and of a collision that ends a step another one
        ends = (y for y in counted if after == (THERMOSTATS[y.scheme].acts[-1].kind == "collide"))
        each = tuple(replace(y, strides=(1,)) for y in ends)
        before, made = acted(each[0].omega if each else 0.0)
        struck = np.abs(made - before) > close * np.std(v)
        shape = unlike_normal(regressed(state[struck], made[struck])[1]) if each else ""
        return Thermal(candidates=each, free=tuple(map(float, free)), misfit=misfit, draws=shape)
    found, added, sparse = list[Candidate](), False, bool(np.median(np.abs(left)) < SPARSE)
    if near(b, d) and near(c, -1):
        half, (decay, slow, error) = near(b, -h / 2), _decay(q, v)
        turn = 4 * (1 + h / (2 * b))
        # with few digits BAOAB's null vector is near that of the others
        blurred = close > 1e-6 and abs(turn - slow) <= 4 * (error + close)
        if half:
            # without a spring these are all the same
            more = ("baoab", "baoa") if slow < error else ("baoab",) if blurred else ()
            found = likely(("aboba", "aoboa", *more), q, v, h)
        if -b > h / 2 and not half and decay + error > 0 and abs(turn - slow) <= 4 * error:
            found = likely(("baoab",), q, v, h, turn=turn)
        if not half or close > 1e-6 or slow < error:
            # a GJ scheme kicks and drifts by another step: another spring for the same null vector
            found += [y for number in GJ if (y := _as_gj(number, decay, slow, error, -b, h, 8 * close))]
    elif near(b, d) and near(b, -h / 2) and -1 < c < 1:
        found = likely(("baoa",), q, v, h, turn=2 * (1 + c))
    elif near(c, -1) and after:
        decay, slow, error = _decay(q, v)
        found = likely(("euler-maruyama",), q, v, h)
        if slow < error:
            # without a spring Bussi's factor leaves the same, and so does a collision in nearly every step
            often, _, anew = changed(np.diff(v) / np.std(v), v[1:], state, close)
            found = [*found * (not anew or (often and even)), *[Candidate(scheme="bussi-after")] * often]
            found, left = ([*found, Candidate(scheme="andersen-after")], left[:0]) if anew else (found, left)
    elif (ahead and abs(c) > 1 + close) or (after and -1 < c < 1):
        w = float(np.sqrt(2 * (1 + (c if after else 1 / c))) / h)
        before, made = acted(w)
        # some steps have no collision, unless these are many; a factor acts in every step, if little
        often, collides, anew = changed((made - before) / np.std(v), made, state, close)
        often = often or close > COARSE
        if after:
            collides = collides and (mixed or anew)
            # noise that is no factor of the momenta, and no friction of theirs, is added to them
            added = not collides and even and _decay(q, v)[0] >= 1 - UNIT_ROOT / len(q) and is_white(left)
            names = ("andersen-after",) * collides
            names += ("bussi-after",) if often and not added and is_a_factor(before, made) else ()
        else:
            # OAB has the null vector of twice its spring: of a collision nothing of a kick is left
            slopes, _, errors = regressed(state, made / np.std(v))
            collides = collides and bool(abs(slopes[0]) < 5 * errors[0] + close * np.std(q) / h / np.std(v))
            names = ("andersen", "andersen-after-kick") if collides else ()
            names += ("bussi", "bussi-unsigned") if often and (mixed or is_a_factor(before, made)) else ()
        if not names and not added:
            return None
        found = [Candidate(scheme=name, omega=w, omega_error=0.0) for name in names]
        left = left if added else np.empty(0)
    elif near(c, -1) and abs(d) <= close * h:
        roots = {n: (lambda x, c2=c2: np.sqrt((1 - c2(x)) / x)) for n, c2 in GJ.items()}
        if near(b, -h):
            before = np.stack([v[:-1], q[:-1], np.ones(len(v) - 1)], axis=1)
            entries, _, errors = regressed(before, v[1:])
            carried, spring = np.abs(entries[:2] / errors[:2]) > 5
            # of several particles' collisions each mode has a part
            names, leapfrog = _of_no_memory(q, v, inf if mixed else close, carried), "andersen-leapfrog"
            of_two = not is_white(left) and residuals.is_correlated(left) and not sparse
            if of_two and names != (leapfrog,):
                found, left = likely(("gj-iii-half",), q, v, h), np.empty(0)
                if found and close > 1e-6:
                    # of little friction few digits do not show a step that is not stretched
                    x = max(h * (found[0].friction - 5 * found[0].friction_error), 1e-9)
                    near_1 = [n for n in GJ if n != "iii" and roots[n](np.asarray(x)) > 1 - 2 * close]
                    found += [Candidate(scheme=f"gj-{n}-half") for n in near_1]
            else:
                if not spring:
                    # without a spring these leave the same
                    names += ("andersen", "andersen-after-kick") if leapfrog in names else ()
                    names += ("bussi", "bussi-unsigned") if is_a_factor(v[:-1], v[1:]) else ()
                one = "gj-iii-half"
                found = [Candidate(scheme=name) for name in names if name != one]
                found += likely((one,), q, v, h) if one in names else []
        elif -b < h and residuals.is_correlated(left):
            rates = {f"gj-{n}-half": _rate(root, -b / h) for n, root in roots.items()}
            found = [Candidate(scheme=n, friction=x / h, friction_error=0.0) for n, x in rates.items() if x]
            left = np.empty(0)
    is_even = even or any(x.scheme == "andersen-leapfrog" for x in found)
    if len(left) and not (is_white(left) and is_even):
        return None
    if not found and sparse:
        # few steps are off, and all others are not
        return None
    # explicit friction in a loop of one's own leaves what these two leave where digits hide collisions
    alike = {x.scheme for x in found} - ({"andersen-leapfrog", "andersen-after"} if found[1:] else set())
    # and another order of the same stages does, ABO and ABOA, at other numbers
    shared = {"bussi-after"}, {"gj-iii-half"}, {"aboba", "aoboa"}
    return Thermal(
        candidates=tuple(found), free=tuple(map(float, free)), misfit=misfit,
        draws=_shape(found, left, mixed), added=added,
        known=alike not in shared and not alike & {"bussi", "euler-maruyama"} and close <= COARSE,
    )  # fmt: skip


def _shape(found: Sequence[Candidate], left: Floats, mixed: bool) -> str:
    """How draws that a map has left are not normal; of collisions and factors it leaves more than draws."""
    known = [THERMOSTATS[x.scheme] for x in found]
    mixed = mixed or any(x.collides or x.rescales for x in known)
    return "" if mixed or not len(left) else unlike_normal(left)


def _rate(of: Callable[[Floats], Floats], wanted: float) -> float | None:
    """The x = gamma h at which a decreasing function is `wanted`, by bisection."""
    low, high = 1e-9, 1e4
    if not of(np.asarray(high)) < wanted < of(np.asarray(low)):
        return None
    for _ in range(200):
        x = (low + high) / 2
        low, high = (x, high) if of(np.asarray(x)) > wanted else (low, x)
    return x


def _decay(q: Floats, v: Floats) -> tuple[float, float, float]:
    """Determinant of the fitted linear map, which is the decay of momenta, (h w)**2 by its trace, and a bound
    of the error of both: five standard errors, and a share of 1/n for the bias of a root near 1 (Dickey &
    Fuller, J. Am.  Stat.  Assoc. 74 (1979) 427)."""
    # normalised, so that neither is small beside the other
    z = np.stack([(x - np.mean(x)) / np.std(x) for x in (q, v)])
    A, n = np.linalg.lstsq(z[:, :-1].T, z[:, 1:].T, rcond=None)[0], len(q)
    decay = float(np.linalg.det(A))
    error = DECAY_ERRORS * float(np.sqrt(max(1 - decay * decay, 0.0) / n)) + UNIT_ROOT / n
    return decay, 2 - 2 * float(np.trace(A)) / (1 + decay), error


def _as_gj(
    number: str, decay: float, slow: float, error: float, t: float, h: float, least: float
) -> Candidate | None:
    """What a GJ scheme would mean by the null vector (1, -t, -1, -t), of a decay and an (h w)**2 of its
    stretched step that are known to an error, the latter to two such in its trace and its determinant; t
    leaves an (h w)**2 of 0 known to `least`."""

    def stretched(x: Any) -> tuple[Any, Any]:
        stretch = GJ[number].stretch(x)
        return stretch, 4 * (1 - stretch * h / (2 * t)) / stretch**2

    x = np.append(np.geomspace(1e-9, 1e4, 4000), _rate(GJ[number], decay) or [])
    with np.errstate(all="ignore"):
        stretch, a = stretched(x)
        fits = (a > -least) & (np.abs(a * stretch**2 - slow) <= 4 * error)
        off = np.where(fits, np.abs(GJ[number](x) - decay), np.inf)
    best = int(np.argmin(off))
    if not off[best] <= error:
        return None
    # what a friction that is off by its standard error makes of the decay, and of the spring; GJ-I does not
    # stretch, and knows its spring whatever its friction
    ends = x[best] * (1 + np.array([-SMALL_CHANGE, SMALL_CHANGE]))
    rate = error / DECAY_ERRORS * np.ptp(ends) / max(float(np.ptp(GJ[number](ends))), 1e-300)
    of_a = 0.0 if number == "i" else float(np.ptp(stretched(ends)[1]) / np.ptp(ends) * rate)
    turn = float(np.sqrt(max(a[best], 0.0)))
    return Candidate(
        scheme=f"gj-{number}", omega=turn / h, omega_error=of_a / (2 * h * max(turn, of_a**0.5, 1e-300)),
        friction=float(x[best] / h), friction_error=float(rate / h),
    )  # fmt: skip


def _of_no_memory(q: Floats, v: Floats, close: float, carried: bool) -> tuple[str, ...]:
    """Schemes in which positions follow their velocities, v = (x' - x)/h, of which a part may be carried on,
    and a bath draws these anew at every step, or at some: between those leapfrog leaves
    v'' - 2 v' + v = -h w**2 (x' - x)."""
    with np.errstate(all="ignore"):
        slopes = np.sort((v[2:] - 2 * v[1:-1] + v[:-2]) / (q[1:-1] - q[:-2]))
        together = slopes[4:] - slopes[:-4]
        if np.any(together < 1e-6 * np.abs(slopes[2:-2])):
            return ("andersen-leapfrog",)
    if carried:
        # digits may hide that five steps of leapfrog have one slope, and few frames that a draw is carried on
        return ("gj-iii-half", *(() if close < 1e-6 else ("andersen-leapfrog",)))
    # a collision in every step leaves what Brownian motion does, and so does a small part carried on
    return ("brownian", "andersen-leapfrog", "gj-iii-half")


def _of_two_halves(q: Floats, h: float, misfit: float, beside: Floats | None, mixed: bool) -> Thermal | None:
    """Schemes whose draw acts in two half kicks: each velocity of a half step has a draw of its own."""
    half = np.diff(q) / h
    known = np.stack([half[:-1], q[1:-1], np.ones(len(half) - 1)], axis=1)
    entries, left, (of_c, of_kick, _) = regressed(known, half[1:])
    c, kick, noise = float(entries[0]), float(entries[1]), float(np.std(left))
    if noise == 0 or not is_white(left / noise):
        return None
    # a force that is not linear leaves more than draws
    bent = residuals.follows(left / noise, np.stack([q**2, q**3], axis=1)[1:-1], known)
    draws = left / noise
    if beside is not None:
        # a weak joint to what stands beside, which does not show by itself, is no draw
        draws = regressed(np.concatenate([known, beside[1:-1]], axis=1), draws)[1]
        draws /= np.std(draws)
    shape = "" if mixed else unlike_normal(draws)
    uniform, normal = shape == residuals.UNIFORM, bool(np.max(np.abs(draws)) > 2.2) and not mixed
    found = []
    for name, share, slope in (
        ("lammps-langevin", 1 - c, 1.0),
        ("bbk", 2 * (1 - c) / (1 + c), 4 / (1 + c) ** 2),
    ):
        # v' = c v - kick x' + noise, the kick of h w**2 and the noise over 1 + x/2 for BBK
        over = 1 + share / 2 if name == "bbk" else 1.0
        a, error = -kick * h * over, of_kick * h * over
        # a spring may be too soft to show, and a friction too small
        if a <= -5 * error or share <= -5 * of_c * slope:
            continue
        w, x = float(np.sqrt(max(a, 0.0)) / h), max(share, 0.0)
        thermal = float((noise * over) ** 2 / (2 * x)) if x else nan
        found.append(
            Candidate(
                scheme=name, omega=w, omega_error=float(error / (2 * h * max(w * h, np.sqrt(error)))),
                friction=float(x / h), friction_error=float(of_c * slope / h), thermal=thermal,
                thermal_error=thermal * float(np.hypot(np.sqrt(2 / len(left)), of_c * slope / (x or nan))),
                # each draws as its library does, where that shows: uniform draws end at 1.73
                nats=inf if (uniform and name == "bbk") or (normal and name != "bbk") else 0.0,
            )
        )  # fmt: skip
    # noise in proportion to the force is none that a scheme adds
    found = [] if residuals.grows(draws, q[1:-1]) else sorted(found, key=lambda y: y.nats)
    return Thermal(candidates=tuple(found), misfit=misfit, draws=shape, known=not bent)
