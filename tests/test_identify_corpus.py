"""On trajectories whose truth is known no name is wrong and no sentence false: some of them, drawn by name.

`validation/identify_corpus.py` runs all of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import identify_bugs as bugs
import identify_corpus as corpus
from springcheck.errors import IdentificationError
from springcheck.identify import Identification

RIGHT = 0.95
"""Least share of the corpus on which all that is wanted is said."""

DRAWN = corpus.chosen(0.06)


@pytest.mark.parametrize("case", DRAWN, ids=lambda case: f"{case.group}, {case.name[:60]}")
def test_nothing_that_is_said_is_false(case: corpus.Case) -> None:
    found = corpus.said(case)
    assert corpus.judged(case, found) in ("right", "short", "refused"), str(found)


def test_every_case_states_how_its_truth_is_known_and_what_it_wants() -> None:
    cases = corpus.load()
    assert len(cases) > 500
    assert len({case.name for case in cases}) == len(cases)
    for case in cases:
        assert case.truth
        assert case.wanted in ("named", "listed", "undecided", "said")
        assert case.schemes or case.says
        assert set(case.true) <= set(corpus.CLAIMS)
        assert len(case.t) == len(case.q)
        assert (case.v is None) or (case.p is None)
    assert sum(file.stat().st_size for file in corpus.FOLDER.iterdir()) < 1.9e6


def test_the_corpus_has_trajectories_of_thirty_programs_of_other_people() -> None:
    """What `validation/programs` made."""
    names = [case.name for case in corpus.load() if case.group == "programs"]
    assert len({name.split(",")[0].split(":")[0].split(" ")[0].lower() for name in names}) >= 30
    today = [case.today for case in corpus.load() if case.group == "programs"]
    assert set(today) <= {"right", "short"}
    assert today.count("short") <= 23


def test_the_judge_tells_what_is_false() -> None:
    case = next(x for x in corpus.load() if x.group == "pairs" and x.wanted == "named" and x.today == "right")
    found = corpus.said(case)
    assert isinstance(found, Identification)
    assert corpus.judged(case, found) == "right"
    assert corpus.judged(replace(case, schemes=("another",)), found) == "WRONG NAME"
    nothing = replace(found, verdict="none", scheme=None, candidates=(), aliases=(), fits=False)
    assert corpus.judged(case, replace(nothing, statement="No known cause")) == "short"
    assert corpus.judged(case, replace(nothing, statement="Noise: it is")) == "FALSE SENTENCE"
    several = replace(found, verdict="not told apart", scheme=None, statement="Several schemes fit")
    assert corpus.judged(replace(case, schemes=("another",)), several) == "LISTED WITHOUT"
    assert corpus.judged(case, several) == "short"
    assert corpus.judged(case, IdentificationError("too few")) == "refused"
    assert corpus.judged(case, IdentificationError("they do not span its plane")) == "FALSE SENTENCE"


def test_clocks_are_those_of_programs() -> None:
    assert np.array_equal(corpus.clock(kind="even", h=0.1, frames=4, every=2), np.arange(0, 7, 2) * 0.1)
    t = [0.0]
    for _ in range(30):
        t.append(t[-1] + 0.1)
    assert np.array_equal(corpus.clock(kind="added", h=0.1, frames=11, every=3), t[::3])


@pytest.mark.parametrize("bug", bugs.chosen(0.1), ids=lambda bug: bug.name)
def test_bugs_of_public_threads_are_told_nothing_false(bug: bugs.Bug) -> None:
    assert bugs.judged(bug, *bugs.said(bug)) != "FALSE"


def test_bugs_are_forty_and_a_false_sentence_is_seen() -> None:
    assert len({bug.name for bug in bugs.BUGS}) == len({bug.source for bug in bugs.BUGS}) == 40
    bug = next(x for x in bugs.BUGS if x.name == "no reaction")
    assert bugs.judged(bug, "The reaction is left out", False) == "right"
    assert bugs.judged(bug, "Velocity Verlet", True) == "FALSE"
    assert bugs.judged(bug, "Noise: it is irregular", False) == "FALSE"
    assert bugs.judged(bug, "No known cause", False) == "short"


MENDED = {
    "the time is doubled", "a limit after the position has moved", "the reaction with the wrong sign",
    "no reaction", "0*5 for 0.5", "another integrator in the middle", "time in single precision",
    "stages without h", "a h for a h**2",
}  # fmt: skip


@pytest.mark.parametrize("bug", [x for x in bugs.BUGS if x.name in MENDED], ids=lambda bug: bug.name)
def test_the_cause_is_stated(bug: bugs.Bug) -> None:
    assert bugs.judged(bug, *bugs.said(bug)) == "right"
