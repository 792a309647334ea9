"""springcheck's own methods, interpreted where a run is short and compiled where it is long.

numba is imported only for a run that is worth it (see `WORTH`).  The numbers are the same either way,
to the last bit, so a machine without numba, or with a cache folder that cannot be written, gets them too.

A scene with a term that the loops do not have is carried through the same steps by NumPy.  In a long run the
loops do it, with the term's own slope compiled (`laws`); an exponential may then differ by a rounding.
"""

from __future__ import annotations

import platform
import sys
from typing import Any

import numpy as np

import springcheck
from springcheck import schemes
from springcheck.engines.contract import Label, Method
from springcheck.engines.own import kernels, laws, layout, loops, solver, vectors
from springcheck.engines.own.job import Job, with_room
from springcheck.engines.own.operations import NoKernelError, Program, evaluations, program, terms_of
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.schemes import Scheme

WORTH = 1_000_000
"""Spring-steps from which on compiling pays.  Interpreted, one takes 0.1 us, recorded 0.3 us; importing numba
takes 0.15 s, loading cached code 5 ms, compiling it the first time 1 to 4 s."""


WORTH_A_LAW = 200_000
"""Calls of the force from which on compiling a term's slope pays: NumPy takes 25 us each, compiling 1 s, and
the first time 4 s more for the kernel."""


class Own:
    """A started run of an own method: `how` fills rows, `compiled` says whether by a compiled kernel.

    `note` says of a long run why it is not compiled.
    """

    def __init__(
        self, how: Job | vectors.Vectors, calls: tuple[int, int], *, compiled: bool, note: str = ""
    ) -> None:
        self.compiled, self.note = compiled, note
        self._first, self._each = calls
        self._steps = 0
        self._how = how

    @property
    def force_calls(self) -> int:
        """Number of force evaluations so far."""
        return self._steps and self._first + (self._steps - 1) * self._each

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n); overflow fills in inf and nan, silently."""
        self._how.advance(every, q, p)
        self._steps += every * len(q)


def version() -> dict[str, str]:
    """Versions of this package, the interpreter and NumPy, and of numba where it has compiled something."""
    found = {
        "springcheck": springcheck.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
    return found | ({"numba": sys.modules["numba"].__version__} if "numba" in sys.modules else {})


def start(scene: Scene, method: Method, label: Label, step: float, seed: Any = None) -> Own | Any:
    """Start a run of `scene.steps` steps of length `step`; compiles here where that pays."""
    if method.generator:
        from springcheck.engines.own.thermal import Random

        return Random(scene, method.scheme, step, seed)
    return prepare(scene, method.scheme, step)


def prepare(
    scene: Scene,
    scheme: str | Scheme,
    step: float,
    *,
    compiled: bool | None = None,
) -> Own:
    """Like `start`, by any scheme; `compiled` forces the kernel either way, by default the length decides.

    Forced, a missing numba is an ImportError; otherwise the interpreted kernel serves, or NumPy.
    """
    found = schemes.scheme(scheme) if isinstance(scheme, str) else scheme
    calls = evaluations(found, scene)
    with np.errstate(all="ignore"):
        try:
            plan = program(found, scene, float(step))
        except NoKernelError:
            plan = None
        apart = plan is None or _lacks(plan, scene)
        others = [] if apart else [term for term in scene.terms if term.key not in loops.KINDS]
        note = ""
        if others:
            long = max(calls) * scene.steps >= WORTH_A_LAW if compiled is None else compiled
            whys = {term.key: laws.obstacle(term, scene.q) for term in others if long}
            note = "; ".join(f"{key} is not compiled ({why})" for key, why in whys.items() if why)
            compiled, apart = True, bool(note) or not long
        if plan is None or apart:
            return Own(vectors.Vectors(found, scene, step), calls, compiled=False, note=note)
        scene = scene.system.clocked
        job = _one(plan, scene) or _many(plan, scene)
    if compiled or (compiled is None and job.work * scene.steps >= WORTH):
        try:
            return Own(job.compiled, calls, compiled=True)
        except ImportError:
            if compiled:
                raise
    return Own(job.interpreted, calls, compiled=False)


def _lacks(plan: Program, scene: Scene) -> bool:
    """Whether the loops cannot solve for a term, or next to one that depends on the time would sum forces or
    compute them in another way than NumPy."""
    keys = {term.key for term in scene.terms}
    if plan.implicit_step:
        return not keys <= {"wall-spring", "spring", "damping"}
    beside = "morse" in keys or any(term.fast for term in scene.terms)
    return scene.system.is_driven and beside


def _one(plan: Program, scene: Scene) -> Job | None:
    """One particle on one spring at rest in 0."""
    walls = [term for term in scene.terms if isinstance(term, WallSpring)]
    if scene.n > 1 or len(walls) != 1 or len(scene.terms) != 1 or len(walls[0]) != 1 or walls[0].at[0] != 0:
        return None
    if any(o.force not in ("", "all", "potential") for o in plan.operations):
        return None
    k, m = float(walls[0].k[0]), float(scene.m[0])
    state = np.array(scene.q, np.float64), np.array(scene.p, np.float64)
    divisor = float(solver.factors(scene, plan.implicit_step)[0][0])
    code, _, x, y = plan.arrays
    v, f = np.zeros((2, plan.a.shape[1]))
    head = (code, x, y, plan.a, v, f), (divisor, m, k)
    return Job(kernel=kernels.single, arguments=(*head, *state), n=1, work=plan.stages)


def _many(plan: Program, scene: Scene) -> Job:
    """Any terms: as a row where they allow it, as index lists otherwise."""
    n = scene.n
    terms = [terms_of(name, scene) for name in plan.forces]
    slots = layout.slots(terms, scene.m)
    work = float(sum(n + sum(len(term) for term in some) for some in terms))
    m, q, p = (np.array(x, dtype=np.float64) for x in (scene.m, scene.q, scene.p))
    solved = solver.factors(scene, plan.implicit_step) if plan.implicit_step else solver.NONE
    rates = scene.system.friction_rates.astype(np.float64)
    # without friction a force stays as the clock is set, which moves it by a rounding alone
    damped = np.array(plan.damped) | (scene.system.is_driven and scene.system.is_damped)
    decays = np.array([np.exp(-x * rates) for x in plan.decays] or np.empty((0, n)))
    head = (*plan.arrays, damped, decays, plan.a), *(slots * 2)[:2], solved
    arguments = with_room(head, m, q, p, plan.a.shape[1])
    return Job(kernel=kernels.many, arguments=arguments, n=n, work=work * plan.stages)
