"""Every study as a function; without a `path` nothing is left on disk."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from springcheck.api.showing import Said, Shelf
from springcheck.api.taking import Step, needed, path_of, scene_of, spoken, taken
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.arguments import typed
from springcheck.physics.arrays import reals
from springcheck.physics.scene import Scene

if TYPE_CHECKING:
    from springcheck.studies.census.result import Census
    from springcheck.studies.ensemble.result import Ensemble
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
def census(
    methods: str | Step | Sequence[str | Step] = (), *, thermostats: bool = False,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> Census:  # fmt: skip
    """Identify the integrator that every installed engine really runs, by its states; `methods` are labels or
    globs.

    With `thermostats` globs match those too, on springs in a bath.
    """
    from springcheck.studies.census import measure

    with taken(methods, force, workers, path) as (named, how):
        return measure.record(path, named, thermostats=thermostats, **how)


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
def ensemble(
    scene: Scene | str | Path, vary: Mapping[str, str | Sequence[float]],
    methods: str | Step | Sequence[str | Step] = (), *, samples: int | None = None, seed: int = 0,
    path: str | Path | None = None, force: bool = False, workers: int = 1,
) -> Ensemble:  # fmt: skip
    """Run one scene over many parameters: error, energy and end of each cell.

    `vary` names fields of the scene file, each with its values or with ``"LOW:HIGH:COUNT"`` (followed by
    ``":log"`` for logarithmic spacing): ``{"spring.0.stiffness": [1, 2, 4], "time.step": "0.01:0.1:8:log"}``.
    With `samples` each is ``"LOW:HIGH"``, drawn uniformly from `seed`.
    """
    from springcheck.studies.ensemble import measure
    from springcheck.studies.ensemble.vary import plan

    found = scene_of(scene)
    needed(vary, Mapping, "vary: a dict of fields and values")
    several = {x: y if isinstance(y, str) else reals("vary", **{x: y})[0].ravel() for x, y in vary.items()}
    given = [
        f"{field}={values if isinstance(values, str) else ','.join(map(repr, values.tolist()))}"
        for field, values in several.items()
    ]
    with taken(methods, force, workers, path) as (named, how):
        text = found.to_toml() if isinstance(scene, Scene) else scenefile.text_of(scene)
        cells = plan(given, samples, seed, text=text)
        return measure.record(found, cells, path, named, **how)


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
