"""What a run of the tests leaves to `--whole`: of campaigns the cases that do what others do as well."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import campaigns

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


def test_the_dearest_are_left_out_as_long_as_every_jump_is_made() -> None:
    made = {"a": {(1,), (2,)}, "b": {(2,), (3,)}, "c": {(1,), (3,)}, "d": {(4,)}, "e": {(4,)}}
    seconds = {"a": 3.0, "b": 2.0, "c": 1.0, "d": 0.1, "e": campaigns.CHEAP / 2}
    assert campaigns.left_out(seconds, made) == {"a", "d"}
    assert campaigns.left_out({"a": 1.0, "b": 2.0, "c": 3.0}, made) == {"c"}
    # of two alike one stays
    assert campaigns.left_out({"d": 1.0, "f": 2.0}, {"d": {(4,)}, "f": {(4,)}}) == {"f"}
