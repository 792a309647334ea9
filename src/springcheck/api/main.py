"""Functions that run, judge, compare and identify: of a scene, a trajectory or a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from springcheck import checks, driver
from springcheck.api.showing import Verdicts
from springcheck.api.taking import Step, labels_of, needed, path_of, scene_of, spoken
from springcheck.checks import compare as comparing
from springcheck.errors import MethodError, SpringcheckError
from springcheck.physics import exact as solutions
from springcheck.physics.arguments import typed
from springcheck.physics.arrays import reals
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Trajectory, of_scene

if TYPE_CHECKING:
    from springcheck.identify.result import Identification
    from springcheck.studies.run.result import Report


@typed
def run(
    scene: Scene | str | Path,
    methods: str | Step | Sequence[str | Step] = (),
    *,
    path: str | Path | None = None,
    force: bool = False,
    thorough: bool = False,
    faults: Sequence[str] = (),
    seed: int | None = None,
    scheme: str = "",
) -> Report:
    """Run a scene with several methods, compare the trajectories and judge them, as `springcheck run` does.

    >>> springcheck.run("spring", "own:*euler").counts
    '24 verdicts passed, 0 failed, 18 not applicable'

    Parameters
    ----------
    scene
        A scene, the name of a shipped one, or the path of a scene file.
    methods
        Labels, globs such as ``"own:*"``, or functions as in `simulate`; by default the scene's methods.
    path, force
        Save the result in a store, and overwrite it.  Without `path` nothing is left on disk.  A store of an
        interrupted call is resumed.
    thorough
        Also run checks that need further runs.
    faults
        Names of deliberate faults to run as well, as ``"friction=1e-3"``.
    seed
        Seed of random methods, a whole number.
    scheme
        The scheme that functions are judged against; by default it is identified.

    Returns
    -------
    Report
        Rows, verdicts and comparison; ``report["own:euler"]`` is a trajectory.

    Raises
    ------
    SpringcheckError
        Any error that a user can correct.
    """
    from springcheck.studies.run import measure

    found = scene_of(scene)
    with spoken(), labels_of(methods, scheme) as named, TemporaryDirectory(prefix="springcheck-") as folder:
        place = Path(folder, "run.h5") if path is None else path_of(path)
        report = measure.run(
            found, place, methods=named, force=force, thorough=thorough, faults=faults, seed=seed
        )
        for why in report.broke.values():
            raise MethodError(why)
        return report if path is not None else replace(report, path=None, trajectories=read(place))


@typed
def simulate(
    scene: Scene | str | Path,
    method: str | Step,
    *,
    progress: driver.Progress | None = None,
    seed: int | None = None,
    scheme: str = "",
) -> Trajectory:
    """Run a scene with one method.

    >>> springcheck.simulate("spring", "own:velocity-verlet").q[-1]
    array([0.91746551])

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    method
        A label such as ``"ase:velocity-verlet"``, or a function ``step(q, p, h, force, mass) -> (q, p)`` of
        numbers for one particle, or arrays (n,).
    progress
        Called with the number of steps done since its last call.
    seed
        Seed of a random method, a whole number; drawn by default.
    scheme
        The scheme that a function is judged against; by default it is identified.

    Returns
    -------
    Trajectory
        t (f,) [T], q (f, n) [L] and p (f, n) [M L/T]; row 0 is the start.

    Raises
    ------
    MethodError
        No such method or seed, or the method cannot serve the scene, or its engine is not installed.
    """
    found = scene_of(scene)
    needed(print if progress is None else progress, Callable, "progress: a function")
    if seed is not None:
        driver.checked_seed(seed)
    with labels_of(method, scheme) as named:
        label = needed(named[0] if len(named) == 1 else named, str, "one method")
        return replace(driver.run(found, label, progress=progress, seed=seed), scene=found)


@typed
def judge(scene: Scene | str | Path, trajectory: Trajectory) -> Verdicts:
    """Judge a trajectory of a scene with all checks.

    >>> run = springcheck.simulate("spring-uneven", "own:velocity-verlet")
    >>> springcheck.judge("spring-uneven", run).passed
    True

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    trajectory
        From `simulate`, `read` or ``Trajectory.from_arrays(..., scheme="velocity-verlet")``.

    Returns
    -------
    Verdicts
        A list; `passed` of a verdict is None where the check does not apply.  `cause` is the diagnosis.

    Raises
    ------
    SpringcheckError
        The trajectory has no scheme, no step, or another number of particles than the scene.
    """
    found, run = scene_of(scene), trajectory
    if not run.scheme:
        raise SpringcheckError(
            f"{run.label}: no scheme to judge it against; state one, as Trajectory.from_arrays(..., "
            "scheme='velocity-verlet'), or find it with identify(trajectory, mass=...)"
        )
    frames = len(run.t)
    shapes = {"t": (frames,), "q": (frames, found.n), "p": (frames, found.n), "energy": (frames,)}
    for name, shape in shapes.items():
        values = getattr(run, name)
        kind = getattr(values, "dtype", type(values).__name__)
        if values is not None and getattr(kind, "kind", "") != "f":
            raise SpringcheckError(f"{run.label}: {name} is {kind}; floating-point numbers are needed")
        if values is not None and (np.shape(values) != shape or not frames):
            given = f"{name} has shape {np.shape(values)}"
            raise SpringcheckError(f"{run.label}: {given}; scene {found.name} needs {shape}")
    if run.every < 1 or run.step == 0:
        raise SpringcheckError(
            f"{run.label}: every = {run.every} and step = {run.step:g} give no time between frames"
        )
    # trajectories made from arrays get the energies of their states
    run = run if run.scene or run.origin else run.of_scene(found)
    verdicts = checks.judge(found, run)
    if (status := checks.status(verdicts)) == 0:
        return Verdicts(verdicts)
    from springcheck.identify import scenes

    if status == 1:
        return Verdicts(checks.explained(found, run, verdicts, scenes.diagnosis))
    with suppress(ArithmeticError, ValueError), np.errstate(all="ignore"):
        return Verdicts(verdicts, shown=scenes.diagnosis(found, run, 0))
    return Verdicts(verdicts)


@typed
def compare(
    scene: Scene | str | Path, trajectories: Mapping[str, Trajectory] | Sequence[Trajectory]
) -> Comparison:
    """Compare trajectories of one scene with each other, and with the exact solution where it is known.

    >>> run = springcheck.simulate("spring", "own:velocity-verlet")
    >>> springcheck.compare("spring", [run, springcheck.exact("spring")])
    Comparison of exact, own:velocity-verlet: differences up to 0.00889

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    trajectories
        Trajectories by name, or a sequence of them with distinct labels.

    Returns
    -------
    Comparison
        `max_difference` (l, l) of each pair of `labels`, relative to the initial energy norm.

    Raises
    ------
    SpringcheckError
        Two trajectories have one label, or one is not of this scene.
    """
    runs: Any = trajectories if isinstance(trajectories, Sequence | Mapping) else [trajectories]
    each = runs.items() if isinstance(runs, Mapping) else [(getattr(x, "label", ""), x) for x in runs]
    named = {label: needed(one, Trajectory, "a Trajectory") for label, one in each}
    if len(named) < max(1, len(runs)):
        raise SpringcheckError("two trajectories have one label; give a dict with a name for each")
    return comparing.compare(scene_of(scene), named)


@typed
def identify(
    found: Trajectory | str | Path | Any,
    q: Any = None,
    p: Any = None,
    *,
    v: Any = None,
    mass: Any = None,
    stiffness: float | None = None,
    friction: float | None = None,
    step: float | None = None,
) -> Identification | dict[str, Identification]:
    """Identify the scheme behind a trajectory, and mistakes in it.

    >>> run = springcheck.simulate("spring", "own:euler")
    >>> springcheck.identify(run.t, run.q, v=run.p, mass=1.0).scheme
    'explicit-euler'

    Parameters
    ----------
    found
        Times t (f,) [T], a `Trajectory`, a DataFrame with columns t, q and p or v (t may be its index), the
        path of a file, or an integrator ``step(q, p, h, force, mass) -> (q, p)``.
    q, p, v
        Positions [L], and momenta [M L/T] or velocities [L/T], (f,) or (f, n), where `found` are times.
    mass, stiffness, friction, step
        Known values [M], [M/T2], [M/T] and [T]; `friction` is the c of a force -c v.

    Returns
    -------
    Identification
        `scheme`, `statement` and what was measured.  Of a file, a dict with one for each trajectory.

    Raises
    ------
    IdentificationError
        The states allow no answer: too few, at rest, or at uneven times.
    """
    from springcheck.identify import files
    from springcheck.identify.report import identify_arrays as of_states
    from springcheck.identify.stepper import identify_stepper

    answer = partial(files.of_springs, stated=stiffness is not None)
    if isinstance(found, str | Path):
        known = {"mass": mass, "stiffness": stiffness, "friction": friction, "step": step}
        with spoken():
            each = files.read(path_of(found))
            return {one.label: answer(files.identify_states(one, **known), one.whole) for one in each}
    if callable(found):
        return identify_stepper(found)
    t = found
    if isinstance(found, Trajectory):
        t, q, p = found.t, found.q, found.p
    elif hasattr(found, "to_numpy") and hasattr(found, "columns"):
        states = files.of_table(found)
        t, q, p, v = states.t, states.q, states.p, states.v
        mass = states.mass if mass is None else mass
    if t is None or q is None or (p is None and v is None):
        raise SpringcheckError("identify needs t, q and p (or v=), a Trajectory, a DataFrame or a path")
    given: dict[str, Any] = {"t": t, "q": q, "p": p, "v": v, "mass": mass,
             "stiffness": stiffness, "friction": friction, "step": step}  # fmt: skip
    given = {name: x for name, x in given.items() if x is not None}
    arrays = zip(given, reals("identify", **given), strict=True)
    numbers: dict[str, Any] = {name: x if x.ndim else x.item() for name, x in arrays}
    with spoken():
        return answer(of_states(**numbers), np.reshape(numbers["q"], (len(numbers["q"]), -1)))


@typed
def exact(scene: Scene | str | Path) -> Trajectory:
    """The exact solution at the frames of a scene, rounded to double precision.

    >>> springcheck.exact("spring").q[-1]
    array([0.91294525])

    Returns
    -------
    Trajectory
        t (f,) [T], q (f, n) [L] and p (f, n) [M L/T].

    Raises
    ------
    SpringcheckError
        The scene has no reference solution; the message says why.
    """
    found = scene_of(scene)
    if not solutions.has_true_motion(found):
        raise SpringcheckError(f"scene {found.name}: no reference solution: {solutions.no_reference(found)}")
    steps = np.arange(found.frames, dtype=np.int64) * found.every
    q, p = (np.asarray(x, np.float64) for x in solutions.true_motion(found, steps, found.step))
    return of_scene(found, q, p, label="exact", scheme="exact")


@typed
def read(path: str | Path) -> dict[str, Trajectory]:
    """Read the trajectories of a store.

    >>> springcheck.read("spring.h5")["own:euler"].q.shape  # doctest: +SKIP
    (201, 1)

    Returns
    -------
    dict of str to Trajectory
        By label.

    Raises
    ------
    StoreError
        The file cannot be read.
    """
    from springcheck.studies import keeper

    scene = keeper.stored_scene(path_of(path))
    return {label: replace(one, scene=scene) for label, one in keeper.read(path).items()}
