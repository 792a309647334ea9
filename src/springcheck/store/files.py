"""Files that are written whole or not at all: locks, room, fsync, and errors in one line."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import platform
import re
import shutil
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from springcheck.errors import StoreError

JOURNAL = ".parts"
"""Ending of the folder of a store that is being written."""

CAUSES = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EFBIG: "the file would be larger than this system allows",
    errno.EROFS: "the disk is read-only",
    errno.EACCES: "permission denied",
    errno.EPERM: "permission denied",
    errno.ENOENT: "there is no such file",
    errno.EISDIR: "it is a folder",
    errno.ENOTDIR: "a part of its path is no folder",
    errno.EAGAIN: "another program is writing it; try again when it is done",
    errno.EIO: "the disk reports an error",
    errno.ENAMETOOLONG: "its name is too long",
}


def cause(error: BaseException) -> str:
    """What an exception of the system or of HDF5 says, in a few words."""
    if isinstance(error, MemoryError):
        return "it asks for more memory than there is"
    if not isinstance(error, OSError):
        return "it is damaged, or its layout is not what its name says"
    said = str(error)
    number = error.errno or int(next(iter(re.findall(r"errno = (\d+)", said)), 0))
    if number in CAUSES:
        return CAUSES[number]
    if "signature not found" in said:
        return "it is no HDF5 file"
    if "truncated file" in said:
        return "it is cut off: its end is missing"
    return error.strerror or f"it is damaged ({' '.join(said.split())[:120]})"


def shown(path: Path) -> Path:
    """The name under which a user knows a file: a part of a journal is the store's."""
    for one in (path, path.parent):
        if one.name.endswith(JOURNAL) and (one / "lock").exists():
            return one.with_name(one.name.removesuffix(JOURNAL))
    return path


@contextlib.contextmanager
def told(path: Path, doing: str) -> Iterator[None]:
    """Turn whatever goes wrong with a file into a StoreError of one line: "cannot `doing` path: why"."""
    try:
        yield
    except (
        OSError,
        KeyError,
        ValueError,
        TypeError,
        RuntimeError,
        AttributeError,
        IndexError,
        OverflowError,
        MemoryError,
    ) as error:
        raise StoreError(f"cannot {doing} {shown(path)}: {cause(error)}") from error


def room(path: Path, size: int) -> None:
    """Raise StoreError when `size` bytes [B] would not fit beside `path`."""
    folder = path.absolute().parent
    with told(folder, "look into"):
        free = shutil.disk_usage(folder).free
    if size > free:
        raise StoreError(
            f"{shown(path).name} would take {readable(size)}; {readable(free)} are free in {folder}: "
            "record less (every, quantities) or choose another folder with -o"
        )


def readable(size: float) -> str:
    """A number of bytes for people: "24 TB"."""
    for unit in ("bytes", "kB", "MB", "GB", "TB", "PB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} EB"


def reserve(file: BinaryIO, size: int) -> None:
    """Take up `size` bytes on the disk now, so that no later write can find it full.

    libhdf5 cannot close a file whose last write failed; with the room taken beforehand none fails.
    """
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
    else:
        file.seek(0, os.SEEK_END)
        block = bytes(1 << 20)
        for start in range(file.tell(), size, len(block)):
            file.write(block[: size - start])
        file.flush()


def sync_folder(folder: Path) -> None:
    """Make names in a folder survive a loss of power."""
    if sys.platform == "win32":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def put(temporary: Path, path: Path) -> None:
    """Move a complete file to its place: fsync, os.replace, fsync of the folder."""
    with temporary.open("rb+") as file:
        os.fsync(file.fileno())
    temporary.replace(path)
    sync_folder(path.absolute().parent)


def put_bytes(content: bytes, path: Path) -> None:
    """Write a small file whole or not at all."""
    temporary = path.with_name(path.name + ".new")
    try:
        temporary.write_bytes(content)
        put(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


class Lock:
    """One writer at a time.  The lock is the system's, so that it ends with its process, killed or not."""

    def __init__(self, path: Path) -> None:
        """Take the lock file `path`, or raise StoreError that says who holds it."""
        self.path = path
        while True:
            self._file = path.open("a+b")
            if not _taken(self._file):
                holder = self._holder()
                self._file.close()
                raise StoreError(f"{path.parent} is being written by {holder}: wait for it, or stop it first")
            # between open and lock the last holder may have removed the file: then its name is free again
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(path.stat(), os.fstat(self._file.fileno())):
                    break
            self._file.close()
        now = datetime.now(UTC).isoformat(timespec="seconds")
        self._file.truncate(0)
        self._file.write(json.dumps({"pid": os.getpid(), "host": platform.node(), "since": now}).encode())
        self._file.flush()

    def _holder(self) -> str:
        self._file.seek(0)
        try:
            who = json.loads(self._file.read())
            return f"process {who['pid']} on {who['host']} since {who['since']}"
        except (ValueError, KeyError, TypeError, OSError):
            return "another process"

    def release(self) -> None:
        """Give the lock back; its file stays until the journal goes."""
        self._file.close()

    def __enter__(self) -> Lock:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def _taken(file: BinaryIO) -> bool:
    if sys.platform == "win32":
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
