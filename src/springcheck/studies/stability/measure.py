"""Limits of stability, measured on the engines' own propagators and compared with theory.

Every method of fixed step has its limit on a spring measured (`limits`).  A scene with friction adds the
region of stability of a damped spring (`regions`), one with springs marked fast the resonances of multiple
time steps (`resonance`), a modulated spring the Floquet multipliers of methods (`multipliers`).
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Unpack

from springcheck import engines
from springcheck.engines.contract import Label, Need
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.schemes import scheme
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.choose import LeftOut, sorted_out
from springcheck.studies.keeper import How, Keeper, each
from springcheck.studies.stability import limits, multipliers, propagators, regions, resonance
from springcheck.studies.stability.longest import fastest
from springcheck.studies.stability.result import LIMITS, MULTIPLIERS, REGIONS, RESONANCES, Stability


def record(
    scene: Scene, path: str | Path | None = None, methods: Sequence[str] = (), **how: Unpack[How]
) -> Stability:
    """Measure the methods that these labels or globs name (all when none is given).

    A store has tables under /stability, and the document (see `keeper.kept`).

    Raises:
        MethodError: a label names nothing, or none of the methods can be measured.
        SceneError: forces of the scene overflow at its start.
    """
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
        if Need.FIELD in method.requires:
            return "limits are measured on springs alone, without the magnetic field that it needs"
        if "wall-spring" not in method.terms:
            return "it moves no springs"
        scan = limits.FIRST_H_W, limits.LAST_H_W
        return propagators.absence(label, *scan) or propagators.unstarted(scene, label)

    usable, left_out = sorted_out(labels, why, "has a limit to measure")
    braked = [label for label in usable if "damping" in engines.method(label).terms]
    damped = braked if scene.system.is_damped else []
    resonant = [label for label in usable if resonance.serves(scene, label)]
    modulated = [label for label in usable if multipliers.serves(scene, label)]
    plan = [
        each(usable, "limit of", partial(partial, limits.measure), LIMITS),
        each(damped, "region of", partial(partial, regions.measure), REGIONS),
        each(resonant, "resonances of", lambda label: partial(resonance.measure, scene, label), RESONANCES),
        each(
            modulated, "multiplier of", lambda label: partial(multipliers.measure, scene, label), MULTIPLIERS
        ),
    ]
    found = iter(kept.results([piece for part in plan for piece in part]))
    of_limits, of_regions, of_resonances, of_multipliers = ([next(found) for _ in part] for part in plan)
    return Stability(
        scene=scene,
        limits=tuple(of_limits),
        regions=tuple(of_regions),
        resonances=tuple(of_resonances),
        multipliers=tuple(x for x in of_multipliers if not x.why),
        left_out=(*left_out, *(LeftOut(method=x.method, reason=x.why) for x in of_multipliers if x.why)),
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
        multipliers=kept.listed(MULTIPLIERS, "multipliers"),
        left_out=kept.left_out,
    )
