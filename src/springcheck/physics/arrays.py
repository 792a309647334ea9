"""The array types that travel through springcheck, how numbers are rounded, and the glossary of its letters.

Glossary, used in every module:

=====  ==========================================================================================
q, p   positions and momenta, (n,) for one state, (f, n) for a trajectory   [L], [M L/T]
m, k   mass and stiffness                                                   [M], [M/T2]
h, t   step and time                                                        [T]
w      angular frequency; w2 its square; a = (h w)**2                       [1/T]
n      coordinates (degrees of freedom), each along one axis; on a line one for each particle
f      frames, the recorded states of a trajectory; frame 0 is the start
=====  ==========================================================================================

[L], [M] and [T] are the units of the scene: nm, u and ps for "md", m, kg and s for "si", and bare
numbers for "reduced".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import SceneError

Floats: TypeAlias = NDArray[np.float64]
Extended: TypeAlias = NDArray[np.longdouble]
Reals: TypeAlias = NDArray[np.floating[Any]]
"""Real numbers of any width; results have the width of the arguments."""

ROUNDOFF = float(np.finfo(np.longdouble).eps) / 2
"""Unit roundoff of `Extended`, in which every reference is computed: 2**-64 on x86-64, 2**-53 where
`long double` is no wider than double (Apple silicon, Windows), so that references round like the engines."""

EPS = 2 * ROUNDOFF
"""Spacing of the numbers above 1 in extended precision: 1.1e-19 on x86-64."""

WIDE = ROUNDOFF < 2.0**-53
"""Whether references have more digits than engines."""

Integers: TypeAlias = NDArray[np.int64]
Force: TypeAlias = Callable[[Reals, Reals], Reals]
"""(q, p), each (..., n) -> force on every particle (..., n) [M L/T2]."""

States: TypeAlias = tuple[Extended, Extended]
"""q and p in extended precision."""


def wide(x: Any) -> Extended:
    """Doubles in extended precision."""
    return np.asarray(x, np.longdouble)


Class = TypeVar("Class")


def by_identity(kind: type[Class]) -> type[Class]:
    """Class decorator: an object equals itself alone.

    A NamedTuple would compare its fields one by one, and the comparison of arrays has no single truth value.
    """
    for name in ("__eq__", "__ne__", "__hash__"):
        setattr(kind, name, getattr(object, name))
    return kind


def told(words: str, default: Any = None) -> Any:
    """A field of a dataclass, and how `worded` states a value other than its default."""
    return field(default=default, metadata={"words": words})


def worded(record: Any) -> str:
    """The fields of a dataclass made by `told` that differ from their defaults, in words."""
    known = ((one, getattr(record, one.name)) for one in fields(record) if "words" in one.metadata)
    return ", ".join(one.metadata["words"].format(x) for one, x in known if x != one.default)


AS_WRITTEN = "as written"
"""Name of the arithmetic of numbers in a file, whose digits are read from the numbers themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Arithmetic:
    """How a platform rounds.  The defaults are IEEE double precision throughout."""

    name: str = "double"
    state: float = told("states to {:.2g}", 2.0**-53)
    """Unit roundoff of stored positions and momenta."""
    force: float = told("forces to {:.2g}", 2.0**-53)
    """Unit roundoff of the force."""
    quantum: float = told("forces in units of {:.2g}", 0.0)
    """Quantum of fixed-point forces [M L/T2], to which each term's force on a particle is truncated."""
    overflow: float = float("inf")
    """Largest force that the fixed-point sum holds."""
    parameters: Literal["double", "single"] = told("parameters in {} precision", "double")
    """Precision in which force constants and rest lengths are stored."""
    excess: float = told("every force {:.2g} too large", 0.0)
    """Relative excess of every force."""
    stale: float = told("forces reused within {:.2g}", 0.0)
    """Largest displacement since a force was computed for which the engine reuses it [L]."""
    cancels: int = told("coefficients of the bath from 1 - exp(-friction h) as a difference", 0)
    """Power of 1/x, x = gamma h, or of x above 1, in the relative rounding of a thermostat's coefficients,
    from 1 - c with a rounded c."""
    keeps_displacement: bool = False
    """Whether a velocity rebuilt over the step comes from the stored displacement, not from x' - x."""
    from_start: bool = told("positions stored as displacements from the start", False)
    """Whether positions are stored as displacements from the start, as total Lagrangian elements do."""
    joints: bool = told("springs as joints whose lengths are rounded", False)
    """Whether springs are joints of length `System.far`, whose rounding each force has."""
    written: Any = field(default=((), ()), compare=False)
    """Half a unit of the last decimal of recorded positions and momenta (2, n); empty where these are not
    rounded to decimals.  It bounds what a recording adds to states that were computed with more digits."""

    @property
    def is_double(self) -> bool:
        """Whether states are computed and recorded in double precision."""
        return self.state <= 2.0**-53 and not np.any(self.written)

    def recorded(self, m: Reals, h: float, rebuilt: bool) -> Extended:
        """`written` of these masses (2, n).  Momenta that are differences of positions over a step h may have
        been made of recorded ones (`rebuilt`)."""
        out, given = np.zeros((2, len(m)), np.longdouble), np.asarray(self.written)
        # a clock beside the particles is exact
        out[:, : given.shape[1]] = given
        if rebuilt and not self.keeps_displacement:
            out[1] += 2 * m * out[0] / abs(h)
        return out

    @property
    def unit(self) -> float:
        """The larger of both unit roundoffs."""
        return max(self.state, self.force)

    def __str__(self) -> str:
        """Departures from double precision, in words; "" where there are none."""
        return worded(self)


MOST_NUMBERS = 1 << 21
"""Most numbers of rows of terms that are computed at a time: 32 MB in extended precision."""


def in_pieces(law: Callable[..., Reals], rows: int, *more: Reals) -> Callable[[Reals, Reals], Reals]:
    """A law of states (q, p, *more), each (..., n), evaluated on as many states at once as memory allows.

    Without this, 200 frames of 200,000 springs on one particle would take 1.5 GB of intermediate results.
    """

    def bounded(q: Reals, p: Reals) -> Reals:
        if q.ndim == 1:
            return law(q, p, *more)
        given = (q, p, *more)
        count = q.size // q.shape[-1]
        if count == 1 or count * rows <= MOST_NUMBERS or any(x.shape != q.shape for x in given):
            return law(*given)
        each = max(1, MOST_NUMBERS // rows)
        flat = [x.reshape(count, -1) for x in given]
        found = np.concatenate([law(*(x[i : i + each] for x in flat)) for i in range(0, count, each)])
        return found.reshape(*q.shape[:-1], *found.shape[1:])

    return bounded


def reals(where: str, **given: Any) -> list[Floats]:
    """Copies of the arguments as doubles.  SceneError for anything but real numbers, none of them masked."""
    found = []
    for name, x in given.items():
        try:
            found.append(np.array(float("no") if np.iscomplexobj(x) or is_masked(x) else x, np.float64))
        except (TypeError, ValueError, OverflowError):
            raise SceneError(f"{where}: {name}: real numbers, or an array of them, are needed") from None
    return found


def is_masked(given: Any) -> bool:
    """Whether values of a masked array are masked, which have no number."""
    return bool(np.any(getattr(given, "_mask", False)))


def roundoff(*given: Any) -> float:
    """Unit roundoff of the narrowest of these arrays, that of a double at least."""
    kinds = [np.asarray(x).dtype for x in given]
    return float(max([2.0**-53, *(np.finfo(kind).eps / 2 for kind in kinds if kind.kind == "f")]))
