"""What runs yield: trajectories, and what is said of them: comparisons and verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from springcheck.errors import SpringcheckError
from springcheck.physics.arrays import Arithmetic, Floats

if TYPE_CHECKING:
    from springcheck.physics.scene import Scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How a run ended.  Nothing that is not `complete` passes for a result."""

    status: Literal["complete", "diverged", "stopped", "continued"]
    """`continued`: a piece of a run that goes on after it."""
    step: int
    """Steps done with finite numbers."""
    message: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Seconds of wall clock: `start` until the engine stands ready, `run` inside `advance` alone."""

    start: float = 0.0
    run: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Recorded states of one run: row i of q and p belongs to t[i]; row 0 is the start."""

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
    """Total energy of each frame, (f,) [M L2/T2]; None where the scene asks for none."""
    arithmetic: Arithmetic = field(default_factory=Arithmetic)
    rebuilds_velocity: bool = False
    off_axis: float | None = None
    """Largest |y| or |z| seen, for engines in three dimensions."""
    origin: Mapping[str, str] = field(default_factory=dict)
    """Versions, platform, velocity convention and the like: what a reader needs to repeat the run."""

    def __repr__(self) -> str:
        n = self.q.shape[1] if self.q.ndim == 2 else 1
        size = f"{len(self.t)} frames, {n} particle{'s' if n != 1 else ''}"
        span = f", t = {self.t[0]:g} to {self.t[-1]:g}" if len(self.t) else ""
        return f"Trajectory({self.label!r}, {size}{span}, {self.outcome.status})"

    def _repr_html_(self) -> str:
        """A small table for notebooks: what it is, its first and its last frame."""
        rows = [("frame", "t", "q", "p")]
        shown = sorted({0, len(self.t) - 1}) if len(self.t) else []
        rows += [(str(i), f"{self.t[i]:g}", _few(self.q[i]), _few(self.p[i])) for i in shown]
        return _table(repr(self), rows)

    def to_dataframe(self) -> Any:
        """A pandas DataFrame: a row a frame, columns q0, p0, q1 ... and energy where it was kept; index t."""
        pandas = _library("pandas")
        columns: dict[str, Floats] = {}
        for i in range(self.q.shape[1]):
            columns |= {f"q{i}": self.q[:, i], f"p{i}": self.p[:, i]}
        if self.energy is not None:
            columns["energy"] = self.energy
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Any:
        """An xarray Dataset: q and p over t and particle, energy over t where it was kept."""
        xarray = _library("xarray")
        kept = {name: (("t", "particle"), getattr(self, name)) for name in ("q", "p")}
        if self.energy is not None:
            kept["energy"] = (("t",), self.energy)  # type: ignore[assignment]
        about = {"method": self.label, "scheme": self.scheme, "step": self.step}
        coordinates = {"t": self.t, "particle": range(self.q.shape[1])}
        return xarray.Dataset(kept, coords=coordinates, attrs=about)


def _table(title: str, rows: Iterable[Sequence[str]]) -> str:
    from html import escape

    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<p>{escape(title)}</p><table>{body}</table>"


def _few(values: Floats) -> str:
    text = ", ".join(f"{x:.6g}" for x in values[:3])
    return text + (" ..." if len(values) > 3 else "")


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise SpringcheckError(
            f"{name} is not installed; install it with: python -m pip install {name}"
        ) from None


def of_scene(scene: Scene, q: Floats, p: Floats, **more: Any) -> Trajectory:
    """States (f, n) at the frames of a scene from its start on, complete unless `more` says otherwise."""
    known: dict[str, Any] = {"outcome": Outcome(status="complete", step=scene.steps), **more}
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
        return f"Comparison of {', '.join(self.labels)}: differences up to {self.max_difference.max():.3g}"

    def _repr_html_(self) -> str:
        """The differences as a table for notebooks."""
        rows = zip(self.labels, self.max_difference, strict=True)
        cells = [(label, *(f"{x:.1e}" for x in row)) for label, row in rows]
        return _table(repr(self), [("", *self.labels), *cells])


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The relative change of each quantity from which on a check fails; None where it says nothing of it."""

    stiffness: float | None = None
    """Of the spring, or row of another potential, that shows least of those that show at all."""
    step: float | None = None
    friction: float | None = None
    """Of the friction on one particle, likewise."""
    area: float | None = None
    """Of every particle's area in phase space at each step: its momentum is multiplied by 1 + x."""
    reaction: float | None = None
    """Of the force on one particle beside its reactions on the others."""
    order: float | None = None
    """Of an order or an exponent, absolute."""

    def __str__(self) -> str:
        """The same in words, or nothing."""
        said = [words.format(x) for name, words in _SEEN.items() if (x := getattr(self, name)) is not None]
        return f"would see {', '.join(said)}" if said else ""

    @classmethod
    def least(cls, several: Iterable[Limits]) -> Limits:
        """Of several checks, or of one on several pieces of a run, that of the one that sees most."""
        every = list(several)
        known = {name: [x for one in every if (x := getattr(one, name)) is not None] for name in _SEEN}
        return cls(**{name: min(x, default=None) for name, x in known.items()})


_SEEN = {
    "stiffness": "a stiffness off by {:.1e}",
    "step": "a step off by {:.1e}",
    "friction": "a friction off by {:.1e}",
    "area": "an area in phase space off by {:.1e} a step",
    "reaction": "a force off its reaction by {:.1e}",
    "order": "an order or exponent off by {:.1e}",
}

NOT_KNOWN = Limits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """One number against one bound.  `passed` is None where the check does not apply.

    Value and bound are finite numbers wherever a check applies, and NaN where it does not.
    """

    method: str
    check: str
    value: float
    bound: float
    unit: str
    passed: bool | None
    why: str
    """The bound's reason, or why the check does not apply."""
    sees: Limits = NOT_KNOWN
    """What the check would have seen in this run."""

    @property
    def reason(self) -> str:
        """Why, and what the check would have seen."""
        exact = "would see any other value" if self.passed and self.bound == 0 else ""
        return "; ".join(filter(None, (self.why, str(self.sees) or exact)))

    def __repr__(self) -> str:
        if self.passed is None:
            return f"Verdict({self.method} {self.check}: not applicable, {self.why})"
        outcome = "passed" if self.passed else "FAILED"
        size = f"{self.value:.3g} of {self.bound:.3g} {self.unit}".rstrip()
        return f"Verdict({self.method} {self.check}: {outcome}, {size})"
