"""The census of `identify`, in short: `validation/identify_census.py` runs thousands."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import identify_census as census
import identify_corpus as corpus
from springcheck.errors import IdentificationError
from springcheck.identify import Identification, identify

DRAWN = [case for case in corpus.load() if case.group == "census"]


@pytest.mark.campaign
@pytest.mark.parametrize("case", DRAWN, ids=lambda case: case.name.split(":")[0])
def test_what_was_wrong_once_is_right(case: corpus.Case) -> None:
    """As data: another catalogue draws other trajectories; `why` in the facts says what was wrong."""
    found = corpus.said(case)
    assert not isinstance(found, IdentificationError)
    made = SimpleNamespace(**case.facts)
    assert census.judged(made, found, case.facts["hidden"]) == case.facts["said"]
    assert corpus.judged(case, found) == "right"


def test_a_motion_that_dies_within_a_few_frames_of_single_precision_excludes_no_scheme() -> None:
    q, v, frames = 3.1, 0.7, []
    for i in range(12 * 50):
        if i % 12 == 0:
            frames.append((q, v))
        v = (v - 1.9 * (q - 0.721)) / 2.9
        q = q + v
    q_, v_ = np.array(frames).astype(np.float32).astype(float).T
    found = identify(12.0 * np.arange(50), q_, v=v_)
    assert found.undecided
    assert found.statement.startswith("The motion shows in 3 frames, too few to exclude a scheme; what fits")
    assert [(x.scheme, x.stride) for x in found.candidates] == [("implicit-euler", 12)]


def test_a_block_has_no_wrong_name_no_false_fit_and_no_wrong_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(census, "BLOCK", 8)
    found = census.block(24)
    assert sum(found["counts"].values()) >= 7
    assert not [text for text in found["wrong"] if text.split(":")[0].isupper()]
    assert sum(n for key, n in found["counts"].items() if key.endswith("named")) >= 4


def test_the_census_tells_a_wrong_name_from_a_right_one() -> None:
    draw = census.Draw(np.random.default_rng([4, 0]))
    t, q, v = draw.move()
    found = census.identify(t, q, v=v, mass=draw.m)
    assert census.judged(draw, found, hidden=False) in (
        "named",
        "not told apart",
        "error seen",
        "cause named",
    )
    draw.scheme = "another"
    draw.error = ""
    assert census.judged(draw, found, hidden=False) in ("WRONG NAME", "LISTED WITHOUT IT", "none")
    draw.error, draw.second = "noise", ""
    assert (census.judged(draw, found, hidden=False) == "FALSE FIT") == found.fits


def drawn(words: str) -> list[corpus.Case]:
    return [case for case in corpus.load() if case.group == "drawn" and words in case.name]


@pytest.mark.parametrize("case", drawn("positions alone"), ids=lambda case: case.name.split(":")[0])
def test_positions_at_rounded_times_are_named(case: corpus.Case) -> None:
    found = corpus.said(case)
    assert isinstance(found, Identification)
    assert corpus.judged(case, found) == "right"
    assert (found.verdict, found.fits) == ("named", True)


def test_a_missing_frame_of_a_coarse_file_is_no_rounding_of_many_steps() -> None:
    (case,) = drawn("a frame of text is missing")
    found = corpus.said(case)
    assert isinstance(found, Identification)
    assert not found.fits


def test_a_thermostat_in_single_precision_is_no_rounding_of_velocities_rebuilt_over_fine_steps() -> None:
    x, u, w2, h, rows = (
        -5.371141823906391,
        -0.001129309300689361,
        9.205808740534945e-06,
        8.760972271142174,
        [],
    )
    warm = u * u + w2 * x * x
    for _ in range(101):
        rows.append((x, u))
        u -= h / 2 * w2 * x
        x += h * u
        u -= h / 2 * w2 * x
        u *= np.sqrt(1 + 1.8836766e-4 * (0.5 * warm / u**2 - 1))
    q, v = (census.written(y, "single") for y in np.array(rows).T)
    assert not identify(h * np.arange(101), q, v=v, mass=1.0, stiffness=w2).fits


@pytest.mark.parametrize("case", drawn("times begin late"), ids=lambda case: case.name.split(":")[0])
def test_times_that_begin_late_leave_the_interval_uncertain(case: corpus.Case) -> None:
    # the times' digits show the interval to 1e-12, and velocities count in positions an interval: a
    # symplectic Euler was "Velocity Verlet without its first half kick", held forces were no known scheme
    found = corpus.said(case)
    assert isinstance(found, Identification)
    assert census.judged(SimpleNamespace(**case.facts), found, False) == "named"
    # nor do they excuse more than they leave open
    assert case.v is not None
    assert not identify(case.t, case.q, v=case.v * (1 + 1e-9), **case.stated).fits


def test_few_frames_of_text_exclude_no_scheme() -> None:
    (case,) = drawn("few frames of text")
    found = corpus.said(case)
    assert isinstance(found, Identification)
    assert corpus.judged(case, found) == "right"
    assert (found.scheme, found.fits, found.undecided) == (None, False, True)
    assert "frames of text, too few to exclude a scheme" in found.statement
    assert case.v is not None
    with pytest.raises(IdentificationError, match=r"give [0-9]+ frames or more that show it"):
        identify(case.t, case.q, v=1.5 * case.v, mass=case.stated["mass"])


def test_a_kick_in_six_frames_leaves_its_cause_open() -> None:
    """Powers of the state with as many coefficients as there are pairs of frames explain anything."""
    q, v, h, frames = 14.2, 3.1, 0.242, []
    for i in range(46):
        if i % 9 == 0:
            frames.append((q, v))
        if i == 22:
            v *= 1 + 2.2e-9
        v -= h / 2 * (q - 15.5)
        q += h * v
        v -= h / 2 * (q - 15.5)
    q_, v_ = np.array(frames).T
    found = identify(9 * h * np.arange(6), q_, v=v_, mass=1.0)
    assert found.statement.startswith("What one map leaves over")
    assert found.statement.endswith("too few to show its cause")


def test_a_motion_that_dies_in_a_few_frames_of_many_is_not_interrupted_by_these() -> None:
    """The frames at rest make no motion from which the others could depart."""
    q, v, h, k, frames = 0.9, 0.4, 1.36, 1.0, []
    for i in range(153):
        if i % 8 == 0:
            frames.append((q, v))
        pull = k * (1 + 8.4e-7 * ((q + 0.156) / 1.2) ** 2)
        v = (v - h * pull * (q + 0.156)) / (1 + h * h * pull)
        q += h * v + 1.5e-11
    q_, v_ = np.array(frames).T
    found = identify(8 * h * np.arange(20), q_, v=v_, mass=1.0, stiffness=k)
    assert not found.fits
    assert "The motion is one" not in found.statement
