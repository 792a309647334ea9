"""Whether the states of a file, all together, show another scheme than the one that is asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from springcheck import schemes
from springcheck.errors import IdentificationError
from springcheck.formats import States
from springcheck.formats.columns import Fixed
from springcheck.identify import files
from springcheck.identify.catalogue import names as known_names
from springcheck.identify.files import identify_states, of_arrays
from springcheck.identify.say import OR_UNKNOWN
from springcheck.identify.steps import has_a_start, is_step_of, springs_of
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Trajectory, Verdict

NO_START = (
    "no start leads to all of these states by {} with the scene's masses, springs and friction, to the "
    "digits that they have: look for another stiffness, mass, friction or step, or another scheme"
)

FINER = 2.0**-27
"""Roundoff of numbers that are finer than single precision."""


def other_scheme(scene: Scene, run: Trajectory, states: States) -> Verdict:
    """Whether the states as a whole show another scheme.

    With few digits many schemes fit every single step, which the other checks examine; the map that fits all
    steps together is known far better.
    """

    def verdict(passed: bool | None, why: str) -> Verdict:
        value, bound = (np.nan, np.nan) if passed is None else (float(not passed), 0.0)
        return Verdict(
            method=run.label, check="identified", value=value, bound=bound, unit="other schemes",
            passed=passed, why=why,
        )  # fmt: skip

    # digits are counted as written: projections onto a line would not show their decimals
    n, width, other = scene.n, states.q.shape[1], np.asarray(states.v if states.p is None else states.p)
    # of points in space the scene's own axes or, where they move along one line, all three
    own = scene.places is not None and width == 3 * scene.particles
    columns = np.arange(width)[scene.where] if own else np.arange(width)
    moving = (np.ptp(states.q, axis=0) + np.ptp(other, axis=0))[columns] > 0
    columns, of = (
        x[moving][: files.MOST_OSCILLATORS] for x in (columns, np.arange(n).repeat(len(columns) // n))
    )
    m, k, c = springs_of(scene)[:, of]
    parts = {name: x[:, columns] for name in ("q", "p", "v") if (x := getattr(states, name)) is not None}
    scheme = schemes.scheme(run.scheme)
    # then the springs and frictions of the scene are all of its forces
    mixed = scheme.has("mixes") and any(term.fast for term in scene.terms)
    alone = scheme.flow or (scheme.has("one-step") and not scheme.has("mixes"))
    known = alone and len(of) > 0 and not np.isnan(k).any()
    stated: dict[str, Any] = {"stiffness": k} if known else {}
    stated |= {"friction": c[0]} if known and np.ptp(c) == 0 else {}
    try:
        record = of_arrays(run.label, replace(states, mass=m, **parts))
        # the exact flow of a frame is that of its steps
        found = identify_states(record, step=scene.step * (run.every if scheme.flow else 1), **stated)
    except (IdentificationError, ArithmeticError, ValueError) as error:
        unread, said = f"no scheme can be read from these states: {error}", ""
    else:
        unread, said = "no one scheme is read from these states", f"all states together: {found.statement}"
        if found.fits and found.verdict in ("named", "not told apart"):
            names = {str(found.scheme), *found.aliases}
            for one in found.candidates:
                names |= {one.scheme, *one.aliases}
            alike = run.scheme in names or is_step_of(scheme, names, scene, run)
            # numbers of single precision may come of forces that were rounded to it, which no row has
            if not alike and states.roundoff == 2.0**-24 and OR_UNKNOWN in found.statement:
                return verdict(None, unread)
            # what has no name there is told by its own motion, below
            if alike or run.scheme in known_names() or not (alone or mixed):
                return verdict(alike, said)
        # single precision may round to one side, where digits do not exclude it
        if "negative friction" in found.statement and states.roundoff < FINER:
            return verdict(False, said)
        # of the few digits of a motion that dies down or grows a cause may be read that is none
        said = "" if found.undecided or not any(x.shown for x in found.explanations[:1]) else said
    springs = (m, k, c) if states.p is not None else (np.ones_like(m), k / m, c / m)
    steps = np.arange(len(run.t)) * run.every
    numbers, fixed = (parts["q"], other[:, columns]), states.fixed or Fixed(0.0, 0.0, 0.0)
    last = [2 * np.broadcast_to(x, width)[columns] for x in (fixed.q, fixed.v)]
    if (
        known and not run.rebuilds_velocity
        and not has_a_start(scheme, run.step, springs, steps, *numbers, states.roundoff, last)
    ):  # fmt: skip
        return verdict(False, said or NO_START.format(scheme.title))
    return verdict(None, unread)
