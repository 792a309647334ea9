"""Engines broken on purpose: the negative controls of the package and its detection limits."""

from __future__ import annotations

import os
from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.study import Study, report_options


def _options(parser: ArgumentParser) -> None:
    team.options(parser, default=min(2, os.cpu_count() or 1))
    parser.add_argument("-o", "--output", metavar="FILE", help="keep it in a store, for plot and report")
    parser.add_argument("--force", action="store_true", help="write an existing store anew")
    report_options(parser)


STUDY = Study(
    name="faults",
    about="engines broken on purpose: what sees them, how small",
    options=_options,
    keeps=lambda options: False,
)
