"""SciPy's `solve_ivp` methods, at the scene's tolerance, relative and for each component alike.

The solvers are stepped as `solve_ivp` steps them, and read by their dense output; they are run by name alone.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from springcheck.engines import solvers
from springcheck.engines.contract import (
    BRAKES,
    DRIVEN,
    EVERY_FORCE,
    EVERY_KIND,
    Engine,
    Label,
    Method,
    Stopped,
    by_name,
    named,
    version_of,
)
from springcheck.engines.solvers import timed
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.schemes import solver

SOLVERS = {
    "rk45": ("RK45", "Dormand-Prince 5(4), adaptive", "Dormand & Prince, J. Comput. Appl. Math. 6 (1980) 19"),
    "dop853": ("DOP853", "DOP853, order 8, adaptive", "Hairer, Norsett & Wanner, Solving ODEs I, II.5"),
    "radau": ("Radau", "Radau IIA, order 5, adaptive", "Hairer & Wanner, Solving ODEs II, IV.8"),
    "bdf": ("BDF", "quasi-constant step BDF, orders 1-5",
            "Shampine & Reichelt, SIAM J. Sci. Comput. 18 (1997) 1"),
    "lsoda": ("LSODA", "LSODA, Adams and BDF by turns",
              "Petzold, SIAM J. Sci. Stat. Comput. 4 (1983) 136"),
}  # fmt: skip
"""SciPy's class of each method, its title, and its source."""

EXPLICIT_SOLVERS = ("RK45", "DOP853")

SMALLEST_TOLERANCE = 100 * np.finfo(np.float64).eps
"""Smallest relative tolerance that SciPy takes; it raises smaller ones to this."""


MOST_CALLS, MOST_A_STEP = 100_000, 2_000
"""Force calls, some seconds, from which on a run stops that takes so many of them in each step."""


class _Solver:
    """An `OdeSolver` in motion."""

    def __init__(self, scene: Scene, method: Method, label: Label, step: float) -> None:
        from scipy import integrate

        name, *_ = SOLVERS[method.name]
        solvers.refuse_hours(scene, label, step, explicit=name in EXPLICIT_SOLVERS)
        self.force_calls = 0
        self._n, self._h, self._done = scene.n, step, 0
        n, m, system = scene.n, scene.m, scene.system
        force, jacobian = timed(scene)

        def slope(t: float, y: Floats) -> Floats:
            self.force_calls += 1
            return np.concatenate([y[n:] / m, force(t, y[:n], y[n:])])

        sizes = np.concatenate(system.amplitudes)
        options: dict[str, Any] = {
            "rtol": max(scene.tolerance, SMALLEST_TOLERANCE),
            "atol": scene.tolerance * np.where(sizes > 0, sizes, 1.0),
        }
        if name not in EXPLICIT_SOLVERS:
            options["jac"] = lambda t, y: jacobian(t, y[:n], y[n:])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self._solver = getattr(integrate, name)(
                slope, 0.0, np.concatenate([scene.q, scene.p]), scene.steps * step, **options
            )
        self._dense: Any = None

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        solver, n = self._solver, self._n
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            for row in range(len(q)):
                t = (self._done + every) * self._h
                while abs(solver.t) < abs(t) and solver.status == "running":
                    if self.force_calls > max(MOST_CALLS, MOST_A_STEP * (self._done + every)):
                        of = self.force_calls // (self._done + every)
                        raise Stopped(row, f"{of:,} force calls a step: too many at this tolerance; use "
                                           "shorter steps, or a larger tolerance")  # fmt: skip
                    message = solver.step()
                    self._dense = None
                    if solver.status == "failed":
                        raise Stopped(row, " ".join(str(message).split()))
                if solver.t == t:
                    y = solver.y
                else:
                    self._dense = self._dense or solver.dense_output()
                    y = self._dense(t)
                q[row], p[row] = y[:n], y[n:]
                self._done += every


ENGINE = Engine(
    name="scipy",
    title="SciPy",
    reference="P. Virtanen et al., SciPy 1.0, Nature Methods 17, 261 (2020), doi:10.1038/s41592-019-0686-2",
    distribution="scipy",
    methods=named(
        *(
            by_name(
                name, f"scipy-{name}", f"scipy.integrate.{its_class}, as solve_ivp steps it",
                EVERY_FORCE | DRIVEN | BRAKES, adaptive=True, kinds=EVERY_KIND,
            )
            for name, (its_class, *_) in SOLVERS.items()
        )
    ),
    schemes=tuple(solver(f"scipy-{x}", title, source) for x, (_, title, source) in SOLVERS.items()),
    start=_Solver,
    version=version_of("scipy"),
    any_axis=True,
)  # fmt: skip
