"""Thermostats: random schemes as data, their exact laws on springs, and the inference of them from states.

A scene without a bath needs their names alone: all but the catalogue is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from springcheck import schemes
from springcheck.bath.catalogue import THERMOSTATS, Thermostat

if TYPE_CHECKING:
    from springcheck.bath import draws, evidence, rounding
    from springcheck.bath.laws import Law
    from springcheck.bath.stepper import Stepper

__all__ = ["THERMOSTATS", "Law", "Stepper", "Thermostat", "draws", "evidence", "rounding"]

_LATER = {"Law": "laws", "Stepper": "stepper"} | {x: x for x in __all__ if x.islower()}
"""Names that no run without a bath needs, and the modules that they are imported from on first use."""


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = import_module(f"{__name__}.{_LATER[name]}")
    return home if name == _LATER[name] else getattr(home, name)


for _one in THERMOSTATS.values():
    # known wherever schemes are
    schemes.bring(_one)
