"""springcheck: simulation engines judged to rounding by a mass on a spring.

>>> import springcheck
>>> scene = springcheck.load_scene("spring")
>>> run = springcheck.simulate(scene, "own:semi-implicit-euler")
>>> run
Trajectory('own:semi-implicit-euler', 201 frames, 1 particle, t = 0 to 20, complete)
>>> all(verdict.passed for verdict in springcheck.judge(scene, run) if verdict.passed is not None)
True

`run` does the whole job, as the command does; `simulate` runs one method, or your own function.  Each study
is a function too.  Each name is imported when it is first used.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from springcheck import plot

    # isort: off
    from springcheck.api import (
        compare, exact, explain, extremes, identify, judge, methods, precision, read, report, run, sampling,
        simulate, stability,
    )  # fmt: skip

    # isort: on
    from springcheck.physics.builders import chain, spring
    from springcheck.physics.scene import Scene
    from springcheck.physics.scenefile import load_scene
    from springcheck.physics.trajectory import Trajectory, Verdict

__version__ = "0.1.0"

__all__ = [
    "Scene", "Trajectory", "Verdict", "__version__", "chain", "compare", "exact",
    "explain", "extremes", "identify", "judge", "load_scene", "methods", "plot", "precision",
    "read", "report", "run", "sampling", "simulate", "spring", "stability",
]  # fmt: skip

_HOMES = {
    "Scene": "physics.scene", "Trajectory": "physics.trajectory", "Verdict": "physics.trajectory",
    "chain": "physics.builders", "load_scene": "physics.scenefile", "spring": "physics.builders",
}  # fmt: skip
"""Modules of the names that are not in `api`."""


class _Package(ModuleType):
    """A package whose `identify` is the function, also after an import of the package of that name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "identify" or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name == "plot":
        return import_module(f"{__name__}.{name}")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES.get(name, 'api')}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
