"""The true motion of linear scenes: normal modes.

A linear scene falls apart into modes y'' = -w2 y - r y' + g, one for each eigenvector of
M^-1/2 K M^-1/2: without friction (r = 0) circular functions for w2 > 0, hyperbolic ones for w2 < 0, a
parabola for w2 = 0; with friction the same, decaying.  Every scheme acts on
each mode by itself too, which is why limits and shadow energies are read off here as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from springcheck.arrays import Extended, Integers, Reals
from springcheck.physics.exact.elliptic import EPS
from springcheck.physics.terms import Spring

if TYPE_CHECKING:
    from springcheck.physics.scene import Scene
    from springcheck.physics.system import System


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Normal modes: q = M**-1/2 V y.  `vectors` is None where V is not kept: 1, or sines (`waves`).

    w2 (n,) [1/T2]; vectors (n, n), columns; pull (n,): the constant force on each mode [M1/2 L/T2];
    rate (n,): that of its friction, c/m [1/T].
    """

    w2: Extended
    pull: Extended
    rate: Extended
    root_m: Extended
    vectors: Extended | None
    waves: bool = False
    """Whether V is of sines, sqrt(2/(n+1)) sin(pi r j/(n+1)): a fast Fourier transform takes its place."""

    def into(self, q: Reals, p: Reals) -> tuple[Extended, Extended]:
        """Mode coordinates y [M1/2 L] and velocities [M1/2 L/T] of states (..., n)."""
        y, v = np.asarray(q, np.longdouble) * self.root_m, np.asarray(p, np.longdouble) / self.root_m
        return self._turned(y, False), self._turned(v, False)

    def out_of(self, y: Extended, v: Extended) -> tuple[Extended, Extended]:
        """Positions and momenta of states in mode coordinates (..., n)."""
        return self._turned(y, True) / self.root_m, self._turned(v, True) * self.root_m

    def _turned(self, y: Extended, back: bool) -> Extended:
        if self.waves:
            return _sines(y)
        if self.vectors is None:
            return y
        return y @ (self.vectors.T if back else self.vectors)

    def spread(self, reach: Extended) -> Extended:
        """|V| reach (n,): bound of what modes of these amplitudes add up to on each particle."""
        if self.waves:
            return _absolute_sines(reach)
        return reach if self.vectors is None else np.abs(self.vectors) @ reach

    def centre(self) -> Extended:
        """Rest position of each mode, 0 for a mode that nothing holds (w2 = 0)."""
        held = self.w2 != 0
        return np.asarray(np.where(held, self.pull / np.where(held, self.w2, 1), 0))


SMALL = 32
"""Particles up to which modes are found to high relative accuracy, at a cost of about 10 n**3."""


def normal_modes(system: System) -> Modes:
    """Normal modes of a linear system.

    Errors of w2 are about n EPS of each value itself where no particle is joined to another, and up to
    `SMALL` particles that nothing pushes apart (no negative stiffness); elsewhere n EPS max(w2).
    ValueError: it has none, or they cannot be had (see `System.has_modes`).
    """
    if not system.has_modes:
        raise ValueError(
            f"scene {system.scene.name!r} has no normal modes here: it is not linear, friction couples them, "
            "or more particles are joined than modes are computed for"
        )
    root_m = np.sqrt(system.m.astype(np.longdouble))
    zero = np.zeros(system.n, dtype=np.longdouble)
    pull: Extended = np.asarray(system.force(zero, zero) / root_m, np.longdouble)
    rate = system.friction_rates
    if system.is_separate:
        k = system.hessian_diagonal(zero)
        return Modes(w2=k / system.m, pull=pull, rate=rate, root_m=root_m, vectors=None)
    if system.n > SMALL and system.is_uniform_chain:
        w2 = _wave_frequencies(system)
        return Modes(w2=w2, pull=_sines(pull), rate=rate, root_m=root_m, vectors=None, waves=True)
    rows = _spring_rows(system, root_m) if system.n <= SMALL else None
    if rows is not None:
        w2, vectors = _graded(rows)
        free = len(system.free_groups)
        w2[np.argsort(w2)[:free]] = 0
    else:
        scaled = system.hessian(zero) / root_m[:, None] / root_m
        w2, vectors = _eigen(np.asarray(scaled, np.longdouble))
        # a free translation has w2 = 0 up to rounding; left as it is it would drift as a slow wave
        w2 = np.where(np.abs(w2) <= 8 * system.n * EPS * np.max(np.abs(w2)), 0, w2)
    pulls = np.where(w2 == 0, _drag(system, pull * root_m) @ vectors, pull @ vectors)
    return Modes(w2=w2, pull=pulls, rate=rate, root_m=root_m, vectors=vectors)


def _drag(system: System, force: Extended) -> Extended:
    """The part of a force (n,) that moves free groups as a whole, and all of it elsewhere, per root of mass.

    Springs pull at both ends alike, which rounding does not see: what it leaves would speed the group up.
    """
    out: Extended = np.asarray(force / np.sqrt(system.m.astype(np.longdouble)))
    for group in system.free_groups:
        m, total = system.m[group].astype(np.longdouble), np.sum(force[group])
        moves = abs(total) > len(group) * EPS * np.sum(np.abs(force[group]))
        out[group] = np.sqrt(m) * total / np.sum(m) if moves else 0
    return out


PI = 4 * np.arctan(np.longdouble(1))


def _wave_frequencies(system: System) -> Extended:
    """Squared frequencies of a uniform chain between walls, slowest first (Lagrange 1788)."""
    k = next(term.k[0] for term in system.terms if isinstance(term, Spring))
    half = np.sin(PI * np.arange(1, system.n + 1) / (2 * (system.n + 1)))
    return np.asarray(4 * k / system.m[0].astype(np.longdouble) * half * half)


def _one_turn(n: int) -> Extended:
    """sqrt(2/(n+1)) sin(pi j/(n+1)), j = 0 ... 2n + 1: all elements of V, by r j modulo a whole turn."""
    return np.asarray(np.sin(PI * np.arange(2 * (n + 1)) / (n + 1)) * np.sqrt(np.longdouble(2) / (n + 1)))


MOST_EXACT = 4096
"""Modes up to which |V| is summed element by element; beyond, every element counts as its largest value."""


def _absolute_sines(reach: Extended) -> Extended:
    """|V| reach (n,) for V of sines, or an upper bound of it for many modes: in memory of O(n)."""
    n = len(reach)
    if n > MOST_EXACT:
        return np.full(n, np.sqrt(np.longdouble(2) / (n + 1)) * np.sum(reach))
    r, sines = np.arange(1, n + 1), np.abs(_one_turn(n))
    return np.array([sines[j * r % (2 * (n + 1))] @ reach for j in r])


def _sines(y: Extended) -> Extended:
    """y (..., n) V for V of sines, by the Fourier transform of its odd continuation."""
    n = y.shape[-1]
    none = np.zeros((*y.shape[:-1], 1), dtype=np.longdouble)
    odd = np.concatenate([none, y, none, -y[..., ::-1]], axis=-1)
    return np.asarray(-np.fft.rfft(odd, axis=-1).imag[..., 1 : n + 1] / np.sqrt(2 * np.longdouble(n + 1)))


def _spring_rows(system: System, root_m: Extended) -> Extended | None:
    """G (s, n) with M^-1/2 K M^-1/2 = G^T G: one row for each spring.  None where a stiffness is negative."""
    rows: list[Extended] = []
    zero = np.zeros(system.n, dtype=np.longdouble)
    for term in system.terms:
        if not term.is_potential:
            continue
        k = np.broadcast_to(term.curvature(zero), (len(term),)).astype(np.longdouble)
        if np.any(k < 0):
            return None
        block = np.zeros((len(k), system.n), dtype=np.longdouble)
        for end, sign in zip(reversed(term.particles), (1, -1), strict=False):
            block[np.arange(len(k)), end] = sign
        rows.append(np.sqrt(k)[:, None] * block / root_m)
    return np.concatenate(rows)


def _graded(rows: Extended) -> tuple[Extended, Extended]:
    """Eigenvalues and vectors of G^T G, each value to high relative accuracy, for G = rows (s, n).

    Rows of very different size (stiff and soft springs) would drown the small eigenvalues in the
    rounding of the large ones if G^T G were formed.  One-sided Jacobi rotations do not form it
    (Demmel & Veselic, SIAM J. Matrix Anal. Appl. 13 (1992) 1204); a pivoted QR factorisation of G^T
    before them makes their columns graded (Drmac & Veselic, SIAM J. Matrix Anal. Appl. 29 (2008) 1322).
    """
    n = rows.shape[1]
    basis, triangle = _pivoted_qr(rows.T)
    columns = triangle.T.copy()
    turn = np.eye(n, dtype=np.longdouble)
    for _ in range(60):
        largest = 0.0
        for i in range(n - 1):
            for j in range(i + 1, n):
                x, y = columns[:, i], columns[:, j]
                a, b, c = x @ x, y @ y, x @ y
                if c == 0 or abs(c) <= EPS * np.sqrt(a * b):
                    continue
                largest = max(largest, float(abs(c) / np.sqrt(a * b)))
                zeta = (b - a) / (2 * c)
                t = (1 if zeta >= 0 else -1) / (abs(zeta) + np.sqrt(1 + zeta * zeta))
                cosine = 1 / np.sqrt(1 + t * t)
                sine = cosine * t
                for of in (columns, turn):
                    x, y = of[:, i].copy(), of[:, j].copy()
                    of[:, i], of[:, j] = cosine * x - sine * y, sine * x + cosine * y
        if largest <= n * EPS:
            break
    return np.sum(columns * columns, axis=0), basis @ turn


def _pivoted_qr(matrix: Extended) -> tuple[Extended, Extended]:
    """Q (n, n) orthogonal and R (n, s) with matrix = Q R, the columns of R in their order of matrix.

    Householder reflections, the column that is largest in what remains first.
    """
    rest = matrix.copy()
    n, s = rest.shape
    basis = np.eye(n, dtype=np.longdouble)
    open_columns = np.ones(s, dtype=bool)
    for i in range(min(n, s)):
        sizes = np.where(open_columns, np.sum(rest[i:] * rest[i:], axis=0), -1)
        j = int(np.argmax(sizes))
        if sizes[j] <= 0:
            break
        open_columns[j] = False
        mirror = rest[i:, j].copy()
        mirror[0] += np.sqrt(sizes[j]) * (1 if mirror[0] >= 0 else -1)
        factor = 2 / (mirror @ mirror)
        rest[i:] -= np.outer(mirror, factor * (mirror @ rest[i:]))
        rest[i + 1 :, j] = 0
        basis[:, i:] -= np.outer(basis[:, i:] @ mirror, factor * mirror)
    return basis, rest


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
    """Runs of neighbouring (sorted) eigenvalues that lie close together."""
    breaks = np.flatnonzero(~np.diagonal(close, offset=1)) + 1
    return [np.asarray(block) for block in np.split(np.arange(len(close)), breaks)]


def motion(scene: Scene, t: Extended) -> tuple[Extended, Extended]:
    """Exact q and p (f, n) of a linear scene at times t (f, 1) [T]."""
    found = scene.system.modes
    y0, v0 = found.into(scene.q, scene.p)
    centre = found.centre()
    u0 = y0 - centre
    y = np.empty((len(t), len(u0)), dtype=np.longdouble)
    v = np.empty_like(y)
    w2, rate = found.w2, found.rate
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        for kind, law in (
            ((w2 != 0) & (rate == 0), _undamped),
            ((w2 != 0) & (rate != 0), _damped),
            ((w2 == 0) & (rate == 0), _free),
            ((w2 == 0) & (rate != 0), _dragged),
        ):
            if np.any(kind):
                y[:, kind], v[:, kind] = law(
                    u0[kind], v0[kind], t, _Law(w2=w2[kind], rate=rate[kind], pull=found.pull[kind])
                )
    return found.out_of(y + centre, v)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Law:
    """u'' = -w2 u - rate u' + pull, the pull only where w2 = 0 (elsewhere u counts from the centre)."""

    w2: Extended
    rate: Extended
    pull: Extended


def _undamped(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    """Hyperbolic for w2 < 0: from |phase| = 1 on as two exponentials, of which one may be all there is."""
    w = np.sqrt(np.abs(law.w2))
    phase = t * w
    turning = law.w2 > 0
    apart = ~turning & (np.abs(phase) > 1)
    near = np.where(turning | apart, 0, phase)
    cosine = np.where(turning, np.cos(phase), np.cosh(near))
    sine = np.where(turning, np.sin(phase), np.sinh(near))
    sign = np.where(turning, -1, 1)
    y, z = u * cosine + v / w * sine, v * cosine + sign * w * u * sine
    if np.any(apart):
        one, two = (u + v / w) / 2, (u - v / w) / 2
        # what is not there does not grow, not even beyond all numbers
        up, down = (np.where(x == 0, 0, x * np.exp(to)) for x, to in ((one, phase), (two, -phase)))
        y, z = np.where(apart, up + down, y), np.where(apart, w * (up - down), z)
    return np.asarray(y), np.asarray(z)


def _damped(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    """With b = rate/2 and s**2 = w2 - b**2: exp(-b t) (u (cos st + b S) + v S), S = sin(st)/s.

    Hyperbolic beyond critical damping.  There the slow root -b + s would cancel and exp(-b t) cosh(st)
    would be 0 times infinity; from st = 1 on the two exponentials are taken apart, with the slow root
    as -w2 / (b + s).  Near critical damping S -> t, and nothing is divided by s.
    """
    b = law.rate / 2
    root = np.sqrt(np.abs(law.w2))
    below = (root - b) * (root + b)
    square = np.where(law.w2 > 0, below, law.w2 - b * b)
    s = np.sqrt(np.abs(square))
    angle = s * t
    turning = square > 0
    apart = ~turning & (np.abs(angle) > 1)
    near = np.where(apart, 0, angle)
    safe = np.where(s > 0, s, 1)
    short = np.abs(near) < 2.0**-33
    cosine = np.where(turning, np.cos(near), np.cosh(np.where(turning, 0, near)))
    sine = np.where(turning, np.sin(near), np.sinh(np.where(turning, 0, near))) / safe
    sine = np.where(short, t, sine)
    decay = np.exp(-b * t)
    y = decay * (u * (cosine + b * sine) + v * sine)
    z = decay * (v * (cosine - b * sine) - law.w2 * u * sine)
    if np.any(apart):
        fast = -(b + s)
        slow = -law.w2 / (b + s)
        one, two = (v - fast * u) / (2 * safe), (v - slow * u) / (2 * safe)
        early, late = np.exp(fast * t), np.exp(slow * t)
        y = np.where(apart, one * late - two * early, y)
        z = np.where(apart, slow * one * late - fast * two * early, z)
    return np.asarray(y), np.asarray(z)


def _free(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    return np.asarray(u + v * t + law.pull * t * t / 2), np.asarray(v + law.pull * t)


def _dragged(u: Extended, v: Extended, t: Extended, law: _Law) -> tuple[Extended, Extended]:
    x = law.rate * t
    gone = -np.expm1(-x) / law.rate
    # (x - 1 + exp(-x)) / x**2, by its series where it would cancel
    small = np.abs(x) < 1
    near, far = np.where(small, x, 0), np.where(small, 1, x)
    series, term = np.zeros_like(x), np.full_like(x, 0.5)
    for k in range(3, 26):
        series, term = series + term, -term * near / k
    fallen = np.where(small, series, (far + np.expm1(-far)) / (far * far))
    return u + v * gone + law.pull * t * t * fallen, v * np.exp(-x) + law.pull * gone
