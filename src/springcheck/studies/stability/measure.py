"""Limits of stability: the largest h w of a method on a spring, measured on its engine's own one-step map.

A limit is compared with that of the scheme's exact map, found by the same search, and with the limit that the
scheme states.  The largest step on a scene follows from the scheme's map on the linearised scene (`longest`).
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Unpack

import numpy as np

from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import sorted_out
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.stability import propagators
from springcheck.studies.stability.edges import first_growth, radius
from springcheck.studies.stability.longest import fastest
from springcheck.studies.stability.result import AGREED, LIMITS, Limit, Stability

GRID = np.geomspace(1e-9, 1e6, 4096)
"""h w of the scan, in a ratio of 1.008."""

OF_STAGES = 8 * float(np.finfo(np.longdouble).eps)
"""Rounding of the entries of a scheme's map, over (h w)**2."""

BLURRED = 16
"""Factor on the rounding in a second search.  Growth beyond a limit is of some power n of the distance, so
that rounding hides a distance r**(1/n), which changes by 16**(1/n) - 1 of itself, at least a quarter up to n
= 12."""


def record(
    scene: Scene, path: str | Path | None = None, methods: Sequence[str] = (), **how: Unpack[How]
) -> Stability:
    """Measure the methods that these labels or globs name (all when none is given).

    Raises MethodError: a label names nothing, or none of the methods can be measured.  SceneError: forces of
    the scene overflow at its start.
    """
    fastest(scene)
    labels = engines.match(methods or ("*",), every=bool(methods))
    return keeper.study("stability", path, labels, partial(_measure, scene, labels), scene=scene, **how)


def _measure(scene: Scene, labels: Sequence[Label], kept: Keeper) -> Stability:
    def why(label: Label) -> str | None:
        claimed = propagators.scheme_of(label)
        if absent := engines.absence(label.engine):
            return absent
        if not claimed.has("named"):
            return "its scheme is not known; --scheme NAME states it, and its limit is then measured"
        if not claimed.has("one-step"):
            return "it has no fixed step and no limit"
        if "wall-spring" not in engines.method(label).terms:
            return "it moves no springs"
        try:
            if engines.refusal(scene, label) is None:
                engines.Started(scene, label)
        except MethodError as error:
            return str(error)
        return propagators.absence(label, GRID[0], GRID[-1])

    usable, left_out = sorted_out(labels, why, "has a limit to measure")
    pieces = each(usable, "limit of", partial(partial, measure), LIMITS)
    return Stability(scene=scene, limits=tuple(kept.results(pieces)), left_out=tuple(left_out))


def measure(label: Label) -> Limit:
    """Measure the limit of a method, and find that of its scheme's map at the engine's rounding."""
    scheme, rounding = propagators.scheme_of(label), propagators.noise(label)
    limit = first_growth(partial(propagators.measured, label), GRID, rounding)
    # an implicit scheme's stages are of the order of (h w)**2 where its map is of the order of 1
    exact, blurred = (
        first_growth(partial(propagators.theory, label), GRID, times * rounding, OF_STAGES)
        for times in (1, BLURRED)
    )
    # where rounding hides growth the limit moves with it, by less than this where the stated one is right
    hidden = 0.0 if exact == blurred else 4 * min(abs(exact - blurred), abs(exact - scheme.limit))
    centre = scheme.limit if 0 < scheme.limit < np.inf else 2.0
    turn = np.sort(np.append(np.geomspace(centre / 20, 5 * centre, 40), centre))
    of_engine, of_scheme = (
        radius(maps(label, turn), rounding)[0][:, 0] for maps in (propagators.measured, propagators.theory)
    )
    return Limit(
        method=str(label), scheme=scheme.title, limit=limit, theory=scheme.limit, exact=exact,
        bound=max(hidden, (AGREED + 4 * rounding) * (exact if np.isfinite(exact) else 1.0)), h_w=turn,
        radius=of_engine, radius_predicted=of_scheme,
    )  # fmt: skip


def perform(options: Namespace, progress: Progress | None) -> Stability:
    """Carry out `springcheck stability`."""
    scene = scenefile.load_scene(options.scene)
    path = options.output or f"{scene.name}-stability.h5"
    return record(scene, path, options.method, **keeper.how(options, progress))
