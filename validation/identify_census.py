"""Claim: `identify` names scheme, stride and precision of every known scheme, from states alone.

For each scheme random springs (m over four decades, h over four, h w log-uniform from 0.02 to 1.5 or
0.95 of the limit of stability, any start, 1 to 8 steps to a frame, 101 frames), with mass and stiffness
stated.  Measured:

* double precision, 200 springs for each of 17 schemes: every one right in scheme, stride and precision, and
  alone, but 63 of 200 exact flows, where others were not excluded;
* numbers rounded to single precision, 200 springs for each of the 14 schemes up to Yoshida's (frictional
  schemes and the exact flow were not measured): all right for the ten schemes up to second order, and none
  wrong without saying so at higher orders: where the error of a step is below the rounding, the exact
  flow or RK4 is named, and the right one is said not to be excluded: RK4 43 of 200, Ruth 3, Forest-Ruth 31,
  Yoshida 22.  There 13, 3, 8 and 16 of the springs are called "single" and not "double, stored in single";
* text of 6 digits, 50 springs for each of 17 schemes: all right up to second order and with friction, and
  likewise the right one not excluded for RK4 20 of 50, Ruth 12, Forest-Ruth 13, Yoshida 11.

Command: python validation/identify_census.py [double|single|text] [springs]
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

from springcheck.errors import IdentificationError
from springcheck.identify import identify
from springcheck.identify.search import aliases
from springcheck.model import Floats
from springcheck.schemes import SCHEMES, step

FRAMES = 101
FRICTION = 0.07
"""gamma h of the schemes that have friction."""


def motion(name: str, rng: np.random.Generator) -> tuple[Floats, Floats, Floats, Floats, Floats, int]:
    """Times, positions, momenta, mass, stiffness and steps per frame of one random spring."""
    scheme = SCHEMES[name]
    highest = min(1.5, 0.95 * scheme.limit) if scheme.limit > 0 else 1.5
    m, h = 10 ** rng.uniform(-2, 2, 1), float(10 ** rng.uniform(-3, 1))
    x = np.exp(rng.uniform(np.log(0.02), np.log(highest), 1))
    k = m * (x / h) ** 2
    q = rng.normal(size=1) * 10 ** rng.uniform(-1, 2)
    p = rng.normal(size=1) * m * x / h * np.abs(q)
    if scheme.flow:
        t = np.asarray(np.arange(FRAMES) * h, dtype=np.float64)
        w = np.sqrt(k.astype(np.longdouble) / m)
        c, s = np.cos(w * t[:, None]), np.sin(w * t[:, None])
        return t, (q * c + p / (m * w) * s).astype(float), (p * c - m * w * q * s).astype(float), m, k, 1
    stride = int(rng.integers(1, 9))
    rate = np.full(1, FRICTION / h) if name.startswith("langevin") else None
    states = [(q, p)]
    for _ in range(FRAMES - 1):
        for _ in range(stride):
            new = step(scheme, q, p, h=h, m=m, force=lambda q, p: -k * q, stiffness=np.diag(k), rate=rate)
            q, p = (np.asarray(x, dtype=np.float64) for x in new)
        # a scheme that grows without bound leaves the range of single precision, and the file ends
        if not max(abs(q[0]), abs(p[0])) < 1e30:
            break
        states.append((q, p))
    qs, ps = (np.array([state[i] for state in states]) for i in (0, 1))
    return np.asarray(np.arange(len(states)) * (stride * h), dtype=np.float64), qs, ps, m, k, stride


def written(x: Floats, form: str) -> Floats:
    """Numbers as a file of this form returns them."""
    if form == "single":
        return x.astype(np.float32).astype(np.float64)
    if form == "text":
        return np.array([[float(f"{y:.6g}") for y in row] for row in x])
    return x


def main() -> None:
    """Print, scheme by scheme, what the springs were taken for."""
    form = sys.argv[1] if len(sys.argv) > 1 else "double"
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 200
    names = [
        scheme.name for scheme in SCHEMES.values() if (scheme.one_step and not scheme.mixes) or scheme.flow
    ]
    for number, name in enumerate(names):
        rng = np.random.default_rng([number, 2026])
        seen: Counter[str] = Counter()
        for _ in range(count):
            t, q, p, m, k, stride = motion(name, rng)
            try:
                found = identify(t, written(q, form), written(p, form), mass=m, stiffness=k)
            except IdentificationError as error:
                seen[f"refused: {error}"] += 1
                continue
            same = {name, *aliases(name)}
            steps = "" if stride == 1 else f", {stride} steps a frame"
            if found.scheme in same and found.stride == stride:
                alone = "" if len(found.candidates) == 1 else ", others not excluded"
                seen[f"right{alone}; {found.precision}; {'fits' if found.fits else 'does not fit'}"] += 1
            elif any(f"{x}{steps}" in found.candidates for x in same):
                seen[f"called {found.scheme}, right one not excluded; {found.precision}"] += 1
            else:
                seen["WRONG"] += 1
                hw = float(np.sqrt(k[0] / m[0]) * t[1] / stride)
                print(
                    f"  WRONG: {found.scheme}, {found.stride} for {name}, {stride}; h w = {hw:.4g}",
                    flush=True,
                )
        print(f"{name:32s}", "; ".join(f"{n} {what}" for what, n in seen.most_common()), flush=True)


if __name__ == "__main__":
    main()
