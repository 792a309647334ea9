"""The engines: ours, those of installed packages, and those that a call brings.  Libraries are left alone.

An engine is one object, an `Engine`, that an entry point of the group `springcheck.engines` names.  Ours are
found the same way.  README.md beside this file shows how to write one.  An engine that cannot be loaded is
named in one line where engines are listed or asked for, and takes no other down.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from springcheck import schemes
from springcheck.engines.contract import (
    ANY_POTENTIAL,
    EVERY_POTENTIAL,
    Arithmetic,
    Engine,
    Label,
    Method,
    Need,
    Simulation,
    Stopped,
    named,
)
from springcheck.errors import MethodError, SpringcheckError, nearest, told
from springcheck.physics import terms
from springcheck.physics.scene import Scene

__all__ = [
    "ANY_POTENTIAL",
    "EVERY_POTENTIAL",
    "Arithmetic",
    "Engine",
    "GROUP",
    "OURS",
    "Label",
    "Method",
    "Need",
    "Origin",
    "Simulation",
    "Stopped",
    "absence",
    "bring",
    "brought",
    "engine",
    "from_file",
    "guarded",
    "installed_version",
    "internal_steps",
    "load",
    "match",
    "method",
    "named",
    "names",
    "origin",
    "parse",
    "refusal",
    "start",
    "unusable",
]

GROUP = "springcheck.engines"
"""The group of entry points by which engines are found."""

OURS = "springcheck"

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where an engine comes from: a package with its version, or a file."""

    package: str
    version: str

    def __str__(self) -> str:
        return f"{self.package} {self.version}".strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """An engine that is known by name: loaded where `engine` is there, unusable where `reason` is."""

    origin: Origin
    point: importlib.metadata.EntryPoint | None = None
    engine: Engine | None = None
    reason: str = ""


# engines that a call brings: a file's, a function, a command.  They live as long as the process, as an
# imported module does
_brought: dict[str, _Found] = {}


@cache
def _points() -> dict[str, _Found]:
    """Entry points by name, ours first; of two with one name the first counts."""
    found: dict[str, _Found] = {}
    points = sorted(
        importlib.metadata.entry_points(group=GROUP),
        key=lambda point: (point.dist is None or point.dist.name != OURS, point.name != "own", point.name),
    )
    for point in points:
        dist = point.dist
        origin = Origin(package=dist.name if dist else "?", version=dist.version if dist else "")
        if point.name not in found:
            found[point.name] = _Found(origin=origin, point=point)
        elif found[point.name].origin != origin:
            reason = f"its name is taken by the engine of {found[point.name].origin}"
            found[f"{point.name} ({origin.package})"] = _Found(origin=origin, reason=reason)
    return found


def _known() -> dict[str, _Found]:
    return _points() | _brought


@cache
def _loaded(point: importlib.metadata.EntryPoint) -> Engine | str:
    """The engine behind an entry point, or why there is none, whatever the code of others raises."""
    try:
        found = point.load()
        return _checked(found, point.name)
    except SpringcheckError as error:
        return str(error)
    except (Exception, SystemExit) as error:
        return f"{point.value} cannot be loaded: {told(error)}"


def _checked(found: object, name: str = "") -> Engine:
    """What claims to be an engine, if it keeps the contract.  Its schemes are then known."""
    if not isinstance(found, Engine):
        raise MethodError(f"it is of type {type(found).__name__}, not a springcheck.engines.Engine")
    if not isinstance(found.name, str) or not found.name.replace("-", "").replace("_", "").isalnum():
        raise MethodError(f"its name {found.name!r} must be of letters, digits, - and _")
    if name and found.name != name:
        raise MethodError(f"it calls itself {found.name!r}, and its entry point {name!r}")
    for what in ("start", "version", "arithmetic", "convention"):
        if not callable(getattr(found, what)):
            raise MethodError(f"its {what} is of type {type(getattr(found, what)).__name__}, not a function")
    if not found.methods:
        raise MethodError("it has no methods")
    for scheme in found.schemes:
        schemes.bring(scheme)
    for key, one in found.methods.items():
        if not isinstance(one, Method) or one.name != key:
            raise MethodError(f"its method {key!r} must be a springcheck.engines.Method of this name")
        scheme = schemes.scheme(one.scheme)
        if one.adaptive and scheme.one_step:
            raise MethodError(f"its method {key!r} is adaptive, but {scheme.title} has a fixed step")
    return found


def names() -> tuple[str, ...]:
    """Names of all engines that can be loaded, our own first."""
    return tuple(name for name in _known() if isinstance(_find(name), Engine))


def unusable() -> dict[str, str]:
    """Why each engine that is registered but cannot be used cannot, by name."""
    found = {name: (_find(name), one.origin) for name, one in _known().items()}
    return {
        name: f"engine {name} of {where} cannot be used: {what}"
        for name, (what, where) in found.items()
        if isinstance(what, str)
    }


def _find(name: str) -> Engine | str | None:
    """An engine, why it cannot be used, or None where there is none of this name."""
    found = _known().get(name)
    if found is None:
        return None
    if found.point is not None:
        return _loaded(found.point)
    return found.engine or found.reason


def engine(name: str) -> Engine:
    """What an engine says of itself; imports no library."""
    found = _find(name)
    if isinstance(found, Engine):
        return found
    if isinstance(found, str):
        raise MethodError(f"engine {name} of {origin(name)} cannot be used: {found}")
    if not _known():
        raise MethodError("no engine is registered, not even ours: install springcheck again, by pip install")
    known = names()
    raise MethodError(f"unknown engine {name!r}{nearest(name, known)}; known are {', '.join(known)}")


def origin(name: str) -> Origin:
    """The package or file that an engine comes from."""
    return _known()[name].origin


def bring(found: Engine, where: str, version: str = "") -> Engine:
    """Make an engine known for the rest of this process.  MethodError where it does not keep the contract."""
    found = _checked(found)
    taken = _points().get(found.name)
    if taken is not None:
        raise MethodError(f"{where}: the name {found.name!r} is taken by the engine of {taken.origin}")
    _brought[found.name] = _Found(origin=Origin(package=where, version=version), engine=found)
    return found


@contextmanager
def brought(found: Engine, where: str) -> Iterator[Engine]:
    """An engine that is known within this context only."""
    bring(found, where)
    try:
        yield found
    finally:
        del _brought[found.name]


def from_file(path: Path) -> Engine | None:
    """Bring the engine of a Python file: its one `Engine`, or the one that it calls ENGINE.

    None for a file that only registers terms.
    """
    before = terms.known()
    module = module_of(path)
    there = {id(x): x for x in vars(module).values() if isinstance(x, Engine)}
    found = getattr(module, "ENGINE", None) or next(iter(there.values()), None)
    if found is None and terms.known() != before:
        return None
    if found is None:
        raise MethodError(f"{path} has no engine: a springcheck.engines.Engine named ENGINE")
    try:
        # the file's digest stands for its version: runs of an older one are not taken up
        return bring(found, str(path), sha256(path.read_bytes()).hexdigest()[:12])
    except MethodError as error:
        text = str(error)
        raise MethodError(text if text.startswith(str(path)) else f"engine of {path}: {text}") from error


def module_of(path: Path) -> ModuleType:
    """A Python file as a module.  MethodError, with the line, where it cannot be run."""
    if not path.is_file():
        raise MethodError(f"{path}: there is no such file")
    spec = importlib.util.spec_from_file_location(f"springcheck_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise MethodError(f"{path} is not a Python file: its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise MethodError(f"{path} cannot be imported: {told(error, path)}") from error
    return module


def absence(name: str) -> str | None:
    """Why an engine's library is not here, or None where it is; imports nothing."""
    found = engine(name)
    try:
        there = not found.imports or importlib.util.find_spec(found.imports) is not None
    except (ImportError, ValueError):
        there = False
    return None if there else f"{found.title} is not installed; install it with: {found.install}"


def installed_version(name: str) -> str:
    """Version of an engine's library, from its installed metadata; of its package where it needs none."""
    found = engine(name)
    try:
        return importlib.metadata.version(found.distribution or origin(name).package)
    except (importlib.metadata.PackageNotFoundError, ValueError):
        return "" if name in _brought else "unknown"


def load(name: str) -> Engine:
    """An engine whose library can be imported.  MethodError, with the reason, where it cannot."""
    found = engine(name)
    reason = absence(name)
    if reason:
        raise MethodError(reason)
    try:
        _imported(found.version)
    except MethodError:
        raise
    except Exception as error:
        raise MethodError(f"{found.title} cannot be imported: {told(error)}") from error
    return found


def internal_steps(label: Label) -> Callable[..., Any]:
    """What an adaptive solver does on its way, counted.  MethodError where its engine cannot count."""
    counted = load(label.engine).internal_steps
    if counted is None:
        raise MethodError(f"{label}: its engine does not count internal steps")
    return counted


@cache
def _imported(version: Callable[[], object]) -> None:
    """Import a library once, where it first is: in the `version` of its engine."""
    version()


def guarded(label: Label, call: Callable[..., T], *arguments: object) -> T:
    """Call into an engine.  What goes wrong in it comes out as MethodError, with its file and line."""
    try:
        return call(*arguments)
    except (SpringcheckError, Stopped, MemoryError):
        raise
    except Exception as error:
        raise MethodError(f"{label} failed: {told(error, origin(label.engine).package)}") from error


def start(scene: Scene, label: Label) -> Simulation:
    """The engine of a label at the scene's start.  MethodError, with the reason, where it cannot start."""
    driver = load(label.engine)
    found: Simulation = guarded(label, driver.start, scene, method(label), label, scene.step)
    if not callable(getattr(found, "advance", None)):
        raise MethodError(f"{label} failed: its start returned {type(found).__name__}, which has no advance")
    return found


def parse(text: str) -> Label:
    """Read ``engine:method[@platform[-precision]]``; says what is known where a part is not."""
    head, _, place = text.partition("@")
    name, colon, method = head.partition(":")
    if not colon:
        raise MethodError(f"method {text!r} is not of the form engine:method[@platform[-precision]]")
    found = engine(name)
    if method not in found.methods:
        known = ", ".join(f"{name}:{m}" for m in found.methods)
        near = nearest(method, found.methods, f"{name}:")
        raise MethodError(f"unknown method {text!r}{near}; {found.title} has {known}")
    if "@" in text and place not in found.platforms:
        known = ", ".join(found.platforms) or "none"
        raise MethodError(f"unknown platform {place!r} in {text!r}; {found.title} has: {known}")
    platform, _, precision = place.partition("-")
    return Label(engine=name, method=method, platform=platform, precision=precision)


def method(label: Label) -> Method:
    """The declaration behind a label."""
    return engine(label.engine).methods[label.method]


def _methods_meant(name: str, glob: str) -> list[str]:
    """The methods of an engine that a glob may name: where it says nothing of methods, the default ones."""
    methods = engine(name).methods
    default = [m for m, declared in methods.items() if declared.default]
    all_of_them = glob != "*" and (not default or glob.rpartition(":")[2] != "*")
    return list(methods) if all_of_them else default


def match(patterns: tuple[str, ...]) -> tuple[Label, ...]:
    """Labels that glob patterns name, each once, in the order of the engines.

    A pattern without a wildcard is a label and may name a platform.  With a wildcard the part before
    `@` is the glob and the platform is carried over to every engine that has it.  `*` alone names the
    methods that are declared as default, and so does `engine:*` of an engine that has such; every other
    glob names all that it fits.
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
            for m in _methods_meant(name, head)
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
    needed = sorted(need.value for need in what.requires if not need.met_by(scene))
    if needed:
        return f"it is for scenes with {' and '.join(needed)}"
    return None
