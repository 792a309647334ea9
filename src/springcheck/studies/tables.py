"""Results as tables of a store and back, bitwise, by the fields of their dataclasses.

A field becomes a column of its name, a dictionary of numbers a column for each of the `keys` in its metadata.
Unknown numbers (None) are NaN and unknown counts -1; tuples of numbers are rows of two dimensions,
NaN-padded.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Generic, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from springcheck.store import Table

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Form(Generic[T]):
    """Stored form of one kind of result.  A table's name is `beginning` and the method of its result."""

    kind: type[Any]
    beginning: str
    named: str = "method"
    """The field that holds the key and is no column; empty where there is none."""
    units: Mapping[str, str] = field(default_factory=dict)
    signal: str = ""
    axes: tuple[str, ...] = ()
    auxiliary: tuple[str, ...] = ()
    log: tuple[str, ...] = ()
    about: str = ""
    extra: Callable[[T], Mapping[str, Any]] = lambda found: {}
    """Columns for viewers that follow from the others; they are not read back."""
    line: Callable[[T], str] = lambda found: ""
    """The result in a line, printed as soon as it is measured."""

    def names(self, found: Sequence[Any]) -> list[str]:
        """Names of the tables of these results."""
        return [self.beginning + method for method in dict.fromkeys(one.method for one in found)]

    def table(self, key: str, found: T) -> Table:
        """The result as a table; a signal is named where its axes have finite points."""
        kept, more = self._split(found)
        kept |= self.extra(found)
        shown = all(np.any(np.isfinite(kept[axis])) for axis in self.axes)
        names = ("signal", "axes", "auxiliary", "log") if shown else ()
        drawn = {name: getattr(self, name) for name in names}
        about = {"about": self.about} if self.about else {}
        units = {name: unit for name, unit in self.units.items() if name in kept}
        return Table(
            name=self.beginning + key, columns=kept, units=units, attributes={**about, **more}, **drawn
        )

    def found(self, table: Table) -> T:
        """The result in such a table.  KeyError where it has another form."""
        raise NotImplementedError

    def listed(self, table: Table) -> list[Any]:
        """Its rows, or the one result that it is."""
        found: Any = self.found(table)
        return found if isinstance(found, list) else [found]

    def _split(self, found: T) -> tuple[dict[str, Any], dict[str, Any]]:
        """Columns and attributes."""
        raise NotImplementedError

    def _key(self, table: Table) -> dict[str, Any]:
        return {self.named: table.name.removeprefix(self.beginning)} if self.named else {}

    @property
    def _fields(self) -> list[_Field]:
        return [one for one in _fields(self.kind) if one.name != self.named]


class RecordForm(Form[T]):
    """One result per table: its arrays are the columns, its numbers and texts the attributes."""

    def _split(self, found: T) -> tuple[dict[str, Any], dict[str, Any]]:
        values = [(one, getattr(found, one.name)) for one in self._fields]
        arrays = {one.name: x for one, x in values if one.is_array}
        return arrays, {one.name: x for one, x in values if not one.is_array}

    def found(self, table: Table) -> T:
        columns, attributes = table.columns, table.attributes
        values = {
            one.name: np.asarray(columns[one.name]) if one.is_array else attributes[one.name]
            for one in self._fields
        }
        return self.kind(**self._key(table), **values)  # type: ignore[no-any-return]


class Rows(Form[Sequence[T]]):
    """One result per row."""

    def _split(self, found: Sequence[T]) -> tuple[dict[str, Any], dict[str, Any]]:
        return dict(_columns(self._fields, found)), {}

    def found(self, table: Table) -> list[T]:
        key = self._key(table)
        parts = [(one, _values(one, table)) for one in self._fields]
        count = len(parts[0][1]) if parts else 0
        return [self.kind(**key, **{one.name: values[row] for one, values in parts}) for row in range(count)]


@dataclass(frozen=True, slots=True)
class _Field:
    name: str
    hint: Any
    optional: bool
    keys: tuple[str, ...]
    is_array: bool


def _fields(kind: Any) -> tuple[_Field, ...]:
    hints = get_type_hints(kind)
    found = []
    for one in fields(kind):
        hint, optional = hints[one.name], False
        if get_origin(hint) in (Union, types.UnionType):
            (hint,) = (x for x in get_args(hint) if x is not type(None))
            optional = True
        if get_origin(hint) is Literal:
            hint = str
        # from NumPy 2.5 on an array's hint is an alias with an origin of its own
        array = get_origin(hint) in (tuple, np.ndarray, NDArray) or hint is np.ndarray
        found.append(_Field(one.name, hint, optional, one.metadata.get("keys", ()), is_array=array))
    return tuple(found)


def _columns(parts: Sequence[_Field], rows: Sequence[Any]) -> Iterator[tuple[str, Any]]:
    for one in parts:
        values: list[Any] = [None if row is None else getattr(row, one.name) for row in rows]
        if is_dataclass(one.hint):
            yield from _columns(_fields(one.hint), values)
        elif one.keys:
            for key in one.keys:
                yield key, np.array([value.get(key, np.nan) for value in values], np.float64)
        elif one.hint is str:
            yield one.name, [str(value) for value in values]
        elif one.is_array:
            filled = np.full((len(values), max([1, *map(len, values)])), np.nan)
            for row, value in zip(filled, values, strict=True):
                row[: len(value)] = value
            yield one.name, filled
        elif one.hint is int:
            yield one.name, np.array([-1 if value is None else value for value in values], np.int64)
        else:
            yield one.name, np.array([np.nan if value is None else value for value in values], np.float64)


def _values(one: _Field, table: Table) -> list[Any]:
    """The field's values in the rows of a table."""
    if is_dataclass(one.hint):
        names = [part.name for part in _fields(one.hint)]
        rows = zip(*(_values(part, table) for part in _fields(one.hint)), strict=True)
        # a result is unknown where its first number is NaN
        kind: Any = one.hint
        return [None if np.isnan(row[0]) else kind(**dict(zip(names, row, strict=True))) for row in rows]
    if one.keys:
        columns = {key: np.asarray(table.columns[key], np.float64).tolist() for key in one.keys}
        count = len(next(iter(columns.values())))
        return [{k: v[row] for k, v in columns.items() if not np.isnan(v[row])} for row in range(count)]
    found = np.asarray(table.columns[one.name])
    if one.is_array:
        return [tuple(row[~np.isnan(row)].tolist()) for row in found]
    values: list[Any] = found.tolist()
    if not one.optional:
        return values
    return [None if np.isnan(value) or (one.hint is int and value < 0) else value for value in values]
