"""The engines: ours, those of installed packages, and those that a call brings.  Libraries are not imported.

An engine is one object, an `Engine`, that an entry point of the group `springcheck.engines` names; ours stand
in modules here.  README.md beside this file shows how to write one.  An engine that cannot be loaded is named
in one line where engines are listed or asked for, and affects no other.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from fnmatch import fnmatchcase
from functools import cache, partial
from typing import Any, TypeVar

from springcheck import schemes
from springcheck.bath import THERMOSTATS
from springcheck.engines.contract import (
    ANY_DISTANCE,
    ANY_POTENTIAL,
    BRAKES,
    DRIVEN,
    EVERY_FORCE,
    EVERY_POTENTIAL,
    Engine,
    Label,
    Method,
    Need,
    Simulation,
    Stopped,
    named,
)  # fmt: skip
from springcheck.engines.registry import (
    OURS,
    bring,
    engine,
    foreign,
    from_file,
    is_brought,
    module_name,
    module_of,
    names,
    origin,
    unusable,
    while_here,
)  # fmt: skip
from springcheck.errors import MOST_LIKELY, EngineError, MethodError, nearest, told
from springcheck.physics.arrays import Arithmetic, Floats
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Distances

__all__ = [
    "ANY_DISTANCE", "ANY_POTENTIAL", "BRAKES", "UNNAMED", "DRIVEN", "EVERY_FORCE", "EVERY_POTENTIAL", "OURS",
    "Arithmetic", "Engine", "Label", "Method", "Need", "Simulation", "Started", "Stopped", "absence",
    "bring", "engine",
    "foreign", "from_file", "guarded", "installed_version", "is_brought", "load", "match", "method",
    "module_name", "module_of", "named", "names", "obstacle", "origin", "parse", "refusal",
    "unusable", "while_here",
]  # fmt: skip

T = TypeVar("T")


def absence(name: str) -> str | None:
    """Why an engine's library is missing, or None where it is installed; imports nothing."""
    found = engine(name)
    try:
        there = not found.imports or importlib.util.find_spec(found.imports) is not None
    except (ImportError, ValueError):
        there = False
    return None if there else f"{found.title} is not installed; install it with: {found.install}"


def installed_version(name: str) -> str:
    """Version of an engine's library, from its installed metadata; of its package where it needs none."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(engine(name).distribution or origin(name).package)
    except (PackageNotFoundError, ValueError):
        return "" if is_brought(name) else "unknown"


def load(name: str) -> Engine:
    """An engine whose library can be imported.  MethodError, with the reason, where it cannot."""
    found = engine(name)
    reason = absence(name)
    if reason:
        raise MethodError(reason)
    with foreign(f"engine {name!r}: its version() failed"):
        try:
            said = _imported(found.version)
        except ImportError as error:
            raise EngineError(f"engine {name!r}, {found.title}, cannot be imported: {told(error)}") from error
    if not isinstance(said, dict):
        kind = type(said).__name__
        raise EngineError(f"engine {name!r}: its version() returned {kind}, not a dict of names and versions")
    return found


@cache
def _imported(version: Callable[[], object]) -> object:
    """Import a library where it is imported first: in its engine's `version`."""
    return version()


def guarded(label: Label, call: Callable[..., T], *arguments: object, form: str = "") -> T:
    """Call into an engine.  Whatever it raises becomes an EngineError, with its file and line.

    So does the way in which the engine has ended an earlier process of this command (see `foreign`).  `form`
    is the call as the contract writes it, for the message where a function takes other arguments.
    """
    with foreign(f"{label} failed", origin(label.engine).package):
        try:
            return call(*arguments)
        except TypeError as error:
            # the call itself failed: no line of the engine was reached
            if form and error.__traceback__ and error.__traceback__.tb_next is None:
                raise EngineError(f"{label} failed: {error}; it is called as {form}") from error
            raise
        finally:
            _reopened()


def _reopened() -> None:
    """Reopen standard streams that an engine has closed, before a file of ours takes their descriptors."""
    for stream, other in ((1, 2), (2, 1)):
        try:
            os.fstat(stream)
        except OSError:
            with suppress(OSError):
                os.dup2(other, stream)


def arithmetic(label: Label) -> Arithmetic:
    """The rounding that the engine of a label declares.  MethodError where its own code fails."""
    driver = load(label.engine)
    found: object = guarded(label, driver.arithmetic, label, form="arithmetic(label)")
    if not isinstance(found, Arithmetic):
        raise EngineError(f"{label} failed: its arithmetic is of type {type(found).__name__}")
    return found


class Started:
    """A simulation at a scene's start: what its engine raises is an EngineError, what it reports is checked.

    `seed` is that of a random method: a number, or a generator where the method takes one.  Raises
    MethodError, with the reason, where it cannot start.
    """

    def __init__(self, scene: Scene, label: Label, seed: Any = None) -> None:
        self.label, self._engine, self._method = label, load(label.engine), method(label)
        seeded = {"seed": seed} if self._method.generator else {}
        form = f"start(scene, method, label, step{', seed=seed' if seeded else ''})"
        begin = partial(self._engine.start, **seeded)
        self.simulation = guarded(label, begin, scene, self._method, label, scene.step, form=form)
        for name in ("advance", "force_calls"):
            if not hasattr(self.simulation, name):
                kind = type(self.simulation).__name__
                raise EngineError(f"{label} failed: its start returned {kind}, which has no {name}")

    @property
    def origin(self) -> dict[str, str]:
        """Provenance in words: the engine's versions, title, method, and how it stores velocities."""
        versions = guarded(self.label, self._engine.version)
        how = guarded(self.label, self._engine.convention, self._method, form="convention(method)")
        said = {"engine": self._engine.title, "method": self._method.about, "velocity": str(how)}
        return {**{str(key): str(value) for key, value in versions.items()}, **said}

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill rows; `Stopped` passes through."""
        guarded(self.label, self.simulation.advance, every, q, p, form="advance(every, q, p)")

    @property
    def force_calls(self) -> int:
        """Force evaluations so far."""
        return self._reported("force_calls", "a whole number of calls", _count)

    @property
    def off_axis(self) -> float | None:
        """The largest |coordinate| along axes that the scene leaves out, where the engine looks at them."""
        seen = getattr(self.simulation, "off_axis", None) is not None
        return self._reported("off_axis", "a number", float) if seen else None

    def _reported(self, name: str, what: str, taken: Callable[[Any], T]) -> T:
        said: Any = guarded(self.label, lambda: getattr(self.simulation, name))
        try:
            return taken(said)
        except (TypeError, ValueError, OverflowError):
            raise EngineError(f"{self.label}: its {name} is {said!r:.60}, not {what}") from None


def _count(said: Any) -> int:
    whole = int(said)
    if whole != said or not 0 <= whole < 2**63:
        raise ValueError
    return whole


def parse(text: str) -> Label:
    """Parse ``engine:method[@platform[-precision]]``; an unknown part is answered with those that are
    known."""
    head, _, place = text.partition("@")
    name, colon, method = head.partition(":")
    if not colon:
        labels = [f"{one}:{m}" for one in names() for m in engine(one).methods]
        if not name and place:
            at = next((f"{x}@{p}" for x in labels for p in engine(x.partition(":")[0]).platforms
                       if p.lower() == place.lower()), "openmm:verlet@CPU")  # fmt: skip
            raise MethodError(f"method {text!r}: a platform goes with a method, as {at}")
        raise MethodError(
            f"method {text!r} is not of the form engine:method[@platform[-precision]]{nearest(name, labels)}"
        )
    found = engine(name)
    every = {**found.methods, **found.thermostats}
    if method not in every:
        known = ", ".join(f"{name}:{m}" for m in every)
        so_called = [f"{name}:{m}" for m, one in every.items() if one.scheme in schemes.textbook(method)]
        so_called = so_called or [f"{x}:{method}" for x in names() if method in engine(x).methods]
        likely = " or ".join(so_called[:MOST_LIKELY])
        near = f", did you mean {likely}?" if likely else nearest(method, every, f"{name}:")
        raise MethodError(f"unknown method {text!r}{near}; {found.title} has {known}")
    if "@" in text and place not in found.platforms:
        known, near = ", ".join(found.platforms), nearest(place, found.platforms, f"{name}:{method}@")
        has = f"has: {known}" if known else f"has no platforms: {name}:{method} is all"
        raise MethodError(f"unknown platform {place!r} in {text!r}{near}; {found.title} {has}")
    platform, _, precision = place.partition("-")
    return Label(engine=name, method=method, platform=platform, precision=precision)


def method(label: Label) -> Method:
    """The declaration behind a label."""
    found = engine(label.engine)
    return found.methods.get(label.method) or found.thermostats[label.method]


def _methods_meant(name: str, glob: str, bath: bool | None, every: bool) -> list[str]:
    """The methods of an engine that a glob may match: all if `every`, else the default ones unless the
    glob names methods."""
    found, meant = engine(name), list[str]()
    for of_bath, methods in ((False, found.methods), (True, found.thermostats)):
        if bath in (None, of_bath):
            default = [m for m, declared in methods.items() if declared.default]
            all_of_them = every or (glob != "*" and (not default or glob.rpartition(":")[2] != "*"))
            meant += methods if all_of_them else default
    return meant


UNNAMED = "**"
"""Pattern of what runs where nobody names a method: a scene's own list, or `*`."""


def match(patterns: Iterable[str], *, bath: bool | None = False, every: bool = False) -> tuple[Label, ...]:
    """Labels that glob patterns match, each once, in the order of the engines.

    A pattern without a wildcard is a label and may name a platform.  With a wildcard the part before `@` is
    the glob and the platform is carried over to every engine that has it.  With a `bath` it matches
    thermostats, without one none of them, and both where that is None.  `*` alone stands for the methods that
    are declared as default, and so does `engine:*` of an engine that has such; every other glob stands for
    all that it matches, and with `every`, as in an argument, these two do as well.
    """
    chosen: dict[str, Label] = {}
    for pattern in patterns:
        head, at, place = ("*" if pattern == UNNAMED else pattern).partition("@")
        if not any(c in head for c in "*?["):
            chosen[pattern] = parse(pattern)
            continue
        found = [
            f"{name}:{m}{at}{place}"
            for name in names(head.partition(":")[0] if ":" in head else "*")
            for m in _methods_meant(name, head, bath, every and pattern != UNNAMED)
            if fnmatchcase(f"{name}:{m}", head) and (not at or place in engine(name).platforms)
        ]
        if not found:
            where = "" if bath is None else f" for a scene with{'' if bath else 'out'} a bath"
            raise MethodError(f"no method matches {pattern!r}{where}; `springcheck list` shows them all")
        chosen.update((text, parse(text)) for text in found)
    return tuple(chosen.values())


PLURAL = {"particles": "particles", "circuit": "circuits"}


def obstacle(scene: Scene, label: Label) -> str | None:
    """Why a method cannot run a scene here: it cannot serve it, or its library is not installed."""
    return refusal(scene, label) or absence(label.engine)


def refusal(scene: Scene, label: Label) -> str | None:
    """Why a method cannot serve a scene, or None where it can; imports nothing."""
    what = method(label)
    if scene.bath and not what.generator:
        if is_brought(label.engine):
            return (
                "it declares no noise, and the scene has a bath: add your thermostat with --engine, or let "
                "`springcheck identify` find friction and kT in its states"
            )
        own = [parse(f"{label.engine}:{name}") for name in engine(label.engine).thermostats]
        able = [str(one) for one in own if refusal(scene, one) is None]
        mine, more = engine(label.engine).title, f" and {len(able) - 3} more" if len(able) > 3 else ""
        serve = f"{mine} has no thermostat for it"
        if able:
            serve = f"the thermostats of {mine} are {', '.join(able[:3])}{more}"
        return f"{what.scheme} has no noise, and the scene has a bath; {serve}"
    if (what.generator or what.scheme in THERMOSTATS) and not scene.bath:
        return "it is a thermostat, for scenes with a bath: --temperature or [bath] gives one"
    of_bath = THERMOSTATS[what.scheme] if what.generator else None
    if of_bath and of_bath.rescales and of_bath.draws and not any(scene.p):
        return "it multiplies all momenta by one factor, and all initial momenta are 0"
    if of_bath and scene.bath and not scene.bath.friction * scene.step < of_bath.most:
        x = scene.bath.friction * scene.step
        return f"from friction * step = {of_bath.most:g} it is no thermostat, and friction * step is {x:.6g}"
    if scene.kind not in what.kinds:
        moved = " and ".join(PLURAL[kind] for kind in sorted(what.kinds))
        others = {kind for other in engine(label.engine).methods.values() for kind in other.kinds}
        who = "it" if scene.kind in others else engine(label.engine).title
        return f"{who} moves {moved}, not {PLURAL[scene.kind]}"
    if scene.places is not None and not engine(label.engine).any_axis:
        return f"{engine(label.engine).title} is given particles along x here, and the scene has other axes"
    whole = ANY_POTENTIAL in what.terms, ANY_DISTANCE in what.terms
    unknown = (
        term for term in scene.terms
        if not (whole[0] and term.kind == "potential") and not (whole[1] and isinstance(term, Distances))
    )  # fmt: skip
    missing = sorted({term.key for term in unknown} - what.terms)
    if missing:
        return f"it has no {' and no '.join(missing)} term"
    needed = sorted(need.value for need in what.requires if not need.met_by(scene))
    if needed:
        return f"it is for scenes with {' and '.join(needed)}"
    if what.one_friction and not scene.system.has_one_friction_rate:
        rates = scene.system.friction_rates
        ranges = f"{float(rates.min()):.6g} to {float(rates.max()):.6g}"
        return f"it has one friction rate for all particles, and damping/mass ranges from {ranges}"
    return None
