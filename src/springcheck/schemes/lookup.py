"""Lookup of schemes by name: of the catalogue, of attachments, and those that engines bring."""

from __future__ import annotations

import re
from collections.abc import Iterable
from fractions import Fraction

import numpy as np

from springcheck.errors import MOST_LIKELY, MethodError, nearest
from springcheck.schemes.catalogue import ATTACHED, SCHEMES, Scheme
from springcheck.schemes.kinds import KINDS

TEXTBOOK = {
    ("euler", "forward-euler", "euler-forward", "euler-explicit"): ("explicit-euler",),
    ("backward-euler", "euler-backward", "euler-implicit"): ("implicit-euler",),
    ("euler-cromer", "cromer", "newton-stormer-verlet"): ("semi-implicit-euler",),
    ("symplectic-euler", "semi-explicit-euler", "euler-symplectic"):
        ("semi-implicit-euler", "semi-implicit-euler-drift-kick"),
    # by whether the velocities belong to the times of the positions, or to half a step before
    ("leapfrog", "leap-frog"): ("velocity-verlet", "semi-implicit-euler"),
    ("verlet", "stormer", "stormer-verlet", "stoermer", "stoermer-verlet"):
        ("velocity-verlet", "position-verlet"),
    ("kick-drift-kick", "kdk"): ("velocity-verlet",),
    ("drift-kick-drift", "dkd"): ("position-verlet",),
    ("rk2", "modified-euler", "runge-kutta-2"): ("rk2-midpoint", "rk2-heun"),
    ("euler-richardson",): ("rk2-midpoint",),
    ("improved-euler", "explicit-trapezoidal"): ("rk2-heun",),
    ("runge-kutta", "runge-kutta-4", "rk"): ("rk4",),
    ("crank-nicolson", "implicit-trapezoidal"): ("trapezoidal",),
}  # fmt: skip
"""Names of textbooks, and the schemes here that they may mean (Hairer, Lubich & Wanner, I.1; Cromer, Am. J.
Phys. 49 (1981) 455; Gould & Tobochnik)."""

ADAPTIVE_SOLVERS = {
    **dict.fromkeys(("rk45", "ode45", "dopri5", "dormand prince"), "rk45"),
    **{name: name for name in ("dop853", "radau", "lsoda")},
}
"""Names of solvers that choose their steps, and the method of SciPy's that each is."""

_MEANT = {name.replace("-", " "): found for names, found in TEXTBOOK.items() for name in names}

# like an imported module, a scheme that an engine brings stays for the life of the process
_brought: dict[str, Scheme] = dict(ATTACHED)


def scheme(name: str) -> Scheme:
    """The scheme of this name, of the catalogue or brought by an engine.  MethodError where there is none."""
    found = SCHEMES.get(name) or _brought.get(name)
    if found is None:
        close = meant(name) or f"; there are {', '.join(SCHEMES)}"
        raise MethodError(
            f"scheme {name!r} is neither in the catalogue nor brought by an engine that is here{close}"
        )
    return found


def meant(name: str, beside: Iterable[str] = ()) -> str:
    """ ", did you mean ...?" for an unknown name: the schemes that textbooks call so, else the nearest name
    of a scheme or of those `next to`, else those whose titles have these words.  Of a solver that chooses its
    steps ": it is ...", with what runs it."""
    found, bare = textbook(name), _bare(name)
    if bare in ADAPTIVE_SOLVERS:
        return (
            ": it is a solver that chooses its steps, and has no one-step map; `springcheck run SCENE "
            f"--method scipy:{ADAPTIVE_SOLVERS[bare]}` runs and judges it"
        )
    close = "" if found else nearest(name, (*known(), *beside))
    if bare and not (found or close):
        found = tuple(x.name for x in known().values() if f" {bare} " in f" {_bare(x.title)} ")
    return f", did you mean {' or '.join(found[:MOST_LIKELY])}?" if found else close


def textbook(name: str) -> tuple[str, ...]:
    """Names of the schemes that textbooks call so, if any."""
    return _MEANT.get(_bare(name.replace("\xf6", "oe")), ())


def _bare(name: str) -> str:
    """The words of a name, in small letters."""
    return " ".join(re.findall(r"[^\W_]+", name.casefold()))


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
