"""Files written whole or not at all: temporary names, fsync, free space, a lock, and errors in one line."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import sys
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from springcheck import interrupts
from springcheck.errors import StoreError, StoreWarning

JOURNAL = ".parts"
"""Ending of the folder of a store that is being written."""

TEMPORARY = re.compile(r"springcheck-[0-9a-f]{16}\.new")
"""Names of temporary files: none that a user would choose."""

UNSUPPORTED = {errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL, errno.ENOLCK}
"""Error numbers of a file system that lacks an operation."""

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
    errno.EMFILE: "too many files are open (ulimit -n)",
    errno.ENFILE: "too many files are open on this machine",
}

BROKEN = (
    OSError, LookupError, ValueError, TypeError, RuntimeError, AttributeError, ArithmeticError, MemoryError
)  # fmt: skip
"""Exceptions that reading a damaged file may raise."""


def cause(error: BaseException, *, writing: bool = False) -> str:
    """Message of an exception of the system or of HDF5, in a few words."""
    if isinstance(error, MemoryError):
        return "it asks for more memory than there is"
    if not isinstance(error, OSError):
        return "it is damaged, or its layout is not what its name says"
    said, number = str(error), number_of(error)
    if writing and number == errno.ENOENT:
        # its folder exists, as /proc does, or has just been removed
        return "no file can be made there"
    if number in CAUSES:
        return CAUSES[number]
    if "signature not found" in said:
        return "it is no HDF5 file"
    if "truncated file" in said:
        return "it is cut off: its end is missing"
    return error.strerror or f"it is damaged ({' '.join(said.split())[:120]})"


def number_of(error: OSError) -> int:
    """Error number of a system error, which libhdf5 gives within its text."""
    return error.errno or int(next(iter(re.findall(r"errno = (\d{1,9})", str(error))), 0))


@contextlib.contextmanager
def told(path: Path, doing: str) -> Iterator[None]:
    """Turn whatever goes wrong with a file into a StoreError of one line: "cannot `doing` path: why"."""
    try:
        yield
    except BROKEN as error:
        why = cause(error, writing=doing.startswith("write"))
        raise StoreError(f"cannot {doing} {_shown(path)}: {why}") from error


def _shown(path: Path) -> Path:
    """The name under which a user knows a file: for a file of a journal, or the journal, the store's."""
    folder = path.parent if path.parent.name.endswith(JOURNAL) else path
    return folder.with_name(folder.name.removesuffix(JOURNAL)) if folder.name else folder


def need_space(path: Path, size: int) -> None:
    """Raise StoreError when `size` bytes [B] would not fit at `path`, in a folder that need not exist."""
    with told(path, "write"):
        folder = next(one for one in path.absolute().parents if one.exists())
        free = shutil.disk_usage(folder).free
    if size > free:
        raise StoreError(
            f"{readable(size)} are needed, and {readable(free)} are free in {folder}: make room, "
            "record less (every, quantities), or choose another folder"
        )


def readable(size: float) -> str:
    """A number of bytes for people: "24 TB"."""
    for unit in ("bytes", "kB", "MB", "GB", "TB", "PB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} EB"


def reserve(file: BinaryIO, size: int) -> None:
    """Allocate `size` bytes on the disk, with zeros where the system cannot reserve.

    libhdf5 cannot close a file whose last write failed; with the space reserved beforehand none fails.
    """
    try:
        os.posix_fallocate(file.fileno(), 0, size)
    except (AttributeError, OSError) as error:
        if isinstance(error, OSError) and error.errno not in UNSUPPORTED:
            raise
        block = bytes(1 << 20)
        for start in range(file.seek(0, os.SEEK_END), size, len(block)):
            file.write(block[: size - start])
        file.flush()


def temporary(path: Path) -> Path:
    """A temporary name next to `path`, for a file that replaces it once complete."""
    return path.with_name(f"springcheck-{os.urandom(8).hex()}.new")


@contextlib.contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """A temporary file that is moved to its place when it is complete, and removed otherwise."""
    remove = partial(path.unlink, missing_ok=True)
    interrupts.takes(remove)
    try:
        yield path
    finally:
        with contextlib.suppress(OSError):
            remove()
        interrupts.forget(remove)


def put(complete: Path, path: Path) -> None:
    """Move a complete file to its place: fsync, os.replace, fsync of the folder."""
    with complete.open("rb+") as file:
        os.fsync(file.fileno())
    complete.replace(path)
    sync_folder(path.absolute().parent)


def put_bytes(content: bytes, path: Path) -> None:
    """Write a small file whole or not at all."""
    with unfinished(temporary(path)) as made:
        made.write_bytes(content)
        put(made, path)


def sync_folder(folder: Path) -> None:
    """Make names in a folder survive a loss of power."""
    if sys.platform == "win32":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in UNSUPPORTED:
            raise
    finally:
        os.close(handle)


def is_plain(path: Path) -> bool:
    """Whether a path is a file with one name, and no link to another one."""
    return path.is_file() and not path.is_symlink() and path.stat().st_nlink == 1


def is_marked(path: Path) -> bool:
    """Whether a file may be a store: the mark of its format is among its first bytes."""
    with told(path, "read"), path.open("rb") as file:
        start = file.read(1 << 20)
    return start.startswith(b"\x89HDF\r\n\x1a\n") and b"springcheck store " in start


class Lock:
    """One writer at a time: flock on a file, which ends with its process, killed or not."""

    def __init__(self, path: Path) -> None:
        """Lock the file `path`; StoreError where another process holds it."""
        if path.is_symlink() or (path.exists() and not is_plain(path)):
            raise StoreError(f"{path} stands where the lock of a store goes; move it away")
        while True:
            self._file: Any = path.open("ab")
            if not _locked(self._file):
                self.release()
                raise StoreError(f"{path.parent} is being written by another process: wait, or stop it")
            # the last holder may have removed the file between `open` and the lock
            if path.exists() and os.path.samestat(path.stat(), os.fstat(self._file.fileno())):
                return
            self.release()

    def release(self) -> None:
        """Give the lock back; its file stays until the journal is removed."""
        self._file.close()


def _locked(file: BinaryIO) -> bool:
    """Whether the lock was granted, or the file system offers none."""
    try:
        import fcntl
    except ImportError:
        # Windows refuses to move or remove a file that another process has open
        return True

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in UNSUPPORTED:
            raise
        said = f"{file.name}: this file system has no locks; let no second program write the store"
        warnings.warn(said, StoreWarning, stacklevel=5)
    return True
