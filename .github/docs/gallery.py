"""The gallery: every shipped scene by a few own methods, drawn as `springcheck plot` does, as one page."""

import re
from pathlib import Path

import springcheck
from springcheck.errors import SpringcheckError
from springcheck.figures import render
from springcheck.figures.style import drawn, style
from springcheck.physics.scenefile import folder, names
from springcheck.studies.run import page

PARTS = ("Source:", "Teaches:", "Exact solution:", "Reference:")
METHODS = ("own:euler", "own:semi-implicit-euler", "own:velocity-verlet", "own:rk4", "own:implicit-midpoint")
IN_A_BATH = ("own:baoab", "own:obabo", "own:bussi")


def about(path: Path) -> str:
    """The comment at the top of a scene file as Markdown: a paragraph for each of its parts."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        text = re.sub(r"([*_<|\[])", r"\\\1", line.removeprefix("#").strip())
        lines.append(f"\n{text}" if text.startswith(PARTS) else text)
    return "\n".join(lines)


def draw(name: str) -> bytes:
    """The phase portrait of one scene, as PNG."""
    scene, runs = springcheck.load_scene(name), {}
    for label in IN_A_BATH if scene.bath else METHODS:
        try:
            runs[label] = springcheck.simulate(scene, label, seed=1 if scene.bath else None)
        except SpringcheckError:
            continue  # the method does not serve this scene
    with style():
        bank = page.of_runs(scene, runs, runs)[0]
        return drawn(render.picture(bank), bank.name)[f"{bank.name}.png"]


def write(into: Path) -> None:
    """Write `gallery.md` and its figures; figures that are there stay."""
    into.mkdir(parents=True, exist_ok=True)
    parts = [
        "# Gallery of scenes",
        "Each scene by a few own methods; `springcheck run NAME` runs all that can serve it.",
    ]
    for name in names():
        picture = into / f"{name}.png"
        if not picture.exists():
            picture.write_bytes(draw(name))
        title = springcheck.load_scene(name).title
        parts += [f"## {name}", about(folder() / f"{name}.toml"), f"![{title}]({picture.name})"]
    (into / "gallery.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
