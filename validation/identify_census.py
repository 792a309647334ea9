"""Claim: `identify` names scheme, stride and precision from states alone, and never names another scheme.

For each scheme random springs (m over four decades, h over four, h w log-uniform from 0.02 to 1.5 or
0.95 of the limit of stability, any start, 1 to 8 steps to a frame, 101 frames; friction gamma h = 0.07),
with mass and stiffness stated.  A name that is not the scheme's, a list without it, and "no scheme" are
wrong.  Measured, nothing wrong in any of them:

* double precision, 100 springs for each of 17 schemes: all named, with stride and as
  "double", but 44 exact flows, which schemes of up to 100 steps a frame come as near to;
* numbers rounded to single precision, 50 springs for each of the ten schemes up to second order and 100 for
  each of the seven others: all named up to second order, with friction, Ruth and Yoshida; not told apart
  were RK4 9 of 100, Forest-Ruth 3 and the exact flow 87.  All are "double, stored in single" but one, an
  implicit Euler that dies down in a few frames, of which it is said that it does not show;
* text of 6 digits, 30 and 50 springs: all named up to second order and with friction; not told apart were RK4
  16 of 50, Ruth 2, Forest-Ruth 10, Yoshida 6 and the exact flow 50, and RK4 1 and Ruth 2 named without their
  number of steps to a frame;
* arithmetic of single precision ("computed-single", 30 springs, 16 schemes, no stiffness stated, so that
  position Verlet, the implicit midpoint and the trapezoidal rule have one map): all "single"; 299 named, 179
  not told apart, 2 named without their number of steps.

Command: python validation/identify_census.py [double|single|text|computed-single|computed-single-text]
[springs] [scheme ...]
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from arguments import arguments
from springcheck.arrays import Floats, Reals
from springcheck.errors import IdentificationError
from springcheck.identify import Identification, identify
from springcheck.identify.search import aliases
from springcheck.schemes import SCHEMES, step

FRAMES = 101
FRICTION = 0.07
"""gamma h of the schemes that have friction."""

FORMS = ("double", "single", "text", "computed-single", "computed-single-text")


def motion(
    name: str, rng: np.random.Generator, width: type = np.float64
) -> tuple[Floats, Floats, Floats, Floats, Floats, int]:
    """Times, positions, momenta, mass, stiffness and steps per frame of one random spring, moved by
    arithmetic of this width."""
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
    # a coarser arithmetic keeps its constants so, too; what is stated is what it has
    m, k = (x.astype(width).astype(float) for x in (m, k))
    q, p = q.astype(width), p.astype(width)
    stiff: Reals = k.astype(width)
    states = [(q, p)]
    for _ in range(FRAMES - 1):
        for _ in range(stride):
            new = step(scheme, q, p, h=h, m=m, force=lambda q, p: -stiff * q, stiffness=np.diag(k), rate=rate)
            q, p = (np.asarray(x, dtype=width) for x in new)
        # a scheme that grows without bound leaves the range of single precision, and the file ends
        if not max(abs(q[0]), abs(p[0])) < 1e30:
            break
        states.append((q, p))
    qs, ps = (np.array([state[i] for state in states], dtype=np.float64) for i in (0, 1))
    return np.asarray(np.arange(len(states)) * (stride * h), dtype=np.float64), qs, ps, m, k, stride


def written(x: Floats, form: str) -> Floats:
    """Numbers as a file of this form returns them."""
    if form == "single":
        return x.astype(np.float32).astype(np.float64)
    if form.endswith("text"):
        return np.array([[float(f"{y:.6g}") for y in row] for row in x])
    return x


def judged(name: str, stride: int, found: Identification) -> tuple[str, bool]:
    """What was said, in words, and whether it is wrong: a name that is another's, or a list without it."""
    same = {name, *aliases(name)}
    listed = any(x.scheme in same and x.stride == stride for x in found.candidates)
    if found.verdict == "none":
        return "taken for no scheme", True
    said = f"{found.precision}; {'fits' if found.fits else 'does not fit'}"
    if found.verdict == "not told apart":
        return (f"not told apart; {said}", False) if listed else (f"LISTED WITHOUT IT; {said}", True)
    if found.scheme not in same or not listed:
        return f"WRONG: {found.scheme}, {found.stride}; {said}", True
    return f"{'named' if found.stride else 'named without its stride'}; {said}", False


def main() -> None:
    """Print, scheme by scheme, what the springs were taken for."""
    given = arguments(__doc__, form="double", count=200, schemes=[])
    form, count, chosen = given.form, given.count, given.schemes
    if form not in FORMS:
        raise SystemExit(f"form {form!r}: one of {', '.join(FORMS)}")
    width = np.float32 if form.startswith("computed") else np.float64
    # the exact flow is evaluated, not computed step by step
    flow = width is np.float64
    names = [
        scheme.name
        for scheme in SCHEMES.values()
        if (scheme.one_step and not scheme.mixes) or (scheme.flow and flow)
    ]
    everything: Counter[str] = Counter()
    for number, name in enumerate(names):
        if chosen and name not in chosen:
            continue
        rng = np.random.default_rng([number, 2026])
        seen: Counter[str] = Counter()
        for _ in range(count):
            t, q, p, m, k, stride = motion(name, rng, width)
            stated = None if form.startswith("computed") else k
            try:
                found = identify(t, written(q, form), written(p, form), mass=m, stiffness=stated)
            except IdentificationError as error:
                seen[f"refused: {error}"] += 1
                continue
            said, wrong = judged(name, stride, found)
            seen[said] += 1
            if wrong or not found.fits:
                x = float(np.sqrt(k[0] / m[0]) * t[1] / stride)
                print(f"  {name}, {stride} steps, h w = {x:.4g}, {len(t)} frames: {said}", flush=True)
        print(f"{name:32s}", "; ".join(f"{n} {what}" for what, n in seen.most_common()), flush=True)
        for said, n in seen.items():
            everything[said.split(";")[0]] += n
    print("all", dict(everything))


if __name__ == "__main__":
    main()
