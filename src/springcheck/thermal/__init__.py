"""Thermostats: random schemes as data, their exact laws on springs, and what their states tell."""

from __future__ import annotations

from springcheck import schemes
from springcheck.thermal.catalogue import THERMOSTATS, Thermostat
from springcheck.thermal.laws import Law
from springcheck.thermal.stepper import Stepper

__all__ = ["THERMOSTATS", "Law", "Stepper", "Thermostat"]

for _one in THERMOSTATS.values():
    # known by name and title wherever schemes are
    schemes.bring(
        schemes.Scheme(
            name=_one.name,
            title=_one.title,
            order=0,
            limit=2.0,
            symplectic=False,
            thermostat=True,
            source=_one.source,
        )
    )
