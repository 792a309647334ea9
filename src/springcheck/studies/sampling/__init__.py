"""How well thermostats sample: temperatures against the step, what an error costs, where they are stable."""

from __future__ import annotations

from springcheck.studies import team
from springcheck.studies.arguments import store_arguments
from springcheck.studies.study import Study

STUDY = Study(
    name="sampling",
    about="measure temperatures, precision and limits of thermostats",
    arguments=(*team.arguments(), *store_arguments("sampling.h5")),
)
