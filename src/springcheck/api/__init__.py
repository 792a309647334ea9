"""The functions of `import springcheck`."""

from springcheck.api.main import compare, exact, identify, judge, read, run, simulate
from springcheck.api.showing import Said, Shelf, Verdicts
from springcheck.api.studies import explain, extremes, methods, precision, report, sampling, stability

__all__ = [
    "Said", "Shelf", "Verdicts", "compare", "exact", "explain", "extremes",
    "identify", "judge", "methods", "precision", "read", "report", "run", "sampling", "simulate",
    "stability",
]  # fmt: skip
