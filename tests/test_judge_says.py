"""What the judge says where it cannot tell, and of a store whose numbers are no longer those of its seal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import springcheck
from springcheck import checks
from springcheck.cli import main
from springcheck.physics import scenefile
from springcheck.studies.run import measure

UNTELLING = """
title = "A well, recorded so rarely that no step can be told"
[[particle]]
mass = 1.0
position = 1.0
[[quartic]]
particle = 0
coefficient = 1.3
[time]
step = 0.1
steps = 6000
[record]
every = 3000
"""


def test_a_method_of_which_nothing_could_tell_is_not_judged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml = tmp_path / "still.toml"
    toml.write_text(UNTELLING)
    arguments = ["run", str(toml), "-o", str(tmp_path / "a.h5"), "--method", "own:semi-implicit-euler"]
    assert main(arguments) == 2
    said = capsys.readouterr().out
    assert "not judged: own:semi-implicit-euler: nothing that applied could tell" in said


def test_a_method_is_not_judged_by_facts_of_its_record_alone() -> None:
    scene = scenefile.load_scene("spring-uneven")
    run = springcheck.simulate(replace(scene, steps=20), "own:semi-implicit-euler")
    verdicts = checks.judge(replace(scene, steps=20), run)
    assert checks.not_judged(verdicts) == ()
    facts = [v for v in verdicts if v.check in ("start", "times", "grid", "energies", "line", "momentum")]
    assert checks.not_judged(facts) == (run.label,)


def is_of_numbers(data: object) -> bool:
    return (
        isinstance(data, h5py.Dataset)
        and data.dtype == np.float64
        and len(data) > 100
        and not data.is_virtual
    )


def test_a_repetition_is_held_against_the_numbers_and_not_against_their_digest(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    assert main(["run", "spring", "-o", str(path), "--method", "own:semi-implicit-euler", "--quiet"]) == 0
    assert all(one.equal for one in measure.repeat(path))
    with h5py.File(path, "r+") as file:
        found: list[h5py.Dataset] = []
        file.visititems(lambda name, x: found.append(x) if is_of_numbers(x) else None)
        assert found
        for data in found:
            data[5] = np.nextafter(data[5], 2.0)
    assert not any(one.equal for one in measure.repeat(path))
