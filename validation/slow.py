"""Claim: a round of `pytest -n auto -m "not slow"` takes a minute on two cores, `pytest -n auto` three.

    pytest -n auto --whole --junitxml=FILE; python validation/slow.py FILE

Of the FILE, every test is listed in `tests/slow.txt` whose cases take more than a tenth of a second on the
average, with its seconds: `slow` marks those, and those of more than `LONG` seconds run by `--whole` alone,
as in CI.  A test that nobody has measured is in no list, and so in every run.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

from arguments import arguments, script

LIST = Path(__file__).parent.parent / "tests" / "slow.txt"
SLOW = 0.1
"""Seconds from which a test is slow."""


def main() -> None:
    """Enter what a junit file says."""
    seconds: dict[str, list[float]] = defaultdict(list)
    for case in ElementTree.parse(arguments(__doc__, file=str).file).iter("testcase"):
        name = f"{case.attrib['classname'].replace('.', '/')}.py::{case.attrib['name'].split('[')[0]}"
        seconds[name].append(float(case.attrib["time"]))
    mean = {name: sum(each) / len(each) for name, each in seconds.items()}
    lines = [f"{mean[name]:.1f} {name}\n" for name in sorted(mean) if mean[name] > SLOW]
    LIST.write_text("".join(lines), encoding="utf-8")
    for most in (SLOW, 0.2, 0.3, 0.4, 0.5, 1.0, max(mean.values())):
        short = [seconds[name] for name, x in mean.items() if x <= most]
        total = sum(map(sum, short))
        print(f"{len(short)} of {len(mean)} tests take {most:.1f} s a case or less, together {total:.0f} s")


if __name__ == "__main__":
    script(main)
