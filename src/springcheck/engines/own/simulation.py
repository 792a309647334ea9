"""springcheck's own methods, interpreted where a run is short and compiled where it is long.

numba is imported only for a run that is worth it (see `WORTH`).  The numbers are the same either way,
to the last bit, so a machine without numba, or with a cache folder that cannot be written, gets them too.
"""

from __future__ import annotations

import importlib.metadata
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from types import FunctionType
from typing import Any, cast

import numpy as np

from springcheck.arrays import Floats
from springcheck.engines.contract import Arithmetic, Label, Method
from springcheck.engines.own import kernels
from springcheck.errors import MethodError
from springcheck.physics import terms
from springcheck.physics.scene import Scene
from springcheck.physics.terms import Term, WallSpring

WORTH = 1_000_000
"""Spring-steps from which compiling pays.  Interpreted, one takes 0.1 us, recorded 0.3 us; importing numba
takes 0.15 s, loading saved code 5 ms, compiling it the first time 0.2 to 0.8 s."""

DENSE = 2000
"""Particles that implicit Euler accepts unless they form a chain: its matrix fills 8 n**2 bytes, 32 MB."""

LANES = 8
"""Numbers in a cache line of 64 bytes, and in the widest vector."""

STAGGER = 9 * LANES
"""Numbers left free between two rows of `many`; see `_blocks`."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """A kernel and what it works on: floats, arrays, and tuples of them; `work` spring-steps a step."""

    kernel: kernels.Kernel
    keys: frozenset[str]
    """Terms that the kernel evaluates one by one."""
    n: int
    constants: tuple[Any, ...]
    q: Any
    p: Any
    work: float


class Own:
    """A started run of an own method.  `compiled` says which way it goes."""

    def __init__(self, layout: Layout, h: float, kernel: kernels.Kernel, *, compiled: bool) -> None:
        self.force_calls = 0
        self.compiled = compiled
        self._h = h
        self._kernel = kernel
        keep = _identity if compiled else _as_lists
        self._constants = keep(layout.constants)
        self._state = keep((layout.q, layout.p))

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        """Fill q and p (f, n), one force evaluation a step; overflow fills in inf and nan, silently."""
        qs, ps = np.ascontiguousarray(q), np.ascontiguousarray(p)
        self._state = self._kernel(every, self._h, *self._constants, *self._state, qs, ps)
        if qs is not q:
            q[...] = qs
        if ps is not p:
            p[...] = ps
        self.force_calls += every * len(q)


def version() -> dict[str, str]:
    """Of this package, the interpreter and NumPy, and of numba where it has compiled something."""
    found = {
        "springcheck": _installed("springcheck"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": _installed("numba") if "numba" in sys.modules else "",
    }
    return {name: text for name, text in found.items() if text}


def start(scene: Scene, method: Method, label: Label, step: float) -> Own:
    """Start a run of `scene.steps` steps of length `step`; compiles here where that pays."""
    return prepare(scene, method.name, step)


def arithmetic(label: Label) -> Arithmetic:
    """IEEE double precision throughout."""
    return Arithmetic()


def convention(method: Method) -> str:
    """Of the momenta."""
    return "positions and momenta belong to the same time"


def prepare(scene: Scene, method: str, step: float, *, compiled: bool | None = None) -> Own:
    """Like `start`; `compiled` forces the kernel either way, left out the length of the run decides.

    Forced, a missing numba is an ImportError; left out, the interpreted kernel serves.
    """
    h = float(step)
    with np.errstate(all="ignore"):
        layout = _layout(scene, method, h)
    if compiled is None:
        kernel = _try_to_compile(layout, h) if layout.work * scene.steps >= WORTH else None
    else:
        kernel = _compile(layout, h) if compiled else None
    return Own(layout, h, kernel or _interpreted(layout), compiled=kernel is not None)


def _layout(scene: Scene, method: str, h: float) -> Layout:
    m, q, p = (np.array(x, dtype=np.float64) for x in (scene.m, scene.q, scene.p))
    implicit = method == "implicit-euler"
    # friction is part of what implicit Euler solves for: 1 + h c/m stands where 1 does without it
    slowed = 1 + h * scene.system.friction_rates.astype(np.float64)
    if implicit:
        scene = scene.derived(terms=tuple(t for t in scene.terms if t.is_potential))
    walls = _single_walls(scene)
    if walls is not None:
        k, at = walls
        inverse = (1 / (slowed + h * (h * (k / m))),) if implicit else ()
        if scene.n == 1 and at[0] == 0:
            constants = tuple(float(x[0]) for x in (m, k, *inverse))
            return Layout(
                kernel=kernels.ONE[method],
                keys=frozenset(),
                n=1,
                constants=constants,
                q=float(q[0]),
                p=float(p[0]),
                work=1,
            )
        q, p, *rows = _blocks((q, p, m, k, at, *inverse))
        return Layout(
            kernel=kernels.MANY[method],
            keys=frozenset(),
            n=scene.n,
            constants=tuple(rows),
            q=q,
            p=p,
            work=scene.n,
        )
    keys = frozenset(term.key for term in scene.terms)
    # the types of absent terms differ from those of empty ones: numba tells saved kernels apart by types
    tables = tuple(_rows(scene, key) if key in keys else () for key in kernels.LAWS)
    kernel = kernels.JOINED[method]
    solver: tuple[Floats, ...] = ()
    work = float(scene.n + sum(len(row[0]) for row in tables if row))
    if implicit and _is_chain(scene):
        kernel, solver = kernels.CHAIN[method], _factors(scene, h, slowed)
        work += scene.n
    elif implicit:
        solver = (_inverse(scene, h, slowed),)
        # one product and sum of the matrix costs about an eighth of a spring
        work += scene.n**2 / 8
    return Layout(
        kernel=kernel,
        keys=keys,
        n=scene.n,
        constants=(m, tables, np.zeros(scene.n), *solver),
        q=q,
        p=p,
        work=work,
    )


def _single_walls(scene: Scene) -> tuple[Floats, Floats] | None:
    """Stiffness and rest point of every particle (n,), where each has at most one wall spring and no more."""
    k, at, count = np.zeros(scene.n), np.zeros(scene.n), np.zeros(scene.n, dtype=np.int64)
    for term in scene.terms:
        if not isinstance(term, WallSpring):
            return None
        np.add.at(count, term.i, 1)
        k[term.i], at[term.i] = term.k, term.at
    return (k, at) if np.all(count <= 1) else None


def _blocks(rows: Sequence[Floats]) -> list[Floats]:
    """Rows (n,) cut into (blocks, width), the last block filled up with copies of the last particle.

    Every block begins on a cache line: a vector that lies across two of them takes up to three times as
    long.  And no two rows begin at the same place within a page of 4 KiB, because the processor takes a
    load for dependent on a recent store to that place in another page.
    """
    n = len(rows[0])
    count = -(-n // kernels.BLOCK)
    width = n if count == 1 else -(-n // (count * LANES)) * LANES
    room = -(-count * width // LANES) * LANES + STAGGER
    memory = np.empty(len(rows) * room + LANES)
    begin = -(memory.ctypes.data // memory.itemsize) % LANES
    out = []
    for row in rows:
        cut = memory[begin : begin + count * width]
        cut[:n], cut[n:] = row, row[-1]
        out.append(cut.reshape(count, width))
        begin += room
    return out


def _rows(scene: Scene, key: str) -> tuple[Any, ...]:
    """Indices and parameters of all terms of one kind, each (s,); s is 0 where the scene has none.

    In the order of the term's columns, as its loop in `kernels` takes them; friction also takes the masses.
    """
    kind = terms.known()[key]
    found = [term for term in scene.terms if term.key == key]
    ends = [np.concatenate([np.empty(0, np.int64), *(x)]) for x in _together(kind.ends, found)]
    columns = [column.field for column in kind.columns]
    rows = [np.concatenate([np.empty(0), *(x)]) for x in _together(columns, found)]
    return (*ends, *rows, scene.m[ends[0]]) if key == "damping" else (*ends, *rows)


def _together(names: Sequence[str], found: Sequence[Term]) -> Iterator[list[Any]]:
    return ([getattr(term, name) for term in found] for name in names)


def _is_chain(scene: Scene) -> bool:
    """Whether springs join neighbours only and none repels: elimination needs no pivoting then.

    1 + h**2 K / m is tridiagonal, and every diagonal element exceeds the sum of the others in its column.
    """
    walls, springs = _rows(scene, "wall-spring"), _rows(scene, "spring")
    neighbours = np.all(np.abs(springs[0] - springs[1]) == 1)
    return bool(neighbours and np.all(springs[2] >= 0) and np.all(walls[1] >= 0))


def _factors(scene: Scene, h: float, slowed: Floats | float = 1.0) -> tuple[Floats, Floats, Floats]:
    """LU factors of slowed + h**2 K / m of a chain: multipliers, 1 / pivots, upper diagonal, each (n,)."""
    (i, k_wall, _), (a, b, k, _) = _rows(scene, "wall-spring"), _rows(scene, "spring")
    total, link = np.zeros(scene.n), np.zeros(scene.n + 1)
    np.add.at(total, i, k_wall)
    np.add.at(total, a, k)
    np.add.at(total, b, k)
    np.add.at(link, np.maximum(a, b), k)
    scale = h * h / scene.m
    upper = np.append(-link[1:-1] * scale[1:], 0.0)
    below = np.append(0.0, -link[1:-1] * scale[:-1])
    lower, pivot = np.zeros(scene.n), slowed + total * scale
    for j in range(1, scene.n):
        lower[j] = below[j] / pivot[j - 1]
        pivot[j] -= lower[j] * upper[j - 1]
    return lower, 1 / pivot, upper


def _inverse(scene: Scene, h: float, slowed: Floats | float = 1.0) -> Floats:
    """Columns of (slowed + h**2 K / m)**-1, as rows (n, n); not a number throughout where there is none."""
    if scene.n > DENSE:
        raise MethodError(
            f"own:implicit-euler serves at most {DENSE} particles joined other than as a chain; "
            f"scene {scene.name!r} has {scene.n}; leave the method out"
        )
    k = np.asarray(scene.system.hessian(scene.q), dtype=np.float64)
    try:
        return np.ascontiguousarray(np.linalg.inv(np.eye(scene.n) * slowed + h * h * (k / scene.m)).T)
    except np.linalg.LinAlgError:
        return np.full((scene.n, scene.n), np.nan)


def _identity(value: Any) -> Any:
    return value


def _as_lists(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(_as_lists(x) for x in value)
    return value.tolist() if isinstance(value, np.ndarray) else value


def _interpreted(layout: Layout) -> kernels.Kernel:
    """The kernel as it stands, without the loops of absent terms."""
    forces = _with_names(kernels.forces, dict(_laws(layout.keys)))
    return _with_names(layout.kernel, {"forces": forces})


def _try_to_compile(layout: Layout, h: float) -> kernels.Kernel | None:
    try:
        return _compile(layout, h)
    except ImportError:
        return None


def _compile(layout: Layout, h: float) -> kernels.Kernel:
    """The layout's kernel, compiled for its types by a call that fills no row, so that `advance` does not."""
    none = np.empty((0, layout.n))
    arguments = (1, h, *layout.constants, layout.q, layout.p, none, none.copy())
    for saved in (True, False):
        try:
            kernel = _jit(layout.kernel, layout.keys, saved)
            kernel(*arguments)
        except (OSError, RuntimeError):
            # no folder for the compiled code can be written: compile for this process alone
            if not saved:
                raise
        else:
            break
    return kernel


@cache
def _jit(kernel: kernels.Kernel, keys: frozenset[str], saved: bool) -> kernels.Kernel:
    """numba's version of a kernel for scenes with these terms."""
    import numba

    jit: Callable[[FunctionType], Any] = numba.njit(cache=saved, **kernels.FLAGS)
    names: dict[str, Any] = {}
    laws = _laws(keys)
    helpers: tuple[Callable[..., Any], ...] = (*kernels.ELEMENTARY, *laws.values())
    for helper in helpers:
        names[helper.__name__] = jit(_with_names(helper, names))
    names = {name: names[law.__name__] for name, law in laws.items()}
    names["forces"] = jit(_with_names(kernels.forces, names))
    return cast(kernels.Kernel, jit(_with_names(kernel, names)))


def _laws(keys: frozenset[str]) -> dict[str, Callable[..., None]]:
    """By the name that `kernels.forces` calls: the loop of each term, `nothing` for those not in keys."""
    return {law.__name__: law if key in keys else kernels.nothing for key, law in kernels.LAWS.items()}


def _with_names(function: Callable[..., Any], names: dict[str, Any]) -> FunctionType:
    """The same code, calling what stands in `names`: numba calls nothing that it has not compiled."""
    code = cast(FunctionType, function).__code__
    return FunctionType(code, {**vars(kernels), **names}, function.__name__)


@cache
def _installed(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ""
