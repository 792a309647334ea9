"""Studies: many runs put together.  A study is a folder here, a line in `STUDIES`, and examples for its help.

They measure how good a scheme is.  A study's own control may fail it; a large error never does.
"""

from __future__ import annotations

from springcheck.studies import extremes, precision, run, sampling, stability
from springcheck.studies.study import Study

STUDIES: tuple[Study, ...] = (
    run.STUDY,
    precision.STUDY,
    stability.STUDY,
    extremes.STUDY,
    sampling.STUDY,
)
"""Every study, in the order in which `--help` names them."""
