"""Records that hold arrays are equal only to themselves: comparing arrays has no one answer."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np

import springcheck
from springcheck.checks.stats import line

ARRAYS = re.compile(r"\b(Floats|Extended|Reals|Integers|ndarray|NDArray)\b")
"""Types of fields that are arrays."""


def test_two_fits_are_compared_without_an_error_and_found_equal_only_to_themselves() -> None:
    x = np.arange(4.0)
    one, other = line(x, 2 * x), line(x, 2 * x)
    assert one == one  # noqa: PLR0124
    assert one != other
    assert len({one, other}) == 2


def test_every_record_of_arrays_is_compared_by_identity() -> None:
    bad = []
    for path in Path(springcheck.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ClassDef):
                continue
            decorators = [ast.unparse(one) for one in node.decorator_list]
            is_tuple = "NamedTuple" in [ast.unparse(base) for base in node.bases]
            if not is_tuple and not any(one.startswith("dataclass") for one in decorators):
                continue
            fields = [ast.unparse(one.annotation) for one in node.body if isinstance(one, ast.AnnAssign)]
            held = [one for one in fields if ARRAYS.search(one) and "Callable" not in one]
            if held and not any("eq=False" in one or one == "by_identity" for one in decorators):
                bad.append(f"{path.name}: {node.name}")
    assert bad == []
