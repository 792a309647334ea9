"""Recorded states at a constant interval, with the resolution of their numbers: the observation model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify.clock import FEWEST_STATES, clock_of
from springcheck.identify.storage import ROUNDING, Storage, storage
from springcheck.physics.arrays import Extended, Floats

SIZES = 1e-75, 1e75
"""Smallest and largest magnitudes accepted: their fourth powers neither underflow nor overflow."""

THROUGH_A_PRODUCT = 14
"""Most digits of text that a product with a mass and the quotient by it leave as they were."""

LEAST = 2.0**-102
"""Smallest factor whose product with another of 2**-24 or more is a normal number of single precision."""

AT_REST = "nothing moves: at rest all schemes agree; start away from rest"
ONE_STATE = "all frames are the same state, with a velocity that is not 0: they may be one array, stored by "
ONE_STATE += "reference; store a copy in each frame"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """Positions q and velocities v (f, n) at f frames, one interval apart.

    v holds momenta, and `momenta` is set, where neither velocities nor masses are known.
    """

    interval: np.longdouble
    jitter: float
    """Relative uncertainty of the interval, from the rounding of the times."""
    clock: float
    """Rounding of a time, in intervals."""
    q: Extended
    v: Extended
    dq: Floats
    """Spacing (f, n) of the numbers that positions are written with."""
    dv: Floats
    names: tuple[str, str]
    """Storage formats of positions and velocities."""
    mass: Floats | None
    momenta: bool
    mixed: bool = False
    """Whether the numbers are combinations of recorded ones: normal modes."""

    @property
    def coarse(self) -> tuple[bool, bool]:
        """Whether positions, velocities, have fewer digits than double precision."""
        q, v = (name != "double" for name in self.names)
        return q, v

    @property
    def fine(self) -> bool:
        """Whether positions and velocities are stored in double precision."""
        return not any(self.coarse)

    @property
    def moving(self) -> list[int]:
        """Indices of the coordinates that are not at rest."""
        spread = np.ptp(self.q, axis=0) + np.ptp(self.v, axis=0) * abs(self.interval)
        return list(np.flatnonzero(spread > SIZES[0]).tolist())

    @property
    def vague(self) -> bool:
        """Whether states of double precision show the interval more exactly than the times do."""
        return self.fine and self.jitter > 1e-12 and not self.momenta

    def along(self, rows: Extended) -> Record:
        """The record of combinations (m, n) of the coordinates."""
        size = np.abs(rows.T).astype(np.float64)
        least = [2.0**-52 * np.max(np.abs(x), axis=0) for x in (self.q, self.v)]
        dq, dv = (
            np.maximum(x, y).astype(np.float64) @ size for x, y in zip((self.dq, self.dv), least, strict=True)
        )
        q, v = self.q @ rows.T, self.v @ rows.T
        return replace(self, q=q, v=v, mass=None, momenta=False, mixed=True, dq=dq, dv=dv)

    def of(self, which: list[int]) -> Record:
        """The record of some coordinates alone."""
        return replace(
            self, q=self.q[:, which], v=self.v[:, which], dq=self.dq[:, which], dv=self.dv[:, which],
            mass=None if self.mass is None else self.mass[which],
        )  # fmt: skip


def of_size(name: str, x: ArrayLike | None, n: int = 1, *, zero: bool = False) -> Floats | None:
    """Check a stated number for n coordinates, or one for each (n,).  A mass lies within `SIZES`, any other
    number within their squares, or is 0 where `zero`.  Raises IdentificationError."""
    if x is None:
        return None
    out = np.ravel(np.asarray(x, dtype=np.float64))
    of_mass = name.endswith("mass")
    least, most = SIZES if of_mass else (SIZES[0] ** 2, SIZES[1] ** 2)
    good = (least < np.abs(out)) & (np.abs(out) < most) & ((out > 0) | (not of_mass)) | ((out == 0) & zero)
    if out.size not in {1, n} or not np.all(good):
        found = f"{out[~good][0]:g}" if not np.all(good) else f"of shape {np.shape(x)}"
        each = f", or {n}," if n > 1 else ""
        above = ", above 0" if of_mass else ""
        raise IdentificationError(
            f"{name} {found}: one number{each} of a size from {least:g} to {most:g}{above}, is needed"
        )
    return np.broadcast_to(out, (n,)).copy()


def _states(x: ArrayLike, name: str, frames: int) -> Floats:
    out = np.asarray(x, dtype=np.float64)
    out = out[:, None] if out.ndim == 1 else out
    if out.ndim != 2 or out.shape[0] != frames:
        raise IdentificationError(f"{name} has shape {np.shape(x)}, and the times ({frames},)")
    if not np.all(np.isfinite(out)):
        frame = int(np.argmin(np.all(np.isfinite(out), axis=1)))
        raise IdentificationError(f"{name} is not finite in frame {frame}; give the part before it")
    return out


def times_of(t: ArrayLike) -> Floats:
    """Times (f,), checked.  Raises IdentificationError."""
    times = np.asarray(t, dtype=np.float64)
    if times.ndim != 1 or not np.all(np.isfinite(times)):
        raise IdentificationError(f"times must be one row of finite numbers; found shape {np.shape(t)}")
    if len(times) < FEWEST_STATES:
        few = f"too few states to read a map from: {len(times)}; give {FEWEST_STATES} or more"
        raise IdentificationError(few)
    return times


def read(
    t: ArrayLike, q: ArrayLike, p: ArrayLike | None, v: ArrayLike | None, mass: ArrayLike | None,
    last: Floats | None = None,
) -> Record:  # fmt: skip
    """Record of times (f,), positions, and momenta or velocities (f, n).  `last` is the unit of the last
    decimal of velocities (n,), where they were written in other units.  Raises IdentificationError."""
    times = times_of(t)
    positions = _states(q, "q", len(times))
    given = [_states(x, name, len(times)) for name, x in (("p", p), ("v", v)) if x is not None]
    for x in given:
        if x.shape != positions.shape:
            raise IdentificationError(
                f"positions have shape {positions.shape}, momenta or velocities {x.shape}: they must agree"
            )
    moving = given[-1]
    if (
        len(times) > FEWEST_STATES
        and np.any(moving)
        and not (np.ptp(positions, 0).any() or np.ptp(moving, 0).any())
    ):
        raise IdentificationError(ONE_STATE)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        clock = clock_of(times)
        pace = abs(float(clock.interval))
        sizes = {
            "times": pace, "positions": float(np.max(np.abs(positions), initial=0.0)),
            "velocities times the interval": float(np.max(np.abs(moving), initial=0.0)) * pace,
        }  # fmt: skip
    for name, size in sizes.items():
        if size and not SIZES[0] < size < SIZES[1]:
            raise IdentificationError(
                f"{name} are of the size {size:.1g}: give them in units in which that is from "
                f"{SIZES[0]:g} to {SIZES[1]:g}, or of an unstable motion the part before"
            )
    masses = _masses(positions, given, mass)
    unit = np.ones(positions.shape[1]) if v is not None or masses is None else masses
    # the start is what a program was given; what it computed shows how it computes
    computed = slice(1 if len(times) > FEWEST_STATES else 0, None)
    q_storage = storage(positions[computed])
    v_storage, dv = _of_velocities(moving, unit, computed, last)
    kept = slice(None)
    if not q_storage.name == v_storage.name == "double":
        kept = slice(_alive(positions, moving))
    return Record(
        interval=clock.interval, jitter=clock.jitter, clock=clock.quantum,
        q=positions[kept].astype(np.longdouble), v=moving[kept].astype(np.longdouble) / unit,
        dq=q_storage.quantum(positions[kept]), dv=dv[kept], names=(q_storage.name, v_storage.name),
        mass=masses, momenta=v is None and masses is None,
    )  # fmt: skip


def _masses(positions: Floats, given: list[Floats], mass: ArrayLike | None) -> Floats | None:
    """The stated masses (n,), or those that momenta and velocities give."""
    masses = of_size("mass", mass, positions.shape[1])
    if len(given) == 2 and masses is None:
        weight = np.sum(given[1] ** 2, axis=0)
        masses = np.sum(given[0] * given[1], axis=0) / np.where(weight == 0, 1.0, weight)
        masses = np.where(weight == 0, 1.0, masses)
        if np.any(masses <= 0):
            raise IdentificationError("momenta and velocities point opposite ways: one of them is wrong")
    return masses


def _of_velocities(
    moving: Floats, unit: Floats, computed: slice, last: Floats | None
) -> tuple[Storage, Floats]:
    """Storage of momenta or velocities, and the spacing of velocities (f, n)."""
    found = storage(moving[computed])
    if found.name == "double" and last is not None and np.any(last):
        return Storage(name="text, fixed decimals"), np.broadcast_to(last, moving.shape).copy()
    if found.name == "double" and np.any(unit != 1):
        # momenta made as m v from velocities in single precision or text are so only after the division
        made = moving[computed] / unit
        text = np.array([float(f"{x:.{THROUGH_A_PRODUCT}g}") for x in made.flat]).reshape(made.shape)
        found = storage(text if np.all(np.abs(text - made) <= 2 * np.spacing(np.abs(made))) else made)
        return found, found.quantum(moving / unit)
    return found, found.quantum(moving) / unit


def _alive(positions: Floats, moving: Floats) -> int:
    """Number of frames before a decaying motion underflows in products of single precision."""
    alive = np.any((np.abs(positions) >= LEAST) & (np.abs(moving) >= LEAST), axis=1)
    last = int(np.flatnonzero(alive)[-1]) if np.any(alive) else 0
    return last + 1 if last + 1 >= FEWEST_STATES else len(positions)


def strides_of(record: Record, step: float | None) -> tuple[int | None, list[str]]:
    """Steps between frames by the stated step: -1, and a note, where it does not divide the interval.  Raises
    IdentificationError."""
    if step is None:
        return None, []
    of_size("step", step)
    ratio = float(record.interval / np.longdouble(step))
    stride = round(ratio)
    room = 4 * max(stride, 1) * (record.jitter + ROUNDING)
    if room >= 0.5:
        raise IdentificationError(
            f"--step {step:g}: the time stamps are too coarse to fix the number of steps per frame "
            f"(about {ratio:.3g})"
        )
    if stride < 1 or abs(ratio - stride) > room:
        interval = float(record.interval)
        return -1, [f"the stated step {step:.9g} does not divide the states' interval {interval:.9g}"]
    return stride, []
