"""Engines from the command line: plug-in files, functions, programs in any language."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from springcheck import engines
from springcheck.doors import command, function
from springcheck.errors import MethodError
from springcheck.physics import terms


@dataclass(frozen=True, slots=True, kw_only=True)
class Brought:
    """Engines, functions and programs as a command line gives them, so that another process can load them."""

    engines: tuple[str, ...] = ()
    steppers: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()
    schemes: tuple[str, ...] = ()
    """A scheme for all functions and programs, or as ``name=scheme`` for one."""
    seconds: float = command.SECONDS

    def bring(self) -> list[str]:
        """Register the engines -> the labels of their methods.  MethodError where one cannot be used."""
        found = [engines.from_file(Path(text)) for text in self.engines]
        # a file may only register a term
        labels = [
            label
            for x in found
            if x is not None
            # whether thermostats are meant or methods depends on the scene
            for label in (
                [f"{x.name}:*"] if x.thermostats
                else [f"{x.name}:{m.name}" for m in x.methods.values() if m.default]
            )
        ]  # fmt: skip
        if self.steppers:
            files = [function.file_of(spec) for spec in self.steppers]
            made = function.engine(self.steppers, self._stated)
            labels += _labels(engines.bring(made, files[0], _digest(*files)))
        if self.programs:
            made = command.engine(self.programs, self._stated, self.seconds)
            files = [file for text in self.programs for file in command.files(text)]
            labels += _labels(engines.bring(made, self.programs[0], _digest(*files)))
        names = {label.partition(":")[2] for label in labels}
        unknown = [text for text in self.schemes if "=" in text and text.partition("=")[0] not in names]
        if unknown:
            raise MethodError(f"--scheme {unknown[0]}: no function and no program has this name")
        return labels

    def _stated(self, name: str) -> str:
        """The scheme that is stated for a function or a program, or ""."""
        stated = {of: scheme for of, _, scheme in (text.rpartition("=") for text in reversed(self.schemes))}
        return stated.get(name, stated.get("", ""))


@cache
def bring_once(what: Brought) -> None:
    """Register them once in this process: a worker carries out many parts."""
    what.bring()


def bring(options: Namespace) -> None:
    """Register the engines that the options name, so that their methods run next to the others.

    `options.brought` hands them on to the processes that a study starts.  Raises MethodError, in one line,
    where one of them cannot be used.
    """
    seconds = getattr(options, "timeout", None)
    if seconds is not None and not (math.isfinite(seconds) and seconds > 0):
        raise MethodError(f"--timeout {seconds}: a number of seconds above 0 is needed")
    what = Brought(
        engines=tuple(options.engine),
        steppers=tuple(getattr(options, "stepper", ())),
        programs=tuple(getattr(options, "program", ())),
        schemes=tuple(getattr(options, "scheme", ())),
        seconds=command.SECONDS if seconds is None else seconds,
    )
    before = terms.known()
    labels = what.bring()
    options.brought = what
    if getattr(options, "cluster", None):
        raise MethodError("--cluster: what a call brings is not on the machines of a cluster; leave it out")
    if (getattr(options, "workers", 1) or 1) > 1 and terms.known() != before:
        raise MethodError(
            "--workers: a term that a call brings is known to its own process alone; leave it out"
        )
    if labels and hasattr(options, "method"):
        # where methods are named, those that are brought here are added to them, but of engines named there
        named = options.method or [engines.UNNAMED]
        others = [x for x in labels if f"{x.partition(':')[0]}:" not in (y[: y.find(":") + 1] for y in named)]
        options.method = list(dict.fromkeys([*named, *others]))


def _labels(found: engines.Engine) -> list[str]:
    return [f"{found.name}:{name}" for name in found.methods]


def _digest(*paths: str) -> str:
    """Stands for the version of code: runs of an older one are not resumed."""
    found = sha256()
    for path in paths:
        if Path(path).is_file():
            found.update(Path(path).read_bytes())
    return found.hexdigest()[:12]
