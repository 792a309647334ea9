"""Causes as data: regression of a map's residuals on functions of the state and of time.

Each law is linear in its own columns, beside those of the map.  One regression serves all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from springcheck.identify import driven
from springcheck.identify.evidence import FALLS, LEFT_BY_ROUNDING, Evidence, matched
from springcheck.identify.families import title
from springcheck.identify.fit import fit
from springcheck.identify.hypothesis import CHANCE, ERRORS, Match
from springcheck.identify.result import Explanation
from springcheck.physics.arrays import Floats

EXPLAINS = 0.35
"""Largest remaining share of the residuals of a law that explains them."""

PAIRS_A_NUMBER = 3
"""Pairs for each parameter of a law from which it fits by no chance."""

ANHARMONIC, IN_TIME, IS_DRIVEN = "is anharmonic", "changes in time", "is driven"
OF_VELOCITY = "depends on the velocity"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cause:
    """A force beside the linear spring's, as columns (f - 1,) of the state and of time."""

    kind: str
    """What the force does, as a phrase; laws of one kind that are not told apart are one cause."""
    columns: Callable[[Evidence], list[Floats]]
    """The columns; NaN for pairs to which the law does not apply."""
    waves: bool = False
    """Whether the columns are multiplied by a cosine and a sine, whose frequency is fitted."""
    flexible: bool = False
    """Whether it is flexible enough to fit any force over a few periods."""
    cause: str | Callable[[Evidence, Regression], str]
    """Sentence, with `{moved}` for the displacement of a frame, and `{j}` for the coordinate."""
    remedy: str = "look for a force that is not that of a linear spring"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regression:
    """Regression of a map's residuals on a law."""

    law: Cause
    left: float
    """Root mean square per degree of freedom that remains, relative to that of the residuals."""
    pairs: int
    """Pairs to which the law applies."""
    rank: int
    """Rank of the columns of map and law."""
    parameters: int
    """Parameters for each of position and velocity, those of the map included."""
    counted: float
    """Effective number of pairs: (sum r**2)**2 / sum r**4 of the residuals r."""
    above: int
    """Pairs with residuals above rounding."""
    x: Floats
    """Coefficients (columns, 2) of the map's columns, then of the law's."""
    turn: float
    """Fitted frequency [rad/frame]; NaN of a law without."""
    worst: float
    """Largest remaining residual, weighted."""
    exact: bool
    """Whether the remaining residuals are rounding."""

    @property
    def shows(self) -> bool:
        """Whether enough pairs follow the law, or follow it closely enough, to exclude chance."""
        spare = self.counted - self.parameters
        if self.exact and not self.law.flexible:
            # each pair beyond the number of columns would have a residual if the law were wrong
            spare = self.above - self.rank
        # as many columns as pairs leave nothing in any case
        closely = spare > 0 and self.pairs > self.rank and self.left**spare < CHANCE
        return self.counted > PAIRS_A_NUMBER * self.parameters or (
            closely and (self.law is POWERS or not self.law.flexible)
        )

    @property
    def cost(self) -> float:
        """Remaining residual times the root of the rank, which favours few parameters."""
        return self.left * math.sqrt(self.rank)


def regression(e: Evidence, law: Cause) -> Regression:
    """Regress the map's residuals on the columns of a law, beside those of the map."""
    columns, turn = law.columns(e), math.nan
    if law.waves:
        turn = driven.frequency(e, columns[0])
        columns = driven.waves(columns[0], turn)
    every = e.weight[:, None] * np.stack([*e.linear, *columns], axis=1)
    kept = np.all(np.isfinite(every), axis=1)
    every, missing = every[kept], (e.weight[:, None] * e.residuals)[kept]
    size = np.sqrt(np.mean(every**2, axis=0)) if len(every) else np.ones(every.shape[1])
    size = np.where(size > 0, size, 1.0)
    x, _, rank, _ = np.linalg.lstsq(every / size, missing)
    left = missing - every / size @ x
    rounding = (LEFT_BY_ROUNDING * e.weight * e.unit)[kept, None]
    if not np.all(kept):
        # residuals are those of a map of the pairs to which the law applies
        own = (every / size)[:, : len(e.linear)]
        missing = missing - own @ np.linalg.lstsq(own, missing)[0]
    square, above = np.sum(missing**2, axis=1), np.any(np.abs(missing) > FALLS * rounding, axis=1)
    total, relative = float(np.sum(square)), square / (np.max(square, initial=0.0) or 1.0)
    share = len(missing) / max(len(missing) - int(rank), 1)
    return Regression(
        law=law, pairs=len(missing), rank=int(rank), x=x / size[:, None], turn=turn,
        # a frequency that is looked for counts as numbers more, the map's own constant does not
        parameters=int(rank) - (len(e.linear) - 2) + 3 * law.waves,
        counted=float(np.sum(relative)) ** 2 / float(np.sum(relative**2)) if total else 0.0,
        left=math.sqrt(float(np.sum(left**2)) * share / total) if total else 1.0,
        worst=float(np.max(np.abs(left), initial=0.0)), above=int(np.count_nonzero(above)),
        exact=bool(np.all(np.abs(left) <= rounding)),
    )  # fmt: skip


def _hats(x: Floats, count: int) -> Floats:
    """Hat functions (count, f) of x, which add up to 1."""
    at = np.linspace(float(np.min(x)), float(np.max(x)), count)
    return np.asarray(np.maximum(0, 1 - np.abs(x - at[:, None]) / ((at[1] - at[0]) or 1.0)))


def _in_time(e: Evidence, *carriers: Floats) -> list[Floats]:
    """Each carrier times hat functions of time."""
    hats = _hats(np.linspace(-1, 1, e.pairs), min(14, max(4, e.pairs // 8)))
    return [hat * x for x in carriers for hat in hats]


def _alternating(e: Evidence) -> list[Floats]:
    return [x * (-1.0) ** np.arange(e.pairs) for x in (e.q, e.v)]


def _directions(e: Evidence) -> list[Floats]:
    """Sign of the velocity (f - 1,).  NaN where it reverses within a step, and once friction holds the
    motion: where the velocity reverses in every frame, or stays below its largest change in a frame."""
    old, new = e.states[:-1, 1], e.states[1:, 1]
    clear = (old * new > 0) & (2 * np.minimum(np.abs(old), np.abs(new)) > np.abs(new - old))
    held = np.flatnonzero((old[:-1] * new[:-1] <= 0) & (old[1:] * new[1:] <= 0))
    fast = np.flatnonzero(np.abs(new) > np.max(np.abs(new - old)))
    for end in (fast[-1] + 1 if len(fast) else 0, held[0] if len(held) else len(clear)):
        moves = np.where(clear & (np.arange(len(clear)) < end), np.sign(old), math.nan)
        if {-1.0, 1.0} <= set(moves.tolist()):
            return [moves]
    return [np.full(len(clear), math.nan)]


def _pushed(e: Evidence, found: Regression) -> Floats:
    """Coefficients (columns, 2) of the next state: those of the map, corrected by the law's regression."""
    whole = found.x.copy()
    whole[:2] += e.found.entries.astype(np.float64).T
    return whole


def _drag(e: Evidence, found: Regression) -> str:
    row, record = _pushed(e, found)[:, 1], e.record
    mass = 1.0 if record.mass is None else float(record.mass[e.j])
    h, scale = abs(float(record.interval)), float(e.found.size[1])
    c1, c2 = mass * (1 - row[1]) / h, -mass * row[-1] / scale
    unit = " of the mass" if record.mass is None else ""
    return f"A drag c1 v + c2 |v| v acts, with c1 = {c1:.4g} and c2 = {c2:.4g}{unit}, explicit in the force"


def _dry(e: Evidence, found: Regression) -> str:
    whole = _pushed(e, found)
    rest = np.linalg.lstsq(np.eye(2) - whole[:2].T, whole[-1])[0]
    away = abs(float(rest[0] * e.found.size[0]))
    force = f", {away * e.stiffness:.6g}" if e.stiffness else ""
    return (
        f"Dry (Coulomb) friction acts: a force of one size{force} against the velocity, which holds the "
        f"motion about {away:.6g} to either side of its rest"
    )


def _cubic(e: Evidence, found: Regression) -> str:
    row = _pushed(e, found)[:, 1]
    share = row[-1] / row[0] * float(np.max(e.q**2)) if row[0] else math.nan
    return f"The force is anharmonic: a cubic part reaches {share:.2g} of the linear one where largest"


def _two_maps(e: Evidence, _: Regression) -> str:
    """How the maps of even and odd frames differ, in a sentence."""
    odd = np.arange(e.pairs) % 2 == 1
    halves = [fit(e.record, e.j, kept=mask) for mask in (~odd, odd)]
    left = max(float(np.max(x.residual)) for x in halves)
    dets = [float(np.linalg.det(x.entries.astype(np.float64))) - 1 for x in halves]
    loose = replace(e.terms, mass_unknown=True, vague=False)
    found = [matched(x, loose) for x in halves]
    one, other = ({m.scheme: m for m in reversed(x)} for x in found)
    both = list(dict.fromkeys(m.scheme for m in found[0] if m.scheme in other))
    what = "two maps take turns"
    if both:
        share = abs(math.sqrt(one[both[0]].a / other[both[0]].a) - 1)
        whose = f"the steps of {title(both[0])}" if len(both) == 1 else "steps"
        what = f"{whose} alternate by {share:.2g} of their length"
    elif abs(dets[0] - dets[1]) > 4 * left:
        what = f"a friction of changing sign multiplies areas by 1 {dets[0]:+.2e} and 1 {dets[1]:+.2e}"
        if dets[0] * dets[1] > 0:
            what = f"one multiplies areas by a share of {abs(dets[0] - dets[1]):.2e} more than the other"
    return f"Even and odd steps differ and alternate: {what}"


OF_A_CLOCK = "look for a parameter or a clock that moves during the run"

DRY = Cause(
    kind=OF_VELOCITY, columns=_directions, cause=_dry,
    remedy="leave the dry friction out: no linear scheme has it",
)  # fmt: skip

COUPLED = Cause(
    kind="is another oscillator's",
    cause="The oscillators are coupled: coordinate {j} follows from the states of all, which {moved}",
    columns=lambda e: [
        *(x for m in e.others for x in m.z[:-1].astype(np.float64).T),
        np.full(e.pairs, 1.0 if e.others else math.nan),
    ],
    remedy="leave the coupling out, or judge it with a --scene that has it",
)  # fmt: skip

CONSTANT = Cause(
    kind="has a constant beside it", columns=lambda e: [np.ones(e.pairs)],
    cause="A constant added to the position in every frame explains most of what a map misses: it {moved}",
    remedy="look for a drift that is not the velocity's, and then for what else is left",
)  # fmt: skip

PARITY = Cause(
    kind="alternates from step to step", columns=_alternating, cause=_two_maps,
    remedy="look for a buffer or a sign that is switched in every step",
)  # fmt: skip

POWERS = Cause(
    kind=ANHARMONIC, flexible=True,
    columns=lambda e: [e.q**i * e.v**k for i in range(4) for k in range(4) if i + k in (0, 2, 3)],
    cause="The motion is anharmonic: the force is not linear in position or velocity, which {moved}",
)  # fmt: skip

BEAT = Cause(
    kind=IN_TIME, remedy=OF_A_CLOCK,
    columns=lambda e: [x * t for x in _alternating(e) for t in (1.0, np.linspace(-1, 1, e.pairs))],
    cause="The step or the stiffness changes in time, up and down in nearly two frames, which {moved}",
)  # fmt: skip

OUTER_DRIVE = Cause(
    kind=IS_DRIVEN, columns=lambda e: [np.ones(e.pairs)], waves=True, flexible=True,
    cause="A force from outside drives the motion, up and down in time, which {moved}",
    remedy="leave the external force out, or judge a part of the trajectory without it",
)  # fmt: skip

LAWS = (
    CONSTANT,
    Cause(
        kind=OF_VELOCITY, columns=lambda e: [np.abs(e.v) * e.v], cause=_drag,
        remedy="leave the quadratic drag out, or judge against a scene that has it",
    ),
    PARITY,
    BEAT,
    Cause(
        kind=ANHARMONIC, columns=lambda e: [np.ones(e.pairs), e.q**2],
        cause="The force is anharmonic: a quadratic part {moved}",
    ),
    Cause(
        kind=ANHARMONIC, columns=lambda e: [e.q**3], cause=_cubic,
        remedy="look for a bond or a geometry that is not a linear spring",
    ),
    Cause(
        kind=IN_TIME, columns=lambda e: [e.q], waves=True, flexible=True, remedy=OF_A_CLOCK,
        cause="The stiffness changes in time, up and down, which {moved}",
    ),
    POWERS,
    Cause(
        kind=ANHARMONIC, columns=lambda e: [*_hats(e.q, 16)], flexible=True,
        cause="The force is not linear in the position, as one that is clipped or anharmonic, which {moved}",
    ),
    Cause(
        kind=OF_VELOCITY, columns=lambda e: [*_hats(e.v, 16)], flexible=True,
        cause="The friction is not linear in the velocity, which {moved}",
    ),
    Cause(
        kind=IN_TIME, columns=lambda e: _in_time(e, e.q), flexible=True, remedy=OF_A_CLOCK,
        cause="The stiffness changes in time, which {moved}",
    ),
    Cause(
        kind=IN_TIME, columns=lambda e: _in_time(e, e.v), flexible=True,
        cause="The friction changes in time, which {moved}",
        remedy="look for a thermostat or a damping that is switched during the run",
    ),
    Cause(
        kind=IN_TIME, columns=lambda e: _in_time(e, e.q, e.v), flexible=True,
        cause="The step or the stiffness changes in time, which {moved}",
        remedy="look for a step that is adapted, or give a part of the trajectory",
    ),
    OUTER_DRIVE,
)  # fmt: skip
"""Laws of the force, in the order in which those that explain as much are named."""


LIKE_FRICTION = [x for x in LAWS if x.kind in (OF_VELOCITY, ANHARMONIC) and not x.flexible]
"""Laws that a few digits do not tell from linear friction."""


def friction_shows(e: Evidence, part: Match) -> bool:
    """Whether the friction stays significant when any of `LIKE_FRICTION` is fitted beside the map."""
    found, slope = e.found, np.linalg.inv(e.found.entries.astype(np.float64)).T.reshape(4)
    known = math.sqrt(float(slope @ found.covariance @ slope))
    for law in LIKE_FRICTION:
        beside = np.stack([*e.linear, *law.columns(e)], axis=1)
        columns = np.zeros((e.pairs, 2, 2 * beside.shape[1]))
        columns[:, 0, ::2] = columns[:, 1, 1::2] = beside
        flat = columns.reshape(2 * e.pairs, -1)
        weighted = found.noise.solve(columns).reshape(flat.shape)
        inverse = np.linalg.pinv(flat.T @ weighted, hermitian=True)
        x = inverse @ (weighted.T @ e.residuals.ravel())
        # columns are of q and v in turn, each for both numbers of the next state
        at = np.array([0, 2, 1, 3])
        scale = max(found.chi2 / max(found.freedom, 1), 1.0)
        error = math.sqrt(scale * float(slope @ inverse[at][:, at] @ slope)) / known
        lost = part.g * part.stride - float(slope @ x[at])
        if lost <= ERRORS * part.g_error * part.stride * max(error, 1.0):
            return False
    return True


def explained_by(e: Evidence, found: Regression) -> Explanation:
    """Explanation of the residuals by a law."""
    law = found.law
    moved = f"moves a frame by {e.size:.1e} of the state's size in each frame"
    cause = law.cause.format(moved=moved, j=e.j) if isinstance(law.cause, str) else law.cause(e, found)
    if law.waves:
        cause += driven.said(e, law.kind == IS_DRIVEN, found.turn)
    return Explanation(cause, law.remedy, found.left, local=found.exact)


def alone(law: Cause, e: Evidence) -> Explanation | None:
    """Explanation by a law that leaves almost no residual."""
    found = regression(e, law)
    # what pushes along the velocity is no friction
    along = law is DRY and found.x[-1, 1] > 0
    return explained_by(e, found) if found.shows and found.left < 1 / FALLS and not along else None
