"""States in the files of other programs are judged by the law of a scheme; a bad file is one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import ase.io
import ase.units
import h5py
import numpy as np
import pytest
from ase import Atoms

from springcheck import simulate
from springcheck.cli import main
from springcheck.physics.scenefile import load_scene
from springcheck.trajectory import Trajectory

SCENE = load_scene("spring-uneven")
LINE = np.array([0.6, 0.0, 0.8])


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def made(label: str = "own:semi-implicit-euler") -> Trajectory:
    return simulate.run(SCENE, label)


def csv(run: Trajectory) -> list[str]:
    rows = [f"{t:.17g},{q:.17g},{p:.17g}" for t, q, p in zip(run.t, run.q[:, 0], run.p[:, 0], strict=True)]
    Path("x.csv").write_text("\n".join(["t [s],q,p", *rows, ""]))
    return ["x.csv"]


def blanks(run: Trajectory) -> list[str]:
    v = run.p[:, 0] / SCENE.m[0]
    np.savetxt("x.txt", np.stack([run.t, run.q[:, 0], v], axis=1), fmt="%.17g")
    return ["x.txt", "--columns", "t,q,v"]


def six_digits(run: Trajectory) -> list[str]:
    np.savetxt("x.txt", np.stack([run.t, run.q[:, 0], run.p[:, 0]], axis=1), fmt="%.6g", header="t q p")
    return ["x.txt"]


def npy(run: Trajectory) -> list[str]:
    np.save("x.npy", np.stack([run.t, run.q[:, 0], run.p[:, 0]], axis=1))
    return ["x.npy", "--columns", "t,q,p"]


def structured(run: Trajectory) -> list[str]:
    out = np.zeros(len(run.t), dtype=[("time", "f8"), ("position", "f8"), ("momentum", "f8")])
    out["time"], out["position"], out["momentum"] = run.t, run.q[:, 0], run.p[:, 0]
    np.save("x.npy", out)
    return ["x.npy"]


def npz(run: Trajectory) -> list[str]:
    np.savez("x.npz", t=run.t, q=run.q, v=run.p / SCENE.m)
    return ["x.npz"]


def single(run: Trajectory) -> list[str]:
    np.savez("x.npz", t=run.t, q=run.q.astype(np.float32), p=run.p.astype(np.float32))
    return ["x.npz"]


def in_space(run: Trajectory) -> list[str]:
    names = ["t", "x", "y", "z", "vx", "vy", "vz"]
    r, v = run.q * LINE, run.p / SCENE.m * LINE
    np.savetxt("x.csv", np.hstack([run.t[:, None], r, v]), fmt="%.17g", delimiter=";", header=";".join(names))
    return ["x.csv"]


def images(run: Trajectory) -> list[Atoms]:
    found = []
    for t, q, p in zip(run.t, run.q, run.p, strict=True):
        atoms = Atoms("X", positions=[q * LINE], masses=SCENE.m)
        # ASE's own unit of time is 10 fs; ours is 1 fs here
        atoms.set_velocities([p / SCENE.m * LINE / ase.units.fs])
        atoms.info["time"] = float(t)
        found.append(atoms)
    return found


def ase_trajectory(run: Trajectory) -> list[str]:
    found = images(run)
    ase.io.write("x.traj", found)
    return ["x.traj", "--step", repr(SCENE.step)]


def dump(run: Trajectory) -> list[str]:
    lines = []
    for step, (q, p) in enumerate(zip(run.q, run.p, strict=True)):
        r, v = q * LINE, p / SCENE.m * LINE
        lines += ["ITEM: TIMESTEP", str(step), "ITEM: NUMBER OF ATOMS", "1", "ITEM: BOX BOUNDS ff ff ff"]
        lines += ["-9 9"] * 3 + ["ITEM: ATOMS id type x y z vx vy vz"]
        lines.append(" ".join(["1 1", *(f"{x:.17g}" for x in (*r, *v))]))
    Path("x.lammpstrj").write_text("\n".join(lines) + "\n")
    return ["x.lammpstrj", "--step", repr(SCENE.step)]


def h5md(run: Trajectory) -> list[str]:
    with h5py.File("x.h5md", "w") as file:
        for name, values in (("position", run.q * LINE), ("velocity", run.p / SCENE.m * LINE)):
            group = file.create_group(f"particles/all/{name}")
            group["value"], group["step"] = values[:, None, :], np.arange(len(run.t))
            group["time"] = run.t
        file["particles/all/mass"] = SCENE.m
    return ["x.h5md"]


def store(run: Trajectory) -> list[str]:
    assert main(["run", "spring-uneven", "--method", run.label, "--quiet", "-o", "x.h5", "--force"]) == 0
    return ["x.h5"]


Writer = Callable[[Trajectory], list[str]]
WRITERS: list[Writer] = [
    csv, blanks, six_digits, npy, structured, npz, single, in_space, ase_trajectory, dump, h5md, store
]  # fmt: skip


def judged(capsys: pytest.CaptureFixture[str], arguments: list[str], scheme: str) -> tuple[int, dict]:  # type: ignore[type-arg]
    capsys.readouterr()
    status = main(["judge", *arguments, "--scene", "spring-uneven", "--scheme", scheme, "--json"])
    out = capsys.readouterr()
    assert status in (0, 1), out.err
    return status, {v["check"]: v["passed"] for v in json.loads(out.out)["verdicts"]}


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_a_file_passes_as_its_scheme_and_fails_as_another(
    write: Writer, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = write(made())
    status, found = judged(capsys, arguments, "semi-implicit-euler")
    assert status == 0, found
    assert found["step-defect"]
    for other in ("velocity-verlet", "explicit-euler"):
        status, found = judged(capsys, arguments, other)
        assert status == 1
        assert not found["step-defect"]


@pytest.mark.parametrize("write", [csv, blanks, npz, in_space, dump], ids=lambda write: write.__name__)
def test_identify_reads_the_same_files(write: Writer, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = write(made("own:euler"))
    assert main(["identify", *arguments, "--mass", str(SCENE.m[0]), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scheme"] == "explicit-euler"


def test_one_bad_frame_fails(capsys: pytest.CaptureFixture[str]) -> None:
    run = made()
    run.q[70, 0] *= 1 + 1e-12
    status, found = judged(capsys, csv(run), "semi-implicit-euler")
    assert status == 1
    assert not found["step-defect"]


BAD = [
    ("", "is empty"),
    ("hello\n", "holds no row of numbers"),
    ("1,2,3\n", "have no names"),
    ("t,q,p\n0,1\n", "2 columns and 3 names"),
    ("t,q\n0,1\n", "no column of momenta or velocities"),
    ("q,p\n0,1\n", "no column of times"),
    ("t,q,p\n0,1,2\n1,2\n", "line 3"),
    ("t,q,p\n0,1,2\n1,x,2\n", "'x' is no number"),
    ("t,q,p\n0,0.3,0.7\n0.1,inf,1\n", "row 2 of q is not finite"),
    ("t,q,p\n0,5,7\n0.1,5,7\n", "frames lie whole steps of|off the start"),
    ("ITEM: TIMESTEP\n0\n", "damaged or cut off"),
    ("1\nProperties=species:S:1:pos:R:3\nX 0 0 0\n", "no velocities"),
    ("PK\x03\x04zip", "NumPy cannot read it"),
]


@pytest.mark.parametrize(("text", "said"), BAD)
def test_a_bad_file_is_one_line(text: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("x").write_text(text)
    assert main(["judge", "x", "--scene", "spring-uneven", "--scheme", "rk4"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert any(part in lines[0] for part in said.split("|")), lines


def test_names_that_are_wrong_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = csv(made())
    assert main(["judge", *arguments, "--scene", "spring-uneven", "--scheme", "rk5"]) == 2
    assert "did you mean rk4?" in capsys.readouterr().err
    assert main(["judge", "nowhere.csv", "--scene", "spring", "--scheme", "rk4"]) == 2
    assert "nowhere.csv" in capsys.readouterr().err
