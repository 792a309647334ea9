"""A scene cannot be invalid; its text is written from its numbers, and they are its identity."""

from __future__ import annotations

import pickle
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from springcheck import checks, driver
from springcheck.errors import SceneError
from springcheck.physics import scenefile as scenes
from springcheck.physics.builders import chain, spring
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Cosine, Damping, Morse, Quartic, Spring, Term, WallSpring
from springcheck.studies import keeper
from springcheck.studies.run import measure as main_job

LABEL = "own:semi-implicit-euler"


def numbers(scene: Scene) -> list[Any]:
    """All that makes a scene what it is, as plain values."""
    rows: list[Any] = [scene.kind, scene.units, scene.step, scene.steps, scene.every, scene.tolerance]
    rows += [scene.quantities, scene.include, scene.title, scene.source]
    rows += [x.tolist() for x in (scene.m, scene.q, scene.p)]
    for term in scene.terms:
        rows += [term.key, term.fast, [x.tolist() for x in term.particles]]
        rows += [getattr(term, column.field).tolist() for column in term.columns]
    return rows


def test_a_changed_scene_is_stored_as_what_it_is_and_run_again_as_that(tmp_path: Path) -> None:
    shipped = scenes.load_scene("spring-uneven")
    changed = replace(shipped, step=0.2, p=3 * shipped.p)
    main_job.run(changed, tmp_path / "x.h5", methods=[LABEL])
    kept = keeper.stored_scene(tmp_path / "x.h5")
    assert numbers(kept) == numbers(changed)
    assert kept.digest == changed.digest != shipped.digest
    (again,) = main_job.repeat(tmp_path / "x.h5")
    assert again.equal
    assert again.difference == 0


GOOD: dict[str, Any] = {
    "m": [1.3, 0.7], "q": [0.1, 0.2], "p": [0.3, 0.4], "step": 0.1, "steps": 12, "every": 3,
    "terms": (WallSpring(i=np.array([0, 1]), k=np.array([2.9, 1.7]), at=np.array([0.0, 0.4])),),
}  # fmt: skip
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "no particle": ({"m": [], "q": [], "p": [], "terms": ()}, "at least one particle"),
    "a mass of -1": ({"m": [1.3, -1.0]}, r"m\[1\] = -1.0: a number > 0"),
    "a mass of 0": ({"m": [0.0, 1.0]}, r"m\[0\] = 0.0: a number > 0"),
    "a mass that is no number": ({"m": [1.3, np.nan]}, r"m\[1\] = nan: a finite number"),
    "an infinite position": ({"q": [np.inf, 0.0]}, r"q\[0\] = inf: a finite number"),
    "a momentum that is no number": ({"p": [0.0, np.nan]}, r"p\[1\] = nan: a finite number"),
    "a position too few": ({"q": [0.1]}, "q has the shape"),
    "a table of momenta": ({"p": [[0.3, 0.4]]}, "p has the shape"),
    "a word for a mass": ({"m": ["one", "two"]}, "m: real numbers"),
    "a complex position": ({"q": [0.1j, 0.0]}, "q: real numbers"),
    "a step of 0": ({"step": 0.0}, "step = 0.0"),
    "an infinite step": ({"step": np.inf}, "step = inf"),
    "an end beyond all numbers": ({"step": 1e308, "steps": 12}, "step = 1e[+]308"),
    "no steps": ({"steps": 0}, "steps = 0"),
    "half a step": ({"steps": 10.5}, "steps = 10.5"),
    "more steps than doubles tell apart": ({"steps": 2**53 + 1, "every": 1}, "2[*][*]53"),
    "steps that are no multiple of every": ({"steps": 7, "every": 2}, "every = 2"),
    "every 0": ({"every": 0}, "every = 0"),
    "a tolerance of 1": ({"tolerance": 1.0}, "tolerance = 1.0"),
    "unknown units": ({"units": "cgs"}, "units = 'cgs'"),
    "an unknown kind": ({"kind": "field"}, "kind = 'field'"),
    "a circuit in nanometres": ({"kind": "circuit", "units": "md"}, "units = 'md'"),
    "no momenta recorded": ({"quantities": ("q", "energy")}, "quantities"),
    "an unknown quantity": ({"quantities": ("q", "p", "heat")}, "heat"),
    "no methods": ({"include": ()}, "include"),
    "a name that is none": ({"name": ""}, "name"),
    "a title of half a character": ({"title": "\ud800"}, "title"),
    "something that is no term": ({"terms": ("spring",)}, "terms"),
    "a spring on a particle that is not there": (
        {"terms": (WallSpring(i=[0, 2], k=[1.0, 1.0], at=[0.0, 0.0]),)}, r"wall-spring: i\[1\] = 2",
    ),
    "a spring on particle -1": ({"terms": (WallSpring(i=[-1], k=[1.0], at=[0.0]),)}, r"i\[0\] = -1"),
    "a spring from a particle to itself": (
        {"terms": (Spring(a=[0], b=[0], k=[1.0], rest=[0.0]),)}, "same particle",
    ),
    "an infinite stiffness": ({"terms": (WallSpring(i=[0], k=[np.inf], at=[0.0]),)}, r"k\[0\] = inf"),
    "a pendulum of no length": (
        {"terms": (Cosine(i=[0], depth=[1.0], wave=[0.0], at=[0.0]),)}, r"wave\[0\] = 0.0: a number > 0",
    ),
    "friction that drives": ({"terms": (Damping(i=[0], c=[-1.0]),)}, r"c\[0\] = -1.0: a number >= 0"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_scene_cannot_be_invalid(name: str) -> None:
    changes, message = WRONG[name]
    right = Scene(**GOOD)
    for make in (lambda: Scene(**{**GOOD, **changes}), lambda: replace(right, **changes)):
        with pytest.raises(SceneError, match=message) as caught:
            make()
        assert "\n" not in str(caught.value)


WRITTEN = """
[[particle]]
mass = 1
momentum = 1
[[spring]]
ends = ["wall", 0]
stiffness = 1
[time]
step = 0.1
steps = 5
"""
"""A scene file that is right."""


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("[[particle]]", "[particle]", "particle: write [[particle]], in double"),
        (
            "[[spring]]",
            "[spring]",
            "spring: write [[spring]], in double brackets",
        ),
        ("[time]", "[[time]]", "time: there is one of it: write [time], in single brackets, once"),
        (
            '"wall"',
            '"Wall"',
            "spring[0].ends[0] = 'Wall': one of \"wall\", the number of a particle is needed",
        ),
        ('"wall"', "0.5", 'spring[0].ends[0] = 0.5: one of "wall", the number of a particle is needed'),
        ('["wall", 0]', "0", "spring[0].ends = 0: a list in brackets is needed"),
        ('["wall", 0]', "[0]", "spring[0].ends = [0]: a list in brackets of length 2 is needed"),
        ("steps = 5", "steps = 5.0", "time.steps = 5.0: a whole number is needed"),
        ("steps = 5", "steps = 0", "time.steps = 0: a whole number >= 1 is needed"),
        ("steps = 5", 'steps = "5"', "time.steps = '5': a whole number is needed, without quotes"),
        ("mass = 1", "mass = true", "particle[0].mass = true: a number is needed"),
        ("mass = 1", "mass = -1", "particle[0].mass = -1: a number > 0.0 is needed"),
        ("mass = 1", 'mass = 1\naxes = "w"', "particle[0].axes = 'w': letters of x, y and z are needed"),
        ("mass = 1", "mass = 1\nposition = 'a'", "position = 'a': a number or a list in brackets is needed"),
        (
            "mass = 1",
            "mas = 1",
            "it has the unknown field `mas`, did you mean mass?; its fields are mass, pos",
        ),
        ("mass = 1", "", "particle[0]: it lacks the field `mass`; its fields are mass, position, momentum"),
        ("stiffness = 1", "stiffness = 1\nfast = 1", "spring[0].fast = 1: true or false is needed"),
        ("[time]", "[tine]", "it has the unknown field `tine`, did you mean time?"),
        ("[time]\nstep = 0.1\nsteps = 5", "", "the scene: it lacks the table [time]"),
        ("[[particle]]", "title = 5\n[[particle]]", "title = 5: text in quotes is needed"),
        (
            "[time]",
            "[[kepler]]\nends = ['wall', 0]\nstrength = 1\n[time]",
            "wall-kepler: the distance u at the start is 0",
        ),
        ("mass = 1", "mass = 0,25", "(at line 3, column 9): mass = 0,25; numbers are written as 0.25"),
        ("steps = 5", "[time]", "Cannot declare [time] twice (at line 10, column 6): [time]"),
    ],
)
def test_a_mistake_in_a_scene_file_is_said_in_words_of_toml(right: str, wrong: str, said: str) -> None:
    assert scenes.parse(WRITTEN, name="one").n == 1
    with pytest.raises(SceneError, match=re.escape(said)) as caught:
        scenes.parse(WRITTEN.replace(right, wrong, 1), name="one")
    assert not any(word in str(caught.value) for word in ("`float`", "`int`", "`str`", "array`", "object"))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: WallSpring(i=[0, 1], k=[1.0], at=[0.0, 0.0]), "wall-spring: k has the shape"),
        (lambda: WallSpring(i=[0.5], k=[1.0], at=[0.0]), "wall-spring: i: whole numbers"),
        (lambda: Spring(a=[0, 1], b=[1], k=[1.0], rest=[0.0]), "spring: b has the shape"),
        (lambda: Morse(a=[0], b=[1], depth=["x"], steepness=[1.0], rest=[0.0]), "morse: depth: real numbers"),
    ],
)
def test_the_rows_of_a_term_belong_together(make: Any, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        make()


def test_a_scene_keeps_numbers_of_its_own() -> None:
    m, k = np.array([1.3, 0.7]), np.array([2.9, 1.7])
    scene = Scene(**{**GOOD, "m": m, "terms": (WallSpring(i=[0, 1], k=k, at=0.0),)})
    m[0], k[0] = -1.0, np.nan
    assert scene.m.tolist() == [1.3, 0.7]
    (term,) = scene.terms
    assert isinstance(term, WallSpring)
    assert term.k.tolist() == [2.9, 1.7]
    for values in (scene.m, scene.q, scene.p, term.i, term.k, term.at):
        assert values.dtype in (np.float64, np.int64)
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 7
    assert replace(scene, step=0.3).m is scene.m, "what cannot change need not be copied"


def test_terms_have_one_order_and_one_object_for_each_law() -> None:
    one = WallSpring(i=[0], k=[2.9], at=[0.0])
    other = WallSpring(i=[1], k=[1.7], at=[0.4])
    fast = WallSpring(i=[1], k=[7.0], at=[0.0], fast=True)
    scene = Scene(
        **{**GOOD, "terms": (Damping(i=[0], c=[0.1]), fast, Quartic(i=[0], b=[1.0], at=0.0), one, other)}
    )
    assert [(term.key, term.fast, len(term)) for term in scene.terms] == [
        ("wall-spring", False, 2), ("wall-spring", True, 1), ("quartic", False, 1), ("damping", False, 1),
    ]  # fmt: skip
    again = Scene(
        **{**GOOD, "terms": (one, other, fast, Quartic(i=[0], b=[1.0], at=0.0), Damping(i=[0], c=[0.1]))}
    )
    assert again.digest == scene.digest


def test_a_scene_goes_to_another_process_without_what_was_computed() -> None:
    scene = spring()
    assert scene.system.modes.w2[0] == 1
    plain = len(pickle.dumps(spring()))
    assert len(pickle.dumps(scene)) == plain
    again = pickle.loads(pickle.dumps(scene))
    assert again.digest == scene.digest
    assert not any(x.flags.writeable for x in (again.m, again.terms[0].k))


def test_the_digest_changes_with_every_number_and_with_no_word() -> None:
    scene = Scene(**GOOD)
    changes: list[dict[str, Any]] = [
        {"m": [1.3, 0.8]}, {"q": [0.1, np.nextafter(0.2, 1)]}, {"p": [0.3, 0.5]}, {"step": -0.1},
        {"steps": 15},
        {"every": 1}, {"tolerance": 1e-9}, {"units": "md"}, {"kind": "circuit", "units": "si"},
        {"quantities": ("q", "p")},
        {"terms": ()}, {"terms": (replace(scene.terms[0], fast=True),)},  # type: ignore[type-var]
        {"terms": (replace(scene.terms[0], at=[0.4, 0.0]),)},  # type: ignore[type-var]
    ]  # fmt: skip
    digests = {replace(scene, **change).digest for change in changes}
    assert len(digests | {scene.digest}) == len(changes) + 1
    assert replace(scene, name="x", title="y", source="z", include=("own:*",)).digest == scene.digest
    assert replace(scene, q=-np.zeros(2)).digest == replace(scene, q=np.zeros(2)).digest


def read_back(scene: Scene) -> Scene:
    return scenes.parse(scene.to_toml(), name=scene.name)


@pytest.mark.parametrize("name", scenes.names())
def test_a_shipped_scene_is_written_so_that_it_is_read_back(name: str) -> None:
    scene = scenes.load_scene(name)
    again = read_back(scene)
    assert numbers(again) == numbers(scene)
    assert again.digest == scene.digest
    assert again.to_toml() == scene.to_toml()


FLOATS = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=True)
POSITIVE = st.floats(min_value=5e-324, max_value=1e308)
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


@st.composite
def made(draw: st.DrawFn) -> Scene:
    """A scene of every kind with every term, of any numbers."""
    n = draw(st.integers(1, 4))
    number = st.integers(0, n - 1)
    rows = st.lists(number, min_size=1, max_size=3)
    pairs = st.lists(st.tuples(number, number).filter(lambda x: x[0] != x[1]), min_size=1, max_size=3)

    def some(kind: Any, of: Any = rows, **signs: Any) -> Term:
        at = np.array(draw(of))
        ends = (at,) if at.ndim == 1 else at.T
        values = {
            column.field: draw(st.lists(signs.get(column.field, FLOATS), min_size=len(at), max_size=len(at)))
            for column in kind.columns
        }
        fast = {"fast": draw(st.booleans())} if kind in (WallSpring, Spring) else {}
        return kind(**dict(zip(kind.ends, ends, strict=True)), **values, **fast)  # type: ignore[no-any-return]

    terms: list[Term] = []
    for kind, signs in (
        (WallSpring, {}), (WallSpring, {}), (Quartic, {}), (Cosine, {"wave": POSITIVE}),
        (Damping, {"c": st.floats(0, 1e308)}),
    ):  # fmt: skip
        if draw(st.booleans()):
            terms.append(some(kind, **signs))
    if n > 1:
        for kind, signs in ((Spring, {}), (Morse, {"depth": POSITIVE})):
            if draw(st.booleans()):
                terms.append(some(kind, pairs, **signs))
    every = draw(st.integers(1, 5))
    step = draw(FLOATS.filter(lambda x: x != 0))
    steps = every * draw(st.integers(1, 2**40))
    assume(np.isfinite(step * steps))
    kind = draw(st.sampled_from(["particles", "circuit"]))
    return Scene(
        name="made",
        title=draw(TEXT),
        source=draw(TEXT),
        m=draw(st.lists(POSITIVE, min_size=n, max_size=n)),
        q=draw(st.lists(FLOATS, min_size=n, max_size=n)),
        p=draw(st.lists(FLOATS, min_size=n, max_size=n)),
        terms=tuple(terms),
        step=step,
        steps=steps,
        every=every,
        tolerance=draw(st.floats(1e-300, 0.999)),
        units="si" if kind == "circuit" else draw(st.sampled_from(["reduced", "md", "si"])),
        kind=kind,
        include=tuple(draw(st.lists(TEXT.filter(bool), min_size=1, max_size=3))),
        quantities=draw(st.sampled_from([("q", "p"), ("q", "p", "energy")])),
    )


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(made())
def test_any_scene_is_written_so_that_it_is_read_back(scene: Scene) -> None:
    again = read_back(scene)
    assert numbers(again) == numbers(scene)
    assert again.digest == scene.digest


def test_a_chain_is_written_by_its_positions() -> None:
    rng = np.random.default_rng(1)
    for scene in (
        chain(50, m=1.3, k=2.9, q=rng.normal(size=50), p=rng.normal(size=50)),
        chain(50, m=1.3, k=2.9, waves=[(3, 0.7), (50, 0.1), (7, 1e-9), (1, 2.0)]),
        chain(1, m=1.3, k=2.9),
        chain(2, m=1.3, k=2.9, q=[0.1, 0.2]),
        chain(3, m=[1.3, 0.7, 2.1], k=[2.3, 1.1, 3.7, 0.9]),
    ):
        assert numbers(read_back(scene)) == numbers(scene)


def test_the_builders_make_what_the_files_say() -> None:
    assert spring().digest == scenes.load_scene("spring").digest
    long = scenes.load_scene("long-chain")
    same = chain(
        1000, m=1.3, k=2.9, waves=[(2, 0.7), (37, 0.11), (400, 0.05)], step=0.03, steps=2000, every=20,
        tolerance=1e-10,
    )  # fmt: skip
    assert same.digest == long.digest


def test_springs_side_by_side_are_one_scene() -> None:
    scene = spring(m=[1.0, 2.0, 3.0], k=2.9, c=[0.0, 0.1, 0.0], at=0.5)
    assert scene.n == 3
    assert [term.key for term in scene.terms] == ["wall-spring", "damping"]
    run = driver.run(scene, LABEL)
    assert all(v.passed is not False for v in checks.judge(scene, run))
    with pytest.raises(SceneError, match="broadcast together"):
        spring(m=[1.0, 2.0], k=[1.0, 2.0, 3.0])


def test_a_scene_without_a_title_has_its_name_for_one(tmp_path: Path) -> None:
    text = "\n".join(x for x in scenes.text_of("spring-uneven").splitlines() if not x.startswith("title"))
    path = tmp_path / "odd.toml"
    path.write_text(text)
    found, shipped = scenes.load_scene(path), scenes.load_scene("spring-uneven")
    assert found.title == found.name == "odd"
    assert found.digest == shipped.digest
    assert scenes.parse(found.to_toml(), name="x").title == "odd"
    assert Scene(m=[2.7], q=[-1.3], p=[0.4], step=0.37, steps=3).title == "scene"
