"""What every command prints with --json is what the schemas of `data/schemas` say of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import schemas
from springcheck import cli


def schema(command: str) -> dict[str, object]:
    """The schema of a command's documents."""
    return json.loads((schemas.FOLDER / f"{schemas.named(command)}.json").read_text())  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the commands read, which are made once."""
    folder = tmp_path_factory.mktemp("files")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("table.csv").write_text(schemas.table())
        schemas.printed(schemas.WAYS["run"][0] + " --force")
    return folder


@pytest.fixture
def _files(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)


@pytest.mark.usefixtures("_files")
@pytest.mark.parametrize("command", list(schemas.WAYS))
def test_every_document_of_a_command_keeps_to_its_schema(command: str) -> None:
    # the last way of a command is its shortest where others take long
    for words in schemas.WAYS[command][-1:] if command == "precision" else schemas.WAYS[command]:
        again = " --force" if " -o " in words else ""
        document = schemas.printed(words + again)
        assert document["schema"] == schema(command)["title"]
        assert schemas.problems(document, schema(command)) == []
        assert schemas.unlisted(document, schema(command)) == [], "python validation/schemas.py write"


def test_every_command_that_prints_a_document_has_a_schema() -> None:
    every = (*cli.STUDIES, *cli.COMMANDS)
    printing = [one.name for one in every if any("--json" in names for names, _ in one.arguments)]
    assert {path.stem for path in schemas.FOLDER.glob("*.json")} == {
        schemas.named(name) for name in (*printing, "scene")
    }
    assert set(schemas.WAYS) == set(printing)


@pytest.mark.usefixtures("_files")
@pytest.mark.parametrize("command", ["judge", "identify"])
def test_a_document_that_does_not_keep_to_its_schema_is_seen(command: str) -> None:
    document = schemas.printed(next(words for words in schemas.WAYS[command] if "run.h5" not in words))
    assert schemas.unlisted(document, schema(command)) == [], "python validation/schemas.py write"
    del document["schema"]
    assert schemas.problems({**document, "not_trusted": 3}, schema(command)) == [
        ".schema is missing",
        ".not_trusted is number, not array",
    ]
    assert schemas.unlisted({**document, "more": 3}, schema(command)) == [".more is not in the schema"]


def test_a_library_may_be_missing_where_the_doctor_looks() -> None:
    document = schemas.printed("doctor")
    document["libraries"]["pandas"] = None
    assert schemas.problems(document, schema("doctor")) == []


def test_the_schema_of_scene_files_is_what_reads_them() -> None:
    kept = schemas.FOLDER / "scene-1.json"
    assert kept.read_text() == schemas.of_scenes(), "python validation/schemas.py write"
    known = json.loads(kept.read_text())["$defs"]
    assert known["SpringTable"]["required"] == ["ends", "stiffness"]
    assert "[M/T2]" in known["SpringTable"]["description"]
    assert known["SpringTable"]["additionalProperties"] is False
