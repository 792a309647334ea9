"""Selection of the methods of a study, with the reason for each that is left out."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from springcheck import engines
from springcheck.engines.contract import Label
from springcheck.errors import MethodError
from springcheck.physics.scene import Scene
from springcheck.text.lines import Lines, plain


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """A method that was not run, or not measured, and why."""

    method: str
    reason: str


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


def sorted_out(
    labels: Iterable[Label], reason: Callable[[Label], str | None], needed: str = ""
) -> tuple[list[Label], list[LeftOut]]:
    """Methods for which `reason` is None, and the others with their reasons.  MethodError where `needed` is
    given and no method is usable."""
    reasons = {label: reason(label) for label in labels}
    left = [LeftOut(method=str(label), reason=why) for label, why in reasons.items() if why]
    usable = [label for label, why in reasons.items() if not why]
    if needed and not usable:
        whys = "; ".join(f"{one.method}: {one.reason}" for one in left)
        raise MethodError(f"none of these methods {needed}: {whys}")
    return usable, left


def choose(scene: Scene, patterns: Sequence[str]) -> tuple[list[Label], list[LeftOut], tuple[str, ...]]:
    """Methods that can serve a scene, of those that the patterns (or the scene) name, and those left out.

    Where the scene names them, the labels of further methods that are installed and could serve it are added.
    Raises MethodError when a method that is named in full cannot run: it was requested.
    """
    # in a scene `*` stands for the default methods, in an argument for all
    own, bath = not patterns or engines.UNNAMED in patterns, scene.bath is not None
    matched: dict[Label, None] = {}
    try:
        for one in patterns or [engines.UNNAMED]:
            of_scene = one == engines.UNNAMED
            named = engines.match(scene.include if of_scene else (one,), bath=bath, every=not of_scene)
            matched |= dict.fromkeys(named)
    except MethodError as error:
        if not own:
            raise
        raise MethodError(f"methods.include of scene {scene.name}: {error}") from error
    chosen, left = sorted_out(matched, partial(engines.obstacle, scene))
    for out in left:
        if out.method in patterns:
            raise MethodError(f"{out.method} cannot run scene {scene.name}: {out.reason}")
    if not chosen:
        raise MethodError(f"no method can serve scene {scene.name}; {left[0].method}: {left[0].reason}")
    rest = engines.match(("*",), bath=bath, every=True) if own else ()
    others = (x for x in rest if x not in matched and not engines.obstacle(scene, x))
    return chosen, left, tuple(map(str, others))
