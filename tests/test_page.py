"""The report page: what stands in it, that no store becomes a part of it, and how a real browser sees it."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springcheck import page, store
from springcheck.cli import main
from springcheck.errors import StoreError
from springcheck.page.content import drawn
from springcheck.physics import scenefile as scenes
from springcheck.studies.run import measure

HOSTILE = (
    "</title></script><script>document.documentElement.dataset.hurt=1</script><img src=x onerror='1'>\"'&"
)
OWN = ("own:euler", "own:semi-implicit-euler", "own:velocity-verlet", "ase:velocity-verlet")


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "spring.h5"
    measure.run(scenes.load_scene("spring"), path, methods=OWN)
    return path


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
    return json.loads(found[1])


def test_numbers_read_back_bit_for_bit(spring: Path) -> None:
    data = _data(page.html(page.gather(spring)))
    stored = store.read(spring)
    assert [run["label"] for run in data["runs"]] == list(stored)
    for run in data["runs"]:
        kept = stored[run["label"]]
        for name, values in (
            ("t", kept.t),
            ("q", kept.q[:, 0]),
            ("p", kept.p[:, 0]),
            ("energy", kept.energy),
        ):
            assert np.array(run[name], np.float64).tobytes() == np.ascontiguousarray(values).tobytes()


def test_numbers_that_are_none_are_words(spring: Path) -> None:
    content = page.gather(spring)
    run = replace(store.read(spring)["own:euler"], t=np.array([np.inf, -np.inf, np.nan, -0.0]))
    data = _data(page.html(replace(content, data={"spring": None, "runs": [drawn(run)]})))
    found = data["runs"][0]["t"]
    assert found[:3] == ["Infinity", "-Infinity", "NaN"]
    assert np.signbit(found[3])


def test_it_asks_for_nothing_and_is_small(spring: Path) -> None:
    text = page.html(page.gather(spring))
    assert len(text.encode()) < 500_000
    for tag, attributes in Tags(text).tags:
        assert tag not in {"link", "img", "iframe", "object", "embed", "base", "form"}
        assert not {"src", "href", "srcset", "action"} & set(attributes), tag
    assert re.findall(r"https?://[^\s\"'<]+", text) == ["http://www.w3.org/2000/svg"]
    assert "@import" not in text
    assert set(re.findall(r"url\([^)]*\)", text)) == {"url(#${clip})"}
    assert "default-src 'none'" in text


def test_tables_have_headers_and_every_verdict_its_reason(spring: Path) -> None:
    text = page.html(page.gather(spring))
    tags = Tags(text)
    assert tags.count("table") == len(OWN) + 2
    assert all(attributes.get("scope") in {"row", "col"} for tag, attributes in tags.tags if tag == "th")
    verdicts = store.verdicts(spring)
    assert text.count('class="why"') == len(verdicts) > 0
    assert "equal bit for bit" in text or "differ by at most" in text


def test_a_failed_verdict_is_open_and_named(spring: Path) -> None:
    content = page.gather(spring)
    first = content.methods[0]
    wrong = replace(first.verdicts[0], passed=False, value=2.0, bound=1.0)
    text = page.html(replace(content, methods=(replace(first, verdicts=(wrong,)), *content.methods[1:])))
    assert text.count("<details open>") == 1
    assert "1 FAILED" in text
    assert "<details open>" not in page.html(content)


def _hostile(content: page.Content) -> page.Content:
    """Everything that a file may say, said by one that means harm."""
    first = content.methods[0]
    verdicts = tuple(replace(v, check=HOSTILE, why=HOSTILE, unit=HOSTILE) for v in first.verdicts)
    runs = [{**run, "label": HOSTILE, "title": HOSTILE, "scheme": HOSTILE} for run in content.data["runs"]]
    known = dict.fromkeys(content.summary.runs[0].parameters, HOSTILE) | {"origin." + HOSTILE: HOSTILE}
    mine = replace(content.summary.runs[0], label=HOSTILE, parameters=known)
    assert content.comparison is not None
    assert content.same
    return replace(
        content,
        scene=replace(content.scene, title=HOSTILE, source=HOSTILE),
        scene_text=HOSTILE,
        not_trusted=(store.Finding(place=HOSTILE, what=HOSTILE),),
        methods=(replace(first, method=HOSTILE, scheme=HOSTILE, verdicts=verdicts),),
        same=tuple(replace(one, labels=(HOSTILE,) * len(one.labels)) for one in content.same),
        comparison=replace(content.comparison, labels=(HOSTILE,) * len(content.comparison.labels)),
        summary=replace(
            content.summary, path=Path("a" + HOSTILE.replace("/", "")), runs=(mine,), root={"run": HOSTILE}
        ),
        data={**content.data, "runs": runs},
    )


def test_a_hostile_store_adds_no_element(spring: Path) -> None:
    text = page.html(_hostile(page.gather(spring)))
    tags = Tags(text)
    assert tags.count("script") == 2
    assert tags.count("img") == 0
    assert not any(name.startswith(("on", "data-hurt")) for _, attributes in tags.tags for name in attributes)
    assert _data(text)["runs"][0]["label"] == HOSTILE
    assert text.count("&lt;/title&gt;") > 20


def test_a_hostile_scene_through_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = replace(scenes.load_scene("spring"), title=HOSTILE, source=HOSTILE, steps=5)
    measure.run(scene, tmp_path / "a.h5", methods=("own:euler",))
    assert main(["report", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.html")]) == 0
    assert "kB" in capsys.readouterr().out
    tags = Tags((tmp_path / "a.html").read_text())
    assert tags.count("script") == 2
    assert tags.count("img") == 0


def test_only_reports_are_replaced(spring: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, mine = page.gather(spring), tmp_path / "mine.html"
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
    assert len(text.encode()) < 500_000
    assert (content.data["spring"] is None) == ("does not compute anything again" in text)
    assert (content.data["spring"] is None) == (name != "lc-circuit")


def test_a_long_run_is_thinned_and_says_so(tmp_path: Path) -> None:
    scene = replace(scenes.load_scene("spring"), steps=100_000)
    measure.run(scene, tmp_path / "a.h5", methods=OWN[1:3])
    content = page.gather(tmp_path / "a.h5")
    text = page.html(content)
    assert len(text.encode()) < 500_000
    assert f"Every {content.stride}th stored frame" in text
    assert all(run["every"] == content.stride for run in content.data["runs"])


# in a browser


def opened(path: Path) -> tuple[str, str]:
    """The page after its scripts, and what its console said."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser is None and not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        pytest.skip("chromium is not here")
    assert browser, "chromium is required here"
    done = subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
            f"--user-data-dir={path.parent / 'profile'}", "--enable-logging=stderr",
            "--virtual-time-budget=20000", "--dump-dom", path.as_uri(),
        ],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    return done.stdout, "\n".join(line for line in done.stderr.splitlines() if "CONSOLE" in line)


def _result(dom: str) -> str:
    found = re.search(r'id="selfcheck" data-result="(\w+)"', dom)
    assert found
    return found[1]


def test_a_browser_gets_the_same_doubles(spring: Path, tmp_path: Path) -> None:
    page.write(page.gather(spring), tmp_path / "a.html")
    dom, said = opened(tmp_path / "a.html")
    assert said == ""
    assert _result(dom) == "equal"
    assert "Your browser = this file, to the last bit" in dom
    assert all(f"{label}: 201 frames, each q and p the same double" in dom for label in OWN)
    assert dom.count('<path class="curve"') > 8


def test_a_browser_gets_the_same_doubles_of_another_spring(tmp_path: Path) -> None:
    base = scenes.load_scene("spring")
    wall = replace(base.terms[0], k=np.array([1.7]), at=np.array([0.3]))  # type: ignore[type-var]
    scene = replace(
        base, terms=(wall,), m=np.array([0.37]), q=np.array([-0.2]), step=0.07, steps=1_500, every=3
    )
    measure.run(scene, tmp_path / "a.h5", methods=OWN[1:])
    page.write(page.gather(tmp_path / "a.h5"), tmp_path / "a.html")
    dom, said = opened(tmp_path / "a.html")
    assert said == ""
    assert _result(dom) == "equal"


def test_a_browser_sees_one_changed_bit(spring: Path, tmp_path: Path) -> None:
    content = page.gather(spring)
    runs = json.loads(json.dumps(content.data["runs"]))
    runs[1]["p"][150] = float(np.nextafter(runs[1]["p"][150], 9.0))
    page.write(replace(content, data={**content.data, "runs": runs}), tmp_path / "a.html")
    dom, _ = opened(tmp_path / "a.html")
    assert _result(dom) == "differs"
    assert "own:semi-implicit-euler differs first in frame 150, t = 15" in dom
    assert "own:euler: 201 frames" in dom


def test_a_browser_runs_nothing_of_a_hostile_store(spring: Path, tmp_path: Path) -> None:
    page.write(_hostile(page.gather(spring)), tmp_path / "a.html")
    dom, said = opened(tmp_path / "a.html")
    assert said == ""
    tags = Tags(dom)
    assert tags.tags[0] == ("html", {"lang": "en"})
    assert tags.count("script") == 2
    assert tags.count("img") == 0


def test_the_sliders_change_the_orbit(spring: Path, tmp_path: Path) -> None:
    text = page.html(page.gather(spring))
    drive = """<script>
        const before = document.getElementById("orbit").innerHTML, h = document.getElementById("slide-h");
        h.value = h.max; h.dispatchEvent(new Event("input"));
        document.body.dataset.changed = before !== document.getElementById("orbit").innerHTML;
        document.body.dataset.said = document.getElementById("live-said").textContent;
        document.getElementById("reset").click();
        document.body.dataset.back = document.getElementById("live-said").textContent;
    </script></body>"""
    # what drives it may not run in the page as it is
    text = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", text).replace("</body>", drive)
    (tmp_path / "a.html").write_text(text)
    dom, said = opened(tmp_path / "a.html")
    assert said == ""
    body = dict(next(attributes for tag, attributes in Tags(dom).tags if tag == "body"))
    assert body["data-changed"] == "true"
    assert body["data-said"] == "h ω = 3: beyond 2, all three explode"
    assert body["data-back"] == "h ω = 0.1: explicit Euler spirals out, the two others stay"
