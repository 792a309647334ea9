"""Which integrator every installed engine really runs, by its states alone."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.study import Study, store_arguments

STUDY = Study(
    name="census",
    about="which integrator every installed engine really runs, by its states",
    arguments=(*team.arguments(), *store_arguments("census.h5")),
)
