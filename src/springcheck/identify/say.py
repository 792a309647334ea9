"""The one place that makes an answer, and its sentences, of the hypotheses that are left."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from springcheck.identify import factors
from springcheck.identify.catalogue import FAULTS, HELD, OLD_FORCE, aliases, capital, title, titles
from springcheck.identify.compare import Joint
from springcheck.identify.elsewhere import ELSEWHERE
from springcheck.identify.result import UNTOLD, Candidate, Explanation, Identification, nothing
from springcheck.identify.search import FEW, Found, Round, Seen
from springcheck.identify.tables import same
from springcheck.identify.unknown import MAP_OF, ONE_MAP, kind_of_map

T = TypeVar("T")

LEAPFROG = {
    "semi-implicit-euler": "leapfrog with velocities half a step early",
    "semi-implicit-euler-drift-kick": "leapfrog with velocities half a step late",
}
OFFSET = {"semi-implicit-euler": -0.5, "semi-implicit-euler-drift-kick": 0.5, "langevin-middle-early": -0.5}
"""Time of the velocities minus that of the positions, in steps, at which the map is of second order."""

OR_UNKNOWN = ", or a scheme that is not known here"
COMPARE = "compare the order of its stages and their coefficients with the scheme's"
FEW_SUBSTEPS = 1 / 32
"""Error of a share from which on it does not tell some substeps from many."""
OF_AN_ERROR = 1e-3
"""Largest error of a stiffness that a step of high order may have."""
UNITS = "look at the units of the force constant, and at whether V is k/2 q**2"


def _common(values: Sequence[T]) -> T | None:
    return values[0] if values and len(set(values)) == 1 else None


def _numbers(seen: Seen, x: Joint) -> tuple[tuple[float, ...], tuple[float, ...] | None, tuple[float, ...]]:
    """Frequencies, stiffnesses and rates of friction of a hypothesis."""
    h = float(seen.record.interval) / x.stride
    omega = tuple(math.sqrt(p.a) / abs(h) if p.a >= 0 else math.nan for p in x.parts)
    stiffness, m = None, seen.record.mass
    if m is not None:
        stiffness = tuple(p.a / h**2 * float(m[j]) for j, p in zip(seen.moving, x.parts, strict=True))
    return omega, stiffness, tuple(p.g / abs(h) * x.row.damped for p in x.parts)


def candidate(seen: Seen, x: Joint) -> Candidate:
    """A hypothesis as a candidate."""
    omega, stiffness, friction = _numbers(seen, x)
    return Candidate(
        scheme=x.row.scheme, aliases=aliases(x.row), stride=x.stride,
        step=float(seen.record.interval) / x.stride, turns=max(p.turns for p in x.parts), omega=omega,
        stiffness=stiffness, friction=friction, law=x.row.law,
    )  # fmt: skip


def _measured(seen: Seen, stride: int | None) -> dict[str, Any]:
    """Fields that follow from the measured maps alone."""
    between = [float(m.b[0, 0] * m.b[1, 1] - m.b[0, 1] * m.b[1, 0]) for m in seen.maps]
    each = tuple(math.copysign(abs(d) ** (1 / (stride or 1)), d) for d in between)
    return {
        "determinant": each if stride else (math.nan,) * len(each),
        "symplectic_defect": max(abs(d - 1) for d in between), "notes": tuple(dict.fromkeys(seen.notes)),
        "defect_ulp": max(float(np.max(np.abs(m.left) / m.unit[:, None])) for m in seen.maps) / 2,
    }  # fmt: skip


def _steps(stride: int | None) -> str:
    return (
        ", in an unknown number of steps"
        if stride is None
        else ""
        if stride == 1
        else f", {stride} steps to a frame"
    )


def _refuted(seen: Seen, *because: Explanation) -> Identification:
    n = len(seen.maps)
    return nothing(because, n, **_measured(seen, 1))


def said(seen: Seen, found: Found, one: Round) -> Identification:
    """The identification of the hypotheses that are left, found in a round."""
    joints = [x for x, _ in found]
    first = joints[0]
    if first.row.fault:
        return _of_a_fault(seen, joints)
    if first.row.free in ("theta", "beta", "stages"):
        return _of_a_parameter(seen, first)
    if one.growing:
        rate = first.parts[0].g * first.stride / float(seen.record.interval)
        cause = (
            f"{titles([first.row.scheme])} with a negative friction, c/m = {rate:.4g}, which feeds energy in"
        )
        return _refuted(seen, Explanation(cause, "look at the sign of the friction", local=True))
    if one.scale:
        return _of_a_scale(seen, joints)
    if (
        seen.stiffness is not None
        and not any(seen.off(x) <= 0 for x in joints)
        and seen.record.mass is not None
    ):
        return _on_another_spring(seen, found)
    if seen.friction is not None and not any(seen.agrees(x) for x in joints):
        return of_another_friction(seen, joints)
    return _named(seen, found)


def _of_a_fault(seen: Seen, joints: list[Joint]) -> Identification:
    texts = {capital(x.row.fault): x for x in joints[:3]}
    first = joints[0]
    text = "; or ".join(texts)
    if first.row.free == "first":
        share = first.parts[0].g / (1 - first.parts[0].g)
        text += f": the first has {share:.6g} times the force of the second"
    elif seen.off(first) > 0:
        text += f", but of a spring {seen.ratio(first):.6g} times as stiff as stated"
    cause = f"{text}{_steps(first.stride)}"
    return _refuted(seen, Explanation(cause, first.row.remedy, local=True))


def _of_a_scale(seen: Seen, joints: list[Joint]) -> Identification:
    """Velocities of another scale than any scheme's."""
    meant = [(x, text) for x in joints if (text := factors.of_velocities(seen, x))]
    meant = [y for y in meant if seen.off(y[0]) <= 0] or meant
    if meant:
        causes = [f"{titles([x.row.scheme])}{_steps(x.stride)}, but {text}" for x, text in meant[:2]]
        remedy = "look at the units, and at where the mass and the step enter"
        return _refuted(seen, Explanation("; or ".join(causes), remedy, local=True))
    kind = kind_of_map(seen.maps[0])
    each = "; ".join(f"{x.row.title}: {math.exp(x.parts[0].log_scale):.6g}" for x in joints[:4])
    cause = kind or f"Schemes that would fit if velocities were multiplied: {each}"
    return _refuted(seen, Explanation(cause, "state the stiffness and the mass", local=True))


def _law(joints: list[Joint]) -> str:
    laws = {x.row.law for x in joints}
    if len(laws) == 1 and joints[0].row.law:
        return f" with {joints[0].row.law}"
    return (
        " with friction"
        if all(x.row.damped for x in joints)
        else " with or without friction" * (any(x.row.damped for x in joints))
    )


def _on_another_spring(seen: Seen, found: Found) -> Identification:
    """Schemes that would fit on another spring than the stated one."""
    joints = [x for x, _ in found]
    meant = [x for x in joints if factors.of_stiffness(seen, x)] or joints[:1]
    if meant[0].row.scheme == "exact" and abs(seen.ratio(meant[0]) - 1) < OF_AN_ERROR:
        # a scheme of high order is the exact solution of a spring that is off by its error
        return _refuted(seen, Explanation(kind_of_map(seen.maps[0]) or ONE_MAP, COMPARE, local=True))
    causes = []
    for x in meant[:3]:
        ratio, text = seen.ratio(x), factors.of_stiffness(seen, x)
        stiff = (
            f"{ratio:.9g} times as stiff as stated"
            if abs(ratio - 1) > 1e-6
            else f"stiffer by {ratio - 1:+.1e}"
        )
        causes.append(
            f"{titles([x.row.scheme])}{_law([x])}{_steps(x.stride)}, but of a spring {stiff}"
            f"{f': {text}' if text else ''}"
        )
    remedy = UNITS if abs(seen.ratio(meant[0]) - 1) > 1e-2 else ""
    if seen.ratio(meant[0]) < 0:
        remedy = "look at the sign of the force, F = -k q, and of the kick, p + h F"
    because = Explanation("; or ".join(dict.fromkeys(causes)), remedy, local=True)
    candidates = tuple(candidate(seen, x) for x in joints)
    fine = seen.record.fine
    omega, stiffness, friction = _numbers(seen, joints[0])
    return replace(
        _refuted(seen, because), candidates=() if fine else candidates, nearest=joints[0].row.scheme,
        omega=omega, stiffness=stiffness, friction=friction,
    )  # fmt: skip


def of_another_friction(seen: Seen, joints: list[Joint]) -> Identification:
    """Schemes that fit with another friction than the stated one, or in other steps."""
    first, m = joints[0], seen.record.mass
    if seen.stride is not None and not any(x.stride == seen.stride for x in joints):
        return _refuted(seen, _of_other_steps(seen, joints))
    rate = first.parts[0].g * first.stride / abs(float(seen.record.interval))
    c = rate * (1.0 if m is None else float(m[seen.moving[0]]))
    whose = f"{titles(x.row.scheme for x in joints)}{_steps(first.stride)}"
    if not first.row.damped:
        cause = f"{whose}, but without friction, where c = {seen.friction:g} is stated"
    elif not seen.friction:
        cause = f"{whose}, but with a friction, c = {c:.6g} where 0 is stated"
    else:
        share = c / seen.friction / (first.parts[0].g * first.stride)
        every = sorted(share * x.parts[0].g * x.stride for x in joints)
        alike = every[-1] - every[0] < 1e-4 * every[0]
        where = "" if alike else f" ({every[0]:.3g} to {every[-1]:.3g} by where it acts)"
        cause = f"{whose}, but with a friction {c / seen.friction:.4g} times the stated{where}"
    remedy = "look at the unit of the friction, c or c/m, and at how often a step applies it"
    return _refuted(seen, Explanation(cause, remedy, local=True))


def _of_other_steps(seen: Seen, joints: list[Joint]) -> Explanation:
    each = " or ".join(dict.fromkeys(str(x.stride) for x in joints[:3]))
    wanted = "no whole number" if seen.stride == -1 else str(seen.stride)
    whose = titles(x.row.scheme for x in joints)
    cause = f"{whose}, {each} steps to a frame, where the stated step gives {wanted}"
    return Explanation(cause, "look at the stated step", local=True)


def _of_a_parameter(seen: Seen, x: Joint) -> Identification:
    part, h = x.parts[0], abs(float(seen.record.interval)) / x.stride
    if x.row.free == "stages":
        twice = abs(part.g / h - 1) < 1e-6
        how = "h twice in its stages: they take h**2 k, not h k" if twice else (
            f"stages of {part.g:.6g} times their steps")  # fmt: skip
        return _refuted(seen, Explanation(f"RK4 with {how}", COMPARE, local=True))
    method = f"{x.row.title} with {x.row.free} = {part.g:.6g}"
    cause = f"{ONE_MAP}: if every step was recorded, {MAP_OF}{method}"
    return _refuted(seen, Explanation(cause, "", local=True))


def _named(seen: Seen, found: Found) -> Identification:
    """The scheme that the states show, or those that they leave."""
    joints = [x for x, _ in found]
    first, precision = found[0]
    fine = seen.record.fine
    candidates = tuple(candidate(seen, x) for x in joints)
    names, strides = list(dict.fromkeys(x.scheme for x in candidates)), {x.stride for x in candidates}
    stride = first.stride if len(strides) == 1 else None
    law, steps = _law(joints), _steps(stride) if len(strides) == 1 else ""
    # many small steps of one scheme come near those of another
    unsure = first.stride > (1 if first.row.scheme in ELSEWHERE else FEW[-1] if seen.stride is None else 999)
    # and so they do where the step may be rounded to single precision beside its times
    unsure = unsure or (first.parts[0].log_scale != 0 and not (seen.record.vague or seen.record.momenta))
    hedge = "" if fine and not unsure else OR_UNKNOWN
    kind, comma, stored = precision.partition(", stored")
    arithmetic = f"rounding to {precision.replace('text, ', '')}"
    if kind in ("double", "single"):
        arithmetic = f"{kind} arithmetic{comma}{stored}{',' * bool(comma)}"
    fields = {**_measured(seen, stride), "precision": precision or UNTOLD, "candidates": candidates}
    fields |= _shared(candidates)
    fields["notes"] = (*fields["notes"], *_of_the_law(candidates))
    if seen.stride is not None and not any(
        x.stride == seen.stride or x.row.scheme == "exact" for x in joints
    ):
        return _refuted(seen, _of_other_steps(seen, joints))
    if len(names) == 1:
        scheme = names[0]
        leap = f" (or {LEAPFROG[scheme]})" if scheme in LEAPFROG else ""
        whose = title(scheme)
        alike = [x.fault for x in FAULTS if scheme in ELSEWHERE and same(x, first.row)]
        leap = f" (on a spring also {alike[0]})" if alike else leap
        if scheme == HELD.scheme:
            whose = _held(first)
            if not whose and not fine:
                vague = 12 * first.parts[0].g_error > FEW_SUBSTEPS
                return Identification(
                    verdict="not told apart", fits=not vague, undecided=vague, **fields,
                    statement=f"{title(scheme)}, of which there are many, or {OLD_FORCE}{steps}{hedge}",
                )  # fmt: skip
            if not whose:
                cause = f"{OLD_FORCE}{steps}"
                return _refuted(
                    seen, Explanation(cause, "compute the force anew after the drift", local=True)
                )
        return Identification(
            verdict="named", scheme=scheme, aliases=candidates[0].aliases, nearest=scheme, fits=True,
            statement=f"{whose}{leap}{law}{steps}{hedge}: {arithmetic} explains every step",
            velocity_offset=OFFSET.get(scheme, 0.0), **fields,
        )  # fmt: skip
    undecided = not fine and len({bool(x.law) for x in candidates}) > 1
    few = f"Several schemes fit, which the states do not tell apart: {titles(names)}"
    return Identification(
        verdict="not told apart", statement=f"{few}{law}{steps}{hedge}; {arithmetic} explains every step",
        fits=not undecided, undecided=undecided, **fields,
    )  # fmt: skip


def _of_the_law(candidates: tuple[Candidate, ...]) -> tuple[str, ...]:
    """Note on the friction rate under each law that it may follow; empty without friction."""
    rates = dict.fromkeys(f"{x.friction[0]:.6g} by {x.law}" for x in candidates if x.law)
    each = "; ".join(list(rates)[:6])
    return (f"the law of the friction is an assumption: c/m is {each}",) if rates else ()


def _held(x: Joint) -> str:
    """Words for a constant force, with its number of substeps; "" where it is constant over a whole step."""
    share, error = x.parts[0].g, 12 * x.parts[0].g_error + 1e-9
    off = abs(2 * share - 1)
    if off < max(error, 1 / 64):
        return ""
    order = "kick, then drift" if share > 0.5 else "drift, then kick"
    return f"Semi-implicit Euler with one force for {round(1 / off)} substeps ({order})"


def _shared(candidates: tuple[Candidate, ...]) -> dict[str, Any]:
    """Numbers that all candidates share to a relative 1e-9."""

    def alike(rows: list[Any]) -> Any:
        same = np.allclose(rows, rows[0], rtol=1e-9, atol=0, equal_nan=True)
        return rows[0] if same else (math.nan,) * len(rows[0])

    known = candidates[0].stiffness is not None
    return {
        "step": _common([x.step for x in candidates]) or math.nan,
        "stride": _common([x.stride for x in candidates]),
        "omega": alike([x.omega for x in candidates]), "friction": alike([x.friction for x in candidates]),
        "stiffness": alike([x.stiffness or () for x in candidates]) if known else None,
    }  # fmt: skip


def answer(seen: Seen, joints: list[Joint]) -> Identification:
    """The hypotheses that are left, as an identification."""
    return _named(seen, [(x, UNTOLD) for x in joints])


def unnamed(seen: Seen, *because: Explanation) -> Identification:
    """The identification where no hypothesis is left, and why."""
    return _refuted(seen, *because)


def either_way(back: Identification | None, turned: Identification | None) -> Identification:
    """Frames whose times fall: steps back in time, or frames in reverse order, or either."""
    ways = [x for x in (back, turned) if x is not None]
    fitting = [x for x in ways if x.fits and all(rate >= 0 for y in x.candidates for rate in y.friction)]
    if len(fitting) < 2 or (fitting[0].scheme and fitting[0].scheme == fitting[1].scheme):
        return fitting[0] if fitting else ways[-1] if ways[0].fits else ways[0]
    forth, over = (titles(x.scheme for x in one.candidates) for one in fitting)
    return replace(
        fitting[0], verdict="not told apart", scheme=None, aliases=(), nearest=None, step=math.nan,
        candidates=tuple(x for one in fitting for x in one.candidates), velocity_offset=math.nan,
        statement=f"Times fall: steps of {forth} back in time, or frames of {over} in reverse order",
    ).noting("what would tell the two apart: the step, with its sign")  # fmt: skip
