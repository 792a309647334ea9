"""Bussi's thermostat: one factor for all momenta, explicit in their kinetic energy and as many draws.

Equation (A7) of J. Chem. Phys. 126 (2007) 014101, alpha**2 = c + b sum R**2 + 2 R1 sqrt(c b) with
b = (1-c)/Nf Kbar/K, and the sign of alpha, that of R1 + sqrt(c/b), Comput. Phys. Commun. 179 (2008) 26.
"""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

import bathed as baths
from clean import clean_bath
from springcheck import checks, driver, engines
from springcheck.bath import THERMOSTATS, Stepper
from springcheck.bath.draws import read
from textbook import Fault


@pytest.mark.parametrize("n", [1, 2, 7])
def test_the_factor_is_that_of_the_paper(n: int) -> None:
    rng, m, rate, h, thermal = np.random.default_rng(n), np.linspace(0.7, 3.0, n), 0.8, 0.35, 1.7
    for _ in range(20):
        p, xi = 2 * rng.standard_normal(n), rng.standard_normal(n)
        c = mp.exp(-2 * mp.mpf(rate) * mp.mpf(h))
        K = sum(mp.mpf(x) ** 2 / (2 * mp.mpf(y)) for x, y in zip(p, m, strict=True))
        share = (1 - c) / n * (n * mp.mpf(thermal) / 2) / K
        squares = sum(mp.mpf(x) ** 2 for x in xi)
        alpha = mp.sqrt(c + share * squares + 2 * mp.mpf(xi[0]) * mp.sqrt(c * share))
        sign = 1 if mp.mpf(xi[0]) + mp.sqrt(c / share) > 0 else -1
        for name, known in (("bussi", sign * alpha), ("bussi-unsigned", alpha)):
            scheme = replace(THERMOSTATS[name], acts=(THERMOSTATS[name].acts[0], THERMOSTATS[name].acts[2]))
            stepper = Stepper(scheme, h=h, m=m, rate=rate, thermal=thermal, width=np.longdouble)
            _, found = stepper(0 * p, p.astype(np.longdouble), lambda q, p: 0 * q, [xi])
            assert found == pytest.approx([float(known) * x for x in p], rel=1e-13), name


def test_the_sign_shows_with_one_degree_of_freedom_and_an_engine_without_it_is_rejected() -> None:
    scene = baths.springs(1, steps=4000)
    run = driver.run(scene, "own:bussi-unsigned", seed=3)
    for claimed, right in (("bussi-unsigned", True), ("bussi", False)):
        said = {v.check: v.passed for v in checks.judge(scene, replace(run, scheme=claimed))}
        assert said["noise-direction"] is True
        assert all(said[f"draws-{x}"] for x in ("independent", "variance", "shape")) == right


def test_ranks_of_kinetic_energies_are_the_draws_of_one_degree_of_freedom() -> None:
    scene = baths.springs(1, steps=300)
    rng, expected = np.random.default_rng(9), np.random.default_rng(9).standard_normal(300)
    fault = Fault("right", "", (), baths.played, scheme="bussi", scene="bath")
    run = fault.run(scene, seed=rng)
    assert read(THERMOSTATS["bussi"], scene, run.q, run.p).draws[:, 0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("label", ["own:bussi", "ase:bussi", "lammps:csvr"])
def test_momenta_of_zero_are_refused_and_all_else_passes(label: str) -> None:
    if reason := engines.absence(label.partition(":")[0]):
        pytest.skip(reason)
    scene = baths.springs(3, steps=500)
    found = [
        *checks.judge(scene, driver.run(scene, label, seed=4)),
        *checks.judge_thoroughly(scene, label, driver.run, seed=4),
    ]
    assert [v.why for v in checks.shared(found) if v.passed is False] == []
    assert {v.check for v in found if v.passed} >= {
        "noise-direction",
        "noise-size",
    }
    with pytest.raises(engines.MethodError, match="all initial momenta are 0"):
        driver.run(replace(scene, p=np.zeros(3)), label, seed=4)


def test_what_a_factor_is_of_may_have_lost_digits_before_it() -> None:
    """A random bath of 10,000 whose kicks all but cancel the momenta that the factor is then of."""
    assert clean_bath(3402).alarms == ()


def test_draws_that_act_on_joined_particles_within_a_step_are_told_apart() -> None:
    """OABAO's first draws reach the force of the middle of its step: of joined particles they are solved for
    together.  Another random bath of 10,000."""
    assert clean_bath(5453).alarms == ()
