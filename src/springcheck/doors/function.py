"""Students' functions ``step(q, p, h, force, mass) -> (q, p)`` as the methods of an engine."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import numpy as np

from springcheck import engines, schemes
from springcheck.engines import BRAKES, DRIVEN, EVERY_FORCE, Engine, Label, Method, Simulation, Stopped
from springcheck.engines.solvers import timed
from springcheck.errors import IdentificationError, MethodError, told
from springcheck.identify import identify_stepper
from springcheck.identify.pair import returned
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.schemes import UNKNOWN

Spec = str | Callable[..., Any]
"""A function, or the text that says where one is."""


def load(spec: Spec) -> Callable[..., Any]:
    """The function of ``module:function`` or ``file.py:function``; modules of the current folder are found.

    MethodError, in one line, where there is none.
    """
    if callable(spec):
        return _step(spec, _called(spec), _called(spec))
    where, _, name = spec.rpartition(":")
    if not (where and name):
        raise MethodError(f"stepper {spec!r} is not of the form module:function, or file.py:function")
    found: Any = engines.module_of(Path(where)) if where.endswith(".py") else _module(where)
    known = [key for key, x in vars(found).items() if inspect.isfunction(x) and not key.startswith("_")]
    for part in name.split("."):
        if not hasattr(found, part):
            raise MethodError(f"{where} has no {name!r}; it has {', '.join(known) or 'no functions'}")
        found = getattr(found, part)
    if not callable(found):
        raise MethodError(f"{spec!r} is a {type(found).__name__}, not a function")
    return _step(found, spec, name)


def _called(spec: Spec) -> str:
    """Name of a function in messages."""
    return spec if isinstance(spec, str) else str(getattr(spec, "__name__", type(spec).__name__))


def _step(found: Callable[..., Any], spec: str, name: str) -> Callable[..., Any]:
    """The function, where it can be called as a step."""
    try:
        signature = inspect.signature(found)
    except (TypeError, ValueError):
        # of an extension
        return found
    try:
        signature.bind(*range(5))
    except TypeError:
        raise MethodError(
            f"{spec}: {name}{signature} cannot be called as a step: step(q, p, h, force, mass) -> (q, p)"
        ) from None
    return found


def _module(name: str) -> ModuleType:
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        with engines.foreign(f"module {name!r} cannot be imported"):
            return importlib.import_module(name)
    except MethodError as failure:
        missing = failure.__cause__
        if not isinstance(missing, ModuleNotFoundError):
            raise
        if f"{name}.".startswith(f"{missing.name or name}."):
            raise MethodError(f"no module {name!r} in {here} or among the installed ones") from missing
        raise MethodError(f"module {name!r} needs {missing.name!r}, which is not installed") from missing
    finally:
        sys.path.remove(here)


@contextmanager
def while_here(functions: Sequence[Callable[..., Any]], scheme: str = "") -> Iterator[list[str]]:
    """Labels of functions, which are methods of an engine within this context and not after it."""
    made = engine(functions, lambda name: scheme)
    codes = [getattr(inspect.unwrap(one), "__code__", one) for one in functions]
    # stands for the version: runs of another function are not resumed
    known = [(x.co_code, x.co_consts, x.co_names) if isinstance(x, CodeType) else x for x in codes]
    with engines.while_here(made, "this call", sha256(repr(known).encode()).hexdigest()[:12]):
        yield [f"{made.name}:{name}" for name in made.methods]


def file_of(spec: str) -> str:
    """The file of a function."""
    return _file(load(spec)) or spec


def engine(specs: Sequence[Spec], stated: Callable[[str], str] = lambda name: "") -> Engine:
    """An engine of the functions; without a stated scheme each has the one that `identify` finds, if any."""
    functions = dict(zip(_names([_called(spec) for spec in specs]), map(load, specs), strict=True))

    def start(scene: Scene, method: Method, label: Label, step: float) -> Simulation:
        function = functions[method.name]
        return _Steps(function, scene, step, _file(function))

    methods = {}
    for spec, (name, function) in zip(map(_called, specs), functions.items(), strict=True):
        scheme = stated(name)
        known = schemes.scheme(scheme).name if scheme else _identified(function)
        about = f"{spec}, {'stated to be' if scheme else 'found to be'} {schemes.title(known)}"
        methods[name] = Method(name=name, scheme=known, about=about, terms=EVERY_FORCE | DRIVEN | BRAKES)
    return Engine(
        name="stepper",
        title=f"the function {_called(specs[0])}" if len(specs) == 1 else "functions",
        methods=methods,
        schemes=(UNKNOWN,),
        start=start,
        version=dict,
        convention=lambda method: "as the function returns them",
        any_axis=True,
    )


def _names(specs: Sequence[str]) -> list[str]:
    """Names of functions, with their modules' where two are equal. MethodError where that is not enough."""
    plain = [re.sub(r"[^A-Za-z0-9_-]", "-", spec.rpartition(":")[2]) or "step" for spec in specs]
    whole = [
        re.sub(r"[^A-Za-z0-9_-]", "-", f"{Path(spec.rpartition(':')[0].removesuffix('.py')).name}-{name}")
        for spec, name in zip(specs, plain, strict=True)
    ]
    names = [long if plain.count(short) > 1 else short for short, long in zip(plain, whole, strict=True)]
    twice = next((spec for spec, name in zip(specs, names, strict=True) if names.count(name) > 1), None)
    if twice is not None:
        raise MethodError(f"{twice}: two functions would have one name; name each once")
    return names


def _identified(function: Callable[..., Any]) -> str:
    schemes.bring(UNKNOWN)
    try:
        # what it does wrong with several particles fails in the scene, beside this scheme
        found = identify_stepper(function, single=True)
    except (MethodError, IdentificationError):
        # an error in the function is shown as it is, when it runs
        return UNKNOWN.name
    known = found.fits and found.scheme in schemes.SCHEMES and schemes.SCHEMES[found.scheme].has("one-step")
    return found.scheme if known and found.scheme else UNKNOWN.name


def _file(function: Callable[..., Any]) -> str:
    try:
        return str(inspect.getsourcefile(inspect.unwrap(function)) or "")
    except TypeError:
        return ""


class _Pull:
    """The argument `force` of a function: force(q, p, t), the last two optional.

    Its attribute `t` (see the README of the engines) is the time at which the step starts, at which the force
    is taken unless the function gives a time.
    """

    def __init__(self, scene: Scene) -> None:
        self.calls, self.t = 0, 0.0
        self._total, _ = timed(scene)

    def __call__(self, q: Any, p: Any = None, t: float | None = None) -> Any:
        self.calls += 1
        here = np.atleast_1d(np.asarray(q, np.float64))
        there = np.zeros_like(here) if p is None else np.atleast_1d(np.asarray(p, np.float64))
        found = self._total(self.t if t is None else t, here, there)
        return float(found[0]) if np.ndim(q) == 0 else found


class _Steps:
    """The function, step by step: with numbers for one particle, or with arrays where it wants them."""

    def __init__(self, function: Callable[..., Any], scene: Scene, step: float, where: str) -> None:
        self._function, self._h, self._where = function, step, where
        self._q, self._p, self._m = scene.q.copy(), scene.p.copy(), scene.m
        self._n, self._arrays = scene.n, scene.n > 1
        self._force, self._done = _Pull(scene), 0

    @property
    def force_calls(self) -> int:
        """Calls of the force by the function."""
        return self._force.calls

    def _call(self, arrays: bool) -> tuple[Floats, Floats]:
        if arrays:
            given: tuple[Any, Any, Any] = (self._q.copy(), self._p.copy(), self._m.copy())
        else:
            given = (float(self._q[0]), float(self._p[0]), float(self._m[0]))
        out = self._function(given[0], given[1], self._h, self._force, given[2])
        q, p = map(np.atleast_1d, returned(self._function, out))
        if q.shape != (self._n,) or p.shape != (self._n,):
            raise MethodError(f"{self._name}: returned shapes {q.shape} and {p.shape}, not ({self._n},)")
        return q, p

    @property
    def _name(self) -> str:
        return str(getattr(self._function, "__name__", "the function"))

    def _step(self) -> tuple[Floats, Floats]:
        if self._arrays:
            return self._call(True)
        try:
            return self._call(False)
        except (TypeError, IndexError, AttributeError) as error:
            first = error
        try:
            found = self._call(True)
        except (ArithmeticError, TypeError, IndexError, AttributeError, ValueError) as second:
            # show the error of whichever call got further into the function
            raise (second if self._line(second) > self._line(first) else first) from None
        self._arrays = True
        return found

    def _line(self, error: BaseException) -> int:
        frames = traceback.extract_tb(error.__traceback__)
        return max((f.lineno or 0 for f in frames if f.filename == self._where), default=0)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        with np.errstate(all="ignore"):
            for row in range(len(q)):
                for _ in range(every):
                    self._force.t = self._done * self._h
                    self._done += 1
                    try:
                        self._q, self._p = self._step()
                    except OverflowError as error:
                        raise Stopped(row, f"the motion explodes: {told(error, self._where)}") from error
                    except (MethodError, MemoryError):
                        raise
                    except Exception as error:
                        raise MethodError(f"{self._name} failed: {told(error, self._where)}") from error
                q[row], p[row] = self._q, self._p
                if not (np.all(np.isfinite(self._q)) and np.all(np.isfinite(self._p))):
                    infinite = np.any(np.isinf([self._q, self._p]))
                    what = "the motion explodes: infinite numbers" if infinite else "nan in place of numbers"
                    raise Stopped(row, f"{what} from the next frame on")
