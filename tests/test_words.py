"""Messages and documents use the field's words: a private one fails here, with the word to write instead."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

PRIVATE = {
    r"\b(un)?told\b(?! apart)": "reported, detected, stated; or name what happens",
    r"\bsaid\b": "reported, stated",
    r"\b(is|are|was|were|be|a) kept\b|\bkept (in|within|as|by)\b|\btaken up\b": "conserved, stored, resumed",
    r"\b(is|are|was|be) held\b|\bheld (over|against|for)\b": "constrained, constant, compared",
    r"\bbesides?\b": "next to, with",
    r"\bmend(s|ed|ing)?\b": "fix, repair",
    r"\boff by\b|\b(is|are) off\b": "wrong by",
    r"(%|\bonce|\btimes|\benergy|\brad) a step\b": "per step",
    r"\b(true|exact) motion\b": "exact solution",
    r"\bwhat the states show\b": "diagnosis",
    r"\bwould (be seen|see)\b|\bsees\b": "detection limit, smallest detectable error",
    r"\btelling (check|number|frame)s?\b": "discriminating",
    r"\bcarried on\b": "accumulated rounding error",
    r"\bof the start (are|is)\b": "initial",
    r"\bquartic wells?\b|\bhardening\b|\brigidity\b": "quartic potential, Duffing oscillator, curvature",
    r"\b(a|its) walk\b": "a random walk",
    r"\bas good as\b|\bby its law\b|\btoo (hot|cold) by\b": "effectively, in theory, above the temperature",
    r"\bis said there\b": "delete the clause",
}
"""Words of this project that a reader of the field does not know, and the field's."""

DOCUMENTS = sorted(
    path
    for pattern in ("README.md", "*/README.md", ".github/**/*.md", "src/**/README.md", "validation/**/*.md")
    for path in ROOT.glob(pattern)
    if ".venv" not in path.parts
)


def messages(path: Path) -> Iterator[tuple[int, str]]:
    """Every text of a source file that is not a docstring and is more than one word, with its line."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    bare = {
        id(one.value)
        for one in ast.walk(tree)
        if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)
    }
    for one in ast.walk(tree):
        text = one.value if isinstance(one, ast.Constant) and id(one) not in bare else None
        if isinstance(text, str) and " " in text.strip():
            yield one.lineno, text


def private(text: str) -> list[str]:
    """Each private word of a text, with what to write."""
    return [f"{found[0]!r}: {field}" for word, field in PRIVATE.items() for found in re.finditer(word, text)]


def test_messages_use_the_words_of_the_field() -> None:
    files = list((ROOT / "src").rglob("*.py"))
    assert len(files) > 100
    found = [
        f"{path.relative_to(ROOT)}:{line}: {word}"
        for path in files
        for line, text in messages(path)
        for word in private(text)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_documents_use_the_words_of_the_field(path: Path) -> None:
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    found = [f"{number}: {word}" for number, line in lines for word in private(line)]
    assert not found, "\n".join(found)


def test_private_words_are_found() -> None:
    assert private("a stiffness off by 1e-3 would be seen") == [
        "'off by': wrong by",
        "'would be seen': detection limit, smallest detectable error",
    ]
    assert private("the drift per step is reported") == []
