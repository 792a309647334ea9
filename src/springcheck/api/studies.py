"""Every study as a function; without a `path` nothing is left on disk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from springcheck.api.showing import Said, Shelf
from springcheck.api.taking import Step, needed, path_of, scene_of, spoken, taken
from springcheck.errors import SpringcheckError
from springcheck.physics.arguments import typed
from springcheck.physics.scene import Scene

if TYPE_CHECKING:
    from springcheck.studies.extremes.result import Atlas
    from springcheck.studies.precision.longtime import LongTime
    from springcheck.studies.precision.result import PrecisionStudy
    from springcheck.studies.sampling.result import Sampling
    from springcheck.studies.stability.result import Stability


@typed
def precision(
    scene: Scene | str | Path, methods: str | Step | Sequence[str | Step] = (), *, budget: float = 45.0,
    metric: str = "largest", periods: float | None = None,
    path: str | Path | None = None, force: bool = False,
) -> PrecisionStudy | LongTime:  # fmt: skip
    """Measure error against run time, down to rounding, in about `budget` seconds, without imports.

    Parameters
    ----------
    scene, methods
        As in `run`; by default the scene's methods, and an own one of every order and kind.
    metric
        Which error: largest, end, energy or phase.
    periods
        Run over so many periods at the scene's step instead, as 1e6.
    path, force
        Save the result in a store, and overwrite it.
    """
    from springcheck.studies.precision import METRICS, longtime, measure

    found = scene_of(scene)
    with taken(methods, force, 1, path) as (named, how):
        if metric not in METRICS:
            raise SpringcheckError(f"metric={metric!r}: one of {', '.join(METRICS)} is needed")
        if not 0 < (budget := float(budget)) < math.inf:
            raise SpringcheckError(f"budget={budget}: a number of seconds above 0 is needed")
        labels, left = measure.methods(found, named)
        if periods is not None:
            long: Any = {"periods": periods, "budget": budget, "metric": metric, "left": left}
            return longtime.record(found, labels, path, **long, **how)
        return measure.record(found, labels, path, budget=budget, metric=metric, left=left, **how)


@typed
def stability(
    scene: Scene | str | Path, methods: str | Step | Sequence[str | Step] = (), *,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> Stability:  # fmt: skip
    """Measure limits of stability next to theory, in h omega, and the largest step [T] on this scene.

    Parameters
    ----------
    scene, methods, path, force
        As in `run`.
    workers
        Processes that measure at once.
    """
    from springcheck.studies.stability import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(scene_of(scene), path, named, **how)


@typed
def extremes(
    methods: str | Step | Sequence[str | Step] = (), *, quick: bool = False,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> Atlas:  # fmt: skip
    """Measure which methods are right at extreme steps, masses and amplitudes.

    Parameters
    ----------
    methods, path, force
        As in `run`.
    quick
        Take fewer cells (20 s).
    workers
        Processes that measure at once.
    """
    from springcheck.studies.extremes import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, quick=quick, **how)


@typed
def sampling(
    methods: str | Sequence[str] = (), *, path: str | Path | None = None, force: bool = False,
    workers: int = 1,
) -> Sampling:  # fmt: skip
    """Measure how well thermostats sample a spring: temperatures, precision and limits, next to theory.

    Parameters
    ----------
    methods, path, force
        As in `run`.
    workers
        Processes that measure at once.
    """
    from springcheck.studies.sampling import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, **how)


@typed
def methods(scene: Scene | str | Path | None = None) -> Shelf:
    """All known methods.

    Returns
    -------
    Shelf
        Rows with label, scheme, whether it runs by default, and why it cannot be used: its engine is not
        installed, or it cannot serve `scene`; "" where it can.
    """
    from springcheck.cli import listing

    return Shelf(listing.methods(None if scene is None else scene_of(scene)))


@typed
def explain(word: str) -> Said:
    """Explain a check, scheme, method, fault, finding or term.  SpringcheckError for an unknown word."""
    from springcheck.cli import explain as explaining

    return Said("\n".join(explaining.lines(needed(word, str, "a word"))))


@typed
def report(path: str | Path, output: str | Path | None = None) -> Path:
    """Write a store as one HTML page that checks itself in a browser.

    Parameters
    ----------
    path
        The store.
    output
        The page; by default the store's name with .html.

    Returns
    -------
    Path
        Where the page is.

    Raises
    ------
    StoreError
        `path` cannot be read, or `output` is a file that is no such page.
    """
    from springcheck.cli import page

    place = path_of(path)
    into = path_of(f"{place.stem}.html" if output is None else output)
    with spoken():
        page.write(page.gather(place), into)
    return into
