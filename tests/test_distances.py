"""Terms on distances: their laws to 40 digits, their scenes, and what a scheme does to an orbit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest

import precession
import springcheck
from springcheck.cli import main
from springcheck.errors import SceneError
from springcheck.physics import scenefile, termcheck
from springcheck.physics.arrays import EPS
from springcheck.physics.terms import Column, Distances, OnParticles, Term, known

IN_DIGITS: dict[str, Any] = {
    "spring": lambda u, k: k * u,
    "wall-spring": lambda u, k: k * u,
    "quartic": lambda u, b: b * u**3,
    "cosine": lambda u, depth, wave: depth * wave * mp.sin(wave * u),
    "weight": lambda u, force: -force,
    "morse": lambda u, d, a: 2 * d * a * (1 - mp.exp(-a * u)) * mp.exp(-a * u),
    "bond": lambda u, k, rest: k * (u - rest),
    "kepler": lambda u, s: s / u**2,
    "lennard-jones": lambda u, e, s: 24 * e * (s**6 / u**7 - 2 * s**12 / u**13),
    "radial-morse": lambda u, d, a, r: 2 * d * a * (1 - mp.exp(-a * (u - r))) * mp.exp(-a * (u - r)),
}


def exactly(x: Any) -> Any:
    high = float(x)
    return mp.mpf(high) + mp.mpf(float(np.longdouble(x) - np.longdouble(high)))


@pytest.mark.parametrize("key", [key for key, term in known().items() if term.kind == "potential"])
def test_every_slope_agrees_with_40_digits_to_four_roundings(key: str) -> None:
    term: Any = known()[key]
    rng = np.random.default_rng(7)
    fields = [c.field for c in term.columns if c.field not in (term.origin, "number")]
    rows = 40
    given = {name: rng.uniform(0.5, 1.5, rows) for name in fields}
    ends = {name: np.arange(rows) + rows * j for j, name in enumerate(term.ends)}
    others = {
        name: np.arange(rows) * 1.0 for name in (term.origin, "number") if name in term.__dataclass_fields__
    }
    made = term(**ends, **given, **others)
    u = rng.uniform(-0.5, 0.5, rows).astype(np.longdouble) * (1 + 37 * np.longdouble(EPS))
    u = u + (2 if issubclass(term, Distances) else 0)
    found, bound = made.law("slope", u), np.abs(term.rounding(np.abs(u), u, *made.parameters))
    with mp.workdps(40):
        for j in range(rows):
            numbers = [mp.mpf(float(x[j])) for x in made.parameters]
            name = key if key in IN_DIGITS else key.removeprefix("wall-")
            assert name in IN_DIGITS, f"add the slope of {name} in 40 digits"
            right = IN_DIGITS[name](exactly(u[j]), *numbers)
            assert abs(exactly(found[j]) - right) <= 4 * EPS * float(bound[j])


def sextic(**changed: Any) -> type[Term]:
    law = {
        "potential": lambda u, c: c * (u * u * u) ** 2 / 6,
        "slope": lambda u, c: c * (u * u) * (u * u) * u,
        "second": lambda u, c: 5 * c * (u * u) * (u * u),
        "rounding": lambda size, u, c: 5 * abs(c) * (u * u) * (u * u) * size,
    }
    parts = {name: staticmethod(function) for name, function in (law | changed).items()}
    columns = (Column("coefficient", "c"), Column("at", "at", 0.0))
    more = {
        "key": "sextic",
        "formula": "c/6 (q - at)**6",
        "columns": columns,
        "__annotations__": {"c": object},
    }
    return dataclass(frozen=True, kw_only=True, eq=False)(type("Sextic", (OnParticles,), parts | more))


@pytest.mark.parametrize(
    "changed",
    [
        {"slope": lambda u, c: np.asarray(c * (u * u) * (u * u) * u, np.float64)},
        {"second": lambda u, c: 5 * c * u * u * u * np.asarray(u, np.float64)},
        {"potential": lambda u, c: np.asarray(c * u, np.float64) * u**5 / 6},
    ],
)
def test_a_law_that_rounds_to_double_precision_is_refused(changed: dict[str, Any]) -> None:
    termcheck.check(sextic())
    with pytest.raises(ValueError, match="rounds to double precision"):
        termcheck.check(sextic(**changed))


@pytest.mark.parametrize("name", ["elastic-pendulum", "kepler", "argon-pair", "diatomic"])
def test_forces_and_second_derivatives_belong_to_the_energy(name: str) -> None:
    system, h = springcheck.load_scene(name).system, 2.0**-20
    rng = np.random.default_rng(3)
    q = system.q + 0.01 * np.max(np.abs(system.q)) * rng.normal(size=system.n)
    moved = q + h * np.concatenate([np.eye(system.n), -np.eye(system.n)])
    e, f = (
        x.reshape(2, system.n, -1) for x in (system.energy(moved, 0 * moved), system.force(moved, 0 * moved))
    )
    size = np.max(np.abs(system.hessian(q)))
    assert np.allclose((e[1] - e[0])[:, 0] / (2 * h), system.force(q, 0 * q), atol=1e-6 * float(size), rtol=0)
    assert np.allclose(
        (f[1] - f[0]) / (2 * h), system.hessian(q).astype(float), atol=1e-6 * float(size), rtol=0
    )


@pytest.mark.parametrize("scene", ["kepler", "elastic-pendulum"])
@pytest.mark.parametrize("scheme", ["velocity-verlet", "semi-implicit-euler", "rk4"])
def test_a_file_of_17_digits_is_judged(scene: str, scheme: str, tmp_path: Path) -> None:
    found = springcheck.load_scene(scene)
    run = springcheck.simulate(replace(found, steps=200), f"own:{scheme}")
    table = np.column_stack([run.t, run.q, run.p / found.m])
    np.savetxt(tmp_path / "a.csv", table, fmt="%.17g", delimiter=",", header="t,x,y,vx,vy", comments="")
    given = ["judge", str(tmp_path / "a.csv"), "--scene", scene, "--partial", "--scheme"]
    assert main([*given, scheme]) == 0
    other = "rk4" if scheme != "rk4" else "velocity-verlet"
    assert main([*given, other]) == 1


@pytest.mark.parametrize("scheme", ["velocity-verlet", "position-verlet", "semi-implicit-euler", "ruth3"])
def test_verlet_turns_an_ellipse_by_its_law(scheme: str) -> None:
    for m, strength, a, e in ((0.7, 1.5, 2.0, 0.5), (3.1, 0.4, 0.9, 0.2)):
        for steps, off in ((500, 3e-3), (1000, 8e-4)):
            found, change = precession.turned(precession.orbit(m, strength, a, e, steps), strength, scheme)
            assert change < 1e-12
            law = precession.law(e, 2 * np.pi / steps)
            assert (abs(found / law - 1) < off) is (scheme != "ruth3")


def test_ends_at_one_place_are_refused_in_a_line() -> None:
    text = scenefile.load_scene("kepler").to_toml().replace("[1.0, 0.0]", "[0.0, 0.0]")
    with pytest.raises(SceneError, match="singular: move its ends apart") as caught:
        scenefile.parse(text, name="a")
    assert "\n" not in str(caught.value)
