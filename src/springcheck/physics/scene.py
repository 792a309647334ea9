"""A scene: the particles, the terms of the Hamiltonian, the start, the time grid, and what is recorded."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, cast, get_args

import numpy as np

from springcheck.errors import SceneError, nearest
from springcheck.physics.arguments import of_kind
from springcheck.physics.arrays import Integers
from springcheck.physics.bath import Bath
from springcheck.physics.distance import Distances
from springcheck.physics.exact.solution import SolvedSystem
from springcheck.physics.fields import Kind, Quantity, SceneFields, Units
from springcheck.physics.term import Term, check_sign, frozen
from springcheck.physics.terms import in_order

MOST_STEPS = 2**53
"""Number of steps up to which every integer is a double, so that t = i h is distinct."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene(SceneFields):
    """A system, its initial state, its time grid, and what is recorded.

    Arrays are stored as read-only copies.  An invalid value raises SceneError, also in `dataclasses.replace`.
    `digest` identifies a scene, and `to_toml` writes it as a scene file.

    >>> Scene(m=[2.0], q=[0.0], p=[1.0], step=0.1, steps=100)
    Scene('scene', 1 particle, free, 100 steps of 0.1)
    """

    def __post_init__(self) -> None:
        for field, value in _checked(self):
            object.__setattr__(self, field, value)
        for term in (x for x in self.terms if isinstance(x, Distances)):
            term.check_start(self.q)

    def __repr__(self) -> str:
        terms = ", ".join(f"{len(term)} {term.key}" for term in self.terms) or "free"
        return f"Scene({self.name!r}, {self.size}, {terms}, {self.stepping})"

    @cached_property
    def system(self) -> SolvedSystem[Scene]:
        """Quantities derived from the scene: forces, energies, modes and the like, each computed once."""
        return SolvedSystem(self)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of all numbers of the scene; its texts, list of methods and signs of zeros do not count."""
        total = hashlib.sha256()
        known = (self.kind, self.units, self.step, self.steps, self.every, self.tolerance, *self.quantities)
        total.update(repr(known).encode())
        if self.places is not None:
            total.update(self.places.astype("<i8").tobytes())
        if self.bath:
            total.update(repr(self.bath).encode())
        for values in (self.m, self.q, self.p):
            total.update((values + 0.0).astype("<f8").tobytes())
        for term in self.terms:
            total.update(repr((term.key, term.fast, len(term))).encode())
            for index in term.particles:
                total.update(index.astype("<i8").tobytes())
            for column in term.columns:
                total.update((getattr(term, column.field) + 0.0).astype("<f8").tobytes())
        return total.hexdigest()

    def to_toml(self) -> str:
        """The scene as the text of a scene file, which reads back with exactly the same numbers."""
        from springcheck.physics.scenefile.writing import text

        return text(self.system)

    def replace(self, **changes: Any) -> Scene:
        """A copy with other values of these fields: ``scene.replace(step=0.05, steps=400)``.

        SceneError for an unknown field, or an invalid value.
        """
        known = [field.name for field in fields(self)]
        for name in changes:
            if name not in known:
                raise SceneError(f"a Scene has no {name!r}{nearest(name, known)}; it has {', '.join(known)}")
        return replace(self, **changes)


def _checked(scene: Scene) -> Iterator[tuple[str, Any]]:
    """The validated fields of a scene in their types.  Raises SceneError, which begins with the field."""
    n: int | None = None
    for field, sign in (("m", "positive"), ("q", "any"), ("p", "any")):
        values = frozen(getattr(scene, field), np.float64, n, field)
        n = len(values)
        if n == 0:
            raise SceneError("m: at least one particle is needed")
        check_sign(values, sign, field)
        yield field, values
    assert n is not None
    places = _places(scene)
    yield "places", places
    terms = _terms(scene.terms, n, places)
    yield "terms", terms
    steps, every = _whole(scene.steps, "steps"), _whole(scene.every, "every")
    if steps > MOST_STEPS:
        raise SceneError(f"steps = {steps}: at most 2**53 = {MOST_STEPS} are distinct in t = i h")
    if steps % every:
        raise SceneError(
            f"every = {every}: steps = {steps} is no multiple of it, so the end would not be recorded"
        )
    yield from (("steps", steps), ("every", every))
    yield "step", _step(scene.step, steps)
    tolerance = float(of_kind("tolerance", scene.tolerance, "float"))
    if not 0 < tolerance < 1:
        raise SceneError(f"tolerance = {tolerance}: a number between 0 and 1 is needed")
    yield "tolerance", tolerance
    for field, known in (("units", get_args(Units)), ("kind", get_args(Kind))):
        given = getattr(scene, field)
        if not isinstance(given, str) or given not in known:
            raise SceneError(f"{field} = {given!r:.60}: one of {', '.join(known)} is needed")
    if scene.kind == "circuit" and scene.units != "si":
        raise SceneError(
            f"units = {scene.units!r}: a circuit is given in H, F, Ohm, C and Wb; leave units out"
        )
    if scene.bath is not None:
        if not isinstance(scene.bath, Bath):
            raise SceneError(f"bath = {scene.bath!r}: a springcheck.physics.bath.Bath is needed")
        if scene.step < 0:
            raise SceneError(f"step = {scene.step}: a bath acts forwards in time only")
        if any(term.key == "damping" for term in scene.terms):
            raise SceneError("bath: it has a friction of its own; leave [[damping]] out")
    yield "quantities", _quantities(scene.quantities)
    include = scene.include if isinstance(scene.include, tuple | list) else ()
    if not include or not all(isinstance(one, str) and one for one in include):
        raise SceneError(f"include = {scene.include!r}: labels or globs of methods are needed")
    yield "include", tuple(include)
    for field in ("name", "title", "source", "include"):
        _check_text(getattr(scene, field), field)
    yield "title", scene.title or scene.name


def _places(scene: Scene) -> Integers | None:
    """The places of the coordinates, None where they are those that None implies."""
    if scene.places is None:
        return None
    n = len(scene.m)
    places = cast("Integers", frozen(scene.places, np.int64, n, "places"))
    if scene.kind != "particles":
        raise SceneError(f"places: a {scene.kind} has no axes; leave them out")
    if len(np.unique(places)) < n or np.any(places < 0):
        raise SceneError("places: every coordinate needs one of its own, 3 particle + axis, from 0 on")
    of = places // 3
    number = len(np.unique(of))
    if np.max(of) != number - 1 or np.any(np.diff(of) < 0):
        raise SceneError(f"places: particles 0 to {number - 1} need a coordinate each, one after the other")
    mass = np.zeros(number)
    mass[of] = scene.m
    if np.any(mass[of] != scene.m):
        raise SceneError("m: the coordinates of one particle need one mass")
    return None if np.array_equal(places, 3 * np.arange(n)) else places


def _terms(given: Any, n: int, places: Integers | None) -> tuple[Term, ...]:
    if not isinstance(given, tuple | list) or not all(isinstance(term, Term) for term in given):
        raise SceneError("terms: objects of springcheck.physics.terms are needed, such as WallSpring(...)")
    for term in given:
        term.check(n)
        of = [np.arange(0) if places is None else places[index] for index in term.particles]
        if len({tuple(x % 3) for x in of}) > 1:
            raise SceneError(f"{term.key}: its rows join coordinates along different axes")
    return in_order(given)


def _whole(value: Any, field: str) -> int:
    if (found := int(of_kind(field, value, "int"))) < 1:
        raise SceneError(f"{field} = {value}: a whole number >= 1 is needed")
    return found


def _step(given: Any, steps: int) -> float:
    step = float(of_kind("step", given, "float"))
    if step == 0 or not math.isfinite(step):
        raise SceneError(f"step = {step}: a step forwards (> 0) or backwards (< 0) is needed")
    if not math.isfinite(step * steps):
        raise SceneError(f"step = {step}: {steps} of them go beyond the largest number")
    return step


def _quantities(given: Any) -> tuple[str, ...]:
    known = get_args(Quantity)
    found = tuple(given) if isinstance(given, tuple | list) else (given,)
    unknown = [one for one in found if not isinstance(one, str) or one not in known]
    if unknown:
        raise SceneError(f"quantities: {unknown[0]!r} is none of {', '.join(known)}")
    if not {"q", "p"} <= set(found):
        raise SceneError('quantities needs "q" and "p"; "energy" may be left out')
    # each once, in a fixed order
    return tuple(one for one in known if one in found)


def _check_text(given: Any, field: str) -> None:
    wanted = "a text of printable characters" if field == "name" else "a text without unpaired surrogates"
    for text in given if isinstance(given, tuple) else (given,):
        right = isinstance(text, str) and not any("\ud800" <= c <= "\udfff" for c in text)
        if not right or (field == "name" and not (text and text.isprintable())):
            raise SceneError(f"{field} = {text!r}: {wanted} is needed")
