"""Text that the reports of several studies share."""

from __future__ import annotations

import re
from collections.abc import Sequence

from springcheck.physics.exact import has_true_motion
from springcheck.physics.norm import energy_scale
from springcheck.physics.scene import Scene
from springcheck.studies.choose import LeftOut
from springcheck.text.lines import Lines, plain
from springcheck.text.wording import count


def left_out(left: Sequence[LeftOut], word: str = "Left out") -> Lines:
    """One line for each reason, without the name of the method in it."""
    reasons: dict[str, list[str]] = {}
    for one in left:
        reasons.setdefault(one.reason.removeprefix(f"{one.method}: "), []).append(one.method)
    said = [
        plain(f"{word} {', '.join(names)}: {re.sub('^it ', 'each ', why) if len(names) > 1 else why}")
        for why, names in reasons.items()
    ]
    return [plain(), *said] if said else []


def resumed(pieces: int, what: str) -> Lines:
    """A line on the pieces resumed from an interrupted call, if any."""
    if not pieces:
        return []
    were = "was" if pieces == 1 else "were"
    return [plain(f"  {count(pieces, what)} {were} finished by an interrupted call and resumed")]


def of_energy(scene: Scene, of: str = "") -> str:
    """Explanation of the column of energies, relative to the scene's `energy_scale` or that of this name."""
    system = scene.system
    changes = ["loss by friction"] * system.is_damped + ["work of the drive"] * system.is_driven
    known = bool(changes) and has_true_motion(scene)
    off = f"H - H{' exact' if known else '0'}"
    of = of or energy_scale(scene.system)[1]
    over = "|H0|" if of == "initial energy" else f"({of})"
    part = f"({off})/{over}" if of else off
    how = f", the {'exact ' * known}{' and '.join(changes)} {'taken off' if known else 'in it'}"
    return f"{part} where it is largest{how if changes else ''}"
