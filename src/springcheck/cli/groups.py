"""Headings of the arguments in the help of a command, and its examples."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence

from springcheck.studies.arguments import REPORT_FORMS, Argument

EXAMPLES: Mapping[str, Sequence[str]] = {
    "run": (
        "spring",
        "spring-uneven --method 'own:*' --step 0.05 --thorough",
        "spring --temperature 300K --seed 1",
        "spring --stepper mine.py:step",
    ),
    "precision": ("spring", "spring --budget 20 --metric energy", "spring --long 1e5 --step 0.3"),
    "stability": ("spring", "multiple-time-steps --method 'openmm:*'"),
    "extremes": ("--quick",),
    "sampling": ("--method 'own:*' --method 'openmm:*'",),
    "inspect": ("spring.h5 --verdicts", "spring.h5 --trajectory own:euler --rows 5"),
    "plot": ("spring.h5 -o figures", "spring-precision.h5 --x calls --y phase", "orbit.csv"),
    "report": ("spring.h5 -o spring.html",),
    "show": ("spring -o my.toml",),
    "explain": ("velocity-verlet", "step-defect", "openmm:verlet"),
    "cite": ("", "spring.h5"),
    "identify": ("orbit.csv --mass 3.7", "--stepper mine.py:step"),
    "judge": ("orbit.csv --scene spring --scheme velocity-verlet",),
    "check": ("spring.h5",),
    "export": ("spring.h5 own:euler out.h5md",),
    "list": ("", "methods"),
    "doctor": ("",),
}
"""Examples of each command, without its name: the help prints them, and a test parses them."""


GROUPS: Mapping[str, Sequence[str]] = {
    "input": ("file", "files", "store", "label", "word", "kind", "--trajectory", "--columns", "--from"),
    "scene": ("scene", "--scene", "--step", "--steps", "--set", "--temperature", "--friction", "--seed"),
    "methods": (
        "--method", "--all", "--engine", "--stepper", "--command", "--scheme", "--timeout", "--fault",
    ),
    "known of the motion": ("--mass", "--stiffness", "--differences", "--arithmetic"),
    "how much is measured": (
        "--thorough", "--partial", "--budget", "--metric", "--long", "--quick", "--workers", "--cluster",
    ),
    "figures": ("--particle", "--x", "--y"),
    "output": ("output", "--output", "--force", "--json", "--quiet", "--verdicts", "--left-out", "--rows"),
    "continuous integration": tuple(f"--{name}" for name in REPORT_FORMS),
}  # fmt: skip
"""Headings in the order of the help, with the arguments below each."""
ELSEWHERE: Mapping[str, Mapping[str, str]] = {
    "plot": {"--step": "input"},
    "judge": {"--step": "input", "--scheme": "scene"},
    "identify": {
        "--stepper": "input", **dict.fromkeys(("--step", "--friction", "--scheme"), "known of the motion"),
    },
}  # fmt: skip
"""By command: options with another meaning there than in other commands, and their headings."""


class Formatter(argparse.HelpFormatter):
    """Wraps descriptions, and leaves the lines of examples as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)


def heading(command: str, names: Sequence[str]) -> str:
    """Heading of an argument; "other" where no group names it, as one of a plug-in."""
    known = ELSEWHERE.get(command, {})
    every = [known[name] for name in names if name in known]
    return [*every, *(title for title, of in GROUPS.items() if set(names) & {*of}), "other"][0]


def add(parser: argparse.ArgumentParser, command: str, arguments: Iterable[Argument]) -> None:
    """Add arguments to a command, in groups."""
    groups = {title: parser.add_argument_group(title) for title in (*GROUPS, "other")}
    for names, how in arguments:
        groups[heading(command, names)].add_argument(*names, **how)
