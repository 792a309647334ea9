"""Which rules of `identify` have a trajectory that dies without them, in the corpus of `identify_corpus.py`.

    python validation/identify_rules.py [PART [WORKERS]]

A rule is an `if`, an arm of one, or a short loop, of two lines and more.  Each is taken out by itself, and
every trajectory of the corpus that went through its body is identified anew, in a process that has compiled
the module without it.  It has a case where something is then said that is worse than with it: a wrong name, a
false sentence, less than before, or an exception.  PART is a part of the name of the modules (all).

It needs coverage (`pip install coverage`).  Tracing the corpus takes a minute and a half of the processor, a
rule a second where a trajectory dies soon, and up to 20 where none does.  Printed are the rules without which
nothing in the corpus is worse, with the trajectories that go through each, and their number; for `clock` "of
10 rules 4 have a case; 6, of 22 lines, have none in the corpus".
Many of these refuse what is no motion, or word a note, which the corpus does not look at.
"""

from __future__ import annotations

import ast
import importlib.abc
import importlib.util
import json
import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import identify_corpus as whole
import springcheck
from arguments import arguments, script

ROOM = Path(springcheck.__file__).parent / "identify"

LEAST_LINES, MOST_LINES = 2, 8
"""Lines of a rule, and of a loop that is one."""

MOST_TRIED = 150
"""Most trajectories that are tried, evenly spaced among those that go through a rule."""

PATIENCE = 60
"""Seconds for a trajectory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """A statement of a module, by its number in the tree's order, that is replaced by its other arm."""

    path: Path
    number: int
    arm: str
    """The arm that goes: "body" or "orelse"."""
    first: int
    last: int
    """Lines of that arm."""
    text: str

    @property
    def name(self) -> str:
        """The module, as it is imported."""
        return f"springcheck.identify.{self.path.stem}"

    def without(self) -> Any:
        """The code of its module without it."""
        tree = ast.parse(self.path.read_text(encoding="utf-8"))
        node: Any = list(ast.walk(tree))[self.number]
        if self.arm == "orelse":
            node.orelse = []
        # a condition that is never met, a loop over nothing
        elif isinstance(node, ast.For):
            node.iter = ast.Tuple(elts=[], ctx=ast.Load())
        else:
            node.test = ast.Constant(value=False)
        return compile(ast.fix_missing_locations(tree), str(self.path), "exec")


def rules(part: str) -> Iterator[Rule]:
    """The rules of the modules with this part in their names."""
    for path in sorted(ROOM.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        for number, node in enumerate(ast.walk(ast.parse(text))):
            short = isinstance(node, ast.For) and (node.end_lineno or 0) - node.lineno < MOST_LINES
            if part not in path.stem or not (isinstance(node, ast.If) or short):
                continue
            for arm in ("body", "orelse") if isinstance(node, ast.If) else ("body",):
                inside = getattr(node, arm)
                # an `elif` is a rule of its own
                if not inside or (arm == "orelse" and isinstance(inside[0], ast.If)):
                    continue
                first, last = inside[0].lineno, inside[-1].end_lineno
                if last - first + 2 >= LEAST_LINES:
                    words = ast.unparse(node).splitlines()[0]
                    words = f"else of {words}" if arm == "orelse" else words
                    yield Rule(path=path, number=number, arm=arm, first=first, last=last, text=words)


class Without(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports a rule's module without the rule."""

    def __init__(self, rule: Rule) -> None:
        self._rule = rule

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        if name != self._rule.name:
            return None
        return importlib.util.spec_from_loader(name, self, origin=str(self._rule.path))

    def exec_module(self, module: ModuleType) -> None:
        exec(self._rule.without(), vars(module))


@cache
def passed() -> tuple[dict[tuple[str, int], set[int]], list[str]]:
    """The trajectories that go through each line (file, line), and what is said of each with all rules."""
    import coverage

    through: dict[tuple[str, int], set[int]] = {}
    said = []
    for i, case in enumerate(whole.load()):
        recorder = coverage.Coverage(data_file=None, include=[str(ROOM / "*.py")])
        with recorder.collect():
            said.append(whole.judged(case, whole.said(case)))
        data = recorder.get_data()
        for file in data.measured_files():
            for line in data.lines(file) or ():
                through.setdefault((Path(file).name, line), set()).add(i)
    return through, said


def first_worse(rule: Rule, tried: list[int], said: list[str]) -> str:
    """The first trajectory of which worse is said without the rule; "" where there is none."""
    for name in [x for x in sys.modules if x.partition(".")[0] in ("springcheck", "identify_corpus")]:
        del sys.modules[name]
    sys.meta_path.insert(0, Without(rule))
    import identify_corpus as corpus

    cases = corpus.load()
    for i in tried:
        signal.alarm(PATIENCE)
        if whole.RANKS[corpus.judged(cases[i], corpus.said(cases[i]))] < whole.RANKS[said[i]]:
            return cases[i].name
    return ""


def asked(rule: Rule, tried: list[int], said: list[str]) -> tuple[int, int]:
    """Start `first_worse` in a fork: its process and the end of a pipe that says what it found."""
    read, write = os.pipe()
    process = os.fork()
    if process == 0:
        try:
            found = first_worse(rule, tried, said)
        except BaseException as error:
            found = type(error).__name__
        os.write(write, json.dumps(found).encode())
        os._exit(0)
    os.close(write)
    return process, read


def main() -> None:
    """Print the rules without a case, and how many have one."""
    given = arguments(__doc__, part="", workers=2)
    through, said = passed()
    running: dict[int, tuple[Rule, int, int]] = {}
    alive = every = lines = 0

    def reap() -> None:
        nonlocal alive, lines
        process, _ = os.wait()
        rule, read, number = running.pop(process)
        with open(read, "rb") as pipe:
            found = pipe.read()
        # nothing is said where the alarm has ended it
        if found == b'""':
            alive, lines = alive + 1, lines + rule.last - rule.first + 2
            print(f"{rule.path.name}:{rule.first - 1}  {number} go through it: {rule.text[:90]}", flush=True)

    for rule in rules(given.part):
        every += 1
        tried = sorted(set().union(*(through.get((rule.path.name, x), set())
                                     for x in range(rule.first, rule.last + 1))))  # fmt: skip
        while len(running) >= given.workers:
            reap()
        process, read = asked(rule, tried[:: len(tried) // MOST_TRIED + 1], said)
        running[process] = (rule, read, len(tried))
    while running:
        reap()
    print(f"of {every} rules {every - alive} have a case; {alive}, of {lines} lines, have none in the corpus")


if __name__ == "__main__":
    script(main)
