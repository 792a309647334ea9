"""The pieces of a long study: kept as they are finished, taken up by the next call of the same command."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from springcheck import store
from springcheck.engines.contract import Label

T = TypeVar("T")

Progress = Callable[[float, float, str], None]
"""Told how much of a study is done, of how much (pieces, or seconds of a budget), and what comes next."""


class Pieces:
    """What an earlier call has finished, and where this one keeps what it finishes.

    Without a journal nothing was finished and nothing is kept.
    """

    def __init__(self, journal: store.Journal | None = None) -> None:
        self._journal = journal
        self._progress: Progress | None = None
        self._expected = 0
        self._finished = journal.tables() if journal else {}
        self.names: list[str] = []
        """Names of the pieces, in the order in which they were asked for."""
        self.taken_up: list[str] = []
        """Those that were not measured again."""

    def finished(self, name: str) -> store.Table | None:
        """The table of this name that an earlier call has kept."""
        return self._finished.get(name)

    def keep(self, table: store.Table) -> None:
        """Keep a table, in the place of an earlier one of its name: from here on it outlives crashes."""
        if self._journal is not None:
            self._journal.add(table)

    def expect(self, pieces: int, progress: Progress | None) -> None:
        """So many pieces are asked for from here on."""
        self._expected, self._progress = pieces, progress

    def piece(
        self,
        name: str,
        what: str,
        measure: Callable[[], T],
        to_table: Callable[[T], store.Table],
        from_table: Callable[[store.Table], T],
    ) -> T:
        """The piece of this name: taken up where it is finished, else measured and kept.

        `what` is its name for people.
        """
        if self._progress:
            self._progress(len(self.names), self._expected, what)
        self.names.append(name)
        table = self.finished(name)
        if table is not None:
            self.taken_up.append(name)
            return from_table(table)
        found = measure()
        self.keep(to_table(found))
        return found

    def each(
        self,
        labels: Iterable[Label],
        beginning: str,
        what: str,
        measure: Callable[[Label], T],
        to_table: Callable[[T], store.Table],
        from_table: Callable[[store.Table], T],
    ) -> tuple[T, ...]:
        """One piece for each method; names begin with `beginning`, and `what` says them for people."""
        return tuple(
            self.piece(
                f"{beginning}{label}", f"{what} {label}", partial(measure, label), to_table, from_table
            )
            for label in labels
        )
