"""The own methods run about as fast as C, and a short run does not pay for a compiler.

Claim, each a ratio of times taken side by side in this run (C with the same operations, the division by
the mass included, and every number known at run time only):

* one spring, 1e8 unrecorded steps: at most 1.2 times C at -O2 -ffp-contract=off;
* one spring, every step recorded: at most 2 times that unrecorded C;
* 4096 springs: at most 1.5 times C at -O3 -march=native -ffp-contract=off;
* a chain of 1,000 masses: at most 2 times a loop written by hand with NumPy; the cost of a spring and
  step stays within the cost of memory (cache, then main memory) up to 1e6 masses;
* 200 steps of one spring are interpreted and import no numba.

Command: python validation/kernel_speed.py        (40 s; without a C compiler `cc` its ratios are left out)

Expected (AMD EPYC, Zen 4, one core, gcc 12, numba 0.68; nanoseconds a spring and step, minimum of 5 to 7):

                                        explicit   semi-implicit   implicit
    one spring, unrecorded                   3.8             7.6         11
    one spring, every step recorded          3.9             7.7         11
    C -O2, unrecorded                        5.9             7.6         11
    unrecorded / C                          0.64            1.00       1.03
    recorded / unrecorded C                 0.66            1.01       0.97
    4096 springs                            0.31            0.31       0.31
    C -O3 -march=native                     0.32            0.32       0.32
    4096 springs / C                        0.99            0.99       0.98
    chain of 1,000 masses                    2.1             2.1        6.1
    chain of 1,000,000 masses                2.7             2.7        6.8

A chain of 1,000 by NumPy takes 7.3, of 1,000,000 3.8: ratios 0.29 and 0.71.  200 interpreted steps take
75 us, start included.  Exit status 0 when every ratio holds, 1 otherwise.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from arguments import arguments
from springcheck.arrays import Floats
from springcheck.engines.own import simulation
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, Term, WallSpring

METHODS = ("euler", "semi-implicit-euler", "implicit-euler")
REPEATS = 7
STEPS = 100_000_000
RECORDED = 10_000_000
CHUNK = 50_000
SPRINGS, SPRING_STEPS, FRAMES = 4096, 5_000, 500
H = 0.01

C = """
#define LOOP(name, body) \\
void name(long steps, double h, double m, double k, double d, double *state) { \\
    double q = state[0], p = state[1]; \\
    for (long i = 0; i < steps; i++) { body } \\
    state[0] = q; state[1] = p; \\
}
LOOP(one_euler, double x = q; q = x + (p / m) * h; p = p + (-k * x) * h;)
LOOP(one_semi_implicit_euler, p = p + (-k * q) * h; q = q + (p / m) * h;)
LOOP(one_implicit_euler, p = (p + (-k * q) * h) * d; q = q + (p / m) * h;)

#define SWEEP(name, body) \\
void name(long steps, long n, double h, const double *restrict m, const double *restrict k, \\
          const double *restrict d, double *restrict q, double *restrict p) { \\
    for (long i = 0; i < steps; i++) \\
        for (long j = 0; j < n; j++) { body } \\
}
SWEEP(many_euler, double x = q[j]; q[j] = x + (p[j] / m[j]) * h; p[j] = p[j] + (-k[j] * x) * h;)
SWEEP(many_semi_implicit_euler,
      double x = p[j] + (-k[j] * q[j]) * h; p[j] = x; q[j] = q[j] + (x / m[j]) * h;)
SWEEP(many_implicit_euler,
      double x = (p[j] + (-k[j] * q[j]) * h) * d[j]; p[j] = x; q[j] = q[j] + (x / m[j]) * h;)
"""


def compiled_c(folder: Path, *flags: str) -> ctypes.CDLL:
    """The C loops, compiled with these flags."""
    source, library = folder / "loops.c", folder / f"loops{''.join(flags)}.so"
    source.write_text(C)
    subprocess.run(
        ["cc", *flags, "-ffp-contract=off", "-shared", "-fPIC", "-o", str(library), str(source)], check=True
    )
    return ctypes.CDLL(str(library))


def in_turn(jobs: dict[str, Callable[[], None]], repeats: int = REPEATS) -> dict[str, Floats]:
    """Seconds of each job, (repeats,) sorted; one warm-up, and the jobs in turn within every repeat."""
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for repeat in range(repeats + 1):
        for name, job in jobs.items():
            begin = perf_counter()
            job()
            if repeat:
                seconds[name].append(perf_counter() - begin)
    return {name: np.sort(found) for name, found in seconds.items()}


def line(name: str, seconds: Floats, each: float) -> None:
    """Print minimum and quartiles in nanoseconds per `each`."""
    low, first, median, third = (
        float(x) / each * 1e9 for x in (seconds[0], *np.percentile(seconds, (25, 50, 75)))
    )
    print(f"  {name:42s} {low:9.3f} {first:9.3f} {median:9.3f} {third:9.3f}")


def ratio(name: str, seconds: float, reference: float, bound: float) -> bool:
    """Print a ratio of minima against its bound."""
    value = seconds / reference
    print(f"  {name:42s} {value:9.3f} {'<=' if value <= bound else 'NOT <='} {bound:g}")
    return value <= bound


def head(title: str, unit: str) -> None:
    """Print the head of a table."""
    print(f"\n{title}\n  {unit:42s} {'min':>9} {'25 %':>9} {'50 %':>9} {'75 %':>9}")


def scene(m: Floats, q: Floats, p: Floats, terms: tuple[Term, ...], steps: int) -> Scene:
    """A scene of these particles and terms."""
    return Scene(name="speed", title="", source="", m=m, q=q, p=p, terms=terms, step=H, steps=steps)


def springs(n: int, steps: int) -> Scene:
    """`n` springs of different strength, each with its own particle."""
    rng = np.random.default_rng(7)
    walls = WallSpring(i=np.arange(n), k=rng.uniform(1, 3, n), at=np.zeros(n))
    return scene(rng.uniform(1, 4, n), rng.normal(size=n), rng.normal(size=n), (walls,), steps)


def chain(n: int, steps: int) -> Scene:
    """`n` different masses between two walls."""
    rng = np.random.default_rng(8)
    ends = WallSpring(i=np.array([0, n - 1]), k=rng.uniform(1, 3, 2), at=np.array([-1.0, float(n)]))
    links = Spring(a=np.arange(n - 1), b=np.arange(1, n), k=rng.uniform(1, 3, n - 1), rest=np.ones(n - 1))
    q = np.arange(n) + rng.normal(size=n)
    return scene(rng.uniform(1, 4, n), q, rng.normal(size=n), (ends, links), steps)


def doubles(x: Floats) -> ctypes.Array[ctypes.c_double]:
    """A pointer to an array's numbers."""
    return x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))  # type: ignore[return-value]


def one_spring(c: ctypes.CDLL | None) -> bool:
    """One spring, unrecorded and recorded, against C."""
    passed = True
    one = springs(1, STEPS)
    m, k = float(one.m[0]), float(one.terms[0].k[0])  # type: ignore[attr-defined]
    for method in METHODS:
        own = simulation.prepare(one, method, H, compiled=True)
        last_q, last_p = np.empty((1, 1)), np.empty((1, 1))
        rows_q, rows_p = np.empty((CHUNK, 1)), np.empty((CHUNK, 1))
        state = np.array([one.q[0], one.p[0]])

        def record(own: simulation.Own = own, q: Floats = rows_q, p: Floats = rows_p) -> None:
            for _ in range(RECORDED // CHUNK):
                own.advance(1, q, p)

        def bare_c(name: str = "one_" + method.replace("-", "_"), state: Floats = state) -> None:
            inverse = 1 / (1 + H * H * (k / m))
            numbers = [ctypes.c_double(x) for x in (H, m, k, inverse)]
            getattr(c, name)(ctypes.c_long(STEPS), *numbers, doubles(state))

        jobs: dict[str, Callable[[], None]] = {
            "unrecorded": partial(own.advance, STEPS, last_q, last_p),
            "recorded": record,
        }
        if c:
            jobs["C"] = bare_c
        found = in_turn(jobs, 5)
        head(f"own:{method}, one spring", "ns a step")
        line("unrecorded", found["unrecorded"], STEPS)
        line("every step recorded", found["recorded"], RECORDED)
        if c:
            line("C -O2, unrecorded", found["C"], STEPS)
            reference = found["C"][0] / STEPS
            passed &= ratio("unrecorded / C", found["unrecorded"][0] / STEPS, reference, 1.2)
            passed &= ratio("recorded / C unrecorded", found["recorded"][0] / RECORDED, reference, 2.0)
    return passed


def many_springs(c: ctypes.CDLL | None) -> bool:
    """4096 springs side by side, against C."""
    passed = True
    many = springs(SPRINGS, SPRING_STEPS)
    k = many.terms[0].k  # type: ignore[attr-defined]
    inverse = 1 / (1 + H * H * (k / many.m))
    each = SPRINGS * SPRING_STEPS
    for method in METHODS:
        own = simulation.prepare(many, method, H, compiled=True)
        q, p = np.empty((1, SPRINGS)), np.empty((1, SPRINGS))
        rows_q, rows_p = np.empty((FRAMES, SPRINGS)), np.empty((FRAMES, SPRINGS))
        # C gets rows laid out as ours are: on cache lines and apart, or it takes up to four times as long
        c_q, c_p, *c_rows = simulation._blocks((many.q, many.p, many.m, k, inverse))

        def bare_c(
            name: str = "many_" + method.replace("-", "_"),
            q: Floats = c_q,
            p: Floats = c_p,
            rows: list[Floats] = c_rows,
        ) -> None:
            sizes = ctypes.c_long(SPRING_STEPS), ctypes.c_long(SPRINGS), ctypes.c_double(H)
            getattr(c, name)(*sizes, *(doubles(x) for x in (*rows, q, p)))

        jobs: dict[str, Callable[[], None]] = {
            "own": partial(own.advance, SPRING_STEPS, q, p),
            "recorded": partial(own.advance, 1, rows_q, rows_p),
        }
        if c:
            jobs["C"] = bare_c
        found = in_turn(jobs)
        head(f"own:{method}, {SPRINGS} springs", "ns a spring and step")
        line("unrecorded", found["own"], each)
        line("every step recorded", found["recorded"], SPRINGS * FRAMES)
        if c:
            line("C -O3 -march=native", found["C"], each)
            passed &= ratio("own / C", found["own"][0], found["C"][0], 1.5)
    return passed


def numpy_chain(what: Scene, steps: int) -> tuple[Floats, Floats]:
    """Semi-implicit Euler of a chain as one writes it with NumPy."""
    ends, links = what.terms
    assert isinstance(ends, WallSpring)
    assert isinstance(links, Spring)
    m, q, p = what.m, what.q.copy(), what.p.copy()
    f = np.empty_like(q)
    for _ in range(steps):
        tension = links.k * (q[1:] - q[:-1] - links.rest)
        f[:-1] = tension
        f[-1] = 0
        f[1:] -= tension
        f[0] -= ends.k[0] * (q[0] - ends.at[0])
        f[-1] -= ends.k[1] * (q[-1] - ends.at[1])
        p += f * H
        q += p / m * H
    return q, p


def long_chain() -> bool:
    """Chains of 1e3 to 1e6 masses against NumPy."""
    passed = True
    head("chains", "ns a spring and step")
    for n in (1_000, 10_000, 100_000, 1_000_000):
        steps = max(10_000_000 // n, 5)
        what = chain(n, steps)
        own = {method: simulation.prepare(what, method, H, compiled=True) for method in METHODS}
        q, p = np.empty((1, n)), np.empty((1, n))

        def vectorised(what: Scene = what, steps: int = steps) -> None:
            numpy_chain(what, steps)

        jobs: dict[str, Callable[[], None]] = {
            method: partial(run.advance, steps, q, p) for method, run in own.items()
        }
        found = in_turn(jobs | {"numpy": vectorised}, 5)
        for method in METHODS:
            line(f"own:{method}, {n} masses", found[method], steps * (n + 1))
        line(f"NumPy, semi-implicit Euler, {n} masses", found["numpy"], steps * (n + 1))
        passed &= ratio(
            "own:semi-implicit-euler / NumPy", found["semi-implicit-euler"][0], found["numpy"][0], 2.0
        )
    return passed


SHORT = """
import sys
from time import perf_counter
import numpy as np
from springcheck.engines.own import simulation
from springcheck.physics.terms import WallSpring
from springcheck.physics.scene import Scene
spring = WallSpring(i=np.array([0]), k=np.array([1.0]), at=np.array([0.0]))
scene = Scene(name="spring", title="", source="", m=np.array([1.0]), q=np.array([0.0]),
              p=np.array([1.0]), terms=(spring,), step=0.1, steps=200)
q, p = np.empty((200, 1)), np.empty((200, 1))
least = 1.0
for _ in range(20):
    begin = perf_counter()
    run = simulation.prepare(scene, "semi-implicit-euler", 0.1)
    run.advance(1, q, p)
    least = min(least, perf_counter() - begin)
print(least, "numba" in sys.modules)
"""


def short_run() -> bool:
    """200 steps in a fresh interpreter: the cost of start and run, and that numba stays out."""
    out = subprocess.run([sys.executable, "-c", SHORT], check=True, capture_output=True, text=True).stdout
    seconds, imported = out.split()
    print(f"\n200 steps of one spring, interpreted, start included: {float(seconds) * 1e6:.0f} us")
    print(f"  numba imported: {imported}")
    return imported == "False"


def main() -> int:
    """Run every part; 1 where a ratio is too large."""
    arguments(__doc__)
    with tempfile.TemporaryDirectory() as folder:
        plain = native = None
        if shutil.which("cc"):
            plain = compiled_c(Path(folder), "-O2")
            native = compiled_c(Path(folder), "-O3", "-march=native")
        passed = [short_run(), one_spring(plain), many_springs(native), long_chain()]
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
