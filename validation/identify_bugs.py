"""Claim: of 40 bugs that people reported in public, `identify` states the cause of 36, and nothing false.

    python validation/identify_bugs.py [SHARE]

Each bug is rebuilt from the facts of its thread as a step of a few lines, with uneven numbers, and written as
CSV of 17 digits.  `springcheck identify` gets that file with what its user would know.  Its first sentence is

    right    it matches the words of the cause
    short    it does not, and claims nothing false: an honest "none", or a part of the cause
    FALSE    it names a scheme or claims a cause that is not so, by the claims of `identify_corpus.py`

SHARE is the part that is run, drawn by the names.  When the bugs were first tried, 27 of them were right and
6 FALSE.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import re
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from arguments import arguments, script
from identify_corpus import claims
from springcheck.cli import main as command

M, K, C, H, FRAMES = 2.3, 5.9, 0.37, 0.083, 300
W2 = K / M
States = tuple[Any, Any, Any]
Step = Callable[[Any, Any], Any]
ON_SPRING: dict[str, Any] = {"mass": M, "stiffness": K}
DAMPED, KEPLER, ALONE = {**ON_SPRING, "friction": C}, {"scene": "kepler"}, {"mass": M}


class Bug(NamedTuple):
    """A bug: its thread, its states, what the first sentence has to match, keys of `claims` that are true of
    it, and the options of the command."""

    name: str
    source: str
    states: Callable[[], States]
    says: str
    true: str = ""
    told: dict[str, Any] = ON_SPRING


def _of(
    step: Step, change: Callable[..., States] = lambda *x: x, *, h: float = H, n: int = FRAMES, q: Any = 0.7,
    v: Any = -0.4,
) -> Callable[[], States]:  # fmt: skip
    """Times, positions and velocities of n frames a step apart, changed as a program wrote them."""

    def states() -> States:
        each = [(q, v)]
        for _ in range(n - 1):
            each.append(step(*each[-1]))
        return change(np.arange(n) * h, *(np.array([x[i] for x in each], np.float64) for i in (0, 1)))

    return states


def _spring(q: Any, v: Any = 0.0, start: Any = None) -> Any:
    return -W2 * q


def _verlet(push: Callable[[Any], Any] = _spring, h: float = H) -> Step:
    def step(q: Any, v: Any) -> Any:
        half = v + h / 2 * push(q)
        return q + h * half, half + h / 2 * push(q + h * half)

    return step


def _euler(push: Callable[[Any], Any] = _spring, h: float = H) -> Step:
    return lambda q, v: (q + h * (v + h * push(q)), v + h * push(q))


def _runge_kutta(
    a: Any = ((1 / 2,), (0, 1 / 2), (0, 0, 1)), b: Any = (1 / 6, 1 / 3, 1 / 3, 1 / 6), *, h: float = H,
    stage: float | None = None, push: Callable[..., Any] = _spring,
) -> Step:  # fmt: skip
    def step(q: Any, v: Any) -> Any:
        slopes: list[Any] = []
        for row in ((), *a):
            x, u = (y + (stage or h) * sum(c * k[i] for c, k in zip(row, slopes, strict=True))
                    for i, y in enumerate((q, v)))  # fmt: skip
            slopes.append((u, push(x, u, q)))
        return tuple(
            y + h * sum(c * k[i] for c, k in zip(b, slopes, strict=True)) for i, y in enumerate((q, v))
        )

    return step


def _driven(q: Any, v: Any, start: Any) -> Any:
    """The force of the scene driven-spring at the time of the step's start, the second coordinate."""
    drive = 0.43 * np.cos(0.87 * start[1] + 0.6)
    return np.array([(drive - 2.9 * q[0] - 0.11 * v[0]) / 3.7, 0])


def _gravity(r: Any, soft: float = 0.0) -> Any:
    return -1.5 / 0.7 * r / (r @ r + soft) ** 1.5


def _first(t: Any, q: Any, v: Any) -> States:
    return t, q if q.ndim == 1 else q[:, 0], v[:, 0]


def _substeps(q: Any, v: Any, *, held: bool) -> Any:
    """Four substeps: with one force for all, or with the friction of a whole step in each."""
    force, h, less = -W2 * q, H / 4, 1.0 if held else np.exp(-C / M * H)
    for _ in range(4):
        v += h * (force if held else -W2 * q)
        q, v = q + h / 2 * (v + less * v), less * v
    return q, v


def _uncorrected() -> States:
    steps, q = np.random.default_rng(3).choice([0.041, 0.083, 0.059], FRAMES - 1), [0.7, 0.67]
    for h in steps[1:]:
        q.append(2 * q[-1] - q[-2] - h**2 * W2 * q[-1])
    return np.append(0, np.cumsum(steps)), np.array(q), None


def _game_loop() -> States:
    waits, each = np.random.default_rng(5).choice([0.0125, 0.016, 0.025, 0.04], FRAMES - 1), [(0.7, -0.4)]
    for wait in waits:
        each.append(_euler(lambda q: -25 * q, min(wait, 1 / 60))(*each[-1]))
    return np.append(0, np.cumsum(waits)), *np.array(each).T


def _exchanged(q: Any, v: Any, root: float = 19**0.5) -> Any:
    a = (14 - root) / 108, (-23 - 20 * root) / 270, 1 / 5, (-2 + 10 * root) / 135, (146 + 5 * root) / 540
    for x, y in zip(a[::-1], a, strict=True):
        q, v = q + (x + y) * H * (v - x * H * W2 * q), v - x * H * W2 * q
        v = v - y * H * W2 * q
    return q, v


def _pair(reaction: float) -> Callable[[Any], Any]:
    return lambda q: (3.1 * (q[1] - q[0]) * np.array([1, reaction]) - np.array([K, 4.3]) * q) / M


def _in_turn(q: Any, v: Any) -> Any:
    """RK4 of two particles of one spring, the second of which sees the first where it has been moved to."""
    x, u, total = q.copy(), v.copy(), np.zeros((2, 2))
    for part, weight in ((0.5, 1), (0.5, 2), (1.0, 2), (0.0, 1)):
        for j in range(2):
            k = np.array([u[j], _pair(-1)(x)[j]])
            total[:, j] += H / 6 * weight * k
            x[j], u[j] = q[j] + part * H * k[0], v[j] + part * H * k[1]
    return q + total[0], v + total[1]


def _picked(*kept: Any, even: bool = True) -> Callable[..., States]:
    return lambda t, q, v: (t[: len(np.r_[kept])] if even else t[np.r_[kept]], q[np.r_[kept]], v[np.r_[kept]])


def _two_schemes(t: Any, q: Any, v: Any) -> States:
    _, x, u = _of(_runge_kutta(), q=q[150], v=v[150], n=150)()
    return t, np.append(q[:150], x), np.append(v[:150], u)


FORUM, VERLET = "scicomp.stackexchange.com", _verlet()
ONE, NEXT = np.array([1.0, 0.0]), np.array([H, 1.0])
ORBIT: dict[str, Any] = {"h": 0.02, "q": np.array([1.0, 0.0]), "v": np.array([0.0, 1.7928429140015905])}
TWO: dict[str, Any] = {"n": 200, "q": np.array([0.7, -0.2]), "v": np.array([-0.4, 0.3])}
STAGES = ((1 / 3, 2 / 3, -1 / 12, 15 / 8, 1 / 10, 80 / 39), (0.065, 0, 0.275, 0.275, 0.16, 0.16, 0.065))
ROWS: tuple[tuple[Any, ...], ...] = (
    ("both half steps of a midpoint rule are added up", "NVIDIA/cuda-quantum#3720",
     _of(_runge_kutta(((1 / 2,),), (1 / 2, 1 / 2))), "^explicit Euler, 2 steps"),
    ("the planet leaves its orbit", f"{FORUM}: Using Velocity Verlet Algorithm for N-Body Simulation",
     _of(lambda q, v: (q + 0.02 * v + 2e-4 * _gravity(q), v + 0.02 * _gravity(q)), **ORBIT), "old force",
     "kicks", KEPLER),
    ("why is my spring exploding", "gamedev.stackexchange.com/questions/209104",
     _of(lambda q, v: (q + H * v - H**2 / 2 * K * q, v - H * K * q)), r"old force.* 2\.3 times",
     "kicks stiffness mass"),
    ("the position moves by the old velocity", "chenglou/react-motion#39",
     _of(lambda q, v: (q + 0.0167 * v, v - 0.0167 * (120 * q + 8 * v) / 1.3), h=0.0167, n=200),
     "^explicit Euler", "", {"mass": 1.3, "stiffness": 120, "friction": 8}),
    ("forces are never cleared", "anthonytorlucci/rlevo#98",
     _of(lambda q, v: (q + H * (v[0] + H * (v[1] - W2 * q)), v[0] * ONE + (v[1] - W2 * q) * NEXT),
         _first, n=200, v=np.array([-0.4, 0])), "forces add up"),
    ("the mean velocity lacks its factor 1/2", "andreadelprete/consim#14",
     _of(lambda q, v: (q + H * (v - H * W2 * q), v - H * W2 * q)), "^semi-implicit Euler", "late"),
    ("friction in every substep", "openmm/openmm#3790", _of(lambda q, v: _substeps(q, v, held=False)),
     "friction 4 times", "friction late", DAMPED),
    ("kJ for kcal, and k for k/2", "paduagroup/clandp#15", _of(_verlet(lambda q: -8.368 * W2 * q)),
     r"8\.368 times", "stiffness"),
    ("a factor of 20 in a bond", "openforcefield/smarty#38", _of(_verlet(lambda q: -20 * W2 * q)), "20 times",
     "stiffness"),
    ("AMBER's velocities", "OpenBioSim/sire#78", _of(VERLET, lambda t, q, v: (t, q, 20.455 * v)),
     "AMBER", "scale unit"),
    ("femtoseconds twice", "SPARC-X/SPARC-X-API#67",
     _of(VERLET, lambda t, q, v: (t, q, v / 10.180505710759414)), "ASE", "scale unit"),
    ("frames at uneven times", "ISISNeutronMuon/MDANSE#1219",
     _of(_verlet(h=0.0083), _picked(slice(0, 1500, 10), slice(1500, 3001, 15), even=False), h=0.0083, n=3001),
     "not at a constant interval", "clock"),
    ("time in single precision", "erf-model/ERF#3161",
     _of(_euler(h=0.3), lambda t, q, v: (np.cumsum(np.where(t, 0.3, 21000), dtype=np.float32), q, v), h=0.3),
     r"times are 1\.002", "step scale"),
    ("backwards with the size of the step", "ben-cassese/jorbit#85", _of(VERLET, lambda t, q, v: (-t, q, v)),
     "forwards while its times fall", "step"),
    ("the time is doubled", "OPALX-project/OPAL#1375", _of(VERLET, lambda t, q, v: (2 * t, q, v)),
     "times are 2 times", "step scale"),
    ("stages at the start of the step", "probabilistic-numerics/probnum#252",
     _of(_runge_kutta(h=0.1, push=_driven), _first, h=0.1, q=np.array([0.3, 0]), v=np.array([0.7 / 3.7, 1])),
     "drive is taken", "time", {"scene": "driven-spring"}),
    ("a limit after the position has moved", "openai/gym#2156",
     _of(lambda q, v: (q + 0.05 * (v - 0.685 * np.sin(q)), np.clip(v - 0.685 * np.sin(q), -5.0, 5.0)), h=0.05,
         q=2.5, v=1.0),
     "velocity is clipped at 5", "anharmonic", {}),
    ("a factor per frame for a damping ratio", "subinium/SuperLightTUI#124",
     _of(lambda q, v: (q + 0.85 * (v - 0.13 * q), 0.85 * (v - 0.13 * q)), h=1.0, n=200),
     "friction [^,]* times the stated", "friction", {"mass": 1, "stiffness": 0.13, "friction": 0.613}),
    ("damping without the step", "idanarye/bevy-tnua#3",
     _of(lambda q, v: (q + H * (v - H * W2 * q - C / M * v), v - H * W2 * q - C / M * v), n=200),
     "friction 12[^,]* times the stated", "friction", DAMPED),
    ("velocities in lengths per step", "liabru/matter-js#637", _of(_euler(), lambda t, q, v: (t, q, H * v)),
     "displacements", "scale"),
    ("Verlet with a step that varies", "soulwire/Coffee-Physics#2", _uncorrected, "by the last displacement",
     "step"),
    ("RK4 of position and velocity by themselves", f"{FORUM}/questions/28163",
     _of(lambda q, v: (q + 0.0121 * (v + 0.055), v + 0.0121 * (0.055 - W2 * q)), h=0.11),
     "explicit Euler.*step", "step scale constant"),
    ("half a step in the last stage", f"{FORUM}/questions/3110",
     _of(_runge_kutta(((1 / 2,), (0, 1 / 2), (0, 0, 1 / 2)))), "fourth stage takes half", "stage late"),
    ("stages that are overwritten", "openrocket/openrocket#3013",
     _of(_runge_kutta([(*[0] * i, x) for i, x in enumerate(STAGES[0])], STAGES[1])),
     "order 1, not known here"),
    ("flow and adjoint exchanged", "JuliaGNI/GeometricIntegrators.jl#220", _of(_exchanged),
     "order 2, not known here"),
    ("a softened orbit turns", "landgreen/landgreen.github.io#5",
     _of(_euler(lambda q: _gravity(q, 0.1), 0.02), **ORBIT), "soft|other forces?", "", KEPLER),
    ("the reaction with the wrong sign", "newton-physics/newton#880", _of(_euler(_pair(1)), **TWO),
     "reaction has the wrong sign", "", ALONE),
    ("no reaction", "simbody/simbody#720", _of(_verlet(_pair(0)), **TWO), "reaction is left out", "", ALONE),
    ("forces without the mass", "jax-md/jax-md#145", _of(_verlet(lambda q: -K * q)), "mass is left out",
     "mass stiffness"),
    ("0*5 for 0.5", "psi4/psi4numpy#103", _of(lambda q, v: (q + H * v, v - H / 2 * W2 * (q + q + H * v))),
     r"without h\*\*2/2 a"),
    ("stages without h", "cfgnunes/numerical-methods-matlab#1", _of(_runge_kutta(stage=1.0)),
     "no h in its stages", "stage"),
    ("frames that are one object", "prody/ProDy#1661", _of(VERLET, _picked([299] * 300)),
     "all frames are the same"),
    ("frames after the checkpoint stay", "Psivant/femto#32",
     _of(VERLET, _picked(slice(181), slice(161, 280))), "between frames 180 and 181, as after",
     "frames"),
    ("another integrator in the middle", "alvinng4/grav_sim#2", _of(VERLET, _two_schemes),
     r"Velocity Verlet up to frame 150, .*RK4", "frames"),
    ("velocities are written as 0", "deepmodeling/abacus-develop#575",
     _of(VERLET, lambda t, q, v: (t, q, 0 * v)), "velocity is 0"),
    ("a largest step", "pmndrs/cannon-es#16", _game_loop, r"step taken is .*0\.0166667 where times are 0\.04",
     "step", {"mass": 1.3, "stiffness": 32.5}),
    ("a frame twice, with its time", "TomWagg/cogsworth#90",
     _of(VERLET, _picked(slice(0, 121), slice(120, 300), even=False)), "frames 120 and 121 are 0 apart",
     "frames clock"),
    ("RK4 of one particle after the other", "anderkve/FYS3150#73", _of(_in_turn, **TWO),
     "after the other|not opposite", "coupled", ALONE),
    ("a h for a h**2", "gamedev.net: Verlet Integration Problem (2012)", _of(_euler(lambda q: -W2 / H * q)),
     "step is left out", "stiffness step"),
    ("world forces once for all substeps", "GabrieleGiuseppini/Floating-Sandbox#27",
     _of(lambda q, v: _substeps(q, v, held=True)), "one force for 4 substeps"),
)  # fmt: skip
BUGS = tuple(Bug(*row) for row in ROWS)


def said(bug: Bug) -> tuple[str, bool]:
    """The first sentence of the command, or its refusal, and whether it names a scheme."""
    t, q, v = bug.states()
    table = np.column_stack([t, q] + [v] * (v is not None))
    names = ["t", *(f"{x}{i}" for x in "xv" for i in range(1 if q.ndim == 1 else q.shape[1]))]
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "states.csv"
        header = ",".join(names[: table.shape[1]])
        np.savetxt(file, table, fmt="%.17g", delimiter=",", header=header, comments="")
        options = [y for name, x in bug.told.items() for y in (f"--{name}", str(x))]
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            command(["identify", str(file), "--json", *options])
    if not out.getvalue().strip():
        return err.getvalue().strip().replace(str(file), "FILE"), False
    answer = json.loads(out.getvalue())
    return str(answer["statement"]), bool(answer["fits"])


def judged(bug: Bug, text: str, fits: bool) -> str:
    """Whether a sentence is right, short, or FALSE."""
    right = re.search(bug.says, text, re.IGNORECASE) is not None
    if claims(text) - set(bug.true.split()) or (fits and not right):
        return "FALSE"
    return "right" if right else "short"


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
