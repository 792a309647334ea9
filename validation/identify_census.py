"""Claim: `identify` names scheme and steps from states alone, never names another scheme, and never takes a
systematic error for an arithmetic.

Each trajectory is drawn at random: a scheme of the catalogue, or one with friction by any law and at any
place in its step, or a force held over substeps; a spring that is stated or not, about an equilibrium at 0 or
away from it (a weight), from rest or not; 1 to 8 steps to a frame; steps that are h, or the differences of a
rounded clock (linspace or accumulated); h, k or m rounded to single precision; numbers in double or single
precision or as text of 6 digits; h w log-uniform from 0.02 to 1.5 or 0.95 of the limit.  One in six carries a
systematic error, of 1e-12 to 1e-3 of the force or the state: a stiffness that wobbles, a cubic force, a
constant drift of the position, noise, alternating steps, one kick; then "fits" is a false fit, unless the
error hides within the rounding of the file.

Measured on the first 50 of seeds 11 and 12, 98 trajectories: no wrong name; 58 named, 3 more named but said
not to be what was stated, 19 not told apart, 3 taken for none, 14 errors seen, and one false fit: noise of
6e-10 of the force, six steps of RK4 to a frame, which has the size of a 64-bit fixed-point force.

Steps are carried out in plain floats from the stages, without the matrices that `identify` matches.

Command: python validation/identify_census.py [trajectories] [seed]
"""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from typing import Any

import numpy as np

from arguments import arguments
from springcheck.arrays import Floats
from springcheck.errors import IdentificationError
from springcheck.identify import Identification, identify
from springcheck.identify.families import DAMPED, UNDAMPED, Family
from springcheck.identify.search import aliases, frictionless
from springcheck.schemes import SCHEMES, number

FRAMES = 101
ERRORS = (
    "wobbling stiffness",
    "cubic force",
    "drift of the position",
    "noise",
    "alternating steps",
    "one kick",
)


class Draw:
    """One random trajectory and what it was made of."""

    def __init__(self, rng: np.random.Generator) -> None:
        kind = rng.choice(["plain", "plain", "damped", "damped", "held"])
        pool = {"plain": UNDAMPED, "damped": DAMPED, "held": UNDAMPED[:1]}[str(kind)]
        self.family: Family = pool[int(rng.integers(len(pool)))]
        self.held = int(rng.integers(2, 9)) if kind == "held" else 0
        self.scheme = "held-force" if self.held else self.family.scheme
        flow = self.family.flow
        self.error = str(rng.choice(ERRORS)) if rng.random() < 1 / 6 and not flow else ""
        self.size = float(10 ** rng.uniform(-12, -3))
        self.stride = 1 if flow else int(rng.integers(1, 9)) if rng.random() < 0.7 else 1
        self.clock = (
            "even" if flow or self.error else str(rng.choice(["even", "even", "linspace", "accumulated"]))
        )
        self.single = "" if flow or self.error else str(rng.choice(["", "", "", "h", "k", "m"]))
        self.form = "double" if self.error else str(rng.choice(["double", "double", "single", "text"]))
        self.stated = bool(rng.random() < 0.5)
        limit = self.family.limit
        highest = min(1.5, 0.95 * limit) if limit > 0 else 1.0
        x = math.exp(rng.uniform(math.log(0.02), math.log(highest)))
        self.m, self.h = float(10 ** rng.uniform(-2, 2)), float(10 ** rng.uniform(-3, 1))
        self.k = self.m * (x / self.h) ** 2
        self.g = float(rng.uniform(0.01, 0.3)) * min(x, 1.0) if self.family.damped and not self.held else 0.0
        self.x = x
        scale = float(10 ** rng.uniform(-1, 2))
        self.at = float(rng.choice([0.0, 0.0, scale * rng.normal()]))
        self.q, self.v = scale * rng.normal() + self.at, scale * rng.normal() * x / self.h
        if rng.random() < 0.15:
            self.v = 0.0
            self.q = self.at + scale if self.at == 0 else 0.0
        self.rng = rng

    def __str__(self) -> str:
        return (
            f"{self.family.name}{f', held over {self.held}' if self.held else ''}, {self.stride} steps, "
            f"h w {self.x:.3g}, {self.form}, clock {self.clock}, single {self.single or '-'}, "
            f"at {self.at:.3g}, stated {self.stated}, {self.error} {self.size:.1e}"
        )

    def move(self, *, clean: bool = False) -> tuple[Floats, Floats, Floats]:
        """Times, positions and velocities of the frames."""
        steps = (FRAMES - 1) * self.stride
        h, k, m = self.h, self.k, self.m
        if self.clock == "even":
            t: Floats = np.asarray(np.arange(steps + 1) * h, np.float64)
        elif self.clock == "linspace":
            t = np.asarray(np.linspace(0, steps * h, steps + 1), np.float64)
        else:
            t = np.concatenate([[0.0], np.cumsum(np.full(steps, h))])
        given = (("h", h), ("k", k), ("m", m))
        h, k, m = (float(np.float32(x)) if self.single == name else x for name, x in given)
        if self.family.flow:
            return self._flow(t)
        noise = np.random.default_rng(5).standard_normal(steps + 1)
        error = "" if clean else self.error
        q, v = self.q, self.v
        frames = [(q, v)]
        for i in range(steps):
            step = h if self.clock == "even" else float(t[i + 1] - t[i])
            if error == "alternating steps":
                step *= 1 + self.size * (-1) ** i

            def force(x: float, i: int = i) -> float:
                out = -k * (x - self.at)
                if error == "wobbling stiffness":
                    out *= 1 + self.size * math.sin(0.37 * i * self.x)
                if error == "cubic force":
                    out *= (
                        1 + self.size * ((x - self.at) / (abs(self.q) + abs(self.v) * self.h / self.x)) ** 2
                    )
                return out + (self.size * k * abs(self.q) * noise[i] if error == "noise" else 0.0)

            if error == "one kick" and i == steps // 2:
                v += self.size * abs(v)
            q, v = (
                self._held(q, v, step, m, force)
                if self.held
                else _step(self.family, q, v, step, m, k, self, force)
            )
            if error == "drift of the position":
                q += self.size * abs(self.q)
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
    family: Family, q: float, v: float, h: float, m: float, k: float, draw: Draw, force: Any
) -> tuple[float, float]:
    """One step in plain floats."""
    rate = draw.g / draw.h
    if family.stability[0]:
        q, v = _tableau(family, q, v, h, m, k, draw, force, rate if not family.stages else 0.0)
    for kind, share in family.stages:
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
    return q, v


def _tableau(
    family: Family, q: float, v: float, h: float, m: float, k: float, draw: Draw, force: Any, rate: float
) -> tuple[float, float]:
    scheme = SCHEMES[family.scheme]
    slopes: list[tuple[float, float]] = []
    for row in scheme.a:
        x, u = q, v
        for c, (dq, dv) in zip(row, slopes, strict=False):
            x, u = x + h * float(c) * dq, u + h * float(c) * dv
        own = float(row[len(slopes)]) * h if len(row) > len(slopes) else 0.0
        if own:
            # u' = u + own (F(x + own u')/m - rate u'), linear
            u = (u + own * (force(x) / m)) / (1 + own * rate + own * own * k / m)
            x = x + own * u
        slopes.append((u, force(x) / m - rate * u))
    for c, (dq, dv) in zip(scheme.b, slopes, strict=True):
        q, v = q + h * float(c) * dq, v + h * float(c) * dv
    return q, v


def written(x: Floats, form: str) -> Floats:
    """Numbers as a file of this form returns them."""
    if form == "single":
        return x.astype(np.float32).astype(np.float64)
    return np.array([float(f"{y:.6g}") for y in x]) if form == "text" else x


def judged(draw: Draw, found: Identification, hidden: bool) -> str:
    """What was said: right, short of it, or wrong."""
    if draw.error:
        return "error seen" if not found.fits else "error within rounding" if hidden else "FALSE FIT"
    same = {draw.scheme}
    if draw.scheme in SCHEMES:
        same |= {*aliases(draw.scheme), *(frictionless(draw.scheme) if not draw.g else ())}
        same |= {f.scheme for f in UNDAMPED if not draw.g and draw.scheme in frictionless(f.scheme)}
    listed = any(x.scheme in same and x.stride == draw.stride for x in found.candidates)
    if found.verdict == "none":
        return "none"
    if found.verdict == "not told apart":
        return "not told apart" if listed else "LISTED WITHOUT IT"
    if found.scheme not in same:
        return "WRONG NAME"
    return ("named" if listed else "WRONG STEPS") + ("" if found.fits else ", but not what was stated")


def main() -> None:
    """Print what was said, class by class, and everything that is wrong."""
    given = arguments(__doc__, count=2000, seed=1)
    seen: dict[str, Counter[str]] = defaultdict(Counter)
    begun = time.perf_counter()
    spent = 0.0
    for number_ in range(given.count):
        draw = Draw(np.random.default_rng([given.seed, number_]))
        try:
            with np.errstate(all="ignore"):
                t, q, v = draw.move()
                clean = draw.move(clean=True) if draw.error else (t, q, v)
        except OverflowError:
            continue
        if not (np.all(np.isfinite(q)) and np.max(np.abs(q)) < 1e30):
            continue
        # an error of a frame below some units in the last place of the file is none of the file's
        size = np.max(np.abs(q - draw.at)) + abs(draw.at)
        first = [float(np.max(np.abs(x[1] - y[1]))) for x, y in zip((q, v), clean[1:], strict=True)]
        late = float(np.max(np.abs(q - clean[1])))
        hidden = bool(late <= 64 * 2.0**-52 * size * draw.stride and max(first) <= 64 * 2.0**-52 * size)
        stated = draw.k if draw.stated else None
        name = draw.error or f"{'held' if draw.held else 'damped' if draw.g else 'plain'}, {draw.form}"
        now = time.perf_counter()
        try:
            found = identify(t, written(q, draw.form), v=written(v, draw.form), mass=draw.m, stiffness=stated)
            said = judged(draw, found, hidden)
        except IdentificationError as error:
            said = f"refused: {str(error)[:60]}"
        spent += time.perf_counter() - now
        seen[name][said] += 1
        if number_ % 50 == 49:
            print("#", number_ + 1, dict(Counter(x for c in seen.values() for x in c.elements())), flush=True)
        if said.isupper() or said.split(",")[0].isupper() or said == "none":
            print(f"{said}: number {number_}: {draw}: {found.statement[:150]}", flush=True)
    for name, counts in sorted(seen.items()):
        print(f"{name:28s}", "; ".join(f"{n} {said}" for said, n in counts.most_common()))
    total = sum(sum(x.values()) for x in seen.values())
    print(
        f"{total} trajectories, {spent / total * 1e3:.0f} ms each, {time.perf_counter() - begun:.0f} s in all"
    )


if __name__ == "__main__":
    main()
