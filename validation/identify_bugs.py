"""Claim: of 40 bugs that people reported in public, `identify` says the cause of most, and nothing false.

    python validation/identify_bugs.py [SHARE]

Each bug is rebuilt from the facts of its thread as a step of a few lines, with uneven numbers, and written as
CSV of 17 digits.  `springcheck identify` gets that file with what its user would know.  Its first sentence is

    right    it matches the words of the cause
    short    it does not, and claims nothing: an honest "none", or a class of methods
    FALSE    it names a scheme or claims a cause that is not so

What a sentence claims is read as in `identify_corpus.py`.  SHARE is the part that is run, drawn by the names.
Of the 40, FIGURES.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from identify_corpus import claims
from springcheck.cli import main as command
from springcheck.physics.arrays import Floats

M, K, C, H = 2.3, 5.9, 0.37, 0.083
W2, FRAMES = K / M, 300
States = tuple[Any, Any, Any]
Step = Callable[[Any, Any], tuple[Any, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bug:
    """A bug: its thread, how it steps, and what is right to say of it."""

    name: str
    source: str
    states: Callable[[], States]
    says: str
    """What the first sentence has to match."""
    true: str = ""
    """Keys of `identify_corpus.CLAIMS` that are true of it."""
    told: dict[str, Any] = field(default_factory=lambda: {"mass": M, "stiffness": K})
    """Options of the command."""


def stepped(step: Step, h: float = H, frames: int = FRAMES, q: Any = 0.7, v: Any = -0.4) -> States:
    """Times, positions and velocities of frames a step apart."""
    each = [(q, v)]
    for _ in range(frames - 1):
        each.append(step(*each[-1]))
    return np.arange(frames) * h, *(np.array([x[i] for x in each], np.float64) for i in (0, 1))


def verlet(h: float = H, w2: float = W2) -> Step:
    """The right step of velocity Verlet."""

    def step(q: Any, v: Any) -> tuple[Any, Any]:
        half = v - h / 2 * w2 * q
        return q + h * half, half - h / 2 * w2 * (q + h * half)

    return step


def euler(h: float = H, w2: float = W2) -> Step:
    """The right step of semi-implicit Euler."""
    return lambda q, v: (q + h * (v - h * w2 * q), v - h * w2 * q)


def tableau(a: Any, b: Any, h: float = H, stage: float = H) -> Step:
    """A Runge-Kutta step, whose stages take steps of their own."""
    *rows, weights = ([float(Fraction(x)) for x in row] for row in (*a, b))

    def step(q: Any, v: Any) -> tuple[Any, Any]:
        y, slopes = np.array([q, v]), [np.array([v, -W2 * q])]
        for row in rows:
            z = y + stage * sum(x * k for x, k in zip(row, slopes, strict=True))
            slopes.append(np.array([z[1], -W2 * z[0]]))
        return tuple(y + h * sum(x * k for x, k in zip(weights, slopes, strict=True)))

    return step


RK4 = (("1/2",), (0, "1/2"), (0, 0, 1)), ("1/6", "1/3", "1/3", "1/6")


def _gravity(r: Any) -> Any:
    return -1.5 / 0.7 * r / np.sqrt(r @ r) ** 3


def _orbit(step: Step) -> States:
    return stepped(step, 0.02, q=np.array([1.0, 0.0]), v=np.array([0.0, 1.7928429140015905]))


def _old_force_on_an_orbit(q: Any, v: Any) -> Any:
    return q + 0.02 * v + 0.02**2 / 2 * _gravity(q), v + 0.02 * _gravity(q)


def _softened(q: Any, v: Any) -> Any:
    v = v - 0.02 * 1.5 / 0.7 * q / (q @ q + 0.1) ** 1.5
    return q + 0.02 * v, v


def _forces_add_up() -> States:
    force = 0.0

    def step(q: Any, v: Any) -> Any:
        nonlocal force
        force -= K * q
        v += H * force / M
        return q + H * v, v

    return stepped(step, frames=200)


def _friction_of_each_substep(q: Any, v: Any) -> Any:
    for _ in range(4):
        v -= H / 4 * W2 * q
        q += H / 8 * v
        v *= np.exp(-C / M * H)
        q += H / 8 * v
    return q, v


def _uneven_dumps() -> States:
    t, q, v = stepped(verlet(0.0083), 0.0083, 3001)
    kept = np.r_[0:1500:10, 1500:3001:15]
    return t[kept], q[kept], v[kept]


def _time_in_single() -> States:
    _, q, v = stepped(euler(0.3), 0.3)
    t = [np.float32(21000)]
    for _ in q[1:]:
        t.append(t[-1] + np.float32(0.3))
    return np.array(t, np.float64), q, v


def _drive_at_the_start_of_the_step() -> States:
    def slope(y: Any, t: float) -> Any:
        return np.array([y[1], (-2.9 * y[0] - 0.11 * y[1] + 0.43 * np.cos(0.87 * t + 0.6)) / 3.7])

    y, each = np.array([0.3, 0.7 / 3.7]), []
    for n in range(FRAMES):
        each.append(y)
        k1 = slope(y, n * 0.1)
        k2 = slope(y + 0.05 * k1, n * 0.1)
        k3 = slope(y + 0.05 * k2, n * 0.1)
        y = y + 0.1 / 6 * (k1 + 2 * k2 + 2 * k3 + slope(y + 0.1 * k3, n * 0.1))
    return np.arange(FRAMES) * 0.1, *np.array(each).T


def _clipped(q: Any, v: Any) -> Any:
    v = v - 0.05 * 13.7 * np.sin(q)
    return q + 0.05 * v, np.clip(v, -5.0, 5.0)


def _uncorrected() -> States:
    steps = np.random.default_rng(3).choice([0.041, 0.083, 0.059], FRAMES - 1)
    q = [0.7, 0.67]
    for h in steps[1:]:
        q.append(2 * q[-1] - q[-2] - h**2 * W2 * q[-1])
    return np.append(0, np.cumsum(steps)), np.array(q), None


def _rk4_of_one_number(q: Any, v: Any) -> Any:
    h = 0.11

    def change(f: float) -> float:
        k = h * f, h * (f + h / 2), h * (f + h / 2), h * (f + h)
        return (k[0] + 2 * k[1] + 2 * k[2] + k[3]) * h / 6

    return q + change(v), v + change(-W2 * q)


def _overwritten_stages() -> Step:
    rows = ("1/3", "2/3", "-1/12", "15/8", "1/10", "80/39")
    b = ("13/200", 0, "11/40", "11/40", "4/25", "4/25", "13/200")
    return tableau([(*[0] * i, x) for i, x in enumerate(rows)], b)


def _swapped_composition(q: Any, v: Any) -> Any:
    root = np.sqrt(19)
    a = (14 - root) / 108, (-23 - 20 * root) / 270, 1 / 5, (-2 + 10 * root) / 135, (146 + 5 * root) / 540
    for x, y in zip(a[::-1], a, strict=True):
        # a flow is a kick and a drift, its adjoint a drift and a kick
        v = v - x * H * W2 * q
        q = q + (x + y) * H * v
        v = v - y * H * W2 * q
    return q, v


def _pair(reaction: float, step: str) -> States:
    def push(q: Any) -> Any:
        force = 3.1 * (q[1] - q[0])
        return (np.array([force, reaction * force]) - np.array([K, 4.3]) * q) / M

    def euler(q: Any, v: Any) -> Any:
        return q + H * (v + H * push(q)), v + H * push(q)

    def verlet(q: Any, v: Any) -> Any:
        half = v + H / 2 * push(q)
        return q + H * half, half + H / 2 * push(q + H * half)

    which = euler if step == "euler" else verlet
    return stepped(which, frames=200, q=np.array([0.7, -0.2]), v=np.array([-0.4, 0.3]))


def _one_particle_after_the_other() -> States:
    def push(q: Any, j: int) -> float:
        return float((3.1 * (q[1 - j] - q[j]) - (K, 4.3)[j] * q[j]) / M)

    def step(q: Any, v: Any) -> Any:
        x, u, kq, kv = q.copy(), v.copy(), np.zeros((4, 2)), np.zeros((4, 2))
        for s, part in enumerate((0.5, 0.5, 1.0, 0.0)):
            for j in range(2):
                kq[s, j], kv[s, j] = H * u[j], H * push(x, j)
                x[j], u[j] = q[j] + part * kq[s, j], v[j] + part * kv[s, j]
        w = np.array([1, 2, 2, 1]) / 6
        return q + w @ kq, v + w @ kv

    return stepped(step, q=np.array([0.7, -0.2]), v=np.array([-0.4, 0.3]))


def _no_square(q: Any, v: Any) -> Any:
    after = q + H * v
    return after, v - H / 2 * W2 * (q + after)


def _held(q: Any, v: Any) -> Any:
    force = -W2 * q
    for _ in range(4):
        v += H / 4 * force
        q += H / 4 * v
    return q, v


def _kepler(step: Step) -> dict[str, Any]:
    return {"states": lambda: _orbit(step), "told": {"scene": "kepler"}}


def _of(step: Step, **given: Any) -> Callable[[], States]:
    return lambda: stepped(step, **given)


def _then(step: Step, change: Callable[[Any, Any, Any], States], **given: Any) -> Callable[[], States]:
    return lambda: change(*stepped(step, **given))


def _factor(factor: float, source: str, says: str) -> dict[str, Any]:
    return {"source": source, "states": _of(verlet(w2=factor * W2)), "says": says, "true": "stiffness unit"}


def _speeds(factor: float, source: str, says: str) -> dict[str, Any]:
    return {
        "source": source, "states": _then(verlet(), lambda t, q, v: (t, q, factor * v)), "says": says,
        "true": "scale unit",
    }  # fmt: skip


def _two_schemes(t: Any, q: Any, v: Any) -> States:
    _, x, u = stepped(tableau(*RK4), q=q[150], v=v[150])
    return t, np.append(q[:150], x[:150]), np.append(v[:150], u[:150])


def _game_loop() -> States:
    waits = np.random.default_rng(5).choice([0.0125, 0.016, 0.025, 0.04], FRAMES - 1)
    q, v = [0.7], [-0.4]
    for wait in waits:
        x, u = euler(min(wait, 1 / 60), 25.0)(q[-1], v[-1])
        q.append(x)
        v.append(u)
    return np.append(0, np.cumsum(waits)), np.array(q), np.array(v)


def _both(x: Any, at: int) -> Any:
    return np.insert(x, at, x[at])


def _midpoint(q: Any, v: Any) -> Any:
    for _ in range(2):
        q, v = q + H / 2 * v, v - H / 2 * W2 * q
    return q, v


def _restarted(t: Any, q: Any, v: Any) -> States:
    kept = np.r_[0:181, 161:FRAMES]
    return np.arange(len(kept)) * H, q[kept], v[kept]


FORUM = "scicomp.stackexchange.com"
BUGS = (
    Bug(name="both half steps of a midpoint rule are added up", source="NVIDIA/cuda-quantum#3720",
        states=_of(_midpoint), says="explicit Euler, 2 steps"),
    Bug(name="the planet leaves its orbit", source=f"{FORUM}: Using velocity Verlet for N bodies",
        says="old force", true="kicks", **_kepler(_old_force_on_an_orbit)),
    Bug(name="why is my spring exploding", source="gamedev.stackexchange.com/questions/209104",
        states=_of(lambda q, v: (q + H * v - H**2 / 2 * K * q, v - H * K * q)), says="old force.*(mass|2.3)",
        true="kicks stiffness mass"),
    Bug(name="the position moves by the old velocity", source="chenglou/react-motion#39",
        states=_of(lambda q, v: (q + 0.0167 * v, v - 0.0167 * (120 * q + 8 * v) / 1.3), h=0.0167, frames=200),
        says="^explicit Euler", told={"mass": 1.3, "stiffness": 120, "friction": 8}),
    Bug(name="forces are never cleared", source="anthonytorlucci/rlevo#98", states=_forces_add_up,
        says="forces add up"),
    Bug(name="the mean velocity lacks its factor 1/2", source="andreadelprete/consim#14",
        states=_of(lambda q, v: (q + H * (v - H * W2 * q), v - H * W2 * q)), says="^semi-implicit Euler", true="late"),
    Bug(name="friction in every substep", source="openmm/openmm#3790", states=_of(_friction_of_each_substep),
        says=r"friction 4(\.0*)? times", true="friction late", told={"mass": M, "stiffness": K, "friction": C}),
    Bug(name="kJ for kcal, and k for k/2", **_factor(2 * 4.184, "paduagroup/clandp#15", r"8\.368 times")),
    Bug(name="a factor of 20 in a bond", **_factor(20, "openforcefield/smarty#38", "20 times")),
    Bug(name="AMBER's velocities", **_speeds(20.455, "OpenBioSim/sire#78", r"20\.455|AMBER")),
    Bug(name="femtoseconds twice", **_speeds(1 / 10.180505710759414, "SPARC-X/SPARC-X-API#67", "10.18|ASE")),
    Bug(name="frames at uneven times", source="ISISNeutronMuon/MDANSE#1219", states=_uneven_dumps,
        says="not at a constant interval|uneven", true="clock"),
    Bug(name="time in single precision", source="erf-model/ERF#3161", states=_time_in_single,
        says=r"times are 1\.002", true="step scale"),
    Bug(name="backwards with the size of the step", source="ben-cassese/jorbit#85",
        states=_then(verlet(), lambda t, q, v: (-t, q, v)), says="wrong sign", true="step scale"),
    Bug(name="the time is doubled", source="OPALX-project/OPAL#1375",
        states=_then(verlet(), lambda t, q, v: (2 * t, q, v)), says="times are 2 times", true="step scale"),
    Bug(name="stages at the start of the step", source="probabilistic-numerics/probnum#252",
        states=_drive_at_the_start_of_the_step, says="time of the drive|drive is taken", told={"scene": "driven-spring"}, true="time"),
    Bug(name="a limit after the position has moved", source="openai/gym#2156",
        states=_of(_clipped, h=0.05, q=2.5, v=1.0), says="velocity is clipped at 5", told={},
        true="anharmonic"),
    Bug(name="a factor per frame for a damping ratio", source="subinium/SuperLightTUI#124",
        states=_of(lambda q, v: (q + 0.85 * (v - 0.13 * q), 0.85 * (v - 0.13 * q)), h=1.0, frames=200),
        says=r"friction [^,]* times the stated", told={"mass": 1, "stiffness": 0.13, "friction": 1.7 * 0.13**0.5},
        true="friction"),
    Bug(name="damping without the step", source="idanarye/bevy-tnua#3",
        states=_of(lambda q, v: (q + H * (v - H * W2 * q - C / M * v), v - H * W2 * q - C / M * v), frames=200),
        says=r"friction 12[^,]* times the stated", told={"mass": M, "stiffness": K, "friction": C}, true="friction"),
    Bug(name="velocities in lengths per step", source="liabru/matter-js#637",
        states=_then(euler(), lambda t, q, v: (t, q, H * v)), says="displacements", true="scale"),
    Bug(name="Verlet with a step that varies", source="soulwire/Coffee-Physics#2", states=_uncorrected,
        says="moved on by the last displacement", true="step"),
    Bug(name="RK4 of position and velocity by themselves", source=f"{FORUM}/questions/28163",
        states=_of(_rk4_of_one_number, h=0.11), says="explicit Euler.*step", true="step scale constant"),
    Bug(name="half a step in the last stage", source=f"{FORUM}/questions/3110",
        states=_of(tableau((("1/2",), (0, "1/2"), (0, 0, "1/2")), RK4[1])), says="fourth stage takes half",
        true="stage late"),
    Bug(name="stages that are overwritten", source="openrocket/openrocket#3013",
        states=_of(_overwritten_stages()), says="one-step method (of order \\d, )?not known here"),
    Bug(name="flow and adjoint exchanged", source="JuliaGNI/GeometricIntegrators.jl#220",
        states=_of(_swapped_composition), says="order 2, not known here"),
    Bug(name="a softened orbit turns", source="landgreen/landgreen.github.io#5", says="soft|other forces?",
        **_kepler(_softened)),
    Bug(name="the reaction with the wrong sign", source="newton-physics/newton#880",
        states=lambda: _pair(1, "euler"), says="reaction has the wrong sign", told={"mass": M}),
    Bug(name="no reaction", source="simbody/simbody#720", states=lambda: _pair(0, "verlet"),
        says="reaction is missing", told={"mass": M}),
    Bug(name="forces without the mass", source="jax-md/jax-md#145", states=_of(verlet(w2=K)), says="mass",
        true="mass stiffness"),
    Bug(name="0*5 for 0.5", source="psi4/psi4numpy#103", states=_of(_no_square), says=r"without h\*\*2/2"),
    Bug(name="stages without h", source="cfgnunes/numerical-methods-matlab#1",
        states=_of(tableau(*RK4, stage=1.0)), says="no h in its stages", true="stage"),
    Bug(name="frames that are one object", source="prody/ProDy#1661",
        states=_then(verlet(), lambda t, q, v: (t, 0 * q + q[-1], 0 * v + v[-1])), says="one state|same"),
    Bug(name="frames after the checkpoint stay", source="Psivant/femto#32",
        states=_then(verlet(), _restarted), says="restart", true="frames"),
    Bug(name="another integrator in the middle", source="alvinng4/grav_sim#2",
        states=_then(verlet(), _two_schemes), says="from frame 1[45]|velocity Verlet.*RK4", true="frames"),
    Bug(name="velocities are written as 0", source="deepmodeling/abacus-develop#575",
        states=_then(verlet(), lambda t, q, v: (t, q, 0 * v)), says="velocit(y is|ies are).* 0"),
    Bug(name="a largest step", source="pmndrs/cannon-es#16", states=_game_loop, says="but the step taken is",
        told={"mass": 1.3, "stiffness": 32.5}, true="step"),
    Bug(name="a frame twice, with its time", source="TomWagg/cogsworth#90",
        states=_then(verlet(), lambda t, q, v: (_both(t, 120), _both(q, 120), _both(v, 120))),
        says="(frame|line|row).*(12[01]|twice|repeated)", true="frames clock"),
    Bug(name="RK4 of one particle after the other", source="anderkve/FYS3150#73",
        states=_one_particle_after_the_other, says="after the other|not opposite", told={"mass": M}, true="coupled"),
    Bug(name="a h for a h**2", source="gamedev.net: Verlet Integration Problem (2012)",
        states=_of(lambda q, v: (q + H * (v - W2 * q), v - W2 * q)), says="step is left out",
        true="stiffness step"),
    Bug(name="world forces once for all substeps", source="GabrieleGiuseppini/Floating-Sandbox#27",
        states=_of(_held), says="one force for 4 substeps"),
)  # fmt: skip


def said(bug: Bug) -> tuple[str, bool]:
    """The first sentence of the command, or its refusal, and whether it names a scheme."""
    t, q, v = bug.states()
    n = 1 if q.ndim == 1 else q.shape[1]
    names = ["t", *(f"x{i}" for i in range(n)), *(f"v{i}" for i in range(n) if v is not None)]
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(out):
        file = Path(folder) / "states.csv"
        table = np.column_stack([t, q] + ([] if v is None else [v]))
        np.savetxt(file, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
        options = [y for name, x in bug.told.items() for y in (f"--{name}", str(x))]
        with contextlib.redirect_stderr(err):
            command(["identify", str(file), "--json", *options])
    if not out.getvalue().strip():
        return err.getvalue().strip().replace(str(file), "FILE"), False
    answer = json.loads(out.getvalue())
    return str(answer["statement"]), bool(answer["fits"])


def judged(bug: Bug, text: str, fits: bool) -> str:
    """Whether a sentence is right, short, or FALSE."""
    import re

    right = re.search(bug.says, text, re.IGNORECASE) is not None
    false = (claims(text) - set(bug.true.split())) or (fits and not right)
    return "FALSE" if false else "right" if right else "short"


def chosen(share: float) -> list[Bug]:
    """The bugs of which a share is drawn by their names' digests."""
    return [x for x in BUGS if int(hashlib.sha256(x.name.encode()).hexdigest()[:8], 16) < share * 2**32]


def main() -> int:
    """Print each bug and what is said of it, and the sums; status 1 where a sentence is false."""
    counts = Counter[str]()
    for bug in chosen(arguments(__doc__, share=1.0).share):
        text, fits = said(bug)
        counts[what := judged(bug, text, fits)] += 1
        print(f"{what:6s}{bug.name} ({bug.source}): {text[:250]}")
    print("; ".join(f"{n} {what}" for what, n in counts.most_common()))
    return int("FALSE" in counts)


if __name__ == "__main__":
    script(main)
