"""Resonances of multiple time steps: where r-RESPA grows although both of its steps are short enough.

A slow kick every half turn of the fast spring acts always at the same phase.  The bands are measured on
copies of a chain in one run: every copy has all stiffnesses scaled by one factor, which is equivalent to
another step. Biesiadecki & Skeel, J. Comput. Phys. 109 (1993) 318.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from springcheck import engines, schemes
from springcheck.engines.contract import Label, Need
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.studies.stability import propagators
from springcheck.studies.stability.propagators import Stepper, by_engine

RESONANCE_TURNS = (1.0, 7.0)
"""Range of h w of the fast spring."""

CHAIN_COPIES = 1200
"""Copies of the chain in the first scan, to which those where two eigenvalues meet are added."""

RESONANT_GROWTH = 1e-7
"""Growth per step from which a step counts as growing: nearly equal eigenvalues of a 4 x 4 matrix are known
to the square root of the rounding only."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Resonance:
    """Spectral radii along h w of the fast spring, and the bands in which they exceed 1."""

    method: str
    scene: str
    h_w: Floats
    radius: Floats
    radius_predicted: Floats
    bands: tuple[tuple[float, float], ...]
    bands_predicted: tuple[tuple[float, float], ...]

    def grows(self, name: str) -> str:
        """Where its steps grow along h w, which is called `name`, in words."""
        bands = ", ".join(f"{a:.6f} to {b:.6f}" for a, b in self.bands)
        ends = f"{self.h_w[0]:g} to {self.h_w[-1]:g}"
        return f"grows at {name} from {bands}" if bands else f"grows at no {name} from {ends}"


def fast_frequency(scene: Scene) -> float:
    """Angular frequency of the scene's fastest mode with its fast springs alone [1/T]."""
    return float(np.sqrt(np.max(replace(scene, terms=scene.system.fast).system.modes.w2)))


def serves(scene: Scene, label: Label) -> bool:
    """Whether a method takes the scene's fast springs in substeps, and nothing acts but springs."""
    marked = engines.method(label).requires == {Need.FAST_SPRINGS}
    springs = scene.system.is_linear and not scene.system.is_damped
    return marked and springs and not engines.refusal(scene, label)


def measure(scene: Scene, label: Label) -> Resonance:
    """Scan the bands of a scene with springs marked fast, and find their edges to 1e-9."""
    turn = np.linspace(*RESONANCE_TURNS, CHAIN_COPIES)
    met = propagators.meetings(lambda x: np.linalg.eigvals(maps(scene, label, x, _by_scheme)), turn)
    turn = np.sort(np.append(turn, met))

    def scanned(step: Stepper) -> tuple[Floats, tuple[tuple[float, float], ...]]:
        radius = radii(scene, label, turn, step)
        return radius, _bands(turn, radius, lambda x: radii(scene, label, x, step))

    (radius, bands), (predicted, bands_predicted) = scanned(by_engine), scanned(_by_scheme)
    return Resonance(
        method=str(label),
        scene=scene.name,
        h_w=turn,
        radius=radius,
        radius_predicted=predicted,
        bands=bands,
        bands_predicted=bands_predicted,
    )


def radii(scene: Scene, label: Label, turn: Floats, step: Stepper) -> Floats:
    """Spectral radii of one step (j,) of copies of the scene at these h w of the fast spring."""
    return np.asarray(np.max(np.abs(np.linalg.eigvals(maps(scene, label, turn, step))), axis=-1))


def maps(scene: Scene, label: Label, turn: Floats, step: Stepper) -> Floats:
    """One-step matrices (j, 2n, 2n) of these copies."""
    copies = len(turn)
    scale = (turn / (abs(scene.step) * fast_frequency(scene))) ** 2
    # coordinates in which q and p/(m w) have one scale
    w = fast_frequency(scene) * np.sqrt(scale)
    # displacements from equilibrium move as if every spring's rest point were 0
    linear = replace(scene, terms=tuple(x.shifted(-getattr(x, x.origin, 0.0)) for x in scene.terms))
    many = linear.system.tiled(copies)
    terms = tuple(term.scaled(np.repeat(scale, len(term) // copies)) for term in many.terms)
    units = np.ones((copies, scene.n)), scene.m * w[:, None]
    return propagators.matrices(replace(many, terms=terms), label, *units, step)


def _by_scheme(scene: Scene, label: Label) -> tuple[Reals, Reals]:
    law = schemes.Law(scheme=schemes.scheme(engines.method(label).scheme), scene=scene, h=scene.step)
    return law.step(scene.q.astype(np.longdouble), scene.p.astype(np.longdouble))


def _bands(
    turn: Floats, radius: Floats, again: Callable[[Floats], Floats]
) -> tuple[tuple[float, float], ...]:
    """Edges of the ranges of growing points, refined to 1e-9."""
    growing = radius > 1 + RESONANT_GROWTH
    edges = np.flatnonzero(growing[1:] != growing[:-1])
    found = [_edge(turn[j], turn[j + 1], again) for j in edges]
    if growing[0]:
        found.insert(0, float(turn[0]))
    if growing[-1]:
        found.append(float(turn[-1]))
    return tuple(zip(found[::2], found[1::2], strict=True))


def _edge(low: float, high: float, again: Callable[[Floats], Floats]) -> float:
    while high - low > 1e-9:
        turn = np.linspace(low, high, 66)
        growing = again(turn) > 1 + RESONANT_GROWTH
        j = int(np.flatnonzero(growing[1:] != growing[:-1])[0])
        low, high = float(turn[j]), float(turn[j + 1])
    return (low + high) / 2
