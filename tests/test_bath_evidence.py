"""Tests of draws: chances are those of their null or larger, and each rejects the faults that it is for.

Seeds are those at which a test was written, none of them chosen.
"""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bathed as baths
from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS, evidence
from springcheck.bath.evidence import Known
from springcheck.cli import main
from springcheck.identify import scenes
from springcheck.physics import scenefile
from springcheck.physics.arrays import Floats
from springcheck.physics.trajectory import Trajectory, Verdict
from textbook import Case as Broken
from textbook import Fault

RNG = np.random.default_rng


def statistics(x: Floats, *, uniform: bool = False) -> dict[str, evidence.Statistic]:
    """The tests of draws x (f, n), with momenta that forget slowly, of the draws themselves."""
    p = np.zeros_like(x)
    for i in range(1, len(x)):
        p[i] = 0.97 * p[i - 1] + 0.25 * x[i - 1]
    state = [Known("the momentum", p), Known("its size", np.abs(p) - np.sqrt(2 / np.pi), of_sizes=True)]
    found = evidence.ties(x, np.full(x.shape, 1e-14))
    assert found is not None
    return {
        "size": evidence.size(x, uniform=uniform),
        "independence": evidence.independence(x, evidence.known_before(x, state)),
        "shape": evidence.shape(x, uniform=uniform), "ties": found,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("f", "n", "uniform"), [(60, 1, False), (40, 8, False), (60, 1, True), (40, 8, True)]
)
def test_right_draws_are_as_seldom_unlikely_as_is_said(f: int, n: int, uniform: bool) -> None:
    rng, found, repeats = RNG(8), dict[str, list[float]](), 1000
    for _ in range(repeats):
        x = np.sqrt(12) * (rng.random((f, n)) - 0.5) if uniform else rng.standard_normal((f, n))
        for name, one in statistics(x, uniform=uniform).items():
            found.setdefault(name, []).append(one.chance)
    for name, chances in found.items():
        for level in (0.5, 0.1, 0.01):
            share, room = np.mean(np.array(chances) <= level), 5 * np.sqrt(level / repeats)
            assert share < level + room, (name, level)
            # of one column of normal draws the chance of their size is exact
            assert name != "size" or n > 1 or uniform or share > level - room


def test_the_chance_of_a_number_of_collisions_is_that_of_the_binomial_distribution() -> None:
    for n, p in ((9, 0.3), (1, 0.6)):
        each = np.array([math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(n + 1)])
        for i in range(n + 1):
            sides = np.sum(each[: i + 1]), np.sum(each[i:])
            assert evidence.hits(i, n, p).chance == pytest.approx(min(1, 2 * min(sides)), rel=1e-12)


def uniform(x: Floats) -> Floats:
    """Uniform numbers of the rank of normal ones."""
    from scipy.special import ndtr

    return np.asarray(np.sqrt(12) * (ndtr(x) - 0.5))


def normal(x: Floats) -> Floats:
    """Normal numbers of the rank of uniform ones."""
    from scipy.special import ndtri

    return np.asarray(ndtri(x / np.sqrt(12) + 0.5))


WRONG: dict[str, tuple[Callable[[Floats], Floats], str]] = {
    "5 % too large": (lambda x: 1.05 * x, "size"),
    "1.9 times too large": (lambda x: 1.9 * x, "size"),
    "one column is too hot and one too cold": (lambda x: x * np.sqrt([1.12, 1, 1, 0.88]), "size"),
    "off centre": (lambda x: (x + 0.05) / np.sqrt(1.0025), "independence"),
    "opposite in two columns": (lambda x: x + 0.08 * np.array([1, 0, 0, -1]), "independence"),
    "a part of the one before": (lambda x: (x + 0.05 * np.roll(x, 1, axis=0)) / np.sqrt(1.0025),
                                 "independence"),
    "shared by neighbours": (lambda x: x * np.sqrt(0.9) + np.sqrt(0.1) * x[:, :1] * [0, 1, 1, 1] +
                             (1 - np.sqrt(0.9)) * x * [1, 0, 0, 0], "independence"),
    "uniform": (uniform, "shape"),
    "cubed a little": (lambda x: (x + 0.1 * x**3) / np.sqrt(1.75), "shape"),
    "skewed": (lambda x: (x + 0.1 * (x**2 - 1)) / np.sqrt(1.02), "shape"),
    "lopsided": (lambda x: np.copysign(x, np.abs(x) - np.sqrt(2 * np.log(2))), "shape"),
    "of a table": (lambda x: np.round(x / 1e-4) * 1e-4, "ties"),
    "cut off": (lambda x: np.clip(1.004 * x, -2.8, 2.8), "ties"),
    "used again 500 rows later": (lambda x: np.concatenate([x[:500], x[:500], x[1000:]]), "ties"),
    "opposite 500 rows later": (lambda x: np.concatenate([x[:500], -x[:500], x[1000:]]), "ties"),
    "of 15 bits": (lambda x: np.sqrt(2) * np.round(x / np.sqrt(2) * 2**13) / 2**13, "ties"),
}  # fmt: skip
"""What is wrong with draws (10,000, 4), and the one test that rejects them."""


@pytest.mark.parametrize("name", WRONG)
def test_wrong_draws_are_rejected_by_one_test(name: str) -> None:
    """A noise of another size is that, and nothing else."""
    change, by = WRONG[name]
    x = change(RNG(12).standard_normal((10_000, 4)))
    found = {what: one.chance for what, one in statistics(x).items()}
    assert {what for what, one in found.items() if one < 1e-8} == {by}, found


def test_numbers_of_single_precision_are_no_ties_and_those_of_few_digits_are_not_judged() -> None:
    x = np.sqrt(12) * (RNG(4).random((50_000, 2), np.float32).astype(np.float64) - 0.5)
    found = evidence.ties(x, np.full(x.shape, 1e-15))
    assert found is not None
    assert found.chance > 1e-4
    assert evidence.ties(x, np.full(x.shape, 1e-6)) is None
    assert evidence.ties(np.full((3, 1), np.nan), np.zeros((3, 1))) is None


def test_sums_over_pieces_are_the_statistics_of_all_draws() -> None:
    rng = RNG(7)
    x, y = rng.standard_normal((2, 60, 5))
    known, none = Known("the force", y), np.zeros((60, 5))
    for of in (
        lambda rows: evidence.size(x[rows]),
        lambda rows: evidence.independence(x[rows], [Known(known.what, y[rows])]),
        lambda rows: evidence.hits(int(np.sum(x[rows, 0] > 1)), len(x[rows]), 0.16),
        lambda rows: evidence.ties(x[rows], none[rows]),
    ):
        whole, both = of(slice(None)), of(slice(20)) + of(slice(20, None))
        if whole.law.__qualname__.startswith("ties"):
            assert both.sums[::2] == whole.sums[::2]
        else:
            assert both.chance == pytest.approx(whole.chance, rel=1e-12)
            assert both.found[1] == whole.found[1]
    # each piece is scaled by itself
    assert (evidence.shape(x[:20]) + evidence.shape(x[20:])).sums[-1] == x.size


def test_an_error_as_large_as_the_limit_of_detection_is_seen_in_19_runs_of_20() -> None:
    rng, alarm = RNG(3), 1e-7
    for draws in (50, 2000):
        known = evidence.size(np.ones((draws, 1)))
        seen = known.sees(alarm).temperature
        assert seen is not None
        squares = (1 + seen) * rng.chisquare(draws, 4000)
        chances = [replace(known, sums=(np.array([x]), known.sums[1])).chance for x in squares]
        assert np.mean(np.array(chances) > alarm) == pytest.approx(evidence.MISSED, abs=0.02)
    for steps, x in ((4000, 0.3), (40_000, 0.02)):
        rare = evidence.hits(0, steps, float(-np.expm1(-x)))
        seen = rare.sees(alarm).friction
        assert seen is not None
        hits = rng.binomial(steps, -np.expm1(-x * (1 + seen)), 4000)
        chances = [replace(rare, sums=(int(k), steps)).chance for k in hits]
        assert np.mean(np.array(chances) > alarm) == pytest.approx(evidence.MISSED, abs=0.02)


@pytest.mark.parametrize("scheme", ["baoab", "baoa"])
def test_a_drag_without_its_noise_is_seen_from_the_stated_limit_on(scheme: str) -> None:
    """It is missed in a run of 20; a tenth of it is seen in none."""
    at = baths.springs(3, steps=2000)
    x = baths.forgetting(at)

    def judged(seed: int, off: float) -> Verdict:
        right_noise = baths.by(np.sqrt(np.expm1(-2 * x) / np.expm1(-2 * x * (1 + off))))
        broken = Broken(scene=at, scheme=THERMOSTATS[scheme], seed=seed, x=0.0)
        run = baths.played(broken, right_noise, rate=1 + off)
        return checks.shared([checks.bath.draws_independent(checks.Case(trajectory=run, scene=at))])[0]

    limit = judged(0, 0.0).sees.friction
    assert limit is not None
    assert 0.2 < limit < 0.8
    for off, least, most in ((limit, 10, 12), (-limit, 10, 12), (0.1 * limit, 0, 0)):
        seen = sum(judged(seed, off).passed is False for seed in range(12))
        assert least <= seen <= most


def pieces_of(run: Trajectory, many: int) -> list[Trajectory]:
    """Pieces of a run, each of which begins with the last frame of the one before."""
    edges = np.linspace(0, len(run.t) - 1, many + 1).astype(int)
    found = []
    for first, last in pairwise(edges):
        rows, end = slice(first, last + 1), last == edges[-1]
        outcome = run.outcome if end else replace(run.outcome, step=int(last), status="continued")
        assert run.energy is not None
        part = {"t": run.t[rows], "q": run.q[rows], "p": run.p[rows], "energy": run.energy[rows]}
        found.append(replace(run, **part, outcome=outcome))  # type: ignore[arg-type]
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


def test_a_report_states_the_least_temperature_that_its_draws_would_have_shown() -> None:
    right = Fault("", "", (), baths.played, scheme="andersen")
    whole, apart = (judged(right, None, 3_000, many) for many in (1, 4))
    assert whole["draws-variance"].sees.temperature == pytest.approx(0.23, abs=0.05)
    assert whole["collisions"].sees.friction == pytest.approx(0.15, abs=0.05)
    # pieces cost nothing
    for check, name in (("draws-variance", "temperature"), ("collisions", "friction")):
        one, four = (getattr(found[check].sees, name) for found in (whole, apart))
        assert four == pytest.approx(one, rel=0.01)


def test_a_statistic_is_in_no_document_and_no_pickle(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "spring", "--method", "own:baoab", "--temperature", "1", "--json"]) == 0
    verdicts = json.loads(capsys.readouterr().out)["verdicts"]
    assert "statistic" not in next(one for one in verdicts if one["check"] == "draws-variance")
    fault = Fault("", "", (), lambda c: baths.played(c, baths.by(1 + c.x)), scheme="baoab", size=0.0)
    verdict = judged(fault, 0.0, 200, 1)["draws-variance"]
    assert verdict.statistic is not None
    again = pickle.loads(pickle.dumps(verdict))
    assert again == verdict
    assert again.statistic is None


FAULTS: dict[str, tuple[str, Callable[[Broken], Trajectory], set[str]]] = {
    "noise of an old friction": (
        "baoab", lambda c: baths.played(c, baths.by(1.889)), {"draws-variance"}),
    "normal numbers on a grid of 0.03": (
        "baoab", lambda c: baths.played(c, lambda x: np.round(x[-1] / 0.03) * 0.03), {"draws-differ"}),
    "the same of a scheme of two draws": (
        "obabo", lambda c: baths.played(c, lambda x: np.round(x[-1] / 0.03) * 0.03), {"draws-differ"}),
    "no root of the mass": (
        "baoab", lambda c: baths.played(c, baths.by(1 / np.sqrt(c.scene.m))), {"draws-variance"}),
    "collisions without it": (
        "andersen", lambda c: baths.played(c, baths.by(1 / np.sqrt(c.scene.m))), {"draws-variance"}),
    "coloured": ("bbk", lambda c: baths.played(c, lambda x: (
        (x[-1] + 0.2 * x[-2]) / np.sqrt(1.04) if len(x) > 3 else x[-1])), {"draws-independent"}),
    "shared by all": ("aboba", lambda c: baths.played(c, lambda x: np.full(c.scene.n, x[-1][0])),
                      {"draws-independent", "draws-differ"}),
    "begun anew": ("gj-ii", lambda c: baths.played(c, lambda x: x[(len(x) - 1) % 4000]), {"draws-differ"}),
    "coins": ("baoab", lambda c: baths.played(c, lambda x: np.sign(x[-1])),
              {"draws-shape", "draws-differ"}),
    "heavy tails": ("baoab", lambda c: baths.played(c, baths.of_rank(baths.heavy)), {"draws-shape"}),
    "uniform collisions": ("andersen-after", lambda c: baths.played(c, baths.of_rank(
        lambda u: np.sqrt(12) * (u - 0.5))), {"draws-shape"}),
    "normal noise in LAMMPS' place": (
        "lammps-langevin", lambda c: baths.played(c, lambda x: normal(x[-1])),
        {"draws-shape"}),
    "a force too large": ("obabo", lambda c: baths.played(c, k=1.15), {"draws-independent"}),
    "friction": ("baoab", lambda c: baths.played(c, rate=0.5), {"draws-independent", "draws-variance"}),
    "collisions too often": ("andersen", lambda c: baths.played(c, collision=1.2), {"collisions"}),
    "no last half kick": ("baoab", lambda c: baths.played(c, runs=THERMOSTATS["baoab"].acts[:-1]),
                          {"noise-direction"}),
}  # fmt: skip
"""A fault of a thermostat: the scheme that it claims, its run, and the checks that it fails."""


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_fails_its_checks_and_no_other(name: str) -> None:
    scheme, make, wanted = FAULTS[name]
    scene = baths.springs(3, steps=8000)
    run = make(Broken(scene=scene, scheme=THERMOSTATS[scheme], seed=11, x=0.0))
    assert {v.check for v in checks.judge(scene, run) if v.passed is False} - {"energies"} == wanted


SHOWN = {
    "noise of an old friction": "the noise is 1.8",
    "no root of the mass": "the noise of the coordinates is ",
    "shared by all": "the random numbers of coordinate 1 are the same as those of coordinate 0",
    "begun anew": "the random numbers from row 4000 on are those from row 0 on, again",
    "a force too large": "the force is not that of the scene",
    "friction": "the drag is not the one that the friction asks for",
    "collisions too often": "times as often as the friction asks",
}
"""What the draws of a fault show."""


@pytest.mark.parametrize("name", SHOWN)
def test_the_draws_of_a_fault_show_it(name: str) -> None:
    """The noise of an old friction was also draws that repeat, that go with the forces and of a period."""
    scheme, make, _ = FAULTS[name]
    scene = baths.springs(3, steps=8000)
    run = make(Broken(scene=scene, scheme=THERMOSTATS[scheme], seed=11, x=0.0))
    assert SHOWN[name] in scenes.diagnosis(scene, run, 0)


@pytest.mark.parametrize("name", ["baoab", "obabo", "bbk", "gj-i-half", "lammps-langevin", "andersen"])
def test_the_same_without_a_fault_passes(name: str) -> None:
    scene = baths.springs(3, steps=8000)
    run = baths.played(Broken(scene=scene, scheme=THERMOSTATS[name], seed=11, x=0.0))
    assert [v.why for v in checks.judge(scene, run) if v.passed is False] == []


@pytest.mark.parametrize(
    ("where", "what"),
    [(lambda q, p: np.sign(p), "the momentum"), (lambda q, p: np.sign(q), "the force"),
     (lambda q, p: np.sign(np.abs(p) - 0.674), "the size of the momentum")],
)  # fmt: skip
@pytest.mark.parametrize("name", ["baoab", "obabo"])
def test_noise_whose_strength_depends_on_the_state_is_seen(name: str, where: Any, what: str) -> None:
    """Too hot by 15 % in one half of the states and too cold in the other; all else of it is right."""
    from springcheck.bath import Stepper
    from springcheck.bath.stepper import forces

    scene = replace(scenefile.load_scene("bath-spring"), steps=20_000)
    stepper, rng = Stepper.of(THERMOSTATS[name], scene, width=np.float64), RNG(7)
    size, push, states = np.sqrt(scene.m * scene.thermal), forces(scene.system), [(scene.q, scene.p)]
    for _ in range(scene.steps):
        q, p = states[-1]
        draws = np.sqrt(1 + 0.15 * where(q, p / size)) * rng.standard_normal((stepper.scheme.draws, 1))
        states.append(stepper(q, p, push, list(draws), False))
    q, p = (np.array(x, np.float64) for x in zip(*states, strict=True))
    run = replace(driver.run(scene, f"own:{name}", seed=1), q=q, p=p, energy=scene.system.energy(q, p))
    (failed,) = (v for v in checks.judge(scene, run) if v.passed is False)
    assert failed.check == "draws-independent"
    assert f"the size of draws with {what}," in failed.why


def test_noise_below_rounding_hides_the_draws_and_not_the_map() -> None:
    far = replace(baths.springs(3, steps=30), q=np.full(3, 1e12))
    for given, hidden in (({}, True), ({"k": 1 + 1e-9}, False), ({"h": 1 + 1e-9}, False)):
        run = baths.played(Broken(scene=far, scheme=THERMOSTATS["baoab"], seed=3, x=0.0), **given)
        said = {v.check: v for v in checks.judge(far, run)}
        assert said["noise-direction"].passed is hidden
        assert said["draws-variance"].passed is None
        assert "rounding hides the draws" in said["draws-variance"].why


LABELS = ("own:baoab", "own:aoboa", "own:oabao", "own:gj-i-half", "own:andersen", "own:bbk", "own:bussi",
          "openmm:langevin-middle-bath", "ase:langevin", "ase:bussi", "lammps:csvr")  # fmt: skip


@pytest.mark.parametrize("label", LABELS)
def test_experiments_with_seeds_pass_for_what_is_right(label: str) -> None:
    if reason := engines.absence(label.partition(":")[0]):
        pytest.skip(reason)
    found = checks.judge_thoroughly(baths.springs(3), label, driver.run, seed=5)
    assert [v.why for v in found if v.passed is False] == []
    assert sum(v.passed is True for v in found) >= (1 if "andersen" in label or ":csvr" in label else 2)


SEEDED: dict[str, tuple[Sequence[str], dict[str, float]]] = {
    "a friction off by 1e-9": (["noise-map", "noise-matrix"], {"rate": 1 + 1e-9}),
    "a temperature off by 2e-12": (["noise-matrix"], {"thermal": 1 + 2e-12}),
    "a step off by 1e-9": (["noise-map", "noise-matrix"], {"h": 1 + 1e-9}),
}


@pytest.mark.parametrize("name", [*SEEDED, "a power of the temperature"])
def test_experiments_with_seeds_reject_what_is_wrong(name: str) -> None:
    by, given = SEEDED.get(name, (["noise-size", "noise-matrix"], {}))

    def make(c: Broken) -> Trajectory:
        return baths.played(c, **(given or {"thermal": c.scene.thermal**1e-9}))  # type: ignore[arg-type]

    fault = Fault("", "", (), make, scheme="baoab")
    found = [check(baths.subject(fault, None)) for check in checks.experiments_of(baths.springs(3))]
    assert [v.check for v in found if v.passed is False] == by
