"""An engine as a package of its own: the PEFRL splitting in NumPy, with its scheme.

PEFRL: I. P. Omelyan, I. M. Mryglod & R. Folk, Comput. Phys. Commun. 146 (2002) 188, equation (22).
"""

from __future__ import annotations

import numpy as np

from springcheck.engines import Arithmetic, Engine, Method, named
from springcheck.schemes import Scheme

XI, CHI, LAMBDA = "0.1786178958448091", "-0.06626458266981849", "-0.2123418310626054"
OUTER_KICK, MIDDLE_DRIFT = "0.7123418310626054", "0.77529337365001878"

HALF = (("drift", XI), ("kick", OUTER_KICK), ("drift", CHI), ("kick", LAMBDA))
PEFRL = Scheme(
    name="pefrl",
    title="PEFRL, fourth order",
    order=4,
    limit=2.98944954590673,
    symplectic=True,
    stages=(*HALF, ("drift", MIDDLE_DRIFT), *reversed(HALF)),
    source="Omelyan, Mryglod & Folk 2002",
)


class Steps:
    """A started run."""

    def __init__(self, scene, step):
        self.force_calls = 0
        self.force = scene.system.force
        self.q, self.p, self.m, self.h = scene.q.copy(), scene.p.copy(), scene.m, step

    def advance(self, every, q, p):
        for row in range(len(q)):
            for _ in range(every):
                self.step()
            q[row], p[row] = self.q, self.p

    def step(self):
        for kind, c in PEFRL.stages:
            if kind == "drift":
                self.q = self.q + float(c) * self.h * (self.p / self.m)
            else:
                self.force_calls += 1
                self.p = self.p + float(c) * self.h * self.force(self.q, self.p)


ENGINE = Engine(
    name="pefrl",
    title="PEFRL in NumPy",
    methods=named(
        Method(
            name="pefrl",
            scheme="pefrl",
            about="nine stages in NumPy",
            terms=frozenset({"wall-spring", "spring", "quartic"}),
        )
    ),
    schemes=(PEFRL,),
    start=lambda scene, method, label, step: Steps(scene, step),
    version=lambda: {"numpy": np.__version__},
    arithmetic=lambda label: Arithmetic(),
)
