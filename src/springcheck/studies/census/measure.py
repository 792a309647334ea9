"""The census: every method on the blog's spring and on an uneven one, named by its states alone."""

from __future__ import annotations

import hashlib
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Unpack

import numpy as np

from springcheck import driver, engines, schemes
from springcheck.engines.contract import Label
from springcheck.errors import IdentificationError, MethodError
from springcheck.identify import Identification, identify
from springcheck.identify.families import FAMILIES
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import Trajectory
from springcheck.schemes.elsewhere import ELSEWHERE
from springcheck.studies import keeper
from springcheck.studies.arguments import Progress
from springcheck.studies.census import baths, maps, table
from springcheck.studies.census.limit import LEAST_STEPS, first_limit
from springcheck.studies.census.result import ENTRIES, Census, Entry
from springcheck.studies.choose import LeftOut, sorted_out
from springcheck.studies.keeper import How, Keeper, each

EVERY = "*:*"
"""Every method of every engine; for an engine with default methods, these."""

BLOG, UNEVEN = "spring", "spring-uneven"

REPEATS = 2

MOST_SUBSTEPS = 64
"""Most substeps over which a held force is named as such; beyond, it counts as never renewed."""


def record(
    path: str | Path | None = None, methods: Sequence[str] = (), *, thermostats: bool = False,
    **how: Unpack[How],
) -> Census:  # fmt: skip
    """Run and name every method that these labels or globs name, all that are here when none is given.

    With `thermostats` globs name those too.  An unfinished census of the same command is resumed.  Raises
    MethodError where none of them can be run.
    """
    bath = None if thermostats else False
    labels = engines.match(methods or (EVERY,), bath=bath, every=bool(methods))
    return keeper.study("census", path, labels, partial(_measure, labels), **how)


def _measure(labels: Sequence[Label], kept: Keeper) -> Census:
    scenes = load_scene(BLOG), load_scene(UNEVEN)

    def why(label: Label) -> str | None:
        of = (baths.springs(1, 1),) if engines.method(label).generator else scenes
        reasons = [engines.refusal(scene, label) for scene in of]
        return next(filter(None, reasons), None) or _absence(label)

    broken = [LeftOut(method=name, reason=reason) for name, reason in engines.unusable().items()]
    usable, left = sorted_out(labels, why)
    left = [*broken, *left]
    if not usable:
        raise MethodError(f"none of these methods moves a spring: {left[0].method}: {left[0].reason}")
    found = kept.results(each(usable, "", lambda label: partial(entry, label), ENTRIES))
    # workers have ended: nothing else of this study runs beside the timing
    entries = [_timed(label, one, kept) for label, one in zip(usable, found, strict=True)]
    return Census(entries=tuple(entries), left_out=tuple(left))


def _timed(label: Label, one: Entry, kept: Keeper) -> Entry:
    """The entry with its seconds per step: the fastest repetition of a short run."""
    if not np.isnan(one.seconds):
        return one
    runs = [driver.run(load_scene(UNEVEN), label) for _ in range(REPEATS + 1)]
    timed = replace(one, seconds=min(run.timing.run for run in runs) / max(runs[0].outcome.step, 1))
    kept.keep(ENTRIES, str(label), timed)
    return timed


def _absence(label: Label) -> str | None:
    """Why an engine cannot be used here: it, or a library that it needs, is not installed."""
    try:
        engines.load(label.engine)
    except MethodError as error:
        return str(error)
    return None


def perform(options: Namespace, progress: Progress | None) -> Census:
    """Carry out `springcheck census`."""
    old = table.load(options.against) if options.against is not None else None
    how = keeper.how(options, progress)
    found = record(options.output or "census.h5", options.method, thermostats=options.thermostats, **how)
    if old is None:
        return found
    before, rows = table.rows(old), table.rows(found.document())
    return replace(found, changes=tuple(table.changes(before, rows)), since=table.versions(before, rows))


@keeper.restoring("census")
def stored(kept: keeper.Kept) -> Census:
    """The census that `record` has saved.  StoreError where the file holds none."""
    return Census(entries=kept.listed(ENTRIES, "entries"), left_out=kept.left_out, path=kept.path)


def entry(label: Label) -> Entry:
    """Identify one method by its states; its time is measured separately."""
    if engines.method(label).generator:
        return baths.entry(label)
    blog, uneven = load_scene(BLOG), load_scene(UNEVEN)
    orbit, run = driver.run(blog, label), driver.run(uneven, label)
    method = engines.method(label)
    found = None if method.adaptive else _identified(uneven, run)
    limit = np.nan if method.adaptive else first_limit(uneven, label)
    ended = orbit.outcome.status == "complete"
    name = "adaptive" if method.adaptive else _name(uneven, found)
    unmapped = method.adaptive or run.outcome.step < LEAST_STEPS
    one_step = None if unmapped else maps.fitted(run.q[:, 0], run.p[:, 0])
    steps = max(run.outcome.step, 1)
    states = np.concatenate([orbit.q[:, 0], orbit.p[:, 0]])
    return Entry(
        method=str(label),
        about=method.about,
        note=method.note,
        version=", ".join(f"{key} {value}" for key, value in engines.load(label.engine).version().items()),
        claimed=method.scheme,
        found=name,
        agrees=agrees(uneven, method.scheme, name),
        substeps=0 if found is None or found.stride is None else found.stride,
        velocity_offset=np.nan if found is None else float(found.velocity_offset),
        area=np.nan if one_step is None else float(np.linalg.det(one_step)) - 1,
        trace=np.nan if one_step is None else float(np.trace(one_step)),
        friction=float(found.friction[0]) if found is not None and found.fits and found.friction else np.nan,
        precision=found.precision if found is not None and found.fits else run.arithmetic.name,
        limit=limit,
        bounded=bool(np.isinf(limit)),
        along=maps.axes(label),
        amplitude=float(np.hypot(orbit.q[-1, 0], orbit.p[-1, 0])) if ended else np.nan,
        force_calls=run.force_calls / steps,
        digest=hashlib.sha256(states.tobytes()).hexdigest()[:16],
        q=orbit.q[:, 0].copy(),
        p=orbit.p[:, 0].copy(),
    )


def _spring(scene: Scene) -> tuple[float, float]:
    """Mass and stiffness of a scene of one mass on one spring."""
    return float(scene.m[0]), float(scene.system.hessian_diagonal(scene.q)[0])


def _identified(scene: Scene, run: Trajectory) -> Identification | None:
    """Identify the states, given mass and stiffness; the step is the interval between frames."""
    m, k = _spring(scene)
    try:
        return identify(run.t, run.q, run.p, mass=m, stiffness=k)
    except IdentificationError:
        return None


def _name(scene: Scene, found: Identification | None) -> str:
    """The scheme that the states show: of the catalogue, or a force held over substeps, or none."""
    if found is not None and found.verdict == "named" and found.fits and found.scheme:
        inside = f"{found.scheme}-{found.stride}"
        if inside in schemes.ATTACHED:
            return inside
        if found.scheme in schemes.SCHEMES or found.scheme in ELSEWHERE:
            return found.scheme
    elif found is not None and found.verdict == "not told apart":
        return " or ".join(dict.fromkeys(x.scheme for x in found.candidates))
    return _held(scene, found) or maps.NO_SCHEME


def _held(scene: Scene, found: Identification | None) -> str:
    """Name of a force held over n substeps, of the determinant 1 + a (n - 1)/2n, a = h**2 k/m; or ""."""
    m, k = _spring(scene)
    if found is not None and found.scheme == "held-force":
        n = 1 / (1 - 2 * (found.determinant[0] - 1) * m / (scene.step**2 * k))
        return f"force-held-{round(n)}" if 2 <= round(n) <= MOST_SUBSTEPS else ""
    # held over infinitely many substeps, as by RK4 with a force that is set before the step
    endless = found is not None and found.statement == FAMILIES["fault: old force"].cause
    return "force-held-rk4" if endless else ""


def agrees(scene: Scene, claimed: str, found: str) -> bool:
    """Whether two schemes have the same map on a spring; True where one of them has none to compare."""
    m, k = (np.array([x]) for x in _spring(scene))
    try:
        one, other = schemes.scheme(claimed), schemes.scheme(found)
    except MethodError:
        # several schemes that the states do not distinguish, or an adaptive solver
        return found == "adaptive" or claimed in found.split(" or ") or claimed == "unknown"
    if not (one.has("one-step") and other.has("one-step")):
        return True
    maps = [schemes.matrix(x, h=scene.step, m=m, k=k)[0] for x in (one, other)]
    return bool(np.allclose(maps[0], maps[1], rtol=1e-14, atol=1e-14))
