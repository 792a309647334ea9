"""The main job: a scene by all its methods, stored, compared and judged."""

from __future__ import annotations

from springcheck.studies.arguments import SCENE, argument, repeatable, store_arguments
from springcheck.studies.study import Study

_SCENE = argument(*SCENE[0], **SCENE[1], nargs="?")

STUDY = Study(
    name="run",
    about="run a scene by its default methods or all, compare, store, judge",
    arguments=(
        _SCENE,
        *store_arguments(),
        argument("--all", action="store_true", help="by every method, not the default ones alone"),
        argument("--step", "--dt", type=float, metavar="H",
                 help="time step in the scene's unit (default: the scene's)"),
        argument("--temperature", metavar="T",
                 help="a heat bath: 300K, or kT where units are reduced (default: none)"),
        argument("--friction", type=float, metavar="G",
                 help="the bath's friction rate, per unit of time (default 0.1/step)"),
        argument("--steps", type=int, metavar="N", help="how many steps (default: the scene's)"),
        repeatable(
            "--set", "FIELD=NUMBER",
            "a number in a field of the scene file, in its units, as spring.0.stiffness=2"
        ),
        repeatable(
            "--fault", "NAME[=SIZE]",
            "an engine broken on purpose among the others; an unknown NAME lists them",
        ),
        argument(
            "--from", dest="source", metavar="FILE", help="run a store's trajectories again and compare"
        ),
        argument("--seed", type=int, metavar="S", help="of random methods (default: drawn)"),
        argument("--verdicts", action="store_true", help="print every verdict with its reason"),
        argument("--left-out", action="store_true", help="print why each method left out did not run"),
        argument(
            "--thorough", action="store_true", help="add the experiments: order, reversal, rounding"
        ),
    ),
    trajectories=True,
    chooses=("particle",),
    keeps=lambda options: options.source is None,
)  # fmt: skip
