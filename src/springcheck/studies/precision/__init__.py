"""Error against run time, down to rounding."""

from __future__ import annotations

from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.study import Study, scene_option, store_options


def _options(parser: ArgumentParser) -> None:
    scene_option(parser)
    team.options(parser)
    store_options(parser, "SCENE-precision.h5")
    parser.add_argument(
        "--budget", type=float, metavar="SECONDS", help="time to spend, shared fairly (default 75)"
    )
    parser.add_argument("--points", action="store_true", help="print every point")


STUDY = Study(name="precision", about="error against run time, down to rounding", options=_options)
