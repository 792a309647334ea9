"""The atlas of extreme cases."""

from __future__ import annotations

from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.study import Study, store_options


def _options(parser: ArgumentParser) -> None:
    team.options(parser)
    store_options(parser, "extremes.h5")
    parser.add_argument("--quick", action="store_true", help="fewer cells, in about 20 seconds")
    parser.add_argument(
        "--cells", type=int, default=0, metavar="N", help="a finer atlas of about N cells, as 100000"
    )


STUDY = Study(name="extremes", about="the atlas of extreme cases", options=_options)
