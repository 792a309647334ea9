"""Which scheme made these states: the search, what is said of it, and the document that carries it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from springcheck.errors import IdentificationError
from springcheck.identify import arithmetic
from springcheck.identify.fit import ROUNDING, Map, fit
from springcheck.identify.match import ONE_STEP, OWN_FRICTION, STRIDES, Match, Terms, match, unit_matrix
from springcheck.identify.record import Record, read
from springcheck.model import Floats
from springcheck.schemes import SCHEMES, roundings

NONE = "none (adaptive or unknown)"

VELOCITY_OFFSET = {
    "semi-implicit-euler": -0.5,
    "semi-implicit-euler-drift-kick": 0.5,
    "langevin-middle": -0.5,
}
"""Time of the velocities after that of the positions, in steps: where the map is of second order."""

LEAPFROG = {
    "semi-implicit-euler": "leapfrog with velocities half a step early",
    "semi-implicit-euler-drift-kick": "leapfrog with velocities half a step late",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """What the states say.  Rows of numbers hold one for each oscillator that moves.

    `fits` is true where a known scheme explains every step to the rounding of a known arithmetic, and what
    was stated (mass, stiffness, step) agrees with it.
    """

    scheme: str
    aliases: tuple[str, ...]
    """Other names of the same map: on a spring nothing can tell them apart."""
    candidates: tuple[str, ...]
    """Schemes that this trajectory does not exclude, "name" or "name, s steps a frame"."""
    step: float
    """[T]; negative where time runs backwards."""
    stride: int
    """Steps from frame to frame."""
    omega: tuple[float, ...]
    """True angular frequency sqrt(k/m), not that of the discrete motion; NaN for an inverted spring [1/T]."""
    stiffness: tuple[float, ...] | None
    """[M/T2]; None where no mass is known."""
    friction: tuple[float, ...]
    """Rate c/m [1/T]."""
    velocity_offset: float
    """Time of the velocities after that of the positions, in steps."""
    determinant: tuple[float, ...]
    """Of the measured map, for one step."""
    symplectic_defect: float
    """Largest |M^T J M - J| of the measured map between frames."""
    defect_ulp: float
    """Largest departure of one recorded step from the scheme's, in units of 2**-52 of the terms' sizes."""
    precision: str
    fits: bool
    nearest: str
    """The scheme itself, or where none fits the one whose entries are closest."""
    difference: tuple[float, ...]
    """Measured less predicted entries M11, M12, M21, M22 between frames, of the first oscillator, (q, v T)."""
    notes: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """For JSON: numbers for one oscillator, lists for several, null for what is not known."""

        def plain(x: Any) -> Any:
            if isinstance(x, float):
                return x if math.isfinite(x) else None
            return [plain(y) for y in x] if isinstance(x, tuple) else x

        out = {name: plain(x) for name, x in asdict(self).items()}
        for name in ("omega", "stiffness", "friction", "determinant"):
            if out[name] is not None and len(out[name]) == 1:
                out[name] = out[name][0]
        return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """One scheme and stride for all oscillators together."""

    scheme: str
    stride: int
    parts: tuple[Match, ...]

    @property
    def accepted(self) -> bool:
        return all(part.accepted for part in self.parts)

    @property
    def chi2(self) -> float:
        return sum(part.chi2 for part in self.parts)

    @property
    def plainness(self) -> tuple[int, int, int]:
        """What parsimony sorts by: no unseen turns, the exact flow or the smallest stride, then the list."""
        return (
            max(part.turns for part in self.parts),
            self.stride,
            -1 if self.scheme == "exact" else list(SCHEMES).index(self.scheme),
        )

    def __str__(self) -> str:
        steps = "" if self.stride == 1 else f", {self.stride} steps a frame"
        return self.scheme + steps


@cache
def aliases(name: str) -> tuple[str, ...]:
    """Schemes whose map on a spring is the same, entry for entry, without friction and with it."""
    a = np.array([0.3, 1.1, 2.9], dtype=np.longdouble)
    friction = np.array([0, 0.2, 0.5], dtype=np.longdouble)
    own = unit_matrix(SCHEMES[name], a, friction)
    return tuple(
        scheme.name
        for scheme in ONE_STEP
        if scheme.name != name and np.max(np.abs(unit_matrix(scheme, a, friction) - own)) < 1e-15
    )


@cache
def distinct() -> tuple[str, ...]:
    """One name of every map.  The implicit midpoint rule speaks for the trapezoidal rule, and so on."""
    out: list[str] = []
    for scheme in ONE_STEP:
        if not set(aliases(scheme.name)) & set(out):
            out.append(scheme.name)
    return tuple(out)


def _search(maps: list[Map], terms: list[Terms], strides: range) -> list[Joint]:
    """Every scheme and stride against every oscillator; what fails one is not tried on the next."""
    without = {scheme.name for scheme in OWN_FRICTION}
    names = [name for name in distinct() if terms[0].damped or name not in without]
    keys: dict[tuple[str, int], list[Match]] = {}
    for i, (found, what) in enumerate(zip(maps, terms, strict=True)):
        best: dict[tuple[str, int], Match] = {}
        for name in names:
            wanted = sorted({key[1] for key in keys if key[0] == name}) if i else []
            if i and not wanted:
                continue
            within = range(wanted[0], wanted[-1] + 1) if i else strides
            for m in match(SCHEMES[name], found, what, within):
                key = name, m.stride
                old = best.get(key)
                if old is None or (not m.accepted, m.turns, m.chi2) < (not old.accepted, old.turns, old.chi2):
                    best[key] = m
        merged = {
            key: [*keys.get(key, []), m] for key, m in best.items() if not i or (key in keys and len(keys[key]) == i)
        }
        passing = {key: ms for key, ms in merged.items() if all(m.accepted for m in ms)}
        keys = passing if passing and i + 1 < len(maps) else merged
    return [Joint(scheme=k[0], stride=k[1], parts=tuple(ms)) for k, ms in keys.items() if len(ms) == len(maps)]


def _moving(record: Record) -> tuple[list[int], list[str]]:
    """Oscillators that move, and a note on those that do not."""
    spread = np.ptp(record.q, axis=0) + np.ptp(record.v, axis=0) * abs(record.interval)
    moving = np.flatnonzero(spread > 0).tolist()
    if not moving:
        raise IdentificationError("nothing moves: at rest every scheme does the same; give a start away from rest")
    still = len(spread) - len(moving)
    return moving, [f"{still} of {len(spread)} oscillators are at rest and left out"] if still else []


def _checked_map(record: Record, j: int) -> Map:
    found = fit(record, j)
    if not found.conditioned:
        raise IdentificationError(
            f"the states of oscillator {j} do not span its plane (a standing state, or whole or half periods "
            "between frames, or an arc shorter than the rounding): record more of the motion"
        )
    return found


def _stated_stride(record: Record, step: float | None, notes: list[str]) -> int | None:
    if step is None:
        return None
    if not math.isfinite(step) or step == 0:
        raise IdentificationError(f"step must be a finite number other than 0; found {step!r}")
    ratio = float(record.interval / np.longdouble(step))
    stride = round(ratio)
    if stride < 1 or abs(ratio - stride) > 4 * stride * (record.jitter + ROUNDING):
        notes.append(
            f"the stated step {step:.9g} does not divide the interval {float(record.interval):.9g} of the states"
        )
        return -1
    return stride


def identify(
    t: ArrayLike,
    q: ArrayLike,
    p: ArrayLike | None = None,
    *,
    v: ArrayLike | None = None,
    mass: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
    step: float | None = None,
) -> Identification:
    """The scheme that made a trajectory of independent oscillators, from its states alone.

    t (f,) [T]; q (f, n) or (f,) [L]; p [M L/T] or v [L/T] or both, like q.  Where both are given the mass
    follows from them.  With momenta alone and no mass, symmetric schemes look alike on a spring; the
    notes say so.  `mass` [M], `stiffness` [M/T2] and `step` [T] are what is stated of the trajectory: they
    are held against it.

    Raises IdentificationError where the states cannot show a map: too few, not finite, at rest, at uneven
    times, or not spanning the plane.
    """
    record = read(t, q, p, v, mass)
    moving, notes = _moving(record)
    maps = [_checked_map(record, j) for j in moving]
    for j, found in zip(moving, maps, strict=True):
        pull, error = abs(float(found.entries[1, 0])), math.sqrt(found.covariance[2, 2])
        if pull < 6 * error:
            raise IdentificationError(f"no force acts on oscillator {j}: every scheme moves it in a straight line")
    stated = None if stiffness is None else np.broadcast_to(np.asarray(stiffness, float).ravel(), record.q.shape[1])
    stride = _stated_stride(record, step, notes)
    base = [_terms(record, j, stated) for j in moving]
    if record.momenta and stated is None:
        notes.append(
            "neither mass nor velocities nor stiffness are known, so only three numbers of each map count: "
            "velocity and position Verlet, implicit midpoint and the exact flow look alike; give the mass"
        )
    found_all, chosen, terms = _find(record, maps, base, stride)
    if chosen is not None and stated is not None:
        agreeing = [x for x in found_all if not _disagreements(record, moving, x, stated)]
        found_all = agreeing or found_all
        chosen = found_all[0]
    if chosen is None or stride == -1 or (stride is not None and chosen.stride != stride and chosen.scheme != "exact"):
        if stride is not None and stride > 0:
            notes.append(f"with the stated step {step:.9g}, {stride} to a frame, no known scheme fits")
        stated_fits = stride is None
    else:
        stated_fits = True
    if chosen is None:
        return _unknown(record, moving, maps, base, found_all, notes)
    return _known(record, moving, maps, found_all, chosen, terms, stated, stated_fits, notes)


def _terms(record: Record, j: int, stated: Floats | None) -> Terms:
    log_stiffness = None
    if record.momenta and stated is not None and stated[j] > 0:
        log_stiffness = math.log(stated[j] * float(record.interval) ** 2)
    return Terms(mass_unknown=record.momenta, jitter=record.jitter, log_stiffness=log_stiffness)


def _find(
    record: Record, maps: list[Map], base: list[Terms], stride: int | None
) -> tuple[list[Joint], Joint | None, list[Terms]]:
    """All accepted schemes, and the plainest; without friction first, and with it where nothing fits.

    Coefficients are taken as rounded in double precision first.  Where the states are coarser than that
    the arithmetic may have been so too, and a second round allows coefficients of single precision.
    """
    coarse = max(float(np.max(found.residual)) for found in maps) > 2.0**-40
    tried: list[Joint] = []
    first = [range(stride, stride + 1)] if stride is not None and stride > 0 else []
    few, many = range(1, STRIDES[0] + 1), range(STRIDES[0] + 1, STRIDES[1] + 1)
    for damped, ranges in ((False, [*first, few]), (True, [*first, few]), (False, [many])):
        for rounding in (ROUNDING, 2.0**-24) if coarse else (ROUNDING,):
            terms = [replace(what, damped=damped, rounding=rounding) for what in base]
            for strides in ranges:
                joints = _search(maps, terms, strides)
                accepted = sorted((x for x in joints if x.accepted), key=lambda x: x.plainness)
                if accepted:
                    # what is 25 worse in chi-squared than the best, five standard errors, is excluded too
                    best = min(x.chi2 for x in accepted)
                    accepted = [x for x in accepted if x.chi2 <= best + 25]
                    return accepted, accepted[0], terms
                tried += joints if not damped and strides is not many else []
    return tried, None, base


def _numbers(
    record: Record, moving: list[int], chosen: Joint
) -> tuple[tuple[float, ...], tuple[float, ...] | None, tuple[float, ...]]:
    """Frequency, stiffness and friction rate of each oscillator."""
    h = float(record.interval) / chosen.stride
    omega = tuple(math.sqrt(m.a) / abs(h) if m.a > 0 else math.nan for m in chosen.parts)
    friction = tuple(m.friction / h for m in chosen.parts)
    stiffness: tuple[float, ...] | None = None
    if record.mass is not None:
        stiffness = tuple(float(record.mass[j]) * m.a / h**2 for j, m in zip(moving, chosen.parts, strict=True))
    elif record.momenta:
        stiffness = tuple(math.exp(m.log_mass) * m.a / h**2 for m in chosen.parts)
    return omega, stiffness, friction


def _disagreements(record: Record, moving: list[int], joint: Joint, stated: Floats) -> list[str]:
    """Where the stiffness that the states show is not the stated one, beyond six standard errors and rounding."""
    _, stiffness, _ = _numbers(record, moving, joint)
    path = 4 if joint.scheme == "exact" else roundings(SCHEMES[joint.scheme])
    out = []
    for j, part, k in zip(moving, joint.parts, stiffness or (), strict=False):
        error = 6 * part.a_error / abs(part.a) + 2 * record.jitter + 4 * path * ROUNDING
        off = k / float(stated[j]) - 1 if stated[j] else math.inf
        if not abs(off) <= error:
            out.append(
                f"the stated stiffness {stated[j]:.9g} does not fit: the states show {k:.9g} "
                f"(relative difference {off:+.2e}, known to {error:.0e})"
            )
    return out


def _determinants(maps: list[Map], stride: int) -> tuple[tuple[float, ...], float]:
    between = [float(x.entries[0, 0] * x.entries[1, 1] - x.entries[0, 1] * x.entries[1, 0]) for x in maps]
    each = tuple(math.copysign(abs(d) ** (1 / stride), d) for d in between)
    return each, max(abs(d - 1) for d in between)


def _difference(found: Map, part: Match) -> tuple[float, ...]:
    off = found.entries.reshape(4) - np.array(part.predicted, dtype=np.longdouble)
    ratio = float(found.size[0] / found.size[1])
    return tuple(float(x) * y for x, y in zip(off, (1, ratio, 1 / ratio, 1), strict=True))


def _known(
    record: Record,
    moving: list[int],
    maps: list[Map],
    accepted: list[Joint],
    chosen: Joint,
    terms: list[Terms],
    stated: Floats | None,
    stated_fits: bool,
    notes: list[str],
) -> Identification:
    defects: list[arithmetic.Defect] = []
    for joint in dict.fromkeys([chosen, *accepted]):
        defects = [
            arithmetic.defect(record, j, x, part) for j, x, part in zip(moving, maps, joint.parts, strict=True)
        ]
        if all(d.precision for d in defects):
            chosen = joint
            break
    else:
        return _unknown(record, moving, maps, terms, accepted, notes)
    worst = max(defects, key=lambda d: (d.precision != "double", d.ulp))
    notes = [*notes, *dict.fromkeys(d.note for d in defects if d.note)]
    omega, found_stiffness, friction = _numbers(record, moving, chosen)
    determinant, symplectic = _determinants(maps, chosen.stride)
    h = float(record.interval) / chosen.stride
    if stated is not None:
        disagreements = _disagreements(record, moving, chosen, stated)
        stated_fits = stated_fits and not disagreements
        notes += disagreements
    notes += _remarks(accepted, chosen, friction)
    first = chosen.parts[0]
    return Identification(
        scheme=chosen.scheme,
        aliases=(*aliases(chosen.scheme), *([LEAPFROG[chosen.scheme]] if chosen.scheme in LEAPFROG else [])),
        candidates=tuple(str(x) for x in accepted),
        step=h,
        stride=chosen.stride,
        omega=omega,
        stiffness=found_stiffness,
        friction=friction,
        velocity_offset=VELOCITY_OFFSET.get(chosen.scheme, 0.0),
        determinant=determinant,
        symplectic_defect=symplectic,
        defect_ulp=max(d.ulp for d in defects),
        precision=worst.precision,
        fits=stated_fits,
        nearest=chosen.scheme,
        difference=_difference(maps[0], first),
        notes=tuple(notes),
    )


def _remarks(accepted: list[Joint], chosen: Joint, friction: tuple[float, ...]) -> list[str]:
    out = []
    if chosen.scheme in LEAPFROG:
        out.append(f"the same map is {LEAPFROG[chosen.scheme]}: states alone do not tell the two apart")
    if any(part.friction for part in chosen.parts):
        out.append(f"the motion is damped at a rate c/m of {', '.join(f'{x:.6g}' for x in friction)}")
    if max(part.turns for part in chosen.parts):
        out.append("the motion makes whole turns between two frames: the frequency is not the one that they show")
    if any(part.a < 0 for part in chosen.parts):
        out.append("the spring is inverted: its stiffness is negative")
    others = [f"{x}{_apart(x, chosen)}" for x in accepted if x is not chosen]
    if others:
        shown = "; ".join(others[:6]) + (f"; and {len(others) - 6} more" if len(others) > 6 else "")
        lead = "no error of a step is visible, so " if chosen.scheme == "exact" else ""
        out.append(f"{lead}not told apart at this precision: {shown}; named is the plainest")
    return out


def _apart(other: Joint, chosen: Joint) -> str:
    """How much stiffer the spring is if it is the other scheme, where that shows."""
    off = other.parts[0].a * other.stride**2 / (chosen.parts[0].a * chosen.stride**2) - 1
    return f" (with {off:+.1e} of the stiffness more)" if abs(off) > 1e-12 else ""


def _unknown(
    record: Record, moving: list[int], maps: list[Map], terms: list[Terms], tried: list[Joint], notes: list[str]
) -> Identification:
    """No scheme: the nearest, what differs, and what else may be the matter."""

    def distance(joint: Joint) -> float:
        return max(max(map(abs, _difference(found, m))) for found, m in zip(maps, joint.parts, strict=True))

    if not tried:
        tried = _search(maps, [replace(what, damped=False) for what in terms], range(1, 2))
    determinant, symplectic = _determinants(maps, 1)
    nearest, difference = "", (math.nan,) * 4
    omega: tuple[float, ...] = tuple(math.nan for _ in moving)
    stiffness = None
    if tried:
        least = min(distance(x) for x in tried)
        # many schemes and strides come close by chance; the plainest of the close ones is the better guess
        close = min((x for x in tried if distance(x) <= 10 * least), key=lambda x: x.plainness)
        nearest, difference = str(close), _difference(maps[0], close.parts[0])
        omega, stiffness, _ = _numbers(record, moving, close)
        entries = ", ".join(
            f"{name} {x:+.1e}" for name, x in zip(("M11", "M12", "M21", "M22"), difference, strict=True)
        )
        notes = [*notes, f"nearest is {nearest}; measured less predicted entries on (q, v T): {entries}"]
    residual = max(float(np.max(found.residual)) for found in maps)
    notes = [*notes, *_causes(maps, terms, residual)]
    return Identification(
        scheme=NONE,
        aliases=(),
        candidates=(),
        step=math.nan,
        stride=0,
        omega=omega,
        stiffness=stiffness,
        friction=tuple(math.nan for _ in moving),
        velocity_offset=math.nan,
        determinant=determinant,
        symplectic_defect=symplectic,
        defect_ulp=residual / 2.0**-52,
        precision="unknown",
        fits=False,
        nearest=nearest,
        difference=difference,
        notes=tuple(notes),
    )


def _other_units(maps: list[Map], terms: list[Terms]) -> list[str]:
    """Whether a scheme fits once velocities may have any scale: wrong masses, wrong units, dq/dt = p."""
    if terms[0].mass_unknown:
        return []
    free = [replace(what, mass_unknown=True, damped=False, rounding=ROUNDING) for what in terms]
    fitting = [x for x in _search(maps, free, range(1, 4)) if x.accepted]
    if not fitting:
        return []
    best = min(fitting, key=lambda x: x.plainness)
    # a scale that is nearly 1 is no change of units but the misfit itself
    if max(abs(part.log_mass) for part in best.parts) < 1e-3:
        return []
    factor = ", ".join(f"{math.exp(-part.log_mass):.3g}" for part in best.parts)
    return [
        f"{best} would fit if velocities were about {factor} times as large: "
        "look at the mass, at the units of velocities and times, and at whether dq/dt = p/m"
    ]


def _causes(maps: list[Map], terms: list[Terms], residual: float) -> list[str]:
    """Why no matrix explains the states, where that shows."""
    z = [found.z.astype(np.float64) for found in maps]
    out = []
    for found, states in zip(maps, z, strict=True):
        q, v = states[:-1].T
        missing = (found.z[1:] - found.z[:-1] @ found.entries.T).astype(np.float64)
        if len(q) > 20:
            powers = [q**i * v**k for i in range(4) for k in range(4) if 0 < i + k <= 3]
            if _left(np.stack(powers, axis=1), missing) < 0.1:
                out.append("the motion is anharmonic: the force is not linear in the position, so no matrix fits it")
                break
    if len(maps) > 1 and len(z[0]) > 4 * len(maps) + 10:
        everything = np.concatenate([states[:-1] for states in z], axis=1)
        for found in maps:
            missing = (found.z[1:] - found.z[:-1] @ found.entries.T).astype(np.float64)
            if residual > 1e-12 and _left(everything, missing) < 0.01:
                out.append(
                    "the oscillators are coupled: each follows from the states of all; "
                    "give normal modes, which are independent"
                )
                break
    out = out or _other_units(maps, terms)
    if not out and residual > 64 * ROUNDING:
        out.append(
            f"one map leaves {residual:.1e} of the state unexplained in every step, which no known arithmetic or "
            "number format does: an adaptive solver, noise, or a force that changes"
        )
    if not out:
        out.append("one map explains the states to rounding, but it is none of the known schemes'")
    return out


def _left(columns: Floats, missing: Floats) -> float:
    """Share of the residual that these columns leave over."""
    fitted = columns @ np.linalg.lstsq(columns, missing, rcond=None)[0]
    total = float(np.sqrt(np.mean(missing**2)))
    share = len(missing) / max(len(missing) - columns.shape[1], 1)
    return float(np.sqrt(np.mean((missing - fitted) ** 2) * share)) / total if total else 1.0
