"""Writes the trajectories of `identify_corpus.py`: loops in plain floats that share nothing with the package.

    python validation/identify_made.py [FOLDER]

Written once and kept as data; it is here to show how the truth of each case is known.  Cases that are there
already keep what was said of them when they were frozen; those of the groups "census" and "drawn", which a
generator drew whose draws change with the catalogue, and of "programs" are kept as they are.
"""

# mypy: disable-error-code="assignment,arg-type,call-arg,attr-defined,list-item,misc"

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from arguments import arguments, script
from identify_corpus import FOLDER, _case, judged, said
from identify_kept import ROWS, STATES, add, digits, even, stored
from identify_loops import KNOWN, MEMORY, MISSING, NAMED_SINCE, RK4, UNKNOWN, W2, K, M, State, march
from identify_rebuilt import rebuilt
from identify_spoiled import outside, pairs, spoiled
from springcheck.physics.arrays import Floats


def clocks() -> None:
    """t += dt, the commonest loop there is."""
    plans = [
        ("velocity Verlet", 0.1, 400, 1),
        ("velocity Verlet", 0.01, 400, 1),
        ("velocity Verlet", 0.1, 1000, 1),
        ("velocity Verlet", 0.1, 10_000, 20),
        ("velocity Verlet", 0.01, 4000, 4),
        ("semi-implicit Euler", 0.1, 400, 1),
        ("semi-implicit Euler", 0.01, 1000, 1),
        ("semi-implicit Euler", 0.1, 1500, 1),
        ("semi-implicit Euler", 0.01, 10_000, 20),
        ("drift-kick Euler", 0.1, 1000, 1),
        ("explicit Euler", 0.1, 500, 1),
        ("explicit Euler", 0.01, 1000, 1),
        ("implicit Euler", 0.1, 400, 1),
        ("implicit Euler", 0.01, 1000, 1),
        ("position Verlet", 0.1, 2000, 4),
        ("implicit midpoint", 0.1, 1000, 1),
        ("RK4", 0.1, 400, 1),
        ("RK4", 0.1, 4000, 10),
        ("RK4", 0.01, 1000, 1),
        ("Heun", 0.1, 400, 1),
        ("Forest-Ruth", 0.1, 1000, 2),
    ]
    for scheme, h, steps, every in plans:
        step, names = KNOWN[scheme]
        for stiff, m, k in ((0, M, K), (1, 0.37, 12.9)):
            if stiff and (
                steps > 1000 or every > 1 or scheme not in ("velocity Verlet", "semi-implicit Euler", "RK4")
            ):
                continue
            q, v = march(step, steps, h, k / m, every=every)
            if np.max(np.abs(q)) > 1e6:
                continue
            t = {"kind": "added", "h": h, "frames": len(q), "every": every}
            base = f"{scheme}, t += {h:g}, {steps} steps, {every} to a frame, k/m {k / m:.3g}"
            truth = "own loop that adds up its time"
            add("clocks", base, truth, t, q, v, schemes=names, stride=every, mass=m, stiffness=k)
            wanted = "named" if every == 1 and scheme != "implicit midpoint" else "listed"
            add(
                "clocks",
                f"{base}, nothing stated",
                truth,
                t,
                q,
                v,
                schemes=names,
                stride=every,
                share=base,
                wanted=wanted,
            )
    for scheme in ("velocity Verlet", "semi-implicit Euler", "RK4"):
        step, names = KNOWN[scheme]
        for h, form in ((0.1, "%.9g"), (0.05, "%.9g"), (0.01, "%.9g")):
            q, v = march(step, 400, h, W2)
            exact = np.arange(401) * h
            added = np.cumsum(np.concatenate([[0.0], np.full(400, h)]).astype(np.float32), dtype=np.float32)
            for what, t in (("a float32 n h", exact.astype(np.float32)), ("a float32 t += h", added)):
                times = np.array([float(form % float(x)) for x in t])
                add(
                    "clocks",
                    f"{scheme}, {what} of {h:g} as text of 9 digits",
                    "own loop",
                    times,
                    q,
                    v,
                    schemes=names,
                    mass=M,
                    stiffness=K,
                )


def texts() -> None:
    """Numbers as text of 10 to 17 digits."""
    forms = {
        "10 digits": "%.10g",
        "11 digits": "%.11g",
        "12 digits": "%.12g",
        "13 digits (E20.12)": "%20.12E",
        "14 digits": "%.14g",
        "15 digits (R, MATLAB, setprecision)": "%.15g",
        "16 digits": "%.16g",
        "10 decimals (CP2K)": "%20.10f",
        "12 decimals": "%.12f",
        "15 decimals": "%.15f",
    }
    for scheme, h in (
        ("velocity Verlet", 0.1),
        ("semi-implicit Euler", 0.31),
        ("RK4", 0.31),
        ("implicit midpoint", 0.2),
        ("explicit Euler", 0.05),
        ("Forest-Ruth", 0.4),
    ):
        step, names = KNOWN[scheme]
        for what, form in forms.items():
            q, v = march(step, 120, h, W2)
            add(
                "texts",
                f"{scheme}, {what}",
                "own loop, written and read back",
                even(h, 121),
                digits(q, form),
                digits(v, form),
                schemes=names,
                mass=M,
                stiffness=K,
            )
    for scheme in ("velocity Verlet", "semi-implicit Euler"):
        step, names = KNOWN[scheme]
        q, v = march(step, 600, 0.1, W2, every=3)
        for what in ("12 digits", "15 digits (R, MATLAB, setprecision)"):
            add(
                "texts",
                f"{scheme}, 3 steps to a frame, {what}, times too",
                "own loop, written and read back",
                digits(np.arange(201) * 0.3, forms[what]),
                digits(q, forms[what]),
                digits(v, forms[what]),
                schemes=names,
                stride=3,
                mass=M,
                stiffness=K,
            )


def bfloat(x: Floats) -> Floats:
    """Rounded to 8 bits, to nearest even."""
    out = []
    for y in x:
        (bits,) = struct.unpack("<I", struct.pack("<f", float(y)))
        bits = (bits + 0x7FFF + ((bits >> 16) & 1)) & 0xFFFF0000
        out.append(struct.unpack("<f", struct.pack("<I", bits))[0])
    return np.array(out)


def formats() -> None:
    """Half precision, velocities that are differences."""
    for scheme, h in (
        ("velocity Verlet", 0.31),
        ("semi-implicit Euler", 0.31),
        ("explicit Euler", 0.05),
        ("implicit Euler", 0.1),
        ("RK4", 0.9),
    ):
        step, names = KNOWN[scheme]
        q, v = march(step, 200, h, W2)
        for what, change in (("float16", lambda x: x.astype(np.float16).astype(float)), ("bfloat16", bfloat)):
            add(
                "formats",
                f"{scheme}, stored in {what}",
                "own loop in double precision, stored short",
                even(h, 201),
                change(q),
                change(v),
                schemes=names,
                wanted="listed",
                mass=M,
                stiffness=K,
            )
    f = np.float32
    for h in (1 / 60, 0.01, 0.05):
        for w2 in (1.0, 30.0):
            x0, x1 = f(0.3), f(0.31)
            rows = [(x1, (x1 - x0) / f(h))]
            for _ in range(150):
                x0, x1 = x1, f(f(x1 + f(x1 - x0)) - f(f(f(h) * f(h)) * f(f(w2) * x1)))
                rows.append((x1, f(f(x1 - x0) / f(h))))
            q, v = np.array(rows, float).T
            add(
                "formats",
                f"Stoermer-Verlet in single precision, v = dx/h, h {h:.3g}, k/m {w2:g}",
                "own loop; the map is that of semi-implicit Euler",
                even(float(f(h)), 151),
                q,
                v,
                schemes=("semi-implicit-euler",),
                wanted="listed",
            )
    for hw in (0.004, 0.009, 0.0105, 0.012, 0.0135, 0.015, 0.03, 0.1):
        h = 1 / 60
        w2 = (hw / h) ** 2
        y0, y1 = 0.3, 0.3001
        rows = [(y1, (y1 - y0) / h)]
        for _ in range(200):
            y0, y1 = y1, y1 + (y1 - y0) - h * h * w2 * y1
            rows.append((y1, (y1 - y0) / h))
        q, v = np.array(rows).T
        add(
            "formats",
            f"Stoermer-Verlet, v = (x - x0)/h, h omega {hw:g}",
            "own loop; the map is that of semi-implicit Euler, velocities carry eps x/h",
            even(h, 201),
            q,
            v,
            schemes=("semi-implicit-euler",),
            mass=1.0,
            stiffness=w2,
        )


ONE_STEP_CLASS = r"one-step|one step|stability function|order [0-9]|not known here"


def families() -> None:
    """What a catalogue may lack."""
    for name, (step, schemes) in MISSING.items():
        for h in (0.1, 0.5):
            q, v = march(step, 120, h, W2)
            add(
                "families",
                f"{name}, h {h:g}",
                "own loop",
                even(h, 121),
                q,
                v,
                schemes=schemes,
                says=ONE_STEP_CLASS,
                mass=M,
                stiffness=K,
            )
    for name, step in UNKNOWN.items():
        for h in (0.1, 0.5):
            q, v = march(step, 120, h, W2)
            add(
                "families",
                f"{name}, h {h:g}",
                "own loop",
                even(h, 121),
                q,
                v,
                wanted="named" if name in NAMED_SINCE else "said",
                schemes=NAMED_SINCE.get(name, ()),
                says=ONE_STEP_CLASS,
                mass=M,
                stiffness=K,
            )
    for name, rows in two_step(0.1).items():
        q, v = np.array(rows).T
        add(
            "families",
            name,
            "own loop",
            even(0.1, len(q)),
            q,
            v,
            wanted="said",
            says=MEMORY,
            true=("frames",) if name == "Beeman" else (),
            mass=M,
            stiffness=K,
        )


def two_step(h: float) -> dict[str, list[State]]:
    """Schemes that remember more than a state."""
    w2, n = W2, 200
    out: dict[str, list[State]] = {}
    start = (0.3, 0.7 / M)
    rows = [start, RK4(*start, h, w2)]
    for _ in range(n - 1):
        (a, b), (q, v) = rows[-2:]
        rows.append((q + h * (1.5 * v - 0.5 * b), v - h * w2 * (1.5 * q - 0.5 * a)))
    out["AB2"] = rows
    rows = [start, RK4(*start, h, w2)]
    for _ in range(n - 1):
        (a, b), (q, v) = rows[-2:]
        x, u, d = (4 * q - a) / 3, (4 * v - b) / 3, 2 * h / 3
        u = (u - d * w2 * x) / (1 + d * d * w2)
        rows.append((x + d * u, u))
    out["BDF2"] = rows
    for name, (am, af) in {
        "HHT, alpha -0.1": (0.0, 0.1),
        "generalised alpha, rho 0.8": ((2 * 0.8 - 1) / 1.8, 0.8 / 1.8),
    }.items():
        gamma = 0.5 - am + af
        beta = (1 - am + af) ** 2 / 4
        q, v = start
        acc = -w2 * q
        rows = [start]
        for _ in range(n):
            # (1 - am) acc' + am acc + w2 ((1 - af) q' + af q) = 0
            free = q + h * v + h * h * (0.5 - beta) * acc
            new = -(am * acc + w2 * ((1 - af) * free + af * q)) / (1 - am + (1 - af) * w2 * h * h * beta)
            q, v, acc = free + h * h * beta * new, v + h * ((1 - gamma) * acc + gamma * new), new
            rows.append((q, v))
        out[name] = rows
    q, v = start
    held = -w2 * q
    rows = [start]
    for _ in range(n):
        q = q + h * v + h * h / 6 * (4 * -w2 * q - held)
        new = -w2 * q
        old = rows[-1][0] * -w2
        v = v + h / 6 * (2 * new + 5 * old - held)
        held = old
        rows.append((q, v))
    out["Beeman"] = rows
    return out


def coarse_runs() -> None:
    """Coarse numbers and a stride that nobody stated."""
    rng = np.random.default_rng(20261122)
    every = {name: (step, names) for name, (step, names) in MISSING.items()}
    every |= {name: (step, NAMED_SINCE.get(name, ())) for name, step in UNKNOWN.items()}
    for name, (step, names) in every.items():
        for _ in range(4):
            stride, hw = int(rng.integers(1, 9)), float(np.exp(rng.uniform(np.log(0.03), np.log(0.9))))
            w2, form = (hw / 0.1) ** 2, str(rng.choice(["single", "%.6g", "%.8g"]))
            start = (float(rng.normal()), float(rng.normal()) * hw / 0.1)
            q, v = march(step, 100 * stride, 0.1, w2, start, stride)
            if np.max(np.abs(q)) > 1e6:
                continue
            q, v = (
                x.astype(np.float32).astype(float) if form == "single" else digits(x, form) for x in (q, v)
            )
            add(
                "coarse",
                f"{name}, {stride} steps to a frame, h omega {hw:.3g}, {form}",
                "own loop",
                even(0.1 * stride, 101),
                q,
                v,
                wanted="listed" if names else "said",
                schemes=names,
                says=r"not known here|one-step|exact",
                stride=None,
                true=("adaptive",),
            )


def joints() -> None:
    """Implicit Euler as physics engines write it for joints."""
    for h in (1 / 60, 0.01, 0.1):
        for k in (K, 400.0):
            w2 = k / M
            runs: dict[str, Callable[[float, float], State]] = {}

            def soft(q: float, v: float, h: float = h, k: float = k) -> State:
                """Box2D, Jolt, Rapier: soft constraint, gamma and bias."""
                gamma = 1 / (h * (0.0 + h * k))
                bias = q * h * k * gamma
                mass = 1 / (1 / M + gamma)
                total = 0.0
                for _ in range(8):
                    impulse = -mass * (v + bias + gamma * total)
                    total += impulse
                    v += impulse / M
                return q + h * v, v

            def xpbd(q: float, v: float, h: float = h, k: float = k) -> State:
                """XPBD: compliance 1/(k h**2)."""
                x = q + h * v
                tilde = 1 / (k * h * h)
                x += (1 / M) * (-x / (1 / M + tilde))
                return x, (x - q) / h

            def vbd(q: float, v: float, h: float = h, k: float = k) -> State:
                """Vertex block descent: one Newton step of the incremental potential."""
                y = q + h * v
                x = y
                for _ in range(3):
                    x = x - (M / h**2 * (x - y) + k * x) / (M / h**2 + k)
                return x, (x - q) / h

            def differences(q: float, v: float, h: float = h, w2: float = w2) -> State:
                """Newton with a Jacobian by differences."""
                x, u = q, v
                for _ in range(6):
                    r0, r1 = x - q - h * u, u - v + h * w2 * x
                    j = (w2 * (x + 1e-6) - w2 * x) / 1e-6
                    du = (-r1 + h * j * r0) / (1 + h * h * j)
                    u, x = u + du, x - r0 + h * du
                return x, u

            runs = {"soft constraint": soft, "XPBD": xpbd, "VBD": vbd, "Newton by differences": differences}
            for name, one in runs.items():
                rows = [(0.3, 0.7 / M)]
                for _ in range(120):
                    rows.append(one(*rows[-1]))
                q, v = np.array(rows).T
                base = f"{name}, h {h:.3g}, k {k:g}"
                add(
                    "joints",
                    base,
                    "own loop",
                    even(h, 121),
                    q,
                    v,
                    schemes=("implicit-euler",),
                    mass=M,
                    stiffness=k,
                )
                add(
                    "joints",
                    f"{base}, blind",
                    "own loop",
                    even(h, 121),
                    q,
                    v,
                    schemes=("implicit-euler",),
                    wanted="listed",
                    share=base,
                )
                rows = [(0.3, 0.7 / M)]
                for _ in range(120):
                    a, b = differences(*rows[-1], h=h / 2)
                    rows.append(differences(a, b, h=h / 2))
            q, v = np.array(rows).T
            add(
                "joints",
                f"two half steps, Jacobian by differences, h {h:.3g}, k {k:g}",
                "own loop",
                even(h, 121),
                q,
                v,
                schemes=("implicit-euler",),
                stride=2,
                mass=M,
                stiffness=k,
            )


def main() -> None:
    """Write the cases."""
    folder = Path(arguments(__doc__, folder=str(FOLDER)).folder)
    before = folder / "cases.json"
    known = {x["name"]: x for x in json.loads(before.read_text(encoding="utf-8"))} if before.exists() else {}
    for group in (clocks, texts, formats, families, coarse_runs, joints, spoiled, pairs, outside, rebuilt):
        group()
    names = {x["name"] for x in ROWS}
    assert len(names) == len(ROWS)
    kept = [x for x in known.values() if x["group"] in ("census", "drawn", "programs")]
    # drawn by the generator of another day: kept as they are
    with np.load(folder / "states.npz") as file:
        states = {name: file[name] for name in file.files}
    for row in kept:
        for name, old in row["arrays"].items():
            if "at" not in old:
                continue
            first, *shape = old["at"]
            flat = states[old["width"]][first : first + math.prod(shape)]
            row["arrays"][name] = stored(flat.reshape(shape).astype(np.float64))
    ROWS.extend(kept)
    arrays = {name: np.concatenate(parts) for name, parts in STATES.items()}
    for row in ROWS:
        old = known.get(row["name"], {})
        row["today"] = old.get("today") or judged(one := _case(row, arrays), said(one))
    np.savez_compressed(folder / "states.npz", **arrays)
    lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in ROWS)
    before.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    print(len(ROWS), "cases;", sum(x.nbytes for x in arrays.values()), "bytes of numbers")


if __name__ == "__main__":
    script(main)
