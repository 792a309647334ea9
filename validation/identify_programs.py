"""Keeps trajectories of other people's programs in the corpus of `identify_corpus.py`, group "programs".

    python validation/identify_programs.py FOLDER

One spring, m = 3.7, k = 2.9, every step recorded, by 32 programs: springs attached and methods called in
`programs/` (Python packages, `programs.mjs` for node, `programs.cpp` for GSL and Boost, `programs.R`,
`programs.m`), each with a line of JSON for a trajectory.  FOLDER has what they printed, `*.jsonl`.

The truth is the program's own documentation or source, and a second look where these disagree: GSL's rk2
returns its result of third order and its rk4 two half steps; desolver's "Symplectic Forward Euler" is
velocity Verlet; deSolve's embedded methods are of order 1 with `varstep=FALSE` (the error of two steps falls
by 4.1 to 4.2 where the step is halved), and its implicit ones add -1e-10 to a velocity, from a Jacobian by
differences; Rebound.js takes its first slope where the last stage of the step before was.

Each is kept twice: with mass and stiffness stated, and with nothing.  Printed: 246 trajectories, 223 right,
23 short of it (solvers that choose their steps, of which nothing false is said), nothing false.
"""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from identify_corpus import FOLDER, _case, judged, said
from identify_kept import ROWS, STATES, add, even
from springcheck.errors import SpringcheckError
from springcheck.identify.hypothesis import aliases
from springcheck.schemes import SCHEMES

SAYS = {
    "memory": r"memory|solver of several orders",
    "adaptive": r"solver",
    "drag": r"drag",
    "constant": r"constant added to the velocity",
    "unknown": r"one-step method that is not known here",
    "symmetric": r"keeps areas and is symmetric",
    **{f"order {n}": rf"of order {n}," for n in range(1, 8)},
}
"""What the first sentence has to say of what no scheme of a catalogue made."""

TRUE = {
    "memory": ("frames",),
    "adaptive": ("frames", "adaptive"),
    "drag": ("drag",),
    "constant": ("constant",),
}
"""Claims that are true of them."""

SAME = {"rk2-heun": ("rk2-midpoint", "rk2-heun"), "trapezoidal": ("implicit-midpoint", "trapezoidal")}


def keep(line: dict[str, Any]) -> None:
    """Add one trajectory, stated and blind."""
    scheme, _, stride = line["scheme"].partition(":")
    t = np.array(line["t"]) if "t" in line else even(line["h"], len(line["q"]))
    kind = scheme in SAYS
    schemes = () if kind else SAME.get(scheme, (scheme, *(aliases(scheme) if scheme in SCHEMES else ())))
    name = line["name"]
    facts = {"stride": int(stride or 1)}
    common: dict[str, Any] = {
        "truth": "the program's source: programs/, and identify_programs.py",
        "schemes": schemes, "stride": None if scheme == "exact" or kind else int(stride or 1),
        "says": SAYS.get(scheme, ""), "true": TRUE.get(scheme, ()), "facts": facts,
    }  # fmt: skip
    friction = {"friction": line["friction"]} if "friction" in line else {}
    wanted = "said" if kind else "listed"
    add("programs", name, t=t, q=line["q"], v=line["v"], wanted=wanted, mass=line["m"], stiffness=line["k"],
        **friction, **common)  # fmt: skip
    add("programs", f"{name}, blind", t=t, q=line["q"], v=line["v"], wanted=wanted, share=name, **common)


def main() -> None:
    """Append what is not kept yet, and print what is said of it."""
    given = arguments(__doc__, folder="")
    printed = sorted(Path(given.folder).glob("*.jsonl")) if given.folder else []
    if not printed:
        raise SpringcheckError(
            "a FOLDER with *.jsonl is needed: without one all that is kept would be dropped"
        )
    rows = json.loads((FOLDER / "cases.json").read_text(encoding="utf-8"))
    rows = [row for row in rows if row["group"] != "programs"]
    with np.load(FOLDER / "states.npz") as file:
        for name in file.files:
            STATES[name] = [file[name]]
    ends = dict.fromkeys(STATES, 0)
    for row in rows:
        for stored in row["arrays"].values():
            if "at" in stored:
                first, *shape = stored["at"]
                ends[stored["width"]] = max(ends[stored["width"]], first + int(np.prod(shape)))
    for width, parts in STATES.items():
        # those of the last time lie behind all others
        parts[0] = parts[0][: ends[width]]
    for path in printed:
        for line in path.read_text(encoding="utf-8").splitlines():
            keep(json.loads(line))
    arrays = {name: np.concatenate(parts) for name, parts in STATES.items()}
    counts: Counter[str] = Counter()
    for row in ROWS:
        case = _case(row, arrays)
        found = said(case)
        row["today"] = judged(case, found)
        counts[row["today"]] += 1
        if row["today"] != "right":
            print(row["today"], row["name"], getattr(found, "statement", found), sep=": ")
    print(len(ROWS), "trajectories:", dict(counts))
    packed: dict[str, Any] = dict(arrays)
    np.savez_compressed(FOLDER / "states.npz", **packed)
    lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in (*rows, *ROWS))
    (FOLDER / "cases.json").write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    script(main)
