"""Distance of a run from the exact solution, taken as it streams by: only a few numbers are stored.

Error, phase and energy are independent: a symplectic method conserves its energy while its phase drifts
(Rein, Brown & Tamayo, MNRAS 489 (2019) 4632), so that none of them can replace another.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from springcheck import schemes
from springcheck.checks.requires import CONTRACTED
from springcheck.errors import SceneError
from springcheck.physics import exact
from springcheck.physics.arrays import WIDE, Extended, Floats, Integers, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, WallSpring
from springcheck.studies.stability.longest import fastest

LEAST_AMPLITUDE = 1e-3
"""Least amplitude, relative to the largest at the start, at which the phase of a mode is taken: in a mode
that hardly moves, or no longer does, the rounding of the others is a large angle."""

MOST_COMPARED_FRAMES = 4096
"""Most frames at which a run is compared with the exact solution.  Their spacing is below a 250th of a period
as long as the run has fewer than 16 periods, and every finer step hits the same instants."""


Motion = Callable[[Integers], tuple[Extended, Extended]]
"""Numbers of steps (f,) -> q and p (f, n)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Errors of one run, over its whole trajectory unless stated otherwise.

    `max_error` and `end_error` are relative to the initial energy norm (`System.norm`); `phase_error` is the
    largest phase lead (> 0) or lag of a mode [rad], None where nothing oscillates, or a field or friction
    couples modes; `energy_error` is the largest |H - H exact| in units of the start's kinetic plus absolute
    potential energy; `rounding_error` is the largest distance from the scheme's own motion in exact
    arithmetic, None where that has no closed form.
    """

    max_error: float
    end_error: float = np.nan
    phase_error: float | None = None
    energy_error: float = np.nan
    rounding_error: float | None = None

    def error(self, metric: str) -> float:
        """The error of this name, without its sign; NaN where there is none."""
        value = getattr(self, {"largest": "max_error"}.get(metric, f"{metric}_error"))
        return float("nan") if value is None else abs(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The exact solution of a scene, with quantities that all its runs share."""

    scene: Scene
    turning: exact.Modes
    """Normal modes of its springs alone, in which the phase is measured; of none where a field or friction
    couples them."""
    rate: Extended
    """Rates of friction of these modes (n,) [1/T]."""
    w: float
    """Largest angular frequency along the motion [1/T], 0 where nothing oscillates."""

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [T]."""
        return self.scene.step * self.scene.steps

    @property
    def angle(self) -> float:
        """w T: the largest phase that the motion accumulates."""
        return abs(self.duration) * self.w


@np.errstate(over="ignore", invalid="ignore")
def truth(scene: Scene) -> Truth:
    """Prepare the exact solution of a scene.

    Raises:
        SceneError: forces overflow, there is no reference solution, or the scene rests: errors have no unit.
    """
    w = fastest(scene)
    if not exact.has_true_motion(scene):
        raise SceneError(
            f"scene {scene.name}: no reference solution, because {exact.no_reference(scene)}; without it no "
            "error can be measured"
        )
    if not scene.system.norm.of:
        raise SceneError(f"scene {scene.name} rests in equilibrium: give a particle a position or a momentum")
    system = scene.system
    joined = system.is_damped and not system.has_modes
    springs = tuple(term for term in scene.terms if isinstance(term, WallSpring | Spring) and not joined)
    rate = system.modes.rate if system.is_damped and not joined else np.zeros(scene.n, np.longdouble)
    return Truth(scene=scene, turning=replace(scene, terms=springs).system.modes, rate=rate, w=w)


class Errors:
    """A sink for `driver.play` that accumulates the errors of one run of steps `h`."""

    def __init__(
        self, known: Truth, h: float, every: int, *, scheme: schemes.Scheme, judged: Scene | None = None,
        first: int = 0,
    ) -> None:  # fmt: skip
        """`judged` is the scene with parameters as the engine stores them, for the rounding error alone;
        `first` the number of steps at the first frame."""
        self._truth, self._h, self._every = known, h, every
        self._step = first
        self._largest = self._end = self._energy = self._phase = self._rounded = 0.0
        modes = known.turning
        u, v = self._turned(known.scene.q[None], known.scene.p[None])
        size = np.hypot(u, v)[0]
        self._least = LEAST_AMPLITUDE * np.max(size)
        # an overdamped mode does not oscillate
        self._clear = (modes.w2 > known.rate**2 / 4) & (size >= self._least) & (size > 0)
        self._last = np.zeros(int(np.count_nonzero(self._clear)), dtype=np.longdouble)
        self._own = own_motion(judged or known.scene, scheme, h)

    def __call__(self, t: Floats, q: Reals, p: Reals, *_: Floats | None) -> None:
        """Accumulate the errors of these frames."""
        known, norm = self._truth, self._truth.scene.system.norm
        steps = self._step + np.arange(len(t)) * self._every
        self._step = int(steps[-1]) + self._every
        true_q, true_p = exact.true_motion(known.scene, steps, self._h)
        with np.errstate(over="ignore", invalid="ignore"):
            error = norm(q - true_q, p - true_p)
            # errors below the uncertainty of the exact solution are not reported
            error = np.maximum(error, exact.uncertainty(known.scene, float(steps[-1]) * self._h))
            wide_q, wide_p = q.astype(np.longdouble), p.astype(np.longdouble)
            energy_off = known.scene.system.energy(wide_q, wide_p) - known.scene.system.energy(true_q, true_p)
            off = np.abs(energy_off) / norm.unit**2
            if self._own is not None:
                own_q, own_p = self._own(steps)
                rounded = float(np.max(norm(q - own_q, p - own_p)))
                self._rounded = float(np.fmax(self._rounded, rounded))
        # np.maximum propagates NaN, which max() drops
        self._largest = float(np.maximum(self._largest, np.max(error)))
        self._end = float(error[-1])
        self._energy = float(np.maximum(self._energy, np.max(off)))
        self._turn(q, p, true_q, true_p)

    @property
    def result(self) -> Accuracy:
        """Errors accumulated so far."""
        return Accuracy(
            max_error=self._largest,
            end_error=self._end,
            phase_error=self._phase if len(self._last) else None,
            energy_error=self._energy,
            rounding_error=None if self._own is None else self._rounded,
        )

    def _turned(self, q: Reals, p: Reals) -> tuple[Extended, Extended]:
        """Mode coordinates (f, n) in which the exact solution moves clockwise on circles, or with friction on
        logarithmic spirals."""
        modes, half = self._truth.turning, self._truth.rate / 2
        y, v = modes.about_centres(q, p)
        return np.sqrt(np.abs(modes.w2 - half * half)) * y, v + half * y

    def _turn(self, q: Reals, p: Reals, true_q: Extended, true_p: Extended) -> None:
        if not len(self._last):
            return
        (u, v), (true_u, true_v) = self._turned(q, p), self._turned(true_q, true_p)
        u, v, true_u, true_v = (x[:, self._clear] for x in (u, v, true_u, true_v))
        with np.errstate(over="ignore", invalid="ignore"):
            ahead = np.arctan2(u * true_v - v * true_u, u * true_u + v * true_v)
            # the phase is unwrapped from frame to frame, across pieces
            ahead = np.unwrap(np.concatenate([self._last[None], ahead]), axis=0)[1:]
            decayed = (self._truth.rate[self._clear] > 0) & (np.hypot(true_u, true_v) < self._least)
        self._last = ahead[-1]
        ahead = np.where(decayed, 0, ahead)
        worst = ahead.flat[int(np.argmax(np.abs(ahead)))]
        if not abs(worst) <= abs(self._phase) and not np.isnan(self._phase):
            self._phase = float(worst)


def own_motion(scene: Scene, scheme: schemes.Scheme, h: float) -> Motion | None:
    """The scheme's own motion in exact arithmetic, from which a run departs by rounding alone, at any step.

    None for an adaptive solver, and without a closed form that rounds less than the engine.
    """
    if not WIDE or not scheme.has("one-step") or scheme.has("mixes") or not scene.system.has_modes:
        return None
    modes = scene.system.modes
    if np.any((modes.w2 == 0) & (modes.pull != 0)):
        return None
    matrices = schemes.matrix(scheme, h=h, m=np.ones(1), k=modes.w2, c=modes.rate)
    # below that, friction contracts areas in one step by more than the digits of extended precision
    if np.any(schemes.rotation(matrices).determinant < CONTRACTED):
        return None
    start = modes.about_centres(scene.q, scene.p)
    symplectic = scheme.has("symplectic") and not scene.system.is_damped
    return lambda steps: modes.from_centres(
        *schemes.propagate(matrices, *start, steps, area_preserving=symplectic)
    )
