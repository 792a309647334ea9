"""`springcheck explain`: a check, a scheme, a method, a fault or a finding in words, from the objects
themselves.  What a check sees of the faults, and from which size, is measured while one waits."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import chain
from typing import TYPE_CHECKING, Any

from springcheck import checks, engines, schemes
from springcheck.errors import SpringcheckError, nearest
from springcheck.schemes import SCHEMES, Scheme
from springcheck.studies.faults.seeded import Fault
from springcheck.studies.faults.table import FAULTS

if TYPE_CHECKING:
    from springcheck.identify.meanings import Meaning

STAGES = {
    "kick": "p = p + {c}F",
    "pull": "p = p + {c}F of the potential",
    "drift": "q = q + {c}p/m",
    "friction": "p = p exp(-{c}c/m)",
    "implicit-friction": "p = p / (1 + {c}c/m)",
    "held": "p = p + {c}F, as it was last evaluated",
    "slow": "p = p + {c}F of the slow springs",
    "fast": "p = p + {c}F of the fast springs",
}
"""What a stage of a splitting does, with its part of the step h; F is the force at the present q and p."""


def lines(name: str) -> Iterator[str]:
    """What a name stands for, all of it.  SpringcheckError where it stands for nothing."""
    if name in _CHECKS:
        return chain(check_lines(_CHECKS[name]), _seen(_CHECKS[name]))
    if ":" in name:
        return _method(name)
    if name in SCHEMES:
        return scheme_lines(SCHEMES[name])
    # heavier to import, and rarely asked for
    from springcheck.identify.meanings import MEANINGS

    parts = [_fault(fault) for fault in FAULTS if fault.name == name]
    parts += [meaning_lines(MEANINGS[name])] if name in MEANINGS else []
    if parts:
        return chain(parts[0], *(chain([""], part) for part in parts[1:]))
    methods = [
        f"{engine}:{method}" for engine in engines.names() for method in engines.engine(engine).methods
    ]
    near = nearest(name, (*_CHECKS, *SCHEMES, *methods, *(fault.name for fault in FAULTS), *MEANINGS))
    raise SpringcheckError(
        f"{name!r} is no check, scheme, method, fault or finding{near}; `springcheck list` names checks and "
        f"methods, `springcheck faults` faults; findings are {', '.join(MEANINGS)}; schemes are "
        f"{', '.join(SCHEMES)}"
    )


_CHECKS = {check.name: check for check in checks.ALL}


def check_lines(check: Any) -> Iterator[str]:
    """What holds where a check passes, how, and for what it applies; what it must reject."""
    yield f"{check.name}, a check of the {check.family}"
    first, _, rest = inspect.cleandoc(check.judge.__doc__ or "").partition("\n")
    yield _line(first)
    if rest.strip():
        yield ""
        yield from rest.strip("\n").splitlines()
    yield ""
    yield _line(f"Applies to: {check.needs}")
    held = [fault for fault in FAULTS if check.name in fault.caught_by]
    if held:
        names = (fault.name + ("" if fault.size is None else f" of {fault.size:.0e}") for fault in held)
        yield _line(f"Must reject, and is held to it: {', '.join(names)}")


def sentence(check: Any) -> str:
    """What holds where a check passes, in one sentence."""
    paragraph = inspect.cleandoc(check.judge.__doc__ or "").partition("\n\n")[0]
    return " ".join(paragraph.split()).partition(". ")[0].removesuffix(".") + "."


def _seen(check: Any) -> Iterator[str]:
    """The faults that a check of recorded states passes, measured now."""
    from springcheck.studies.faults import measure

    if check.name not in measure.RECORDED:
        return
    passed = [fault.name for fault in FAULTS if measure.probe(fault)(check.name, fault.size)]
    if passed:
        yield _line(f"Does not see, at the sizes of `springcheck faults`: {', '.join(passed)}")


def _fault(fault: Fault) -> Iterator[str]:
    from springcheck.studies.faults import measure

    yield f"{fault.name}: {fault.about}"
    yield _line(
        f"A fault: {fault.scheme} on a {fault.scene}, broken on purpose"
        + ("" if fault.size is None else f"; its size in the table is {fault.size:.0e}")
    )
    passed_by = measure.probe(fault)
    verdicts = {name: passed_by(name, fault.size) for name in measure.RECORDED}
    yield _line(f"Must be rejected by: {', '.join(fault.caught_by)}")
    seen = [name for name, passed in verdicts.items() if passed is False]
    yield _line(f"Recorded states are rejected by: {', '.join(seen) or 'none'}")
    passing = [name for name, passed in verdicts.items() if passed]
    yield _line(f"and passed by: {', '.join(passing) or 'none'}")
    if fault.size is not None and seen:
        sizes = {name: measure.smallest(passed_by, name, fault.size) for name in seen}
        limits = {name: size for name, size in sizes.items() if size is not None}
        if limits:
            name = min(limits, key=lambda one: limits[one])
            yield f"Smallest size that is seen on this {fault.scene}: {limits[name]:.1e}, by {name}"


def meaning_lines(meaning: Meaning) -> Iterator[str]:
    """A finding of `springcheck identify`."""
    yield _line(f"{meaning.name}, a finding of identify: {meaning.title}")
    yield f"  {meaning.formula}"
    yield _line(f"Sees: {meaning.sees}")
    yield _line(f"Does not see: {meaning.misses}")
    if meaning.source:
        yield _line(f"Source: {meaning.source}")


def _method(name: str) -> Iterator[str]:
    method = engines.method(engines.parse(name))
    yield f"{name}: {method.about}"
    yield ""
    yield from scheme_lines(schemes.scheme(method.scheme))


def scheme_lines(scheme: Scheme) -> Iterator[str]:
    """Formula, order, limit and source of a scheme."""
    yield f"{scheme.name}: {scheme.title}"
    for kind, c in scheme.stages:
        part = "h " if c == 1 else f"{c} h "
        yield f"  {STAGES[kind].format(c=part)}"
    if scheme.b:
        yield from _tableau(scheme.a, scheme.b)
    if not scheme.stages and not scheme.b:
        yield "  the exact flow" if scheme.flow else "  a solver that chooses its own steps; no one-step map"
    if scheme.stages or scheme.b:
        bounded = {0.0: "no step", math.inf: "every step"}.get(scheme.limit)
        area = "symplectic" if scheme.symplectic else "not symplectic"
        where = bounded or f"h omega up to {scheme.limit:.6g}"
        yield f"Order {scheme.order}; {area}; bounded on a spring: {where}"
    if scheme.source:
        yield _line(f"Source: {scheme.source}")


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
