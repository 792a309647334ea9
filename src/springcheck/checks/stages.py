"""Stages of a thermostat that are others than its scheme's, or that come more or less often."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from springcheck.bath import Thermostat
from springcheck.bath.decays import Decay
from springcheck.checks.bath import collisions, noise_direction, read_frames, reading, thermostat
from springcheck.checks.case import Case

ROUNDINGS_OF_A_SUM = 4
"""Rounding errors of draws, added up, by which a sum of draws departs from 0 at most."""

MOST_HIT = 0.5
"""Largest share of momenta drawn anew, of which each explains itself whatever its stage."""


def found(case: Case) -> str:
    """Which stage of the scheme is another, or left out; "" where none is, or noise reaches every state."""
    scheme = thermostat(case)
    if scheme.rescales or noise_direction(case).passed is not False:
        return ""
    for said, other in _others(scheme):
        seen = read_frames(case, case.trajectory.q, case.trajectory.p, scheme=other)
        few = seen.hits is None or np.mean(seen.hits) < MOST_HIT
        if few and seen.across is not None and np.all(seen.across[other.carried :] <= seen.roundings):
            return f"each step is the scheme's own but for {said}"
    return ""


def balanced(case: Case) -> str:
    """Noise that adds up to 0 over all particles at every step, along each axis, to its rounding."""
    seen, size, axes = reading(case), np.sqrt(case.judged.m), case.scene.all_places % 3
    # a draw acts on momenta by the root of the mass
    along = np.equal.outer(axes, axes).astype(float)
    total, room = np.abs((size * seen.draws) @ along), (size * seen.error) @ along
    return "the noise of all particles adds up to 0 at every step, as with LAMMPS' `zero yes`" * bool(
        case.scene.particles > 1 and np.all(total <= ROUNDINGS_OF_A_SUM * room)
    )


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
        if scheme.draws == 1 and act.kind in ("exchange", "noise"):
            yield from _moved(scheme, i)
        if act.kind == "undamp":
            made = (*acts[:i], act._replace(kind="damp"), *acts[i + 1 :])
            yield "its last friction, which is that of the velocity before it", replace(scheme, acts=made)
    if scheme.carried:
        made = tuple(act._replace(draw=0) for act in acts)
        said = (
            "its random numbers: each acts in both halves of one step, not in the second and the next first"
        )
        yield said, replace(scheme, acts=made, draws=1, carried=0)


def _moved(scheme: Thermostat, i: int) -> Iterator[tuple[str, Thermostat]]:
    """Those whose noise, stage i, acts elsewhere in the step, with its friction and without."""
    act, before, after = scheme.acts[i], scheme.acts[:i], scheme.acts[i + 1 :]
    ways = [("noise", act, before)]
    if isinstance(c := act.part, Decay):
        shot = act._replace(kind="noise", part=lambda x: np.sqrt(c.lost(x) * c.both(x) / (2 * x)))
        ways = [
            ("noise with its friction", act, before),
            ("noise", shot, (*before, act._replace(kind="damp", part=c.lost))),
        ]  # fmt: skip
    for what, moved, first in ways:
        rest = (*first, *after)
        for j in {*range(len(rest) + 1)} - {len(before), len(first)}:
            where = (
                "at its start" if not j else f"after stage {j} of the other {len(rest)}, a {rest[j - 1].kind}"
            )
            yield f"its {what}, which acts {where}", replace(scheme, acts=(*rest[:j], moved, *rest[j:]))
