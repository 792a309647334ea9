"""The kernels compiled by numba, cached next to them, and loaded only as they were written.

numba loads cached code without a check: a file cut short or zeroed ends in an exception of any kind, or kills
the process.  So a digest of every file is stored beside them, and what does not match is removed and compiled
again.  It covers the sources too, because numba watches the file of the kernel alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from springcheck.engines.own import kernels, loops

HELP: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
"""How numba compiles: division by zero gives inf instead of an exception, and there is no fastmath, which
would contract and reorder.  Nothing is allocated, so arrays need not be counted, which would take longer
than a step of a few hundred particles."""

HELPERS: tuple[Callable[..., Any], ...] = tuple(
    thing
    for thing in vars(loops).values()
    if inspect.isfunction(thing) and thing.__module__ == loops.__name__ and thing is not loops.others
)
"""The functions that the kernels call."""


@cache
def _registered() -> None:
    """Register the helpers with numba, which calls no other function."""
    from numba.extending import overload, register_jitable

    overload(loops.others, jit_options=HELP, strict=False)(
        lambda laws, q, f: loops.others if len(laws) else loops.none
    )
    for helper in HELPERS:
        register_jitable(**HELP)(helper)


def compiled(kernel: Callable[..., Any], arguments: tuple[Any, ...]) -> Callable[..., Any]:
    """A kernel compiled for arguments of these types, the last two of them arrays (f, n) of any layout.

    Raises:
        ImportError: numba is not here.
    """
    key = kernel, *map(_look, arguments)
    if key not in _COMPILED:
        import numba

        types = [numba.typeof(argument) for argument in arguments]
        # rows may be part of a wider array
        types[-2:] = (kind.copy(layout="A") for kind in types[-2:])
        try:
            _COMPILED[key] = _jit(kernel, tuple(types), saved=True)
        except Exception:
            # the cache cannot be read, or written: compile for this process alone
            _COMPILED[key] = _jit(kernel, tuple(types), saved=False)
    return _COMPILED[key]


_COMPILED: dict[tuple[Any, ...], Callable[..., Any]] = {}
"""Kernels by what their arguments look like: numba takes a millisecond to find and compare types."""


def _look(argument: Any) -> Any:
    """The properties of an argument on which its numba type depends."""
    if isinstance(argument, np.ndarray):
        flags = argument.flags
        layout = flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned
        return argument.dtype, argument.ndim, *layout
    return (type(argument), *map(_look, argument)) if isinstance(argument, tuple) else type(argument)


def _jit(kernel: Callable[..., Any], types: tuple[Any, ...], *, saved: bool) -> Callable[..., Any]:
    import numba

    _registered()
    found: Any = numba.njit(cache=saved, nogil=True, **HELP)(kernel)
    written = saved and not _unbroken(Path(found.stats.cache_path), kernel)
    found.compile(types)
    if written:
        _seal(Path(found.stats.cache_path), kernel)
    # other layouts of arrays are converted, never compiled for
    found.disable_compile()
    function: Callable[..., Any] = found
    return function


def _files(folder: Path, kernel: Callable[..., Any]) -> list[Path]:
    return sorted(folder.glob(f"{Path(inspect.getfile(kernel)).stem}.{kernel.__name__}-*.nb[ci]"))


def _digest(folder: Path, kernel: Callable[..., Any]) -> str:
    """Digest of the cached code of a kernel and of the sources that it was compiled from."""
    sources = [Path(__file__), *(Path(inspect.getfile(module)) for module in (loops, kernels))]
    sums = [(path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in _files(folder, kernel)]
    return repr([*sums, *(hashlib.sha256(path.read_bytes()).hexdigest() for path in sources)])


def _unbroken(folder: Path, kernel: Callable[..., Any]) -> bool:
    """Whether the cached code of a kernel is as it was written; removes it where it is not."""
    with contextlib.suppress(OSError):
        if (folder / f"{kernel.__name__}.seal").read_text() == _digest(folder, kernel):
            return True
    for path in _files(folder, kernel):
        path.unlink(missing_ok=True)
    return False


def _seal(folder: Path, kernel: Callable[..., Any]) -> None:
    """Store the digest of the cached code of a kernel; without it the next process compiles again."""
    with contextlib.suppress(OSError):
        path = folder / f"{kernel.__name__}.seal"
        draft = path.with_suffix(f".{os.getpid()}")
        draft.write_text(_digest(folder, kernel))
        draft.replace(path)
