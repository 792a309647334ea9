"""The motion of scenes by Taylor series in integers of 288 bits, against the solution of springcheck.

Claim: no solution is further from the exact motion than its stated error, which is within 100 times of the
true one in the median.

Command: python validation/references.py --scenes 2007    (random scenes of nine kinds, 6 minutes of a core)
         python validation/references.py --write NAME ... (makes data/reference/motion/NAME.json anew)

It prints for each kind: scenes, the largest error in units of the stated one (below 1), the median of
stated/true, the scenes without a reference, and the longest time that one took.  A random scene is followed
for up to 25 times its shortest time.

The route: every position is a power series in time, of 48 terms, in steps in which they fall below 2**-150.
Products, powers, exponentials and sines of series follow by their recurrences (Jorba and Zou, Experimental
Math. 14 (2005) 99).  Nothing is shared with springcheck but the numbers of a scene.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Iterator
from operator import mul
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

from arguments import script
from springcheck.errors import SpringcheckError
from springcheck.physics import exact, scenefile, terms
from springcheck.physics.scene import Scene

FOLDER = Path(__file__).parents[1] / "data" / "reference" / "motion"
BITS, ORDER, DIGITS = 288, 48, 25


def whole(x: Any) -> int:
    """A double or an extended number in units of 2**-BITS."""
    mantissa, exponent = np.frexp(np.longdouble(x))
    return shifted(int(np.ldexp(mantissa, 64)), BITS - 64 + int(exponent))


def shifted(x: int, by: int) -> int:
    """X times 2**by, rounded down."""
    return x << by if by >= 0 else x >> -by


def real(of: Callable[..., Any], x: int) -> int:
    """A function of mpmath at a number in units of 2**-BITS."""
    with mp.workprec(2 * BITS):
        return int(mp.nint(mp.ldexp(of(mp.ldexp(x, -BITS)), BITS)))


class Series:
    """Coefficients of a power series, each computed when it is needed, by its number."""

    def __init__(self, rule: Callable[[int], int], *first: int) -> None:
        self.rule, self.known = rule, list(first)

    def __getitem__(self, k: int) -> int:
        while len(self.known) <= k:
            self.known.append(self.rule(len(self.known)))
        return self.known[k]

    def upto(self, k: int) -> list[int]:
        self[k]
        return self.known[: k + 1]

    def __add__(self, other: Series) -> Series:
        return Series(lambda k: self[k] + other[k])

    def __mul__(self, other: Series | int) -> Series:
        if isinstance(other, int):
            return Series(lambda k: self[k] * other >> BITS)
        return Series(lambda k: sum(map(mul, self.upto(k), reversed(other.upto(k)))) >> BITS)

    def shift(self, by: int) -> Series:
        return Series(lambda k: self[k] + (by if k == 0 else 0))

    def power(self, a: float) -> Series:
        """a is a whole number of halves."""
        two = int(2 * a)

        def rule(k: int) -> int:
            total = sum((two * j - 2 * (k - j)) * self[j] * out[k - j] for j in range(1, k + 1))
            return total // (2 * k * self[0])

        out = Series(rule, real(lambda x: x ** mp.mpf(a), self[0]))
        return out

    def exp(self) -> Series:
        out = Series(
            lambda k: (sum(j * self[j] * out[k - j] for j in range(1, k + 1)) >> BITS) // k,
            real(mp.exp, self[0]),
        )
        return out

    def sine_cosine(self) -> tuple[Series, Series]:
        def rule(k: int, of: Callable[[], Series], sign: int) -> int:
            return sign * ((sum(j * self[j] * of()[k - j] for j in range(1, k + 1)) >> BITS) // k)

        sine = Series(lambda k: rule(k, lambda: cosine, 1), real(mp.sin, self[0]))
        cosine = Series(lambda k: rule(k, lambda: sine, -1), real(mp.cos, self[0]))
        return sine, cosine


def forces(scene: Scene, u: list[Series], v: list[Series], t: Series) -> Iterator[tuple[int, Series]]:
    """Coordinate and force of each row of each term, at positions u, velocities v and the time t."""
    for term in scene.terms:
        rows = [dict(zip(term.arrays, row, strict=True)) for row in term.rows()]
        distances: dict[float, list[Any]] = {}
        for row in rows:
            n = {name: whole(x) for name, x in row.items() if name not in (*term.ends, "number")}
            if "number" in row:
                distances.setdefault(row["number"], []).append((row, n))
                continue
            end = row[term.ends[-1]]
            x = u[end].shift(-n.get("at", n.get("rest", 0)))
            x = x if term.bodies == 1 else x + u[row["a"]] * -(1 << BITS)
            if term.key in ("wall-spring", "spring"):
                pull = x * n["k"]
            elif term.key == "quartic":
                pull = x * x * x * n["b"]
            elif term.key == "cosine":
                pull = (x * n["wave"]).sine_cosine()[0] * n["wave"] * n["depth"]
            elif term.key == "weight":
                pull = Series(lambda k: 0, -n["force"])
            elif term.key == "morse":
                e = (x * -n["steepness"]).exp()
                pull = (e + e * e * -(1 << BITS)) * n["steepness"] * (2 * n["depth"])
            elif term.key == "damping":
                pull = v[end] * n["c"]
            elif term.key == "van-der-pol":
                x = x * ((1 << 2 * BITS) // n["width"])
                pull = (x * x).shift(-1 << BITS) * v[end] * n["c"]
            else:
                assert term.key == "drive", term.key
                pull = (t * n["frequency"]).shift(n["phase"]).sine_cosine()[1] * -n["amplitude"]
            yield end, pull * -(1 << BITS)
            if "a" in row:
                yield row["a"], pull
        for several in distances.values():
            way = [
                u[row["i"]].shift(-n["at"]) if "i" in row else u[row["b"]] + u[row["a"]] * -(1 << BITS)
                for row, n in several
            ]
            square = sum((x * x for x in way[1:]), start=way[0] * way[0])
            pull = over_length(term.key.removeprefix("wall-"), several[0][1], square)
            for (row, _), x in zip(several, way, strict=True):
                one = x * pull
                yield row[term.ends[-1]], one * -(1 << BITS)
                if "a" in row:
                    yield row["a"], one


def over_length(key: str, n: dict[str, int], square: Series) -> Series:
    """The slope of a potential of the distance, over the distance, from its square."""
    if key == "bond":
        return (square.power(-0.5) * -n["rest"]).shift(1 << BITS) * n["k"]
    if key == "kepler":
        return square.power(-1.5) * n["strength"]
    if key == "lennard-jones":
        x = square.power(-1) * (n["diameter"] ** 2 >> BITS)
        x = x * x * x
        return (x + x * x * (-2 << BITS)) * square.power(-1) * (24 * n["depth"])
    if key != "radial-morse":
        raise SpringcheckError(f"add the law of {key} to over_length")
    e = (square.power(0.5).shift(-n["rest"]) * -n["steepness"]).exp()
    return (e + e * e * -(1 << BITS)) * square.power(-0.5) * n["steepness"] * (2 * n["depth"])


def _position(force: list[Series], m: int, unit: int, q: int, v: int) -> Series:
    """A position by Newton's law, in units of 2**unit of time."""

    def rule(k: int) -> int:
        return (shifted(sum(f[k - 2] for f in force), 2 * unit) << BITS) // (m * k * (k - 1))

    return Series(rule, q, v)


def _rate(x: Series, unit: int) -> Series:
    return Series(lambda k: shifted((k + 1) * x[k + 1], -unit))


def truth(scene: Scene, times: list[int]) -> list[tuple[list[int], list[int]]]:
    """q and p at rising |times| of one sign, in units of 2**-BITS."""
    m, q, p = ([whole(x) for x in xs] for xs in (scene.m, scene.q, scene.p))
    # in units of time in which the coefficients neither vanish nor overflow
    unit = math.floor(math.log2(abs(times[-1]) / 2**BITS)) - 3
    v, done, found = [shifted((x << BITS) // y, unit) for x, y in zip(p, m, strict=True)], 0, []
    for end in (shifted(t, -unit) for t in times):
        while done != end:
            force: list[list[Series]] = [[] for _ in m]
            u = [_position(force[i], m[i], unit, q[i], v[i]) for i in range(len(m))]
            rates = [_rate(x, unit) for x in u]
            now = Series(lambda k: 0, shifted(done, unit), shifted(1 << BITS, unit))
            for i, one in forces(scene, u, rates, now):
                force[i].append(one)
            h = abs(end - done)
            for x in u:
                for k in (ORDER + 1, ORDER):
                    if x[k]:
                        bits = (abs(x[k]).bit_length() - BITS + 150) / ORDER
                        h = min(h, max(int(2.0 ** (60 - bits)) << (BITS - 60), 1))
            h = h if end > done else -h
            done += h
            q = [value(x.upto(ORDER + 1), h) for x in u]
            v = [value([j * c for j, c in enumerate(x.upto(ORDER + 1))][1:], h) for x in u]
        found.append((q, [shifted(x * y >> BITS, -unit) for x, y in zip(v, m, strict=True)]))
    return found


def value(x: list[int], h: int) -> int:
    """The polynomial of these coefficients at h."""
    total = 0
    for c in reversed(x):
        total = (total * h >> BITS) + c
    return total


def random(rng: np.random.Generator, kind: str) -> Scene:
    """A scene of a kind, with numbers over several decades, forwards or (1 of 8) backwards in time."""
    laws: Any = terms
    m, k, size, b, c = (float(10 ** rng.uniform(-2, 2)) for _ in range(5))
    x, y, z, r = rng.normal(size=4) * size
    i, t = [0], math.sqrt(m / k)
    p = rng.normal(size=4) * math.sqrt(m * k) * size
    flat = {"m": [m] * 2, "q": [x, y], "p": p[:2], "places": [0, 1]}
    pair = {"m": [m, m, b, b], "q": [x, y, x + z, y + r], "p": p, "places": [0, 1, 3, 4]}
    both = {"a": [0, 1], "b": [2, 3], "number": [0, 0]}
    length, line = math.hypot(z, r), {"m": [m], "q": [x], "p": p[:1]}
    spring = laws.WallSpring(i=i, k=[k * rng.choice([1, 1, -1])], at=[y * rng.choice([0, 1])])
    near, deep = length * rng.uniform(0.5, 1.5), k * size**2
    swing = laws.Cosine(i=i, depth=[deep], wave=[1 / size], at=[y]), laws.Damping(i=i, c=[0.1 * m / t])
    brake = laws.VanDerPol(i=i, c=[min(c, 9) * m / t], width=[size], at=[0.0])
    tie = laws.RadialSpring.to_points(i=[0, 1], at=[z, r], k=[k] * 2, rest=[size] * 2, number=[0, 0])
    bond = {"depth": [deep] * 2, "steepness": [1 / size] * 2, "rest": [near] * 2}
    line_bond = laws.Morse(a=[0], b=[1], depth=[deep], steepness=[1 / size], rest=[near])
    known: dict[str, tuple[dict[str, Any], tuple[Any, ...]]] = {
        "quartic": (line, (spring, laws.Quartic(i=i, b=[k / size**2], at=[0.0]))),
        "pendulum": (line, swing),
        "van-der-pol": (line, (laws.WallSpring(i=i, k=[k], at=[0.0]), brake)),
        "morse": ({"m": [m, b], "q": [0.0, length], "p": [p[0], -p[0]]}, (line_bond,)),
        "elastic": (flat, (tie, laws.Weight(i=[1], force=[-k * size], at=[0.0]))),
        "bond": (pair, (laws.RadialSpring(k=[k] * 2, rest=[near] * 2, **both),)),
        "kepler": (pair, (laws.Kepler(strength=[k * length**3] * 2, **both),)),
        "lennard-jones": (pair, (laws.LennardJones(depth=[deep] * 2, diameter=[0.63 * near] * 2, **both),)),
        "radial-morse": (pair, (laws.RadialMorse(**bond, **both),)),
    }
    given, several = known[kind]
    of_force = Scene(**given, terms=several, step=t, steps=1).system
    t = 1 / float(np.sqrt(np.max(of_force.gershgorin(of_force.q) / of_force.m)))
    steps = int(rng.integers(2, 2000))
    span = t * 25 * rng.uniform(0.02, 1) * (-1 if rng.random() < 1 / 8 and kind != "van-der-pol" else 1)
    return Scene(**given, terms=several, step=span / steps, steps=steps)


KINDS = (
    "quartic",
    "pendulum",
    "van-der-pol",
    "morse",
    "elastic",
    "bond",
    "kepler",
    "lennard-jones",
    "radial-morse",
)


def ratios(scene: Scene, frames: list[int]) -> list[float]:
    """Errors of q and p of each coordinate at these frames, in units of the stated ones."""
    right, found = truth(scene, [steps * whole(scene.step) for steps in frames]), []
    for steps, wanted in zip(frames, right, strict=True):
        states = exact.true_motion(scene, np.array([steps]), scene.step)
        stated = scene.system.solution.doubt(scene.step * steps)  # type: ignore[union-attr]
        for x, y, limit in ((*z,) for z in zip(states, wanted, stated, strict=True)):
            found += [
                abs(whole(one) - two) / max(whole(most), 1)
                for one, two, most in zip(x[0], y, limit, strict=True)
            ]
    return found


def write(name: str) -> None:
    """The reference of a shipped scene, at some frames."""
    scene = scenefile.load_scene(name)
    frames = sorted({0, 1, scene.steps // 7, scene.steps // 3, scene.steps // 2, scene.steps})
    start = [whole(x) for x in scene.q], [whole(x) for x in scene.p]
    rows, later = [], truth(scene, [steps * whole(scene.step) for steps in frames[1:]])
    for steps, states in zip(frames, [start, *later], strict=True):
        with mp.workprec(BITS):
            q, p = ([mp.nstr(mp.ldexp(x, -BITS), DIGITS) for x in xs] for xs in states)
        rows.append({"steps": steps, "q": q, "p": p})
    origin = f"Taylor series of order {ORDER} in integers of {BITS} bits (validation/references.py)"
    text = json.dumps({"origin": origin, "every": 1, "motion": rows}, indent=1)
    (FOLDER / f"{name}.json").write_text(text + "\n")


def main() -> int:
    """Compare, or write; the exit status is 1 where an error exceeds the stated one."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--scenes", type=int, default=90)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", nargs="*", default=[])
    options = parser.parse_args()
    for name in options.write:
        write(name)
    if options.write:
        return 0
    bad, every = 0, []
    print("kind           scenes  largest error/stated  median stated/true  none  longest [s]")
    for number, kind in enumerate(KINDS):
        worst, medians, none, longest = 0.0, [], 0, 0.0
        for j in range(options.scenes // len(KINDS)):
            scene, begun = random(np.random.default_rng([options.seed, number, j]), kind), time.process_time()
            known = exact.has_true_motion(scene)
            longest = max(longest, time.process_time() - begun)
            if not known:
                none += 1
                continue
            off = ratios(scene, [scene.steps // 2 + 1, scene.steps])
            if not max(off) <= 1:
                bad += 1
                print(f"{kind}, scene {j}: the error is {max(off):.3g} of the stated one")
            worst = max(worst, *off)
            medians.append(float(np.median(off)))
        every += medians
        middle = 1 / np.median(medians)
        print(f"{kind:14} {len(medians):6} {worst:21.3g} {middle:19.3g} {none:5} {longest:11.2g}", flush=True)
    print(
        f"{len(every)} scenes, {bad} beyond the stated error; the median of all: {1 / np.median(every):.3g}"
    )
    return int(bad > 0)


if __name__ == "__main__":
    script(main)
