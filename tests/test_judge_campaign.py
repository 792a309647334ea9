"""The campaign against the judge, in short: `validation/judge_campaign.py` runs thousands of scenes."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "validation"))
_spec = importlib.util.spec_from_file_location("judge_campaign", ROOT / "validation" / "judge_campaign.py")
assert _spec is not None
assert _spec.loader is not None
judge_campaign = importlib.util.module_from_spec(_spec)
sys.modules["judge_campaign"] = judge_campaign
_spec.loader.exec_module(judge_campaign)


def test_the_campaign_has_more_than_a_hundred_kinds_of_faults() -> None:
    assert len(judge_campaign.FAULTS) >= 100
    assert len(judge_campaign.LEGAL) == 16
    assert len(judge_campaign.explicit_forms.FORMS) == 5


@pytest.mark.parametrize("first", [0, 100])
def test_no_legal_engine_is_rejected_and_no_fault_is_missed_that_is_above_their_noise(
    first: int, whole: bool
) -> None:
    scenes = 10 if whole else 4
    found = judge_campaign.campaign(first, scenes)
    assert found.sets >= 3 * scenes
    assert found.alarms == []
    assert found.missed == []
    assert found.numbers == []
    assert found.seen >= scenes
    assert max(found.noise.values()) < 0.5
