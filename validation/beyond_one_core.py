"""Beyond one core: what workers save, what a piece costs beside its work, and that costs are linear.

Claim: the atlas of extreme cases by two workers takes at most 0.58 of the time of one (two idle cores), with
the same numbers; a piece costs at most 5 ms of processor time beside its work, however many there are; cells
of an ensemble take the same time each and memory that does not grow.

A million cells (--pieces --cells 1000000): 299 s of processor time, 104 MB at most (95 MB at 100,000 cells),
49 bytes a cell in the file, under a load of 15 to 20.

Command: python validation/beyond_one_core.py [--pieces N ...] [--atlas]       (two idle cores; minutes)

Printed on two idle cores: 1,135 bytes a piece in the file, 1.79 ms a piece at 1,000 and at 10,000; 0.37 ms
a cell at 10,000 cells, 0.27 at 100,000, 106 MB; the atlas 12 s by one worker, 6 s by two, 0.52 of it, with
the same numbers.  Under a
load of 10 to 23 a piece took 4.26 ms at 10,000 and 4.54 at 100,000, journal and store in memory.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from arguments import script
from springcheck import store
from springcheck.physics import scenefile
from springcheck.studies import keeper
from springcheck.studies.ensemble import measure, vary
from springcheck.studies.ensemble.result import CELLS
from springcheck.studies.extremes import measure as extremes
from springcheck.studies.keeper import Piece
from springcheck.studies.team import Processes

SHARE = 0.58
PIECE_SECONDS = 5e-3


def timed(work: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds of a clock, that on the wall by default."""
    began = clock()
    work()
    return clock() - began


def numbers(count: int) -> dict[str, np.ndarray]:
    """A piece without work: a kilobyte of result."""
    return {"value": np.arange(float(count))}


def pieces(count: int, folder: Path, workers: int) -> float:
    """Seconds of processor time of a study of so many empty pieces, and of its commit."""
    path = folder / f"pieces-{count}-{workers}.h5"
    plan = [
        Piece(key=f"own:none/{i:06d}", what="", measure=partial(numbers, 128), form=CELLS)
        for i in range(count)
    ]

    def study() -> None:
        with keeper.kept(path, f"pieces {count}", team=Processes(workers)) as kept:
            for _ in kept.stream(plan):
                pass
            kept.commit("pieces", {})

    # what the disk and other programs take is not the study's
    seconds = timed(study, time.process_time)
    print(f"  {path.stat().st_size / count:.0f} bytes a piece in the file")
    return seconds


def atlas(folder: Path) -> bool:
    """The atlas by one and by two workers."""
    seconds = {}
    for workers in (1, 2):
        path = folder / f"atlas-{workers}.h5"
        seconds[workers] = timed(partial(extremes.record, path, team=Processes(workers)))
    one, two = (dict(store.tables_of(folder / f"atlas-{workers}.h5")) for workers in (1, 2))
    same = one.keys() == two.keys() and all(
        repr(np.asarray(values).tolist()) == repr(np.asarray(two[name].columns[column]).tolist())
        for name in one
        for column, values in one[name].columns.items()
    )
    share = seconds[2] / seconds[1]
    print(f"atlas: {seconds[1]:.0f} s by one, {seconds[2]:.0f} s by two: {share:.2f} of it, at most {SHARE}")
    print(f"the same numbers: {same}")
    return same and share <= SHARE


def ensemble(cells: int, folder: Path) -> tuple[float, int]:
    """Seconds of an ensemble of so many springs, and the largest memory of the process so far [B]."""
    scene = scenefile.load_scene("spring-uneven")
    plan = vary.plan([f"spring.0.stiffness=0.5:8:{cells}"])
    path = folder / f"ensemble-{cells}.h5"
    seconds = timed(partial(measure.record, scene, plan, path, ["own:semi-implicit-euler"]))
    return seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def main() -> int:
    """Print each claim with its numbers; 1 where one does not hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--pieces", type=int, nargs="*", default=[1000, 10_000])
    parser.add_argument("--cells", type=int, nargs="*", default=[10_000, 100_000])
    parser.add_argument("--atlas", action="store_true")
    given = parser.parse_args()
    good = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for count in given.pieces:
            each = pieces(count, folder, 1) / count
            good &= each <= PIECE_SECONDS
            print(f"{count} pieces: {1e3 * each:.2f} ms each, at most {1e3 * PIECE_SECONDS:g} ms")
        for cells in given.cells:
            seconds, memory = ensemble(cells, folder)
            print(f"{cells} cells: {1e6 * seconds / cells:.0f} us each, at most {memory / 1e6:.0f} MB so far")
        if given.atlas:
            good &= atlas(folder)
    return 0 if good else 1


if __name__ == "__main__":
    script(main)
