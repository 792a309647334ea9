"""Keeping a library's own printing off the user's terminal and out of our results."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def caught(descriptor: int) -> Iterator[list[str]]:
    """Catch what C or C++ code prints to standard output (1) or error (2) while this context is open.

    The list that is handed out holds the text, as one string, once the context is left.  Where the
    descriptor is closed nothing is caught.
    """
    text: list[str] = []
    try:
        saved = os.dup(descriptor)
    except OSError:
        yield text
        return
    stream = sys.stdout if descriptor == 1 else sys.stderr
    if stream is not None:
        stream.flush()
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), descriptor)
        try:
            yield text
        finally:
            # what C++ has printed may still stand in the C library's buffer
            if os.name == "posix":
                ctypes.CDLL(None).fflush(None)
            os.dup2(saved, descriptor)
            os.close(saved)
            file.seek(0)
            text.append(file.read().decode(errors="replace").strip())
