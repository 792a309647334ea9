"""The atlas of extreme cases: the README's windows and its figure.

Claim: over every method and thousands of cells from 1e-300 to 1e300 no result is wrong without a named
reason.

Command: python validation/extreme.py [FOLDER]       (default: figures; about two minutes)

Expected: 0 cells silently wrong; OpenMM on OpenCL right for forces between 1e-2 and 1e8 in every
precision mode, on Reference between 1e-150 and 1e150 (it squares lengths); ASE and the own methods right
for all that is tried.
"""

from __future__ import annotations

import time
from pathlib import Path

from arguments import arguments
from springcheck.studies.extremes import figure as figures
from springcheck.studies.extremes import measure as extremes


def main() -> int:
    """Print counts, reasons and windows, and draw the atlas; 1 where a cell is silently wrong."""
    folder = arguments(__doc__, folder=Path("figures")).folder
    began = time.perf_counter()
    atlas = extremes.measure()
    print(f"{len(atlas.cells)} cells in {time.perf_counter() - began:.0f} s: {dict(atlas.counts())}")
    for window in atlas.windows:
        print(window.sentence)
    for left in atlas.left_out:
        print(f"left out {left.method}: {left.reason}")
    for cell in atlas.wrong:
        print(f"silently wrong: {cell}")
    for path in figures.draw(atlas, folder):
        print(path)
    return 0 if atlas.passed else 1


if __name__ == "__main__":
    raise SystemExit(main())
