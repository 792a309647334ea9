"""An engine from anywhere is found, judged and stored like ours, and a broken one takes no other down."""

from __future__ import annotations

import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from springcheck import engines, schemes, store
from springcheck.cli import main
from springcheck.errors import MethodError

pytestmark = pytest.mark.usefixtures("own_folder")

EXAMPLE = Path(__file__).parent / "plugin-example"


@pytest.fixture(autouse=True)
def _nothing_left_over() -> Iterator[None]:
    yield
    engines.registry._points.cache_clear()
    engines.registry._loaded.cache_clear()


def springcheck(folder: Path, *arguments: str, path: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "springcheck", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, installed by pip into a folder of its own."""
    folder = tmp_path_factory.mktemp("site")
    source = shutil.copytree(EXAMPLE, tmp_path_factory.mktemp("source") / "example")
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--target",
        str(folder),
        str(source),
    ]
    done = subprocess.run(pip, capture_output=True, text=True, check=False)
    if done.returncode and not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        pytest.skip(f"pip cannot build a package here: {done.stderr.strip().splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    return folder


def test_an_installed_package_is_found_run_stored_and_still_readable_when_it_is_gone(
    installed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = str(shutil.copytree(installed, tmp_path / "site"))
    listed = springcheck(tmp_path, "list", "methods", path=site).stdout
    assert "PEFRL in NumPy 1.2.3, from springcheck-pefrl 1.2.3" in listed
    run = springcheck(
        tmp_path, "run", "spring-uneven", "--method", "pefrl:*", "--thorough", "--json", path=site
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    assert [one["scheme"] for one in found["runs"]] == ["pefrl"]
    judged = {one["check"]: one["passed"] for one in found["verdicts"]}
    assert all(
        judged[name]
        for name in ("step-defect", "closed-form", "shadow-energy", "frequency", "order", "mirror")
    )
    shutil.rmtree(site)
    # in this process, which knows nothing of the package
    for command in ("inspect", "check", "plot", "identify"):
        assert main([command, "spring-uneven.h5"]) in (0, 1), command
    capsys.readouterr()
    assert main(["list"]) == 0
    assert "PEFRL" not in capsys.readouterr().out
    assert main(["run", "spring-uneven", "--method", "pefrl:pefrl"]) == 2
    assert capsys.readouterr().err.startswith("springcheck: unknown engine 'pefrl'")


def test_what_is_in_a_store_is_told_without_its_engines_but_for_schemes_of_their_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A plug-in may be slow to import, or run code of a stranger."""
    plugin = str(EXAMPLE / "springcheck_pefrl.py")
    assert main(["run", "spring", "--engine", plugin, "--method", "own:*euler", "--quiet", "-o", "x.h5"]) == 0
    loaded: list[str] = []
    find = engines.registry._find
    monkeypatch.setattr(engines.registry, "_find", lambda name: loaded.append(name) or find(name))
    monkeypatch.delitem(schemes.lookup._brought, "pefrl")
    for command in ("inspect", "plot", "report"):
        assert main([command, "x.h5"]) == 0
    assert set(loaded) == {"pefrl"}


def test_a_scheme_of_its_own_is_carried_out_wrongly_and_the_verdicts_say_so(tmp_path: Path) -> None:
    text = (EXAMPLE / "springcheck_pefrl.py").read_text()
    wrong = tmp_path / "wrong.py"
    wrong.write_text(text.replace("self.q + float(c) * self.h", "self.q + 1.0000001 * float(c) * self.h"))
    assert (
        main(["run", "spring", "--method", "pefrl:*", "--engine", str(wrong), "--quiet", "-o", "x.h5"]) == 1
    )


def test_a_file_is_an_engine_for_one_call_and_runs_beside_the_others(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    folder = tmp_path / "a-folder-with-many-hyphens" / "and-another-so-that-its-path-fills-a-line"
    folder.mkdir(parents=True)
    file = str(folder / "springcheck_pefrl.py")
    shutil.copy(EXAMPLE / "springcheck_pefrl.py", file)
    assert main(["run", "spring", "--engine", file, "--method", "own:euler", "--json"]) == 0
    assert [run["method"] for run in json.loads(capsys.readouterr().out)["runs"]] == [
        "own:euler",
        "pefrl:pefrl",
    ]
    assert main(["list", "methods", "--engine", file]) == 0
    assert file in capsys.readouterr().out, "a path stays in one piece"


MINIMAL = """
from springcheck.engines import Arithmetic, Engine, Method, named
class S:
    force_calls = {calls}; {more}
    def advance(self, {advanced}):
        {advance}
def start({started}):
    {start}
M = Method(name={method}, scheme={scheme}, about="", terms={terms})
ENGINE = Engine(name={name}, title="bad", methods={by_name}(M),
                start=start, version=lambda: {version}, arithmetic={arithmetic})
"""


def bad(path: Path, **parts: str) -> Path:
    plain = {
        "advance": "pass", "start": "return S()", "name": "'bad'", "method": "'m'",
        "scheme": "'explicit-euler'", "version": "{}", "arithmetic": "lambda label: Arithmetic()",
        "by_name": "named", "terms": "{'wall-spring'}", "started": "scene, method, label, step",
        "advanced": "every, q, p", "calls": "0", "more": "pass",
    }  # fmt: skip
    path.write_text(MINIMAL.format(**plain | parts))
    return path


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"name": "'own'"}, "is taken by the engine of springcheck"),
        ({"name": "'a b'"}, "its name 'a b' must be of letters"),
        ({"method": "'m@x'"}, "the name of its method 'm@x' must be of letters"),
        ({"scheme": "'velocity-verlett'"}, "did you mean velocity-verlet?"),
        (
            {"by_name": "{}, thermostats=named", "scheme": "'baoab'"},
            "its thermostat 'm': the `generator` of its Method must say what draws",
        ),
        (
            {"start": "return scene.mass"},
            "object has no attribute 'mass' (bad.py, line 8)",
        ),
        ({"advance": "q[0] = 1 / 0"}, "ZeroDivisionError: division by zero (bad.py, line 6)"),
        (
            {"version": "1 / 0"},
            "engine 'bad': its version() failed: ZeroDivisionError: division by zero (bad.py",
        ),
        ({"version": "__import__('nonesuch')"}, "engine 'bad', bad, cannot be imported: ModuleNotFoundError"),
        ({"advance": "q[:] = p[:] = 0", "version": "1 / 0"}, "ZeroDivisionError: division by zero (bad.py"),
        ({"version": "[]"}, "engine 'bad': its version() returned list, not a dict of names and versions"),
        (
            {"advance": "q[:] = p[:] = 0", "arithmetic": "lambda: Arithmetic()"},
            "takes 0 positional arguments but 1 was given; it is called as arithmetic(label)",
        ),
        ({"started": "scene, step"}, "given; it is called as start(scene, method, label, step)"),
        (
            {"advanced": "q, p"},
            "takes 3 positional arguments but 4 were given; it is called as advance(every",
        ),
        ({"start": "return S(1)"}, "TypeError: S() takes no arguments (bad.py, line 8)"),
        (
            {"by_name": "(lambda *all: [*all])"},
            "its methods are a list, not by name; named(...) makes them so",
        ),
        ({"terms": "['wall-spring']"}, "the terms of its method 'm' are a list, not a set"),
        ({"terms": "{'wall-sprin'}"}, "there is no term 'wall-sprin', did you mean wall-spring?"),
        ({"advance": "q[:] = p[:] = 0", "arithmetic": "str"}, "its arithmetic is of type str"),
        ({"start": "return None"}, "NoneType"),
        ({"advance": "return ("}, "SyntaxError"),
        ({"scheme": "'euler'"}, "did you mean explicit-euler?"),
        (
            {"advance": "q[:] = p[:] = 0", "calls": "'many'"},
            "bad:m: its force_calls is 'many', not a whole number of calls",
        ),
        ({"advance": "q[:] = p[:] = 0", "calls": "1e30"}, "its force_calls is 1e+30, not a whole number"),
        ({"advance": "q[:] = p[:] = 0", "more": "off_axis = 'far'"}, "its off_axis is 'far', not a number"),
        (
            {"advance": "pass"},
            "its advance(every, q, p) has left row 0 of q and p as it was; it writes",
        ),
        ({"advance": "q[:] = 0"}, "has left row 0 of p as it was"),
        ({"advance": "import springcheck.engines as e; raise e.Stopped(900, '')"}, "after 900 rows of 200"),
    ],
    ids=str,
)
def test_a_bad_file_is_answered_in_one_line(
    parts: dict[str, str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = bad(tmp_path / "bad.py", **parts)
    assert main(["run", "spring", "--engine", str(file), "--method", "own:euler"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]


ENDS: dict[str, tuple[str, str]] = {
    "sys.exit(0)": ("start", "bad:m failed: SystemExit: 0 (bad.py, line"),
    "os._exit(0)": ("advance", "bad:m failed: SystemExit: 0"),
    "os._exit(1)": ("version", "engine 'bad': its version() failed: SystemExit: 1"),
    "raise BaseException('x')": ("advance", "bad:m failed: BaseException: x (bad.py, line"),
    "raise GeneratorExit": ("start", "bad:m failed: GeneratorExit (bad.py, line"),
    "raise MemoryError": ("advance", "bad:m failed: MemoryError (bad.py, line"),
    "raise Mute": ("start", "bad:m failed: Mute: its text cannot be made (bad.py, line"),
}


def harmful(path: Path, where: str, act: str) -> Path:
    """An engine that does this at some place, and stands still."""
    harm = {"start": "return S()", "advance": "q[:], p[:] = 1, 0", "version": "{}"}
    wrong = {"start": f"{act}; return S()", "advance": f"{act}; q[:], p[:] = 1, 0", "version": "act()"}
    parts = harm | {key: text for key, text in wrong.items() if key == where}
    text = bad(path, **parts).read_text()
    head = (
        "import os, sys, threading, time\nclass Mute(Exception):\n    def __str__(self): raise ValueError\n"
    )
    head += f"def act():\n    {act}\n    return {{}}\n" + "act()\n" * (where == "import")
    path.write_text(head + text)
    return path


@pytest.mark.parametrize("act", ENDS)
def test_an_engine_that_ends_the_program_is_named_and_what_others_finished_is_kept(
    act: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where, said = ENDS[act]
    harmful(tmp_path / "bad.py", where, act)
    command = ["run", "spring", "--engine", "bad.py", "--method", "own:euler", "-o", "s.h5"]
    status, (out, err) = main(command), capsys.readouterr()
    assert status == 2
    assert said in err + out
    assert "Traceback" not in err
    # the others are shown all the same, and nothing reads as if all had passed
    assert not out or "bad:m" in out
    if where in ("start", "advance"):
        assert list(store.read(tmp_path / "s.h5")) == ["own:euler"]


@pytest.mark.parametrize(
    ("where", "act"),
    [
        ("start", "print('noise'); os.system('echo noise')"),
        ("advance", "print('noise', flush=True)"),
        ("start", "sys.stdout.close()"),
        ("start", "os.close(1)"),
        ("advance", "threading.Thread(target=time.sleep, args=(99,)).start()"),
        ("start", "os.fork()"),
        ("version", "print('noise')"),
        ("version", "os.close(1)"),
    ],
)
def test_nothing_that_an_engine_does_to_the_program_stands_in_its_document(
    where: str, act: str, tmp_path: Path, program: Callable[..., Any]
) -> None:
    harmful(tmp_path / "bad.py", where, act)
    done = program("run", "spring", "--engine", "bad.py", "--method", "own:euler", "--json", "-o", "s.h5")
    # it stands still, and fails for it
    assert done.status == 1, done.err
    assert [run["method"] for run in json.loads(done.out)["runs"]] == ["own:euler", "bad:m"]
    assert "noise" in done.err or "noise" not in act
    assert "springcheck:" not in done.err


def test_a_missing_file_is_answered_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "spring", "--engine", "nowhere.py"]) == 2
    assert capsys.readouterr().err == "springcheck: nowhere.py: there is no such file\n"


def test_a_broken_plug_in_is_named_and_takes_no_other_down(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    real = importlib.metadata.entry_points(group=engines.registry.GROUP)
    texts = {"raises": "raise RuntimeError('no licence\\nfound')", "leaves": "raise SystemExit(3)"}
    for name in ("raises", "leaves", "number", "own"):
        (tmp_path / f"broken_{name}.py").write_text(texts.get(name, "ENGINE = 7"))
    monkeypatch.syspath_prepend(tmp_path)
    dist = importlib.metadata.Distribution.from_name("numpy")
    broken = [
        SimpleNamespace(name=name, module=f"broken_{name}", attr="ENGINE", dist=dist)
        for name in ("gone", "raises", "leaves", "number", "own")
    ]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [*broken, *real])
    engines.registry._points.cache_clear()
    assert engines.names()[0] == "own"
    assert not {"gone", "raises", "leaves", "number"} & set(engines.names())
    assert set(engines.unusable()) == {"gone", "raises", "leaves", "number", "own (numpy)"}
    assert all("\n" not in reason for reason in engines.unusable().values())
    with pytest.raises(MethodError, match=r"engine raises of numpy .* RuntimeError: no licence found"):
        engines.parse("raises:x")
    assert main(["run", "spring", "--method", "own:*euler", "--quiet"]) == 0
    assert main(["list"]) == 0
    assert "engine number of numpy" in capsys.readouterr().out


def test_declaring_and_listing_engines_imports_none_of_their_libraries(tmp_path: Path) -> None:
    code = (
        "import sys; from springcheck import engines; "
        "[engines.absence(n) for n in engines.names()]; print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    libraries = {engines.engine(name).imports for name in engines.names()} - {"", "scipy"}
    assert not {name.partition(".")[0] for name in done.stdout.split()} & libraries


def test_every_engine_is_registered_and_of_fields_that_mean_something() -> None:
    assert len(engines.names()) > 5
    for name in engines.names():
        found = engines.engine(name)
        assert found.name == name
        assert np.all([place.partition("@")[0] in found.methods for place in found.atlas])
