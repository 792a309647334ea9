"""A census of teaching code: 40 integrator steps of courses, books and forums, judged as they are named.

    python validation/teaching/census.py            # about 60 s; writes census.csv and README.md
    python validation/teaching/census.py --check    # judges five steps and compares them with census.csv

Each step is transcribed in a few lines, in this file's notation: x, v, the step h, and the acceleration a(x).
It runs on a mass of 3.7 and a stiffness of 2.9.  `judge` compares its states with the scheme that the source
names, and `identify` names the scheme that made them.  A step stands for the idea and not for its author: a
question on a forum is there because somebody asked for help.
"""

import csv
import sys
from collections.abc import Callable
from pathlib import Path

import springcheck
from springcheck.errors import SpringcheckError

HERE = Path(__file__).parent
QUICK = ("code-review-question", "wells-bishop", "sarkar-rk4", "compy-leapfrog", "hmc-stat689")
X, M = "excerpt", "memory"
"""How a step was read: whole, in a stored excerpt of the page; or as it is widely known."""

Step = Callable[..., tuple[float, float]]
"""step(x, v, h, a) -> (x, v)."""


def kick_drift(x, v, h, a):
    v = v + h * a(x)
    return x + h * v, v


def kick_drift_kick(x, v, h, a):
    v = v + h / 2 * a(x)
    x = x + h * v
    return x, v + h / 2 * a(x)


def drift_kick_drift(x, v, h, a):
    x = x + h / 2 * v
    v = v + h * a(x)
    return x + h / 2 * v, v


def verlet(x, v, h, a):
    old = a(x)
    x = x + h * v + h * h / 2 * old
    return x, v + h / 2 * (old + a(x))


def stages(*table):
    """A Runge-Kutta method: rows of weights of the stages before, and last those of the step."""

    def step(x, v, h, a):
        k = []
        for row in table:
            y = x + h * sum(w * k[i][0] for i, w in enumerate(row))
            u = v + h * sum(w * k[i][1] for i, w in enumerate(row))
            k.append((u, a(y)))
        return y, u

    return step


def composed(kicks, drifts):
    """Kicks and drifts in turn, a kick first."""

    def step(x, v, h, a):
        for kick, drift in zip(kicks, drifts, strict=True):
            v = v + kick * h * a(x)
            x = x + drift * h * v
        return x, v

    return step


def each_by_itself(x, v, h, a):
    """RK4 of v with x fixed but for v's own increments, then RK4 of x likewise."""

    def alone(f, y):
        k1 = h * f(y)
        k2 = h * f(y + k1 / 2)
        k3 = h * f(y + k2 / 2)
        return (k1 + 2 * k2 + 2 * k3 + h * f(y + k3)) / 6

    v = v + alone(a, x)
    return x + alone(lambda u: u, v), v


def implicit_euler(x, v, h, a):
    square = -a(1.0)
    return (x + h * v) / (1 + h * h * square), (v - h * square * x) / (1 + h * h * square)


def yoshida(x, v, h, a):
    d = 1 / (2 - 2 ** (1 / 3))
    for part in (d, 1 - 2 * d, d):
        x, v = verlet(x, v, part * h, a)
    return x, v


euler = lambda x, v, h, a: (x + h * v, v + h * a(x))
parabola = lambda x, v, h, a: (x + h * v + h * h / 2 * a(x), v + h * a(x))
C = 2 ** (1 / 3)
MIDPOINT, HEUN = stages((), (0.5,), (0, 1)), stages((), (1,), (0.5, 0.5))
RK4 = stages((), (0.5,), (0, 0.5), (0, 0, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6))
FOREST_RUTH = composed(
    [0, 1 / (2 - C), -C / (2 - C), 1 / (2 - C)],
    [0.5 / (2 - C), 0.5 * (1 - C) / (2 - C), 0.5 * (1 - C) / (2 - C), 0.5 / (2 - C)],
)
RUTH3 = composed([7 / 24, 3 / 4, -1 / 24], [2 / 3, -2 / 3, 1])
E, SE, VV = "explicit-euler", "semi-implicit-euler", "velocity-verlet"
REVIEW = "codereview.stackexchange.com/questions/164440"
ORBITS = "Justin08784/orbits, symplectic_integrators.py"
GAFFER = "Fiedler, Integration Basics, gafferongames.com"
MAKINO = "jmakino/coronavirus, integratorlib.cr"
FORUM = "game development forum, thread Newton Was Wrong?"
TUTORIAL = "Fourth Order Runge-Kutta Numerical Integration, a tutorial"
HERO = "hero.handmade.network, thread 1163 (v += h a was assumed)"

ROWS: list[tuple[str, str, str, str, str, Step]] = [
    ("code-review-question", REVIEW + ", question", "Euler method", E, X, kick_drift),
    ("code-review-answer", REVIEW + ", answer", "Euler method", E, X, euler),
    ("wells-bishop", "WellsBishop/Code-Samples, notebook", "Euler formula", E, X,
     lambda x, v, h, a: (x - h * v, v - h * a(x))),
    ("physics-forums", "physicsforums.com/threads/785484, question", "Euler method", E, X,
     lambda x, v, h, a: (x + h * v, v + h * a(1.0))),
    ("euler-heun", "HussainAther/mathematics, diffeq/eulerheun.py", "Euler-Heun", "rk2-heun", X,
     lambda x, v, h, a: (x + h * v, v + h * a(1.0) * v)),
    ("game-universe", "Kahrstrom, Creating my own universe, a blog", "Euler integration", E, X, euler),
    ("gaffer-euler", GAFFER, "explicit Euler", E, M, euler),
    ("gaffer-symplectic", GAFFER, "semi-implicit Euler", SE, M, kick_drift),
    ("gaffer-rk4", GAFFER, "RK4", "rk4", M, RK4),
    ("tutorial-rk4", TUTORIAL, "RK4", "rk4", X, RK4),
    ("tutorial-euler", TUTORIAL, "Euler's method", E, X, euler),
    ("forum-question", FORUM + ", question", "constant acceleration", "", X, parabola),
    ("forum-symplectic", FORUM + ", answer", "symplectic Euler", SE, X, kick_drift),
    ("forum-verlet", FORUM + ", answer", "velocity Verlet", VV, X, verlet),
    ("hero-before", HERO + ", as it was", "the update of a position", "", X,
     lambda x, v, h, a: (x + h * v + h * h * a(x), v + h * a(x))),
    ("hero-after", HERO + ", as proposed", "constant acceleration", "", X, parabola),
    ("zhao-cromer", "zhaoyoyo/computationalphysics_N2013301020083", "Euler-Cromer", SE,
     X, kick_drift),
    ("langtangen-cromer", "Linge & Langtangen, osc_EC", "Euler-Cromer", SE, M,
     kick_drift),
    ("langtangen-euler", "Linge & Langtangen, osc_FE", "Forward Euler", E, M, euler),
    ("coding-train", "CodingTrain, challenge 160, undamped", "a spring", "", X, kick_drift),
    ("makino-1a", MAKINO, "symplectic, first order", "semi-implicit-euler-drift-kick", X,
     lambda x, v, h, a: (x + h * v, v + h * a(x + h * v))),
    ("makino-1b", MAKINO, "symplectic, first order", SE, X, kick_drift),
    ("makino-rk2", MAKINO, "RK2", "rk2-heun", X, HEUN),
    ("makino-leapfrog", MAKINO, "leapfrog", VV, X, verlet),
    ("makino-yoshida4", MAKINO, "Yoshida, fourth order", "yoshida4", X, yoshida),
    ("astrocodex", "astrocodex.github.io, leapfrog integrator", "leapfrog", VV, X, kick_drift_kick),
    ("molssi", "MolSSI-Education/ab-initio-md, episode 6", "velocity Verlet", VV, X, verlet),
    ("compy-leapfrog", "com-py/compy, Program 2.6", "leapfrog", "position-verlet", X,
     drift_kick_drift),
    ("algo-chaos", "habib256/algo-chaos, Leapfrog.py", "leapfrog", VV, X, verlet),
    ("comp-physics-a11", "The-Earth/comp-Physics, A11/verlet-v.py", "velocity Verlet", VV, X, verlet),
    ("hmc-julia", "compneuro-julia, book, mcmc/016.jl", "leapfrog", VV, X, kick_drift_kick),
    ("hmc-matlab", "InezPereira/mcmc, hmc/leapfrog.m", "leapfrog", VV, X, kick_drift_kick),
    ("hmc-nuts", "henrifnk/NoUTurn, R/Leapfrog.R", "leapfrog", VV, X, kick_drift_kick),
    ("hmc-stat689", "delimited0/stat-689-project, hmc.R", "leapfrog, then momentum reversed", "", X,
     lambda x, v, h, a: (lambda y, u: (y, -u))(*kick_drift_kick(x, v, h, a))),
    ("orbits-leap2", ORBITS, "leapfrog", "position-verlet", X, drift_kick_drift),
    ("orbits-ruth3", ORBITS, "Ruth, third order", "ruth3", X, RUTH3),
    ("orbits-ruth4", ORBITS, "Ruth, fourth order", "forest-ruth", X, FOREST_RUTH),
    ("villamil-rk2", "jdvillamils/Physics-Tools, 6/OscilladoRK2.m", "RK2", "rk2-midpoint", X,
     MIDPOINT),
    ("sarkar-rk4", "Sarkar-Physics/Fortran, pendulum_rk4.f90", "RK4", "rk4", X, each_by_itself),
    ("lak-backward", "PetrLak/CMiM_Assignment_C, osc_BE.m", "Backward Euler", "implicit-euler", X,
     implicit_euler),
]  # fmt: skip


def judged(step: Step, scheme: str) -> tuple[str, str]:
    """Whether the step is that of the scheme ("-" without one), and the scheme that is identified."""

    def stepper(q, p, h, force, mass):
        x, v = step(q, p / mass, h, lambda x: force(x) / mass)
        return x, v * mass

    try:
        found = springcheck.identify(stepper).statement
    except SpringcheckError as error:
        found = str(error)
    if not scheme:
        return "-", found
    verdicts = springcheck.judge(
        "spring-uneven", springcheck.simulate("spring-uneven", stepper, scheme=scheme)
    )
    return ("yes" if verdicts.passed else "no"), found


TEXT = """# A census of teaching code

{n} integrator steps from courses, books, forums and tutorials, each judged as its text names it. Of {named}
that name a scheme {right} are that scheme to rounding and {wrong} are not; {none} name none.

A step stands for the idea and not for its author. A question on a forum is there because somebody asked for
help; answers are in the table too. Hamiltonian Monte Carlo reverses the momentum on purpose. Sources such
as NAME/REPOSITORY are on GitHub, and may have changed since. "Read" says how: the whole step in a stored
excerpt of the page, or from memory, as it is widely known. [census.py](census.py) has the transcriptions.

## Not the scheme that the text names, or none named

{others}

## All steps

| step | source | named | as named? | read |
|---|---|---|---|---|
{all}
"""


def main(*arguments: str) -> int:
    """Judge all steps and write the table and the page, or compare a few."""
    names = ("step", "source", "named", "scheme", "as_named", "identified", "read")
    few = "--check" in arguments
    rows = [
        dict(zip(names, (name, source, claim, scheme, *judged(step, scheme), read), strict=True))
        for name, source, claim, scheme, read, step in ROWS
        if not few or name in QUICK
    ]
    if few:
        with (HERE / "census.csv").open(newline="", encoding="utf-8") as file:
            known = {row["step"]: row for row in csv.DictReader(file)}
        # the words of what is identified may change
        wrong = [row["step"] for row in rows if row["as_named"] != known[row["step"]]["as_named"]]
        print("as in census.csv" if not wrong else f"not as in census.csv: {', '.join(wrong)}")
        return bool(wrong)
    with (HERE / "census.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([names, *(row.values() for row in rows)])
    count = {answer: sum(row["as_named"] == answer for row in rows) for answer in ("yes", "no", "-")}
    others = [row for row in rows if row["as_named"] != "yes"]
    text = TEXT.format(
        n=len(rows), named=count["yes"] + count["no"], right=count["yes"], wrong=count["no"], none=count["-"],
        others="\n".join("* **{step}** ({source}), named {named}: {identified}.".format(**x) for x in others),
        all="\n".join("| {step} | {source} | {named} | {as_named} | {read} |".format(**row) for row in rows),
    )  # fmt: skip
    (HERE / "README.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
