"""What a library may change for the whole process, put back after each call into it."""

from __future__ import annotations

import contextlib
import ctypes
import ctypes.util
import locale
import os
import signal
import threading
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

from springcheck import interrupts

FENV_BYTES = 64
"""More than a floating-point environment takes on any platform: 32 bytes on x86-64, 8 on ARM."""


@contextlib.contextmanager
def restored() -> Iterator[None]:
    """Restore rounding mode, floating-point flags, NumPy's error handling, working directory, locale and
    the handlers of signals on leaving."""
    undo = [undoing for undoing in map(_kept, (_arithmetic, _folder, _locale, _signals)) if undoing]
    try:
        with np.errstate():
            yield
    finally:
        for one in undo:
            one()


def _kept(of: Callable[[], Callable[[], Any]]) -> Callable[[], Any] | None:
    """What restores one of them; None where this platform does not tell its state."""
    try:
        return of()
    except (OSError, AttributeError, ValueError, locale.Error):
        return None


@cache
def _library() -> Any:
    """The C library of numbers, which holds the floating-point environment of a thread."""
    return ctypes.CDLL(ctypes.util.find_library("m"))


def _arithmetic() -> Callable[[], Any]:
    library, state = _library(), ctypes.create_string_buffer(FENV_BYTES)
    library.fegetenv(state)
    return lambda: library.fesetenv(state)


def _folder() -> Callable[[], Any]:
    before = os.getcwd()

    def restore() -> None:
        # a folder that is gone cannot be returned to
        with contextlib.suppress(OSError):
            if os.getcwd() != before:
                os.chdir(before)

    return restore


def _locale() -> Callable[[], Any]:
    before = locale.setlocale(locale.LC_ALL)
    return lambda: locale.setlocale(locale.LC_ALL) == before or locale.setlocale(locale.LC_ALL, before)


def _signals() -> Callable[[], Any]:
    # only the main thread may set handlers, and None stands for one that Python has not set
    here = threading.current_thread() is threading.main_thread()
    before = {number: signal.getsignal(number) for number in interrupts.SIGNALS if here}
    known = {number: handler for number, handler in before.items() if handler is not None}

    def restore() -> None:
        for number, handler in known.items():
            if signal.getsignal(number) is not handler:
                signal.signal(number, handler)

    return restore
