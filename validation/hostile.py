"""Stores that a stranger made to do harm: built here, and shown to every command in a process of its own.

    python validation/hostile.py [stores] [mutated]

Each kind (`KINDS`) changes a whole store: numbers that lie in other files, sizes that memory cannot hold,
links that lead in circles, texts with control characters, fields of the wrong type.  Every second one gets
a seal of its own, which anyone can write.  Every command that reads a store is then given it, in a process
forked for the purpose.  What must hold, whatever the file:

* exit status 0, 1 or 2; no traceback; a message on standard error of one line and 500 characters at most;
* no control character on standard output or standard error;
* at most 1 GiB of memory and 20 seconds of the processor;
* nothing of a file beside it is shown, and nothing is written but into the folder of the command.

So far one store of each of the 44 kinds was shown to every command (352 commands, every second store with a
seal): no crash, no traceback, nothing of another file, all within bounds; `identify` said two lines instead
of one of 7 of them, of which two were repeated after a change and passed.
"""

# ruff: noqa: D103 (the name of a kind says it)
from __future__ import annotations

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from arguments import arguments
from springcheck.errors import StoreError
from springcheck.store import seal, trust
from store_fuzz import damaged

LABEL, OTHER = "own:euler", "own:semi-implicit-euler"
SECRET = "do-not-show-this-4711"
SECRET_NUMBER = 4711.0815
BASE = f"observables/{LABEL}"
MEMORY, SECONDS, MESSAGE = 1 << 30, 20.0, 500
NASTY = "\x1b]0;owned\x07\x1b[2J\u202e\x9b31m\r\nx$\\frac{$<script>"

COMMANDS: tuple[tuple[str, ...], ...] = (
    ("inspect", "FILE"),
    ("inspect", "FILE", "--json"),
    ("inspect", "FILE", "--trajectory", "LABEL", "--verdicts"),
    ("plot", "FILE", "-o", "pictures"),
    ("check", "FILE"),
    ("export", "FILE", "LABEL", "out.h5md"),
    ("identify", "FILE"),
    ("run", "--from", "FILE"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What one command made of one store: seconds, peak memory [B], and what must not happen."""

    command: tuple[str, ...]
    status: int
    seconds: float
    memory: int
    out: str
    err: str
    wrong: tuple[str, ...]


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
    for key, value in kept.items():
        made.attrs[key] = value
    return made


def array(rng: random.Random) -> str:
    """One of the recorded arrays of one trajectory."""
    return f"{BASE}/{rng.choice(['q/value', 'p/value', 'energy/value'])}"


@kind
def numbers_in_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    outside = [(str(folder / "secret.txt"), 0, 8 * 512)]
    replace(file, name, file[name].shape, "<f8", external=outside)


@kind
def a_column_in_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["verdicts/value", "verdicts/bound", "comparison/max_difference"])
    replace(file, name, file[name].shape, "<f8", external=[(str(folder / "secret.txt"), 0, 8 * 512)])


@kind
def numbers_of_a_device(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    replace(file, name, file[name].shape, "<f8", external=[("/dev/zero", 0, h5py.h5f.UNLIMITED)])


@kind
def a_link_to_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    del file[name]
    file[name] = h5py.ExternalLink(str(folder / "secret.h5"), "/x")


@kind
def a_table_in_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["verdicts", "precision", "documents"])
    if name in file:
        del file[name]
    file[name] = h5py.ExternalLink(str(folder / "secret.h5"), "/verdicts")


@kind
def a_text_in_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["verdicts/why", "verdicts/method", "documents/precision"])
    if name in file:
        del file[name]
    file.require_group(name.rsplit("/", 1)[0])
    file[name] = h5py.ExternalLink(str(folder / "secret.h5"), "/text")


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
def positions_of_another_file(file: Any, rng: random.Random, folder: Path) -> None:
    name = f"particles/{LABEL}/{rng.choice(['position', 'velocity'])}/value"
    view = h5py.VirtualLayout(file[name].shape, "<f8")
    view[:, :, 0] = h5py.VirtualSource(str(folder / "secret.h5"), "x", shape=(201, 1))
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
def a_trajectory_that_contains_everything(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["observables", "parameters", "particles"])
    file[f"{name}/{rng.choice(['again', 'a:b'])}"] = file["/"]


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
def a_wide_table(file: Any, rng: random.Random, folder: Path) -> None:
    rows = 1 << rng.choice([24, 28])
    name = rng.choice(["verdicts/value", "verdicts/passed", "comparison/max_difference"])
    replace(file, name, (rows,), file[name].dtype, chunks=(1 << 20,), compression="gzip")


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
def a_text_of_many_megabytes(file: Any, rng: random.Random, folder: Path) -> None:
    text = rng.choice(["x", "[[spring]]\n", "a = [", "# ½\n"]) * 9_000_000
    rng.choice([file, file[f"parameters/{LABEL}"]]).attrs.create("scene", text, dtype=h5py.string_dtype())


@kind
def control_characters_in_labels(file: Any, rng: random.Random, folder: Path) -> None:
    for tree in ("parameters", "observables", "particles"):
        file.move(f"{tree}/{LABEL}", f"{tree}/own:{NASTY}".replace("/", "").replace(tree, tree + "/", 1))


@kind
def control_characters_in_attributes(file: Any, rng: random.Random, folder: Path) -> None:
    for node in (file, file[f"parameters/{LABEL}"], file["verdicts"]):
        for key in list(node.attrs):
            if isinstance(node.attrs[key], str) and key not in {"format", "sha256", "scene", "kind", "run"}:
                node.attrs.create(key, NASTY, dtype=h5py.string_dtype("utf-8"))


@kind
def control_characters_in_verdicts(file: Any, rng: random.Random, folder: Path) -> None:
    for name in ("method", "check", "unit", "why"):
        column = file[f"verdicts/{name}"]
        column[...] = np.array([NASTY] * len(column), dtype=object)


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
def control_characters_in_table_names(file: Any, rng: random.Random, folder: Path) -> None:
    group = file.create_group(NASTY.replace("/", ""))
    group.attrs["kind"] = "table"
    group["x"] = [1.0]


@kind
def a_name_that_climbs_out(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["/../../PWNED", "../PWNED", "a/b/PWNED", "/tmp/PWNED", "PWNED\0x"])
    file.attrs.create("scene_name", name.replace("\0", ""), dtype=h5py.string_dtype())


@kind
def an_unknown_scheme(file: Any, rng: random.Random, folder: Path) -> None:
    field = rng.choice(
        ["scheme", "outcome", "arithmetic", "parameter_precision", "units", "kind", "quantities"]
    )
    file[f"parameters/{LABEL}"].attrs.create(
        field, rng.choice(["nonsense", "", NASTY]), dtype=h5py.string_dtype()
    )


@kind
def no_frames(file: Any, rng: random.Random, folder: Path) -> None:
    for name, shape in (("q/value", (0, 1)), ("p/value", (0, 1)), ("energy/value", (0,)), ("q/time", (0,))):
        replace(file, f"{BASE}/{name}", shape, "<f8")
    if rng.random() < 0.5:
        file[f"parameters/{LABEL}"].attrs["frames"] = 0


@kind
def a_misshapen_comparison(file: Any, rng: random.Random, folder: Path) -> None:
    shape = rng.choice([(1, 1), (3, 2), (0,), (), (2, 2, 2)])
    replace(file, "comparison/max_difference", data=np.zeros(shape))


@kind
def a_missing_column(file: Any, rng: random.Random, folder: Path) -> None:
    del file[
        rng.choice(
            [f"verdicts/{x}" for x in ("method", "check", "value", "passed", "why")] + ["comparison/labels"]
        )
    ]


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
            '{"methods": [], "regions": [], "resonances": [], "costs": [], "left_out": []}',
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
            np.full(shape, np.inf),
            np.full(shape, np.nan),
            np.full(shape, 1 + 2j),
            np.full(shape, 1e308),
            np.full(shape, b"x"),
            np.zeros(shape, "f2"),
            np.zeros(shape, "O"),
            np.full(shape, True),
            np.zeros(shape, [("a", "f8")]),
            np.zeros(shape, ">f8"),
            np.zeros(shape, "u8"),
            np.full(shape, -0.0),
        ]
    )
    if values.dtype == object:
        replace(file, name, shape, h5py.string_dtype())
    else:
        replace(file, name, data=values)


@kind
def times_that_are_none(file: Any, rng: random.Random, folder: Path) -> None:
    shape = file[f"{BASE}/q/time"].shape
    values = rng.choice(
        [
            np.zeros(shape),
            np.full(shape, np.nan),
            np.full(shape, np.inf),
            -(np.arange(shape[0]) ** 2.0),
            np.zeros((3, 3)),
            np.zeros(()),
            np.zeros(7),
        ]
    )
    replace(file, f"{BASE}/q/time", data=values)


@kind
def names_that_are_no_text(file: Any, rng: random.Random, folder: Path) -> None:
    where = rng.choice(["/", "parameters", "observables", "verdicts", f"parameters/{LABEL}"])
    made = h5py.h5g.create(file[where].id, b"\xff\xfe" + LABEL.encode())
    h5py.h5a.create(made, b"\xff", h5py.h5t.NATIVE_INT32, h5py.h5s.create(h5py.h5s.SCALAR))
    h5py.h5a.create(file[where].id, b"\xfe\x1b", h5py.h5t.NATIVE_INT32, h5py.h5s.create(h5py.h5s.SCALAR))


@kind
def texts_that_are_none(file: Any, rng: random.Random, folder: Path) -> None:
    text = h5py.string_dtype("utf-8", 4)
    if rng.random() < 0.5:
        replace(
            file, "verdicts/why", data=np.array([b"\xff\xfe\x1b["] * len(file["verdicts/why"]), dtype=text)
        )
    else:
        node = rng.choice([file, file[f"parameters/{LABEL}"]])
        node.attrs.create(
            rng.choice(["scene", "scene_name", "outcome_message"]), b"\xff\xfe\x1b[", dtype=text
        )


@kind
def attributes_of_the_wrong_type(file: Any, rng: random.Random, folder: Path) -> None:
    node = rng.choice([file, file[f"parameters/{LABEL}"], file["verdicts"], file["comparison"], file["h5md"]])
    wrong = [
        "text",
        1.5,
        -1,
        0,
        2**62,
        np.nan,
        np.inf,
        np.zeros((2, 2)),
        np.array([b"x"]),
        np.zeros(0),
        1 + 2j,
        True,
        h5py.Empty("f8"),
        np.uint64(2**64 - 1),
        np.zeros(1, [("a", "f8")]),
    ]
    for key in rng.sample(sorted(node.attrs), min(3, len(node.attrs))):
        if key != "format":
            node.attrs[key] = rng.choice(wrong)


@kind
def an_attribute_too_many(file: Any, rng: random.Random, folder: Path) -> None:
    node = rng.choice([file, file[f"parameters/{LABEL}"], file["verdicts"]])
    for i in range(20_000):
        node.attrs[f"x{i}"] = i


@kind
def a_large_attribute(file: Any, rng: random.Random, folder: Path) -> None:
    node = rng.choice([file, file[f"parameters/{LABEL}"], file["verdicts"]])
    node.attrs[rng.choice(["x", "origin.x", "axes"])] = np.zeros(6_000_000)


@kind
def tables_without_number(file: Any, rng: random.Random, folder: Path) -> None:
    top = file.create_group("many")
    for i in range(30_000):
        top.create_group(f"t{i}").attrs["kind"] = "table"


@kind
def trajectories_without_number(file: Any, rng: random.Random, folder: Path) -> None:
    for i in range(5_000):
        for tree in ("parameters", "observables"):
            file[f"{tree}/own:{i}"] = file[f"{tree}/{LABEL}"]


@kind
def groups_for_datasets(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice([array(rng), f"{BASE}/q/time", "verdicts/value", "comparison/labels"])
    del file[name]
    if rng.random() < 0.5:
        file.create_group(name)
    else:
        file[name] = np.dtype("f8")


@kind
def datasets_for_groups(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(
        ["parameters", "observables", f"{BASE}/q", f"parameters/{LABEL}", "verdicts", "documents", "h5md"]
    )
    if name in file:
        del file[name]
    file[name] = rng.choice([1.0, "text", np.zeros((2, 2))])


@kind
def a_filter_of_its_own(file: Any, rng: random.Random, folder: Path) -> None:
    name = array(rng)
    shape = file[name].shape
    del file[name]
    how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    how.set_chunk(shape)
    how.set_filter(rng.choice([32015, 32001, 4711]), h5py.h5z.FLAG_OPTIONAL)
    h5py.h5d.create(file.id, name.encode(), h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple(shape), how)


@kind
def a_scene_that_no_machine_holds(file: Any, rng: random.Random, folder: Path) -> None:
    text = str(file.attrs["scene"])
    text = rng.choice(
        [
            text.replace("steps = 200", "steps = " + "9" * 4400),
            text.replace("steps = 200", "steps = 4000000000000"),
            "title = 'x'\n[chain]\nmasses = 1000000000\nmass = 1.0\nstiffness = 1.0\n"
            "wave = [{mode = 1, amplitude = 1.0}]\n[time]\nstep = 0.1\nsteps = 200\n",
            "a = " + "[" * 3000,
            text.replace("steps = 200", "steps = 1"),
            "",
            "\x1b[2J = 1",
        ]
    )
    for node in (file, file[f"parameters/{LABEL}"], file[f"parameters/{OTHER}"]):
        node.attrs.create("scene", text, dtype=h5py.string_dtype("utf-8"))


@kind
def a_sparse_file(file: Any, rng: random.Random, folder: Path) -> None:
    rows = 14_000_000_000 // 16
    for name, shape, of in (("q/value", (rows, 1), "<f8"), ("p/value", (rows, 1), "<f8")):
        kept = dict(file[f"{BASE}/{name}"].attrs)
        del file[f"{BASE}/{name}"]
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        how.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        space = h5py.h5s.create_simple(shape)
        h5py.h5d.create(file.id, f"{BASE}/{name}".encode(), h5py.h5t.py_create(np.dtype(of)), space, how)
        for key, value in kept.items():
            file[f"{BASE}/{name}"].attrs[key] = value


def base(folder: Path) -> Path:
    """A whole store of two trajectories."""
    from springcheck.cli import main

    path = folder / "base.h5"
    assert main(["run", "spring", "--method", LABEL, "--method", OTHER, "--quiet", "-o", str(path)]) == 0
    return path


def build(name: str, whole: Path, path: Path, own: Path, seed: int, *, forged: bool) -> None:
    """A hostile store of a kind; `own` holds the reader's files, `forged` gives it a seal."""
    if name == "mutated":
        damaged(whole.read_bytes(), random.Random(seed), path)
        if forged:
            seal.attach(path, [])
        return
    shutil.copyfile(whole, path)
    with h5py.File(path, "r+", libver=("v110", "latest")) as file:
        KINDS[name](file, random.Random(seed), own)
    if forged:
        known = seal.find(whole)
        assert known is not None
        seal.attach(path, [] if "frames" in name or "rows" in name or seed % 3 else known.extents)


def wrong(status: int, out: str, err: str, seconds: float, memory: int) -> Iterator[str]:
    """What must not happen."""
    if status not in {0, 1, 2}:
        yield f"exit status {status}"
    if "Traceback" in err or "Traceback" in out:
        yield "a traceback"
    lines = err.splitlines()
    if status == 2 and len(lines) != 1:
        yield f"{len(lines)} lines of message"
    if any(len(line) > MESSAGE for line in lines):
        yield f"a message of {max(map(len, lines))} characters"
    strange = {
        c for c in out + err if (ord(c) < 32 and c != "\n") or 127 <= ord(c) < 160 or c in "\u202e\u2066"
    }
    if strange:
        yield f"control characters {sorted(strange)!a}"
    for text in (out, err):
        if SECRET in text or "4711.08" in text:
            yield "another file is shown"
    if seconds > SECONDS:
        yield f"{seconds:.1f} s"
    if memory > MEMORY:
        yield f"{memory / MEMORY:.1f} GiB"


def show(command: tuple[str, ...], path: Path, label: str, folder: Path) -> Result:
    """Run a command in a forked process, in a folder of its own."""
    words = [{"FILE": str(path), "LABEL": label}.get(word, word) for word in command]
    pid = os.fork()
    if pid == 0:
        status = 99
        try:
            os.chdir(folder)
            for number, name in ((1, "out"), (2, "err")):
                os.dup2(os.open(f".{name}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
            resource.setrlimit(resource.RLIMIT_AS, (4 * MEMORY, 4 * MEMORY))
            from springcheck.cli import main

            status = main(words)
            sys.stdout.flush()
        except SystemExit as ended:
            status = int(ended.code or 0)
        except BaseException:
            import traceback

            traceback.print_exc()
            sys.stderr.flush()
        finally:
            os._exit(status)
    old = signal.signal(signal.SIGALRM, lambda *_: os.kill(pid, signal.SIGKILL))
    signal.setitimer(signal.ITIMER_REAL, 10 * SECONDS)
    _, raw, usage = os.wait4(pid, 0)
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, old)
    # of the processor: a busy machine is no fault of the store
    seconds = usage.ru_utime + usage.ru_stime
    status = os.waitstatus_to_exitcode(raw)
    out, err = (
        (folder / f".{name}").read_bytes().decode("utf-8", "backslashreplace") for name in ("out", "err")
    )
    memory = usage.ru_maxrss * 1024
    found = list(wrong(status, out, err, seconds, memory))
    written = {p.name for p in folder.iterdir()} - {".out", ".err", "pictures", "out.h5md"}
    found += [f"{name} was written" for name in sorted(written)]
    return Result(
        command=command, status=status, seconds=seconds, memory=memory, out=out, err=err, wrong=tuple(found)
    )


def every_command(path: Path, label: str = LABEL, *, drawn: bool = True) -> list[Result]:
    """A store before every command; the folder it lies in must not change.  `drawn`: by plot too."""
    found = []
    before = {p.name for p in path.parent.iterdir()}
    # once for all of them: what is forked from here inherits the answer
    for way in (trust.OURS, trust.FOREIGN):
        with contextlib.suppress(StoreError):
            trust.guarded(path, way)
    for command in COMMANDS:
        if command[0] == "plot" and not drawn:
            continue
        with tempfile.TemporaryDirectory() as name:
            found.append(show(command, path, label, Path(name)))
    beside = {p.name for p in path.parent.iterdir()} - before
    if beside:
        raise AssertionError(f"{path}: written beside it: {beside}")
    return found


def warm() -> None:
    """Import what the commands import, so that a forked one need not."""
    from springcheck.cli import inspect  # noqa: F401
    from springcheck.identify import files  # noqa: F401
    from springcheck.studies.extremes import figure  # noqa: F401
    from springcheck.studies.precision import figure as f1  # noqa: F401
    from springcheck.studies.run import figure as f2  # noqa: F401
    from springcheck.studies.stability import figure as f3  # noqa: F401


def serve() -> None:
    """Answer lines of JSON [path, label, drawn] with the results: one process that forks, without threads."""
    warm()
    for line in sys.stdin:
        path, label, drawn = json.loads(line)
        answer = [
            [x.command, x.status, x.seconds, x.memory, x.out, x.err, x.wrong]
            for x in every_command(Path(path), label, drawn=drawn)
        ]
        print(json.dumps(answer), flush=True)


class Server:
    """`serve` in a process of its own, with one thread for all numerics."""

    def __init__(self, *before: str) -> None:
        """`before`: words of a command in front of it, such as strace's."""
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [*before, sys.executable, __file__, "--serve"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ, **threads},
        )  # fmt: skip

    def __call__(self, path: Path, label: str = LABEL, *, drawn: bool = True) -> list[Result]:
        """What every command makes of a store."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps([str(path), label, drawn]), file=self._process.stdin, flush=True)
        return [
            Result(
                command=tuple(c), status=status, seconds=seconds, memory=memory, out=out, err=err,
                wrong=tuple(found),
            )
            for c, status, seconds, memory, out, err, found in json.loads(self._process.stdout.readline())
        ]  # fmt: skip

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


def main() -> int:
    """All stores; the exit status says whether one of them did harm."""
    if sys.argv[1:2] == ["--serve"]:
        serve()
        return 0
    given = arguments(__doc__, stores=500, mutated=5000)
    count = given.stores + given.mutated
    bad, shown, longest, largest = 0, 0, 0.0, 0
    with tempfile.TemporaryDirectory() as name:
        folder, own, place = Path(name), Path(name) / "own", Path(name) / "stores"
        own.mkdir()
        place.mkdir()
        secrets(own)
        whole = base(folder)
        server = Server()
        for i in range(count):
            what = list(KINDS)[i % len(KINDS)] if i < given.stores else "mutated"
            path = place / "s.h5"
            build(what, whole, path, own, i, forged=i // len(KINDS) % 2 == 1)
            for result in server(path):
                shown += 1
                longest, largest = max(longest, result.seconds), max(largest, result.memory)
                if result.wrong:
                    bad += 1
                    words = " ".join(result.command)
                    print(f"{i} {what}: {words}: {'; '.join(result.wrong)}: {result.err[-300:]!r}")
            path.unlink()
        server.close()
    print(
        f"{given.stores} hostile stores of {len(KINDS)} kinds, {given.mutated} mutated, {shown} commands: "
        f"{bad} wrong; "
        f"at most {longest:.1f} s and {largest / 2**20:.0f} MiB"
    )
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
