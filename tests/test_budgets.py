"""A budget of lines for every room: whoever raises one says in the commit what left, or why nothing could."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import springcheck

HOME = Path(springcheck.__file__).parent

BUDGETS = {
    ("physics",): 6949,
    ("schemes",): 1708,
    ("bath",): 1900,
    ("engines/own",): 1591,
    ("engines/openmm", "engines/ase", "engines/sundials"): 1284,
    ("engines",): 2836,
    ("driver", "conformance", "doors"): 1193,
    ("checks",): 5755,
    ("identify",): 9459,
    ("formats", "store"): 5197,
    ("studies",): 1456,
    ("studies/*",): 9878,
    ("figures", "cli", "api", "plot", "text", "errors", "interrupts", "__init__", "__main__"): 7332,
}
"""Lines of each room, or of several: of an engine in one file, and of what all studies share, in the first
folder."""


def sizes() -> Counter[tuple[str, ...]]:
    """Lines of each room; of one without a budget under its own name."""
    found: Counter[tuple[str, ...]] = Counter()
    for path in HOME.rglob("*.py"):
        room, *below = path.relative_to(HOME).with_suffix("").parts
        if len(below) > 1 and room == "studies":
            room = "studies/*"
        elif len(below) > 1 and room == "engines":
            room = f"engines/{below[0]}"
        rooms = next((rooms for rooms in BUDGETS if room in rooms), (room,))
        found[rooms] += len(path.read_text().splitlines())
    return found


def test_every_room_keeps_its_budget() -> None:
    found = sizes()
    over = [
        f"{', '.join(rooms)}: {lines} lines of {BUDGETS.get(rooms, 0)}"
        for rooms, lines in found.items()
        if lines > BUDGETS.get(rooms, 0)
    ]
    assert over == []
    assert set(found) == set(BUDGETS)


def test_no_module_is_longer_than_400_lines() -> None:
    long = {
        str(path.relative_to(HOME)): lines
        for path in HOME.rglob("*.py")
        if (lines := len(path.read_text().splitlines())) > 400
    }
    assert long == {}


def test_the_scripts_of_the_page_are_few_lines_that_can_be_read() -> None:
    lines = [line for path in (HOME / "cli/page").glob("*.js") for line in path.read_text().splitlines()]
    assert len(lines) <= 832
    assert max(map(len, lines)) <= 110
