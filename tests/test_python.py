"""Python has what the command has: every study a function, a function of one's own a method, nothing kept on
disk unless it is asked for, and results that show themselves."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np
import pytest

import springcheck
from springcheck import api, driver, engines
from springcheck.api.taking import labels_of
from springcheck.cli import file
from springcheck.errors import MethodError, SceneError, SpringcheckError, StoreError
from springcheck.text.wording import DIAGNOSIS


def leapfrog(q: Any, p: Any, h: Any, force: Callable[..., Any], mass: Any) -> tuple[Any, Any]:
    p = p + h / 2 * force(q)
    q = q + h * p / mass
    return q, p + h / 2 * force(q)


def heavy(q: Any, p: Any, h: Any, force: Callable[..., Any], mass: Any) -> tuple[Any, Any]:
    """Velocity Verlet that leaves the mass out."""
    return leapfrog(q, p, h, force, 1.0)


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def need(library: str) -> Any:
    if not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        return pytest.importorskip(library)
    return __import__(library)


def test_every_study_of_schemes_takes_a_function() -> None:
    def rk2(q: Any, p: Any, h: Any, force: Callable[..., Any], mass: Any) -> tuple[Any, Any]:
        middle = p + h / 2 * force(q)
        return q + h * middle / mass, p + h * force(q + h / 2 * p / mass)

    study = springcheck.stability("spring", [leapfrog, "own:velocity-verlet"])
    mine, ours = study.limits
    assert mine.method == "stepper:leapfrog"
    assert mine.limit == pytest.approx(ours.limit, rel=1e-9)
    (entry,) = springcheck.stability("spring", rk2).limits
    assert entry.method == "stepper:rk2"


def test_a_function_of_ones_own_is_a_method_for_its_call_alone() -> None:
    scene = springcheck.load_scene("spring-uneven")
    run = springcheck.simulate(scene, leapfrog)
    assert run.label == "stepper:leapfrog"
    assert run.scheme == "velocity-verlet"
    assert springcheck.judge(scene, run).passed
    assert "stepper" not in engines.names()
    with pytest.raises(MethodError, match="stepper"):
        springcheck.simulate(scene, "stepper:leapfrog")
    report = springcheck.run(scene, [heavy, "own:velocity-verlet"], scheme="velocity-verlet")
    assert [one.method for one in report.runs] == ["stepper:heavy", "own:velocity-verlet"]
    assert report.status == 1
    failed = api.Verdicts(report.verdicts).failed
    assert {verdict.method for verdict in failed} == {"stepper:heavy"}
    assert "mass" in failed[0].why
    with pytest.raises(SpringcheckError, match="goes with a function of yours"):
        springcheck.simulate(scene, "own:euler", scheme="velocity-verlet")
    unknown = springcheck.judge(scene, springcheck.simulate(scene, heavy))
    assert not unknown.failed
    assert not unknown.passed, "of no scheme nothing is judged"
    with pytest.raises(MethodError, match="cannot be called as a step"):
        springcheck.simulate(scene, lambda q, p: (q, p))


def test_a_function_of_another_thread_is_not_run_in_the_place_of_this_one() -> None:
    def euler(q: Any, p: Any, h: Any, force: Callable[..., Any], mass: Any) -> tuple[Any, Any]:
        return q + h * p / mass, p + h * force(q)

    euler.__name__ = leapfrog.__name__
    scene, entered, over = springcheck.load_scene("spring-uneven"), Event(), Event()

    def elsewhere() -> None:
        with labels_of(euler):
            entered.set()
            over.wait(60)

    alone = springcheck.simulate(scene, leapfrog)
    other = Thread(target=elsewhere)
    with labels_of(leapfrog) as (label,):
        other.start()
        entered.wait(60)
        found = driver.run(scene, label)
        over.set()
        other.join()
        again = driver.run(scene, label)
    np.testing.assert_array_equal(found.q, alone.q)
    np.testing.assert_array_equal(again.q, alone.q)


def test_run_leaves_nothing_on_disk_unless_it_is_asked_to() -> None:
    report = springcheck.run("spring", ["own:euler", "own:velocity-verlet"])
    assert list(Path().iterdir()) == []
    assert repr(report) == "Report('spring', 2 methods: " + report.counts + ")"
    alone = springcheck.simulate("spring", "own:euler")
    assert np.array_equal(report["own:euler"].q, alone.q)
    assert "Stored" not in str(report)
    assert {"phase-portrait", "energy", "error"} <= set(report.figures())
    kept = springcheck.run("spring", "own:euler", path="kept.h5")
    assert np.array_equal(kept["own:euler"].p, alone.p)
    assert [path.name for path in Path().iterdir()] == ["kept.h5"]


def shown(result: Any, name: str) -> Any:
    """The table of a result, after a look at its line and its HTML."""
    pandas = need("pandas")
    assert repr(result).startswith(f"{name}(")
    assert len(repr(result)) < 160
    assert "\n" not in repr(result)
    html = result._repr_html_()
    assert html.startswith("<pre>")
    assert str(result).count("\n") > 3
    frame = result.to_dataframe()
    assert isinstance(frame, pandas.DataFrame)
    assert len(frame) > 0
    return frame


def test_every_study_has_a_function_whose_result_shows_itself() -> None:
    two = ["own:euler", "own:velocity-verlet"]
    frame = shown(springcheck.precision("spring", two, budget=Fraction(1, 5)), "PrecisionStudy")
    assert set(frame["method"]) <= set(two)
    assert {"max_error", "run_seconds"} <= set(frame.columns)
    limits = springcheck.stability("spring", two)
    found = shown(limits, "Stability").set_index("method")["limit"]
    assert found["own:velocity-verlet"] == pytest.approx(2, rel=1e-6)
    assert limits.figures()
    assert list(Path().iterdir()) == []


def test_a_study_keeps_a_store_that_it_writes_anew_when_it_is_told_to() -> None:
    kept = springcheck.stability("spring", "own:euler", path="s.h5")
    with pytest.raises(StoreError, match=r"s.h5 exists: force=True writes it anew, path= writes another"):
        springcheck.stability("spring", "own:euler", path="s.h5")
    again = springcheck.stability("spring", "own:euler", path="s.h5", force=True, workers=np.int64(2))
    assert again.document() == kept.document()
    assert [path.name for path in Path().iterdir()] == ["s.h5"]


def test_methods_and_words_and_pages_are_functions_too() -> None:
    rows = springcheck.methods("lc-circuit")
    by = {row["method"]: row for row in rows}
    assert by["own:velocity-verlet"]["why not"] == ""
    assert "not circuits" in by["openmm:verlet"]["why not"] or "installed" in by["openmm:verlet"]["why not"]
    assert repr(rows).splitlines()[0].split()[:2] == ["method", "scheme"]
    assert rows._repr_html_().count("<tr>") == len(rows) + 1
    said = springcheck.explain("velocity-verlet")
    assert repr(said) == said
    assert said.startswith("velocity-verlet: ")
    with pytest.raises(SpringcheckError, match="did you mean velocity-verlet"):
        springcheck.explain("velocity-verlt")
    springcheck.run("spring", "own:euler", path="x.h5")
    assert springcheck.report("x.h5") == Path("x.html")
    assert Path("x.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_verdicts_have_a_summary_and_name_what_failed() -> None:
    run = springcheck.simulate("spring-uneven", "own:velocity-verlet")
    good = springcheck.judge("spring-uneven", run)
    assert good.passed
    assert repr(good) == f"Verdicts({good.summary})"
    bad = springcheck.judge(
        "spring-uneven", springcheck.simulate("spring-uneven", heavy, scheme="velocity-verlet")
    )
    assert not bad.passed
    assert bad.summary.split()[1:4:2] == ["of", "failed:"]
    assert len(repr(bad).splitlines()) == len(bad.failed) + 2
    assert bad._repr_html_().count("FAILED") == len(bad.failed)
    assert not api.Verdicts().passed
    if need("pandas"):
        assert list(bad.to_dataframe()["passed"]) == [verdict.passed for verdict in bad]


def test_a_trajectory_is_made_of_plain_arrays_and_knows_its_error() -> None:
    scene = springcheck.load_scene("spring-uneven")
    t = np.arange(scene.frames) * scene.step * scene.every
    exact = springcheck.exact(scene)
    mine = springcheck.Trajectory.from_arrays(t, exact.q[:, 0], v=exact.v[:, 0], scene=scene, scheme="exact")
    np.testing.assert_array_equal(mine.q, exact.q)
    np.testing.assert_allclose(mine.p, exact.p, rtol=4e-16)
    np.testing.assert_allclose(mine.v * scene.m, mine.p, rtol=4e-16)
    # what is left is the rounding of the exact solution to double precision
    assert mine.error().max() < 1e-14
    off = springcheck.simulate(scene, "own:euler")
    assert off.error().shape == off.t.shape
    assert off.error()[0] == 0
    report = springcheck.run(scene, "own:euler")
    assert off.error().max() == pytest.approx(report.runs[0].max_error, rel=1e-12)
    with pytest.raises(SpringcheckError, match="no scene is known"):
        springcheck.Trajectory.from_arrays(t, exact.q, exact.p).error()
    for wrong, words in (
        ({"q": exact.q[:-1], "p": exact.p}, "do not fit together"),
        ({"q": exact.q}, "momenta p or velocities v= are needed"),
        ({"q": exact.q, "v": exact.v}, "mass= or scene="),
    ):
        with pytest.raises(SpringcheckError, match=words):
            springcheck.Trajectory.from_arrays(t, **wrong)


@pytest.mark.parametrize("known", [True, False])
def test_a_right_trajectory_of_arrays_passes_whatever_the_scene_records(known: bool) -> None:
    scene = springcheck.spring(m=2.7, k=0.3, q=-1.3, p=0.4, step=0.37, steps=171, every=3)
    run = springcheck.simulate(scene, "own:velocity-verlet")
    more = {"scene": scene} if known else {"every": 3}
    mine = springcheck.Trajectory.from_arrays(run.t, run.q, run.p, scheme="velocity-verlet", **more)
    assert mine.outcome.step == 171
    assert not springcheck.judge(scene, mine).failed
    other = np.arange(1.0, len(run.t))
    moved = springcheck.Trajectory.from_arrays(np.append(0.0, other), run.q, run.p, scene=scene)
    with pytest.raises(SpringcheckError, match="not multiples of the step"):
        moved.error()


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("name", ["spring-uneven", "chain", "pendulum"])
def test_arrays_of_single_precision_are_judged_to_their_digits(name: str, known: bool) -> None:
    scene = springcheck.load_scene(name)
    run = springcheck.simulate(scene, "own:velocity-verlet")
    more = {"scene": scene} if known else {"every": scene.every, "mass": scene.m}
    t, q, v = (x.astype(np.float32) for x in (run.t, run.q, run.p / scene.m))

    def judged(t: Any = t, q: Any = q, scheme: str = "velocity-verlet") -> dict[str, bool | None]:
        made = springcheck.Trajectory.from_arrays(t, q, v=v, scheme=scheme, **more)
        assert made.arithmetic.state == 2.0**-24
        return {verdict.check: verdict.passed for verdict in springcheck.judge(scene, made)}

    found = judged()
    assert False not in found.values()
    assert {"start", "times", "grid", "step-defect"} <= {name for name, passed in found.items() if passed}
    # two roundings more are another start, and one is another time
    off = q.copy()
    off[0] = q[0] + 2 * np.spacing(np.abs(q[0]))
    assert judged(q=off)["start"] is False
    assert judged(t=np.nextafter(t, np.float32(np.inf)))["times"] is False
    assert judged(scheme="semi-implicit-euler")["step-defect"] is False


def test_wrong_arguments_are_answered_in_words() -> None:
    scene, t = springcheck.load_scene("spring"), np.arange(4.0)
    made = springcheck.Trajectory.from_arrays
    run = springcheck.simulate(scene, "own:euler")
    for call, words in (
        (lambda: made(t, t, t, every=0), "every = 0"),
        (lambda: made(t, t + 1j, t), "q: real numbers"),
        (lambda: made(t, t, v=t, mass=-1), "above 0"),
        (lambda: made(t, t, v=t, mass=[1, 2]), "one number or \\(n,\\) above 0"),
        (lambda: made(t, t, t, scene="spring"), "a Scene is needed"),
        (lambda: made(t, [t] * 4, [t] * 4, scene=scene), "do not fit together"),
        (lambda: springcheck.compare(scene, [run, run]), "one label"),
        (lambda: springcheck.compare(scene, []), "one label"),
        (lambda: springcheck.identify(run, mass="a"), "mass: real numbers"),
        (lambda: springcheck.simulate(scene, None), "a method's label or a function"),
        *(
            (lambda x=x: springcheck.load_scene(x), "the name or path of a scene is needed, not")
            for x in (5, None, b"x", [1])
        ),
        *(
            (lambda f=f, x=x: f(x), "path.* is needed")
            for x in (5, [1], "")
            for f in (springcheck.read, springcheck.report)
        ),
        *((lambda f=f: f(Path()), "it is a folder") for f in (springcheck.read, springcheck.report)),
        (lambda: made(t, np.ma.array(t, mask=t == 2), t), "q: real numbers"),
        (lambda: scene.replace(m=np.ma.array([3.0], mask=[True])), "m: real numbers"),
        (lambda: springcheck.plot.phase([run, run]), "phase: runs = .*: a Trajectory is needed"),
        (springcheck.plot.energy, "nothing to draw"),
        (lambda: springcheck.plot.phase(run, particle=1), "particle = 1: one from 0 to 0 is needed"),
        (lambda: springcheck.identify(""), "the path of a file is needed"),
        (lambda: springcheck.compare(scene, 5), "a Trajectory is needed, not int"),
        (lambda: springcheck.chain(3, waves=[1]), "pairs of a mode and an amplitude are needed"),
        (lambda: springcheck.simulate(scene, lambda q, p, h, force, mass: (q + 1j, p)), "real numbers"),
        (lambda: springcheck.stability(scene, "own:rk4", workers=0), "a number from 1 to"),
    ):
        with pytest.raises(SpringcheckError, match=words):
            call()
    assert springcheck.compare(scene, run).labels == ("exact", "own:euler")
    numbered = [springcheck.simulate("bath-spring", "own:baoab", seed=one).q for one in (3, np.int64(3))]
    np.testing.assert_array_equal(*numbered)


def test_a_wave_that_a_chain_has_not_is_no_other_wave() -> None:
    for mode in (0, 4, 1.5):
        with pytest.raises(SpringcheckError, match="modes 1 to 3"):
            springcheck.chain(masses=3, waves=[(mode, 0.4)])


def test_threads_that_capture_what_libraries_print_leave_the_streams_as_they_were() -> None:
    from concurrent.futures import ThreadPoolExecutor
    from time import sleep

    from springcheck.engines import quiet

    def capture(number: int) -> list[str]:
        with quiet.caught(1) as text:
            sleep(0.01 * (number % 3))
            sys.stdout.write(f"{number}\n")
        return text

    shown, kept = sys.stdout, os.fstat(1)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(capture, range(12)))
    assert found == [[str(number)] for number in range(12)]
    assert sys.stdout is shown
    assert (os.fstat(1).st_dev, os.fstat(1).st_ino) == (kept.st_dev, kept.st_ino)


@pytest.mark.parametrize("name", ["states.csv", "states.npz"])
def test_what_a_trajectory_saves_reads_back_to_the_last_bit_and_is_identified(name: str) -> None:
    """A table had neither masses nor energies, and coupled masses were identified as no scheme at all."""
    run = springcheck.simulate("chain", "own:velocity-verlet")
    path = run.save(name)
    if path.suffix == ".csv":
        head = path.read_text().splitlines()[0]
        assert head == "t,q0,p0,q1,p1,q2,p2,energy,m0,m1,m2"
        values = np.loadtxt(path, delimiter=",", skiprows=1)
        states = np.stack([run.q, run.p], axis=2).reshape(len(run.t), 6)
        assert np.array_equal(values[:, :8], np.column_stack([run.t, states, run.energy]))
        assert np.all(values[:, 8:] == run.scene.m)
    (found,) = springcheck.identify(path).values()
    assert (found.scheme, found.fits) == ("velocity-verlet", True)
    with pytest.raises(SpringcheckError, match=r"\.csv or \.npz"):
        run.save("states.txt")
    with pytest.raises(SpringcheckError, match="cannot be written"):
        run.save(f"nowhere/{name}")


def test_a_trajectory_draws_itself_beside_the_exact_solution() -> None:
    import matplotlib as mpl

    mpl.use("agg")
    from matplotlib.figure import Figure

    run = springcheck.simulate("spring", "own:euler")
    axes = Figure().add_subplot()
    assert run.plot(axes) is axes
    assert [line.get_label() for line in axes.lines] == ["exact", "own:euler"]
    np.testing.assert_array_equal(axes.lines[1].get_xydata(), np.column_stack([run.q, run.p]))
    assert run.plot().lines


def test_identify_reads_a_data_frame_whose_index_may_be_the_time() -> None:
    pandas = need("pandas")
    run = springcheck.simulate("spring-uneven", "own:velocity-verlet")
    mass = float(run.scene.m[0])
    assert springcheck.identify(run.to_dataframe(), mass=mass).scheme == "velocity-verlet"
    named = pandas.DataFrame({"time": run.t, "x": run.q[:, 0], "v": run.v[:, 0], "note": "?"})
    found = springcheck.identify(named, mass=mass)
    assert found.scheme == "velocity-verlet"
    with pytest.raises(StoreError, match="no column of times"):
        springcheck.identify(named.drop(columns="time"))


def test_a_scene_is_replaced_by_the_names_of_its_fields() -> None:
    scene = springcheck.load_scene("spring")
    assert scene.replace(step=0.05, steps=400).step == 0.05
    assert scene.step == 0.1
    with pytest.raises(SceneError, match="has no 'stepp', did you mean step"):
        scene.replace(stepp=0.05)
    with pytest.raises(SceneError, match="steps"):
        scene.replace(steps=-1)


def test_judge_says_what_the_states_show_as_the_command_does(tmp_path: Path) -> None:
    scene = springcheck.load_scene("spring-uneven")

    def heavy(q: Any, p: Any, h: float, force: Any, mass: Any) -> Any:
        p = p + h * force(q)
        return q + h * p / (1.25 * mass), p

    run = springcheck.simulate(scene, heavy, scheme="semi-implicit-euler")
    verdicts = springcheck.judge(scene, run)
    (why,) = (v.why for v in verdicts if DIAGNOSIS in v.why)
    run.save(tmp_path / "run.csv")
    found = file.judge(tmp_path / "run.csv", scene=scene, scheme="semi-implicit-euler")
    (said,) = (v.why for v in found.verdicts if DIAGNOSIS in v.why)
    assert verdicts.cause == why.partition(DIAGNOSIS)[2] == said.partition(DIAGNOSIS)[2]
    assert verdicts.cause
    assert verdicts.cause in repr(verdicts)
    assert springcheck.judge(scene, springcheck.simulate(scene, "own:euler")).cause == ""


def test_what_is_not_judged_says_so_and_what_the_states_show() -> None:
    """`4 verdicts passed, 0 failed` of a function whose scheme is not known was read as a pass."""

    def new_force(q: Any, p: Any, h: float, force: Any, mass: Any) -> Any:
        q = q + h * p / mass + h * h / 2 * force(q) / mass
        return q, p + h * force(q)

    scene = springcheck.load_scene("spring-uneven")
    verdicts = springcheck.judge(scene, springcheck.simulate(scene, new_force))
    assert not verdicts.passed
    assert repr(verdicts).startswith("Verdicts(not judged: stepper:new_force: nothing that applied tells")
    assert "Velocity Verlet with a friction" in verdicts.cause
    assert verdicts.cause in repr(verdicts)
    html = verdicts._repr_html_()
    assert "not judged" in html
    assert "Velocity Verlet with a friction" in html
    still = replace(scene, q=0 * scene.q, p=0 * scene.p)
    assert springcheck.judge(still, springcheck.simulate(still, "own:euler")).cause == ""


def test_judge_without_a_scheme_says_in_a_line_how_to_find_it() -> None:
    scene = springcheck.load_scene("spring")
    run = springcheck.simulate(scene, "own:velocity-verlet")
    made = springcheck.Trajectory.from_arrays(run.t, run.q, run.p)
    with pytest.raises(SpringcheckError, match=r"no scheme.*scheme=.*identify") as error:
        springcheck.judge(scene, made)
    assert "forest-ruth" not in str(error.value)
    with pytest.raises(SpringcheckError, match=r"did you mean velocity-verlet or position-verlet[?]"):
        springcheck.judge(scene, replace(made, scheme="verlet"))


@pytest.mark.parametrize(("name", "writer"), [("a.csv", "savetxt"), ("a.npz", "savez")])
def test_a_file_that_cannot_be_written_whole_leaves_what_was_there(
    name: str, writer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = springcheck.simulate("spring", "own:euler")
    before = run.save(name).read_bytes()

    def broken(file: Any, *given: Any, **named: Any) -> None:
        (file.write if hasattr(file, "write") else Path(file).write_bytes)(before[:100])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, writer, broken)
    with pytest.raises(SpringcheckError, match=f"{name}: cannot be written: No space left"):
        run.save(name)
    assert Path(name).read_bytes() == before
    assert [path.name for path in Path().iterdir()] == [name]
    with pytest.raises(SpringcheckError, match="cannot be written: embedded null"):
        run.save("\0" + name)


def test_arguments_that_no_file_and_no_figure_can_take_are_one_line() -> None:
    scene = springcheck.load_scene("spring-uneven").derived(steps=4)
    run = springcheck.simulate(scene, "own:euler")
    for name in ("a\0b", Path("a\0b")):
        with pytest.raises(SpringcheckError, match="without zero bytes"):
            springcheck.report("s.h5", output=name)
    with pytest.raises(SceneError, match="ax = 5: an Axes of matplotlib is needed"):
        springcheck.plot.phase(run, ax=5)  # type: ignore[arg-type]
    with pytest.raises(SpringcheckError, match="from 1 to 2"):
        springcheck.Trajectory.from_arrays(run.t, run.q, run.p, every=1e308)


@pytest.mark.parametrize("made", [{"q": 1.0, "p": 2.0}, {1.0, 2.0}, "12"])
def test_a_step_that_returns_no_pair_in_order_is_told_what_it_returned(made: object) -> None:
    """The keys of a dict were "no numbers", a set was taken in either order, and letters as digits."""
    with pytest.raises(MethodError, match=f"returned {type(made).__name__} of 2; a step returns"):
        springcheck.simulate("spring", lambda q, p, h, force, mass: made)
