"""One scene over many parameters: grids and random samples, streamed into one store."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.arguments import SCENE, argument, repeatable, store_arguments
from springcheck.studies.study import Study

VARY = (
    repeatable(
        "--vary", "FIELD=LOW:HIGH:COUNT[:log]",
        "an ensemble over a field of the scene file, as spring.0.stiffness=1:100:64 or time.step=0.1,0.2",
    ),
    argument(
        "--samples", type=int, metavar="N", help="N random scenes, each FIELD=LOW:HIGH[:log] drawn evenly"
    ),
    argument("--seed", type=int, metavar="S",
             help="of the samples (default 0), or of random methods (default: drawn)"),
)  # fmt: skip
"""Options of what is varied."""

STUDY = Study(
    name="ensemble",
    about="one scene over many parameters: error, energy, end",
    arguments=(SCENE, *store_arguments("SCENE-ensemble.h5"), *team.arguments(), *VARY),
    chooses=("quantity", "over"),
)
