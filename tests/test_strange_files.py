"""Files as strangers write them: what is there is read, or it is said in one line why not; nothing is lost
without a word."""

from __future__ import annotations

import contextlib
import gzip
import json
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ase.io
import h5py
import numpy as np
import pytest
import scipy.io
from ase import Atoms

from springcheck import formats
from springcheck.cli import main
from springcheck.errors import StoreError
from springcheck.formats import States

pytestmark = pytest.mark.usefixtures("own_folder", "tried_here")

F = 12
T = 0.1 * np.arange(F)
Q, V = np.cos(T), -np.sin(T)
Q2, V2 = 2 * Q + 1, 3 * V


def read(name: str, *columns: str, step: float | None = None) -> States:
    (found,) = formats.read(Path(name), columns, step).values()
    return found


def table(*columns: object, head: str = "", sep: str = ",") -> str:
    rows = [sep.join(map(repr, map(float, row))) for row in zip(*columns, strict=True)]  # type: ignore[arg-type]
    return "\n".join([*([head] if head else []), *rows, ""])


def first_row(text: str) -> str:
    rows = table(T, Q, V).splitlines()
    return "\n".join([text, *rows[1:]])


TABLES = {
    "a comment of numbers, which is no row": "# t q v\n# 0.1 1.0 0.5\n" + table(T, Q, V, sep=" "),
    "a comment as MATLAB writes it": table(T, Q, V, head="% t q v", sep=" "),
    "cells in quotes": '"t","q","v"\n'
    + "\n".join(",".join(f'"{x}"' for x in row.split(",")) for row in table(T, Q, V).splitlines()),
    "velocities in another order than positions": table(T, Q, Q2, V2, V, head="t,x,y,vy,vx"),
    "the same by numbers": table(T, Q2, Q, V, V2, head="t,x2,x1,v1,v2"),
    "velocities by a dot": table(T, Q, V, head="t,x,xdot"),
    "velocities by a quotient": table(T, Q, V, head="t,x,dx/dt"),
    "axes in words": table(T, Q, Q2, V, V2, head="t,position_x,position_y,velocity_x,velocity_y"),
}


@pytest.mark.parametrize("text", TABLES.values(), ids=TABLES)
def test_a_table_is_read_as_it_is_meant(text: str) -> None:
    Path("x.csv").write_text(text)
    found = read("x.csv")
    assert found.t.tolist() == T.tolist()
    assert found.v is not None
    for q, v in zip(found.q.T, found.v.T, strict=True):
        assert (q.tolist(), v.tolist()) in ((Q.tolist(), V.tolist()), (Q2.tolist(), V2.tolist()))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (first_row("0.0,n/a,0.3"), "line 1: 'n/a' is no number"),
        (first_row("0.0,\u22121,0.3"), "line 1: '\u22121' is no number"),
        ("t,q,v\n0,1,0\n0.1,1_0,0\n", "'1_0' is no number"),
        (table(T, Q, V, 2 + T, head="t,q,v,m"), "the masses change"),
    ],
)
def test_a_row_is_not_lost(text: str, said: str) -> None:
    Path("x.csv").write_text(text)
    with pytest.raises(StoreError, match=said):
        read("x.csv", *(["t", "q", "v"] if text[0] == "0" else []))


def arrays(v: object) -> dict[str, object]:
    return {"t": T, "q": Q, "v": v}


def as_npz(v: object) -> str:
    np.savez("x.npz", **arrays(v))
    return "x.npz"


def as_json(v: object) -> str:
    Path("x.json").write_text(json.dumps({name: np.asarray(x).tolist() for name, x in arrays(v).items()}))
    return "x.json"


def as_mat(v: object) -> str:
    scipy.io.savemat("x.mat", arrays(v))
    return "x.mat"


def as_hdf5(v: object) -> str:
    with h5py.File("x.h5", "w") as file:
        for name, x in arrays(v).items():
            file[name] = x
    return "x.h5"


def as_excel(v: object) -> str:
    pytest.importorskip("pandas").DataFrame(arrays(v)).to_excel("x.xlsx", index=False)
    return "x.xlsx"


TEXTS = [*map(str, V[:-1]), "lost"]
UNREAD = {
    as_npz: (V[1:], V + 0j, V > 0, V.astype(str), V.reshape(F, 1, 1, 1)),
    as_json: (V[1:], TEXTS),
    as_mat: (V[1:], V + 0j),
    as_hdf5: (V[1:], V + 0j, h5py.SoftLink("/q"), h5py.ExternalLink("y.h5", "q")),
    as_excel: (TEXTS,),
}


@pytest.mark.parametrize("write", UNREAD, ids=lambda write: write.__name__)
def test_velocities_that_cannot_be_read_are_not_left_out(write: Callable[[object], str]) -> None:
    """Positions alone would be the same for other schemes: to take them for all there is would be a lie."""
    for v in UNREAD[write]:
        with pytest.raises(
            StoreError, match=r"\bv\b.*(no numbers of 12|no array of numbers|leads elsewhere)"
        ):
            read(write(v))


@pytest.mark.parametrize("write", [as_npz, as_json, as_hdf5], ids=lambda f: f.__name__)
def test_initial_values_are_of_no_frame(write: Callable[[object], str]) -> None:
    assert read(write(V[:1])).v is None


def test_velocities_that_some_frames_lack_are_not_left_out() -> None:
    images = [Atoms("Ar", positions=[[q, 0, 0]], info={"time": t}) for t, q in zip(T, Q, strict=True)]
    for atoms in images[:-1]:
        atoms.set_velocities([[1.0, 0, 0]])
    ase.io.write("x.traj", images)
    with pytest.raises(StoreError, match="some frames have velocities, and others have none"):
        read("x.traj", step=0.1)


def test_velocities_behind_a_link_of_h5md_are_not_left_out() -> None:
    with h5py.File("x.h5", "w") as file:
        for name in ("particles/all/position", "v"):
            file[f"{name}/value"] = Q[:, None, None]
            file[f"{name}/time"] = T
        file["particles/all/velocity"] = h5py.SoftLink("/v")
    with pytest.raises(StoreError, match="a link 'velocity' that leads elsewhere"):
        read("x.h5")


def dump(number: Callable[[int], int]) -> str:
    head = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS id x y z vx vy vz\n{} {} 0 0 {} 0 0\n"
    return "".join(head.format(i, number(i), Q[i], V[i]) for i in range(F))


def test_frames_without_times_are_not_counted_as_times() -> None:
    for comment in ("Spring", "the great=yes"):
        Path("x.xyz").write_text(XYZ.replace("no", comment).replace("t = ", "s "))
        assert read("x.xyz", step=0.1).t.tolist() == pytest.approx(T.tolist())
        with pytest.raises(StoreError, match="give its time step, as --step H"):
            read("x.xyz")
    Path("x.xyz").write_text(XYZ)
    with pytest.raises(StoreError, match="frame 0 says no time, as others do"):
        read("x.xyz", step=0.2)


XYZ = "".join(
    f"1\n{f't = {t}' if t else 'no'}\nAr {q} 0 0 {v} 0 0\n" for t, q, v in zip(T, Q, V, strict=True)
)


def test_positions_alone_of_atoms_are_positions_alone() -> None:
    Path("x.xyz").write_text("".join(f"1\nt = {t}\nAr {q} 0 0\n" for t, q in zip(T, Q, strict=True)))
    found = read("x.xyz")
    assert (found.q[:, 0].tolist(), found.v) == (Q.tolist(), None)


def test_other_atoms_are_not_taken_for_the_same() -> None:
    Path("x.dump").write_text(dump(lambda i: 1 if i < 7 else 2))
    with pytest.raises(StoreError, match="frame 7 has other atoms than the first"):
        read("x.dump", step=0.1)


def trr(atoms: Callable[[int], int]) -> bytes:
    out = b""
    for i in range(F):
        n = atoms(i)
        out += struct.pack(">3i12s13i", 1993, 13, 12, b"GMX_trn_file", *[0] * 7, 12 * n, 12 * n, 0, n, i, 0)
        out += struct.pack(f">2f{6 * n}f", T[i], 0, *[Q[i]] * 3 * n, *[V[i]] * 3 * n)
    return out


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("x.trr", trr(lambda i: 1 + (i > 5)), "the number of particles changes from frame to frame"),
        ("x.csv.gz", gzip.compress(table(T, Q, V).encode())[:-9], "packed is damaged or cut off"),
        ("x.csv.gz", gzip.compress(bytes(9999))[:10] + b"\xff" * 99, "packed is damaged or cut off"),
        ("x.dump", dump(lambda i: 1)[:-9].encode(), "fewer words than it should have"),
    ],
)
def test_a_damaged_file_says_what_it_is(name: str, content: bytes, said: str) -> None:
    Path(name).write_bytes(content)
    with pytest.raises(StoreError, match=said):
        read(name, *(["t", "q", "v"] if "csv" in name else []), step=0.1)


def test_masses_that_do_not_fit_are_said() -> None:
    for m, said in ((np.ones(5), "masses: 5, columns of q: 1"), (1 + T, "the masses change")):
        np.savez("x.npz", m=m, **arrays(V))
        with pytest.raises(StoreError, match=said):
            read("x.npz")
    np.savez("x.npz", m=np.full(F, 2.0), **arrays(V))
    assert read("x.npz").mass == pytest.approx([2.0])


def test_a_mark_of_the_order_of_bytes_hides_no_format() -> None:
    as_json(V)
    for name, text in (("x.json", Path("x.json").read_text()), ("x.xyz", XYZ.replace("no", "t = 0"))):
        Path(name).write_text(text, encoding="utf-8-sig")
        assert read(name).v is not None


def test_columns_of_structs_are_looked_at_as_any() -> None:
    for kind, values in (("c16", V), ("U9", V.astype(str))):
        found = np.zeros(F, dtype=[("t", "f8"), ("q", "f8"), ("v", kind)])
        found["t"], found["q"], found["v"] = T, Q, values
        np.save("x.npy", found)
        with pytest.raises(StoreError, match="no numbers of 12 frames"):
            read("x.npy")


def test_the_index_of_a_table_is_a_column() -> None:
    pd = pytest.importorskip("pandas")
    pd.DataFrame(arrays(V)).set_index("t").to_parquet("x.parquet")
    assert read("x.parquet").t.tolist() == T.tolist()
    pd.DataFrame(arrays(V) | {"t": pd.to_timedelta(T, "s")}).to_parquet("x.parquet")
    with pytest.raises(StoreError, match="no array of times among t, q, v"):
        read("x.parquet")


LETTERS = {
    "digits": "1",
    "letters": "a",
    "blanks": " ",
    "tabs": "\t",
    "commas": ",",
    "semicolons": ";",
    "at": "@",
    "minus": "-",
    "dots": ".",
    "brackets": "[",
    "parentheses": "(",
    "quotes": '"',
    "hashes": "#",
    "equals": "t=",
    "blanks after at": " @",
    "underscores": "_",
    "exponents": "e",
    "names": "x1_",
    "words": "time ",
    "braces": "{",
    "thirds": "1,2;",
}
HEADS = {
    "x.csv": "",
    "y.csv": "t,q,v\n",
    "x.xvg": "@ s0 legend ",
    "x.dump": "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS id x y z vx vy vz\n",
    "x.xyz": "1\nt = 0\nA 1 0 0 1 0 0\n1\n",
    "x.json": '{"t": [0, 1], "',
    "x.log": "LAMMPS (",
    "x.gro": "Spring t= ",
    "x.txt": "# Created by Octave",
}


@pytest.mark.parametrize("letters", LETTERS.values(), ids=LETTERS)
def test_long_lines_take_no_more_time_than_their_length(letters: str) -> None:
    """A .gro title of `t=` 10,000 times took 11.5 s, an .xvg of 40,000 blanks after its @ for ever."""
    for name, head in HEADS.items():
        Path(name).write_text(f"{head}{letters * 100_000}\n0 1 2\n")
        began = time.process_time()
        with contextlib.suppress(StoreError):
            read(name, step=0.1)
        assert time.process_time() - began < 4, name


KNOWN = np.stack([T, Q, V], axis=1)


def rows(shape: str) -> str:
    return "".join(shape.format(*map(float, row)) + "\n" for row in KNOWN)


PEOPLE: dict[str, tuple[str, str, tuple[str, ...], float | None]] = {
    "labels beside numbers": ("x.log", rows("t={0!r} x={1!r} v={2!r}"), (), None),
    "labels with blanks": ("x.log", rows("t = {0!r}, x = {1!r}, v = {2!r}"), (), None),
    "rows as NumPy prints them": ("x.txt", rows("[ {0!r}  {1!r} {2!r}]"), (), None),
    "a row in brackets, with commas": ("x.txt", rows("[{0!r}, {1!r}, {2!r}]"), ("t", "q", "v"), None),
    "columns without names": ("x.csv", rows("{0!r},{1!r},{2!r}"), (), None),
    "a column left out": ("x.csv", rows("7.5,{0!r},{1!r},{2!r}"), ("-", "t", "q", "v"), None),
    "no times": ("x.csv", "x,v\n" + rows("{1!r},{2!r}"), (), 0.1),
    "split as pandas writes it": (
        "x.json",
        json.dumps({"columns": ["t", "x", "v"], "index": [*range(F)], "data": KNOWN.tolist()}),
        (),
        None,
    ),
    "German": (
        "x.csv",
        ";Zeit [s];Auslenkung [m];Geschwindigkeit [m/s]\n"
        + "".join(
            ";".join([str(i), *(repr(float(x)).replace(".", ",") for x in row)]) + "\n"
            for i, row in enumerate(KNOWN)
        ),
        (),
        None,
    ),
    "units behind a stroke": (
        "x.csv",
        "Zeit / s,Ort / m,v in m/s\n" + rows("{0!r},{1!r},{2!r}"),
        (),
        None,
    ),
    "Norwegian": ("x.csv", "tid (s),pos (m),fart (m/s)\n" + rows("{0!r},{1!r},{2!r}"), (), None),
    "French": ("x.csv", "Temps (s),Élongation (m),Vitesse (m/s)\n" + rows("{0!r},{1!r},{2!r}"), (), None),
    "angles": ("x.csv", "Time,Angle,Omega\n" + rows("{0!r},{1!r},{2!r}"), (), None),
    "a rate": ("x.csv", "t,theta,theta_dot\n" + rows("{0!r},{1!r},{2!r}"), (), None),
}


@pytest.mark.parametrize(("name", "text", "columns", "step"), PEOPLE.values(), ids=PEOPLE)
def test_a_file_as_people_have_it_is_read(
    name: str, text: str, columns: tuple[str, ...], step: float
) -> None:
    Path(name).write_text(text)
    found = read(name, *columns, step=step)
    assert found.t == pytest.approx(T, rel=1e-15)
    assert found.v is not None
    assert (found.q[:, 0].tolist(), found.v[:, 0].tolist()) == (Q.tolist(), V.tolist())
    bare = "=" not in text and text.lstrip("[ ")[0].isdigit() and not columns
    assert any("without names" in note for note in found.notes) is bare


@pytest.mark.parametrize("clock", [{"t": T}, {"dt": 0.1}])
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("of", [(Q, V), (Q, 1 - Q, V, -V)])
def test_positions_and_velocities_in_one_array_are_those_of_scipy(
    of: tuple[Any, ...], turned: bool, clock: dict[str, Any]
) -> None:
    y = np.stack(of, axis=int(turned))
    np.savez("x.npz", y=y, **clock)
    found = read("x.npz")
    n = len(of) // 2
    assert found.v is not None
    assert np.array_equal(np.hstack([found.q, found.v]).T, of)
    assert (found.q.shape[1], found.t[3]) == (n, pytest.approx(T[3]))
    assert any("y was taken as positions" in note for note in found.notes)
    # two coordinates, of which none is the rate of the other
    np.savez("x.npz", y=np.stack([Q, Q2]), t=T)
    assert read("x.npz").v is None


def test_a_table_that_pandas_stores_in_hdf5_is_read() -> None:
    with h5py.File("x.h5", "w") as file:
        file["run/axis0"] = file["run/block0_items"] = np.array([b"t", b"x", b"v"])
        file["run/axis1"], file["run/block0_values"] = np.arange(F), KNOWN
    found = read("x.h5")
    assert found.v is not None
    assert (found.t.tolist(), found.q[:, 0].tolist(), found.v[:, 0].tolist()) == (
        T.tolist(),
        Q.tolist(),
        V.tolist(),
    )


@pytest.mark.parametrize(
    ("names", "factors", "unit"),
    [
        ("time (ms),x (cm),v (cm/s)", (1e3, 1e2, 1e2), "cm/ms"),
        ("t [s],theta_deg,omega (deg/s)", (1, 180 / np.pi, 180 / np.pi), "rad/s"),
        ("t [s],x [m],v [m s-1]", (1, 1, 1), ""),
    ],
)
def test_velocities_are_turned_into_the_units_of_the_header(
    names: str, factors: tuple[float, ...], unit: str
) -> None:
    t, q, v = (x * y for x, y in zip((T, Q, V), factors, strict=True))
    Path("x.csv").write_text(table(t, q, v, head=names))
    found = read("x.csv")
    angle = factors[1] if "deg" in names else 1.0
    assert found.v is not None
    assert found.q[:, 0] == pytest.approx(q / angle)
    assert found.v[:, 0] == pytest.approx(V * (factors[1] / angle) / factors[0])
    assert any(unit in note for note in found.notes) is bool(unit)


@pytest.mark.parametrize(
    "head",
    [
        "t,energy",
        "t,E_tot",
        '#"Step","Time (ps)","Potential Energy (kJ/mole)","Kinetic Energy (kJ/mole)","Temperature (K)"',
    ],
)
def test_energies_alone_are_said_to_be_that(head: str) -> None:
    many = [np.arange(F), T, 1 + V, 2 + Q, Q][: head.count(",") + 1] if "Step" in head else [T, 2 + V]
    Path("x.csv").write_text(table(*many, head=head))
    with pytest.raises(StoreError, match=r"energies alone.*changes by .* of its size.*record positions"):
        read("x.csv")
    np.savez("x.npz", t=T, E_tot=np.stack([Q, V], axis=1))
    with pytest.raises(StoreError, match=r"energies alone.*E_tot changes by"):
        read("x.npz")


def test_coordinates_as_gromacs_writes_them_are_those_of_its_atoms() -> None:
    names = [f'@ s{i} legend "atom {1 + i // 3} {"XYZ"[i % 3]}"' for i in range(6)]
    columns = [T, *(Q + i for i in range(6))]
    Path("x.xvg").write_text(
        '@ xaxis label "Time (ps)"\n' + "\n".join(names) + "\n" + table(*columns, sep=" ")
    )
    found = read("x.xvg")
    assert found.q[0].tolist() == [Q[0] + i for i in range(6)]
    assert found.v is None


def test_a_count_that_does_not_fit_says_how_a_column_is_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    Path("x.csv").write_text(table(T, Q, V, V))
    with pytest.raises(StoreError, match=r"columns: 4, names: 3.*- leaves a column out"):
        read("x.csv", "t", "q", "v")
    Path("x.csv").write_text(table(7 * T, T, Q, V))
    main(["identify", "x.csv", "--columns", "-,t,q,v"])
    assert "step:" in capsys.readouterr().out


def test_formats_that_are_not_read_are_named() -> None:
    for name, text, said in (
        ("x.log", "LAMMPS (2 Aug 2023)\n", "log of LAMMPS"),
        ("x.gro", "Spring t= 0\n1\n", "a .gro file"),
        ("x.txt", "# Created by Octave 8\n", "text of Octave"),
        ("x.pdb", "REMARK   1 CREATED WITH OPENMM\n", "a PDB file"),
        ("x.dcd", "\x54\0\0\0CORD", "a DCD file"),
        ("x.nc", "CDF\x01", "NetCDF"),
    ):
        Path(name).write_text(text)
        with pytest.raises(StoreError, match=said):
            read(name)


def test_whole_numbers_of_four_hundred_digits_are_no_crash() -> None:
    digits = "9" * 400
    Path("x.json").write_text(f'{{"t": [0, 1, 2], "q": [1, {digits}, 3], "v": [1, 2, 3]}}')
    with pytest.raises(StoreError) as caught:
        read("x.json")
    assert "crash" not in str(caught.value)
    Path("x.json").write_text(f"[[0, 1, 2], [1, {digits}, 3]]")
    with pytest.raises(StoreError) as caught:
        read("x.json", "t", "q", "v")
    assert "crash" not in str(caught.value)
