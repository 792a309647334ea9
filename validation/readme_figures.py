"""The figure of the README, made anew in data/figures.

Claim: it is what `springcheck plot` draws of `springcheck run spring`; nothing in it is drawn by hand.
Run:   python validation/readme_figures.py [FOLDER]
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from arguments import arguments, script
from springcheck import load_scene
from springcheck.studies.run import STUDY as RUN
from springcheck.studies.run.measure import run, stored

NAMES = ("phase-portrait.png",)


def main() -> int:
    """Draw it; the exit status says whether all verdicts behind them passed."""
    folder = arguments(__doc__, folder=Path("data/figures")).folder
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "spring.h5")
        report = run(load_scene("spring"), path)
        for figure in RUN.draw(stored(path), Path(name)):
            if figure.name in NAMES:
                (folder / figure.name).write_bytes(figure.read_bytes())
                print(folder / figure.name)
    print(f"{len(report.runs)} methods in the phase portrait")
    return report.status


if __name__ == "__main__":
    script(main)
