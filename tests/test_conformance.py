"""The engine of the README is complete and short, passes every check, and each check rejects a broken one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import springcheck.engines
from springcheck import conformance, engines, simulate
from springcheck.engines import Engine
from springcheck.physics.scenefile import load_scene

README = Path(springcheck.engines.__file__).parent / "README.md"
CODE = re.search(r"```python\n(\"\"\"my_engine.*?)```", README.read_text(), re.DOTALL).group(1)  # type: ignore[union-attr]


@pytest.fixture(autouse=True)
def _nothing_left_over() -> Iterator[None]:
    yield
    engines.registry._brought.clear()


def made(code: str) -> Engine:
    space: dict[str, Any] = {"__name__": "my_engine"}
    exec(code, space)
    return space["ENGINE"]  # type: ignore[no-any-return]


def test_the_example_takes_at_most_sixty_lines() -> None:
    assert len(CODE.splitlines()) <= 60


def test_the_example_passes_every_check() -> None:
    found = conformance.checks_of(made(CODE))
    assert len(found) == 1 + len(conformance.TESTS)
    for check in found:
        check()


STEP, ROW, COUNT = (
    "                self.q = ",
    "        for row in range(len(q)):",
    "        self.force_calls = 0\n",
)
HALF = f"self.kick(self.h / 2)\n{STEP}"
MOVED = "        scene.q.setflags(write=True)\n        scene.q[0] += 1e-3\n"

FAULTS = [
    ("right on uneven scenes", HALF, f"self.kick(self.h)\n{STEP}"),
    ("right on uneven scenes", "self.q[i] - at", "self.q[i]"),
    ("right on uneven scenes", "self.h * y / m", "self.h * y"),
    ("right on uneven scenes", "self.h * y / m", "(1 + 1e-12) * self.h * y / m"),
    ("rows in parts", ROW, f"        self.p = [x + 1e-9 for x in self.p]\n{ROW}"),
    ("frames apart", "for _ in range(every)", "for _ in range(min(every, 9))"),
    ("scene untouched", COUNT, COUNT + MOVED),
    ("negative step", "self.h = step", "self.h = abs(step)"),
    ("versions", '{"mine": "1.0"}', '{"mine": 1.0}'),
]  # fmt: skip


@pytest.mark.parametrize(("name", "old", "new"), FAULTS)
def test_each_check_rejects_a_broken_engine(name: str, old: str, new: str) -> None:
    assert old in CODE
    check = next(x for x in conformance.checks_of(made(CODE.replace(old, new, 1))) if x.name == name)
    with pytest.raises(AssertionError):
        check()


def test_a_wrong_trajectory_is_told_in_words() -> None:
    scene = load_scene("spring-uneven")
    run = simulate.run(scene, "own:euler")
    conformance.assert_right(scene, run)
    with pytest.raises(AssertionError, match=r"own:euler is not rk4 on spring-uneven:\n  step-defect: "):
        conformance.assert_right(scene, replace(run, scheme="rk4"))


@conformance.parametrize_with_checks(engines.engine("ase"))
def test_an_engine_of_ours(check: conformance.Check, need: Any) -> None:
    need("ase:velocity-verlet")
    check()
