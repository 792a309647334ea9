"""Engines that a command line brings: the file of a plug-in."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from springcheck import engines


def bring(options: Namespace) -> None:
    """Make the engines that the options name known, and have their methods run beside the others.

    Raises MethodError, in one line, where one of them cannot be used.
    """
    labels = []
    for text in getattr(options, "engine", []):
        found = engines.from_file(Path(text))
        labels += [f"{found.name}:{name}" for name, method in found.methods.items() if method.default]
    if labels and hasattr(options, "method"):
        # where methods are named, those that are brought here are meant as well
        options.method = [*(options.method or ["*"]), *(x for x in labels if x not in options.method)]
