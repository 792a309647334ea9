"""Claim: on trajectories whose truth is known without `identify`, no name is wrong and no sentence false.

    python validation/identify_corpus.py [SHARE [GROUP]]

The trajectories lie in `data/reference/identify`: `cases.json` states of each how its truth is known, what
is told of it, what is expected, and where in `states.npz` its numbers lie; `load` puts the two together.
They are data, so that no change of the catalogue changes them; own loops and other programs made them.

SHARE is the part that is run (1: all; tests run 0.1, drawn by the names).  What is said of each is judged:

    right           the scheme is named, or listed, or the sentence names the cause, whichever is expected
    short           nothing is false, and something is missing
    refused         nothing is said, for a reason that may be true
    WRONG NAME      a scheme is named, or said to fit, that is not the one
    FALSE SENTENCE  the first sentence, or the refusal, claims something that is not so
    LISTED WITHOUT  several schemes are listed, and not the one

A sentence is false where it makes a claim (`CLAIMS`) that is none of the case's own.  A name or a list beside
which "or a scheme that is not known here" stands is short of the truth where it lacks the scheme, not wrong.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import time
import warnings
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from arguments import arguments, script
from springcheck.errors import IdentificationError, SpringcheckError
from springcheck.identify import Identification, identify
from springcheck.physics.arrays import Floats

FOLDER = Path(__file__).parent.parent / "data" / "reference" / "identify"

CLAIMS = {
    "scale": r"velocities (were|would have to be|are) [-0-9.e+]+ times|several schemes would fit",
    "unit": r"another unit|kcal|kJ|degrees|CHARMM|ASE's|Angstrom|femtosecond",
    "kicks": r"full kicks|without its (first|second) half kick|old force",
    "halves": r"halves swapped|drift of (half|two)",
    "stage": r"RK4 (whose|with|without)|Heun's method whose|midpoint method whose",
    "iteration": r"fixed-point iteration|position is moved by the old velocity",
    "step": r"times are|step taken is|sign of the step",
    "friction": r"negative friction|c/m = |friction .*was not|and a friction",
    "stiffness": r"stiffness .*times|stiffer by|another spring|softer by",
    "mass": r"mass is left out|treated as a velocity|divided by the mass",
    "plane": r"span its plane|record more of the motion",
    "noise": r"^Noise|takes noise",
    "time": r"changes in time|alternat",
    "anharmonic": r"anharmonic|not linear in (the )?position|clipped",
    "drag": r"drag|not linear in the velocity|depends on the velocity",
    "constant": r"constant (added|beside)|has a constant",
    "coupled": r"coupled",
    "frames": r"but not (in|from) frame|is missing|are missing|does not belong|changed places"
    r"|frame \d+.* is wrong|repeated|jumps|one kick",
    "late": r"one (step|frame) (behind|ahead)|half a step",
    "clock": r"not at a constant interval",
    "adaptive": r"adaptive",
    "straight": r"no force acts|straight line",
}
"""What sentences claim, by the words that do so."""


RANKS = {"WRONG NAME": 0, "FALSE SENTENCE": 1, "LISTED WITHOUT": 1, "refused": 2, "short": 2, "right": 3}
"""How good each judgement is: less is worse."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One trajectory and what is expected of it."""

    name: str
    group: str
    truth: str
    """What it is, and how that is known."""
    t: Floats
    """Times (f,)."""
    q: Floats
    """Positions (f, n)."""
    v: Floats | None
    p: Floats | None
    stated: dict[str, Any]
    """What is told: `mass`, `stiffness`, `friction`, `step`."""
    wanted: str
    """"named", "listed" (or named), "undecided" (or listed), or "said": the sentence names the cause."""
    schemes: tuple[str, ...]
    """Names of the scheme, all that share its map; none where no scheme of a catalogue made it."""
    stride: int | None
    says: str
    """What the first sentence has to match where it is to name the cause."""
    true: tuple[str, ...]
    """Keys of `CLAIMS` that are true of it."""
    today: str
    """What was said of it when it was frozen."""
    facts: dict[str, Any]
    """What else is known."""


@cache
def load() -> tuple[Case, ...]:
    """All cases, in the order of the file."""
    rows = json.loads((FOLDER / "cases.json").read_text(encoding="utf-8"))
    with np.load(FOLDER / "states.npz") as file:
        states = {name: file[name] for name in file.files}
    return tuple(_case(row, states) for row in rows)


def _case(row: dict[str, Any], states: dict[str, Any]) -> Case:
    arrays: dict[str, Any] = {"v": None, "p": None}
    for name, stored in row["arrays"].items():
        if "kind" in stored:
            arrays[name] = clock(**stored)
            continue
        first, *shape = stored["at"]
        flat = states[stored["width"]][first : first + math.prod(shape)].astype(np.float64)
        arrays[name] = flat.reshape(shape)[..., stored.get("column", slice(None))]
    known = ("name", "group", "truth", "stated", "wanted", "stride", "says", "today")
    return Case(
        **arrays, **{x: row[x] for x in known}, schemes=tuple(row["schemes"]), true=tuple(row["true"]),
        facts=row["facts"],
    )  # fmt: skip


def clock(*, kind: str, h: float, frames: int, every: int = 1, start: float = 0.0) -> Floats:
    """Times (frames,) of a program, one frame in `every` steps: n h ("even"), or t += h ("added")."""
    steps = (frames - 1) * every
    if kind == "even":
        return np.asarray(start + np.arange(0, steps + 1, every) * h, np.float64)
    return np.cumsum(np.concatenate([[start], np.full(steps, h)]))[::every]


def said(case: Case) -> Identification | IdentificationError:
    """What `identify` says, or why it refuses."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return identify(case.t, case.q, case.p, v=case.v, **case.stated)
        except IdentificationError as error:
            return error


def claims(text: str) -> set[str]:
    """What a sentence claims."""
    return {name for name, words in CLAIMS.items() if re.search(words, text)}


def judged(case: Case, found: Identification | IdentificationError) -> str:
    """Whether what was said is right, short of it, or false."""
    text = str(found) if isinstance(found, IdentificationError) else found.statement
    wrong = claims(text) - set(case.true)
    if re.search("to tell (which|whether)", text) and claims(text) & set(case.true):
        # one of several, and a true one among them
        wrong = set()
    named = bool(case.says) and re.search(case.says, text, re.IGNORECASE) is not None
    if isinstance(found, IdentificationError):
        return "FALSE SENTENCE" if wrong else "right" if named else "refused"
    own = set(case.schemes)
    names = {y for x in found.candidates for y in (x.scheme, *x.aliases)}
    if found.undecided and (case.wanted in ("undecided", "said") or case.facts.get("hidden")):
        return "WRONG NAME" if found.scheme and not {found.scheme, *found.aliases} & own else "right"
    hedged = "not known here" in text
    if found.scheme and not {found.scheme, *found.aliases} & own:
        return "short" if hedged else "WRONG NAME"
    if found.fits and case.wanted == "said" and not (case.facts.get("hidden") or (own and named)):
        return "short" if hedged else "WRONG NAME"
    if wrong and not (found.scheme and found.fits):
        return "FALSE SENTENCE"
    if case.wanted == "said" or found.verdict == "none":
        return "right" if named else "short"
    if found.scheme is None and not names & own:
        return "short" if hedged else "LISTED WITHOUT"
    if not any(case.stride in (None, x.stride) for x in found.candidates if _same(x, case)):
        return "short" if hedged else "LISTED WITHOUT"
    return "right" if found.fits and (found.scheme or case.wanted != "named") else "short"


def _same(candidate: Any, case: Case) -> bool:
    return bool({candidate.scheme, *candidate.aliases} & set(case.schemes))


def chosen(share: float, group: str = "") -> list[Case]:
    """The cases of a group, or of all, of which a share is drawn by their names' digests."""
    cases = [x for x in load() if group in ("", x.group)]
    if not cases:
        raise SpringcheckError(f"no group {group!r}; there are {', '.join({x.group: 0 for x in load()})}")
    return [x for x in cases if int(hashlib.sha256(x.name.encode()).hexdigest()[:8], 16) < share * 2**32]


def main() -> None:
    """Print what is not right, and the counts by group."""
    given = arguments(__doc__, share=1.0, group="")
    counts: Counter[tuple[str, str]] = Counter()
    begun = time.process_time()
    for case in chosen(given.share, given.group):
        found = said(case)
        what = judged(case, found)
        counts[case.group, what] += 1
        if what != "right":
            text = str(found) if isinstance(found, IdentificationError) else found.statement
            print(f"{what:15s}{case.group}: {case.name}: {text[:230]}")
    for name in dict.fromkeys(group for group, _ in counts):
        print(f"{name:12s}", "; ".join(f"{n} {what}" for (group, what), n in counts.items() if group == name))
    total: Counter[str] = Counter()
    for (_, what), n in counts.items():
        total[what] += n
    print(f"{'all':12s}", "; ".join(f"{n} {what}" for what, n in total.most_common()))
    print(f"{sum(total.values())} trajectories, {time.process_time() - begun:.0f} s")


if __name__ == "__main__":
    script(main)
