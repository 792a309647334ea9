"""Error against run time, down to rounding, and over long times."""

from __future__ import annotations

from springcheck.studies.arguments import SCENE, argument, store_arguments
from springcheck.studies.study import Study

METRICS = ("largest", "end", "energy", "phase")
"""Errors that a study may be about; every one is measured and stored."""

STUDY = Study(
    name="precision",
    about="measure error against run time and force calls",
    arguments=(
        SCENE,
        argument("--metric", choices=METRICS, default=METRICS[0], help="error to measure (default: largest)"),
        argument("--budget", type=float, metavar="SECONDS", help="time shared by the methods (default 45)"),
        argument(
            "--long", type=float, metavar="PERIODS",
            help="measure the error over this many periods (1e6) at one step instead",
        ),
        argument("--step", type=float, metavar="H", help="the step of --long (default: the scene's)"),
        *store_arguments("SCENE-precision.h5"),
    ),
    chooses=("x", "y"),
)  # fmt: skip
