"""Every study as a function; without a `path` nothing is left on disk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from springcheck.api.showing import Said, Shelf
from springcheck.api.taking import Step, needed, path_of, scene_of, spoken, taken
from springcheck.errors import SpringcheckError
from springcheck.physics.arguments import typed
from springcheck.physics.scene import Scene

if TYPE_CHECKING:
    from springcheck.studies.extremes.result import Atlas
    from springcheck.studies.faults.result import FaultReport
    from springcheck.studies.precision.result import PrecisionStudy
    from springcheck.studies.sampling.result import Sampling
    from springcheck.studies.stability.result import Stability


@typed
def precision(
    scene: Scene | str | Path, methods: str | Step | Sequence[str | Step] = (), *, budget: float = 75.0,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> PrecisionStudy:  # fmt: skip
    """Measure error against run time, down to rounding, in about `budget` seconds, without imports.

    Methods as in `run`.  `path` saves the result in a store; `workers` processes measure errors in parallel.
    """
    from springcheck.studies.precision import measure

    found = scene_of(scene)
    with taken(methods, force, workers, path) as (named, how):
        if not 0 < (budget := float(budget)) < math.inf:
            raise SpringcheckError(f"budget={budget}: a number of seconds above 0 is needed")
        from springcheck.studies.choose import choose

        labels, left, _ = choose(found, named)
        return measure.record(found, labels, path, budget=budget, left=left, **how)


@typed
def stability(
    scene: Scene | str | Path, methods: str | Step | Sequence[str | Step] = (), *,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> Stability:  # fmt: skip
    """Measure limits of stability against theory, with the h omega and the largest step [T] on this scene.

    Methods as in `run`.
    """
    from springcheck.studies.stability import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(scene_of(scene), path, named, **how)


@typed
def extremes(
    methods: str | Step | Sequence[str | Step] = (), *, quick: bool = False,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> Atlas:  # fmt: skip
    """The atlas of extreme cases: steps, masses, amplitudes to the ends of the range, and who is right.

    `quick` takes fewer cells (20 s).
    """
    from springcheck.studies.extremes import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, quick=quick, **how)


@typed
def faults(*, path: str | Path | None = None, force: bool = False, workers: int = 1) -> FaultReport:
    """Engines broken on purpose: which checks reject each, and their detection limits.  It takes minutes."""
    from springcheck.studies.faults import measure

    with taken((), force, workers, path) as (_, how):
        return measure.record(path, **how)


@typed
def sampling(
    methods: str | Sequence[str] = (), *, path: str | Path | None = None, force: bool = False,
    workers: int = 1,
) -> Sampling:  # fmt: skip
    """How well thermostats sample a spring: temperatures, precision and limits, each beside its law."""
    from springcheck.studies.sampling import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, **how)


@typed
def methods(scene: Scene | str | Path | None = None) -> Shelf:
    """All known methods: label, scheme, whether it runs by default, and why it cannot be used (its engine is
    not installed, or it cannot serve the `scene`); "" where it can."""
    from springcheck.cli import listing

    return Shelf(listing.methods(None if scene is None else scene_of(scene)))


@typed
def explain(word: str) -> Said:
    """Explain a check, scheme, method, fault, finding or term.  SpringcheckError for an unknown word."""
    from springcheck.cli import explain as explaining

    return Said("\n".join(explaining.lines(needed(word, str, "a word"))))


@typed
def report(path: str | Path, output: str | Path | None = None) -> Path:
    """Write a store as one HTML page that checks itself in a browser; `output` is its name with .html by
    default.

    StoreError where `path` cannot be read, or another file is where the page would be.
    """
    from springcheck.cli import page

    place = path_of(path)
    into = path_of(f"{place.stem}.html" if output is None else output)
    with spoken():
        page.write(page.gather(place), into)
    return into
