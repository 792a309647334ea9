"""Rounding of OpenMM on each platform."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from springcheck.engines.contract import Label
from springcheck.physics.arrays import Arithmetic
from springcheck.physics.scene import Scene

FIXED_POINT = 2.0**-32
"""GPU-type platforms sum forces as 64-bit integers in units of 2**-32 kJ/mol/nm in every precision
mode (OpenMM's `realToFixedPoint`): a fixed quantum below, overflow from 2**31 on.  Each term's force is
converted by itself, by `(long)(x * 0x100000000)`, which C leaves open out of range: pocl on x86 gives
-2**63 for every such force, of either sign, and the sum is modulo 2**64, so that two of them make 0."""

_PRECISIONS = {
    name: Arithmetic(
        name=name, state=state, force=force, quantum=FIXED_POINT, overflow=2.0**31, parameters="single",
        keeps_displacement=True,
    )
    for name, state, force in (
        ("single", 2.0**-24, 2.0**-24), ("mixed", 2.0**-48, 2.0**-24), ("double", 2.0**-53, 2.0**-53),
    )
}  # fmt: skip
"""Bond parameters are stored in single precision in every mode: 2.9 becomes 2.9000000954.  k = 1 hides it.
"mixed" keeps positions as a float and a float of correction, together 48 bits.  The velocity is the
displacement of the step times 1/h, so it does not lose the digits of x' - x as on Reference."""

CUSTOM = ("euler", "semi-implicit-euler", "mts")
"""Methods that OpenMM's CustomIntegrator carries out; MTSIntegrator and MTSLangevinIntegrator are such."""

CUSTOM_EXCESS = 2.0**-32
"""On GPU-type platforms CustomIntegrator turns fixed-point forces back by 1/0xFFFFFFFF, which is
1/(2**32 - 1), where every other integrator divides by 2**32 (`forceScale` in customIntegratorPerDof.cc):
its forces are too large by 2.3e-10."""


def sizes(scene: Scene, step: float, how: Arithmetic) -> Iterator[tuple[float, str, float, float]]:
    """Numbers of a scene that GPU-type platforms keep in single precision, for `bonds.within`.

    A force is multiplied by step/2**32 and by 1/mass; a length is the root of a square.
    """
    least, most = float(np.finfo(np.float32).smallest_normal), float(np.finfo(np.float32).max)
    for term in scene.terms:
        for column in term.columns:
            values = np.abs(term.arrays[column.field]) if column.single else np.zeros(0)
            for x in np.sort(values[values > 0])[[0, -1]] if np.any(values) else ():
                yield least, f"{column.name} of a {term.key}", float(x), most
    if how.force == 2.0**-24:
        # of the start, and, of a start at rest, of where the motion goes
        yield 0.0, "bond's length", float(np.max(np.abs(scene.q))), most**0.5
        yield least**0.5, "bond's length", scene.system.far, np.inf
    if how.state == 2.0**-24:
        yield least * 2.0**32, "step", abs(step), most
        yield 0.0, "speed", float(np.max(np.abs(scene.p / scene.m))), most
        yield from ((1 / most, "mass", float(m), 1 / least) for m in (np.min(scene.m), np.max(scene.m)))


def arithmetic(label: Label) -> Arithmetic:
    """Reference is double; CPU takes Reference's code for bonds; GPU-type platforms default to single."""
    if label.platform in ("", "Reference", "CPU"):
        return Arithmetic()
    found = _PRECISIONS[label.precision or "single"]
    return replace(found, excess=CUSTOM_EXCESS) if label.method.partition("-langevin")[0] in CUSTOM else found
