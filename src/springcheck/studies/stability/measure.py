"""Limits of stability, measured on the engines' own propagators and compared with theory.

Every method of fixed step has its limit on a spring measured (`limits`).  A scene with friction adds the
region of stability of a damped spring (`regions`), one with springs marked fast the resonances of multiple
time steps (`resonance`).
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
from springcheck.errors import SceneError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.schemes import scheme
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import sorted_out
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.stability import limits, propagators, regions, resonance
from springcheck.studies.stability.longest import fastest
from springcheck.studies.stability.result import LIMITS, REGIONS, RESONANCES, Stability


def record(
    scene: Scene, path: str | Path | None = None, methods: Sequence[str] = (), **how: Unpack[How]
) -> Stability:
    """Measure the methods that these labels or globs name (all when none is given).

    A store has tables under /stability, and the document (see `keeper.kept`).

    Raises:
        MethodError: a label names nothing, or none of the methods can be measured.
        SceneError: forces of the scene overflow at its start, or it has rods.
    """
    if rods := scene.system.rods:
        rate = float(np.max(rods.rates(scene.q, scene.p)))
        here = f", here h < {1 / rate:.6g} at the rate of the start" if rate else ""
        raise SceneError(
            f"scene {scene.name} has rods, and stability is a study of springs: a rod that turns freely has "
            f"a step below h w = 1{here}, and none beyond"
        )
    fastest(scene)
    labels = engines.match(methods or ("*",), every=bool(methods))
    return keeper.study("stability", path, labels, partial(_measure, scene, labels), scene=scene, **how)


def _measure(scene: Scene, labels: Sequence[Label], kept: Keeper) -> Stability:
    def why(label: Label) -> str | None:
        method = engines.method(label)
        if absent := engines.absence(label.engine):
            return absent
        claimed = scheme(method.scheme)
        if not claimed.has("named"):
            return "its scheme is not known; --scheme NAME states it, and its limit is then measured"
        if not claimed.has("one-step"):
            return "it has no fixed step and no limit"
        if "wall-spring" not in method.terms:
            return "it moves no springs"
        scan = limits.FIRST_H_W, limits.LAST_H_W
        return propagators.absence(label, *scan) or propagators.unstarted(scene, label)

    usable, left_out = sorted_out(labels, why, "has a limit to measure")
    braked = [label for label in usable if "damping" in engines.method(label).terms]
    damped = braked if scene.system.is_damped else []
    resonant = [label for label in usable if resonance.serves(scene, label)]
    plan = [
        each(usable, "limit of", partial(partial, limits.measure), LIMITS),
        each(damped, "region of", partial(partial, regions.measure), REGIONS),
        each(resonant, "resonances of", lambda label: partial(resonance.measure, scene, label), RESONANCES),
    ]
    found = iter(kept.results([piece for part in plan for piece in part]))
    of_limits, of_regions, of_resonances = ([next(found) for _ in part] for part in plan)
    return Stability(
        scene=scene,
        limits=tuple(of_limits),
        regions=tuple(of_regions),
        resonances=tuple(of_resonances),
        left_out=tuple(left_out),
    )


def perform(options: Namespace, progress: Progress | None) -> Stability:
    """Carry out `springcheck stability`."""
    scene = scenefile.load_scene(options.scene)
    path = options.output or f"{scene.name}-stability.h5"
    return record(scene, path, options.method, **keeper.how(options, progress))


@keeper.restoring("stability")
def stored(kept: keeper.Kept) -> Stability:
    """The study that `record` has saved.  StoreError where the file holds none."""
    return Stability(
        scene=keeper.stored_scene(kept.path),
        limits=kept.listed(LIMITS, "methods"),
        regions=kept.listed(REGIONS, "regions"),
        resonances=kept.listed(RESONANCES, "resonances"),
        left_out=kept.left_out,
    )
