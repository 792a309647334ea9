"""A scene: the particles, the terms of the Hamiltonian, the start, the time grid, and what is recorded."""

from __future__ import annotations

import hashlib
import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy as np
from numpy.typing import NDArray

from springcheck.errors import SceneError, nearest
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.bath import Bath
from springcheck.physics.system import System
from springcheck.physics.term import Term, check_sign, frozen, refrozen
from springcheck.physics.terms import in_order

Kind: TypeAlias = Literal["particles", "circuit", "rotor"]
Units: TypeAlias = Literal["reduced", "md", "si"]
Quantity: TypeAlias = Literal["q", "p", "energy"]

MOST_STEPS = 2**53
"""Numbers of steps up to which each is a double of its own, so that t = i h tells them apart."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """What is to be simulated: a system, its start, its time grid, and what is asked of it.

    Making one, or changing one by `dataclasses.replace`, raises SceneError where it makes no sense.  Arrays
    are kept as read-only copies.  Its identity is `digest`, and `to_toml` writes it as a scene file.
    """

    m: Floats
    """Masses, > 0 (n,) [M]."""
    q: Floats
    """Positions at the start (n,) [L]."""
    p: Floats
    """Momenta at the start (n,) [M L/T]."""
    places: Integers | None = None
    """Where each coordinate stands among x, y and z of all particles (n,): 3 particle + axis.  Arrays (n,)
    hold a number for each coordinate.  None where each particle has one, along x."""
    terms: tuple[Term, ...] = ()
    """One of each kind, in the order of `terms.known`; terms of one kind are joined."""
    step: float
    """Step [T], < 0 for a run backwards in time."""
    steps: int
    every: int = 1
    """Every how many steps a frame is recorded; it divides `steps`."""
    box: tuple[float, float, float] | None = None
    """Lengths of a periodic box along x, y and z [L], where every spring is that of the nearest images of its
    ends; None without one.  Positions are counted on across its borders, so that no motion changes."""
    bath: Bath | None = None
    """The heat bath, which only random methods have; None where the motion is deterministic."""
    tolerance: float = 1e-12
    """Relative tolerance per step of adaptive solvers."""
    units: Units = "reduced"
    kind: Kind = "particles"
    include: tuple[str, ...] = ("*",)
    """Labels or globs of the methods to run."""
    quantities: tuple[str, ...] = ("q", "p", "energy")
    """What is recorded: q and p, and the energy unless it is left out."""
    name: str = "scene"
    title: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        for field, value in _checked(self):
            object.__setattr__(self, field, value)
        if self.system.rods:
            self.system.rods.check(self.q, self.p)

    def __repr__(self) -> str:
        terms = ", ".join(f"{len(term)} {term.key}" for term in self.terms) or "free"
        steps = f"{self.steps} step{'s' if self.steps != 1 else ''} of {self.step:g}"
        return f"Scene({self.name!r}, {self.size}, {terms}, {steps})"

    @property
    def n(self) -> int:
        """Number of coordinates: of particles, where each moves along one axis."""
        return len(self.m)

    @property
    def particles(self) -> int:
        """Number of particles."""
        return self.n if self.places is None else int(np.max(self.places)) // 3 + 1

    @property
    def size(self) -> str:
        """How many particles there are, and along which axes they move where that is not x, in words."""
        particles = f"{self.particles} particle{'s' if self.particles != 1 else ''}"
        along = ", ".join(self.axes[:-1]) + " and " * (len(self.axes) > 1) + self.axes[-1]
        return particles if self.places is None else f"{particles} along {along}"

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes along which something moves, of x, y and z."""
        return ("x",) if self.places is None else tuple("xyz"[i] for i in np.unique(self.places % 3))

    @property
    def all_places(self) -> Integers:
        """Where each coordinate stands (n,), as `places`, also where these are left out."""
        return 3 * np.arange(self.n) if self.places is None else self.places

    @property
    def masses(self) -> Floats:
        """The mass of each particle (particles,) [M]."""
        found = np.empty(self.particles)
        found[self.all_places // 3] = self.m
        return found

    @property
    def where(self) -> slice | Integers:
        """The coordinates among x, y and z of all particles, as an index of an array (3 particles,)."""
        return slice(0, 3 * self.n, 3) if self.places is None else self.places

    @cached_property
    def elsewhere(self) -> NDArray[np.bool_]:
        """Which of x, y and z of all particles (3 particles,) are no coordinates of the scene."""
        left = np.ones(3 * self.particles, dtype=bool)
        left[self.where] = False
        return left

    @property
    def periods(self) -> Floats:
        """The length of the box along the axis of each coordinate, 0 without a box (n,) [L]."""
        if self.box is None:
            return np.zeros(self.n)
        return np.array(self.box)[self.all_places % 3]

    @property
    def frames(self) -> int:
        """Number of recorded states, the start among them."""
        return self.steps // self.every + 1

    @property
    def thermal(self) -> float:
        """The thermal energy kT of the bath [M L2/T2]; 0 without one."""
        return self.bath.thermal(self.units) if self.bath else 0.0

    @cached_property
    def system(self) -> System:
        """What follows from the scene: forces, energies, modes and the like, each worked out once."""
        return System(self)

    @cached_property
    def digest(self) -> str:
        """The scene's identity: sha256 of all its numbers, and of no word about them.

        Equal for scenes that no method can tell apart: name, title, source and the list of methods do not
        count, nor does the sign of a zero.
        """
        total = hashlib.sha256()
        known = (self.kind, self.units, self.step, self.steps, self.every, self.tolerance, *self.quantities)
        total.update(repr(known).encode())
        if self.places is not None:
            total.update(self.places.astype("<i8").tobytes())
        if self.box:
            total.update(repr(("box", *self.box)).encode())
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

    @cached_property
    def _toml(self) -> str:
        from springcheck.physics.scenefile.writing import text

        return text(self)

    def to_toml(self) -> str:
        """The scene as a scene file, written from its numbers: read back it has exactly the same ones."""
        return self._toml

    def replace(self, **changes: Any) -> Scene:
        """A scene that is like this one but for these fields: ``scene.replace(step=0.05, steps=400)``.

        SceneError where there is no such field, or a value makes no sense.
        """
        known = [field.name for field in fields(self)]
        for name in changes:
            if name not in known:
                raise SceneError(f"a Scene has no {name!r}{nearest(name, known)}; it has {', '.join(known)}")
        return replace(self, **changes)

    def derived(self, **changes: Any) -> Scene:
        """Like `replace`, for numbers that follow from a scene's own and are not checked again.

        They may be inf, where an engine of single precision would keep them so.
        """
        twin = object.__new__(type(self))
        twin.__dict__.update(self.__getstate__(), **changes)
        return twin

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        refrozen(self, state)


def _checked(scene: Scene) -> Iterator[tuple[str, Any]]:
    """The fields of a scene in the types in which it keeps them.  Raises SceneError, the field first."""
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
    yield "box", _box(scene, terms)
    steps, every = _whole(scene.steps, "steps"), _whole(scene.every, "every")
    if steps > MOST_STEPS:
        raise SceneError(f"steps = {steps}: at most 2**53 = {MOST_STEPS} can be told apart in t = i h")
    if steps % every:
        raise SceneError(
            f"every = {every}: steps = {steps} is no multiple of it, so the end would not be recorded"
        )
    yield from (("steps", steps), ("every", every))
    yield "step", _step(scene.step, steps)
    tolerance = _real(scene.tolerance, "tolerance")
    if not 0 < tolerance < 1:
        raise SceneError(f"tolerance = {tolerance}: a number between 0 and 1 is needed")
    yield "tolerance", tolerance
    for field, known in (("units", get_args(Units)), ("kind", get_args(Kind))):
        if getattr(scene, field) not in known:
            raise SceneError(f"{field} = {getattr(scene, field)!r}: one of {', '.join(known)} is needed")
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


def _places(scene: Scene) -> Integers | None:
    """The places of the coordinates, None where they are what None stands for."""
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


def _box(scene: Scene, terms: tuple[Term, ...]) -> tuple[float, ...] | None:
    """The three lengths of the box, in which springs alone may act."""
    if scene.box is None:
        return None
    try:
        lengths = tuple(np.atleast_1d(np.asarray(scene.box, np.float64)).tolist())
    except (TypeError, ValueError):
        lengths = ()
    if len(lengths) not in (1, 3) or not all(isinstance(x, float) and 0 < x < math.inf for x in lengths):
        raise SceneError(f"box = {scene.box!r}: a length > 0, or three of them, is needed")
    if scene.kind != "particles" or scene.bath is not None:
        raise SceneError("box: it is for particles, without a bath")
    for term in terms:
        if term.key not in BOXED:
            raise SceneError(f"box: a {term.key} has no nearest image; {', '.join(BOXED)} have")
    return lengths * (3 // len(lengths))


BOXED = ("wall-spring", "spring", "damping")
"""Terms that a box may hold."""


def _terms(given: Any, n: int, places: Integers | None) -> tuple[Term, ...]:
    if not isinstance(given, tuple | list) or not all(isinstance(term, Term) for term in given):
        raise SceneError("terms: objects of springcheck.physics.terms are needed, such as WallSpring(...)")
    for term in given:
        term.check(n)
        if term.kind == "magnetic" and (
            places is None
            or np.any(np.diff([x // 3 for x in (places[index] for index in term.particles)], axis=0))
        ):
            raise SceneError(f"{term.key}: it turns velocities in the plane of two axes of one particle")
        if (
            term.kind != "magnetic"
            and places is not None
            and len({tuple(places[index] % 3) for index in term.particles}) > 1
        ):
            raise SceneError(f"{term.key}: its rows join coordinates along different axes")
    return in_order(given)


def _whole(value: Any, field: str) -> int:
    try:
        found = operator.index(value)
    except TypeError:
        found = 0
    if found < 1 or isinstance(value, bool):
        raise SceneError(f"{field} = {value}: a whole number >= 1 is needed")
    return found


def _real(value: Any, field: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{field} = {value!r}: a number is needed") from None


def _step(given: Any, steps: int) -> float:
    step = _real(given, "step")
    if step == 0 or not math.isfinite(step):
        raise SceneError(f"step = {step}: a step forwards (> 0) or backwards (< 0) is needed")
    if not math.isfinite(step * steps):
        raise SceneError(f"step = {step}: {steps} of them go beyond the largest number")
    return step


def _quantities(given: Any) -> tuple[str, ...]:
    known = get_args(Quantity)
    found = tuple(given) if isinstance(given, tuple | list) else (given,)
    unknown = [one for one in found if one not in known]
    if unknown:
        raise SceneError(f"quantities: {unknown[0]!r} is none of {', '.join(known)}")
    if not {"q", "p"} <= set(found):
        raise SceneError('quantities needs "q" and "p"; "energy" may be left out')
    # each once, and in one order
    return tuple(one for one in known if one in found)


def _check_text(given: Any, field: str) -> None:
    for text in (given,) if isinstance(given, str) else given if isinstance(given, tuple) else (None,):
        try:
            right = text.isprintable() or field != "name"
            text.encode()
        except (AttributeError, UnicodeEncodeError):
            right = False
        if not right or (field == "name" and not text):
            raise SceneError(f"{field} = {text!r}: a text is needed, without halves of characters")
