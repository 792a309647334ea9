"""The longest step at which a scheme stays bounded on a scene, from the spectral radius of its one-step map.

The map is that of the scene linearised where its motion is stiffest, with its friction, and with slow and
fast springs separate for a scheme that treats them differently.  Uncoupled modes have a 2 x 2 matrix each;
otherwise all eigenvalues are those of one 2n x 2n matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from springcheck import schemes
from springcheck.errors import SceneError
from springcheck.physics import exact
from springcheck.physics.arrays import ROUNDOFF, Extended, Floats, Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.system import MOST_DENSE, System
from springcheck.schemes import Scheme
from springcheck.studies.stability import propagators

FIRST_STEP, LAST_STEP = 1e-9, 1e6
"""Steps between which a limit is searched, in units of the fastest angular frequency or friction rate."""

SCANNED_STEPS = 4096
"""Steps of the first scan, 1.008 from one to the next."""

REFINED_STEPS = 256
"""Steps of each refinement of the bracket."""

SAMPLED_STATES = 512
"""States of an anharmonic motion among which the stiffest is searched."""

REFINEMENT = 64
"""States in place of each interval about the stiffest, twice: the error of a maximum falls with the square of
the interval, from 1e-5 of it to 1e-12."""

MOST_MODES = 64
"""Modes of a long chain that are examined: the fastest, the slowest, and some between."""

MOST_COUPLED = 16
"""Most particles whose modes a scheme or friction couples: a scan has SCANNED_STEPS matrices of 2n x 2n."""

COUPLED_GROWTH = 1e-7
"""Growth per step from which coupled modes count as growing: nearly equal eigenvalues of their matrix are
known to the square root of the rounding only."""

LEAST_DECAY = 2.0**-80
"""Relative decay below which a mode counts as undamped: the square of 2**12 roundings."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linear:
    """The linearised motion y'' = -A y - r y', y = sqrt(m) q: uncoupled modes, or one group of all.

    A is that of the slow plus that of the fast springs, (g, n, n) [1/T2]; rate is r (g, n) [1/T].
    """

    slow: Extended
    fast: Extended
    rate: Extended

    @classmethod
    def of_modes(cls, w2: Reals, rate: Reals) -> Linear:
        """Uncoupled modes (g,)."""
        a = np.asarray(w2, np.longdouble)[:, None, None]
        return cls(slow=a, fast=np.zeros_like(a), rate=np.asarray(rate, np.longdouble)[:, None])


@lru_cache(maxsize=8)
def stiffest(scene: Scene) -> Floats:
    """Positions (n,) where the exact solution of an anharmonic scene is stiffest; otherwise the start."""
    system = scene.system
    many = scene.n > MOST_MODES and not system.is_separate
    if system.is_linear or many or not exact.has_true_motion(scene):
        return np.asarray(scene.q)
    found, number = np.asarray(scene.q), SAMPLED_STATES
    steps = np.arange(SAMPLED_STATES + 1)
    for _ in range(3):
        q, _ = exact.true_motion(scene, steps, scene.step * scene.steps / number)
        finite = np.isfinite(q).all(axis=-1)
        if not np.any(finite):
            break
        here = q[finite].astype(np.float64)
        stiff = np.array([_largest(system, at) for at in here])
        if system.brakes_by_place:
            stiff = stiff + np.max(np.maximum(system.friction_at(here)[0], 0), axis=-1) ** 2
        found = here[int(np.argmax(stiff))]
        # refine about the stiffest, from the sample before it to the one after
        first, number = (int(steps[finite][int(np.argmax(stiff))]) - 1) * REFINEMENT, number * REFINEMENT
        steps = np.arange(max(first, 0), min(first + 2 * REFINEMENT, number) + 1)
    return found


def _largest(system: System[Scene], q: Floats) -> float:
    """The largest eigenvalue of M**-1/2 K M**-1/2 at q (n,), or its Gershgorin bound [1/T2]."""
    if system.is_separate:
        return float(np.max(system.hessian_diagonal(q) / system.m))
    if system.n > MOST_DENSE:
        return float(np.max(system.gershgorin(q) / system.m))
    found = _scaled(system, q).astype(np.float64)
    return float(np.linalg.eigvalsh(found)[-1]) if np.isfinite(found).all() else np.inf


def _scaled(system: System[Scene], q: Reals) -> Extended:
    root = np.sqrt(system.m.astype(np.longdouble))
    return np.asarray(system.hessian(q) / root[:, None] / root)


@np.errstate(over="ignore", invalid="ignore")
def fastest(scene: Scene) -> float:
    """Largest angular frequency of a scene without its friction [1/T], 0 where nothing oscillates.

    For an anharmonic scene, of small oscillations where it is `stiffest`.  SceneError where forces
    overflow there.
    """
    system = scene.system
    largest = float(np.max(system.modes.w2)) if system.has_modes else _largest(system, stiffest(scene))
    if not np.isfinite(largest):
        raise SceneError(f"scene {scene.name}: its forces at the start are beyond the range of numbers")
    return float(np.sqrt(max(largest, 0.0)))


def linear(scene: Scene, scheme: Scheme) -> Linear | None:
    """The linearised motion that determines a scheme's stability on a scene.

    None for more coupled particles than are examined, and where position-dependent friction acts on
    joined particles.
    """
    system = scene.system
    if system.brakes_by_place and not system.is_separate:
        return None
    if (scheme.has("mixes") and system.fast) or not (system.is_separate or system.has_one_friction_rate):
        if scene.n > MOST_COUPLED:
            return None
        at = stiffest(scene).astype(np.longdouble)
        parts = [
            _scaled(System(scene.derived(terms=tuple(x for x in terms if x.kind == "potential"))), at)[None]
            for terms in (system.slow, system.fast)
        ]
        squares, turned = np.linalg.eigh(np.asarray(parts[0][0] + parts[1][0], np.float64))
        if scheme.b and squares[0] >= -COUPLED_GROWTH * squares[-1]:
            return _oscillators(squares, turned, np.asarray(system.friction_rates, np.float64))
        return Linear(slow=parts[0], fast=parts[1], rate=system.friction_rates[None])
    if system.has_modes:
        modes, rate = system.modes, system.modes.rate
        # no np.unique, which imports masked arrays
        some = np.argsort(modes.w2)[np.linspace(0, scene.n - 1, min(scene.n, MOST_MODES)).astype(int)]
        # independent particles have a friction each
        some = np.append(some, [np.argmax(rate), np.argmin(np.where(rate > 0, rate, np.inf))])
        return Linear.of_modes(modes.w2[some], rate[some])
    here = stiffest(scene)
    if system.is_separate:
        return Linear.of_modes(system.hessian_diagonal(here) / system.m, system.friction_at(here)[0])
    w2 = np.array([_largest(system, here)])
    if scene.n <= MOST_DENSE:
        w2 = np.linalg.eigvalsh(_scaled(system, here).astype(np.float64))
    return Linear.of_modes(w2, np.broadcast_to(system.friction_rates[:1], w2.shape))


def _oscillators(w2: Floats, modes: Floats, rate: Floats) -> Linear:
    """Oscillators with the eigenvalues of modes that friction couples: a Runge-Kutta step needs no more.

    In the modes the motion is a skew matrix minus C, so that an eigenvector (u, v) decays at the rate v* C
    v/(u* u + v* v), which is accurate even beside large frequencies.
    """
    w, c = np.diag(np.sqrt(np.maximum(w2, 0))), modes.T @ (rate[:, None] * modes)
    values, vectors = np.linalg.eig(np.block([[np.zeros_like(w), w], [-w, -c]]))
    size, v = np.abs(vectors) ** 2, vectors[len(w) :]
    decay = np.real(np.sum(v.conj() * (c @ v), axis=0)) / size.sum(axis=0)
    # a vector is off by some roundings, so that an undamped one has a decay of their square
    decay = np.where(decay > LEAST_DECAY * np.max(rate), decay, 0.0)
    turns, alone = values.imag > 0, np.sort(decay[values.imag == 0])
    one, other = alone[::2], alone[1::2]
    return Linear.of_modes(
        np.append(decay[turns] ** 2 + values.imag[turns] ** 2, one * other),
        np.append(2 * decay[turns], one + other),
    )


def maps(scheme: Scheme, of: Linear, h: Floats) -> Extended:
    """One-step matrices of a step of h (j,) [T], in units of each step (j, g, 2n, 2n)."""
    g, n = of.rate.shape
    # A h**2 and r h
    t = np.asarray(h, np.longdouble)[:, None, None, None]
    slow, fast, rate = of.slow * t * t, of.fast * t * t, of.rate[:, None, :] * t
    eye, none = np.eye(n, dtype=np.longdouble), np.zeros((n, n), dtype=np.longdouble)
    q, p = (np.broadcast_to(np.concatenate(x), (len(h), g, 2 * n, n)) for x in ((eye, none), (none, eye)))

    def force(a: Extended, brake: Extended | float) -> Force:
        return lambda q, p: np.asarray(-(q @ a) - brake * p)

    q, p = schemes.step(
        scheme, q, p, h=np.longdouble(1), m=np.ones(n), force=force(slow + fast, rate),
        rate=rate if np.any(rate) else None, parts=(force(slow, rate), force(fast, 0.0)),
    )  # fmt: skip
    # rows are the images of the unit vectors
    return np.swapaxes(np.concatenate([q, p], axis=-1), -1, -2)


def eigenvalues(maps: Extended) -> np.ndarray:
    """Eigenvalues (..., 2n) of maps, NaN of those that are not finite."""
    finite = np.asarray(np.isfinite(maps).all(axis=(-1, -2)))
    values = np.linalg.eigvals(np.where(finite[..., None, None], maps, 0).astype(np.float64))
    return np.where(finite[..., None], values, np.nan)


def grows(scheme: Scheme, of: Linear, h: Floats) -> np.ndarray:
    """Whether a step of h (j,) [T] makes some mode grow; modes on a barrier (A < 0) grow anyway."""
    found = maps(scheme, of, h)
    if of.rate.shape[1] == 1:
        wild = ~propagators.bounded(found.reshape(-1, 2, 2), 64 * ROUNDOFF).reshape(found.shape[:2])
        return np.asarray(np.any(wild & ((of.slow + of.fast)[:, 0, 0] >= 0), axis=-1))
    largest = np.max(np.abs(eigenvalues(found)), axis=-1)
    return np.asarray(np.any(~(largest <= 1 + COUPLED_GROWTH), axis=-1))


@lru_cache(maxsize=64)
def limit_of(scheme: Scheme) -> float:
    """The largest h w of a scheme on a spring: by the catalogue, or for another scheme by its own map, as it
    may state a wrong limit, unless its step has more than one map (multiple time steps) or none."""
    ours = scheme in (schemes.SCHEMES.get(scheme.name), schemes.ATTACHED.get(scheme.name))
    if ours or scheme.has("random") or scheme.has("mixes") or not scheme.has("one-step"):
        return scheme.limit
    return _first(scheme, Linear.of_modes(np.ones(1), np.zeros(1)), 1.0)


def longest(scheme: Scheme, scene: Scene, limit: float | None = None) -> float:
    """The largest h [T] up to which every step is bounded: 0 none is, infinity all are, NaN unknown.

    For a scheme of multiple time steps that is where its first resonance begins.  `limit` replaces the
    scheme's for an engine that departs from its map.
    """
    limit = limit_of(scheme) if limit is None else limit
    if not scheme.has("one-step") or np.isinf(limit):
        # a scheme that is bounded on every spring is bounded with friction too
        return np.inf
    of = linear(scene, scheme)
    if of is None:
        return np.nan
    w2, known = np.linalg.eigvalsh(np.asarray(of.slow + of.fast, np.float64)), np.inf
    if scheme.has("mixes") or w2.shape[1] > 1:
        if np.min(w2) < -COUPLED_GROWTH * np.max(np.abs(w2)):
            return np.nan
    else:
        alone = (w2[:, 0] > 0) & (of.rate[:, 0] == 0)
        if np.any(alone):
            # without friction the catalogue's limit has more digits than a scan
            known = limit / float(np.sqrt(np.max(w2[alone])))
        of = Linear(slow=of.slow[~alone], fast=of.fast[~alone], rate=of.rate[~alone])
        w2 = w2[~alone]
    scale = max(float(np.sqrt(np.max(w2, initial=0.0))), float(np.max(of.rate, initial=0.0)))
    return min(known, _first(scheme, of, scale)) if scale else known


def too_long(name: str, scene: Scene) -> float | None:
    """The largest step of a scheme where the scene's is longer, otherwise None; also for a scheme without
    stable steps, as explicit Euler without friction, or whose map is unknown."""
    scheme = schemes.known().get(name)
    if scheme is None or not scheme.has("one-step") or scheme.has("random"):
        return None
    h = np.array([abs(scene.step)])
    with np.errstate(all="ignore"):
        of = None if np.isinf(limit_of(scheme)) else linear(scene, scheme)
        if of is None or not np.isfinite(of.slow + of.fast).all() or not grows(scheme, of, h)[0]:
            return None
        limit = longest(scheme, scene)
    return limit if 0 < limit < h[0] else None


def _first(scheme: Scheme, of: Linear, scale: float) -> float:
    """The first growing step of a scan, to a part in 1e10."""
    h = np.geomspace(FIRST_STEP, LAST_STEP, SCANNED_STEPS) / scale
    if scheme.has("mixes"):
        # a resonance may be narrow: equal spacing up to the limit of the fast springs alone, and where
        # eigenvalues meet
        even = np.linspace(0, scheme.limit, SCANNED_STEPS + 1)[1:] / scale
        with np.errstate(all="ignore"):
            met = propagators.meetings(lambda h: eigenvalues(maps(scheme, of, h))[:, 0], even)
        h = np.append(np.sort(np.append(even, met)), h[h > even[-1]])
    with np.errstate(all="ignore"):
        return propagators.first(lambda h: (grows(scheme, of, h), h), h, REFINED_STEPS, 6)
