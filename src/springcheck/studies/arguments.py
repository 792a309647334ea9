"""Arguments that several commands take, and how they report progress."""

from __future__ import annotations

from argparse import Namespace
from typing import Any, Protocol

Argument = tuple[tuple[str, ...], dict[str, Any]]
"""An argument of a command: its names, and the keywords of argparse's `add_argument`."""


class Progress(Protocol):
    """Callback for progress: the amount done, the whole (pieces, steps or seconds), and what is next."""

    def __call__(self, done: float, whole: float, what: str = "") -> None: ...


def argument(*names: str, **how: Any) -> Argument:
    """An argument of a command."""
    return names, how


def repeatable(name: str, metavar: str, about: str, **more: Any) -> Argument:
    """An option that may be given more than once."""
    return argument(name, action="append", default=[], metavar=metavar, help=f"{about}; repeatable", **more)


JSON = argument("--json", action="store_true", help="one JSON document on standard output")
QUIET = argument("--quiet", action="store_true", help="print errors only")
FORCE = argument("--force", action="store_true", help="overwrite an existing store")
ENGINE = repeatable("--engine", "FILE.py", "an engine of your own, for this call")
SCENE = argument("scene", metavar="SCENE", help="a shipped scene's name, or the path of a scene file")
"""Arguments of many commands."""


def store_arguments(default: str = "SCENE.h5") -> tuple[Argument, ...]:
    """Arguments of every study that is saved in a store: its path, its methods, options of its runs."""
    return (
        argument("-o", "--output", metavar="FILE", help=f"the store (default: {default})"),
        repeatable("--method", "LABEL", "engine:method[@platform[-precision]] or a glob such as 'own:*'"),
        ENGINE,
        repeatable(
            "--stepper", "MODULE:FUNCTION",
            "your function step(q, p, h, force, mass) -> (q, p), also as FILE.py:FUNCTION",
        ),
        repeatable(
            "--command", "NAME=COMMAND", "a program in any language, as 'name=./engine {scene} {out}'",
            dest="program",
        ),
        repeatable(
            "--scheme", "SCHEME|NAME=SCHEME", "the scheme of your functions and programs, or of one of them"
        ),
        argument("--timeout", type=float, metavar="SECONDS", help="time limit for a program (default 600)"),
        FORCE,
        JSON,
        QUIET,
    )  # fmt: skip


REPORTING = ("run", "judge", "identify")
"""Commands that judge something, and take these options."""
REPORTS = (
    argument("--junit", metavar="FILE.xml", help="write a JUnit report, as every CI shows it"),
    argument(
        "--summary", metavar="FILE.md", help="append a summary in Markdown, as for $GITHUB_STEP_SUMMARY"
    ),
)
REPORT_FORMS = ("junit", "summary")


def reported(options: Namespace) -> bool:
    """Whether a command line asks for a JUnit report or a summary."""
    return any(getattr(options, name, None) is not None for name in REPORT_FORMS)
