"""The report page: what stands in it, that no store becomes a part of it, and how a real browser sees it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import Browser
from clock import steady
from springcheck import store
from springcheck.cli import main, page
from springcheck.cli.page.given import drawn, linear
from springcheck.errors import StoreError
from springcheck.figures import charts, looks
from springcheck.figures.charts import Bank, Chart, Curve, Naming, Rule, Scale, Tiles
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.studies import STUDIES
from springcheck.studies.extremes import STUDY as ATLAS
from springcheck.studies.run import measure
from springcheck.studies.sampling import measure as sampling
from springcheck.text.lines import Text, TextTable, plain, table

HOSTILE = (
    "</title></script><script>document.documentElement.dataset.hurt=1</script><img src=x onerror='1'>\"'&"
)
OWN = ("own:euler", "own:semi-implicit-euler", "own:velocity-verlet", "ase:velocity-verlet")


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "spring.h5"
    measure.run(scenes.load_scene("spring"), path, methods=OWN)
    return path


@pytest.fixture(scope="module")
def content(spring: Path) -> page.Content:
    return page.gather(spring)


class Tags(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def count(self, name: str) -> int:
        return sum(1 for tag, _ in self.tags if tag == name)


def _data(text: str) -> Any:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    assert found
    rows, data = json.loads(found[1])

    def whole(x: Any) -> Any:
        if isinstance(x, list):
            return [whole(value) for value in x]
        if isinstance(x, dict):
            (place,) = [x[name] for name in ("#", "$") if name in x] or [None]
            return rows[place] if place is not None else {name: whole(value) for name, value in x.items()}
        return x

    return whole(data)


def test_numbers_read_back_bit_for_bit(spring: Path, content: page.Content) -> None:
    data = _data(page.html(content))
    stored = store.read(spring)
    assert [run["label"] for run in data["runs"]] == list(stored)
    for run in data["runs"]:
        kept = stored[run["label"]]
        for name, values in (("t", kept.t), ("q", kept.q[:, 0]), ("p", kept.p[:, 0])):
            assert np.array(run[name], np.float64).tobytes() == np.ascontiguousarray(values).tobytes()


def test_numbers_that_are_none_are_words(spring: Path, content: page.Content) -> None:
    run = replace(store.read(spring)["own:euler"], t=np.array([np.inf, -np.inf, np.nan, -0.0]))
    data = _data(page.html(replace(content, data={"spring": None, "banks": {}, "runs": [drawn(run)]})))
    found = data["runs"][0]["t"]
    assert found[:3] == ["Infinity", "-Infinity", "NaN"]
    assert np.signbit(found[3])


def test_it_begins_with_what_was_found_and_the_tables_of_the_run(spring: Path, content: page.Content) -> None:
    head = page.html(content).partition("<h2")[0]
    assert "<h1>Mass on a spring: explicit Euler gains energy; 2 conserve it on average</h1>" in head
    assert content.summary_line in head
    tables = [block for block in content.result if isinstance(block, TextTable)]
    assert tables
    assert all(f">{title}</th>" in head for title in tables[0].titles)
    assert all(label in head for label in store.read(spring))


def test_the_page_draws_what_plot_draws(spring: Path, content: page.Content) -> None:
    from springcheck.studies.run.page import banks

    drawn_here = _data(page.html(content))["banks"]["motion"]["charts"]
    expected = [chart for bank in banks(measure.stored(spring)) for chart in bank.charts]
    assert [[x["name"] for x in one["curves"]] for one in drawn_here] == [
        [x.name for x in one.curves] for one in expected
    ]
    shown = [[one[axis]["shown"] for axis in ("x", "y")] for one in drawn_here]
    for ranges, one in zip(shown, expected, strict=True):
        np.testing.assert_allclose(ranges, [one.x.shown, one.y.shown], rtol=1e-6)


def test_it_asks_for_nothing_and_is_small(content: page.Content) -> None:
    text = page.html(content)
    assert len(text.encode()) < 500_000
    for tag, attributes in Tags(text).tags:
        assert tag not in {"link", "img", "iframe", "object", "embed", "base", "form"}
        assert not {"src", "srcset", "action"} & set(attributes), tag
        assert (attributes.get("href") or "#").startswith("#")
    assert re.findall(r"https?://[^\s\"'<]+", text) == ["http://www.w3.org/2000/svg"]
    assert "@import" not in text
    assert set(re.findall(r"url\([^)]*\)", text)) == {"url(#${clip})"}
    assert "default-src 'none'" in text


def test_every_verdict_that_applies_has_its_value_and_its_reason(spring: Path, content: page.Content) -> None:
    text = page.html(content)
    headers = [attributes for tag, attributes in Tags(text).tags if tag == "th"]
    assert all(attributes.get("scope") in {"row", "col", "rowgroup"} for attributes in headers)
    for verdict in store.verdicts(spring):
        assert f"<b>{verdict.check}</b>" in text or verdict.passed is None
    assert text.count("<li><b>") == sum(v.passed is not None for v in store.verdicts(spring)) > 0


def test_a_failed_verdict_is_open_and_named(content: page.Content) -> None:
    first = content.methods[0]
    wrong = replace(first.verdicts[0], passed=False, value=2.0, bound=1.0)
    text = page.html(replace(content, methods=(replace(first, verdicts=(wrong,)), *content.methods[1:])))
    assert text.count('<details class="method" open>') == 1
    assert "1 FAILED" in text
    # and it is said before anything else
    head = text.partition("<h2")[0]
    assert re.search(rf"\b1 of \d+ failed: {first.method}", head)
    assert f"FAILED {first.method} {wrong.check}: " in head
    assert " open>" not in page.html(content)
    assert re.search(r"\d+ verdicts passed, 0 failed", page.html(content).partition("<h2")[0])


def _hostile(content: page.Content) -> page.Content:
    """Everything that a file may say, said by one that means harm."""
    first = content.methods[0]
    verdicts = tuple(replace(v, check=HOSTILE, why=HOSTILE, unit=HOSTILE) for v in first.verdicts)
    runs = [{**run, "label": HOSTILE, "title": HOSTILE, "scheme": HOSTILE} for run in content.data["runs"]]
    known = dict.fromkeys(content.summary.runs[0].parameters, HOSTILE) | {"origin." + HOSTILE: HOSTILE}
    mine = replace(content.summary.runs[0], label=HOSTILE, parameters=known)
    assert content.scene is not None
    said = plain(HOSTILE)
    section = {
        "name": "hostile", "title": HOSTILE, "banks": ("hostile-0", "hostile-1"),
        "blocks": [said, table([HOSTILE, "b"], [said, (said, HOSTILE)])],
    }  # fmt: skip
    scale = Scale(name=HOSTILE)
    curve = Curve(name=HOSTILE, group=HOSTILE, x=[0.0, 1.0], y=[0.0, 1.0], notes=[HOSTILE] * 2)
    tiles = Tiles(kinds=[(HOSTILE, "good")], rows=[[0, 0]], notes=[[HOSTILE] * 2])
    values = Scale(name=HOSTILE, values=[1.0, 2.0])
    lines = Chart(title=HOSTILE, x=scale, y=scale, curves=[curve])
    mosaic = Chart(title=HOSTILE + "2", x=values, y=Scale(name=HOSTILE, values=[1.0]), tiles=tiles)
    banks = {
        f"hostile-{i}": charts.plain(Bank(title=HOSTILE, charts=[x])) for i, x in enumerate((lines, mosaic))
    }
    return replace(
        content,
        title=HOSTILE,
        known=known,
        sections=(section,),
        scene=replace(content.scene, title=HOSTILE, source=HOSTILE),
        scene_text=HOSTILE,
        not_trusted=(store.Damage(place=HOSTILE, what=HOSTILE),),
        methods=(replace(first, method=HOSTILE, scheme=HOSTILE, verdicts=verdicts),),
        result=section["blocks"],
        summary=replace(
            content.summary, path=Path("a" + HOSTILE.replace("/", "")), runs=(mine,), root={"run": HOSTILE}
        ),
        data={**content.data, "runs": runs, "banks": banks},
    )


def test_a_heading_in_a_table_stands_over_its_rows(content: page.Content) -> None:
    rows = [plain("velocity Verlet", "italic"), ("own:velocity-verlet", "2"), plain("about it", "dim")]
    section = {"name": "a", "title": "A", "banks": (), "blocks": [table(("method", "limit"), rows)]}
    text = page.html(replace(content, sections=(section,)))
    assert '<th scope="rowgroup" colspan="2">velocity Verlet</th>' in text
    assert '<td class="why small" colspan="2">about it</td>' in text


def test_a_hostile_store_adds_no_element(content: page.Content) -> None:
    text = page.html(_hostile(content))
    tags = Tags(text)
    assert tags.count("script") == 2
    assert tags.count("img") == 0
    assert not any(name.startswith(("on", "data-hurt")) for _, attributes in tags.tags for name in attributes)
    assert _data(text)["runs"][0]["label"] == HOSTILE
    assert text.count("&lt;/title&gt;") > 15


def test_a_hostile_scene_through_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = replace(scenes.load_scene("spring"), title=HOSTILE, source=HOSTILE, steps=5)
    measure.run(scene, tmp_path / "a.h5", methods=("own:euler",))
    assert main(["report", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.html")]) == 0
    assert "kB" in capsys.readouterr().out
    tags = Tags((tmp_path / "a.html").read_text())
    assert tags.count("script") == 2
    assert tags.count("img") == 0


def test_only_reports_are_replaced(
    spring: Path, content: page.Content, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mine = tmp_path / "mine.html"
    mine.write_text("<p>mine</p>")
    with pytest.raises(StoreError, match="no report of ours"):
        page.write(content, mine)
    assert mine.read_text() == "<p>mine</p>"
    assert page.write(content, tmp_path / "new.html") == page.write(content, tmp_path / "new.html")
    assert main(["report", str(spring), "-o", str(mine)]) == 2
    assert main(["report", str(spring), "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 2


@pytest.mark.parametrize("name", ["chain", "pendulum", "carbon-monoxide", "lc-circuit"])
def test_other_scenes_are_reported_too(name: str, tmp_path: Path) -> None:
    scene = replace(scenes.load_scene(name), include=("own:*",))
    measure.run(scene, tmp_path / "a.h5", methods=("own:euler", "own:semi-implicit-euler"))
    content = page.gather(tmp_path / "a.h5")
    text = page.html(content)
    assert len(text.encode()) < 508_000
    assert (content.data["linear"] is None) == ("Not computed again here: this page" in text)
    assert (content.data["spring"] is None) == (name != "lc-circuit")


def test_a_long_run_is_thinned_and_says_so(tmp_path: Path) -> None:
    scene = replace(scenes.load_scene("spring"), steps=20_000)
    measure.run(scene, tmp_path / "a.h5", methods=OWN[1:3])
    content = page.gather(tmp_path / "a.h5")
    text = page.html(content)
    assert len(text.encode()) < 500_000
    assert f"every {content.stride}th stored frame" in text
    assert "every 22nd stored frame" in page.html(replace(content, stride=22))
    assert all(run["every"] == content.stride for run in content.data["runs"])


# studies


NAMES = ("precision", "stability", "extremes", "sampling")


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A small store of each study that a store holds, by its name."""
    folder = tmp_path_factory.mktemp("studies")
    methods = ["--method", "own:euler", "--method", "own:semi-implicit-euler"]
    calls = {
        "precision": ["precision", "spring", "--budget", "0.4", *methods],
        "stability": ["stability", "rlc-circuit", *methods[2:]],
        "extremes": ["extremes", "--quick", "--method", "own:semi-implicit-euler"],
        "sampling": ["sampling", "--method", "own:baoab"],
    }
    for name, call in calls.items():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sampling, "WIDE", 50)
            if name == "precision":
                steady(patch)
            assert main([*call, "-o", str(folder / f"{name}.h5"), "--quiet"]) == 0
    return {name: folder / f"{name}.h5" for name in NAMES}


def test_these_are_all_studies_that_a_store_holds() -> None:
    kept = {study.name for study in STUDIES if not study.trajectories}
    assert kept == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_study_brings_its_charts_and_its_tables(studies: dict[str, Path], name: str) -> None:
    content = page.gather(studies[name])
    text = page.html(content)
    assert len(text.encode()) < 500_000
    (section,) = content.sections
    assert section["name"] == name
    assert section["banks"]
    assert all(f'<div id="{bank}"></div>' in text for bank in section["banks"])
    tables = [block for block in section["blocks"] if isinstance(block, TextTable)]
    assert tables
    tags = Tags(text)
    assert all(
        attributes.get("scope") in {"row", "col", "rowgroup"} for tag, attributes in tags.tags if tag == "th"
    )
    known = {"sampling": "own:baoab"}.get(name, "own:semi-implicit-euler")
    assert known in {
        str(row[0]).strip() for table in tables for row in table.rows if not isinstance(row, Text)
    }


def test_every_cell_of_the_atlas_stands_in_its_map(studies: dict[str, Path]) -> None:
    (chart,) = _data(page.html(page.gather(studies["extremes"])))["banks"]["extremes-0"]["charts"]
    tiles = chart["tiles"]
    rows = [[kind for count, kind in row for _ in range(count)] for row in tiles["rows"]]
    assert {len(row) for row in rows} == {len(chart["x"]["values"])}
    assert len(rows) == len(chart["y"]["values"])
    found = keeper_atlas(studies["extremes"])
    placed = {(round(float(np.log10(c.parameters["h_w"])), 3), c.outcome) for c in found}
    seen = {
        (round(float(np.log10(turn)), 3), tiles["kinds"][kind][0])
        for turn, row in zip(chart["y"]["values"], rows, strict=True)
        for kind in row
        if kind >= 0
    }
    assert seen == placed


def keeper_atlas(path: Path) -> list[Any]:
    """The cells of force and h w that are stored."""
    return [cell for cell in ATLAS.stored(path).cells if cell.block == "force"]


# in a browser


@pytest.fixture
def opened(chromium: Browser, tmp_path: Path) -> Any:
    def open_page(content: page.Content, **look: Any) -> Browser:
        page.write(content, tmp_path / "a.html")
        chromium.open(tmp_path / "a.html", **look)
        assert chromium.said == []
        assert chromium.asked == [(tmp_path / "a.html").as_uri()]
        return chromium

    return open_page


def _checked(chromium: Browser) -> tuple[str, str]:
    """What the page found, and its words."""
    place = 'document.getElementById("selfcheck")'
    return chromium.run(f"{place}.dataset.result"), chromium.run(f"{place}.textContent")


def test_a_browser_gets_the_same_doubles(content: page.Content, opened: Any) -> None:
    found, said = _checked(opened(content))
    assert found == "equal"
    assert "Your browser = this file: 3 of 4 methods to the last bit, 1 to rounding" in said
    assert f"q and p equal bit for bit (201 frames): {', '.join(OWN[:3])}" in said


def test_a_browser_gets_the_same_doubles_of_another_spring(tmp_path: Path, opened: Any) -> None:
    base = scenes.load_scene("spring")
    wall = replace(base.terms[0], k=np.array([1.7]), at=np.array([0.3]))  # type: ignore[type-var]
    scene = replace(
        base, terms=(wall,), m=np.array([0.37]), q=np.array([-0.2]), step=0.07, steps=1_500, every=3
    )
    measure.run(scene, tmp_path / "a.h5", methods=OWN[1:])
    found, _ = _checked(opened(page.gather(tmp_path / "a.h5")))
    assert found == "equal"


def test_a_browser_sees_one_changed_bit(content: page.Content, opened: Any) -> None:
    runs = json.loads(json.dumps(content.data["runs"]))
    runs[1]["p"][150] = float(np.nextafter(runs[1]["p"][150], 9.0))
    found, said = _checked(opened(replace(content, data={**content.data, "runs": runs})))
    assert found == "differs"
    assert "own:semi-implicit-euler differs first in frame 150, t = 15" in said
    assert "q and p equal bit for bit (201 frames): own:euler" in said


def test_a_browser_counts_the_frames_of_every_run(content: page.Content, opened: Any) -> None:
    runs = json.loads(json.dumps(content.data["runs"]))
    runs[0] |= {name: runs[0][name][:50] for name in ("t", "q", "p")}
    found, said = _checked(opened(replace(content, data={**content.data, "runs": runs})))
    assert found == "equal"
    assert f"q and p equal bit for bit (50, 201 frames): {', '.join(OWN[:3])}" in said


EVERY = ("own:*", "openmm:*", "ase:*", "sundials:*", "scipy:*")


@pytest.mark.parametrize("name", ["spring-uneven", "overdamped", "stiff-spring", "inverted", "free"])
def test_every_scheme_of_one_particle_is_computed_again(
    tmp_path: Path, opened: Any, name: str, whole: bool
) -> None:
    base = scenes.load_scene(name)
    # own methods have every scheme; others' arithmetic is that of one scene as of another
    methods = EVERY if whole or name == "spring-uneven" else ("own:*",)
    # at the tolerance of the scene an implicit solver takes thousands of steps
    measure.run(replace(base, steps=min(base.steps, 50), tolerance=1e-9), tmp_path / "a.h5", methods=methods)
    content = page.gather(tmp_path / "a.h5")
    found, said = _checked(opened(content))
    assert found == "equal", said
    assert "not computed again" not in said
    # a shift of a thousandth is seen in every one of them, in most a far smaller one
    runs = json.loads(json.dumps(content.data["runs"]))
    for run in runs:
        run["q"][-1] += 1e-3 * max(abs(float(q)) for q in run["q"])
    found, said = _checked(opened(replace(content, data={**content.data, "runs": runs})))
    assert found == "differs"
    unseen = {
        x["label"] for x in runs if not re.search(rf"{re.escape(x['label'])} (differs first|is not) ", said)
    }
    assert not unseen


def test_what_failed_is_drawn_and_the_check_says_so(tmp_path: Path, opened: Any) -> None:
    measure.run(scenes.load_scene("spring"), tmp_path / "a.h5", methods=OWN, faults=["friction=1e-3"])
    content = page.gather(tmp_path / "a.h5")
    assert content.methods[0].method == "fault:friction"
    chromium = opened(content)
    found, said = _checked(chromium)
    assert found == "equal"
    assert "fault:friction" not in said
    beside = chromium.run("document.querySelector('#selfcheck + .bad').textContent")
    assert beside.startswith("fault:friction is not")
    assert "as its verdicts say" in beside
    picture = chromium.run('document.querySelector("#motion figure svg").innerHTML')
    assert "rgb(221, 0, 51)" in picture


def test_a_browser_runs_nothing_of_a_hostile_store(content: page.Content, opened: Any) -> None:
    chromium = opened(_hostile(content))
    assert chromium.run("Object.keys(document.documentElement.dataset).length") == 0
    assert chromium.run('document.querySelectorAll("script").length') == 2
    assert chromium.run('document.querySelectorAll("img").length') == 0
    # and it was there to be run
    assert chromium.run('document.querySelector("#hostile-0 figcaption").textContent').startswith(HOSTILE)


@pytest.mark.parametrize("width", [1100, 390])
def test_nothing_is_wider_than_the_window(content: page.Content, opened: Any, width: int) -> None:
    chromium = opened(content, width=width)
    assert chromium.run("document.documentElement.scrollWidth") <= width


def test_the_sliders_change_the_orbit(content: page.Content, opened: Any) -> None:
    chromium = opened(content)
    orbits = 'document.getElementById("orbits").innerHTML'
    said = 'document.getElementById("live-said").textContent'
    before = chromium.run(orbits)
    for name in "hkmpc":
        slide = f'document.getElementById("slide-{name}")'
        chromium.run(f'{slide}.value = {slide}.max; {slide}.dispatchEvent(new Event("input")); 0')
        after = chromium.run(orbits)
        assert after != before, name
        if name == "h":
            assert chromium.run(said) == "h ω = 3: beyond 2, all three explode"
        before = after
    assert "damping ratio" in chromium.run(said)
    chromium.run('document.getElementById("reset").click()')
    assert chromium.run(said) == "h ω = 0.1: explicit Euler spirals out, the two others stay"


def test_a_number_that_is_typed_stands_in_the_address(
    content: page.Content, opened: Any, tmp_path: Path
) -> None:
    chromium = opened(content)
    value = 'document.getElementById("show-k").value'
    chromium.run(f'{value} = "2.5"; document.getElementById("show-k").dispatchEvent(new Event("change")); 0')
    assert chromium.run("location.hash") == "#k=2.5"
    assert "h ω = 0.158" in chromium.run('document.getElementById("live-said").textContent')
    # a mass below 0 is none
    chromium.run('document.getElementById("show-m").value = "-1"; 0')
    chromium.run('document.getElementById("show-m").dispatchEvent(new Event("change")); 0')
    assert chromium.run('document.getElementById("show-m").value') == "1"
    chromium.send("Page.reload")
    while chromium._next().get("method") != "Page.loadEventFired":
        pass
    assert chromium.run(value) == "2.5"


THREE = ("explicit-euler", "semi-implicit-euler", "velocity-verlet")


@pytest.mark.parametrize("name", ["spring-uneven", "overdamped", "rlc-circuit"])
def test_exact_motion_in_the_page_is_that_of_the_library(
    content: page.Content, opened: Any, name: str
) -> None:
    scene = scenes.load_scene(name)
    s = linear(scene)
    assert s is not None
    s["at"] = s["f"] / s["k"]
    times = opened(content).run(f"exactMotion({json.dumps(s)}, [{scene.step}, {20 * scene.step}])")
    q, p = exact.true_motion(scene, np.array([1, 20]), scene.step)
    np.testing.assert_allclose(np.array(times).T, [q[:, 0], p[:, 0]], rtol=1e-9, atol=1e-12)


def test_names_at_the_edge_of_a_chart_stand_apart(content: page.Content, opened: Any) -> None:
    names = ["one", "other", "third"]
    curves = [Curve(name=x, group=x, x=[0.0, 1.0], y=[0.0, 1.0]) for x in names]
    labels = [Naming(text=x, group=x, x=1.0, y=1 - 0.052 * i) for i, x in enumerate(names)]
    rules = [Rule(axis="x", at=at, name=f"limit {at}") for at in (0.1, 0.11, 0.12)]
    scale = Scale(name="x", shown=(0.0, 1.0))
    chart = Chart(title="Names", x=scale, y=scale, curves=curves, labels=labels, rules=rules)
    chromium = opened(replace(content, data={**content.data, "banks": {"motion": charts.plain(
        Bank(title="Names", charts=[chart]))}}))  # fmt: skip
    boxes = chromium.run(
        "[...document.querySelectorAll('#motion .plot g text')].filter((x) => x.textContent)"
        ".map((x) => x.getBoundingClientRect().toJSON())"
    )
    assert len(boxes) == 6
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            apart = one["left"] >= other["right"] or other["left"] >= one["right"]
            # letters fill the middle of their lines
            assert apart or abs(one["y"] - other["y"]) >= 11, (one, other)


@pytest.mark.parametrize("width", [1100, 390])
def test_what_a_chart_writes_is_not_cut_off(content: page.Content, opened: Any, width: int) -> None:
    scale = Scale(name="x", shown=(0.0, 1000.0))
    small = Scale(name="y", shown=(-0.00125, 0.0005))
    curve = Curve(name="one", group="one", x=[0.0, 1000.0], y=[0.0, 0.0005])
    labels = [Naming(text="a name of letters that are many", group="one", x=x, y=0.5) for x in (0.61, 0.59)]
    rules = [Rule(axis="y", at=0.00049, name="a limit", look="one"), Rule(axis="x", at=990, name="a limit")]
    chart = Chart(title="Names", x=scale, y=small, curves=[curve], labels=labels, rules=rules)
    bank = charts.plain(Bank(title="Names", charts=[chart, chart]))
    chromium = opened(replace(content, data={**content.data, "banks": {"motion": bank}}), width=width)
    boxes = "[...document.querySelectorAll('#motion .plot')].map((plot) => [{frames}, {texts}]"
    box = ".getBoundingClientRect().toJSON()"
    script = boxes.format(
        frames=f"[plot.querySelector('svg'), plot.querySelector('.frame')].map((x) => x{box})",
        texts=f"[...plot.querySelectorAll('text')].map((x) => [x.closest('g') !== null, x{box}])",
    )
    for (whole, frame), texts in chromium.run(script + ")"):
        assert len(texts) > 10
        name = texts[-1][1]
        for inside, text in texts:
            around = frame if inside else whole
            assert around["left"] - 1 <= text["left"]
            assert text["right"] <= around["right"] + 1
            # letters fill the middle of their lines
            assert around["top"] - 3 <= text["top"]
            beside = text["left"] >= name["right"] - 3 or text["top"] > frame["bottom"]
            assert text is name or inside or beside


def _middle(chromium: Browser, of: str) -> tuple[float, float, float, float]:
    """Left, top, width and height of an element, scrolled into view [pixels]."""
    chromium.run(f"document.querySelector('{of}').scrollIntoView()")
    box = chromium.run(f"document.querySelector('{of}').getBoundingClientRect().toJSON()")
    return box["x"], box["y"], box["width"], box["height"]


def test_a_pointer_reads_points(spring: Path, content: page.Content, opened: Any) -> None:
    chromium = opened(content)
    x, y, w, h = _middle(chromium, "#motion .plot")
    read = "document.querySelector('#motion .reading').textContent"
    chromium.mouse("mouseMoved", x + w / 2, y + h / 3)
    found = re.fullmatch(r"(own:\S+): position q (\S+), momentum p (\S+); t (\S+)", chromium.run(read))
    assert found
    run = store.read(spring)[found[1]]
    row = int(np.flatnonzero(run.t == float(found[4]))[0])
    assert (run.q[row, 0], run.p[row, 0]) == (float(found[2]), float(found[3]))


@pytest.mark.parametrize("dark", [False, True])
def test_a_scheme_has_the_colour_that_it_has_in_figures(
    content: page.Content, opened: Any, dark: bool
) -> None:
    chromium = opened(content, dark=dark)
    for place in ("#motion", "#orbits"):
        drawn_in = chromium.run(
            f"[...document.querySelectorAll('{place} .plot')[0].querySelectorAll('.curve')]"
            ".map((x) => getComputedStyle(x).stroke)"
        )
        for scheme in THREE:
            shade = looks.ON_SCREEN[looks.look(scheme).color][dark]
            rgb = ", ".join(str(int(shade[i : i + 2], 16)) for i in (1, 3, 5))
            assert f"rgb({rgb})" in drawn_in, (place, scheme)


def test_methods_are_switched_on_and_off(content: page.Content, opened: Any) -> None:
    chromium = opened(content)
    lines = "document.querySelectorAll('#motion .plot')[0].querySelectorAll('.curve').length"
    # the exact solution, and the first engine of each scheme
    assert chromium.run(lines) == 4
    chromium.run("document.querySelectorAll('#motion input')[0].click()")
    assert chromium.run(lines) == 3


@pytest.mark.parametrize("name", NAMES)
def test_a_study_is_drawn(studies: dict[str, Path], opened: Any, name: str) -> None:
    chromium = opened(page.gather(studies[name]))
    drawn_paths = chromium.run(f"document.querySelectorAll('#{name}-0 .plot path').length")
    assert drawn_paths > 0
    x, y, w, h = _middle(chromium, f"#{name}-0 .plot")
    reading = f"document.querySelector('#{name}-0 .reading').textContent"
    places = ((x + w * i / 12, y + h * j / 12) for i in range(2, 12) for j in range(1, 10))
    assert any(chromium.mouse("mouseMoved", *place) or chromium.run(reading).strip() for place in places)
    assert chromium.said == []
