"""Inputs broken at random: plug-ins, functions, commands, tables; scenes; words of a command line.

`campaign.py` gives them to springcheck, and says what must hold.
"""

from __future__ import annotations

import argparse
import random
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from springcheck import cli, engines
from springcheck.cli.commands import COMMANDS
from springcheck.physics import scenefile
from springcheck.studies import STUDIES

ROOT = Path(__file__).parent.parent
PLUGIN = (ROOT / "tests" / "plugin-example" / "springcheck_pefrl.py").read_text()
FUNCTION = """
def step(q, p, h, force, mass):
    p = p + h * force(q)
    q = q + h * p / mass
    return q, p
"""
TABLE = "t,q,p\n" + "".join(f"{0.1 * i!r},{0.3 + i / 7!r},{0.7 - i / 3!r}\n" for i in range(6))
DUMP = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS id x y z vx vy vz\n1 0.3 0 0 0.2 0 0\n"


def broken(text: str, rng: random.Random) -> str:
    """A text with some of its characters, words or lines lost, doubled, moved or made something else."""
    for _ in range(rng.randint(1, 3)):
        lines = text.splitlines()
        i, j = rng.randrange(len(text)), rng.randrange(len(lines))
        kind = rng.randrange(6)
        if kind == 0:
            text = text[:i] + text[i + rng.randint(1, 9) :]
        elif kind == 1:
            text = text[:i] + rng.choice("()[]{},:=\"'\\\n\t0x@;nan") + text[i:]
        elif kind == 2:
            text = "\n".join(lines[:j] + lines[j + 1 :]) + "\n"
        elif kind == 3:
            text = "\n".join(lines[:j] + [lines[j]] * 2 + lines[j + 1 :]) + "\n"
        elif kind == 4:
            text = text[: max(1, i)]
        else:
            words = text.split(" ")
            words[rng.randrange(len(words))] = rng.choice(
                ["None", "1e999", "-1", "import os", "[]", "'x'", "q"]
            )
            text = " ".join(words)
        text = text or "\n"
    return text


def plug_in(folder: Path, rng: random.Random) -> list[str]:
    """A plug-in's file."""
    (folder / "engine.py").write_text(broken(PLUGIN, rng))
    return ["run", "spring", "--engine", "engine.py", "--method", "own:euler", "--quiet", "-o", "x.h5"]


def function(folder: Path, rng: random.Random) -> list[str]:
    """A student's function."""
    (folder / "mine.py").write_text(broken(FUNCTION, rng))
    return ["run", "spring", "--stepper", "mine.py:step", "--method", "own:euler", "--quiet", "-o", "x.h5"]


def command(folder: Path, rng: random.Random) -> list[str]:
    """A program that writes a broken table."""
    (folder / "table").write_text(broken(TABLE, rng))
    text = "c=sh -c 'cp table $1' sh {out} {scene}"
    if rng.random() < 0.3:
        text = broken("c=cp table {out} {scene}", rng).strip()
    return [
        "run",
        "spring",
        "--command",
        text,
        "--method",
        "own:euler",
        "--quiet",
        "-o",
        "x.h5",
        "--timeout",
        "5",
    ]


def file(folder: Path, rng: random.Random) -> list[str]:
    """A table, a dump, or bytes."""
    kind = rng.randrange(3)
    path = folder / "x"
    if kind == 2:
        magic = rng.choice(
            [b"\x93NUMPY", b"PK\x03\x04", b"\x89HDF\r\n\x1a\n", b"- of Ulm", b"\x00\x00\x07\xc9", b""]
        )
        path.write_bytes(magic + rng.randbytes(rng.randint(0, 200)))
    else:
        path.write_text(broken(TABLE if kind else DUMP, rng))
    known = rng.choice([["identify", "x"], ["judge", "x", "--scene", "spring", "--scheme", "rk4"]])
    return [*known, *rng.choice([[], ["--columns", "t,q,v"], ["--step", "0.1"]])]


DOORS: tuple[Callable[[Path, random.Random], list[str]], ...] = (plug_in, function, command, file)

NUMBERS = (
    "0", "-0.0", "-1", "1", "2", "0.5", "1e-3", "1e9", "1e15", "1e-15", "1e150", "1e308", "-1e308",
    "1e-300", "5e-324",
    "nan", "inf", "-inf", "9007199254740993", "9223372036854775808", "1_0", "0x10", "true", '"x"', "[]",
    "[1.0]", "1e400",
    "2024-01-01", "{}", "100000", "1000000",
)  # fmt: skip
"""What a number of a scene may turn into."""

WORDS = (
    "colour = 3\n", "[[spring]]\n", "[[particle]]\nmass = 1.0\n", "[time]\n",
    "[methods]\ninclude = ['own:*']\n",
    'title = "\\u001b]0;owned\\u0007 \\u202e $\\\\frac{$"\n', "[record]\nevery = 7\n", '"\\u001b[2J" = 1\n',
    '[record]\nquantities = ["q"]\n', "[[damping]]\nrate = 0.1\n",
    "[chain]\nmasses = 3\nmass = 1.0\nstiffness = 1.0\n",
    "title = '" + "x" * 5000 + "'\n", "units = 'si'\n", "a = " + "[" * 200 + "\n", "ends = [0, 1]\n",
    "stiffness = -3.0\n",
)  # fmt: skip
"""Lines that a scene may get."""

METHODS = ("ase:velocity-verlet", "openmm:verlet@Reference", "sundials:adams")
STEPS = 200
"""Most steps of a changed scene."""


def scene_text(rng: random.Random) -> str:
    """A shipped scene, shortened, with numbers, words and lines changed."""
    path = rng.choice(sorted(scenefile.folder().glob("*.toml")))
    text = path.read_text(encoding="utf-8")
    text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith("#"))
    text = re.sub(r"steps = (\d+)", lambda found: f"steps = {min(STEPS, int(found[1]))}", text)
    text = text.replace("masses = 1000", "masses = 40").replace("mode = 400", "mode = 31")
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        how = rng.random()
        if how < 0.6:
            numbers = list(re.finditer(r"(?<![\w.])-?\d[\w.+-]*", text))
            if numbers:
                one = rng.choice(numbers)
                text = text[: one.start()] + rng.choice(NUMBERS) + text[one.end() :]
        elif how < 0.8:
            lines = text.splitlines(keepends=True)
            lines.insert(rng.randrange(len(lines) + 1), rng.choice(WORDS))
            text = "".join(lines)
        else:
            text = broken(text, rng)
    return text


def scene(folder: Path, rng: random.Random) -> list[list[str]]:
    """A scene, and the commands that it is given to."""
    (folder / "s.toml").write_text(scene_text(rng), encoding="utf-8")
    own = [f"own:{name}" for name in engines.load("own").methods]
    methods = [rng.choice(own), rng.choice(own if rng.random() < 0.8 else METHODS)]
    named = [word for method in methods for word in ("--method", method)]
    how = rng.random()
    if how < 0.04:
        return [["precision", "s.toml", *named, "--budget", "0.05"]]
    if how < 0.12:
        return [["stability", "s.toml", *named]]
    if how < 0.2:
        (folder / "x.csv").write_text(TABLE)
        return [["judge", "x.csv", "--scene", "s.toml", "--scheme", rng.choice(own).removeprefix("own:")]]
    more = rng.choice([[], [], [], ["--json"], ["--verdicts"], ["--steps", rng.choice(NUMBERS)]])
    more += ["--thorough"] if rng.random() < 0.02 else []
    return [["run", "s.toml", *named, *more], ["show", "s.toml"]]


VALUES = (
    "", "x", "-1", "0", "1", "3", "0.1", "1e-300", "1e300", "nan", "inf", "1e999", "9" * 5000, "ü" * 300,
    "\x1b]0;x\x07",
    "\u202e", "a\nb", "../x", "/", ".", "--", "-", "/nowhere/x", "{scene}", "x" * 5000, "\udcff", "=",
    "a=b", "[", "*", "%s",
)  # fmt: skip
"""What any option may be given."""

FITTING: dict[str, tuple[str, ...]] = {
    "scene": ("spring", "chain", "anharmonic", "pendulum", "s.toml", "none.toml", "sprin", "free"),
    "file": ("a.h5", "t.csv", "s.toml", "none.h5", "folder", "loop", "empty", "/dev/null"),
    "output": ("o.h5", "o.h5", "folder", "a.h5", "none/o.h5", "loop", "/dev/full", "s.toml", "."),
    "label": ("own:euler", "own:semi-implicit-euler", "own:eular"),
    "method": ("own:euler", "own:*", "own:rk4", "openmm:verlet", "*:verlet", "own:eular", "sundials:adams"),
    "engine": ("plugin.py", "mine.py", "none.py", "folder", "s.toml"),
    "stepper": ("mine.py:step", "mine:step", "mine.py:none", "os:getcwd", "none:none"),
    "program": ("c=cp t.csv {out} {scene}", "c=false {scene} {out}", "c=none {scene} {out}",
        "c=sleep 1 {scene} {out}"),
    "scheme": ("explicit-euler", "velocity-verlet", "rk4", "mine=rk4", "none", "c=explicit-euler"),
    "set": ("spring.0.stiffness=2", "particle.0.mass=1e-300", "time.steps=3", "spring.7.stiffness=2",
        "title=x"),
    "fault": ("wrong-stiffness", "noise", "noise=1e-3", "noise=x", "none"),
    "columns": ("t,q,p", "t=a,q=b,v=c", "t", "x,y,z", "t,t,t"),
    "word": ("step-defect", "explicit-euler", "openmm:verlet", "noise", "stepdefect"),
    "budget": ("0.2", "0"),
    "steps": ("3", "1000000000", "1000000000000000000"),
    "step": ("0.1", "1e9", "-0.1"),
    "workers": ("1", "2", "0", "4097"),
    "cluster": ("nowhere.json", "tcp://127.0.0.1:1", "tcp://"),
    "timeout": ("1", "0", "-1"),
}  # fmt: skip
"""What fits an option, by the name of its attribute; some does only nearly."""
FITTING |= {
    "source": FITTING["file"],
    "files": FITTING["file"],
    "trajectory": FITTING["label"],
    "integrator": FITTING["stepper"],
}


def given(folder: Path, store: bytes) -> None:
    """The files that a command line may name."""
    (folder / "a.h5").write_bytes(store)
    (folder / "t.csv").write_text(TABLE)
    (folder / "s.toml").write_text((scenefile.folder() / "spring.toml").read_text())
    (folder / "mine.py").write_text(FUNCTION)
    (folder / "plugin.py").write_text(PLUGIN)
    (folder / "empty").write_bytes(b"")
    (folder / "loop").symlink_to("loop")
    (folder / "folder").mkdir()


def command_line(rng: random.Random) -> list[str]:
    """A command with arguments and options, most of which fit; now and then one is lost or mistyped."""
    name = rng.choice([*(one.name for one in STUDIES), *(one.name for one in COMMANDS)])
    commands: Any = next(x.choices for x in cli._parser([name])._actions if isinstance(x.choices, dict))
    words = [name]

    def value(action: argparse.Action) -> str:
        return rng.choice(FITTING.get(action.dest, VALUES) if rng.random() < 0.8 else VALUES)

    actions = commands[name]._actions
    for action in actions:
        if (not action.option_strings or action.required) and rng.random() < 0.97:
            words += [*action.option_strings[-1:], value(action)]
    options = [action for action in actions if action.option_strings and not action.required]
    for action in rng.sample(options, min(len(options), rng.choice([0, 1, 1, 2, 3, 5]))):
        words += [rng.choice(action.option_strings), *([value(action)] if action.nargs != 0 else [])]
    if rng.random() < 0.1:
        i = rng.randrange(len(words))
        words[i : i + 1] = rng.choice([[], [words[i]] * 2, [words[i][:-1]], [rng.choice(VALUES)]])
    # no argument of a program holds a zero byte
    return [word.replace("\0", "") for word in words]
