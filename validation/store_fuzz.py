"""Damaged files are told in one line: 2400 of them, read through the public functions.

    python validation/store_fuzz.py [files]

A store of ours, the same without its seal, an exported trajectory and files in the oldest and newest format
of libhdf5 are damaged in turn: bytes flipped, ranges overwritten, ends cut off, datasets and attributes
removed or replaced by others of the wrong type.  Each is read by `read`, `summary`, `read_tables`,
`read_foreign` and `check`.  Every one must give a result or a StoreError of one line, within the time
limit; a result that differs from the numbers that were stored must not come out of a file that still carries
its seal.

Why the files without a seal are tried in a process of their own: with HDF5 2.0 about one damaged file in
1400 sends libhdf5 into a loop that no exception ends, whoever reads it.

Expected, in about ten minutes on two cores: 2400 files, no traceback, no crash, no wrong number.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from arguments import arguments
from springcheck import store
from springcheck.errors import StoreError
from springcheck.physics.scene import Scene
from springcheck.store import seal, trust

LABEL = "own:euler"
trust.LIMIT = 5.0


def originals(folder: Path) -> dict[str, bytes]:
    """Files to damage, by kind."""
    m = np.array([3.7, 0.4])
    scene = Scene(name="fuzz", title="", source="", m=m, q=m, p=m, terms=(), step=0.1, steps=60, units="md")
    rng = np.random.default_rng(3)
    with store.open_new(folder / "s.h5", "fuzz") as journal:
        for label in (LABEL, "openmm:verlet"):
            with journal.draft(label, scene) as draft:
                q, p = rng.normal(size=(2, scene.frames, 2))
                draft.append(np.linspace(0, 6, scene.frames), q, p, p[:, 0])
                draft.finish({"scheme": "explicit-euler"})
        journal.add(
            store.Table(
                name="precision/x", columns={"h": [0.1, 0.2], "why": ["a", "b"]}, signal="h", log=("h",)
            )
        )
        journal.commit(scene, documents={"report": "text"})
    store.export(folder / "s.h5", LABEL, folder / "e.h5md")
    known = seal.find(folder / "s.h5")
    assert known is not None
    content = (folder / "s.h5").read_bytes()
    found = {"sealed": content, "unsealed": content[: known.end], "export": (folder / "e.h5md").read_bytes()}
    for libver in ("earliest", "latest"):
        with h5py.File(folder / f"{libver}.h5", "w", libver=libver) as file:
            group = file.create_group("particles/all")
            for name in ("position", "velocity"):
                values = rng.normal(size=(20, 3, 3)).astype("f4")
                element = group.create_group(name)
                element.create_dataset(
                    "value", data=values, chunks=(5, 3, 3), compression="gzip", shuffle=True
                )
                element["step"], element["time"] = np.arange(20), 0.1 * np.arange(20)
                element["value"].attrs["unit"] = "nm"
            group["mass"] = np.ones(3)
        found[libver] = (folder / f"{libver}.h5").read_bytes()
    return found


def damaged(content: bytes, rng: random.Random, path: Path) -> None:
    """Write a damaged copy."""
    changed = bytearray(content)
    how = rng.random()
    if how < 0.55:
        for _ in range(rng.choice([1, 1, 2, 5, 20])):
            changed[rng.randrange(len(changed))] = rng.choice([0, 255, 128, rng.randrange(256)])
    elif how < 0.65:
        start = rng.randrange(len(changed))
        end = min(len(changed), start + rng.randrange(1, 400))
        changed[start:end] = rng.randbytes(end - start)
    elif how < 0.75:
        del changed[rng.randrange(len(changed)) :]
    path.write_bytes(changed)
    if how >= 0.75:
        with h5py.File(path, "r+", libver=("v110", "latest")) as file:
            for _ in range(rng.choice([1, 2, 4])):
                mutilate(file, rng)


def mutilate(file: Any, rng: random.Random) -> None:
    """Remove one object or attribute, or put one of the wrong type in its place."""
    names: list[str] = []
    file.visit(names.append)
    if not names:
        return
    name = rng.choice(names)
    wrong: list[Any] = ["text", 1.5, np.zeros((2, 2, 2), "i2"), np.zeros(0), np.array([b"x"]), np.nan]
    keys = list(file[name].attrs) if name in file else []
    if keys and rng.random() < 0.4:
        key = rng.choice(keys)
        del file[name].attrs[key]
        if rng.random() < 0.7:
            file[name].attrs[key] = rng.choice(wrong)
    elif name in file:
        del file[name]
        if rng.random() < 0.6:
            file[name] = rng.choice(wrong)
        elif rng.random() < 0.3:
            file.create_group(name)


def attempt(path: Path, kind: str, truth: bytes) -> list[str]:
    """What each reader made of a file: "read", "told", or what must not happen."""
    made = []
    readers: list[Callable[[Path], object]] = [
        store.read,
        store.summary,
        store.read_tables,
        store.read_foreign,
        store.check,
    ]
    for reader in readers:
        try:
            result = reader(path)
        except StoreError as error:
            made.append("told" if "\n" not in str(error) and len(str(error)) < 500 else f"BAD {error}")
            continue
        except Exception as error:
            made.append(f"BAD {type(error).__name__} from {reader.__name__}: {error}")
            continue
        wrong = kind == "sealed" and seal.find(path) is not None and reader is store.read
        if wrong and any(one.q.tobytes() not in truth for one in store.read(path).values()):
            made.append("BAD a wrong number was read")
        made.append("read" if result or reader is not store.check else "clean")
    return made


def main() -> int:
    """All files; the exit status says whether one was not told properly."""
    count = arguments(__doc__, files=2400).files
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sources = originals(folder)
        kinds = list(sources)

        def one(i: int) -> tuple[str, list[str]]:
            kind, path = kinds[i % len(kinds)], folder / f"{i}.h5"
            damaged(sources[kind], random.Random(i), path)
            made = attempt(path, kind, sources[kind])
            path.unlink()
            return kind, made

        counts: Counter[str] = Counter()
        bad = 0
        with ThreadPoolExecutor(2) as pool:
            for kind, made in pool.map(one, range(count)):
                for what in made:
                    bad += what.startswith("BAD")
                    counts[f"{kind}: {what[:200]}"] += 1
    for what, number in sorted(counts.items()):
        print(f"{number:6d}  {what}")
    print(f"{count} files, {bad} not told properly")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
