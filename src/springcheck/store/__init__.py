"""The HDF5 store: trajectories, verdicts and studies of one scene in one file; alone imports h5py.

Writing: ``with open_new(path, command) as journal`` and `Journal`.  Reading: `read`, `windows`, `strided`,
`end`, `summary`, `tables_of`, `verdicts`, `comparison`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from springcheck.errors import StoreError, StoreWarning
from springcheck.store.draft import Draft
from springcheck.store.files import need_space
from springcheck.store.journal import Journal, open_new
from springcheck.store.layout import machine, size
from springcheck.store.reading import (
    Run,
    Summary,
    comparison,
    decoded,
    digest,
    document,
    end,
    measured_by,
    read,
    read_one,
    scene_text,
    sources,
    strided,
    summary,
    tables_of,
    verdicts,
    windows,
)
from springcheck.store.records import attributes
from springcheck.store.tables import Table

if TYPE_CHECKING:
    from springcheck.store.checking import Damage, check, doubts
    from springcheck.store.exporting import export
    from springcheck.store.foreign import is_foreign, read_arrays, read_foreign

__all__ = [
    "Draft", "Damage", "Journal", "Run", "StoreError", "StoreWarning", "Summary", "Table", "attributes",
    "check", "comparison", "decoded", "digest", "document", "doubts", "end", "export", "machine",
    "is_foreign", "measured_by", "need_space", "open_new", "read", "read_arrays", "read_foreign",
    "read_one", "scene_text", "size", "sources", "strided", "summary", "tables_of", "verdicts",
    "windows",
]  # fmt: skip

_LATER = {
    **dict.fromkeys(("Damage", "check", "doubts"), "checking"),
    **dict.fromkeys(("is_foreign", "read_arrays", "read_foreign"), "foreign"),
    "export": "exporting",
}
"""What no run needs, and the module that it is imported from when it is first used."""


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LATER[name]}"), name)
