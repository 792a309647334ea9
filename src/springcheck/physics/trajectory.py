"""Results of runs: trajectories, comparisons and verdicts."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from springcheck.errors import SpringcheckError
from springcheck.physics.arguments import typed
from springcheck.physics.arrays import AS_WRITTEN, Arithmetic, Extended, Floats, reals, roundoff, told, worded

if TYPE_CHECKING:
    from springcheck.physics.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a run ended.  Only a `complete` one is a result."""

    status: Literal["complete", "diverged", "stopped", "continued"]
    """`continued`: a piece of a run that has further pieces."""
    step: int
    """Steps done with finite numbers."""
    message: str = ""
    fastest: float = float("inf")
    """The largest speed that the engine gives a body, where it stopped at that [L/T]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Seconds of wall clock: `start` until the engine is ready, `run` inside `advance` alone."""

    start: float = 0.0
    run: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Recorded states of one run: t (f,) [T], q (f, n) [L] and p (f, n) [M L/T]; row 0 is at the start."""

    label: str
    scheme: str
    t: Floats
    q: Floats
    p: Floats
    step: float
    every: int
    outcome: Outcome
    timing: Timing = Timing()
    force_calls: int = 0
    tolerance: float | None = None
    """Relative tolerance per step; None for a method of fixed step."""
    energy: Floats | None = None
    """Total energy of each frame, (f,) [M L2/T2]; None where the scene does not record it."""
    arithmetic: Arithmetic = field(default_factory=Arithmetic)
    rebuilds_velocity: bool = False
    off_axis: float | None = None
    """Largest magnitude of y or z [L], for engines in three dimensions."""
    origin: Mapping[str, str] = field(default_factory=dict)
    """Versions, platform, velocity convention and the like, as needed to repeat the run."""
    scene: Scene | None = None
    """The scene that was run, if known: `v` and `error` need it."""

    @classmethod
    @typed
    def from_arrays(
        cls,
        t: Any,
        q: Any,
        p: Any = None,
        *,
        v: Any = None,
        scene: Scene | None = None,
        mass: Any = None,
        scheme: str = "",
        label: str = "data",
        every: float = 1,
    ) -> Trajectory:
        """Make a trajectory from arrays of any program.

        >>> Trajectory.from_arrays([0, 0.1], q=[0, 0.1], v=[1, 0.99], mass=2.0).p[:, 0]
        array([2.  , 1.98])

        Parameters
        ----------
        t, q, p, v
            Times (f,) [T]; positions [L], and momenta [M L/T] or velocities [L/T], (f,) or (f, n).  Arrays of
            single precision are judged to their digits.
        scene
            Gives masses, step, `every`, the energies of these states, and the exact solution.
        mass
            One number or (n,) [M], which converts v to p.
        scheme, label, every
            The scheme to judge against, a name, and the number of steps between frames.

        Raises
        ------
        SpringcheckError
            Arrays whose shapes do not fit together, or without momenta and masses.
        """
        if p is None and v is None:
            raise SpringcheckError(f"{label}: momenta p or velocities v= are needed with t and q")
        m, every = (mass, every) if scene is None else (scene.m if mass is None else mass, scene.every)
        if p is None and m is None:
            raise SpringcheckError(f"{label}: velocities make momenta with mass= or scene=")
        if not 1 <= every <= 2**53 or every % 1:
            raise SpringcheckError(f"{label}: every = {every}: a whole number from 1 to 2**53 is needed")
        given = {"t": t, "q": q, "p or v": v if p is None else p, "mass": m if p is None else 1.0}
        time, where, speed, m = reals(label, **given)
        where, speed = (x[:, None] if x.ndim == 1 else x for x in (where, speed))
        shape = (*time.shape, scene.n if scene is not None else where.size // max(1, time.size))
        alike = time.ndim == 1 and where.shape == speed.shape == shape and m.shape in {(), (1,), shape[1:]}
        if not alike or not np.all(m > 0):
            raise SpringcheckError(
                f"{label}: t {time.shape}, q {where.shape}, p or v {speed.shape} and mass {m} do not fit "
                "together: (f,), (f, n), (f, n) and one number or (n,) above 0 are needed"
            )
        if scene is None and len(time) < 2:
            raise SpringcheckError(f"{label}: one frame has no step; two at least are needed, or scene=")
        steps = (len(time) - 1) * int(every)
        step = scene.step if scene is not None else float(time[-1] - time[0]) / steps
        more: Any = {"scene": scene, "outcome": Outcome(status="complete", step=steps)}
        unit = roundoff(q, *(x for x in (v, mass) if x is not None) if p is None else (p,))
        if unit > Arithmetic().state:
            more["arithmetic"] = Arithmetic(name=AS_WRITTEN, state=unit)
        made = cls(
            label=label, scheme=scheme, t=time, q=where, p=speed * m, step=step, every=int(every), **more
        )
        return made if scene is None else made.of_scene(scene)

    def of_scene(self, scene: Scene) -> Self:
        """The same with the energies of its states, where this scene asks for them, and with times in single
        precision as the whole steps of it that they are."""
        more: dict[str, Any] = {}
        t = np.rint(self.t / scene.step) * scene.step
        with np.errstate(all="ignore"):
            if self.energy is None and "energy" in scene.quantities:
                more["energy"] = np.asarray(scene.system.energy(self.q, self.p), np.float64)
            single = t.astype(np.float32)
        if np.any(self.t != t) and np.array_equal(self.t, single):
            more |= {"t": t, "step": scene.step}
        return replace(self, **more)

    @property
    def v(self) -> Floats:
        """Velocities p/m (f, n) [L/T].  SpringcheckError where no scene gives the masses."""
        return np.asarray(self.p / self._known.m)

    @property
    def _known(self) -> Scene:
        if self.scene is None:
            raise SpringcheckError(f"{self.label}: no scene is known; give one: from_arrays(..., scene=...)")
        return self.scene

    def error(self) -> Floats:
        """Distance from the exact solution (f,), relative to the initial energy norm.

        SpringcheckError for a scene without an exact solution."""
        scene = self._known
        if scene.system.solution is None:
            reason = scene.system.unsolved
            raise SpringcheckError(f"scene {scene.name}: no reference solution, because {reason}")
        q, p = self._exact(scene)
        return scene.system.norm(self.q - q, self.p - p)

    def _exact(self, scene: Scene) -> tuple[Extended, Extended]:
        """The exact solution at each frame.  SpringcheckError where a time is no whole number of steps."""
        from springcheck.physics import exact

        steps = np.rint(self.t / self.step)
        if not np.all(np.abs(self.t - steps * self.step) <= 1e-6 * abs(self.step)):
            raise SpringcheckError(f"{self.label}: times are not multiples of the step {self.step:g}")
        return exact.true_motion(scene, steps.astype(np.int64), self.step)

    def of_particle(self, particle: int) -> tuple[Floats, Floats]:
        """Its positions and momenta, (f,) each.  SpringcheckError where none has this number."""
        if particle not in range(-(n := self.q.shape[1]), n):
            raise SpringcheckError(f"{self.label}: particle = {particle}: one from 0 to {n - 1} is needed")
        return self.q[:, particle], self.p[:, particle]

    def at(self, rows: slice) -> Trajectory:
        """These frames alone."""
        energy = None if self.energy is None else self.energy[rows]
        return replace(self, t=self.t[rows], q=self.q[rows], p=self.p[rows], energy=energy)

    @typed
    def save(self, path: str | Path) -> Path:
        """Write t, q, p (and m, energy) as .csv or .npz, every double so that it reads back exactly.

        A .csv has columns t, q0, p0, q1 ..., energy, m0, m1 ...; `springcheck.identify` and the command read
        both.  A file of this name is replaced, once the new one is whole.  SpringcheckError where it cannot
        be written.
        """
        place, m = Path(path), None if self.scene is None else self.scene.m
        if place.suffix not in (".csv", ".npz"):
            raise SpringcheckError(f"{place}: a name that ends in .csv or .npz is needed")
        draft = place.parent / f"{place.name}.{os.urandom(8).hex()}"
        try:
            with draft.open("wb") as file:
                if place.suffix == ".npz":
                    more = {name: x for name, x in (("energy", self.energy), ("m", m)) if x is not None}
                    np.savez(file, allow_pickle=False, t=self.t, q=self.q, p=self.p, **more)
                else:
                    masses = {f"m{i}": np.full(len(self.t), x) for i, x in enumerate(() if m is None else m)}
                    columns = {"t": self.t, **self._columns, **masses}
                    rows = np.column_stack([*columns.values()])
                    np.savetxt(file, rows, "%.17g", ",", header=",".join(columns), comments="")
            draft.replace(place)
        except (OSError, ValueError) as error:
            with suppress(OSError, ValueError):
                draft.unlink(missing_ok=True)
            why = getattr(error, "strerror", None) or error
            raise SpringcheckError(f"{place}: cannot be written: {why}") from error
        return place

    @typed
    def plot(self, ax: Any = None, *, particle: int = 0) -> Any:
        """Phase portrait of one particle, over the exact solution where it is known -> its axes.

        `ax`: matplotlib axes of your own.  `springcheck.plot` draws several trajectories, and over time.
        """
        states = self.of_particle(particle)
        axes = library("matplotlib.pyplot").figure(layout="constrained").add_subplot() if ax is None else ax
        if self.scene is not None and self.scene.system.solution is not None:
            q, p = self._exact(self.scene)
            axes.plot(q[:, particle], p[:, particle], color="#b3b3b3", linewidth=4, label="exact")
        axes.plot(*states, label=self.label)
        axes.set(xlabel="q", ylabel="p", title=f"{self.label}: phase portrait of {len(self.t)} frames")
        axes.legend()
        return axes

    def __repr__(self) -> str:
        n = self.q.shape[1] if self.q.ndim == 2 else 1
        size = f"{len(self.t)} frame{'s' if len(self.t) != 1 else ''}, {n} particle{'s' if n != 1 else ''}"
        span = f", t = {self.t[0]:g} to {self.t[-1]:g}" if len(self.t) else ""
        return f"Trajectory({self.label!r}, {size}{span}, {self.outcome.status})"

    @property
    def _columns(self) -> dict[str, Floats]:
        """Columns (f,) q0, p0, q1 ..., and energy where it is recorded."""
        states = {f"{name}{i}": getattr(self, name)[:, i] for i in range(self.q.shape[1]) for name in "qp"}
        return states if self.energy is None else {**states, "energy": self.energy}

    def to_dataframe(self) -> Any:
        """A pandas DataFrame: a row for each frame, columns q0, p0, q1 ..., energy if recorded; index t."""
        return library("pandas").DataFrame({"t": self.t, **self._columns}).set_index("t")

    def to_xarray(self) -> Any:
        """An xarray Dataset: q and p over t and particle, energy over t if recorded."""
        kept: dict[str, Any] = {name: (("t", "particle"), getattr(self, name)) for name in ("q", "p")}
        kept |= {} if self.energy is None else {"energy": ("t", self.energy)}
        about = {"method": self.label, "scheme": self.scheme, "step": self.step}
        coordinates = {"t": self.t, "particle": range(self.q.shape[1])}
        return library("xarray").Dataset(kept, coords=coordinates, attrs=about)


def html_table(title: str, rows: Iterable[Sequence[str]]) -> str:
    """Rows of cells, the first of them the titles, under a line of text."""
    from html import escape

    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<p>{escape(title)}</p><table>{body}</table>"


def library(name: str) -> Any:
    """Import a library for a single feature.  SpringcheckError where it is not installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise SpringcheckError(
            f"{name} is not installed; install it with: python -m pip install {name}"
        ) from None


def of_scene(scene: Scene, q: Floats, p: Floats, **more: Any) -> Trajectory:
    """States (f, n) at the frames of a scene from its start on, complete unless `more` says otherwise."""
    known: dict[str, Any] = {"outcome": Outcome(status="complete", step=scene.steps), "scene": scene, **more}
    t = np.arange(len(q), dtype=np.float64) * scene.every * scene.step
    return Trajectory(t=t, q=q, p=p, step=scene.step, every=scene.every, **known)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """Largest difference of each pair of trajectories over all frames, (l, l), symmetric.

    Relative to the initial energy norm (`Norm`); NaN where one of the two runs did not complete.
    """

    labels: tuple[str, ...]
    max_difference: Floats

    def __repr__(self) -> str:
        known = self.max_difference[np.tril_indices(len(self.labels), -1)]
        largest = np.max(known, where=~np.isnan(known), initial=-np.inf)
        said = f"differences up to {largest:.3g}" if largest >= 0 else "no two runs to compare"
        if largest >= 0 and np.any(np.isnan(known)):
            said += " between those that are complete"
        return f"Comparison of {', '.join(self.labels)}: {said}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The relative change of each quantity from which on a check fails; None where the check is blind."""

    stiffness: float | None = told("stiffness {:.1e}")
    """Relative change of the spring, or other potential's row, with the largest such limit."""
    step: float | None = told("step {:.1e}")
    friction: float | None = told("friction {:.1e}")
    """Relative change of the friction on one particle."""
    area: float | None = told("phase-space area per step {:.1e}")
    """Relative change of every particle's phase-space area a step: its momentum is multiplied by 1 + x."""
    reaction: float | None = told("reaction {:.1e}")
    """Relative excess of the force on one particle over its reactions on the others."""
    order: float | None = told("order or exponent {:.1e}")
    """Absolute change of an order or an exponent."""
    amplitude: float | None = told("amplitude of a drive {:.1e}")
    """Relative change of a drive's amplitude: the largest such limit."""
    frequency: float | None = told("frequency of a drive {:.1e}")
    """Relative change of the frequency of a drive."""
    phase: float | None = told("phase of a drive {:.1e} rad")
    """Change of the phase of a drive, in radians."""
    late: float | None = told("delay of a drive {:.1e} steps")
    """Delay of a drive, in steps."""
    temperature: float | None = told("noise temperature {:.1e}")
    """Relative change of the temperature of a bath's noise, seen in 19 runs of 20."""

    def __str__(self) -> str:
        """The limits in words; "" where all are None."""
        return f"smallest detectable errors: {said}" if (said := worded(self)) else ""

    @classmethod
    def least(cls, several: Iterable[Limits]) -> Limits:
        """The smallest limits among several checks, or among pieces of a run that one check has judged."""
        every, names = list(several), [of.name for of in fields(cls)]
        known = {name: [x for one in every if (x := getattr(one, name)) is not None] for name in names}
        return cls(**{name: min(x, default=None) for name, x in known.items()})


NOT_KNOWN = Limits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One number and its bound.  Where the check does not apply, `passed` is None and both are NaN."""

    method: str
    check: str
    value: float
    bound: float
    unit: str
    passed: bool | None
    why: str
    """The bound's reason, or why the check does not apply."""
    sees: Limits = NOT_KNOWN
    """Detection limits: the smallest errors that the check would have reported in this run."""
    statistic: Any = field(default=None, compare=False, repr=False)
    """Of a random verdict the statistic (`bath.evidence`) where it adds up over pieces of a run; it is in no
    document and no pickle."""

    @property
    def stated(self) -> dict[str, Any]:
        """What documents state of it, by name."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name != "statistic"}

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Verdict, **self.stated), ()

    @property
    def reason(self) -> str:
        """The reason, and the detection limits."""
        # what is identified is known to the digits of the states
        counted = self.bound == 0 and self.check != "identified"
        exact = "any other value would fail" if self.passed and counted else ""
        return "; ".join(filter(None, (self.why, str(self.sees) or exact)))

    def __repr__(self) -> str:
        if self.passed is None:
            return f"Verdict({self.method} {self.check}: not applicable, {self.why})"
        outcome = "passed" if self.passed else "FAILED"
        size = f"{self.value:.3g} of {self.bound:.3g} {self.unit}".rstrip()
        return f"Verdict({self.method} {self.check}: {outcome}, {size})"
