"""What a study is: a folder with its measure, result, text and figure, and its line in the list of studies.

The folder's `__init__` declares the study and imports nothing heavy; its parts are imported when they are
used: `measure.perform` and `measure.stored`, `text.lines`, and `page.banks` or, where matplotlib draws by
itself, `figure.pictures`.
"""

from __future__ import annotations

import gc
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from springcheck.studies.arguments import Argument, Progress

if TYPE_CHECKING:
    from springcheck.figures.charts import Bank
    from springcheck.store import Summary
    from springcheck.studies.choose import LeftOut
    from springcheck.text.lines import Lines


class StudyResult:
    """What a study has found, and how that shows itself in Python: in a line, as the command's text, a table.

    Its class stands beside the `STUDY` of its package.
    """

    __slots__ = ()
    table_of: ClassVar[str] = ""
    """The key of its document under which the rows of its table stand."""

    @property
    def status(self) -> int:
        """Exit status: 0 passed, 1 a verdict or a control failed, 2 nothing was measured."""
        raise NotImplementedError

    def document(self) -> dict[str, Any]:
        """Plain data for JSON; what is not a finite number is None."""
        raise NotImplementedError

    def __str__(self) -> str:
        from springcheck.text.lines import as_text

        return as_text(study_of(self).lines(self))

    def _repr_html_(self) -> str:
        from springcheck.text.lines import as_html

        return as_html(study_of(self).lines(self))

    def rows(self) -> list[dict[str, Any]]:
        """The rows of its table as plain data; numbers that are not known are None."""
        found: list[dict[str, Any]] = self.document()[self.table_of]
        return found

    def to_dataframe(self) -> Any:
        """The rows as a pandas DataFrame; the columns of nested values are called ``outer.inner``."""
        from springcheck.physics.trajectory import library

        return library("pandas").json_normalize(self.rows())

    def figures(self) -> dict[str, Any]:
        """What `springcheck plot` draws, as matplotlib's figures by name."""
        from springcheck.figures.style import style

        with style():
            return {name: draw() for name, draw in study_of(self).pictures(self).items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Studied(StudyResult):
    """What every study says that is kept in a store by its document and tables."""

    left_out: tuple[LeftOut, ...] = ()
    resumed: int = 0
    """Pieces that an interrupted call had finished."""
    path: Path | None = None
    """Where it was stored."""


def study_of(found: object) -> Study:
    """The study that has found this: of `run --vary` it is the ensemble."""
    study: Study = import_module(type(found).__module__.rpartition(".")[0]).STUDY
    return study


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study as the command line, `inspect` and `plot` know it."""

    name: str
    """The name of its command, of its folder, and of its document in a store."""
    about: str
    arguments: tuple[Argument, ...]
    """The arguments of its command."""
    trajectories: bool = False
    """Kept in a store as trajectories, not as a document."""
    chooses: tuple[str, ...] = ()
    """Options of `plot` that its figures take."""
    keeps: Callable[[Namespace], bool] = lambda options: True
    """Whether what is finished outlives an interrupt, so that the same command goes on."""
    package: str = ""
    """Where its parts are; left out: in the folder of its name."""

    def perform(self, options: Namespace, progress: Progress | None) -> StudyResult:
        """Measure what the command line asks for; SpringcheckError for what a user can mend."""
        # first, while the stack is short: beyond a chunk of it Python 3.11 maps memory for every call, and to
        # make the terms' classes takes hundreds
        import_module("springcheck.physics.terms")
        measure = self._part("measure")
        if not gc.isenabled():
            # the program has switched it off for its imports: what was imported stays, and is not searched
            gc.freeze()
            gc.enable()
        found: StudyResult = measure.perform(options, progress)
        return found

    def lines(self, found: StudyResult, options: Namespace | None = None, path: Path | None = None) -> Lines:
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

    def stored(self, path: Path) -> StudyResult:
        """What a store holds of this study.  StoreError where it cannot be read."""
        found: StudyResult = self._part("measure").stored(path)
        return found

    def draw(
        self, found: StudyResult, folder: Path, check: Callable[[list[str]], object] = list, **chosen: Any
    ) -> list[Path]:
        """Draw a stored or a fresh result into a folder, as it is `chosen`; returns the files.

        `check` is called with their names before the first is drawn.
        """
        from springcheck.figures.style import files_of, save, style

        with style():
            pictures = self.pictures(found, **chosen)
            check([file for name in pictures for file in files_of(name)])
            return [path for name, draw in pictures.items() for path in save(draw(), folder, name)]

    def pictures(self, found: StudyResult, **chosen: Any) -> dict[str, Callable[[], Any]]:
        """By the name of each of its figures what draws it by matplotlib."""
        if self._has("figure"):
            drawn: dict[str, Any] = self._part("figure").pictures(found, **chosen)
            return {name: partial(drawn.get, name) for name in drawn}
        from springcheck.figures import render

        banks = self.banks(found, **chosen)
        return {bank.name: partial(render.picture, bank) for bank in banks if bank.name}

    def banks(self, found: StudyResult, **chosen: Any) -> list[Bank]:
        """Its charts in figures and in the report page; none where it has no such part."""
        if not self._has("page"):
            return []
        banks: list[Bank] = self._part("page").banks(found, **chosen)
        return banks

    def _has(self, name: str) -> bool:
        return find_spec(f"{self._package}.{name}") is not None

    def _part(self, name: str) -> Any:
        return import_module(f"{self._package}.{name}")

    @property
    def _package(self) -> str:
        return self.package or f"springcheck.studies.{self.name}"
