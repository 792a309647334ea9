"""Limits of stability and largest steps by a second route: matrices in mpmath with 40 digits.

Claim: the limit of every explicit scheme of the catalogue is the first h w at which an eigenvalue of its step
on a spring exceeds 1; and the largest step of r-RESPA on `multiple-time-steps` is where an eigenvalue of the
product of its parts does.  The printed numbers are these, rounded down.

Command: python validation/limits.py        (half a minute)

Expected: every line agrees to 1e-9: 2 for the Verlet family, 1.5734019 for Forest-Ruth and Yoshida, 2.8284271
for RK4, 2.5074811 for Ruth's third order, and 0.34679839 for r-RESPA.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import mpmath as mp

from arguments import arguments, script
from springcheck import load_scene, schemes
from springcheck.schemes import Scheme
from springcheck.studies.stability.longest import longest
from springcheck.text.wording import rounded_down

mp.mp.dps = 40
POINTS, MOST, ALLOWED = 4000, 4.0, 1e-9
NO_GROWTH = 1e-25
"""Excess of an eigenvalue over 1 that is rounding."""


def coefficient(c: object) -> mp.mpf:
    """A coefficient of a scheme, a fraction or decimals."""
    numerator, denominator = getattr(c, "numerator", None), getattr(c, "denominator", None)
    return mp.mpf(str(c)) if numerator is None else mp.mpf(numerator) / denominator


def step(scheme: Scheme, x: mp.mpf) -> mp.matrix:
    """One step on a spring of h w = x, in units of the step."""
    if scheme.stages:
        out = mp.eye(2)
        for kind, c in scheme.stages:
            a = coefficient(c) * x
            out = (mp.matrix([[1, 0], [-a, 1]]) if kind == "kick" else mp.matrix([[1, a], [0, 1]])) * out
        return out
    slopes: list[Any] = []
    motion = x * mp.matrix([[0, 1], [-1, 0]])
    for row in scheme.a:
        inner = mp.eye(2)
        for c, k in zip(row, slopes, strict=False):
            inner += coefficient(c) * k
        slopes.append(motion * inner)
    return mp.eye(2) + sum((coefficient(c) * k for c, k in zip(scheme.b, slopes, strict=True)), mp.zeros(2))


def growth(matrix: mp.matrix) -> mp.mpf:
    """The largest size of an eigenvalue, less 1."""
    if matrix.rows == 2:
        half, area = (matrix[0, 0] + matrix[1, 1]) / 2, mp.det(matrix)
        return mp.mpf(max(abs(half + s * mp.sqrt(mp.mpc(half**2 - area))) for s in (1, -1)) - 1)
    return max(abs(x) for x in mp.eig(matrix)[0]) - 1


def first(grows: Callable[[mp.mpf], mp.mpf], most: float = MOST, points: int = POINTS) -> mp.mpf:
    """The first point of growth beyond `NO_GROWTH`, by a scan and bisection."""
    grid = [mp.mpf(most) * i / points for i in range(1, points + 1)]
    low, high = next(((a, b) for a, b in pairwise(grid) if grows(b) > NO_GROWTH), (mp.inf, mp.inf))
    while mp.isfinite(high) and high - low > 1e-20:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) > NO_GROWTH else (middle, high)
    return mp.mpf(low)


def respa(h: mp.mpf) -> mp.matrix:
    """Velocity Verlet of the slow spring around 8 steps of the fast one, on `multiple-time-steps`."""
    scene = load_scene("multiple-time-steps")
    m = [mp.mpf(float(x)) for x in scene.m]
    wall, bond = (mp.mpf(float(x.parameters[0][0])) for x in scene.terms)
    slow, fast = mp.matrix([[wall, 0], [0, 0]]), mp.matrix([[bond, -bond], [-bond, bond]])

    def kick(k: mp.matrix, t: mp.mpf) -> mp.matrix:
        out = mp.eye(4)
        out[2:, :2] = -t * k
        return out

    drift = mp.eye(4)
    drift[0, 2], drift[1, 3] = h / 8 / m[0], h / 8 / m[1]
    inner = kick(fast, h / 16) * drift * kick(fast, h / 16)
    return kick(slow, h / 2) * inner**8 * kick(slow, h / 2)


def main() -> int:
    """Compare every limit; 1 where one differs."""
    arguments(__doc__)
    wrong = 0
    for scheme in schemes.SCHEMES.values():
        plain = scheme.has("plain") or (scheme.b and scheme.has("explicit"))
        if plain and 0 < scheme.limit < MOST:
            found = first(lambda x, s=scheme: growth(step(s, x)))  # type: ignore[misc]
            off = abs(found / scheme.limit - 1)
            wrong += not off < ALLOWED
            print(f"{scheme.name:32}{rounded_down(scheme.limit):>14}  differs by {float(off):.0e}")
    scene = load_scene("multiple-time-steps")
    ours = longest(schemes.scheme("respa8"), scene)
    # the first resonance is 0.7 % wide
    off = abs(first(lambda h: growth(respa(h)), 0.4, 800) / ours - 1)
    wrong += not off < ALLOWED
    print(f"{'respa8 on ' + scene.name:32}{rounded_down(ours):>14}  differs by {float(off):.0e}")
    print(f"{wrong} differences above {ALLOWED:.0e}")
    return int(bool(wrong))


if __name__ == "__main__":
    script(main)
