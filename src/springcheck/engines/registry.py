"""Sources of engines: entry points of installed packages, ours among them, and what a call brings."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from contextvars import ContextVar
from fnmatch import fnmatchcase
from functools import cache
from hashlib import sha256
from operator import attrgetter
from pathlib import Path
from re import fullmatch
from types import ModuleType
from typing import NamedTuple

import springcheck
from springcheck import schemes
from springcheck.bath import THERMOSTATS
from springcheck.engines.contract import ANY_DISTANCE, ANY_POTENTIAL, Engine, Method, Stopped
from springcheck.engines.restored import restored
from springcheck.errors import EngineError, MethodError, SpringcheckError, nearest, told
from springcheck.physics import terms

GROUP = "springcheck.engines"
"""The group of entry points by which the engines of other packages are found."""

OURS = "springcheck"
MODULES = ("own", "ase", "lammps", "mujoco", "openmm", "scipy", "sundials")
"""Our engines, each the ENGINE of the module next to this one."""


class Origin(NamedTuple):
    """The source of an engine: a package with its version, or a file."""

    package: str
    version: str

    def __str__(self) -> str:
        return f"{self.package} {self.version}".strip()


class _Found(NamedTuple):
    """An engine that is known by name: it, its `place` as module:attribute, or the reason why it is none."""

    origin: Origin
    place: str = ""
    engine: Engine | None = None
    reason: str = ""


# brought by a call, as a file, a function or a command: like an imported module they stay for the life of the
# process
_brought: dict[str, _Found] = {}

# known within a context alone, so that another thread's engine of the same name is not run in its place
_here: ContextVar[dict[str, _Found]] = ContextVar("_here", default={})  # noqa: B039


@cache
def _ours() -> dict[str, _Found]:
    origin = Origin(package=OURS, version=springcheck.__version__)
    return {name: _Found(origin=origin, place=f"{GROUP}.{name}:ENGINE") for name in MODULES}


@cache
def _points() -> dict[str, _Found]:
    """Entry points by name, after ours; of two with one name the first counts."""
    # slow to import and to run, so that a call which names only ours does without
    import importlib.metadata

    found = dict(_ours())
    for point in sorted(importlib.metadata.entry_points(group=GROUP), key=lambda point: point.name):
        about = point.dist.metadata if point.dist else {"Name": "?", "Version": ""}
        origin = Origin(package=about["Name"], version=about["Version"])
        if point.name not in found:
            found[point.name] = _Found(origin=origin, place=f"{point.module}:{point.attr}")
        elif found[point.name].origin.package != origin.package:
            reason = f"its name is taken by the engine of {found[point.name].origin}"
            found[f"{point.name} ({origin.package})"] = _Found(origin=origin, reason=reason)
    return found


def _known() -> dict[str, _Found]:
    return _points() | _brought | _here.get()


def _look(name: str) -> _Found | None:
    return _ours().get(name) or _known().get(name)


@cache
def _loaded(name: str, place: str) -> Engine | str:
    """The engine at a place, or why there is none, whatever its code raises."""
    module, _, attribute = place.partition(":")
    try:
        with foreign(f"{place} cannot be loaded"):
            return _checked(attrgetter(attribute)(importlib.import_module(module)), name)
    except SpringcheckError as error:
        return str(error)


@contextmanager
def foreign(what: str, file: str = "") -> Iterator[None]:
    """Run foreign code: whatever it raises becomes an EngineError "`what`: why", and `os._exit` raises."""
    process, leave = os.getpid(), os._exit
    os._exit = sys.exit  # type: ignore[assignment]
    try:
        with restored():
            yield
    except (SpringcheckError, Stopped, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise EngineError(f"{what}: {told(error, file)}") from error
    finally:
        os._exit = leave
        if os.getpid() != process:
            # a fork within foreign code is not the program
            os._exit(1)


def _plain(what: str, name: object) -> None:
    """MethodError for a name that a label cannot hold."""
    if not isinstance(name, str) or not fullmatch(r"[\w-]+", name):
        raise MethodError(f"{what} {name!r} must be of letters, digits, - and _")


def _checked(found: object, name: str = "") -> Engine:
    """The object, if it is an engine that keeps the contract; its schemes are registered.  MethodError, with
    what the contract asks, where it does not."""
    if not isinstance(found, Engine):
        raise MethodError(f"it is of type {type(found).__name__}, not a springcheck.engines.Engine")
    _plain("its name", found.name)
    if name and found.name != name:
        raise MethodError(f"its name is {found.name!r}, but that of its entry point is {name!r}")
    for what in ("start", "version", "arithmetic", "convention"):
        if not callable(getattr(found, what)):
            raise MethodError(f"its {what} is of type {type(getattr(found, what)).__name__}, not a function")
    for what in ("methods", "thermostats"):
        if not isinstance(by_name := getattr(found, what), Mapping):
            raise MethodError(
                f"its {what} are a {type(by_name).__name__}, not by name; named(...) makes them so"
            )
    if not (found.methods or found.thermostats):
        raise MethodError("it has no methods and no thermostats")
    known = (*terms.known(), ANY_POTENTIAL, ANY_DISTANCE)
    for scheme in found.schemes:
        schemes.bring(scheme)
    for key, one in (*found.methods.items(), *found.thermostats.items()):
        if not isinstance(one, Method) or one.name != key:
            raise MethodError(f"its method {key!r} must be a springcheck.engines.Method of this name")
        _plain("the name of its method", key)
        if not isinstance(one.terms, Set):
            raise MethodError(f"the terms of its method {key!r} are a {type(one.terms).__name__}, not a set")
        for term in one.terms:
            if term not in known:
                raise MethodError(f"its method {key!r}: there is no term {term!r}{nearest(str(term), known)}")
        if found.thermostats.get(key) is one and not one.generator:
            raise MethodError(f"its thermostat {key!r}: the `generator` of its Method must say what draws")
        if one.generator:
            if one.scheme not in THERMOSTATS:
                raise MethodError(f"the scheme {one.scheme!r} of its thermostat {key!r} is not known")
            continue
        scheme = schemes.scheme(one.scheme)
        if one.adaptive and scheme.has("one-step"):
            raise MethodError(f"its method {key!r} is adaptive, but {scheme.title} has a fixed step")
    return found


def names(like: str = "*") -> tuple[str, ...]:
    """Names of all engines that can be loaded, our own first, or of those that a glob fits."""
    # a call that names one of ours loads no other
    known = [like] if like in _ours() else [name for name in _known() if fnmatchcase(name, like)]
    return tuple(name for name in known if isinstance(_find(name), Engine))


def unusable() -> dict[str, str]:
    """Engines that are registered and cannot be used, by name, each with the reason."""
    found = {name: (_find(name), one.origin) for name, one in _known().items()}
    return {
        name: f"engine {name} of {where} cannot be used: {what}"
        for name, (what, where) in found.items()
        if isinstance(what, str)
    }


GIVEN = {"stepper": "--stepper FILE.py:FUNCTION", "command": "--command 'NAME=PROGRAM {scene} {out}'"}
"""Names of the engines of what a user brings, and the options that bring it."""


def _find(name: str) -> Engine | str | None:
    """An engine, why it cannot be used, or None where there is none of this name."""
    found = _look(name)
    if found is None:
        return None
    return found.engine or found.reason or _loaded(name, found.place)


def engine(name: str) -> Engine:
    """The declarations of an engine; imports no library."""
    found = _find(name)
    if isinstance(found, Engine):
        return found
    if isinstance(found, str):
        raise MethodError(f"engine {name} of {origin(name)} cannot be used: {found}")
    if name in GIVEN:
        raise MethodError(f"{name} is the engine of {GIVEN[name]}, which is not given here: give it again")
    known = names()
    raise MethodError(f"unknown engine {name!r}{nearest(name, known)}; known are {', '.join(known)}")


def origin(name: str) -> Origin:
    """The package or file that an engine comes from."""
    found = _look(name)
    assert found is not None, f"{name} is no engine"
    return found.origin


def module_name(name: str) -> str:
    """The module that an engine is imported from; "" where a call or a test has brought it."""
    found = _look(name)
    return found.place.partition(":")[0] if found else ""


def bring(found: Engine, where: str, version: str = "") -> Engine:
    """Register an engine for the rest of this process.  MethodError where it does not keep the contract."""
    _brought.update(_named(found, where, version))
    return found


@contextmanager
def while_here(found: Engine, where: str, version: str) -> Iterator[None]:
    """Register an engine within this context, of this thread alone, before any other of its name."""
    before = _here.set({**_here.get(), **_named(found, where, version)})
    try:
        yield
    finally:
        _here.reset(before)


def _named(found: Engine, where: str, version: str) -> dict[str, _Found]:
    """The engine by its name.  MethodError where it does not keep the contract, or a package has that."""
    found = _checked(found)
    if (taken := _look(found.name)) is not None and not is_brought(found.name):
        raise MethodError(f"{where}: the name {found.name!r} is taken by the engine of {taken.origin}")
    return {found.name: _Found(origin=Origin(package=where, version=version), engine=found)}


def is_brought(name: str) -> bool:
    """Whether a call has brought it, rather than a package."""
    return name in _brought or name in _here.get()


def from_file(path: Path) -> Engine | None:
    """Register the engine of a Python file: its one `Engine`, or the one that it calls ENGINE. None for a
    file that only registers terms."""
    before = terms.known()
    module = module_of(path)
    there = {id(x): x for x in vars(module).values() if isinstance(x, Engine)}
    found = getattr(module, "ENGINE", None) or next(iter(there.values()), None)
    if found is None and terms.known() != before:
        return None
    if found is None:
        raise MethodError(f"{path} has no engine: a springcheck.engines.Engine named ENGINE")
    try:
        # the file's digest stands for its version: runs of an older one are not resumed
        return bring(found, str(path), sha256(path.read_bytes()).hexdigest()[:12])
    except MethodError as error:
        text = str(error)
        raise MethodError(text if text.startswith(str(path)) else f"engine of {path}: {text}") from error


def module_of(path: Path) -> ModuleType:
    """A Python file as a module.  MethodError, with the line, where it cannot be run."""
    if not path.is_file():
        why = "it is a folder, a Python file is needed" if path.is_dir() else "there is no such file"
        raise MethodError(f"{path}: {why}")
    spec = importlib.util.spec_from_file_location(f"springcheck_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise MethodError(f"{path} is not a Python file: its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    with foreign(f"{path} cannot be imported", str(path)):
        # the loader would take bytecode of a text of the same length and second for that of this one
        exec(compile(path.read_bytes(), str(path), "exec", dont_inherit=True), vars(module))
    return module
