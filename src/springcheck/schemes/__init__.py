"""The mathematics of the methods: schemes as data, and all that follows from that one definition."""

from __future__ import annotations

from springcheck.schemes.catalogue import (
    FRICTION,
    SCHEMES,
    Coefficient,
    Scheme,
    Stage,
    number,
)
from springcheck.schemes.linear import (
    Rotation,
    amplification,
    condition,
    invariant,
    matrix,
    propagate,
    propagator,
    rotation,
)
from springcheck.schemes.lookup import bring, scheme, title
from springcheck.schemes.rounding import magnitude_step, roundings
from springcheck.schemes.stepping import step

__all__ = [
    "Coefficient",
    "FRICTION",
    "Scheme",
    "SCHEMES",
    "Stage",
    "bring",
    "scheme",
    "title",
    "number",
    "step",
    "magnitude_step",
    "roundings",
    "Rotation",
    "amplification",
    "condition",
    "invariant",
    "matrix",
    "propagate",
    "propagator",
    "rotation",
]
