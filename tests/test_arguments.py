"""Arguments of a wrong type are refused in one line: the function, the argument, and what is needed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck.errors import SpringcheckError
from springcheck.physics import builders
from springcheck.physics.bath import Bath
from springcheck.physics.terms import Spring, WallSpring

SPRING = springcheck.load_scene("spring")
RUN = springcheck.exact(SPRING)
STRANGE: list[Any] = [
    None, True, -1, 1.5, "x", b"x", [1], [], (1, 2), {"a": 1}, object(), object, np.array([1.0, 2.0]),
    np.array("x"), 1j, [[1, 2], [3]], 10**400, {1, 2}, np.float64("nan"),
]  # fmt: skip

OF_SPRING = [
    "m", "k", "q", "p", "step", "steps", "at", "c", "fast", "units", "kind", "quantities", "terms",
    "nothing",
]  # fmt: skip
OF_CHAIN = ["masses", "m", "k", "waves", "q", "p", "step", "steps", "every"]

CALLS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "spring": (springcheck.spring, dict.fromkeys(OF_SPRING)),
    "chain": (springcheck.chain, dict.fromkeys(OF_CHAIN)),
    "cold": (builders.cold, {"scene": SPRING, "friction": 0.1}),
    "bath": (Bath, {"temperature": 1.0, "friction": 1.0}),
    "wall": (WallSpring, {"i": [0], "k": 1.0, "at": 0.0, "fast": False}),
    "between": (Spring, {"a": [0], "b": [1], "k": 1.0, "rest": 0.0, "fast": False}),
    "identify": (springcheck.identify, {"found": RUN.t, "q": RUN.q, "p": RUN.p, "step": 0.1}),
    "compare": (springcheck.compare, {"scene": SPRING, "trajectories": [RUN]}),
    "judge": (springcheck.judge, {"scene": SPRING, "trajectory": RUN}),
    "simulate": (springcheck.simulate, {"scene": SPRING, "method": "own:euler", "scheme": ""}),
    "from-arrays": (springcheck.Trajectory.from_arrays, {"t": RUN.t, "q": RUN.q, "p": RUN.p, "every": 1}),
    "save": (RUN.save, {"path": "nothing.txt"}),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_no_argument_of_a_wrong_type_ends_in_an_error_of_python(name: str) -> None:
    function, usual = CALLS[name]
    given = {argument: value for argument, value in usual.items() if value is not None}
    for argument in usual:
        for value in STRANGE:
            with suppress(SpringcheckError):
                function(**(given | {argument: value}))


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: springcheck.spring(fast=[1]), "spring: fast = [1]: True or False is needed"),
        (lambda: springcheck.chain(masses=True), "chain: masses = True: a whole number is needed"),
        (lambda: springcheck.explain(3), "explain: word = 3: a text is needed"),
        (lambda: springcheck.run(SPRING, thorough="x"), "run: thorough = 'x': True or False is needed"),
        (lambda: springcheck.extremes(quick=[1]), r"extremes: quick = [1]: True or False is needed"),
        (lambda: springcheck.stability("spring", workers=1.5), "workers = 1.5: a whole number is needed"),
        (lambda: RUN.save(3), "save: path = 3: a text or a path is needed"),
    ],
)
def test_the_line_names_the_function_the_argument_and_what_is_needed(
    call: Callable[[], Any], said: str
) -> None:
    with pytest.raises(SpringcheckError) as error:
        call()
    assert said in str(error.value)
