"""The study of the faults: what rejects each of them, how small it may be, and no alarm without one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from springcheck import checks, mechanics, schemes
from springcheck.checks import Experiment
from springcheck.faults import clean, steppers
from springcheck.faults.seeded import Fault, Where
from springcheck.faults.table import FAULTS
from springcheck.model import Scene, Trajectory, Verdict


@cache
def scene(where: Where) -> Scene:
    """The scenes of the faults: no mass, stiffness, rest point or step that is 1, h w about 0.1."""
    if where == "chain":
        made = clean.scene(
            np.array([1.3, 0.7, 2.1]),
            (
                mechanics.Spring(
                    a=np.array([0, 1]), b=np.array([1, 2]), k=np.array([1.1, 3.7]), rest=np.array([0.9, 1.2])
                ),
            ),
            np.array([0.2, 1.0, 1.9]),
            np.array([0.4, -0.3, 0.5]),
            step=0.05,
            steps=200,
        )
    else:
        made = clean.scene(
            np.array([3.7]),
            (clean.walls(np.array([2.9]), np.array([0.0])),),
            np.array([0.3]),
            np.array([0.7]),
            step=0.1,
            steps=2100 if where == "long spring" else 200,
        )
    return replace(made, name=where)


def rejected(fault: Fault, size: float | None = None) -> list[str]:
    """Names of the checks that reject a fault."""
    where = scene(fault.scene)
    verdicts = checks.judge(where, fault.run(where, size=size))
    verdicts += checks.judge_thoroughly(where, fault.name, lambda s, label: fault.run(s, label, size=size))
    return [verdict.check for verdict in verdicts if verdict.passed is False]
