"""Bad plug-ins, functions, commands and files, broken at random: each is answered in one clear line.

Claim: of 200 cases none ends in a traceback, and each that is refused says so in one line on standard error,
with exit status 2; a case that happens to be right runs (status 0 or 1).
Run:   python validation/doors_fuzz.py [CASES]        (about two minutes)
"""

import contextlib
import io
import random
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from arguments import arguments
from springcheck import engines
from springcheck.cli import main as springcheck

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
    line = rng.choice(["cp table {out}", "false {scene} {out}", "cat {scene} {out}", "cp {scene} {out}"])
    text = f"c={line}" if "{scene}" in line else f"c={line} {{scene}}"
    text = "c=sh -c 'cp table $1' sh {out} {scene}" if rng.random() < 0.7 else broken(text, rng).strip()
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


KINDS: tuple[Callable[[Path, random.Random], list[str]], ...] = (plug_in, function, command, file)


def one(number: int) -> str:
    """What is wrong with the answer to a case, or ""."""
    rng = random.Random(number)
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        words = KINDS[number % len(KINDS)](Path(name), rng)
        said, printed = io.StringIO(), io.StringIO()
        try:
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
                status = springcheck(words)
        except BaseException as error:
            return f"{' '.join(words)}: {type(error).__name__}: {error}"
        finally:
            engines.registry._brought.clear()
        lines = said.getvalue().splitlines()
        if status == 2 and len(lines) == 1 and lines[0].startswith("springcheck: "):
            return ""
        return (
            "" if status in (0, 1) else f"{' '.join(words)}: status {status}, {len(lines)} lines: {lines[:3]}"
        )


def main() -> int:
    """Run the cases; the exit status says whether the claim holds."""
    options = arguments(__doc__, cases=200)
    wrong = [(number, found) for number in range(options.cases) if (found := one(number))]
    for number, found in wrong:
        print(f"case {number}: {found}")
    print(f"{options.cases} cases, {len(wrong)} that are not answered in one line")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
