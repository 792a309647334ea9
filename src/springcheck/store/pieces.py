"""Pieces of a study in the collection: rows of many pieces as one table, and who measured each piece.

A part ``rows-<table>/<piece>.h5`` holds rows of a table; in the collection they stand below one another, in
the order of the names of their pieces.  So a store has as many tables whether a thousand pieces or a million
were measured.  The root of a part says by whom it was measured; the collection has one row for each of those,
and one for each piece.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.store import access, digests, seal, tables
from springcheck.store.parts import name_of, table_of
from springcheck.store.tables import Table

BY = "measured_by"
"""The attribute of a part's root that says by whom: a list of records as JSON."""

WORKERS, PIECES = "provenance/workers", "provenance/pieces"

Worker = Mapping[str, str]
"""What is known of a worker: host, processor, versions ..."""


def by_text(by: Sequence[Worker]) -> dict[str, str]:
    """The attribute of a part that says by whom it was measured; none where that is not known."""
    return {BY: json.dumps([dict(record) for record in by], sort_keys=True)} if by else {}


def by_of(file: Any) -> list[dict[str, str]]:
    """By whom an open part was measured."""
    try:
        found: list[dict[str, str]] = access.json(
            str(access.attribute(file, BY) or "[]"), list[dict[str, str]]
        )
        return found
    except ValueError:
        return []


class Provenance:
    """Who measured which piece, collected while a collection is written."""

    def __init__(self) -> None:
        self._records: dict[str, int] = {}
        self._pieces: dict[tuple[str, int], None] = {}

    def note(self, piece: str, by: Iterable[Worker]) -> None:
        """A piece was measured by these."""
        for record in by:
            number = self._records.setdefault(json.dumps(dict(record), sort_keys=True), len(self._records))
            self._pieces[piece, number] = None

    def tables(self) -> list[Table]:
        """A row for each worker, and one for each piece with the row of its worker."""
        if not self._pieces:
            return []
        found: list[dict[str, str]] = [json.loads(text) for text in self._records]
        names = list(dict.fromkeys(name for record in found for name in record))
        columns = {name: [record.get(name, "") for record in found] for name in names}
        piece, worker = zip(*sorted(self._pieces), strict=True)
        return [
            Table(name=WORKERS, columns=columns, attributes={"about": "a row for each who measured pieces"}),
            Table(
                name=PIECES,
                columns={"piece": list(piece), "worker": np.array(worker, np.int32)},
                attributes={"about": f"worker: the row of {WORKERS}, from 0 on"},
            ),
        ]


def measured(found: Mapping[str, Table]) -> Iterator[tuple[str, dict[str, str]]]:
    """Each piece and who measured it, from the tables of a store; nothing where it does not say.

    StoreError where its tables do not fit together.
    """
    if not {WORKERS, PIECES} <= found.keys():
        return
    workers, columns = found[WORKERS].columns, found[PIECES].columns
    try:
        rows = zip(*workers.values(), strict=True)
        known = [dict(zip(workers, map(str, row), strict=True)) for row in rows]
        for piece, worker in zip(columns["piece"], columns["worker"], strict=True):
            yield str(piece), known[int(worker)]
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise StoreError(f"the tables of who measured what do not fit together: {error}") from error


def join(file: Any, parts: Sequence[Path], provenance: Provenance) -> None:
    """Write the tables whose rows these parts hold, a part at a time."""
    for name, group in groupby(sorted(parts, key=name_of), key=table_of):
        _join(file, name, list(group), provenance)


def _join(file: Any, name: str, parts: Sequence[Path], provenance: Provenance) -> None:
    lengths = np.zeros(len(parts) + 1, np.int64)
    for j, part in enumerate(parts):
        with access.opened(part) as source:
            lengths[j + 1] = lengths[j] + _length(source[name_of(part)])
    with access.opened(parts[0]) as source:
        first = tables.read(source[name_of(parts[0])], name)
    group = tables.begin(file, first)
    whole = {
        column: tables.column(group, first, column, (int(lengths[-1]), *np.shape(values)[1:]))
        for column, values in first.columns.items()
    }
    sums = {column: hashlib.sha256() for column in whole}
    for j, part in enumerate(parts):
        known = seal.find(part)
        if known is None or not seal.is_whole(part, known):
            raise StoreError(f"{part.name} is damaged: give the same command again, and it is measured again")
        with access.opened(part) as source:
            provenance.note(name_of(part), by_of(source))
            rows = source[name_of(part)]
            found = {column: access.column(rows[column]) for column in access.members(rows)}
            like = {column: (x.dtype.kind, x.shape[1:]) for column, x in found.items()}
            if like != {
                column: (np.asarray(x).dtype.kind, np.shape(x)[1:]) for column, x in first.columns.items()
            }:
                raise StoreError(f"{part.name} has other columns than the rows of {name} before it")
            for column, values in found.items():
                whole[column][lengths[j] : lengths[j + 1]] = values
                sums[column].update(_bytes(values))
    for column, dataset in whole.items():
        back = hashlib.sha256()
        for values in digests.blocks(dataset):
            back.update(_bytes(values))
        if back.digest() != sums[column].digest():
            raise StoreError(f"{name}/{column} was damaged on its way: check disk and memory")


def _length(group: Any) -> int:
    name = next(iter(group))
    return len(group[name])


def _bytes(values: np.ndarray) -> bytes:
    if values.dtype.kind == "O":
        return "".join(f"{text}\0" for text in values.ravel()).encode("utf-8", "surrogatepass")
    return np.ascontiguousarray(values).tobytes()
