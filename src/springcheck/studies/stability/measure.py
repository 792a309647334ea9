"""Where methods stop being stable, measured on the engines' own propagators and set beside theory.

Every method of fixed step gets its limit on a spring (`limits`).  A scene with friction adds the region
of stability of a damped spring (`regions`), one with springs marked fast the resonances of multiple time
steps (`resonance`), and the scenes `two-scales` and `overdamped` what stiffness costs (`costs`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import engines, store
from springcheck.engines.contract import Label
from springcheck.errors import MethodError, StoreError
from springcheck.physics.scene import Scene
from springcheck.provenance import command
from springcheck.studies.pieces import Pieces, Progress
from springcheck.studies.stability import costs, keeping, limits, propagators, regions, resonance
from springcheck.studies.stability.costs import Cost
from springcheck.studies.stability.limits import Limit
from springcheck.studies.stability.regions import Region
from springcheck.studies.stability.resonance import Resonance

__all__ = [
    "Cost",
    "Limit",
    "Region",
    "Resonance",
    "Stability",
    "document",
    "measure",
    "record",
    "sentences",
    "stored",
]

DOCUMENT = "stability"
"""Name of the study's document in a store."""

GROWTH = 1e-6
"""Relative difference allowed between measured and predicted growth in double precision: what is left of
the decaying eigenvector in the fitted quarter of a run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stability:
    """All that was measured, and what was left out and why."""

    scene: Scene
    limits: tuple[Limit, ...]
    regions: tuple[Region, ...]
    resonances: tuple[Resonance, ...]
    costs: tuple[Cost, ...]
    left_out: tuple[tuple[str, str], ...]
    taken_up: int = 0
    """Limits, regions, resonances and costs that an interrupted call had finished."""

    @property
    def passed(self) -> bool:
        """Whether limits, growth, regions and bands are where theory puts them, and any was measured."""
        return bool(self.limits) and not failures(self)


def measure(
    scene: Scene,
    methods: Sequence[str] = (),
    *,
    progress: Progress | None = None,
    pieces: Pieces | None = None,
) -> Stability:
    """Measure the methods that these labels or globs name (all when none is given).

    What an earlier call has finished (`pieces`) is taken up.

    Raises:
        MethodError: a label names nothing, or none of the methods can be measured.
    """
    chosen = engines.match(tuple(methods) or ("*",))
    left_out = []
    usable: list[Label] = []
    for label in chosen:
        absent = engines.absence(label.engine)
        if label not in propagators.one_step_labels(chosen):
            adaptive = engines.method(label).adaptive
            absent = absent or ("it has no fixed step and no limit" if adaptive else "it moves no springs")
        else:
            absent = absent or propagators.absence(label)
        if absent:
            left_out.append((str(label), absent))
        else:
            usable.append(label)
    damped = regions.labels(tuple(usable)) if scene.system.is_damped else ()
    resonant = [label for label in usable if resonance.serves(scene, label)]
    family = next((name for name in costs.RATIOS if name == scene.name), None)
    stiff = [label for label in chosen if family and costs.serves(label, family)]
    pieces = pieces or Pieces()
    pieces.expect(len(usable) + len(damped) + len(resonant) + len(stiff), progress)
    found_limits = pieces.each(
        usable, keeping.LIMITS, "limit of", limits.measure, keeping.of_limit, keeping.to_limit
    )
    found_regions = pieces.each(
        damped, keeping.REGIONS, "region of", regions.measure, keeping.of_region, keeping.to_region
    )
    found_resonances = pieces.each(
        resonant,
        keeping.RESONANCES,
        "resonances of",
        partial(resonance.measure, scene),
        keeping.of_resonance,
        keeping.to_resonance,
    )
    rows: tuple[tuple[Cost, ...], ...] = ()
    if family:
        cost = partial(costs.measure, family=family)
        rows = pieces.each(stiff, keeping.COSTS, "stiffness,", cost, keeping.of_costs, keeping.to_costs)
    if not usable and not rows:
        raise MethodError(
            "none of these methods has a limit to measure: " + "; ".join(map(": ".join, left_out))
        )
    return Stability(
        scene=scene,
        limits=found_limits,
        regions=found_regions,
        resonances=found_resonances,
        costs=tuple(row for of_method in rows for row in of_method),
        left_out=tuple(left_out),
        taken_up=len(pieces.taken_up),
    )


def record(
    scene: Scene,
    path: str | Path,
    methods: Sequence[str] = (),
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Stability:
    """Like `measure`, kept in a store: tables under /stability as they are finished, and the document.

    An unfinished study of the same command is taken up.  Raises StoreError, before anything is measured,
    when the file exists or cannot be written.
    """
    labels = engines.match(tuple(methods) or ("*",))
    with store.open_new(path, command("stability", labels, scene.text), force=force) as journal:
        study = measure(scene, methods, progress=progress, pieces=Pieces(journal))
        journal.commit(scene, documents={DOCUMENT: json.dumps(document(study), allow_nan=False)})
    return study


def stored(path: str | Path, scene: Scene) -> Stability:
    """The study that `record` has kept, of this scene.  StoreError where the file holds none."""
    known = json.loads(store.document(path, DOCUMENT))
    tables = store.read_tables(path)

    def under(beginning: str, name: str) -> Iterator[store.Table]:
        # the document knows the order in which they were measured
        return (tables[beginning + one["method"]] for one in known[name])

    try:
        return Stability(
            scene=scene,
            limits=tuple(map(keeping.to_limit, under(keeping.LIMITS, "methods"))),
            regions=tuple(map(keeping.to_region, under(keeping.REGIONS, "regions"))),
            resonances=tuple(map(keeping.to_resonance, under(keeping.RESONANCES, "resonances"))),
            costs=tuple(
                row
                for method in dict.fromkeys(one["method"] for one in known["costs"])
                for row in keeping.to_costs(tables[keeping.COSTS + method])
            ),
            left_out=tuple((one["method"], one["reason"]) for one in known["left_out"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise StoreError(f"{path}: its study of stability lacks {error}; measure it anew") from error


def growth_allowed(limit: Limit) -> float:
    """Relative difference allowed between measured and predicted growth above the limit.

    Growth is the square root of the distance from the limit, so a limit known to `bound` moves it by half
    of bound over that distance; in double precision the limit is known to far better than `AGREED`.
    """
    if limit.theory in (0.0, np.inf) or limit.bound <= limits.AGREED:
        return GROWTH
    return GROWTH + 0.5 * limit.bound / (limit.theory * limits.NEXT)


def failures(study: Stability) -> list[str]:
    """What is not where theory puts it, one sentence each."""
    out = []
    for x in study.limits:
        if not x.agrees:
            out.append(f"{x.method}: limit {x.limit:.9g}, theory {x.theory:.9g}, allowed {x.bound:.1e}")
        if np.isfinite(x.theory):
            off = abs(x.growth_above / x.growth_predicted - 1)
            if not off <= growth_allowed(x):
                out.append(
                    f"{x.method}: growth {x.growth_above:.9g} a step, predicted {x.growth_predicted:.9g}"
                )
        if np.isfinite(x.growth_below) and not x.growth_below <= max(x.growth_below_predicted, 0) + 1e-4:
            out.append(f"{x.method}: grows by {x.growth_below:.3g} a step below its limit")
    out += [f"{x.method}: {x.wrong} points of the damped plane disagree" for x in study.regions if x.wrong]
    for y in study.resonances:
        if y.bands != y.bands_predicted and not _apart(y) <= 1e-6:
            out.append(f"{y.method}: bands {y.bands}, the exact map's {y.bands_predicted}")
    return out


def sentences(study: Stability) -> list[str]:
    """What was found beside the table of limits, in sentences."""
    out = [
        f"{x.method}: stable in {np.count_nonzero(x.stable)} of {x.points} points of the damped plane, "
        f"{x.wrong} against theory; radii within {x.off:.2f} of what rounding allows"
        for x in study.regions
    ]
    for y in study.resonances:
        bands = ", ".join(f"{a:.6f} to {b:.6f}" for a, b in y.bands)
        out.append(f"{y.method}: grows at h w_fast from {bands}; the exact map agrees to {_apart(y):.1e}")
    out += failures(study)
    return out


def _apart(x: Resonance) -> float:
    a, b = np.array(x.bands), np.array(x.bands_predicted)
    return float(np.max(np.abs(a - b))) if a.shape == b.shape and a.size else float("nan")


def document(study: Stability) -> dict[str, Any]:
    """Plain data for JSON; what is not a finite number is None (a limit of None: there is none)."""
    return {
        "scene": study.scene.name,
        "passed": study.passed,
        "methods": [
            {
                "method": x.method,
                "scheme": x.scheme,
                "limit": _finite(x.limit),
                "theory": _finite(x.theory),
                "bound": x.bound,
                "agrees": x.agrees,
                "growth_above": _finite(x.growth_above),
                "growth_predicted": _finite(x.growth_predicted),
                "growth_below": _finite(x.growth_below),
                "edge": _finite(x.edge),
                "points": [
                    {"h_w": a, "radius": _finite(b), "radius_predicted": _finite(c)}
                    for a, b, c in zip(
                        x.turn.tolist(), x.radius.tolist(), x.radius_predicted.tolist(), strict=True
                    )
                ],
            }
            for x in study.limits
        ],
        "regions": [
            {
                "method": x.method,
                "points": x.points,
                "stable": int(np.count_nonzero(x.stable)),
                "wrong": x.wrong,
                "undecided": x.undecided,
                "off": x.off,
            }
            for x in study.regions
        ],
        "resonances": [
            {"method": x.method, "bands": x.bands, "bands_predicted": x.bands_predicted}
            for x in study.resonances
        ],
        "costs": [
            {
                name: _finite(value) if isinstance(value, float) else value
                for name in Cost.__slots__
                for value in [getattr(x, name)]
            }
            for x in study.costs
        ],
        "left_out": [{"method": method, "reason": reason} for method, reason in study.left_out],
        "failures": failures(study),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
