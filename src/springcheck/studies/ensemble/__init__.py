"""One scene over many parameters: grids and random samples, streamed into one store."""

from __future__ import annotations

from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.study import Study, repeatable, scene_option, store_options


def _options(parser: ArgumentParser) -> None:
    scene_option(parser)
    store_options(parser, "SCENE-ensemble.h5")
    team.options(parser)
    vary_options(parser)


def vary_options(parser: ArgumentParser) -> None:
    """What is varied."""
    field = "an ensemble over a field of the scene file, as spring.0.stiffness=1:100:64 or time.step=0.1,0.2"
    repeatable(parser, "--vary", "FIELD=LOW:HIGH:COUNT[:log]", field)
    parser.add_argument(
        "--samples", type=int, metavar="N", help="N random scenes, each FIELD=LOW:HIGH[:log] drawn evenly"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the samples (default 0)")


STUDY = Study(
    name="ensemble",
    about="one scene over many parameters: error, energy, end",
    options=_options,
    chooses=("quantity", "over"),
)
