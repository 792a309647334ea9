"""Engines broken on purpose: the package's own negative controls and its detection limits."""

from __future__ import annotations

from springcheck.faults.seeded import Fault
from springcheck.faults.table import FAULTS
from springcheck.faults.trial import ENGINES, FaultReport, Result, examine, study

__all__ = ["ENGINES", "FAULTS", "Fault", "FaultReport", "Result", "examine", "study"]
