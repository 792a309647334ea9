"""Damaged files, and stores that a stranger made to do harm, are answered in one line by every command.

    python validation/hostile.py [files] [seed]

Every kind of `KINDS` changes a whole store: numbers that lie in other files, sizes that memory cannot hold,
links that lead in circles, texts with control characters, fields of the wrong type.  Damaged are a store of
ours, an exported trajectory, files in the oldest and newest format of libhdf5, and text, NPZ, NPY, JSON and
molecular files: bytes flipped, ranges overwritten, ends cut off, objects removed or replaced.  `check`,
`inspect`, `identify`, `judge` and `run --from` read each.  Then:

* exit status 0, 1 or 2; with 2 one line on standard error; no traceback, no control character;
* at most 20 s of the processor and 1 GiB of memory, no process left, and nothing of another file shown.

Expected: "0 wrong".
"""

# ruff: noqa: D103 (the name of a kind says it)
from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import resource
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from arguments import arguments, script
from interrupts import left
from springcheck import store

LABEL, OTHER = "own:euler", "own:semi-implicit-euler"
SECRET = "do-not-show-this-4711"
SECRET_NUMBER = 4711.0815
BASE = f"observables/{LABEL}"
NASTY = "\x1b]0;owned\x07\x1b[2J\u202e\x9b31m\r\nx$\\frac{$<script>"

Change = Callable[[Any, random.Random, Path], None]
KINDS: dict[str, Change] = {}
"""Name -> what it does to an open copy of the store; the path is a folder with the reader's own files."""


def kind(change: Change) -> Change:
    """Enter a kind under the name of its function."""
    KINDS[change.__name__.replace("_", " ")] = change
    return change


def secrets(folder: Path) -> None:
    """The reader's own files, which no store may show."""
    (folder / "secret.txt").write_bytes(np.full(512, SECRET_NUMBER).tobytes())
    with h5py.File(folder / "secret.h5", "w") as file:
        file["x"] = np.full((201, 1), SECRET_NUMBER)
        file["t"] = np.arange(201) * 0.1
        file["text"] = SECRET
        group = file.create_group("verdicts")
        group["why"] = [SECRET]


def replace(file: Any, name: str, *given: Any, **how: Any) -> Any:
    """Put another dataset in the place of one, its attributes kept."""
    kept = dict(file[name].attrs)
    del file[name]
    made = file.create_dataset(name, *given, **how)
    for key in kept.keys() - {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}:
        made.attrs[key] = kept[key]
    return made


def array(rng: random.Random) -> str:
    """One of the recorded arrays of one trajectory."""
    return f"{BASE}/{rng.choice(['q/value', 'p/value', 'energy/value'])}"


REPEATED = 9_000_000
"""Times that a word stands in a text."""
SPARSE = 14_000_000_000
"""Bytes of two arrays that take none of the disk."""
VERDICTS = 1_000_000
"""Rows of their table."""


@kind
def numbers_in_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    outside = [(str(folder / "secret.txt"), 0, 8 * 512)]
    replace(file, name, file[name].shape, "<f8", external=outside)


@kind
def a_link_to_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    del file[name]
    file[name] = h5py.ExternalLink(str(folder / "secret.h5"), "/x")


@kind
def a_view_of_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    shape = file[name].shape
    view = h5py.VirtualLayout(shape, "<f8")
    source = h5py.VirtualSource(str(folder / "secret.h5"), "x", shape=(201, 1))
    view[...] = source if len(shape) == 2 else source[:, 0]
    del file[name]
    file.create_virtual_dataset(name, view)


@kind
def a_view_of_itself(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice([array(rng), f"particles/{LABEL}/position/value"])
    shape = file[name].shape
    view = h5py.VirtualLayout(shape, "<f8")
    view[...] = h5py.VirtualSource(".", "/" + name, shape)
    del file[name]
    file.create_virtual_dataset(name, view)


@kind
def a_circle_of_groups(file: Any, rng: random.Random, folder: Path) -> None:
    top = file.require_group("precision")
    for i in range(rng.choice([1, 12])):
        top[f"again {i}"] = file["precision"]


@kind
def links_that_lead_nowhere(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice([array(rng), f"{BASE}/q/time", f"parameters/{LABEL}", "verdicts", "comparison/labels"])
    del file[name]
    file[name] = h5py.SoftLink(rng.choice(["/nowhere", "/" + name, "."]))


@kind
def billions_of_rows(file: Any, rng: random.Random, folder: Path) -> None:
    rows = rng.choice([3_000_000_000, 2**40])
    for name, shape in (("q/value", (rows, 1)), ("p/value", (rows, 1)), ("energy/value", (rows,))):
        replace(file, f"{BASE}/{name}", shape, "<f8", chunks=(1 << 16, *shape[1:]), compression="gzip")
    time, step = f"{BASE}/q/time", f"{BASE}/q/step"
    for name, of in ((time, "<f8"), (step, "<i4")):
        replace(file, name, (rows,), of, chunks=(1 << 16,), compression="gzip")
    file[f"parameters/{LABEL}"].attrs["frames"] = rows


@kind
def much_out_of_little(file: Any, rng: random.Random, folder: Path) -> None:
    rows = 1 << rng.choice([22, 25])
    for name in ("q/value", "p/value"):
        made = replace(file, f"{BASE}/{name}", (rows, 1), "<f8", chunks=(1 << 17, 1), compression="gzip")
        chunk = np.zeros((1 << 17, 1))
        for start in range(0, rows if rows < 1 << 24 else 1 << 20, 1 << 17):
            made[start : start + (1 << 17)] = chunk


@kind
def one_text_a_million_times(file: Any, rng: random.Random, folder: Path) -> None:
    text = h5py.string_dtype("utf-8")
    replace(
        file, "verdicts/why", (1 << 20,), text, chunks=(1 << 12,), compression="gzip", fillvalue="x" * 60_000
    )


@kind
def a_label_of_sixty_thousand_characters(file: Any, rng: random.Random, folder: Path) -> None:
    long = "own:" + "e" * 60_000
    for tree in ("parameters", "observables", "particles"):
        file.move(f"{tree}/{LABEL}", f"{tree}/{long}")


@kind
def control_characters_in_attributes(file: Any, rng: random.Random, folder: Path) -> None:
    for node in (file, file[f"parameters/{LABEL}"], file["verdicts"]):
        for key in list(node.attrs):
            if isinstance(node.attrs[key], str) and key not in {"format", "sha256", "scene", "kind", "run"}:
                node.attrs.create(key, NASTY, dtype=h5py.string_dtype("utf-8"))


@kind
def control_characters_in_the_scene(file: Any, rng: random.Random, folder: Path) -> None:
    text = str(file.attrs["scene"]).splitlines()
    text = [
        'title = "\\u001b]0;owned\\u0007 \\u202e $\\\\frac{$"' if x.startswith("title") else x for x in text
    ]
    if rng.random() < 0.5:
        text.append('"\\u001b[2J" = 1')
    for node in (file, file[f"parameters/{LABEL}"]):
        node.attrs.create("scene", "\n".join(text), dtype=h5py.string_dtype("utf-8"))


@kind
def no_frames(file: Any, rng: random.Random, folder: Path) -> None:
    for name, shape in (("q/value", (0, 1)), ("p/value", (0, 1)), ("energy/value", (0,)), ("q/time", (0,))):
        replace(file, f"{BASE}/{name}", shape, "<f8")
    if rng.random() < 0.5:
        file[f"parameters/{LABEL}"].attrs["frames"] = 0


@kind
def columns_of_unlike_length(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["verdicts/value", "verdicts/passed", "verdicts/bound"])
    replace(file, name, data=rng.choice([np.zeros(3), np.zeros((7, 7)), np.full(len(file[name]), 9)]))


@kind
def a_document_that_is_no_study(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["precision", "stability", "extremes"])
    text = rng.choice(
        [
            "[" * 100_000,
            '{"a":' * 50_000,
            '{"methods": ' + "9" * 5000 + "}",
            '{"budget_seconds": 1e999}',
            "null",
            "3",
            '"x"',
            "{}",
            '{"methods": [], "regions": [], "resonances": [], "left_out": []}',
            '{"tables": ["verdicts"], "windows": [], "left_out": [], "quick": true}',
            "{",
            "\x00",
            "ÿ",
            '{"points": [{"method": "'
            + NASTY.encode("unicode_escape").decode().replace("\\x", "\\u00")
            + '"}]}',
        ]
    )
    file.require_group("documents")
    file["documents"].create_dataset(name, data=text.replace("\0", ""), dtype=h5py.string_dtype("utf-8"))


@kind
def numbers_that_are_none(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    shape = file[name].shape
    values: Any = rng.choice(
        [
            np.full(shape, np.inf), np.full(shape, np.nan), np.full(shape, 1 + 2j),
            np.full(shape, 1e308), np.full(shape, b"x"), np.zeros(shape, "f2"), np.zeros(shape, "O"),
            np.full(shape, True), np.zeros(shape, [("a", "f8")]), np.zeros(shape, ">f8"),
            np.zeros(shape, "u8"), np.full(shape, -0.0),
        ]
    )  # fmt: skip
    if values.dtype == object:
        replace(file, name, shape, h5py.string_dtype())
    else:
        replace(file, name, data=values)


@kind
def attributes_of_the_wrong_type(file: Any, rng: random.Random, folder: Path) -> None:
    node = rng.choice([file, file[f"parameters/{LABEL}"], file["verdicts"], file["comparison"], file["h5md"]])
    wrong = [
        "text", 1.5, -1, 0, 2**62, np.nan, np.inf, np.zeros((2, 2)), np.array([b"x"]), np.zeros(0),
        1 + 2j, True, h5py.Empty("f8"), np.uint64(2**64 - 1), np.zeros(1, [("a", "f8")]),
    ]  # fmt: skip
    for key in rng.sample(sorted(node.attrs), min(3, len(node.attrs))):
        if key != "format":
            node.attrs[key] = rng.choice(wrong)


@kind
def a_large_attribute(file: Any, rng: random.Random, folder: Path) -> None:
    node = rng.choice([file, file[f"parameters/{LABEL}"], file["verdicts"]])
    node.attrs[rng.choice(["x", "origin.x", "axes"])] = np.zeros(6_000_000)


@kind
def trajectories_without_number(file: Any, rng: random.Random, folder: Path) -> None:
    for i in range(5_000):
        for tree in ("parameters", "observables"):
            file[f"{tree}/own:{i}"] = file[f"{tree}/{LABEL}"]


@kind
def a_sparse_file(file: Any, rng: random.Random, folder: Path) -> None:
    rows = SPARSE // 16
    for name, shape, of in (("q/value", (rows, 1), "<f8"), ("p/value", (rows, 1), "<f8")):
        kept = dict(file[f"{BASE}/{name}"].attrs)
        del file[f"{BASE}/{name}"]
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        how.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        space = h5py.h5s.create_simple(shape)
        h5py.h5d.create(file.id, f"{BASE}/{name}".encode(), h5py.h5t.py_create(np.dtype(of)), space, how)
        for key in kept.keys() - {"DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME"}:
            file[f"{BASE}/{name}"].attrs[key] = kept[key]


@kind
def many_labels_on_one_group(file: Any, rng: random.Random, folder: Path) -> None:
    file[f"parameters/{LABEL}"].attrs.create("x", "x" * REPEATED, dtype=h5py.string_dtype())
    for i in range(1_000):
        for tree in ("parameters", "observables", "particles"):
            file[f"{tree}/own:{i}"] = file[f"{tree}/{LABEL}"]


@kind
def a_million_verdicts(file: Any, rng: random.Random, folder: Path) -> None:
    for name in list(file["verdicts"]):
        old = file["verdicts"][name]
        values = np.resize(old[()], VERDICTS)
        kept = h5py.string_dtype() if values.dtype.kind == "O" else values.dtype
        replace(file, f"verdicts/{name}", data=values, dtype=kept)


@kind
def a_document_of_many_megabytes(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["precision", "stability", "extremes"])
    text = rng.choice(["[" + "[]," * (2 * REPEATED) + "1]", '{"a": "' + "x" * (6 * REPEATED) + '"}'])
    file.require_group("documents").create_dataset(name, data=text, dtype=h5py.string_dtype("utf-8"))


@kind
def declared_frames_of_h5md(file: Any, rng: random.Random, folder: Path) -> None:
    del file.attrs["format"]
    rows = 1 << rng.choice([25, 28])
    for name in ("position", "velocity"):
        element = f"particles/{LABEL}/{name}"
        for kind in ("value", "time", "step"):
            del file[f"{element}/{kind}"]
        view = h5py.VirtualLayout((rows, 1, 3), "<f8")
        view[:201, :, 0] = h5py.VirtualSource(".", f"{BASE}/q/value", (201, 1), "<f8")
        file.create_virtual_dataset(f"{element}/value", view, fillvalue=0.0)
        file[f"{element}/time"], file[f"{element}/step"] = 0.1, 1


def originals(folder: Path) -> dict[str, bytes]:
    """Files to damage, by their names."""
    from springcheck.cli import main

    path, rng = folder / "base.h5", np.random.default_rng(3)
    assert main(["run", "spring", "--method", LABEL, "--method", OTHER, "--quiet", "-o", str(path)]) == 0
    store.export(path, LABEL, folder / "e.h5md")
    run = store.read(path)[LABEL]
    for name in ("e.csv", "e.npz"):
        run.save(folder / name)
    rows = np.column_stack([run.t, run.q, run.p])
    np.save(folder / "e.npy", rows)
    (folder / "e.json").write_text(
        json.dumps({"t": run.t.tolist(), "q": run.q[:, 0].tolist(), "v": run.p[:, 0].tolist()})
    )
    (folder / "e.xyz").write_text("".join(f"1\nt = {t}\nA {q} 0 0 {p} 0 0\n" for t, q, p in rows.tolist()))
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
            group["mass"] = np.ones(3)
    return {one.name: one.read_bytes() for one in sorted(folder.iterdir()) if one.is_file()}


def damaged(content: bytes, rng: random.Random, path: Path) -> None:
    """Write a damaged copy."""
    changed = bytearray(content)
    how = rng.random()
    if how < 0.55:
        for _ in range(rng.choice([1, 1, 2, 5, 20])):
            changed[rng.randrange(len(changed))] = rng.choice([0, 255, 128, rng.randrange(256)])
    elif how < 0.65:
        start = rng.randrange(len(changed))
        changed[start : start + rng.randrange(1, 400)] = rng.randbytes(rng.randrange(1, 400))
    elif how < 0.75:
        del changed[rng.randrange(len(changed)) :]
    path.write_bytes(changed)
    if how >= 0.75 and path.suffix in (".h5", ".h5md"):
        with h5py.File(path, "r+", libver=("v110", "latest")) as file:
            for _ in range(rng.choice([1, 2, 4])):
                mutilate(file, rng)


def mutilate(file: Any, rng: random.Random) -> None:
    """Remove one object or attribute, or put one of the wrong type in its place."""
    names: list[str] = []
    file.visit(names.append)
    if not names:
        # all has been removed before
        return
    name = rng.choice(names)
    wrong: list[Any] = ["text", 1.5, np.zeros((2, 2, 2), "i2"), np.zeros(0), np.array([b"x"]), np.nan]
    keys = list(file[name].attrs)
    if keys and rng.random() < 0.4:
        key = rng.choice(keys)
        del file[name].attrs[key]
        if rng.random() < 0.7:
            file[name].attrs[key] = rng.choice(wrong)
        return
    del file[name]
    if rng.random() < 0.6:
        file[name] = rng.choice(wrong)


def perform(path: Path, into: int) -> None:
    """Every command on one file, in this process: a line of JSON for each."""
    from springcheck.cli import main

    commands = [
        ["check"], ["inspect"], ["identify"], ["run", "--from"],
        ["judge", "--scene", "spring", "--scheme", "explicit-euler", "--trajectory", LABEL],
    ]  # fmt: skip
    for command in commands:
        out, err = io.StringIO(), io.StringIO()
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status: object = main([*command, str(path)])
        except BaseException as error:
            status = repr(error)
        both = [resource.getrusage(x) for x in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        seconds = sum(x.ru_utime + x.ru_stime for x in both)
        memory = max(x.ru_maxrss for x in both) * 1024
        said = [command[0], status, out.getvalue()[-100_000:], err.getvalue()[-100_000:], seconds, memory]
        os.write(into, json.dumps(said).encode() + b"\n")


def wrong(path: Path, folder: Path) -> list[str]:
    """What should not be of the commands on a file, in a process of their own."""
    out, into = os.pipe()
    if not (pid := os.fork()):
        os.setsid()
        os.chdir(folder)
        perform(path, into)
        os._exit(0)
    os.close(into)
    with os.fdopen(out) as pipe:
        lines = pipe.readlines()
    ended = os.waitpid(pid, 0)[1]
    found, before = [], 0.0
    for line in lines:
        name, status, said, err, seconds, memory = json.loads(line)
        if status not in (0, 1, 2):
            found.append(f"{name}: status {status}")
        if status == 2 and err.count("\n") != 1:
            found.append(f"{name}: said {err[:300]!r}")
        if "Traceback" in err or re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", said + err):
            found.append(f"{name}: a traceback, or a control character")
        if SECRET in said + err or "4711.08" in said + err:
            found.append(f"{name}: shows another file")
        if seconds - before > 20 or memory > 1 << 30:
            found.append(f"{name}: {seconds - before:.1f} s, {memory >> 20} MiB")
        before = seconds
    if ended or len(lines) != 5:
        found.append(f"ended with {ended} after {len(lines)} commands")
    if left(pid):
        found.append("a process is left")
    return found


def main() -> int:
    """Try every kind once, and so many damaged files."""
    given = arguments(__doc__, files=200, seed=1)
    count = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for one in ("whole", "own", "work"):
            (folder / one).mkdir()
        whole = originals(folder / "whole")
        secrets(folder / "own")
        cases: list[tuple[str, Callable[[Path], None]]] = []
        for kind_name, made in KINDS.items():

            def hostile(path: Path, change: Change = made, seed: str = kind_name) -> None:
                shutil.copyfile(folder / "whole" / "base.h5", path)
                with h5py.File(path, "r+", libver=("v110", "latest")) as file:
                    change(file, random.Random(seed), folder / "own")

            cases.append((kind_name, hostile))
        for i in range(given.files):
            rng = random.Random(f"{given.seed} {i}")
            kept = rng.choice(sorted(whole))
            cases.append((f"{i} {kept}", partial(damaged, whole[kept], rng)))
        for number, (label, make) in enumerate(cases):
            path = folder / "work" / f"{number}{Path(label).suffix or '.h5'}"
            make(path)
            for what in wrong(path, folder / "work"):
                count += 1
                print(f"  {label}: {what}", flush=True)
            path.unlink()
    print(f"{len(KINDS)} kinds, {given.files} damaged files, {count} wrong")
    return int(count > 0)


if __name__ == "__main__":
    script(main)
