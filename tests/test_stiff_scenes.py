"""The stiff scenes against references made by another route: matrix exponentials in mpmath.

The references carry 30 digits.  The bound is rounding in extended
precision, with what makes it larger: phases and exponents are known to EPS of themselves; near critical
damping the distance of the two roots is known to EPS w**2 only, which costs the exponent squared; and a
stiff mode sees the rounding of its vector times w q, even where it is at rest.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from onestep import propagator
from springcheck import checks, driver, engines, schemes
from springcheck.errors import MethodError, SceneError
from springcheck.physics import exact
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Extended
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Spring

FOLDER = Path(__file__).parents[1] / "data" / "reference" / "stiff"
ROWS = [
    pytest.param(path.stem, row, id=f"{path.stem}-{row.get('ratio', '')}-{row['steps']}")
    for path in sorted(FOLDER.glob("*.json"))
    for row in json.loads(path.read_text(encoding="utf-8")).get("motion", ())
]


def reference(name: str) -> dict[str, Any]:
    return dict(json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8")))


def extended(texts: list[str]) -> Extended:
    return np.array([np.longdouble(x) for x in texts])


def as_stated(name: str, row: dict[str, Any]) -> Scene:
    """The scene with the ratio of a reference's row put in."""
    scene = scenes.load_scene(name)
    if name == "two-scales":
        soft, stiff = scene.terms
        return replace(scene, terms=(soft, replace(stiff, k=soft.k * float(row["ratio"]))))
    if name == "overdamped":
        spring, brake = scene.terms
        return replace(scene, terms=(spring, replace(brake, c=np.array([float(row["coefficient"])]))))
    return scene


@pytest.mark.parametrize(("name", "row"), ROWS)
def test_the_true_motion_is_the_matrix_exponential(name: str, row: dict[str, Any]) -> None:
    scene = as_stated(name, row)
    found = scene.system.modes
    q, p = exact.true_motion(scene, np.array([row["steps"]]), scene.step)
    wanted_q, wanted_p = extended(row["q"]), extended(row["p"])
    t = row["steps"] * scene.step
    w = np.sqrt(np.abs(found.w2))
    half = found.rate / 2
    slow = np.where(half > w, found.w2 / (half + np.sqrt(np.abs((half - w) * (half + w)))), w)
    exponent = float(np.max(slow * t))
    y, v = found.into(wanted_q, wanted_p)
    moved = np.max(np.abs(w * y) + np.abs(v)) + np.max(w) * np.max(np.abs(y))
    allowed = 16 * exact.EPS * (1 + exponent) * moved
    if np.any(found.rate):
        allowed *= 1 + exponent
    assert np.max(np.abs(p[0] - wanted_p) / found.root_m) <= allowed
    assert np.max(np.abs(q[0] - wanted_q) * found.root_m) <= allowed / np.min(w)


@pytest.mark.parametrize("row", reference("two-scales")["frequencies"], ids=lambda row: row["ratio"])
def test_both_frequencies_of_two_scales_are_right_to_their_own_size(row: dict[str, Any]) -> None:
    found = np.sort(as_stated("two-scales", row).system.modes.w2)
    wanted = np.sort(extended(row["w2"]))
    assert np.max(np.abs(found / wanted - 1)) <= 16 * exact.EPS


def test_the_eigenvalues_of_the_matrix_itself_would_lose_the_slow_mode() -> None:
    row = reference("two-scales")["frequencies"][-1]
    scene = as_stated("two-scales", row)
    root_m = np.sqrt(scene.m.astype(np.longdouble))
    scaled = scene.system.hessian(scene.q) / root_m[:, None] / root_m
    plain = np.linalg.eigvalsh(scaled.astype(np.float64))[0]
    assert abs(plain / float(row["w2"][0]) - 1) > 1e-7


def test_graded_modes_find_a_chain_over_twelve_decades_and_its_free_translation() -> None:
    rng = np.random.default_rng(5)
    n = 7
    m = rng.uniform(0.5, 4, n)
    spring = Spring(
        a=np.arange(n - 1), b=np.arange(1, n), k=10.0 ** rng.uniform(-6, 6, n - 1), rest=np.zeros(n - 1)
    )
    scene = Scene(
        name="graded", title="", source="", m=m, q=rng.normal(size=n), p=rng.normal(size=n),
        terms=(spring,), step=0.1, steps=10,
    )  # fmt: skip
    found = scene.system.modes
    assert np.count_nonzero(found.w2 == 0) == 1
    assert found.vectors is not None
    assert np.max(np.abs(found.vectors.T @ found.vectors - np.eye(n))) < 64 * exact.EPS
    import mpmath as mp

    with mp.workdps(60):
        k = mp.zeros(n)
        for a, b, x in zip(spring.a.tolist(), spring.b.tolist(), spring.k.tolist(), strict=True):
            k[a, a] += x
            k[b, b] += x
            k[a, b] -= x
            k[b, a] -= x
        root = [mp.sqrt(x) for x in m.tolist()]
        scaled = mp.matrix(n, n)
        for i in range(n):
            for j in range(n):
                scaled[i, j] = k[i, j] / root[i] / root[j]
        values = sorted(mp.eigsy(scaled, eigvals_only=True))[1:]
        wanted = extended([mp.nstr(x, 30) for x in values])
    assert np.max(np.abs(np.sort(found.w2)[1:] / wanted - 1)) <= 8 * n * exact.EPS


@pytest.mark.parametrize("row", reference("multiple-time-steps")["maps"], ids=lambda row: row["h_w_fast"])
def test_the_respa_map_is_the_product_of_its_parts(row: dict[str, Any]) -> None:
    scene = scenes.load_scene("multiple-time-steps")
    found = propagator(schemes.SCHEMES["respa8"], scene, h=float(row["step"]))
    wanted = np.array([extended(line) for line in row["matrix"]])
    assert np.max(np.abs(found - wanted)) <= 256 * exact.EPS * np.max(np.abs(wanted))


SCENES = ("stiff-spring", "overdamped", "detest-b1", "multiple-time-steps")


@pytest.mark.parametrize("name", SCENES)
def test_every_method_that_serves_a_stiff_scene_passes_every_check(name: str, need: Any) -> None:
    scene = scenes.load_scene(name)
    judged = 0
    for label in engines.match(scene.include):
        if engines.refusal(scene, label):
            continue
        if name == "detest-b1" and label.method == "langevin-middle":
            # two friction rates: refused, as another test demands
            continue
        need(str(label))
        run = driver.run(scene, label)
        failed = [v for v in checks.judge(scene, run) if v.passed is False]
        assert not failed, f"{label}: {failed}"
        judged += 1
    assert judged >= 3


@pytest.mark.parametrize(("name", "stage"), [("langevin-middle", "friction"), ("respa8", "fast")])
def test_a_wrong_coefficient_in_a_new_kind_of_stage_is_seen(name: str, stage: str, need: Any) -> None:
    need("openmm:mts")
    scene = scenes.load_scene("overdamped" if stage == "friction" else "multiple-time-steps")
    scene = replace(scene, steps=200, every=1)
    run = driver.run(scene, "openmm:langevin-middle" if stage == "friction" else "openmm:mts")
    case = checks.Case(scene=scene, trajectory=run)
    assert checks.step_defect(case).passed
    true = schemes.SCHEMES[name]
    stages = tuple((kind, schemes.number(c, np.longdouble)) for kind, c in true.stages)
    j = [kind for kind, _ in stages].index(stage)  # type: ignore[arg-type]
    off = replace(
        true, stages=tuple((kind, str(c * (1 + 1e-10 * (i == j)))) for i, (kind, c) in enumerate(stages))
    )
    faulty = replace(run, scheme="off")
    schemes.SCHEMES["off"] = off
    try:
        assert checks.step_defect(checks.Case(scene=scene, trajectory=faulty)).passed is False
    finally:
        del schemes.SCHEMES["off"]


def test_the_langevin_middle_engine_refuses_two_friction_rates_and_a_run_backwards(need: Any) -> None:
    need("openmm:langevin-middle")
    with pytest.raises(MethodError, match="one friction rate"):
        driver.run(scenes.load_scene("detest-b1"), "openmm:langevin-middle")
    scene = scenes.load_scene("overdamped")
    with pytest.raises(MethodError, match="forwards in time only"):
        driver.run(replace(scene, step=-scene.step), "openmm:langevin-middle")


def test_methods_for_friction_or_fast_springs_say_what_a_scene_lacks() -> None:
    spring = scenes.load_scene("spring-uneven")
    for label, lack in (("openmm:langevin-middle", "damping"), ("openmm:mts", "springs marked fast")):
        reason = engines.refusal(spring, engines.parse(label))
        assert reason is not None
        assert lack in reason


def test_a_friction_below_zero_is_refused() -> None:
    text = scenes.load_scene("overdamped").to_toml().replace("coefficient = 388.3", "coefficient = -1.0")
    with pytest.raises(SceneError, match=r"damping\[0\].coefficient"):
        scenes.parse(text, name="x")
