"""Where methods stop being stable."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.arguments import SCENE, store_arguments
from springcheck.studies.study import Study

STUDY = Study(
    name="stability",
    about="measure stability limits and compare them with theory",
    arguments=(SCENE, *team.arguments(), *store_arguments("SCENE-stability.h5")),
)
