"""What an identification says, as frozen data and as a JSON document."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

NONE = "none (adaptive or unknown)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """What the states say.  Rows of numbers hold one for each oscillator that moves.

    `fits` is true where a known scheme explains every step to the rounding of a known arithmetic, and what
    was stated (mass, stiffness, step) agrees with it.
    """

    scheme: str
    aliases: tuple[str, ...]
    """Other names of the same map: on a spring nothing can tell them apart."""
    candidates: tuple[str, ...]
    """Schemes that this trajectory does not exclude, "name" or "name, s steps a frame"."""
    step: float
    """[T]; negative where time runs backwards."""
    stride: int
    """Steps from frame to frame."""
    omega: tuple[float, ...]
    """True angular frequency sqrt(k/m), not that of the discrete motion; NaN for an inverted spring [1/T]."""
    stiffness: tuple[float, ...] | None
    """[M/T2]; None where no mass is known."""
    friction: tuple[float, ...]
    """Rate c/m [1/T]."""
    velocity_offset: float
    """Time of the velocities after that of the positions, in steps."""
    determinant: tuple[float, ...]
    """Of the measured map, for one step."""
    symplectic_defect: float
    """Largest |M^T J M - J| of the measured map between frames."""
    defect_ulp: float
    """Largest departure of one recorded step from the scheme's, in units of 2**-52 of the terms' sizes."""
    precision: str
    fits: bool
    nearest: str
    """The scheme itself, or where none fits the one whose entries are closest."""
    difference: tuple[float, ...]
    """Measured less predicted entries M11, M12, M21, M22 on (q, v T) between frames; first oscillator."""
    notes: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """For JSON: numbers for one oscillator, lists for several, null for what is not known."""

        def plain(x: Any) -> Any:
            if isinstance(x, float):
                return x if math.isfinite(x) else None
            return [plain(y) for y in x] if isinstance(x, tuple) else x

        out = {name: plain(x) for name, x in asdict(self).items()}
        for name in ("omega", "stiffness", "friction", "determinant"):
            if out[name] is not None and len(out[name]) == 1:
                out[name] = out[name][0]
        return out
