"""The studies, methods, explanations and the page as functions."""

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
    """Measure error against run time and force calls, from the stability limit down to rounding.

    >>> springcheck.precision("spring", "own:rk4", budget=0.2).to_dataframe().columns[4]
    'max_error'

    Parameters
    ----------
    scene, methods, path, force
        As in `run`; by default the scene's methods, and an own one of every order and kind.
    budget
        Time to measure [s], without imports.
    metric
        Which error: largest, end, energy or phase.
    periods
        Integrate over this number of periods at the scene's step instead, as 1e6.

    Returns
    -------
    PrecisionStudy or LongTime
        A table that prints, and `to_dataframe()` with a row for each step or tolerance.
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
    """Measure stability limits in h omega, with those of theory, and the largest step [T] on this scene.

    >>> springcheck.stability("spring", "own:velocity-verlet").to_dataframe()["limit"][0].round(6).item()
    2.0

    Parameters
    ----------
    scene, methods, path, force
        As in `run`.
    workers
        Number of processes.

    Returns
    -------
    Stability
        A table that prints, and `to_dataframe()` with a row for each method.
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

    >>> print(springcheck.extremes("own:velocity-verlet", quick=True))  # doctest: +SKIP

    Parameters
    ----------
    methods, path, force, workers
        As in `run` and `stability`.
    quick
        Measure a third of the cells.

    Returns
    -------
    Atlas
        A table that prints: right, unstable as in theory, at a limit of the engine, or silently wrong.
    """
    from springcheck.studies.extremes import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, quick=quick, **how)


@typed
def sampling(
    methods: str | Sequence[str] = (), *, path: str | Path | None = None, force: bool = False,
    workers: int = 1,
) -> Sampling:  # fmt: skip
    """Measure how well thermostats sample a spring: temperatures, precision and limits, with theory.

    >>> print(springcheck.sampling("own:baoab"))  # doctest: +SKIP

    Parameters
    ----------
    methods, path, force, workers
        As in `run` and `stability`.

    Returns
    -------
    Sampling
        A table that prints, and `to_dataframe()` with a row for each method.
    """
    from springcheck.studies.sampling import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, **how)


@typed
def methods(scene: Scene | str | Path | None = None) -> Shelf:
    """List all methods.

    >>> springcheck.methods("spring")[0]
    {'method': 'own:euler', 'scheme': 'explicit Euler', 'default': True, 'why not': ''}

    Returns
    -------
    Shelf
        A list of dicts: label, scheme, whether it runs by default, and why it cannot be used: its engine is
        not installed, or it cannot serve `scene`; "" where it can.
    """
    from springcheck.cli import listing

    return Shelf(listing.methods(None if scene is None else scene_of(scene)))


@typed
def explain(word: str) -> Said:
    """Explain a check, scheme, method, fault, finding or term.  SpringcheckError for an unknown word.

    >>> springcheck.explain("ulp")
    ulp: unit in the last place: the distance between neighbouring numbers, 2**-52 of one between 1 and 2
    """
    from springcheck.cli import explain as explaining

    return Said("\n".join(explaining.lines(needed(word, str, "a word"))))


@typed
def report(path: str | Path, output: str | Path | None = None) -> Path:
    """Write a store as one HTML page that checks itself in a browser.

    >>> springcheck.report("spring.h5")  # doctest: +SKIP

    Parameters
    ----------
    path
        The store.
    output
        The page; by default the store's name with .html.

    Returns
    -------
    Path
        The page.

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
