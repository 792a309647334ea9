"""The journal of a store that is being written: no reported number is ever lost.

Finished trajectories and tables are files of their own in ``<file>.parts/``, put there by os.replace and
fsync.  `Journal.commit` writes a collection of all parts, checks the digests, puts it in place by os.replace,
and only then removes the parts.  No file that holds reported numbers is ever changed.  A process that is
killed at any point finds everything when it is started again.
"""

from __future__ import annotations

import contextlib
import os
import re
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from urllib.parse import quote

import h5py
import msgspec

from springcheck import interrupts
from springcheck.errors import StoreError, StoreWarning, plain
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory, Verdict
from springcheck.store import access, adopt, files, layout, merge, pieces, reading, records, seal, tables
from springcheck.store.access import Scalar
from springcheck.store.draft import Draft
from springcheck.store.parts import JournalClaim, Parts, claim, name_of, opened, parts_folder, parts_in
from springcheck.store.tables import Table

COLLECTION = "collection.new"


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
    folder = path.absolute().parent
    if not folder.is_dir():
        raise StoreError(f"cannot write {path}: there is no folder {folder}")
    if path.is_dir():
        raise StoreError(f"cannot write {path}: it is a folder")
    if path.exists() and not path.is_file():
        # --force would put a file in the place of /dev/null
        raise StoreError(f"cannot write {path}: it is a device or a pipe, a store is a file")
    if path.suffix == ".toml":
        raise StoreError(f"cannot write {path}: a name in .toml is a scene's, not a store's")
    parts = parts_folder(path)
    with files.told(path, "write"):
        if not _is_free(parts):
            raise StoreError(f"cannot write {path}: {parts} stands where its journal goes; move it away")
        if path.exists() and not _is_ours(path):
            raise StoreError(
                f"{path} is no store of springcheck, and is not replaced; -o writes another file"
            )
    with files.told(folder, "write into"):
        parts.mkdir(exist_ok=True)
        lock = files.Lock(parts / "lock")
    try:
        with files.told(parts, "write"):
            run = _claim(path, parts, command, force=force)
    except BaseException:
        _leave(parts, "lock")
        lock.release()
        raise
    return Journal(path, run, lock)


_NAMES = re.compile(rf"lock|command|undo|collection\.new|(run|table|rows)-.*\.h5|{files.TEMPORARY.pattern}")
"""Names of the files of a journal: no other file of its folder is ever touched."""


def _is_free(parts: Path) -> bool:
    """Whether a journal may be created here: the folder is missing, or recognisably one of ours."""
    if not os.path.lexists(parts):
        return True
    if parts.is_symlink() or not parts.is_dir():
        return False
    known = {entry.name for entry in parts.iterdir()}
    if "command" in known:
        with contextlib.suppress(StoreError):
            return claim(parts) is not None
        return False
    # left by a kill or a loss of power at the very beginning or end; the lock is looked at as it is taken
    return all(
        name == "lock"
        or files.TEMPORARY.fullmatch(name)
        or (_NAMES.fullmatch(name) and files.is_plain(parts / name) and _is_ours(parts / name))
        for name in known
    )


def _is_ours(path: Path) -> bool:
    """Whether a file is a store of ours, whole or damaged, or empty."""
    with path.open("rb") as file:
        start = file.read(1 << 20)
    hdf5 = start.startswith(b"\x89HDF\r\n\x1a\n") and b"springcheck store " in start
    return not start or hdf5 or start.startswith(b'{"name": "run-')


def _claim(path: Path, parts: Path, command: str, *, force: bool) -> str:
    """The run id of the journal, resumed or new."""
    known = claim(parts)
    if known is not None and path.is_file() and _run_of(path) == known.run:
        # killed as it tidied up: the store is complete
        _remove(parts, lambda name: name != "lock")
        known = None
    if known is not None and (not force or known.forced):
        if known.command == command:
            adopt.recover(parts, parts / COLLECTION, known.run)
            _remove(parts, lambda name: name.endswith(".new"))
            _look_at_parts(parts, known.run)
            return known.run
        if not force and not known.failed:
            raise StoreError(
                f"{parts} holds finished work of another command, or of other versions of what it runs: "
                "give that command again to complete it, or --force to discard it"
            )
    if path.exists() and not force:
        raise StoreError(f"{path} exists: --force writes it anew, -o writes another file")
    _remove(parts, lambda name: name not in {"lock", "command"})
    run = os.urandom(16).hex()
    JournalClaim(run=run, command=command, forced=force).write(parts)
    files.sync_folder(path.absolute().parent)
    return run


def _run_of(path: Path) -> str:
    """The run that wrote a store; "" where it does not say."""
    found = seal.find(path)
    if found is not None:
        return found.run
    with contextlib.suppress(StoreError), opened(path) as file:
        return str(access.attribute(file, "run"))
    return ""


def _look_at_parts(parts: Path, run: str) -> None:
    """Remove the damaged parts of a run, with a warning: they alone are measured again."""
    for part in parts_in(parts):
        name = name_of(part)
        known = seal.find(part)
        if known is not None and known.run != run:
            said = f"{part} is a part of another run and is left out: {name} is measured again"
        elif known is None or not seal.is_whole(part, known) or seal.broken(part, known.extents):
            part.unlink()
            said = f"{part} was damaged and is removed: {name} is measured again"
        else:
            continue
        warnings.warn(said, StoreWarning, stacklevel=5)


def _remove(parts: Path, which: Callable[[str], bool]) -> None:
    """Delete files of a journal, those of its names alone."""
    for entry in parts.iterdir():
        if _NAMES.fullmatch(entry.name) and which(entry.name):
            entry.unlink(missing_ok=True)


def _end(parts: Path) -> None:
    """Remove a journal: its claim first, so that a kill leaves an empty folder at worst."""
    (parts / "command").unlink(missing_ok=True)
    _remove(parts, lambda _: True)
    with contextlib.suppress(OSError):
        # files that a user has put into it stay
        parts.rmdir()


def _leave(parts: Path, *empty: str) -> None:
    """Remove a journal that holds no more than these files."""
    with interrupts.held(), contextlib.suppress(OSError):
        if {entry.name for entry in parts.iterdir()} <= {*empty}:
            _end(parts)


def _give_up(temporary: Path, run: str) -> None:
    """Undo a failed commit: the adopted part is restored, the disk space freed.

    Not while libhdf5 still has the file open, which it might write to later; then the next writer does it.
    """
    held = h5py.h5f.get_obj_ids(h5py.h5f.OBJ_ALL, h5py.h5f.OBJ_FILE)
    if not any(Path(h5py.h5f.get_name(one).decode()) == temporary for one in held):
        with contextlib.suppress(OSError, StoreError):
            adopt.recover(temporary.parent, temporary, run)
            temporary.unlink(missing_ok=True)


class Journal:
    """The only writer of a store: drafts, tables, commits.  A context manager that releases the lock."""

    def __init__(self, path: Path, run: str, lock: files.Lock) -> None:
        self.path, self.run = path, run
        self.folder = parts_folder(path)
        self._lock = lock
        self._sequence = 0

    def sources(self) -> dict[str, Path]:
        """Label of each finished trajectory -> the file that holds it (part or collection)."""
        return reading.sources(self.path, self.run)

    def finished(self) -> tuple[str, ...]:
        """Labels of the trajectories that are finished and need no second run."""
        return tuple(self.sources())

    def draft(self, label: str, scene: Scene) -> Draft:
        """A writer of one trajectory (see `Draft`)."""
        # the one writer need look at what is there only once
        self._sequence = (self._sequence or len(self.sources())) + 1
        path = self._part("run", label)
        return Draft(path, label, scene, sequence=self._sequence, run=self.run)

    def save(self, trajectory: Trajectory, scene: Scene) -> str:
        """Store a trajectory that is at hand in full -> digest."""
        with self.draft(trajectory.label, scene) as draft:
            draft.append(*(getattr(trajectory, x) for x in ("t", *layout.QUANTITIES)))
            return draft.finish(records.attributes(trajectory))

    def add(self, table: Table, *, by: Sequence[pieces.Worker] = (), rows: bool = False) -> None:
        """Store one table; once this returns it survives crashes.  `by` says who measured it.

        With `rows` it is a piece ``<table>/<piece>`` of a table: the final collection joins the rows of all
        pieces into one table, in the order of their names.
        """
        if table.name.split("/")[0] in layout.RESERVED:
            raise ValueError(f"a table cannot be called {table.name!r}")
        image = merge.image({"part": table.name, "run": self.run, **pieces.by_text(by)}, [table])
        with files.told(self.folder, "write"):
            files.put_bytes(image, self._part("rows" if rows else "table", table.name))

    def tables(self) -> Mapping[str, Table]:
        """The finished tables, and pieces of tables, by name; each is read on access."""
        return reading.tables_of(self.path, self.run, rows=True)

    def measured_by(self, name: str) -> list[dict[str, str]]:
        """Who measured a finished table that is not yet in the collection."""
        for kind in ("table", "rows"):
            if (part := self._part(kind, name)).is_file():
                with opened(part) as file:
                    return pieces.by_of(file)
        return []

    def commit(
        self,
        scene: Scene | None = None,
        *,
        comparison: Comparison | None = None,
        verdicts: Sequence[Verdict] = (),
        documents: Mapping[str, str] | None = None,
    ) -> None:
        """Write a collection of everything finished in the place of the store; the journal ends."""
        extra: list[Table] = []
        if comparison is not None:
            extra.append(tables.of_comparison(comparison))
        if verdicts:
            extra.append(tables.of_verdicts(verdicts))
        root: dict[str, Scalar] = {"run": self.run, "complete": True}
        if scene is not None:
            root |= {"scene": scene.to_toml(), "scene_name": scene.name, "units": scene.units}
        found = Parts.of(self.path, self.run)
        temporary = self.folder / COLLECTION
        # an adopted part no longer exists on its own
        copied = adopt.choice(found.runs) is None
        with files.told(self.path, "write"), files.unfinished(temporary) if copied else nullcontext():
            try:
                temporary.unlink(missing_ok=True)
                merge.collection(temporary, found, root, extra, documents or {})
                files.sync(temporary)
            except BaseException as error:
                # an interrupt as the file was opened leaves it to a frame, which holds it open
                traceback.clear_frames(error.__traceback__)
                _give_up(temporary, self.run)
                raise
            # whole once begun, in milliseconds: no interrupt leaves a complete store beside its journal
            with interrupts.held():
                files.move(temporary, self.path)
                adopt.settled(self.folder)
                for part in found.everything:
                    part.unlink(missing_ok=True)
                _end(self.folder)
                # the store is complete: the same command would refuse to overwrite it
                interrupts.announce(plain(f"interrupted; {self.path} is complete"))

    def _part(self, kind: str, name: str) -> Path:
        return self.folder / f"{kind}-{quote(name, safe='@-._')}.h5"

    def fail(self) -> None:
        """Note that a method of this command failed.  The same command resumes what is finished; any other,
        such as the corrected one, may replace it."""
        if known := claim(self.folder):
            with files.told(self.folder, "write"):
                msgspec.structs.replace(known, failed=True).write(self.folder)

    def close(self) -> None:
        """Release the lock; what is finished stays for the next writer."""
        _leave(self.folder, "lock", "command")
        self._lock.release()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
