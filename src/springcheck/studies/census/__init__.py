"""Which integrator every installed engine really runs, by its states alone."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.arguments import argument, store_arguments
from springcheck.studies.study import Study

STUDY = Study(
    name="census",
    about="which integrator every installed engine really runs, by its states",
    arguments=(
        *team.arguments(),
        *store_arguments("census.h5"),
        argument("--thermostats", action="store_true", help="thermostats too, on springs in a bath"),
        argument("--against", metavar="OLD.json", help="what changed since an earlier census --json"),
    ),
)
