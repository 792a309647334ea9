"""Verdicts, made in one place: the rule of what passes stands here alone."""

from __future__ import annotations

import numpy as np

from springcheck.trajectory import Verdict


def within(method: str, check: str, value: float, bound: float, unit: str, why: str) -> Verdict:
    """Passed only if the value is a number within the bound.  A bound that is infinite says nothing."""
    if bound == np.inf and not np.isnan(value):
        return not_applicable(method, check, "what rounding or the tolerance allows is beyond all numbers")
    return Verdict(
        method=method,
        check=check,
        value=value,
        bound=bound,
        unit=unit,
        passed=bool(value <= bound),
        why=why,
    )


def not_applicable(method: str, check: str, why: str) -> Verdict:
    """Reported as what it is, never as passed."""
    return Verdict(
        method=method,
        check=check,
        value=float("nan"),
        bound=float("nan"),
        unit="",
        passed=None,
        why=why,
    )
