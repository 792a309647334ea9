"""Which integrator an engine really runs: rows of engines.csv, measured by `springcheck`'s commands alone.

    python validation/engines/table.py --method own:euler
    python validation/engines/table.py --method 'pymunk:*' --engine validation/engines/pymunk_.py
    python validation/engines/table.py --method command:mine --command 'mine=./mine {scene} {out}'

Each row is read from the states of springs, not from what the engine says.  `run` gives the states of
`spring` (m = k = 1, h = 0.1) and `spring-uneven` (m = 3.7, k = 2.9), `identify` the scheme, or `run` where it
names none and every verdict on the declared one has passed, and `simulate` at other steps the limit.  Of a
thermostat (`--thermostats`) `run` judges the scheme and gives the temperatures of 1,000 springs at
h omega = 0.5 and friction times step 0.4.  Rows of methods that are not given stay as they are; a new one is
added at the end.
"""

from __future__ import annotations

import csv
import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import springcheck
from springcheck import schemes
from springcheck.cli import main as command
from springcheck.errors import SpringcheckError

FOLDER = Path(__file__).parent
TABLE = FOLDER / "engines.csv"

WRONG = "DECLARED OTHERWISE"
"""Note of a row whose states are not those of the declared scheme."""

COLUMNS = (
    "method", "about", "version", "thermostat", "scheme", "claimed", "velocity", "substeps", "friction",
    "det", "precision", "limit", "amplitude", "configurational", "kinetic", "forces", "note", "command",
)  # fmt: skip

MASS, STIFFNESS, THERMAL, H_OMEGA, GAMMA_H, SPRINGS, STEPS = 3.7, 2.9, 1.7, 0.5, 0.4, 1000, 1000
"""The springs of thermostats."""

NO_VERSION = ("engine", "method", "velocity", "draws", "generator", "seed", "threads")
"""What a store says of a run beside versions."""

SHORT, FEWEST = 12, 5
"""Steps of the runs by which a limit is found, and the fewest frames of one that the engine ends."""

TEMPERATURES = ("configurational", "kinetic")


def document(*words: str) -> dict[str, Any]:
    """The JSON document of a command; SystemExit where it fails."""
    out = StringIO()
    with redirect_stdout(out):
        status = command([*words, "--json"])
    if not out.getvalue():
        raise SystemExit(status)
    found: dict[str, Any] = json.loads(out.getvalue())
    return found


def heated() -> str:
    """The text of a scene of many equal springs at typical thermal states."""
    q, p = np.random.default_rng(62).standard_normal((2, SPRINGS))
    scene = springcheck.spring(
        m=np.full(SPRINGS, MASS), k=np.full(SPRINGS, STIFFNESS), q=np.sqrt(THERMAL / STIFFNESS) * q,
        p=np.sqrt(MASS * THERMAL) * p, step=H_OMEGA * float(np.sqrt(MASS / STIFFNESS)), steps=STEPS,
    )  # fmt: skip
    return scene.to_toml()


def rows(methods: Sequence[str], brings: Sequence[str]) -> list[dict[str, str]]:
    """A row for each method that these labels or globs name."""
    chosen = [word for one in methods for word in ("--method", one)]
    blog = document("run", "spring", *chosen, *brings, "-o", "blog.h5")
    uneven = document("run", "spring-uneven", *chosen, *brings, "-o", "uneven.h5")
    orbits, runs = springcheck.read("blog.h5"), springcheck.read("uneven.h5")
    calls = {one["method"]: one["force_calls"] / max(one["steps"], 1) for one in uneven["runs"]}
    failed = {one["method"] for one in (*blog["verdicts"], *uneven["verdicts"]) if one["passed"] is False}
    out = []
    for name, run in runs.items():
        row = _named(run) | {"forces": f"{calls[name]:.3g}", "thermostat": "none"}
        end = orbits[name].q[-1, 0], orbits[name].p[-1, 0]
        row |= {"amplitude": f"{np.hypot(*end):.4f}", "limit": "-"}
        solver = {"scheme": "adaptive", "precision": "double"}
        row |= _identified(run) | {"limit": _limit(run)} if run.tolerance is None else solver
        if name in failed:
            row["note"] = WRONG
        elif row["scheme"] == "":
            # every verdict on the declared scheme has passed
            row["scheme"] = row["claimed"]
        out.append({"note": ""} | row)
    return out


def _named(run: Any) -> dict[str, str]:
    """What the store says of a run: method, versions, and the scheme that it is declared with."""
    known = run.origin
    versions = [f"{name} {known[name]}" for name in known if name not in NO_VERSION]
    return {
        "method": run.label, "about": known["method"], "version": ", ".join(versions),
        "claimed": schemes.title(run.scheme),
    }  # fmt: skip


def _identified(run: Any) -> dict[str, str]:
    """What the states of `spring-uneven` show."""
    found = springcheck.identify(run, mass=MASS, stiffness=STIFFNESS)
    area = float(np.linalg.det(_step(run))) - 1
    offset, friction = found.velocity_offset, found.friction[0] if found.friction and found.fits else 0.0
    names = [found.scheme] if found.scheme else list(dict.fromkeys(x.scheme for x in found.candidates))
    return {
        "scheme": " or ".join(map(schemes.title, names)),
        "velocity": "-" if np.isnan(offset) else "synchronised" if offset == 0 else f"{offset:+g} of a step",
        "substeps": str(found.stride or "-"),
        "friction": "0" if abs(friction) < 1e-9 else f"{friction:+.3g}",
        "det": "0" if abs(area) < (1e-6 if found.precision == "single" else 1e-12) else f"{area:+.3g}",
        "precision": found.precision,
    }


def _step(run: Any) -> Any:
    """The one-step matrix (2, 2) that fits the states best."""
    z = np.stack([run.q[:, 0], run.p[:, 0]])
    return z[:, 1:] @ np.linalg.pinv(z[:, :-1])


def _limit(run: Any) -> str:
    """The least h omega from which the one-step map grows: 0 where it does at the first that is tried."""
    omega, least = np.sqrt(STIFFNESS / MASS), 1e-6 if run.arithmetic.name == "double" else 1e-4
    scene = springcheck.load_scene("spring-uneven")

    def grows(turn: float) -> bool:
        try:
            short = springcheck.simulate(scene.replace(step=float(turn / omega), steps=SHORT), run.label)
        except SpringcheckError:
            return True
        if len(short.t) < FEWEST:
            return True
        matrix = _step(short)
        area = np.linalg.det(matrix)
        return bool(area > 1 + least or abs(np.trace(matrix)) > 1 + area + least)

    low = 0.0
    for high in np.arange(1, 41) / 10:
        if grows(high):
            break
        low = float(high)
    else:
        return "none up to 4"
    for _ in range(16 * bool(low)):
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return f"{low:.4f}"


def thermostats(methods: Sequence[str], brings: Sequence[str]) -> list[dict[str, str]]:
    """A row for each thermostat that these labels or globs name."""
    chosen = [word for one in methods for word in ("--method", one)]
    Path("springs.toml").write_text(heated(), encoding="utf-8")
    bath = ["--temperature", str(THERMAL), "--friction", str(GAMMA_H / H_OMEGA * np.sqrt(STIFFNESS / MASS))]
    found = document("run", "springs.toml", *bath, "--seed", "26", *chosen, *brings, "-o", "bath.h5")
    failed = {one["method"] for one in found["verdicts"] if one["passed"] is False}
    heat = {one["method"]: one for one in found["temperatures"]}
    out = []
    for name, run in springcheck.read("bath.h5").items():
        row = _named(run)
        row |= {x: f"{heat[name][x]:.4f} +- {heat[name][f'{x}_error']:.1g}" for x in TEMPERATURES}
        shown = "none that is known" if name in failed else row["claimed"]
        row |= {"thermostat": row["claimed"], "scheme": shown, "precision": run.arithmetic.name}
        out.append(row | {"note": WRONG if name in failed else ""})
    return out


def main() -> int:
    """Measure the rows and put them into the table."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--method", action="append", required=True, metavar="LABEL")
    parser.add_argument("--thermostats", action="store_true", help="the labels name thermostats")
    for name in ("engine", "command", "scheme"):
        parser.add_argument(f"--{name}", action="append", default=[])
    given = parser.parse_args()
    files = [str(Path(one).resolve()) for one in given.engine]
    brings = [x for name in ("command", "scheme") for one in getattr(given, name) for x in (f"--{name}", one)]
    # plug-ins of this folder import what they share from it
    sys.path.insert(0, str(FOLDER))
    with TemporaryDirectory() as folder, chdir(folder):
        measure = thermostats if given.thermostats else rows
        found = measure(given.method, [*brings, *(x for one in files for x in ("--engine", one))])
    with TABLE.open(encoding="utf-8") as file:
        table = {row["method"]: row for row in csv.DictReader(file)}
    options = {name: getattr(given, name) for name in ("engine", "command", "scheme")}
    words = " ".join(f"--{name} {one}" for name, several in options.items() for one in several)
    for row in found:
        how = f"python validation/engines/table.py --method {row['method']} {words}".strip()
        before = table.get(row["method"], {})
        row["note"] = row["note"] or before.get("note", "").replace(WRONG, "")
        table[row["method"]] = dict.fromkeys(COLUMNS, "-") | row | {"command": how}
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(table.values())
    print(f"{len(found)} rows measured, {len(table)} in {TABLE.name}")
    return int(any(row["note"] == WRONG for row in found))


if __name__ == "__main__":
    sys.exit(main())
