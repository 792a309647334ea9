"""The journal of a store that is being written: no reported number is ever lost.

Finished trajectories and tables are files of their own in ``<file>.parts/``, put there by os.replace and
fsync.  `Journal.commit` writes one file of all parts, checks the digests, puts it in place by os.replace,
and only then removes the parts.  No file that holds reported numbers is ever changed: appending to one HDF5
file in place would lose them, because a kill between two writes leaves its structure torn.  A process that is
killed at any point finds everything when it is started again.
"""

from __future__ import annotations

import contextlib
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import msgspec

from springcheck import interrupts
from springcheck.errors import StoreError, StoreWarning, plain
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory, Verdict
from springcheck.store import access, apart, checking, collection, files, layout, reading, records, tables
from springcheck.store.access import Scalar
from springcheck.store.draft import Draft
from springcheck.store.parts import TRIAL, Claim, Parts, claim, folder_of, name_of, opened, parts_in
from springcheck.store.tables import Table

_NAMES = re.compile(rf"lock|command|collection\.new|(run|table)-.*\.h5|{files.TEMPORARY.pattern}")
"""Names of the files of a journal: no other file of its folder is ever touched."""
_WORK = "springcheck", "collection", "run", "table"
"""Beginnings of the names of all of them but the lock and the claim."""


def open_new(path: str | Path, command: str, *, force: bool = False) -> Journal:
    """Start to write a store, or resume one that the same command left unfinished.

    `command` says all that decides the results (scene text, methods, options): it is how a journal is
    recognised.  Raises StoreError when the path exists and is no unfinished store of this command
    (`force` starts over, or resumes what it has started over itself; the old file stays until the new one is
    complete), when another process is writing it, and when the folder is missing or cannot be written.
    """
    path = Path(path)
    if path.is_symlink():
        # the link stays, and what it leads to is written
        path = path.resolve()
    folder, parts = path.absolute().parent, folder_of(path)
    for wrong, why in (
        (not folder.is_dir(), f"there is no folder {folder}"),
        (path.is_dir(), "it is a folder"),
        # --force would put a file in the place of /dev/null
        (path.exists() and not path.is_file(), "it is a device or a pipe, a store is a file"),
        (path.suffix == ".toml", "a name in .toml is a scene's, not a store's"),
    ):
        if wrong:
            raise StoreError(f"cannot write {path}: {why}")
    with files.told(path, "write"):
        if not _is_free(parts):
            raise StoreError(f"cannot write {path}: {parts} stands where its journal goes; move it away")
        if path.exists() and not _is_store(path):
            raise StoreError(
                f"{path} is no store of springcheck, and is not replaced; -o writes another file"
            )
    with files.told(folder, "write into"):
        parts.mkdir(exist_ok=True)
        lock = files.Lock(parts / "lock")
    try:
        with files.told(parts, "write"):
            run = _claimed(path, parts, command, force=force)
    except BaseException:
        if {entry.name for entry in parts.iterdir()} == {"lock"}:
            _leave(parts)
        lock.release()
        raise
    return Journal(path, run, lock)


def _is_free(parts: Path) -> bool:
    """Whether a journal may be created here: the folder is missing, or holds no file of another name."""
    if not os.path.lexists(parts):
        return True
    with contextlib.suppress(StoreError):
        # without a claim a kill or a loss of power has left it at the very beginning or end
        mine = parts.is_dir() and not parts.is_symlink()
        return mine and (claim(parts) is not None or all(map(_is_mine, parts.iterdir())))
    return False


def _is_mine(entry: Path) -> bool:
    """Whether a file is recognisably one of a journal: an empty lock, a temporary file, or a store."""
    if not files.is_plain(entry) or not _NAMES.fullmatch(entry.name):
        return False
    if entry.name == "lock":
        return entry.stat().st_size == 0
    return files.TEMPORARY.fullmatch(entry.name) is not None or _is_store(entry)


def _is_store(path: Path) -> bool:
    """Whether a file is a store of ours, whole or damaged, or empty."""
    return not path.stat().st_size or files.is_marked(path)


def _claimed(path: Path, parts: Path, command: str, *, force: bool) -> str:
    """The run id of the journal, resumed or new."""
    known = claim(parts)
    if known is not None and path.is_file() and _run_of(path) == known.run:
        # killed as it tidied up: the store is complete
        _remove(parts, "command")
        known = None
    if known is not None and (not force or known.forced):
        if known.command == command:
            _remove(parts, "springcheck", "collection")
            _look_at_parts(parts, known.run)
            return known.run
        if not force:
            raise StoreError(
                f"{parts} holds finished work of another command, or of other versions of what it runs: "
                "give that command again to complete it, or --force to discard it"
            )
    _remove(parts, *_WORK)
    if path.exists() and not force:
        raise StoreError(f"{path} exists: --force writes it anew, -o writes another file")
    claimed = Claim(run=os.urandom(16).hex(), command=command, forced=force)
    files.put_bytes(msgspec.json.encode(claimed), parts / "command")
    files.sync_folder(path.absolute().parent)
    return claimed.run


def _run_of(path: Path) -> str:
    """The run that wrote a store; "" where it does not say."""
    with contextlib.suppress(StoreError), opened(path) as file:
        return str(access.attribute(file, "run"))
    return ""


def _look_at_parts(parts: Path, run: str) -> None:
    """Remove the damaged parts of a run, with a warning: they alone are measured again."""
    there = [one for listed in parts_in(parts) for one in listed]
    with contextlib.suppress(StoreError):
        # all of them in one child process
        apart.trust(parts, TRIAL)
        for part in there:
            apart.know(part)
    for part in there:
        if checking.check_file(part) or _run_of(part) != run:
            part.unlink()
            why = f"{part} was damaged and is removed: {name_of(part)} is measured again"
            warnings.warn(why, StoreWarning, stacklevel=5)


def _remove(parts: Path, *beginnings: str) -> None:
    """Delete files of a journal whose names begin like this, and no other files."""
    for entry in parts.iterdir():
        if _NAMES.fullmatch(entry.name) and entry.name.startswith(beginnings):
            entry.unlink(missing_ok=True)


def _leave(parts: Path) -> None:
    """Remove a journal, its claim first; files that a user has put into it stay."""
    with contextlib.suppress(OSError):
        _remove(parts, "command")
        _remove(parts, "")
        parts.rmdir()


class Journal:
    """The only writer of a store: drafts, tables, commits.  A context manager that releases the lock."""

    def __init__(self, path: Path, run: str, lock: files.Lock) -> None:
        self.path, self.run, self.folder = path, run, folder_of(path)
        self._lock = lock
        self._sequence = 0

    def finished(self) -> dict[str, Path]:
        """Label of each trajectory that is finished and needs no second run -> the part that holds it."""
        return reading.sources(self.path, writing=True)

    def draft(self, label: str, scene: Scene) -> Draft:
        """Start to store a trajectory of this scene."""
        self._sequence = (self._sequence or len(Parts.of(self.path, writing=True).runs)) + 1
        return Draft(self._part("run", label), label, scene, sequence=self._sequence, run=self.run)

    def save(self, trajectory: Trajectory, scene: Scene) -> str:
        """Store a complete trajectory; returns its digest."""
        with self.draft(trajectory.label, scene) as draft:
            draft.append(*(getattr(trajectory, x) for x in ("t", *layout.QUANTITIES)))
            return draft.finish(records.attributes(trajectory))

    def add(self, table: Table) -> None:
        """Store one table; once this returns it survives crashes."""
        if table.name.split("/")[0] in layout.RESERVED:
            raise ValueError(f"a table cannot be called {table.name!r}")
        part = self._part("table", table.name)
        with files.told(self.folder, "write"):
            files.put_bytes(collection.image({"part": table.name, "run": self.run}, table), part)
            apart.know(part)

    def tables(self) -> Mapping[str, Table]:
        """The finished tables by name; each is read on access."""
        return reading.Tables({name_of(one): one for one in Parts.of(self.path, writing=True).tables})

    def commit(
        self,
        scene: Scene | None = None,
        *,
        comparison: Comparison | None = None,
        verdicts: Sequence[Verdict] = (),
        documents: Mapping[str, str] | None = None,
        solution: collection.Solution | None = None,
    ) -> None:
        """Write a file of everything finished in the place of the store; the journal ends."""
        extra = [] if comparison is None else [tables.of_comparison(comparison)]
        if verdicts:
            extra.append(tables.of_verdicts(verdicts))
        root: dict[str, Scalar] = {"run": self.run, "complete": True}
        if scene is not None:
            root |= {"scene": scene.to_toml(), "scene_name": scene.name, "units": scene.units}
        found = Parts.of(self.path, writing=True)
        with files.told(self.path, "write"), files.unfinished(self.folder / "collection.new") as made:
            made.unlink(missing_ok=True)
            collection.write(made, found.everything, root, extra, documents or {}, solution)
            files.put(made, self.path)
            apart.know(self.path)
            # the store is complete: the same command would refuse to overwrite it
            interrupts.announce(plain(f"interrupted; {self.path} is complete"))
            _leave(self.folder)

    def _part(self, kind: str, name: str) -> Path:
        return self.folder / f"{kind}-{quote(name, safe='@-._')}.h5"

    def close(self) -> None:
        """Release the lock; what is finished stays for the next writer."""
        if self.folder.is_dir() and {entry.name for entry in self.folder.iterdir()} <= {"lock", "command"}:
            _leave(self.folder)
        self._lock.release()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
