"""Error against run time, down to rounding."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.arguments import SCENE, argument, store_arguments
from springcheck.studies.study import Study

STUDY = Study(
    name="precision",
    about="error against run time, down to rounding",
    arguments=(
        SCENE,
        *team.arguments(),
        *store_arguments("SCENE-precision.h5"),
        argument("--budget", type=float, metavar="SECONDS", help="of run time, shared fairly (default 75)"),
        argument("--points", action="store_true", help="print every point"),
    ),
)
