"""Recorded states at a constant interval, checked, with the resolution of their numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify.clock import FEWEST_STATES, clock_of
from springcheck.identify.storage import BINARY, ROUNDING, Storage, storage
from springcheck.physics.arrays import Extended, Floats

LEAST = 2.0**-102
"""Smallest factor whose product with another of 2**-24 or more is a normal number of single precision."""

DEEP = 2.0**-30
"""Resolution of a file, relative to its largest number, that resolves the roundings of single precision."""

SIZES = 1e-75, 1e75
"""Smallest and largest magnitudes accepted: their fourth powers neither underflow nor overflow."""


THROUGH_A_PRODUCT = 14
"""Most digits of text that a product with a mass and the quotient by it leave as they were."""

AT_REST = "nothing moves: at rest all schemes agree; start away from rest"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """Positions q and velocities v (f, n) of n coordinates at f frames, one interval apart.

    v holds momenta, and `momenta` is set, where neither velocities nor masses are known.
    """

    interval: np.longdouble
    jitter: float
    """Relative uncertainty of the interval, from the rounding of the recorded times."""
    clock: float
    """Rounding of the recorded times, in intervals."""
    unlike: float
    """The part of it that steps may have: decimals are those of a file."""
    deviations: Extended | None
    """Relative deviation (f - 1,) of each interval from the mean; None where times are coarse or even."""
    q: Extended
    v: Extended
    q_quantum: Floats
    v_quantum: Floats
    q_storage: Storage
    v_storage: Storage
    mass: Floats | None
    momenta: bool
    parts: tuple[Floats, Floats] | None = None
    """Sums (f, n) of the absolute values of the terms of positions and velocities, where these are normal
    modes: their rounding is relative to these sums."""
    rough: bool = False
    """Whether errors of forces that are as small as those of single precision need not be noise."""

    @property
    def fine(self) -> bool:
        """Whether positions and velocities are stored in double precision."""
        return self.q_storage.name == self.v_storage.name == "double"

    @property
    def moving(self) -> list[int]:
        """Indices of the coordinates that are not at rest."""
        spread = np.ptp(self.q, axis=0) + np.ptp(self.v, axis=0) * abs(self.interval)
        return list(np.flatnonzero(spread > SIZES[0]).tolist())

    def quanta(self, j: int) -> Floats:
        """Spacing of the representable numbers around each state (f, 2) of coordinate j, on (q, v T)."""
        return np.stack([self.q_quantum[:, j], self.v_quantum[:, j] * abs(float(self.interval))], axis=1)

    def sigma(self, j: int) -> Floats:
        """Standard error (f, 2) of the recorded states (q, v T) of coordinate j from their storage; 0 in
        double precision, whose rounding is part of the arithmetic."""
        coarse = [self.q_storage.name != "double", self.v_storage.name != "double"]
        return np.asarray(self.quanta(j) * coarse / np.sqrt(12.0))

    def summed(self, j: int) -> Floats:
        """Size (f, 2) to which the rounding of each state (q, v T) of coordinate j is relative: its own, or
        the sum of the absolute values of its terms."""
        q, v = self.parts or (np.abs(self.q).astype(np.float64), np.abs(self.v).astype(np.float64))
        return np.stack([q[:, j], v[:, j] * abs(float(self.interval))], axis=1)

    @property
    def deep(self) -> bool:
        """Whether the states resolve single precision's roundings: `fine`, or text of enough digits."""
        pairs = ((self.q, self.q_quantum), (self.v, self.v_quantum))
        return self.fine or all(
            bool(np.max(quantum) <= DEEP * np.max(np.abs(x))) and x_storage.name not in BINARY
            for (x, quantum), x_storage in zip(pairs, (self.q_storage, self.v_storage), strict=True)
        )

    @property
    def vague(self) -> bool:
        """Whether the states show the interval more exactly than the times do: these are no double precision,
        whose deviations steps may follow, and not even."""
        return self.fine and self.deviations is None and self.jitter > 2.0**-50

    @property
    def text(self) -> bool:
        """Whether positions or velocities are decimal text."""
        return any(x.name.startswith("text") for x in (self.q_storage, self.v_storage))


def _states(x: ArrayLike, name: str, frames: int) -> Floats:
    out = np.asarray(x, dtype=np.float64)
    if out.ndim == 1:
        out = out[:, None]
    if out.ndim != 2 or out.shape[0] != frames:
        raise IdentificationError(f"{name} has shape {np.shape(x)}, and the times ({frames},)")
    if not np.all(np.isfinite(out)):
        frame = int(np.argmin(np.all(np.isfinite(out), axis=1)))
        raise IdentificationError(f"{name} is not finite in frame {frame}; give the part before it")
    return out


def _alive(positions: Floats, moving: Floats) -> int:
    """Number of frames before a decaying motion underflows in products of single precision; later states
    follow no scheme's step."""
    alive = np.any((np.abs(positions) >= LEAST) & (np.abs(moving) >= LEAST), axis=1)
    last = int(np.flatnonzero(alive)[-1]) if np.any(alive) else 0
    return last + 1 if last + 1 >= FEWEST_STATES else len(positions)


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


def read(
    t: ArrayLike,
    q: ArrayLike,
    p: ArrayLike | None,
    v: ArrayLike | None,
    mass: ArrayLike | None,
    last: Floats | None = None,
) -> Record:
    """Record of times (f,), positions, and momenta or velocities (f, n).  `last` is the unit of the last
    decimal of velocities (n,), where they were written in other units.  Raises IdentificationError."""
    times = np.asarray(t, dtype=np.float64)
    if times.ndim != 1 or not np.all(np.isfinite(times)):
        raise IdentificationError(f"times must be one row of finite numbers; found shape {np.shape(t)}")
    if len(times) < FEWEST_STATES:
        raise IdentificationError(
            f"too few states to read a map from: {len(times)}; give {FEWEST_STATES} or more"
        )
    positions = _states(q, "q", len(times))
    given = [_states(x, name, len(times)) for name, x in (("p", p), ("v", v)) if x is not None]
    for x in given:
        if x.shape != positions.shape:
            raise IdentificationError(
                f"positions have shape {positions.shape}, momenta or velocities {x.shape}: they must agree"
            )
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        clock = clock_of(times)
        interval = clock.interval
        sizes = {
            "times": abs(float(interval)),
            "positions": float(np.max(np.abs(positions), initial=0.0)),
            "velocities times the interval": float(np.max(np.abs(given[-1]), initial=0.0))
            * abs(float(interval)),
        }
    for name, size in sizes.items():
        if size and not SIZES[0] < size < SIZES[1]:
            raise IdentificationError(
                f"{name} are of the size {size:.1g}: give them in units in which that is from "
                f"{SIZES[0]:g} to {SIZES[1]:g}, or of an unstable motion the part before"
            )
    masses = of_size("mass", mass, positions.shape[1])
    if p is not None and v is not None and masses is None:
        weight = np.sum(given[1] ** 2, axis=0)
        masses = np.sum(given[0] * given[1], axis=0) / np.where(weight == 0, 1.0, weight)
        masses = np.where(weight == 0, 1.0, masses)
        if np.any(masses <= 0):
            raise IdentificationError("momenta and velocities point opposite ways: one of them is wrong")
    moving = given[-1]
    unit = np.ones(positions.shape[1], dtype=np.longdouble)
    if v is None and masses is not None:
        unit = masses.astype(np.longdouble)
    # the start is what a program was given; only what it computed shows how it computes
    computed = slice(1 if len(times) > FEWEST_STATES else 0, None)
    q_storage, v_storage = storage(positions[computed]), storage(moving[computed])
    if v is not None and last is not None and np.any(last) and v_storage.name == "double":
        v_storage, quantum = Storage(name="text, fixed decimals"), np.broadcast_to(last, moving.shape)
        v_storage = q_storage if q_storage.decimals is not None else v_storage
    elif v is None and masses is not None and v_storage.name == "double":
        # momenta made as m v from velocities in single precision or text are so only after the division
        made = moving[computed] / masses
        text = np.array([float(f"{x:.{THROUGH_A_PRODUCT}g}") for x in made.flat]).reshape(made.shape)
        v_storage = storage(text if np.all(np.abs(text - made) <= 2 * np.spacing(np.abs(made))) else made)
        quantum = v_storage.quantum(moving / masses)
    else:
        quantum = v_storage.quantum(moving) / unit.astype(np.float64)
    finely = q_storage.name == v_storage.name == "double"
    kept = slice(None if finely else _alive(positions, moving))
    return Record(
        interval=interval,
        jitter=clock.jitter,
        clock=clock.quantum,
        unlike=clock.unlike,
        deviations=clock.deviations if finely else None,
        q=positions[kept].astype(np.longdouble),
        v=moving[kept].astype(np.longdouble) / unit,
        q_quantum=q_storage.quantum(positions[kept]),
        v_quantum=quantum[kept],
        q_storage=q_storage,
        v_storage=v_storage,
        mass=masses,
        momenta=v is None and masses is None,
    )


def stated(
    record: Record, stiffness: ArrayLike | None, friction: float | None, step: float | None
) -> tuple[Floats | None, int | None, list[str]]:
    """Stated stiffness (n,), and steps between frames by the stated step: -1, and a note, where it does not
    divide the interval.  Raises IdentificationError."""
    stiff = of_size("stiffness", stiffness, record.q.shape[1], zero=True)
    of_size("friction", friction, zero=True)
    if step is None:
        return stiff, None, []
    of_size("step", step)
    ratio = float(record.interval / np.longdouble(step))
    stride = round(ratio)
    if 4 * stride * (record.jitter + ROUNDING) >= 0.5:
        raise IdentificationError(
            f"--step {step:g}: {ratio:.3g} of them to a frame are more than the times can tell from one more"
        )
    if stride < 1 or abs(ratio - stride) > 4 * stride * (record.jitter + ROUNDING):
        interval = float(record.interval)
        note = f"the stated step {step:.9g} does not divide the states' interval {interval:.9g}"
        return stiff, -1, [note]
    return stiff, stride, []
