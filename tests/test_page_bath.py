"""The page of a bath: a finding for its heading, temperatures of all frames, an ellipse that sliders move."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from browser import Browser
from springcheck.bath.heat import heated_of
from springcheck.cli import page
from springcheck.cli.page.given import bath
from springcheck.physics import scenefile as scenes
from springcheck.studies import keeper
from springcheck.studies.run import measure

METHODS = ("own:baoab", "own:obabo", "own:andersen")


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bath") / "bath.h5"
    measure.run(scenes.load_scene("bath-spring").derived(steps=3000), path, methods=METHODS, seed=3)
    return path


@pytest.fixture(scope="module")
def content(stored: Path) -> page.Content:
    return page.gather(stored)


def marks(bank: Any) -> dict[str, float]:
    return {
        f"{chart['short'].partition(',')[0]}: {curve['name']}": curve["x"][0]
        for chart in bank["charts"] if "temperature" in chart["short"]
        for curve in chart["curves"] if curve["name"] in METHODS
    }  # fmt: skip


def test_temperatures_are_those_of_all_frames_though_few_are_drawn(
    stored: Path, content: page.Content
) -> None:
    assert content.stride > 1
    scene = scenes.load_scene("bath-spring").derived(steps=3000)
    whole = [heated_of(scene, keeper.windows(stored, one.label)) for one in keeper.summary(stored).runs]
    shown = marks(content.data["banks"]["motion"])
    assert len(shown) == 6
    for one in whole:
        assert shown[f"kinetic temperature: {one.method}"] == pytest.approx(one.kinetic, rel=1e-6)
        assert shown[f"configurational temperature: {one.method}"] == pytest.approx(
            one.configurational, rel=1e-6
        )


def test_its_heading_is_a_temperature_that_is_off_by_law(content: page.Content) -> None:
    assert content.finding.endswith(
        "the configurational temperature of own:andersen is 1.7 % too hot by its law, however long it runs"
    )


def test_a_scene_without_a_bath_or_of_several_particles_has_no_ellipse() -> None:
    assert bath(scenes.load_scene("spring"), ()) is None
    assert bath(scenes.load_scene("bath-uneven"), ()) is None
    assert bath(scenes.load_scene("bath-free"), ()) is None


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory, content: page.Content, chromium: Browser) -> Browser:
    file = tmp_path_factory.mktemp("page") / "page.html"
    file.write_text(page.html(content))
    chromium.open(file)
    return chromium


def test_the_browser_has_the_covariances_of_python_and_moves_their_ellipse(opened: Any) -> None:
    assert opened.said == []
    assert opened.run("by('bath-check').dataset.result") == "equal"
    row = "[...document.querySelectorAll('#bath-said tr')].map((x) => x.innerText.split('\\t'))"
    assert opened.run(row)[0] == ["BAOAB", "300 K", "295.08 K"]
    before = opened.run("document.querySelector('#bath-chart .plot path.curve').getAttribute('d')")

    def slide(name: str, place: int) -> None:
        opened.run(f"by('slide-bath-{name}').value = {place}")
        opened.run(f"by('slide-bath-{name}').dispatchEvent(new Event('input'))")

    slide("h", 200)
    assert opened.run(row)[0] == ["BAOAB", "none: unstable", "none: unstable"]
    slide("h", 100)
    slide("T", 200)
    assert opened.run(row)[0][1] == "3000 K"
    assert opened.run("document.querySelector('#bath-chart .plot path.curve').getAttribute('d')") != before


def test_a_changed_number_is_told(opened: Any, content: page.Content, tmp_path: Path) -> None:
    h, rate, found = content.data["bath"]["values"][0]
    baoab = [*found["baoab"][:2], found["baoab"][2] * (1 + 1e-7)]
    values = [[h, rate, {**found, "baoab": baoab}], *content.data["bath"]["values"][1:]]
    text = page.html(
        replace(content, data={**content.data, "bath": {**content.data["bath"], "values": values}})
    )
    (tmp_path / "changed.html").write_text(text)
    opened.open(tmp_path / "changed.html")
    assert opened.run("by('bath-check').dataset.result") == "differs"
