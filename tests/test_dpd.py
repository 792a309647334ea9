"""OpenMM's DPDIntegrator: BAOA of the relative velocity along a pair, its friction that of their distance."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("openmm")

import dpd


def test_a_step_of_dpd_is_its_law_to_rounding(capsys: pytest.CaptureFixture[str]) -> None:
    assert dpd.main(1000) == 0, capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "factor"), [("GAMMA", 1 + 1e-11), ("CUTOFF", 1 + 1e-11), ("KT", 2.0), ("K", 1 + 1e-11)]
)
def test_the_script_rejects_another_law(name: str, factor: float, monkeypatch: pytest.MonkeyPatch) -> None:
    right: Any = dpd.law

    def other(*given: Any) -> Any:
        with pytest.MonkeyPatch.context() as inside:
            inside.setattr(dpd, name, getattr(dpd, name) * factor)
            return right(*given)

    monkeypatch.setattr(dpd, "law", other)
    if name == "KT":
        monkeypatch.setattr(dpd, name, dpd.KT * factor)
    # what one draw leaves shows an error of the law in any of them
    assert dpd.main(1000 if name == "KT" else 200) == 1
