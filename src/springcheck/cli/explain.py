"""`springcheck explain`: a check, a scheme, a method, a fault or a finding in words, from the objects
themselves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from springcheck import checks, engines, schemes
from springcheck.bath import THERMOSTATS, Law
from springcheck.checks.seeds import SEEDED
from springcheck.engines.own.laws import why_not
from springcheck.errors import SpringcheckError
from springcheck.physics import terms
from springcheck.schemes import Scheme
from springcheck.studies.run.faulty import FAULTS, Fault
from springcheck.text.wording import described

if TYPE_CHECKING:
    from springcheck.identify.meanings import Meaning

WORDS = {
    "scene": "a system, its initial state, its time grid and what is recorded: a TOML file or a `Scene`",
    "engine, method": "an engine is a program that integrates; a method is one of its integrators. A label "
    "names both: `openmm:verlet`",
    "scheme": "the mathematics of a method: its one-step map",
    "one-step map": "the map from the state (q, p) at t to the state at t + h; on a spring a 2 x 2 matrix",
    "kick, drift": "a kick changes the momentum by h F(q), a drift the position by h p/m. Schemes named "
    "kick-drift, drift-kick or kick-drift-kick are made of these, in this order",
    "symplectic": "a step that preserves areas in phase space (q, p). On a spring its energy error stays "
    "bounded for all times, as long as h omega is below its stability limit",
    "energy drift": "the steady growth or loss of the total energy. A symplectic scheme has none beyond "
    "rounding; explicit Euler gains (h omega)**2 of the energy per step, RK4 loses (h omega)**6/72",
    "order": "the power of the step h with which the error falls: halving h divides the error of a scheme of "
    "order 2 by 4",
    "step defect": "the distance between a recorded step and the scheme's own step from the same state, "
    "evaluated in extended precision",
    "shadow energy": "a quantity close to the energy that a symplectic scheme conserves exactly on a spring",
    "closed form": "the scheme's own solution after n steps, as a formula",
    "detection limit": "the smallest relative error of a parameter that a check would have reported",
    "verdict": "one number, its bound, and the reason for the bound",
    "h omega": "the step times the highest angular frequency: the number on which stability depends",
    "study": "many runs and a table of what they show: precision, stability, extremes, sampling",
    "rounding": "the error of one operation in floating point: at most half an ulp of its result",
    "ulp": "unit in the last place: the distance between neighbouring numbers, 2**-52 of one between 1 and 2",
    "energy norm": "the size of a difference of two states: the square root of its energy, relative to the "
    "initial energy",
}
"""Terms of the field and of springcheck, each with its meaning."""


def word(name: str) -> tuple[str, str] | None:
    """A term and its meaning, by its name or its first word; None for an unknown one."""
    asked = _bare(name)
    for known, meaning in WORDS.items():
        if asked and asked in (_bare(known), *map(_bare, known.split(", ")), _bare(known).split()[0]):
            return known, meaning
    return None


def _bare(name: str) -> str:
    return " ".join(name.lower().replace("-", " ").replace("_", " ").replace(",", " ").split())


def lines(name: str) -> Iterator[str]:
    """All explanations of a name.  SpringcheckError where it is unknown."""
    # a scheme is found by its title too, which tables print
    for scheme in schemes.known().values():
        if name in (scheme.name, scheme.title):
            return scheme_lines(scheme)
    if ":" in name:
        return _method(name)
    # heavier to import, and rarely needed
    from springcheck.identify.meanings import MEANINGS

    # tables head their columns by the short names of checks
    parts = [check_lines(check) for check in _CHECKS.values() if name in (check.name, check.short)]
    parts += [_fault(fault) for fault in FAULTS if fault.name == name]
    parts += [meaning_lines(MEANINGS[name])] if name in MEANINGS else []
    if term := terms.known().get(name):
        parts.append(_term(term))
    if said := word(name):
        parts.append(iter([f"{said[0]}: {said[1]}"]))
    if not parts:
        methods = [f"{x}:{method}" for x in engines.names() for method in engines.engine(x).methods]
        # engines that are not asked for have schemes of their own
        meant = [name] if name in schemes.known() else schemes.textbook(name)
        parts = [scheme_lines(schemes.scheme(one)) for one in meant]
    if parts:
        return chain(parts[0], *(chain([""], part) for part in parts[1:]))
    others = (*_CHECKS, *methods, *(x.name for x in FAULTS), *MEANINGS, *terms.known(), *WORDS)
    every = f"; `springcheck list` shows the names, and these words are explained: {', '.join(WORDS)}"
    raise SpringcheckError(
        f"{name!r} is not the name of a check, scheme, method, fault, finding, term or word"
        f"{schemes.meant(name, others) or every}"
    )


_CHECKS = {check.name: check for check in (*checks.ALL, *checks.RANDOM, *SEEDED)}


def check_lines(check: Any) -> Iterator[str]:
    """What a pass proves, how it is measured, and the scope of the check."""
    yield f"{check.name}, a check of the {check.family}"
    first, _, rest = described(check.judge).partition("\n\n")
    yield _line(first)
    if rest.strip():
        yield ""
        yield from rest.strip("\n").splitlines()
    yield ""
    yield _line(f"Applies to: {check.needs}")


def _fault(fault: Fault) -> Iterator[str]:
    yield f"{fault.name}: {fault.about}"
    size = "" if fault.size is None else f", size {fault.size:.0e}"
    yield _line(f"A deliberate fault in {fault.scheme}{size}: springcheck run SCENE --fault {fault.name}")


def meaning_lines(meaning: Meaning) -> Iterator[str]:
    """A finding of `springcheck identify`."""
    yield _line(f"{meaning.name}, a finding of identify: {meaning.title}")
    yield f"  {meaning.formula}"
    yield _line(f"Sees: {meaning.sees}")
    yield _line(f"Does not see: {meaning.misses}")
    if meaning.source:
        yield _line(f"Source: {meaning.source}")


def _term(term: Any) -> Iterator[str]:
    """A term: its law, and the fields of its table."""
    yield _line(f"{term.key}, a term: {described(term)}")
    yield f"  energy   {term.formula}"
    for column in (x for x in term.columns if x.field != "number"):
        default = "" if column.default is None else f", {column.default:g} by default"
        sign = {"any": "any number", "positive": "above 0", "nonnegative": "0 or more"}[column.sign]
        yield f"  {column.name}: {sign}{default}"
    why = why_not(term)
    yield f"Long runs of own methods: {f'NumPy, not compiled ({why})' if why else 'compiled'}"


def _method(name: str) -> Iterator[str]:
    method = engines.method(engines.parse(name))
    yield f"{name}: {method.about}" + f"; {method.note}" * bool(method.note)
    yield ""
    yield from scheme_lines(schemes.scheme(method.scheme))


def scheme_lines(scheme: Scheme) -> Iterator[str]:
    """Formula, order, limit and source of a scheme."""
    yield f"{scheme.name}: {scheme.title}"
    for kind, (_, c) in zip(scheme.kinds, scheme.stages, strict=True):
        part = "h " if c == 1 else f"{c} h "
        yield f"  {kind.word.format(c=part)}"
    if scheme.b:
        yield from _tableau(scheme.a, scheme.b)
    if scheme.has("flow"):
        yield "  the exact flow"
    elif scheme.has("random"):
        yield from _thermostat(scheme.name)
    elif not scheme.has("one-step"):
        yield "  a solver that chooses its own steps; no one-step map"
    else:
        bounded = {0.0: "never", math.inf: "always"}.get(scheme.limit)
        area = "symplectic" if scheme.has("symplectic") else "not symplectic"
        if scheme.has("symplectic", "friction"):
            area = "conformally symplectic: area falls by exp(-h c/m) per step; conserved without friction"
        where = bounded or f"h omega up to {scheme.limit:.6g}"
        braked = scheme.braked_order
        lower = f" ({braked} with friction)" if braked < scheme.order else ""
        yield f"Order {scheme.order}{lower}; {area}; stable on a spring: {where}"
    if scheme.source:
        yield _line(f"Source: {scheme.source}")


SHOWN = 0.5, 0.1
"""h omega and gamma h at which the averages of a thermostat are shown."""


def _thermostat(name: str) -> Iterator[str]:
    """Stages of a random scheme, and its averages on a spring."""
    scheme = THERMOSTATS[name]
    fixed = [act.kind if callable(act.part) or act.part == 1 else f"{act.kind} {act.part}"
             for act in scheme.acts]  # fmt: skip
    yield f"  Stages: {', '.join(fixed)}"
    if scheme.rescales:
        yield "Not linear: each kinetic energy is judged by its noncentral chi-squared distribution"
        return
    turn, x = SHOWN
    of = Law(scheme=scheme, h=turn, m=np.ones(1), k=np.ones(1), rate=x / turn, thermal=1.0)
    yield (
        f"At h omega {turn} and gamma h {x}: k<q**2>/kT {of.configurational[0]:.6f}, <p**2>/m kT "
        f"{of.kinetic[0]:.6f}; of a free particle D m gamma/kT {of.diffusion[0]:.6f}"
    )
    if not scheme.synchronised:
        yield "Its velocities belong to another time than its positions"


def _tableau(a: Sequence[Sequence[Fraction]], b: Sequence[Fraction]) -> Iterator[str]:
    for i, row in enumerate(a, 1):
        yield f"  Y{i} = y + h ({_sum(row)})" if any(row) else f"  Y{i} = y"
    yield f"  y = y + h ({_sum(b)})"
    yield "  with y = (q, p) and f(y) = (p/m, F(q, p))"


def _sum(row: Sequence[Fraction]) -> str:
    terms = [("" if c == 1 else f"{c} ") + f"f(Y{i})" for i, c in enumerate(row, 1) if c]
    return " + ".join(terms).replace("+ -", "- ")


def _line(text: str) -> str:
    return " ".join(text.split())
