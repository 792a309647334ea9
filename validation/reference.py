"""The reference pages in `validation/reference`, written from what the code knows: do they still say it?

One page for the checks (what holds, bound, faults that each must reject), one for the schemes (formula,
order, limit, source), one for the scenes, one for the functions of Python.  A test compares.

Run:   python validation/reference.py          (compares: 0 of 4 pages differ)
       python validation/reference.py write
"""

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path

import springcheck
from arguments import arguments, script
from springcheck import checks, schemes
from springcheck.cli import explain
from springcheck.physics import scenefile

FOLDER = Path(__file__).parent / "reference"
MADE = "<!-- python validation/reference.py write -->"


def of_checks() -> Iterator[str]:
    """A section for each check."""
    yield "# Checks\n\nWhat `springcheck explain NAME` says of each, but for what it measures.\n"
    for check in dict.fromkeys((*checks.ALL, *checks.RANDOM)):
        yield f"## {check.name}\n\n```\n{_text(explain.check_lines(check))}\n```\n"


def of_schemes() -> Iterator[str]:
    """A section for each scheme."""
    yield "# Schemes\n\nStages in their order, h the step; limits are those of a spring.\n"
    for name, scheme in schemes.SCHEMES.items():
        if not scheme.unnamed:
            yield f"## {name}\n\n```\n{_text(explain.scheme_lines(scheme))}\n```\n"


def of_scenes() -> Iterator[str]:
    """A row for each shipped scene."""
    yield "# Scenes\n\n`springcheck show NAME` prints one to start from.\n"
    yield "| scene | what it is | size | steps | units |\n|---|---|---|---|---|"
    for name in scenefile.names():
        scene = scenefile.load_scene(name)
        terms = ", ".join(f"{len(term)} {term.key}" for term in scene.terms) or "free"
        steps = f"{scene.steps} of {scene.step:g}"
        title = " ".join(scene.title.split())
        yield f"| `{name}` | {title} | {scene.n} coordinates, {terms} | {steps} | {scene.units} |"
    yield ""


def of_python() -> Iterator[str]:
    """A section for each public function and class."""
    yield "# Python\n\nEvery name of `import springcheck`, as `help` shows it.\n"
    for name in springcheck.__all__:
        found = getattr(springcheck, name)
        if callable(found):
            signature = inspect.signature(found) if inspect.isfunction(found) else "(...)"
            yield f"## {name}\n\n```python\n{name}{signature}\n```\n\n{inspect.getdoc(found)}\n"


def _text(lines: Iterator[str]) -> str:
    return "\n".join(line.rstrip() for line in lines)


PAGES: dict[str, Callable[[], Iterator[str]]] = {
    "checks.md": of_checks,
    "schemes.md": of_schemes,
    "scenes.md": of_scenes,
    "python.md": of_python,
}


def page(name: str) -> str:
    """The text of a page."""
    return f"{MADE}\n" + "\n".join(PAGES[name]()).rstrip() + "\n"


def main() -> int:
    """Compare, or write."""
    given = arguments(__doc__, what=("compare", "write"))
    texts = {name: page(name) for name in PAGES}
    files = {name: FOLDER / name for name in PAGES}
    differ = [
        name for name, file in files.items()
        if not file.is_file() or file.read_text(encoding="utf-8") != texts[name]
    ]  # fmt: skip
    if given.what == "write":
        for name in differ:
            files[name].write_text(texts[name], encoding="utf-8")
    done = "written anew" if given.what == "write" else "differ"
    print(f"{len(differ)} of {len(PAGES)} pages {done} {' '.join(differ)}".rstrip())
    return int(bool(differ) and given.what == "compare")


if __name__ == "__main__":
    script(main)
