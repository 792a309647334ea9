"""The grid of extreme cases: decades of mass, stiffness, amplitude and step."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from springcheck.engines.contract import Need
from springcheck.physics.builders import spring
from springcheck.physics.scene import Scene
from springcheck.studies.stability.propagators import MASS, STEP

CELL_STEPS = 20
"""Steps of every cell."""

CELL_TURNS = (1e-8, 1e-6, 1e-4, 1e-2, 0.1, 1.0, 1.9, 1.99, 2.01, 2.5, 5.0, 10.0)
"""h w of the plane of forces."""

FORCE_DECADES = (
    -300, -200, -150, -100, -50, -40, -30, -20, -15, -12, -11, -10, -9, -8, -7, -6, -5, -4, -3, -2, -1, 0,
    1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 15, 20, 30, 40, 50, 100, 150, 200, 300,
)  # fmt: skip
"""Powers of ten of the largest initial force, in the scene's unit: denser where engines differ."""

SIZE_DECADES = (-300, -200, -100, -30, -10, 0, 10, 30, 100, 200, 300)
"""Powers of ten of masses and stiffnesses."""

STEP_DECADES = (-300, -150, -100, -30, -10, -3, 0, 3, 10, 30, 100, 150, 300)
"""Powers of ten of steps."""


RATIOS = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12)
"""Stiffness ratios of the stiff cells."""

MOST_CALLS = 20_000
"""Most force calls of a solver on a stiff cell that are waited for, about a second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """Parameters of a cell: one spring, one start, one step, one length."""

    block: str
    m: float
    k: float
    q: float
    p: float
    h: float
    steps: int = CELL_STEPS
    tolerance: float = 1e-9

    @property
    def finite(self) -> bool:
        """Whether a scene may hold all these numbers."""
        numbers = (self.m, self.k, self.q, self.p, self.h)
        return bool(np.all(np.isfinite(numbers))) and self.m > 0 and self.h != 0

    @property
    def force(self) -> float:
        """Scale of the initial force: the larger of k |q| and w |p|."""
        with np.errstate(all="ignore"):
            k, m = np.longdouble(abs(self.k)), np.longdouble(self.m)
            return float(max(k * abs(self.q), np.sqrt(k / m) * abs(self.p)))

    @property
    def h_w(self) -> float:
        """|h| w."""
        return float(abs(np.longdouble(self.h)) * np.sqrt(abs(np.longdouble(self.k)) / np.longdouble(self.m)))


def specs(*, quick: bool = False) -> list[Spec]:
    """All cells of methods of fixed step that are judged step by step."""
    with np.errstate(over="ignore", under="ignore"):
        forces = itertools.starmap(force_cell, itertools.product(CELL_TURNS, FORCE_DECADES))
        found = [*forces, *sizes(), *steps(), *special()]
    if quick:
        # every third cell of the planes, and all steps and special cases
        found = [x for j, x in enumerate(found) if x.block in ("step", "special") or j % 3 == 0]
    return [x for x in found if x.finite]


def force_cell(turn: float, decade: int) -> Spec:
    """A cell of the plane of h w and force: mass and step are fixed, amplitude = force / k."""
    k = MASS * (turn / STEP) ** 2
    q = float(np.float64(10.0**decade) / np.float64(k))
    return Spec(block="force", m=MASS, k=k, q=q, p=0.6 * MASS * (turn / STEP) * q, h=STEP)


def sizes() -> Iterator[Spec]:
    """The plane of mass and stiffness at h w = 0.3, amplitude 1."""
    for a, b in itertools.product(SIZE_DECADES, SIZE_DECADES):
        m, k = 3.7 * 10.0**a, 2.9 * 10.0**b
        # a power of 2, so that cells of one ratio share a step
        w = float(2.0 ** np.round(np.log2(2.9 / 3.7) / 2 + (b - a) / 2 * np.log2(10)))
        yield Spec(block="size", m=m, k=k, q=1.0, p=0.6 * np.sqrt(m) * np.sqrt(k), h=0.25 / w)


def steps() -> Iterator[Spec]:
    """Steps of every size and both signs at h w = 0.3, and free motion where no stiffness is large enough."""
    for decade, sign in itertools.product(STEP_DECADES, (1, -1)):
        h = sign * 3.1 * 10.0**decade
        k = 3.7 * np.float64(0.3 / 3.1 / 10.0 ** np.float64(decade)) ** 2
        yield Spec(block="step", m=3.7, k=float(k) if np.isfinite(k) else 0.0, q=0.8, p=0.0, h=h)


def special() -> Iterator[Spec]:
    """k = 0, k < 0, a state of rest, the smallest and the largest numbers; all with one step."""
    for k, q, p in (
        (0.0, 0.3, 0.7), (0.0, 0.0, 0.0), (0.0, 1e300, 1e300), (0.0, 1e-300, 1e-300), (2.9, 0.0, 0.0),
        (2.9, 0.0, 0.7), (2.9, 0.3, 0.0), (-2.9, 0.3, 0.7), (-2.9, 0.0, 0.0), (-1e-300, 0.3, 0.7),
        (-1e-3, 0.3, -0.7), (-1e3, 0.3, 0.7), (-1e6, 0.3, 0.7), (-1e12, 0.3, 0.7), (-1e300, 0.3, 0.7),
        (2.9, 5e-324, 0.0), (2.9, 0.0, 5e-324), (2.9, 1e-310, 1e-310), (1e-310, 0.3, 0.7),
        (5e-324, 0.3, 0.7), (2.9, 1.7e308, 0.0), (2.9, 0.0, 1.7e308), (1e300, 1e300, 0.0),
        (1.7e308, 0.3, 0.7), (1e-300, 1e-300, 0.0), (2.9, -0.3, -0.7), (2.9, 0.3, 1e-16), (2.9, 1e16, 0.7),
    ):  # fmt: skip
        for m in (3.7, 0.37):
            yield Spec(block="special", m=m, k=k, q=q, p=p, h=0.11)


def scene(cells: list[Spec], requires: frozenset[Need]) -> Scene:
    """Cells of one step and one length as a scene of particles side by side."""
    first = cells[0]
    m, k, q, p = (np.array([getattr(x, name) for x in cells]) for name in ("m", "k", "q", "p"))
    c = None
    if Need.DAMPING in requires:
        # methods that require damping get friction: h c/m = 1/80
        rate = min(0.0125 / abs(first.h), 1e300) if first.h > 0 else 0.0
        with np.errstate(over="ignore", under="ignore"):
            c = np.where(first.block == "force", np.minimum(rate * m, 1e300), 0.0)
    return spring(
        m, k, q, p, first.h, first.steps, c=c, fast=Need.FAST_SPRINGS in requires, name="extreme",
        tolerance=first.tolerance, quantities=("q", "p"),
    )  # fmt: skip
