"""What is not part of springcheck is refused by name in one line, and stores that hold it still open."""

from __future__ import annotations

from pathlib import Path

import pytest

from springcheck import load_scene, store
from springcheck.cli import main
from springcheck.errors import SceneError
from springcheck.physics import scenefile
from springcheck.physics.scenefile.tables import LEFT


@pytest.mark.parametrize("name", sorted(LEFT))
@pytest.mark.parametrize("row", ["[{0}]", "[[{0}]]"])
def test_a_scene_with_what_left_is_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, row: str
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(load_scene("spring").to_toml() + "\n" + row.format(name) + "\nunheard-of = 1.0\n")
    assert main(["run", str(scene), "-o", str(tmp_path / "a.h5")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"[{name}]" in said
    assert LEFT[name] in said
    assert "Traceback" not in said
    with pytest.raises(SceneError, match=LEFT[name]):
        load_scene(scene)
    assert LEFT[name] in scenefile.gone_from(scene.read_text())


def test_a_store_with_what_left_still_opens_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.h5"
    assert main(["run", "spring", "--method", "own:euler", "-o", str(path)]) == 0
    capsys.readouterr()
    text = store.scene_text(path) + "\n[[magnetic]]\nparticle = 0\nstrength = 1.0\n"
    monkeypatch.setattr(store, "scene_text", lambda path: text)
    for more, says in ([], True), (["--trajectory", "own:euler"], False):
        assert main(["inspect", str(path), *more]) == 0
        assert (LEFT["magnetic"] in capsys.readouterr().out) == says
