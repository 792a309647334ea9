"""The own methods run about as fast as C, and a short run does not pay for a compiler.

Claim, each a ratio of times taken side by side in this run, in one thread (C with the same operations, the
division by the mass included, every number known at run time only, gcc -O3 -march=native -ffp-contract=off;
of two ways to write the chain in C the faster one counts):

* one spring, unrecorded: at most 1.1 times C;
* 4096 springs by the Eulers: at most 1.7 times C, whose rows lie on cache lines;
* RK4, and Forest-Ruth on 4096 springs, without a claim: their stages go through memory one after the other,
  C has them in registers;
* chains of 1,000 to 1,000,000 unequal masses and springs: at most 1.5 times C;
* 200 steps of one spring are interpreted and import no numba.

Command: python validation/kernel_speed.py        (2 min; without a C compiler `cc` its ratios are left out)

Processor time of the thread is taken, not the clock on the wall, so that what else runs counts little; the
rounds go through all jobs in turn, and a ratio is that of the least times.

Expected (AMD EPYC, an idle core; gcc 12, numba 0.68; nanoseconds a mass and step, least of 9 rounds, and in
brackets the ratio to C):

                                     explicit        semi-implicit   implicit Euler
    one spring                       3.9 (0.66)      7.6 (1.00)      8.5 (1.00)
    4096 springs                     0.39 (1.21)     0.40 (1.29)     0.45 (1.41)
    chain of 1,000 masses            0.60 (1.18)     0.76 (1.48)     4.5 (1.08)
    chain of 10,000 masses           0.67 (1.12)     0.62 (1.04)     4.5 (1.09)
    chain of 100,000 masses          0.84 (1.20)     0.86 (1.25)     4.6 (1.11)
    chain of 1,000,000 masses        1.9 (1.19)      1.8 (1.12)      5.3 (1.19)

Forest-Ruth: 1.00 on one spring, 1.3 to 2.3 on 4096; RK4: 1.6 and 4.4.

Exit status 0 when every ratio holds, 1 otherwise.
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
from time import thread_time
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck.engines.own import simulation, solver
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring, Term, WallSpring

BLOG = ("explicit-euler", "semi-implicit-euler", "implicit-euler")
FOURTH = ("rk4", "forest-ruth")
"""Compared with C where springs are separate."""
OTHERS = (*FOURTH, "velocity-verlet", "implicit-midpoint")
"""Timed too; a chain by them has no C."""
ROUNDS = 9
STEPS = 2_000_000
SPRINGS, SPRING_STEPS = 4096, 1_000
SIZES = (1_000, 10_000, 100_000, 1_000_000)
WORK = 4_000_000
"""Masses times steps of one run of a chain, at least 12 steps."""
H = 0.01

C = """
#define LOOP(name, body) \\
void name(long steps, double h, double m, double k, double d, double *state) { \\
    double q = state[0], p = state[1]; \\
    for (long i = 0; i < steps; i++) { body } \\
    state[0] = q; state[1] = p; \\
}
LOOP(one_explicit_euler, double x = q; q = x + (p / m) * h; p = p + (-k * x) * h;)
LOOP(one_semi_implicit_euler, p = p + (-k * q) * h; q = q + (p / m) * h;)
LOOP(one_implicit_euler, p = (p + (-k * q) * h) * d; q = q + (p / m) * h;)

/* of order 4: a velocity and a force of each stage; X1 is 1/(2 - 2**(1/3)) */
#define RK4(q, p, m, k) \\
    double v1 = p / m, f1 = -k * q, u = q + a * v1, w = p + a * f1; \\
    double v2 = w / m, f2 = -k * u; u = q + a * v2; w = p + a * f2; \\
    double v3 = w / m, f3 = -k * u; u = q + h * v3; w = p + h * f3; \\
    double v4 = w / m, f4 = -k * u; \\
    q = q + b * v1; p = p + b * f1; q = q + c * v2; p = p + c * f2; \\
    q = q + c * v3; p = p + c * f3; q = q + b * v4; p = p + b * f4;
#define X1 1.3512071919596578
#define FOREST_RUTH(q, p, m, k) \\
    q = q + (p / m) * (h * X1 / 2); p = p + (-k * q) * (h * X1); q = q + (p / m) * (h * (1 - X1) / 2); \\
    p = p + (-k * q) * (h * (1 - 2 * X1)); q = q + (p / m) * (h * (1 - X1) / 2); \\
    p = p + (-k * q) * (h * X1); q = q + (p / m) * (h * X1 / 2);
LOOP(one_rk4, double a = h * 0.5; double b = h / 6; double c = h / 3; RK4(q, p, m, k))
LOOP(one_forest_ruth, FOREST_RUTH(q, p, m, k))

#define SWEEP(name, body) \\
void name(long steps, long n, double h, const double *restrict m, const double *restrict k, \\
          const double *restrict d, double *restrict q, double *restrict p) { \\
    for (long i = 0; i < steps; i++) \\
        for (long j = 0; j < n; j++) { body } \\
}
SWEEP(many_explicit_euler, double x = q[j]; q[j] = x + (p[j] / m[j]) * h; p[j] = p[j] + (-k[j] * x) * h;)
SWEEP(many_semi_implicit_euler,
      double x = p[j] + (-k[j] * q[j]) * h; p[j] = x; q[j] = q[j] + (x / m[j]) * h;)
SWEEP(many_implicit_euler,
      double x = (p[j] + (-k[j] * q[j]) * h) * d[j]; p[j] = x; q[j] = q[j] + (x / m[j]) * h;)

SWEEP(many_rk4, double a = h * 0.5; double b = h / 6; double c = h / 3; double x = q[j]; double y = p[j];
      RK4(x, y, m[j], k[j]) q[j] = x; p[j] = y;)
SWEEP(many_forest_ruth, double x = q[j]; double y = p[j]; FOREST_RUTH(x, y, m[j], k[j]) q[j] = x; p[j] = y;)

/* a chain between two walls: stiffness and place of both in w */
#define CHAIN(name) \\
void name(long steps, long n, double h, const double *restrict m, const double *restrict k, \\
          const double *restrict rest, const double *restrict w, const double *restrict below, \\
          const double *restrict inverse, const double *restrict above, double *restrict f, \\
          double *restrict q, double *restrict p)

/* in one pass: the tension of the spring before is kept */
CHAIN(chain_explicit_euler_1) {
    for (long s = 0; s < steps; s++) {
        double left = w[0] * (q[0] - w[1]);
        for (long i = 0; i < n; i++) {
            double x = q[i], y = p[i];
            double t = i < n - 1 ? k[i] * (q[i + 1] - x - rest[i]) : -w[2] * (x - w[3]);
            p[i] = y + (t - left) * h; q[i] = x + (y / m[i]) * h; left = t;
        }
    }
}
CHAIN(chain_semi_implicit_euler_1) {
    for (long s = 0; s < steps; s++) {
        double left = w[0] * (q[0] - w[1]);
        for (long i = 0; i < n; i++) {
            double x = q[i];
            double t = i < n - 1 ? k[i] * (q[i + 1] - x - rest[i]) : -w[2] * (x - w[3]);
            double y = p[i] + (t - left) * h;
            p[i] = y; q[i] = x + (y / m[i]) * h; left = t;
        }
    }
}
/* in two: the tensions first */
#define TENSIONS \\
    f[0] = w[0] * (q[0] - w[1]); f[n] = -w[2] * (q[n - 1] - w[3]); \\
    for (long i = 0; i < n - 1; i++) f[i + 1] = k[i] * (q[i + 1] - q[i] - rest[i]);
CHAIN(chain_explicit_euler_2) {
    for (long s = 0; s < steps; s++) {
        TENSIONS
        for (long i = 0; i < n; i++) {
            double y = p[i]; p[i] = y + (f[i + 1] - f[i]) * h; q[i] = q[i] + (y / m[i]) * h;
        }
    }
}
CHAIN(chain_semi_implicit_euler_2) {
    for (long s = 0; s < steps; s++) {
        TENSIONS
        for (long i = 0; i < n; i++) {
            double y = p[i] + (f[i + 1] - f[i]) * h; p[i] = y; q[i] = q[i] + (y / m[i]) * h;
        }
    }
}
CHAIN(chain_implicit_euler_1) {
    for (long s = 0; s < steps; s++) {
        double left = w[0] * (q[0] - w[1]), z = 0;
        for (long i = 0; i < n; i++) {
            double t = i < n - 1 ? k[i] * (q[i + 1] - q[i] - rest[i]) : -w[2] * (q[i] - w[3]);
            z = p[i] + (t - left) * h - below[i] * z; f[i] = z; left = t;
        }
        z = 0;
        for (long i = n - 1; i >= 0; i--) { z = (f[i] - above[i] * z) * inverse[i]; p[i] = z; }
        for (long i = 0; i < n; i++) q[i] = q[i] + (p[i] / m[i]) * h;
    }
}
CHAIN(chain_implicit_euler_2) {
    for (long s = 0; s < steps; s++) {
        double left = w[0] * (q[0] - w[1]), z = 0;
        for (long i = 0; i < n; i++) {
            double t = i < n - 1 ? k[i] * (q[i + 1] - q[i] - rest[i]) : -w[2] * (q[i] - w[3]);
            z = p[i] + (t - left) * h - below[i] * z; f[i] = z; left = t;
        }
        z = 0;
        for (long i = n - 1; i >= 0; i--) {
            z = (f[i] - above[i] * z) * inverse[i]; p[i] = z; q[i] = q[i] + (z / m[i]) * h;
        }
    }
}
"""


def compiled_c(folder: Path) -> ctypes.CDLL:
    """The C loops."""
    source, library = folder / "loops.c", folder / "loops.so"
    source.write_text(C)
    flags = ("-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC")
    subprocess.run(["cc", *flags, "-o", str(library), str(source)], check=True)
    return ctypes.CDLL(str(library))


def in_turn(jobs: dict[str, Callable[[], None]], rounds: int = ROUNDS) -> dict[str, Floats]:
    """Seconds of each job, (rounds,) sorted; one warm-up, and the jobs in turn within every round."""
    seconds: dict[str, list[float]] = {name: [] for name in jobs}
    for each in range(rounds + 1):
        for name, job in jobs.items():
            begin = thread_time()
            job()
            if each:
                seconds[name].append(thread_time() - begin)
    return {name: np.sort(found) for name, found in seconds.items()}


def line(name: str, seconds: Floats, each: float) -> None:
    """Print minimum and quartiles in nanoseconds per `each`."""
    numbers = (float(x) / each * 1e9 for x in (seconds[0], *np.percentile(seconds, (25, 50, 75))))
    print(f"  {name:42s}" + "".join(f" {x:9.3f}" for x in numbers))


def ratio(name: str, seconds: float, reference: float, bound: float) -> bool:
    """Print a ratio of minima against its bound."""
    value = seconds / reference
    print(f"  {name:42s} {value:9.3f} {'<=' if value <= bound else 'NOT <='} {bound:g}")
    return value <= bound


def head(title: str, unit: str) -> None:
    """Print the head of a table."""
    print(f"\n{title}\n  {unit:42s} {'min':>9} {'25 %':>9} {'50 %':>9} {'75 %':>9}")


def scene(m: Floats, q: Floats, p: Floats, terms: tuple[Term, ...]) -> Scene:
    """A scene of these particles and terms."""
    return Scene(name="speed", title="", source="", m=m, q=q, p=p, terms=terms, step=H, steps=1)


def springs(n: int) -> Scene:
    """`n` springs of different strength, each with its own particle."""
    rng = np.random.default_rng(7)
    walls = WallSpring(i=np.arange(n), k=rng.uniform(1, 3, n), at=np.zeros(n))
    return scene(rng.uniform(1, 4, n), rng.normal(size=n), rng.normal(size=n), (walls,))


def chain(n: int) -> Scene:
    """`n` different masses between two walls."""
    rng = np.random.default_rng(8)
    ends = WallSpring(i=np.array([0, n - 1]), k=rng.uniform(1, 3, 2), at=np.array([-1.0, float(n)]))
    links = Spring(a=np.arange(n - 1), b=np.arange(1, n), k=rng.uniform(1, 3, n - 1), rest=np.ones(n - 1))
    q = np.arange(n) + rng.normal(size=n)
    return scene(rng.uniform(1, 4, n), q, rng.normal(size=n), (ends, links))


def doubles(x: Floats) -> Any:
    """A pointer to an array's numbers."""
    return x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def staggered(rows: Any) -> list[Floats]:
    """Copies of rows that begin on a cache line each, and no two of them at the same place within a page."""
    longest = -(-max(len(row) for row in rows) // 8) * 8
    room = -(-longest // 512) * 512 + 72
    memory = np.empty(len(rows) * room + 8)
    begin = -(memory.ctypes.data // memory.itemsize) % 8
    out = []
    for row in rows:
        out.append(memory[begin : begin + len(row)])
        out[-1][:] = row
        begin += room
    return out


class Again:
    """A run that starts over in every round: a method that damps or grows must not reach odd numbers."""

    def __init__(self, what: Scene, scheme: str, steps: int) -> None:
        self._start = partial(simulation.prepare, what, scheme, H, compiled=True)
        self._rows = np.empty((2, 1, what.n))
        self._steps = steps
        self._run = self._start()
        self._calls = 0

    def __call__(self) -> None:
        self._run.advance(self._steps, *self._rows)


def against_c(title: str, what: Scene, steps: int, bound: float, jobs: dict[str, Callable[[], None]]) -> bool:
    """Time the own methods beside jobs in C, whose names begin with the scheme's."""
    mine: dict[str, Callable[[], None]] = {name: Again(what, name, steps) for name in BLOG + OTHERS}
    found = in_turn(mine | jobs)
    head(title, "ns a mass and step")
    passed = True
    free = FOURTH if what.n > 1 else ("rk4",)
    for name in BLOG + OTHERS:
        line(name, found[name], steps * what.n)
        best = min((found[c][0] for c in jobs if c.startswith(name)), default=0.0)
        for c in (c for c in jobs if c.startswith(name)):
            line(c, found[c], steps * what.n)
        if best:
            # stages that go through memory have no claim
            within = ratio(f"{name} / C", found[name][0], best, np.inf if name in free else bound)
            passed &= within
    return passed


def one_spring(c: ctypes.CDLL | None) -> bool:
    """One spring against C."""
    one = springs(1)
    m, k = float(one.m[0]), float(one.terms[0].k[0])  # type: ignore[attr-defined]
    numbers = [ctypes.c_double(x) for x in (H, m, k, 1 / (1 + H * (H * (k / m))))]

    def bare(name: str) -> None:
        state = np.array([one.q[0], one.p[0]])
        getattr(c, name)(ctypes.c_long(STEPS), *numbers, doubles(state))

    every = BLOG + FOURTH if c else ()
    names = {f"{name}, C": partial(bare, "one_" + name.replace("-", "_")) for name in every}
    return against_c("One spring", one, STEPS, 1.1, dict(names))


def many_springs(c: ctypes.CDLL | None) -> bool:
    """4096 springs side by side, against C."""
    many = springs(SPRINGS)
    k = many.terms[0].k  # type: ignore[attr-defined]
    # C gets rows laid out as ours are: on cache lines and apart, or it takes up to four times as long
    q, p, *rows = staggered((many.q, many.p, many.m, k, 1 / (1 + H * (H * (k / many.m)))))

    def bare(name: str) -> None:
        sizes = ctypes.c_long(SPRING_STEPS), ctypes.c_long(SPRINGS), ctypes.c_double(H)
        q[:], p[:] = many.q, many.p
        getattr(c, name)(*sizes, *(doubles(x) for x in (*rows, q, p)))

    every = BLOG + FOURTH if c else ()
    names = {f"{name}, C": partial(bare, "many_" + name.replace("-", "_")) for name in every}
    return against_c(f"{SPRINGS} springs", many, SPRING_STEPS, 1.7, dict(names))


def long_chain(c: ctypes.CDLL | None, n: int) -> bool:
    """A chain against C."""
    what, steps = chain(n), max(WORK // n, 12)
    walls, links = what.terms
    assert isinstance(walls, WallSpring)
    assert isinstance(links, Spring)
    ends = np.array([walls.k[0], walls.at[0], walls.k[1], walls.at[1]])
    _, factors, _ = solver.factors(what, H)
    given = (what.q, what.p, what.m, links.k, links.rest, ends, *factors, np.zeros(n + 1))
    q, p, *rows = staggered(given)

    def bare(name: str) -> None:
        sizes = ctypes.c_long(steps), ctypes.c_long(n), ctypes.c_double(H)
        q[:], p[:] = what.q, what.p
        getattr(c, name)(*sizes, *(doubles(x) for x in (*rows, q, p)))

    names = {
        f"{name}, C in {way}": partial(bare, f"chain_{name.replace('-', '_')}_{way}")
        for name in BLOG
        for way in (1, 2)
    }
    return against_c(f"A chain of {n:,} masses", what, steps, 1.5, dict(names) if c else {})


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
        c = compiled_c(Path(folder)) if shutil.which("cc") else None
        passed = [short_run(), one_spring(c), many_springs(c), *(long_chain(c, n) for n in SIZES)]
    return 0 if all(passed) else 1


if __name__ == "__main__":
    script(main)
