"""Keep a library's own printing off the user's terminal and out of our results."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any

_CAPTURING = threading.RLock()
"""Held while a stream is captured: of two threads each would put back what the other has put there."""


@contextmanager
def caught(descriptor: int) -> Iterator[list[str]]:
    """Capture what a library prints to standard output (1) or error (2) while this context is open.

    From C or C++ code, and from Python code that prints to another stream in its place, as in a notebook.
    The list that is handed out holds the text, as one string, once the context is left.  Where the descriptor
    is closed nothing is captured.
    """
    with _CAPTURING:
        text: list[str] = []
        try:
            saved = os.dup(descriptor)
        except OSError:
            yield text
            return
        stream = sys.stdout if descriptor == 1 else sys.stderr
        if stream is not None:
            stream.flush()
        redirected: Any = redirect_stdout if descriptor == 1 else redirect_stderr
        with tempfile.TemporaryFile() as file, StringIO() as printed:
            os.dup2(file.fileno(), descriptor)
            try:
                with redirected(printed):
                    yield text
            finally:
                # output of C++ code may still be in the C library's buffer
                if os.name == "posix":
                    ctypes.CDLL(None).fflush(None)
                os.dup2(saved, descriptor)
                os.close(saved)
                file.seek(0)
                text.append((printed.getvalue() + file.read().decode(errors="replace")).strip())
