"""Numbers that the terminal prints, computed a second time with 40 digits from textbook formulas.

Claim: errors, energies, limits, largest steps and temperatures that `run`, `precision` and `stability` print
are right to their last digit.  This script reads them off the terminal's text (of `precision`, whose table is
by decades, off its store) and computes each anew: schemes as their textbooks write them, motion by the
matrix exponential, stationary covariances by a Lyapunov equation, limits by the eigenvalues of a step.

Command: python validation/printed_numbers.py        (a minute)

Expected: over 200 numbers, 0 differ.
"""

from __future__ import annotations

import contextlib
import io
import re
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import mpmath as mp
import numpy as np

from arguments import arguments, script
from limits import NO_GROWTH, first, growth
from springcheck.cli import main as springcheck

mp.mp.dps = 40
SCENES = Path(__file__).parents[1] / "data" / "scenes"
ROUNDING = 1e-9
"""Numbers below this are made by rounding and have no value of their own."""

KB = mp.mpf("8.31446261815324e-3")
"""Boltzmann's constant, kJ/mol/K."""


class Linear:
    """Masses, stiffness matrix, resting places and start of a scene of springs, read off its file."""

    def __init__(self, name: str) -> None:
        with (SCENES / f"{name}.toml").open("rb") as file:
            told = tomllib.load(file)
        each = [np.atleast_1d(x.get("position", 0.0)).astype(float) for x in told["particle"]]
        axes, n = len(each[0]), len(each)

        def number(x: Any) -> Any:
            return mp.mpf(float(x))

        self.m = [number(x["mass"]) for x in told["particle"] for _ in range(axes)]
        self.q = mp.matrix([number(x) for place in each for x in place])
        momenta = [np.atleast_1d(x.get("momentum", 0.0)).astype(float) for x in told["particle"]]
        self.p = mp.matrix([number(x) for p in momenta for x in p])
        self.k, pull = mp.zeros(n * axes), mp.zeros(n * axes, 1)
        for term in told["spring"]:
            along = ["xyz".index(term["axis"])] if "axis" in term else range(axes)
            (a, b), k, rest = term["ends"], number(term["stiffness"]), number(term.get("rest", 0.0))
            rest += number(term.get("wall", 0.0)) * (1 if a == "wall" else -1)
            for axis in along:
                ends = [(i * axes + axis, sign) for i, sign in ((a, -1), (b, 1)) if i != "wall"]
                for i, s in ends:
                    pull[i] += s * k * rest
                    for j, t in ends:
                        self.k[i, j] += s * t * k
        self.q -= mp.lu_solve(self.k, pull)  # from where the forces vanish
        self.h, self.steps = number(told["time"]["step"]), told["time"]["steps"]
        self.every = told.get("record", {}).get("every", 1)
        self.bath = told.get("bath", {})

    def energy(self, q: Any, p: Any) -> Any:
        """Kinetic and potential energy."""
        return (q.T * self.k * q)[0] / 2 + sum(x * x / m for x, m in zip(p, self.m, strict=True)) / 2

    def rates(self) -> Any:
        """The matrix of the equations of motion on (q, p)."""
        n = len(self.m)
        out = mp.zeros(2 * n)
        for i in range(n):
            out[i, n + i] = 1 / self.m[i]
            for j in range(n):
                out[n + i, j] = -self.k[i, j]
        return out


Step = Callable[[Any, Any, Any, Callable[[Any], Any], Callable[[Any], Any]], tuple[Any, Any]]


def verlet(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
    """Velocity Verlet."""
    p = p + h / 2 * force(q)
    q = q + h * speed(p)
    return q, p + h / 2 * force(q)


def position_verlet(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
    """Half a drift, a kick, half a drift."""
    q = q + h / 2 * speed(p)
    p = p + h * force(q)
    return q + h / 2 * speed(p), p


def rk4(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
    """Classical Runge-Kutta."""
    a, b = speed(p), force(q)
    c, d = speed(p + h / 2 * b), force(q + h / 2 * a)
    e, f = speed(p + h / 2 * d), force(q + h / 2 * c)
    g, i = speed(p + h * f), force(q + h * e)
    return q + h / 6 * (a + 2 * c + 2 * e + g), p + h / 6 * (b + 2 * d + 2 * f + i)


def midpoint(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
    """Explicit midpoint rule."""
    return q + h * speed(p + h / 2 * force(q)), p + h * force(q + h / 2 * speed(p))


def composed(step: Step) -> Step:
    """Three steps whose third-order errors cancel (Forest & Ruth; Yoshida)."""
    w = 1 / (2 - mp.cbrt(2))

    def out(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
        for x in (w, 1 - 2 * w, w):
            q, p = step(q, p, x * h, force, speed)
        return q, p

    return out


def kick_drift(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
    """Semi-implicit Euler."""
    p = p + h * force(q)
    return q + h * speed(p), p


def drift_kick(q: Any, p: Any, h: Any, force: Any, speed: Any) -> tuple[Any, Any]:
    """Semi-implicit Euler in the other order."""
    q = q + h * speed(p)
    return q, p + h * force(q)


EXPLICIT: dict[str, Step] = {
    "own:euler": lambda q, p, h, force, speed: (q + h * speed(p), p + h * force(q)),
    "own:semi-implicit-euler": kick_drift,
    "own:semi-implicit-euler-drift-kick": drift_kick,
    "own:velocity-verlet": verlet,
    "own:position-verlet": position_verlet,
    "own:rk2-midpoint": midpoint,
    "own:rk4": rk4,
    "own:forest-ruth": composed(position_verlet),
    "own:yoshida4": composed(verlet),
}


def map_of(label: str, scene: Linear, h: Any) -> Any:
    """One step of a scheme as a matrix on (q, p)."""
    n = len(scene.m)
    rates, one = scene.rates(), mp.eye(2 * n)
    if label == "own:implicit-euler":
        return mp.inverse(one - h * rates)
    if label in ("own:implicit-midpoint", "own:trapezoidal"):
        return mp.inverse(one - h / 2 * rates) * (one + h / 2 * rates)
    force, out = (lambda q: -scene.k * q), mp.zeros(2 * n)
    speed = lambda p: mp.matrix([x / m for x, m in zip(p, scene.m, strict=True)])  # noqa: E731
    for column in range(2 * n):
        q, p = EXPLICIT[label](one[:n, column], one[n:, column], h, force, speed)
        out[:n, column], out[n:, column] = q, p
    return out


LABELS = (*EXPLICIT, "own:implicit-euler", "own:implicit-midpoint", "own:trapezoidal")


def errors(scene: Linear, label: str, h: Any, steps: int, every: int) -> tuple[Any, Any]:
    """Largest distance from the exact motion over the initial energy norm, and the relative error of the
    energy where it is largest."""
    n, one, exact = len(scene.m), map_of(label, scene, h), mp.expm(scene.rates() * h)
    one, exact = one**every, exact**every
    start = mp.matrix([*scene.q, *scene.p])
    x, y, norm = start.copy(), start.copy(), scene.energy(scene.q, scene.p)
    far, lost = mp.mpf(0), mp.mpf(0)
    for _ in range(steps // every):
        x, y = one * x, exact * y
        far = max(far, scene.energy(x[:n] - y[:n], x[n:] - y[n:]))
        off = scene.energy(x[:n], x[n:]) / norm - 1
        lost = off if abs(off) > abs(lost) else lost
    return mp.sqrt(far / norm), lost


def limit(label: str) -> Any:
    """The first h w at which a step on a spring has an eigenvalue beyond the unit circle: infinite where it
    never has, 0 where it always has."""
    oscillator = Linear("spring")

    def grown(x: Any) -> Any:
        return growth(map_of(label, oscillator, x))

    return mp.mpf(0) if grown(mp.mpf("0.01")) > NO_GROWTH else first(grown, points=400)


def said(*words: str) -> str:
    """What a command prints."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        springcheck([*words, "--force"])
    return out.getvalue()


def rows(text: str, head: str) -> Iterator[tuple[str, list[str]]]:
    """Labels and cells of the table whose first line begins with these words."""
    lines = text.splitlines()
    at = next(i for i, line in enumerate(lines) if re.match(head, line))
    for line in lines[at + 1 :]:
        cells = re.split(r"\s{2,}", line.strip())
        if not line.strip() or line.startswith("error:"):
            return
        if re.match(r"\w+:\S+$", cells[0]):
            yield cells[0], cells[1:]


class Count:
    """How many numbers were compared, and which of them differ."""

    def __init__(self) -> None:
        self.all, self.wrong = 0, 0

    def __call__(self, where: str, printed: str, right: Any, *, down: bool = False) -> None:
        """Compare a printed number: half a unit of its last digit, or rounded down by less than one."""
        self.all += 1
        mantissa, _, power = printed.lower().partition("e")
        unit = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
        off = float(right) - float(printed)
        good = -1e-12 * abs(float(right)) <= off < unit if down else abs(off) <= 0.5001 * unit
        self.wrong += not good
        if not good:
            print(f"DIFFERS {where}: printed {printed}, computed {mp.nstr(right, 8)}")


def of_runs(count: Count, folder: Path) -> None:
    """Errors and energies of `run`."""
    for name in ("spring", "spring-uneven", "chain", "orbit", "lissajous", "stiff-spring"):
        scene = Linear(name)
        text = said("run", name, "-o", str(folder / "run.h5"), *(w for x in LABELS for w in ("--method", x)))
        for label, (far, lost, *_) in rows(text, "method .*error .*energy"):
            right = errors(scene, label, scene.h, scene.steps, scene.every)
            for what, printed, number in zip(("error", "energy"), (far, lost), right, strict=True):
                if abs(number) > ROUNDING:
                    count(f"run {name} {label} {what}", printed, number)


def of_precision(count: Count, folder: Path) -> None:
    """Errors by step of `precision`, off its store, by three digits."""
    labels = ("own:velocity-verlet", "own:rk4", "own:implicit-euler", "own:forest-ruth")
    scene, path = Linear("spring-uneven"), folder / "precision.h5"
    said("precision", "spring-uneven", "-o", str(path), "--budget", "4",
         *(w for x in labels for w in ("--method", x)))  # fmt: skip
    with h5py.File(path) as store:
        for label in labels:
            group = store["precision"][label]
            for h, steps, far in zip(*(group[x][()] for x in ("step", "steps", "max_error")), strict=True):
                if steps <= 3000 and far > ROUNDING:
                    right = errors(scene, label, mp.mpf(float(h)), int(steps), 1)[0]
                    count(f"precision {label} h = {h:.6g}", f"{far:.2e}", right)


def of_stability(count: Count, folder: Path) -> None:
    """Limits and largest steps of `stability`."""
    for name, w in (("spring", mp.mpf(1)), ("spring-uneven", mp.sqrt(mp.mpf(2.9) / mp.mpf(3.7)))):
        text = said("stability", name, "-o", str(folder / "stability.h5"),
                    *(x for label in LABELS for x in ("--method", label)))  # fmt: skip
        for label, (measured, theory, step) in rows(text, "method .*limit of h w"):
            right = limit(label)
            word = {mp.inf: "always stable", mp.mpf(0): "never stable"}.get(right)
            if word:
                count.all += 1
                count.wrong += {measured, theory} != {word} or step != ("any" if right else "none")
                continue
            for what, printed, number in (("limit", measured, right), ("theory", theory, right)):
                count(f"stability {name} {label} {what}", printed, number, down=True)
            count(f"stability {name} {label} largest step", step, right / w, down=True)


def thermostat(label: str, scene: Linear) -> tuple[Any, Any]:
    """The map of one step of one spring in a bath, and the stationary covariance of (q, p) over that of the
    bath's temperature."""
    m, k, h, kt = scene.m[0], scene.k[0, 0], scene.h, KB * mp.mpf(scene.bath["temperature"])
    rate = mp.mpf(scene.bath["friction"])

    def part(letter: str, share: Any) -> tuple[Any, Any]:
        if letter == "A":
            return mp.matrix([[1, share * h / m], [0, 1]]), mp.zeros(2)
        if letter == "B":
            return mp.matrix([[1, 0], [-share * h * k, 1]]), mp.zeros(2)
        c = mp.exp(-rate * share * h)
        return mp.matrix([[1, 0], [0, c]]), mp.matrix([[0, 0], [0, (1 - c * c) * m * kt]])

    letters = label.partition(":")[2].upper()
    step, noise = mp.eye(2), mp.zeros(2)
    for letter in letters:
        a, g = part(letter, mp.mpf(1) / letters.count(letter))
        step, noise = a * step, a * noise * a.T + g
    # the covariance S with S = A S A' + G, by its three numbers
    a, b, c, d = step
    lhs = mp.matrix([[1 - a * a, -2 * a * b, -b * b], [-a * c, 1 - a * d - b * c, -b * d],
                     [-c * c, -2 * c * d, 1 - d * d]])  # fmt: skip
    s = mp.lu_solve(lhs, mp.matrix([noise[0, 0], noise[0, 1], noise[1, 1]]))
    scale = mp.matrix([[mp.sqrt(k / kt), 0], [0, 1 / mp.sqrt(m * kt)]])
    return scale * step * scale**-1, scale * mp.matrix([[s[0], s[1]], [s[1], s[2]]]) * scale


def error_of_mean(step: Any, covariance: Any, frames: int, i: int) -> float:
    """Standard error of a mean square over frames: the correlation of squares of normal numbers is 2 C**2."""
    a, c = (np.array(x.tolist(), float) for x in (step, covariance))
    total, apart = 0.0, c.copy()
    for lag in range(frames):
        total += (1 if lag == 0 else 2) * (frames - lag) * 2 * apart[i, i] ** 2
        apart = a @ apart
    return float(np.sqrt(total)) / frames


def of_baths(count: Count, folder: Path) -> None:
    """Exact and measured temperatures of a spring in a bath."""
    labels = [f"own:{x}" for x in ("baoab", "obabo", "aboba", "oabao", "aoboa", "boaob")]
    scene, path = Linear("bath-spring"), folder / "bath.h5"
    text = said("run", "bath-spring", "-o", str(path), *(w for x in labels for w in ("--method", x)))
    with h5py.File(path) as store:
        for label, (q_exact, q_found, p_exact, p_found) in rows(text, "method .*configurational"):
            step, covariance = thermostat(label, scene)
            group, kt = store["particles"][label], KB * scene.bath["temperature"]
            q, v = (np.asarray(group[x]["value"])[:, 0, 0] for x in ("position", "velocity"))
            radius = float(max(abs(x) for x in mp.eig(step)[0]))
            # until the start has decayed to exp(-5) of thermal motion
            start = float(2 * scene.energy(scene.q, scene.p) / kt)
            first = round((5 + max(0.0, np.log(start) / 2)) / -np.log(radius))
            squares = q**2 * float(scene.k[0, 0] / kt), v**2 * float(scene.m[0] / kt)
            for i, (what, law, found) in enumerate(
                (("configurational", q_exact, q_found), ("kinetic", p_exact, p_found))
            ):
                value, _, error = found.split()
                used = squares[i][first:-1]
                count(f"bath {label} {what}", law, covariance[i, i])
                count(f"bath {label} {what}, measured", value, float(np.mean(used)))
                count(f"bath {label} {what}, error", error, error_of_mean(step, covariance, len(used), i))


def main() -> int:
    """Compare all; 1 where a number differs."""
    arguments(__doc__)
    count = Count()
    with tempfile.TemporaryDirectory() as folder:
        for part in (of_runs, of_precision, of_stability, of_baths):
            before = count.all
            part(count, Path(folder))
            print(f"{part.__name__.removeprefix('of_'):12}{count.all - before:5d} numbers")
    print(f"{count.all} numbers, {count.wrong} differ")
    return int(bool(count.wrong))


if __name__ == "__main__":
    script(main)
