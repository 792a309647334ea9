"""What states with rods or in a bath show where a check failed, and that right ones show nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from springcheck import driver
from springcheck.checks import Case, causes
from springcheck.physics import scenefile
from springcheck.studies.faults import baths
from springcheck.studies.faults.table import FAULTS


@pytest.mark.parametrize(
    ("name", "said"),
    [("rod-after-drift", "after the drift"), ("rod-a-step-late", "a step before"), ("rod-no-impulse", "")],
)  # fmt: skip
def test_the_way_of_a_push_is_read_off_positions(name: str, said: str) -> None:
    scene = scenefile.load_scene("dumbbell").derived(steps=60)
    fault = next(x for x in FAULTS if x.name == name)
    shown = causes.found(Case(trajectory=fault.run(scene), scene=scene))
    assert (said in shown) if said else shown == ""
    right = driver.run(scene, "own:velocity-verlet")
    assert causes.found(Case(trajectory=right, scene=scene)) == ""


@pytest.mark.parametrize("name", ["baoab", "lammps-langevin", "bussi"])
def test_right_thermostats_show_nothing_and_a_wrong_temperature_shows(name: str) -> None:
    scene = baths.springs(2, steps=800)
    run = driver.run(scene, f"own:{name}", seed=5)
    assert causes.found(Case(trajectory=run, scene=scene)) == ""
    bath = replace(scene.bath, temperature=2.25 * scene.bath.temperature)  # type: ignore[union-attr, type-var]
    shown = causes.found(Case(trajectory=run, scene=scene.derived(bath=bath)))
    assert "noise" in shown
    if name == "baoab":
        size = float(shown.split(" +- ")[0].split()[-1])
        assert np.isclose(size, 2 / 3, rtol=0.1)
