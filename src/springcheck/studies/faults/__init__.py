"""Engines broken on purpose: the negative controls of the package and its detection limits."""

from __future__ import annotations

from springcheck.studies.study import Study, report_options

STUDY = Study(
    name="faults",
    about="engines broken on purpose: what sees them, how small",
    options=report_options,
    keeps=lambda options: False,
)
