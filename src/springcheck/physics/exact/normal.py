"""Normal modes of linear scenes.

A linear scene decouples into modes y'' = -w2 y - r y' + g, one for each eigenvector of M^-1/2 K M^-1/2.
Every scheme acts on each mode separately as well, so that limits and shadow energies follow from them too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np

from springcheck.physics.arrays import EPS, WIDE, Extended, Integers, Reals, by_identity
from springcheck.physics.exact.digits import FEWER_DIGITS, Wide, digits, eigen, exactly, extended
from springcheck.physics.system import System
from springcheck.physics.terms import Damping, Spring

PI = 4 * np.arctan(np.longdouble(1))

CENTRE_ROUNDINGS = 16
"""Roundings of a centre's distance in the closed form of a motion about it; 6 have been met."""


@by_identity
class Start(NamedTuple):
    """The start of each mode, (n,) each: u from its centre [M1/2 L], v [M1/2 L/T]; and, for non-oscillating
    modes, the shares of exp(slow t) and exp(fast t) in its motion (see `split`).

    `sizes` are those to whose rounding these four are known; for waves without that of the transform.
    """

    u: Extended
    v: Extended
    slow: Extended
    fast: Extended
    sizes: tuple[Extended, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Normal modes: q = M**-1/2 V y.  `vectors` is None for V = 1 and for sines (`waves`).

    w2 (n,) [1/T2]; vectors (n, n), columns; pull (n,): the constant force on each mode [M1/2 L/T2]; rate
    (n,): its friction rate c/m [1/T].
    """

    w2: Extended
    pull: Extended
    rate: Extended
    root_m: Extended
    vectors: Extended | None = None
    waves: bool = False
    """Whether V consists of sines, sqrt(2/(n+1)) sin(pi r j/(n+1)), applied by a fast Fourier transform."""
    start: Start
    doubt: Extended
    """Error of w2 (n,) [1/T2] beyond its rounding, 0 where the sums that it comes from are exact."""

    def into(self, q: Reals, p: Reals) -> tuple[Extended, Extended]:
        """Mode coordinates y [M1/2 L] and velocities [M1/2 L/T] of states (..., n)."""
        y, v = np.asarray(q, np.longdouble) * self.root_m, np.asarray(p, np.longdouble) / self.root_m
        return self._turned(y, False), self._turned(v, False)

    def out_of(self, y: Extended, v: Extended) -> tuple[Extended, Extended]:
        """Positions and momenta of states in mode coordinates (..., n)."""
        return self._turned(y, True) / self.root_m, self._turned(v, True) * self.root_m

    def about_centres(self, q: Reals, p: Reals) -> tuple[Extended, Extended]:
        """As `into`, with positions relative to the centre of each mode."""
        y, v = self.into(q, p)
        return y - self.centre(), v

    def from_centres(self, u: Extended, v: Extended) -> tuple[Extended, Extended]:
        """Positions and momenta of states whose mode positions are relative to the centre of each mode."""
        return self.out_of(u + self.centre(), v)

    def _turned(self, y: Extended, back: bool) -> Extended:
        if self.waves:
            return _sines(y)
        if self.vectors is None:
            return y
        return y @ (self.vectors.T if back else self.vectors)

    @property
    def rest(self) -> Extended:
        """Positions (n,) [L] at which every mode is at its centre."""
        return self.out_of(self.centre(), np.zeros_like(self.w2))[0]

    @property
    def blur(self) -> Extended:
        """Rounding of positions (n,) [L] in a motion about the centres of the modes, which are far away where
        hardly any stiffness holds; 0 where engines round as much as references do."""
        far = self.spread(np.abs(self.centre())) / self.root_m
        return np.asarray(CENTRE_ROUNDINGS * EPS * far if WIDE else 0 * far)

    def spread(self, reach: Extended) -> Extended:
        """|V| reach (n,): bound on the displacement of each particle by modes of these amplitudes."""
        if self.waves:
            return _absolute_sines(reach)
        return reach if self.vectors is None else np.abs(self.vectors) @ reach

    def centre(self) -> Extended:
        """Rest position of each mode, 0 for a free mode (w2 = 0)."""
        held = self.w2 != 0
        return np.asarray(np.where(held, self.pull / np.where(held, self.w2, 1), 0))


def split(u: Any, v: Any, w2: Any, rate: Any) -> tuple[Any, Any, Any]:
    """u'' = -w2 u - rate u' beyond critical damping, in any precision: shares of exp(slow t) and exp(fast
    t) in u, and a bound on their summands.  slow = -w2/(b + s), fast = -(b + s), s**2 = b**2 - w2, b =
    rate/2."""
    b = rate / 2
    square = b * b - w2
    s = np.sqrt(np.where(square > 0, square, 0 * b + 1))
    fast, slow = -(b + s), -w2 / np.where(b + s == 0, 0 * b + 1, b + s)
    size = (np.abs(v) + np.abs(fast) * np.abs(u)) / (2 * s)
    return (v - fast * u) / (2 * s), (slow * u - v) / (2 * s), size


def discriminant(w2: Extended, rate: Extended) -> tuple[Extended, Extended, Extended]:
    """b = rate/2, w2 - b**2, which nothing cancels near critical damping, and the root of its size."""
    b, w = rate / 2, np.sqrt(np.abs(w2))
    square = np.where(w2 > 0, (w - b) * (w + b), w2 - b * b)
    return b, square, np.sqrt(np.abs(square))


MOST_PRECISE = 32
"""Most particles whose modes are computed to high relative accuracy, in 0.7 s at most."""

ALWAYS_PRECISE = 8
"""Most particles for which that takes 15 ms, and is always done."""

GRADED_RATIO = 2.0**10
"""Ratio of squared frequencies from which it is needed."""


def normal_modes(system: System[Any]) -> Modes:
    """Normal modes of a linear system.

    w2 and vectors are accurate to rounding for separate particles, for a uniform chain, and up to
    `MOST_PRECISE` particles; otherwise to n EPS max(w2), as `Modes.doubt` states.  ValueError: it has none,
    or they are too expensive (see `System.has_modes`).
    """
    if not system.has_modes:
        raise ValueError(
            f"scene {system.scene.name!r} has no normal modes here: it is not linear, friction couples them, "
            "or more particles are joined than modes are computed for"
        )
    root_m = np.sqrt(system.m.astype(np.longdouble))
    zero = np.zeros(system.n, dtype=np.longdouble)
    pull: Extended = np.asarray(system.force(zero, zero) / root_m, np.longdouble)
    rate, none = system.friction_rates, np.zeros_like(zero)
    if system.is_separate:
        w2, doubt = system.hessian_diagonal(zero) / system.m, system.rigidity * np.longdouble(EPS) / system.m
        return _modes(system, w2=w2, pull=pull, root_m=root_m, rate=rate, doubt=np.asarray(doubt))
    if system.n > MOST_PRECISE and system.is_uniform_chain:
        w2 = _wave_frequencies(system)
        return _modes(system, w2=w2, pull=_sines(pull), root_m=root_m, rate=rate, waves=True, doubt=none)
    scaled = np.asarray(system.hessian(zero) / root_m[:, None] / root_m, np.longdouble)
    w2, vectors = _eigen(scaled)
    largest = np.max(np.abs(w2))
    # a free translation has w2 = 0 up to rounding; unless it is set to 0 it would move as a slow wave
    is_zero = np.abs(w2) <= 8 * system.n * EPS * largest
    graded = np.count_nonzero(is_zero) > len(system.free_groups)
    graded |= bool(np.any(np.abs(w2[~is_zero]) * GRADED_RATIO < largest))
    if system.n <= ALWAYS_PRECISE or (system.n <= MOST_PRECISE and graded):
        return _in_many_digits(system)
    w2 = np.where(is_zero, 0, w2)
    pulls = np.where(is_zero, _of_whole_groups(system, pull * root_m) @ vectors, pull @ vectors)
    # w2 = 0 is exact for translations of free groups, unless other modes are as slow
    known = is_zero & (np.count_nonzero(is_zero) == len(system.free_groups))
    doubt = np.where(known, none, 4 * system.n * EPS * largest)
    return _modes(system, w2=w2, pull=pulls, root_m=root_m, rate=rate, vectors=vectors, doubt=doubt)


def _modes(system: System[Any], **parts: Any) -> Modes:
    """Modes with the start of the scene."""
    none = np.zeros_like(parts["w2"])
    found = Modes(**parts, start=Start(none, none, none, none, (none,) * 4))
    return replace(found, start=_start(system, found))


def _start(system: System[Any], modes: Modes) -> Start:
    """Start in extended precision; for particles that approach the top of a barrier in more digits."""
    y, v = modes.into(system.q, system.p)
    centre = modes.centre()
    u = y - centre
    slow, fast, _ = split(u, v, modes.w2, modes.rate)
    # a transform that mixes modes may concentrate the rounding of all in one
    of_all = modes.vectors is not None
    size_u, size_v = (np.sqrt(np.sum(x * x)) + np.zeros_like(x) if of_all else np.abs(x) for x in (y, v))
    size_u = size_u + np.abs(centre)
    _, _, size = split(size_u, size_v, modes.w2, modes.rate)
    sizes = [size_u, size_v, size, size.copy()]
    lost = (modes.w2 < 0) & (np.minimum(np.abs(slow), np.abs(fast)) * 16 < size)
    if system.is_separate and np.any(lost):
        chosen = np.flatnonzero(lost)
        with digits():
            part = system.beside(system.part(chosen))
            k, pull, rate = exact_sums(part, np.diagonal)
            m, q, p = (exactly(x) for x in (part.m, part.q, part.p))
            root = np.sqrt(m)
            for out, like, x in zip(
                (slow, fast), sizes[2:], split(root * (q - pull / k), p / root, k / m, rate), strict=False
            ):
                out[chosen] = extended(x)
                like[chosen] = np.abs(out[chosen])
    return Start(u, v, slow, fast, tuple(sizes))


def exact_sums(system: System[Any], of: Callable[[Wide], Wide]) -> tuple[Wide, Wide, Wide]:
    """Stiffness, by the part `of` its matrix; force at 0 (n,) and friction rates (n,); without rounding."""
    zero = np.zeros(system.n, dtype=np.longdouble)
    force: Any
    k, force, friction = (exactly(np.zeros(x)) for x in ((system.n, system.n), system.n, system.n))
    for term in system.terms:
        if isinstance(term, Damping):
            np.add.at(friction, term.i, exactly(term.c))
            continue
        row = exactly(np.broadcast_to(term.curvature(zero), (len(term),)))
        at_rest = exactly(term.slope(np.zeros(len(term)), *term.parameters))
        term.add_pull(row * -exactly(getattr(term, term.origin)) + at_rest, force)
    for one, other, added in system.elements(zero):
        np.add.at(k, (one, other), exactly(added))
    return of(k), force, friction / exactly(system.m)


def _in_many_digits(system: System[Any]) -> Modes:
    """Modes in so many digits that stiff and soft ones of a small system keep full accuracy."""
    with digits():
        # sums of the terms as they stand: exact
        k, force, rates = exact_sums(system, np.asarray)
    count = _digits_for(system, k)
    left = Decimal(10) ** (12 - count)
    with digits(count):
        m, q, p = (exactly(x) for x in (system.m, system.q, system.p))
        root = np.sqrt(m)
        w2, vectors = eigen(k / root[:, None] / root, count)
        pull = vectors.T @ (force / root)
        # a free translation: nothing holds it, and inner forces do not move it
        is_zero = np.abs(w2) <= np.max(np.abs(w2)) * left
        w2 = np.where(is_zero, 0 * w2, w2)
        pull = np.where(np.abs(pull) <= np.sum(np.abs(force / root)) * left, 0 * pull, pull)
        y, v = vectors.T @ (root * q), vectors.T @ (p / root)
        u = y - np.where(is_zero, 0 * pull, pull / np.where(is_zero, 1, w2))
        slow, fast, _ = split(u, v, w2, np.max(rates))
        # where a sum cancels, as at rest far from 0, it is known to the digits of its summands
        vast = left * np.max(np.abs(w2)) / np.where(is_zero, np.max(np.abs(w2)) or 1, np.abs(w2))
        of_u = (np.abs(vectors.T) @ np.abs(root * q) + np.abs(y - u)) * vast
        of_v = np.abs(vectors.T) @ np.abs(p / root) * left
        of_both = split(of_u, of_v, w2, np.max(rates))[2]
        lost = [extended(x) / EPS for x in (of_u, of_v, of_both, of_both)]
        parts = tuple(extended(x) for x in (u, v, slow, fast))
        sizes = tuple(np.maximum(np.abs(x), least) for x, least in zip(parts, lost, strict=True))
        return Modes(
            w2=extended(w2), pull=extended(pull), rate=system.friction_rates, root_m=extended(root),
            vectors=extended(vectors), start=Start._make((*parts, sizes)), doubt=np.zeros_like(parts[0]),
        )  # fmt: skip


def _digits_for(system: System[Any], k: Wide) -> int:
    """Digits that resolve the slowest mode: as many decades as masses and stiffnesses span."""
    masses, springs = system.m, np.abs(k[k != 0])
    decades = Decimal(0)
    for of in (exactly(masses), springs):
        decades += (max(of) / min(of)).log10() if len(of) else 0
    return max(FEWER_DIGITS, 40 + int(decades))


def _of_whole_groups(system: System[Any], force: Extended) -> Extended:
    """A force (n,) over the root of mass, reduced in free groups to the part that moves them as a whole.

    Springs exert opposite forces at both ends, but not after rounding: the remainder would accelerate the
    group.
    """
    out: Extended = np.asarray(force / np.sqrt(system.m.astype(np.longdouble)))
    for group in system.free_groups:
        m, total = system.m[group].astype(np.longdouble), np.sum(force[group])
        moves = abs(total) > len(group) * EPS * np.sum(np.abs(force[group]))
        out[group] = np.sqrt(m) * total / np.sum(m) if moves else 0
    return out


def _wave_frequencies(system: System[Any]) -> Extended:
    """Squared frequencies of a uniform chain between walls, slowest first (Lagrange 1788)."""
    k = next(term.k[0] for term in system.terms if isinstance(term, Spring))
    half = np.sin(PI * np.arange(1, system.n + 1) / (2 * (system.n + 1)))
    return np.asarray(4 * k / system.m[0].astype(np.longdouble) * half * half)


def _one_turn(n: int) -> Extended:
    """sqrt(2/(n+1)) sin(pi j/(n+1)), j = 0 ... 2n + 1: all elements of V, by r j modulo a full period."""
    return np.asarray(np.sin(PI * np.arange(2 * (n + 1)) / (n + 1)) * np.sqrt(np.longdouble(2) / (n + 1)))


MOST_EXACT = 4096
"""Most modes for which |V| is summed element by element; beyond, every element counts as its largest
value."""


def _absolute_sines(reach: Extended) -> Extended:
    """|V| reach (n,) for V of sines, or for many modes an upper bound on it, in memory of O(n)."""
    n = len(reach)
    if n > MOST_EXACT:
        return np.full(n, np.sqrt(np.longdouble(2) / (n + 1)) * np.sum(reach))
    r, sines = np.arange(1, n + 1), np.abs(_one_turn(n))
    return np.array([sines[j * r % (2 * (n + 1))] @ reach for j in r])


def _sines(y: Extended) -> Extended:
    """y (..., n) V for V of sines, by the Fourier transform of its odd extension."""
    n = y.shape[-1]
    none = np.zeros((*y.shape[:-1], 1), dtype=np.longdouble)
    odd = np.concatenate([none, y, none, -y[..., ::-1]], axis=-1)
    return np.asarray(-np.fft.rfft(odd, axis=-1).imag[..., 1 : n + 1] / np.sqrt(2 * np.longdouble(n + 1)))


def _eigen(symmetric: Extended) -> tuple[Extended, Extended]:
    """Eigenvalues and vectors in extended precision, by refinement of LAPACK's in double.

    Ogita & Aishima, Japan J. Indust. Appl. Math. 35 (2018) 1007: in the basis of the approximate
    vectors the matrix is nearly diagonal; one first-order rotation squares the error.  Within a cluster
    of equal eigenvalues the small block is diagonalised instead.
    """
    _, start = np.linalg.eigh(symmetric.astype(np.float64))
    vectors: Extended = start.astype(np.longdouble)
    size = float(np.max(np.abs(symmetric))) or 1.0
    for _ in range(4):
        gram = vectors.T @ vectors
        vectors = vectors @ (1.5 * np.eye(len(gram), dtype=np.longdouble) - 0.5 * gram)
        inner = vectors.T @ symmetric @ vectors
        values = np.diag(inner)
        gap = values[None, :] - values[:, None]
        close = np.abs(gap) <= 1e-9 * size
        rotation = np.where(close, 0, inner / np.where(close, 1, gap))
        vectors = vectors + vectors @ rotation
        for block in _clusters(close):
            off = inner[np.ix_(block, block)] - np.diag(values[block])
            if len(block) > 1 and np.any(np.abs(off) > EPS * size):
                shifted = inner[np.ix_(block, block)] - np.mean(values[block]) * np.eye(len(block))
                _, turn = np.linalg.eigh(np.asarray(shifted / np.max(np.abs(shifted)), np.float64))
                vectors[:, block] = vectors[:, block] @ turn.astype(np.longdouble)
        if np.max(np.abs(rotation)) < 4 * len(gram) * EPS:
            break
    gram = vectors.T @ vectors
    vectors = vectors @ (1.5 * np.eye(len(gram), dtype=np.longdouble) - 0.5 * gram)
    return np.diag(vectors.T @ symmetric @ vectors).copy(), vectors


def _clusters(close: np.ndarray) -> list[Integers]:
    """Runs of neighbouring (sorted) eigenvalues that are close together."""
    breaks = np.flatnonzero(~np.diagonal(close, offset=1)) + 1
    return [np.asarray(block) for block in np.split(np.arange(len(close)), breaks)]
