"""Thermostats by the Gaussian likelihood of an oscillator's states in (h w)**2, gamma h and kT/m.

The second moments of the frames are sufficient: of frames s steps of A and G apart, the map A**s and the
covariance of what s steps of noise come to.  In units of a step the law depends on (h w)**2 and gamma h
alone, and kT/m has its best value in closed form; Newton's method goes on from all starts at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import inf, nan

import numpy as np

from springcheck.bath.catalogue import THERMOSTATS, Thermostat
from springcheck.bath.laws import Law
from springcheck.physics.arrays import Floats

ODDS = float(np.log(1e6))
"""Log-likelihood ratio [nats] by which one scheme must exceed every other to be named."""

GAINED_BY_CHANCE = 26.0
"""Nats that nine parameters of a map, a constant and a noise gain over four or five by chance once in 1e9."""

STEPS_A_FRAME = (2, 3, 4, 5, 6, 8)
"""Steps from frame to frame that are tried where they are not known."""

EITHER_WAY = 0.5
"""Sine of the rotation between two frames, below which it is tried in both directions."""

FAR_ABOVE = 200.0
"""Nats above the best start's, from which on a descent is abandoned as soon as it gains little."""

STEPS_DOWNHILL = 40
"""Steps of Newton's method at most."""

STARTS_HALVED = 3
"""Most times that the friction of a start is halved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A scheme that may have made the states; standard errors are 0 for rounding, and NaN if unknown."""

    scheme: str
    omega: float = nan
    omega_error: float = nan
    friction: float = nan
    friction_error: float = nan
    thermal: float = nan
    """kT/m [L2/T2]."""
    thermal_error: float = nan
    nats: float = 0.0
    """Log-likelihood of the best candidate minus its own."""
    strides: tuple[int, ...] = (1,)
    """Steps from frame to frame that the frames leave open, the likeliest first, of which the numbers are."""


def likely(
    names: tuple[str, ...], q: Floats, v: Floats, h: float, *, turn: float | None = None
) -> list[Candidate]:
    """Schemes of noise of rank one by the likelihood of their innovations in frames of every step; `turn` is
    (h w)**2 if known.

    Empty where every one falls short of a free map and a free noise by more than chance allows.
    """
    found = [y for name in names for y in _of_scheme(THERMOSTATS[name], q, v, h, (1,), turn)]
    return _compared(found, q, v, rank=1)


def likely_apart(q: Floats, v: Floats, h: float, *, white: bool = True) -> list[Candidate]:
    """Schemes by their likelihood, the steps between two frames h apart unknown; such as fall short of the
    best by more than `ODDS` at every stride are left out, but for those of every step.  What every step
    leaves is white unless it carries draws on.  Empty as in `likely`.
    """
    found: list[Candidate] = []
    for scheme in THERMOSTATS.values():
        if not scheme.rescales:
            at_once = scheme.full_rank and white != bool(scheme.carried)
            found += _of_scheme(scheme, q, v, h, (1,) * at_once + STEPS_A_FRAME)
    kept: dict[str, Candidate] = {}
    for one in _compared(found, q, v):
        before = kept.get(one.scheme)
        if before is None:
            kept[one.scheme] = one
        elif one.nats < ODDS:
            kept[one.scheme] = replace(before, strides=(*before.strides, *one.strides))
    return [one for one in kept.values() if one.nats < ODDS or one.strides == (1,)]


def _compared(found: list[Candidate], q: Floats, v: Floats, *, rank: int = 2) -> list[Candidate]:
    """Candidates by what their likelihood falls short of the best, if one fits as a free map would, of the
    velocities alone where noise has a `rank` of 1: they carry all that the positions do."""
    best = min((y.nats for y in found), default=inf)
    moments, n = _moments(q, v)
    free = (moments[:2, :2] - _free(moments) @ moments[2:, :2])[2 - rank :, 2 - rank :]
    by_chance = GAINED_BY_CHANCE if rank == 2 else ODDS
    if not best - n / 2 * (float(np.log(np.linalg.det(free))) + rank) < by_chance:
        return []
    return sorted((replace(y, nats=y.nats - best) for y in found), key=lambda y: y.nats)


def _of_scheme(
    scheme: Thermostat, q: Floats, v: Floats, h: float, strides: tuple[int, ...], turn: float | None = None,
) -> list[Candidate]:  # fmt: skip
    """Best candidate of a scheme at each stride, or from each start, with its log likelihood in nats."""
    moments, n = _moments(q, v * h)
    begins, every = _starts(_free(moments)[:, :2], strides, n)
    if turn is not None:
        begins = begins[:, :1]
    of = partial(_profile, scheme, moments, n, turn)
    with np.errstate(all="ignore"):
        at, nats, curved = _descend(of, begins, every)
        thermal = of(at, every)[1]
    out = []
    for s in strides:
        rows = np.flatnonzero(every == s)
        if not np.isfinite(nats[rows]).any():
            continue
        i = rows[np.nanargmin(nats[rows])]
        errors = _errors(of, at[i], s, curved[i], 1 / n if scheme.full_rank or s > 1 else 2 / n)
        w = float(np.sqrt(turn if turn is not None else np.exp(at[i, 1])) * s / h)
        rate, heat = float(np.exp(at[i, 0]) * s / h), float(thermal[i] * (s / h) ** 2)
        out.append(
            Candidate(
                scheme=scheme.name, omega=w,
                omega_error=0.0 if turn is not None else float(w * errors[1] / 2), friction=rate,
                friction_error=float(rate * errors[0]), thermal=heat,
                thermal_error=float(heat * errors[-1]),
                # a change of the unit of velocity is no information
                nats=float(nats[i] - n * np.log(h)), strides=(s,),
            )
        )  # fmt: skip
    return out


def _profile(
    scheme: Thermostat, moments: Floats, n: int, turn: float | None, at: Floats, every: Floats
) -> tuple[Floats, Floats]:
    """Minus the logarithm of the likelihood (k,) at log gamma h and log (h w)**2 (k, 2) of strides (k,), in
    units of a frame, and the best kT/m in those of a step."""
    turns = np.full(len(at), turn) if turn is not None else np.exp(at[:, 1])
    law = Law(
        scheme=scheme, h=1.0, m=np.ones(len(at)), k=turns, rate=np.exp(at[:, 0]), thermal=1.0,
    )  # fmt: skip
    B, Q = law.apart(every)
    unit = np.stack([np.ones(len(at)), every], axis=1)
    B = B * unit[:, :, None] / unit[:, None, :]
    Q = Q * unit[:, :, None] * unit[:, None, :]
    full = scheme.full_rank or not np.all(every == 1)
    # of one draw the position and the momentum carry the same information
    weight = Q[:, ::-1, ::-1] * np.array([[1, -1], [-1, 1]]) if full else np.diag([0.0, 1.0])
    apart = np.stack([1 - B[:, 0, 0], -B[:, 1, 0]], axis=1)[:, :, None]
    over = np.concatenate([np.broadcast_to(np.eye(2), B.shape), -B, 0 * apart], axis=2)
    # the likeliest centre: where it does not matter, as without a spring, 0
    weighed = apart.transpose(0, 2, 1) @ weight
    held, mean = weighed @ apart, weighed @ over @ moments[:, -1:]
    centre = np.divide(mean, held, where=held > 0, out=np.zeros_like(held))
    over[:, :, -1:] = -centre * apart
    seen = over @ moments @ over.transpose(0, 2, 1)
    if full:
        det = Q[:, 0, 0] * Q[:, 1, 1] - Q[:, 0, 1] ** 2
        thermal = (
            Q[:, 1, 1] * seen[:, 0, 0] + Q[:, 0, 0] * seen[:, 1, 1] - 2 * Q[:, 0, 1] * seen[:, 0, 1]
        ) / (2 * det)
        value = 2 * np.log(thermal) + np.log(det) + 2
    else:
        thermal = seen[:, 1, 1] / Q[:, 1, 1]
        value = np.log(seen[:, 1, 1]) + 1
    value = n / 2 * value
    return np.where(np.isfinite(value), value, inf), np.asarray(thermal)


def _starts(A: Floats, strides: tuple[int, ...], n: int) -> tuple[Floats, Floats]:
    """Log gamma h and log (h w)**2 (k, 2) of which a free map A of n frames has its decay and its turn, at
    strides (k,); whole turns between frames leave several of a stride."""
    det = min(max(float(np.linalg.det(A)), 1e-6), 1 - 1e-6)
    half, known = float(np.trace(A)) / 2, 1 / np.sqrt(n)
    out, every = [], []
    # of a decay below what so many frames tell, the largest is as likely
    for s, left in [(s, x) for s in strides for x in ([det] if det > known else [det, known])]:
        decay = left ** (1 / s)
        if half * half < left or half < 0:
            cosine = max(half / np.sqrt(left), -1.0)
            angle, sine = float(np.arccos(cosine)), np.sqrt(1 - cosine * cosine)
            # of half a turn, more or less, the frames may not tell which way it was
            ways = [angle, 2 * np.pi - angle][:: 1 if A[0, 1] > 0 else -1][: 2 if sine < EITHER_WAY else 1]
            angles = [angle] if s == 1 else [(x + 2 * np.pi * m) / s for m in range(s) for x in ways]
            traces = [2 * np.sqrt(decay) * np.cos(x) for x in angles if x < np.pi]
        else:
            roots = half + np.array([1, -1]) * np.sqrt(half * half - left)
            traces = [float(np.sum(np.maximum(roots, 1e-6) ** (1 / s)))]
        for trace in traces or [0.0]:
            turn = min(max(2 * (1 - trace / (1 + decay)), 1e-6), 3.9)
            out.append(np.log([-np.log(decay), turn]))
            every.append(s)
    return np.array(out), np.array(every)


def _descend(
    of: Callable[[Floats, Floats], tuple[Floats, Floats]], at: Floats, every: Floats
) -> tuple[Floats, Floats, Floats]:
    """Minima of a function from starts (k, p) by Newton's method, its curvatures taken positive and damped:
    where they are, its values (k,) and its second derivatives (k, p, p)."""
    at, damping = at.copy(), np.full(len(at), 1e-3)
    best, slope, curved = _derivatives(of, at, every)
    for _ in range(STARTS_HALVED):
        # a decay in a frame may be of more friction than a scheme has a motion for
        if not len(lost := np.flatnonzero(~np.isfinite(best))):
            break
        at[lost, 0] -= np.log(2)
        best[lost], slope[lost], curved[lost] = _derivatives(of, at[lost], every[lost])
    going = np.isfinite(best)
    for _ in range(STEPS_DOWNHILL):
        rows = np.flatnonzero(going)
        if not len(rows):
            break
        sizes, ways = np.linalg.eigh(curved[rows])
        along = np.einsum("kij,ki->kj", ways, slope[rows])
        sizes = np.abs(sizes) + damping[rows, None] * np.max(np.abs(sizes), axis=1, keepdims=True) + 1e-9
        move = -np.einsum("kij,kj->ki", ways, along / sizes)
        gain = np.sum(along**2 / sizes, axis=1) / 2
        move /= np.maximum(np.max(np.abs(move), axis=1, keepdims=True), 1.0)
        value, new_slope, new_curved = _derivatives(of, at[rows] + move, every[rows])
        better = value < best[rows]
        won = rows[better]
        at[won] += move[better]
        best[won], slope[won], curved[won] = value[better], new_slope[better], new_curved[better]
        damping[rows] *= np.where(better, 0.1, 10)
        # what is far off, and would be after ten such steps, is no minimum that counts
        near = best[rows] - 10 * gain < np.min(best) + FAR_ABOVE
        going[rows] = (gain > 1e-5) & (damping[rows] < 1e8) & near
    return at, best, curved


def _derivatives(
    of: Callable[[Floats, Floats], tuple[Floats, Floats]], at: Floats, every: Floats
) -> tuple[Floats, Floats, Floats]:
    """Values (k,), slopes (k, p) and second derivatives (k, p, p) of a function, by differences."""
    k, p = at.shape
    step, unit = 1e-3, np.eye(p)
    pairs = [(i, j) for i in range(p) for j in range(i)]
    moves = [np.zeros(p), *unit, *-unit]
    moves += [a * unit[i] + b * unit[j] for i, j in pairs for a in (1, -1) for b in (1, -1)]
    points = at[:, None] + step * np.array(moves)
    y = of(points.reshape(-1, p), np.repeat(every, len(moves)))[0].reshape(k, -1)
    up, down, curved = y[:, 1 : p + 1], y[:, p + 1 : 2 * p + 1], np.empty((k, p, p))
    for i in range(p):
        curved[:, i, i] = up[:, i] - 2 * y[:, 0] + down[:, i]
    for (i, j), four in zip(pairs, np.split(y[:, 2 * p + 1 :], max(len(pairs), 1), axis=1), strict=False):
        curved[:, i, j] = curved[:, j, i] = (four[:, 0] - four[:, 1] - four[:, 2] + four[:, 3]) / 4
    off, slope = ~np.isfinite(y).all(axis=1), (up - down) / (2 * step)
    value = np.where(off, inf, y[:, 0])
    slope[off], curved[off] = 0, 0
    return value, slope, curved / step**2


def _errors(
    of: Callable[[Floats, Floats], tuple[Floats, Floats]], at: Floats, every: int, curved: Floats, own: float
) -> Floats:
    """Relative standard errors of exp(at), and of kT/m, whose variance is `own` where these are known."""
    step, unit = 1e-3, np.eye(len(at))
    heat = np.log(of(np.concatenate([at + step * unit, at - step * unit]), np.full(2 * len(at), every))[1])
    slope = (heat[: len(at)] - heat[len(at) :]) / (2 * step)
    try:
        spread = np.linalg.inv(curved)
    except np.linalg.LinAlgError:
        return np.full(len(at) + 1, nan)
    variances = np.array([*np.diag(spread), own + slope @ spread @ slope])
    return np.sqrt(np.where(variances >= 0, variances, nan))


def _moments(q: Floats, v: Floats) -> tuple[Floats, int]:
    """Second moments of (x', v', x, v, 1), (5, 5), and of how many frames."""
    # a mean velocity is none of the law: over few frames, of little friction, it is not 0
    z, n = np.stack([q - np.mean(q), v]), len(q) - 1
    both = np.concatenate([z[:, 1:], z[:, :-1], np.ones((1, n))])
    return np.asarray(both @ both.T / n), n


def _free(moments: Floats) -> Floats:
    """The best map of a frame and the best constant, (2, 3), of these moments."""
    return np.asarray(np.linalg.solve(moments[2:, 2:], moments[2:, :2]).T)
