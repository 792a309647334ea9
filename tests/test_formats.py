"""States in the files of other programs are judged by the law of a scheme; a bad file is one line."""

from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import ase.io
import ase.units
import h5py
import MDAnalysis
import numpy as np
import pytest
import scipy.io
from ase import Atoms

from springcheck import driver, formats
from springcheck.cli import main
from springcheck.errors import StoreError
from springcheck.formats.digits import number, roundoff
from springcheck.formats.tables import read_table
from springcheck.physics.scenefile import load_scene
from springcheck.physics.trajectory import Trajectory
from springcheck.store import apart

pytestmark = pytest.mark.usefixtures("own_folder", "tried_here")

SCENE = load_scene("spring-uneven")
READ_APART = apart.read
LINE = np.array([0.6, 0.0, 0.8])


def made(label: str = "own:semi-implicit-euler") -> Trajectory:
    return driver.run(SCENE, label)


def read_one(
    name: str, columns: tuple[str, ...] | list[str] = (), step: float | None = None
) -> formats.States:
    (found,) = formats.read(Path(name), columns, step).values()
    return found


def csv(run: Trajectory) -> list[str]:
    rows = [f"{t:.17g},{q:.17g},{p:.17g}" for t, q, p in zip(run.t, run.q[:, 0], run.p[:, 0], strict=True)]
    Path("x.csv").write_text("\n".join(["t [s],q,p", *rows, ""]))
    return ["x.csv"]


def with_index(run: Trajectory) -> list[str]:
    """As pandas writes a table, its index first and without a name."""
    rows = np.hstack([np.arange(len(run.t))[:, None], run.t[:, None], run.q, run.p])
    np.savetxt("x.csv", rows, fmt="%.17g", delimiter=",", header=",t,q,p", comments="")
    return ["x.csv"]


def printed_with_index(run: Trajectory) -> list[str]:
    """As pandas or R print a table: the index has no name at all."""
    rows = np.hstack([np.arange(len(run.t))[:, None], run.t[:, None], run.q, run.p])
    np.savetxt("x.txt", rows, fmt="%.17g", header="t q p", comments="  ")
    return ["x.txt"]


def decimal_commas(run: Trajectory) -> list[str]:
    csv(run)
    path = Path("x.csv")
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    return ["x.csv"]


def blanks(run: Trajectory) -> list[str]:
    v = run.p[:, 0] / SCENE.m[0]
    np.savetxt("x.txt", np.stack([run.t, run.q[:, 0], v], axis=1), fmt="%.17g")
    return ["x.txt", "--columns", "t,q,v"]


def slashes(run: Trajectory) -> list[str]:
    rows = np.stack([run.t, run.q[:, 0], run.p[:, 0]], axis=1)
    np.savetxt("x.txt", rows, fmt="%.17g", header="t, q, p", comments="// ", delimiter=", ")
    return ["x.txt"]


def grace(run: Trajectory) -> list[str]:
    """As GROMACS writes an .xvg file."""
    names = '@    xaxis  label "Time (ps)"\n@TYPE xy\n@ s0 legend "q"\n@ s1 legend "p"'
    header = f'# made by hand\n@    title "t, q, p"\n@ view 0.15, 0.15, 0.75\n{names}'
    rows = np.stack([run.t, run.q[:, 0], run.p[:, 0]], axis=1)
    np.savetxt("x.xvg", rows, fmt="%.17g", header=header, comments="")
    return ["x.xvg"]


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


def extended_xyz(run: Trajectory) -> list[str]:
    ase.io.write("x.extxyz", images(run))
    return ["x.extxyz"]


def universe() -> MDAnalysis.Universe:
    found = MDAnalysis.Universe.empty(1, trajectory=True, velocities=True)
    for name, values in (("name", ["X"]), ("resname", ["X"]), ("resid", [1]), ("mass", SCENE.m)):
        found.add_TopologyAttr(name, values)
    found.dimensions = [90, 90, 90, 90, 90, 90]
    return found


def frames(run: Trajectory, atoms: MDAnalysis.Universe) -> Iterator[tuple[float, MDAnalysis.Universe]]:
    """A reduced length and time are 1 nm and 1 ps; MDAnalysis counts in Angstrom."""
    for t, q, p in zip(run.t, run.q, run.p, strict=True):
        atoms.atoms.positions, atoms.atoms.velocities = 10 * q * LINE, 10 * p / SCENE.m * LINE
        atoms.trajectory.ts.time = t
        yield t, atoms


@pytest.mark.filterwarnings("ignore")
def trr(run: Trajectory) -> list[str]:
    with MDAnalysis.Writer("x.trr", 1) as writer:
        for _, atoms in frames(run, universe()):
            writer.write(atoms)
    return ["x.trr"]


def fixed_decimals(run: Trajectory) -> list[str]:
    """Velocities are a tenth of positions, and are written a digit coarser for it."""
    np.savetxt("x.txt", np.stack([run.t, run.q[:, 0], run.p[:, 0]], axis=1), fmt="%.8f", header="t q p")
    return ["x.txt"]


def arrays_in_hdf5(run: Trajectory) -> list[str]:
    with h5py.File("x.hdf5", "w") as file:
        file["t"], file["q"], file["p"], file["note"] = run.t, run.q, run.p, "mine"
    return ["x.hdf5"]


def groups_in_hdf5(run: Trajectory) -> list[str]:
    with h5py.File("x.hdf5", "w") as file:
        for name in ("one", "other"):
            file[f"{name}/time"], file[f"{name}/x"] = run.t, (run.q * LINE)[:, None]
            file[f"{name}/velocity"] = (run.p / SCENE.m * LINE)[:, None]
    return ["x.hdf5", "--trajectory", "other"]


def named_in_hdf5(run: Trajectory) -> list[str]:
    with h5py.File("x.hdf5", "w") as file:
        file["clock"], file["run/a"], file["run/b"] = run.t, run.q[:, 0].astype(np.float32), run.p[:, 0]
        file["run/q"] = np.zeros(3)
    return ["x.hdf5", "--columns", "t=clock,q=run/a,p=run/b"]


def named_in_npz(run: Trajectory) -> list[str]:
    np.savez("x.npz", clock=run.t, a=run.q, b=run.p, q=np.zeros(3))
    return ["x.npz", "--columns", "t=clock,q=a,p=b"]


def rows_of(run: Trajectory) -> dict[str, list[float]]:
    return {"t": run.t.tolist(), "q": run.q[:, 0].tolist(), "p": run.p[:, 0].tolist()}


def gzipped(run: Trajectory) -> list[str]:
    Path("x.csv.gz").write_bytes(gzip.compress(Path(csv(run)[0]).read_bytes()))
    return ["x.csv.gz"]


def fortran(run: Trajectory) -> list[str]:
    """As Fortran writes double precision with D24.16, here with the digit that is lacking."""
    path = Path(blanks(run)[0])
    rows = [" ".join(f"{float(x):.17e}" for x in line.split()) for line in path.read_text().splitlines()]
    path.write_text("\n".join(rows).replace("e", "D") + "\n")
    return ["x.txt", "--columns", "t,q,v"]


def plain_xyz(run: Trajectory) -> list[str]:
    out = []
    for t, q, p in zip(run.t, run.q, run.p, strict=True):
        numbers = (*(q * LINE), *(p / SCENE.m * LINE))
        out += ["1", f"made by hand, t = {float(t)!r}", "Ar " + " ".join(f"{x:.17g}" for x in numbers)]
    Path("x.xyz").write_text("\n".join(out) + "\n")
    return ["x.xyz"]


def json_of_lists(run: Trajectory) -> list[str]:
    Path("x.json").write_text(json.dumps({"made": "by hand", **rows_of(run)}))
    return ["x.json"]


def json_of_rows(run: Trajectory) -> list[str]:
    known = rows_of(run)
    rows = [dict(zip(known, row, strict=True)) for row in zip(*known.values(), strict=True)]
    Path("x.json").write_text(json.dumps(rows, indent=1))
    return ["x.json"]


def json_of_bare_rows(run: Trajectory) -> list[str]:
    rows = zip(*rows_of(run).values(), strict=True)
    Path("x.json").write_text(json.dumps([*rows]))
    return ["x.json", "--columns", "t,q,p"]


def json_lines(run: Trajectory) -> list[str]:
    known = rows_of(run)
    rows = [json.dumps(dict(zip(known, row, strict=True))) for row in zip(*known.values(), strict=True)]
    Path("x.jsonl").write_text("\n".join(rows) + "\n")
    return ["x.jsonl"]


def json_lines_of_bare_rows(run: Trajectory) -> list[str]:
    rows = [json.dumps(row) for row in zip(*rows_of(run).values(), strict=True)]
    Path("x.jsonl").write_text("\n".join(rows) + "\n")
    return ["x.jsonl", "--columns", "t,q,p"]


def json_of_pandas(run: Trajectory) -> list[str]:
    """As `DataFrame.to_json` writes it."""
    found = {name: {str(i): x for i, x in enumerate(values)} for name, values in rows_of(run).items()}
    Path("x.json").write_text(json.dumps(found))
    return ["x.json"]


def excel(run: Trajectory) -> list[str]:
    pytest.importorskip("openpyxl")
    pytest.importorskip("pandas").DataFrame(rows_of(run)).to_excel("x.xlsx", index=False)
    return ["x.xlsx"]


def parquet(run: Trajectory) -> list[str]:
    pytest.importorskip("pyarrow")
    pytest.importorskip("pandas").DataFrame(rows_of(run)).to_parquet("x.parquet")
    return ["x.parquet"]


def feather(run: Trajectory) -> list[str]:
    pytest.importorskip("pyarrow")
    pytest.importorskip("pandas").DataFrame(rows_of(run)).to_feather("x.feather")
    return ["x.feather"]


def matlab(run: Trajectory) -> list[str]:
    scipy.io.savemat("x.mat", rows_of(run))
    return ["x.mat"]


def matlab_struct(run: Trajectory) -> list[str]:
    scipy.io.savemat("x.mat", {"out": {"states": rows_of(run), "note": "a run"}})
    return ["x.mat"]


OCTAVE = "# Created by Octave 7.3.0, Mon Nov 23 07:10:55 2026 UTC <root@vm>\n"


def matlab_7_3(run: Trajectory) -> list[str]:
    """HDF5 after a block of MATLAB's own, every array turned: rows are columns."""
    with h5py.File("x.mat", "w", userblock_size=512) as file:
        for name, values in rows_of(run).items():
            file[name] = np.array([values])
    content = bytearray(Path("x.mat").read_bytes())
    content[:19] = b"MATLAB 7.3 MAT-file"
    Path("x.mat").write_bytes(content)
    return ["x.mat"]


def octave(run: Trajectory) -> list[str]:
    """As ``save -hdf5`` writes it: each array in a group of its name."""
    with h5py.File("x.h5", "w") as file:
        for name, values in rows_of(run).items():
            file[f"{name}/type"], file[f"{name}/value"] = np.bytes_("matrix"), np.array([values]).T
    return ["x.h5"]


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
    csv, with_index, printed_with_index, decimal_commas, blanks,
    slashes, grace, six_digits, npy, structured, npz, single, in_space, ase_trajectory, dump, h5md, store,
    extended_xyz, trr, fixed_decimals, arrays_in_hdf5, groups_in_hdf5, named_in_hdf5, named_in_npz,
    gzipped, fortran, plain_xyz, json_of_lists, json_of_rows,
    json_of_bare_rows, json_of_pandas, excel, parquet, feather, matlab, matlab_7_3, octave,
    json_lines, json_lines_of_bare_rows, matlab_struct,
]  # fmt: skip
READ_BY_ALL: list[Writer] = [
    csv, blanks, npz, in_space, dump, trr, arrays_in_hdf5, groups_in_hdf5, named_in_hdf5, named_in_npz,
]  # fmt: skip


def name_of(write: Writer) -> str:
    return write.__name__


def judged(capsys: pytest.CaptureFixture[str], arguments: list[str], scheme: str) -> tuple[int, dict]:  # type: ignore[type-arg]
    capsys.readouterr()
    status = main(["judge", *arguments, "--scene", "spring-uneven", "--scheme", scheme, "--json"])
    out = capsys.readouterr()
    assert status in (0, 1), out.err
    return status, {v["check"]: v["passed"] for v in json.loads(out.out)["verdicts"]}


@pytest.mark.parametrize("write", WRITERS, ids=name_of)
def test_a_file_passes_as_its_scheme_and_fails_as_another(
    write: Writer, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = write(made())
    status, found = judged(capsys, arguments, "semi-implicit-euler")
    assert status == 0, found
    assert found["step-defect"]
    assert found.get("identified", True)
    for other in ("velocity-verlet", "explicit-euler"):
        status, found = judged(capsys, arguments, other)
        assert status == 1
        assert not found["step-defect"]


@pytest.mark.parametrize(
    "write",
    READ_BY_ALL,
    ids=name_of,
)
def test_identify_reads_the_same_files(write: Writer, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = write(made("own:euler"))
    assert main(["identify", *arguments, "--mass", str(SCENE.m[0]), "--json"]) == 0
    # of .trr, in single precision, nothing may be named
    schemes = {"explicit-euler", None} if write is trr else {"explicit-euler"}
    assert json.loads(capsys.readouterr().out)["scheme"] in schemes


@pytest.mark.parametrize("write", [csv, groups_in_hdf5], ids=name_of)
def test_plot_draws_the_same_files(write: Writer) -> None:
    assert main(["plot", *write(made()), "-o", "figures", "--quiet"]) == 0
    assert Path("figures/states.png").stat().st_size > 10_000


def test_each_group_of_an_hdf5_file_is_a_trajectory(capsys: pytest.CaptureFixture[str]) -> None:
    groups_in_hdf5(made())
    assert main(["identify", "x.hdf5", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["identifications"]
    assert [(one["trajectory"], one["scheme"]) for one in found] == [
        ("one", "semi-implicit-euler"), ("other", "semi-implicit-euler")
    ]  # fmt: skip
    for command in (["judge", "x.hdf5", "--scene", "spring", "--scheme", "rk4"], ["plot", "x.hdf5"]):
        assert main(command) == 2
        assert "trajectories: 2; choose one by --trajectory: one, other" in capsys.readouterr().err


def test_coarse_digits_are_those_of_the_quantity_that_is_written_coarsest() -> None:
    rows = [["0.1", f"{x:.4f}", f"{x / 1000:.4f}"] for x in (12.3456, 98.7654, 31.4159)]
    assert roundoff(rows, [1]) == pytest.approx(5e-6)
    assert roundoff(rows, [1, 2]) == pytest.approx(5e-3)
    # what does not change says nothing of how it is written
    assert roundoff(rows, [0]) == 2.0**-53


def test_numbers_as_fortran_and_matlab_write_them() -> None:
    """gfortran leaves the letter out of exponents of three digits."""
    assert [number(x) for x in ("1.5-100", "-2.5+100", "1.5D-02", ".5-300")] == [
        1.5e-100,
        -2.5e100,
        0.015,
        5e-301,
    ]
    for cell in ("2020-100", "1-2", ".-100", "1.5-1000"):
        with pytest.raises(ValueError, match="could not convert"):
            number(cell)
    assert roundoff([["1.25-100"], ["2.5-100"]], [0]) == pytest.approx(5e-3)
    scipy.io.savemat("x.mat", {"a": {"t": [0, 1.0], "q": [1, 2.0]}, "b": {"t": [0, 2.0], "q": [3, 5.0]}})
    with pytest.raises(StoreError, match=r"no array of times among a\.t, a\.q, b\.t, b\.q; name them"):
        read_one("x.mat")
    assert read_one("x.mat", ["t=b.t", "q=b.q"]).q.ravel().tolist() == [3, 5]


def test_arrays_that_are_not_there_are_said(capsys: pytest.CaptureFixture[str]) -> None:
    named_in_hdf5(made())
    for columns, said in (
        ("t=clok,q=run/a,p=run/b", "holds no array 'clok'"),
        ("", "no datasets of times"),
    ):
        assert main(["identify", "x.hdf5", "--columns", columns]) == 2
        assert said in capsys.readouterr().err


def test_one_bad_frame_fails(capsys: pytest.CaptureFixture[str]) -> None:
    run = made()
    run.q[70, 0] *= 1 + 1e-12
    status, found = judged(capsys, csv(run), "semi-implicit-euler")
    assert status == 1
    assert not found["step-defect"]


def test_times_that_were_replaced_are_not_called_exact(capsys: pytest.CaptureFixture[str]) -> None:
    run = made()
    _, found = judged(capsys, csv(run), "semi-implicit-euler")
    assert found["times"]
    _, found = judged(capsys, csv(replace(run, t=run.t * (1 + 4e-16))), "semi-implicit-euler")
    assert found["times"] is None


def test_velocities_beside_the_line_are_not_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = in_space(made())
    path = Path(arguments[0])
    rows = path.read_text().splitlines()
    numbers = rows[-1].split(";")
    # LINE has no part along y
    numbers[5] = "0.31234567890123457"
    path.write_text("\n".join([*rows[:-1], ";".join(numbers), ""]))
    assert main(["judge", *arguments, "--scene", "spring-uneven", "--scheme", "semi-implicit-euler"]) == 2
    assert "not along one line" in capsys.readouterr().err


def test_a_file_that_ends_before_its_scene_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    run = made()
    short = replace(run, t=run.t[:-3], q=run.q[:-3], p=run.p[:-3])
    assert main(["judge", *csv(short), "--scene", "spring-uneven", "--scheme", "semi-implicit-euler"]) == 2
    steps = SCENE.steps - 3 * SCENE.every
    assert f"{steps:,} of {SCENE.steps:,} steps" in capsys.readouterr().out


BAD = [
    ("", "is empty"),
    ("hello\n", "holds no row of numbers"),
    ("t;q;p\n0;3,000.0;7,000.0\n", "line 2: '3,000.0' is no number"),
    ("1,2,3\n", "have no names"),
    ("t,q,p\n0,1\n", "columns: 2, names: 3"),
    ("t,q\n0,1\n", "no momenta or velocities"),
    ("q,p\n0,1\n", "no column of times"),
    ("t,q,p\n0,1,2\n1,2\n", "line 3"),
    ("t,q,p\n0,1,2\n1,x,2\n", "'x' is no number"),
    ("t,q,p\n0,0.3,0.7\n0.1,inf,1\n", "row 2 of q is not finite"),
    ("t,q,p\n0,0.3,0.7\n0.1,0.3,0.7\nnan,0.3,0.7\n", "row 3 of t is not finite"),
    ("t,q,p\n0,0.3,0.7\ninf,0.3,0.7\n", "row 2 of t is not finite"),
    ("t,q,p\n0,5,7\n0.1,5,7\n", "frames lie whole steps of|off the start"),
    ("t,q,p\n0,0.3,0.7\n0.1,0.3,0.7\n0.3,0.3,0.7\n", "row 3 is at t = 0.3, and 0.2 is due: frames lie"),
    ("t,q,p\n0,0.3,0.7\n0.1,0.3,0.7\n0.1,0.3,0.7\n", "row 3 is at t = 0.1, and 0.2 is due"),
    ("ITEM: TIMESTEP\n0\n", "damaged or cut off"),
    ("1\nProperties=species:S:1:pos:R:3\nX 0 0 0\n", "give its time step"),
    ("PK\x03\x04zip", "NumPy cannot read it"),
    ('{"t": 1}\n{"t": ', "msgspec cannot read it"),
]


@pytest.mark.parametrize(("text", "said"), BAD)
def test_a_bad_file_is_one_line(text: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("x").write_text(text)
    assert main(["judge", "x", "--scene", "spring-uneven", "--scheme", "rk4"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert any(part in lines[0] for part in said.split("|")), lines


def test_what_is_of_no_format_is_told_which_are_read(capsys: pytest.CaptureFixture[str]) -> None:
    Path("x.bin").write_bytes(b"\xff\xfe\x00\x01" * 99)
    assert main(["identify", "x.bin"]) == 2
    said = capsys.readouterr().err
    for one in formats.FORMATS:
        assert one.name in said
    with pytest.raises(SystemExit):
        main(["identify", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    for one in formats.FORMATS:
        assert one.name in told


@pytest.mark.parametrize("write", [excel, parquet, feather, matlab, ase_trajectory, trr], ids=name_of)
def test_a_library_reads_in_a_process_of_its_own(
    write: Writer, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    arguments = write(made("own:euler"))
    monkeypatch.setattr(apart, "read", READ_APART)
    assert main(["identify", *arguments, "--json", "--mass", str(SCENE.m[0])]) == 0
    out, err = capfd.readouterr()
    assert err == ""
    assert json.loads(out)["scheme"] in ({"explicit-euler", None} if write is trr else {"explicit-euler"})


HARMFUL = {
    "brackets.csv": "[" * 100_000 + ",t,q,p\n0,1,2\n",
    "digits.csv": "q" + "1" * 100_000 + ",t,q,p\n0,1,2\n",
    "dots.csv": "q" + "._" * 100_000 + "x,t,q,p\n0,1,2,3\n",
    "names.csv": ",".join(["n" * 65_000] * 50) + "\n" + ",".join(["0"] * 50) + "\n",
    "negative.dump": "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n-1\nITEM: ATOMS id x y z vx vy vz\n" * 9,
    "many.dump": "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n999999999\nITEM: ATOMS id x y z vx vy vz\n",
    "none.xyz": "0\n\n" * 9,
    "many.xyz": "999999999999\nt=0\nAr 0 0 0\n",
    "endless.log": "LAMMPS (1 Jan 2024)\n" + "Step v_q\n" * 99,
    "deep.json": "{" + '"a":[' * 100_000,
    "x.traj": "- of UlmASE-Trajectory" + "\0" * 200,
    "x.trr": "\0\0\x07\xc9" + "\x7f" * 200,
    "x.xlsx": "PK\x03\x04[Content_Types].xml",
    "x.parquet": "PAR1" + "\xff" * 99 + "PAR1",
    "x.feather": "ARROW1" + "\xff" * 99,
    "x.mat": "MATLAB 5.0 MAT-file" + " " * 105 + "\0\x01IM" + "\x0f\0\0\0\xff\xff\xff\x7f" * 9,
    "x.gz": "\x1f\x8b\x08\0nothing",
    "latin-1.csv": "t,q,p # \xe5\n0,1,2\n",
    "empty.csv": ",\n" * 2_000_000,
    "one.csv": "1\n" * 20_000_000,
}


def test_a_file_made_to_do_harm_is_one_line() -> None:
    for name, content in HARMFUL.items():
        Path(name).write_bytes(content.encode("latin-1"))
    lines = answered(*HARMFUL)
    for name, line in zip(HARMFUL, lines, strict=True):
        assert line.startswith(f"springcheck: {name}")
        assert len(line) < 500
    assert "no text in UTF-8" in lines[-3]
    assert "no row of numbers" in lines[-2]


def test_datasets_by_their_names_that_cannot_be_read_are_not_called_missing() -> None:
    with h5py.File("x.h5", "w") as file:
        for name in "tqp":
            file.create_dataset(name, (1 << 30,), "f8", chunks=(1 << 20,))
    assert "/p claims 8589934592 bytes, more than the file holds" in one_line("x.h5")


def answered(*files: str) -> list[str]:
    """What identify says of files, as a program of its own within the limits that are promised."""
    limited = (
        f"import resource as r; r.setrlimit(r.RLIMIT_AS, ({1 << 30},) * 2); "
        "r.setrlimit(r.RLIMIT_CPU, (20, 20)); from springcheck.__main__ import main; raise SystemExit(main())"
    )
    command = [sys.executable, "-c", limited, "identify", *files]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout) == (2, ""), done
    return done.stderr.splitlines()


def one_line(name: str) -> str:
    (line,) = answered(name)
    return line


def test_what_unpacks_to_gigabytes_is_one_line() -> None:
    deflated = zipfile.ZipFile("x.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1)
    with deflated as archive, archive.open("t.npy", "w") as member:
        for _ in range(400):
            member.write(bytes(1 << 20))
    # members of a gzip file follow each other: each block is packed once
    names = ",".join(["t,q,p", *(f"x{i}" for i in range(61))])
    rows = (",".join(["0"] * 64) + "\n").encode() * 8192
    Path("x.csv.gz").write_bytes(gzip.compress(f"{names}\n".encode()) + gzip.compress(rows) * 40)
    Path("line.csv.gz").write_bytes(gzip.compress(bytes(1 << 20)) * 200)
    with open("sparse.csv", "wb") as file:
        file.truncate(900_000_000)
    assert len(answered("x.npz", "x.csv.gz", "line.csv.gz", "sparse.csv")) == 4


def test_a_table_of_forty_megabytes_is_read_within_the_limits() -> None:
    t = np.arange(700_000) * 0.1
    rows = [f"{x:.17g},{np.cos(x):.17g},{-np.sin(x):.17g}" for x in t[:7000]]
    Path("x.csv").write_text("t,q,p\n" + "\n".join(rows * 100))
    assert Path("x.csv").stat().st_size > 3.9e7
    assert "not at a constant interval" in one_line("x.csv")


def test_names_that_are_wrong_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = csv(made())
    assert main(["judge", *arguments, "--scene", "spring-uneven", "--scheme", "rk5"]) == 2
    assert "did you mean rk4?" in capsys.readouterr().err
    assert main(["judge", "nowhere.csv", "--scene", "spring", "--scheme", "rk4"]) == 2
    assert "nowhere.csv" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "q", "v", "m"),
    [
        ("t,x1,x2,v2,v1,m2,m1", "x1 x2", "v1 v2", "m1 m2"),
        ("t,x2,x1,v2,v1,m1,m2", "x1 x2", "v1 v2", "m1 m2"),
        ("t,x1,x2,y1,y2,vx1,vx2,vy1,vy2,m1,m2", "x1 y1 x2 y2", "vx1 vy1 vx2 vy2", "m1 m2"),
        ("t,q[0],q[1],v[1],v[0]", "q[0] q[1]", "v[0] v[1]", ""),
        ("t,x1 [1],x2 [1],v2 [1],v1 [1]", "x1 [1] x2 [1]", "v1 [1] v2 [1]", ""),
        ("t,x,y,v_y,v_x", "x y", "v_x v_y", ""),
        ("t,x,x'", "x", "x'", ""),
        ("t,'x','v'", "'x'", "'v'", ""),
        ("t,x1,x2,x2dot,x1dot", "x1 x2", "x1dot x2dot", ""),
        ("t,q2,q1,v,v", "q2 q1", "v v", ""),
    ],
)
def test_a_column_is_that_of_the_particle_and_the_axis_in_its_name(
    names: str, q: str, v: str, m: str
) -> None:
    """Masses stood in the order of the file, of x1, x2, y1, y2 half of them at other coordinates; x' was a
    second position, and v_x was left out."""
    known = names.split(",")
    numbers = [
        np.full(9, 10.0 * i) if x[0] == "m" else 10.0 * i + np.arange(9.0) for i, x in enumerate(known)
    ]
    np.savetxt("a.csv", np.column_stack(numbers), header=names, comments="", delimiter=",")
    (found,) = formats.read(Path("a.csv")).values()
    mass = [] if found.mass is None else found.mass.tolist()
    for have, wanted in ((found.q[0], q), (found.v, v), (mass, m)):
        places = [int(x // 10) for x in np.atleast_2d(have)[0]] if have is not None else []
        assert " ".join(known[i] for i in places) == wanted


def test_arrays_along_axes_are_those_of_their_particles() -> None:
    """Of x (f, n) and y (f, n) the masses were repeated as if the particles' axes stood side by side."""
    x, y, vx, vy = (10.0 * i + np.arange(18.0).reshape(9, 2) / 7 for i in range(4))
    np.savez("a.npz", t=np.arange(9.0), x=x, y=y, vx=vx, vy=vy, m=[1.5, 2.5])
    (found,) = formats.read(Path("a.npz")).values()
    np.testing.assert_array_equal(found.q, np.stack([x, y], axis=2).reshape(9, 4))
    np.testing.assert_array_equal(found.v, np.stack([vx, vy], axis=2).reshape(9, 4))
    assert found.mass is not None
    assert found.mass.tolist() == [1.5, 2.5]


def test_one_mass_in_json_is_the_mass() -> None:
    rows = {name: [0.0, 0.3, 0.7, *range(9)] for name in "txv"}
    Path("a.json").write_text(json.dumps({**rows, "mass": 2.5}))
    (found,) = formats.read(Path("a.json")).values()
    assert found.mass is not None
    assert found.mass.tolist() == [2.5]


def test_a_picture_says_which_frames_are_not_finite_and_names_units(tmp_path: Path) -> None:
    """A coordinate with nan counted as one that rests, and was left out without a word."""
    path = tmp_path / "a.h5"
    t = np.arange(40) * 0.1
    q, v = np.cos(t)[:, None, None] * [1.0, 0.0, 2.0], np.sin(t)[:, None, None] * [1.0, 0.0, 2.0]
    q[17, 0, 2] = np.nan
    with h5py.File(path, "w") as file:
        for name, values, unit in (("position", q, "nm"), ("velocity", v, "nm ps-1")):
            file[f"particles/all/{name}/value"] = values
            file[f"particles/all/{name}/value"].attrs["unit"] = unit
            file[f"particles/all/{name}/time"] = t
    assert main(["plot", str(path), "-o", str(tmp_path / "figures"), "--quiet"]) == 0
    said = (tmp_path / "figures" / "states.svg").read_text()
    for part in ("not finite: 1 frame, the first of them frame 17", "coordinate 2", "q (nm)", "v (nm ps-1)"):
        assert part in said


@pytest.mark.parametrize(
    ("names", "said"),
    [
        # a radius and a speed were the third coordinate
        ("t,x,y,r,vx,vy,v", "positions along axes and others: x, y, r"),
        # a temperature was the time
        ("step,T,x,v", "counts steps and knows no times"),
    ],
)
def test_a_column_that_may_be_another_quantity_is_not_taken(names: str, said: str) -> None:
    np.savetxt(
        "a.csv",
        np.arange(36.0).reshape(4, -1)[:, : len(names.split(","))],
        header=names,
        comments="",
        delimiter=",",
    )
    with pytest.raises(StoreError, match=said):
        formats.read(Path("a.csv"))


@pytest.mark.parametrize(
    ("names", "units"), [("t,x,v", "s,m,m/s"), ("time;x;v", "[s];[m];[m/s]"), ("t x v", "ms - 1/s")]
)
def test_a_row_of_units_below_the_names_is_left_out_and_said(names: str, units: str) -> None:
    separator = next(x for x in ",; " if x in names)
    rows = [separator.join(map(str, (0.1 * i, np.cos(0.1 * i), -np.sin(0.1 * i)))) for i in range(4)]
    Path("x.csv").write_text("\n".join([names, units, *rows]))
    found = read_table(Path("x.csv"), [], None)
    assert found.q[1, 0] == np.cos(0.1)
    assert found.v is not None
    (note,) = found.notes
    assert note.startswith("line 2 left out as units (")
    # a row of a table that is damaged is no row of units, and a second row of names replaces the first
    for bad, said in (("x,1,2", "'x' is no number"), ("1,x,2", "'x' is no number")):
        Path("x.csv").write_text("\n".join(["t,x,v", bad, "0,1,2", "1,2,3"]))
        with pytest.raises(StoreError, match=said):
            read_table(Path("x.csv"), [], None)
    Path("x.csv").write_text("a,time,c\nt,q,v\n0,1,2\n1,2,3\n")
    assert read_table(Path("x.csv"), [], None).notes == ()


def test_a_table_of_counted_steps_takes_its_time_step_from_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--step` was left aside by tables: their steps had to be called t, and were taken for times."""
    run = driver.run(SCENE, "own:velocity-verlet")
    path = tmp_path / "a.csv"
    rows = np.column_stack([np.arange(len(run.t)), run.q, run.p])
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header="step,q,p", comments="")
    judged = ["judge", str(path), "--scene", "spring-uneven", "--scheme", "velocity-verlet"]
    assert main(judged) == 2
    assert "counts steps and knows no times; give its time step, as --step H" in capsys.readouterr().err
    assert main([*judged, "--step", "0.1"]) == 0
    assert main(["identify", str(path), "--mass", "3.7", "--step", "0.1"]) == 0
    assert "velocity-verlet" in capsys.readouterr().out
    # beside times the number of the step is no time
    np.savetxt(
        path,
        np.c_[rows[:, 0], run.t, rows[:, 1:]],
        fmt="%.17g",
        delimiter=",",
        header="step,t,q,p",
        comments="",
    )
    assert main(judged) == 0


def test_a_grace_file_without_rows_is_told() -> None:
    Path("x.xvg").write_text('@ s0 legend "q"\n@ nonsense without an end\n')
    with pytest.raises(StoreError, match="holds no row of numbers"):
        read_table(Path("x.xvg"), [], None)
