"""What the page of one particle on a spring in a bath is given.

Splittings by their stages, places of sliders, and covariances by `Law`, against which it holds its own.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np

from springcheck.figures import charts
from springcheck.figures.charts import EXACTLY, Bank, Chart, Curve, Scale
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

TRIED_STEPS, TRIED_FRICTIONS = (0.3, 1.0, 1.9), (0.05, 1.0, 8.0)
"""h omega and gamma/omega at which the page is held against Python, beside the scene's own."""


def bath(scene: Scene | None, ran: Collection[str]) -> dict[str, Any] | None:
    """Of one particle that a spring holds; None for any other scene.  `ran` are schemes, drawn at first."""
    if scene is None or scene.bath is None or scene.n != 1 or not scene.system.is_linear:
        return None
    from springcheck.thermal import THERMOSTATS, Law

    at = np.zeros(1)
    k, m, rate = float(scene.system.hessian_diagonal(at)[0]), float(scene.m[0]), scene.bath.friction
    if not 0 < k < math.inf:
        return None
    w, h = math.sqrt(k / m), abs(scene.step)
    splittings = {name: one for name, one in THERMOSTATS.items() if set(name) <= set("abo")}
    points = [(h, rate), *((x / w, y * w) for x in TRIED_STEPS for y in TRIED_FRICTIONS)]

    def moments(name: str, h: float, rate: float) -> list[float]:
        law = Law(scheme=splittings[name], h=h, m=scene.m, k=np.array([k]), rate=rate, thermal=scene.thermal)
        S = law.covariance[0] / scene.thermal
        return [float(S[0, 0] * k), float(S[0, 1] * w), float(S[1, 1] / m)]

    drawn = [Curve(name="Boltzmann", group=EXACTLY, x=[], y=[], title="the exact stationary distribution")]
    drawn += [
        Curve(name=name.upper(), group=name, x=[], y=[], title=one.title) for name, one in splittings.items()
    ]
    chart = Chart(
        title="Standard deviation of states in every direction: the stationary covariance of each step",
        x=Scale(name="q"), y=Scale(name="v"), curves=drawn,
    )  # fmt: skip
    on = [name.upper() for name in splittings if name in ran] or ["BAOAB", "OBABO"]
    return {
        "stages": {
            name: [
                (act.kind, 1 / one.draws if act.kind == "exchange" else float(act.part))  # type: ignore[arg-type]
                for act in one.acts
            ]
            for name, one in splittings.items()
        },
        "own": {"h": h, "g": rate, "T": scene.bath.temperature},
        "w": w, "q": math.sqrt(scene.thermal / scene.bath.temperature / k),
        "sliders": {
            "h": _ratios(0.02 / w, 2.2 / w), "g": _ratios(0.01 * w, 100 * w),
            "T": _ratios(scene.bath.temperature / 10, scene.bath.temperature * 10),
        },
        "unit": "" if scene.units == "reduced" else "K",
        "values": [[*at, {name: moments(name, *at) for name in splittings}] for at in points],
        "live": charts.plain(Bank(title="Drawn", charts=[chart], on=["Boltzmann", *on])),
    }  # fmt: skip


def _ratios(least: float, most: float) -> list[float]:
    places: Floats = least * (most / least) ** (np.arange(201) / 200)
    return [float(f"{x:.6g}") for x in places]
