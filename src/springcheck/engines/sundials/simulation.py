"""One scene by CVODE or IDA, SUNDIALS' adaptive multistep solvers, through scikit-sundae.

A circuit is handed to IDA as the equations that Kirchhoff's laws give, unsolved for the currents.  The
unknowns of a loop are its charge q, the flux p of its coil, and the current i::

    q' = i        p' = -(voltages of its capacitors and resistors)        0 = p - L i

The last has no derivative: a differential-algebraic system of index 1, because L is not 0.

The tolerance is relative and per step.  The absolute tolerance is the same fraction of the amplitude
that the energy of the start allows each component, because q and p may differ in size by many orders
(p ~ m w q).  The Jacobian is supplied: a difference quotient would call the force behind our back.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import sksundae
from scipy.sparse import coo_array
from sksundae.cvode import CVODE
from sksundae.ida import IDA

from springcheck.engines import quiet, solvers
from springcheck.engines.contract import Label, Method, Simulation, Stopped
from springcheck.engines.solvers import timed
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene

KINDS = {"adams": "Adams", "bdf": "BDF", "ida": "IDA"}

MOST_STEPS = 1_000_000
"""Internal steps allowed between two outputs, for a motion that hardly turns in between.  The library's own
default of 500 is far too few; a motion that escapes to infinity in finite time takes as many as there are."""

STEPS_A_RADIAN = 1000
"""Internal steps allowed for every radian of the fastest rate at the start: several times what Adams' method
takes at a tolerance of 1e-15."""


def most_steps(scene: Scene, step: float) -> int:
    """Internal steps allowed between two outputs."""
    turned = solvers.turned(scene, step)
    return int(max(MOST_STEPS, min(STEPS_A_RADIAN * turned, 1e9) if np.isfinite(turned) else 0))


def version() -> dict[str, str]:
    """Versions of the wrapper and of SUNDIALS beneath it."""
    return {"scikit-sundae": sksundae.__version__, "sundials": str(sksundae.SUNDIALS_VERSION)}


def start(scene: Scene, method: Method, label: Label, step: float) -> Simulation:
    """A solver standing at the start.

    MethodError where it would not come to the first output in an hour, or cannot step there.
    """
    if abs(step) * scene.every < np.finfo(np.float64).tiny:
        raise MethodError(f"{label}: frames {abs(step) * scene.every:.0e} apart, whose inverse is no number")
    solvers.refuse_hours(scene, label, step)
    return Solver(scene, KINDS[method.name], step)


def absolute_tolerance(scene: Scene) -> Floats:
    """`scene.tolerance` times the amplitude of each component of (q, p) at the energy of the start (2n,)."""
    found = scene.tolerance * np.concatenate(scene.system.amplitudes)
    # a component that never moves needs a weight too; any will do
    return np.asarray(np.where(found > 0, found, scene.tolerance))


LARGE = 32
"""Particles above which the sparse solver is taken; below, the dense one is faster."""

MOST_ALIKE = 1e3
"""Ratio of stiffnesses up to which they may be summed in one matrix: three digits are lost then.  A soft
spring next to a stiff one would lose more, and is evaluated spring by spring."""


def _suits_matrix(scene: Scene) -> bool:
    """Whether the right-hand side may be one matrix product, five times as fast for a few particles."""
    if not scene.system.is_linear or scene.n > 32:
        return False
    held = [term.rigidity for term in scene.terms if term.kind == "potential"]
    k = np.abs(np.concatenate(held or [np.ones(1)]))
    return bool(np.max(k) <= MOST_ALIKE * np.min(k))


def _matrix(scene: Scene) -> tuple[Floats, Floats]:
    """Slope (2n, 2n) and constant part (2n,) of the right-hand side of a linear scene."""
    zero = np.zeros(scene.n)
    return scene.system.jacobian(zero), np.concatenate([zero, scene.system.force(zero, zero)])


def _sparse(scene: Scene) -> dict[str, Any]:
    """What CVODE needs for a Jacobian of a large scene by its elements that are not 0: cost grows with the
    springs, not the cube."""
    n = scene.n
    rows, columns = [np.arange(n), n + np.arange(n)], [n + np.arange(n)] * 2
    for i, j, _ in scene.system.elements(scene.q):
        rows.append(n + i)
        columns.append(j)
    by_place = scene.system.brakes_by_place
    if by_place:
        rows.append(n + np.arange(n))
        columns.append(np.arange(n))
    where = np.concatenate(rows).astype(np.int32), np.concatenate(columns).astype(np.int32)
    constant: list[Reals] = [1 / scene.m, -scene.system.friction_rates.astype(np.float64)]

    def matrix(values: Reals) -> Any:
        # elements of the same place are added up, in the order of columns that SuperLU takes
        return coo_array((values, where), shape=(2 * n, 2 * n)).tocsc()

    def jacobian(t: float, y: Floats, yp: Floats, out: Floats) -> None:
        values = [*constant, *(-k for *_, k in scene.system.elements(y[:n]))]
        if by_place:
            rate, bend = scene.system.friction_at(y[:n])
            values[1] = -rate
            values.append(-bend * y[n:])
        out[:] = matrix(np.concatenate(values)).data

    pattern = matrix(np.ones(len(where[0])))
    pattern.data[:] = 1
    return {"linsolver": "sparse", "sparsity": pattern, "jacfn": jacobian}


def _circuit(scene: Scene, atol: Floats, called: Callable[[float], None]) -> IDA:
    """IDA standing at the start, its vector (q, p, i).  `atol` is of (q, p); `called` gets every t asked."""
    n, m = scene.n, scene.m
    force = scene.system.force
    stiffness = np.asarray(scene.system.hessian(scene.q), np.float64)
    resistance = np.asarray(scene.system.friction_rates * m, np.float64)
    one = np.eye(n)

    def residual(t: float, y: Floats, yp: Floats, out: Floats) -> None:
        called(t)
        q, p, i = y[:n], y[n : 2 * n], y[2 * n :]
        out[:n] = yp[:n] - i
        out[n : 2 * n] = yp[n : 2 * n] - force(q, m * i)
        out[2 * n :] = p - m * i

    def jacobian(t: float, y: Floats, yp: Floats, out: Floats, cj: float, matrix: Floats) -> None:
        matrix[:n, :n], matrix[:n, 2 * n :] = cj * one, -one
        matrix[n : 2 * n, :n], matrix[n : 2 * n, n : 2 * n] = stiffness, cj * one
        matrix[n : 2 * n, 2 * n :] = np.diag(resistance)
        matrix[2 * n :, n : 2 * n], matrix[2 * n :, 2 * n :] = one, -np.diag(m)

    pull = force(scene.q, scene.p)
    found = IDA(
        residual, rtol=scene.tolerance, atol=np.concatenate([atol, atol[n:] / m]), jacfn=jacobian,
        algebraic_idx=list(range(2 * n, 3 * n)), max_num_steps=MOST_STEPS,
    )  # fmt: skip
    current = scene.p / m
    found.init_step(
        0.0, np.concatenate([scene.q, scene.p, current]), np.concatenate([current, pull, pull / m])
    )
    return found


class Solver:
    """CVODE, stepped from output to output.  Outputs between internal steps are interpolated by CVODE."""

    def __init__(self, scene: Scene, method: str, step: float) -> None:
        self.force_calls = 0
        n, m = scene.n, scene.m
        force, slopes = timed(scene)
        as_matrix = _suits_matrix(scene)
        slope, pull = _matrix(scene) if as_matrix else (np.empty(0), np.empty(0))
        pulled = bool(np.any(pull))

        def by_terms(t: float, y: Floats, yp: Floats) -> None:
            self._called(t)
            q, p = y[:n], y[n:]
            yp[:n] = p / m
            yp[n:] = force(t, q, p)

        def by_matrix(t: float, y: Floats, yp: Floats) -> None:
            self._called(t)
            np.dot(slope, y, out=yp)
            if pulled:
                np.add(yp, pull, out=yp)

        def jacobian(t: float, y: Floats, yp: Floats, jacobian: Floats) -> None:
            jacobian[:] = slope if as_matrix else slopes(t, y[:n], y[n:])

        self._n, self._step, self._done = n, step, 0
        atol = absolute_tolerance(scene)
        if method == "IDA":
            self._solver = _circuit(scene, atol, self._called)
            return
        with warnings.catch_warnings():
            # scikit-sundae warns that our Jacobian replaces its own, as is intended
            warnings.filterwarnings("ignore", message="Custom sparse Jacobian", category=UserWarning)
            self._solver = CVODE(
                by_matrix if as_matrix else by_terms,
                method=method,
                rtol=scene.tolerance,
                atol=atol,
                max_num_steps=most_steps(scene, step),
                **({"jacfn": jacobian} if n <= LARGE else _sparse(scene)),
            )
        self._solver.init_step(0.0, np.concatenate([scene.q, scene.p]))

    def _called(self, t: float) -> None:
        self.force_calls += 1

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        n, take, step, done = self._n, self._solver.step, self._step, self._done
        failure = ""
        states: list[Floats] = []
        # SUNDIALS' logger prints on standard output, where results go
        with quiet.caught(1) as said:
            for _ in range(len(q)):
                done += every
                try:
                    result = take(done * step)
                    failure = "" if result.success else str(result.message)
                except RuntimeError as error:
                    failure = str(error)
                if failure:
                    break
                states.append(result.y)
        self._done = done
        if states:
            # one copy for all rows: slicing each row would cost a twentieth of an easy step
            rows = np.array(states)
            q[: len(rows)], p[: len(rows)] = rows[:, :n], rows[:, n : 2 * n]
        if failure:
            raise Stopped(len(states), " ".join(" ".join([failure, *said]).split()))
