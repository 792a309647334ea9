"""Thermostats that are broken on purpose, as such that shipped were: each is rejected, by the check named.

A fault changes one thing of a right scheme: its draws, its numbers, its stages, or what is recorded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from springcheck import checks, engines
from springcheck.checks.seeds import SEEDED, Seeded
from springcheck.engines.own import thermal as own
from springcheck.physics.bath import Bath
from springcheck.physics.scene import Scene
from springcheck.physics.terms import WallSpring
from springcheck.physics.trajectory import Trajectory, of_scene
from springcheck.thermal import THERMOSTATS, Stepper
from springcheck.thermal.catalogue import HALF, ONE, Act, Thermostat

N = 40


def scene(steps: int = 1200, n: int = N) -> Scene:
    """Unlike particles on unlike springs; nothing is 1."""
    m, k = np.geomspace(0.7, 9.0, n), np.geomspace(5.0, 1.9, n)
    springs = WallSpring(i=np.arange(n), k=k, at=np.zeros(n))
    return Scene(
        m=m, q=np.full(n, 0.3), p=np.full(n, 0.2), terms=(springs,), step=0.35, steps=steps, name="springs",
        bath=Bath(temperature=1.7, friction=0.8),
    )  # fmt: skip


Draws = Callable[[np.random.Generator, int, np.ndarray], np.ndarray]


def right(rng: np.random.Generator, i: int, m: np.ndarray) -> np.ndarray:
    return rng.standard_normal(len(m))


@dataclass(frozen=True, kw_only=True)
class Fault:
    """What is claimed, what runs, and the check that must reject it."""

    by: str
    claims: str = "baoab"
    runs: Thermostat | str = ""
    draws: Draws = right
    numbers: dict[str, float] = field(default_factory=dict)
    """Factors of h, rate, thermal, m, k and collision."""
    n: int = N
    steps: int = 1200


def _repeated(period: int) -> Draws:
    kept: dict[int, np.ndarray] = {}

    def draws(rng: np.random.Generator, i: int, m: np.ndarray) -> np.ndarray:
        if i < period:
            kept[i] = rng.standard_normal(len(m))
        return kept[i % period]

    return draws


def _twice(sign: float) -> Draws:
    kept: list[np.ndarray] = []

    def draws(rng: np.random.Generator, i: int, m: np.ndarray) -> np.ndarray:
        if i % 2 == 0:
            kept[:] = [rng.standard_normal(len(m))]
            return kept[0]
        return sign * kept[0]

    return draws


def _coloured(rng: np.random.Generator, i: int, m: np.ndarray) -> np.ndarray:
    last = _LAST.get(id(rng), np.zeros(len(m)))
    _LAST[id(rng)] = 0.1 * last + np.sqrt(0.99) * rng.standard_normal(len(m))
    return _LAST[id(rng)]


_LAST: dict[int, np.ndarray] = {}


def _acts(*acts: Act, draws: int = 1, carried: int = 0) -> Thermostat:
    return Thermostat(name="broken", title="", acts=acts, draws=draws, carried=carried)


A, B = (Act("drift", HALF), Act("kick", HALF))
O = THERMOSTATS["baoab"].acts[2]  # noqa: E741 - the letter of the literature

FAULTS: dict[str, Fault] = {
    "root of the mass missing": Fault(by="draws-variance", draws=lambda r, i, m: right(r, i, m) / np.sqrt(m)),
    "mass for its root": Fault(by="draws-variance", draws=lambda r, i, m: right(r, i, m) * np.sqrt(m)),
    "noise too large by 1 %": Fault(by="draws-variance", draws=lambda r, i, m: 1.01 * right(r, i, m), n=250),
    "noise of 1 - c for 1 - c**2": Fault(
        by="draws-variance", draws=lambda r, i, m: right(r, i, m) / np.sqrt(1 + np.exp(-0.28))
    ),
    "calories for joules": Fault(by="draws-variance", numbers={"thermal": 4.184}),
    "boltzmann's constant of five digits": Fault(
        by="noise-matrix", numbers={"thermal": 8.3145 / 8.31446261815324}
    ),
    "sigma off by 1e-12": Fault(by="noise-matrix", numbers={"thermal": 1 + 2e-12}),
    "uniform draws": Fault(by="draws-shape", draws=lambda r, i, m: np.sqrt(12) * (r.random(len(m)) - 0.5)),
    "coins for draws": Fault(by="draws-shape", draws=lambda r, i, m: r.choice([-1.0, 1.0], len(m))),
    "heavy tails": Fault(by="draws-shape", draws=lambda r, i, m: r.standard_t(5, len(m)) * np.sqrt(0.6)),
    "draws cut off at 2": Fault(by="draws-variance", draws=lambda r, i, m: np.clip(right(r, i, m), -2, 2)),
    "draws that are not centred": Fault(by="draws-mean", draws=lambda r, i, m: right(r, i, m) + 0.05),
    "each draw used in two steps": Fault(by="draws-neighbours", draws=_twice(1)),
    "every other draw the opposite": Fault(by="draws-neighbours", draws=_twice(-1)),
    "coloured noise": Fault(by="draws-neighbours", draws=_coloured),
    "generator restarted every 64 steps": Fault(by="draws-repeat", draws=_repeated(64)),
    "generator restarted every 500 steps": Fault(by="draws-repeat", draws=_repeated(500)),
    "one draw for all particles": Fault(
        by="draws-particles", draws=lambda r, i, m: np.full(len(m), r.standard_normal())
    ),
    "one draw for each two particles": Fault(
        by="draws-particles", draws=lambda r, i, m: np.repeat(r.standard_normal(len(m) // 2), 2)
    ),
    "velocities half a step early": Fault(by="noise-direction", runs="baoa"),
    "half-step velocities for on-site ones": Fault(
        by="noise-direction", claims="gj-i", runs="gj-i-half"
    ),
    "ABOBA for BAOAB": Fault(by="noise-direction", runs="aboba"),
    "OBABO for BAOAB": Fault(by="noise-direction", runs="obabo"),
    "BAOAB for OBABO": Fault(by="draws-neighbours", claims="obabo", runs="baoab"),
    "GJ-II for BAOAB": Fault(by="noise-direction", runs="gj-ii"),
    "GJ-I for BAOAB, another decay": Fault(by="noise-map", runs="gj-i"),
    "BAOAB for GJ": Fault(by="noise-direction", claims="gj-ii", runs="baoab"),
    "friction of the other half step": Fault(by="noise-map", claims="bbk", runs="lammps-langevin"),
    "friction of the on-site velocity": Fault(by="noise-map", claims="lammps-langevin", runs="bbk"),
    "friction of each substep for the whole": Fault(by="draws-variance", numbers={"rate": 0.5}),
    "friction off by 1e-9": Fault(by="noise-map", numbers={"rate": 1 + 1e-9}),
    "last half kick left out": Fault(by="noise-direction", runs=_acts(B, A, O, A)),
    "last half kick with the old force": Fault(
        by="noise-direction", runs=_acts(B, A, O, A, Act("held", HALF)), steps=60
    ),
    "whole drifts for half ones": Fault(
        by="noise-direction", runs=_acts(B, Act("drift", ONE), O, Act("drift", ONE), B), steps=60
    ),
    "noise in positions too": Fault(
        by="noise-direction", runs=_acts(B, A, O, A, B, Act("jump", lambda x: 1e-9 * x))
    ),
    "step off by 1e-9": Fault(by="noise-direction", numbers={"h": 1 + 1e-9}),
    "stiffness off by 1e-9": Fault(by="noise-direction", numbers={"k": 1 + 1e-9}),
    "masses of 1 in the drift": Fault(by="noise-direction", numbers={"m": 0.0}),
    "collision after the first half kick": Fault(
        by="draws-variance", claims="andersen", runs="andersen-after-kick", n=250
    ),
    "collision on half-step velocities": Fault(
        by="noise-direction", claims="andersen", runs="andersen-leapfrog"
    ),
    "chance of a collision gamma h": Fault(
        by="collisions", claims="andersen", numbers={"collision": 0.28 / (1 - np.exp(-0.28))}
    ),
    "collisions without the root of the mass": Fault(
        by="draws-variance", claims="andersen", draws=lambda r, i, m: right(r, i, m) / np.sqrt(m)
    ),
    "a seed that is ignored": Fault(by="seed-kept", draws=lambda r, i, m: _FIXED.standard_normal(len(m))),
    "a seed that is fixed": Fault(by="seed-kept", draws=_repeated(1)),
}  # fmt: skip

_FIXED = np.random.default_rng(1)


def play(fault: Fault, at: Scene, seed: int) -> Trajectory:
    """The run of a fault, under the name of what it claims."""
    assert at.bath is not None
    claims = THERMOSTATS[fault.claims]
    of = fault.runs if isinstance(fault.runs, Thermostat) else THERMOSTATS[fault.runs or fault.claims]
    f = {name: fault.numbers.get(name, 1.0) for name in ("h", "rate", "thermal", "m", "k", "collision")}
    # a factor of 0: all masses 1
    m = at.m * f["m"] if f["m"] else np.ones(at.n)
    stepper = Stepper(
        of, h=at.step * f["h"], m=m, rate=at.bath.friction * f["rate"], thermal=at.thermal * f["thermal"],
        width=np.float64,
    )  # fmt: skip
    rng, q, p = np.random.default_rng(seed), [at.q], [at.p]
    drawn = iter(range(10**9))

    def some(number: int) -> list[np.ndarray]:
        if of.uniform:
            return list(np.sqrt(12) * (rng.random((number, at.n)) - 0.5))
        return [fault.draws(rng, next(drawn), at.m) for _ in range(number)]

    def force(q: Any, p: Any) -> Any:
        return f["k"] * at.system.potential_force(q, p)

    carried = some(of.carried)
    for _ in range(at.steps):
        draws = [*carried, *some(of.fresh)]
        hit = rng.random(at.n) < f["collision"] * stepper.collision
        a, b = stepper(q[-1], p[-1], force, draws, hit)
        carried = draws[len(draws) - of.carried :]
        q.append(a)
        p.append(b)
    return of_scene(at, np.array(q), np.array(p), label=f"own:{claims.name}", scheme=claims.name)


def verdicts(fault: Fault, seed: int, monkeypatch: pytest.MonkeyPatch) -> dict[str, bool | None]:
    at = scene(fault.steps, fault.n)
    if fault.by in {one.name for one in SEEDED}:
        return _experiments(fault, seed, monkeypatch)
    run = play(fault, at, seed)
    at = replace(at, quantities=("q", "p"))
    return {v.check: v.passed for v in checks.judge(at, run)}


def _experiments(fault: Fault, seed: int, monkeypatch: pytest.MonkeyPatch) -> dict[str, bool | None]:
    """The same by an engine: our own one with the fault in it."""

    class Broken(own.Random):
        def __init__(self, scene: Scene, scheme: str, step: float, seed: Any) -> None:
            super().__init__(scene, scheme, step, seed)
            assert scene.bath is not None
            of = {name: fault.numbers.get(name, 1.0) for name in ("rate", "thermal")}
            of_name = str(fault.runs) or scheme
            self._scheme = replace(THERMOSTATS[of_name], uniform=THERMOSTATS[scheme].uniform)
            self._step = Stepper(
                self._scheme, h=step, m=scene.m, rate=scene.bath.friction * of["rate"],
                thermal=scene.thermal * of["thermal"], width=np.float64,
            )  # fmt: skip

        def _drawn(self, steps: int, draws: int) -> Any:
            if fault.draws is right:
                return super()._drawn(steps, draws)
            shape = (steps, draws, len(self._q))
            rng = np.random.default_rng(3)
            return np.reshape([fault.draws(rng, i, self._q) for i in range(steps * draws)], shape)

    monkeypatch.setattr(own, "Random", Broken)
    few = scene(n=3)
    found = [one(Seeded(scene=few, label=f"own:{fault.claims}", seed=seed)) for one in SEEDED]
    return {v.check: v.passed for v in checks.shared(found)}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_rejected_by_the_check_that_is_for_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = verdicts(FAULTS[name], 20261122, monkeypatch)
    assert found[FAULTS[name].by] is False, found


def test_there_are_forty_faults_and_every_check_of_draws_has_one() -> None:
    assert len(FAULTS) >= 40
    mine = {one.name for one in checks.RANDOM if one.family == "noise"} | {one.name for one in SEEDED}
    assert mine - {fault.by for fault in FAULTS.values()} == {"noise-size", "seeds-apart"}


@pytest.mark.parametrize("name", ["baoab", "obabo", "bbk", "gj-i-half", "lammps-langevin", "andersen"])
def test_what_is_right_passes_here(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = verdicts(Fault(by="", claims=name), 20261122, monkeypatch)
    assert all(passed is not False for passed in found.values()), found


@pytest.mark.parametrize(
    "label", ["own:baoab", "own:andersen", "own:bbk", "openmm:langevin-middle-bath", "ase:langevin"]
)
def test_experiments_with_seeds_pass_for_what_is_right(label: str) -> None:
    if reason := engines.absence(label.partition(":")[0]):
        pytest.skip(reason)
    found = checks.judge_seeds(scene(n=3), label, 5)
    assert [v.why for v in found if v.passed is False] == []
    assert sum(v.passed is True for v in found) >= 2
