"""Arguments of public functions, compared with their annotations before anything is computed."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import wraps
from numbers import Integral
from os import PathLike
from typing import Any, ParamSpec, TypeVar

import numpy as np

from springcheck.errors import SceneError

P = ParamSpec("P")
R = TypeVar("R")


def _is_number(x: Any) -> bool:
    with suppress(TypeError, ValueError, OverflowError):
        return not isinstance(x, str | bytes) and np.ndim(x) == 0 and float(x) is not None
    return False


ANNOTATED: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "bool": ("True or False", lambda x: isinstance(x, bool | np.bool_)),
    "int": ("a whole number", lambda x: isinstance(x, Integral) and not isinstance(x, bool)),
    "float": ("a number", _is_number),
    "str": ("a text", lambda x: isinstance(x, str)),
    "Sequence[str]": ("texts", lambda x: isinstance(x, Sequence) and all(isinstance(y, str) for y in x)),
    "Path": ("a path", lambda x: isinstance(x, PathLike)),
    "Scene": ("a Scene", lambda x: type(x).__name__ == "Scene"),
    "Axes": ("an Axes of matplotlib", lambda x: hasattr(x, "plot")),
    "Trajectory": ("a Trajectory", lambda x: type(x).__name__ == "Trajectory"),
    "None": ("", lambda x: x is None),
}
"""What an annotation says in words, and whether an argument is of it."""


def of_kind(what: str, value: Any, *kinds: str) -> Any:
    """The value, if it is of one of these kinds.  SceneError, in one line, if it is not."""
    if any(ANNOTATED[kind][1](value) for kind in kinds):
        return value
    words = " or ".join(ANNOTATED[kind][0] for kind in kinds if kind != "None")
    raise SceneError(f"{what} = {' '.join(repr(value).split()):.60}: {words} is needed")


def typed(function: Callable[P, R]) -> Callable[P, R]:
    """Function decorator: SceneError for an argument that is not what its annotation says, if that is made of
    `ANNOTATED`."""
    signature = inspect.signature(function)
    wanted = {name: str(one.annotation).split(" | ") for name, one in signature.parameters.items()}

    @wraps(function)
    def call(*given: P.args, **named: P.kwargs) -> R:
        try:
            bound = signature.bind(*given, **named)
        except TypeError:
            # Python's own message names the function
            return function(*given, **named)
        for name, value in bound.arguments.items():
            is_several = signature.parameters[name].kind is inspect.Parameter.VAR_POSITIONAL
            for one in (value if is_several else (value,)) if ANNOTATED.keys() >= set(wanted[name]) else ():
                of_kind(f"{function.__name__}: {name}", one, *wanted[name])
        return function(*given, **named)

    return call
