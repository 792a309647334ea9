"""Files that no single map explains, files of several particles, files of outside programs: a part of the
cases of `identify_corpus.py`."""
# ruff: noqa: D103
# mypy: disable-error-code="assignment,arg-type,call-arg,attr-defined,list-item,misc,operator"

from __future__ import annotations

import math
from typing import Any

import numpy as np

from identify_kept import add, even
from identify_loops import KNOWN, W2, H, K, M, kick_drift, march, position_verlet, verlet
from springcheck.physics.arrays import Floats


def langevin(rng: np.random.Generator, n: int, rate: float, warm: float) -> tuple[Floats, Floats]:
    q, v = 0.3, 0.2
    rows = [(q, v)]
    c = math.exp(-rate * H)
    for _ in range(n):
        v -= H / 2 * W2 * q
        q += H / 2 * v
        v = c * v + math.sqrt((1 - c * c) * warm) * float(rng.normal())
        q += H / 2 * v
        v -= H / 2 * W2 * q
        rows.append((q, v))
    out = np.array(rows)
    return out[:, 0], out[:, 1]


def spoiled() -> None:
    """Files that no single map explains."""
    rng = np.random.default_rng(7)
    t = even(H, 401)

    def of(
        name: str,
        q: Any,
        v: Any,
        says: str,
        true: tuple[str, ...],
        times: Any = None,
        schemes: tuple[str, ...] = (),
        **stated: Any,
    ) -> None:
        facts = {"mass": M, **stated}
        clock_ = t if times is None else times
        if len(np.asarray(q)) != 401 and times is None:
            clock_ = even(H, len(np.asarray(q)))
        add(
            "spoiled",
            name,
            "own loop",
            clock_,
            q,
            v,
            wanted="said",
            says=says,
            true=true,
            stride=None,
            schemes=schemes,
            **facts,
        )

    noise = ("noise",)
    for rate, warm in ((0.1, 0.05), (2.0, 0.05), (20.0, 0.01)):
        q, v = langevin(rng, 400, rate, warm)
        of(
            f"BAOAB at a temperature, friction {rate:g}",
            q,
            v,
            "noise|random",
            (*noise, "friction", "drag"),
            schemes=("baoab", "langevin-middle"),
        )
    q, v = 0.3, 0.2
    rows = [(q, v)]
    for _ in range(400):
        q, v = verlet(q, v, H, W2)
        if float(rng.random()) < 0.1:
            v = 0.2 * float(rng.normal())
        rows.append((q, v))
    of(
        "Andersen",
        *np.array(rows).T,
        "noise|random|kick",
        (*noise, "frames"),
        schemes=("andersen-after",),
    )
    q, v = 0.3, 0.2
    rows = [(q, v)]
    for _ in range(400):
        q, v = verlet(q, v, H, W2)
        v *= math.sqrt(1 + H / 0.5 * (0.02 / max(v * v, 1e-4) - 1)) if v * v > 0.004 else 1.0
        rows.append((q, v))
    of("Berendsen", *np.array(rows).T, "thermostat|velocity|friction", ("drag", "friction", "time", *noise))
    q, v, xi = 0.3, 0.2, 0.0
    rows = [(q, v)]
    for _ in range(400):
        xi += H / 2 * (v * v - 0.05) / 0.3
        v = v * math.exp(-H / 2 * xi)
        q, v = verlet(q, v, H, W2)
        v = v * math.exp(-H / 2 * xi)
        xi += H / 2 * (v * v - 0.05) / 0.3
        rows.append((q, v))
    of("Nose-Hoover", *np.array(rows).T, "friction|thermostat|time", ("friction", "time", "drag"))
    for w, amplitude in ((0.5, 0.3), (1.0, 0.05), (3.0, 2.0)):
        q, v = 0.3, 0.2
        rows = [(q, v)]
        for i in range(400):
            v -= H / 2 * (W2 * q - amplitude * math.cos(w * i * H))
            q += H * v
            v -= H / 2 * (W2 * q - amplitude * math.cos(w * (i + 1) * H))
            rows.append((q, v))
        of(f"driven at {w:g}", *np.array(rows).T, "driv|external|time", ("time",))
    q, v, h = 0.3, 0.2, 1e-6
    rows = [(q, v)]
    for _ in range(20):
        q, v = kick_drift(q, v, h, W2)
        rows.append((q, v))
        h += h
    of("dt += dt", *np.array(rows).T, "step.*(grow|double|long|chang)|time", ("time", "step"))
    q, v = march(verlet, 400, H, W2)
    big = 30 * q
    of("wrapped into a box of 10", np.mod(big, 10.0), 30 * v, "wrap|box|period", ("frames",))
    of(
        "wrapped into a box of 20, centred",
        np.mod(big + 10, 20.0) - 10,
        30 * v,
        "wrap|box|period",
        ("frames",),
    )
    rows2 = [march(verlet, 400, H, w2, s) for w2, s in ((W2, (0.3, 0.2)), (2 * W2, (-0.5, 0.1)))]
    q2, v2 = (np.stack([x[i] for x in rows2], axis=1) for i in (0, 1))
    swapped = [x.copy() for x in (q2, v2)]
    for x in swapped:
        x[[100, 250]] = x[[100, 250]][:, ::-1]
    of(
        "two particles swapped in 2 of 401 frames",
        *swapped,
        "swapped|changed places|frame",
        ("frames",),
        mass=[M, M],
    )
    swapped = [x.copy() for x in (q2, v2)]
    for x in swapped:
        x[200:] = x[200:, ::-1]
    of(
        "two particles swapped from frame 200 on",
        *swapped,
        "swapped|changed places|frame 200",
        ("frames",),
        mass=[M, M],
    )
    of(
        "velocities of the other particle",
        q2,
        v2[:, ::-1],
        "order|other particle|other columns|sorted",
        ("coupled",),
        mass=[M, M],
    )
    mixed = v2.copy()
    for i in range(401):
        if float(rng.random()) < 0.5:
            mixed[i] = mixed[i, ::-1]
    of(
        "velocities unsorted",
        q2,
        mixed,
        "order|sorted|unsorted|changed places|swapped",
        ("frames",),
        mass=[M, M],
    )
    turned = v.copy()
    turned[137] *= -1
    of("one velocity's sign turned", q, turned, "frame 137", ("frames",))
    of("all velocities' signs turned", q, -v, "sign", ("step",))
    turned = v2.copy()
    turned[:, 1] *= -1
    of("one particle's velocity has the other sign", q2, turned, "sign|oscillator 1", ("step",), mass=[M, M])
    off = [q.copy(), v.copy()]
    for i in (50, 120, 121, 300, 377):
        off[0][i] += 0.05 * float(rng.normal())
    of("five frames off", *off, r"frames? (50|120)|5[0-9]* frames|five frames", ("frames",))
    off = [q.copy(), v.copy()]
    off[0][200:205] = 0.0
    of("five frames zero", *off, r"frames? 200|frame 199", ("frames",))
    x, y, vx, vy = 1.0, 0.0, 0.0, 0.7
    orbit = []
    for _ in range(401):
        r = math.hypot(x, y)
        orbit.append((r, math.atan2(y, x), (x * vx + y * vy) / r, (x * vy - y * vx) / r**2))
        x, vx = verlet(x, vx, H, W2)
        y, vy = verlet(y, vy, H, W2)
    r, phi, dr, dphi = np.array(orbit).T
    of(
        "an orbit in polar coordinates, r and phi",
        np.stack([r, np.unwrap(phi)], axis=1),
        np.stack([dr, dphi], axis=1),
        "anharmonic|not linear|polar|linear",
        ("anharmonic", "coupled"),
    )
    of("the radius of an orbit", r, dr, "anharmonic|not linear", ("anharmonic",))
    m2 = np.array([1.3, 4.1])
    x2, u2 = np.array([0.0, 1.4]), np.array([0.5, 0.1])
    rows3 = [(x2, u2)]
    for _ in range(400):
        f = 2.9 * (x2[1] - x2[0] - 1.0) * np.array([1.0, -1.0])
        u2 = u2 + H / 2 * f / m2
        x2 = x2 + H * u2
        u2 = u2 + H / 2 * 2.9 * (x2[1] - x2[0] - 1.0) * np.array([1.0, -1.0]) / m2
        rows3.append((x2, u2))
    q3, v3 = (np.array([row[i] for row in rows3]) for i in (0, 1))
    add(
        "pairs",
        "a drifting pair of unlike masses",
        "own loop",
        even(H, 401),
        q3,
        v3,
        schemes=("velocity-verlet",),
        mass=m2.tolist(),
    )


def pairs() -> None:
    """Two bound particles, at rest as a whole, in any direction."""
    rng = np.random.default_rng(3)
    for name, m2 in (("like", (3.7, 3.7)), ("unlike", (1.3, 4.1)), ("H and Cl", (1.008, 35.45))):
        for where in ("along x", "in any direction"):
            axis = np.array([1.0, 0, 0]) if where == "along x" else rng.normal(size=3)
            axis = axis / np.linalg.norm(axis)
            for scheme in ("velocity Verlet", "semi-implicit Euler"):
                _, names = KNOWN[scheme]
                m = np.array(m2)
                reduced = m[0] * m[1] / (m[0] + m[1])
                # both particles stepped by themselves, with the force between them
                x = np.array([[0.0], [1.2]]) * axis
                com = (m @ x) / m.sum()
                x = x - com
                u = np.array([[0.4 / m[0]], [-0.4 / m[1]]]) * axis

                def pull(x: Any, axis: Any = axis) -> Any:
                    f = K * ((x[1] - x[0]) - axis)
                    return np.stack([f, -f])

                rows = [(x, u)]
                for _ in range(120):
                    if scheme == "velocity Verlet":
                        u = u + H / 2 * pull(x) / m[:, None]
                        x = x + H * u
                        u = u + H / 2 * pull(x) / m[:, None]
                    else:
                        u = u + H * pull(x) / m[:, None]
                        x = x + H * u
                    rows.append((x, u))
                q, v = (np.array([row[i] for row in rows]).reshape(121, 6) for i in (0, 1))
                kept = np.ptp(q, axis=0) > 0
                masses = np.repeat(m, 3)[kept].tolist()
                base = f"a pair of {name} masses at rest as a whole, {where}, {scheme}"
                facts = {"reduced mass": float(reduced)}
                own: dict[str, Any] = {"schemes": names, "facts": facts}
                add("pairs", base, "own loop", even(H, 121), q[:, kept], v[:, kept], mass=masses, **own)
                add(
                    "pairs",
                    f"{base}, stiffness of the bond stated",
                    "own loop",
                    even(H, 121),
                    q,
                    v,
                    share=base,
                    mass=masses,
                    stiffness=K,
                    **own,
                )
                add("pairs", f"{base}, nothing stated", "own loop", even(H, 121), q, v, share=base, **own)
                add(
                    "pairs",
                    f"{base}, one coordinate",
                    "own loop",
                    even(H, 121),
                    q,
                    v,
                    share=base,
                    column=0,
                    mass=masses[0],
                    **own,
                )
                if name == "unlike":
                    add(
                        "pairs",
                        f"{base}, momenta",
                        "own loop",
                        even(H, 121),
                        q[:, kept],
                        p=v[:, kept] * masses,
                        mass=masses,
                        **own,
                    )
    for turn in (0.05, 0.3):
        x, y, u, w = 1.0, 0.0, 0.3, 0.8
        rows4 = [(x, y, u, w)]
        t_, s_ = math.tan(turn / 2), 2 * math.tan(turn / 2) / (1 + math.tan(turn / 2) ** 2)
        for _ in range(300):
            a, b = u + w * t_, w - u * t_
            u, w = u + b * s_, w - a * s_
            x, y = x + H * u, y + H * w
            rows4.append((x, y, u, w))
        z = np.array(rows4)
        add(
            "pairs",
            f"a Boris orbit that turns by {turn:g} in a step",
            "own loop: a rotation of the velocity",
            even(H, 301),
            z[:, :2],
            z[:, 2:],
            wanted="said",
            says="rotat|magnetic|Boris|turns",
            stride=None,
            true=("coupled",),
            mass=[M, M],
        )


def outside() -> None:
    """What outside programs do to their times, positions and forces."""
    for n in (400, 1000):
        now, q, v = 0.0, 0.3, 0.7 / M
        rows, times = [(q, v)], [0.0]
        for i in range(1, n + 1):
            to = i * H
            while now < to:
                h = min(H, to - now)
                q, v = position_verlet(q, v, h, W2)
                now = to if h < H else now + h
                if now > to:
                    break
            rows.append((q, v))
            times.append(now)
        q_, v_ = np.array(rows).T
        add(
            "outside",
            f"REBOUND to i h with exact_finish_time, {n} frames",
            "own loop: position Verlet whose last step before i h is what is left to it",
            np.array(times),
            q_,
            v_,
            schemes=("position-verlet",),
            mass=M,
            stiffness=K,
        )
    q, v = march(kick_drift, 300, 0.1, W2)
    single = q.astype(np.float32)
    for shift in (np.float32(1.7), np.float32(2.5)):
        moved = (single + shift).astype(np.float32).astype(float)
        add(
            "outside",
            f"GROMACS: positions in single precision, shifted by {shift:g} after",
            "own loop",
            even(0.1, 301),
            moved,
            v.astype(np.float32).astype(float),
            schemes=("semi-implicit-euler",),
            mass=M,
            wanted="listed",
        )
    for c in (0.05, 0.5):
        q0, v0 = 0.3, 0.7 / M
        f = -K * q0 - c * v0
        rows = [(q0, v0)]
        for _ in range(400):
            half = v0 + H / 2 * f / M
            q0 = q0 + H * half
            f = -K * q0 - c * half
            v0 = half + H / 2 * f / M
            rows.append((q0, v0))
        q, v = np.array(rows).T
        add(
            "outside",
            f"LAMMPS fix viscous, c {c:g}",
            "own loop: friction of the half-step velocity",
            even(H, 401),
            q,
            v,
            wanted="listed",
            schemes=("velocity-verlet",),
            says="half.step|half a step ago",
            true=("friction", "frames"),
            mass=M,
            stiffness=K,
        )
