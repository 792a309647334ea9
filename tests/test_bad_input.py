"""A user's mistake gets one clear line and exit status 2; nothing is lost or overwritten."""

from __future__ import annotations

import errno
import itertools
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import pytest

import springcheck
from springcheck import store
from springcheck.cli import main
from springcheck.physics.scenefile import folder
from springcheck.studies.precision import measure as precision

pytestmark = pytest.mark.usefixtures("own_folder", "tried_here", "sketched")

SPRING = (folder() / "spring.toml").read_text()


def refused(capsys: pytest.CaptureFixture[str], arguments: list[str], *words: str) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert "Traceback" not in captured.err
    for word in words:
        assert word in captured.err


SCENES = {
    "an unknown key": (("mass = 1.0", "mass = 1.0\ncolour = 3"), ("particle[0]", "colour", "mass, position")),
    "a misspelt table": (("[time]", "[tiem]"), ("tiem",)),
    "a wrong type": (("mass = 1.0", 'mass = "heavy"'), ("particle[0].mass", "heavy", "a number is needed")),
    "nan": (("mass = 1.0", "mass = nan"), ("particle[0].mass", "nan", "finite")),
    "infinity": (("momentum = 1.0", "momentum = inf"), ("particle[0].momentum", "inf", "finite")),
    "a mass of zero": (("mass = 1.0", "mass = 0.0"), ("particle[0].mass", "0.0", "> 0")),
    "a negative mass": (("mass = 1.0", "mass = -2.0"), ("particle[0].mass", "-2.0", "> 0")),
    "an end that does not exist": (('["wall", 0]', '["wall", 7]'), ("spring[0].ends", "7", "particles")),
    "an end that is no end": (('["wall", 0]', '["floor", 0]'), ("spring[0].ends[0]", "floor")),
    "two walls": (('["wall", 0]', '["wall", "wall"]'), ("spring[0].ends", "two walls")),
    "one end twice": (('["wall", 0]', "[0, 0]"), ("spring[0].ends", "same particle")),
    "no steps": (("steps = 200", "steps = 0"), ("time.steps", "0", ">= 1")),
    "half a step": (("steps = 200", "steps = 2.5"), ("time.steps", "2.5", "a whole number")),
    "a step of zero": (("step = 0.1", "step = 0.0"), ("time.step", "0")),
    "no time at all": (("[time]\nstep = 0.1\nsteps = 200\ntolerance = 1e-12", ""), ("time",)),
    "a tolerance of zero": (("tolerance = 1e-12", "tolerance = 0.0"), ("time.tolerance", "0.0")),
    "1e12 frames": (("steps = 200", "steps = 1_000_000_000_000"), ("GB", "free")),
    "a record that misses the end": (("tolerance = 1e-12", "[record]\nevery = 7"), ("every", "7", "200")),
    "an unknown unit": (('units = "reduced"', 'units = "parsec"'), ("units", "parsec", "reduced, md, si")),
    "a unit that is no word": (('units = "reduced"', "units = 3"), ("units = 3", "reduced, md, si")),
    "an unknown quantity": (
        ("steps = 200", 'steps = 200\n[record]\nquantities = ["q", "v"]'),
        ("record.quantities[1]", "'v'", "q, p, energy"),
    ),
    "quantities that are no list": (
        ("steps = 200", 'steps = 200\n[record]\nquantities = "q"'),
        ("record.quantities", "a list in brackets"),
    ),
    "more steps than numbers": (
        ("steps = 200\ntolerance = 1e-12", f"steps = {10**23}\n[record]\nevery = {10**23}"),
        ("time.steps", "2**53"),
    ),
    "broken TOML": (("[time]", "[time"), ("TOML", "line")),
    "a huge integer": (("steps = 200", "steps = " + "9" * 400), ("time.steps", "finite")),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_mistake_in_a_scene_is_named_with_its_file_and_field(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (old, new), words = SCENES[name]
    assert old in SPRING
    Path("bad.toml").write_text(SPRING.replace(old, new))
    refused(capsys, ["run", "bad.toml", "--method", "own:euler"], *words)
    assert {path.name for path in Path().iterdir()} == {"bad.toml"}


@pytest.mark.parametrize(
    ("method", "words"),
    [
        ("own:eular", ("own:eular", "own:euler")),
        ("opemm:verlet", ("opemm", "openmm")),
        ("verlet", ("engine:method",)),
        ("openmm:verlet@GPU", ("GPU", "Reference", "CUDA-double")),
        ("own:euler@CPU", ("CPU", "has no platforms")),
        ("openmm:verlet@CUDA", ("CUDA",)),
        ("no*:such", ("no*:such", "springcheck list")),
        ("", ("engine:method",)),
    ],
)
def test_a_method_that_is_not_there_is_named_with_those_that_are(
    method: str, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, ["run", "spring", "--method", method], *words)
    assert not list(Path().glob("*.h5"))


def test_a_method_that_a_scene_names_wrongly_is_looked_for_in_the_scene(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("mine.toml").write_text(SPRING + '\n[methods]\ninclude = ["own:eular"]\n')
    refused(capsys, ["run", "mine.toml"], "methods.include", "mine", "own:eular", "own:euler")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with names")
def test_force_puts_no_store_in_the_place_of_a_device_or_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo("pipe.h5")
    refused(capsys, ["run", "spring", "--method", "own:euler", "--force", "-o", "pipe.h5"], "pipe.h5")
    assert Path("pipe.h5").is_fifo()
    assert [path.name for path in Path().iterdir()] == ["pipe.h5"]


def test_a_scene_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["run", "sprong"], "sprong", "spring-uneven")
    refused(capsys, ["run", "missing.toml"], "missing.toml", "No such file")
    refused(capsys, ["run", "."], ".")


def test_an_existing_store_is_kept_unless_forced(capsys: pytest.CaptureFixture[str]) -> None:
    Path("spring.h5").write_text("not to be lost")
    for force in ([], ["--force"]):
        refused(capsys, ["run", "spring", "--method", "own:euler", *force], "spring.h5", "no store")
    assert Path("spring.h5").read_text() == "not to be lost"
    Path("spring.h5").unlink()
    assert main(["run", "spring", "--method", "own:euler", "--quiet"]) == 0
    assert main(["run", "spring", "--method", "own:euler", "--force", "--quiet"]) == 0
    assert main(["check", "spring.h5"]) == 0


def test_a_forced_run_that_fails_leaves_the_old_store(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from springcheck.engines.own import simulation
    from springcheck.errors import MethodError

    assert main(["run", "spring", "--method", "own:euler", "--quiet"]) == 0
    before = Path("spring.h5").read_bytes()

    def broken(*_: object) -> None:
        raise MethodError("the engine would not start")

    monkeypatch.setattr(simulation, "start", broken)
    refused(capsys, ["run", "spring", "--method", "own:euler", "--force"], "would not start")
    assert Path("spring.h5").read_bytes() == before


def test_a_folder_that_is_not_there(capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, ["run", "spring", "--method", "own:euler", "-o", "no/where.h5"], "no folder")
    Path("file").write_text("")
    refused(capsys, ["run", "spring", "--method", "own:euler", "-o", "file/x.h5"], "file")
    main(["run", "spring", "--method", "own:euler", "--quiet"])
    refused(capsys, ["export", "spring.h5", "own:euler", "no/where.h5md"], "no folder")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    Path("locked").mkdir(mode=0o500)
    refused(capsys, ["run", "spring", "--method", "own:euler", "-o", "locked/x.h5"], "locked")


@pytest.mark.parametrize("command", ["inspect", "plot"])
def test_a_file_that_is_no_store(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    refused(capsys, [command, "missing.h5"], "missing.h5")
    refused(capsys, ["check", "missing.h5"], "missing.h5")
    Path("text.h5").write_text("this is no HDF5 file")
    refused(capsys, [command, "text.h5"], "text.h5")
    Path("empty.h5").write_bytes(b"")
    refused(capsys, [command, "empty.h5"], "empty.h5")


def test_a_truncated_store(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "spring", "--method", "own:euler", "--quiet"])
    whole = Path("spring.h5").read_bytes()
    for part in (len(whole) * 9 // 10, len(whole) // 2, 600, 9):
        Path("cut.h5").write_bytes(whole[:part])
        refused(capsys, ["inspect", "cut.h5"], "cut.h5")
        refused(capsys, ["plot", "cut.h5"], "cut.h5")


def test_a_trajectory_that_is_not_in_the_store(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "spring", "--method", "own:euler", "--quiet"])
    refused(capsys, ["inspect", "spring.h5", "--trajectory", "own:verlet"], "own:verlet", "own:euler")
    refused(capsys, ["export", "spring.h5", "own:verlet", "x.h5md"], "own:verlet")
    refused(capsys, ["export", "spring.h5", "own:euler", "x.xyz"], ".h5md")
    refused(capsys, ["inspect", "spring.h5", "--trajectory", "own:euler", "--rows", "0"], "--rows")


def test_an_exported_trajectory_is_a_store_to_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "spring", "--method", "own:euler", "--quiet"]) == 0
    assert main(["export", "spring.h5", "own:euler", "out.h5md"]) == 0
    capsys.readouterr()
    for command in ("inspect", "plot", "report", "check", "identify"):
        assert main([command, "out.h5md"]) == 0, command
    assert Path("figures/out/phase-portrait.png").is_file()
    assert main(["judge", "out.h5md", "--scene", "spring", "--scheme", "explicit-euler"]) == 0
    assert main(["run", "--from", "out.h5md"]) == 0
    capsys.readouterr()
    refused(capsys, ["export", "out.h5md", "own:euler", "again.h5md"], "exported trajectory already", "copy")


def test_a_file_where_the_journal_goes_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.h5.parts").write_text("mine")
    refused(
        capsys, ["run", "spring", "-o", "mine.h5"], "cannot write mine.h5", "mine.h5.parts", "move it away"
    )
    assert Path("mine.h5.parts").read_text() == "mine"


def test_figures_are_not_drawn_into_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.toml").write_text(SPRING)
    assert main(["run", "mine.toml", "--method", "own:euler", "--quiet"]) == 0
    refused(capsys, ["plot", "mine.h5", "-o", "mine.toml"], "mine.toml is a file", "-o")
    assert Path("mine.toml").read_text() == SPRING


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no folder in which nothing can be made")
@pytest.mark.parametrize(
    "command", [["run", "spring", "-o", "/proc/a.h5"], ["report", "mine.h5", "-o", "/proc/a.html"]]
)
def test_a_folder_in_which_nothing_can_be_made_is_said_to_be_that(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    if command[0] == "report":
        assert main(["run", "spring", "--method", "own:euler", "--quiet", "-o", "mine.h5"]) == 0
    refused(capsys, command, "no file can be made there" if os.geteuid() == 0 else "/proc")


@pytest.mark.parametrize("blocks", [1, 3, 40])
def test_a_full_disk_is_told_by_the_name_of_the_store(blocks: int) -> None:
    resource = pytest.importorskip("resource")
    # without -B Python keeps half of a module's bytecode under this limit, and later commands die of it
    done = subprocess.run(
        [
            sys.executable,
            "-B",
            "-m",
            "springcheck",
            "run",
            "spring",
            "--method",
            "own:*euler",
            "-o",
            "here.h5",
        ],
        env=os.environ | {"PYTHONPATH": str(Path(springcheck.__file__).parents[1])},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1024 * blocks, 1024 * blocks)),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert (
        done.stderr == "springcheck: cannot write here.h5: the file would be larger than this system allows\n"
    )
    assert not Path("here.h5").exists()


def test_of_a_scene_for_which_there_is_no_room_nothing_is_left() -> None:
    resource = pytest.importorskip("resource")
    done = subprocess.run(
        [sys.executable, "-B", "-m", "springcheck", "show", "spring", "-o", "my.toml"],
        env=os.environ | {"PYTHONPATH": str(Path(springcheck.__file__).parents[1])},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100)),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert done.returncode == 2
    assert "cannot write my.toml: the file would be larger than this system allows" in done.stderr
    assert not Path("my.toml").exists()


@pytest.mark.parametrize("study", ["stability", "precision"])
def test_forces_beyond_all_numbers_are_refused(study: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = (folder() / "morse-bond.toml").read_text()
    lines = ["rest = 1e6" if line.startswith("rest") else line for line in text.splitlines()]
    Path("far.toml").write_text("\n".join(lines))
    refused(capsys, [study, "far.toml", "--method", "own:euler"], "beyond the range of numbers")


def limited(*words: str, memory: int = 0, **environment: str) -> subprocess.CompletedProcess[str]:
    """The program with less address space [B], or in another environment."""
    begin = f"import resource as r; r.setrlimit(r.RLIMIT_AS, ({memory},) * 2); " if memory else ""
    code = f"{begin}from springcheck.__main__ import main; raise SystemExit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *words],
        env={**os.environ, **environment}, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("size", [300, 400])
def test_too_little_address_space_is_said_in_words(size: int) -> None:
    done = limited("run", "spring", "--method", "own:euler", memory=size << 20)
    said = f"springcheck: {size} MiB of address space (ulimit -v): at least 512 MiB are needed\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)


def test_a_backend_that_matplotlib_does_not_know_is_named_where_it_draws_and_nowhere_else() -> None:
    Path("x.csv").write_text("t,q,v\n" + "".join(f"{i},{0.3**i},{-(0.2**i)}\n" for i in range(9)))
    done = limited("plot", "x.csv", "-o", "drawn", MPLBACKEND="nonsense")
    said = "springcheck: MPLBACKEND='nonsense' names no backend of matplotlib: unset it, or set it to agg\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", said)
    assert not Path("drawn").exists()
    assert "nonsense" not in limited("identify", "x.csv", MPLBACKEND="nonsense").stderr
    # a window of others is not opened
    assert limited("plot", "x.csv", "-o", "drawn", MPLBACKEND="tkagg", DISPLAY="none").returncode == 0


def test_a_user_whose_name_is_no_text_has_stores_and_figures_without_a_window() -> None:
    odd = {"USER": os.fsdecode(b"J\xf6rg")}
    assert limited("run", "spring", "--method", "own:euler", "--quiet", "-o", "s.h5", **odd).stderr == ""
    done = limited("plot", "s.h5", "--quiet", **odd)
    assert (done.returncode, done.stderr) == (0, "")
    assert main(["check", "s.h5"]) == 0


def test_who_wants_no_colours_gets_none_whatever_else_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["run", "spring", "--method", "own:euler", "--force", "-o", "s.h5"]
    for name, coloured in (("FORCE_COLOR", True), ("NO_COLOR", False)):
        monkeypatch.setenv(name, "1")
        assert main(words) == 0
        assert ("\x1b[" in capsys.readouterr().out) == coloured


@pytest.mark.parametrize("name", ["run-own%3Aeuler.h5", "table-x.h5", "lock", "command", "undo", ""])
def test_a_pipe_in_a_journal_keeps_no_command_waiting(name: str) -> None:
    with store.open_new("s.h5", "another command") as journal:
        journal.add(store.Table(name="x", columns={"a": [1.0]}))
    place = Path("s.h5.parts", name)
    if not name:
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    os.mkfifo(place)
    run = ["run", "spring", "--method", "own:euler", "--quiet", "-o", "s.h5"]
    for words in (["inspect", "s.h5"], ["check", "s.h5"], run):
        with alarmed(10):
            assert main(words) in (0, 1, 2)


@contextmanager
def alarmed(seconds: int) -> Iterator[None]:
    """Fail where it takes longer."""

    def late(*_: object) -> None:
        raise AssertionError(f"waits for more than {seconds} s")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)


def test_a_clock_that_runs_backwards_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    times = itertools.count(0, -1)
    monkeypatch.setattr(precision, "perf_counter", lambda: float(next(times)))
    assert main(["precision", "spring", "--method", "own:euler", "--budget", "1", "-o", "p.h5"]) == 2
    assert "the clock of this machine runs backwards" in capsys.readouterr().err


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_whose_locks_libhdf5_does_not_know_is_read(
    number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["run", "spring", "--method", "own:euler", "--quiet", "-o", "s.h5"]) == 0
    real = h5py.File

    class Unlocked(real):  # type: ignore[misc,valid-type]
        def __init__(self, *given: Any, locking: Any = None, **how: Any) -> None:
            if locking == "best-effort":
                raise OSError(
                    f"Unable to synchronously open file (unable to lock file, errno = {number}, ...)"
                )
            super().__init__(*given, locking=locking, **how)

    monkeypatch.setattr(h5py, "File", Unlocked)
    assert main(["check", "s.h5"]) == 0
