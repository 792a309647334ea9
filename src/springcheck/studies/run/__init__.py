"""The main job: a scene by all its methods, stored, compared and judged."""

from __future__ import annotations

from springcheck.studies.arguments import SCENE, argument, repeatable, store_arguments
from springcheck.studies.study import Study

_SCENE = argument(*SCENE[0], **SCENE[1], nargs="?")

STUDY = Study(
    name="run",
    about="integrate a scene with several methods; compare, judge and store them",
    arguments=(
        _SCENE,
        *store_arguments(),
        argument("--all", action="store_true", help="run every method, not only the default ones"),
        argument("--step", "--dt", type=float, metavar="H",
                 help="time step in the scene's unit (default: the scene's)"),
        argument("--temperature", metavar="T",
                 help="temperature of a heat bath: 300K, or kT in reduced units (default: none)"),
        argument("--friction", type=float, metavar="G",
                 help="friction rate of the bath [1/time] (default 0.1/step)"),
        argument("--steps", type=int, metavar="N", help="number of steps (default: the scene's)"),
        repeatable(
            "--set", "FIELD=NUMBER",
            "set a number of the scene file, as spring.0.stiffness=2"
        ),
        repeatable(
            "--fault", "NAME[=SIZE]",
            "add a deliberately broken engine; an unknown NAME lists them",
        ),
        argument(
            "--from", dest="source", metavar="FILE", help="run a store's trajectories again and compare"
        ),
        argument("--seed", type=int, metavar="S", help="seed of random methods (default: random)"),
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
