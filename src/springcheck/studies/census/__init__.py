"""Which integrator every installed engine really runs, by its states alone."""

from __future__ import annotations

from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.study import Study, store_options


def _options(parser: ArgumentParser) -> None:
    team.options(parser)
    store_options(parser, "census.h5")


STUDY = Study(
    name="census",
    about="which integrator every installed engine really runs, by its states",
    options=_options,
)
