"""The table of stage kinds: one row each, of which steps, matrices and rounding are made."""

from __future__ import annotations

import ast
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import springcheck
from springcheck import schemes
from springcheck.schemes import ATTACHED, KINDS, SCHEMES
from springcheck.schemes.catalogue import ONE, splitting
from springcheck.schemes.rounding import Met

ULP = 2.0**-52


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_stage_rounds_is_within_its_bound(kind: str) -> None:
    """Each kind in double and in extended precision, over sizes from 1e-3 to 1e3."""
    rng = np.random.default_rng(8)
    n = 2000
    q, p, m, force = rng.normal(size=(4, n)) * 10.0 ** rng.uniform(-3, 3, (4, n))
    m, rate = np.abs(m), 10.0 ** rng.uniform(-2, 1, n)
    one = splitting("one", "", 2, 2.0, (("kick", ONE), (kind, Fraction(7, 24))), "", symplectic=False)

    def stepped(width: type) -> tuple[np.ndarray, np.ndarray]:
        wide = [x.astype(width) for x in (q, p, m, rate, force)]
        return schemes.step(
            one, wide[0], wide[1], h=width(0.37), m=wide[2], rate=wide[3], force=lambda q, p: wide[4],
            parts=(lambda q, p: wide[4],) * 2,
        )  # fmt: skip

    met = [Met(magnitude=lambda q, p: np.abs(force).astype(np.longdouble))] * len(one.evaluations)
    size = schemes.magnitude_step(
        one, q, p, h=0.37, m=m.astype(np.longdouble), met=met, rate=rate.astype(np.longdouble),
    )  # fmt: skip
    off = [
        np.abs(a - b) / s for a, b, s in zip(stepped(np.float64), stepped(np.longdouble), size, strict=True)
    ]
    if np.finfo(np.longdouble).eps < ULP:
        assert 0 < np.max(off) <= schemes.roundings(one) * ULP / 2


def test_every_shipped_scheme_is_made_of_these_kinds() -> None:
    used = {name for scheme in (SCHEMES | ATTACHED).values() for name, _ in scheme.stages}
    assert used == set(KINDS)


def test_kinds_are_named_in_the_table_and_by_schemes_alone() -> None:
    """Whoever asks what a kind does asks its row; identify and thermostats have kinds of their own."""
    home = Path(springcheck.__file__).parent
    telling = set(KINDS) - {"friction", "slow", "fast", "pull"}  # words that stand for other things too
    named = {
        path.relative_to(home).as_posix()
        for path in home.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and node.value in telling
    }
    assert {name for name in named if not name.startswith(("identify/", "bath/"))} == {
        "schemes/kinds.py", "schemes/catalogue.py",
        # what the page's loops carry out
        "cli/page/given.py",
    }  # fmt: skip
