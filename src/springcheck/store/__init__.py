"""The HDF5 store: trajectories, verdicts and studies of one scene in one file; alone imports h5py.

Writing: ``with open_new(path, command) as journal`` and `Journal`.  Reading: `read`, `windows`, `strided`,
`end`, `summary`, `tables_of`, `verdicts`, `comparison`.
"""

from springcheck.errors import StoreError, StoreWarning
from springcheck.store.checking import Damage, check, doubts
from springcheck.store.collection import Solution
from springcheck.store.draft import Draft
from springcheck.store.exporting import export
from springcheck.store.files import need_space
from springcheck.store.journal import Journal, open_new
from springcheck.store.layout import need_names, size
from springcheck.store.reading import (
    Summary,
    comparison,
    decoded,
    digest,
    document,
    end,
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
from springcheck.store.records import Run, attributes, machine
from springcheck.store.tables import Table

__all__ = [
    "Draft", "Damage", "Journal", "Run", "Solution", "StoreError", "StoreWarning", "Summary", "Table",
    "attributes", "check", "comparison", "decoded", "digest", "document", "doubts", "end", "export",
    "machine", "need_names", "need_space", "open_new", "read", "read_one", "scene_text", "size", "sources",
    "strided", "summary", "tables_of", "verdicts", "windows",
]  # fmt: skip
