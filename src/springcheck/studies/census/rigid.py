"""Constraints in the census: what a method holds rigid, by its states alone.

A method for scenes with rods moves each mass of the census in two parts, joined by a rod along the line:
together they are one mass, whose map is measured.  Length and turn are those of the scene `dumbbell`, for
every method that can serve it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label, Need
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.rods import Rods
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.terms import Rod
from springcheck.physics.trajectory import Trajectory

LENGTH, PART = 0.75, 0.375
"""Length of the rod [L], and share of the mass at its near end: unequal, and exact in binary."""

ROD_TURNS: Mapping[str, Callable[[Floats], Floats]] = {
    "asin(h w)": np.arcsin,
    "2 asin(h w/2)": lambda x: 2 * np.arcsin(x / 2),
    "atan(h w)": np.arctan,
    "2 atan(h w/2)": lambda x: 2 * np.arctan(x / 2),
    "h w": lambda x: x,
}
"""Turn of a free rod in a step: by SHAKE and RATTLE; by these in two drifts of half a step; where the length
is restored along the rod after the drift; by Cayley's rotation; exactly."""

WORSE_FIT = 4
"""Largest residual of a scheme's map, in residuals of the best linear map."""

NO_SCHEME = "none that is known"

ROUNDED_ERROR = 1e-13
"""Largest error that counts as rounding: 400 steps of 2**-52."""

ALIKE_MAPS = 1e-9
"""Difference of one-step maps along two axes up to which they count as equal: fits of 60 states leave 1e-13,
solvers their tolerance."""

UNLIKE_TURN = 1e-4
"""Relative misfit from which a turn follows none of these: at h w = 0.15 they differ by 1.9e-3 or more."""


def split(scene: Scene) -> Scene:
    """A scene of one mass with that mass in two parts, joined by a rod."""
    near = PART * scene.m
    m = np.concatenate([near, scene.m - near])
    rod = Rod(a=np.array([0]), b=np.array([1]), length=np.array([LENGTH]))
    return scene.derived(
        m=m, q=np.append(scene.q, scene.q + LENGTH), p=m * (scene.p / scene.m), terms=(*scene.terms, rod)
    )


def is_rigid(label: Label) -> bool:
    """Whether a method serves scenes with rods alone, without noise, and so moves a mass in two parts."""
    method = engines.method(label)
    return Need.RODS in method.requires and not method.generator


def is_hinge(label: Label) -> bool:
    """Whether a method serves rotors alone, whose coordinate is an angle."""
    return engines.method(label).kinds == {"rotor"}


def _given(scene: Scene, label: Label) -> Scene:
    if is_hinge(label):
        return scene.derived(kind="rotor")
    return split(scene) if is_rigid(label) else scene


def refusal(scene: Scene, label: Label) -> str | None:
    """Why a method cannot move this spring, as `engines.refusal`."""
    return engines.refusal(_given(scene, label), label)


def run(scene: Scene, label: Label) -> Trajectory:
    """A run of one mass; a method for rods runs the two parts, which are reported as one mass."""
    both = driver.run(_given(scene, label), label)
    if not is_rigid(label):
        return both
    return replace(both, q=both.q[:, :1], p=np.sum(both.p, axis=1, keepdims=True), energy=None)


def fitted(q: Floats, p: Floats) -> Floats:
    """The one-step matrix (2, 2) that fits states (f,) best, by least squares."""
    z = np.stack([q, p])
    return np.asarray(z[:, 1:] @ np.linalg.pinv(z[:, :-1]))


def name(scene: Scene, found: Trajectory) -> str:
    """Schemes whose map of this spring fits the states as well as any linear map.  The residuals are the
    solver's own, of an arithmetic that `identify` does not know."""
    if found.outcome.step == 0:
        return NO_SCHEME
    z = np.stack([found.q[:, 0], found.p[:, 0]])
    z = z / np.max(np.abs(z), axis=1, keepdims=True)
    scale = np.max(np.abs(found.q)) / np.max(np.abs(found.p))
    best = fitted(*z)
    if found.arithmetic.parameters == "single":
        scene = scene.system.in_single
    m, k = scene.m, scene.system.hessian_diagonal(scene.q)
    unlike: list[tuple[str, Floats]] = []
    for one in schemes.SCHEMES.values():
        if one.has("one-step"):
            matrix = schemes.matrix(one, h=scene.step, m=m, k=k)[0] * [[1, 1 / scale], [scale, 1]]
            if not any(np.allclose(matrix, other, rtol=1e-14, atol=1e-14) for _, other in unlike):
                unlike.append((one.name, matrix))

    def left(matrix: Floats) -> float:
        return float(np.max(np.abs(z[:, 1:] - matrix @ z[:, :-1])))

    fit = (one for one, matrix in unlike if left(matrix) <= WORSE_FIT * left(best))
    return " or ".join(fit) or NO_SCHEME


def axes(label: Label) -> str:
    """Axes along which a method moves particles, by the states of `orbit`, or of `rigid-triangle` for
    rods."""
    if is_hinge(label):
        return "an angle"
    scene = replace(load_scene("rigid-triangle" if is_rigid(label) else "orbit"), steps=60)
    if engines.refusal(scene, label):
        return "x"
    found = driver.run(scene, label)
    if found.outcome.step == 0:
        return "none"
    said = "x, y and z"
    if not is_rigid(label):
        maps = np.stack([fitted(found.q[:, axis], found.p[:, axis]) for axis in range(3)])
        coarse = found.arithmetic.state > 2.0**-53
        alike = np.ptp(maps, axis=0).max() < (1e-4 if coarse else ALIKE_MAPS)
        # steps that depend on the forces are no linear map
        said += " alike" if alike else "" if engines.method(label).adaptive else " unlike"
    return said


def constraint(label: Label) -> str:
    """What a method holds rigid, by the states of `dumbbell` or of a free rotor; "" where it serves
    neither."""
    if is_hinge(label):
        free = load_scene("hinged-pendulum").derived(terms=())
        each, h_w = np.diff(driver.run(free, label).q[:, 0]), free.step * free.p / free.m
        return f"hinge: {_named(each, h_w)}"
    scene = load_scene("dumbbell")
    if engines.refusal(scene, label):
        return ""
    found, rods = driver.run(scene, label), scene.system.rods
    assert rods is not None
    return f"rod: {_turn(found, rods, scene)}, length {to(np.max(np.abs(rods.strain(found.q))))}"


def _turn(found: Trajectory, rods: Rods, scene: Scene) -> str:
    r = rods.ways(found.q.astype(np.longdouble))
    sine = r[:-1, 0] * r[1:, 1] - r[:-1, 1] * r[1:, 0]
    each = np.abs(np.arctan2(sine, rods.dot(r[:-1], r[1:])[:, 0]))
    h_w = np.asarray(scene.step * rods.rates(scene.q, scene.p), np.float64)
    return _named(each, h_w)


def _named(each: Reals, h_w: Floats) -> str:
    """The mean turn per step, as a law of h w (1,) [rad]."""
    if not len(each):
        return "takes no step"
    off = {name: float(np.abs(np.mean(each) / turn(h_w) - 1)[0]) for name, turn in ROD_TURNS.items()}
    name = min(off, key=lambda one: off[one])
    if not off[name] < UNLIKE_TURN:
        return f"turns by {float(np.mean(each) / h_w[0]):.4f} h w a step"
    return f"turns by {name} a step {to(off[name])}"


def to(off: float) -> str:
    """A deviation rounded up to a power of ten, so that roundings do not change a column that is compared."""
    return "to rounding" if off < ROUNDED_ERROR else f"to {10.0 ** np.ceil(np.log10(off)):.0e}"
