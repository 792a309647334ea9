"""Engines broken on purpose: the negative controls of the package and its detection limits."""

from __future__ import annotations

import os

from springcheck.studies import team
from springcheck.studies.arguments import FORCE, JSON, QUIET, argument
from springcheck.studies.study import Study

STUDY = Study(
    name="faults",
    about="engines broken on purpose: what sees them, how small; about seven minutes on two cores",
    arguments=(
        *team.arguments(default=min(2, os.cpu_count() or 1)),
        argument("-o", "--output", metavar="FILE", help="keep it in a store, for plot and report"),
        FORCE,
        JSON,
        QUIET,
    ),
    keeps=lambda options: options.output is not None,
)
