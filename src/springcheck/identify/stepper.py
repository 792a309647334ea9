"""A student's integrator, judged in one line: a Python callable ``step(q, p, h, force, mass) -> (q, p)``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from springcheck.errors import IdentificationError, MethodError, told
from springcheck.identify.catalogue import FAULTS, of_scheme, title
from springcheck.identify.elsewhere import ELSEWHERE
from springcheck.identify.pair import Timeless, on_a_pair, returned
from springcheck.identify.report import identify_arrays
from springcheck.identify.result import Explanation, Identification
from springcheck.identify.steps import takers
from springcheck.identify.tables import same
from springcheck.identify.unknown import MAP_OF, ONE_MAP
from springcheck.physics.arrays import Floats
from springcheck.physics.exact import true_motion
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Quartic
from springcheck.schemes import SCHEMES

Stepper: TypeAlias = Callable[..., Any]

SPRINGS = ((3.7, 2.9, 0.31), (0.6, 1.7, 0.11), (1.9, 0.8, 0.43))
"""m, k, h: uneven, so that a missing mass or a misplaced half step shows."""

FRAMES = 81

BATH_FRAMES = 4001
"""Frames of a stepper that draws random numbers: its kT is then known to 10 %."""

TINY_STEP = 1e-6, 1e-3
"""A step whose higher powers vanish, and the tolerance of the weights' sums, which are 1."""

RUNAWAY = 1e5
"""Growth of a state at which a run ends."""

ALONG, MANY_PLACES = 16.0, 1025
"""Largest position, and number of positions, at which jumps are sought."""

LONG = 16
"""Steps in the duration on the quartic potential, to tell schemes apart that agree on a spring."""

WELL = (1.3, 2.1, 1.1, 0.4, 2.0)
"""m, b, q0, p0 and duration on V = b/4 q**4, a quarter of whose time scale passes in a unit of time."""


def _one(
    step: Stepper, q: float, p: float, h: float, force: Callable[..., Any], mass: float
) -> tuple[float, float]:
    """One step of the stepper on numbers, or on arrays of one particle where it needs to index them.  Raises
    MethodError."""
    force = Timeless(force)
    try:
        try:
            out = step(q, p, h, force, mass)
        except Exception as first:
            try:
                out = step(np.array([q]), np.array([p]), h, force, np.array([mass]))
            except Exception:
                raise first from None
        q, p = (float(x.flat[0]) for x in returned(step, out))
    except (KeyboardInterrupt, MethodError):
        raise
    except BaseException as error:
        file = getattr(getattr(step, "__code__", None), "co_filename", "")
        raise MethodError(
            f"the stepper failed at q={q:.6g}, p={p:.6g}, h={h:.6g}: {told(error, file)}; "
            "it is called as step(q, p, h, force, mass) and returns (q, p)"
        ) from error
    if not (math.isfinite(q) and math.isfinite(p)):
        raise MethodError(f"the stepper returned q={q}, p={p}, which are not finite numbers")
    return q, p


def _run(
    step: Stepper, force: Callable[..., Any], m: float, h: float, start: tuple[float, float], frames: int
) -> tuple[Floats, Floats, Floats]:
    states = [start]
    most = RUNAWAY * max(map(abs, start))
    for _ in range(frames - 1):
        # of a motion that runs away the growing direction alone is left: no map can be fitted to it
        if len(states) > 6 and max(map(abs, states[-1])) > most:
            break
        states.append(_one(step, *states[-1], h, force, m))
    q, p = np.array(states).T
    return np.asarray(h * np.arange(len(q)), dtype=np.float64), q, p


def _spring(k: float) -> Callable[..., Any]:
    return lambda q, p=0.0: -k * q


def _identified(
    step: Stepper, spring: tuple[float, ...] = SPRINGS[0], frames: int = FRAMES, way: int = 1, clock: int = 1
) -> Identification:
    """Identify a stepper on a spring (m, k, h) with steps of sign `way` and times of sign `clock`."""
    m, k, h = spring
    t, q, p = _run(step, _spring(k), m, way * h, (1.3, 0.7 * m), frames)
    return identify_arrays(way * clock * t, q, p, mass=m, stiffness=k, step=clock * h)


def _step(
    step: Stepper, h: float | None = None, force: Callable[..., Any] | None = None
) -> tuple[float, float]:
    """One step on the first spring."""
    m, k, long = SPRINGS[0]
    return _one(step, 1.3, 0.7 * m, h or long, force or _spring(k), m)


def identify_stepper(step: Stepper, *, single: bool = False) -> Identification:
    """Which scheme a callable ``step(q, p, h, force, mass) -> (q, p)`` is, and what is wrong with it.

    It is run on three springs of uneven mass, stiffness and step, backwards in time, and on a quartic
    potential: a spring alone can overestimate the order of a scheme; and with two unlike particles at once,
    unless `single`.  ``force`` may be called as force(q), force(q, p) or force(q, p, t); ``force.t`` is the
    time at which the step starts.  The numbers are those of the first spring. Raises MethodError where the
    callable fails or returns no pair of finite numbers.
    """
    results: list[Identification] = []
    for spring in SPRINGS:
        try:
            results.append(_identified(step, spring))
        except IdentificationError as error:
            if _draws(step):
                return _identified(step, frames=BATH_FRAMES)
            raise MethodError(f"the stepper does not move a spring as a scheme would: {error}") from error
        if not results[0].fits:
            break
    found = results[0]
    if not found.fits and _draws(step):
        return _identified(step, frames=BATH_FRAMES)
    if not all(x.fits for x in results) and (leaps := _leaps(step, found)):
        # a motion that is torn says nothing else
        return replace(found.refuted(leaps.cause, leaps), nearest=None)
    wrong = [*_on_springs(step, results), *_unasked_friction(found)]
    if any(x.cause.startswith(ONE_MAP) for x in found.explanations[:1]):
        wrong += _short(step)
    if found.scheme and not wrong:
        wrong += _backwards(step, found)
    if found.scheme in ELSEWHERE and _calls(step) > len(ELSEWHERE[found.scheme].over) - 1 > 0:
        # more stages than the scheme needs: a fault of the same map has them
        wrong += [Explanation(one.fault, one.remedy) for one in FAULTS if same(one, of_scheme(found.scheme))]
    slope, deviation = _order(step)
    order = f"order {slope:.2f} +- {deviation:.2f} in a quartic potential"
    if math.isnan(slope):
        order = "its error in a quartic potential does not fall as a power of the step: no order is measured"
    known = SCHEMES.get(str(found.scheme)) or ELSEWHERE.get(str(found.scheme))
    if not wrong and known and known.order and slope < known.order - max(5 * deviation, 0.25):
        cause = (
            f"On a spring it is {found.scheme}, of order {known.order}, but not on forces that are not linear"
        )
        wrong.append(Explanation(cause, "look for a force that is evaluated at the wrong place"))
    alone = []
    if found.scheme and found.fits and not (wrong or single):
        try:
            wrong += on_a_pair(step, [found.scheme, *found.aliases])
        except MethodError as error:
            alone = [f"tried with one particle alone: {error}"]
    if found.scheme and found.fits and not wrong:
        found = _on_a_well(step, found)
    # one remark of each kind: other springs have other numbers
    remarks = [note for x in results if x is results[0] or not x.fits for note in x.notes]
    return replace(
        found,
        fits=found.fits and not wrong,
        statement=wrong[0].cause if wrong else found.statement,
        # what the other springs refute is no explanation any more
        explanations=(*wrong, *found.explanations[1 if wrong and _parametric(found) else 0 :]),
        notes=tuple(dict.fromkeys([*remarks, *alone, order])),
        defect_ulp=max(x.defect_ulp for x in results),
    )


def _steep(q: float, p: float = 0.0) -> float:
    """Force of the quartic potential."""
    return -WELL[1] * q**3


def _well(h: float) -> Scene:
    """The quartic potential, with steps of h [T]."""
    m, b, q, p = (np.array([x]) for x in WELL[:4])
    return Scene(m=m, q=q, p=p, terms=(Quartic(i=np.array([0]), b=b, at=np.zeros(1)),), step=h, steps=1)


def _on_a_well(step: Stepper, found: Identification) -> Identification:
    """Name the scheme, of those with one map on a spring, whose step the stepper takes in a quartic
    potential, or withhold the name where none does."""
    m, _, q, p, duration = WELL
    scene = _well(duration / LONG)
    made = _one(step, q, p, scene.step, _steep, m)
    names = [str(found.scheme), *found.aliases]
    known = [name for name in names if name in SCHEMES and SCHEMES[name].has("one-step")]
    least = 2.0 ** (-49 if found.precision == "double" else -20)
    positions, momenta = np.array([[q, p], made]).T[..., None]
    taking = takers(known, scene, scene.step, positions, momenta, least)
    if not known or str(found.scheme) in taking:
        return found
    for name in taking:
        others = tuple(x for x in names if x != name)
        candidates = tuple(replace(x, scheme=name, aliases=others) for x in found.candidates)
        return replace(
            found, scheme=name, aliases=others, candidates=candidates, nearest=name,
            statement=found.statement.replace(title(str(found.scheme)), title(name), 1),
        )  # fmt: skip
    return replace(
        found, scheme=None, aliases=(), candidates=(), verdict="not told apart",
        statement=f"{title(names[0])} on a spring, and another scheme on forces that are not linear: another "
        "member of its class, which is not known here, or a force that is evaluated elsewhere",
    )  # fmt: skip


def _on_springs(step: Stepper, results: list[Identification]) -> list[Explanation]:
    """What the further springs show of a scheme that fits on the first, or of a method with parameters."""
    if not results[0].fits:
        return _parameters(step, results[0])
    if len({x.scheme for x in results}) == 1:
        return list(next((x.explanations for x in results if not x.fits), ()))
    try:
        same = _identified(step).scheme == results[0].scheme
    except IdentificationError:
        same = False
    if not same:
        cause = (
            f"{title(str(results[0].scheme))} in a first run, and not in a later one from the same start: "
            "the stepper keeps a force or a state of the run before"
        )
        remedy = "make each step follow from its arguments, or begin each run with a stepper of its own"
        return [Explanation(cause, remedy)]
    named = "; ".join(
        f"{x.scheme or 'none that is known'} at m={m}, k={k}, h={h}"
        for x, (m, k, h) in zip(results, SPRINGS, strict=False)
    )
    cause = f"The stepper looks like different schemes on different springs: {named}"
    return [Explanation(cause, "look for numbers that are written into it")]


def _parameters(step: Stepper, found: Identification) -> list[Explanation]:
    """Refute a method whose parameters, read from the first spring, differ on the others."""
    read = [_parametric(found)]
    for spring in SPRINGS[1:] if read[0] else ():
        try:
            read.append(_parametric(_identified(step, spring)))
        except IdentificationError:
            read.append("")
    if len(set(read)) == 1:
        return []
    each = "; ".join(x or "another" for x in read)
    cause = f"A one-step method that is not known here: on three springs it would be {each}"
    return [Explanation(cause, found.explanations[0].remedy)]


def _parametric(found: Identification) -> str:
    """Method with parameters that would have the map, as named in the explanation; "" where there is none."""
    cause = found.explanations[0].cause if found.explanations else ""
    return cause.partition(MAP_OF)[2].partition(";")[0]


def _unasked_friction(found: Identification) -> list[Explanation]:
    rates = ", ".join(f"{x.friction[0]:.4g} by {x.law}" for x in found.candidates[:3])
    if not any(x.law for x in found.candidates):
        return []
    whose = title(found.candidates[0].scheme)
    cause = f"{whose} with a friction that the force has not: c/m is {rates}"
    return [Explanation(cause, "set the damping to 0, which many engines do not by default")]


def _leaps(step: Stepper, found: Identification) -> Explanation | None:
    """Explain positions that are wrapped into a box, linear in the starting position except for equal jumps,
    or rounded, in jumps alone; or steps that depend on earlier calls, where a first run shows no scheme."""
    m, k, h = SPRINGS[0]
    places = np.linspace(-ALONG, ALONG, MANY_PLACES)
    ends, again = (
        np.array([_one(step, q, 0.7 * m, h, _spring(k), m)[0] for q in way]) for way in (places, places[::-1])
    )
    moved = np.diff(ends)
    usual = float(np.median(moved))
    off = np.abs(moved - usual)
    leaps, rest = off[off > abs(usual)], off[off <= abs(usual)]
    if not np.array_equal(ends, again[::-1]):
        cause = "A step depends on an earlier call: after another one it ends elsewhere from the same state"
        remedy = "make each step follow from its arguments: an old position or force is that of another state"
        return None if found.fits else Explanation(cause, remedy)
    if len(leaps) < 2:
        return None
    if usual == 0:
        apart = float(np.median(np.diff(places[1:][off > 0])))
        cause = (
            f"Positions are rounded in the step, to about {apart:.3g}: between the jumps it ends in one place"
        )
        remedy = "keep positions in floating point: an array of integers cuts off what is put into it"
        return Explanation(cause, remedy)
    if np.ptp(leaps) > 1e-9 * leaps[0] or np.max(rest) > 1e-9 * abs(usual):
        return None
    cause = f"The positions are wrapped into a box of {leaps[0]:.6g}, and forces are those of wrapped ones"
    remedy = "do not wrap positions between steps, or take the nearest image where forces are worked out"
    return Explanation(cause, remedy)


def _draws(step: Stepper) -> bool:
    """Whether a third call from one state still differs from the second, as with random numbers."""
    _, one, other = (_step(step) for _ in range(3))
    return one != other


def _short(step: Stepper) -> list[Explanation]:
    """Terms linear in h whose weights do not add up to 1: inconsistent, whatever its order."""
    (m, k, _), (h, most) = SPRINGS[0], TINY_STEP
    q, p = _step(step, h)
    drift, kick = (q - 1.3) / (h * 0.7), (p - 0.7 * m) / (-h * k * 1.3)
    off = max(abs(drift - 1), abs(kick - 1))
    if off < most:
        return []
    x, y = q / 1.3, p / (0.7 * m)
    if max(abs(x - 1), abs(y - 1)) > most:
        cause = f"A step of no length multiplies the position by {x:.4g} and the momentum by {y:.4g}"
        remedy = "return what the last kick and drift have left: q and p as they are, p not with another sign"
        return [Explanation(cause, remedy, off)]
    cause = (
        f"Over a short step the momentum changes by {kick:.5g} h F and the position by {drift:.5g} h p/m, "
        "where a scheme of any order has 1 and 1"
    )
    remedy = "add up the lengths of its kicks and of its drifts, or the weights of its stages: each sum is 1"
    return [Explanation(cause, remedy, off)]


def _calls(step: Stepper) -> int:
    """Number of force evaluations in a step."""
    calls: list[Any] = []

    def force(q: Any, p: Any = 0.0) -> Any:
        calls.append(q)
        return -SPRINGS[0][1] * q

    _step(step, force=force)
    return len(calls)


def _backwards(step: Stepper, found: Identification) -> list[Explanation]:
    """Explanations of a negative step that does not go backwards by the same scheme."""
    back = _identified(step, way=-1, clock=-1)
    if back.scheme == found.scheme:
        return []
    if _identified(step, way=-1).scheme == found.scheme:
        cause = f"{title(str(found.scheme))}, but a negative step goes forwards: the sign of the step is lost"
        return [Explanation(cause, "take the step with its sign")]
    cause = f"A negative step is not {found.scheme} backwards but {back.scheme}"
    return [Explanation(cause, "look for what depends on the direction of time")]


def _order(step: Stepper) -> tuple[float, float]:
    """Slope of log error over log step on a quartic potential, with its standard error; or NaN."""
    m, _, q0, p0, duration = WELL
    true_q, true_p = (float(x[0, 0]) for x in true_motion(_well(duration), np.array([1]), duration))
    steps, errors = [], []
    for count in (16, 24, 36, 54, 80, 120, 180, 270, 400, 600):
        h = duration / count
        q, p = q0, p0
        for _ in range(count):
            if not abs(q) + abs(p) < RUNAWAY:
                break
            q, p = _one(step, q, p, h, _steep, m)
        size = math.hypot(q - true_q, (p - true_p) / m)
        # below, rounding dominates; above, higher orders do
        if 1e-10 < size < 0.03:
            steps.append(math.log(h))
            errors.append(math.log(size))
    if len(steps) < 4:
        return math.nan, math.nan
    x, y = np.array(steps[-5:]), np.array(errors[-5:])
    x = x - np.mean(x)
    slope = float(x @ y / (x @ x))
    left = y - np.mean(y) - slope * x
    return slope, float(np.sqrt(left @ left / (len(x) - 2) / (x @ x)))
