"""The draws behind recorded states: which numbers a random scheme must have taken, and what contradicts it.

Two numbers of a state, q' and p', follow from at most two draws.  Where one draw enters a step, or where one
acts in two steps, they overdetermine it: the residual is rounding, at every step, at any temperature.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springcheck.bath.catalogue import ENERGY_LEFT, Thermostat
from springcheck.bath.jointly import jointly
from springcheck.bath.laws import Law
from springcheck.bath.rounding import one_rounding, roundings_of
from springcheck.bath.stepper import Stepper, forces
from springcheck.physics.arrays import Arithmetic, Extended, Floats, Reals
from springcheck.physics.scene import Scene

HOTTEST = 1e4
"""Noncentrality of a chi-squared distribution up to which its rank is computed to all digits."""

_NONE: Extended = np.empty((0, 0), np.longdouble)

SMALL_RATE = 1e-4
"""Relative change of a friction over which its effect is linear."""

LARGEST_DRAW = 8.0
"""Size that no draw of a run of a few steps exceeds: the chance is 1e-15 for each."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """The draws between frames, as far as the frames determine them."""

    draws: Floats
    """Draws (f-1, n) of mean 0 and variance 1, independent if the scheme is right; NaN where a step had none.

    Of two fresh draws a step those of the first and of the second are rows one after the other.
    """
    across: Floats | None
    """Contradiction between the numbers of a state, in roundings; None where some draws reach every state."""
    roundings: int
    """Largest `across` that rounding explains."""
    error: Floats
    """Rounding error of each draw, of the shape of `draws`."""
    hits: NDArray[np.bool_] | None = None
    """Where collisions took place, (f-1, n)."""
    missed: Floats | None = None
    """Largest change by a collision that is not noticed, in draws, (f-1, n)."""
    rescaled: Floats | None = None
    """Twice the kinetic energy over kT before and after one factor for all momenta, (2, f-1)."""

    @property
    def known(self) -> bool:
        """Whether rounding moves no chance of the draws by much.

        Their sum has a standard deviation of sqrt(N); errors of one sign may add up to a twentieth of that,
        which changes a chance of 1e-7 by a third.
        """
        error = self.error if self.hits is None else self.error[self.hits]
        return bool(np.sum(error) <= 0.05 * np.sqrt(error.size))


def law_of(scheme: Thermostat, scene: Scene) -> Law:
    """The law of a scheme on each particle by itself, with its own curvature at the start."""
    assert scene.bath is not None
    q = scene.q.astype(np.longdouble)
    return Law(
        scheme=scheme, h=scene.step, m=scene.m, rate=scene.bath.friction, thermal=scene.thermal,
        k=np.asarray(scene.system.hessian_diagonal(q), np.longdouble),
    )  # fmt: skip


def drag_in_draws(scheme: Thermostat, scene: Scene) -> float:
    """Correlation of the draws with the momenta before them for each relative change of the friction that
    acts without its noise; 0 where more than one draw acts in a step, or it is not known."""
    law = law_of(scheme, scene)
    if scheme.draws > 1 or scheme.collides:
        return 0.0
    changed = [replace(law, rate=law.rate * (1 + x)).A.astype(np.float64) for x in (-SMALL_RATE, SMALL_RATE)]
    slope, G = (changed[1] - changed[0]) / (2 * SMALL_RATE), law.G.astype(np.float64)[:, :, 0]
    row = 0 if np.any(np.abs(G[:, 0]) > 0) else 1
    S, own = law.covariance, scene.thermal * np.asarray(scene.m, np.float64)
    held = np.einsum("ni,ni->n", slope[:, row], S[:, :, 1]) / G[:, row] / np.sqrt(own)
    found = abs(np.sum(held)) / np.sqrt(len(held) * float(np.sum(S[:, 1, 1] / own)))
    return float(found) if np.isfinite(found) else 0.0


def read(
    scheme: Thermostat, scene: Scene, q: Floats, p: Floats, *, how: Arithmetic | None = None,
    rebuilt: bool = False,
) -> Reading:  # fmt: skip
    """The draws behind frames q, p (f, n), one step apart; `how` the engine rounds.

    With `rebuilt` velocities are differences of positions over the step.
    """
    return _Reader(scheme, scene, how or Arithmetic(), rebuilt).read(q, p)


class _Reader:
    def __init__(self, scheme: Thermostat, scene: Scene, how: Arithmetic, rebuilt: bool) -> None:
        self.scheme, self.scene, self.how, self.rebuilt = scheme, scene, how, rebuilt
        self.stepper = Stepper.of(scheme, scene)
        self.sizer = Stepper.of(scheme, scene, absolute=True)
        self._force = forces(scene.system)
        self.roundings = roundings_of(scheme)
        self.directions, self.of_q = (_NONE, False) if scheme.rescales else _directions(scheme, scene)

    def read(self, q: Floats, p: Floats) -> Reading:
        z = q.astype(np.longdouble), p.astype(np.longdouble)
        start, end = (z[0][:-1], z[1][:-1]), (z[0][1:], z[1][1:])
        if self.scheme.rescales:
            return self._rescaled(start, end)
        if self.scheme.collides:
            return self._collided(start, end)
        draws, across, unit, unseen = self._solved(start, end, hit=False)
        c = self.scheme.carried
        if draws.shape[0] == 1:
            one = np.asarray(draws[0], np.float64)
            return self._reading(_whitened(one) if c else one, across, unit[0])
        if not c:
            return self._reading(_in_rows(draws), None, _in_rows(unit))
        # the last draw of each step is the first of the next; that of the start is not recorded
        off = np.abs(draws[0][1:] - draws[1][:-1]) / (unit[0][1:] + unit[1][:-1])
        off = np.where(unseen[1:] | unseen[:-1], np.maximum(across[1:], across[:-1]), off)
        return self._reading(draws[1], off, unit[1])

    def _reading(
        self, draws: Reals, across: Reals | None, unit: Reals, hits: NDArray[np.bool_] | None = None
    ) -> Reading:
        return Reading(
            draws=np.asarray(draws, np.float64), error=np.asarray(self.roundings * unit, np.float64),
            across=None if across is None else np.asarray(across, np.float64),
            roundings=self.roundings, hits=hits,
        )  # fmt: skip

    def _collided(self, start: tuple[Extended, Extended], end: tuple[Extended, Extended]) -> Reading:
        """A step without a collision is known to rounding; any other has one draw."""
        none = np.zeros((1, *start[0].shape), np.longdouble)
        q, p = self.stepper(*start, self._force, list(none), False, end[0])
        of_q, of_p = self._allowed(start, none)
        straight = np.maximum(np.abs(end[0] - q) / of_q, np.abs(end[1] - p) / of_p)
        draws, across, unit, _ = self._solved(start, end, hit=True)
        hits = ~(straight <= self.roundings)
        found = self._reading(
            np.where(hits, draws[0], np.nan), np.where(hits, across, straight), unit[0], hits
        )
        after, before = (self.stepper(*start, self._force, [none[0] + x], True, end[0]) for x in (1, 0))
        makes = np.maximum(np.abs(after[0] - before[0]) / of_q, np.abs(after[1] - before[1]) / of_p)
        return replace(found, missed=np.asarray(self.roundings / makes, np.float64))

    def _rescaled(self, start: tuple[Extended, Extended], end: tuple[Extended, Extended]) -> Reading:
        """The factor of all momenta follows from them, and leaves n - 1 of them and all positions to check.

        The kinetic energy that it makes is, over (1 - c) kT/2, noncentral chi-squared of n degrees of freedom
        about c times that before: its rank is a draw.  Of one degree of freedom it is the normal one itself.
        """
        from scipy.special import chndtr, ndtri

        m, n, bath = self.scene.m, self.scene.n, self.scene.bath
        assert bath is not None

        def at(factor: float) -> Extended:
            return np.stack(self.stepper(*start, self._force, [0], factor, end[0]))

        none = at(0.0)
        slope, target = at(1.0) - none, np.stack(end)
        if self.scheme.acts[0].kind in ("rescale", "scale"):
            # computed without the kicks, beside which a small momentum would lose its digits
            still = np.zeros_like(start[0])
            slope = np.stack(self.stepper(still, start[1], lambda q, p: 0 * q, [0], 1.0))
        twice = np.sum(slope[1] ** 2 / m, axis=-1, keepdims=True)
        factor = np.sum(slope[1] * (target - none)[1] / m, axis=-1, keepdims=True) / twice
        of = np.stack(self._allowed(start, [0], np.maximum(1, np.abs(factor))))
        unit = np.sum(np.abs(slope[1]) * of[1] / m, axis=-1, keepdims=True) / twice
        across = np.abs(target - none - factor * slope) / (of + unit * np.abs(slope))
        x = np.asarray(bath.friction * self.scene.step)
        about = twice / (ENERGY_LEFT.lost(x) * self.scene.thermal)
        here, before = np.asarray(factor**2 * about, float), np.asarray(ENERGY_LEFT(x) * about, float)
        with np.errstate(all="ignore"):
            far = ~((before < HOTTEST) & (here < 4 * HOTTEST))
            draws = np.where(far, np.inf, ndtri(chndtr(*np.where(far, 1.0, [here, n + 0 * here, before]))))
        if n == 1 and self.scheme.acts[0].kind == "rescale":
            draws = factor * np.sqrt(about) - np.sqrt(before)
        # of a normal number of the same variance
        spread = np.sqrt(2 * (n + 2 * before)) / (2 * np.abs(factor) * about)
        # the series of the distribution ends where the motion is that much above the noise
        found = self._reading(
            draws, np.max(across, axis=0), np.where(before < HOTTEST, unit / spread, np.inf)
        )
        kinetic = np.concatenate([twice, factor**2 * twice], axis=-1).T / self.scene.thermal
        return replace(found, rescaled=np.asarray(kinetic, np.float64))

    def _allowed(
        self, start: tuple[Extended, Extended], draws: Any, hit: Any = True
    ) -> tuple[Extended, Extended]:
        """One rounding of everything that a step adds up."""
        return one_rounding(self.scene, self.sizer, start, list(np.abs(draws)), hit, self.how, self.rebuilt)

    def _solved(
        self, start: tuple[Extended, Extended], end: tuple[Extended, Extended], *, hit: bool
    ) -> tuple[Extended, Extended, Extended, NDArray[np.bool_]]:
        """Draws (u, f-1, n); by how many roundings the state contradicts them, (f-1, n); one rounding of a
        draw; and where rounding hides it, so that any draw differs from none by less than what is allowed.

        One draw is contradicted by the other number of the state; two are not, where both show.
        """
        u = self.directions.shape[1]
        found = np.zeros((u, *start[0].shape), np.longdouble)

        def at(draws: Extended) -> Extended:
            those = np.tensordot(self.directions, draws, axes=1)
            return np.stack(self.stepper(*start, self._force, list(those), hit, end[0]))

        target, none, linear = np.stack(end), at(found), self.scene.system.is_linear
        units = np.eye(u, dtype=np.longdouble)[:, :, None, None]
        for iteration in range(6):
            now = at(found)
            slopes = np.stack([at(found + unit) - now for unit in units])
            if u == 1:
                first = 0 if self.of_q else 1
                change = ((target - now)[first] / slopes[0][first])[None]
            else:
                (a, c), (b, d) = slopes[0], slopes[1]
                x, y = target - now
                change = np.stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)
            found = found + change
            if np.all(np.abs(change) <= 1e-17 * (1 + np.abs(found))) or (linear and iteration == 1):
                break
        of = np.stack(self._allowed(start, np.tensordot(self.directions, found, axes=1)))
        if u == 1:
            unit = of[first][None] / np.abs(slopes[0][first])
            turn = np.abs(slopes[0][1 - first] / slopes[0][first])
            across = np.abs(target - at(found))[1 - first] / (of[1 - first] + turn * of[first])
        else:
            unit = np.stack([np.abs(d) * of[0] + np.abs(b) * of[1], np.abs(a) * of[1] + np.abs(c) * of[0]])
            unit, across = unit / np.abs(a * d - b * c), np.zeros_like(of[0])
            if not np.all(np.abs(target - at(found)) <= self.roundings * of):
                # the force of the middle of a step has draws of particles that are joined in it
                found, unit = jointly(at, target, found, of)
        unseen = ~(self.roundings * np.max(unit, axis=0) <= 1)
        if np.any(unseen):
            # what no draw explains is then at most the largest one
            of = np.stack(self._allowed(start, np.zeros((self.scheme.draws, *found.shape[1:]))))
            each = np.stack([at(np.broadcast_to(unit, found.shape)) - none for unit in units])
            noise = LARGEST_DRAW * np.sum(np.abs(each), axis=0) / self.roundings
            across = np.where(unseen, np.max(np.abs(target - none) / (of + noise), axis=0), across)
        return found, across, unit, unseen


def _in_rows(draws: Extended) -> Extended:
    """Draws (2, f-1, n) of two a step as rows one after the other."""
    return draws.transpose(1, 0, 2).reshape(-1, draws.shape[2])


def _directions(scheme: Thermostat, scene: Scene) -> tuple[Extended, bool]:
    """Matrix (draws, u) from the u combinations that a state determines to the draws of a step, and whether
    only one of them reaches the position."""
    found = law_of(scheme, scene)
    # the stiffest particle has all that the others have
    j = int(np.argmax(np.abs(found.k) / found.m))
    m = float(scene.m[j])
    G = found.G[j] / (np.sqrt(scene.thermal / m) * np.array([[scene.step], [m]]))
    # of rank two unless its rows are in proportion, however much the draws differ in what they do
    x = np.multiply.outer(*G)
    u = 1 + bool(np.any(np.abs(x - x.T) > 1e-12 * (np.abs(x) + np.abs(x.T))))
    _, _, turned = np.linalg.svd(G.astype(np.float64), full_matrices=False)
    made = np.eye(u) if u == scheme.draws else turned[:1].T * np.sign(turned[0, 0])
    return made.astype(np.longdouble), bool(np.any(np.abs(G[0]) > 1e-9))


def _whitened(x: Floats) -> Floats:
    """Independent draws of those (f, n) that are sums of one and the next over sqrt(2): covariance 1/2 with
    their neighbours, by its Cholesky factor, whose rows have two entries."""
    out = np.empty_like(x)
    below, last = 0.0, np.zeros(x.shape[1])
    for i, row in enumerate(x):
        size = np.sqrt(1 - below * below)
        last = (row - below * last) / size
        out[i] = last
        below = 0.5 / size
    return out
