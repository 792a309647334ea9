"""Stability and stiffness: the README's table of limits and the figures of stability.

Claim: every method's limit of stability is where theory puts it, to 1e-6 in double precision; so are the
damped regions, point by point, and the resonances of multiple time steps; BDF alone leaves a stiff mode
behind.

Command: python validation/stiff.py [FOLDER]        (default: figures; about a minute)

Expected: limits 0, 2, 16 and none, each within 1e-6; 0 points against theory in four planes of 40,000;
bands 3.100202 to 3.121445 and 5.460125 to 5.719347; at a stiffness ratio of 1e12 BDF needs some hundred
steps where Verlet would need 1e7; LangevinMiddle, whose step is 1e4 relaxation times of the velocity,
moves too fast by 1.2e-2 of the amplitude.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import stiffness_costs
from arguments import arguments, script
from springcheck import engines
from springcheck.checks.stats import line
from springcheck.engines.contract import Label
from springcheck.physics import scenefile as scenes
from springcheck.studies.stability import STUDY, limits
from springcheck.studies.stability import measure as stability
from springcheck.studies.stability.propagators import Springs
from springcheck.text.lines import as_text

SCENES = ("detest-b1", "multiple-time-steps", "two-scales", "overdamped")
FAMILIES: tuple[stiffness_costs.Family, ...] = ("two-scales", "overdamped")


def edge(label: Label, theory: float) -> float:
    """Exponent of growth with the number of steps at the limit: 1 where the two eigenvectors are one.

    NaN where there is no limit, or none in double precision.
    """
    if not 0 < theory < np.inf or engines.arithmetic(label).state > 2.0**-53:
        return float("nan")
    steps = 1000
    size = np.hypot(*limits.stepped(Springs(label=label, turn=np.array([theory])), steps))
    n = np.arange(steps // 10, steps + 1)
    if len(size) <= steps or np.any(size[n] <= 0):
        return float("nan")
    return line(np.log(n), np.log(size[n])).slope


def main() -> int:
    """Print limits, regions, bands and costs, and draw them; 1 where something is not where theory has it."""
    folder = arguments(__doc__, folder=Path("figures")).folder
    passed = True
    for name in SCENES:
        study = stability.record(scenes.load_scene(name))
        passed &= study.passed
        print(f"## {name}")
        if name == SCENES[0]:
            for x in study.limits:
                print(
                    f"{x.method:28} limit {x.limit:.10g}, theory {x.theory:g}, "
                    f"growth {x.growth_above:.9f} of {x.growth_predicted:.9f}, "
                    f"at the limit n**{edge(engines.parse(x.method), x.theory):.3f}"
                )
        for said in study.sentences:
            print(said)
        for path in STUDY.draw(study, folder):
            print(path)
    for family in FAMILIES:
        costs = stiffness_costs.study(family)
        print(f"## {family}", as_text([stiffness_costs.as_table(costs)]), sep="\n")
        for path in stiffness_costs.draw(costs, folder):
            print(path)
    return 0 if passed else 1


if __name__ == "__main__":
    script(main)
