"""A scheme of known stages, or a tableau, is two lines in the catalogue: all commands have it then."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

LINE = "catalogue.SCHEMES['odd-7'] = catalogue.{how}"
PROGRAM = """
import sys
from fractions import Fraction as F
from springcheck.schemes import catalogue
{line}
from springcheck.cli import main
for command in {commands}:
    print("$", *command, flush=True)
    status = main(command)
    if status:
        sys.exit(f"{{command}}: {{status}}")
"""

HALF = "F(1, 2)"
SCHEMES = {
    # 2 sin(x/2)-like, but with a fifth of the kick at both ends: the limit is 2 sqrt(5/3)
    "two drifts a step": (
        "splitting('odd-7', 'Odd', 2, 2.581988897471611, (('kick', F(1, 5)), ('drift', F(1, 2)), "
        "('kick', F(3, 5)), ('drift', F(1, 2)), ('kick', F(1, 5))), 'nobody')",
        "spring-uneven", "odd-7",
    ),
    "a kick by an old force": (
        "splitting('odd-7', 'Odd', 1, 0.0, (('kick', F(1, 3)), ('drift', F(1)), ('held', F(2, 3))), "
        "'nobody', symplectic=False)",
        "spring-uneven", "odd-7",
    ),
    "friction taken implicitly": (
        "splitting('odd-7', 'Odd', 1, 2.0, (('pull', F(1)), ('implicit-friction', F(1)), ('drift', F(1))), "
        "'nobody', symplectic=False)",
        "rlc-circuit", "semi-implicit-euler",
    ),
    "two implicit stages": (
        "Scheme(name='odd-7', title='Odd', order=2, limit=float('inf'), symplectic=True, source='nobody', "
        "a=((F(1, 4),), (F(1, 2), F(1, 4))), b=(F(1, 2), F(1, 2)))",
        "spring-uneven", "odd-7",
    ),
}  # fmt: skip
"""What is appended, on which scene, and what identify names at least among what it cannot tell apart: a step
of implicit friction is semi-implicit Euler with friction after its kick."""


@pytest.mark.parametrize("name", SCHEMES)
def test_every_command_has_a_scheme_that_is_two_lines(name: str, tmp_path: Path) -> None:
    how, scene, named = SCHEMES[name]
    method = ["--method", "own:odd-7"]
    commands = [
        ["list"],
        ["explain", "odd-7"],
        ["explain", "own:odd-7"],
        ["run", scene, *method, "--thorough", "-o", "run.h5"],
        ["inspect", "run.h5"],
        ["judge", "run.h5", "--scene", scene, "--scheme", "odd-7"],
        ["identify", "run.h5"],
        ["report", "run.h5", "-o", "page.html"],
        ["stability", scene, *method, "-o", "stability.h5"],
        ["precision", scene, *method, "--budget", "0.1", "-o", "precision.h5"],
    ]
    program = PROGRAM.format(line=LINE.format(how=how), commands=commands)
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-2000:]
    said = dict(part.split("\n", 1) for part in done.stdout.split("$ ")[1:])
    (ran,) = (text for command, text in said.items() if command.startswith("run "))
    assert ", 0 failed" in ran
    assert named in said["identify run.h5"]
