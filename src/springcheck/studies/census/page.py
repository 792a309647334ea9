"""The chart of a census, in figures and in the report page: the orbits of the blog's spring."""

from __future__ import annotations

import numpy as np

from springcheck.figures.charts import Bank, Chart, Curve, Scale
from springcheck.figures.looks import engine, title
from springcheck.figures.naming import labelled
from springcheck.studies.census.result import Census, Entry
from springcheck.text.wording import count, few

MOST_NAMES = 2


def banks(census: Census) -> list[Bank]:
    """One phase portrait; methods whose orbits are equal bit for bit are one curve."""
    curves, on = [], []
    for scheme, members in census.grouped.items():
        same: dict[str, list[Entry]] = {}
        makers = len({engine(x.method) for x in members})
        of = f": {len(members)} methods of {count(makers, 'engine')}" if len(members) > 1 else ""
        for x in (one for one in members if len(one.q)):
            same.setdefault(x.digest, []).append(x)
        for i, equal in enumerate(same.values()):
            names = [x.method for x in equal]
            name = few(names, MOST_NAMES, " = ")
            x = equal[0]
            notes = [f"step {step}; bit for bit {', '.join(names)}" for step in range(len(x.q))]
            curves.append(
                Curve(
                    name=name, group=scheme, title=f"{title(scheme)}{of}", x=x.q, y=x.p, notes=notes,
                    methods=names,
                )
            )  # fmt: skip
            if i == 0:
                on.append(name)
    if not curves:
        return []
    turn = np.linspace(0, 2 * np.pi, 201)
    exact = Curve(name="exact", group="exact", x=np.cos(turn), y=np.sin(turn))
    chart = Chart(
        title="The blog's spring, m = k = 1, 200 steps of 0.1, by every method; a colour for each scheme.",
        x=Scale(name="q"),
        y=Scale(name="p"),
        curves=[exact, *curves],
        equal=True,
    )
    engines = count(len({engine(x.method) for x in census.entries}), "engine")
    heading = (
        f"The blog's spring by {count(len(census.entries), 'method')} of {engines}: how it is attached "
        "decides the scheme (m = k = 1, h = 0.1, 200 steps)"
    )
    return [
        Bank(
            name="census", title="Orbits drawn", heading=heading, charts=[labelled(chart)], on=["exact", *on]
        )
    ]
