"""Claim: what tests leave to `pytest --whole` reaches no line of the package that others do not reach.

    python validation/campaigns.py FILE [...]

Tests marked `campaign` try many cases of one law.  Every case of those in the FILEs (`tests/test_faults.py`)
is run here, and of each is noted which jumps from line to line of the package it makes, and its cost in
calls of functions: unlike seconds, these do not depend on the machine's load.
The dearest are left out first, as long as others of the same file make all their jumps, and every value of
the parameters that a mark names, as `campaign("fault.caught_by")` does, still has a case.

Lines do not tell rows of a table apart: a test whose cases are a row each, as of thermostats, is no campaign.

`tests/campaigns.txt` lists them: they are run by `pytest --whole` alone, as in CI.  A case that nobody has
measured is in no list, and so in every run.

It needs coverage (`pip install coverage`), and takes three times as long as the tests.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from cProfile import Profile
from pathlib import Path
from typing import Any

import pytest

from arguments import arguments, script

ROOT = Path(__file__).parent.parent
LIST = ROOT / "tests" / "campaigns.txt"
CHEAP = 10_000
"""Calls of a case that always stays: about 10 ms."""
PROCESS = 1_000_000
"""Calls that a process counts for: about a second."""
STARTS = ("_posixsubprocess.fork_exec", "posix.posix_spawn")
"""What starts a process; since Python 3.14 also the second."""
APART = ("studies/faults/table.py", "studies/faults/steppers.py")
"""What breaks engines on purpose: every fault has lines of its own there, and checks tell them apart."""

Jumps = set[tuple[Any, ...]]


class Cases:
    """Every case of a campaign with its jumps and its cost in calls."""

    def __init__(self, recorder: Any) -> None:
        self.recorder = recorder
        self.costs: dict[str, int] = {}
        self.values: dict[str, Jumps] = {}
        self.failed: list[str] = []

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = [item for item in items if item.get_closest_marker("campaign")]
        self.values = {item.nodeid: set(values(item)) for item in items}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        self.recorder.switch_context(item.nodeid)
        profile = Profile()
        profile.enable()
        try:
            return (yield)
        finally:
            profile.disable()
            self.costs[item.nodeid] = calls(profile)
            self.recorder.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self.costs.pop(report.nodeid, None)
        if report.failed:
            self.failed.append(report.nodeid)


def calls(profile: Any) -> int:
    """How many calls were made, a process that was started among them as `PROCESS`."""
    made = [(str(x.code), x.callcount) for x in profile.getstats()]
    return sum(n * (PROCESS if any(name in code for name in STARTS) else 1) for code, n in made)


def values(item: Any) -> Iterator[tuple[Any, ...]]:
    """What must keep a case: the test, and each value of the parameters that its mark names."""
    yield (item.function.__name__,)
    for path in item.get_closest_marker("campaign").args:
        name, *attributes = path.split(".")
        value = item.callspec.params[name]
        for attribute in attributes:
            value = getattr(value, attribute)
        for one in value if isinstance(value, tuple) else (value,):
            yield item.function.__name__, path, getattr(one, "__name__", repr(one))


def jumps(recorder: Any, names: list[str]) -> dict[str, Jumps]:
    """Jumps of each case within the package."""
    data, found = recorder.get_data(), {}
    files = [file for file in data.measured_files() if not file.endswith(APART)]
    for name in names:
        data.set_query_context(name)
        found[name] = {(file, a, b) for file in files for a, b in data.arcs(file) or ()}
    return found


def left_out(costs: dict[str, int], made: dict[str, Jumps]) -> set[str]:
    """Cases that can go, the dearest first, so that every jump is still made by one that stays.

    A few calls in a million differ from run to run: of cases that cost the same to two digits, names decide.
    """
    makers = Counter(jump for name in costs for jump in made[name])
    out = set()
    for name in sorted(costs, key=lambda name: (-float(f"{costs[name]:.2g}"), name)):
        if costs[name] > CHEAP and all(makers[jump] > 1 for jump in made[name]):
            makers.subtract(made[name])
            out.add(name)
    return out


def main() -> int:
    """Measure the files, and enter what can be left out; 1 if a case fails."""
    files = arguments(__doc__, files=list[str]()).files
    import coverage

    recorder = coverage.Coverage(data_file=None, branch=True, source_pkgs=["springcheck"])
    cases = Cases(recorder)
    recorder.start()
    pytest.main(["-q", "-p", "no:cacheprovider", "--whole", *files], plugins=[cases])
    recorder.stop()
    made = {name: of | cases.values[name] for name, of in jumps(recorder, list(cases.costs)).items()}
    enter(files, cases.costs, made)
    return 1 if cases.failed else 0


def enter(files: list[str], costs: dict[str, int], made: dict[str, Jumps]) -> None:
    """Put what is left out of the files into the list."""
    old = LIST.read_text(encoding="utf-8").splitlines() if LIST.exists() else []
    out = {name for name in old if name.split("::")[0] not in files}
    for file in files:
        mine = {name: cost for name, cost in costs.items() if name.split("::")[0] == file}
        gone = left_out(mine, made)
        out |= gone
        for one in dict.fromkeys(name.split("[")[0] for name in mine):
            every = [name for name in mine if name.split("[")[0] == one]
            kept = [name for name in every if name not in gone]
            print(
                f"{one}: {len(kept)} of {len(every)} stay, "
                f"{sum(mine[x] for x in kept):,} calls of {sum(mine[x] for x in every):,}"
            )
    LIST.write_text("".join(f"{name}\n" for name in sorted(out)), encoding="utf-8")


if __name__ == "__main__":
    script(main)
