"""Which thermostat made the frames of an oscillator: a scheme is a row with a covariance next to its map.

One step is z' = A z + G xi.  The best map of the frames and the covariance of what it leaves are measured
once (`noise_of`).  A row has two free numbers, a = (h w)**2 and x = gamma h, and its best kT in closed form;
its score is its log-likelihood below that of a free map with a free covariance, in nats (`fit`).  Where one
draw enters a step, one combination of (q', v', q, v) is free of noise, to rounding, at any temperature: a
row with another combination is rejected, and the numbers that it depends on are known to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from math import inf, log, nan, sqrt

import numpy as np

from springcheck.bath import evidence
from springcheck.bath.catalogue import THERMOSTATS, Thermostat
from springcheck.bath.laws import Law
from springcheck.physics.arrays import Floats

FEWEST = 200
"""Fewest frames from which a thermostat is named."""

NOISE = 1e-3
"""Smallest noise of a step, relative to the motion, that is not taken for a file's rounding."""

ONE_DRAW = 1e-3
"""Largest part of a combination that is free of noise, relative to the noise."""

ODDS = log(1e6)
"""Nats by which a scheme is less likely than another, or than a free map, where it is rejected."""

WHITE = 1e-9
"""Probability below which what a map leaves are no draws."""

CORRELATED = 6.2
"""Standard errors of a correlation with the state, of chance `WHITE`."""

NEIGHBOURS_DIFFER = 0.8
"""Mean squared difference of what neighbouring states leave, over its variance, below which it follows from
the state: 2 of draws, less than 0.1 of a smooth function."""

FEWEST_OF_EACH, TRIPLES = 10, 30_000
"""Fewest frames with and without a collision, and triples of frames that are tried for a map."""

DRAWN_ONCE = tuple(
    one for one in THERMOSTATS.values()
    if not (one.collides or one.rescales or one.full_rank) and one.name not in ("bbk", "lammps-langevin")
)  # fmt: skip
"""Rows whose noise has one direction in every step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A scheme that may have made the frames; standard errors are 0 where rounding is all, NaN if unknown."""

    scheme: str
    omega: float = nan
    omega_error: float = nan
    friction: float = nan
    friction_error: float = nan
    thermal: float = nan
    """kT/m [L2/T2]."""
    thermal_error: float = nan
    nats: float = 0.0
    """Log-likelihood of a free map and covariance less its own."""
    known: bool = True
    """Whether the frames hold more numbers than the scheme leaves free: else an unknown one fits as well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Noise:
    """Frames of one oscillator a step of h apart, z = (q, v h), and what their best map leaves."""

    h: float
    z: Floats
    moments: Floats
    """Covariance (4, 4) of (z', z)."""
    A: Floats
    left: Floats
    """What the best map leaves, (f - 1, 2)."""
    free: Floats
    """The combination of (q', v' h, q, v h) with the least noise, 1 on q'."""
    misfit: float
    """Root mean square of that combination over that of the noise."""

    @property
    def close(self) -> float:
        """Relative error of the entries of `free`, and of a map between collisions."""
        return max(1e-9, 100 * self.misfit)


def noise_of(q: Floats, v: Floats, h: float) -> Noise | None:
    """What a linear map of positions and velocities (f,), h apart, leaves; None of too few frames, at rest,
    or where it leaves nothing beyond a file's rounding."""
    z = np.stack([q - np.mean(q), v * h], axis=1)
    if len(z) < FEWEST or not (np.isfinite(z).all() and np.all(np.ptp(z, axis=0) > 0)):
        return None
    frames = np.concatenate([z[1:], z[:-1]], axis=1)
    frames = frames - np.mean(frames, axis=0)
    size = np.tile(np.std(z, axis=0), 2)
    weights, ways = np.linalg.svd(frames / size, full_matrices=False)[1:]
    if weights[2] < NOISE * weights[0]:
        return None
    A = np.linalg.lstsq(frames[:, 2:], frames[:, :2], rcond=None)[0].T
    free = ways[3] / size
    return Noise(
        h=h, z=z, moments=frames.T @ frames / len(frames), A=A, left=frames[:, :2] - frames[:, 2:] @ A.T,
        free=free / free[0] if free[0] else np.full(4, nan), misfit=float(weights[3] / weights[2]),
    )  # fmt: skip


def _law(scheme: Thermostat, at: Floats) -> tuple[Floats, Floats]:
    """Map (k, 2, 2) and noise (k, 2, draws) on (q, v h) at log a, log x (k, 2)."""
    a, x = np.exp(at.T)
    _, A, G = Law(scheme=scheme, h=1.0, m=np.ones(len(at)), k=a, rate=x, thermal=1.0)._maps[-1]
    return A[:, :2, :2].astype(float), np.concatenate([A[:, :2, 2:], G[:, :2]], axis=2).astype(float)


def _off(scheme: Thermostat, seen: Noise, at: Floats) -> Floats:
    """How far the combination that is free of noise at log a, log x (k, 2) is from the one seen, (k, 3)."""
    A, G = _law(scheme, at)
    g = np.take_along_axis(G, np.argmax(np.abs(G[:, 1:]), axis=2)[..., None].repeat(2, 1), 2)[:, :, 0]
    n = np.stack([np.ones(len(at)), -g[:, 0] / g[:, 1]], axis=1)
    size = np.sqrt(np.diag(seen.moments))
    both = np.concatenate([n[:, 1:], -np.einsum("ki,kij->kj", n, A)], axis=1)
    return np.asarray((both - seen.free[1:]) * size[1:] / size[0])


def _slopes(of: Callable[[Floats], Floats], at: Floats) -> Floats:
    """Derivatives (k, m, 2) of a function of log a and log x (k, 2)."""
    return np.stack([(of(at + d) - of(at - d)) / 2e-5 for d in 1e-5 * np.eye(2)], axis=2)


def _back(scheme: Thermostat, seen: Noise, at: Floats, rounds: int) -> Floats:
    """The nearest numbers at which the combination that is free of noise is the one seen (Gauss-Newton)."""

    def of(x: Floats) -> Floats:
        return np.nan_to_num(_off(scheme, seen, x), nan=1e9, posinf=1e9, neginf=-1e9)

    for _ in range(rounds):
        off = of(at)
        if np.max(np.abs(off)) < 1e-14:
            break
        step = np.linalg.pinv(_slopes(of, at), rcond=1e-6) @ off[..., None]
        at = at - np.clip(step[..., 0], -1, 1)
    return at


def _score(scheme: Thermostat, seen: Noise, at: Floats) -> tuple[Floats, Floats]:
    """Nats below a free map, and kT h**2/m, at log a and log x (k, 2)."""
    A, G = _law(scheme, at)
    Q = G @ G.transpose(0, 2, 1)
    if scheme.carried:
        # what a carried draw has in common with the state before belongs to the map
        a, x = np.exp(at.T)
        A, Q = Law(scheme=scheme, h=1.0, m=np.ones(len(at)), k=a, rate=x, thermal=1.0).apart([1])
    over = np.concatenate([np.broadcast_to(np.eye(2), A.shape), -A], axis=2)
    S, n = over @ seen.moments @ over.transpose(0, 2, 1), len(seen.left)
    C = seen.left.T @ seen.left / n
    if not scheme.full_rank:
        # the velocities carry all that the positions do
        return n / 2 * np.log(S[:, 1, 1] / C[1, 1]), S[:, 1, 1] / Q[:, 1, 1]
    thermal = np.trace(np.linalg.solve(Q, S), axis1=1, axis2=2) / 2
    return n / 2 * (2 * np.log(thermal) + np.linalg.slogdet(Q)[1] - np.linalg.slogdet(C)[1]), thermal


@np.errstate(all="ignore")
def fit(scheme: Thermostat, seen: Noise) -> Fitted | None:
    """The numbers of a scheme whose step made the frames, and its score; None where it cannot have."""
    det, n = min(max(float(np.linalg.det(seen.A)), 1e-6), 1 - 1e-6), len(seen.left)
    a = min(max(2 - 2 * float(np.trace(seen.A)) / (1 + det), 1e-6), 3.9)
    best = np.array([[log(a), log(-log(det)) + shift] for shift in (0, -1, 1)])
    ways, known = np.eye(2), scheme.full_rank
    if not scheme.full_rank:
        best = _back(scheme, seen, best, 8)
        off = np.max(np.abs(_off(scheme, seen, best)), axis=1)
        i = int(np.argmin(np.where(np.isfinite(off), off, inf)))
        if not off[i] <= seen.close:
            return None
        best = best[[i]]
        sizes, turned = np.linalg.svd(np.nan_to_num(_slopes(lambda x: _off(scheme, seen, x), best)[0]))[1:]
        ways, known = turned[sizes < 1e-5], bool(np.any(sizes >= 1e-5))
    at, width = best[0], 2.5
    while len(ways) and width > 1e-4:
        grid = np.array(list(product(np.linspace(-1, 1, 7), repeat=len(ways)))) @ ways
        tried = at + width * grid
        tried = tried if scheme.full_rank or len(ways) == 2 else _back(scheme, seen, tried, 2)
        values = _score(scheme, seen, tried)[0]
        at, width = tried[np.argmin(np.where(np.isfinite(values), values, inf))], width / 2.5
    nats, thermal = (float(x[0]) for x in _score(scheme, seen, at[None]))
    if not nats < ODDS or not np.all(np.isfinite(at)):
        return None
    spread, of_heat = np.zeros((2, 2)), 2 / n / (1 + scheme.full_rank)
    if len(ways):
        d = 3e-3 * ways
        up, down = (_score(scheme, seen, at + s * d) for s in (1, -1))
        H = np.diag((up[0] + down[0] - 2 * nats) / 9e-6)
        if len(ways) == 2:
            H[0, 1] = H[1, 0] = sum(
                s * t * float(_score(scheme, seen, (at + s * d[0] + t * d[1])[None])[0][0])
                for s, t in product((1, -1), repeat=2)
            ) / 36e-6  # fmt: skip
        sound = bool(np.isfinite(H).all()) and bool(np.all(np.linalg.eigvalsh(H) > 0))
        inverse = np.linalg.inv(H) if sound else np.full(H.shape, nan)
        slope = np.log(up[1] / down[1]) / 6e-3
        spread, of_heat = ways.T @ inverse @ ways, of_heat + float(slope @ inverse @ slope)
    w, rate = sqrt(float(np.exp(at[0]))) / seen.h, float(np.exp(at[1])) / seen.h
    errors, thermal = np.sqrt(np.diag(spread)), thermal / seen.h**2
    return Fitted(
        scheme=scheme.name, omega=w, omega_error=w * float(errors[0]) / 2, friction=rate,
        friction_error=rate * float(errors[1]), thermal=thermal,
        thermal_error=thermal * float(np.sqrt(of_heat)), nats=nats, known=known,
    )  # fmt: skip


def _are_draws(x: Floats, z: Floats) -> bool:
    """Whether x (f, 1) are draws, whatever their size: nothing of the states z (f, 2) before them shows in
    them, nor of the draw before, and few come again."""
    if np.max(np.abs(np.corrcoef(x[:, 0], z.T)[0, 1:])) > CORRELATED / np.sqrt(len(x)):
        return False
    q, u = (z / np.std(z, axis=0)).T[:, :, None]
    ways = {"q": q, "v": u, "q**2": q * q - np.mean(q * q), "q**3": q**3}
    known = [evidence.Known(name, y) for name, y in ways.items()]
    known += [evidence.Known(name, ways[name], of_sizes=True) for name in ("q", "v", "q**2")]
    tied = evidence.ties(x / np.std(x), np.full(x.shape, 1e-9))
    found = evidence.independence(x, evidence.known_before(x, known)).chance
    return min(found, tied.chance if tied else 1.0) > WHITE


def _follows(x: Floats, z: Floats) -> bool:
    """Whether what a map leaves, x (f,), follows from the states z (f, 2)."""
    from scipy.spatial import cKDTree

    each = z / np.std(z, axis=0)
    nearest = np.asarray(cKDTree(each).query(each, 2)[1])[:, 1]
    return bool(np.mean((x - x[nearest]) ** 2) < NEIGHBOURS_DIFFER * np.var(x))


def thermostats(q: Floats, v: Floats, h: float) -> list[Fitted] | None:
    """Schemes that may have made positions and velocities (f,), a step of h apart, the likeliest first.

    Empty where every step takes noise, by none that is known; None where none shows, or where frames are no
    single steps of one oscillator.
    """
    seen = noise_of(q, v, h)
    if seen is None or _follows(seen.left[:, 1], seen.z[:-1]):
        return None
    if (found := _in_two_halves(seen)) is not None or (found := _collided(seen)) is not None:
        return found
    one = seen.misfit < ONE_DRAW
    rows = list(DRAWN_ONCE) if one else [x for x in THERMOSTATS.values() if x.full_rank and not x.carried]
    if not _are_draws(seen.left[:, 1:], seen.z[:-1]):
        # a draw that acts in two steps colours what a map leaves
        rows = [x for x in rows if x.carried]
        if not rows:
            return None
    fits = [y for x in rows if (y := fit(x, seen))]
    return sorted(fits, key=lambda y: y.nats)


def named(found: list[Fitted]) -> Fitted | None:
    """The one scheme that is likelier than all others by `ODDS`, where frames exclude unknown ones."""
    best = found[0] if found else None
    alone = best and best.known and all(y.nats - best.nats > ODDS for y in found[1:])
    return best if alone else None


def _in_two_halves(seen: Noise) -> list[Fitted] | None:
    """Schemes whose draw acts in two half kicks: q'' - q = 2 h v', and each velocity of a half step,
    u' = c u - s q' + draw, has a draw of its own."""
    (q, v), n = seen.z.T, len(seen.left)
    if np.std(q[2:] - q[:-2] - 2 * v[1:-1]) > 1e-3 * seen.close * np.std(seen.left[:, 0]) + 1e-9 * np.std(q):
        return None
    u = np.diff(q)
    known = np.stack([u[:-1], q[1:-1], np.ones(n - 1)], axis=1)
    entries = np.linalg.lstsq(known, u[1:], rcond=None)[0]
    left = u[1:] - known @ entries
    if not _are_draws(left[:, None], np.stack([q[1:-1], u[:-1]], axis=1)):
        return None
    of = np.std(left) * np.sqrt(np.diag(np.linalg.inv(known.T @ known)))
    c, s, noise, out = float(entries[0]), -float(entries[1]), float(np.var(left)), []
    for name, x, over, slope in (
        ("lammps-langevin", 1 - c, 1.0, 1.0), ("bbk", 2 * (1 - c) / (1 + c), 2 / (1 + c), 4 / (1 + c) ** 2),
    ):  # fmt: skip
        # of BBK kick and noise are over 1 + x/2 = 2/(1 + c), and their draws are normal, not uniform
        likely = evidence.shape(left[:, None], uniform=name != "bbk").chance > WHITE
        if likely and x > 0 and s > 0:
            w, heat, error = sqrt(s * over), noise * over**2 / (2 * x), float(of[0]) * slope
            out.append(Fitted(
                scheme=name, omega=w / seen.h, omega_error=float(of[1]) * over / (2 * w * seen.h),
                friction=x / seen.h, friction_error=error / seen.h, thermal=heat / seen.h**2,
                thermal_error=heat / seen.h**2 * sqrt(2 / n + (error / x) ** 2), known=len(q) > FEWEST,
            ))  # fmt: skip
    return out


def _collided(seen: Noise) -> list[Fitted] | None:
    """Schemes with collisions, where one map of determinant 1 leads to many frames to rounding, and to others
    not, at random times; None where there is no such map."""
    z, n = seen.z / np.std(seen.z, axis=0), len(seen.left)
    known, after = np.column_stack([z[:-1], np.ones(n)]), z[1:]
    rows = np.random.default_rng(0).integers(n, size=(TRIPLES, 3))
    rows = rows[np.abs(np.linalg.det(known[rows])) > 1e-6]
    maps, few = np.linalg.solve(known[rows], after[rows]), slice(0, n, max(n // 250, 1))
    room = 1e-7 + seen.close * (seen.misfit < ONE_DRAW)
    counts = sum(np.sum(np.abs(maps[:, :, i] @ known[few].T - after[few, i]) < room, axis=1) for i in (0, 1))
    still = np.max(np.abs(known @ maps[int(np.argmax(counts))] - after), axis=1) < room
    hits, share = ~still, float(np.mean(still))
    if not FEWEST_OF_EACH <= np.sum(still) <= n - FEWEST_OF_EACH:
        return None
    times = np.where(hits, share, share - 1)[:, None]
    B = np.linalg.lstsq(known[still], after[still], rcond=None)[0]
    A = (B[:2].T * np.std(seen.z, axis=0)[:, None]) / np.std(seen.z, axis=0)
    if (
        not abs(np.linalg.det(A) - 1) < 1e-7
        or evidence.independence(times, [evidence.Known("the one before", np.roll(times, 1, axis=0))]).chance
        < WHITE
    ):
        return None
    centre = np.linalg.solve(np.eye(2) - A, B[2] * np.std(seen.z, axis=0))
    start, end = (seen.z[:-1] - centre)[hits], (seen.z[1:] - centre)[hits]
    # kicks in time, or of one size, are no collisions
    kicks = np.linalg.norm(end - start @ A.T, axis=1)
    if np.ptp(np.diff(np.flatnonzero(hits))) == 0 or np.median(np.diff(np.sort(kicks))) < room * np.mean(
        kicks
    ):
        return None
    a, x, out = 2 - float(np.trace(A)), -log(share), []
    for scheme in (one for one in THERMOSTATS.values() if one.collides and a > 0):
        law = Law(scheme=scheme, h=1.0, m=np.ones(1), k=np.array([a]), rate=x, thermal=1.0)
        (_, miss, _), (_, hit, G) = law._maps
        g = G[0, :, 0].astype(float)
        draws = (end - start @ hit[0].astype(float).T) @ g / (g @ g)
        across = end - start @ hit[0].astype(float).T - draws[:, None] * g
        fits = np.max(np.abs(miss[0] - A)) < 1e3 * room and np.max(np.abs(across)) < 1e3 * room * np.std(end)
        if fits and _are_draws(draws[:, None], start):
            heat = float(np.mean(draws**2)) / seen.h**2
            out.append(Fitted(
                scheme=scheme.name, omega=sqrt(a) / seen.h, omega_error=0.0, friction=x / seen.h,
                friction_error=sqrt((1 - share) / (share * n)) / seen.h, thermal=heat,
                thermal_error=heat * sqrt(2 / len(draws)),
            ))  # fmt: skip
    return out
