"""The main job: a scene by all its methods, stored, compared and judged."""

from __future__ import annotations

from argparse import ArgumentParser

from springcheck.studies import team
from springcheck.studies.ensemble import vary_options
from springcheck.studies.study import Study, repeatable, scene_option, store_options


def _options(parser: ArgumentParser) -> None:
    scene_option(parser, nargs="?")
    store_options(parser)
    parser.add_argument("--step", type=float, metavar="H", help="another step than the scene's")
    parser.add_argument("--steps", type=int, metavar="N", help="another number of steps")
    number = "another number in a field of the scene file, as spring.0.stiffness=2"
    repeatable(parser, "--set", "FIELD=NUMBER", number)
    fault = "an engine broken on purpose among the others, as `springcheck faults` tells"
    repeatable(parser, "--fault", "NAME[=SIZE]", fault)
    parser.add_argument(
        "--from", dest="source", metavar="FILE", help="run a store's trajectories again and compare"
    )
    vary_options(parser)
    team.options(parser)
    parser.add_argument("--verdicts", action="store_true", help="print every verdict with its reason")
    parser.add_argument(
        "--thorough", action="store_true", help="add the experiments: order, reversal, rounding"
    )


STUDY = Study(
    name="run",
    about="run a scene by every method, compare, store, judge",
    options=_options,
    trajectories=True,
    chooses=("particle",),
    keeps=lambda options: options.source is None,
)
