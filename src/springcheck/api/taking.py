"""Arguments of the Python functions: scenes, methods, functions of one's own, ways to measure."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene

if TYPE_CHECKING:
    from springcheck.studies.keeper import How

Step = Callable[..., Any]
"""A function ``step(q, p, h, force, mass) -> (q, p)`` of numbers or arrays (n,); `force(q)` is the force."""


@contextmanager
def labels_of(methods: Any, scheme: str = "") -> Iterator[list[str]]:
    """Labels of these methods; functions among them form an engine that exists within this context only."""
    is_one = isinstance(methods, str) or not isinstance(methods, Iterable) or not getattr(methods, "ndim", 1)
    several = [methods] if is_one else list(methods)
    steps = [one for one in several if not isinstance(one, str)]
    if wrong := [one for one in steps if not callable(one)]:
        raise SpringcheckError(f"a method's label or a function is needed, not {wrong[0]!r}")
    if not steps:
        if scheme:
            raise SpringcheckError(f"scheme={scheme!r} goes with a function of yours; methods have their own")
        yield several
        return
    from springcheck.doors import function

    with function.while_here(steps, scheme) as made:
        named = iter(made)
        yield [one if isinstance(one, str) else next(named) for one in several]


@contextmanager
def spoken() -> Iterator[None]:
    """In messages, replace options of the command by the arguments of the call."""
    try:
        yield
    except SpringcheckError as error:
        said = str(error).replace("--force", "force=True").replace("that command", "that call")
        said = re.sub(r"(?<![\w-])-o\b", "path=", re.sub(r"--([a-z]+)\b", r"\1=", said))
        if said != str(error):
            raise type(error)(said) from error
        raise


@contextmanager
def taken(methods: Any, force: bool, workers: int, path: Any = None) -> Iterator[tuple[list[str], How]]:
    """Labels of these methods for a study, and its `How`; functions of yours are measured by this process."""
    from springcheck.studies.team import MOST_PROCESSES, Processes

    if path is not None:
        path_of(path)
    if not 1 <= workers <= MOST_PROCESSES:
        raise SpringcheckError(f"workers={workers}: a number from 1 to {MOST_PROCESSES} is needed")
    with spoken(), labels_of(methods) as named:
        if workers > 1 and any(label.startswith("stepper:") for label in named):
            raise SpringcheckError("workers: your function runs in this process only; leave workers out")
        yield named, {"force": force, "progress": None, "team": Processes(int(workers))}


def scene_of(scene: Scene | str | Path) -> Scene:
    """The scene itself, or the one of this name or path.  SpringcheckError for anything else."""
    return scene if isinstance(scene, Scene) else scenefile.load_scene(scene)


def path_of(given: Any) -> Path:
    """The path of a file; "" is none.  SpringcheckError for anything else."""
    named = given if not isinstance(given, str) or given else None
    if "\0" in str(needed(named, str | PathLike, "the path of a file")):
        raise SpringcheckError(f"{given!r}: a path without zero bytes is needed")
    return Path(given)


def needed(given: Any, kind: Any, what: str) -> Any:
    """The argument, if it is of this kind.  SpringcheckError for anything else."""
    if isinstance(given, kind):
        return given
    raise SpringcheckError(f"{what} is needed, not {type(given).__name__}")
