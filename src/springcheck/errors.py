"""The exceptions that springcheck raises on purpose; each message says what, where, and what to do."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from itertools import islice
from pathlib import Path

LONGEST_MESSAGE = 480
"""Characters of a message, which is one line: what a file says in it may be longer."""

LONGEST_WORD, MOST_WORDS, MOST_LIKELY = 100, 2000, 4
"""Characters of a word that may be mistyped, the words it is compared with, and the most that contain it."""

_STRANGE = ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp")
"""Unicode's controls, formats (which turn the direction of writing), surrogates, and ends of lines."""


def plain(text: object, longest: int | None = None) -> str:
    r"""Text from a file as it may be shown: on a terminal, in a figure, in a page, in a message.

    Control characters are written as escapes (``\x1b``); a text longer than `longest` characters keeps its
    beginning and its end.
    """
    shown = str(text)
    if longest is not None and len(shown) > 2 * longest:
        shown = shown[:longest] + shown[-longest:]
    if not shown.isprintable():
        shown = "".join(
            c.encode("unicode_escape").decode() if unicodedata.category(c) in _STRANGE else c for c in shown
        )
    if longest is not None and len(shown) > longest:
        half = longest // 2 - 2
        shown = f"{shown[:half]} .. {shown[-half:]}"
    return shown


class SpringcheckError(Exception):
    """An error that a user can correct.  The command line prints the message alone and exits with 2."""

    def __str__(self) -> str:
        return plain(super().__str__(), LONGEST_MESSAGE)


class SceneError(SpringcheckError):
    """A scene that cannot be read or makes no sense."""


class MethodError(SpringcheckError):
    """A method label that names nothing, or a method that cannot run here."""


class EngineError(MethodError):
    """An engine that is installed has failed: its code raised, or its library cannot be imported."""


class StoreError(SpringcheckError):
    """A file that cannot be read, written or trusted."""


class IdentificationError(SpringcheckError):
    """States from which no one-step map can be read: too few, at rest, or at uneven times."""


def told(error: BaseException, file: object = "") -> str:
    """An exception of foreign code in one line: its type, its message, and where it was raised.

    The place is the deepest line of `file` in its traceback, where there is one, else the deepest of all.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"SyntaxError: {error.msg} ({Path(error.filename).name}, line {error.lineno})"
    import traceback

    frames = list(traceback.extract_tb(error.__traceback__))
    inside = [frame for frame in frames if file and Path(frame.filename) == Path(str(file))]
    deepest = (inside or frames)[-1] if frames else None
    try:
        message = plain(" ".join(str(error).split()), LONGEST_MESSAGE)
    except BaseException:
        message = "its text cannot be made"
    where = f" ({Path(deepest.filename).name}, line {deepest.lineno})" if deepest is not None else ""
    return f"{type(error).__name__}{': ' if message else ''}{message}{where}"


def nearest(word: str, known: Iterable[str], before: str = "") -> str:
    """ ", did you mean ...?" where one of the known words is close, or a few contain it, else ""."""
    from difflib import get_close_matches

    # the time that a comparison takes grows with the square of the lengths
    short = (one for one in known if len(one) <= LONGEST_WORD)
    folded, given = {one.casefold(): one for one in islice(short, MOST_WORDS)}, word[:LONGEST_WORD].casefold()
    close = get_close_matches(given, folded, n=1) or [one for one in folded if given in one]
    likely = " or ".join(folded[one] for one in close)
    return f", did you mean {before}{likely}?" if given and 0 < len(close) <= MOST_LIKELY else ""


class StoreWarning(UserWarning):
    """A store is written or resumed all the same, but with a limitation."""

    def __str__(self) -> str:
        return plain(super().__str__(), LONGEST_MESSAGE)
