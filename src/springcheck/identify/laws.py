"""Laws of what one map leaves over, as a table: the columns of each, and its sentence."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from springcheck.identify.catalogue import distinct
from springcheck.identify.compare import Freedom, compare, distance
from springcheck.identify.measure import Map
from springcheck.identify.repairs import FALLS
from springcheck.identify.result import Explanation

EXPLAINS = 0.35
"""Largest share of the residuals that a law may leave."""

SURELY = 0.03
"""Share left by a law that is surer than a scheme with memory."""

NEAREST = ("exact", "velocity-verlet", "rk4", "forest-ruth")
"""Schemes with friction that the exact solution is compared with."""

FINEST = 1e-10
"""Distance from the exact solution below which a map that is no scheme's is that of a solver."""

FORGETS = 0.1
"""Share left by a law that needs no memory."""

FEW_TURNS = 2.0
"""Fewest periods that separate functions of the state from functions of time."""

FEWEST = 24
"""Effective number of frames below which residuals show no cause."""


def _hats(x: Any, n: int) -> list[Any]:
    at = np.linspace(float(np.min(x)), float(np.max(x)), n)
    return list(np.maximum(0, 1 - np.abs(x - at[:, None]) / ((at[1] - at[0]) or 1.0)))


def _time(z: Any, *carriers: Any) -> list[Any]:
    hats = _hats(np.linspace(-1, 1, len(z)), min(14, max(4, len(z) // 8)))
    return [hat * c for c in carriers for hat in hats]


def _turns(z: Any) -> list[Any]:
    old, new = z[:, 1], np.append(z[1:, 1], np.nan)
    return [np.where(old * new > 0, np.sign(old), np.nan)]


def _past(z: Any, steps: int) -> list[Any]:
    return [np.concatenate([np.full(i, np.nan), z[:-i, k]]) for i in range(1, steps) for k in (0, 1)]


def _powers(z: Any) -> list[Any]:
    return [z[:, 0] ** i * z[:, 1] ** k for i in range(4) for k in range(4) if i + k in (0, 2, 3)]


def _waves(z: Any, left: Any, carrier: Any) -> list[Any]:
    """A carrier times cosine and sine of the frequency that explains most."""
    n = np.arange(len(z))
    flat = np.linalg.qr(np.column_stack([z, np.ones(len(z))]))[0]
    rest = left - flat @ (flat.T @ left)
    size = 1 << (8 * len(z) - 1).bit_length()
    power = np.sum(np.abs(np.fft.rfft(rest * carrier[:, None], size, axis=0)) ** 2, 1)
    lowest = size // (4 * len(z))
    w = 2 * np.pi / size * float(np.argmax(power[lowest:]) + lowest)

    def missed(w: float) -> float:
        wave = [carrier * np.cos(w * n), carrier * np.sin(w * n)]
        two = np.column_stack([z, np.ones(len(z)), *wave])
        return float(np.sum((left - two @ np.linalg.lstsq(two, left, rcond=None)[0]) ** 2))

    step, least = 2 * np.pi / size, missed(w)
    for _ in range(60):
        if step < 1e-14:
            break
        ways = [(missed(w + step), w + step), (missed(w - step), w - step)]
        if min(ways)[0] < least:
            least, w = min(ways)
        else:
            step /= 4
    return [carrier * np.cos(w * n), carrier * np.sin(w * n)]


@dataclass(frozen=True, slots=True)
class Law:
    """A law: its kind, its sentence, what to do, further numbers, and its columns of states and residuals."""

    kind: str
    text: str
    remedy: str
    more: int
    columns: Callable[[Any, Any], list[Any]]


SCENE = "state the force: --scene"
STEADY = "keep the step and the constants of the force as they are"
LAWS = (
    Law("constant", "A constant added to the position in every frame explains most of what a map misses",
        "look for a drift that is not the velocity's", 0, lambda z, r: [np.ones(len(z))]),
    Law("drag", "A drag c1 v + c2 |v| v acts: the friction depends on the velocity", SCENE, 0,
        lambda z, r: [np.abs(z[:, 1]) * z[:, 1]]),
    Law("dry", "Dry (Coulomb) friction acts: a force of one size against the velocity", SCENE, 0,
        lambda z, r: _turns(z)),
    Law("alternates", "Even and odd steps differ and alternate", STEADY, 0,
        lambda z, r: [z[:, k] * (-1.0) ** np.arange(len(z)) for k in (0, 1)]),
    Law("anharmonic", "The force is anharmonic: not linear in the position, it has a quadratic part",
        SCENE, 0, lambda z, r: [np.ones(len(z)), z[:, 0] ** 2]),
    Law("anharmonic", "The force is anharmonic: not linear in the position, it has a cubic part", SCENE, 0,
        lambda z, r: [z[:, 0] ** 3]),
    Law("memory", "Each state follows from the two before it: a scheme with memory (two-step, Adams, BDF), "
        "or a coupled oscillator not recorded", "record every coordinate, or name the method", 0,
        lambda z, r: _past(z, 2)),
    Law("memory", "Each state follows from the three before it: a scheme with memory (Adams, BDF)",
        "name the method", 6, lambda z, r: _past(z, 3)),
    Law("time", "The stiffness changes in time, up and down", SCENE, 3, lambda z, r: _waves(z, r, z[:, 0])),
    Law("driven", "A force from outside drives the motion, up and down in time", SCENE, 3,
        lambda z, r: _waves(z, r, np.ones(len(z)))),
    Law("anharmonic", "The motion is anharmonic: the force is not linear in position or velocity", SCENE, 0,
        lambda z, r: _powers(z)),
    Law("anharmonic", "The force is not linear in the position, as one that is clipped or anharmonic",
        SCENE, 0, lambda z, r: _hats(z[:, 0], 16)),
    Law("drag", "The friction is not linear in the velocity: a drag", SCENE, 0,
        lambda z, r: _hats(z[:, 1], 16)),
    Law("time", "The stiffness changes in time", STEADY, 0, lambda z, r: _time(z, z[:, 0])),
    Law("time", "The friction changes in time, as of a thermostat", STEADY, 0,
        lambda z, r: _time(z, z[:, 1])),
    Law("time", "The step or the stiffness changes in time", STEADY, 0,
        lambda z, r: _time(z, z[:, 0], z[:, 1])),
)  # fmt: skip
FAINT = 1e-12
"""Effect of a law on a frame, relative to the state, below which few frames do not tell it from another."""

ALSO = {
    "time": "changes in time", "anharmonic": "is anharmonic", "drag": "depends on the velocity",
    "driven": "is driven",
}  # fmt: skip


def law(maps: list[Map], m: Map, jitter: float) -> Explanation:
    """The law that explains what is left of map m with the fewest numbers, a solver, memory, or noise."""
    w = 1 / m.base[:, None]
    z, left = m.z[:-1].astype(float), m.left * w
    counted = float(np.sum(left**2)) ** 2 / max(float(np.sum(np.sum(left**2, 1) ** 2)), 1e-300)
    off = np.max(np.abs(m.left), 1)
    mean = float(np.sqrt(np.mean((np.sqrt(np.sum(z**2, 1))[:, None] * w) ** 2)))
    size = float(np.sqrt(np.mean(left**2))) / mean
    if found := of_a_solver(m, size, jitter):
        return found
    others = [c for x in maps if x is not m for c in x.z[:-1].astype(float).T]
    coupled = Law("coupled", "The oscillators are coupled: a coordinate follows from the states of all",
                  SCENE, 0, lambda z, r: others)  # fmt: skip
    rows = (*LAWS, *([coupled] if others else []))
    tried = [x for one in rows if (x := _tried(one, z, left, w, counted))]
    fitting = [x for x in tried if x[0] < EXPLAINS]
    if any(x[0] < FORGETS and x[3].kind != "memory" for x in fitting):
        # a drive, and what is not linear, obeys a recurrence of several states as well
        fitting = [x for x in fitting if x[3].kind != "memory"]
    surely = any(x[0] < SURELY and x[3].kind in ("anharmonic", "drag") for x in fitting)
    relative = off / np.max(np.abs(m.z[1:].astype(float)), 1)
    ways = (np.maximum(off - 8 / w[:, 0], 0), relative)
    begins = all(x[len(z) // 4 :].max(initial=0) < 0.1 * x.max() for x in ways)
    if not surely and len(z) > 12 and begins and np.max(off[1:] * w[1:, 0]) > 64:
        return Explanation(
            "The first frames follow another map than those after them: a scheme with memory, whose force is "
            "that of the step before (Adams, BDF, generalised alpha), or a solver of several orders",
            "name the method, or give the frames after its start",
            size,
        )
    return _best(fitting, m, counted, size) if fitting else _none(left, counted, size)


def _tried(one: Law, z: Any, left: Any, w: Any, counted: float) -> tuple[float, float, int, Law] | None:
    """Share of the residuals that a law leaves, its cost, its numbers, itself; None where it is not sure."""
    columns = np.column_stack([z, np.ones(len(z)), *one.columns(z, left / w)])
    ok = np.all(np.isfinite(columns), 1)
    if np.count_nonzero(ok) <= columns.shape[1] + 1:
        return None
    x, y = columns[ok] * w[ok], left[ok]
    scale = np.sqrt(np.mean(x**2, 0))
    x = x / np.where(scale > 0, scale, 1)
    fit, _, rank, _ = np.linalg.lstsq(x, y, rcond=None)
    spare, own = len(y) - rank - one.more, y
    if one.kind != "constant":
        own = y - x[:, :3] @ np.linalg.lstsq(x[:, :3], y, rcond=None)[0]
    rest = y - x @ fit
    share = math.sqrt(float(np.sum(rest**2)) / max(float(np.sum(own**2)), 1e-300) * len(y) / max(spare, 1))
    exact, numbers = float(np.max(np.abs(rest))) < 64, int(rank) - 2 + one.more
    certain = counted > 3 * numbers or (exact and spare > 2 * rank)
    certain = certain or share ** max(min(counted, spare) - numbers, 0) < 1e-7
    return (share, share * math.sqrt(rank + one.more), numbers, one) if spare > 2 and certain else None


SINGLE = 2.0**-20
"""Residuals up to which forces in single precision, or a sum of them in fixed point, may be their cause."""


COARSE = "; forces in less than double precision may leave as much"


def _best(fitting: list[tuple[float, float, int, Law]], m: Map, counted: float, size: float) -> Explanation:
    least = min(fitting, key=lambda x: x[1])
    good = [x for x in fitting if x[0] <= 3 * least[1] / math.sqrt(x[2] + 2)] or [least]
    kinds = dict.fromkeys(x[3].kind for x in good)
    first = min(good, key=lambda x: x[2])
    # in few frames a law in time, or one near the rounding of doubles, may be any other
    unsure = first[0] > 1 / FALLS or first[3].kind in ("time", "driven") or size < FAINT
    if (unsure and counted < FEWEST) or size > 1:
        return _too_few(counted, size)
    if first[3].kind in ("time", "anharmonic", "driven", "memory") and m.turns < FEW_TURNS:
        return Explanation(
            "The force changes in time or is anharmonic or is driven, and the arc is too short to tell "
            f"which: it moves a frame by {size:.1e} of the state's size",
            "record more periods",
            size,
        )
    few = m.freedom < 60
    also = [ALSO[k] for k in kinds if k in ALSO and ALSO[k] != ALSO.get(first[3].kind) and few]
    text = f"{first[3].text}, which moves a frame by {size:.1e} of the state's size"
    more = f"; or it {also[0]}: too few periods to tell which" if also else ""
    return Explanation(text + more, first[3].remedy, size)


def _too_few(counted: float, size: float) -> Explanation:
    cause = (
        f"What one map leaves over, {size:.1e} of the state's size, stands in about {round(counted)} frames"
    )
    return Explanation(
        f"{cause}: they do not show its cause; a solver that chooses its steps has no fixed scheme to find"
        + COARSE * (size < SINGLE),
        "",
        size,
        shown=False,
    )


def _none(left: Any, counted: float, size: float) -> Explanation:
    """Residuals that no law explains: few, noise, or no noise."""
    if counted < FEWEST:
        return _too_few(counted, size)
    q, v = (float(np.sqrt(np.mean(left[:, k] ** 2))) for k in (0, 1))
    where = "the velocity" if q < 0.2 * v else "the position" if v < 0.2 * q else "position and velocity"
    sums = [
        abs(float(np.sum(left[k:, i] * left[:-k, i]) / np.sum(left[:, i] ** 2)))
        for k in range(1, 9)
        for i in (0, 1)
        if np.any(left[:, i])
    ]
    if max(sums) * math.sqrt(len(left)) > 5:
        return Explanation(
            f"No known cause alone explains what one map leaves over, and it is no white noise: {size:.1e} "
            f"of the state's size, in {where}" + COARSE * (size < SINGLE),
            "look for several errors at once; a solver that chooses its steps has no fixed scheme to find",
            size,
            shown=False,
        )
    coarse = ", forces in less than double precision" if size < SINGLE else ""
    return Explanation(
        f"Noise: what one map leaves over is irregular, {size:.1e} of the state's size, in {where}: a "
        f"thermostat, random kicks{coarse}, or an iteration that stops early",
        "look for a thermostat, or a tolerance",
        size,
    )


def of_a_solver(m: Map, size: float, jitter: float, *, clean: bool = False) -> Explanation | None:
    """The exact solution to within more than rounding, and no scheme so near."""
    rows = (*distinct("plain"), *(row for row in distinct("friction") if row.scheme in NEAREST))
    near = compare([m], Freedom(jitter=jitter), rows, range(1, 2), far=True)
    off = [(distance(m, x.parts[0]), x.row.free, x.row.scheme) for x in near]
    exact = min((d for d in off if d[2] == "exact"), default=None)
    if exact is None or exact[0] > 0.05 or size > 0.05:
        return None
    others = min((d[0] for d in off if d[2] != "exact" and d[1] == exact[1]), default=math.inf)
    close = exact[0] < max(0.3 * others, 4 * size) and others > 4 * max(exact[0], size)
    if not close or exact[0] > (FINEST if clean else 30 * size + 1e-12):
        return None
    return Explanation(
        f"The states are the exact solution to within {max(size, exact[0]):.1e} of their size in each frame: "
        "an adaptive solver or one of high order, which has no fixed scheme to find",
        "compare its error with its tolerance",
        size,
    )
