"""A scheme as the list of operations that the kernels carry out.

A splitting is such a list already: neighbouring kicks and drifts are joined.  Explicit Euler is one
operation; any other explicit tableau is carried out as it is, and has none.  A tableau with one implicit
stage is a step of implicit Euler before or after an explicit one:

* implicit Euler: IMPLICIT(h);
* the trapezoidal rule: EULER(h/2), IMPLICIT(h/2), because its last stage is its result;
* the implicit midpoint: P of IMPLICIT(h/2) is half way, so p' = 2 P - p and q' = q + h P/m.  The force at
  the middle is not used: its rounding would be multiplied by h k, which a stiff spring makes large.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from springcheck.engines.own import kernels
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.schemes import Scheme, number

ALL, POTENTIAL, SLOW, FAST = "all", "potential", "slow", "fast"


class NoKernelError(Exception):
    """A scheme of fixed step that the kernels do not have: its stages, or the equations of its stages."""


class Operation(NamedTuple):
    """One operation of a step: `x` and `y` are times, `force` names what kicks."""

    code: int
    x: float = 0.0
    y: float = 0.0
    force: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Program:
    """A step as operations, or as an explicit tableau by all terms."""

    operations: tuple[Operation, ...] = ()
    a: Floats = field(default_factory=lambda: np.empty((0, 0)))
    """Rows of the tableau times the step, the weights last; none where there is no tableau."""
    forces: tuple[str, ...] = (ALL,)
    damped: tuple[bool, ...] = (False, False)
    """Whether each force depends on the momenta."""

    @property
    def stages(self) -> int:
        """Stages of the tableau, or operations: proportional to the time of a step."""
        return self.a.shape[1] or len(self.operations)

    @property
    def implicit_step(self) -> float:
        """x of the implicit operations, 0 where there is none."""
        return next((o.x for o in self.operations if o.code in (kernels.IMPLICIT, kernels.MIDPOINT)), 0.0)

    @property
    def decays(self) -> tuple[float, ...]:
        """x of the frictions, in the order of their rows."""
        return tuple(o.x for o in self.operations if o.code == kernels.FRICTION)

    @property
    def arrays(self) -> tuple[Integers, Integers, Floats, Floats]:
        """Code, slot (the index of its force, or of its row of decays), x and y of each operation."""
        frictions = iter(range(len(self.operations)))
        slots = [
            next(frictions) if o.code == kernels.FRICTION else self.forces.index(o.force) if o.force else 0
            for o in self.operations
        ]
        codes = np.array([o.code for o in self.operations], np.int64)
        x, y = (np.array([getattr(o, name) for o in self.operations], np.float64) for name in "xy")
        return codes, np.array(slots, np.int64), x, y


def evaluations(scheme: Scheme, scene: Scene) -> tuple[int, int]:
    """Evaluations of forces in the first step, and in each later one: none where nothing has changed that a
    force depends on."""
    if not scheme.stages:
        return len(scheme.b), len(scheme.b)
    fresh: set[str] = set()
    counts, braked = [0, 0], scene.system.is_damped
    for cycle in range(2):
        for kind in scheme.kinds:
            name = POTENTIAL if kind.evaluates == ALL and not braked else kind.evaluates
            counts[cycle] += name not in (*fresh, "")
            fresh.add(name)
            fresh -= fresh if kind.drifts else {ALL, SLOW} if braked else set()
    return counts[0], counts[1]


def program(scheme: Scheme, scene: Scene, h: float) -> Program:
    """The operations of a step of length h.

    Raises:
        MethodError: an adaptive scheme, or a random one.
        NoKernelError: the kernels lack a stage of the scheme.
    """
    if scheme.has("random") or not scheme.has("one-step"):
        raise MethodError(f"own: the scheme {scheme.name} has no fixed step that can be repeated")
    clock = (Operation(code=kernels.SET_CLOCK, x=h),) if scene.system.is_driven else ()
    if scheme.stages:
        found = _splitting(scheme, h)
    elif scheme.has("implicit"):
        found = _implicit(scheme, h)
    elif len(scheme.b) == 1:
        found = (Operation(code=kernels.EULER, x=h, y=h, force=ALL),)
    else:
        s = len(scheme.b)
        a = np.zeros((s + 1, s))
        for i, row in enumerate((*scheme.a, scheme.b)):
            a[i, : len(row)] = [float(number(c, np.float64) * h) for c in row]
        return Program(operations=clock, a=a)
    damped = scene.system.is_damped
    if not damped:
        without = (o for o in found if o.code != kernels.FRICTION)
        found = tuple(o._replace(force=POTENTIAL) if o.force == ALL else o for o in without)
    forces = tuple(dict.fromkeys(o.force for o in found if o.force))
    if len(forces) > 2:
        raise NoKernelError(f"{len(forces)} groups of forces; at most two can be compiled")
    depends = tuple(damped and name in (ALL, SLOW) for name in (*forces, "", "")[:2])
    return Program(operations=(*clock, *found), forces=forces or (ALL,), damped=depends)


def _splitting(scheme: Scheme, h: float) -> tuple[Operation, ...]:
    found: list[Operation] = []
    for kind, (_, c) in zip(scheme.kinds, scheme.stages, strict=True):
        x = float(number(c, np.float64) * h)
        if kind.decay:
            found.append(Operation(code=kernels.FRICTION, x=x))
        elif kind.evaluates and kind.kicks:
            found.append(Operation(code=kernels.KICK, x=x, force=kind.evaluates))
        elif not kind.drifts:
            raise NoKernelError(f"a stage that is not served: {kind.name}")
        elif found and found[-1].code == kernels.KICK:
            found[-1] = found[-1]._replace(code=kernels.KICK_DRIFT, y=x)
        else:
            found.append(Operation(code=kernels.DRIFT, y=x))
    return tuple(found)


def _implicit(scheme: Scheme, h: float) -> tuple[Operation, ...]:
    a, b = scheme.a, scheme.b
    s = len(b)
    x = float(number(a[-1][s - 1], np.float64) * h)
    explicit = all(not c for row in a[:-1] for c in row)
    if explicit and s <= 2 and tuple(a[-1]) == tuple(b):
        first = float(number(a[-1][0], np.float64) * h)
        before = (Operation(code=kernels.EULER, x=first, y=first, force=ALL),) if s == 2 else ()
        return (*before, Operation(code=kernels.IMPLICIT, x=x, y=x, force=POTENTIAL))
    if s == 1 and b[0] == 1 and a[0][0] * 2 == 1:
        return (Operation(code=kernels.MIDPOINT, x=x, y=h, force=POTENTIAL),)
    raise NoKernelError("implicit stages that are not solved by factors")


def terms_of(force: str, scene: Scene) -> tuple[Term, ...]:
    """The terms behind the name of a force."""
    if force == POTENTIAL:
        return tuple(term for term in scene.terms if term.kind in ("potential", "drive"))
    return {ALL: scene.terms, SLOW: scene.system.slow, FAST: scene.system.fast}[force]
