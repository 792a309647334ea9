"""The study of sampling: temperatures, precision and limits of thermostats, each beside its law."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from springcheck import engines
from springcheck.bath import THERMOSTATS
from springcheck.cli import main
from springcheck.engines.own import thermal
from springcheck.studies.sampling import measure, page
from springcheck.studies.sampling.result import Sampling


@pytest.fixture(autouse=True)
def _smaller(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(measure, "WIDE", 100)
    monkeypatch.setattr(measure, "SAMPLED_TURNS", np.array([0.2, 0.5, 1.2]))
    monkeypatch.setattr(measure, "AVERAGED_STEPS", np.array([10.0, 100.0, 500.0]))
    monkeypatch.setattr(measure, "FRICTIONS", np.array([0.3, 1.0, 3.0]))


def test_temperatures_errors_and_limits_lie_on_their_laws() -> None:
    one = measure.measured(engines.parse("own:obabo"))
    a = one.turn**2
    assert one.configurational_law == pytest.approx(1 / (1 - a / 4))
    assert one.kinetic_law == pytest.approx(np.ones(3))
    assert not one.departs
    # a root of a mean square of a hundred
    assert np.abs(one.off / one.off_law - 1).max() < 5 / np.sqrt(2 * 100)
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
    [
        ("andersen-after-kick", 1.0, np.sqrt(2)),
        ("brownian", 3.0, 6.0),
        ("vanden-eijnden-ciccotti", 10.0, 0.4),
    ],
)
def test_a_limit_has_all_decimals_that_are_printed(scheme: str, friction: float, limit: float) -> None:
    assert measure._last_stable(partial(measure._radius, scheme, friction), 1e-9) == pytest.approx(
        limit, abs=2e-6
    )


def test_a_limit_beyond_which_growth_is_below_the_rounding_is_not_resolved() -> None:
    """Collisions in almost every step: from sqrt 2 on a step multiplies variances by less than 1 + 1e-7."""
    assert np.isnan(measure._last_stable(partial(measure._radius, "andersen-after-kick", 10.0), 1e-9))
    assert measure._last_stable(partial(measure._radius, "gj-iv", 10.0), 1e-9) == np.inf


def test_frames_are_used_when_variances_have_settled_not_means_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Near sqrt 2 a step of Andersen's collisions keeps 0.992 of a variance and 0.75 of a mean."""
    monkeypatch.setattr(measure, "SAMPLED_TURNS", np.array([0.2, 1.4]))
    steps: list[int] = []
    run = measure.driver.run
    monkeypatch.setattr(measure.driver, "run", lambda x, *y, **z: (steps.append(x.steps), run(x, *y, **z))[1])
    measure.measured(engines.parse("own:andersen-after-kick"))
    law = measure.law_at("andersen-after-kick", 1.4, measure.RATE)
    assert float(law.growth[0]) ** (steps[1] - 500) < np.exp(-4.9)


def test_the_limits_of_unlike_schemes_are_told_by_both_ends() -> None:
    one = measure.measured(engines.parse("own:obabo"))
    other = replace(one, scheme="lammps-langevin", limit_law=np.array([1.7, 1.2, np.sqrt(13) - 3]))
    heading = page.banks(Sampling(methods=(one, other)))[-1].heading
    assert heading.startswith("At every friction steps are stable up to h \u03c9 = 0.606 by ")
    assert ", and up to 2 by " in heading


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
    found = measure.stored("s.h5")
    assert [x.method for x in found.methods] == ["own:baoa", "own:bussi"]
    temperatures, costs, limits = page.banks(found)
    assert [chart.short.split(",")[0] for chart in temperatures.charts] == ["Configurational", "Kinetic"]
    names = [x.name for x in temperatures.charts[0].curves]
    # a factor of all momenta has no such law, and no line
    assert names == ["BAOA", "own:baoa", "own:bussi"]
    assert len(costs.charts) == 2
    # titles are findings
    assert temperatures.heading.startswith("At h \u03c9 = 1.2 positions have their temperature to 1 % by ")
    assert " is off by 1" in costs.heading
    assert limits.heading == "Steps are stable up to h \u03c9 = 2 at every friction"
    assert [x.name for x in limits.charts[0].curves] == ["BAOA", "own:baoa"]
    assert main(["plot", "s.h5"]) == 0
    assert Path("figures/s/sampling-temperatures.png").stat().st_size > 10_000


def test_what_collisions_cost_has_a_law_too() -> None:
    """The motion is a mixture of maps, and no Gaussian one: its squares forget as collisions come."""
    one = measure.measured(engines.parse("own:andersen-after-kick"))
    assert np.abs(one.off / one.off_law - 1).max() < 5 / np.sqrt(2 * 100)
