"""Stages of a thermostat that are others than its scheme's, or that come more or less often."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from springcheck.checks.case import Case
from springcheck.checks.thermal import collisions, noise_direction, read_frames, reading, thermostat
from springcheck.thermal import Thermostat

MOST_HIT = 0.5
"""Largest share of momenta drawn anew, of which each explains itself whatever its stage."""


def found(case: Case) -> str:
    """Which stage of the scheme is another, or left out; "" where none is, or noise reaches every state."""
    scheme = thermostat(case)
    if scheme.rescales or case.scene.system.rods or noise_direction(case).passed is not False:
        return ""
    for said, other in _others(scheme):
        seen = read_frames(case, case.trajectory.q, case.trajectory.p, scheme=other)
        few = seen.hits is None or np.mean(seen.hits) < MOST_HIT
        if few and seen.across is not None and np.all(seen.across[other.carried :] <= seen.roundings):
            return f"each step is the scheme's own but for {said}"
    return ""


def collided(case: Case) -> str:
    """How often momenta are drawn anew, where that is not as the friction asks."""
    hits, bath = reading(case).hits, case.judged.bath
    # where nothing is left of any step, its map is another
    if hits is None or bath is None or np.all(hits) or collisions(case).passed is not False:
        return ""
    share, x = float(np.mean(hits)), bath.friction * case.trajectory.step
    rate, error = -np.log1p(-share) / x, np.sqrt(share / (1 - share) / hits.size) / x
    return f"collisions come {rate:.4g} +- {error:.1g} times as often as the friction asks"


def _others(scheme: Thermostat) -> Iterator[tuple[str, Thermostat]]:
    """What is another, in words, and the scheme that it makes."""
    acts = scheme.acts
    kicks = [i for i, act in enumerate(acts) if act.kind == "kick"]
    for j, i in enumerate(kicks, 1):
        of = f"kick {j} of {len(kicks)}, which"
        if j > 1:
            old = f"{of} has the force of the one before: none is computed at the new positions"
            yield old, replace(scheme, acts=(*acts[:i], acts[i]._replace(kind="held"), *acts[i + 1 :]))
        yield f"{of} is left out", replace(scheme, acts=(*acts[:i], *acts[i + 1 :]))
    for i, act in enumerate(acts):
        if act.kind == "undamp":
            made = (*acts[:i], act._replace(kind="damp"), *acts[i + 1 :])
            yield "its last friction, which is that of the velocity before it", replace(scheme, acts=made)
    if scheme.carried:
        made = tuple(act._replace(draw=0) for act in acts)
        said = (
            "its random numbers: each acts in both halves of one step, not in the second and the next first"
        )
        yield said, replace(scheme, acts=made, draws=1, carried=0)
