"""Axes of a picture of a scene: a coordinate, its momentum, and their units."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from springcheck.errors import SpringcheckError
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, VanDerPol

MOST_PANELS = 4
"""Particles up to which each has a panel of its own."""

WEAK_MODE = 1e-9
"""Part of the largest energy of a mode from which on a mode is drawn."""

State = tuple[Floats, Floats]


class Units(NamedTuple):
    """Units of a scene's numbers, "" for reduced ones."""

    q: str = ""
    p: str = ""
    t: str = ""


_UNITS = {
    ("particles", "md"): Units("nm", "u nm/ps", "ps"),
    ("particles", "si"): Units("m", "kg m/s", "s"),
    ("circuit", "si"): Units("C", "Wb", "s"),
}


def units(scene: Scene) -> Units:
    """The units of a scene."""
    return _UNITS.get((scene.kind, scene.units), Units())


def with_unit(name: str, unit: str) -> str:
    """The label of an axis."""
    return f"{name} ({unit})" if unit else name


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """One coordinate x of a scene and its momentum y."""

    title: str
    """Title of its panel: "particle 1", or "" for a scene of one."""
    what: str
    """Name of the abscissa, in one word."""
    x_name: str
    y_name: str
    x_unit: str
    y_unit: str
    pick: Callable[[Reals, Reals], State]
    """q and p (f, n) -> x and y (f,)."""
    turn: float = 0.0
    """The period of x, 0 where it has none."""
    potential: Callable[[Floats], Floats] | None = None
    """The potential of x alone, where the motion of x is independent of other coordinates."""
    mass: float = 1.0

    def wrapped(self, x: Floats, y: Floats) -> State:
        """States in one period, from -turn/2 to turn/2; NaN between two on opposite sides of its border."""
        if not self.turn:
            return x, y
        near = x - self.turn * np.round(x / self.turn)
        breaks = 1 + np.flatnonzero(np.abs(np.diff(near)) > self.turn / 2)
        return np.insert(near, breaks, np.nan), np.insert(y, breaks, np.nan)

    def separatrices(self, low: float, high: float) -> list[State]:
        """Curves of constant energy through the maxima of the potential near a range of x, which separate
        motions of different kinds."""
        if self.potential is None or not (np.isfinite([low, high]).all() and high > low):
            return []
        x = (
            np.linspace(low, high, 2001)
            if self.turn
            else np.linspace(low - (high - low), 2 * high - low, 6001)
        )
        with np.errstate(all="ignore"):
            v = self.potential(x)
        inside = v[1:-1]
        tops = {int(i) + 1 for i in np.flatnonzero((inside > v[:-2]) & (inside >= v[2:]))}
        if self.turn:
            tops.add(int(np.argmax(v)))
        levels = sorted({float(v[i]) for i in tops if np.isfinite(v[i])})
        out = []
        for level in levels:
            rest = level - v
            # a maximum itself, where a rounding may make it negative
            rest = np.where(np.abs(rest) <= 1e-12 * np.ptp(v), 0, rest)
            with np.errstate(invalid="ignore"):
                out.append((x, np.sqrt(2 * self.mass * rest)))
        return out


_NAMES = {
    "particles": ("position q", "momentum p"),
    "circuit": ("charge q", "flux p"),
}


def views(scene: Scene, particle: int | None = None) -> list[View]:
    """Views of a scene: this particle, a free pair's bond, or the first particles one by one.

    SpringcheckError where there is no such particle.
    """
    if particle is not None:
        if not 0 <= particle < scene.n:
            raise SpringcheckError(
                f"--particle {particle}: scene {scene.name} has particles 0 to {scene.n - 1}"
            )
        return [_single(scene, particle)]
    # two particles that are bound to each other and to nothing else
    joined = scene.terms and all(term.bodies == 2 for term in scene.terms)
    if scene.particles == 2 and joined and scene.bath is None:
        return [_bond(scene) if scene.n == 2 else _bond_in_space(scene)]
    system = scene.system
    if scene.n == scene.particles > 2 and not system.is_separate and system.has_modes and scene.bath is None:
        y, v = (x[0] for x in system.modes.about_centres(scene.q[None], scene.p[None]))
        energies = np.asarray(v * v + np.abs(system.modes.w2) * y * y, np.float64)
        # a mode that turns less than once is no circle
        turns = np.abs(system.modes.w2) * float(scene.step * scene.steps) ** 2 > (2 * np.pi) ** 2
        energies = np.where(turns | ~np.any(turns), energies, 0)
        strongest = np.argsort(-energies, kind="stable")[:MOST_PANELS]
        return [_mode(scene, int(i)) for i in strongest if energies[i] > WEAK_MODE * np.max(energies)]
    return [_single(scene, i) for i in range(scene.n if scene.n <= MOST_PANELS else 1)]


def paths(scene: Scene) -> list[View]:
    """The path of the first particle in each plane of axes along which it moves: one axis over the other."""
    if scene.places is None:
        return []
    of_axis = {"xyz"[p % 3]: j for j, p in enumerate(scene.places.tolist()) if p < 3}
    unit = units(scene).q

    def view(x: str, y: str) -> View:
        i, j = of_axis[x], of_axis[y]

        def pick(q: Reals, p: Reals) -> State:
            return np.asarray(q[:, i], np.float64), np.asarray(q[:, j], np.float64)

        return View(
            title=f"plane of {x} and {y}", what="path", x_name=f"position {x}", y_name=f"position {y}",
            x_unit=unit, y_unit=unit, pick=pick,
        )  # fmt: skip

    found = [view(x, y) for x, y in ("xy", "yz", "xz") if x in of_axis and y in of_axis]
    return [replace(one, title="") for one in found] if len(found) == 1 else found


def _relaxing(scene: Scene, i: int, term: VanDerPol) -> View:
    """Van der Pol's oscillator in Lienard's plane: it creeps along a cubic, and jumps between its arms."""
    c, width, at = (float(x[term.i == i][0]) for x in (term.c, term.width, term.at))

    def pick(q: Reals, p: Reals) -> State:
        u = np.asarray(q[:, i], np.float64) - at
        with np.errstate(over="ignore", invalid="ignore"):
            return u + at, np.asarray(p[:, i], np.float64) / c - u + u**3 / (3 * width**2)

    unit = units(scene)
    return View(
        title="" if scene.n == 1 else f"particle {i}", what="position", x_name="position q",
        y_name="Li\u00e9nard's p/c \u2212 q + q\u00b3/3w\u00b2", x_unit=unit.q, y_unit=unit.q, pick=pick,
    )  # fmt: skip


def _single(scene: Scene, i: int) -> View:
    for term in scene.terms:
        if isinstance(term, VanDerPol) and np.any(term.i == i):
            return _relaxing(scene, i, term)
    unit = units(scene)
    x_name, y_name = _NAMES[scene.kind]
    turns = {float(2 * np.pi / w) for t in scene.terms if isinstance(t, Cosine) for w in t.wave[t.i == i]}
    alone = scene.system.is_separate
    part = scene.system.part(np.array([i])) if alone else None
    # an angle in units of pi, for a pendulum alone
    turn = turns.pop() if len(turns) == 1 and part is not None and _only_cosine(part) else 0.0
    centre = float(part.terms[0].at[0]) if turn and part is not None else 0.0  # type: ignore[attr-defined]
    scale = 2.0 / turn if turn else 1.0

    def pick(q: Reals, p: Reals) -> State:
        return scale * (np.asarray(q[:, i], np.float64) - centre), np.asarray(p[:, i], np.float64)

    def potential(x: Floats) -> Floats:
        assert part is not None
        q = (x / scale + centre)[:, None]
        return np.asarray(part.system.energy(q, np.zeros_like(q)), np.float64)

    return View(
        title=f"particle {i}" if scene.places is None and scene.n > 1 else _place(scene, i),
        what="angle" if turn else x_name.split()[0],
        x_name="angle" if turn else x_name,
        y_name=y_name,
        x_unit="\u03c0" if turn else unit.q,
        y_unit=unit.p,
        pick=pick,
        turn=2.0 if turn else 0.0,
        potential=potential if alone else None,
        mass=float(scene.m[i]),
    )


def _place(scene: Scene, i: int) -> str:
    """The particle whose coordinate it is where particles move in space, else ""."""
    if scene.places is None:
        return ""
    particle, axis = divmod(int(scene.places[i]), 3)
    return "xyz"[axis] if scene.particles == 1 else f"particle {particle}, {'xyz'[axis]}"


def _only_cosine(part: Scene) -> bool:
    held = [term for term in part.terms if term.kind == "potential"]
    return len(held) == 1 and isinstance(held[0], Cosine) and len(held[0]) == 1


def _bond(scene: Scene) -> View:
    unit = units(scene)
    m = scene.m
    mass = float(m[0] * m[1] / (m[0] + m[1]))

    def pick(q: Reals, p: Reals) -> State:
        x, y = q[:, 1] - q[:, 0], mass * (p[:, 1] / m[1] - p[:, 0] / m[0])
        return np.asarray(x, np.float64), np.asarray(y, np.float64)

    def potential(x: Floats) -> Floats:
        q = np.stack([np.zeros_like(x), x], axis=1)
        return np.asarray(scene.system.energy(q, np.zeros_like(q)), np.float64)

    return View(
        title="the bond",
        what="length",
        x_name="length q1 - q0",
        y_name="relative momentum",
        x_unit=unit.q,
        y_unit=unit.p,
        pick=pick,
        potential=potential,
        mass=mass,
    )


def _mode(scene: Scene, i: int) -> View:
    """A normal mode of a chain: on a circle, unless it gains or loses energy."""
    modes = scene.system.modes
    one = np.zeros((1, scene.n), np.longdouble)
    one[0, i] = 1
    # its shape, by which the modes of a long chain cost no transform of every frame
    shape = np.asarray((modes.from_centres(one, 0 * one)[0] - modes.rest)[0], np.float64)
    rest, w = np.asarray(modes.rest, np.float64), float(np.sqrt(max(float(modes.w2[i]), 0.0)))
    number = int(np.sum(modes.w2 < modes.w2[i])) + 1

    def pick(q: Reals, p: Reals) -> State:
        with np.errstate(over="ignore", invalid="ignore"):
            y = np.asarray(q, np.float64) - rest
            return (w or 1.0) * (y * scene.m) @ shape, np.asarray(p, np.float64) @ shape

    return View(
        title=f"mode {number} of {scene.n}", what="mode", x_name="\u03c9 times its position", x_unit="",
        y_name="its velocity", y_unit="", pick=pick,
    )  # fmt: skip


def _bond_in_space(scene: Scene) -> View:
    """The length of the bond of two particles in space, and the momentum along it."""
    assert scene.places is not None
    unit, axes = units(scene), scene.places % 3
    ends = [scene.places // 3 == k for k in (0, 1)]
    m = [float(scene.m[here][0]) for here in ends]
    mass = m[0] * m[1] / (m[0] + m[1])

    def apart(x: Reals) -> Floats:
        out = np.zeros((2, len(x), 3))
        for k, here in enumerate(ends):
            out[k][:, axes[here]] = np.asarray(x, np.float64)[:, here]
        return np.asarray(out[1] - out[0])

    def pick(q: Reals, p: Reals) -> State:
        with np.errstate(all="ignore"):
            way, moving = apart(q), apart(np.asarray(p) / scene.m)
            length = np.sqrt(np.sum(way**2, axis=1))
            return length, mass * np.sum(way * moving, axis=1) / length

    return View(
        title="the bond", what="length", x_name="length of the bond", y_name="momentum along the bond",
        x_unit=unit.q, y_unit=unit.p, pick=pick, mass=mass,
    )  # fmt: skip
