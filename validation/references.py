"""The true motion of every scene by a route of its own: Taylor series of the equations of motion in mpmath.

Claim: the closed forms that springcheck uses as the truth agree with the equations of motion, integrated
in 40 digits, to 1e-13 over the whole length of every scene.

Command: python validation/references.py            (compares springcheck with data/reference/motion/)
         python validation/references.py --write    (makes data/reference/motion/ anew, 3 minutes)

Expected: one line a scene, its largest error relative to the largest position and momentum, below 1e-16;
4e-14 for the long chain, whose start is rounded to doubles before it moves, and 5e-15 for the diatomic, whose
start in doubles turns a little.

The references are made without springcheck: a scene file is read as TOML, every float in it stands for
its double, and q and p are carried from step to step by power series in time.  Each is made twice, with
steps of different lengths, and kept only if both agree to 25 digits.  The long chain is the exception: its
waves are cosines in time, evaluated in 40 digits.
"""

from __future__ import annotations

import argparse
import json
import tomllib
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

from arguments import script

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "data" / "reference" / "motion"
ELSEWHERE = ("detest-b1", "stiff-spring", "two-scales", "multiple-time-steps", "overdamped", "van-der-pol")
"""Scenes whose references are of another kind."""
DIGITS = 25
ORDER = 40

mp.mp.dps = 40

Series = list[list[Any]]
"""Coefficients of each particle's position in powers of time."""


def along_axes(table: dict[str, Any]) -> dict[str, Any]:
    """The same scene file with a particle of one axis for each axis of each: springs act on each alike."""
    rows = table.get("particle", ())
    if not any(isinstance(row.get("position"), list) for row in rows):
        return table
    apart: list[dict[str, Any]] = []
    number: dict[tuple[int, str], int] = {}
    for i, row in enumerate(rows):
        for axis, *start in zip("xyz", row["position"], row.get("momentum", [0.0] * 3), strict=False):
            number[i, axis] = len(apart)
            apart.append({"mass": row["mass"], "position": start[0], "momentum": start[1]})
    springs = []
    for row in table.get("spring", ()):
        particle = next(end for end in row["ends"] if end != "wall")
        for axis in row.get("axis", "xyz"[: len(rows[particle]["position"])]):
            ends = [end if end == "wall" else number[end, axis] for end in row["ends"]]
            springs.append({**row, "ends": ends})
    axes = "xyz"[: len(rows[0]["position"])]
    bonds = [
        {**row, "axes": [[number[i, axis] for i in row["ends"]] for axis in axes]}
        for row in table.get("bond", ())
    ]
    weights = [(number[row["particle"], row["axis"]], row["force"]) for row in table.get("weight", ())]
    made = {"particle": apart, "spring": springs, "bond": bonds, "weight": weights}
    return {**table, **made}


class System:
    """Masses, start, and the laws of a scene file."""

    def __init__(self, table: dict[str, Any]) -> None:
        table = along_axes(table)
        rows = table.get("particle") or table["inductor"]
        names = {
            "particle": ("mass", "position", "momentum"),
            "inductor": ("inductance", "charge", "flux"),
        }[next(name for name in ("particle", "inductor") if name in table)]
        self.m, self.q, self.p = ([mp.mpf(row.get(name, 0)) for row in rows] for name in names)
        self.table = table
        self.weights = [mp.mpf(0)] * len(self.m)
        for i, force in table.get("weight", ()):
            self.weights[i] += mp.mpf(force)

    def springs(self) -> list[tuple[list[tuple[int, int]], Any, Any]]:
        """((particle, sign) of each end, stiffness, rest) with elongation sum of sign * q - rest."""
        found: list[tuple[list[tuple[int, int]], Any, Any]] = []
        for row in self.table.get("spring", ()):
            a, b = row["ends"]
            rest, wall = mp.mpf(row.get("rest", 0.0)), row.get("wall", 0.0)
            if a == "wall":
                found.append(([(b, 1)], mp.mpf(row["stiffness"]), mp.mpf(wall + row.get("rest", 0.0))))
            elif b == "wall":
                found.append(([(a, 1)], mp.mpf(row["stiffness"]), mp.mpf(wall - row.get("rest", 0.0))))
            else:
                found.append(([(a, -1), (b, 1)], mp.mpf(row["stiffness"]), rest))
        for row in self.table.get("capacitor", ()):
            signs = (1,) if len(row["loops"]) == 1 else (-1, 1)
            ends = list(zip(row["loops"], signs, strict=True))
            found.append((ends, mp.mpf(1 / row["capacitance"]), mp.mpf(0)))
        return found

    def friction(self) -> list[tuple[int, Any]]:
        """Particle and coefficient."""
        found = [(row["particle"], mp.mpf(row["coefficient"])) for row in self.table.get("damping", ())]
        return found + [(row["loop"], mp.mpf(row["resistance"])) for row in self.table.get("resistor", ())]

    def series(self, q: list[Any], p: list[Any], t: Any) -> Series:
        """Taylor coefficients of the motion from (q, p) at the time t, up to ORDER."""
        n = len(self.m)
        u: Series = [[q[i], p[i] / self.m[i]] for i in range(n)]
        laws: list[Any] = [_Quartic(row) for row in self.table.get("quartic", ())]
        laws += [_Cosine(row) for row in self.table.get("cosine", ())]
        laws += [_Morse(row) for row in self.table.get("morse", ())]
        laws += [_Driven(row, t) for row in self.table.get("drive", ())]
        laws += [_Bond(row) for row in self.table.get("bond", ())]
        springs, friction = self.springs(), self.friction()
        for order in range(ORDER):
            force = [mp.mpf(0)] * n if order else list(self.weights)
            for ends, k, rest in springs:
                stretch = sum(sign * u[i][order] for i, sign in ends) - (rest if order == 0 else 0)
                for i, sign in ends:
                    force[i] -= sign * k * stretch
            for i, c in friction:
                force[i] -= c * (order + 1) * u[i][order + 1]
            for law in laws:
                law.add(u, order, force)
            for i in range(n):
                u[i].append(force[i] / self.m[i] / ((order + 1) * (order + 2)))
        return u


def _product(a: list[Any], b: list[Any], order: int) -> Any:
    return mp.fsum(a[j] * b[order - j] for j in range(order + 1))


class _Quartic:
    def __init__(self, row: dict[str, Any]) -> None:
        self.i, self.b, self.at = row["particle"], mp.mpf(row["coefficient"]), mp.mpf(row.get("at", 0.0))
        self.x: list[Any] = []
        self.x2: list[Any] = []

    def add(self, u: Series, order: int, force: list[Any]) -> None:
        self.x.append(u[self.i][order] - (self.at if order == 0 else 0))
        self.x2.append(_product(self.x, self.x, order))
        force[self.i] -= self.b * _product(self.x2, self.x, order)


class _Cosine:
    """Its length is given; what counts is the double next to the inverse."""

    def __init__(self, row: dict[str, Any]) -> None:
        self.i, self.depth, self.at = row["particle"], mp.mpf(row["depth"]), mp.mpf(row.get("at", 0.0))
        self.wave = mp.mpf(1 / row.get("length", 1.0))
        self.sine: list[Any] = []
        self.cosine: list[Any] = []

    def add(self, u: Series, order: int, force: list[Any]) -> None:
        x = u[self.i]
        if order == 0:
            angle = self.wave * (x[0] - self.at)
            self.sine, self.cosine = [mp.sin(angle)], [mp.cos(angle)]
        else:
            slope = [self.wave * j * x[j] for j in range(1, order + 1)]
            self.sine.append(_product(slope, self.cosine, order - 1) / order)
            self.cosine.append(-_product(slope, self.sine, order - 1) / order)
        force[self.i] -= self.depth * self.wave * self.sine[order]


class _Morse:
    def __init__(self, row: dict[str, Any]) -> None:
        self.a, self.b = row["ends"]
        self.depth, self.steepness, self.rest = (mp.mpf(row[x]) for x in ("depth", "steepness", "rest"))
        self.x: list[Any] = []

    def add(self, u: Series, order: int, force: list[Any]) -> None:
        if order == 0:
            self.x = [mp.exp(-self.steepness * (u[self.b][0] - u[self.a][0] - self.rest))]
        else:
            slope = [-self.steepness * j * (u[self.b][j] - u[self.a][j]) for j in range(1, order + 1)]
            self.x.append(_product(slope, self.x, order - 1) / order)
        tension = 2 * self.depth * self.steepness * (self.x[order] - _product(self.x, self.x, order))
        force[self.a] += tension
        force[self.b] -= tension


class _Bond:
    """A spring of its length: k (1 - rest/s) of the way between its ends, s by the series of a root."""

    def __init__(self, row: dict[str, Any]) -> None:
        self.axes, self.k, self.rest = row["axes"], mp.mpf(row["stiffness"]), mp.mpf(row.get("rest", 0.0))
        self.d: Series = [[] for _ in self.axes]
        self.s: list[Any] = []
        self.part: list[Any] = []

    def add(self, u: Series, order: int, force: list[Any]) -> None:
        for d, (a, b) in zip(self.d, self.axes, strict=True):
            d.append(u[b][order] - u[a][order])
        square = mp.fsum(_product(d, d, order) for d in self.d)
        if order == 0:
            self.s = [mp.sqrt(square)]
            self.part = [self.rest / self.s[0]]
        else:
            self.s.append(mp.mpf(0))
            self.s[order] = (square - _product(self.s, self.s, order)) / (2 * self.s[0])
            self.part.append(mp.mpf(0))
            self.part[order] = -_product(self.s, self.part, order) / self.s[0]
        for d, (a, b) in zip(self.d, self.axes, strict=True):
            pull = self.k * (d[order] - _product(self.part, d, order))
            force[a] += pull
            force[b] -= pull


class _Driven:
    """A driving force: the cosine by its own series about the time t."""

    def __init__(self, row: dict[str, Any], t: Any) -> None:
        self.i, self.row = row["particle"], {name: mp.mpf(x) for name, x in row.items()}
        self.w, self.angle = self.row["frequency"], self.row["frequency"] * t + self.row.get("phase", 0)

    def add(self, u: Series, order: int, force: list[Any]) -> None:
        cosine = self.w**order * mp.cos(self.angle + order * mp.pi / 2) / mp.factorial(order)
        force[self.i] += self.row["amplitude"] * cosine


def moved(system: System, start: Any, t: Any, pieces: int, state: tuple[list[Any], list[Any]]) -> Any:
    """The state a time t after the start, in so many steps of a power series each."""
    q, p = state
    h = t / pieces
    for piece in range(pieces):
        u = system.series(q, p, start + piece * h)
        q = [mp.polyval(x[::-1], h) for x in u]
        p = [
            m * mp.polyval([j * x[j] for j in range(len(x) - 1, 0, -1)], h)
            for m, x in zip(system.m, u, strict=True)
        ]
    return q, p


def chain(table: dict[str, Any], t: Any) -> tuple[list[Any], list[Any]]:
    """Positions and momenta of the standing waves of a chain."""
    of = table["chain"]
    n, m, k = of["masses"], mp.mpf(of["mass"]), mp.mpf(of["stiffness"])
    q, p = [mp.mpf(0)] * n, [mp.mpf(0)] * n
    for wave in of["wave"]:
        r, a = wave["mode"], mp.mpf(wave["amplitude"])
        w = 2 * mp.sqrt(k / m) * mp.sin(mp.pi * r / (2 * (n + 1)))
        c, s = mp.cos(w * t), mp.sin(w * t)
        for j in range(n):
            shape = a * mp.sin(mp.pi * r * (j + 1) / (n + 1))
            q[j] += shape * c
            p[j] -= m * w * shape * s
    return q, p


def make(name: str) -> dict[str, Any]:
    """The reference of one scene."""
    table = tomllib.loads((ROOT / "data" / "scenes" / f"{name}.toml").read_text(encoding="utf-8"))
    step, steps = mp.mpf(table["time"]["step"]), table["time"]["steps"]
    at = [0, 1, steps // 7, steps // 3, steps // 2, steps]
    rows = []
    origin = (
        f"Taylor series of order {ORDER} in mpmath, {mp.mp.dps} digits, two step lengths agreeing to {DIGITS}"
    )
    if "chain" in table:
        origin = f"standing waves in mpmath, {mp.mp.dps} digits; every 37th mass from mass 0 on"
        for count in at:
            q, p = chain(table, step * count)
            rows.append({"steps": count, "q": _text(q[::37]), "p": _text(p[::37])})
        return {"origin": origin, "every": 37, "motion": rows}
    system = System(table)
    coarse = fine = (system.q, system.p)
    before = 0
    for count in at:
        pieces = max(1, 2 * (count - before))
        coarse = moved(system, step * before, step * (count - before), pieces, coarse)
        more = pieces + pieces // 2 + 1
        fine = moved(system, step * before, step * (count - before), more, fine)
        before = count
        for one, other in zip([*coarse[0], *coarse[1]], [*fine[0], *fine[1]], strict=True):
            if abs(one - other) > mp.mpf(10) ** -DIGITS * max(abs(one), 1e-3):
                raise SystemExit(f"{name}: the two integrations part at step {count}: {one} {other}")
        rows.append({"steps": count, "q": _text(fine[0]), "p": _text(fine[1])})
    return {"origin": origin, "every": 1, "motion": rows}


def _text(values: list[Any]) -> list[str]:
    return [mp.nstr(x, DIGITS) for x in values]


def error(name: str, found: dict[str, Any]) -> float:
    """Largest difference of springcheck's true motion, relative to the largest q and p of the scene."""
    from springcheck.physics import exact
    from springcheck.physics import scenefile as scenes

    scene = scenes.load_scene(name)
    steps = np.array([row["steps"] for row in found["motion"]])
    worst = 0.0
    for states, key in zip(exact.true_motion(scene, steps, scene.step), "qp", strict=True):
        wanted = np.array([[np.longdouble(x) for x in row[key]] for row in found["motion"]])
        size = np.max(np.abs(wanted), axis=0)
        off = np.max(np.abs(states[:, :: found["every"]] - wanted), axis=0)
        worst = max(worst, float(np.max(off / np.where(size > 0, size, 1))))
    return worst


def named() -> list[str]:
    """The scenes that have one motion to be compared with: none in a bath, which draws another each time."""
    found = {path.stem: tomllib.loads(path.read_text()) for path in (ROOT / "data" / "scenes").glob("*.toml")}
    return sorted(name for name, scene in found.items() if "bath" not in scene and name not in ELSEWHERE)


def main() -> int:
    """Make the references, or compare springcheck with them; returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="make data/reference/motion/ anew")
    parser.add_argument("scene", nargs="*", help="these scenes alone")
    options = parser.parse_args()
    names = options.scene or named()
    status = 0
    for name in names:
        path = FOLDER / f"{name}.json"
        if options.write:
            path.write_text(json.dumps(make(name), indent=1) + "\n", encoding="utf-8")
        worst = error(name, json.loads(path.read_text(encoding="utf-8")))
        status |= worst > 1e-13
        print(f"{name:20} {worst:.1e}")
    return status


if __name__ == "__main__":
    script(main)
