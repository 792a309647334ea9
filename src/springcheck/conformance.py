"""Checks of an engine for its own test-suite: that it keeps the contract, and does what its scheme promises.

In a test module of an engine, with pytest::

    from springcheck.conformance import parametrize_with_checks

    @parametrize_with_checks(ENGINE)
    def test_springcheck(check):
        check()

`assert_right` judges one trajectory, however it was made.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS
from springcheck.engines import Engine, Label
from springcheck.errors import MethodError, SpringcheckError
from springcheck.physics.arrays import Floats
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.scenefile import load_scene
from springcheck.physics.terms import Damping, Quartic, Spring, WallSpring
from springcheck.physics.trajectory import Trajectory

__all__ = ["Check", "assert_right", "checks_of", "parametrize_with_checks", "uneven_scenes"]

SEED = 20260101

__tracebackhide__ = True
"""pytest omits our frames from a traceback, and shows those of the engine and of its test."""


@dataclass(frozen=True, slots=True)
class Check:
    """One check of one method, to be called.  AssertionError says what is wrong, in words."""

    name: str
    label: Label
    test: Callable[[Label], None]

    def __call__(self) -> None:
        self.test(self.label)

    def __str__(self) -> str:
        return f"{self.label}-{self.name}"


def parametrize_with_checks(engine: Engine) -> Any:
    """A decorator that runs a test once for each check of each method; its argument is named `check`.

    Parameters
    ----------
    engine
        The engine to test; it need not be installed as a plug-in.

    Examples
    --------
    >>> from springcheck import engines
    >>> len(checks_of(engines.engine("ase"))) > 10
    True
    """
    import pytest

    return pytest.mark.parametrize("check", checks_of(engine), ids=str)


def checks_of(engine: Engine) -> list[Check]:
    """Every check of every method of an engine."""
    if engine.name not in engines.names() or engines.engine(engine.name) is not engine:
        engines.bring(engine, "the tests of its own")
    labels = [Label(engine=engine.name, method=name) for name in (*engine.methods, *engine.thermostats)]
    found = [Check("declaring imports no library", labels[0], _imports_nothing)]
    for label in labels:
        scenes = _served(label)
        found += [Check(f"right on {scene.name}", label, partial(_right, scene=scene)) for scene in scenes]
        tests = TESTS if scenes else {"serves a scene": _serves_none}
        if label.method not in engine.methods:
            tests = {"seeds": _seeds} if scenes else {}
        found += [Check(name, label, test) for name, test in tests.items()]
    return found


def assert_right(scene: Scene, run: Trajectory) -> None:
    """Raise AssertionError if a verdict on a trajectory fails; the message has diagnosis and reasons."""
    verdicts = checks.explained(scene, run, checks.judge(scene, run), _shown)
    wrong = [verdict for verdict in verdicts if verdict.passed is False]
    if wrong:
        cause = checks.cause_of(wrong)
        lines = [
            f"  {verdict.check}: {verdict.value:.3g} where {verdict.bound:.3g} {verdict.unit} is allowed; "
            f"{verdict.why.partition(checks.DIAGNOSIS)[0]}"
            for verdict in wrong
        ]
        said = f": {cause}" if cause else ""
        raise AssertionError(
            f"{run.label} is not {run.scheme} on {scene.name}{said}\n"
            + "\n".join([*lines, checks.summary(verdicts)])
        )


def _shown(scene: Scene, run: Trajectory, about: int, few: bool) -> str:
    """Cause that the states of a failed run show; or that SciPy or h5py, which would find it, is missing."""
    try:
        from springcheck.identify import scenes
    except ModuleNotFoundError as error:
        if error.name and error.name.partition(".")[0] in ("scipy", "h5py"):
            return "with SciPy installed, this line says what they are"
        raise
    return scenes.diagnosis(scene, run, about, few)


def uneven_scenes() -> Iterator[Scene]:
    """Scenes of uneven numbers, so that no mass, stiffness, step, rest point or axis can hide."""
    rng = np.random.default_rng(SEED)

    def some(low: float, high: float, n: int) -> Floats:
        return np.asarray(rng.uniform(low, high, n))

    for number in range(12):
        n = 1 if number < 6 else 3
        i = np.arange(n)
        m, k = some(0.4, 4.0, n), some(0.5, 3.0, n)
        at = some(-0.7, 0.7, n) if number % 2 else np.zeros(n)
        terms: list[Any] = [WallSpring(i=i, k=k, at=at)]
        if number in (8, 9):
            a = np.arange(n - 1)
            terms.append(Spring(a=a, b=a + 1, k=some(0.5, 2.0, n - 1), rest=some(0.1, 0.9, n - 1)))
        if number == 10:
            terms.append(Quartic(i=i, b=some(0.3, 1.5, n), at=np.zeros(n)))
        if number == 11:
            terms.append(Damping(i=i, c=some(0.1, 0.5, n)))
        yield Scene(
            name=f"uneven-{number + 1}", m=m, q=some(-1.2, 1.2, n), p=some(-1.5, 1.5, n), terms=tuple(terms),
            # at longer steps explicit Euler escapes a quartic
            step=float(rng.uniform(0.02, 0.05 if number == 10 else 0.2)),
            steps=120, every=1 if number % 3 else 3,
        )  # fmt: skip
    for number, axes in enumerate(([0, 1, 2], [1, 2], [0, 1, 2, 3, 4, 5])):
        n = len(axes)
        of = np.array(axes) // 3
        m, k = some(0.4, 4.0, 2)[of], some(0.5, 3.0, 2)[of]
        held = WallSpring(i=np.arange(n), k=k, at=np.zeros(n))
        pairs = Spring(a=np.arange(3), b=np.arange(3, 6), k=np.full(3, some(0.5, 2.0, 1)), rest=np.zeros(3))
        yield Scene(
            name=f"uneven-axes-{number + 1}", places=np.array(axes), m=m,
            q=some(-1.2, 1.2, n), p=some(-1.5, 1.5, n),
            terms=(held, pairs) if n == 6 else (held,), step=float(rng.uniform(0.02, 0.2)), steps=120,
        )  # fmt: skip


def _served(label: Label) -> list[Scene]:
    """The uneven scenes that a method serves, or scenes made for it where it serves none; [] if none."""
    uneven = list(uneven_scenes())
    bath = Bath(temperature=1.7, friction=0.8)
    for scenes in (
        uneven,
        (replace(x, terms=(*x.terms, Damping(i=np.arange(x.n), c=0.3 * x.m))) for x in uneven[:2]),
        map(_with_fast_pairs, uneven[8:10]),
        map(load_scene, ("lc-circuit", "rlc-circuit", "pendulum")),
        (replace(x, bath=bath, steps=400, every=1) for x in uneven if not x.system.is_damped),
    ):
        if found := [scene for scene in scenes if engines.refusal(scene, label) is None]:
            return found
    return []


def _with_fast_pairs(scene: Scene) -> Scene:
    """The springs between particles are fast, those to walls are slow."""
    terms = (replace(term, fast=True) if isinstance(term, Spring) else term for term in scene.terms)
    return replace(scene, terms=tuple(terms))


def odd_scenes(scene: Scene) -> list[Scene]:
    """A scene with the terms that engines lose or change: particles out of order, two springs to walls of one
    particle, two between one pair with ends swapped, a rest length or stiffness below 0, one friction."""
    i, x = np.arange(scene.n), np.array
    count = i.astype(np.float64)
    wall = WallSpring(i=i[::-1], k=1.3 + 0.4 * count, at=0.2 * count - 0.1)
    odd = {
        "out-of-order": (),
        "two-walls": (WallSpring(i=i[:1], k=x([0.7]), at=x([0.5])),),
        "below-0": (WallSpring(i=i[-1:], k=x([-0.3]), at=x([0.1])),),
        "one-friction": (Damping(i=i[:1], c=x([0.4])),),
    }
    if scene.n > 1:
        twice = Spring(a=x([0, 1]), b=x([1, 0]), k=x([0.9, 0.6]), rest=x([0.3, -0.4]))
        odd["a-pair-twice"] = (twice,)
    return [replace(scene, name=name, terms=(wall, *terms)) for name, terms in odd.items()]


def _imports_nothing(label: Label) -> None:
    engine = engines.engine(label.engine)
    module = engines.module_name(label.engine) or getattr(engine.start, "__module__", "")
    if not engine.imports or module == "__main__":
        return
    code = f"import sys, {module}; sys.exit(3 * ({engine.imports!r} in sys.modules))"
    there = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=there
    )
    assert done.returncode in (0, 3), f"{module} cannot be imported by itself: {done.stderr.strip()[-300:]}"
    assert not done.returncode, (
        f"importing {module} imports {engine.imports}: import it inside start and version, so that "
        "engines can be listed without it"
    )


def _serves_none(label: Label) -> None:
    why = engines.refusal(next(uneven_scenes()), label)
    raise AssertionError(f"{label} serves none of the scenes: {why}")


def _right(label: Label, scene: Scene) -> None:
    """Every verdict on a scene passes."""
    try:
        run = driver.run(scene, label, seed=SEED if scene.bath else None)
    except MethodError as error:
        # the message contains the line of the engine that raised
        raise AssertionError(f"{label} does not run {scene.name}: {error}") from None
    assert run.outcome.status == "complete", (
        f"{label} {run.outcome.status} on {scene.name}: {run.outcome.message}"
    )
    assert_right(scene, run)


def _advanced(scene: Scene, label: Label, every: int, *parts: int) -> Floats:
    """q and p (2, f, n) after every so many steps, asked for in parts of so many rows."""
    simulation, states = engines.Started(scene, label), np.full((2, sum(parts), scene.n), np.nan)
    for some in np.split(states, np.cumsum(parts[:-1]), axis=1):
        simulation.advance(every, *some)
    return states


def _chunks(label: Label) -> None:
    """Rows asked for at once or one by one are the same."""
    scene = replace(_served(label)[0], every=1)
    same = np.array_equal(_advanced(scene, label, 1, 24), _advanced(scene, label, 1, 1, 6, 17))
    assert same, "states asked for in parts are not those asked for at once: keep the state"


def _strides(label: Label) -> None:
    """Every tenth state is the tenth of all."""
    scene = replace(_served(label)[0], every=1)
    if not engines.method(label).adaptive:
        same = np.array_equal(_advanced(scene, label, 1, 30)[:, 9::10], _advanced(scene, label, 10, 3))
        assert same, (
            "advance(10, ...) does not give every tenth state of advance(1, ...), bit for bit: keep between "
            "rows what a step has left, as the momenta of a leapfrog's half step"
        )


def _untouched(label: Label) -> None:
    """The scene is the caller's, and two runs of it are the same."""
    scene = _served(label)[0]
    q, p = scene.q.copy(), scene.p.copy()
    one, other = driver.run(scene, label), driver.run(scene, label)
    assert np.array_equal(scene.q, q), "the run has changed scene.q: copy it"
    assert np.array_equal(scene.p, p), "the run has changed scene.p: copy it"
    assert np.array_equal(one.q, other.q), "two runs of one scene differ: is a state shared between them?"


def _seeds(label: Label) -> None:
    """One seed gives one trajectory, and another seed another."""
    one, same, other = (driver.run(_served(label)[0], label, seed=seed).q for seed in (SEED, SEED, SEED + 1))
    assert np.array_equal(one, same), "two runs of one seed differ: let the seed alone decide the draws"
    drawn = THERMOSTATS[engines.method(label).scheme].draws
    assert not drawn or not np.array_equal(one, other), (
        "two seeds give one trajectory: is the seed handed on?"
    )


def _backwards(label: Label) -> None:
    """A negative step goes backwards by the same scheme, or is refused."""
    scene = next((x for x in _served(label) if x.system.is_linear and not x.system.is_damped), None)
    if scene is None or engines.method(label).adaptive:
        return
    scene = replace(scene, step=-scene.step)
    try:
        run = driver.run(scene, label)
    except MethodError:
        return
    assert_right(scene, run)


def _refuses(label: Label) -> None:
    """What it does not serve is refused with a reason, and never moved wrongly."""
    served = _served(label)
    scene = next((x for x in served if x.n > 1), served[0])
    for odd in odd_scenes(scene) if scene.kind == "particles" else ():
        if engines.refusal(odd, label) is None:
            try:
                run = driver.run(odd, label)
            except MethodError as error:
                if error.__cause__ is None or isinstance(error.__cause__, SpringcheckError):
                    continue
                why = f"{error}, on {odd.name}: refuse it in start, by a MethodError"
                raise AssertionError(why) from error
            assert_right(odd, run)


def _versions(label: Label) -> None:
    """Versions are named: without them no run can be repeated."""
    found = engines.load(label.engine).version()
    assert all(isinstance(x, str) and x for pair in found.items() for x in pair), (
        f"version() returned {found!r}"
    )


TESTS: dict[str, Callable[[Label], None]] = {
    "rows in parts": _chunks,
    "frames apart": _strides,
    "scene untouched": _untouched,
    "negative step": _backwards,
    "refusals": _refuses,
    "versions": _versions,
}
