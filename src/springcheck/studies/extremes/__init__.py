"""The atlas of extreme cases."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.arguments import argument, store_arguments
from springcheck.studies.study import Study

STUDY = Study(
    name="extremes",
    about="find where engines fail at extreme steps, masses and amplitudes",
    arguments=(
        *team.arguments(),
        *store_arguments("extremes.h5"),
        argument("--quick", action="store_true", help="fewer cells"),
    ),
)
