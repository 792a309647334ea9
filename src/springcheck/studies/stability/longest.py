"""The longest step at which a scheme stays bounded on a scene: the spectral radius of its one-step map.

The map is that of the scene linearised where its motion is stiffest, with its friction, and with slow and
fast springs separate for a scheme that treats them differently.  Uncoupled modes have a 2 x 2 matrix each;
otherwise all eigenvalues are those of one 2n x 2n matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from springcheck import schemes
from springcheck.errors import SceneError
from springcheck.physics import exact
from springcheck.physics.arrays import ROUNDOFF, Extended, Floats, Force, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.system import MOST_DENSE, System
from springcheck.schemes import Scheme
from springcheck.studies.stability.edges import COUPLED_GROWTH, first_growth, grows

FIRST_STEP, LAST_STEP, SCANNED_STEPS = 1e-9, 1e6, 2048
"""Range of the scan, in units of the fastest angular frequency or friction rate, and its steps: as many
again are evenly spaced up to the scheme's limit."""

SAMPLED_STATES, REFINEMENT = 512, 64
"""States of an anharmonic motion among which the stiffest is searched, and those in place of each interval
about it, twice: the error of a maximum falls with the square of the interval, from 1e-5 of it to 1e-12."""

MOST_MODES = 64
"""Modes of a long chain that are examined: the fastest, the slowest, and some between."""

MOST_COUPLED = 16
"""Most particles whose modes a scheme or friction couples: a scan has thousands of 2n x 2n matrices."""


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

    @property
    def w2(self) -> Floats:
        """Squares of the angular frequencies without friction (g, n) [1/T2]."""
        return np.asarray(np.linalg.eigvalsh(np.asarray(self.slow + self.fast, np.float64)))


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
    """Largest angular frequency of a scene without its friction [1/T], 0 where nothing oscillates: of an
    anharmonic scene that of small oscillations where it is `stiffest`.  SceneError where forces overflow."""
    system = scene.system
    largest = float(np.max(system.modes.w2)) if system.has_modes else _largest(system, stiffest(scene))
    if not np.isfinite(largest):
        raise SceneError(f"scene {scene.name}: its forces at the start are beyond the range of numbers")
    return float(np.sqrt(max(largest, 0.0)))


def linear(scene: Scene, scheme: Scheme) -> Linear | None:
    """The linearised motion that determines a scheme's stability on a scene.

    None for more coupled particles than are examined, and where position-dependent friction acts on joined
    particles.
    """
    system, here = scene.system, stiffest(scene)
    if system.brakes_by_place and not system.is_separate:
        return None
    if (scheme.has("mixes") and system.fast) or not (system.is_separate or system.has_one_friction_rate):
        if scene.n > MOST_COUPLED:
            return None
        slow, fast = (
            _scaled(System(scene.derived(terms=tuple(x for x in terms if x.kind == "potential"))), here)[None]
            for terms in (system.slow, system.fast)
        )
        return Linear(slow=slow, fast=fast, rate=system.friction_rates[None])
    if system.has_modes:
        modes, rate = system.modes, system.modes.rate
        # no np.unique, which imports masked arrays
        some = np.argsort(modes.w2)[np.linspace(0, scene.n - 1, min(scene.n, MOST_MODES)).astype(int)]
        # independent particles have a friction each
        some = np.append(some, [np.argmax(rate), np.argmin(np.where(rate > 0, rate, np.inf))])
        return Linear.of_modes(modes.w2[some], rate[some])
    if system.is_separate:
        return Linear.of_modes(system.hessian_diagonal(here) / system.m, system.friction_at(here)[0])
    w2 = np.array([_largest(system, here)])
    if scene.n <= MOST_DENSE:
        w2 = np.linalg.eigvalsh(_scaled(system, here).astype(np.float64))
    return Linear.of_modes(w2, np.broadcast_to(system.friction_rates[:1], w2.shape))


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


@lru_cache(maxsize=64)
def limit_of(scheme: Scheme) -> float:
    """The largest h w of a scheme on a spring: by the catalogue, or for another scheme by its own map, as it
    may state a wrong limit, unless its step has more than one map (multiple time steps) or none."""
    ours = scheme in (schemes.SCHEMES.get(scheme.name), schemes.ATTACHED.get(scheme.name))
    if ours or scheme.has("random") or scheme.has("mixes") or not scheme.has("one-step"):
        return scheme.limit
    return _first(scheme, Linear.of_modes(np.ones(1), np.zeros(1)), 1.0)


@lru_cache(maxsize=64)
def longest(scheme: Scheme, scene: Scene, limit: float | None = None) -> float:
    """The largest h [T] up to which every step is bounded: 0 none is, infinity all are, NaN unknown.

    For a scheme of multiple time steps that is where its first resonance begins.  `limit` replaces the
    scheme's for an engine that departs from its map, on undamped modes.
    """
    own = limit_of(scheme)
    if not scheme.has("one-step") or (np.isinf(own) and limit is None):
        # a scheme that is bounded on every spring is bounded with friction too
        return np.inf
    of = linear(scene, scheme)
    if of is None:
        return np.nan
    w2, known = of.w2, np.inf
    if scheme.has("mixes") or w2.shape[1] > 1:
        if limit is not None or np.min(w2) < -COUPLED_GROWTH * np.max(np.abs(w2)):
            return np.nan
    else:
        alone = (w2[:, 0] > 0) & (of.rate[:, 0] == 0)
        if np.any(alone):
            # without friction the limit on a spring has more digits than a scan
            known = (own if limit is None else limit) / float(np.sqrt(np.max(w2[alone])))
        # modes on a barrier (A < 0) grow anyway
        rest = ~alone & (w2[:, 0] >= 0)
        of = Linear(slow=of.slow[rest], fast=of.fast[rest], rate=of.rate[rest])
        w2 = w2[rest]
        if limit is not None and np.any(of.rate):
            return np.nan
    scale = max(float(np.sqrt(np.max(w2, initial=0.0))), float(np.max(of.rate, initial=0.0)))
    return min(known, _first(scheme, of, scale)) if scale else known


def _first(scheme: Scheme, of: Linear, scale: float) -> float:
    grid = np.geomspace(FIRST_STEP, LAST_STEP, SCANNED_STEPS)
    if 0 < scheme.limit < np.inf:
        # resonances may be narrow
        grid = np.sort(np.append(grid, np.linspace(0, scheme.limit, SCANNED_STEPS + 1)[1:]))
    return first_growth(partial(maps, scheme, of), grid / scale, 64 * ROUNDOFF)


def too_long(name: str, scene: Scene) -> float | None:
    """The largest step of a scheme where the scene's is longer, otherwise None; also for a scheme without
    stable steps, as explicit Euler without friction, or whose map is unknown."""
    scheme = schemes.known().get(name)
    if scheme is None or not scheme.has("one-step") or scheme.has("random"):
        return None
    h = np.array([abs(scene.step)])
    with np.errstate(all="ignore"):
        of = None if np.isinf(limit_of(scheme)) else linear(scene, scheme)
        if of is None or not np.isfinite(of.slow + of.fast).all():
            return None
        growing = grows(maps(scheme, of, h), 64 * ROUNDOFF)[0]
        if of.rate.shape[1] == 1:
            growing = growing & ((of.slow + of.fast)[:, 0, 0] >= 0)
        if not np.any(growing):
            return None
        limit = longest(scheme, scene)
    return limit if 0 < limit < h[0] else None
