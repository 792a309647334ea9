"""A streaming writer of one trajectory: any length in bounded memory.

The arrays are laid out in an HDF5 file first and then filled past libhdf5, at their offsets.  A run that
stops early is laid out again at the length that it reached.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import ExitStack
from io import FileIO
from pathlib import Path

import numpy as np

from springcheck.errors import StoreError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import LONGEST_TEXT
from springcheck.store import apart, digests, files, layout, records
from springcheck.store.access import Scalar

BUFFER = 1 << 23
"""Bytes that are buffered before they are written."""


class Draft:
    """A streaming writer of one trajectory; a context that leaves nothing behind without `finish`."""

    def __init__(self, path: Path, label: str, scene: Scene, *, sequence: int = 0, run: str = "") -> None:
        """`path` is where the finished part of this run goes; `sequence` is its place in the store."""
        layout.check_label(label)
        self._text = scene.to_toml()
        if len(self._text) > LONGEST_TEXT:
            raise StoreError(
                f"{path}: the scene's text has {len(self._text) / 1e6:.0f} MB, and stores hold at most "
                f"{LONGEST_TEXT / 1e6:.0f}: take fewer particles, or join alike ones to a [chain]"
            )
        self.path, self.label, self.scene, self.sequence, self.run = path, label, scene, sequence, run
        self.rows = 0
        self._temporary = files.temporary(path)
        self._buffered: list[dict[str, np.ndarray]] = []
        self._size = 0
        self._columns = layout.columns(label, scene, scene.frames)
        self._hash = {name: hashlib.sha256() for name in self._columns}
        self._next: dict[str, int] = {}
        """Where the next rows of each column go in the file [B]; empty before it is there."""
        self._stack = ExitStack()

    def append(self, t: Floats, q: Floats, p: Floats, energy: Floats | None = None) -> None:
        """Append frames: t (f,), q and p (f, n), and energy (f,) where the scene records energies.

        Quantities that the scene does not record are ignored.  Raises StoreError when the disk is full.
        """
        f = len(t)
        given: dict[str, np.ndarray] = {}
        for name, values in zip(("time", *layout.QUANTITIES), (t, q, p, energy), strict=True):
            if name in self._columns:
                expected = (f, *self._columns[name].shape[1:])
                if values is None or values.shape != expected:
                    found = None if values is None else values.shape
                    raise ValueError(f"{name} of {self.label}: shape {found}, not {expected}")
                given[name] = np.array(values, "<f8")
        if self.rows + f > self.scene.frames:
            raise ValueError(f"{self.label}: more frames than the scene's {self.scene.frames}")
        if "velocity" in self._columns:
            with np.errstate(over="ignore"):
                given["velocity"] = p / self.scene.m
        steps = np.arange(self.rows, self.rows + f) * self.scene.every
        given["step"] = steps.astype(self._columns["step"].dtype)
        self._buffered.append(given)
        self._size += sum(values.nbytes for values in given.values())
        self.rows += f
        if self._size > BUFFER:
            with files.told(self.path.parent, "write"):
                self._flush()

    def finish(self, attributes: Mapping[str, Scalar | None]) -> str:
        """Complete the part and put it into the journal -> the digest of its numbers.

        Once this returns, the trajectory survives crashes of program and machine.  An attribute that is None
        is left out.
        """
        if self.rows == 0:
            raise ValueError(f"{self.label}: a trajectory without frames")
        with files.told(self.path.parent, "write"):
            self._flush(self.rows)
            if self.rows < self._columns["time"].shape[0]:
                self._shorten()
            digest = self._complete(attributes)
            files.put(self._temporary, self.path)
            apart.know(self.path)
        return digest

    def _create(self, frames: int) -> None:
        self._columns = layout.columns(self.label, self.scene, frames)
        with layout.fresh(self._temporary, sum(column.size for column in self._columns.values())) as file:
            self._next = layout.skeleton(file, self.label, self.scene, self._columns)

    def _flush(self, frames: int = 0) -> None:
        """Write the buffered rows, into a file for so many frames, or for all of the scene."""
        if not self._next:
            self._create(frames or self.scene.frames)
        with self._temporary.open("rb+", buffering=0) as file:
            for name in self._columns if self._buffered else ():
                values = np.concatenate([rows[name] for rows in self._buffered])
                self._hash[name].update(values.data)
                self._put(file, name, values.data.cast("B"))
        self._buffered, self._size = [], 0

    def _put(self, file: FileIO, name: str, content: memoryview) -> None:
        file.seek(self._next[name])
        self._next[name] += len(content)
        while content:
            # one system call may write less
            content = content[file.write(content) :]

    def _shorten(self) -> None:
        """Lay the file out again for the frames that there are."""
        sizes = {name: column.size // column.shape[0] * self.rows for name, column in self._columns.items()}
        before = {name: end - sizes[name] for name, end in self._next.items()}
        with files.unfinished(files.temporary(self.path)) as long:
            self._temporary.replace(long)
            self._create(self.rows)
            with long.open("rb") as source, self._temporary.open("rb+", buffering=0) as file:
                for name, size in sizes.items():
                    for block in digests.blocks(source, before[name], size):
                        self._put(file, name, memoryview(block))

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
                "finished": records.now(),
                "sha256": digest,
            }
            parameters = file.create_group(f"parameters/{self.label}")
            layout.write_attributes(parameters, {**records.machine(), **given, **known})
            for name, column in self._columns.items():
                layout.write_attributes(file[column.path], {"sha256": found[name]})
            digests.write(file)
        return digest

    def __enter__(self) -> Draft:
        self._stack.enter_context(files.unfinished(self._temporary))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
