"""A scheme of known stages, or a tableau, is two lines in the catalogue: all commands have it then."""

from __future__ import annotations

import subprocess
import sys

import pytest

LINE = "catalogue.SCHEMES['{name}'] = catalogue.{how}"
PROGRAM = """
import sys
from fractions import Fraction as F
from springcheck.schemes import catalogue
{lines}
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
        "spring-uneven", "",
    ),
    "a kick by an old force": (
        "splitting('odd-7', 'Odd', 1, 0.0, (('kick', F(1, 3)), ('drift', F(1)), ('held', F(2, 3))), "
        "'nobody', symplectic=False)",
        "spring-uneven", "",
    ),
    "friction taken implicitly": (
        "splitting('odd-7', 'Odd', 1, 2.0, (('pull', F(1)), ('implicit-friction', F(1)), ('drift', F(1))), "
        "'nobody', symplectic=False)",
        "rlc-circuit", "semi-implicit-euler",
    ),
    "two implicit stages": (
        "Scheme(name='odd-7', title='Odd', order=2, limit=float('inf'), symplectic=True, source='nobody', "
        "a=((F(1, 4),), (F(1, 2), F(1, 4))), b=(F(1, 2), F(1, 2)))",
        "spring-uneven", "",
    ),
}  # fmt: skip
"""What is appended, on which scene, and what identify names at least among what it cannot tell apart, if not
the scheme itself: a step of implicit friction is semi-implicit Euler with friction after its kick."""


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    """What each command prints of each scheme, in one interpreter whose catalogue has all of them."""
    lines, commands = [], []
    for i, (how, scene, _) in enumerate(SCHEMES.values()):
        name = f"odd-{i}"
        lines.append(LINE.format(name=name, how=how.replace("odd-7", name)))
        method = ["--method", f"own:{name}"]
        commands += [
            ["list"],
            ["explain", name],
            ["explain", f"own:{name}"],
            ["run", scene, *method, "--thorough", "-o", f"{name}-run.h5"],
            ["inspect", f"{name}-run.h5"],
            ["judge", f"{name}-run.h5", "--scene", scene, "--scheme", name],
            ["identify", f"{name}-run.h5"],
            ["report", f"{name}-run.h5", "-o", f"{name}-page.html"],
            ["stability", scene, *method, "-o", f"{name}-stability.h5"],
            ["precision", scene, *method, "--budget", "0.5", "-o", f"{name}-precision.h5"],
        ]
    program = PROGRAM.format(lines="\n".join(lines), commands=commands)
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path_factory.mktemp("two"), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-2000:]
    of_schemes = done.stdout.split("$ list\n")[1:]
    return [dict(part.split("\n", 1) for part in f"list\n{x}".split("$ ")) for x in of_schemes]


@pytest.mark.parametrize("name", SCHEMES)
def test_every_command_has_a_scheme_that_is_two_lines(name: str, printed: list[dict[str, str]]) -> None:
    i = list(SCHEMES).index(name)
    said = printed[i]
    assert len(said) == 10
    (ran,) = (text for command, text in said.items() if command.startswith("run "))
    assert ", 0 failed" in ran
    assert (SCHEMES[name][2] or f"odd-{i}") in said[f"identify odd-{i}-run.h5"]
