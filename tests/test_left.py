"""What springcheck no longer has is refused by name, and stores that hold it can still be looked at."""

from __future__ import annotations

from pathlib import Path

import pytest

from springcheck.cli import main
from springcheck.errors import SceneError
from springcheck.physics import scenefile

STORES = Path(__file__).parent / "older-stores"

PARTICLE = "[[particle]]\nmass = 1.0\nposition = [1.0, 0.0]\n"
TIME = "[time]\nstep = 0.1\nsteps = 3\n"

LEFT = {
    "box": (PARTICLE + "[box]\nlengths = 4.1\n", "periodic boxes"),
    "magnetic": (PARTICLE + "[[magnetic]]\nparticle = 0\nstrength = 0.7\n", "magnetic fields"),
    "modulated-spring": (PARTICLE + "[[modulated-spring]]\nparticle = 0\n", "springs of modulated stiffness"),
    "rod": (PARTICLE + '[[rod]]\nends = ["wall", 0]\n', "constraints"),
    "rotor": ("[[rotor]]\ninertia = 1.0\n", "rotors"),
}


@pytest.mark.parametrize("name", LEFT)
def test_a_scene_with_what_left_is_refused_by_name(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, what = LEFT[name]
    with pytest.raises(SceneError, match=f"{name}: {what}.* not part of springcheck"):
        scenefile.parse(text + TIME, name="s")
    path = tmp_path / "s.toml"
    path.write_text(text + TIME)
    assert main(["run", str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert what in line


@pytest.mark.parametrize("name", LEFT)
def test_a_store_with_what_left_is_inspected_and_checked_and_says_so(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    store = str(STORES / f"{name}.h5")
    assert main(["inspect", store]) == 0
    said = capsys.readouterr().out
    assert f"{name}: {LEFT[name][1]}" in said
    assert "own:" in said
    label = said[said.index("own:") :].split()[0]
    assert main(["inspect", store, "--trajectory", label]) == 0
    assert main(["check", store]) == 0
    assert main(["report", store, "-o", "page.html"]) == 2
    assert LEFT[name][1] in capsys.readouterr().err
