"""Error against run time, down to rounding, and over long times."""

from __future__ import annotations

from springcheck.studies.arguments import SCENE, argument, store_arguments
from springcheck.studies.study import Study

METRICS = ("largest", "end", "energy", "phase")
"""Errors that a study may be about; every one is measured and stored."""

STUDY = Study(
    name="precision",
    about="error against run time and force calls, down to rounding",
    arguments=(
        SCENE,
        argument("--metric", choices=METRICS, default=METRICS[0], help="which error (default: largest)"),
        argument("--budget", type=float, metavar="SECONDS", help="of run time, shared fairly (default 45)"),
        argument(
            "--long", type=float, metavar="PERIODS",
            help="error over so many periods at one step, as 1e6, instead of error against run time",
        ),
        argument("--step", type=float, metavar="H", help="the step of --long (default: the scene's)"),
        *store_arguments("SCENE-precision.h5"),
    ),
    chooses=("x", "y"),
)  # fmt: skip
