"""Nothing that was reported is lost when the power goes: what a disk may then hold, built and read.

    python validation/power.py [states]

A writer (that of validation/kill.py) stores trajectories and tables, with a commit at the end, while
every fsync, rename, removal and new folder is noted with the bytes of the files.  A loss of power may come
between any two of them.  What the disk holds then is what the system has promised, and no more:

* of a file, its bytes at its last fsync; of later writes each block of 4 kB may have arrived or not;
* of a folder, its names at its last fsync; of later changes the first few have arrived, or any of them,
  each rename whole or not at all.

Each state is built in a folder of its own, a writer takes it up, and everything reported before the loss must
be there with its digest, and `check` must find nothing wrong.  The same with fsync taken away must lose:
that is how the script is known to see losses.

Expected: lost 0; without fsync most states lose something.  The last 120 states: lost 0; without
fsync all of 20 lost something.
"""

from __future__ import annotations

import os
import random
import tempfile
import warnings
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

from arguments import arguments, script
from kill import Ledger, lost, write
from springcheck.errors import StoreError, StoreWarning
from springcheck.store import adopt

BLOCK = 4096
Names = dict[str, int]


@dataclass
class Disk:
    """What was done to a folder: the bytes that were promised, and the changes of names that were not yet."""

    root: Path
    synced: dict[int, bytes] = field(default_factory=dict)
    """Bytes of each file (inode) at its last fsync."""
    names: Names = field(default_factory=dict)
    """Names (path below the root -> inode; 0 for a folder) at the last fsync of their folder."""
    pending: list[tuple[str, str, int]] = field(default_factory=list)
    """Changes since: ("put " and the old name, if it has one, or "remove", path, inode)."""
    states: list[tuple[dict[int, bytes], Names, list[tuple[str, str, int]], dict[int, bytes], int]] = field(
        default_factory=list
    )
    reports: list[str] = field(default_factory=list)
    promises: bool = True
    held: dict[int, int] = field(default_factory=dict)

    def name(self, path: Any) -> str:
        """A path below the root."""
        return str(Path(path).absolute().relative_to(self.root))

    def listing(self) -> Names:
        """All names now."""
        return {self.name(path): 0 if path.is_dir() else path.stat().st_ino for path in self.root.rglob("*")}

    def look(self) -> None:
        """A moment at which the power may go."""
        now = self.listing()
        known = self.names.copy()
        for how, name, inode in self.pending:
            _change(known, how, name, inode)
        # names of new files come up without a call that is seen here
        gone = known.keys() - now.keys()
        for name, inode in now.items():
            if known.get(name) != inode:
                # a rename is done whole or not at all, from one folder to another too
                old = next((one for one in gone if inode and known[one] == inode), "")
                gone -= {old}
                self.pending.append((f"put {old}", name, inode))
        self.pending += [("remove", name, 0) for name in gone]
        content = {}
        for name, inode in now.items():
            if inode:
                if inode not in self.held:
                    # as long as it is open no other file gets its number
                    self.held[inode] = os.open(self.root / name, os.O_RDONLY)
                content[inode] = (self.root / name).read_bytes()
        self.states.append(
            (self.synced.copy(), self.names.copy(), self.pending.copy(), content, len(self.reports))
        )

    def fsync(self, handle: int) -> None:
        """What fsync promises."""
        self.look()
        path = Path(os.readlink(f"/proc/self/fd/{handle}"))
        if not self.promises or self.root not in (path, *path.parents):
            return
        if path.is_dir():
            below = "" if path == self.root else self.name(path)
            mine = [
                change
                for change in self.pending
                if (below or ".") in {str(Path(name).parent) for name in (change[1], _old(change))}
            ]
            for how, name, inode in mine:
                _change(self.names, how, name, inode)
                self.pending.remove((how, name, inode))
        else:
            self.synced[os.fstat(handle).st_ino] = path.read_bytes()
        self.look()


def _old(change: tuple[str, str, int]) -> str:
    """The old name of a renamed file; its only name else."""
    how, name, _ = change
    return how[4:] if how.startswith("put ") and how[4:] else name


def _change(names: Names, how: str, name: str, inode: int) -> None:
    if how.startswith("put "):
        names[name] = inode
        names.pop(how[4:], None)
    else:
        for one in [one for one in names if one == name or one.startswith(name + "/")]:
            del names[one]


def record(root: Path, seed: int, *, promises: bool = True) -> Disk:
    """A whole round of the writer, noted."""
    disk = Disk(root=root, promises=promises)

    def watched(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            disk.look()
            made = real(*given, **named)
            disk.look()
            return made

        return call

    with ExitStack() as stack:
        stack.enter_context(mock.patch("os.fsync", disk.fsync))
        for name in ("replace", "rename", "unlink", "mkdir", "rmdir"):
            stack.enter_context(mock.patch(f"os.{name}", watched(getattr(os, name))))
        write(root / "s.h5", disk.reports.append, seed)
        disk.look()
    return disk


def build(disk: Disk, moment: int, rng: random.Random, folder: Path) -> list[str]:
    """What the disk may hold after a loss at this moment, in a folder -> what was reported before it."""
    synced, names, pending, content, reported = disk.states[moment]
    known = names.copy()
    order = rng.random() < 0.5
    first = rng.randrange(len(pending) + 1)
    for i, (how, name, inode) in enumerate(pending):
        if (i < first) if order else (rng.random() < 0.5):
            _change(known, how, name, inode)
    for name, inode in sorted(known.items()):
        path = folder / name
        if not path.parent.is_dir():
            continue
        if inode == 0:
            path.mkdir()
        else:
            path.write_bytes(torn(synced.get(inode, b""), content.get(inode), rng))
    return disk.reports[:reported]


def torn(old: bytes, new: bytes | None, rng: random.Random) -> bytes:
    """A file of which only the old bytes were promised."""
    if new is None or new == old:
        return old
    # what was promised stays as long as nothing cuts it off
    least, most = sorted((len(old), len(new)))
    length = rng.choice([least, most, rng.randint(least, most)])
    made = bytearray(old[:length].ljust(length, b"\0"))
    share = rng.choice([0.0, 0.5, 1.0])
    for start in range(0, min(length, len(new)), BLOCK):
        if rng.random() < share:
            block = new[start : min(start + BLOCK, length)]
            made[start : start + len(block)] = block
    return bytes(made)


def losses(states: int, *, promises: bool) -> int:
    """States in which something reported is gone."""
    rng = random.Random(30)
    bad, shown, rounds = 0, 0, []
    with tempfile.TemporaryDirectory() as name:
        for large in (1 << 28, 0):
            adopt.LARGE = large
            root = Path(name) / f"round-{large}"
            root.mkdir()
            rounds.append((large, record(root, 0, promises=promises)))
        for i in range(states):
            large, disk = rounds[i % 2]
            adopt.LARGE = large
            with tempfile.TemporaryDirectory(dir=name) as folder:
                before = build(disk, rng.randrange(len(disk.states)), rng, Path(folder))
                ledger = Ledger()
                ledger.add(before)
                try:
                    gone = lost(Path(folder) / "s.h5", 0, ledger.stored, ledger.listed)
                except StoreError as error:
                    gone = [str(error)]
            bad += bool(gone)
            if gone and promises and shown < 20:
                shown += 1
                print(f"  state {i}, lost:", gone)
    adopt.LARGE = 1 << 28
    return bad


def main() -> int:
    """All states; the exit status says whether one of them lost something, or the script sees no loss."""
    count = arguments(__doc__, states=1000).states
    # parts that a loss has torn were never reported
    warnings.simplefilter("ignore", StoreWarning)
    bad = losses(count, promises=True)
    print(f"losses of power: states {count}, lost {bad}")
    control = max(20, count // 10)
    seen = losses(control, promises=False)
    print(f"the same without fsync: states {control}, lost {seen}")
    return int(bad > 0 or seen == 0)


if __name__ == "__main__":
    script(main)
