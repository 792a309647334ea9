"""h5grove, the server behind H5Web, gives H5Web all it draws from a store, by H5Web's own rules, bit for bit.

The rules are those of H5Web 16 (packages/app/src/vis-packs/nexus/utils.ts).  H5Web itself, in a browser, is
driven by validation/h5web.py.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from h5grove.content import get_content_from_file

from springcheck import driver, engines, store
from springcheck.physics import scenefile as scenes
from springcheck.physics.trajectory import Comparison
from stores import LABELS, scene, trajectory, written

OPTIONS: dict[str, Any] = {"swmr": True, "locking": False}
"""How jupyterlab-h5web opens files."""


@dataclass(frozen=True)
class Drawn:
    """An NXdata as H5Web draws it: names to arrays, and what is written at the axes."""

    title: str
    signal: np.ndarray
    axes: list[np.ndarray | None]
    auxiliary: dict[str, np.ndarray]
    labels: list[str]
    scales: dict[str, Any]
    default_slice: list[str]


def _grove(path: Path, where: str) -> tuple[dict[str, Any], dict[str, Any], Any]:
    """Metadata, attributes and values, as h5grove gives them."""
    with get_content_from_file(path, where, lambda _, why: KeyError(why), h5py_options=OPTIONS) as content:
        known = content.metadata()
        return known, content.attributes(), content.data() if known["kind"] == "dataset" else None


def _label(path: Path, where: str) -> str:
    attributes = _grove(path, where)[1]
    name, unit = where.rsplit("/", 1)[1], attributes.get("units", "")
    return str(attributes.get("long_name") or (f"{name} ({unit})" if unit else name))


def drawn(path: Path, where: str = "") -> Drawn:
    """What H5Web draws at a path; it follows @default as far as an NXdata with a signal."""
    known, attributes, _ = _grove(path, where or "/")
    if attributes.get("NX_class") != "NXdata":
        return drawn(path, f"{where}/{attributes['default']}")
    children = [child["name"] for child in known["children"]]
    title = _grove(path, f"{where}/title")[2] if "title" in children else None
    names = list(attributes.get("axes", ()))
    auxiliary = list(attributes.get("auxiliary_signals", ()))
    assert {attributes["signal"], *auxiliary, *names} - {"."} <= set(children)
    signal = _grove(path, f"{where}/{attributes['signal']}")[2]
    found = Drawn(
        title=title.decode() if title else _label(path, f"{where}/{attributes['signal']}"),
        signal=signal,
        axes=[None if name == "." else _grove(path, f"{where}/{name}")[2] for name in names],
        auxiliary={name: _grove(path, f"{where}/{name}")[2] for name in auxiliary},
        labels=[_label(path, f"{where}/{name}") for name in (*names, attributes["signal"]) if name != "."],
        scales=json.loads(attributes.get("SILX_style", "{}")),
        default_slice=list(attributes.get("default_slice", ())),
    )
    scatter = signal.ndim == 1 and len(names) == 2
    for i, axis in enumerate(found.axes):
        assert axis is None or len(axis) == signal.shape[0 if scatter else i]
        if axis is not None and signal.ndim == 2:
            # H5Web spreads the pixels of an image evenly from the first value of an axis to the last
            even = np.linspace(axis[0], axis[-1], len(axis))
            np.testing.assert_allclose(axis, even, rtol=0, atol=1e-12 * np.max(np.abs(axis)))
    assert all(values.shape == signal.shape for values in found.auxiliary.values())
    return found


def _everything(path: Path, where: str = "") -> list[str]:
    known = _grove(path, where or "/")[0]
    assert known["kind"] in {"group", "dataset"}, f"{where} is a link that h5grove does not resolve"
    below = [f"{where}/{child['name']}" for child in known.get("children", ())]
    return [*([where] if where else []), *(name for child in below for name in _everything(path, child))]


def test_h5web_opens_on_the_default_plot_and_draws_every_observable(tmp_path: Path) -> None:
    s, path = scene(), tmp_path / "s.h5"
    with store.open_new(path, "run") as journal:
        made = {label: trajectory(s, label, i, s.frames - (i == 2)) for i, label in enumerate(LABELS)}
        for one in made.values():
            journal.save(one, s)
        journal.commit(s, comparison=Comparison(labels=("a", "b"), max_difference=2.5 * np.eye(2)))
    plot = drawn(path)
    assert plot.title == "q of the first particle"
    assert plot.labels == ["t (ps)", f"q of {LABELS[0]} (nm)"]
    assert np.array_equal(plot.signal, made[LABELS[0]].q[:, 0])
    assert list(plot.auxiliary) == [LABELS[1]]  # the third run is shorter
    assert np.array_equal(plot.auxiliary[LABELS[1]], made[LABELS[1]].q[:, 0])
    assert plot.axes[0] is not None
    assert np.array_equal(plot.axes[0], made[LABELS[0]].t)
    for name in ("p", "energy"):
        assert drawn(path, f"/plots/{name}").signal.shape == (s.frames,)
    for label, one in made.items():
        for name, values in (("q", one.q), ("p", one.p), ("velocity", one.p / s.m), ("energy", one.energy)):
            found = drawn(path, f"/observables/{label}/{name}")
            assert np.array_equal(found.signal, values)
            assert found.axes[0] is not None
            assert np.array_equal(found.axes[0], one.t)
            assert found.default_slice == ([] if name == "energy" else [".", "0"])
    image = drawn(path, "/comparison")
    assert np.array_equal(image.signal, 2.5 * np.eye(2))
    assert image.scales["signal_scale_type"] == "log"


def test_h5grove_reads_every_dataset_and_attribute_as_h5py_does(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    written(path, scene())
    names = _everything(path)
    assert f"/particles/{LABELS[0]}/position/value" in names
    with h5py.File(path, **OPTIONS) as file:
        for name in names:
            known, attributes, values = _grove(path, name)
            for key, value in file[name].attrs.items():
                if key in ("DIMENSION_LIST", "REFERENCE_LIST"):
                    continue  # references, which are equal to none
                np.testing.assert_array_equal(attributes[key], value, err_msg=f"{name} {key}")
            if known["kind"] == "dataset":
                assert tuple(known["shape"]) == file[name].shape
                np.testing.assert_array_equal(values, file[name][()], err_msg=name)


@pytest.mark.parametrize(("units", "at_axis"), [("reduced", "t"), ("si", "t (s)")])
def test_axes_carry_units_where_numbers_do(tmp_path: Path, units: str, at_axis: str) -> None:
    written(tmp_path / "s.h5", scene(units=units))
    assert drawn(tmp_path / "s.h5").labels[0] == at_axis


def test_a_table_names_its_scales_and_what_is_drawn_beside(tmp_path: Path) -> None:
    table = store.Table(
        name="precision/x",
        columns={"h": [0.1, 1.0, 10.0], "e": [3.0, 4.0, 5.0], "bound": [7.0, 8.0, 9.0]},
        signal="e",
        axes=("h",),
        auxiliary=("bound",),
        log=("e",),
    )
    with store.open_new(tmp_path / "s.h5", "precision") as journal:
        journal.add(table)
        journal.commit()
    plot = drawn(tmp_path / "s.h5")
    assert plot.signal.tolist() == [3.0, 4.0, 5.0]
    assert {name: values.tolist() for name, values in plot.auxiliary.items()} == {"bound": [7.0, 8.0, 9.0]}
    assert plot.scales["axes_scale_type"] == ["linear"]
    assert plot.scales["signal_scale_type"] == "log"
    back = store.tables_of(tmp_path / "s.h5")["precision/x"]
    assert (back.auxiliary, back.log, back.attributes) == (table.auxiliary, table.log, {})


def test_a_store_with_nothing_to_draw_promises_no_plot(tmp_path: Path) -> None:
    with store.open_new(tmp_path / "s.h5", "notes") as journal:
        journal.add(store.Table(name="notes/x", columns={"text": ["nothing"]}))
        journal.commit()
    assert "default" not in _grove(tmp_path / "s.h5", "/")[1]
    assert "/plots" not in _everything(tmp_path / "s.h5")


def test_h5web_draws_a_run_of_the_real_spring(tmp_path: Path) -> None:
    s, label = scenes.load_scene("spring-uneven"), "own:euler"
    made = driver.run(s, engines.parse(label))
    with store.open_new(tmp_path / "s.h5", "run") as journal:
        journal.save(made, s)
        journal.commit(s)
    plot = drawn(tmp_path / "s.h5")
    assert np.array_equal(plot.signal, made.q[:, 0])
    positions = _grove(tmp_path / "s.h5", f"/particles/{label}/position/value")[2]
    assert np.array_equal(positions[..., 0], made.q)
    assert not positions[..., 1:].any()
