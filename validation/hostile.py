"""Stores that a stranger made to do harm, and damaged files; `campaign.py` shows them to every command.

Each kind (`KINDS`) changes a whole store: numbers that lie in other files, sizes that memory cannot hold,
links that lead in circles, texts with control characters, fields of the wrong type.  Damaged are a store of
ours, the same without its seal, an exported trajectory and files in the oldest and newest format of libhdf5:
bytes flipped, ranges overwritten, ends cut off, datasets and attributes removed or replaced by others of the
wrong type.  Every second one gets a seal of its own, which anyone can write.
"""

# ruff: noqa: D103 (the name of a kind says it)
from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from springcheck import store
from springcheck.store import seal

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


REPEATED = 9_000_000
"""Times that a word stands in a text."""


@kind
def a_text_of_many_megabytes(file: Any, rng: random.Random, folder: Path) -> None:
    text = rng.choice(["x", "[[spring]]\n", "a = [", "# ½\n"]) * REPEATED
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


SPARSE = 14_000_000_000
"""Bytes of two arrays that take none of the disk."""


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
        for key, value in kept.items():
            file[f"{BASE}/{name}"].attrs[key] = value


@kind
def a_circle_of_unmarked_groups(file: Any, rng: random.Random, folder: Path) -> None:
    del file.attrs["format"]
    tops = [file.create_group(f"ring {i}") for i in range(12)]
    for one in tops:
        for j, other in enumerate(tops):
            one[f"to {j}"] = other


@kind
def many_labels_on_one_group(file: Any, rng: random.Random, folder: Path) -> None:
    file[f"parameters/{LABEL}"].attrs.create("x", "x" * REPEATED, dtype=h5py.string_dtype())
    for i in range(1_000):
        for tree in ("parameters", "observables", "particles"):
            file[f"{tree}/own:{i}"] = file[f"{tree}/{LABEL}"]


@kind
def columns_linked_to_each_other(file: Any, rng: random.Random, folder: Path) -> None:
    name = rng.choice(["verdicts", "comparison", "precision/x"])
    group = file.require_group(name)
    group.attrs["kind"] = "table"
    group["wide"] = np.zeros(REPEATED // 4)
    for i in range(200):
        group[f"x{i}"] = group["wide"]


VERDICTS = 1_000_000
"""Rows of their table in what follows."""


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


def base(folder: Path) -> Path:
    """A whole store of two trajectories."""
    from springcheck.cli import main

    path = folder / "base.h5"
    assert main(["run", "spring", "--method", LABEL, "--method", OTHER, "--quiet", "-o", str(path)]) == 0
    return path


def build(name: str, whole: Path, path: Path, own: Path, seed: int, *, forged: bool) -> None:
    """A hostile store of a kind; `own` holds the reader's files, `forged` gives it a seal."""
    shutil.copyfile(whole, path)
    with h5py.File(path, "r+", libver=("v110", "latest")) as file:
        KINDS[name](file, random.Random(seed), own)
    if forged:
        known = seal.find(whole)
        assert known is not None
        seal.attach(path, [] if "frames" in name or "rows" in name or seed % 3 else known.extents)


def originals(whole: Path, folder: Path) -> dict[str, bytes]:
    """Files to damage, by kind."""
    rng = np.random.default_rng(3)
    store.export(whole, LABEL, folder / "e.h5md")
    known = seal.find(whole)
    assert known is not None
    content = whole.read_bytes()
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
