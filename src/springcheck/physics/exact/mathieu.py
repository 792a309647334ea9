"""The exact solution of springs of modulated stiffness, by Floquet theory: Mathieu's equation.

The state a period later is a matrix times the present one.  Within a period the matrix from its start to each
node of a grid is a product of Taylor series in time, whose step has a phase below half a radian.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from springcheck.physics.arrays import EPS, Extended
from springcheck.physics.driven import ModulatedSpring
from springcheck.physics.exact.closedform import PI, ClosedForm, NoClosedFormError, States, wide
from springcheck.physics.exact.powers import propagate
from springcheck.physics.system import System

FORM_EPS = 64 * EPS
TAYLOR_ORDER = 22
"""Order of the Taylor series: its next term is (1/2)**23/23!, 5e-30 of the first."""

ERROR_SCALES = 5
"""Coordinates in which the growth of errors is bounded."""

MOST_NODES = 1 << 14
"""Most nodes of a period: a slower modulation has no solution here."""


class _Mode:
    """One particle: u'' = -w2 (level + depth cos(turn t + phase)) u, u = q - at, and its start (u, v).

    Without friction the level is 1.  With friction u is (q - at) exp(friction t/2).

    `rate` is the larger angular frequency, of the spring or of the modulation [1/T], and `nodes` (j + 1, 2,
    2) are the matrices that take (u, v) from the start to each node of a period, `node` [T] apart, the last
    to its end.
    """

    def __init__(self, found: Extended, row: Sequence[float], friction: float = 0.0) -> None:
        """From mass, position and momentum, a row of its term, and the rate of friction [1/T].
        NoClosedFormError for too long a period."""
        m, q, p = found
        k, self.depth, self.turn, self.phase, self.at = wide(row)
        self.w2, self.start = k / m, np.array([q - self.at, p / m])
        self.level = 1 - (np.square(np.longdouble(friction)) / (4 * self.w2) if friction else 0)
        spring = np.sqrt(np.abs(self.w2) * (np.abs(self.level) + np.abs(self.depth)))
        self.rate = float(np.maximum(spring, np.abs(self.turn)))
        if self.turn == 0 or not 2 * self.rate * 2 * np.pi / abs(float(self.turn)) < MOST_NODES:
            raise NoClosedFormError
        self.period = 2 * PI / np.abs(self.turn)
        count = int(np.ceil(2 * self.rate * float(self.period)))
        self.node = self.period / count
        nodes = [np.asarray(np.eye(2), np.longdouble)]
        for one in self.steps(self.node * np.arange(count), np.full(count, self.node)):
            nodes.append(np.asarray(one @ nodes[-1], np.longdouble))
        self.nodes = np.stack(nodes)

    def steps(self, t: Extended, s: Extended) -> Extended:
        """Matrices (f, 2, 2) that take (u, v) from the times t (f,) to t + s."""
        angle = self.turn * t + self.phase
        waves, factor = [], np.longdouble(1)
        for j in range(TAYLOR_ORDER):
            # the j-th derivative of the cosine: cos, -sin, -cos, sin
            wave = (np.cos(angle), -np.sin(angle), -np.cos(angle), np.sin(angle))[j % 4]
            waves.append(self.depth * factor * wave + (self.level if j == 0 else 0))
            factor = factor * self.turn / (j + 1)
        # both unit starts at once, coefficients (order, 2, f)
        u = [np.stack([np.ones_like(s), np.zeros_like(s)]), np.stack([np.zeros_like(s), np.ones_like(s)])]
        for j in range(TAYLOR_ORDER):
            total = sum((waves[i] * u[j - i] for i in range(j + 1)), np.zeros_like(u[0]))
            u.append(np.asarray(-self.w2 * total / ((j + 1) * (j + 2)), np.longdouble))
        y, v = np.zeros_like(u[0]), np.zeros_like(u[0])
        for j in reversed(range(len(u))):
            y = y * s + u[j]
            v = v * s + j * u[j] if j else v
        return np.asarray(np.moveaxis(np.stack([y, v]), -1, 0))


class ModulatedMotion(ClosedForm):
    """A whole scene of springs of modulated stiffness, one on each particle, each with its `_Mode`."""

    def __init__(self, system: System[Any]) -> None:
        super().__init__(system)
        term = next(iter(system.terms), None)
        self.need(
            isinstance(term, ModulatedSpring) and len(system.terms) == 1 and np.all(system.pulls() == 1)
        )
        assert isinstance(term, ModulatedSpring)
        found = wide([system.m, system.q, system.p])
        self.modes = [_Mode(found[:, i], row) for i, *row in sorted(term.rows())]

    def at(self, t: Extended) -> States:
        q, p = np.empty((2, len(t), self.system.n), dtype=np.longdouble)
        for i, mode in enumerate(self.modes):
            n = np.floor(t[:, 0] / mode.period).astype(np.int64)
            rest = t[:, 0] - n * mode.period
            j = np.clip((rest / mode.node).astype(np.int64), 0, len(mode.nodes) - 2)
            last = mode.steps(mode.node * j, rest - mode.node * j)
            # a matrix that rotates by nearly half a turn a period: its negative rotates by little
            sign, begun = np.copysign(1, np.trace(mode.nodes[-1])), np.empty((2, len(t)), np.longdouble)
            (a, b), (c, d) = sign * mode.nodes[-1]
            for matrix, mine in ((np.array([[a, b], [c, d]]), n >= 0), (np.array([[d, -b], [-c, a]]), n < 0)):
                u0, v0 = mode.start[:, None]
                u, v = propagate(matrix[None], u0, v0, np.abs(n[mine]), area_preserving=True)
                begun[:, mine] = np.stack([u[:, 0], v[:, 0]]) * np.where(n[mine] % 2 == 1, sign, 1)
            q[:, i], p[:, i] = np.einsum("fij,jf->if", last @ mode.nodes[j], begun)
        return q + np.array([mode.at for mode in self.modes]), p * self.system.m

    def doubt(self, t: np.longdouble) -> States:
        """Rounding of the accumulated phase, times the largest state.

        With eigenvalues x and y, and N the norm of M - x, the matrix M of a period has powers of at most 1 +
        n N or the condition of its eigenvectors, k + root(k**2 - 1) with k = N/|x - y|: close to the edge of
        a resonance they grow, once with the state and once with an error.  That holds in the coordinates (z
        u, v) for any z, and the least of several is taken; errors begin with rate/z there.
        """
        u, v = np.empty((2, self.system.n), dtype=np.longdouble)
        for i, mode in enumerate(self.modes):
            M = mode.nodes[-1]
            half = np.trace(M) / 2
            root = np.emath.sqrt((half - 1) * (half + 1)) * np.copysign(1, half)
            radius = max(float(np.abs(np.real(half + root))), 1.0)
            gap, periods = max(2 * float(np.abs(root)), FORM_EPS), float(np.abs(t) / mode.period) + 1
            # a time before the start is whole periods back, and a part of one forward
            turned = mode.rate * (t if t >= 0 else mode.period - t)
            sizes = []
            for z in mode.rate * np.geomspace(1, _balance(M) / mode.rate, ERROR_SCALES):
                scaled = mode.nodes * [[1, z], [1 / z, 1]]
                length = float(np.linalg.norm((scaled[-1] - (half + root) * np.eye(2)).astype(complex)))
                k = max(length / gap, 1.0)
                power = min(k + np.sqrt(k * k - 1), 1 + periods * length)
                within = np.max(np.linalg.norm(scaled.astype(np.float64), axis=(1, 2)))
                grown = within * power**2 * max(mode.rate / z, z / mode.rate)
                sizes.append(grown * np.hypot(z * mode.start[0], mode.start[1]) / np.array([z, 1]))
            u[i], v[i] = np.min(sizes, axis=0) * radius**periods * FORM_EPS * (1 + turned)
            u[i] += FORM_EPS * np.abs(mode.at)
        return u, v * self.system.m


def _balance(M: Extended) -> float:
    """The z for which M (2, 2) on (z u, v) has off-diagonal elements of equal size."""
    one, other = np.abs(M[0, 1]), np.abs(M[1, 0])
    return float(np.sqrt(other / one)) if one > 0 < other else 1.0


def floquet(system: System[Any]) -> tuple[float, float, float] | None:
    """Growth factor of the exact motion in a period of the modulation (its larger Floquet multiplier, below 1
    by friction alone), the period [T], and the angle of the multiplier, 0 to pi [rad], of the fastest growing
    particle; None for other scenes."""
    each, bare = [], system.without("damping")
    if ModulatedMotion.of(bare) is None:
        return None
    (term,), found = bare.terms, wide([system.m, system.q, system.p])
    for (i, *row), friction in zip(sorted(term.rows()), system.friction_rates.tolist(), strict=True):
        try:
            mode = _Mode(found[:, i], row, friction)
        except NoClosedFormError:
            return None
        half = float(np.trace(mode.nodes[-1])) / 2
        # the matrix of a period has the determinant 1
        grown = max(1.0, abs(half) + float(np.sqrt(max(half * half - 1, 0))))
        grown *= float(np.exp(-friction * mode.period / 2))
        each.append((grown, float(mode.period), float(np.arccos(np.clip(half, -1, 1)))))
    return max(each, default=None)
