"""A report as HTML: the template with autoescape, the data as JSON that cannot end its own script."""

from __future__ import annotations

import base64
import hashlib
import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from springcheck.cli.page.content import Content
from springcheck.errors import StoreError, plain
from springcheck.figures import looks
from springcheck.figures.charts import BEGIN, EXACTLY, GUIDE, REJECTED, SEPARATRIX
from springcheck.store import files
from springcheck.text.wording import count, ordinal

HERE = Path(__file__).parent
MARK = '<meta name="generator" content="springcheck report">'
"""In the first lines of every report: no other file is replaced."""
SCRIPTS = ("loops.js", "drawing.js", "charts.js", "page.js")
"""Scripts of the page, each after those that it needs."""
DASHES = ("", "7 4", "2 3", "9 3 2 3", "14 4", "9 3 2 3 2 3", "2 6")
"""Dashes in the order of `looks.LINES`."""
PLAIN_DASHES = {EXACTLY: "1 5", SEPARATRIX: "3 3", GUIDE: "", BEGIN: ""}
"""Dashes of lines that belong to no scheme."""
SHAPES = (
    "m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0",
    "m-3-3h6v6h-6z",
    "m0-4l4 7h-8z",
    "m0-4l4 4l-4 4l-4-4z",
    "m-3-3l6 6m0-6l-6 6",
)
"""Marks as paths, relative to their position."""
JSON_WORDS = ("Infinity", "-Infinity", "NaN")
FEWEST_POOLED = 8
"""Most numbers of a row that is written in place; a longer one is written once and referenced."""
MARK_BYTES = 1024
"""Bytes within which the mark is found."""


def html(content: Content) -> str:
    """The page.  Scripts and styles are admitted by their digests; nothing else is loaded from anywhere."""
    around = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        # text of a file is shown without control characters
        finalize=lambda value: plain(value) if type(value) is str and not value.isprintable() else value,
    )
    around.filters |= {
        "short": "{:.3g}".format,
        "ordinal": ordinal,
        "count": count,
        "words": lambda text: str(text).strip(),
    }
    script = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS)
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return around.get_template("page.html").render(
        content=content,
        scene=content.scene,
        # the text is the file's, and is freed of control characters line by line
        scene_lines=[plain(line) for line in content.scene_text.splitlines()],
        mark=Markup(MARK),
        style=Markup(style),
        style_digest=_digest(style),
        script=Markup(script),
        script_digest=_digest(script),
        data=_json(pooled(_with_looks(content.data))),
    )


def write(content: Content, path: Path) -> int:
    """Write the page; returns its size [B].  StoreError where any other file is there."""
    try:
        if path.is_dir():
            raise StoreError(f"{path} is a folder: a file's name is needed after -o")
        if path.is_symlink() or path.exists():
            with path.open("rb") as file:
                if MARK.encode() not in file.read(MARK_BYTES):
                    raise StoreError(
                        f"{path} is no report of ours: move it away, or name another file with -o"
                    )
        page = html(content).encode()
        path.parent.mkdir(parents=True, exist_ok=True)
        files.put_bytes(page, path)
    except OSError as error:
        why = files.cause(error, writing=True)
        raise StoreError(f"{path}: the report cannot be written: {why}") from error
    return len(page)


def _with_looks(data: Mapping[str, Any]) -> dict[str, Any]:
    """The data with a look for each curve: colours on white and on black, dash, mark.

    Curves of one name and scheme have one look; those of one scheme share a colour and alternate dashes.
    """
    order: dict[str, int] = {}

    def look(group: str, count: int) -> dict[str, Any]:
        if group in PLAIN_DASHES:
            soft = "var(--soft)"
            return {"colours": (soft, soft), "dash": PLAIN_DASHES[group], "mark": SHAPES[-1]}
        known, place = looks.look(group), order.setdefault(group, len(order)) + count
        line = looks.LINES.index(known.linestyle)
        colours = looks.FAILED_ON_SCREEN if group == REJECTED else looks.ON_SCREEN[known.color]
        dash, mark = DASHES[(line + count) % len(DASHES)], SHAPES[place % len(SHAPES)]
        return {"colours": colours, "dash": dash, "mark": mark}

    def seen(bank: Mapping[str, Any]) -> dict[str, Any]:
        counts: Counter[tuple[str, bool]] = Counter()
        found: dict[tuple[str, str], dict[str, Any]] = {}

        def with_look(curve: Mapping[str, Any]) -> dict[str, Any]:
            group = curve["group"]
            known = curve["name"], group
            if known not in found:
                # a theory's line and the marks on it share one look
                found[known] = look(group, counts[group, curve["line"]])
                counts[group, curve["line"]] += 1
            return {**curve, "look": found[known]}

        each = [{**chart, "curves": [with_look(x) for x in chart["curves"]]} for chart in bank["charts"]]
        return {**bank, "charts": each}

    live = data.get("live")
    banks = {name: seen(bank) for name, bank in data["banks"].items()}
    return {**data, "live": live and seen(live), "banks": banks}


def pooled(data: Any) -> list[Any]:
    """Every row once: [rows, data], where {"#": i} stands for the i-th row of numbers, {"$": i} of text.

    Looks are pooled too.  Numbers that JSON cannot represent occur in rows alone.
    """
    rows: dict[str, int] = {}

    def put(x: Any) -> Any:
        if isinstance(x, Mapping) and "colours" in x:
            return {"$": rows.setdefault(json.dumps(x), len(rows))}
        if isinstance(x, Mapping):
            return {key: put(value) for key, value in x.items()}
        if not isinstance(x, list | tuple):
            return x
        long = len(x) > FEWEST_POOLED or any(type(value) is str for value in x)
        if long and all(type(value) is float or value in JSON_WORDS for value in x):
            return {"#": rows.setdefault(json.dumps(x), len(rows))}
        if len(x) > FEWEST_POOLED and all(type(value) is str for value in x):
            return {"$": rows.setdefault(json.dumps(x), len(rows))}
        return [put(value) for value in x]

    found = put(data)
    return [[json.loads(text) for text in rows], found]


def _json(data: Any) -> Markup:
    """JSON inside HTML: no character of it can end the script or begin a tag."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


def _digest(text: str) -> str:
    """The digest by which a Content-Security-Policy allows a text to run."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
