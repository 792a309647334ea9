"""Tables beside the trajectories: one dataset per column, drawn by silx and H5Web where a signal is named."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np

from springcheck.store.layout import RESERVED, Scalar, write_attributes
from springcheck.trajectory import Comparison, Verdict

_STYLE = "SILX_style"
"""The attribute from which silx and H5Web take scales."""
_PASSED = {None: -1, False: 0, True: 1}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """Columns of one or two dimensions under a name such as ``precision/own:euler``.

    Numbers, truth values or text.  `units` by column; `signal` and `axes` name the columns that a viewer
    draws ("." for an axis without one), `auxiliary` those beside the signal, `log` those of signal and axes
    that want a logarithmic scale.
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
    write_attributes(group, {"kind": "table", **table.attributes})
    if table.signal:
        write_attributes(group, {"NX_class": "NXdata", "signal": table.signal})
        if table.axes:
            write_attributes(group, {"axes": list(table.axes)})
        if table.auxiliary:
            write_attributes(group, {"auxiliary_signals": list(table.auxiliary)})
        if table.log:
            scale = {name: "log" if name in table.log else "linear" for name in (*table.axes, table.signal)}
            axes = [scale[name] for name in table.axes]
            # the plural is silx's, the singular H5Web's
            style = {
                "axes_scale_types": axes,
                "axes_scale_type": axes,
                "signal_scale_type": scale[table.signal],
            }
            write_attributes(group, {_STYLE: json.dumps(style)})
    for name, column in table.columns.items():
        values = np.asarray(column)
        if values.dtype.kind in "UO":
            group.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype("utf-8"))
        else:
            group.create_dataset(name, data=values)
        if name in table.units:
            unit = table.units[name]
            write_attributes(group[name], {"unit": unit, "units": unit})
    write_attributes(group, {"sha256": digest(group)})


def digest(group: Any) -> str:
    """sha256 of a table's columns: names, shapes and values."""
    total = hashlib.sha256()
    for name in sorted(group):
        values = _values(group[name])
        total.update(f"{name} {values.shape} {values.dtype.str}\n".encode())
        if values.dtype.kind == "O":
            total.update("\0".join(str(x) for x in values.ravel()).encode("utf-8", "surrogatepass"))
        else:
            total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def read(group: Any, name: str) -> Table:
    """A table as it was written."""
    left = {"kind", "NX_class", "signal", "axes", "auxiliary_signals", _STYLE, "sha256"}
    signal = str(group.attrs.get("signal", ""))
    axes = tuple(str(axis) for axis in group.attrs.get("axes", ()))
    style = json.loads(group.attrs.get(_STYLE, "{}"))
    scales = [*style.get("axes_scale_types", ()), style.get("signal_scale_type")]
    return Table(
        name=name,
        columns={column: _values(group[column]) for column in group},
        units={column: group[column].attrs["unit"] for column in group if "unit" in group[column].attrs},
        attributes={key: scalar(value) for key, value in group.attrs.items() if key not in left},
        signal=signal,
        axes=axes,
        auxiliary=tuple(str(column) for column in group.attrs.get("auxiliary_signals", ())),
        log=tuple(column for column, scale in zip((*axes, signal), scales, strict=False) if scale == "log"),
    )


def names(file: Any) -> Iterator[str]:
    """Names of the tables of an open file, but for those that every store has."""
    for top in file:
        if top not in RESERVED and isinstance(file.get(top), h5py.Group):
            yield from _within(file[top], top)


def _within(group: Any, name: str, depth: int = 0) -> Iterator[str]:
    if group.attrs.get("kind") == "table":
        yield name
    elif depth < 8:
        for child in group:
            if isinstance(group.get(child), h5py.Group):
                yield from _within(group[child], f"{name}/{child}", depth + 1)


def _values(dataset: Any) -> np.ndarray:
    if h5py.check_string_dtype(dataset.dtype) is not None:
        return np.asarray(dataset.asstr()[()], dtype=object)
    return np.asarray(dataset[()])


def scalar(value: Any) -> Scalar:
    """An attribute as a plain Python value; arrays as text."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.bool_ | bool):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.floating):
        return float(value)
    return value if isinstance(value, str | int | float) else str(value)


def of_verdicts(verdicts: Sequence[Verdict]) -> Table:
    """Verdicts as a table; passed is 1, 0, or -1 where the check does not apply."""
    return Table(
        name="verdicts",
        columns={
            "method": [v.method for v in verdicts],
            "check": [v.check for v in verdicts],
            "value": np.array([v.value for v in verdicts], dtype=np.float64),
            "bound": np.array([v.bound for v in verdicts], dtype=np.float64),
            "unit": [v.unit for v in verdicts],
            "passed": np.array([_PASSED[v.passed] for v in verdicts], dtype=np.int8),
            "why": [v.why for v in verdicts],
        },
        attributes={"about": "passed: 1 yes, 0 no, -1 the check does not apply"},
    )


def to_verdicts(table: Table) -> tuple[Verdict, ...]:
    """The verdicts of such a table."""
    columns = [table.columns[name] for name in ("method", "check", "value", "bound", "unit", "passed", "why")]
    back = {number: passed for passed, number in _PASSED.items()}
    return tuple(
        Verdict(
            method=str(method),
            check=str(check),
            value=float(value),
            bound=float(bound),
            unit=str(unit),
            passed=back[int(passed)],
            why=str(why),
        )
        for method, check, value, bound, unit, passed, why in zip(*columns, strict=True)
    )


def of_comparison(comparison: Comparison) -> Table:
    """A comparison as a table that viewers draw as an image."""
    return Table(
        name="comparison",
        columns={"labels": list(comparison.labels), "max_difference": comparison.max_difference},
        units={"max_difference": "1"},
        attributes={"about": "largest difference over all frames, in units of the start"},
        signal="max_difference",
        log=("max_difference",),
    )


def to_comparison(table: Table) -> Comparison:
    """The comparison of such a table."""
    return Comparison(
        labels=tuple(str(label) for label in table.columns["labels"]),
        max_difference=np.asarray(table.columns["max_difference"], dtype=np.float64),
    )
