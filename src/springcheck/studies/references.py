"""A reference solution as columns of doubles, for a store: integrated once, and read by what draws it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from springcheck.physics.arrays import Floats, wide
from springcheck.physics.exact.reference import FILLED, STAGES, Path, ReferenceMotion

MOST_STORED = 1 << 20
"""Most numbers of a reference that is stored: 16 MB."""


def columns(scene: Any) -> tuple[str, dict[str, Floats]]:
    """The digest of a scene's reference, and its numbers as two doubles each (2, ...); empty without one."""
    groups = scene.system.solution.groups if scene.system.solution else ()
    for _, motion in groups:
        if isinstance(motion, ReferenceMotion) and (path := motion.paths[1][0]).series:
            _, dq, dp = motion.known[1]
            parts: dict[str, Any] = {"powers": path.powers, "dq": dq, "dp": dp}
            parts |= {name: np.array(getattr(path, name)) for name in ("starts", "series", "most")}
            if sum(map(np.size, parts.values())) <= MOST_STORED:
                return motion.digest, {name: _halves(x) for name, x in parts.items()}
    return "", {}


def _halves(given: Any) -> Floats:
    x = wide(given).ravel()
    high = x.astype(np.float64)
    return np.stack([high, (x - high).astype(np.float64)])


def take(digest: str, stored: Mapping[str, Any]) -> None:
    """Make the columns of a reference known, by the digest of its scene, to what asks for it next."""

    def fill(motion: ReferenceMotion) -> None:
        n, scene = motion.system.n, motion.system.scene
        whole = {name: wide(x[0]) + wide(x[1]) for name, x in stored.items()}
        path = Path(motion.system, scene.step, STAGES)
        path.powers = [int(x) for x in whole["powers"]]
        path.done = [np.longdouble(0), *np.cumsum(np.ldexp(np.longdouble(1), path.powers))]
        path.starts, path.most = [*whole["starts"].reshape(-1, n)], [*whole["most"].reshape(5, n)]
        path.series = [*whole["series"].reshape(len(path.powers), STAGES, n)]
        dq, dp = (wide(whole[name].reshape(len(path.done), motion.n)) for name in ("dq", "dp"))
        finite = all(np.all(np.isfinite(x)) for x in whole.values())
        reaches = finite and len(path.starts) == len(path.done) and path.done[-1] >= scene.steps
        if not (reaches and np.array_equal(path.starts[0], path.q) and np.all(dq >= 0) and np.all(dp >= 0)):
            raise ValueError("not the reference of this scene")
        motion.paths[1], motion.known[1] = (path,), (wide(path.done), dq, dp)

    FILLED[digest] = fill
