"""Pieces of a study in the collection: rows of many pieces as one table, and who measured each piece.

A part ``rows-<table>/<piece>.h5`` holds rows of a table; the collection concatenates them in the order of the
names of their pieces.  So a store has as many tables whether a thousand pieces or a million were measured.
The root of a part records the workers that measured it; the collection has one row for each worker, and one
for each piece.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.errors import StoreError
from springcheck.store import access, seal, tables
from springcheck.store.parts import name_of, table_of
from springcheck.store.tables import Table

BY = "measured_by"
"""Attribute of a part's root that records the workers: a list of records as JSON."""

WORKERS, PIECES = "provenance/workers", "provenance/pieces"

Worker = Mapping[str, str]
"""Provenance of a worker: host, processor, versions ..."""


def by_text(by: Sequence[Worker]) -> dict[str, str]:
    """The attribute of a part that says by whom it was measured; none where that is not known."""
    return {BY: json.dumps([dict(record) for record in by], sort_keys=True)} if by else {}


def by_of(file: Any) -> list[dict[str, str]]:
    """The workers that measured an open part."""
    try:
        return list(access.json(str(access.attribute(file, BY) or "[]"), list[dict[str, str]]))
    except ValueError:
        return []


def provenance(by: Sequence[tuple[str, Worker]]) -> list[Table]:
    """Pieces and who measured them as tables: a row for each worker, and one for each piece with the row of
    its worker."""
    if not by:
        return []
    texts = [json.dumps(worker, sort_keys=True) for _, worker in by]
    rows = {text: row for row, text in enumerate(dict.fromkeys(texts))}
    found: list[dict[str, str]] = [json.loads(text) for text in rows]
    names = list(dict.fromkeys(name for record in found for name in record))
    columns = {name: [record.get(name, "") for record in found] for name in names}
    pairs = {(piece, rows[text]) for (piece, _), text in zip(by, texts, strict=True)}
    piece, worker = zip(*sorted(pairs), strict=True)
    return [
        Table(name=WORKERS, columns=columns, attributes={"about": "a row for each who measured pieces"}),
        Table(
            name=PIECES,
            columns={"piece": list(piece), "worker": np.array(worker, np.int32)},
            attributes={"about": f"worker: the row of {WORKERS}, from 0 on"},
        ),
    ]


def measured(found: Mapping[str, Table]) -> Iterator[tuple[str, dict[str, str]]]:
    """Each piece and who measured it, from the tables of a store; empty where they are not recorded.
    StoreError where its tables contradict each other."""
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


def joined(parts: Sequence[Path], by: list[tuple[str, Worker]]) -> Iterator[Table]:
    """The tables of these parts, rows of one table joined; adds each piece to `by`, and who measured it."""
    for name, group in groupby(sorted(parts, key=lambda part: (table_of(part), name_of(part))), key=table_of):
        yield _joined(name, list(group), by)


def _joined(name: str, parts: Sequence[Path], by: list[tuple[str, Worker]]) -> Table:
    first: Any = None
    columns: dict[str, list[np.ndarray]] = {}
    for part in parts:
        known = seal.find(part)
        if known is None or not seal.is_whole(part, known):
            raise StoreError(f"{part.name} is damaged: give the same command again, and it is measured again")
        with access.opened(part) as source:
            by += [(name_of(part), worker) for worker in by_of(source)]
            table = tables.read(source[name_of(part)], name)
        if len(parts) == 1:
            return table
        first = first or table
        if _kinds(table) != _kinds(first):
            raise StoreError(f"{part.name} has other columns than the rows of {name} before it")
        for column, x in table.columns.items():
            columns.setdefault(column, []).append(np.asarray(x))
    joined: Table = replace(first, columns={name: np.concatenate(x) for name, x in columns.items()})
    return joined


def _kinds(table: Table) -> dict[str, tuple[Any, ...]]:
    columns = {column: np.asarray(x) for column, x in table.columns.items()}
    return {column: (x.dtype, x.shape[1:]) for column, x in columns.items()}
