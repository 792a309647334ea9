"""Frames at uneven times: every step is compared with a scheme's step of its own length."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from springcheck.identify.catalogue import PLAIN, capital, title, titles
from springcheck.identify.record import of_size
from springcheck.identify.result import Candidate, Explanation, Identification, nothing
from springcheck.identify.storage import ROUNDING, storage
from springcheck.identify.tables import table
from springcheck.physics.arrays import Floats
from springcheck.text.wording import either

FEWEST, OF_STIFFNESS = 12, 1e-7
"""Fewest frames, and the relative difference of stiffnesses that agree."""

SHARES = (0.5, 1.0, 0.25, 0.75, 2.0, 1.5, 4.0)
"""First guesses of the step that was taken in place of an interval, over it."""

NOT_SCALED = (
    "The step changes, and the positions are moved on by the last displacement as it was: of Stoermer-Verlet "
    "x - x_before has to be scaled by the new step over the old one"
)
NOW_SCALED = "Stoermer-Verlet, each displacement scaled where the step changes"


def of_uneven(t: Any, q: Any, p: Any, v: Any, mass: Any, stiffness: Any) -> Identification | None:
    """Identification of states of oscillators at uneven times; None where no scheme's steps are seen.  Raises
    IdentificationError for a mass or a stiffness of another size."""
    times = np.asarray(t, np.float64)
    positions = np.reshape(np.asarray(q, np.float64), (len(times), -1))
    h, n = np.diff(times), positions.shape[1]
    if len(times) < FEWEST or not np.all(h > 0):
        return None
    weights = of_size("mass", mass, n)
    m, spring = np.ones(n) if weights is None else weights, of_size("stiffness", stiffness, n, zero=True)
    k = None if weights is None or spring is None or not np.all(spring) else spring / m
    moving = [j for j in range(n) if np.ptp(positions[:, j])]
    if p is None and v is None:
        said = [_of_positions(positions[:, j], h) for j in moving]
        return nothing([said[0]]) if said and said[0] and said.count(said[0]) == len(said) else None
    speeds = np.reshape(np.asarray(p if v is None else v, np.float64), positions.shape)
    speeds = speeds / m if v is None else speeds
    each = [_Steps(times, positions[:, j], speeds[:, j]) for j in moving]
    names = [one.taken(None if k is None else float(k[j])) for j, one in zip(moving, each, strict=True)]
    kept = [x for x in (names[0] if names else {}) if all(x in y for y in names)]
    if kept and k is not None:
        ratio = max((y[kept[0]] / k[j] for j, y in zip(moving, names, strict=True)), key=lambda x: abs(x - 1))
        if abs(ratio - 1) > OF_STIFFNESS:
            cause = f"{titles(kept)}, in steps of uneven length, but of a spring {ratio:.9g} times as stiff"
            return nothing([Explanation(f"{cause} as stated", local=True)], n)
    if kept:
        return _named(kept, names, m[moving], mass is not None)
    clipped = [one.of_another_step() for one in each]
    first = clipped[0] if clipped else None
    return nothing([first], n) if first and all(clipped) else None


def _named(kept: list[str], names: list[dict[str, float]], m: Floats, weighed: bool) -> Identification:
    each = tuple(
        Candidate(
            scheme=x, aliases=(), stride=1, step=math.nan, turns=0,
            omega=tuple(math.sqrt(abs(y[x])) for y in names),
            stiffness=tuple(float(w) * y[x] for w, y in zip(m, names, strict=True)) if weighed else None,
            friction=(0.0,) * len(names),
        )
        for x in kept
    )  # fmt: skip
    one = kept[0] if len(kept) == 1 else None
    return Identification(
        verdict="named" if one else "not told apart", scheme=one, nearest=one, candidates=each, stride=1,
        omega=each[0].omega, stiffness=each[0].stiffness, friction=each[0].friction, fits=True,
        determinant=(math.nan,) * len(names), statement=f"{titles(kept)}, in steps of uneven length",
        notes=("the times are not even: each step was compared with a step of its own length",),
    )  # fmt: skip


def _of_positions(x: Floats, h: Floats) -> Explanation | None:
    """What positions (f,) alone show of steps h (f - 1,) of Stoermer-Verlet."""
    new, old, way = h[1:], h[:-1], np.diff(x)
    for scaled, text in ((False, NOT_SCALED), (True, NOW_SCALED)):
        share = new / old if scaled else np.ones(len(new))
        pull = new * (new + old) / 2 if scaled else new**2
        columns = np.column_stack([pull * x[1:-1], pull])
        left = way[1:] - share * way[:-1]
        left = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
        quantum = 4 * storage(x[1:]).quantum(x[1:-1]) * (storage(x[1:]).name != "double")
        if np.all(np.abs(left) <= 64 * ROUNDING * np.max(np.abs(x)) + quantum):
            remedy = "" if scaled else "multiply the displacement by the new step over the old one"
            return Explanation(text, remedy, local=True)
    return None


class _Steps:
    """One oscillator's states z = (q, v) at uneven times, and the schemes whose steps they are."""

    def __init__(self, t: Floats, q: Floats, v: Floats) -> None:
        self.h, self.z = np.diff(t.astype(np.longdouble)), np.stack([q, v]).astype(np.longdouble)
        pull = np.abs(np.diff(v) / np.diff(t))
        late = 4 * np.spacing(np.max(np.abs(t)))
        size = np.max(np.abs(self.z), axis=1).astype(float)
        quanta = [
            2 * np.max(storage(x[1:]).quantum(x[1:])) * (storage(x[1:]).name != "double") for x in (q, v)
        ]
        moved = np.array([size[1], np.max(pull)])
        self.room = 64 * ROUNDING * (size + moved * np.max(np.diff(t))) + late * moved + quanta

    def after(self, r: int, w2: Any, x0: Any, h: Any, at: Any) -> Any:
        """States (2, c) a step of h (c,) after the frames `at`."""
        one = np.ones(len(h), np.longdouble)
        m = table(PLAIN).unit(np.full(len(h), r), w2 * h * h, 0 * one)
        q, v = self.z[0, at] - x0, self.z[1, at]
        return np.stack([x0 + m[0] * q + m[1] * h * v, m[2] / h * q + m[3] * v])

    def fitted(self, r: int, some: Any, w2: float | None) -> tuple[Any, Any] | None:
        """Stiffness over mass and equilibrium by which a row takes the steps `some`; None where none does."""
        h, ends = self.h[some], self.z[:, 1:][:, some]
        middle = (self.z[0, :-1] + self.z[0, 1:])[some] / 2
        pull = (np.diff(self.z[1]) / self.h)[some]
        slope, start = np.polyfit(middle.astype(float), pull.astype(float), 1)
        if not slope < 0:
            return None
        x = [np.longdouble(-slope if w2 is None else w2), np.longdouble(-start / slope)]
        for _ in range(8):
            left = ends - self.after(r, x[0], x[1], h, some)
            if np.all(np.abs(left) <= self.room[:, None]):
                return x[0], x[1]
            steps = np.array([abs(x[0]), np.max(np.abs(self.z[0]))]) * np.longdouble(2.0) ** -20
            slopes = [
                (self.after(r, x[0] + d, x[1] + e, h, some) + left - ends) / (d + e)
                for d, e in ((steps[0], 0), (0, steps[1]))
            ]  # fmt: skip
            weight = self.room[:, None]
            columns = np.stack([(y / weight).ravel() for y in slopes], 1).astype(float)
            move = np.linalg.lstsq(columns, (left / weight).ravel().astype(float), rcond=None)[0]
            if not np.all(np.isfinite(move)):
                return None
            x = [y + d for y, d in zip(x, move, strict=True)]
        return None

    def taken(self, w2: float | None) -> dict[str, float]:
        """Names of the schemes that take every step, with the stiffness over the mass that they imply."""
        every = np.arange(len(self.h))
        with np.errstate(all="ignore"):
            found = {row.scheme: self.fitted(r, every, w2) for r, row in enumerate(PLAIN)}
        return {name: float(x[0]) for name, x in found.items() if x is not None}

    def of_another_step(self) -> Explanation | None:
        """A scheme whose steps over intervals of one length are of another."""
        rounded = np.array([float(f"{x:.6g}") for x in self.h.astype(float)])
        lengths, which, counts = np.unique(rounded, return_inverse=True, return_counts=True)
        if len(lengths) > FEWEST:
            return None
        usual = int(np.argmax(counts))
        for r, row in enumerate(PLAIN):
            with np.errstate(all="ignore"):
                found = self.fitted(r, np.flatnonzero(which == usual), None)
                if found is None:
                    continue
                others = [i for i in range(len(lengths)) if i != usual]
                steps = {
                    float(lengths[i]): self.step_of(r, *found, np.flatnonzero(which == i)) for i in others
                }
            known = {x: float(y) for x, y in steps.items() if y is not None}
            if len(known) == len(steps):
                each = either([f"{y:.6g} where times are {x:.6g} apart" for x, y in known.items()])
                cause = f"{capital(title(row.scheme))}, but the step taken is {each}"
                return Explanation(cause, "look for a largest or smallest step that is allowed", local=True)
        return None

    def step_of(self, r: int, w2: Any, x0: Any, some: Any) -> Any:
        """The one step that leads from the frames `some` to the next; None where there is none."""
        ends, usual = self.z[:, 1:][:, some], np.mean(self.h[some])
        for share in SHARES:
            h = share * usual
            for _ in range(12):
                left = ends - self.after(r, w2, x0, np.full(len(some), h), some)
                if np.all(np.abs(left) <= self.room[:, None]):
                    return h
                d = h * np.longdouble(2.0) ** -20
                slope = (
                    (self.after(r, w2, x0, np.full(len(some), h + d), some) + left - ends)
                    / d
                    / self.room[:, None]
                )
                h = h + np.sum(slope * left / self.room[:, None]) / np.sum(slope * slope)
                if not 0 < h < 10 * usual:
                    break
        return None
