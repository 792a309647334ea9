"""Where `long double` is no wider than double, references round like engines: what is said, and seen.

The suite's core runs so with `PYTHONPATH=tests python -m pytest -p narrow` as well.
"""

import subprocess
import sys
from pathlib import Path

SAID = """
import narrow
from dataclasses import replace
import springcheck
from springcheck import checks
from springcheck.physics.arrays import ROUNDOFF, WIDE
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile as scenes
from springcheck.studies.extremes import measure

assert ROUNDOFF == 2.0**-53 and not WIDE
scene = scenes.load_scene("spring-uneven")
for label in ("own:semi-implicit-euler", "own:velocity-verlet"):
    run = springcheck.simulate(scene, label)
    found = checks.judge(scene, run)
    assert not [v for v in found if v.passed is False]
    assert sum(v.passed is True for v in found) >= 8
    (step,) = (v for v in found if v.check == "step-defect")
    assert "rounds like the engine here" in step.why
    wrong = replace(run, q=run.q * (1 + 1e-13 * (run.t > run.t[50])[:, None]))
    assert [v for v in checks.judge(scene, wrong, [checks.step_defect]) if v.passed is False]
for size in (1e200, 1e-200):
    far = replace(scene, q=scene.q * size, p=scene.p * size)
    try:
        far.system.norm
    except SpringcheckError as error:
        print(error)
measure.WIDE = False
try:
    measure.record(quick=True)
except SpringcheckError as error:
    print(error)
"""


def test_the_core_judges_where_references_round_like_the_engines() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", SAID], cwd=Path(__file__).parent, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert len(lines) == 3
    assert all("leaves the range of" in line for line in lines[:2])
    assert "no wider than double" in lines[2]
