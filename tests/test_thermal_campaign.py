"""The campaign at temperature, in short: `validation/thermal_campaign.py` counts thousands of cases."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "validation"))
_spec = importlib.util.spec_from_file_location(
    "thermal_campaign", ROOT / "validation" / "thermal_campaign.py"
)
assert _spec is not None
assert _spec.loader is not None
campaign = importlib.util.module_from_spec(_spec)
sys.modules["thermal_campaign"] = campaign
_spec.loader.exec_module(campaign)

WRONG_BEFORE = {
    37: ("boaob", "strided"), 104: ("gj-v", "text"), 123: ("andersen-leapfrog", "text"),
    134: ("gj-iv", "coupled"), 135: ("gj-v", "coupled"), 148: ("lammps-langevin", "coupled"),
    154: ("andersen-leapfrog", "coupled"), 185: ("andersen-leapfrog", "whole"), 292: ("gj-vii", "coupled"),
    596: ("gj-i", "coupled"), 597: ("gj-ii", "coupled"), 1031: ("gj-ii", "text"),
    40110: ("gj-viii", "text"), 60041: ("gj-iii", "strided"), 60056: ("bbk", "strided"),
    60120: ("bbk", "text"), 60212: ("gj-vi-half", "strided"), 60302: ("gj-viii", "coupled"),
    60881: ("gj-iii-half", "single"), 70073: ("lammps-langevin", "coupled"), 70451: ("gj-v-half", "strided"),
    70705: ("gj-iii-half", "coupled"), 101829: ("andersen-leapfrog", "coupled"),
    102124: ("gj-viii-half", "text"), 301471: ("lammps-langevin", "strided"),
}  # fmt: skip
"""Cases that had a wrong name, a list without the right one, nothing said or no end, with their schemes and
kinds."""

SHORT = {203931}
"""Cases whose list lacks the scheme: Andersen's collisions of one step in forty, in single precision."""


@pytest.mark.campaign
@pytest.mark.parametrize("case", WRONG_BEFORE)
def test_files_that_had_a_wrong_name_have_none(case: int) -> None:
    scheme, kind, (t, q, p, scene) = campaign.file_of(case, *WRONG_BEFORE[case])
    found = campaign.of_bath(t, q, p, None, scene.m)
    assert found is None or found.scheme in (None, scheme), kind
    if kind != "coupled" or case > 60000:
        assert found is not None
        assert scheme in [one.scheme for one in found.candidates]


@pytest.mark.campaign
@pytest.mark.parametrize("case", [71, 293, 294, 515, 10061, 10284, 10394, 10506])
def test_a_factor_of_several_steps_is_not_taken_for_collisions(case: int) -> None:
    found = campaign.files(case, wide=True)
    assert not [word for word in found if "MISSING" in word or "WRONG" in word]


@pytest.mark.parametrize("case", [1000, 1031, 1062, 1093, 1124])
def test_a_file_of_each_kind_has_no_wrong_name(case: int) -> None:
    scheme, _, (t, q, p, scene) = campaign.file_of(case)
    found = campaign.of_bath(t, q, p, None, scene.m)
    assert found is None or found.scheme in (None, scheme)


def test_a_campaign_goes_on_where_it_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "HERE", tmp_path)
    campaign.add("alarms", 3)
    known = campaign.add("alarms", 2)
    assert known["cases"] == 5
    assert known["found"]["runs"] == 5
    assert json.loads((tmp_path / "alarms.json").read_text()) == known


@pytest.mark.parametrize("part", ["alarms", "files", "wide"])
def test_what_is_stored_has_no_alarm_and_no_wrong_name(part: str) -> None:
    known = json.loads((campaign.HERE / f"{part}.json").read_text())
    assert known["cases"] + sum(end - first for first, end in known.get("more", [])) >= 300
    found = known["found"]
    assert found.get("alarms", 0) == 0
    assert [word for word in found if word.endswith("WRONG NAME")] == []
    short = {int(word.split()[1].rstrip(":")) for word in found if word.startswith("case ")}
    assert short <= {*WRONG_BEFORE, *SHORT}
    assert sum(count for word, count in found.items() if word.endswith("IN THE LIST")) == len(short)


def test_ranges_of_cases_are_kept_apart_go_on_and_are_merged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(campaign, "HERE", tmp_path)
    monkeypatch.setattr(campaign, "PARTS", {"alarms": lambda case: {"runs": 1, "alarms": 0, "sum": case}})
    campaign.add("alarms", 10)
    campaign.add("alarms", 3, 100)
    campaign.add("alarms", 5, 100)
    campaign.add("alarms", 5, 200)
    assert campaign.merge() == 0
    known = json.loads((tmp_path / "alarms.json").read_text())
    assert known["more"] == [[100, 105], [200, 205]]
    assert known["found"]["runs"] == 20
    assert known["found"]["sum"] == sum([*range(10), *range(100, 105), *range(200, 205)])
    campaign.add("alarms", 2, 104)
    assert campaign.merge() == 1
    assert json.loads((tmp_path / "alarms.json").read_text()) == known


def test_right_steps_of_every_linear_scheme_raise_no_alarm() -> None:
    found = [campaign.alarms(case) for case in range(len(campaign.LINEAR))]
    assert sum(one.get("runs", 0) for one in found) >= 20
    assert sum(one.get("alarms", 0) for one in found) == 0


def test_a_chain_that_rests_and_at_four_times_the_temperature_does_not_raises_no_alarm() -> None:
    found = campaign.alarms(20399)
    assert (found["runs"], found["alarms"]) == (1, 0)
