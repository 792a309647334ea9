"""Verdicts, made in one place: the rule of what passes stands here alone."""

from __future__ import annotations

import numpy as np

from springcheck.trajectory import NOT_KNOWN, Limits, Verdict

BEYOND = 2.0**511
"""Stands for every value that fails and is no number or larger: a verdict and its ratio are numbers."""


def within(
    method: str, check: str, value: float, bound: float, unit: str, why: str, sees: Limits = NOT_KNOWN
) -> Verdict:
    """Passed only if the value is a number within the bound.  A bound that is infinite says nothing.

    The verdict's value and bound are finite numbers: `BEYOND` stands for a value that is none, and fails.
    """
    if np.isposinf(bound) and not np.isnan(value):
        return not_applicable(method, check, "what rounding or the tolerance allows is beyond all numbers")
    passed = bool(-np.inf < value <= bound < np.inf)
    if not passed and not (np.isfinite(bound) and bound >= 0):
        value, bound, why = BEYOND, 0.0, f"what is allowed is no number; {why}"
    elif not passed and not np.isfinite(value):
        why = f"what was found is no finite number; {why}"
    if not passed and not abs(value) <= BEYOND:
        value, bound = BEYOND, min(bound, BEYOND / 2)
    return Verdict(
        method=method,
        check=check,
        value=float(value),
        bound=float(bound),
        unit=unit,
        passed=passed,
        why=why,
        sees=sees,
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
