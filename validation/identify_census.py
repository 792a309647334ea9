"""Claim: `identify` names scheme and steps from states alone, never names another scheme, and never takes a
systematic error for an arithmetic.

    python validation/identify_census.py [FIRST COUNT [FILE]]

Each trajectory is drawn at random: a scheme of the catalogue, or one with friction by any law and at any
place in its step, or a force held over substeps; a spring that is stated or not, about an equilibrium at 0 or
away from it (a weight), from rest or not; 1 to 8 steps to a frame; steps that are h, or the differences of a
rounded clock (linspace or accumulated); h, k or m rounded to single precision; numbers in double or single
precision or as text of 6 digits; h w log-uniform from 0.02 to 1.5 or 0.95 of the limit.  One in six carries a
systematic error, of 1e-12 to 1e-3 of the force or the state: a stiffness that wobbles, a cubic force, a
constant drift of the position, noise, alternating steps, one kick; one in twelve carries two of them.  Then
"fits" is a false fit, unless the error hides within the rounding of the file, and the first sentence may name
no cause that is none of them.

A class is what was drawn; what is said of it is counted.  What is written in capitals is wrong.  "Undecided"
says: the scheme is known, and whether its arithmetic explains the rest cannot be judged.

Steps are carried out in plain floats from the stages, without the matrices that `identify` matches.  Steps
are carried out in plain floats from the stages, without the matrices that `identify` matches.  With
FILE every block of 100 trajectories is kept in it, a line of JSON each: blocks that are there are not run
again, and what is printed is the sum of all blocks of the file.  Numbers from 1,000,000 on draw few frames (5
to 101), text of 3 to 9 digits and up to 12 steps to a frame as well.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck.errors import IdentificationError
from springcheck.identify import Identification, identify
from springcheck.identify.catalogue import FRICTION, PLAIN, PREDICTED, aliases
from springcheck.identify.rows import Row
from springcheck.physics.arrays import Floats
from springcheck.schemes import SCHEMES, number

BLOCK = 100
FRAMES = 101
WIDE = 1_000_000
"""Numbers from here on draw the frames (5 to 101), the digits of text (3 to 9) and 1 to 12 steps as well."""
ERRORS = (
    "wobbling stiffness",
    "cubic force",
    "drift of the position",
    "noise",
    "alternating steps",
    "one kick",
)


CAUSES = {
    "wobbling stiffness": "changes in time|on time",
    "cubic force": "anharmonic|not linear in (the )?position|cubic|quadratic|powers of the position",
    "drift of the position": "constant added to the position",
    "noise": "^Noise",
    "alternating steps": "alternate|the step or a force changes in time",
    "one kick": "one kick|but (not from )?frame|motion is one",
}
"""What the sentence of each cause says.  Where one error is seen and the sentence is another's, it is wrong;
sentences that name no cause (one linear map that is no scheme's, near the exact solution) are none."""


class Draw:
    """One random trajectory and what it was made of."""

    def __init__(self, rng: np.random.Generator, wide: bool = False) -> None:
        kind = rng.choice(["plain", "plain", "damped", "damped", "held"])
        pool = {"plain": PLAIN, "damped": FRICTION, "held": PLAIN[:1]}[str(kind)]
        self.row: Row = pool[int(rng.integers(len(pool)))]
        self.held = int(rng.integers(2, 9)) if kind == "held" else 0
        self.scheme = "held-force" if self.held else self.row.scheme
        flow = self.row.scheme == "exact"
        self.error = str(rng.choice(ERRORS)) if rng.random() < 1 / 6 and not flow else ""
        self.second = ""
        self.size = float(10 ** rng.uniform(-12, -3))
        self.stride = 1 if flow else int(rng.integers(1, 9)) if rng.random() < 0.7 else 1
        self.clock = (
            "even" if flow or self.error else str(rng.choice(["even", "even", "linspace", "accumulated"]))
        )
        self.single = "" if flow or self.error else str(rng.choice(["", "", "", "h", "k", "m"]))
        self.form = "double" if self.error else str(rng.choice(["double", "double", "single", "text"]))
        self.stated = bool(rng.random() < 0.5)
        limit = SCHEMES[self.row.scheme].limit
        highest = min(1.5, 0.95 * limit) if limit > 0 else 1.0
        x = math.exp(rng.uniform(math.log(0.02), math.log(highest)))
        self.m, self.h = float(10 ** rng.uniform(-2, 2)), float(10 ** rng.uniform(-3, 1))
        self.k = self.m * (x / self.h) ** 2
        self.g = float(rng.uniform(0.01, 0.3)) * min(x, 1.0) if self.row.damped and not self.held else 0.0
        self.x = x
        scale = float(10 ** rng.uniform(-1, 2))
        self.at = float(rng.choice([0.0, 0.0, scale * rng.normal()]))
        self.q, self.v = scale * rng.normal() + self.at, scale * rng.normal() * x / self.h
        if rng.random() < 0.15:
            self.v = 0.0
            self.q = self.at + scale if self.at == 0 else 0.0
        if self.error and rng.random() < 1 / 3:
            self.second = str(rng.choice([x for x in ERRORS if x != self.error]))
        self.second_size = float(10 ** rng.uniform(-12, -3))
        self.frames, self.digits = FRAMES, (6, 6)
        if wide:
            self.frames = int(rng.choice([5, 6, 8, 10, 15, 20, 50, FRAMES]))
            digits = int(rng.integers(3, 10))
            self.digits = digits, int(rng.choice([digits, max(3, digits - 2)]))
            self.stride = 1 if flow else int(rng.integers(1, 13))

    def __str__(self) -> str:
        return (
            f"{self.row.scheme}, {self.row.law}"
            f"{f', held over {self.held}' if self.held else ''}, {self.stride} steps, "
            f"h w {self.x:.3g}, {self.form}, clock {self.clock}, single {self.single or '-'}, "
            f"at {self.at:.3g}, stated {self.stated}, {self.error} {self.size:.1e}, {self.second} "
            f"{self.second_size:.1e}"
            + (
                f", {self.frames} frames, {self.digits} digits"
                if self.frames != FRAMES or self.form == "text"
                else ""
            )
        )

    def move(self) -> tuple[Floats, Floats, Floats]:
        """Times, positions and velocities of the frames."""
        steps = (self.frames - 1) * self.stride
        h, k, m = self.h, self.k, self.m
        if self.clock == "even":
            t: Floats = np.asarray(np.arange(steps + 1) * h, np.float64)
        elif self.clock == "linspace":
            t = np.asarray(np.linspace(0, steps * h, steps + 1), np.float64)
        else:
            t = np.concatenate([[0.0], np.cumsum(np.full(steps, h))])
        given = (("h", h), ("k", k), ("m", m))
        h, k, m = (float(np.float32(x)) if self.single == name else x for name, x in given)
        if self.row.scheme == "exact":
            return self._flow(t)
        noise = np.random.default_rng(5).standard_normal(steps + 1)
        sizes = {self.second: self.second_size, self.error: self.size}
        sizes = {name: size for name, size in sizes.items() if name}
        q, v = self.q, self.v
        frames = [(q, v)]
        for i in range(steps):
            step = h if self.clock == "even" else float(t[i + 1] - t[i])
            step *= 1 + sizes.get("alternating steps", 0.0) * (-1) ** i

            def force(x: float, i: int = i) -> float:
                out = -k * (x - self.at)
                if "wobbling stiffness" in sizes:
                    out *= 1 + sizes["wobbling stiffness"] * math.sin(0.37 * i * self.x)
                if "cubic force" in sizes:
                    reach = abs(self.q - self.at) + abs(self.v) * self.h / self.x
                    out *= 1 + sizes["cubic force"] * ((x - self.at) / reach) ** 2
                return float(out + sizes.get("noise", 0.0) * k * abs(self.q) * noise[i])

            if i == steps // 2:
                v += sizes.get("one kick", 0.0) * abs(v)
            q, v = (
                self._held(q, v, step, m, force)
                if self.held
                else _step(self.row, q, v, step, m, k, self, force)
            )
            q += sizes.get("drift of the position", 0.0) * abs(self.q)
            if (i + 1) % self.stride == 0:
                frames.append((q, v))
        qs, vs = np.array(frames).T
        return t[:: self.stride], qs, vs

    def _held(self, q: float, v: float, h: float, m: float, force: Any) -> tuple[float, float]:
        held = force(q)
        for _ in range(self.held):
            v = v + h / self.held * held / m
            q = q + h / self.held * v
        return q, v

    def _flow(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        g, w2 = np.longdouble(self.g) / self.h, np.longdouble(self.k) / self.m
        w = np.sqrt(w2 - g * g / 4)
        y, u = np.longdouble(self.q - self.at), np.longdouble(self.v)
        b = (u + g / 2 * y) / w
        decay = np.exp(-g / 2 * t.astype(np.longdouble))
        c, s = np.cos(w * t), np.sin(w * t)
        q = decay * (y * c + b * s)
        v = decay * ((b * w - g / 2 * y) * c - (y * w + g / 2 * b) * s)
        return t, np.asarray(self.at + q, np.float64), np.asarray(v, np.float64)


def _step(
    row: Row, q: float, v: float, h: float, m: float, k: float, draw: Draw, force: Any
) -> tuple[float, float]:
    """One step in plain floats."""
    rate = draw.g / draw.h
    if row.over:
        q, v = _tableau(row, q, v, h, m, k, draw, force, rate if not row.stages else 0.0)
    for kind, share in row.stages:
        c = float(number(share, np.longdouble)) * h
        if kind == "drift":
            q = q + c * v
        elif kind == "kick":
            v = v + c * (force(q) / m)
        elif kind == "friction":
            v = v * math.exp(-c * rate)
        elif kind == "explicit":
            v = v + c * (force(q) / m - rate * v)
        elif kind == "implicit":
            v = (v + c * (force(q) / m)) / (1 + c * rate)
        elif kind == "centred":
            v = ((1 - c * rate / 2) * v + c * (force(q) / m)) / (1 + c * rate / 2)
        else:
            half = (v - c * (force(q) / m)) / (1 - c * rate)
            v = v + c * (force(q) / m - rate * half)
    place = row.law.removeprefix("explicit friction ")
    if place in PREDICTED:
        begun = force(q) / m - rate * v
        moved, early = v + h / 2 * begun, v + (PREDICTED[place][0] / PREDICTED[place][1]) * h * begun
        q = q + h * moved
        v = moved + h / 2 * (force(q) / m - rate * early)
    return q, v


def _tableau(
    row: Row, q: float, v: float, h: float, m: float, k: float, draw: Draw, force: Any, rate: float
) -> tuple[float, float]:
    scheme = SCHEMES[row.scheme]
    slopes: list[tuple[float, float]] = []
    for weights in scheme.a:
        x, u = q, v
        for c, (dq, dv) in zip(weights, slopes, strict=False):
            x, u = x + h * float(c) * dq, u + h * float(c) * dv
        own = float(weights[len(slopes)]) * h if len(weights) > len(slopes) else 0.0
        if own:
            # u' = u + own (F(x + own u')/m - rate u'), linear
            u = (u + own * (force(x) / m)) / (1 + own * rate + own * own * k / m)
            x = x + own * u
        slopes.append((u, force(x) / m - rate * u))
    for c, (dq, dv) in zip(scheme.b, slopes, strict=True):
        q, v = q + h * float(c) * dq, v + h * float(c) * dv
    return q, v


def written(x: Floats, form: str, digits: int = 6) -> Floats:
    """Numbers as a file of this form, text with so many digits, returns them."""
    if form == "single":
        return x.astype(np.float32).astype(np.float64)
    return np.array([float(f"{y:.{digits}g}") for y in x]) if form == "text" else x


def judged(draw: Draw, found: Identification, hidden: bool) -> str:
    """What was said: right, short of it, or wrong."""
    if draw.error:
        if found.fits:
            return "error within rounding" if hidden else "FALSE FIT"
        if found.undecided:
            return "undecided"
        own = [CAUSES[x] for x in (draw.error, draw.second) if x]
        others = [words for name, words in CAUSES.items() if name not in (draw.error, draw.second)]
        said = [any(re.search(x, found.statement) for x in words) for words in (own, others)]
        return "cause named" if said[0] else "WRONG CAUSE" if said[1] and not hidden else "error seen"
    same = {draw.scheme, *(() if draw.held else aliases(draw.row))}
    listed = any(x.scheme in same and x.stride == draw.stride for x in found.candidates)
    if found.verdict == "none":
        return "none"
    if found.verdict == "not told apart":
        return "undecided" if found.undecided else "not told apart" if listed else "LISTED WITHOUT IT"
    if found.scheme not in same:
        return "WRONG NAME"
    if not listed:
        return "WRONG STEPS"
    if found.fits or found.undecided:
        return "named" if found.fits else "undecided"
    rounded = draw.single and "in single precision" in found.statement
    return "named, and the constant that was rounded" if rounded else "named, but not what was stated"


def _hides(states: tuple[Floats, ...], stride: int) -> bool:
    """Whether one linear map and a constant explain the states to some units in the last place: an error that
    is another stiffness or another start is none."""
    _, q, v = states
    scale = np.array([np.std(q) or 1.0, np.std(v) or 1.0])
    z = np.stack([q, v], axis=1) / scale
    size = np.sqrt(np.sum(z[:-1] ** 2 + z[1:] ** 2, axis=1, keepdims=True))
    # squares of what has died down are 0
    size = np.where(size > 1e-100, size, np.inf)
    columns = np.concatenate([z[:-1], np.ones((len(z) - 1, 1))], axis=1) / size
    unit = np.sqrt(np.sum(columns**2, axis=0))
    fitted = np.linalg.lstsq(columns / unit, z[1:] / size, rcond=None)[0]
    left = z[1:] / size - columns / unit @ fitted
    return bool(np.max(np.abs(left)) <= 128 * 2.0**-52 * stride)


def said_of(number_: int) -> tuple[Draw, str, str, float] | None:
    """What is said of one trajectory, its statement and the seconds of the call; None where it overflows."""
    draw = Draw(np.random.default_rng([4, number_]), wide=number_ >= WIDE)
    try:
        with np.errstate(all="ignore"):
            states = draw.move()
    except OverflowError:
        return None
    t, q, v = states
    if not (np.all(np.isfinite(q)) and np.max(np.abs(q)) < 1e30):
        return None
    stated = draw.k if draw.stated else None
    begun = time.process_time()
    try:
        q, v = (written(x, draw.form, n) for x, n in zip((q, v), draw.digits, strict=True))
        found = identify(t, q, v=v, mass=draw.m, stiffness=stated)
        hidden = bool(draw.error) and _hides(states, draw.stride)
        said = judged(draw, found, hidden)
        statement = found.statement
    except IdentificationError as error:
        said, statement = f"refused: {str(error)[:60]}", ""
    return draw, said, statement, time.process_time() - begun


def block(first: int) -> dict[str, Any]:
    """One block of trajectories: what was said of each class, what is wrong, and the seconds a call takes."""
    counts: Counter[str] = Counter()
    wrong: list[str] = []
    seconds: list[float] = []
    for at in range(first, first + BLOCK):
        one = said_of(at)
        if one is None:
            continue
        draw, said, statement, spent = one
        name = draw.error or f"{'held' if draw.held else 'damped' if draw.g else 'plain'}, {draw.form}"
        counts[f"{'two errors' if draw.second else name}: {said}"] += 1
        seconds.append(spent)
        if said.isupper() or said in ("none", "named, but not what was stated"):
            wrong.append(f"{said}: number {at}: {draw}: {statement[:200]}")
    return {"first": first, "counts": counts, "wrong": wrong, "seconds": seconds}


def main() -> None:
    """Print what was said, class by class, and everything that is wrong."""
    given = arguments(__doc__, first=0, count=1000, file="")
    path = Path(given.file) if given.file else None
    kept = [json.loads(line) for line in path.read_text().splitlines()] if path and path.exists() else []
    have = {one["first"] for one in kept}
    for first in range(given.first - given.first % BLOCK, given.first + given.count, BLOCK):
        if first in have:
            continue
        kept.append(block(first))
        if path:
            with path.open("a") as out:
                out.write(json.dumps(kept[-1]) + "\n")
    total: Counter[str] = Counter()
    for one in kept:
        total.update(one["counts"])
    for text in sorted({x for one in kept for x in one["wrong"]}):
        print(text)
    for name in sorted({key.split(": ")[0] for key in total}):
        said = {key.split(": ", 1)[1]: n for key, n in total.most_common() if key.split(": ")[0] == name}
        print(f"{name:24s}", "; ".join(f"{n} {what}" for what, n in said.items()))
    every = Counter[str]()
    for key, n in total.items():
        every[key.split(": ", 1)[1]] += n
    print(f"{'all':24s}", "; ".join(f"{n} {what}" for what, n in every.most_common()))
    seconds = np.array([x for one in kept for x in one["seconds"]])
    shares = ", ".join(f"{1e3 * float(np.quantile(seconds, x)):.0f}" for x in (0.5, 0.9, 0.99, 1.0))
    print(f"{sum(total.values())} trajectories; ms a call (half, 90 %, 99 %, all within): {shares}")


if __name__ == "__main__":
    script(main)
