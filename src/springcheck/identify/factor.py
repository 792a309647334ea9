"""One factor a step for all momenta, as a Nose-Hoover chain or a thermostat that rescales takes it.

Of one particle any factor may be.  Of several, b + F c is what it acts on, or has made, of each of them, with
unknown constants c of linear forces; the ratio of two of them has no factor in it, and is linear in c once it
is multiplied out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.identify.result import Explanation, Identification
from springcheck.physics.arrays import Floats
from springcheck.thermal.catalogue import random_scheme

PLACES_OF_FACTOR = ("before velocity Verlet", "after velocity Verlet", "amid the drift of leapfrog")

SHARP_FACTOR = 1e-3
"""Misfit over the spread of the factor, below which it is one: two particles of unlike factors leave 1."""

UNLIKE_MOTION = 0.01
"""Share of the products of two particles' numbers in their difference, below which the two move alike."""


def one_factor(h: float, q: Floats, v: Floats) -> tuple[str, float, Floats] | None:
    """Place in a step of h at which one factor multiplies the velocities v (f, n) of q (f, n), the relative
    residual, and the factors (f - 1,); None where no factor that varies from step to step explains them."""
    x, n = q - np.mean(q, axis=0), q.shape[1]
    here, both = (np.column_stack([y, np.ones(len(y))]) for y in (x[:-1], x[:-1] + x[1:]))
    ways = ((v[:-1], np.diff(x, axis=0) / h, here), (v[1:], v[:-1], both), (v[1:], v[:-1], here))
    for i, (a, b, F) in enumerate(ways):
        misfit, pulled = 0.0, b.copy()
        for j in range(1, n):
            one, other = a[:, j] * b[:, 0], a[:, 0] * b[:, j]
            size = float(np.linalg.norm(np.abs(one) + np.abs(other)))
            if not np.linalg.norm(one - other) > UNLIKE_MOTION * size:
                return None
            columns = np.concatenate([-a[:, [j]] * F, a[:, [0]] * F], axis=1)
            c = np.linalg.lstsq(columns, one - other, rcond=None)[0]
            misfit = max(misfit, float(np.linalg.norm(one - other - columns @ c)) / size)
            pulled[:, 0], pulled[:, j] = b[:, 0] + F @ c[: n + 1], b[:, j] + F @ c[n + 1 :]
        of, made = (pulled, a) if i else (a, pulled)
        factor = np.sum(of * made, axis=1) / np.sum(of**2, axis=1)
        # of velocities that are linear in the positions any c would do: there the factor makes none of them
        off = np.linalg.norm(made - factor[:, None] * of, axis=0) / np.linalg.norm(made, axis=0)
        high, low = np.quantile(factor, [0.9, 0.1])
        if max(misfit, *off) < SHARP_FACTOR * (high - low) / max(abs(high), abs(low)):
            return PLACES_OF_FACTOR[i], misfit, np.asarray(factor)
    return None


def by_a_factor(found: Identification, h: float, q: Floats, v: Floats) -> Identification:
    """Identification by one factor a step for all momenta, where that explains the states, or `found`."""
    if q.shape[1] < 2 or found.verdict == "named":
        return found
    with np.errstate(all="ignore"):
        seen = one_factor(h, q, v)
    if seen is None:
        return found
    place, misfit, factor = seen
    low, high = np.quantile(factor, [0.1, 0.9])
    kept = tuple(x for x in found.candidates if random_scheme(x.scheme).rescales)
    which = " or ".join(x.scheme for x in kept) or "a Nose-Hoover chain, or a thermostat that rescales"
    cause = (
        f"One factor a step multiplies the momenta of all {q.shape[1]} coordinates, {place}: {low:.3g} to "
        f"{high:.3g} in most steps, all else to {misfit:.0e} of their size: {which}"
    )
    remedy = "judge it by its scheme, which the factor alone does not tell; its bath is in no frame"
    notes = tuple(note for note in found.notes if not kept or note.split(":")[0] in {x.scheme for x in kept})
    return replace(
        found, statement=cause, candidates=kept, notes=notes,
        explanations=() if kept else (Explanation(cause, remedy),),
    )  # fmt: skip
