"""A report as HTML: the template with autoescape, the data as JSON that cannot end its own script."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from springcheck.cli.page.content import Content
from springcheck.errors import StoreError, plain
from springcheck.figures import looks
from springcheck.figures.charts import REJECTED
from springcheck.physics.trajectory import Verdict
from springcheck.store import files
from springcheck.text.wording import ordinal

HERE = Path(__file__).parent
MARK = '<meta name="generator" content="springcheck report">'
"""In the first lines of every report: no other file is replaced."""
SCRIPTS = ("loops.js", "drawing.js", "charts.js", "page.js")
"""In the order in which they need one another."""
LOOPS = ("explicit-euler", "semi-implicit-euler", "velocity-verlet")
"""Schemes that the page itself carries out, whatever the store holds."""
JSON_WORDS = ("Infinity", "-Infinity", "NaN")
FEWEST_POOLED = 8
"""Numbers that are written where they stand."""
HEAD = 1024
"""Bytes in which the mark stands."""


def html(content: Content) -> str:
    """The page.  Scripts and styles run by their digest alone; nothing else is loaded from anywhere."""
    around = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        # what a file says is text without control characters
        finalize=lambda value: plain(value) if type(value) is str and not value.isprintable() else value,
    )
    around.filters |= {
        "short": "{:.3g}".format,
        "fraction": fraction,
        "ordinal": ordinal,
        "words": lambda text: str(text).strip(),
    }
    script = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS)
    style = (HERE / "page.css").read_text(encoding="utf-8")
    return around.get_template("page.html").render(
        content=content,
        scene=content.scene,
        # of the file alone, its lines kept
        scene_lines=[plain(line) for line in content.scene_text.splitlines()],
        mark=Markup(MARK),
        style=Markup(style),
        style_digest=_digest(style),
        script=Markup(script),
        script_digest=_digest(script),
        data=_json(pooled({**content.data, "looks": _looks(content.data)})),
    )


def write(content: Content, path: Path) -> int:
    """Write the page; returns its size [B].  StoreError where any other file stands there."""
    try:
        if path.is_dir():
            raise StoreError(f"{path} is a folder: a file's name is needed after -o")
        if path.is_symlink() or path.exists():
            with path.open("rb") as file:
                if MARK.encode() not in file.read(HEAD):
                    raise StoreError(
                        f"{path} is no report of ours: move it away, or name another file with -o"
                    )
        page = html(content).encode()
        path.parent.mkdir(parents=True, exist_ok=True)
        files.put_bytes(page, path)
    except OSError as error:
        raise StoreError(f"{path}: the report cannot be written: {error.strerror or error}") from error
    return len(page)


def _looks(data: Mapping[str, Any]) -> dict[str, tuple[str, str, int]]:
    """Of each scheme that is drawn: its colour on white and on black, and the number of its line."""
    curves = (
        curve for bank in data["banks"].values() for chart in bank["charts"] for curve in chart["curves"]
    )
    names = (*LOOPS, *(curve["group"] for curve in curves if curve["group"] != REJECTED))
    found = {name: looks.look(name) for name in names}
    shown = {
        name: (*looks.ON_SCREEN[look.color], looks.LINES.index(look.linestyle))
        for name, look in found.items()
    }
    return {**shown, "failed": looks.FAILED_ON_SCREEN}


def pooled(data: Any) -> list[Any]:
    """Every row once: [rows, data], where {"#": i} stands for the i-th row of numbers, {"$": i} of text."""
    rows: dict[str, int] = {}

    def put(x: Any) -> Any:
        if isinstance(x, Mapping):
            return {key: put(value) for key, value in x.items()}
        if not isinstance(x, list | tuple):
            return x
        if len(x) > FEWEST_POOLED and all(type(value) is float or value in JSON_WORDS for value in x):
            text = json.dumps(x)
            return {"#": rows.setdefault(text, len(rows))}
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
    """As a Content-Security-Policy names what may run."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def fraction(verdict: Verdict) -> str:
    """The value as a fraction of its bound; below 1 passes, and a bound of 0 admits 0 alone."""
    if verdict.passed is None:
        return "-"
    if verdict.bound == 0:
        return "exact" if verdict.value == 0 else "not exact"
    return f"{verdict.value / verdict.bound:.2g}"
