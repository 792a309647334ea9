"""One name for one class in the whole package, and a noun in the name of a constant that others have too."""

from __future__ import annotations

import ast
from collections import defaultdict
from functools import cache
from pathlib import Path

import springcheck

HOME = Path(springcheck.__file__).parent

STILL_TWICE = {
    "Candidate", "Case", "Check", "Clock", "Column", "Law", "Springs",
    "Tally",
}  # fmt: skip
"""Classes of two rooms that have one name still: none may join them."""

MOST_SHARED = 93
"""Names of constants that several modules give to things of their own: no more than there were."""

BY_CONTRACT = {"ENGINE", "STUDY"}
"""What every module of an engine, and every folder of a study, is asked for by name."""


@cache
def defined() -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Modules that define each public class, and each public constant."""
    classes, constants = defaultdict(list), defaultdict(list)
    for path in sorted(HOME.rglob("*.py")):
        where = path.relative_to(HOME).as_posix()
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef):
                classes[node.name].append(where)
            targets = node.targets if isinstance(node, ast.Assign) else []
            targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
            for name in (part for target in targets for part in ast.walk(target)):
                if isinstance(name, ast.Name) and name.id.isupper() and len(name.id) > 1:
                    constants[name.id].append(where)
    return (
        {name: found for name, found in classes.items() if len(found) > 1 and name[0] != "_"},
        {name: found for name, found in constants.items() if len(found) > 1 and name[0] != "_"},
    )


def test_two_classes_have_two_names() -> None:
    classes, _ = defined()
    assert {name: where for name, where in classes.items() if name not in STILL_TWICE} == {}
    assert set(classes) == STILL_TWICE, "what has one name now leaves the list"


def test_no_constant_has_the_name_of_many_others() -> None:
    _, constants = defined()
    assert {name: where for name, where in constants.items() if len(where) > 8}.keys() <= BY_CONTRACT
    assert not {"FEWEST", "FAR"} & set(constants)
    assert len(constants) <= MOST_SHARED, "a constant needs a name of its own: its noun"
