"""Which scheme made these states, or what is wrong with them?  Read from the states alone, anyone's.

A hypothesis is a row (`rows`, `catalogue`): a scheme or a mistake, its free numbers, a way of recording, and
its sentence.  One score (`compare`, `arithmetic`) holds all rows against the map between frames that is
measured (`record` with `clock` and `storage`, `measure`, `modes`).  `search` tries them, the simplest first.
Where none is left, `explain` asks tables of causes: `repairs`, `frames`, `laws`, and the class of the map
(`unknown`).  `say` (with `factors`) makes every sentence, `result` holds the answer; `report` leads through
all of it.  Next to it stand `positions` for files without velocities, `bath`, `steps` for a scene whose force
is known, `files` and `stepper` for what commands get.
"""

from springcheck.identify.report import identify_arrays as identify
from springcheck.identify.result import Identification
from springcheck.identify.stepper import identify_stepper

__all__ = ["Identification", "identify", "identify_stepper"]
