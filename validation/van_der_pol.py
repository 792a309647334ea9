"""Van der Pol's oscillator in 25 digits for mu from 1 to 1e6, by two routes without springcheck.

Claim: the exact motion that springcheck takes for the scene `van-der-pol` at any mu is off by less than it
states.

Command: python validation/van_der_pol.py            (compares springcheck with the file below)
         python validation/van_der_pol.py --write    (makes data/reference/stiff/van-der-pol.json anew)

Expected: one line for each mu, its largest error in units of what is stated, below 0.1.

The first route is Gauss collocation in Lienard's plane, u' = g (u - u**3/3) + z, z' = -w2 u, in 60 digits:
of 24 stages with steps whose series end below 1e-30, and of 30 below 1e-34, kept where both agree to 18
digits.  The second, for mu up to 30, are Taylor series of u'' = g (1 - u**2) u' - w2 u of order 50; it must
agree with the first to 24 digits.  What springcheck uses itself, Radau IIA in (u, u') in extended
precision, is a third.

At mu = 1000 in slow time, from (2, 0) to t = 2, the first makes 1.70616773217046501 and
-0.89280970102481655.  The Test Set for IVP Solvers (F. Mazzia and C. Magherini, release 2.4) gives
1.706167732170483 and -0.8928097010247975 (problem vdpol), and 1.706167732170469 and -0.8928097010248125
(problem vdpolm): they are right to 14 digits.
"""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

from arguments import arguments, script

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "data" / "reference" / "stiff" / "van-der-pol.json"
MU = (1.0, 10.0, 30.0, 1e3, 1e4, 1e5, 1e6)
SHARES = (0.001, 0.4, 0.81, 1.2, 2.0)
"""Times in units of c/k, half a period being 0.8; below mu = 30 these are multiplied by 10/mu."""
TEST_SET = (("1.706167732170483", "-0.8928097010247975"), ("1.706167732170469", "-0.8928097010248125"))

mp.mp.dps = 60


class Gauss:
    """Collocation of s stages: nodes, A and what makes Legendre coefficients of values."""

    def __init__(self, s: int) -> None:
        self.s = s
        start = np.polynomial.legendre.leggauss(s)[0]
        x = [mp.findroot(lambda y: mp.legendre(s, y), mp.mpf(float(y))) for y in start]
        values = mp.matrix(s, s)
        integrals = mp.matrix(s, s)
        for i in range(s):
            p = [mp.legendre(j, x[i]) for j in range(s + 1)]
            for j in range(s):
                values[i, j] = p[j]
                integrals[i, j] = (p[j + 1] - p[j - 1]) / (2 * j + 1) if j else x[i] + 1
        self.series = (values**-1).tolist()
        self.a = (integrals * values**-1 / 2).tolist()
        # the integral over the whole step is the first coefficient
        self.b = self.series[0]
        self.double = np.array(self.a, dtype=float)


def solve(rule: Gauss, g: Any, w2: Any, u: Any, z: Any, times: list[Any], tail: Any) -> list[tuple[Any, Any]]:
    """(u, u') at times."""
    t, found = mp.mpf(0), []
    h = 1 / (g * (1 + u * u) + mp.sqrt(w2))
    for end in times:
        while t < end:
            last = t + h >= end
            step = end - t if last else h
            met = stages(rule, g, w2, u, z, step)
            if met is None:
                h = step / 4
                continue
            v = [g * (x - x**3 / 3) + y for x, y in zip(*met, strict=True)]
            of = [abs(mp.fdot(row, v)) for row in rule.series[-2:]]
            size = max(of) / max(map(abs, v))
            factor = float(mp.mpf(0.9) * (tail / max(size, tail / 10**9)) ** (mp.mpf(1) / (rule.s - 1)))
            if size > 4 * tail:
                h = step * min(max(factor, 0.1), 0.9)
                continue
            u, z = u + step * mp.fdot(rule.b, v), z - w2 * step * mp.fdot(rule.b, met[0])
            t = end if last else t + step
            h = step * min(max(factor, 0.3), 3) if not last or factor < 1 else max(h, step)
        found.append((u, g * (u - u**3 / 3) + z))
    return found


def stages(rule: Gauss, g: Any, w2: Any, u: Any, z: Any, h: Any) -> tuple[list[Any], list[Any]] | None:
    """u and z at the nodes, by a Newton iteration whose matrix is one of doubles."""
    us = [u] * rule.s
    best = mp.inf
    for _ in range(60):
        zs = [z - w2 * h * mp.fdot(row, us) for row in rule.a]
        v = [g * (x - x**3 / 3) + y for x, y in zip(us, zs, strict=True)]
        lacks = [x - u - h * mp.fdot(row, v) for x, row in zip(us, rule.a, strict=True)]
        size = max(map(abs, lacks))
        if size == 0:
            return us, zs
        at = np.array([float(x) for x in us])
        a = float(h) * rule.double
        matrix = np.eye(rule.s) - a @ (np.diag(float(g) * (1 - at) * (1 + at)) - float(w2) * a)
        change = np.linalg.solve(matrix, np.array([float(x / size) for x in lacks]))
        if not np.all(np.isfinite(change)):
            return None
        us = [x - size * mp.mpf(c) for x, c in zip(us, change, strict=True)]
        off = size * float(np.max(np.abs(change)))
        if off < mp.mpf(10) ** -50 or (off < mp.mpf(10) ** -42 and off > best / 4):
            return us, [z - w2 * h * mp.fdot(row, us) for row in rule.a]
        best = min(best, off)
    return None


def taylor(g: Any, w2: Any, u: Any, v: Any, times: list[Any], order: int = 50) -> list[tuple[Any, Any]]:
    """(u, u') at times by series in time."""
    t, found = mp.mpf(0), []
    for end in times:
        while t < end:
            a, b = [u], [v]
            square: list[Any] = []
            for j in range(order):
                square.append(mp.fdot(a, a[::-1]))
                a.append(b[j] / (j + 1))
                b.append((g * (b[j] - mp.fdot(square, b[j::-1])) - w2 * a[j]) / (j + 1))
            ratio = max(abs(b[-1]), abs(b[-2])) / max(abs(b[0]), abs(b[1]) / g)
            h = min((mp.mpf(10) ** -34 / ratio) ** (mp.mpf(1) / order), end - t)
            u, v = (mp.polyval(x[::-1], h) for x in (a, b))
            t = end if h == end - t else t + h
        found.append((u, v))
    return found


def rows() -> list[dict[str, Any]]:
    """The states of the scene at every mu."""
    table = tomllib.loads((ROOT / "data" / "scenes" / "van-der-pol.toml").read_text(encoding="utf-8"))
    m, q, p = (mp.mpf(table["particle"][0][x]) for x in ("mass", "position", "momentum"))
    k, width = mp.mpf(table["spring"][0]["stiffness"]), mp.mpf(table["van-der-pol"][0]["width"])
    routes = Gauss(24), Gauss(30)
    g = mp.mpf(10) ** 6
    again = solve(routes[0], g, g, mp.mpf(2), -g * (2 - mp.mpf(8) / 3), [mp.mpf(2)], mp.mpf(10) ** -30)[0]
    for known in TEST_SET:
        assert all(abs(x - mp.mpf(y)) < 3 * mp.mpf(10) ** -14 for x, y in zip(again, known, strict=True)), (
            again
        )
    found = []
    for mu in MU:
        # the doubles that a scene would hold
        c = float(mu * mp.sqrt(k * m))
        unit = mp.mpf(c) / k * max(1, 10 / mu)
        times = [float(unit * share) for share in SHARES]
        g, w2, u = mp.mpf(c) / m, k / m, q / width
        z = p / m / width - g * (u - u**3 / 3)
        exact = [mp.mpf(t) for t in times]
        one, other = (
            solve(rule, g, w2, u, z, exact, mp.mpf(10) ** -e)
            for rule, e in zip(routes, (30, 34), strict=True)
        )
        pairs = [(one, other, 18)]
        if mu <= 30:
            pairs.append((taylor(g, w2, u, p / m / width, exact), other, 24))
        for first, second, digits in pairs:
            for a, b in zip(first, second, strict=True):
                assert all(abs(x - y) <= mp.mpf(10) ** -digits * abs(y) for x, y in zip(a, b, strict=True)), (
                    mu
                )
        for t, (u1, v1) in zip(times, other, strict=True):
            q1, p1 = (mp.nstr(x, 25, strip_zeros=False) for x in (u1 * width, v1 * width * m))
            found.append({"mu": mu, "coefficient": c, "time": t, "q": q1, "p": p1})
        print(f"mu = {mu:g}: made", flush=True)
    return found


def compare(found: list[dict[str, Any]]) -> None:
    """What springcheck is off by."""
    import springcheck
    from springcheck.physics import exact

    scene = springcheck.load_scene("van-der-pol")
    spring: Any
    brake: Any
    spring, brake = scene.terms
    for mu in MU:
        worst = 0.0
        for row in (row for row in found if row["mu"] == mu):
            one = replace(
                scene, terms=(spring, replace(brake, c=[row["coefficient"]])), step=row["time"], steps=1
            )
            q, p = (x[0, 0] for x in exact.true_motion(one, np.array([1]), one.step))
            assert one.system.solution is not None
            stated = one.system.solution.doubt(row["time"])
            off = [
                abs(x - np.longdouble(row[key])) / y[0]
                for x, key, y in zip((q, p), "qp", stated, strict=True)
            ]
            worst = max(worst, *map(float, off))
        print(f"mu = {mu:g}: {worst:.2g} of what is stated")


def main() -> None:
    """Write the references, or compare springcheck's own with those that are stored."""
    if arguments(__doc__, write=False).write:
        text = {
            "origin": "validation/van_der_pol.py, mpmath with 60 digits, 25 of them kept",
            "states": rows(),
        }
        TARGET.write_text(json.dumps(text, indent=1) + "\n", encoding="utf-8")
    compare(json.loads(TARGET.read_text(encoding="utf-8"))["states"])


if __name__ == "__main__":
    script(main)
