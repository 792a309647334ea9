"""Ctrl-C and SIGTERM: one KeyboardInterrupt, and the end of the program in two seconds."""

import _thread
import os
import signal
import sys
import time
from contextlib import suppress

STATUS, GRACE = 130, 1.5  # exit status of an interrupted program; seconds until it ends, whatever it is doing
SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
_state = {"seen": "", "message": "interrupted", "errors": "2"}
_ends = set()  # type: ignore[var-annotated]
takes, forget = _ends.add, _ends.discard
"""`takes(end)`: call `end` where the process ends in the middle of something; `forget(end)` cancels it."""


def install() -> None:
    """Turn the first signal into a KeyboardInterrupt; ignore later ones; end the process in time."""
    sys.unraisablehook = lambda found: None if seen() else sys.__unraisablehook__(found)
    _state["errors"] = str(os.dup(2))
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup, or a shell's & have them
            signal.signal(number, _raise)
    if os.name == "posix":
        read, write = os.pipe()
        os.set_blocking(write, False)
        signal.set_wakeup_fd(write, warn_on_full_buffer=False)
        _thread.start_new_thread(_watch, (read,))


def _raise(number: int, frame: object) -> None:
    if not seen():
        _state["seen"] = "yes"
        raise KeyboardInterrupt


def _watch(wakeup: int) -> None:  # a thread works while native code has released the interpreter lock
    os.read(wakeup, 1)
    time.sleep(GRACE)
    leave()


def seen() -> bool:
    """Whether a signal has come: later findings of the program are no result."""
    return _state["seen"] == "yes"


def announce(message: str) -> None:
    """Set the line that an interrupt prints from here on."""
    _state["message"] = message


def leave() -> None:
    """End an interrupted process now, with one line and none from the interpreter's shutdown."""
    said, _state["message"] = f"springcheck: {_state['message']}\n" * bool(_state["message"]), ""
    for end in [*_ends, lambda: os.write(int(_state["errors"]), said.encode(errors="replace"))]:
        with suppress(Exception):
            end()
    os._exit(STATUS)
