"""Data for the scripts of a page: runs, the numbers of their scene, schemes as their coefficients."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.errors import SpringcheckError
from springcheck.figures import charts
from springcheck.figures.charts import EXACTLY, Bank, Chart, Curve, Scale, numbers
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.physics.trajectory import Trajectory

LONGEST = 2_000_000
"""Most steps of which a browser repeats the loops: about a second."""
STAGES = {"kick", "held", "drift", "pull", "friction", "implicit-friction"}
"""Stages of a splitting that a page can carry out."""
LOOPS = {"own:euler", "own:semi-implicit-euler", "own:velocity-verlet"}
"""Methods of a wall spring whose operations, in their order, a page repeats to the last bit."""
TRIED = {
    "explicit Euler": "explicit-euler",
    "semi-implicit Euler": "semi-implicit-euler",
    "velocity Verlet": "velocity-verlet",
}
"""Schemes that run with the reader's own numbers."""
SLIDING = np.arange(201) / 200
"""Positions of a slider."""


def to_scripts(scene: Scene | None, pieces: Sequence[Trajectory], wrong: Collection[str]) -> dict[str, Any]:
    """The data of a page except its charts; `wrong` are the methods with a failed verdict."""
    one = spring(scene) if scene and not scene.bath else None
    return {
        "runs": [drawn(piece, scene, failed=piece.label in wrong) for piece in pieces],
        "spring": one,
        "sliders": one and sliders(**one),
        "live": one and charts.plain(_live()),
        "linear": linear(scene) if scene else None,
        "laws": laws([*(piece.scheme for piece in pieces), *TRIED.values()]),
        "steps": scene.steps if scene else 0,
        "equal": scene is not None and scene.units == "reduced",
    }


def _live() -> Bank:
    """The chart of the sliders; its script fills in the numbers of the curves."""
    names = {EXACTLY: EXACTLY, **TRIED}
    curves = [Curve(name=name, group=group, x=[], y=[]) for name, group in names.items()]
    orbits = Chart(title="Momentum over position", x=Scale(name="q"), y=Scale(name="p"), curves=curves)
    return Bank(title="Drawn", charts=[orbits])


def spring(scene: Scene) -> dict[str, float] | None:
    """Parameters of one particle on one wall spring; None for any other scene, or one too long."""
    if scene.n != 1 or len(scene.terms) != 1 or scene.steps > LONGEST:
        return None
    wall = scene.terms[0]
    if not isinstance(wall, WallSpring) or len(wall) != 1:
        return None
    given = {"k": wall.k, "at": wall.at, "m": scene.m, "q": scene.q, "p": scene.p}
    return {name: float(values[0]) for name, values in given.items()} | {"h": scene.step}


def sliders(*, h: float, k: float, m: float, q: float, p: float, at: float) -> dict[str, list[float]]:
    """Values at each position of each slider, in even ratios where the sign is fixed."""
    w = math.sqrt(abs(k) / m) or 1.0
    start = abs(p) or abs(q - at) * m * w or 1.0
    return {
        "h": _ratios(min(0.01 / w, abs(h) / 2), max(3 / w, 2 * abs(h)), h),
        "k": _ratios(abs(k) / 10 or 0.1, abs(k) * 10 or 10, k),
        "m": _ratios(m / 10, m * 10),
        "p": _rounded((2 * SLIDING - 1) * 3 * start),
        "c": _rounded(SLIDING * 3 * m * w),
    }


def _ratios(least: float, most: float, sign: float = 1.0) -> list[float]:
    return _rounded(math.copysign(1, sign) * least * (most / least) ** SLIDING)


def _rounded(places: Floats) -> list[float]:
    return [float(f"{x:.6g}") for x in places]


def linear(scene: Scene) -> dict[str, Any] | None:
    """Parameters of one particle in a linear force f - k q - c p/m; None for another or too long scene."""
    system = scene.system
    if scene.n != 1 or not system.is_linear or scene.steps > LONGEST:
        return None
    zero = np.zeros(1)
    found = {
        "k": system.hessian_diagonal(zero), "f": system.force(zero, zero),
        "c": system.friction_rates * scene.m, "m": scene.m, "q": scene.q, "p": scene.p,
    }  # fmt: skip
    values = {name: float(x[0]) for name, x in found.items()}
    return {**values, "tolerance": scene.tolerance} if np.isfinite(list(values.values())).all() else None


def laws(names: Iterable[str]) -> dict[str, Any]:
    """Schemes by name, as their stages or their tableau in doubles; "exact" for exact and adaptive ones."""
    known, found = schemes.known(), dict[str, Any]()
    for scheme in (known[name] for name in names if name in known):
        if scheme.has("flow") or scheme.has("adaptive"):
            found[scheme.name] = "exact"
        elif scheme.stages and {kind for kind, _ in scheme.stages} <= STAGES:
            found[scheme.name] = [(kind, float(schemes.number(c, np.float64))) for kind, c in scheme.stages]
        elif scheme.b:
            a = [[float(x) for x in row] for row in scheme.a]
            found[scheme.name] = {"a": a, "b": [float(x) for x in scheme.b]}
    return found


def drawn(piece: Trajectory, scene: Scene | None = None, *, failed: bool = False) -> dict[str, Any]:
    """The first particle of a trajectory, and a bound on the effect of rounding in a step."""
    how = piece.arithmetic
    return {
        "label": piece.label,
        "failed": failed,
        "loop": piece.label in LOOPS and scene is not None and spring(scene) is not None,
        "rounding": 256 * max(how.unit, how.quantum, 2.0**-53) * _stretch(piece, scene),
        "scheme": piece.scheme,
        "title": schemes.title(piece.scheme),
        "every": piece.every,
        "step": piece.step,
        "t": numbers(piece.t),
        "q": numbers(piece.q[:, 0]),
        "p": numbers(piece.p[:, 0]),
    }


def _stretch(piece: Trajectory, scene: Scene | None) -> float:
    """Amplification of an error of a step as it is propagated: the deviation of the orbit of the scheme's map
    from a circle; the number of steps where the orbit is no ellipse."""
    known = linear(scene) if scene else None
    if known is None or laws([piece.scheme]).get(piece.scheme, "exact") == "exact":
        return 1.0
    m = known["m"]
    w = math.sqrt(abs(known["k"]) / m) or 1.0
    k, c = (np.array([known[name] / m]) for name in "kc")
    try:
        found = schemes.matrix(schemes.known()[piece.scheme], h=piece.step, m=np.ones(1), k=k, c=c)
    except SpringcheckError:
        return float(len(piece.t) * piece.every)
    (a, b), (c, d) = found[0].astype(float)
    half, area = abs(c / w - b * w) / 2, -((a - d) ** 2 / 4 + b * c)
    if not area > 0:
        return float(len(piece.t) * piece.every)
    return float(half + math.sqrt(max(half * half - area, 0.0))) / math.sqrt(area)
