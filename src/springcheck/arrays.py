"""The array types that travel through springcheck, and the glossary of its letters.

Glossary, used in every module:

=====  ==========================================================================================
q, p   positions and momenta, (n,) for one state, (f, n) for a trajectory   [L], [M L/T]
m, k   mass and stiffness                                                   [M], [M/T2]
h, t   step and time                                                        [T]
w      angular frequency; w2 its square; a = (h w)**2                       [1/T]
n      particles (degrees of freedom); every motion is along one line
f      frames, the recorded states of a trajectory; frame 0 is the start
=====  ==========================================================================================

[L], [M] and [T] are the units of the scene: nm, u and ps for "md", m, kg and s for "si", and bare
numbers for "reduced".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
Extended: TypeAlias = NDArray[np.longdouble]
Reals: TypeAlias = NDArray[np.floating[Any]]
"""Real numbers of any width: what is computed comes back in the width that came in."""

ROUNDOFF = float(np.finfo(np.longdouble).eps) / 2
"""Unit roundoff of `Extended`, in which every reference is computed: 2**-64 on x86-64, 2**-53 where
`long double` is no wider than double (Apple silicon, Windows), so that references round like the engines."""

WIDE = ROUNDOFF < 2.0**-53
"""Whether a reference has digits that an engine has not."""

Integers: TypeAlias = NDArray[np.int64]
Force: TypeAlias = Callable[[Reals, Reals], Reals]
"""(q, p), each (..., n) -> force on every particle (..., n) [M L/T2]."""
