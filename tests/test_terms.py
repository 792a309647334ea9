"""A term does to itself what is done to terms: one of unheard-of names goes through every command."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import textbook as seeded
from springcheck import checks, driver, store
from springcheck.checks import laws
from springcheck.cli import main
from springcheck.errors import SceneError
from springcheck.physics import scenefile as scenes
from springcheck.physics import termcheck, terms
from springcheck.physics.arrays import Floats, Integers
from springcheck.physics.terms import Column, OnPairs, OnParticles, Term, known, register

Need = Any


@dataclass(frozen=True, kw_only=True, eq=False)
class Gauss(Term):
    """Dents of the ground under particles: V = zeta (1 - exp(-(kappa (q - omphalos))**2 / 2))."""

    key: ClassVar[str] = "gauss-dent"
    formula: ClassVar[str] = "zeta (1 - exp(-(kappa (q - omphalos))**2 / 2))"
    columns: ClassVar[tuple[Column, ...]] = (
        Column("depth-of-dent", "zeta"),
        Column("kappa", "kappa", 1.0, sign="positive"),
        Column("omphalos", "omphalos", 0.0),
    )
    ends: ClassVar[tuple[str, ...]] = ("who",)
    origin: ClassVar[str] = "omphalos"
    who: Integers
    zeta: Floats
    kappa: Floats
    omphalos: Floats

    @staticmethod
    def potential(u: Any, zeta: Any, kappa: Any) -> Any:
        return -zeta * np.expm1(-((kappa * u) ** 2) / 2)

    @staticmethod
    def slope(u: Any, zeta: Any, kappa: Any) -> Any:
        return zeta * kappa**2 * u * np.exp(-((kappa * u) ** 2) / 2)

    @staticmethod
    def second(u: Any, zeta: Any, kappa: Any) -> Any:
        return zeta * kappa**2 * (1 - (kappa * u) ** 2) * np.exp(-((kappa * u) ** 2) / 2)

    @staticmethod
    def rounding(size: Any, u: Any, zeta: Any, kappa: Any) -> Any:
        # that of u, which the exponential feels 1 + (kappa u)**2 fold, and of the exponential's argument
        square = (kappa * u) ** 2
        return np.abs(zeta) * kappa**2 * size * (1 + square) * np.exp(-square / 2) * (1 + square)


SCENE = """
title = "A dent in the ground"

[[particle]]
mass = 1.3
position = 0.7

[[particle]]
mass = 0.9
position = -0.4
momentum = 0.2

[[spring]]
ends = [0, 1]
stiffness = 0.6
rest = 0.5

[[gauss-dent]]
particle = 0
depth-of-dent = 2.9
kappa = 0.6

[[gauss-dent]]
particle = 1
depth-of-dent = 1.1
kappa = 0.3
omphalos = 0.2

[time]
step = 0.05
steps = 120
"""


@pytest.fixture
def dent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(terms, "_KNOWN", known())
    register(Gauss)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dent.toml").write_text(SCENE)
    yield tmp_path / "dent.toml"
    assert "gauss-dent" in known()


@pytest.mark.usefixtures("sketched")
def test_a_new_term_goes_through_every_command(
    dent: Path, need: Need, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    need("ase:velocity-verlet")
    need("sundials:bdf")
    # springs of their own, on which the new term does not act
    few = {h: replace(laws.ensemble(h), steps=64, every=1) for h in (laws.ODD, laws.EVEN)}
    monkeypatch.setattr(laws, "ensemble", few.__getitem__)
    assert main(["run", "dent.toml", "--left-out"]) == 0
    shown = capsys.readouterr()
    assert "0 failed" in shown.out
    assert "no gauss-dent term" in shown.out, "methods that need the formula say so"
    labels = set(store.read("dent.h5"))
    assert {"ase:velocity-verlet", "sundials:bdf", "sundials:adams"} <= labels
    assert main(["run", "--from", "dent.h5"]) == 0
    for command in ("inspect", "check", "plot"):
        assert main([command, "dent.h5"]) == 0
    assert main(["export", "dent.h5", "ase:velocity-verlet", "dent.h5md"]) == 0
    assert main(["identify", "dent.h5", "--trajectory", "ase:velocity-verlet"]) in (0, 1)
    assert "Traceback" not in capsys.readouterr().err
    assert main(["stability", "dent.toml", "--method", "ase:*", "--quiet"]) == 0
    thorough = ["run", "dent.toml", "-o", "thorough.h5", "--thorough", "--method", "ase:velocity-verlet"]
    assert main([*thorough, "--quiet"]) == 0
    capsys.readouterr()
    assert main(["precision", "dent.toml", "--method", "own:rk4", "--budget", "3", "--quiet"]) == 0
    text = scenes.load_scene(dent).to_toml()
    assert "gauss-dent" in text
    assert scenes.parse(text, name="again").digest == scenes.load_scene(dent).digest


def test_a_new_term_is_hardened_and_judged(dent: Path, need: Need) -> None:
    """The faults that change the potential change it too, and are found."""
    need("ase:velocity-verlet")
    scene = scenes.load_scene(dent)
    gauss = next(term for term in scene.terms if isinstance(term, Gauss))
    for size in (0.0, 1e-9):
        harder = scene.system.scaled(1 + size)
        changed = next(term for term in harder.terms if isinstance(term, Gauss))
        assert changed.zeta.tolist() == (gauss.zeta * (1 + size)).tolist()
        run = driver.run(harder, "ase:velocity-verlet")
        verdicts = {v.check: v.passed for v in checks.judge(scene, run)}
        assert verdicts["step-defect"] is (size == 0)
    moved = seeded.shifted(scene, 1e-9)
    run = driver.run(moved, "ase:velocity-verlet")
    assert {v.check: v.passed for v in checks.judge(scene, run)}["step-defect"] is False
    kept = next(term for term in scene.system.in_single.terms if isinstance(term, Gauss))
    for column in Gauss.columns:
        narrow = np.float32(getattr(gauss, column.field)).astype(float)
        assert getattr(kept, column.field).tolist() == narrow.tolist()
    three = scene.system.tiled(3).terms[-1]
    assert three.particles[0].tolist() == [0, 1, 2, 3, 4, 5]
    assert len(scene.system.part(np.array([1])).terms[-1]) == 1


def changed(**functions: Any) -> type[Term]:
    return type("Wrong", (Gauss,), {"key": "wrong", **{k: staticmethod(v) for k, v in functions.items()}})


@pytest.mark.parametrize(
    ("functions", "message"),
    [
        ({"slope": lambda u, z, k: 1.000001 * Gauss.slope(u, z, k)}, "slope is not the derivative"),
        ({"second": lambda u, z, k: Gauss.second(u, z, k) + 1e-6}, "second is not the derivative"),
        ({"potential": lambda u, z, k: Gauss.potential(u, z, k) + 1e-6}, "not proportional|0 at rest"),
        ({"rounding": lambda size, u, z, k: 0.01 * Gauss.rounding(size, u, z, k)}, "rounds more"),
    ],
)
def test_a_law_that_contradicts_itself_is_refused(functions: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        register(changed(**functions))
    assert "wrong" not in known()


def test_a_class_that_is_no_term_is_refused() -> None:
    class Nothing(OnParticles):
        key = "nothing"

    with pytest.raises(TypeError, match="lacks"):
        register(Nothing)
    with pytest.raises(TypeError, match="no field 'zeta'"):
        register(
            type("Bare", (OnPairs,), {n: getattr(Gauss, n) for n in ("key", "formula", "columns", *LAW)})
        )
    with pytest.raises(TypeError, match="'time' cannot be"):
        register(type("Time", (Gauss,), {"key": "time"}))
    with pytest.raises(TypeError, match="taken by WallSpring"):
        register(type("Gauss", (Gauss,), {"key": "wall-spring"}))


LAW = ("potential", "slope", "second", "rounding")


# a weight pulls everywhere, and so rests nowhere
@pytest.mark.parametrize(
    "term", [term for term in known().values() if term.kind == "potential" and term.key != "weight"]
)
def test_the_law_of_every_term_is_consistent(term: type[Term]) -> None:
    termcheck.check(term)


def test_a_scene_with_an_unknown_term_is_refused_in_one_line() -> None:
    with pytest.raises(SceneError, match="gauss-dent") as caught:
        scenes.parse(SCENE, name="dent")
    assert "\n" not in str(caught.value)


def test_a_term_of_other_numbers_is_another_object() -> None:
    scene = scenes.load_scene("spring")
    assert replace(scene, terms=scene.terms).terms[0] is scene.terms[0]
    assert scene.terms[0].scaled(2.0) is not scene.terms[0]
