"""Bugs that users of simulators reported, rebuilt: a part of the cases of `identify_corpus.py`."""
# ruff: noqa: D103
# mypy: disable-error-code="assignment,arg-type,call-arg,attr-defined,list-item,misc"

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from identify_kept import add, even
from identify_loops import MEMORY, H, K, M, State


def bugs() -> Iterator[tuple[str, str, str, tuple[str, ...], tuple[str, ...], list[State]]]:
    """Name, thread, words of the first sentence, true claims, schemes (where the bug is a scheme), states.

    Other bugs of threads stand in `tests/test_identify_bugs.py`, as steppers.
    """

    def run(one: Callable[[float, float], State], n: int = 160) -> list[State]:
        rows = [(0.3, 0.7)]
        for _ in range(n):
            rows.append(one(*rows[-1]))
        return rows

    def of(pull: Callable[[float, float], float]) -> Callable[[float, float], State]:
        """Velocity Verlet in momenta with this force of position and momentum."""

        def one(q: float, p: float) -> State:
            p = p + H / 2 * pull(q, p)
            q = q + H * p / M
            return q, p + H / 2 * pull(q, p)

        return one

    def swapped(q: float, p: float) -> State:
        a = -K * q / M
        q = q + H / 2 * p / M + H * H * a
        return q, p + H / 2 * (a - K * q / M) * M

    yield "halves swapped", "headmyshoulder/odeint-v2#150", r"halves swapped", ("halves",), (), run(swapped)

    def square(q: float, p: float) -> State:
        a = -K * q / M
        q = q + H * p / M + H * H * a
        return q, p + H / 2 * (a - K * q / M) * M

    yield (
        "h**2 a instead of h**2/2 a",
        "an unasked friction of h k/(n m), as in chaos-polymtl/lethe#134",
        r"h\*\*2|twice|full|half|mark of",
        ("halves", "kicks", "friction"),
        (),
        run(square),
    )

    def half_drift(q: float, p: float) -> State:
        p = p - H / 2 * K * q
        q = q + H / 2 * p / M
        return q, p - H / 2 * K * q

    yield ("drift of half a step", "erf-model/ERF#3594", r"drift of half", ("halves",), (), run(half_drift))
    yield (
        "Verlet decayed to symplectic Euler",
        "chaos-polymtl/lethe#2082",
        "semi-implicit Euler",
        (),
        ("semi-implicit-euler",),
        run(lambda q, p: (q + H * (p - H * K * q) / M, p - H * K * q)),
    )
    yield (
        "SymplecticEuler was Euler",
        "SciML/OrdinaryDiffEq.jl#577, openai/gym#907",
        "explicit Euler",
        (),
        ("explicit-euler",),
        run(lambda q, p: (q + H * p / M, p - H * K * q)),
    )
    yield (
        "the force is one step behind",
        "a force buffer one step stale",
        r"force.*(behind|old|stale|late|step before)",
        ("kicks", "late", "frames"),
        (),
        stale(),
    )

    def rk4(
        fourth: int = 3, weights: tuple[float, ...] = (1, 2, 2, 1), total: float = 6, first: bool = True
    ) -> Any:
        def one(q: float, p: float) -> State:
            k1 = (p / M, -K * q)
            k2 = ((p + H / 2 * k1[1]) / M, -K * (q + H / 2 * k1[0]))
            k3 = ((p + H / 2 * k2[1]) / M, -K * (q + H / 2 * k2[0]))
            last = (k1, k2, k3)[fourth - 1]
            k4 = ((p + H * last[1]) / M, -K * (q + H * last[0]))
            ks = (k1 if first else (0.0, 0.0), k2, k3, k4)
            return (
                q + H / total * sum(w * x[0] for w, x in zip(weights, ks, strict=True)),
                p + H / total * sum(w * x[1] for w, x in zip(weights, ks, strict=True)),
            )

        return one

    yield (
        "fourth stage from the second",
        "f1tenth/f1tenth_gym#52",
        r"RK4.*stage",
        ("stage",),
        ("rk3-kutta",),
        run(rk4(2)),
    )
    yield (
        "fourth stage from the first",
        "the same slip one further",
        r"RK4.*stage",
        ("stage",),
        (),
        run(rk4(1)),
    )
    yield (
        "equal weights",
        "GeomScale/volesti#375",
        r"RK4.*weights",
        ("stage",),
        (),
        run(rk4(3, (1, 1, 1, 1), 4)),
    )
    yield (
        "first slope left out of RK4",
        "a loop over stages that begins at 1",
        r"RK4.*(first|weights)",
        ("stage",),
        (),
        run(rk4(first=False)),
    )
    yield ("weights over 8", "a typing slip", r"RK4.*8", ("stage",), (), run(rk4(3, (1, 2, 2, 1), 8), 100))

    def stale_slope() -> list[State]:
        q, p, k1 = 0.3, 0.7, (0.7 / M, -K * 0.3)
        rows = [(q, p)]
        for _ in range(400):
            k2 = ((p + H / 2 * k1[1]) / M, -K * (q + H / 2 * k1[0]))
            k3 = ((p + H / 2 * k2[1]) / M, -K * (q + H / 2 * k2[0]))
            k4 = ((p + H * k3[1]) / M, -K * (q + H * k3[0]))
            q, p = (x + H / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]) for i, x in enumerate((q, p)))
            k1 = k4
            rows.append((q, p))
        return rows

    yield (
        "first slope of RK4 is the last one of the step before",
        "first-same-as-last where it is not",
        MEMORY + "|stale|slope",
        ("late",),
        (),
        stale_slope(),
    )

    def implicit_old(q: float, p: float) -> State:
        return q + H * p / M, (p - H * K * q) / (1 + H * H * K / M)

    yield (
        "implicit velocity, old position",
        "gbionics/jaxsim#68",
        "implicit.*old velocity",
        ("iteration",),
        (),
        run(implicit_old),
    )
    yield (
        "mean of old and new velocity",
        "bulletphysics/bullet3#1446",
        "old force|held",
        ("kicks",),
        (),
        run(lambda q, p: (q + H * (2 * p - H * K * q) / 2 / M, p - H * K * q)),
    )
    a = H * H * K / M
    yield (
        "energy lost without damping",
        "dartsim/dart#846",
        "implicit Euler",
        (),
        ("implicit-euler",),
        run(lambda q, p: ((q + H * p / M) / (1 + a), (p - H * K * q) / (1 + a))),
    )

    def wrong_sign(q: float, p: float) -> State:
        p = p + H * (-K * q + 0.1 * p / M)
        return q + H * p / M, p

    yield (
        "friction added",
        "slembcke/Chipmunk2D#248",
        "negative friction|wrong sign",
        ("friction",),
        (),
        run(wrong_sign),
    )
    yield ("mass left out", "dq/dt = p", "mass is left out", ("mass",), (), run(massless))
    yield (
        "p is a velocity",
        "dq/dt = p, dp/dt = F/m",
        "treated as a velocity",
        ("mass",),
        (),
        run(as_velocity),
    )
    yield (
        "divided by the step",
        "ThomasLengeling/traerphysics#2",
        "1/h|divided by",
        ("step",),
        (),
        run(by_step, 8),
    )
    yield (
        "drag by default",
        "pybullet's 0.04",
        "friction",
        ("friction",),
        ("semi-implicit-euler",),
        run(lambda q, p: (q + H * (p - H * K * q) * (1 - 0.04 * H) / M, (p - H * K * q) * (1 - 0.04 * H))),
    )

    def one_iteration(q: float, p: float) -> State:
        new = q + H * p / M
        return q + H * (p - H * K * new) / M, p - H * K * new

    yield (
        "implicit Euler by one iteration",
        "an iteration that stops early",
        r"iteration|not solved|semi-implicit",
        ("iteration",),
        (),
        run(one_iteration),
    )
    for n, name in ((2.0, "double counted"), (0.5, "halved"), (1 / 4.184, "kcal"), (4.184, "kJ")):
        yield (
            f"the force is {name}",
            "openmm/openmm#1486 and others",
            "kcal|kJ|twice|half|k q|0.5|2 times|/2",
            ("unit", "stiffness", "kicks"),
            ("velocity-verlet",),
            run(of(lambda q, p, n=n: -n * K * q)),
        )
    yield ("one force for two substeps", "a frame skip", "held", ("kicks",), ("held-force",), run(held_two))

    def rank_one(q: float, p: float) -> State:
        p = p - H * K * q
        q = q + H * p / M
        return q, 0.8 * M * q

    yield (
        "the velocity follows the position",
        "a buffer that is shared",
        "rank|follows the position|multiple",
        (),
        (),
        run(rank_one, 100),
    )
    rows = run(of(lambda q, p: -K * q), 280)
    yield (
        "velocities one step behind",
        "NVIDIA-Omniverse/PhysX#308",
        "one (step|frame) behind",
        ("late",),
        (),
        [(x[0], y[1]) for x, y in zip(rows[1:], rows[:-1], strict=True)],
    )
    yield (
        "velocities half a step early",
        "openmm/openmm#1474 and #4929",
        "half a step",
        ("late",),
        ("semi-implicit-euler",),
        [(q, p + H / 2 * K * q) for q, p in rows],
    )
    yield (
        "degrees",
        "angles in degrees, rates in radians",
        "degrees|57.29",
        ("scale", "unit"),
        (),
        [(math.degrees(q), p) for q, p in rows],
    )
    yield (
        "ASE's unit of time",
        "fs taken for A sqrt(u/eV)",
        r"10.18|ASE",
        ("scale", "unit"),
        (),
        [(q, 10.180505710759414 * p) for q, p in rows],
    )
    yield (
        "AKMA's unit of time",
        "fs taken for 48.888 fs",
        r"48.88|AKMA|CHARMM|0.02045",
        ("scale", "unit"),
        (),
        [(q, p / 48.88821) for q, p in rows],
    )
    yield (
        "Angstrom for nm",
        "positions in one, velocities in the other",
        r"Angstrom|\b10\b|0\.1|nm",
        ("scale", "unit"),
        (),
        [(10 * q, p) for q, p in rows],
    )
    cut = rows[:272] + rows[273:]
    yield (
        "a frame is missing",
        "a lost frame",
        "frame 27[12].*missing|missing.*frame 27[12]",
        ("frames",),
        (),
        cut,
    )
    yield (
        "a step is repeated",
        "a restart that writes twice",
        "repeated at frame 10[01]",
        ("frames",),
        (),
        rows[:101] + rows[100:-1],
    )


def stale() -> list[State]:
    q, p, f = 0.3, 0.7, -K * 0.3
    rows = [(q, p)]
    for _ in range(400):
        p = p + H / 2 * f
        new = -K * q
        q = q + H * p / M
        p = p + H / 2 * new
        f = new
        rows.append((q, p))
    return rows


def massless(q: float, p: float) -> State:
    p = p - H / 2 * K * q
    q = q + H * p
    return q, p - H / 2 * K * q


def as_velocity(q: float, p: float) -> State:
    p = p - H / 2 * K / M * q
    q = q + H * p
    return q, p - H / 2 * K / M * q


def by_step(q: float, p: float) -> State:
    p = p - K * q / H
    return q + p / M / H, p


def held_two(q: float, p: float) -> State:
    f = -K * q
    for _ in range(2):
        p = p + H / 2 * f
        q = q + H / 2 * p / M
    return q, p


def rebuilt() -> None:
    for name, thread, words, true, schemes, rows in bugs():
        q, p = np.array(rows).T
        add(
            "bugs",
            name,
            thread,
            even(H, len(q)),
            q,
            p=p,
            wanted="said",
            says=words,
            schemes=schemes,
            true=true,
            stride=None,
            mass=M,
            stiffness=K,
        )
