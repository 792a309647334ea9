"""How small a fault is seen: the smallest size that each check rejects."""

from __future__ import annotations

from matplotlib.figure import Figure

from springcheck.studies.faults.result import FaultReport

MARKERS = "os^DvPX*<>"


def pictures(found: FaultReport) -> dict[str, Figure]:
    """The detection limits, where there are any, by name."""
    return {"faults": limits(found)} if any(result.limits for result in found.results) else {}


def limits(found: FaultReport) -> Figure:
    """One line a fault, one mark a check; the tick is the size at which a fault must be rejected."""
    shown = [result for result in found.results if result.limits][::-1]
    checks = list(dict.fromkeys(name for result in shown[::-1] for name in result.limits))
    figure = Figure(figsize=(9.2, 0.26 * len(shown) + 1.6), layout="constrained")
    axes = figure.add_subplot()
    for i, check in enumerate(checks):
        places = [(result.limits[check], j) for j, result in enumerate(shown) if check in result.limits]
        axes.plot(
            *zip(*places, strict=True), linestyle="none", marker=MARKERS[i % len(MARKERS)],
            color=f"C{i}", markerfacecolor="white", label=check,
        )  # fmt: skip
    sizes = [(result.size, j) for j, result in enumerate(shown) if result.size]
    axes.plot(*zip(*sizes, strict=True), "|", color="#888888", markersize=9, label="size in the table")
    axes.set_xscale("log")
    axes.set_yticks(range(len(shown)), [result.name for result in shown])
    axes.set_xlabel("smallest relative size that the check rejects")
    axes.set_title("How small a fault is seen: one spring, h $\\omega$ = 0.09, 200 steps")
    figure.legend(loc="outside right upper", frameon=False)
    return figure
