"""What another file holds is not read, whether a dataset's storage, a link or a view leads there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from springcheck.errors import StoreError
from springcheck.formats import hdf5
from springcheck.store import access

HELD = np.arange(8.0)


def _external(group: Any, name: str, there: Path) -> None:
    raw = there.with_suffix(".raw")
    raw.write_bytes(HELD.tobytes())
    group.create_dataset(name, HELD.shape, "<f8", external=[(str(raw), 0, HELD.nbytes)])


def _link(group: Any, name: str, there: Path) -> None:
    group[name] = h5py.ExternalLink(str(there), "/x")


def _soft(group: Any, name: str, there: Path) -> None:
    group["linked"] = h5py.ExternalLink(str(there), "/x")
    group[name] = h5py.SoftLink(f"{group.name}/linked")


def _view(group: Any, name: str, there: Path) -> None:
    layout = h5py.VirtualLayout(HELD.shape, "<f8")
    layout[:] = h5py.VirtualSource(str(there), "x", HELD.shape)
    group.create_virtual_dataset(name, layout)


WAYS = [
    (_external, "lies outside the file: what other files hold is not read"),
    (_link, "leads elsewhere: only what lies in the file is read"),
    (_soft, "leads elsewhere: only what lies in the file is read"),
    (_view, "shows another file"),
]


def _made(folder: Path, way: Callable[[Any, str, Path], None]) -> Path:
    path, there = folder / "given.h5", folder / "other.h5"
    with h5py.File(there, "w") as file:
        file["x"] = HELD
    with h5py.File(path, "w") as file:
        way(file.create_group("run"), "q", there)
    return path


@pytest.mark.parametrize(("way", "why"), WAYS)
def test_what_lies_in_another_file_is_refused_and_says_that_it_does(
    way: Callable[[Any, str, Path], None], why: str, tmp_path: Path
) -> None:
    path = _made(tmp_path, way)
    with h5py.File(path) as file:
        # libhdf5 itself would read it
        assert np.array_equal(file["run/q"][()], HELD)
        with pytest.raises(StoreError, match=why):
            access.dataset_at(file, "run/q", packed=True)


@pytest.mark.parametrize("way", [_link, _soft])
def test_a_link_out_of_the_file_is_no_member_of_its_group(
    way: Callable[[Any, str, Path], None], tmp_path: Path
) -> None:
    path = _made(tmp_path, way)
    with h5py.File(path, "r+") as file:
        file["run/here"] = HELD
    with h5py.File(path) as file:
        assert access.members(file["run"]) == ["here"]


@pytest.mark.parametrize("way", [_external, _view])
def test_arrays_of_any_program_say_what_lies_in_another_file_in_its_place(
    way: Callable[[Any, str, Path], None], tmp_path: Path
) -> None:
    path = _made(tmp_path, way)
    with h5py.File(path, "r+") as file:
        file["run/v"] = 2 * HELD
    with h5py.File(path) as file:
        found = {place: values for place, values, _ in hdf5.arrays(file, lambda place: True)}
    np.testing.assert_array_equal(found.pop("run/v"), 2 * HELD)
    assert len(found) > 0
    for refused in found.values():
        assert isinstance(refused, StoreError)
        assert "what other files hold is not read" in str(refused)
