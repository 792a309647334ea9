"""The one number of a scene that is another than it should be where steps are wrong.

Of each number the value is sought by which all steps are the scheme's own: Newton's method on the sum of
squares of what the steps miss.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from springcheck.checks import sight
from springcheck.checks.case import Case
from springcheck.checks.requires import MAP, missing
from springcheck.physics.arrays import Extended, Floats, Integers
from springcheck.text.wording import either

VALUE_STEPS = 8
"""Newton steps to a value: a force is proportional to its strength, and bends with lengths."""
VALUE_SLACK = 2.0
"""Bounds that steps keep by the value found: one of the engine's roundings, one of what these do to it."""
SQUARES_FALL = 4.0
"""Factor by which the squares of what steps miss have to fall from one Newton step to the next."""
MOST_ALONE = 16
"""Objects of a term, or particles, that are looked at one by one, and in pairs: those farthest off."""
MOST_NUMBERS = 1 << 13
"""Coordinates times steps between frames up to which numbers are sought, and those of all frames by which."""
NEAR_SINGLE = 2.0**-40
"""Relative distance from a number's single precision, 2**-24 off it at most, within which a value is that."""

Number: TypeAlias = tuple[str, float, float, Callable[[float], Case]]
"""A number in words, its value, the least size of changes of it, and the case where it has another value."""

Rows: TypeAlias = tuple[str, NDArray[np.bool_]]
"""Some of a term's rows, or of the coordinates (s,), in words."""


@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """The numbers (s,) of one kind in a scene, and the case that has others."""

    name: str
    of: str
    numbers: Floats
    other: Callable[[Floats], Case]
    off: Floats
    """How far the steps of each row's coordinates are off at most (s,), in bounds."""
    objects: list[Rows]
    """Rows that have one number: of a particle, or of a spring or bond, along all axes."""
    alone: Sequence[Rows] = ()
    """Single rows of them, where they may have each its own."""
    size: float = 0.0

    def changed(self, here: NDArray[np.bool_] | None, x: float) -> Case:
        """The case with the number x in some rows, or with a factor x to all."""
        return self.other(self.numbers * x if here is None else np.where(here, x, self.numbers))

    def farthest(self, rows: Sequence[Rows]) -> list[Rows]:
        """Those that are farthest off."""
        most = np.array([np.max(self.off[here]) for _, here in rows])
        return [rows[i] for i in sorted(np.argsort(-most, kind="stable")[:MOST_ALONE])]


def found(case: Case) -> str:
    """That number with both of its values, or "" where no one number explains the states."""
    cost = case.scene.n * case.trajectory.every
    if missing(case, MAP) or cost > MOST_NUMBERS or case.ahead is None or case.scene.kind != "particles":
        return ""
    case = case.clocked
    with np.errstate(all="ignore"):
        values = ((name, own, _value(case, own, size, of)) for name, own, size, of in _numbers(case))
        return either([*dict.fromkeys(_said(name, own, x) for name, own, x in values if x is not None)])


def _said(name: str, own: float, value: float) -> str:
    if not own or not value:
        # -0 is 0
        return f"{name}: {value:.6g}, not {own + 0.0:.6g}"
    digits, kept = 3 - int(np.floor(np.log10(abs(value / own - 1)))), float(np.float32(own))
    single = ", as in single precision" if own != kept and abs(value / kept - 1) < NEAR_SINGLE else ""
    return f"{name}: {value:.{max(6, min(17, digits))}g}, not {own:.15g}{single}"


def _off(case: Case, other: Case, at: Integers) -> Extended:
    """What the steps after these frames miss in another case (2, r, n), in bounds, but for a clock."""
    assert case.ahead is not None
    run, n = other.trajectory, case.scene.n - case.scene.system.is_driven
    unit = case.roundings * case.ahead.allowance[:, at]
    if run.p is not case.trajectory.p:
        # momenta that are made anew of velocities, and so are their bounds
        unit[1] *= other.judged.m / case.judged.m
    ends = np.stack(sight.ends(other, at)) - np.stack([run.q[at + 1], run.p[at + 1]])
    return np.asarray(np.where(unit > 0, ends / unit, 0)[..., :n])


def _value(case: Case, own: float, size: float, of: Callable[[float], Case]) -> float | None:
    """The value of a number by which all steps are the scheme's own, or None."""
    at, x, left = _rows(case), own, np.inf
    for _ in range(VALUE_STEPS):
        change, here = sight.CHANGE * max(abs(x), size), _off(case, of(x), at)
        slope = (_off(case, of(x + change), at) - here) / change
        # what roundings, all of the sign that hurts, do to the value
        error = VALUE_SLACK * float(np.sum(np.abs(slope)) / np.sum(slope * slope))
        if not SQUARES_FALL * np.sum(here * here) < left:
            break
        left, x = np.sum(here * here), x - float(np.sum(here * slope) / np.sum(slope * slope))
    if not (np.max(np.abs(here)) <= VALUE_SLACK and abs(x - own) > error):
        return None
    return (x if abs(x) > error else 0.0) if _fits(case, of(x)) else None


def _rows(case: Case) -> Integers:
    """A few frames, fewer of many particles."""
    at = sight.rows(case, len(case.trajectory.t) - 1)
    return at[:: max(1, len(at) * case.scene.n * case.trajectory.every // MOST_NUMBERS)]


def with_numbers(case: Case, number: int, field: str, values: Floats) -> Case:
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
    every = np.arange(len(case.trajectory.t) - 1)
    # some of them tell nearly all others
    parts = _rows(case), every
    return all(np.max(np.abs(_off(case, other, at))) <= VALUE_SLACK for at in parts)


def _kinds(case: Case) -> Iterator[Kind]:
    """The numbers of a scene."""
    run, scene = case.trajectory, case.judged
    n, places = scene.n - scene.system.is_driven, scene.all_places
    reach = float(np.max(np.ptp(run.q[:, :n], axis=0)))
    steps = sight.rows(case, len(run.t) - 1)
    off = np.pad(np.max(np.abs(_off(case, case, steps)), axis=(0, 1)).astype(np.float64), (0, scene.n - n))
    for number, term in enumerate(scene.terms):
        least = np.min([off[ends] for ends in term.particles], axis=0)
        objects = _objects(term.objects(places))
        alone = _alone(objects, places[term.particles[0]])
        for column in term.columns:
            place = column.field == term.origin and term.bodies == 1
            name = f"{'place' if place else column.name} of the {term.key.removeprefix('wall-')}"
            numbers = term.arrays[column.field]
            if numbers.dtype.kind == "f" and column.field != "number":
                of_axes = alone if term.is_by_axes or place else []
                other = partial(with_numbers, case, number, column.field)
                yield Kind(name, " of ", numbers, other, least, objects, of_axes, reach)
    objects = _objects([((int(place) // 3,), 1) for place in places[:n]])
    for of, way in ((" of ", _heavier), (" that divides the force on ", _quicker)):
        yield Kind("mass", of, scene.m[:n], partial(way, case), off[:n], objects)


def _objects(of: list[tuple[tuple[int, ...], int]]) -> list[Rows]:
    """The rows (s,) of each object, named by its particles."""
    found = []
    for one in dict.fromkeys(of):
        ends = [*dict.fromkeys(map(str, one[0]))]
        name = f"particle{'s' if len(ends) > 1 else ''} {' and '.join(ends)}"
        found.append((name, np.array([each == one for each in of])))
    return found


def _alone(objects: list[Rows], places: Integers) -> list[Rows]:
    """Each row of the objects that have several."""
    several = [(name, row) for name, here in objects if np.sum(here) > 1 for row in np.flatnonzero(here)]
    every = np.arange(len(places))
    return [(f"{name} along {'xyz'[places[row] % 3]}", every == row) for name, row in several]


def _numbers(case: Case) -> Iterator[Number]:
    """The numbers of a scene, each by itself, and those of one kind together by a factor."""
    run, scene = case.trajectory, case.judged
    for kind in _kinds(case):
        name, own = kind.name, kind.numbers
        for words, here in kind.farthest(kind.objects) + kind.farthest(kind.alone):
            if np.all(own[here] == own[here][0]):
                value = float(own[here][0])
                yield f"the {name}{kind.of}{words}", value, kind.size, partial(kind.changed, here)
        if len(kind.objects) > 1 or np.any(own != own[0]):
            yield f"a factor to each {name}", 1.0, 0.0, partial(kind.changed, None)
    if sum(term.kind == "potential" for term in scene.terms) > 1:
        yield "a factor to every force", 1.0, 0.0, lambda x: sight.of_scene(case, scene.system.scaled(x))
    yield "the step", run.step, 0.0, lambda x: sight.changed(case, "step", x / run.step - 1)
