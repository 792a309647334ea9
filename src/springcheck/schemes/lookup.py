"""Lookup of schemes by name: of the catalogue, of attachments, and those that engines bring."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from springcheck.errors import MethodError, nearest
from springcheck.schemes.catalogue import ATTACHED, SCHEMES, Scheme
from springcheck.schemes.kinds import KINDS

# like an imported module, a scheme that an engine brings stays for the life of the process
_brought: dict[str, Scheme] = dict(ATTACHED)


def scheme(name: str) -> Scheme:
    """The scheme of this name, of the catalogue or brought by an engine.  MethodError where there is none."""
    found = SCHEMES.get(name) or _brought.get(name)
    if found is None:
        close = nearest(name, (*SCHEMES, *_brought)) or f"; there are {', '.join(SCHEMES)}"
        raise MethodError(
            f"scheme {name!r} is neither in the catalogue nor brought by an engine that is here{close}"
        )
    return found


def known() -> dict[str, Scheme]:
    """Every scheme by its name: of the catalogue, of attachments, and those brought so far."""
    return SCHEMES | _brought


def title(name: str) -> str:
    """The title of a scheme, or its name where its engine is not here."""
    found = SCHEMES.get(name) or _brought.get(name)
    return found.title if found else name


def bring(found: Scheme) -> None:
    """Register the scheme of an engine.  MethodError where it is invalid, or its name is taken."""
    if not isinstance(found, Scheme):
        raise MethodError(f"a scheme is of type {type(found).__name__}, not springcheck.schemes.Scheme")
    if (SCHEMES | _brought).get(found.name, found) != found:
        raise MethodError(f"its scheme {found.name!r} is not the one that is known by this name")
    wrong = _flaw(found)
    if wrong:
        raise MethodError(f"its scheme {found.name!r}: {wrong}")
    _brought[found.name] = found


def _flaw(found: Scheme) -> str:
    """Why a scheme cannot be carried out, or "" where it can."""
    if found.stages and found.b:
        return "it has stages and a tableau; one of them is the step"
    for stage in found.stages:
        if len(stage) != 2 or stage[0] not in KINDS:
            return f"{stage!r} is no stage: a pair of one of {', '.join(KINDS)} and a coefficient"
        if not _is_coefficient(stage[1]):
            return f"coefficient {stage[1]!r} of {stage[0]} is neither a Fraction nor a decimal string"
    if found.b and (
        len(found.a) != len(found.b)
        or any(len(row) != len(found.b) and len(row) <= i for i, row in enumerate(found.a))
    ):
        return "its tableau needs one row of a for each b, up to the diagonal at least"
    if found.b and not all(isinstance(x, Fraction) for row in (*found.a, found.b) for x in row):
        return "the coefficients of its tableau must be Fractions"
    return ""


def _is_coefficient(c: object) -> bool:
    try:
        return isinstance(c, Fraction) or (isinstance(c, str) and bool(np.isfinite(float(c))))
    except ValueError:
        return False
