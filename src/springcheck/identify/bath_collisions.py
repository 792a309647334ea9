"""Frames between which no collision took place: there Andersen's steps are those of velocity Verlet, or of
leapfrog, to rounding, and so give the spring and the number of steps; their fraction gives the friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from springcheck.bath.catalogue import THERMOSTATS
from springcheck.bath.laws import Law
from springcheck.identify.bath_likelihood import Candidate
from springcheck.identify.bath_residuals import neighbours, recurrence, regressed, together
from springcheck.physics.arrays import Floats

TRIPLES = 30000
"""Triples of frames that each give a map: of one that holds for every tenth frame 24 are expected."""

NO_COLLISION = 1e-7
"""Residual, relative to the motion, up to which a map holds between two frames without a collision."""

FEWEST_OF_EACH = 10
"""Fewest frames with, and fewest without a collision: three of the latter make the map."""

TIMES_LEFT_OVER = 10.0
"""Error allowed for the entries of a map, in units of its mean residual."""

LEAST_CHANCE = 1e-9
"""Chance below which collisions stand together, or what they change tells of the next, and are none."""

MOST_A_FRAME = 20
"""Steps from frame to frame at most."""


def between_collisions(q: Floats, v: Floats, h: float) -> list[Candidate] | None:
    """Schemes with collisions, if between many of the frames h apart of q and v (f,) one map of determinant 1
    holds to rounding, and between many not; none where what acts there is drawn and adds to the state, which
    is no scheme's.  None where there is no such map."""
    sizes, n = np.array([np.std(q), np.std(v)]), len(q) - 1
    z = np.stack([(q - q[0]) / sizes[0], v / sizes[1]], axis=1)
    known, after = np.column_stack([z[:-1], np.ones(n)]), z[1:]
    rng, few = np.random.default_rng(0), slice(0, n, max(n // 250, 1))
    rows = rng.integers(n, size=(TRIPLES, 3))
    rows = rows[np.abs(np.linalg.det(known[rows])) > 1e-6]
    maps = np.linalg.solve(known[rows], after[rows])
    # a collision that ends a frame has moved nothing yet, and momenta show it
    missed = (np.abs(maps[:, :, i] @ known[few].T - after[few, i]) for i in (0, 1))
    best = int(np.argmax(sum(np.sum(x < NO_COLLISION, axis=1) for x in missed)))
    left = known @ maps[best] - after
    still = np.max(np.abs(left), axis=1) < NO_COLLISION
    share = float(np.mean(still))
    if not FEWEST_OF_EACH <= np.sum(still) <= n - FEWEST_OF_EACH:
        return None
    spread = (still - share) / np.sqrt(share * (1 - share))
    drawn, replaced = collide(left[~still], known[~still])
    if not (neighbours(spread) > LEAST_CHANCE and drawn) or _is_in_time(~still):
        return None
    if not replaced:
        return []
    entries = np.linalg.lstsq(known[still], after[still], rcond=None)[0]
    off = max(float(np.sqrt(np.mean((known[still] @ entries - after[still]) ** 2))), 2.0**-52)
    A, room = entries[:2].T, TIMES_LEFT_OVER * off
    if not (abs(np.linalg.det(A) - 1) < NO_COLLISION and A[0, 1] * A[1, 0] < room):
        return None
    # both ends of a step of leapfrog are unlike by (h w)**2, which few digits may hide
    apart, least = abs(A[0, 0] - A[1, 1]), -A[0, 1] * A[1, 0] / MOST_A_FRAME
    alike = {apart <= room} if apart > room or room < least else {True, False}
    names = [name for name, one in THERMOSTATS.items() if one.collides and one.synchronised in alike]
    error = float(np.sqrt((1 - share) / (share * n)) / h)
    friction = {"friction": float(-np.log(share) / h), "friction_error": error}
    if -A[0, 1] * A[1, 0] < room < A[0, 1]:
        # without a spring all are alike, in any number of steps
        heat, lasting = float(np.var(v)), (1 + share) / (1 - share)
        soft = Candidate(
            scheme="", omega=0.0, omega_error=float(np.sqrt(room) / h), **friction,
            thermal=heat, thermal_error=heat * float(np.sqrt(2 * lasting / n)),
            strides=tuple(range(1, MOST_A_FRAME + 1)),
        )  # fmt: skip
        return [replace(soft, scheme=name) for name in names]
    close = room * (1 / abs(A[0, 1]) + 1 / abs(A[1, 0]))
    A = A * sizes[:, None] / sizes
    return [y for name in names for y in _of_scheme(name, A, h, n, float(np.var(v)), close, friction)]


def collide(changes: Floats, known: Floats) -> tuple[bool, bool]:
    """Whether changes (f, k) are draws beside what follows from the state (f, 3) before each, in units of its
    sizes, and whether they take the place of it.

    A collision forgets half of a state or more, wherever in a frame it is; a shot of noise adds to it.
    """
    drawn, entries, rest = _fitted(changes, known)
    error = np.sqrt(np.trace(np.linalg.pinv(known.T @ known)[:2, :2]) * np.sum(rest**2) / len(known))
    return drawn, not np.linalg.norm(entries[:2]) < 5 * error < 0.5


def _fitted(changes: Floats, known: Floats) -> tuple[bool, Floats, Floats]:
    """Whether changes (f, k) are draws beside a linear map of what is known (f, m): no rounding is left of
    them, and what is left tells nothing of the next; the map (m, k), and what it leaves (f, k)."""
    entries = np.linalg.lstsq(known, changes, rcond=None)[0]
    rest = changes - known @ entries
    sizes = np.std(rest, axis=0)
    drawn = len(changes) >= FEWEST_OF_EACH and bool(np.max(sizes) > NO_COLLISION)
    for x in (rest / sizes).T[sizes > NO_COLLISION] if drawn else ():
        one = min(neighbours(x), recurrence(x), together(x))
        drawn = drawn and one > LEAST_CHANCE
    return drawn, np.asarray(entries), rest


def changed(changes: Floats, after: Floats, state: Floats, close: float) -> tuple[bool, bool, bool]:
    """Whether nearly all momenta (f,) change by more than `close`, in units of their size; whether those that
    do take the place of the one before, as draws at random times; and whether nothing of the state (f, 3)
    before is left in these."""
    struck = np.abs(changes) > close
    often = bool(np.quantile(np.abs(changes), 0.05) > close)
    if not all(collide(changes[struck, None], state[struck])) or _is_in_time(struck):
        return often, False, False
    entries, _, errors = regressed(state[struck], after[struck])
    return often, True, bool(np.all(np.abs(entries[:2]) < 5 * errors[:2]))


def _is_in_time(struck: NDArray[np.bool_]) -> bool:
    """Whether what takes place in some steps (f,) does so after every so many of them: no collisions do."""
    gaps = np.diff(np.flatnonzero(struck))
    return bool(gaps[0] > 1 and np.all(gaps == gaps[0]))


def is_a_factor(before: Floats, after: Floats) -> bool:
    """Whether one factor made momenta (f,) of others: kinetic energies are then draws of mean c K + b and
    variance 2 b**2 + 4 c b K, of whatever sign the factor is (Bussi, Donadio & Parrinello, equation A7)."""
    K, made = ((x / np.std(after)) ** 2 for x in (before, after))
    known = np.stack([K, np.ones(len(K))], axis=1)
    coefficients = np.linalg.lstsq(known, made, rcond=None)[0]
    # b of little friction shows in the variance alone
    c, square = max(float(coefficients[0]), 0.0), float(np.mean((made - known @ coefficients) ** 2))
    b = square / 2 / (np.hypot(c * np.mean(K), np.sqrt(square / 2)) + c * np.mean(K))
    size = np.sqrt(2 * b * b + 4 * c * b * K)[:, None]
    return bool(b > 0) and _fitted(made[:, None] / size, known / size)[0]


def _of_scheme(
    name: str, A: Floats, h: float, n: int, size: float, close: float, friction: dict[str, float]
) -> list[Candidate]:
    """Parameters at which a scheme has the map A between n frames without a collision, with every possible
    number of steps; A is known to the relative error `close`."""
    fits: list[tuple[int, float]] = []
    # the sine of a small angle is known better than its cosine
    sine = np.sqrt(max(-A[0, 1] * A[1, 0] - (A[0, 0] - A[1, 1]) ** 2 / 4, 0.0))
    turned, frequency = float(np.arctan2(sine, np.trace(A) / 2)), float(np.sqrt(-A[1, 0] / A[0, 1]))
    for steps in range(1, MOST_A_FRAME + 1):
        angles = np.concatenate([2 * np.pi * np.arange(steps) + x for x in (turned, -turned)]) / steps
        angles = angles[(angles > 0) & (angles < np.pi)]
        # of Verlet A01 = h sin(n y) / sin y and A10 = -sin(n y) sin y / h; of leapfrog 2 sin(y/2) for sin y
        of_step = np.sin(angles) if THERMOSTATS[name].synchronised else 2 * np.sin(angles / 2)
        near = np.abs(of_step - frequency * h / steps) < close * (frequency * h + sine) / steps
        fits += [(steps, x) for x in angles[near & (np.sin(steps * angles) * A[0, 1] > 0)]]
    if not fits:
        return []
    steps, angle = fits[0]
    w = float(2 * np.sin(angle / 2) * steps / h)
    law = Law(
        scheme=THERMOSTATS[name], h=h / steps, m=np.ones(1), k=np.array([w * w]),
        rate=friction["friction"], thermal=1.0,
    )  # fmt: skip
    heat = size / float(law.covariance[0, 1, 1])
    return [
        Candidate(
            scheme=name, omega=w, omega_error=0.0, **friction, thermal=heat,
            thermal_error=heat * float(law.error_of_variances(n, steps)[0, 1]),
            strides=tuple(sorted({steps for steps, _ in fits})),
        )
    ]  # fmt: skip
