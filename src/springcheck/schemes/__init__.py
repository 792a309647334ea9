"""The mathematics of the methods: schemes as data, and all that follows from that one definition."""

from __future__ import annotations

from springcheck.schemes.catalogue import ATTACHED, SCHEMES, UNKNOWN, Scheme, number, solver
from springcheck.schemes.kinds import KINDS
from springcheck.schemes.law import Law, Trait
from springcheck.schemes.linear import amplification, condition, invariant, matrix
from springcheck.schemes.lookup import bring, known, meant, scheme, textbook, title
from springcheck.schemes.powers import propagate, rotation
from springcheck.schemes.rounding import magnitude_step, roundings
from springcheck.schemes.stepping import step

__all__ = [
    "ATTACHED", "KINDS", "Law", "Scheme", "Trait", "SCHEMES", "UNKNOWN", "bring", "known", "meant", "scheme",
    "textbook", "solver", "title", "number", "step", "magnitude_step", "roundings", "amplification",
    "condition", "invariant", "matrix", "propagate", "rotation",
]  # fmt: skip
