"""springcheck: simulation engines judged to rounding by a mass on a spring.

>>> import springcheck
>>> scene = springcheck.load_scene("spring")
>>> run = springcheck.run(scene, "own:semi-implicit-euler")
>>> run.t.shape, run.q.shape, run.p.shape
((201,), (201, 1), (201, 1))

`load_scene` reads a scene, `run` moves it by one method, `read` opens a store, `judge` gives verdicts.
What they return is described in `springcheck.trajectory`.  Each is imported when it is first used.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes longer to import than all else here
if TYPE_CHECKING:
    from typing import Any

    from springcheck.checks import judge
    from springcheck.physics.scenefile import load_scene
    from springcheck.simulate import run
    from springcheck.studies.keeper import read

__all__ = ["judge", "load_scene", "read", "run"]

_HOMES = {
    "judge": "checks",
    "load_scene": "physics.scenefile",
    "read": "studies.keeper",
    "run": "simulate",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
