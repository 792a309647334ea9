"""A study: a folder with its measure and its result, and a line in the list `STUDIES`.

The folder's `__init__` declares the study and imports nothing heavy.  Its `measure.perform` carries out what
the command line asks for and returns a result.  A result says its title, its answer, its tables and its
charts; one printer, one drawer and one reader here serve all of them.
"""

from __future__ import annotations

import gc
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from springcheck.studies.arguments import Argument, Progress
from springcheck.text.lines import Lines, as_html, as_text, plain
from springcheck.text.wording import count

if TYPE_CHECKING:
    from springcheck.figures.charts import Bank
    from springcheck.physics.scene import Scene
    from springcheck.store import Summary
    from springcheck.studies.choose import LeftOut
    from springcheck.studies.tables import Form


class StudyResult:
    """Result of a study, and its forms in Python: a line, the text of the command, a table, figures.

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

    def banks(self, **chosen: Any) -> list[Bank]:
        """Its charts, for figures and for the report page."""
        return []

    def __str__(self) -> str:
        return as_text(study_of(self).lines(self))

    def _repr_html_(self) -> str:
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
    """Result of a study that is stored by its fields: those of `forms` as tables, the others as JSON."""

    forms: ClassVar[Mapping[str, Form[Any]]] = {}
    piece: ClassVar[str] = "method"
    """Noun for what an interrupted call has finished."""

    scene: Scene | None = None
    left_out: tuple[LeftOut, ...] = ()
    resumed: int = 0
    """Number of pieces that an interrupted call had finished."""
    path: Path | None = None
    """Path of the store."""

    @property
    def title(self) -> str:
        """What was measured."""
        raise NotImplementedError

    def answer(self) -> Lines:
        """What was found, in a sentence or two."""
        return []

    def tables(self) -> Lines:
        """Tables, each below its caption, and notes on them."""
        raise NotImplementedError

    def lines(self, options: Namespace | None = None) -> Lines:
        """Title, answer, tables, and the methods that were left out."""
        from springcheck.studies.choose import left_out

        were = "was" if self.resumed == 1 else "were"
        taken = f"  {count(self.resumed, self.piece)} {were} finished by an interrupted call and resumed"
        head = [plain(self.title, "bold"), *self.answer(), *[plain(taken)] * bool(self.resumed)]
        return [*head, plain(), *self.tables(), *left_out(self.left_out)]


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
        measure = self._measure
        if not gc.isenabled():
            # the program has disabled it for its imports: imported objects stay, and are not scanned
            gc.freeze()
            gc.enable()
        found: StudyResult = measure.perform(options, progress)
        return found

    def lines(self, found: StudyResult, options: Namespace | None = None, path: Path | None = None) -> Lines:
        """The report as text; with the `path` of its store the one of `inspect`."""
        where: Path | None = path or getattr(found, "path", None)
        stored = where is not None and not self.trajectories and path is None
        return [*found.lines(options), *[plain(f"Stored in {where}")] * stored]

    def held(self, summary: Summary) -> bool:
        """Whether a store holds a study of this kind."""
        return bool(summary.runs) if self.trajectories else self.name in summary.documents

    def stored(self, path: str | Path) -> Any:
        """The result that a store holds of this study.  StoreError where it cannot be read."""
        if self.trajectories:
            return self._measure.stored(Path(path))
        from springcheck.studies import keeper

        kinds = {name: x for name, x in vars(self._measure).items() if isinstance(x, type)}
        return keeper.restored(self.name, Path(path), kinds)

    def drawn(
        self, found: StudyResult, check: Callable[[Sequence[str]], object] = list, **chosen: Any
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

        return {bank.name: partial(render.picture, bank) for bank in found.banks(**chosen) if bank.name}

    @property
    def _measure(self) -> Any:
        return import_module(f"{self.package or f'springcheck.studies.{self.name}'}.measure")
