"""Springs in a periodic box that do not act on the nearest image, where steps show them."""

from __future__ import annotations

import numpy as np

from springcheck.checks import other
from springcheck.checks.case import Case
from springcheck.text.wording import count, few

NEAR_WHOLE = 1e-6
"""Distance of what a step misses from a whole number of boxes, relative to the effect of one, beside twice
what rounding allows."""

WIDEST_ROOM = 0.01
"""Largest such distance in all: of wider ones any number is near a whole one."""

NO_PART = 1e-3
"""Part of the largest change of an elongation below which another one is rounding."""

FEWEST_OFF = 10
"""Steps off of which multiples of a part of the box are no chance, as they are of one step."""

MOST_SPRINGS = 64
"""Rows of springs up to which the effect of a box on each is looked at."""

MOST_TOLD = 3
"""Springs that a cause names."""


def found(case: Case) -> str:
    """The cause in one sentence, or "" where nothing is in a box or most steps that are off miss anything but
    whole boxes: linear springs make each of them the same change of every step."""
    scene, run = case.judged, case.trajectory
    terms = [(i, term) for i, term in enumerate(scene.terms) if term.origin]
    springs = [(i, term, *row) for i, term in terms for row in other.single_rows(term, scene.all_places)]
    if scene.box is None or not scene.system.is_linear or not 0 < len(springs) <= MOST_SPRINGS:
        return ""
    missed = np.stack([run.q[1:], run.p[1:]]) - np.stack(case.next_states)
    allowed = case.roundings * np.stack(case.allowance)
    off = ~np.all(np.abs(missed) <= allowed, axis=(0, 2))
    one = np.stack([run.q[:1], run.p[:1]]).astype(np.longdouble)
    right, effects = np.stack(case.step(*one)), []
    for i, term, _, here in springs:
        longer = term.arrays[term.origin] - here * scene.periods[term.particles[0]]
        effects.append((np.stack(other.with_numbers(case, i, term.origin, longer).step(*one)) - right)[:, 0])
    # of positions, which the force at the start of a step moves, or where it moves none of momenta
    part = 0 if np.any(np.array(effects)[:, 0]) else 1
    of = np.array(effects)[:, part], missed[part, off], 2 * allowed[part, off]
    design, steps, room = ((x / np.max(np.abs(of[0]))).astype(np.float64).T for x in of)
    boxes = np.linalg.lstsq(design, steps, rcond=None)[0]
    size = np.abs(boxes)
    # of a box of another length each is a multiple of one number, which many steps tell
    least = float(np.min(size[size > NO_PART * np.max(size, initial=0.0)], initial=1.0))
    many = FEWEST_OFF <= np.count_nonzero(off) < len(off)
    for unit, few_off in ((1.0, 0.5), (least, 0.0)) if many else ((1.0, 0.5),):
        whole = np.rint(boxes / unit)
        near = NEAR_WHOLE * unit + room
        told = np.all(
            (np.abs(design @ (unit * whole) - steps) <= near) & (near <= WIDEST_ROOM * unit), axis=0
        )
        which = np.flatnonzero(np.any(whole[:, told] != 0, axis=1))
        if len(which) and np.mean(~told) <= few_off:
            share = f"{unit:.6g} times " if unit != 1 else ""
            names = few([f"{springs[i][1].key} of {springs[i][2]}" for i in which], MOST_TOLD)
            return (
                f"in {np.count_nonzero(told)} of {count(len(told), 'step')} off, elongations are longer or "
                f"shorter by {share}the box, or several, than to the nearest image: {names}"
            )
    return ""
