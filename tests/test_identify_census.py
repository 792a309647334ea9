"""The census of `identify`, in short: `validation/identify_census.py` runs thousands."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from springcheck.errors import IdentificationError
from springcheck.identify import identify

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "validation"))
_spec = importlib.util.spec_from_file_location("identify_census", ROOT / "validation" / "identify_census.py")
assert _spec is not None
assert _spec.loader is not None
census = importlib.util.module_from_spec(_spec)
sys.modules["identify_census"] = census
_spec.loader.exec_module(census)


@pytest.mark.parametrize(
    ("number", "said"),
    [
        # among laws of friction the one of the stated stiffness in single precision
        (20, "named"),
        # a force held over substeps on a growing motion, whose equilibrium shows in the first frames alone
        (74, "named"),
        (207, "named"),
        (981, "named"),
        # a step in single precision: with a free scale of velocities other turns and steps would fit as well
        (109, "named"),
        (346, "named"),
        # among several schemes the one whose stiffness is nearest to the stated one
        (1019, "named"),
        # a start at 0, whose number is finer than what follows from it
        (769, "named"),
        # the same in a file of single precision, a force held over substeps
        (434, "named"),
        # a mass in single precision, not "velocities are one step ahead": that is the same map
        (891, "named"),
        # two steps to a frame, each the difference of rounded times
        (134, "named"),
        # a step in single precision in a file of single precision leaves other schemes no room
        (2059, "not told apart"),
        # what RK4 loses may be friction, to single precision
        (2130, "not told apart"),
        # drifts and noise that are there in the first frames of a growing motion
        (308, "error seen"),
        (660, "error seen"),
        # a kick within the rounding of late times, which the steps do not follow
        (886, "cause named"),
        # two errors are no noise; a wobble over less than a period is no anharmonic force for certain
        (105, "cause named"),
        (200, "error seen"),
        (544, "error seen"),
        # errors of 2e-12 over several steps to a frame, within the sum of all roundings but not irregular
        (108, "cause named"),
        (1393, "cause named"),
        (3431, "cause named"),
        (3956, "cause named"),
        # steps of an uneven clock, too even to show by itself
        (3049, "named"),
        (9948, "not told apart"),
        # on a motion that dies in four frames the excuse of one scheme is that of another's equal map
        (5803, "not told apart"),
        (21445, "not told apart"),
        # a cubic force that the first frames of a dying motion alone show
        (13070, "cause named"),
        # a wobble over two turns, which powers of the state follow as well
        (2678, "cause named"),
        (4092, "cause named"),
        # a wobble, and a cubic force, on motions that die down in a few frames
        (1247, "error seen"),
        (1177, "error seen"),
        (661, "cause named"),
        # on dying and growing motions another stiffness explains what coarse forces seemed to
        (30291, "undecided"),
        (31678, "undecided"),
        (100661, "cause named"),
        # a late clock's rounding, of which unlike steps within a frame show next to nothing
        (31801, "cause named"),
        (34781, "error seen"),
        (111774, "cause named"),
        (65287, "named"),
        (106999, "error seen"),
        # a kick in one component alone moves the equilibrium of neither
        (101841, "cause named"),
        # what falls off with the motion has no few bad frames
        (32917, "cause named"),
        (121679, "error seen"),
        (107281, "cause named"),
        # noise shows where a growing motion is smallest
        (250838, "error seen"),
        # states that come back after eight frames: alternating steps and a cubic force look alike
        (120026, "cause named"),
        (38303, "cause named"),
        (124159, "cause named"),
        (355165, "cause named"),
        # a frequency that is looked for follows what few frames miss
        (300109, "error seen"),
        (300543, "error seen"),
        (35151, "cause named"),
        (100290, "error seen"),
        # friction takes the phase of a step beyond the largest that it has without
        (32607, "named"),
        (36207, "named"),
        (121254, "named"),
        (32421, "named"),
        # steps in which large terms cancel round by the size of these
        (104125, "named"),
        (103280, "named"),
        (113587, "named"),
        # a velocity that is added up in substeps
        (31924, "named"),
        (119040, "named"),
        # near whole and half turns between frames the roots of a map are known far worse than itself
        (714102, "not told apart"),
        (250179, "named"),
        # an equilibrium has no velocity, which numbers that grow ever finer beside it show
        (101122, "named"),
        # the share of a held force tells 1/n by twice itself
        (408640, "named"),
        (411946, "named"),
        (504064, "named"),
        (505079, "named"),
        # at the largest phase of fourth-order splittings, which friction moves and rounding exceeds
        (400569, "named"),
        (502576, "named"),
        (117172, "named"),
        (204261, "named"),
        (810392, "named"),
        # an uneven clock is seen before a constant, which its steps look like
        (407594, "named"),
        (506412, "named"),
        (500265, "named"),
        # the equilibrium of a motion that grows by 1e21 shows in its first frames
        (407564, "named"),
        # several bad frames, all where the motion is largest, or smallest, are no interruptions
        (508115, "cause named"),
        (716834, "error seen"),
        # explicit Euler moves positions by no force, however that is cut off
        (826175, "cause named"),
        # a constant is no alternation, and no quadratic force, because each of these has one beside it
        (824783, "cause named"),
        # few frames: an equilibrium is as likely as friction, and makes entries more uncertain
        (1000047, "named"),
        (1000653, "named"),
        (1002702, "not told apart"),
        (1002677, "not told apart"),
        (1000205, "undecided"),
        # a motion that dies within a few frames of text
        (978850, "undecided"),
        (1302398, "undecided"),
        # 15 frames of 3 digits
        (1238164, "undecided"),
        # explicit Euler with friction g + a has the map of drift-kick Euler with g, on the same spring
        (1210084, "not told apart"),
        # a motion that dies down to numbers whose squares are 0
        (602112, "error seen"),
        # what the roundings of one scheme explain they explain of another with the same map
        (105363, "not told apart"),
    ],
)
def test_what_was_wrong_once_is_right(number: int, said: str) -> None:
    assert census.said_of(number)[1] == said


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


@pytest.mark.parametrize("number", [3065, 3071, 3379, 3481])
def test_positions_at_rounded_times_are_named(number: int) -> None:
    assert census.said_of(number, alone=True)[1] == "named"


def test_a_missing_frame_of_a_coarse_file_is_no_rounding_of_many_steps() -> None:
    draw = census.Draw(np.random.default_rng([7, 166]))
    draw.single, draw.clock = "", "even"
    t, q, v = draw.move()
    assert draw.form == "text"
    q, v = (census.written(np.delete(x, 22), "text") for x in (q, v))
    assert not identify(t[:-1], q, v=v, mass=draw.m, stiffness=draw.k).fits


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


@pytest.mark.parametrize("number", [1, 6, 22, 27, 36, 86, 101])
def test_times_that_begin_late_leave_the_interval_uncertain(number: int) -> None:
    # the times' digits show the interval to 1e-12, and velocities count in positions an interval: a
    # symplectic Euler was "Velocity Verlet without its first half kick", held forces were no known scheme
    draw = census.Draw(np.random.default_rng([77, number]))
    draw.clock = "even"
    t, q, v = draw.move()
    q, v = (census.written(x, draw.form) for x in (q, v))
    found = identify(t + 1e4, q, v=v, mass=draw.m)
    assert census.judged(draw, found, False) == "named"
    # nor do they excuse more than they leave open
    assert not identify(t + 1e4, q, v=v * (1 + 1e-9), mass=draw.m).fits


def test_few_frames_of_text_exclude_no_scheme() -> None:
    # 6 frames of 3 digits: semi-implicit Euler with friction was named implicit Euler
    assert census.said_of(1112175)[1] == "undecided"
    draw = census.Draw(np.random.default_rng([4, 1112175]), wide=True)
    t, q, v = draw.move()
    q, v = (census.written(x, "text", digits) for x, digits in zip((q, v), draw.digits, strict=True))
    found = identify(t, q, v=v, mass=draw.m, stiffness=draw.k)
    assert (found.scheme, found.fits, found.undecided) == (None, False, True)
    assert "frames of text that show the motion exclude no scheme" in found.statement
    with pytest.raises(IdentificationError, match=r"give [0-9]+ frames or more that show it"):
        identify(t, q, v=1.5 * v, mass=draw.m)
