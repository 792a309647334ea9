"""Engines that a command line brings: the file of a plug-in, a function, a program in any language."""

from __future__ import annotations

import math
from argparse import Namespace
from hashlib import sha256
from pathlib import Path

from springcheck import engines
from springcheck.doors import command, function
from springcheck.errors import MethodError


def bring(options: Namespace) -> None:
    """Make the engines that the options name known, and have their methods run beside the others.

    Raises MethodError, in one line, where one of them cannot be used.
    """
    scheme = getattr(options, "scheme", None) or ""
    labels = []
    for text in getattr(options, "engine", []):
        # a file may only register a term
        if (own := engines.from_file(Path(text))) is not None:
            labels += [f"{own.name}:{name}" for name, method in own.methods.items() if method.default]
    if getattr(options, "stepper", None):
        file = function.file_of(options.stepper)
        found = engines.bring(function.engine(options.stepper, scheme), file, _digest(file))
        labels += [f"{found.name}:{name}" for name in found.methods]
    if getattr(options, "program", None):
        seconds = options.timeout if options.timeout is not None else command.SECONDS
        if not (math.isfinite(seconds) and seconds > 0):
            raise MethodError(f"--timeout {seconds}: a number of seconds above 0 is needed")
        made = command.engine(options.program, scheme, seconds)
        found = engines.bring(made, options.program, _digest(*command.files(options.program)))
        labels += [f"{found.name}:{name}" for name in found.methods]
    if labels and (getattr(options, "workers", 1) or 1) > 1:
        raise MethodError("--workers: what a call brings is known to its own process alone; leave it out")
    if labels and hasattr(options, "method"):
        # where methods are named, those that are brought here are meant as well
        options.method = [*(options.method or ["*"]), *(x for x in labels if x not in options.method)]


def _digest(*paths: str) -> str:
    """What stands for the version of code: runs of an older one are not taken up."""
    found = sha256()
    for path in paths:
        if Path(path).is_file():
            found.update(Path(path).read_bytes())
    return found.hexdigest()[:12]
