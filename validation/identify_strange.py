"""Claim: whatever is recorded, `identify` says something of it or refuses it in one line.

    python validation/identify_strange.py [FIRST COUNT]

Records are drawn at random: of 5 to 60 frames and up to 3 coordinates, each column still, constant, turning,
dying or growing, straight, noise, one jump, or of one decimal, of any size; a third in single precision, a
fifth far from 0, one in seven with a frame that is off; with velocities, momenta or neither, masses,
stiffnesses and steps that are true or not.  What ends in another exception than IdentificationError,
or makes NumPy warn, is printed, and the status is 1.

0 to 5549 without what is caught now: 0.8 % ended in an exception of NumPy or SciPy.  With it, of 0 to 2999,
20000 to 21999 and 30000 to 31999, 5,621 were answered, 1,379 refused, and none ended otherwise.
"""

from __future__ import annotations

import warnings
from collections import Counter
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck.errors import IdentificationError
from springcheck.identify import identify
from springcheck.physics.arrays import Floats


def drawn(number: int) -> dict[str, Any]:
    """One record, and what is stated of it: the arguments of `identify`."""
    rng = np.random.default_rng([7, number])
    frames, n = int(rng.integers(5, 61)), int(rng.integers(1, 4))
    t = np.arange(frames) * 10 ** rng.uniform(-3, 3)
    phase: Floats = np.arange(frames) * 10.0 ** float(rng.uniform(-3, 1.2))
    q, v = (np.stack([_column(rng, phase) for _ in range(n)], axis=1) for _ in range(2))
    if rng.random() < 0.4:
        v = np.gradient(q, t, axis=0)
    out: dict[str, Any] = {"t": t, "q": q}
    if (kind := rng.random()) > 0.15:
        out["p" if kind < 0.3 else "v"] = v
    for name, share in (("mass", 0.5), ("stiffness", 0.3)):
        if rng.random() < share:
            out[name] = 10 ** rng.uniform(-3, 3)
    if rng.random() < 0.2:
        out["step"] = t[1] / int(rng.integers(1, 5))
    return out


def _column(rng: np.random.Generator, phase: Floats) -> Floats:
    """Numbers (f,) of one of the kinds."""
    i, turns = np.arange(len(phase)), np.cos(phase + rng.uniform(0, 7))
    kinds: tuple[Any, ...] = (
        0.0 * i, 0.0 * i + 1, turns, np.exp(-rng.uniform(0, 5) * i), 1.0 * i, rng.normal(size=len(i)),
        1.0 + (i >= rng.integers(1, len(i))), np.round(turns, 1), turns * np.exp(rng.uniform(-0.3, 0.3) * i),
    )  # fmt: skip
    x: Floats = kinds[int(rng.integers(len(kinds)))]
    if rng.random() < 0.3:
        x = x.astype(np.float32).astype(np.float64)
    if rng.random() < 0.2:
        x = x + 10 ** rng.uniform(-12, 6)
    if rng.random() < 0.15:
        x = np.where(i == rng.integers(len(i)), x * 10 ** rng.uniform(-3, 3), x)
    return np.asarray(x * 10 ** rng.uniform(-8, 8))


def said(number: int) -> str:
    """Whether a record is answered or refused, or the exception that it ends in."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            identify(**drawn(number))
        except IdentificationError:
            return "refused"
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    return "answered"


def main() -> int:
    """Print what was said, and the numbers of all that ended otherwise."""
    given, counts = arguments(__doc__, first=0, count=2000), Counter[str]()
    for number in range(given.first, given.first + given.count):
        counts[what := said(number)] += 1
        if what not in ("answered", "refused"):
            print(number, what)
    print("; ".join(f"{count} {what}" for what, count in counts.most_common()))
    return int(len(set(counts) - {"answered", "refused"}) > 0)


if __name__ == "__main__":
    script(main)
