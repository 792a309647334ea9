"""Words that name no check, scheme or fault: `springcheck explain WORD`, and the README's table."""

from __future__ import annotations

WORDS = {
    "scene": "a system, its start, its time grid, and what is recorded: a TOML file or a `Scene`",
    "engine, method": "who runs, and what it can run; a label names both: `openmm:verlet`",
    "scheme": "the mathematics of a method: its one-step map",
    "one-step map": "what takes the state (q, p) at t to the state at t + h; on a spring a 2 x 2 matrix",
    "step defect": "distance of a recorded step from the scheme's own step, evaluated in extended precision",
    "shadow energy": "the quantity near the energy that a symplectic scheme keeps exactly",
    "closed form": "the scheme's own motion after n steps, by formula",
    "verdict": "one number against one bound, with the bound's reason",
    "h omega": "the step in units of the fastest oscillation, the number that stability depends on",
    "study": "many runs and what they say together: precision, stability, extremes, faults",
    "rounding": "what a result lacks because numbers have 53 bits: half an ulp for each operation",
    "ulp": "unit in the last place: the distance of neighbouring numbers, 2**-52 of one between 1 and 2",
    "energy norm": "the size of a difference of states: the root of its energy, over that of the start",
    "ensemble": "many runs of a scene with numbers varied: `springcheck run SCENE --vary FIELD=A:B:N`",
}
"""Each with its meaning."""


def word(name: str) -> tuple[str, str] | None:
    """A word and its meaning, by its name or by the beginning of it; None where there is none."""
    asked = _bare(name)
    for known, meaning in WORDS.items():
        if asked and asked in (*map(_bare, (known, *known.split(", "))), _bare(known).split()[0].rstrip(",")):
            return known, meaning
    return None


def _bare(name: str) -> str:
    return name.lower().replace("-", " ").replace("_", " ").strip()
