"""The table of engines as CSV and as one page, to filter and sort, from the JSON documents of censuses.

Command: springcheck census --json > mine.json
         python validation/engines_table.py engines mine.json [OTHER.json ...]

writes engines.csv and engines.html; of a method that is in several documents the first one's row stands.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from arguments import arguments, script
from springcheck.errors import SpringcheckError, StoreError, plain
from springcheck.studies.census import table
from springcheck.studies.census.table import load

COLUMNS = {
    "method": "engine and attachment",
    "about": "what is called",
    "version": "version",
    **{name: table.WATCHED[name][0] for name in ("thermostat", "axes", "scheme")},
    "claimed": "declared or documented as",
    **{
        name: table.WATCHED[name][0]
        for name in ("velocity", "substeps", "friction", "det", "precision", "limit", "amplitude")
    },
    "configurational": "configurational temperature, k<x2>/kT",
    "kinetic": "kinetic temperature, m<v2>/kT",
    "forces": "forces a step",
    "note": "note",
    "command": "command that makes the row",
}

MARK = '<meta name="generator" content="springcheck census">'
"""In the first lines of every page: no other file is replaced."""

HEAD = ",".join(COLUMNS)
"""The first line of every CSV."""

MOST_BYTES = 500_000

STYLE = """
body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:110em;padding:0 1em}
body{color:#222;background:#fff}
table{border-collapse:collapse;font-size:13px}td,th{padding:.25em .6em;text-align:left;vertical-align:top}
th{position:sticky;top:0;background:#eee;cursor:pointer}tr:nth-child(even){background:#f7f7f7}
td:nth-child(n+4):nth-child(-n+7){min-width:11em}
td.wrong{color:#b00;font-weight:bold}code{font-size:12px}input{font:inherit;width:24em;padding:.3em}
@media(prefers-color-scheme:dark){body{color:#ddd;background:#181818}th{background:#333}
tr:nth-child(even){background:#222}a{color:#8bf}td.wrong{color:#f77}}
"""

SCRIPT = """
const body=document.querySelector('tbody'),rows=[...body.rows];
document.querySelector('input').oninput=e=>{const w=e.target.value.toLowerCase().split(/\\s+/);
for(const r of rows)r.hidden=!w.every(x=>r.textContent.toLowerCase().includes(x))};
document.querySelectorAll('th').forEach((th,i)=>{let up=1;th.onclick=()=>{
rows.sort((a,b)=>up*a.cells[i].textContent.localeCompare(b.cells[i].textContent,undefined,{numeric:true}));
up=-up;body.append(...rows)}});
for(const a of document.querySelectorAll('a[download]')){
const x=JSON.parse(document.getElementById(a.download).textContent);
a.href=URL.createObjectURL(new Blob([typeof x==='string'?x:JSON.stringify(x)]))}
"""


def rows(*documents: Mapping[str, Any]) -> list[dict[str, str]]:
    """One row for each entry of these documents, as text; of a method that is in several the first one's."""
    found: dict[str, dict[str, str]] = {}
    for document in documents:
        watched = table.rows(document)
        for x in document["entries"]:
            found.setdefault(x["method"], _row(x, watched[x["method"]]))
    return list(found.values())


def _row(x: Mapping[str, Any], watched: Mapping[str, str]) -> dict[str, str]:
    row = {
        **watched,
        "method": x["method"],
        "about": x.get("about", ""),
        "claimed": table.titles(x["claimed"]),
        "configurational": _share(x, "configurational"),
        "kinetic": _share(x, "kinetic"),
        "forces": f"{x['force_calls']:.3g}",
        "note": "; ".join(filter(None, (x.get("note", ""), "" if x["agrees"] else "DECLARED OTHERWISE"))),
        "command": x.get("command", f"springcheck census --method {x['method']}"),
    }
    return {name: row[name] for name in COLUMNS}


def _share(x: Mapping[str, Any], name: str) -> str:
    """A temperature of the bath's and its standard error."""
    value, error = x.get(name), x.get(f"{name}_error")
    return "-" if value is None else f"{value:.4f}" if error is None else f"{value:.4f} +- {error:.1g}"


def engine(row: Mapping[str, str]) -> str:
    """The engine of a row: of a program what its version names first."""
    name = row["method"].partition(":")[0]
    return row["version"].split(" ")[0].lower() if name == "command" else name


def as_csv(found: Sequence[Mapping[str, str]]) -> str:
    """The rows as CSV, whose cells no spreadsheet takes for a formula."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in found:
        cells = (plain(row[name]) for name in COLUMNS)
        writer.writerow([f"'{cell}" if cell[:1] in ("=", "@") else cell for cell in cells])
    return out.getvalue()


def html(found: Sequence[Mapping[str, str]], documents: Sequence[Mapping[str, Any]]) -> str:
    """The page: a table to filter and sort; CSV and JSON are in it."""
    known = set(map(engine, found))
    parts = {"csv": as_csv(found), "json": list(documents)}
    links = " ".join(f'<a download="engines.{name}">{name.upper()}</a>' for name in parts)
    kept = "\n".join(
        f'<script type="application/json" id="engines.{name}">'
        + json.dumps(part, separators=(",", ":")).replace("<", "\\u003c") + "</script>"
        for name, part in parts.items()
    )  # fmt: skip
    head = "".join(f"<th>{escape(title)}</th>" for title in COLUMNS.values())
    body = "\n".join("<tr>" + "".join(map(_cell, row, row.values())) + "</tr>" for row in found)
    left = sorted({f"{x['method']}: {x['reason']}" for one in documents for x in one.get("left_out", ())})
    rest = "".join(f"<li>{escape(plain(line, 300))}</li>" for line in left)
    page = f"""<!doctype html><html lang="en"><head><meta charset="utf-8">{MARK}
<meta name="viewport" content="width=device-width"><title>Which integrator does it really run?</title>
<style>{STYLE}</style></head><body>
<h1>Which integrator does it really run?</h1>
<p>{len(found)} ways to move a mass on a spring by {len(known)} engines.  No cell is an engine's word: each
but claim and note is read from the states of two springs, 200 steps of 0.1 (m = k = 1, and m = 3.7, k = 2.9);
of thermostats from those of springs at h omega = 0.5 and friction times step 0.4.
{links}</p>
<p><input placeholder="filter: rapier, implicit, single ..." aria-label="filter"></p>
<table><thead><tr>{head}</tr></thead><tbody>
{body}
</tbody></table>
{"<h2>Not in the table</h2><ul>" + rest + "</ul>" if rest else ""}
{kept}
<script>{SCRIPT}</script></body></html>
"""
    if len(page.encode()) > MOST_BYTES:
        raise SpringcheckError(f"the page would have {len(page.encode()):,} bytes, {MOST_BYTES:,} at most")
    return page


def _cell(name: str, text: str) -> str:
    shown = escape(plain(text))
    if name in ("method", "command"):
        shown = f"<code>{shown}</code>"
    return f'<td class="wrong">{shown}</td>' if "DECLARED" in text else f"<td>{shown}</td>"


def free(path: str | Path, beginning: str) -> None:
    """StoreError where there is a file that is no such table, or no folder to write it in."""
    place = Path(path)
    if place.is_dir() or not place.parent.is_dir():
        raise StoreError(
            f"{path}: {'it is a folder' if place.is_dir() else f'there is no folder {place.parent}'}"
        )
    if place.exists() and place.stat().st_size:
        with place.open("rb") as file:
            if beginning.encode() not in file.read(1024):
                raise StoreError(f"{path}: it is there and no such table; name another")


def main() -> int:
    """Write both; 2 where a file is no census, there is no row, or another file would be replaced."""
    given = arguments(__doc__, name="engines", files=list[str]())
    documents = [load(path) for path in given.files]
    found = rows(*documents)
    if not found:
        raise SpringcheckError("no rows: name JSON documents of `springcheck census --json`")
    texts = {f"{given.name}.csv": as_csv(found), f"{given.name}.html": html(found, documents)}
    for path, beginning in zip(texts, (HEAD, MARK), strict=True):
        free(path, beginning)
    for path, text in texts.items():
        Path(path).write_text(text, encoding="utf-8")
        print(path)
    return 0


if __name__ == "__main__":
    script(main)
