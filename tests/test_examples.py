"""The examples in docstrings of public names show what they print; each public function has one."""

from __future__ import annotations

import doctest
import inspect
from importlib import import_module

import matplotlib as mpl
import pytest

import springcheck

MODULES = [
    "springcheck", "springcheck.api.main", "springcheck.api.studies", "springcheck.plot",
    "springcheck.physics.trajectory", "springcheck.engines.contract", "springcheck.conformance",
]  # fmt: skip
FUNCTIONS = [name for name in springcheck.__all__ if inspect.isfunction(getattr(springcheck, name))]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_show_what_they_print(name: str) -> None:
    mpl.use("agg")
    found = doctest.testmod(
        import_module(name),
        extraglobs={"springcheck": springcheck},
        optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE,
    )
    assert found.failed == 0
    assert found.attempted > 0


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_has_an_example_and_sections(name: str) -> None:
    function = getattr(springcheck, name)
    text = inspect.getdoc(function) or ""
    assert ">>> " in text
    if name != "explain":
        assert "\nReturns\n---" in text or "\nRaises\n---" in text
    for parameter in inspect.signature(function).parameters if "\nParameters\n---" in text else ():
        assert parameter in text
