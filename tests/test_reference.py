"""The help of every command parses its own examples, `doctor` says what is installed, the how-tos run."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import pytest

from springcheck.cli import main

HOWTO = Path(__file__).parents[1] / "validation" / "howto.md"


def test_the_doctor_names_versions_arithmetic_and_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["long_double"]["bits"] in (53, 64, 106, 113)
    engines = {one["name"]: one for one in found["engines"]}
    assert engines["own"]["problem"] is None
    assert "Reference" in engines["openmm"]["platforms"]
    missing = [one for one in engines.values() if one["problem"]]
    assert all("install" in one["problem"] for one in missing)
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    assert said.count("  missing  ") == len(missing)
    assert "  ok       own" in said


def test_the_python_of_the_how_tos_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib as mpl

    pytest.importorskip("pandas")
    mpl.use("agg")
    monkeypatch.chdir(tmp_path)
    code = next(
        block
        for block in re.findall(r"```python\n(.*?)```", HOWTO.read_text(encoding="utf-8"), re.S)
        if "budget=5" in block
    )
    (tmp_path / "notebook.py").write_text(code.replace("budget=5", "budget=0.3"))
    # a function that is identified needs a file to be named in a message
    exec(compile(code.replace("budget=5", "budget=0.3"), "notebook.py", "exec"), {"__name__": "notebook"})
    assert [path.name for path in tmp_path.iterdir()] == ["notebook.py"]


def test_every_command_shows_examples_that_it_can_parse(capsys: pytest.CaptureFixture[str]) -> None:
    from springcheck.cli import _parser
    from springcheck.cli.commands import COMMANDS
    from springcheck.cli.groups import EXAMPLES
    from springcheck.studies import STUDIES

    assert set(EXAMPLES) == {one.name for one in (*STUDIES, *COMMANDS)}
    for name, examples in EXAMPLES.items():
        assert examples
        for example in examples:
            words = [name, *shlex.split(example)]
            assert _parser(words).parse_args(words).name == name
        with pytest.raises(SystemExit):
            main([name, "--help"])
        said = capsys.readouterr().out
        assert f"  springcheck {name} {examples[0]}".rstrip() in said
        assert max(map(len, said.splitlines())) <= 80
        assert "\nother:" not in said
