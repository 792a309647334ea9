"""Functions that run, judge, compare and identify: of a scene, a trajectory or a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
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
    """Run a scene by several methods, compare and judge them, as `springcheck run` does.

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
        Seed of random methods.
    scheme
        The scheme that functions are judged against; by default the one that their states show.

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
    """Run a scene by one method.

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
        The scheme that a function is judged against; by default the one that its states show.

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
    """Judge a trajectory of a scene by all checks.

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
        Frames of another shape than the scene's, or no step, or no scheme.
    """
    found, run = scene_of(scene), trajectory
    if not run.scheme:
        raise SpringcheckError(
            f"{run.label}: identify(trajectory, mass=...) says which scheme its states show; judge it "
            "by that or by its own, as Trajectory.from_arrays(..., scheme='velocity-verlet')"
        )
    frames = len(run.t)
    shapes = {"t": (frames,), "q": (frames, found.n), "p": (frames, found.n), "energy": (frames,)}
    for name, shape in shapes.items():
        values = getattr(run, name)
        kind = getattr(values, "dtype", None)
        if values is not None and (kind is None or kind.kind != "f"):
            given = f"an array of {kind}" if kind is not None else f"a {type(values).__name__}"
            raise SpringcheckError(
                f"{run.label}: {name} is {given}; an array of floating-point numbers is needed"
            )
        if values is not None and (np.shape(values) != shape or not frames):
            raise SpringcheckError(
                f"{run.label}: {name} has the shape {np.shape(values)}; the times of scene {found.name} "
                f"need {shape}, and one at least"
            )
    if run.every < 1 or run.step == 0:
        raise SpringcheckError(f"{run.label}: every = {run.every} by step = {run.step:g} lie no frames apart")
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

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    trajectories
        Trajectories by name, or a sequence of them with distinct labels.

    Returns
    -------
    Comparison
        Largest difference of every pair, relative to the initial energy norm.
    """
    runs: Any = trajectories if isinstance(trajectories, Sequence | Mapping) else [trajectories]
    each = runs.items() if isinstance(runs, Mapping) else [(getattr(x, "label", ""), x) for x in runs]
    named = {label: needed(one, Trajectory, "a Trajectory") for label, one in each}
    if len(named) < max(1, len(runs)):
        raise SpringcheckError(
            "compare needs trajectories of unlike labels, or a dict of them by other names"
        )
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
    """Identify the scheme that made a trajectory, and its errors.

    Parameters
    ----------
    found
        Times t (f,) [T], a `Trajectory`, a DataFrame with columns t, q and p or v (t may be its index), the
        path of a file, or an integrator ``step(q, p, h, force, mass) -> (q, p)``.
    q, p, v
        Positions, and momenta or velocities, (f,) or (f, n), where `found` are times.
    mass, stiffness, friction, step
        Stated values; `friction` is the c of a force -c v.

    Returns
    -------
    Identification
        Of a file, a dict with one for each of its trajectories, by label.

    Raises
    ------
    IdentificationError
        The states do not show a scheme.
    """
    from springcheck.identify import files
    from springcheck.identify.report import identify_arrays as of_states
    from springcheck.identify.stepper import identify_stepper

    if isinstance(found, str | Path):
        stated = {"mass": mass, "stiffness": stiffness, "friction": friction, "step": step}
        with spoken():
            return {
                one.label: files.of_springs(
                    files.identify_states(one, **stated), one.whole, stated=stiffness is not None
                )
                for one in files.read(path_of(found))
            }
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
        raise SpringcheckError(
            "identify needs t, q and p (or v=), a Trajectory, a DataFrame, or the path of a file"
        )
    given: dict[str, Any] = {"t": t, "q": q, "p": p, "v": v, "mass": mass,
             "stiffness": stiffness, "friction": friction, "step": step}  # fmt: skip
    given = {name: x for name, x in given.items() if x is not None}
    arrays = zip(given, reals("identify", **given), strict=True)
    numbers: dict[str, Any] = {name: x if x.ndim else x.item() for name, x in arrays}
    with spoken():
        told = of_states(**numbers)
        whole = np.reshape(numbers["q"], (len(numbers["q"]), -1))
        return files.of_springs(told, whole, stated=stiffness is not None)


@typed
def exact(scene: Scene | str | Path) -> Trajectory:
    """The exact solution at the frames of a scene, rounded to double precision.

    Returns
    -------
    Trajectory
        t (f,) [T], q (f, n) [L] and p (f, n) [M L/T].

    Raises
    ------
    SpringcheckError
        There is no reference solution.
    """
    found = scene_of(scene)
    if not solutions.has_true_motion(found):
        reason = solutions.no_reference(found)
        raise SpringcheckError(f"scene {found.name}: no reference solution, because {reason}")
    steps = np.arange(found.frames, dtype=np.int64) * found.every
    q, p = (np.asarray(x, np.float64) for x in solutions.true_motion(found, steps, found.step))
    return of_scene(found, q, p, label="exact", scheme="exact")


@typed
def read(path: str | Path) -> dict[str, Trajectory]:
    """Read the trajectories of a store.

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
