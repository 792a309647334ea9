"""The census names what an engine runs by its states, and says when that is not what it is declared as."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import census as by_hand
import claims
import engines_table
from springcheck import driver, engines
from springcheck.cli import main
from springcheck.engines.own import thermal
from springcheck.errors import SpringcheckError, StoreError
from springcheck.identify import identify
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import Trajectory
from springcheck.studies.census import baths, rigid, table
from springcheck.studies.census import measure as census
from springcheck.studies.census.limit import _of_states, first_limit
from springcheck.studies.census.page import banks
from springcheck.studies.census.result import ENTRIES, Entry
from springcheck.studies.team import Processes
from springcheck.thermal import THERMOSTATS

OWN = ("own:euler", "own:semi-implicit-euler", "own:implicit-euler")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_each_method_is_named_by_its_states(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["census", *(x for label in OWN for x in ("--method", label)), "-o", "c.h5"]
    assert main([*arguments, "--json"]) == 0
    found = {x["method"]: x for x in json.loads(capsys.readouterr().out)["entries"]}
    assert [found[label]["found"] for label in OWN] == [
        "explicit-euler", "semi-implicit-euler", "implicit-euler"
    ]  # fmt: skip
    assert [round(found[label]["amplitude"], 3) for label in OWN] == [2.705, 1.02, 0.37]
    scene = load_scene("spring-uneven")
    a = scene.step**2 * scene.system.hessian_diagonal(scene.q)[0] / scene.m[0]
    assert found["own:euler"]["area"] == pytest.approx(float(a), rel=1e-9)
    assert found["own:semi-implicit-euler"]["velocity_offset"] == -0.5
    assert main(["inspect", "c.h5"]) == 0
    assert "own:implicit-euler" in capsys.readouterr().out
    assert main(["plot", "c.h5"]) == 0
    assert Path("figures/c/census.png").stat().st_size > 10_000
    restored = census.stored("c.h5")
    (drawn,) = banks(restored)
    assert drawn.heading.startswith("The blog's spring by 3 methods of 1 engine: ")
    assert [x.method for x in restored.entries] == list(OWN)
    assert np.array_equal(restored.entries[0].q, driver.run(load_scene("spring"), OWN[0]).q[:, 0])


def test_a_census_by_workers_is_that_of_one_but_for_the_times_which_they_do_not_measure() -> None:
    assert np.isnan(census.entry(engines.parse(OWN[0])).seconds)
    two, one = (census.record(f"{n}.h5", OWN, team=Processes(n)) for n in (2, 1))
    for many, alone in zip(two.entries, one.entries, strict=True):
        assert min(many.seconds, alone.seconds) > 0
        assert np.array_equal(many.q, alone.q)
        # an engine names the compiler once it has needed it
        same = [{**vars_of(x), "version": "", "seconds": 0, "q": None, "p": None} for x in (many, alone)]
        assert repr(same[0]) == repr(same[1])
    assert [x.seconds for x in census.stored("2.h5").entries] == [x.seconds for x in two.entries]


def vars_of(entry: Entry) -> dict[str, object]:
    return {field.name: getattr(entry, field.name) for field in fields(entry)}


def test_an_engine_that_is_not_what_it_is_declared_as_is_found_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (Path(__file__).parent / "plugin-example" / "springcheck_pefrl.py").read_text()
    (tmp_path / "wrong.py").write_text(text.replace('scheme="pefrl"', 'scheme="velocity-verlet"'))
    assert main(["census", "--method", "pefrl:*", "--engine", "wrong.py"]) == 1
    assert "pefrl:pefrl is declared as velocity Verlet" in " ".join(capsys.readouterr().out.split())


BROKEN = """
from springcheck.engines import Engine, Method, Need, Stopped, named

RIGID = {"terms": frozenset({"wall-spring", "rod"}), "requires": frozenset({Need.RODS})}

class Run:
    force_calls = 0
    def __init__(self, scene, method, label, step, seed=None):
        self.stops = method.name.startswith("stops")
    def advance(self, every, q, p):
        if self.stops:
            raise Stopped(0, "out of order")
        q[:] = p[:] = float("inf")

ENGINE = Engine(
    name="broken", title="Broken", start=Run, version=lambda: {},
    any_axis=True,
    methods=named(
        Method(name="stops-rods", scheme="velocity-verlet", about="", **RIGID),
        *(Method(name=x, scheme="velocity-verlet", about="") for x in ("stops", "escapes")),
    ),
    thermostats=named(
        *(Method(name=f"{x}-bath", scheme="baoab", about="", generator="none") for x in ("stops", "escapes"))
    ),
)
"""


def test_an_engine_whose_first_step_fails_has_no_numbers_of_a_motion(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "broken.py").write_text(BROKEN)
    arguments = ["--thermostats", "--engine", "broken.py", "--method", "broken:*"]
    assert main(["census", *arguments, "--json"]) == 1
    rows = {x["method"].partition(":")[2]: x for x in json.loads(capsys.readouterr().out)["entries"]}
    assert set(rows) == {"stops-rods", "stops", "escapes", "stops-bath", "escapes-bath"}
    assert rows["stops-rods"]["constraint"] == "rod: takes no step, length to rounding"
    assert {x[key] for x in rows.values() for key in ("amplitude", "area", "trace", "kinetic")} == {None}
    assert rows["stops-rods"]["along"] == rows["stops"]["along"] == "none"
    limits = [(rows[x]["limit"], rows[x]["bounded"]) for x in ("stops", "escapes")]
    assert limits == [(None, False), (0.0, False)]
    assert "1000 springs: stopped after step 0" in rows["stops-bath"]["note"]


def test_what_was_measured_by_hand_is_compared() -> None:
    """A census that names another scheme, amplitude, partner or growth than a loop by hand is told."""
    one = census.entry(engines.parse("own:euler"))
    right = replace(one, method="pymunk:force")
    assert by_hand.differences(census.Census(entries=(one, right), left_out=())) == []
    grown = replace(one, method="mujoco:motor-frame-skip-5", found="force-held-5", area=3.1e-3)
    for wrong, said in (
        (replace(right, found="semi-implicit-euler"), "is semi-implicit-euler, and was explicit-euler"),
        (replace(right, amplitude=2.706), "has the amplitude 2.7060"),
        (replace(right, digest="0"), "is not own:euler bit for bit"),
        (grown, "grows the motion 1.857 times"),
    ):
        (found,) = by_hand.differences(census.Census(entries=(one, wrong), left_out=()))
        assert said in found


def held(n: float) -> Trajectory:
    """States of a force held over n substeps."""
    scene = load_scene("spring-uneven")
    made = driver.run(scene, "own:euler")
    m, k, h = float(scene.m[0]), float(scene.system.hessian_diagonal(scene.q)[0]), scene.step
    g = (1 + 1 / n) / 2
    step = np.array([[1 - g * h * h * k / m, h / m], [-h * k, 1]])
    z = [np.array([scene.q[0], scene.p[0]])]
    for _ in range(200):
        z.append(step @ z[-1])
    q, p = np.array(z).T
    return replace(made, q=q[:, None], p=p[:, None], energy=None)


@pytest.mark.parametrize(
    ("n", "name"), [(2, "force-held-2"), (7, "force-held-7"), (np.inf, "force-held-rk4")]
)
def test_a_held_force_is_told_from_its_map(n: float, name: str) -> None:
    scene, run = load_scene("spring-uneven"), held(n)
    assert census._name(scene, census._identified(scene, run)) == name


@pytest.mark.parametrize("n", [1.5, 2.5])
def test_a_held_force_over_no_whole_number_of_substeps_is_none(n: float) -> None:
    scene, run = load_scene("spring-uneven"), held(n)
    assert census._name(scene, census._identified(scene, run)) == "none that is known"


def test_states_of_another_scheme_are_no_held_force() -> None:
    scene = load_scene("spring-uneven")
    for label in ("own:implicit-euler", "own:semi-implicit-euler"):
        assert census._held(scene, census._identified(scene, driver.run(scene, label))) == ""


def written(monkeypatch: pytest.MonkeyPatch, *files: str) -> None:
    """The page and the CSV of these documents."""
    monkeypatch.setattr("sys.argv", ["engines_table.py", "t", *files])
    assert engines_table.main() == 0


def test_the_table_is_a_page_csv_and_what_changed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    first = ["census", *(x for label in OWN[:2] for x in ("--method", label)), "-o", "a.h5", "--json"]
    assert main(first) == 0
    old = capsys.readouterr().out
    Path("old.json").write_text(old)
    # another version, another scheme, and a method that is gone
    changed = json.loads(old)
    changed["entries"][0].update(version="springcheck 0.0.9", found="implicit-euler")
    changed["entries"].append({**changed["entries"][1], "method": "gone:one", "note": "<b>&"})
    Path("other.json").write_text(json.dumps(changed))
    again = ["census", "--method", OWN[0], "--method", OWN[1], "-o", "b.h5"]
    assert main([*again, "--against", "old.json", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["changes"] == []
    assert main([*again, "--force", "--against", "other.json"]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert (
        "own:euler, scheme, from the states: implicit Euler -> explicit Euler (springcheck 0.0.9 -> " in said
    )
    assert "gone:one is no longer here" in said
    assert "Changes (springcheck 0.0.9 -> springcheck " in said
    written(monkeypatch, "old.json")
    page = Path("t.html").read_text()
    assert len(page.encode()) < 500_000
    assert "springcheck census --method own:euler" in page
    with open("t.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    written(monkeypatch, "old.json", "other.json")
    page = Path("t.html").read_text()
    assert "gone:one" in page
    assert "&lt;b&gt;&amp;" in page
    assert page.count("<tr>") == 4
    assert [row["scheme"] for row in rows] == ["explicit Euler", "semi-implicit Euler, kick-drift"]
    assert [row["limit"] for row in rows] == ["0.0000", "2.0000"]
    assert all(row["version"].startswith("springcheck ") for row in rows)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--against", "notes.txt"], "is no JSON document of springcheck census"),
        (["--against", "nosuch.json"], "No such file"),
        (["--against", ""], ""),
    ],
)
def test_bad_input_to_the_tables_options_is_said_before_anything_runs(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("notes.txt").write_text("mine")
    assert main(["census", "--method", "own:euler", "-o", "c.h5", *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not Path("c.h5").exists()
    assert Path("notes.txt").read_text() == "mine"


def test_a_table_without_a_row_replaces_none(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("t.csv").write_text(f"{engines_table.HEAD}\nmine\n")
    monkeypatch.setattr("sys.argv", ["engines_table.py", "t"])
    with pytest.raises(SpringcheckError, match="no rows"):
        engines_table.main()
    assert "mine" in Path("t.csv").read_text()


@pytest.mark.parametrize(
    ("name", "said"),
    [("notes.txt", "it is there and no such table"), (".", "it is a folder"), ("no/t", "there is no folder")],
)
def test_a_table_takes_the_place_of_no_other_file(name: str, said: str) -> None:
    Path("notes.txt").write_text("mine")
    with pytest.raises(StoreError, match=said):
        engines_table.free(name, engines_table.HEAD)


@pytest.mark.parametrize(
    ("label", "limit"),
    [
        ("own:euler", 0.0),
        ("own:semi-implicit-euler", 2.0),
        ("own:rk4", 2 * 2**0.5),
        ("own:implicit-euler", np.inf),
        ("own:yoshida4", 1.573409),
    ],
)
def test_the_first_limit_is_read_from_states(label: str, limit: float) -> None:
    scene = load_scene("spring-uneven")
    assert first_limit(scene, engines.parse(label)) == pytest.approx(limit, abs=2e-5)


def test_a_spring_that_passes_its_rest_length_beyond_its_limit_has_one() -> None:
    pytest.importorskip("pymunk")
    found = first_limit(load_scene("spring-uneven"), engines.parse("pymunk:damped-spring"))
    assert found == pytest.approx(2.0, abs=2e-5)


def test_a_map_whose_eigenvectors_coincide_at_its_limit_has_one() -> None:
    """Kick, then drift, at h omega = 2 in numbers that are exact."""
    z = [np.array([0.5, 0.25])]
    for _ in range(8):
        p = z[-1][1] - 4 * z[-1][0]
        z.append(np.array([z[-1][0] + p, p]))
    size, error = _of_states(np.array(z).T)
    assert abs(size) < error < 1e-5


def test_the_kept_table_has_a_hundred_rows_with_versions_and_none_is_declared_otherwise() -> None:
    folder = Path(by_hand.__file__).parent / "engines"
    document = table.load(folder / "engines.json")
    rows = engines_table.rows(document)
    assert len(rows) >= 100
    assert len({engines_table.engine(row) for row in rows}) >= 20
    assert not any("DECLARED" in row["note"] for row in rows)
    lock = (folder / "engines.lock").read_text().splitlines()
    assert all(part.strip() in lock for row in rows for part in row["version"].split(","))
    assert all(re.search(r"\d", row["version"]) and row["command"] for row in rows)
    # a scheme has one first limit whoever runs it, as far as it is bracketed
    limits: dict[str, set[str]] = {}
    for row in rows:
        if row["scheme"] != "none that is known" and " or " not in row["scheme"]:
            coarse = row["precision"] not in ("double", "fixed-point force", "mixed")
            limits.setdefault(f"{row['scheme']} {row['substeps']} {coarse:d}", set()).add(row["limit"])
    for scheme, found in limits.items():
        numbers = {float(x) for x in found if x not in ("-", "none up to 4")}
        # a growth is seen later in single precision: as its square root where eigenvalues meet
        most = 2e-3 if scheme.endswith("1") else 2e-4
        assert max(numbers, default=0) - min(numbers, default=0) < most, (scheme, found)
    with (folder / "engines.csv").open(newline="") as file:
        assert list(csv.DictReader(file)) == rows


def test_a_program_s_row_is_held_against_the_scheme_that_its_documentation_claims() -> None:
    document = table.load(Path(by_hand.__file__).parent / "engines" / "engines.json")
    rows = {row["method"].removeprefix("command:"): row for row in document["entries"]}
    assert {*claims.NAMED, *claims.MAPS} <= set(rows)
    assert all(row["claimed"] != "unknown" for row in document["entries"])
    row = dict(rows["petsc-beuler"])
    by_hand.claimed(row)
    assert row["agrees"]
    row["found"] = "explicit-euler"
    by_hand.claimed(row)
    assert not row["agrees"]
    for name in claims.MAPS:
        row = dict(rows[name])
        by_hand.claimed(row)
        assert row["agrees"], name
        row["trace"] += 1e-9
        by_hand.claimed(row)
        assert not row["agrees"], name


def test_kept_states_of_engines_that_are_not_here_are_named_as_in_the_table() -> None:
    document = table.load(Path(by_hand.__file__).parent / "engines" / "engines.json")
    rows = {row["method"]: row["found"] for row in document["entries"]}
    scene = load_scene("spring-uneven")
    with np.load(by_hand.STATES) as kept:
        assert len(kept) >= 8
        for name, (q, p) in kept.items():
            t = scene.step * np.arange(len(q))
            m, k = float(scene.m[0]), float(scene.system.hessian_diagonal(scene.q)[0])
            found = identify(t, q[:, None], p[:, None], mass=m, stiffness=k)
            # ten decimals, which are no arithmetic of a step
            few = name == "cp2k:nve" and found.statement.startswith("The map is Velocity Verlet's")
            assert few or found.scheme == rows[name], (name, found.statement)


def test_a_program_of_an_engine_is_short() -> None:
    folder = Path(by_hand.__file__).parent / "engines"
    programs = [path for kind in ("cpp", "hpp", "cjs", "py") for path in folder.glob(f"*.{kind}")]
    assert {path.name: n for path in programs if (n := len(path.read_text().splitlines())) > 100} == {}
    assert len(programs) > 12


def test_the_temperatures_of_a_row_are_shown_with_their_errors() -> None:
    (row,) = engines_table.rows(
        census.Census(entries=(census.entry(engines.parse(OWN[0])),), left_out=()).document()
    )
    assert (row["thermostat"], row["constraint"], row["kinetic"]) == ("none", "none", "-")
    document = census.Census(entries=(), left_out=()).document()
    document["entries"] = [{
        **vars_of(replace(census.entry(engines.parse(OWN[0])), thermostat="Andersen", configurational=1.1088,
                          configurational_error=4e-4)), "partners": [],
    }]  # fmt: skip
    (row,) = engines_table.rows(document)
    assert (row["thermostat"], row["configurational"]) == ("Andersen", "1.1088 +- 0.0004")


RIGID = {
    "own:velocity-verlet": "asin(h w)",
    "own:position-verlet": "2 asin(h w/2)",
    "ase:rattle": "asin(h w)",
}


def test_what_holds_rods_says_by_its_states_how_it_turns_them() -> None:
    for label, turn in (("own:velocity-verlet", "asin(h w)"), ("own:position-verlet", "2 asin(h w/2)")):
        said = rigid.constraint(engines.parse(label))
        assert said == f"rod: turns by {turn} a step to rounding, length to rounding"
    assert rigid.constraint(engines.parse("own:euler")) == ""


def test_the_axes_of_a_method_are_said_by_its_states(
    need: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert rigid.axes(engines.parse("own:rk4")) == "x, y and z alike; periodic box"
    assert rigid.axes(engines.parse("scipy:radau")) == "x, y and z alike"
    need("ase:rattle")
    assert rigid.axes(engines.parse("ase:rattle")) == "x, y and z"
    need("pymunk:force")
    assert rigid.axes(engines.parse("pymunk:force")) == "x"
    right = driver.run

    def broken(scene: Any, label: Any) -> Any:
        run = right(scene, label)
        p = run.p.copy()
        p[:, 2] *= 1.001 ** np.arange(len(p))
        return replace(run, p=p)

    monkeypatch.setattr(driver, "run", broken)
    assert rigid.axes(engines.parse("own:rk4")) == "x, y and z unlike; periodic box"


def test_a_method_for_rods_is_named_with_its_mass_in_two_parts(need: Callable[[str], None]) -> None:
    need("openmm:verlet-rods-as-it-is")
    one = census.entry(engines.parse("openmm:verlet-rods-as-it-is"))
    # one whose solver ends at 1e-5
    said = "rod: turns by asin(h w) a step to 1e-07, length to 1e-07"
    assert (one.found, one.constraint, one.agrees) == ("velocity-verlet", said, True)
    assert one.limit == pytest.approx(2, abs=1e-4)


def test_states_of_no_known_turn_and_of_no_scheme_are_said_to_be_such() -> None:
    dumbbell, uneven = load_scene("dumbbell"), load_scene("spring-uneven")
    run = driver.run(dumbbell, "own:velocity-verlet")
    assert dumbbell.system.rods is not None
    slow = replace(run, q=run.q[::3])
    assert rigid._turn(slow, dumbbell.system.rods, dumbbell) == "turns by 3.0114 h w a step"
    grown = driver.run(uneven, "own:velocity-verlet")
    assert rigid.name(uneven, grown) == "velocity-verlet"
    growth = 1.001 ** np.arange(len(grown.q))[:, None]
    assert rigid.name(uneven, replace(grown, q=grown.q * growth, p=grown.p * growth)) == rigid.NO_SCHEME


def test_a_thermostat_is_a_row_whose_temperatures_are_measured(capsys: pytest.CaptureFixture[str]) -> None:
    found = [
        "census",
        "--thermostats",
        "--method",
        "own:baoa",
        "--method",
        "own:baoab",
        "--method",
        OWN[0],
        "-o",
        "c.h5",
    ]
    assert main([*found, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    entries = {x["method"]: x for x in document["entries"]}
    assert set(entries) == {"own:baoab", "own:baoa", OWN[0]}
    one = entries["own:baoa"]
    assert one["found"] == "baoa"
    assert one["velocity_offset"] == -0.5
    # BAOAB's own velocities are too cold by a/4, those of BAOA are right, positions of both
    for x, kinetic in ((entries["own:baoab"], 1 - 0.25 / 4), (one, 1.0)):
        assert abs(x["kinetic"] - kinetic) < 5 * x["kinetic_error"] < 0.02
        assert abs(x["configurational"] - 1) < 5 * x["configurational_error"] < 0.02
    rows = {row["method"]: row for row in engines_table.rows(document)}
    assert rows["own:baoa"]["thermostat"].startswith("BAOA")
    assert rows["own:baoa"]["amplitude"] == "-"
    assert rows[OWN[0]]["thermostat"] == "none"
    assert main(["inspect", "c.h5"]) == 0
    assert "Temperatures over that of the bath" in capsys.readouterr().out


def test_a_thermostat_under_a_wrong_name_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    assert baths.entry(engines.parse("own:aboba")).agrees
    monkeypatch.setattr(thermal, "THERMOSTATS", {**THERMOSTATS, "aboba": THERMOSTATS["baoa"]})
    found = baths.entry(engines.parse("own:aboba"))
    assert (found.claimed, found.found, found.agrees) == ("aboba", "baoa", False)


@pytest.mark.parametrize("label", ["openmm:langevin-middle-rods", "lammps:rattle-langevin"])
def test_a_thermostat_of_rods_is_read_by_the_centres_of_dumbbells(
    label: str, need: Callable[[str], None]
) -> None:
    need(label)
    row = baths.entry(engines.parse(label))
    assert row.agrees
    # BBK differs by how its draws are distributed, which the sum of two does not show
    assert row.claimed in row.found.split(" or ")
    assert (row.along, row.constraint) == ("x, y and z", "rod: length to rounding")
    # a = (h w)**2 = 1/4, gamma h = 0.4
    law = 0.8 / (0.8 - 0.25 / 4) if row.claimed == "lammps-langevin" else 1.0
    assert abs(row.configurational - law) < 5 * row.configurational_error < 0.02


def test_new_rows_of_the_table_stand_where_the_whole_table_has_them() -> None:
    old = [{"method": name, "found": "old"} for name in "bdz"]
    new = [{"method": name, "found": "new"} for name in "eba"]
    kept = by_hand.beside(old, new, list("abcdef"))
    assert [one["method"] for one in kept] == list("abdez")
    assert [one["found"] for one in kept] == ["new", "new", "old", "new", "old"]


@pytest.mark.parametrize("label", ["mujoco:hinge", "dart:hinge"])
def test_a_hinge_is_named_on_springs_of_rotors(label: str, need: Callable[[str], None]) -> None:
    need(label)
    one = census.entry(engines.parse(label))
    assert (one.found, one.constraint) == ("semi-implicit-euler", "hinge: turns by h w a step to rounding")
    assert one.agrees


def test_a_row_of_before_a_column_was_measured_has_its_default() -> None:
    one = census.entry(engines.parse(OWN[0]))
    kept = ENTRIES.table(one.method, one)
    before = replace(
        kept, attributes={k: v for k, v in kept.attributes.items() if k not in ("along", "constraint")}
    )
    read = ENTRIES.found(before)
    assert (one.along, read.along, read.constraint) == ("x, y and z alike; periodic box", "x", "")
    assert (read.digest, read.limit) == (one.digest, one.limit)
    with pytest.raises(KeyError):
        ENTRIES.found(replace(kept, attributes={k: v for k, v in kept.attributes.items() if k != "digest"}))
