"""The exceptions that springcheck raises on purpose; each message says what, where, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


class SpringcheckError(Exception):
    """Something a user can mend.  The command line prints the message alone and exits with 2."""


class SceneError(SpringcheckError):
    """A scene that cannot be read or makes no sense."""


class MethodError(SpringcheckError):
    """A method label that names nothing, or a method that cannot run here."""


class StoreError(SpringcheckError):
    """A file that cannot be read, written or trusted."""


class IdentificationError(SpringcheckError):
    """States from which no one-step map can be read: too few, at rest, or at uneven times."""


def told(error: BaseException, file: object = "") -> str:
    """An exception of code that is not ours as one line: its type, its message, and where it was raised.

    The place is the deepest line of `file` on the way to it, where there is one, else the deepest of all.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"SyntaxError: {error.msg} ({Path(error.filename).name}, line {error.lineno})"
    import traceback

    frames = list(traceback.extract_tb(error.__traceback__))
    inside = [frame for frame in frames if file and Path(frame.filename) == Path(str(file))]
    deepest = (inside or frames)[-1] if frames else None
    message = " ".join(str(error).split())
    if len(message) > LONGEST_MESSAGE:
        message = message[:LONGEST_MESSAGE] + " ..."
    where = f" ({Path(deepest.filename).name}, line {deepest.lineno})" if deepest is not None else ""
    return f"{type(error).__name__}{': ' if message else ''}{message}{where}"


LONGEST_MESSAGE = 500
"""Characters of a foreign message that are shown."""


def nearest(word: str, known: Iterable[str], before: str = "") -> str:
    """ ", did you mean ...?" where one of the known words is close, else nothing."""
    from difflib import get_close_matches

    close = get_close_matches(word, list(known), n=1)
    return f", did you mean {before}{close[0]}?" if close else ""
