"""How lists are displayed in Python: verdicts, tables of methods, and text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from springcheck import checks
from springcheck.physics.trajectory import Verdict, html_table, library


class Verdicts(list[Verdict]):
    """Verdicts and their summary; `print` shows the summary and the failed verdicts."""

    def __init__(self, verdicts: Iterable[Verdict] = (), *, shown: str = "") -> None:
        super().__init__(verdicts)
        self._shown = shown

    @property
    def passed(self) -> bool:
        """Whether nothing failed, and a check that distinguishes schemes applied."""
        return checks.status(self) == 0

    @property
    def failed(self) -> Verdicts:
        """The verdicts that failed."""
        return Verdicts(verdict for verdict in self if verdict.passed is False)

    @property
    def summary(self) -> str:
        """How many passed, or which failed, or which are not judged, in one line."""
        said, without = checks.summary(self), ", ".join(checks.not_judged(self)[: checks.MOST_NAMED])
        return f"not judged: {without}: nothing that applied tells the scheme; {said}" if without else said

    @property
    def cause(self) -> str:
        """The diagnosis of a failure, or of no judgement, in a sentence; "" for none."""
        return checks.cause_of(self) or self._shown

    def __repr__(self) -> str:
        said = [f"  Diagnosis: {self.cause}"] if self.cause else []
        return "\n".join([f"Verdicts({self.summary})", *said, *(f"  {verdict!r}" for verdict in self.failed)])

    def _repr_html_(self) -> str:
        words = {True: "passed", False: "FAILED", None: "does not apply"}
        rows = [(x.check, words[x.passed], f"{x.value:.3g}", f"{x.bound:.3g}", x.reason) for x in self]
        said = f"{self.summary}. Diagnosis: {self.cause}" if self.cause else self.summary
        return html_table(said, [("check", "verdict", "value", "bound", "why"), *rows])

    def to_dataframe(self) -> Any:
        """A pandas DataFrame with a row for each verdict."""
        names = ("method", "check", "passed", "value", "bound", "unit", "why")
        return library("pandas").DataFrame([{name: getattr(x, name) for name in names} for x in self])


class Shelf(list[dict[str, Any]]):
    """Rows with the same names: a table on a terminal, in a notebook, or of pandas."""

    def __repr__(self) -> str:
        from springcheck.text.lines import as_text, table

        names = list(self[0]) if self else []
        rows = [[str("" if row[name] is None else row[name]) for name in names] for row in self]
        return as_text([table(names, rows, left=names, prose=names[-1])]) if self else "nothing"

    def _repr_html_(self) -> str:
        rows = [[str("" if x is None else x) for x in row.values()] for row in self]
        return html_table("", [list(self[0]), *rows]) if self else ""

    def to_dataframe(self) -> Any:
        """The rows as a pandas DataFrame."""
        return library("pandas").DataFrame(list(self))


class Said(str):
    """Text whose representation is the text itself."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)
