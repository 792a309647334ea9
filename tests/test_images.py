"""Programs that do not take the nearest image in a periodic box, and what the states show of that."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from springcheck import checks
from springcheck.checks import Case, causes
from springcheck.physics.arrays import Floats
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import of_scene

BOX = load_scene("periodic-box")
LENGTHS = np.array(BOX.box)[:2]
BOND, TIED = 2.9, 1.7
Image = Callable[[Floats], Floats]


def nearest(d: Floats, box: Any = LENGTHS) -> Floats:
    return np.asarray(d - box * np.rint(d / box))


def wrapped(x: Floats) -> Floats:
    return np.asarray(x - LENGTHS * np.floor(x / LENGTHS))


def played(bond: Image = nearest, wall: Image = nearest, place: Image = wrapped, factor: float = 1.0) -> Case:
    """The scene by velocity Verlet, written out, with a program's own images."""
    m, h = BOX.m.reshape(3, 2), BOX.step
    q, p = BOX.q.reshape(3, 2), BOX.p.reshape(3, 2)

    def force(q: Floats) -> Floats:
        at = place(q)
        pull = BOND * factor * bond(at[1] - at[0])
        return np.stack([pull, -pull, -TIED * wall(at[2])])

    states = [(q.ravel(), p.ravel())]
    for _ in range(BOX.steps):
        p = p + h / 2 * force(q)
        q = q + h * p / m
        p = p + h / 2 * force(q)
        states.append((q.ravel(), p.ravel()))
    known = {"label": "own:velocity-verlet", "scheme": "velocity-verlet"}
    run = of_scene(BOX, *np.moveaxis(np.array(states), 1, 0), **known).of_scene(BOX)
    return Case(trajectory=run, scene=BOX)


@pytest.mark.parametrize(
    ("how", "said"),
    [({"bond": np.asarray}, "by the box, or several, than to the nearest image: spring of particles 0 and 1"),
     ({"wall": np.asarray}, "wall-spring of particle 2 along x, wall-spring of particle 2 along y"),
     ({"bond": wrapped}, "spring of particles 0 and 1 along x, spring of particles 0 and 1 along y"),
     ({"bond": lambda d: np.where(d > LENGTHS / 2, d - LENGTHS, d)}, "spring of particles 0 and 1 along x"),
     ({"bond": lambda d: np.append(nearest(d)[0], d[1])}, "box, or several, than to the nearest image: "
      "spring of particles 0 and 1 along y"),
     ({"bond": lambda d: nearest(d, 1.02 * LENGTHS)}, "by 0.02 times the box")],
)  # fmt: skip
def test_an_image_that_is_not_the_nearest_is_told(how: dict[str, Image], said: str) -> None:
    case = played(**how)
    assert checks.status(checks.judge(case.scene, case.trajectory)) == 1
    assert said in causes.found(case)


def test_right_images_pass_and_other_faults_are_not_of_images() -> None:
    right = played()
    assert checks.status(checks.judge(right.scene, right.trajectory)) == 0
    counted = played(np.asarray, np.asarray, np.asarray)
    assert checks.status(checks.judge(counted.scene, counted.trajectory)) == 0
    stiffer = played(factor=1.01)
    assert causes.found(stiffer).startswith("each step is the scheme's own with another number")
    assert "image" not in causes.found(stiffer)
