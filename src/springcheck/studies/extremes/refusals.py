"""Input that must be refused, with one clear line: by the scene file, or by a method."""

from __future__ import annotations

from dataclasses import replace

from springcheck import driver, engines
from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile as scenes
from springcheck.studies.extremes.judging import Cell

_SPRING = """
title = "A spring"
[[particle]]
mass = 3.7
position = 0.3
momentum = 0.7
[[spring]]
ends = ["wall", 0]
stiffness = 2.9
[time]
step = 0.1
steps = 20
"""

_CHANGES = (
    ("mass = 3.7", "mass = 0.0"), ("mass = 3.7", "mass = -3.7"), ("mass = 3.7", "mass = nan"),
    ("mass = 3.7", "mass = inf"), ("mass = 3.7", 'mass = "3.7"'), ("mass = 3.7", "mass = 1e400"),
    ("position = 0.3", "position = nan"), ("position = 0.3", "position = -inf"),
    ("momentum = 0.7", "momentum = inf"), ("stiffness = 2.9", "stiffness = nan"),
    ("stiffness = 2.9", "stiffness = 1e999"), ("stiffness = 2.9", "stifness = 2.9"),
    ('ends = ["wall", 0]', 'ends = ["wall", 1]'), ('ends = ["wall", 0]', 'ends = ["wall", "wall"]'),
    ("step = 0.1", "step = 0.0"), ("step = 0.1", "step = inf"), ("step = 0.1", "step = nan"),
    ("steps = 20", "steps = 0"), ("steps = 20", "steps = -1"), ("steps = 20", "steps = 2.5"),
    ("steps = 20", "steps = 20\ntolerance = 0.0"), ("steps = 20", "steps = 20\ntolerance = 1.0"),
)  # fmt: skip


def cells() -> list[Cell]:
    """One cell for each; refused when the answer is an error that a user can read."""
    found = [
        _cell("scene file", f"{new} instead of {old}", _answer(_SPRING.replace(old, new)))
        for old, new in _CHANGES
    ]
    spring = scenes.parse(_SPRING, name="spring")
    braked = scenes.parse(_SPRING + "[[damping]]\nparticle = 0\ncoefficient = 0.37\n", name="braked")
    for label in engines.match(("*",)):
        for what, scene in (("a spring", spring), ("friction", braked)):
            if engines.refusal(scene, label) and not engines.absence(label.engine):
                try:
                    driver.run(replace(scene, steps=1, every=1), label)
                    answer = None
                except SpringcheckError as error:
                    answer = str(error)
                found.append(_cell(str(label), what, answer))
    return found


def _answer(text: str) -> str | None:
    try:
        scenes.parse(text, name="extreme")
    except SpringcheckError as error:
        return str(error)
    return None


def _cell(method: str, what: str, answer: str | None) -> Cell:
    return Cell(
        method=method,
        block="refusal",
        parameters={},
        outcome="refused" if answer else "silently wrong",
        reason=answer or f"{what} was taken without a word",
        value=float("nan"),
        bound=float("nan"),
    )
