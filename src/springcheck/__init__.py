"""springcheck: simulation engines judged to rounding by a mass on a spring.

>>> import springcheck
>>> scene = springcheck.load_scene("spring")
>>> run = springcheck.simulate(scene, "own:semi-implicit-euler")
>>> run
Trajectory('own:semi-implicit-euler', 201 frames, 1 particle, t = 0 to 20, complete)
>>> all(verdict.passed for verdict in springcheck.judge(scene, run) if verdict.passed is not None)
True

`run` does the whole job, as the command does; `simulate` runs one method.  Each name is imported when it is
first used.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from springcheck import plot
    from springcheck.api import compare, exact, judge, read, run
    from springcheck.physics.builders import chain, spring
    from springcheck.physics.scene import Scene
    from springcheck.physics.scenefile import load_scene
    from springcheck.physics.trajectory import Trajectory, Verdict

__version__ = "0.1.0"

__all__ = [
    "Scene", "Trajectory", "Verdict", "__version__", "chain", "compare", "exact", "identify", "judge",
    "load_scene", "plot", "read", "run", "simulate", "spring",
]  # fmt: skip

_HOMES = {
    "Scene": "physics.scene",
    "Trajectory": "physics.trajectory",
    "Verdict": "physics.trajectory",
    "chain": "physics.builders",
    "compare": "api",
    "exact": "api",
    "judge": "api",
    "load_scene": "physics.scenefile",
    "read": "api",
    "run": "api",
    "spring": "physics.builders",
}
_MODULES = {"identify", "simulate"}
"""Modules that are called as the public function of their name, which stands in `api`."""


class _Function(ModuleType):
    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.__wrapped__(*arguments, **named)

    @property
    def __wrapped__(self) -> Any:
        """The function, for `help` and signatures."""
        from springcheck import api

        return getattr(api, self.__name__.rpartition(".")[2])


class _Package(ModuleType):
    def __setattr__(self, name: str, value: Any) -> None:
        if name in _MODULES and isinstance(value, ModuleType):
            value.__class__ = _Function
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name in _MODULES or name == "plot":
        return import_module(f"{__name__}.{name}")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
