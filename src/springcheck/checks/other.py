"""The one number of a scene, or the one frame, that is another than it should be where steps are off.

Of each number the value is sought by which all steps are the scheme's own: Newton's method on the sum of
squares of what the steps miss.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import combinations, product
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.checks import sight
from springcheck.checks.case import Case
from springcheck.checks.requires import MAP, missing
from springcheck.physics.arrays import Extended, Floats, Integers
from springcheck.physics.scene import Scene
from springcheck.physics.term import Term
from springcheck.text.wording import either

VALUE_STEPS = 8
"""Newton steps to a value: a force is proportional to its strength, and bends with lengths."""
VALUE_SLACK = 2.0
"""Bounds that steps keep by the value found: one of the engine's roundings, one of what these do to it."""
SQUARES_FALL = 4.0
"""Factor by which the squares of what steps miss have to fall from one Newton step to the next."""
MOST_ALONE = 16
"""Rows of a term, or masses, that are looked at one by one, and in pairs: those whose steps are farthest
off."""
NEAR_SINGLE = 2.0**-40
"""Relative distance from a number's single precision, 2**-24 off it at most, within which a value is that."""
SAME = "each step is the scheme's own"

Number: TypeAlias = tuple[str, float, float, Callable[[float], Case]]
"""A number in words, its value, the least size of changes of it, and the case where it has another value."""


def found(case: Case) -> str:
    """The cause in one sentence, or "" where neither one number nor one frame explains the states."""
    if missing(case, MAP) or case.ahead is None or case.scene.kind != "particles":
        return ""
    case = case.clocked
    with np.errstate(all="ignore"):
        values = ((name, own, _value(case, own, size, of)) for name, own, size, of in _numbers(case))
        shown = dict.fromkeys(_said(name, own, x) for name, own, x in values if x is not None)
        if shown:
            return f"{SAME} with another number, {either([*shown])}"
        return next(
            (f"{SAME} with {words}" for words, of in _exchanged(case) if _fits(case, of)), _frame(case)
        )


def _said(name: str, own: float, value: float) -> str:
    if not own or not value:
        return f"{name}: {value:.6g}, not {own:.6g}"
    digits, kept = 3 - int(np.floor(np.log10(abs(value / own - 1)))), float(np.float32(own))
    single = ", as in single precision" if own != kept and abs(value / kept - 1) < NEAR_SINGLE else ""
    return f"{name}: {value:.{max(6, min(17, digits))}g}, not {own:.15g}{single}"


def _off(case: Case, unit: Extended, at: Integers) -> Extended:
    """What the steps after these frames miss, in bounds (2, r, n), but for a clock."""
    run, n = case.trajectory, case.scene.n - case.scene.system.is_driven
    ends = np.stack(sight.ends(case, at)) - np.stack([run.q[at + 1], run.p[at + 1]])
    return np.asarray(np.where(unit[:, at] > 0, ends / unit[:, at], 0)[..., :n])


def _value(case: Case, own: float, size: float, of: Callable[[float], Case]) -> float | None:
    """The value of a number by which all steps are the scheme's own, or None."""
    assert case.ahead is not None
    unit, every = case.roundings * case.ahead.allowance, np.arange(len(case.trajectory.t) - 1)
    at, x, left = sight.rows(case, len(every)), own, np.inf
    for _ in range(VALUE_STEPS):
        change, here = sight.CHANGE * max(abs(x), size), _off(of(x), unit, at)
        slope = (_off(of(x + change), unit, at) - here) / change
        # what roundings, all of the sign that hurts, do to the value
        error = VALUE_SLACK * float(np.sum(np.abs(slope)) / np.sum(slope * slope))
        if not SQUARES_FALL * np.sum(here * here) < left:
            break
        left, x = np.sum(here * here), x - float(np.sum(here * slope) / np.sum(slope * slope))
    if not (np.max(np.abs(here)) <= VALUE_SLACK and abs(x - own) > error):
        return None
    return (x if abs(x) > error else 0.0) if _fits(case, of(x)) else None


def _with(case: Case, number: int, field: str, values: Floats) -> Case:
    """The case with other numbers in a field of a term."""
    terms: list[Any] = list(case.judged.terms)
    terms[number] = replace(terms[number], **{field: values})
    return sight.of_scene(case, case.judged.derived(terms=tuple(terms)))


def _heavier(case: Case, m: Floats) -> Case:
    """The case with other masses of its coordinates (n,), a clock's apart; none is below 0."""
    scene = case.judged
    return sight.of_scene(case, scene.derived(m=np.append(np.where(m > 0, m, np.nan), scene.m[len(m) :])))


def _quicker(case: Case, m: Floats) -> Case:
    """The same, of a program that keeps velocities, from which momenta were made by the scene's masses."""
    there = _heavier(case, m)
    p = case.trajectory.p * (there.scene.m / case.judged.m)
    return replace(there, trajectory=replace(there.trajectory, p=p))


def _fits(case: Case, other: Case) -> bool:
    """Whether all steps are the scheme's own in another case."""
    assert case.ahead is not None
    unit, every = case.roundings * case.ahead.allowance, np.arange(len(case.trajectory.t) - 1)
    # some of them tell nearly all others
    parts = sight.rows(case, len(every)), every
    return all(np.max(np.abs(_off(other, unit, at))) <= VALUE_SLACK for at in parts)


def _exchanged(case: Case) -> Iterator[tuple[str, Case]]:
    """Cases in which two particles have exchanged their masses, or two rows of a term a number."""
    scene, n, off = case.judged, case.judged.n - case.judged.system.is_driven, _off_by(case)
    of = scene.all_places[:n] // 3
    kinds: list[tuple[str, Floats, Callable[[Floats], Case], Integers, Floats]] = [
        ("masses of particles", scene.m[:n], partial(way, case), of, off) for way in (_heavier, _quicker)
    ]
    for number, term in enumerate(scene.terms):
        least = np.min([off[ends] for ends in term.particles], axis=0)
        for column, rows in product(term.columns, _wholes(scene, term)):
            words = f"numbers ({column.name}) of {term.key.removeprefix('wall-')}s"
            changed = partial(_with, case, number, column.field)
            if column.field != term.shared:
                kinds.append((words, term.arrays[column.field], changed, rows, least))
    for words, numbers, other, rows, least in kinds:
        for i, j in combinations(sorted(_farthest(rows, least)), 2):
            mine, its = numbers[rows == i], numbers[rows == j]
            if len(mine) == len(its) and np.any(mine != its):
                swapped = numbers.copy()
                swapped[rows == i], swapped[rows == j] = its, mine
                yield f"the {words} {i} and {j} exchanged", other(swapped)


def _wholes(scene: Scene, term: Term) -> list[Integers]:
    """Numbers of the whole of each row of a term (s,): that of its axis alone, and of all its axes."""
    ends = np.stack([scene.all_places[one] // 3 for one in term.particles])
    bodies = np.unique(ends, axis=1, return_inverse=True)[1].ravel()
    return [term.groups, bodies][: 1 + (len({*bodies}) < len({*term.groups}))]


def _off_by(case: Case) -> Floats:
    """How far the steps of each coordinate are off at most, in bounds (n,); of a clock not at all."""
    assert case.ahead is not None
    at = sight.rows(case, len(case.trajectory.t) - 1)
    off = np.max(np.abs(_off(case, case.roundings * case.ahead.allowance, at)), axis=(0, 1))
    return np.pad(off.astype(np.float64), (0, case.scene.n - len(off)))


def _farthest(rows: Integers, off: Floats) -> list[int]:
    """The wholes of rows (s,) that are farthest off, each by its own farthest."""
    most = np.zeros(int(np.max(rows, initial=-1)) + 1)
    np.maximum.at(most, rows, off[: len(rows)])
    return [int(i) for i in np.argsort(-most, kind="stable")[:MOST_ALONE]]


def _numbers(case: Case) -> Iterator[Number]:
    """The numbers of a scene, each by itself, and those of one kind together by a factor."""
    run, scene, off = case.trajectory, case.judged, _off_by(case)
    n, of = scene.n - scene.system.is_driven, [str(j // 3) for j in scene.all_places]
    reach = float(np.max(np.ptp(run.q[:, :n], axis=0)))
    for number, term in enumerate(scene.terms):
        ends = [dict.fromkeys(of[j] for j in row) for row in zip(*term.particles, strict=True)]
        where = [f"particle{'s' if len(one) > 1 else ''} {' and '.join(one)}" for one in ends]
        least = np.min([off[x] for x in term.particles], axis=0)
        for column, rows in product(term.columns, _wholes(scene, term)):
            place = column.field == term.origin and term.bodies == 1
            kind = f"{'place' if place else column.name} of the {term.key.removeprefix('wall-')}"
            if column.field != term.shared:
                numbers, other = term.arrays[column.field], partial(_with, case, number, column.field)
                power = -1 if column.inverse else 1
                yield from _each(kind, " of ", numbers, other, where, rows, least, reach, power)

    if sum(term.kind == "potential" for term in scene.terms) > 1:
        yield "a factor to every force", 1.0, 0.0, lambda x: sight.of_scene(case, scene.system.scaled(x))

    bodies = scene.all_places[:n] // 3
    where = [f"particle {one}" for one in bodies]
    for words, way in ((" of ", _heavier), (" that divides the force on ", _quicker)):
        yield from _each("mass", words, scene.m[:n], partial(way, case), where, bodies, off)
    yield "the step", run.step, 0.0, lambda x: sight.changed(case, "step", x / run.step - 1)


def _each(
    kind: str, of: str, numbers: Floats, other: Callable[[Floats], Case], where: list[str],
    rows: Integers, off: Floats, size: float = 0.0, power: int = 1,
) -> Iterator[Number]:  # fmt: skip
    """The numbers (s,) of a kind, one for each whole of rows, and how far these are off; `power` is -1 where
    a scene file has their inverse."""

    def changed(here: NDArray[np.bool_], x: float) -> Case:
        return other(np.where(here, x**power, numbers))

    for whole in sorted(_farthest(rows, off)):
        here = rows == whole
        first = int(np.argmax(here))
        if np.ptp(numbers[here]) == 0:
            own = float(numbers[first]) ** power
            yield f"the {kind}{of}{where[first]}", own, size, partial(changed, here)
    if len(np.unique(rows)) > 1:
        yield f"a factor to each {kind}", 1.0, 0.0, lambda x: other(numbers * x**power)


def _frame(case: Case) -> str:
    """The one frame from which on states are a step too late or too early, or ""."""
    assert case.ahead is not None
    run, unit = case.trajectory, case.roundings * case.ahead.allowance
    off = np.flatnonzero(~np.all(np.abs(_off(case, unit, np.arange(len(run.t) - 1))) <= 1, axis=(0, 2)))
    if len(off) != 1 or run.every > 1:
        return ""
    i, states = int(off[0]), np.stack([run.q, run.p])
    if np.array_equal(states[:, i], states[:, i + 1]):
        return f"{SAME}, but frame {i + 1} is the one before it once more"
    twice = np.stack(case.step(*case.step(*states[:, i : i + 1].astype(np.longdouble))))
    missed = np.all(np.abs(twice - states[:, i + 1 : i + 2]) <= VALUE_SLACK * unit[:, i : i + 1])
    return f"{SAME}, but a frame is missing before frame {i + 1}" if missed else ""
