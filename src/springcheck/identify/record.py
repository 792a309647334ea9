"""What was recorded: states at a constant interval, and how finely their numbers were written down."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.physics.arrays import Extended, Floats

ROUNDING = 2.0**-53

FEWEST = 5
"""Frames: four pairs leave one number to spare above the three unknowns of each row of the map."""

LEAST = 2.0**-102
"""Smallest number of which single precision keeps all 24 digits in products with others of up to 2**24."""

SIZES = 1e-75, 1e75
"""Sizes of numbers whose fourth powers are numbers of double precision still."""

ADDED_UP = 64
"""Roundings of a clock that adds up its steps from frame to frame, half of one for each."""

SAMPLE = 500
"""Values whose decimal form is looked at; fewer than all of a long file, spread evenly over it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Storage:
    """How numbers were written down: `name` ("double", "single", "text, 6 digits"), and how finely."""

    name: str = "double"
    digits: int = 0
    """Significant decimal digits; 0 where the numbers are not decimal text of that kind."""
    decimals: int | None = None
    """Digits after the point, where that is what is constant."""

    def quantum(self, x: Floats) -> Floats:
        """Distance of neighbouring numbers around x that the storage can hold."""
        if self.decimals is not None:
            return np.full(x.shape, 10.0**-self.decimals)
        if self.digits:
            size = np.where(x == 0, 1.0, np.abs(x))
            return np.where(x == 0, 0.0, 10.0 ** (np.floor(np.log10(size)) - self.digits + 1))
        if self.name == "single":
            return np.spacing(np.abs(x).astype(np.float32)).astype(np.float64)
        return np.asarray(np.spacing(np.abs(x)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """Positions q and velocities v (f, n) of n oscillators, one interval apart.

    Where only momenta are known and no mass is, v holds the momenta and `mass` is None with `momenta` set.
    """

    interval: np.longdouble
    jitter: float
    """Relative uncertainty of the interval, from the rounding of the recorded times."""
    clock: float
    """Rounding of the recorded times, in intervals."""
    slips: Extended | None
    """Relative excess (f - 1,) of each interval over the mean, None where times are coarse or even."""
    q: Extended
    v: Extended
    q_quantum: Floats
    v_quantum: Floats
    q_storage: Storage
    v_storage: Storage
    mass: Floats | None
    momenta: bool
    parts: tuple[Floats, Floats] | None = None
    """Sizes (f, n) of what positions and velocities are sums of, where they are normal modes: their
    rounding is relative to these."""

    @property
    def fine(self) -> bool:
        """Whether all numbers have the digits of double precision."""
        return self.q_storage.name == self.v_storage.name == "double"

    def quanta(self, j: int) -> Floats:
        """Distance of neighbouring numbers around each state (f, 2) of an oscillator, on (q, v interval)."""
        return np.stack([self.q_quantum[:, j], self.v_quantum[:, j] * abs(float(self.interval))], axis=1)

    @property
    def text(self) -> bool:
        """Whether some numbers were written as decimal text of few digits."""
        return any(x.name.startswith("text") for x in (self.q_storage, self.v_storage))


def storage(x: Floats) -> Storage:
    """How x was written down, from the numbers themselves."""
    values = np.ravel(x)
    values = values[values != 0]
    if len(np.unique(np.abs(values))) < FEWEST - 1:
        return Storage()
    with np.errstate(over="ignore", under="ignore"):
        rounded = values.astype(np.float32).astype(np.float64)
    # a unit conversion in double precision leaves the numbers within an ulp of single ones
    single = bool(np.all(np.abs(rounded - values) <= 2.0**-51 * np.abs(values)))
    sample = [float(y) for y in values[np.linspace(0, len(values) - 1, min(len(values), SAMPLE)).astype(int)]]

    def same(text: str, y: float) -> bool:
        return bool(np.float32(text) == np.float32(y)) if single else float(text) == y

    most = 7 if single else 9
    digits = next((d for d in range(1, most + 1) if all(same(f"{y:.{d - 1}e}", y) for y in sample)), 0)
    decimals = next((d for d in range(most) if all(same(f"{y:.{d}f}", y) for y in sample)), None)
    found = [Storage(name=f"text, {digits} digits", digits=digits)] if digits else []
    if decimals is not None:
        found.append(Storage(name=f"text, {decimals} decimals", decimals=decimals))
    # text that is finer than the numbers around it says nothing: every number has such a decimal form
    values = np.array(sample)
    binary = Storage(name="single" if single else "double").quantum(values)
    found = [text for text in found if np.all(text.quantum(values) >= 2 * binary)]
    if found:
        # both can hold the numbers; the coarser of the two leaves less to chance.  A power of ten has its
        # neighbours below it ten times as close as those above
        below = values * (1 - 2.0**-40)
        return max(found, key=lambda s: float(np.mean(np.log10(s.quantum(below)))))
    return Storage(name="single") if single else Storage()


def _interval(t: Floats) -> tuple[np.longdouble, float, float, Extended | None]:
    """The interval of times t (f,), its relative uncertainty, the rounding of t in intervals, and the
    relative excess of each interval where double precision shows it."""
    wide = t.astype(np.longdouble)
    interval = (wide[-1] - wide[0]) / (len(t) - 1)
    if interval == 0:
        raise IdentificationError("all times are equal: the interval between the states is unknown")
    off = np.abs(np.diff(wide) - interval)
    worst = int(np.argmax(off))
    even = float(np.max(np.spacing(np.abs(t))))
    # 0.5, 1.0, 1.5 are multiples of a round step, not times that were cut to one decimal, and those of a
    # float32 clock are not text: the finest of the grids that the times lie on explains them
    single = bool(np.all(t.astype(np.float32) == t))
    grids = [even]
    grids += [float(np.max(np.spacing(np.abs(t).astype(np.float32))))] if single else []
    grids.append(float(np.max(storage(t).quantum(t))))
    # two rounded times make a difference, and a clock that adds its step up rounds once more each time
    quantum = next((x for x in grids if off[worst] <= 4 * x), None)
    quantum = even if quantum is None and off[worst] <= ADDED_UP * even else quantum
    if quantum is None:
        raise IdentificationError(
            f"the states are not at a constant interval: frames {worst} and {worst + 1} are "
            f"{float(wide[worst + 1] - wide[worst]):.9g} apart, the mean is {float(interval):.9g}; "
            "give a part of the trajectory with one interval"
        )
    jitter = quantum / abs(float(wide[-1] - wide[0])) + 2.0**-53
    slips = None
    if quantum == even and float(off[worst]) > 2 * ROUNDING * abs(float(interval)):
        slips = np.asarray(np.diff(wide) / interval - 1)
    elif quantum != even:
        # a program's step is a short decimal, and a coarse clock leaves room for it
        near = (float(f"{float(interval):.{digits}g}") for digits in range(1, 8))
        interval = np.longdouble(
            next((x for x in near if abs(x / float(interval) - 1) <= jitter), float(interval))
        )
    return interval, jitter, quantum / abs(float(interval)), slips


def _states(x: ArrayLike, name: str, frames: int) -> Floats:
    out = np.asarray(x, dtype=np.float64)
    if out.ndim == 1:
        out = out[:, None]
    if out.ndim != 2 or out.shape[0] != frames:
        raise IdentificationError(f"{name} has shape {np.shape(x)}, but there are {frames} times")
    if not np.all(np.isfinite(out)):
        frame = int(np.argmin(np.all(np.isfinite(out), axis=1)))
        raise IdentificationError(f"{name} is not finite in frame {frame}; give the part before it")
    return out


def _alive(positions: Floats, moving: Floats) -> int:
    """Frames until a motion has died down so far that single precision keeps no relative precision of it.

    From there on products underflow, and what is left is no scheme's step any more.
    """
    alive = np.any((np.abs(positions) >= LEAST) & (np.abs(moving) >= LEAST), axis=1)
    last = int(np.flatnonzero(alive)[-1]) if np.any(alive) else 0
    return last + 1 if last + 1 >= FEWEST else len(positions)


def of_size(name: str, x: ArrayLike | None, n: int = 1, *, zero: bool = False) -> Floats | None:
    """A number that is stated of n oscillators, or of each (n,): a mass of `SIZES`, or what may be a product
    of two, and 0 where that says something.  Raises IdentificationError."""
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
    t: ArrayLike, q: ArrayLike, p: ArrayLike | None, v: ArrayLike | None, mass: ArrayLike | None
) -> Record:
    """Check and order what a caller has: times (f,), positions, and momenta or velocities or both (f, n)."""
    times = np.asarray(t, dtype=np.float64)
    if times.ndim != 1 or not np.all(np.isfinite(times)):
        raise IdentificationError(f"times must be one row of finite numbers; found shape {np.shape(t)}")
    if len(times) < FEWEST:
        raise IdentificationError(
            f"{len(times)} states are too few to read a map from; give {FEWEST} or more"
        )
    if p is None and v is None:
        raise IdentificationError(
            "positions alone do not show the scheme; give momenta or velocities as well"
        )
    positions = _states(q, "q", len(times))
    given = [_states(x, name, len(times)) for name, x in (("p", p), ("v", v)) if x is not None]
    for x in given:
        if x.shape != positions.shape:
            raise IdentificationError(
                f"positions have shape {positions.shape}, momenta or velocities {x.shape}: they must agree"
            )
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        interval, jitter, clock, slips = _interval(times)
        sizes = {
            "times": abs(float(interval)),
            "positions": float(np.max(np.abs(positions), initial=0.0)),
            "velocities": float(np.max(np.abs(given[-1]), initial=0.0) * abs(float(interval))),
        }
    for name, size in sizes.items():
        if size and not SIZES[0] < size < SIZES[1]:
            way = " times the interval" if name == "velocities" else ""
            raise IdentificationError(
                f"{name}{way} are of the size {size:.1g}: give them in units in which that is from "
                f"{SIZES[0]:g} to {SIZES[1]:g}"
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
    computed = slice(1 if len(times) > FEWEST else 0, None)
    q_storage, v_storage = storage(positions[computed]), storage(moving[computed])
    if v is None and masses is not None and v_storage.name == "double":
        # momenta made as m v from single-precision velocities are single only after the division
        velocities = storage(moving[computed] / masses)
        v_storage = velocities if velocities.name == "single" else v_storage
        quantum = v_storage.quantum(moving / masses)
    else:
        quantum = v_storage.quantum(moving) / unit.astype(np.float64)
    finely = q_storage.name == v_storage.name == "double"
    kept = slice(None if finely else _alive(positions, moving))
    return Record(
        interval=interval,
        jitter=jitter,
        clock=clock,
        slips=None if slips is None or not finely else slips,
        q=positions[kept].astype(np.longdouble),
        v=moving[kept].astype(np.longdouble) / unit,
        q_quantum=q_storage.quantum(positions[kept]),
        v_quantum=quantum[kept],
        q_storage=q_storage,
        v_storage=v_storage,
        mass=masses,
        momenta=v is None and masses is None,
    )


def stated_stride(record: Record, step: float | None, notes: list[str]) -> int | None:
    """Steps to a frame of a stated step; -1, and a note, where it does not divide the interval."""
    if step is None:
        return None
    of_size("step", step)
    ratio = float(record.interval / np.longdouble(step))
    stride = round(ratio)
    if stride < 1 or abs(ratio - stride) > 4 * stride * (record.jitter + ROUNDING):
        notes.append(
            f"the stated step {step:.9g} does not divide the states' interval {float(record.interval):.9g}"
        )
        return -1
    return stride
