"""Where methods stop being stable, and what stiffness costs."""

from __future__ import annotations

from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.study import Study, scene_option, store_options


def _options(parser: ArgumentParser) -> None:
    scene_option(parser)
    team.options(parser)
    store_options(parser, "SCENE-stability.h5")


STUDY = Study(name="stability", about="limits of stability, measured against theory", options=_options)
