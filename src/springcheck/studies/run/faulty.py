"""An engine broken on purpose among the others, for the classroom: --fault."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from springcheck import schemes
from springcheck.errors import MethodError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Outcome, Trajectory, of_scene

if TYPE_CHECKING:
    from springcheck.studies.keeper import Draft

FAULT = "fault"
"""Engine name in the labels of engines broken on purpose."""

MOST_NUMBERS = 10**7
"""Most steps times particles of a run with a fault: Python loops record it in memory."""


def _same(x: float, scene: Scene, q: Floats, p: Floats) -> tuple[Floats, Floats]:
    return q, p


def _scaled(name: str) -> Callable[..., Scene]:
    return lambda x, scene: replace(scene, **{name: getattr(scene, name) * (1 + x)})


def _single(x: float, scene: Scene, values: Floats, *_: Any) -> Floats:
    return values.astype(np.float32).astype(np.float64)


def _early(x: float, scene: Scene, q: Floats, p: Floats) -> tuple[Floats, Floats]:
    before = np.asarray(p - scene.step / 2 * scene.system.force(q, p), np.float64)
    return q, np.concatenate([p[:1], before[1:]])


def _exchanged(x: float, scene: Scene, q: Floats, p: Floats) -> tuple[Floats, Floats]:
    order = np.arange(len(q))
    order[[len(q) // 2, len(q) // 2 + 1]] = order[[len(q) // 2 + 1, len(q) // 2]]
    return q[order], p[order]


def _digits(x: float, scene: Scene, q: Floats, p: Floats) -> tuple[Floats, Floats]:
    return tuple(np.vectorize(lambda y: float(f"{y:.9g}"))(y) for y in (q, p))


@dataclass(frozen=True, slots=True)
class Fault:
    """A correct engine but for its hooks, which are given its size and the scene first."""

    name: str
    about: str
    size: float | None = None
    """Size by default; None where it has none."""
    _: KW_ONLY
    scheme: str = "velocity-verlet"
    """The scheme that it claims."""
    runs: str = ""
    """The scheme that it runs instead."""
    scene: Callable[..., Scene] = lambda x, scene: scene
    """The scene that it moves."""
    force: Callable[..., Floats] = lambda x, scene, force, q, p: force
    """Size, scene, correct force, q, p -> its force."""
    after: Callable[..., tuple[Floats, Floats]] = _same
    """Size, scene, q, p after a correct step -> the next q, p."""
    reports: Callable[..., tuple[Floats, Floats]] = _same
    """Size, scene, all q, p -> those that it reports."""


FAULTS = (
    Fault("stiffness", "every spring is too stiff", 1e-12, scene=lambda x, s: s.system.scaled(1 + x)),
    Fault("mass", "every mass is too large", 1e-12, scene=_scaled("m")),
    Fault("step", "every step is too long", 1e-12, scene=_scaled("step")),
    Fault("friction", "momenta lose a fraction in each step", 1e-12,
          after=lambda x, s, q, p: (q, p * (1 - x))),
    Fault("heating", "positions gain a fraction in each step", 1e-12,
          after=lambda x, s, q, p: (q * (1 + x), p)),
    Fault("momentum-for-velocity", "dq/dt = p; a mass of 1 hides it",
          scene=lambda x, s: replace(s, m=np.ones(s.n))),
    Fault("single-force", "forces in single precision", force=_single),
    Fault("single-state", "positions and momenta in single precision",
          after=lambda x, s, q, p: (_single(x, s, q), _single(x, s, p))),
    Fault("explicit-for-semi-implicit", "explicit Euler under the name of semi-implicit Euler",
          runs="explicit-euler", scheme="semi-implicit-euler"),
    Fault("first-order", "semi-implicit Euler under the name of velocity Verlet", runs="semi-implicit-euler"),
    Fault("position-for-velocity-verlet", "position Verlet under the name of velocity Verlet",
          runs="position-verlet"),
    Fault("early-momenta", "momenta half a step early, reported as synchronised", reports=_early),
    Fault("swapped-frames", "two frames have changed places", reports=_exchanged),
    Fault("text-file", "states are written with 9 digits", reports=_digits),
)  # fmt: skip
"""The faults of the classroom; the tests have more."""


@dataclass(frozen=True, slots=True)
class Broken:
    """A fault, with its own size or another."""

    fault: Fault
    size: float | None

    @property
    def label(self) -> str:
        """Label of its trajectory."""
        return f"{FAULT}:{self.fault.name}"

    @property
    def about(self) -> str:
        """The fault and its size."""
        return self.fault.about + (f" ({self._size:.0e})" if self._size else "")

    @property
    def _size(self) -> float:
        return (self.fault.size if self.size is None else self.size) or 0.0

    def made(self, scene: Scene) -> Trajectory:
        """Its trajectory of a scene, up to the last finite state."""
        one, x = self.fault, self._size
        q, p = np.empty((2, scene.frames, scene.n))
        a, b = q[0], p[0] = scene.q, scene.p
        moved = one.scene(x, scene)
        wide, scheme = moved.system.clocked, schemes.SCHEMES[one.runs or one.scheme]
        law = schemes.Law(scheme=scheme, scene=wide, h=moved.step)
        force = lambda q, p: one.force(x, scene, wide.system.force(q, p), q, p)  # noqa: E731
        given: dict[str, Any] = {"h": moved.step, "m": wide.m, "force": force, "stiffness": law.stiffness}
        given |= {"parts": wide.system.parts, "rate": law.rate}
        with np.errstate(all="ignore"):
            for i in range(1, scene.steps + 1):
                # the clock of a drive
                time = (i - 1) * moved.step
                y = (np.append(a, time), np.append(b, wide.p[scene.n :])) if len(wide.m) > scene.n else (a, b)
                a, b = (np.asarray(z[: scene.n], np.float64) for z in schemes.step(scheme, *y, **given))
                a, b = one.after(x, scene, a, b)
                if i % scene.every == 0:
                    q[i // scene.every], p[i // scene.every] = a, b
            q, p = one.reports(x, scene, q, p)
            good = np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1)
            f = len(q) if good.all() else int(np.argmin(good))
            energy = np.asarray(scene.system.energy(q[:f], p[:f]), np.float64)
        ended = Outcome(status="complete" if f == len(q) else "diverged", step=(f - 1) * scene.every)
        return of_scene(
            scene, q[:f], p[:f], label=self.label, scheme=one.scheme, outcome=ended, off_axis=0.0,
            energy=energy if "energy" in scene.quantities else None, force_calls=scene.steps,
        )  # fmt: skip

    def play(self, scene: Scene, draft: Draft) -> None:
        """Record it.  MethodError where it does not apply to the scene."""
        from springcheck.studies.keeper import attributes

        option = f"--fault {self.fault.name}"
        if scene.bath is not None:
            raise MethodError(f"{option}: it needs a scene without a heat bath")
        if scene.steps * scene.n > MOST_NUMBERS:
            raise MethodError(f"{option}: {scene.steps} steps are too many for it")
        made, right = self.made(scene), Broken(Fault("", "", scheme=self.fault.scheme), None).made(scene)
        if np.array_equal(made.q, right.q) and np.array_equal(made.p, right.p):
            raise MethodError(f"{option}: scene {scene.name} shows nothing of it; spring-uneven does")
        draft.append(made.t, made.q, made.p, made.energy)
        origin = {"engine": "broken on purpose", "method": self.about, "velocity": "as it says"}
        draft.finish(attributes(replace(made, origin=origin)))


def broken(text: str) -> Broken:
    """The fault of NAME or NAME=SIZE.  MethodError, with all names, where there is none."""
    name, equals, size = text.partition("=")
    found = {fault.name: fault for fault in FAULTS}.get(name)
    if found is None:
        raise MethodError(f"--fault {name}: the faults are {', '.join(fault.name for fault in FAULTS)}")
    if not equals:
        return Broken(found, None)
    try:
        value = float(size)
    except ValueError:
        value = math.nan
    if found.size is None or not (math.isfinite(value) and value > 0):
        needed = "it has no size" if found.size is None else "a size above 0 is needed"
        raise MethodError(f"--fault {text}: {needed}")
    return Broken(found, value)
