"""What the documents say, in one line of words each: tests hold numbers in them against the code."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[1]


def words_of(name: str) -> str:
    """The document of this path from the root, its words with one space between."""
    return " ".join((ROOT / name).read_text(encoding="utf-8").split())
