"""The engine contract: what an engine declares, and what a simulation does.

>>> leap = Method(name="leap", scheme="velocity-verlet", about="one function")
>>> Engine(name="mine", title="Mine", methods=named(leap), start=print, version=dict).methods["leap"].default
True
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib import import_module
from math import inf
from typing import Any, Protocol

from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.schemes import Scheme


class Need(Enum):
    """A feature that a scene must have for a method to be worth running; the value is the phrase for a
    report."""

    DAMPING = "damping"
    FAST_SPRINGS = "springs marked fast"

    def met_by(self, scene: Scene) -> bool:
        """Whether the scene has it."""
        if self is Need.DAMPING:
            return any(term.key == "damping" for term in scene.terms)
        return any(term.fast for term in scene.terms)


ANY_POTENTIAL = "any potential"
"""Among the terms of a method: it takes the force of every potential as a function."""

ANY_DISTANCE = "any distance"
"""Among the terms of a method: it takes the formula of every potential of a distance."""

EVERY_POTENTIAL = frozenset({ANY_POTENTIAL, "wall-spring", "spring", "quartic", "cosine", "morse", "weight"})
"""The terms of a method that takes the force as a function: the potentials that are known, and all others."""

EVERY_FORCE = EVERY_POTENTIAL | {"damping"}
"""The terms of a method whose force may also depend on the velocity."""

SPRINGS = frozenset({"wall-spring", "spring"})

DRIVEN = frozenset({"drive"})
"""The term of a method whose force may also depend on the time."""

BRAKES = frozenset({"van-der-pol"})
"""The term of a method whose friction may depend on the position."""

EVERY_KIND = frozenset({"particles", "circuit"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A method that an engine can run, as the engine declares it without its library being imported."""

    name: str
    scheme: str
    """A scheme of the catalogue, or one that the engine brings."""
    about: str
    """One line for `springcheck list`: which class or function of the library is called."""
    adaptive: bool = False
    """Whether it chooses its steps by the scene's tolerance; `scheme` then has no one-step map."""
    default: bool = True
    """Whether `*` includes it, which a scene runs by default.  Other methods are run by name, or by a glob
    that spells part of it."""
    terms: frozenset[str] = SPRINGS
    """Keys of the terms that it can evaluate."""
    kinds: frozenset[str] = frozenset({"particles"})
    """Kinds of scenes that it moves: particles, circuit."""
    requires: frozenset[Need] = frozenset()
    rebuilds_velocity: bool = False
    """The velocity is a difference of positions over the step, which costs digits: eps q / h."""
    one_friction: bool = False
    """Whether a single friction rate serves all particles of a run."""
    generator: str = ""
    """The random number generator of a random method, in words."""
    scripted: bool = False
    """Whether its seed may be a generator of one's own, an object with `standard_normal(size)`."""
    note: str = ""
    """A remark of the library's authors on a finding, and the thread where they made it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A method and where it runs: ``engine:method[@platform[-precision]]``."""

    engine: str
    method: str
    platform: str = ""
    precision: str = ""

    def __str__(self) -> str:
        place = "@" + self.platform if self.platform else ""
        return f"{self.engine}:{self.method}{place}{'-' + self.precision if self.precision else ''}"


class Simulation(Protocol):
    """A started engine.  It advances and does nothing else: the driver records, times and judges.

    An engine in three dimensions may have an attribute `off_axis`, the largest magnitude of a coordinate
    along axes that the scene leaves out.  A text `note` becomes the message of a complete run.
    """

    @property
    def force_calls(self) -> int:
        """Number of force evaluations so far, as springcheck counts them."""
        ...

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q [L] and p [M L/T], both (f, n): row i is the state `every` steps after row i-1, at one time.

        Raises `Stopped` if the engine stops by itself; the rows before stay filled.
        """
        ...


class Stopped(Exception):  # noqa: N818 - an outcome, not an error
    """An engine gave up after filling some rows.

    Parameters
    ----------
    rows, message
        Number of rows that it had filled, and why it stopped.
    fastest
        The largest speed that it gives a body [L/T], where that is the reason.
    is_limit
        Whether it stopped at a limit of its own, which the message names.
    """

    def __init__(self, rows: int, message: str, *, fastest: float = inf, is_limit: bool = False) -> None:
        super().__init__(message)
        self.rows, self.fastest, self.is_limit = rows, fastest, is_limit or fastest < inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """An engine, declared without its library being imported: only `start` and `version` may do that."""

    name: str
    """Also the name of its entry point."""
    title: str
    methods: Mapping[str, Method] = field(default_factory=dict)
    """By name; see `named`."""
    start: Callable[..., Simulation]
    """start(scene, method, label, step): the engine in the initial state.  The step [T] may be negative.
    For a random method it takes the keyword `seed` too."""
    version: Callable[[], Mapping[str, str]]
    """Versions of the library and of its own dependencies, by name."""
    arithmetic: Callable[[Label], Arithmetic] = lambda label: Arithmetic()
    """How the library rounds: double precision throughout by default."""
    convention: Callable[[Method], str] = lambda method: "synchronised"
    """How the library stores velocities, as a phrase for the report."""
    thermostats: Mapping[str, Method] = field(default_factory=dict)
    """Random methods by name, for scenes with a bath; their schemes are those of `springcheck.bath`."""
    distribution: str = ""
    """Its library's name on the package index, or "" where it needs none."""
    reference: str = ""
    """The publication that its authors ask to be cited."""
    module: str = ""
    """The module whose absence means that the library is missing; the name of the distribution by default."""
    extra: str = ""
    """The extra of springcheck that installs the library, where there is one."""
    platforms: tuple[str, ...] = ()
    """Platforms and precisions that a label may name, as `platform` or `platform-precision`."""
    schemes: tuple[Scheme, ...] = ()
    """Schemes that are not in the catalogue."""
    atlas: tuple[str, ...] = ()
    """Methods on platforms, as `method@platform`, that the atlas of extremes measures next to the methods."""
    squares_lengths: bool = False
    """Forces come from the lengths of bonds, roots of squares, and 1/m and 1/h are formed: half of the
    exponent range is left."""
    any_axis: bool = False
    """Whether it also moves particles along y and z: it then reads `Scene.where`."""

    @property
    def install(self) -> str:
        """The command that installs the library."""
        what = f"'springcheck[{self.extra}]'" if self.extra else self.distribution
        return f"python -m pip install {what}"

    @property
    def imports(self) -> str:
        """The module that must be there, or ""."""
        return self.module or self.distribution.replace("-", "_")


def by_default(
    name: str, scheme: str, about: str, terms: frozenset[str], *needs: Need, **more: Any
) -> Method:
    """A method of these terms and needs; `more` are further fields of `Method`."""
    return Method(name=name, scheme=scheme, about=about, terms=terms, requires=frozenset(needs), **more)


def by_name(name: str, scheme: str, about: str, terms: frozenset[str], *needs: Need, **more: Any) -> Method:
    """A method of these terms and needs that is run by its name alone, never by default."""
    return by_default(name, scheme, about, terms, *needs, default=False, **more)


def thermostat(
    name: str, scheme: str, about: str, generator: str, terms: frozenset[str], **more: Any
) -> Method:
    """A random method, with what draws its numbers."""
    return Method(name=name, scheme=scheme, about=about, terms=terms, generator=generator, **more)


def named(*methods: Method) -> dict[str, Method]:
    """Methods by name, as `Engine` takes them."""
    return {method.name: method for method in methods}


def version_of(module: str, name: str = "") -> Callable[[], dict[str, str]]:
    """The function `version` of a library with a `__version__`, under the name of its module or another."""
    return lambda: {name or module: str(import_module(module).__version__)}


def installed_version(distribution: str) -> Callable[[], dict[str, str]]:
    """The function `version` of a library that does not report it, from its installed metadata."""

    def version() -> dict[str, str]:
        from importlib import metadata

        return {distribution: metadata.version(distribution)}

    return version


def deferred(module: str, *more: str) -> dict[str, Any]:
    """`start`, `version` and more functions of a module that is imported when the first of them is called."""

    def of(name: str) -> Callable[..., Any]:
        def call(*arguments: object, **options: object) -> Any:
            return getattr(import_module(module), name)(*arguments, **options)

        return call

    return {name: of(name) for name in ("start", "version", *more)}
