"""A streaming writer of one trajectory: any length in bounded memory.

The arrays are laid out in an HDF5 file first and then filled past libhdf5, at their offsets, by a few threads
that hash what they write.  A run that stops early is laid out again at the length that it reached.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from contextlib import ExitStack
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.store import access, apart, digests, files, layout, records
from springcheck.store.access import Scalar

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

BUFFER = 1 << 22
"""Bytes that are buffered for one array before they are written."""


class Draft:
    """A streaming writer of one trajectory; a context that leaves nothing behind without `finish`."""

    def __init__(self, path: Path, label: str, scene: Scene, *, sequence: int = 0, run: str = "") -> None:
        """`path` is where the finished part of this run goes; `sequence` is its place in the store."""
        layout.check_label(label)
        self._text = scene.to_toml()
        if len(self._text) > access.LONGEST_TEXT:
            raise StoreError(
                f"{path}: the scene's text has {len(self._text) / 1e6:.0f} MB, and stores hold at most "
                f"{access.LONGEST_TEXT / 1e6:.0f}: take fewer particles, or join alike ones to a [chain]"
            )
        self.path, self.label, self.scene, self.sequence, self.run = path, label, scene, sequence, run
        self.rows = 0
        self._temporary = files.temporary(path)
        self._held = 0
        self._offsets: dict[str, int] = {}
        self._files: dict[str, FileIO] = {}
        """One for each column, at its next byte: columns are written side by side."""
        self._threads: ThreadPoolExecutor | None = None
        self._running: list[Future[None]] = []
        self._stack = ExitStack()

    def _lay_out(self, *, steps: bool) -> None:
        self._steps, frames = steps, self.scene.frames
        self._columns = layout.columns(self.label, self.scene, frames, steps=steps)
        self._hash = {name: hashlib.sha256() for name in self._columns}
        widest = max(column.size for column in self._columns.values()) // frames
        self._length = max(1, min(frames, BUFFER // widest))
        self._buffer, self._spare = (
            {name: np.empty((self._length, *c.shape[1:]), c.dtype) for name, c in self._columns.items()}
            for _ in range(2)
        )

    def append(
        self, t: Floats, q: Floats, p: Floats, energy: Floats | None = None, last_step: Floats | None = None
    ) -> None:
        """Append frames: t (f,), q and p (f, n), energy (f,) where the scene records energies, and last steps
        (f,) where the solver reports them: for all frames, or for none.

        Quantities that the scene does not record are ignored.  Raises StoreError when the disk is full.
        """
        if not self.rows:
            self._lay_out(steps=last_step is not None)
        f = len(t)
        given: dict[str, Floats] = {}
        for name, values in zip(("time", *layout.QUANTITIES), (t, q, p, energy, last_step), strict=True):
            if name in self._columns:
                expected = (f, *self._columns[name].shape[1:])
                if values is None or values.shape != expected:
                    found = None if values is None else values.shape
                    raise ValueError(f"{name} of {self.label}: shape {found}, not {expected}")
                given[name] = values
        if self.rows + f > self.scene.frames:
            raise ValueError(f"{self.label}: more frames than the scene's {self.scene.frames}")
        done = 0
        while done < f:
            count = min(f - done, self._length - self._held)
            rows, into = slice(done, done + count), slice(self._held, self._held + count)
            for name, values in given.items():
                self._buffer[name][into] = values[rows]
            if "velocity" in self._columns:
                with np.errstate(over="ignore"):
                    np.divide(p[rows], self.scene.m, out=self._buffer["velocity"][into])
            first = self.rows + done
            self._buffer["step"][into] = np.arange(first, first + count) * self.scene.every
            self._held += count
            done += count
            if self._held == self._length:
                self._flush()
        self.rows += f

    def finish(self, attributes: Mapping[str, Scalar | None]) -> str:
        """Complete the part and put it into the journal -> the digest of its numbers.

        Once this returns, the trajectory survives crashes of program and machine.  An attribute that is None
        is left out.
        """
        if self.rows == 0:
            raise ValueError(f"{self.label}: a trajectory without frames")
        with files.told(self.path.parent, "write"):
            if not self._files:
                self._create(self.rows)
            self._flush()
            self._wait()
            self._close()
            if self.rows < self._columns["time"].shape[0]:
                self._shorten()
            digest = self._complete(attributes)
            files.put(self._temporary, self.path)
            apart.know(self.path)
        return digest

    def _create(self, frames: int) -> None:
        self._columns = layout.columns(self.label, self.scene, frames, steps=self._steps)
        with layout.fresh(self._temporary, sum(column.size for column in self._columns.values())) as file:
            self._offsets = layout.skeleton(file, self.label, self.scene, self._columns)
        for name, offset in self._offsets.items():
            self._files[name] = self._temporary.open("rb+", buffering=0)
            self._files[name].seek(offset)

    def _flush(self) -> None:
        """Write the buffers: at once where they hold everything, else in the background."""
        if not self._held:
            return
        with files.told(self.path.parent, "write"):
            self._wait()
            if not self._files:
                self._create(self.scene.frames)
            filled = {name: buffer[: self._held] for name, buffer in self._buffer.items()}
            if self._held == self._length < self.scene.frames:
                from concurrent.futures import ThreadPoolExecutor

                self._threads = self._threads or ThreadPoolExecutor(max_workers=min(4, os.cpu_count() or 1))
                self._running = [
                    self._threads.submit(self._write, name, values) for name, values in filled.items()
                ]
                self._buffer, self._spare = self._spare, self._buffer
            else:
                for name, values in filled.items():
                    self._write(name, values)
        self._held = 0

    def _wait(self) -> None:
        """Wait until the last buffers are written; raises the errors of the writing threads."""
        running, self._running = self._running, []
        for done in running:
            done.result()

    def _write(self, name: str, values: np.ndarray) -> None:
        self._hash[name].update(values.data)
        self._put(name, values.data.cast("B"))

    def _put(self, name: str, content: memoryview) -> None:
        """Write all of it: one system call may write less."""
        while content:
            content = content[self._files[name].write(content) :]

    def _shorten(self) -> None:
        offsets = self._offsets
        with files.unfinished(files.temporary(self.path)) as long:
            self._temporary.replace(long)
            self._create(self.rows)
            with long.open("rb") as source:
                for name, column in self._columns.items():
                    for block in digests.blocks(source, offsets[name], column.size):
                        self._put(name, memoryview(block))
            self._close()

    def _complete(self, attributes: Mapping[str, Scalar | None]) -> str:
        found = {name: total.hexdigest() for name, total in self._hash.items()}
        digest = digests.combined(found, self._columns)
        given = {name: value for name, value in attributes.items() if value is not None}
        text = 8 * sum(len(str(value)) for value in [*given.values(), self._text])
        with layout.reopened(self._temporary, text) as file:
            layout.begin(file)
            layout.write_attributes(file, {"run": self.run})
            known: dict[str, Scalar] = {
                "scene": self._text,
                "scene_name": self.scene.name,
                "units": self.scene.units,
                "kind": self.scene.kind,
                "frames": self.rows,
                "particles": self.scene.n,
                **({} if self.scene.places is None else {"axes": layout.axes_of(self.scene)}),
                "quantities": " ".join(n for n in layout.QUANTITIES if n in self._columns),
                "sequence": self.sequence,
                "finished": datetime.now(UTC).isoformat(timespec="seconds"),
                "sha256": digest,
            }
            parameters = file.create_group(f"parameters/{self.label}")
            layout.write_attributes(parameters, {**records.machine(), **given, **known})
            for name, column in self._columns.items():
                layout.write_attributes(file[column.path], {"sha256": found[name]})
            digests.write(file)
        return digest

    def _close(self) -> None:
        if self._threads is not None:
            self._threads.shutdown()
            self._threads = None
        for file in self._files.values():
            file.close()
        self._files.clear()

    def __enter__(self) -> Draft:
        self._stack.enter_context(files.unfinished(self._temporary))
        return self

    def __exit__(self, *_: object) -> None:
        with self._stack:
            self._close()
