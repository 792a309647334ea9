"""How a kernel is called: on all particles, or on some after others, in one thread or in several.

Particles that nothing joins are carried through all steps a few at a time, so that they stay in the
first-level cache.  A long chain is cut into tiles that stay in the second-level cache for some steps: each
starts from a copy with so many neighbours on both sides that what is wrong at its ends, where they lack
theirs, does not reach the particles that are kept (overlapped tiling: Krishnamoorthy et al., PLDI 2007).
Neither changes any number, so tiles may be worked on by several threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from springcheck.engines.own import layout
from springcheck.physics.arrays import Floats

WIDTH = 4096
"""Particles of a tile: 6 rows of 32 KiB stay in the second-level cache."""

NARROW, MANY_STEPS = 1024, 32
"""Particles of a tile of uncoupled particles that takes at least this many steps at a time: 5 rows of 8 KiB
stay in the first-level cache."""

MARGIN = 64
"""Particles that a tile of a chain gets on each side: it goes alone until its ends' error comes as far."""

PARALLEL = 2_000_000
"""Particle-steps of one call from which threads pay: 1 to 2 ms, where starting them takes 0.1 ms."""

LANES = 8
"""Numbers in a cache line of 64 bytes, and in the widest vector."""

STAGGER = 9 * LANES
"""Numbers left free between two rows: the processor takes a load to depend on a recent store to the same
place in another page of 4 KiB."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """A kernel and what it works on.  `head` stands before the masses, and `work` counts spring-steps."""

    kernel: Callable[..., Any]
    head: tuple[Any, ...]
    state: tuple[Floats, Floats]
    n: int
    work: float
    m: Floats | None = None
    """Masses (n,); None for the kernels of a single particle."""
    stages: int = 0
    """Stages of a tableau, 0 where there is none."""
    reach: int = 0
    """Neighbours over which a step of joined particles reaches; 0 where all must advance together."""
    joined: bool = False
    """Whether neighbours are joined."""

    def arguments(self, head: tuple[Any, ...], m: Floats, q: Floats, p: Floats, skip: int) -> tuple[Any, ...]:
        """All of the kernel's arguments but `every` and the rows to fill, with work arrays of their own."""
        s, n = self.stages, len(m)
        v, f, stage = np.zeros((s, n)), np.zeros((max(s, 2), n)), np.zeros((2, n if s else 0))
        return *head, m, (v, f, stage, np.zeros(n + 1), np.ones(2, bool)), q, p, skip

    @property
    def whole(self) -> tuple[Any, ...]:
        """The arguments for all particles."""
        if self.m is None:
            return *self.head, *self.state
        return self.arguments(self.head, self.m, *self.state, 0)


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def compiled(job: Job) -> Job:
    """The job with its kernel compiled.  Raises ImportError without numba."""
    from springcheck.engines.own.compiled import compiled as compile_for

    none = np.empty((0, job.n))
    return replace(job, kernel=compile_for(job.kernel, (1, *job.whole, none, none)))


class Whole:
    """All particles in one call, interpreted or compiled."""

    def __init__(self, job: Job, *, compiled: bool) -> None:
        self._kernel = job.kernel
        self._arguments = job.whole if compiled else as_lists(job.whole)

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n)."""
        self._kernel(every, *self._arguments, q, p)


class Tiled:
    """A row of particles cut into tiles."""

    def __init__(self, job: Job, threads: int) -> None:
        assert job.m is not None
        self._job, self._threads = job, threads
        given, rows = (job.head, job.m, job.state), list[Floats]()
        mapped(given, lambda x: rows.append(x) if is_row(x) and len(x) >= job.n - 1 else None)
        apart = dict(zip(map(id, rows), staggered(rows), strict=True))
        self._head, self._m, (self._q, self._p) = mapped(given, lambda x: apart.get(id(x), x))
        self._width, self._tiles = 0, list[tuple[int, int, int, tuple[Any, ...]]]()

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n)."""
        steps = every * len(q)
        if not self._job.joined:
            self._each(self._alone, NARROW if steps >= MANY_STEPS else WIDTH, 0, every, q, p, steps)
            return
        most = max(1, MARGIN // self._job.reach)
        if self._job.n < 2 * WIDTH or steps < 4:
            self._each(self._alone, self._job.n, 0, every, q, p, 0)
            return
        if every <= most:
            rows = most // every
            for first in range(0, len(q), rows):
                self._together(every, q[first : first + rows], p[first : first + rows])
            return
        spare = np.empty((2, 1, self._job.n))
        for row in range(len(q)):
            left = every
            while left > most:
                self._together(most, *spare)
                left -= most
            self._together(left, q[row : row + 1], p[row : row + 1])

    def _together(self, every: int, q: Floats, p: Floats) -> None:
        self._each(self._with_margin, WIDTH, MARGIN + self._job.reach, every, q, p, every * len(q))
        self._q[:], self._p[:] = q[-1], p[-1]

    def _each(
        self, go: Callable[..., None], width: int, margin: int, every: int, q: Floats, p: Floats, steps: int
    ) -> None:
        tiles = self._cut(width, margin)
        if self._threads > 1 and len(tiles) > 1 and steps * self._job.n >= PARALLEL:
            from concurrent.futures import ThreadPoolExecutor

            with ThreadPoolExecutor(min(self._threads, len(tiles))) as pool:
                list(pool.map(lambda tile: go(tile, every, q, p), tiles))
        else:
            for tile in tiles:
                go(tile, every, q, p)

    def _alone(self, tile: Any, every: int, q: Floats, p: Floats) -> None:
        lo, _, hi, arguments = tile
        self._job.kernel(every, *arguments, q[:, lo:hi], p[:, lo:hi])

    def _with_margin(self, tile: Any, every: int, q: Floats, p: Floats) -> None:
        lo, before, hi, (head, m) = tile
        mine = slice(lo - before, lo - before + len(m))
        local_q, local_p = staggered((self._q[mine], self._p[mine]))
        arguments = self._job.arguments(head, m, local_q, local_p, before)
        self._job.kernel(every, *arguments, q[:, lo:hi], p[:, lo:hi])

    def _cut(self, width: int, margin: int) -> list[tuple[int, int, int, tuple[Any, ...]]]:
        """Tiles: the particles lo to hi that are kept, how many stand before them, and the arguments.

        The last cut alone is kept: its tiles hold the forces of their last step, which are those of the state
        only as long as no other cut moves it.
        """
        if width != self._width:
            n = self._job.n
            count = -(-n // width)
            edge = -(-n // (count * LANES)) * LANES if count > 1 else n
            found = []
            for lo in range(0, n, edge):
                hi = min(lo + edge, n)
                begin, end = max(0, lo - margin), min(n, hi + margin)
                head, m = cut(self._head, begin, end), self._m[begin:end]
                inner: tuple[Any, ...] = (head, m)
                if not margin:
                    inner = self._job.arguments(head, m, self._q[lo:hi], self._p[lo:hi], 0)
                found.append((lo, lo - begin, hi, inner))
            self._width, self._tiles = width, found
        return self._tiles


def cut(head: tuple[Any, ...], lo: int, hi: int) -> tuple[Any, ...]:
    """The part of a kernel's constants that belongs to the particles lo to hi."""
    (*steps, decays, a), one, two, (divisors, *rest) = head
    slots = layout.cut(one, lo, hi), layout.cut(two, lo, hi)
    return (*steps, np.ascontiguousarray(decays[:, lo:hi]), a), *slots, (divisors[lo:hi], *rest)


def staggered(rows: Any) -> list[Floats]:
    """Copies of rows that begin on a cache line each, and no two of them at the same place within a page.

    A vector that lies across two cache lines takes up to three times as long.
    """
    longest = -(-max(len(row) for row in rows) // LANES) * LANES
    # a multiple of a page, and then one step on
    room = -(-longest // 512) * 512 + STAGGER
    memory = np.empty(len(rows) * room + LANES)
    begin = -(memory.ctypes.data // memory.itemsize) % LANES
    out = []
    for row in rows:
        out.append(memory[begin : begin + len(row)])
        out[-1][:] = row
        begin += room
    return out


def mapped(value: Any, change: Callable[[Any], Any]) -> Any:
    """Tuples within tuples, each part that is none of them changed."""
    return tuple(mapped(x, change) for x in value) if isinstance(value, tuple) else change(value)


def as_lists(value: Any) -> Any:
    """Arrays within tuples as lists."""
    return mapped(value, lambda x: x.tolist() if isinstance(x, np.ndarray) else x)


def is_row(value: Any) -> bool:
    """Whether it is a one-dimensional array of floats."""
    return isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype == np.float64
