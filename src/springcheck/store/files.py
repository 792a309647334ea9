"""Files written whole or not at all: locks, free space, fsync, and errors in one line."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import json
import os
import platform
import re
import shutil
import stat
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from springcheck import interrupts
from springcheck.errors import StoreError, StoreWarning

JOURNAL = ".parts"
"""Ending of the folder of a store that is being written."""

TEMPORARY = re.compile(r"springcheck-[0-9a-f]{16}\.new")
"""Names of temporary files: none that a user would choose."""

UNSUPPORTED = {errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL, errno.ENOLCK, errno.EINTR}
"""Error numbers of a file system that lacks an operation, or never completes it."""

INTERRUPTED_FOR = 1.0
"""How long an interrupted system call is retried [s]; Python itself would retry it forever."""

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


def cause(error: BaseException, *, writing: bool = False) -> str:
    """Message of an exception of the system or of HDF5, in a few words."""
    if isinstance(error, MemoryError):
        return "it asks for more memory than there is"
    if not isinstance(error, OSError):
        return "it is damaged, or its layout is not what its name says"
    said = str(error)
    number = number_of(error)
    if writing and number == errno.ENOENT:
        # its folder is there, as /proc is, or has just gone
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
    return error.errno or int(next(iter(re.findall(r"errno = (\d+)", str(error))), 0))


def shown(path: Path) -> Path:
    """The name under which a user knows a file: for a part of a journal, the store's."""
    for one in (path, path.parent):
        if one.name.endswith(JOURNAL) and (one / "lock").exists():
            return one.with_name(one.name.removesuffix(JOURNAL))
    return path


BROKEN = (
    OSError, LookupError, ValueError, TypeError, RuntimeError, AttributeError, ArithmeticError, MemoryError
)  # fmt: skip
"""Exceptions that reading a damaged file may raise."""


@contextlib.contextmanager
def told(path: Path, doing: str) -> Iterator[None]:
    """Turn whatever goes wrong with a file into a StoreError of one line: "cannot `doing` path: why"."""
    try:
        yield
    except BROKEN as error:
        why = cause(error, writing=doing.startswith("write"))
        raise StoreError(f"cannot {doing} {shown(path)}: {why}") from error


def need_space(path: Path, size: int) -> None:
    """Raise StoreError when `size` bytes [B] would not fit at `path`, in a folder that may not be there."""
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
    """Allocate `size` bytes on the disk now, so that no later write finds it full.

    libhdf5 cannot close a file whose last write failed; with the space reserved beforehand none fails.  Where
    the system cannot reserve, zeros are written.
    """
    if hasattr(os, "posix_fallocate") and _done("posix_fallocate", file, 0, size):
        return
    file.seek(0, os.SEEK_END)
    block = bytes(1 << 20)
    for start in range(file.tell(), size, len(block)):
        file.write(block[: size - start])
    file.flush()


def _done(name: str, file: BinaryIO, *given: int) -> bool:
    """Call a function of the C library on a file; False where the system does not offer it.

    OSError for any other failure, which the function returns as a number or leaves in `errno`.
    """
    call, until = _function(name), time.monotonic() + INTERRUPTED_FOR
    while number := call(file.fileno(), *given):
        number = number if number > 0 else ctypes.get_errno()
        if number != errno.EINTR or time.monotonic() > until:
            break
    if number and number not in UNSUPPORTED:
        raise OSError(number, os.strerror(number))
    return not number


def _function(name: str) -> Callable[..., int]:
    # offsets have 64 bits where longs have, and the others ask for no such file
    return lambda file, *given: int(
        getattr(ctypes.CDLL(None, use_errno=True), name)(file, *map(ctypes.c_long, given))
    )


def own(path: Path, *, create: bool = False) -> BinaryIO:
    """Open a file of a journal for reading, with `create` for writing as well.  ValueError where it is not a
    plain file with one name: a link would lead to a file of the user's."""
    how = os.O_RDWR | os.O_CREAT if create else os.O_RDONLY
    for flag in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY"):
        how |= getattr(os, flag, 0)
    if path.is_symlink():
        raise ValueError(f"{path} is a link")
    handle = os.open(path, how, 0o666)
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        os.close(handle)
        raise ValueError(f"{path} is no file of its own")
    return os.fdopen(handle, "rb+" if create else "rb")


def is_plain(path: Path) -> bool:
    """Whether a path is a file, and no link to one."""
    return path.is_file() and not path.is_symlink()


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


def temporary(path: Path) -> Path:
    """A temporary name beside `path`, for a file that replaces it once complete."""
    return path.with_name(f"springcheck-{os.urandom(8).hex()}.new")


@contextlib.contextmanager
def unfinished(path: Path) -> Iterator[Path]:
    """A temporary file that is moved to its place when it is complete, and removed otherwise, interrupts
    included."""
    remove = partial(path.unlink, missing_ok=True)
    interrupts.takes(remove)
    try:
        yield path
    finally:
        with interrupts.held(), contextlib.suppress(OSError):
            remove()
        interrupts.forget(remove)


def put(complete: Path, path: Path) -> None:
    """Move a complete file to its place: fsync, os.replace, fsync of the folder."""
    sync(complete)
    move(complete, path)


def sync(path: Path) -> None:
    """Make a file's content survive a loss of power."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def move(complete: Path, path: Path) -> None:
    """Move a file that is complete and synced to its place."""
    complete.replace(path)
    sync_folder(path.absolute().parent)


def put_bytes(content: bytes, path: Path) -> None:
    """Write a small file whole or not at all."""
    with unfinished(temporary(path)) as made:
        with made.open("xb") as file:
            file.write(content)
        put(made, path)


class Lock:
    """A lock of the operating system, for one writer at a time: it ends with its process, killed or not.

    Where the file system has no locks, the file itself says who writes, and a `StoreWarning` says that
    writers on two machines would not see each other.  The library filelock (4.2) handles ENOSYS alone among
    the errors of such file systems (`UNSUPPORTED`), and its file does not say who writes.
    """

    def __init__(self, path: Path) -> None:
        """Take the lock file `path`, or raise StoreError that says who holds it."""
        self.path = path
        while True:
            try:
                self._file = own(path, create=True)
            except (ValueError, OSError) as error:
                raise StoreError(f"{path} stands where the lock of a store goes; move it away") from error
            try:
                self._take()
                # between open and lock the last holder may have removed the file: then its name is free again
                with contextlib.suppress(FileNotFoundError):
                    if os.path.samestat(path.stat(), os.fstat(self._file.fileno())):
                        break
            except BaseException:
                self._file.close()
                raise
            self._file.close()

    def _take(self) -> None:
        taken = _taken(self._file)
        self._file.seek(0)
        content = self._file.read(4096)
        who = _holder(content)
        self._system = taken is not None
        if taken is False or (not self._system and _alive(who)):
            by = f"process {who['pid']} on {who['host']} since {who['since']}" if who else "another process"
            raise StoreError(f"{self.path.parent} is being written by {by}: wait for it, or stop it first")
        if not who and not _is_torn(content):
            raise StoreError(f"{self.path} stands where the lock of a store goes; move it away")
        now = datetime.now(UTC).isoformat(timespec="seconds")
        mine = {"pid": os.getpid(), "host": platform.node(), "since": now, "token": os.urandom(4).hex()}
        self._write(json.dumps(mine).encode())
        if not self._system:
            time.sleep(0.05)
            if _holder(self.path.read_bytes()) != mine:
                raise StoreError(f"{self.path.parent} is being written by another process")
            said = f"{self.path.parent}: this file system has no locks; let no second program write the store"
            warnings.warn(said, StoreWarning, stacklevel=4)

    def _write(self, content: bytes) -> None:
        self._file.seek(0)
        self._file.truncate(0)
        self._file.write(content)
        self._file.flush()

    def release(self) -> None:
        """Give the lock back; its file stays until the journal goes."""
        if not self._file.closed and not self._system:
            self._write(b"")
        self._file.close()


def _holder(content: bytes) -> dict[str, Any]:
    """Who holds a lock, from what its file says; nothing where it is no lock file of ours."""
    try:
        who = json.loads(content)
        return dict(who) if {"pid", "host", "since"} <= set(who) and isinstance(who["pid"], int) else {}
    except (ValueError, TypeError, RecursionError):
        return {}


def _is_torn(content: bytes) -> bool:
    """Whether a full disk or a power failure has left this of a lock file of ours, which is never synced."""
    whole, left = b'{"pid": ', content.replace(b"\0", b"")
    return left.startswith(whole) or whole.startswith(left)


def _alive(who: dict[str, Any]) -> bool:
    """Whether the holder of a lock still runs, as far as this machine can tell."""
    if not who or who["host"] != platform.node():
        return bool(who)
    with contextlib.suppress(OSError):
        try:
            os.kill(who["pid"], 0)
        except (ProcessLookupError, OverflowError):
            return False
    return True


def _taken(file: BinaryIO) -> bool | None:
    """Whether the system granted the lock; None where it offers none."""
    if sys.platform == "win32":
        import msvcrt

        # nobody can read what is locked there, and who holds it stands at the beginning
        file.seek(1 << 30)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        return _done("flock", file, fcntl.LOCK_EX | fcntl.LOCK_NB) or None
    except BlockingIOError:
        return False
