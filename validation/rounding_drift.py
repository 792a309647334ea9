"""Why no verdict fits a slope to the shadow energy of a single run: right rounding drifts as well.

Claim: where h, k and m are short decimals the shadow energies of engines that round every kick and every
drift by itself drift by up to 6e-18 a step, more than 5 standard errors of a single run.  A limit above that,
and 5 standard errors more, would not see a friction or heating of 1e-17 a step for certain.

    python validation/rounding_drift.py [RUNS STEPS]

Springs of three kinds (short decimals, as scenes are written; binary fractions; numbers of all digits) are
moved by three splittings in double precision, in the order of operations of the own methods.  The drift is
the mean of 64 equal parts of the run, the best estimate of a walk; their scatter is its standard error: over
20,480 steps 6e-19 (semi-implicit Euler) or 9e-19 (Verlet) a step, so that 5 of them would see 1e-17.

Of 1,998 runs of 20,480 steps 3 would raise an alarm (drifts up to 5.9e-18 a step), of 1,998 of 163,840 steps
20 (up to 5.2e-18), all of them of short decimals.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from arguments import arguments, script
from springcheck import schemes
from springcheck.physics.arrays import Floats, Reals

NAMES = ("semi-implicit-euler", "velocity-verlet", "position-verlet")
KINDS = ("decimals", "binary fractions", "all digits")
PARTS = 64
SIGMAS = 5.0


def springs(kind: str, n: int, rng: np.random.Generator) -> tuple[Floats, ...]:
    """h, k, m, q and p of springs, (n,) each; h w below 1.3."""
    if kind == "all digits":
        m, k = (10 ** rng.uniform(-3, 3, n) for _ in range(2))
        q, p = rng.normal(size=n), rng.normal(size=n) * np.sqrt(m * k)
        return 10 ** rng.uniform(-3, 0.1, n) * np.sqrt(m / k), k, m, q, p
    if kind == "decimals":
        m, k = (rng.integers(1, 13, n) / rng.choice([1.0, 4.0, 10.0], n) for _ in range(2))
        h = rng.choice([0.01, 0.02, 0.05, 0.1, 0.2, 0.25, 0.3], n)
    else:
        m, k, h = (np.ldexp(1.0, rng.integers(low, high, n)) for low, high in ((-3, 4), (-3, 4), (-10, 1)))
    q, p = (rng.integers(1, 40, n) / (10 if kind == "decimals" else 8) for _ in range(2))
    return np.where(h * np.sqrt(k / m) > 1.3, h / 16, h), k, m, q, p


def drifts(name: str, steps: int, numbers: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Relative drift of the shadow energies a step, and its standard error, (n,) each."""
    h, k, m, *start = numbers
    q: Reals
    p: Reals
    q, p = start
    stages = [(kind == "kick", schemes.number(c, np.longdouble)) for kind, c in schemes.SCHEMES[name].stages]

    def moved(q: Reals, p: Reals) -> tuple[Reals, Reals]:
        for kick, c in stages:
            ch = (c * h).astype(q.dtype)
            if kick:
                p = p + ch * (-k * q)
            else:
                q = q + ch * (p / m)
        return q, p

    one, none = np.ones(len(h), np.longdouble), np.zeros(len(h), np.longdouble)
    (a, c), (b, d) = moved(one, none), moved(none, one)

    def energy() -> Reals:
        x, y = q.astype(np.longdouble), p.astype(np.longdouble)
        return np.asarray(-c * x * x + (a - d) * x * y + b * y * y)

    kept = [energy()]
    for _ in range(PARTS):
        for _ in range(steps // PARTS):
            q, p = moved(q, p)
        kept.append(energy())
    part = np.asarray(np.diff(kept, axis=0) / kept[0], np.float64) / (steps // PARTS)
    return np.mean(part, axis=0), np.std(part, axis=0, ddof=1) / np.sqrt(PARTS)


def main() -> int:
    """Print what each kind and scheme comes to; 1 where no right run drifts, and the claim is void."""
    asked = arguments(__doc__, runs=2000, steps=20480)
    rng = np.random.default_rng(12)
    n, every = max(1, asked.runs // (len(NAMES) * len(KINDS))), 0
    for kind in KINDS:
        for name in NAMES:
            mean, error = drifts(name, asked.steps, springs(kind, n, rng))
            far = np.abs(mean) > SIGMAS * error
            every += int(np.count_nonzero(far))
            most = np.max(np.abs(mean[far]), initial=0)
            said = (
                f"standard error {np.median(error):.1e}: {np.count_nonzero(far):3} beyond {SIGMAS:g} of them"
            )
            print(f"{kind:17} {name:20} {n} runs, {said}, by {most:.1e} a step at most", flush=True)
    print(f"{every} of {n * len(NAMES) * len(KINDS)} right runs would raise an alarm")
    return int(every == 0)


if __name__ == "__main__":
    script(main)
