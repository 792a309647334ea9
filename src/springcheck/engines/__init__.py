"""The engines: what each can do, known without importing its library, and the one lazy import.

An engine is a folder here.  Its `__init__` states as data what it can do and imports nothing foreign;
its `simulation` imports the library plainly at the top and offers::

    def version() -> dict[str, str]: ...        # library and what it stands on
    def start(scene: Scene, method: Method, label: Label, step: float) -> Simulation: ...
    def arithmetic(label: Label) -> Arithmetic: ...
    def convention(method: Method) -> str: ...  # how velocities are stored and synchronised

A new engine is a new folder; nothing else needs an edit.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from typing import Protocol, cast

from springcheck.engines.contract import ANY_POTENTIAL, Arithmetic, Label, Method, Simulation
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """What an engine says of itself."""

    name: str
    title: str
    distribution: str
    """Its library's name on the package index, or "" for our own."""
    module: str
    """The module whose absence means that the library is missing."""
    methods: Mapping[str, Method]
    platforms: tuple[str, ...] = ()
    """Platforms and precisions that a label may name, as `platform` or `platform-precision`."""

    @property
    def install(self) -> str:
        """The command that installs the library."""
        return f"python -m pip install {self.distribution}"


class Driver(Protocol):
    """The module `simulation` of an engine."""

    def version(self) -> dict[str, str]: ...

    def start(self, scene: Scene, method: Method, label: Label, step: float) -> Simulation: ...

    def arithmetic(self, label: Label) -> Arithmetic: ...

    def convention(self, method: Method) -> str: ...


@cache
def names() -> tuple[str, ...]:
    """Names of all engines, our own first."""
    found = [m.name for m in pkgutil.iter_modules(__path__) if m.ispkg]
    return tuple(sorted(found, key=lambda name: (name != "own", name)))


@cache
def engine(name: str) -> Engine:
    """What an engine says of itself; imports nothing foreign."""
    if name not in names():
        raise MethodError(f"unknown engine {name!r}; known are {', '.join(names())}")
    return cast(Engine, importlib.import_module(f"{__name__}.{name}").ENGINE)


def absence(name: str) -> str | None:
    """Why an engine's library is not here, or None where it is; imports nothing."""
    found = engine(name)
    if not found.distribution or importlib.util.find_spec(found.module) is not None:
        return None
    return f"{found.title} is not installed; install it with: {found.install}"


def installed_version(name: str) -> str:
    """Version of an engine's library, from its installed metadata."""
    distribution = engine(name).distribution or "springcheck"
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def load(name: str) -> Driver:
    """Import an engine with its library.  Only a missing foreign module is reported as missing."""
    found = engine(name)
    try:
        return cast(Driver, importlib.import_module(f"{__name__}.{name}.simulation"))
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == "springcheck":
            raise
        reason = absence(name) or f"{found.title} cannot be imported: {error}"
        raise MethodError(reason) from error


def parse(text: str) -> Label:
    """Read ``engine:method[@platform[-precision]]``; says what is known where a part is not."""
    head, _, place = text.partition("@")
    name, colon, method = head.partition(":")
    if not colon:
        raise MethodError(f"method {text!r} is not of the form engine:method[@platform[-precision]]")
    found = engine(name)
    if method not in found.methods:
        known = ", ".join(f"{name}:{m}" for m in found.methods)
        raise MethodError(f"unknown method {text!r}; {found.title} has {known}")
    if "@" in text and place not in found.platforms:
        known = ", ".join(found.platforms) or "none"
        raise MethodError(f"unknown platform {place!r} in {text!r}; {found.title} has: {known}")
    platform, _, precision = place.partition("-")
    return Label(engine=name, method=method, platform=platform, precision=precision)


def method(label: Label) -> Method:
    """The declaration behind a label."""
    return engine(label.engine).methods[label.method]


def match(patterns: tuple[str, ...]) -> tuple[Label, ...]:
    """Labels that glob patterns name, each once, in the order of the engines.

    A pattern without a wildcard is a label and may name a platform.  With a wildcard the part before
    `@` is the glob and the platform is carried over to every engine that has it.
    """
    chosen: dict[str, Label] = {}
    for pattern in patterns:
        head, at, place = pattern.partition("@")
        if not any(c in head for c in "*?["):
            chosen[pattern] = parse(pattern)
            continue
        found = [
            f"{name}:{m}{at}{place}"
            for name in names()
            for m in engine(name).methods
            if fnmatchcase(f"{name}:{m}", head) and (not at or place in engine(name).platforms)
        ]
        if not found:
            raise MethodError(f"no method matches {pattern!r}; `springcheck list` shows them all")
        chosen.update((text, parse(text)) for text in found)
    return tuple(chosen.values())


PLURAL = {"particles": "particles", "circuit": "circuits", "rotor": "rotors"}


def refusal(scene: Scene, label: Label) -> str | None:
    """Why a method cannot serve a scene, or None where it can; imports nothing."""
    what = method(label)
    if scene.kind not in what.kinds:
        moved = " and ".join(PLURAL[kind] for kind in sorted(what.kinds))
        others = {kind for other in engine(label.engine).methods.values() for kind in other.kinds}
        who = "it" if scene.kind in others else engine(label.engine).title
        return f"{who} moves {moved}, not {PLURAL[scene.kind]}"
    unknown = (term for term in scene.terms if not (term.is_potential and ANY_POTENTIAL in what.terms))
    missing = sorted({term.key for term in unknown} - what.terms)
    if missing:
        return f"it has no {' and no '.join(missing)} term"
    here = {term.key for term in scene.terms}
    if any(term.fast for term in scene.terms):
        here.add("springs marked fast")
    needed = sorted(what.requires - here)
    if needed:
        return f"it is for scenes with {' and '.join(needed)}"
    return None
