"""Maps that fit states, and the axes along which a method moves particles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck import driver, engines
from springcheck.engines.contract import Label
from springcheck.physics.arrays import Floats
from springcheck.physics.scenefile import load_scene

NO_SCHEME = "none that is known"

ALIKE_MAPS = 1e-9
"""Difference of one-step maps along two axes up to which they count as equal: fits of 60 states leave 1e-13,
solvers their tolerance."""


def fitted(q: Floats, p: Floats) -> Floats:
    """The one-step matrix (2, 2) that fits states (f,) best, by least squares."""
    z = np.stack([q, p])
    return np.asarray(z[:, 1:] @ np.linalg.pinv(z[:, :-1]))


def axes(label: Label) -> str:
    """Axes along which a method moves particles, by the states of `orbit`, and whether it serves a periodic
    box."""
    scene = replace(load_scene("orbit"), steps=60)
    if engines.refusal(scene, label):
        return "x"
    found = driver.run(scene, label)
    if found.outcome.step == 0:
        return "none"
    maps = np.stack([fitted(found.q[:, axis], found.p[:, axis]) for axis in range(3)])
    alike = np.ptp(maps, axis=0).max() < (1e-4 if found.arithmetic.state > 2.0**-53 else ALIKE_MAPS)
    # steps that depend on the forces are no linear map
    said = "x, y and z" + (" alike" if alike else "" if engines.method(label).adaptive else " unlike")
    boxed = engines.refusal(load_scene("periodic-box"), label)
    return said if boxed else f"{said}; periodic box"
