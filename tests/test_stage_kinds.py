"""The table of stage kinds: one row each, of which steps, matrices, noise and rounding are made.

A random splitting is z' = A z + G xi with standard normal xi.  BAOAB, BAOA and OBABO (Leimkuhler & Matthews,
Appl. Math. Res. Express 2013, 34; Zhang et al., J. Phys. Chem. A 123, 2019, 6056; Bussi & Parrinello, Phys.
Rev. E 75, 2007, 056707) are stepped here on a spring whose m, k, gamma and kT are all unlike one.
"""

from __future__ import annotations

import ast
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import springcheck
from springcheck import schemes
from springcheck.schemes import ATTACHED, KINDS, SCHEMES, Scheme
from springcheck.schemes.catalogue import HALF, ONE, Stage
from springcheck.schemes.rounding import Met

M, K, GAMMA, KT, H = 3.7, 2.9, 0.45, 1.7, 0.61
A = H * H * K / M
DECAY = np.exp(-GAMMA * H)
ULP = 2.0**-52

PULL, DRIFT, THERMAL = ("pull", HALF), ("drift", HALF), ("thermal", ONE)
O = ("thermal", HALF)  # noqa: E741


def random(*stages: Stage) -> Scheme:
    return Scheme(name="random", title="", order=2, limit=2.0, symplectic=False, stages=stages)


BAOAB = random(PULL, DRIFT, THERMAL, DRIFT, PULL)
BAOA = random(("pull", ONE), DRIFT, THERMAL, DRIFT)
OBABO = random(O, PULL, ("drift", ONE), PULL, O)
RANDOM = {"BAOAB": BAOAB, "BAOA": BAOA, "OBABO": OBABO}


def law(scheme: Scheme, kT: float = KT) -> tuple[np.ndarray, np.ndarray]:
    """A (2, 2) and G (2, draws) on (q, p)."""
    spring = {"h": H, "m": np.array([M]), "k": np.array([K]), "c": GAMMA * M}
    return schemes.matrix(scheme, **spring)[0], schemes.noise(scheme, **spring, kT=kT)[0]


def written_out(scheme: Scheme) -> tuple[np.ndarray, np.ndarray]:
    """The same, multiplied from the matrices of the stages by hand."""
    a, columns = np.eye(2), []
    for kind, part in scheme.stages:
        x = float(part) * H
        c = np.exp(-GAMMA * x)
        one = {"pull": [[1, 0], [-x * K, 1]], "drift": [[1, x / M], [0, 1]], "thermal": [[1, 0], [0, c]]}[
            kind
        ]
        a, columns = np.array(one) @ a, [np.array(one) @ g for g in columns]
        if kind == "thermal":
            columns.append(np.array([0, np.sqrt((1 - c * c) * M * KT)]))
    return a, np.array(columns).T


def stationary(a: np.ndarray, g: np.ndarray) -> np.ndarray:
    """The covariance of (q, p) that a step leaves as it is: S = A S A' + G G'."""
    a, g = a.astype(float), g.astype(float)
    return np.linalg.solve(np.eye(4) - np.kron(a, a), (g @ g.T).ravel()).reshape(2, 2)


@pytest.mark.parametrize("name", RANDOM)
def test_propagator_and_noise_are_those_of_the_stages_multiplied_by_hand(name: str) -> None:
    (a, g), (by_hand, columns) = law(RANDOM[name]), written_out(RANDOM[name])
    assert g.shape == columns.shape == (2, RANDOM[name].draws)
    # both are rounded: a handful of products a stage
    np.testing.assert_allclose(a, by_hand, rtol=32 * ULP)
    np.testing.assert_allclose(g, columns, rtol=32 * ULP)


@pytest.mark.parametrize(
    ("name", "of_q", "of_p", "of_qp"),
    [("BAOAB", 1, 1 - A / 4, 0), ("BAOA", 1, 1, K * H / 2), ("OBABO", 1 / (1 - A / 4), 1, 0)],
)
def test_the_stationary_state_is_the_closed_form(name: str, of_q: float, of_p: float, of_qp: float) -> None:
    """k <q**2>/kT, <p**2>/(m kT) and k <q p>/kT; the determinant is exp(-gamma h) for all three."""
    a, g = law(RANDOM[name])
    s = stationary(a, g) / KT
    # the solution of the discrete Lyapunov equation is as good as 1 - det A is far from 0
    room = 64 * ULP / (1 - DECAY)
    np.testing.assert_allclose([K * s[0, 0], s[1, 1] / M, K * s[0, 1]], [of_q, of_p, of_qp], atol=room)
    np.testing.assert_allclose(float(np.linalg.det(a.astype(float))), DECAY, rtol=8 * ULP)
    np.testing.assert_allclose(float(np.trace(a)), (1 + DECAY) * (1 - A / 2), rtol=8 * ULP)


def test_one_draw_a_step_gives_noise_of_one_direction() -> None:
    """q to p as h/2m to 1 - a/4: what tells BAOAB in a file, at any temperature."""
    for kT in (KT, 300.0):
        _, g = law(BAOAB, kT)
        np.testing.assert_allclose(float(g[0, 0] / g[1, 0]), H / (2 * M) / (1 - A / 4), rtol=8 * ULP)
    assert np.linalg.matrix_rank(law(OBABO)[1].astype(float)) == 2


def test_draws_enter_in_the_order_of_the_stages() -> None:
    draws = np.array([[[0.3]], [[-1.1]]])
    a, g = law(OBABO)
    q, p = schemes.step(
        OBABO, np.array([[0.4]]), np.array([[-0.9]]), h=H, m=np.array([M]), rate=np.array([GAMMA]),
        force=lambda q, p: -K * q - GAMMA * p, draws=draws, kT=KT,
    )  # fmt: skip
    expected = a @ [0.4, -0.9] + g @ draws[:, 0, 0]
    np.testing.assert_allclose([q[0, 0], p[0, 0]], expected.astype(float), rtol=16 * ULP)


def test_without_draws_or_friction_a_thermal_stage_is_one_of_friction() -> None:
    bare = random(*(("friction" if kind == "thermal" else kind, c) for kind, c in BAOAB.stages))
    assert (law(BAOAB)[0] == law(bare)[0]).all()
    assert (BAOAB.draws, bare.draws, SCHEMES["velocity-verlet"].draws) == (1, 0, 0)
    free = schemes.noise(BAOAB, h=H, m=np.array([M]), k=np.array([K]), kT=KT)
    assert not np.any(free)


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_stage_rounds_is_within_its_bound(kind: str) -> None:
    """Each kind in double and in extended precision, over sizes from 1e-3 to 1e3."""
    rng = np.random.default_rng(8)
    n = 2000
    q, p, m, force, draws = rng.normal(size=(5, n)) * 10.0 ** rng.uniform(-3, 3, (5, n))
    m, rate = np.abs(m), 10.0 ** rng.uniform(-2, 1, n)
    one = random(("kick", ONE), (kind, Fraction(7, 24)))

    def stepped(width: type) -> tuple[np.ndarray, np.ndarray]:
        wide = [x.astype(width) for x in (q, p, m, rate, force)]
        return schemes.step(
            one, wide[0], wide[1], h=width(0.37), m=wide[2], rate=wide[3], force=lambda q, p: wide[4],
            parts=(lambda q, p: wide[4],) * 2, draws=[draws.astype(width)] * one.draws, kT=KT,
        )  # fmt: skip

    met = [Met(magnitude=lambda q, p: np.abs(force).astype(np.longdouble))] * len(one.evaluations)
    size = schemes.magnitude_step(
        one, q, p, h=0.37, m=m.astype(np.longdouble), met=met, rate=rate.astype(np.longdouble),
        draws=[draws] * one.draws, kT=KT,
    )  # fmt: skip
    off = [
        np.abs(a - b) / s for a, b, s in zip(stepped(np.float64), stepped(np.longdouble), size, strict=True)
    ]
    if np.finfo(np.longdouble).eps < ULP:
        assert 0 < np.max(off) <= schemes.roundings(one) * ULP / 2


def test_every_shipped_scheme_is_made_of_these_kinds() -> None:
    used = {name for scheme in (SCHEMES | ATTACHED).values() for name, _ in scheme.stages}
    assert used <= set(KINDS)
    assert set(KINDS) - used == {"thermal"}


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
    assert {name for name in named if not name.startswith(("identify/", "thermal/"))} == {
        "schemes/kinds.py", "schemes/catalogue.py", "schemes/elsewhere.py", "schemes/attached.py",
        # of thermostats, and what the page's loops carry out
        "engines/own/thermal.py", "studies/faults/baths.py", "cli/explain.py", "cli/page/given.py",
    }  # fmt: skip
