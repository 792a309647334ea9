"""What a run of the tests leaves to `--whole`: of campaigns the cases that do what others do as well."""

from __future__ import annotations

import ast
import subprocess
import sys
from cProfile import Profile
from dataclasses import replace
from functools import cache
from pathlib import Path

import campaigns
import slow
from springcheck import driver, load_scene

HERE = Path(__file__).parent


@cache
def marked(file: str) -> set[str]:
    tree = ast.parse((HERE.parent / file).read_text(encoding="utf-8"))
    return {
        part.name
        for part in tree.body
        if isinstance(part, ast.FunctionDef)
        and any("mark.campaign" in ast.unparse(x) for x in part.decorator_list)
    }


def test_every_case_that_is_left_out_is_of_a_campaign() -> None:
    listed = campaigns.LIST.read_text(encoding="utf-8").splitlines()
    assert listed == sorted(set(listed))
    for name in listed:
        file, test = name.split("[")[0].split("::")
        assert test in marked(file), name


def test_what_is_slow_is_a_test_and_in_the_list_alone() -> None:
    rows = [line.split(" ") for line in slow.LIST.read_text(encoding="utf-8").splitlines()]
    assert len(rows) > 400
    assert [name for _, name in rows] == sorted({name for _, name in rows})
    assert all(float(seconds) >= slow.SLOW for seconds, _ in rows)
    sources = {path.name: path.read_text(encoding="utf-8") for path in HERE.glob("test_*.py")}
    for _, name in rows:
        file, test = name.removeprefix("tests/").split("::")
        assert f"def {test}(" in sources[file], name
    by_hand = "mark." + "slow"
    assert [name for name, text in sources.items() if by_hand in text] == []


def test_the_dearest_are_left_out_as_long_as_every_jump_is_made() -> None:
    made = {"a": {(1,), (2,)}, "b": {(2,), (3,)}, "c": {(1,), (3,)}, "d": {(4,)}, "e": {(4,)}}
    dear = 10 * campaigns.CHEAP
    costs = {"a": 3 * dear, "b": 2 * dear, "c": dear, "d": campaigns.CHEAP + 1, "e": campaigns.CHEAP}
    assert campaigns.left_out(costs, made) == {"a", "d"}
    assert campaigns.left_out({"a": dear, "b": 2 * dear, "c": 3 * dear}, made) == {"c"}
    # of two alike one stays
    assert campaigns.left_out({"d": dear, "f": 2 * dear}, {"d": {(4,)}, "f": {(4,)}}) == {"f"}


def test_a_cost_is_the_calls_that_are_made_and_a_process_counts_for_many() -> None:
    scene = load_scene("spring")
    costs = []
    # the first run loads the engine
    for steps in (100, 100, 100, 200):
        with Profile() as profile:
            driver.run(replace(scene, steps=steps), "ase:velocity-verlet")
        costs.append(campaigns.calls(profile))
    assert abs(costs[2] - costs[1]) < 0.01 * costs[1]
    assert 1.1 * costs[1] < costs[3] < 100 * costs[1]
    with Profile() as profile:
        subprocess.run([sys.executable, "-S", "-c", ""], check=True)
    assert campaigns.PROCESS < campaigns.calls(profile) < 2 * campaigns.PROCESS
