"""What is too small to show in a piece of a run in a bath shows in all, and how small it may be is said.

The laws of sums of draws are held against the same statistics of all draws at once, and against many
repetitions under the null hypothesis.
"""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from springcheck import checks
from springcheck.bath import chance
from springcheck.cli import main
from springcheck.physics.trajectory import Trajectory, Verdict
from springcheck.studies.faults import baths
from springcheck.studies.faults.seeded import Fault

BEYOND_ONE = 0.15865525393145707
"""Chance of a normal number above 1."""


def pieces_of(run: Trajectory, many: int) -> list[Trajectory]:
    """Pieces of a run, each of which begins with the last frame of the one before."""
    edges = np.linspace(0, len(run.t) - 1, many + 1).astype(int)
    found = []
    for first, last in pairwise(edges):
        rows, end = slice(first, last + 1), last == edges[-1]
        outcome = run.outcome if end else replace(run.outcome, step=int(last), status="continued")
        assert run.energy is not None
        found.append(
            replace(
                run, t=run.t[rows], q=run.q[rows], p=run.p[rows], energy=run.energy[rows], outcome=outcome
            )
        )
    return found


def judged(fault: Fault, size: float | None, steps: int, many: int, n: int = 3) -> dict[str, Verdict]:
    scene = baths.springs(n, steps=steps)
    run = fault.run(scene, size=size, seed=5)
    each = [checks.judge(scene, piece, piece=True) for piece in pieces_of(run, many)]
    return {v.check: v for v in checks.shared(checks.worst(each))}


@pytest.mark.parametrize("name", ["baoab", "obabo", "bbk", "bussi", "andersen"])
def test_noise_a_little_too_large_shows_in_all_pieces_of_a_run_together(name: str) -> None:
    """Each piece alone has an excess of two to four standard errors of its variance."""
    size = {"bussi": 0.05, "andersen": 0.06}.get(name, 0.03)
    fault = Fault("", "", (), lambda c: baths.played(c, baths.by(1 + c.x)), scheme=name, size=size)
    found = judged(fault, size, 12_000, 12)["draws-variance"]
    assert found.passed is False
    assert f"of {36_000 if name == 'baoab' else ''}" in found.why
    right = judged(fault, 0.0, 12_000, 12)
    assert [v.check for v in right.values() if v.passed is False] == []


@pytest.mark.parametrize("name", ["baoab", "obabo", "gj-i", "andersen"])
def test_draws_that_are_cut_off_at_four_show_by_the_two_largest(name: str) -> None:
    """No moment shows them: one draw of 16,000 is changed, by 0.2 in the mean."""
    fault = Fault("", "", (), lambda c: baths.played(c, lambda x: np.clip(x[-1], -4, 4)), scheme=name)
    found = judged(fault, None, 4_000 if name != "andersen" else 12_000, 1, n=40)
    assert [v.check for v in found.values() if v.passed is False] == ["draws-largest"]
    assert "largest 4.0000" in found["draws-largest"].why


def test_draws_drawn_again_beyond_three_and_a_half_show_by_the_largest() -> None:
    """Of 80,000 draws 37 are expected beyond."""

    def again(right: list[np.ndarray]) -> np.ndarray:
        x = right[-1]
        return np.where(np.abs(x) > 3.5, 0.5 * x, x)

    fault = Fault("", "", (), lambda c: baths.played(c, again), scheme="baoab")
    for many in (1, 10):
        assert judged(fault, None, 4_000, many, n=20)["draws-largest"].passed is False


HOT_AND_COLD = {
    "half of the run": lambda i, n: np.where(i < n / 2, 1, -1),
    "every second step": lambda i, n: np.where(i % 2, 1, -1),
    "every third step": lambda i, n: np.where(i % 3 == 0, 1.4, -0.7),
    "to and fro": lambda i, n: np.sqrt(2) * np.sin(i / 7),
}
"""Deviations, of mean 0 and mean square 1, of the number i of n."""


@pytest.mark.parametrize("name", ["baoab", "obabo", "bussi"])
@pytest.mark.parametrize("when", HOT_AND_COLD)
def test_noise_that_is_right_in_the_mean_alone_is_seen(name: str, when: str) -> None:
    """Too hot by a tenth and too cold by as much, or pushed to and fro, by turns; it passed."""
    for number, check in enumerate(("draws-variance", "draws-mean")):

        def draws(right: list[np.ndarray], number: int = number) -> np.ndarray:
            # of all draws of a step alike
            step = (len(right) - 1) // (2 if name == "obabo" else 1)
            off = 0.1 * HOT_AND_COLD[when](step, 24_000)
            return right[-1] * np.sqrt(1 + off) if number == 0 else right[-1] + off

        fault = Fault("", "", (), lambda c, draws=draws: baths.played(c, draws), scheme=name)
        for many in (1, 10) if name == "baoab" and when == "half of the run" else (1,):
            found = judged(fault, None, 24_000, many)
            if name == "bussi":
                # one number a step acts on the energies of all alike
                assert [v.check for v in found.values() if v.passed is False], found[check]
            else:
                assert found[check].passed is False, found[check]
                assert "not alike all along" in found[check].why


def test_sums_over_pieces_are_the_statistics_of_all_draws() -> None:
    rng = np.random.default_rng(7)
    x, y = rng.standard_normal((60, 5)), rng.standard_normal((2, 60, 5))
    errors = np.full(x.shape, 1e-12)
    cases: list[tuple[chance.Statistic, ...]] = [
        (chance.mean(x), chance.mean(x[:20]), chance.mean(x[20:])),
        (chance.variance(x), chance.variance(x[:20]), chance.variance(x[20:])),
        (chance.largest(x, errors), chance.largest(x[:20], errors[:20]), chance.largest(x[20:], errors[20:])),
        (chance.foretold(x[None], y),
         chance.foretold(x[None, :20], y[:, :20]), chance.foretold(x[None, 20:], y[:, 20:])),
        (chance.count(9, 60, 0.1), chance.count(2, 20, 0.1), chance.count(7, 40, 0.1)),
    ]  # fmt: skip
    for whole, one, other in cases:
        both = one + other
        assert both.chance == pytest.approx(whole.chance, rel=1e-12)
        assert both.found[1] == whole.found[1]
        assert (both.draws, both.pieces, both.tests) == (whole.draws, 2, 3)
    # each piece is normalised by itself, and what stands at its ends has one neighbour less
    for of in (chance.shape, chance.neighbours):
        parts = [of(part) for part in (x[:20], x[20:])]
        assert (parts[0] + parts[1]).draws == x.size


def test_chances_of_sums_are_those_of_their_null() -> None:
    rng = np.random.default_rng(11)
    found: dict[str, list[float]] = {}
    names = ("mean", "variance", "neighbours", "largest", "count", "steady", "pushed", "shape")
    for x in rng.standard_normal((1500, 4, 300)):
        sums = [
            [chance.mean(part) for part in x], [chance.variance(part) for part in x],
            [chance.neighbours(part) for part in x],
            [chance.largest(part, np.full(part.shape, 1e-13)) for part in x],
            [chance.count(int(np.sum(part > 1)), 300, BEYOND_ONE) for part in x],
            [chance.steady(chance.variance(part), chance.normal_sizes(part)) for part in x.reshape(4, -1, 3)],
            [chance.steady(chance.mean(part), part) for part in x.reshape(4, -1, 3)],
        ]  # fmt: skip
        if len(found.get("shape", [])) < 400:
            sums.append([chance.shape(part) for part in x])
        for name, parts in zip(names, sums, strict=False):
            found.setdefault(name, []).append(sum(parts[1:], parts[0]).chance)
    for name, chances in found.items():
        for level in (0.5, 0.1, 0.01):
            share = np.mean(np.array(chances) <= level)
            assert share < level + 5 * np.sqrt(level / len(chances)), name
            if name in names[:3]:
                assert share > level - 5 * np.sqrt(level / len(chances)), name


def test_what_is_as_large_as_the_limit_of_detection_is_seen_in_19_runs_of_20() -> None:
    rng, alarm = np.random.default_rng(3), 1e-7
    for draws in (50, 2000):
        known = chance.variance(np.ones(draws))
        seen = known.sees(alarm).temperature
        assert seen is not None
        squares = (1 + seen) * rng.chisquare(draws, 4000)
        chances = [replace(known, sums=(float(x),)).chance for x in squares]
        assert np.mean(np.array(chances) > alarm) == pytest.approx(chance.MISSED, abs=0.02)
    for steps, x in ((4000, 0.3), (40_000, 0.02)):
        rare = chance.count(0, steps, float(-np.expm1(-x)))
        seen = rare.sees(alarm).friction
        assert seen is not None
        hits = rng.binomial(steps, -np.expm1(-x * (1 + seen)), 4000)
        chances = [replace(rare, sums=(int(k),)).chance for k in hits]
        assert np.mean(np.array(chances) > alarm) == pytest.approx(chance.MISSED, abs=0.02)


def test_a_report_says_the_least_temperature_that_its_draws_would_have_shown() -> None:
    right = Fault("", "", (), baths.played, scheme="andersen")
    whole, apart = (judged(right, None, 3_000, many) for many in (1, 4))
    assert whole["draws-variance"].sees.temperature == pytest.approx(0.23, abs=0.05)
    assert whole["collisions"].sees.friction == pytest.approx(0.15, abs=0.05)
    # four pieces cost a little of their rate
    for check, name in (("draws-variance", "temperature"), ("collisions", "friction")):
        one, four = (getattr(found[check].sees, name) for found in (whole, apart))
        assert 1 < four / one < 1.1
    assert "a temperature off by" in whole["draws-variance"].reason


def test_a_statistic_is_in_no_document_and_no_pickle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its law is a function: documents of runs in a bath were refused."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "spring", "--method", "own:baoab", "--temperature", "1", "--json"]) == 0
    (mean,) = (one for one in json.loads(capsys.readouterr().out)["verdicts"] if one["check"] == "draws-mean")
    assert "statistic" not in mean
    fault = Fault("", "", (), lambda c: baths.played(c, baths.by(1 + c.x)), scheme="baoab", size=0.0)
    verdict = judged(fault, 0.0, 200, 1)["draws-mean"]
    assert verdict.statistic is not None
    again = pickle.loads(pickle.dumps(verdict))
    assert again == verdict
    assert again.statistic is None
