"""Which scheme made these states?  Read from the states alone, ours or anyone's.

Pairs of states one interval apart give the map between them by least squares; where a file is coarser than
the arithmetic, the orbit of all states together does, and knows it far better.  Of its four entries one
fixes (h w)**2, and a scheme with a number of steps per frame predicts the others; the covariance of the
fit is the yardstick.  What single steps leave over names the arithmetic.

A scheme is named only where the states exclude the others.  Where they do not, all that are left are said,
with what would tell them apart.
"""

from springcheck.identify.report import identify_arrays as identify
from springcheck.identify.result import Identification
from springcheck.identify.stepper import identify_stepper

__all__ = ["Identification", "identify", "identify_stepper"]
