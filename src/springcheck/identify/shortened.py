"""Schemes whose step or mass is the stated one in single precision, in double arithmetic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from springcheck.identify.coarse import over_single
from springcheck.identify.evidence import Measured
from springcheck.identify.families import HELD
from springcheck.identify.hypothesis import FEW, Joint, distinct


def single_parameters(seen: Measured) -> tuple[list[Joint], str]:
    """Schemes that fit if the step or the mass is the stated one in single precision, and which of them."""
    record, stride = seen.record, seen.stride
    if record.momenta:
        return [], ""
    masses = [1.0 if record.mass is None else float(record.mass[j]) for j in seen.moving]
    heavier = [_shortened(m) for m in masses]
    strides = range(stride, stride + 1) if stride is not None and stride > 0 else FEW
    longer = [0.0, *(_shortened(record.interval / s) for s in range(1, strides.stop))]
    for families in (distinct(damped=False), (*distinct(damped=True), HELD)):
        for what, of_mass, of_step in (("step", 0, 1), ("mass", 1, 0), ("step and the mass", 1, 1)):
            scales = [tuple(of_mass * m - of_step * h for h in longer) for m in heavier]
            if not any(any(row[1:]) for row in scales):
                continue
            loose = [replace(x, scales=row) for x, row in zip(seen.terms, scales, strict=True)]
            if joints := replace(seen, terms=loose).compare(families, strides):
                return joints, f"the {what} was rounded to single precision in double arithmetic"
    return [], ""


def _shortened(x: np.longdouble | float) -> float:
    """Log of a number in single precision over the number."""
    return -float(np.log(over_single(x)))
