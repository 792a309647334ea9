"""Tables beside the trajectories: one dataset per column, drawn by silx and H5Web where a signal is named."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass, field, fields
from typing import Any

import h5py
import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.trajectory import Comparison, Limits, Verdict
from springcheck.store import access
from springcheck.store.access import Scalar
from springcheck.store.layout import RESERVED, write_attributes, write_unit

_STYLE = "SILX_style"
"""The attribute from which silx and H5Web take scales."""
DEEPEST = 8
"""Groups that a table lies in."""
MOST_VERDICTS = 1 << 17
"""Most verdicts in a table: every check of the most trajectories that a store may hold."""
_PASSED = {None: -1, False: 0, True: 1}
_VERDICT = {
    "method": "O", "check": "O", "value": "f", "bound": "f", "unit": "O", "passed": "i", "why": "O",
    **{f"sees_{one.name}": "f" for one in fields(Limits)},
}  # fmt: skip
_OWN = tuple(name for name in _VERDICT if not name.startswith("sees_"))
"""Columns of the table of verdicts, and their kinds; stores of earlier formats have fewer limits."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """Columns of one or two dimensions under a name such as ``precision/own:euler``.

    They hold numbers, booleans or text; `units` has the unit of a column.  A viewer draws the column
    `signal` over `axes` ("." for an index), with the columns `auxiliary`; those in `log` logarithmically.
    """

    name: str
    columns: Mapping[str, np.ndarray | Sequence[str] | Sequence[float]]
    units: Mapping[str, str] = field(default_factory=dict)
    attributes: Mapping[str, Scalar] = field(default_factory=dict)
    signal: str = ""
    axes: tuple[str, ...] = ()
    auxiliary: tuple[str, ...] = ()
    log: tuple[str, ...] = ()


def write(file: Any, table: Table) -> None:
    """Write a table into an open file."""
    parts = table.name.split("/")
    if not all(parts) or {".", ".."} & set(parts):
        raise ValueError(f"{table.name!r} cannot name a table")
    group = file.create_group(table.name)
    known: dict[str, Any] = {"kind": "table", **table.attributes}
    if table.signal:
        known |= {"NX_class": "NXdata", "signal": table.signal}
        known |= {"axes": list(table.axes)} if table.axes else {}
        known |= {"auxiliary_signals": list(table.auxiliary)} if table.auxiliary else {}
    if table.signal and table.log:
        *axes, signal = ("log" if name in table.log else "linear" for name in (*table.axes, table.signal))
        # the plural is silx's, the singular H5Web's
        style = {"axes_scale_types": axes, "axes_scale_type": axes, "signal_scale_type": signal}
        known[_STYLE] = json.dumps(style)
    write_attributes(group, known)
    for name, given in table.columns.items():
        values = np.asarray(given)
        is_text = values.dtype.kind in "UO"
        kind = h5py.string_dtype("utf-8") if is_text else values.dtype
        dataset = group.create_dataset(name, values.shape, kind)
        dataset[...] = values.astype(object) if is_text else values
        if name in table.units:
            write_unit(dataset, table.units[name])


def read(group: Any, name: str) -> Table:
    """A table as it was written.  StoreError where it is none."""
    known = access.attributes(group)
    left = {"kind", "NX_class", "signal", "axes", "auxiliary_signals", _STYLE, "sha256"}
    signal, axes = str(known.get("signal", "")), _listed(known.get("axes"))
    style: dict[str, Any] = {}
    with contextlib.suppress(ValueError):
        style = access.json(str(known.get(_STYLE, "{}")), dict[str, Any])
    scales = [*_listed(style.get("axes_scale_types")), style.get("signal_scale_type")]
    columns = {column: access.dataset_at(group, column) for column in access.members(group)}
    units = {column: access.attribute(dataset, "unit") for column, dataset in columns.items()}
    return Table(
        name=name,
        columns={column: access.column(dataset) for column, dataset in columns.items()},
        units={column: str(unit) for column, unit in units.items() if unit is not None},
        attributes={key: value for key, value in known.items() if key not in left},
        signal=signal,
        axes=axes,
        auxiliary=_listed(known.get("auxiliary_signals")),
        log=tuple(column for column, scale in zip((*axes, signal), scales, strict=False) if scale == "log"),
    )


def _listed(value: Any) -> tuple[str, ...]:
    return tuple(map(str, value)) if isinstance(value, list) else ()


def names(file: Any) -> Iterator[str]:
    """Names of the tables of an open file, but for those that every store has."""

    def into(place: str, node: Any) -> bool:
        return place not in RESERVED and not _is_table(node)

    for place, _, node in access.walk(file, DEEPEST, into):
        if place not in RESERVED and _is_table(node):
            yield place


def _is_table(node: Any) -> bool:
    return access.is_group(node) and access.attribute(node, "kind") == "table"


def of_verdicts(verdicts: Sequence[Verdict]) -> Table:
    """Verdicts as a table; passed is 1, 0, or -1 where the check does not apply."""
    # an unknown limit, None, becomes NaN
    rows = [[*(getattr(v, name) for name in _OWN), *astuple(v.sees)] for v in verdicts]
    passed = [_PASSED[v.passed] for v in verdicts]
    types = {"O": object, "f": np.float64, "i": np.int8}
    columns = {
        name: np.array(passed if name == "passed" else values, dtype=types[kind])
        for (name, kind), values in zip(_VERDICT.items(), zip(*rows, strict=True), strict=True)
    }
    about = (
        "passed: 1 yes, 0 no, -1 the check does not apply; sees_...: the relative change of the "
        "parameter from which on the check fails, NaN where it says nothing of it"
    )
    return Table(name="verdicts", columns=columns, attributes={"about": about})


def to_verdicts(table: Table) -> tuple[Verdict, ...]:
    """The verdicts of such a table.  StoreError where it is none."""
    kept = {name: kind for name, kind in _VERDICT.items() if name in _OWN or name in table.columns}
    columns = [_column(table, name, kind).tolist() for name, kind in kept.items()]
    if len(columns[0]) > MOST_VERDICTS:
        raise StoreError(f"the table of verdicts has {len(columns[0])} rows, more than springcheck writes")
    back = {number: passed for passed, number in _PASSED.items()}
    found = []
    try:
        for row in zip(*columns, strict=True):
            known = dict(zip(kept, row, strict=True))
            own = {name: known.pop(name) for name in _OWN}
            sees = {name.removeprefix("sees_"): None if np.isnan(x) else x for name, x in known.items()}
            found.append(Verdict(**own | {"passed": back[own["passed"]]}, sees=Limits(**sees)))
    except (ValueError, KeyError) as error:
        raise StoreError("the table of verdicts is none of ours: its columns do not fit together") from error
    return tuple(found)


def _column(table: Table, name: str, kind: str, dimensions: int = 1) -> np.ndarray:
    found = np.asarray(table.columns.get(name))
    if found.dtype.kind != kind or found.ndim != dimensions or name not in table.columns:
        raise StoreError(f"table {table.name} has no column {name} of the kind that we write")
    return found


def of_comparison(comparison: Comparison) -> Table:
    """A comparison as a table that viewers draw as an image."""
    return Table(
        name="comparison",
        columns={"labels": list(comparison.labels), "max_difference": comparison.max_difference},
        units={"max_difference": "1"},
        attributes={"about": "largest difference over all frames, relative to the initial energy norm"},
        signal="max_difference",
        log=("max_difference",),
    )


def to_comparison(table: Table) -> Comparison:
    """The comparison of such a table.  StoreError where it is none."""
    labels = tuple(map(str, _column(table, "labels", "O")))
    found = _column(table, "max_difference", "f", 2)
    if found.shape != (len(labels), len(labels)):
        raise StoreError(f"the comparison of {len(labels)} trajectories has shape {found.shape}")
    return Comparison(labels=labels, max_difference=found)
