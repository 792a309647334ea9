"""A study of any number of pieces is few tables in its store, and the store says who measured each piece."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springcheck import cli, store
from springcheck.errors import StoreError
from springcheck.store import access
from springcheck.store.parts import parts_folder
from springcheck.store.tables import Table
from springcheck.studies import keeper, provenance
from springcheck.studies.keeper import Piece
from springcheck.studies.tables import Rows


@dataclass(frozen=True, kw_only=True)
class Square:
    number: int
    name: str
    square: float


FORM: Rows[Square] = Rows(kind=Square, beginning="squares/", named="", units={"square": "nm"}, joined=True)


def squares(i: int) -> list[Square]:
    return [Square(number=j, name=f"{j} é", square=float(j * j)) for j in range(i, i + i % 3 + 1)]


def pieces(count: int) -> list[Piece]:
    return [
        Piece(key=f"own/{i:06d}", what="", measure=partial(squares, i), form=FORM, cost=i % 7)
        for i in range(count)
    ]


def rows(table: Table) -> list[tuple[Any, ...]]:
    return list(
        zip(*(np.asarray(table.columns[name]).tolist() for name in ("number", "square", "name")), strict=True)
    )


WANTED = [(x.number, x.square, x.name) for i in range(40) for x in squares(i)]


def test_more_pieces_than_a_store_may_have_tables_are_one_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(access, "MOST_MEMBERS", 30)
    path = tmp_path / "s.h5"
    with keeper.kept(path, "squares") as kept:
        done = kept.stream(list(reversed(pieces(40))))
        for _ in range(25):
            next(done)
    assert store.summary(path).tables == ("squares/own",)
    with keeper.kept(path, "squares") as kept:
        found = kept.results(pieces(40))
        assert kept.resumed >= 24
        assert [x for one in found for x in one] == [x for i in range(40) for x in squares(i)]
        kept.commit("squares", {})
    assert store.check(path) == []
    table = store.tables_of(path)["squares/own"]
    # in the order of the names of the pieces, whoever came first
    assert rows(table) == WANTED
    assert table.units == {"square": "nm"}
    assert not parts_folder(path).exists()


def test_pieces_of_other_columns_are_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with store.open_new(path, "squares") as journal:
        journal.add(Table(name="t/a/0", columns={"x": np.arange(3.0)}), rows=True)
        journal.add(Table(name="t/a/1", columns={"x": np.eye(3)}), rows=True)
        with pytest.raises(StoreError, match="other columns"):
            journal.commit()
        assert list(journal.tables()) == ["t/a/0", "t/a/1"]


def test_a_piece_that_is_damaged_before_the_commit_is_not_put_into_the_store(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with keeper.kept(path, "squares") as kept:
        kept.results(pieces(3))
        part = sorted(parts_folder(path).glob("rows-*"))[1]
        content = bytearray(part.read_bytes())
        at = content.index(np.float64(4.0).tobytes())
        content[at + 6] ^= 1
        part.write_bytes(content)
        with pytest.raises(StoreError, match=r"000001\.h5 is damaged"):
            kept.commit("squares", {})
    assert not path.exists()


def test_a_damaged_piece_alone_is_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    with keeper.kept(path, "squares") as kept:
        kept.results(pieces(5))
    part = sorted(parts_folder(path).glob("rows-*"))[2]
    content = bytearray(part.read_bytes())
    content[len(content) // 2] ^= 1
    part.write_bytes(content)
    with pytest.warns(store.StoreWarning, match="squares/own/000002 is measured again"):
        journal = store.open_new(path, "squares")
    with journal:
        kept = keeper.Keeper(journal)
        kept.results(pieces(5))
        assert kept.resumed == 4
        kept.commit("squares", {})
    assert rows(store.tables_of(path)["squares/own"]) == WANTED[: sum(i % 3 + 1 for i in range(5))]


def test_a_result_that_is_written_again_keeps_all_who_measured_it(tmp_path: Path) -> None:
    path = tmp_path / "s.h5"
    form: Rows[Square] = Rows(kind=Square, beginning="squares/", named="")
    for host in ("a", "b", "a"):
        with keeper.kept(path, "squares") as kept:
            kept.keep(form, "one", squares(1), {"host": host})
    with keeper.kept(path, "squares") as kept:
        kept.keep(form, "two", squares(2))
        kept.commit("squares", {})
    by = store.measured_by(path)
    assert [(piece, one["host"]) for piece, one in by[:2]] == [("squares/one", "a"), ("squares/one", "b")]
    assert by[2] == ("squares/two", dict(keeper.record()))
    assert {"host", "processor", "numpy", "openmm", "springcheck"} <= by[2][1].keys()
    assert len(by) == 3


def who(host: str, processor: str = "P", bits: str = "0") -> dict[str, str]:
    return {"host": host, "processor": processor, "bits of sums": bits}


def test_processors_that_differ_are_named_and_whether_their_bits_do() -> None:
    assert provenance.sentences([("a", who("x")), ("b", who("y"))]) == []
    (kinds, same) = provenance.sentences([("a", who("x")), ("b", who("y", "Q")), ("c", who("z"))])
    assert "2 kinds of processors: 2 on P (x, z); 1 on Q (y)" in kinds
    assert "agree bit for bit" in same
    (_, differ) = provenance.sentences([("a", who("x")), ("b", who("y", "P", "1")), ("c", who("z"))])
    assert "differ in a bit: sums round otherwise on y than on x, z" in differ


def test_report_inspect_and_page_say_who_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(keeper, "who", lambda path: [f"Measured on two kinds, says {Path(path).name}."])
    path = str(tmp_path / "limits.h5")
    assert cli.main(["stability", "spring", "--method", "own:euler", "-o", path]) == 0
    assert cli.main(["inspect", path]) == 0
    assert capsys.readouterr().out.count("Measured on two kinds, says limits.h5.") == 2
    assert cli.main(["report", path, "-o", str(tmp_path / "page.html")]) == 0
    assert "Measured on two kinds, says limits.h5." in (tmp_path / "page.html").read_text()
