"""Which scheme made these states?  Read from the states alone, ours or anyone's.

Pairs of states one interval apart give the map between them by least squares; where a file is coarser than
the arithmetic, the orbit of all states together gives it far more precisely.  Of its four entries one
fixes (h w)**2, and a scheme with a number of steps per frame predicts the others; the covariance of the
fit is the yardstick.  The residuals of single steps give the arithmetic.

A scheme is named only where the states exclude the others.  Where they do not, all that are left are named,
with what would tell them apart.

The way of the data, in the order in which to read it; `report` leads through all of it:

* `record` (with `clock`, `storage`) checks what was written; `judged` picks what can be judged;
* `fit` (`noise`) measures the map between frames;
* `families` lists the maps of schemes and mistakes, `maps` evaluates many at once; `search` says which are
  tried in turn; `guesses` and `compare` hold them against the measured map, which leaves a `hypothesis` or
  excludes it; of what is left `arithmetic` (`coarse`) has to explain every step;
* `named` (`candidates`, `notes`) says what the hypotheses that are left mean, `result` holds it;
* where none is left `explain` asks for causes: `driven`, `interrupted`, `misplaced`, `unknown`, `wrong`.

Beside it stand `positions` (`recurrence`) for files without velocities, `together` for several
coordinates of one motion, `thermal` for baths, `files` and `stepper` for what commands get.
"""

from springcheck.identify.report import identify_arrays as identify
from springcheck.identify.result import Identification
from springcheck.identify.stepper import identify_stepper

__all__ = ["Identification", "identify", "identify_stepper"]
