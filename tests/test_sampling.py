"""The study of sampling: temperatures, precision and limits of thermostats, each beside its law."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from springcheck import engines
from springcheck.bath import THERMOSTATS
from springcheck.cli import main
from springcheck.engines.own import thermal
from springcheck.studies.sampling import STUDY, laws, measure
from springcheck.studies.sampling.result import Sampling


@pytest.fixture(autouse=True)
def _smaller(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "WIDE", 100)
    monkeypatch.setattr(measure, "SAMPLED_TURNS", np.array([0.2, 0.5, 1.2]))
    monkeypatch.setattr(measure, "FRICTIONS", np.array([0.3, 1.0, 3.0]))


def test_temperatures_errors_and_limits_lie_on_their_laws() -> None:
    one = measure.measured(engines.parse("own:obabo"))
    a = one.turn**2
    assert one.configurational_law == pytest.approx(1 / (1 - a / 4))
    assert one.kinetic_law == pytest.approx(np.ones(3))
    assert not one.departs
    assert one.limit == pytest.approx([2, 2, 2], abs=1e-5)
    assert one.limit_law == pytest.approx([2, 2, 2], abs=1e-6)
    # one a step, as of engines that keep it, and the first
    assert one.force_calls == pytest.approx(1, abs=0.01)


def test_a_friction_of_the_half_step_shortens_the_stable_step() -> None:
    """LAMMPS' fix langevin: 1 - x/2 = a/4, whose root at friction omega is sqrt(5) - 1."""
    x = np.array([0.3, 1.0, 3.0])
    expected = np.sqrt(x * x + 4) - x
    one = measure.measured(engines.parse("own:lammps-langevin"))
    assert one.limit_law == pytest.approx(expected, abs=1e-6)
    assert one.limit == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("scheme", "friction", "limit"),
    [("andersen-after-kick", 1.0, np.sqrt(2)), ("brownian", 3.0, 6.0), ("vanden-eijnden-ciccotti", 10.0, 0.4),
     ("lammps-langevin", 3.0, np.sqrt(13) - 3), ("gj-iv", 10.0, np.inf)],
)  # fmt: skip
def test_a_limit_has_all_decimals_that_are_printed(scheme: str, friction: float, limit: float) -> None:
    assert laws.limits(scheme, np.array([friction]))[0] == pytest.approx(limit, abs=2e-6)


def test_a_limit_beyond_which_growth_is_below_the_rounding_is_not_resolved() -> None:
    """Collisions in almost every step: from sqrt 2 on a step multiplies variances by less than 1 + 1e-7."""
    assert np.isnan(laws.limits("andersen-after-kick", np.array([10.0]))[0])


def test_frames_are_used_when_variances_have_settled_not_means_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Near sqrt 2 a step of Andersen's collisions keeps 0.992 of a variance and 0.75 of a mean."""
    monkeypatch.setattr(measure, "SAMPLED_TURNS", np.array([0.2, 1.4]))
    steps: list[int] = []
    run = measure.driver.run
    monkeypatch.setattr(measure.driver, "run", lambda x, *y, **z: (steps.append(x.steps), run(x, *y, **z))[1])
    measure.measured(engines.parse("own:andersen-after-kick"))
    law = laws.law_at("andersen-after-kick", np.array([1.4]), laws.RATE)
    assert float(law.growth[0]) ** (steps[1] - 500) < np.exp(-4.9)


def test_a_limit_is_rounded_down_and_a_fault_of_a_tenth_is_red() -> None:
    one = measure.measured(engines.parse("own:lammps-langevin"))
    assert "1.2360" in [str(x) for x in one.row]
    assert replace(one, kinetic=1.1 * one.kinetic).departs


def test_a_thermostat_that_is_not_its_law_fails_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thermal, "THERMOSTATS", {**THERMOSTATS, "baoab": THERMOSTATS["obabo"]})
    one = measure.measured(engines.parse("own:baoab"))
    assert one.departs
    assert Sampling(methods=(one,)).status == 1
    assert Sampling(methods=()).status == 2


def test_the_study_is_kept_shown_and_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sampling", "--method", "own:baoa", "--method", "own:bussi", "-o", "s.h5"]) == 0
    said = capsys.readouterr().out
    assert main(["inspect", "s.h5"]) == 0
    assert "own:baoa " in said
    assert "own:baoa " in capsys.readouterr().out
    found = STUDY.stored("s.h5")
    assert [x.method for x in found.methods] == ["own:baoa", "own:bussi"]
    (bank,) = found.banks()
    configurational, kinetic, limit = bank.charts
    assert [x.short.split(",")[0] for x in (configurational, kinetic)] == ["Configurational", "Kinetic"]
    # a factor of all momenta has no such law, and no line
    assert [x.name for x in configurational.curves] == ["BAOA", "own:baoa", "own:bussi"]
    assert [x.name for x in limit.curves] == ["BAOA", "own:baoa"]
    # a law is no line between six points
    assert len(limit.curves[0].x) > 50
    assert "1 of 2 schemes right to 1 %; Bussi: " in bank.foot
    assert main(["plot", "s.h5"]) == 0
    assert Path("figures/s/sampling.png").stat().st_size > 10_000
