"""Explanations of a first frame that is not its scene's start, and of masses that contradict the scene."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

import numpy as np

from springcheck import schemes
from springcheck.errors import SpringcheckError, StoreError
from springcheck.formats import States
from springcheck.physics.arrays import Floats, Reals
from springcheck.physics.scene import Scene
from springcheck.text.wording import count

CLOSE_STATE = 1e-6
"""Distance, relative to the amplitude, within which a state explains a first frame."""
ROUNDINGS = 4
"""Roundings in the difference of a frame from a step: two of each number of both."""
MOST_STEPS, MOST_PARTICLES = 100, 1000
"""Steps of the scheme that are tried, and the most particles of a scene for it."""


def contradicted(path: Path, states: States, scene: Scene) -> None:
    """StoreError where the file's momenta are not its velocities times the scene's masses."""
    if states.p is None or states.v is None:
        return
    axes = states.q.shape[1]
    m = np.repeat(scene.m, max(1, axes // scene.n))
    if scene.places is not None and axes == 3 * scene.particles:
        m = np.zeros(axes)
        m[scene.where] = scene.m
    if len(m) != axes:
        return
    p, v = states.p[:, m > 0], states.v[:, m > 0]
    m = m[m > 0]
    off, *sizes = (np.max(np.abs(x), axis=0) for x in (p - m * v, p, m * v))
    size = np.maximum(*sizes)
    if not np.any(bad := off > max(1e-9, 10 * states.roundoff) * size):
        return
    i = int(np.argmax(bad))
    seen = float(np.sum(p[:, i] * v[:, i]) / (np.sum(v[:, i] ** 2) or 1.0))
    raise StoreError(
        f"{path}: momenta and velocities contradict each other: p/v = {seen:.6g}, and the mass in scene "
        f"{scene.name} is {m[i]:.6g}; keep one of the two"
    )


def clock(states: States, scene: Scene) -> list[str]:
    """A note where frames lie a power of 1000 times as far apart as in the scene, and are as many: units of
    time are that far apart."""
    if not len(states.t) == scene.frames > 1:
        return []
    times = abs(float(states.t[1] - states.t[0])) / (scene.step * scene.every)
    whole = 1000.0 ** round(np.log10(times) / 3) if 0 < times < np.inf else 1.0
    if whole == 1 or abs(times / whole - 1) > 1e-6:
        return []
    return [
        f"as many frames as in the scene lie {whole:g} times as far apart: if the times are in another unit, "
        f"as ms are for s, divide them by {whole:g}"
    ]


def differs(scene: Scene, scheme: str, states: States, q: Floats, p: Floats, every: int) -> str:
    """Explain a first frame of q, p (f, n), made from the states of a file, that is not the scene's start,
    with a remedy."""
    at, velocities = (q[0], p[0]), states.p is None
    with np.errstate(all="ignore"):
        found = _single(scene, *at)
        if not (found or _is_at(scene, *at, scene.q, scene.p)):
            found = _weighted(scene, *at, velocities) or _kicked(scene, scheme, q, p, every, states.roundoff)
            found = found or _later(scene, scheme, *at) or _scaled(scene, *at, velocities)
        return found or _largest(scene, *at)


def _is_at(scene: Scene, q: Floats, p: Floats, there_q: Reals, there_p: Reals) -> bool:
    return bool(scene.system.norm(q - there_q, p - there_p) <= CLOSE_STATE)


def _single(scene: Scene, q: Floats, p: Floats) -> str:
    for state in ((scene.q, scene.p), (scene.q, np.float64(np.float32(scene.p / scene.m)) * scene.m)):
        single_q, single_p = (np.float32(x) for x in state)
        if np.array_equal(single_q, q) and np.allclose(single_p, p, rtol=1e-15, atol=0):
            return "it is the start in single precision; store the numbers as float32, or to nine digits"
    return ""


def _weighted(scene: Scene, q: Floats, p: Floats, velocities: bool) -> str:
    if _is_at(scene, q, p * scene.m, scene.q, scene.p):
        return "its momenta are the scene's divided by the masses: velocities; name their columns v, as t,q,v"
    if not _is_at(scene, q, p / scene.m, scene.q, scene.p):
        return ""
    if velocities:
        return "its velocities are the scene's momenta; name their columns p, as t,q,p"
    return "its momenta are the scene's times the masses; divide them by these"


def _scaled(scene: Scene, q: Floats, p: Floats, velocities: bool) -> str:
    of_q, of_p = _ratio(q, scene.q), _ratio(p, scene.p)
    one = of_q if np.any(scene.q) else of_p
    what = "velocities" if velocities else "momenta"
    if _is_at(scene, q / one, p / one, scene.q, scene.p):
        return (
            f"positions and {what} are {one:.6g} times the scene's, as in another unit of length; divide "
            "both by that"
        )
    # for one particle any two numbers are multiples of the scene's: powers of ten are units
    if _is_at(scene, q / _ten(of_q), p / _ten(of_p), scene.q, scene.p):
        return (
            f"positions are {_ten(of_q):g} times the scene's, and {what} {_ten(of_p):g} times, as in other "
            "units; divide by these"
        )
    return ""


def _ratio(x: Floats, own: Floats) -> float:
    """Ratio of x to the scene's own numbers where these are largest; 1 where they are 0."""
    i = int(np.argmax(np.abs(own)))
    return float(x[i] / own[i]) if own[i] else 1.0


def _ten(x: float) -> float:
    """The power of ten nearest to a factor; 1 where there is none."""
    return float(10.0 ** np.rint(np.log10(x))) if 0 < x < np.inf else 1.0


def _kicked(scene: Scene, scheme: str, q: Floats, p: Floats, every: int, roundoff: float) -> str:
    kick = scene.step * np.asarray(scene.system.force(q, p), np.float64)
    for part, name in ((0.5, "half a kick"), (1.0, "a kick")):
        for side, late, back in ((-1, "before", "add"), (1, "after", "take off")):
            if not _is_at(scene, q[0], p[0], scene.q, scene.p + side * part * kick[0]):
                continue
            found = f"its momenta are {name} {late} the scene's"
            if _follows(scene, scheme, q, p - side * part * kick, every, roundoff):
                return (
                    f"{found}, as leapfrog has them between the times of the positions; {back} {part:g} h "
                    "F(q) in every frame, or see what `springcheck identify` reads"
                )
            if len(q) > 3 and _follows(scene, scheme, q[1:-1], p[1:-1], every, roundoff):
                return (
                    f"{found} there alone, and the frames after it are those of {schemes.title(scheme)}: "
                    "differences to one side, as np.gradient has at both ends; put the scene's own there, "
                    "and leave out the last frame if it is one"
                )
            return f"{found} there; see what `springcheck identify` reads of all frames"
    return ""


def _follows(scene: Scene, scheme: str, q: Floats, p: Floats, every: int, roundoff: float) -> bool:
    """Whether each of the first frames leads to the next by a scheme, as far as their digits can tell it from
    half a kick."""
    q, p = (x[: MOST_STEPS + 1] for x in (q, p))
    half, norm = scene.step / 2 * np.asarray(scene.system.force(q, p)), scene.system.norm
    rounded = norm.most(*(ROUNDINGS * roundoff * np.max(np.abs(x), axis=0) for x in (q, p)))
    close = max(CLOSE_STATE, float(rounded / norm.unit))
    at = next(islice(_steps(scene, scheme, q[:-1], p[:-1]), every - 1, None), None)
    right = at is not None and np.all(norm(at[0] - q[1:], at[1] - p[1:]) <= close)
    return bool(right and 2 * close <= np.max(norm(np.zeros_like(q), half)))


def _steps(scene: Scene, scheme: str, q: Floats, p: Floats) -> Iterator[tuple[Reals, Reals]]:
    """States after each step of a scheme from q, p (..., n), up to one that the forces do not determine."""
    law = schemes.Law(scheme=schemes.scheme(scheme), scene=scene, h=scene.step)
    at: tuple[Reals, Reals] = q.astype(np.longdouble), p.astype(np.longdouble)
    with suppress(SpringcheckError, ArithmeticError, ValueError):
        while True:
            at = law.step(*at)
            yield at


def _later(scene: Scene, scheme: str, q: Floats, p: Floats) -> str:
    if scene.n > MOST_PARTICLES or scene.bath:
        return ""
    steps = islice(_steps(scene, scheme, scene.q, scene.p), min(scene.steps, MOST_STEPS))
    for done, at in enumerate(steps, 1):
        if _is_at(scene, q, p, *at):
            return (
                f"it is the scene's state after {count(done, 'step')} of {schemes.title(scheme)}; write the "
                "start as the first frame, or give a scene that starts there"
            )
    return ""


def _largest(scene: Scene, q: Floats, p: Floats) -> str:
    parts = [("q", q, scene.q), ("p", p, scene.p)]
    none = np.zeros_like(q)
    sizes = [scene.system.norm(q - scene.q, none), scene.system.norm(none, p - scene.p)]
    name, x, own = parts[int(np.argmax(sizes))]
    i = int(np.argmax(np.abs(x - own)))
    values = f"{x[i]:.15g} there, and {own[i]:.15g} in the scene"
    return f"{name}[{i}] is {values}; give a scene that starts so"
