"""`springcheck cite`: what to cite for springcheck, and for the engines and schemes of a store."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import springcheck
from springcheck import engines, schemes, store

BIBTEX = """@software{{springcheck,
  title = {{springcheck: simulation engines judged to rounding by a mass on a spring}},
  author = {{{{The springcheck authors}}}},
  version = {{{version}}},
  year = {{2026}}
}}"""


def lines(file: str | None) -> Iterator[str]:
    """References as text: of springcheck, and of the engines, schemes and scene of a store."""
    yield from BIBTEX.format(version=springcheck.__version__).splitlines()
    runs = store.summary(Path(file)).runs if file else ()
    named = dict.fromkeys(engines.parse(run.label).engine for run in runs)
    known = [engines.engine(name) for name in (named if file else engines.names()) if name in engines.names()]
    found = {one.title: one.reference for one in known if one.reference}
    used = (schemes.known().get(str(run.parameters.get("scheme"))) for run in runs)
    found |= {one.title: one.source for one in used if one is not None and one.source}
    yield ""
    yield from (f"{title}: {reference}" for title, reference in found.items())
