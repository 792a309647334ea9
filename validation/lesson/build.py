"""Run the lesson and write what it prints and draws into the notebook and into its page, lesson.md.

    python validation/lesson/build.py            (about 10 s)
    python validation/lesson/build.py --check    # writes nothing: is what they show what the code says?
    python validation/lesson/build.py --take-along lesson.zip    # what learners are given, in one file

A cell is run as Jupyter runs it, in one namespace and in order; its output is what it prints and the figures
that it leaves.  No part of Jupyter is needed.
"""

import base64
import contextlib
import io
import json
import os
import sys
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
HANDOUTS = (
    "lesson.ipynb", "lesson.md", "ten-minutes.md", "figures/*.png", "exercises.py", "grade.py",
    "temperature.py", "temperature_questions.py",
)  # fmt: skip
"""What learners are given: no solutions."""
NOTEBOOK, PAGE, FIGURES = HERE / "lesson.ipynb", HERE / "lesson.md", HERE / "figures"


@dataclass
class Shown:
    """What a cell has shown."""

    text: str = ""
    figures: list[bytes] = field(default_factory=list)
    """PNG."""


def run(cells: list[dict[str, Any]], *, draw: bool = True) -> dict[str, Shown]:
    """What every code cell shows, by the cell's id; without `draw` its text alone."""
    os.environ.setdefault("MPLBACKEND", "agg")
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    known: dict[str, Any] = {"__name__": "__main__"}
    found = {}
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            # a cell of the project's own notebook
            exec(compile("".join(cell["source"]), f"{NOTEBOOK.name}, {cell['id']}", "exec"), known)
        shown = Shown(text=out.getvalue())
        for number in plt.get_fignums() if draw else ():
            png = io.BytesIO()
            plt.figure(number).savefig(png, dpi=80, metadata={"Software": None})
            shown.figures.append(png.getvalue())
        plt.close("all")
        found[cell["id"]] = shown
    return found


def outputs(shown: Shown, alt: list[str]) -> list[dict[str, Any]]:
    """As a notebook keeps them; `alt`: what each figure shows, in words."""
    out: list[dict[str, Any]] = []
    if shown.text:
        out.append({"name": "stdout", "output_type": "stream", "text": shown.text.splitlines(keepends=True)})
    for png, said in zip(shown.figures, alt, strict=True):
        picture = base64.b64encode(png).decode()
        data = {"image/png": picture, "text/plain": [said]}
        out.append({"data": data, "metadata": {}, "output_type": "display_data"})
    return out


def printed(cell: dict[str, Any]) -> str:
    """What a cell of the notebook says that it prints."""
    return "".join("".join(one["text"]) for one in cell.get("outputs", ()) if one["output_type"] == "stream")


def page(cells: list[dict[str, Any]]) -> str:
    """The notebook as Markdown, its figures as files beside it."""
    note = "<!-- written by build.py from lesson.ipynb -->"
    parts = [note]
    for cell in cells:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        if text := printed(cell).rstrip():
            parts.append(f"```text\n{text}\n```")
        pictures = [one for one in cell["outputs"] if one["output_type"] == "display_data"]
        # what each shows, in words, stands with the cell
        words = cell["metadata"]["alt"] if pictures else []
        parts += [f"![{said}](figures/{cell['id']}-{i}.png)" for i, said in enumerate(words)]
    return "\n\n".join(parts) + "\n"


def main(arguments: list[str]) -> int:
    """Write notebook, page and figures, or compare; the exit status says whether they agree."""
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    cells: list[dict[str, Any]] = notebook["cells"]
    if arguments[:1] == ["--take-along"] and len(arguments) == 2:
        with zipfile.ZipFile(arguments[1], "w", zipfile.ZIP_DEFLATED) as file:
            for path in (path for name in HANDOUTS for path in sorted(HERE.glob(name))):
                file.write(path, Path("lesson", path.relative_to(HERE)))
        print(f"{arguments[1]}: hand-outs, without solutions")
        return 0
    check = "--check" in arguments
    found = run(cells, draw=not check)
    if check:
        wrong = [
            cell["id"] for cell in cells if cell["id"] in found and printed(cell) != found[cell["id"]].text
        ]
        stale = PAGE.read_text(encoding="utf-8") != page(cells)
        print(
            "\n".join(
                [*(f"{name}: it prints something else now" for name in wrong), *(["lesson.md"] * stale)]
            )
        )
        return 1 if wrong or stale else 0
    FIGURES.mkdir(exist_ok=True)
    for i, cell in enumerate(cell for cell in cells if cell["cell_type"] == "code"):
        cell["execution_count"], cell["outputs"] = (
            i + 1,
            outputs(found[cell["id"]], cell["metadata"].get("alt", [])),
        )
        for j, png in enumerate(found[cell["id"]].figures):
            (FIGURES / f"{cell['id']}-{j}.png").write_bytes(png)
    NOTEBOOK.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    PAGE.write_text(page(cells), encoding="utf-8")
    print(f"{NOTEBOOK.name}, {PAGE.name} and {len(list(FIGURES.iterdir()))} figures")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
