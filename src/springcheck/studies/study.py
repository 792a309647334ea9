"""Definition of a study: a folder with its measure, result and charts, and a line in the list.

The folder's `__init__` declares the study and imports nothing heavy; its parts are imported on use:
`measure.perform` and `measure.stored`, whose results say themselves, and `page.banks` where it has charts.
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
    """Result of a study, and its forms in Python: a line, the text of the command, a table.

    Its class stands in the package whose `STUDY` it belongs to.
    """

    __slots__ = ()
    table_of: ClassVar[str] = ""
    """Key of its document that holds the rows of its table."""

    @property
    def status(self) -> int:
        """Exit status: 0 passed, 1 a verdict or a control failed, 2 nothing was measured."""
        raise NotImplementedError

    def document(self) -> dict[str, Any]:
        """Plain data for JSON; non-finite numbers are None."""
        raise NotImplementedError

    def lines(self, options: Namespace | None = None) -> Lines:
        """The whole report as text, with these options of the command."""
        raise NotImplementedError

    def __str__(self) -> str:
        from springcheck.text.lines import as_text

        return as_text(study_of(self).lines(self))

    def _repr_html_(self) -> str:
        from springcheck.text.lines import as_html

        return as_html(study_of(self).lines(self))

    def rows(self) -> list[dict[str, Any]]:
        """The rows of its table as plain data; unknown numbers are None."""
        found: list[dict[str, Any]] = self.document()[self.table_of]
        return found

    def to_dataframe(self) -> Any:
        """The rows as a pandas DataFrame; columns of nested values are named ``outer.inner``."""
        from springcheck.physics.trajectory import library

        return library("pandas").json_normalize(self.rows())

    def figures(self) -> dict[str, Any]:
        """The figures of `springcheck plot`, as matplotlib's figures by name."""
        from springcheck.figures.style import style

        with style():
            return {name: draw() for name, draw in study_of(self).pictures(self).items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Studied(StudyResult):
    """Result of a study that is stored by its document and tables."""

    left_out: tuple[LeftOut, ...] = ()
    resumed: int = 0
    """Number of pieces that an interrupted call had finished."""
    path: Path | None = None
    """Path of the store."""

    def kept_document(self) -> dict[str, Any]:
        """The document as a store holds it, beside the tables."""
        return self.document()


def study_of(found: object) -> Study:
    """The study that this is a result of; by the package of its class."""
    study: Study = import_module(type(found).__module__.rpartition(".")[0]).STUDY
    return study


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study as seen by the command line, `inspect` and `plot`."""

    name: str
    """The name of its command, of its folder, and of its document in a store."""
    about: str
    arguments: tuple[Argument, ...]
    """The arguments of its command."""
    trajectories: bool = False
    """Stored as trajectories, not as a document."""
    chooses: tuple[str, ...] = ()
    """Options of `plot` that its figures take."""
    keeps: Callable[[Namespace], bool] = lambda options: True
    """Whether finished pieces survive an interrupt, so that the same command resumes."""
    package: str = ""
    """Package of its parts; by default the folder of its name."""

    def perform(self, options: Namespace, progress: Progress | None) -> StudyResult:
        """Carry out what the command line asks for; SpringcheckError for what a user can correct."""
        # first, while the stack is short: beyond a chunk of it Python 3.11 maps memory for every call, and
        # making the terms' classes takes hundreds
        import_module("springcheck.physics.terms")
        measure = self._part("measure")
        if not gc.isenabled():
            # the program has disabled it for its imports: imported objects stay, and are not scanned
            gc.freeze()
            gc.enable()
        found: StudyResult = measure.perform(options, progress)
        return found

    def lines(self, found: StudyResult, options: Namespace | None = None, path: Path | None = None) -> Lines:
        """The report as text; with the `path` of its store the one of `inspect`."""
        where: Path | None = path or getattr(found, "path", None)
        if self.trajectories or where is None:
            return found.lines(options)
        from springcheck.text.lines import plain

        return [*found.lines(options), *([] if path else [plain(f"Stored in {where}")])]

    def held(self, summary: Summary) -> bool:
        """Whether a store holds a study of this kind."""
        return bool(summary.runs) if self.trajectories else self.name in summary.documents

    def stored(self, path: Path) -> StudyResult:
        """The result that a store holds of this study.  StoreError where it cannot be read."""
        found: StudyResult = self._part("measure").stored(path)
        return found

    def drawn(
        self, found: StudyResult, check: Callable[[list[str]], object] = list, **chosen: Any
    ) -> dict[str, bytes]:
        """The figures of a stored or a fresh result, with the options `chosen`, by the names of their files.

        `check` is called with these names before the first is drawn.
        """
        from springcheck.figures.style import drawn, files_of, style

        with style():
            pictures = self.pictures(found, **chosen)
            check([file for name in pictures for file in files_of(name)])
            return {file: x for name, draw in pictures.items() for file, x in drawn(draw(), name).items()}

    def draw(self, found: StudyResult, folder: Path) -> list[Path]:
        """Write its figures into a folder; returns the files."""
        from springcheck.figures.folder import write

        return write(self.drawn(found), folder)

    def pictures(self, found: StudyResult, **chosen: Any) -> dict[str, Callable[[], Any]]:
        """Functions that draw its figures by matplotlib, by name."""
        from springcheck.figures import render

        banks = self.banks(found, **chosen)
        return {bank.name: partial(render.picture, bank) for bank in banks if bank.name}

    def banks(self, found: StudyResult, **chosen: Any) -> list[Bank]:
        """Its charts in figures and in the report page; none where it has no such part."""
        if find_spec(f"{self._package}.page") is None:
            return []
        banks: list[Bank] = self._part("page").banks(found, **chosen)
        return banks

    def _part(self, name: str) -> Any:
        return import_module(f"{self._package}.{name}")

    @property
    def _package(self) -> str:
        return self.package or f"springcheck.studies.{self.name}"
