"""All orbits of the blog's spring in one phase portrait, grouped by the scheme that the states show."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from springcheck.figures import looks
from springcheck.studies.census.result import Census
from springcheck.text.wording import few

MOST_NAMES = 3


def pictures(census: Census) -> dict[str, Figure]:
    """Its one figure by name."""
    return {"census": portrait(census)}


def portrait(census: Census) -> Figure:
    """Orbits in the plane of q and p: one colour and line a scheme, a dot where each orbit ends."""
    figure = Figure(figsize=(9.8, 5.2), layout="constrained")
    axes = figure.add_subplot()
    turn = np.linspace(0, 2 * np.pi, 400)
    axes.plot(np.cos(turn), np.sin(turn), color="#bbbbbb", linewidth=4, label="exact", zorder=1)
    groups = census.grouped
    for name, members in groups.items():
        how = looks.look(name)
        label = f"{looks.title(name)}\n{few([x.method for x in members], MOST_NAMES)}"
        for j, x in enumerate(members):
            axes.plot(
                x.q,
                x.p,
                linewidth=0.9,
                label=label if j == 0 else None,
                zorder=2,
                color=how.color,
                linestyle=how.linestyle,
            )
            axes.plot(
                x.q[-1],
                x.p[-1],
                looks.mark(looks.engine(x.method))[0],
                color=how.color,
                markersize=4,
                zorder=3,
            )
    axes.set_aspect("equal")
    axes.set_xlabel("q")
    axes.set_ylabel("p")
    axes.set_title(
        f"The blog's spring by {len(census.entries)} methods: how it is attached\n"
        "decides the scheme (m = k = 1, h = 0.1, 200 steps)"
    )
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize=7.2)
    return figure
