"""What a study is: a folder with its measure, result, text and figure, and its line in the list of studies.

The folder's `__init__` declares the study and imports nothing heavy; its parts are imported when they are
used: `measure.perform` and `measure.stored`, `text.lines`, `figure.pictures`, and `page.banks` where there
are charts for the report page.
"""

from __future__ import annotations

import gc
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from springcheck.store import Summary
    from springcheck.studies.charts import Bank
    from springcheck.text.lines import Lines


Argument = tuple[tuple[str, ...], dict[str, Any]]
"""An argument of a command: its names, and what argparse is told of it."""


class Progress(Protocol):
    """Told how much is done, of how much (pieces, steps or seconds of a budget), and what comes next."""

    def __call__(self, done: float, whole: float, what: str = "") -> None: ...


class Result(Protocol):
    """What a study has found."""

    @property
    def status(self) -> int:
        """Exit status: 0 passed, 1 a verdict or a control failed, 2 nothing was measured."""
        ...

    def document(self) -> dict[str, Any]:
        """Plain data for JSON; what is not a finite number is None."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study as the command line, `inspect` and `plot` know it."""

    name: str
    """Of its command, of its folder, and of its document in a store."""
    about: str
    arguments: tuple[Argument, ...]
    """Of its command."""
    trajectories: bool = False
    """Kept in a store as trajectories, not as a document."""
    chooses: tuple[str, ...] = ()
    """Options of `plot` that its figures take."""
    keeps: Callable[[Namespace], bool] = lambda options: True
    """Whether what is finished outlives an interrupt, so that the same command goes on."""
    package: str = ""
    """Where its parts are; left out: in the folder of its name."""

    def perform(self, options: Namespace, progress: Progress | None) -> Result:
        """Measure what the command line asks for; SpringcheckError for what a user can mend."""
        measure = self._part("measure")
        if not gc.isenabled():
            # the program has switched it off for its imports: what was imported stays, and is not searched
            gc.freeze()
            gc.enable()
        found: Result = measure.perform(options, progress)
        return found

    def lines(self, found: Result, options: Namespace | None = None, path: Path | None = None) -> Lines:
        """The report as text; with the `path` of its store the one that `inspect` shows."""
        lines: Lines = self._part("text").lines(found, options)
        where: Path | None = path or getattr(found, "path", None)
        if self.trajectories or where is None:
            return lines
        from springcheck.studies import keeper
        from springcheck.text.lines import plain

        said = [] if path else [f"Stored in {where}"]
        return [*lines, *map(plain, [*said, *keeper.who(where)])]

    def held(self, summary: Summary) -> bool:
        """Whether a store holds a study of this kind."""
        return bool(summary.runs) if self.trajectories else self.name in summary.documents

    def stored(self, path: Path) -> Result:
        """What a store holds of this study.  StoreError where it cannot be read."""
        found: Result = self._part("measure").stored(path)
        return found

    def draw(self, found: Result, folder: Path, **chosen: Any) -> list[Path]:
        """Draw a stored or a fresh result into a folder, as it is `chosen`; returns the files."""
        from springcheck.figures.style import save, style

        with style():
            pictures = self._part("figure").pictures(found, **chosen)
            return [path for name, picture in pictures.items() for path in save(picture, folder, name)]

    def banks(self, found: Result) -> list[Bank]:
        """Its charts in the report page; none where it has no such part."""
        if find_spec(f"{self._package}.page") is None:
            return []
        banks: list[Bank] = self._part("page").banks(found)
        return banks

    def _part(self, name: str) -> Any:
        return import_module(f"{self._package}.{name}")

    @property
    def _package(self) -> str:
        return self.package or f"springcheck.studies.{self.name}"


def argument(*names: str, **how: Any) -> Argument:
    """An argument of a command."""
    return names, how


def repeatable(name: str, metavar: str, about: str, **more: Any) -> Argument:
    """An option that may be given more than once."""
    return argument(name, action="append", default=[], metavar=metavar, help=f"{about}; repeatable", **more)


JSON = argument("--json", action="store_true", help="one JSON document on standard output")
QUIET = argument("--quiet", action="store_true", help="print nothing but mistakes")
FORCE = argument("--force", action="store_true", help="write an existing store anew")
ENGINE = repeatable("--engine", "FILE.py", "an engine of your own, for this call")
SCENE = argument("scene", metavar="SCENE", help="a shipped scene's name, or the path of a scene file")
"""Arguments of many commands."""


def store_arguments(default: str = "SCENE.h5") -> tuple[Argument, ...]:
    """Those of every study that is kept in a store: where, which methods, what runs beside them."""
    return (
        argument("-o", "--output", metavar="FILE", help=f"the store (default: {default})"),
        repeatable("--method", "LABEL", "engine:method[@platform[-precision]] or a glob such as 'own:*'"),
        ENGINE,
        repeatable(
            "--stepper", "MODULE:FUNCTION",
            "your function step(q, p, h, force, mass) -> (q, p), also as FILE.py:FUNCTION",
        ),
        repeatable(
            "--command", "NAME=COMMAND", "a program in any language, as 'name=./engine {scene} {out}'",
            dest="program",
        ),
        repeatable(
            "--scheme", "SCHEME|NAME=SCHEME", "the scheme of your functions and programs, or of one of them"
        ),
        argument("--timeout", type=float, metavar="SECONDS", help="what a program may take (default 600)"),
        FORCE,
        JSON,
        QUIET,
    )  # fmt: skip
