"""Meaning of a table's columns by their names: times, positions, and momenta or velocities."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from springcheck.errors import StoreError, plain

Floats: TypeAlias = npt.NDArray[np.float64]
Columns: TypeAlias = Mapping[str, Floats]
"""Columns (f,) or (f, n) by name."""

Kind: TypeAlias = Literal["t", "q", "p", "v", "m"]

NAMES: dict[Kind, str] = {
    "t": r"t|time|times|zeit|temps|tid|tiempo",
    "q": r"q|r|(pos|position|positions|coordinate|coordinates)([_ ][xyz])?|[xyz]|angle|theta|phi"
    r"|auslenkung|ort|displacement|posisjon",
    "p": r"p(_?[xyz])?|(mom|momentum|momenta)([_ ][xyz])?",
    "v": r"v(_?[xyz])?|(vel|velocity|velocities)([_ ][xyz])?|[qxyz](_?dot|')|d[qxyz]/?dt|omega"
    r"|angular[_ ]velocity|theta_?dot|speed|geschwindigkeit|vitesse|fart|hastighet",
    "m": r"m|mass|masses",
}


FEWEST_SINGLE, FEW_ROWS, SHORT = 8, 1000, 0xFFF
"""Evidence that numbers are of single precision: so many different ones in so many rows, and bits among the
last of the 24 set in some.  None is set in numbers that no step has rounded, such as 0.75."""

LONGEST_NAME = 200
"""Characters of a column's name; patterns take the square of it."""

ALONE = "positions alone are the same for leapfrog, Verlet and semi-implicit Euler: record velocities too"
"""Note on a file that cannot distinguish schemes which share one recurrence of the positions."""


class Fixed(NamedTuple):
    """Numbers with a fixed number of decimals, whose rounding is absolute."""

    q: Any
    """Half a unit of the last decimal of positions [L], of all or each (n,); 0 where it is not fixed."""
    v: Any
    """The same of momenta, or else velocities."""
    beside: float
    """Unit roundoff of other columns, or of single precision where the decimals do not exclude it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class States:
    """Recorded states: t (f,), q and p or v (f, n) or neither, mass (n,) or None, and the precision of the
    numbers."""

    t: Floats
    q: Floats
    p: Floats | None
    v: Floats | None
    mass: Floats | None
    roundoff: float = 2.0**-53
    """Unit roundoff of the numbers: 2**-24 for single precision, 5e-d for d significant digits."""
    fixed: Fixed | None = None
    """How text with fixed decimals is rounded; None for other numbers."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units of q, v, t and mass, as an H5MD file states them."""
    notes: tuple[str, ...] = ()
    """Parts of the file that were left out."""


Reader: TypeAlias = Callable[[Path, list[str], float | None], States]
"""(path, names of columns, time step of a file that counts steps) -> its states."""


def fitting(path: Path, found: States) -> States:
    """States whose masses fit their positions; StoreError where they do not."""
    if found.mass is not None and (not len(found.mass) or found.q.shape[1] % len(found.mass)):
        raise StoreError(f"{path}: masses: {len(found.mass)}, columns of q: {found.q.shape[1]}")
    # decimals that hold numbers of single precision have no more of its digits
    return replace(found, roundoff=max(found.roundoff, found.fixed.beside)) if found.fixed else found


def times(path: Path, steps: Any, step: float | None, unit: str = "") -> Floats:
    """Times of counted steps; StoreError where the time step is not stated."""
    if step is None:
        how = f"as --step H{unit and f' in {unit}'}"
        raise StoreError(f"{path}: counts steps and knows no times; give its time step, {how}")
    return np.asarray(np.asarray(steps, np.float64) * step)


def moving(path: Path, found: States) -> States:
    """States with momenta or velocities; StoreError where positions stand alone."""
    if found.p is None and found.v is None:
        raise StoreError(
            f"{path}: holds no momenta or velocities; {ALONE}; `springcheck identify` says what positions "
            "alone leave open"
        )
    return found


@lru_cache(maxsize=4096)
def kind(name: str) -> Kind | None:
    """Quantity that a column of this name holds; units in brackets, numbers and case are ignored."""
    bare, _ = _parted(name)
    found: list[Kind] = [one for one, pattern in NAMES.items() if re.fullmatch(pattern, bare)]
    return found[0] if found else None


def counts_steps(name: str) -> bool:
    """Whether a column of this name counts steps."""
    return name.strip().lower() in ("step", "steps", "timestep", "timesteps")


def kinds(names: Collection[str]) -> dict[str, Kind]:
    """The quantity of each column that holds one.

    A capital letter beside the small letter of its quantity means something else: beside t or steps and p, or
    v, T and V are energies (or a temperature), and P is a pressure.
    """
    found = {name: what for name in names if (what := kind(name)) is not None}
    small = {what for name, what in found.items() if not _is_capital(name)}
    if any(counts_steps(name) for name in names):
        small.add("t")
    if small & {"p", "v"}:
        small |= {"p", "v"}
    return {name: what for name, what in found.items() if not (_is_capital(name) and what in small)}


def _is_capital(name: str) -> bool:
    bare = _without_unit(name[:LONGEST_NAME])
    return len(bare) == 1 and bare.isupper()


def _without_unit(name: str) -> str:
    bare = re.sub(r"^'(.*)'$", r"\1", name.strip().strip('"#').strip())
    # the index of an array is its number
    return re.sub(r"[\[(].*?[\])]", "", re.sub(r"(?<=[^\W\d])\s*[\[(](\d+)[\])]", r"_\1", bare)).strip()


def _parted(name: str) -> tuple[str, str]:
    """A name without its unit and case, and the number at its end, or before the sign of a derivative."""
    if len(name) > LONGEST_NAME:
        return "", ""
    bare = re.sub(r"(\d+)(_?dot|'|/?dt)$", r"\2\1", _without_unit(name).lower())
    found = re.search(r"[\s_.]*(\d*)$", bare)
    return (bare[: found.start()], found[1]) if found else (bare, "")


def _place(name: str) -> tuple[str, float]:
    """Axis and number in a column's name: ("x", 2) of ``vx2``; ("", -1) of ``v``."""
    bare, number = _parted(name)
    axis = re.search(r"[xyz](?=$|_?dot|'|/?dt)", bare)
    return axis[0] if axis else "", float(number or -1)


def _by_place(parts: Sequence[Floats], places: Sequence[tuple[str, float]]) -> Floats:
    """Columns by the particle, and then by the axis, that their names give; of an array its columns are the
    particles."""
    wide = [x.shape[1] for x in parts]
    number, axis = (np.repeat(x, wide) for x in ([n for _, n in places], [ord(a or "q") for a, _ in places]))
    particle = np.concatenate([np.arange(width) for width in wide])
    return np.asarray(np.hstack(parts)[:, np.lexsort((axis, particle, number))])


def split(path: Path, columns: Columns, roundoff: float = 2.0**-53) -> States:
    """Named columns as states.  StoreError names those that are missing or do not fit together."""
    parts: dict[Kind, list[Floats]] = {}
    places: dict[Kind, list[tuple[str, float]]] = {}
    meant = kinds(columns)
    for name, what in meant.items():
        values = columns[name]
        parts.setdefault(what, []).append(values if values.ndim > 1 else values[:, None])
        places.setdefault(what, []).append(_place(name))
    for what, found in places.items():
        axes = {axis for axis, _ in found}
        if len(axes) == 1:
            places[what] = [("", number) for _, number in found]
        elif what == "q" and "" in axes:
            names = listed(name for name, one in meant.items() if one == what)
            raise StoreError(f"{path}: positions along axes and others: {names}; name all by --columns t,q,v")
    alike = [sorted(places[what]) for what in "qpv" if what in places]
    if all(x == alike[0] and len({*x}) == len(x) for x in alike):
        # momenta and velocities belong to the positions of their numbers, and so do masses
        for what in places.keys() & {"q", "p", "v"}:
            parts[what] = [_by_place(parts[what], places[what])]
        if "m" in places and {*places["m"]} == {("", number) for _, number in places.get("q", ())}:
            parts["m"] = [_by_place(parts["m"], places["m"])]
    for what, why in (("t", "times"), ("q", "positions")):
        if what not in parts:
            how = "name all columns, as --columns t,q,v"
            raise StoreError(f"{path}: no column of {why} among {listed(columns)}; {how}")
    t = np.hstack(parts["t"])
    if t.shape[1] != 1:
        times = [name for name, what in meant.items() if what == "t"]
        raise StoreError(
            f"{path}: columns of times: {t.shape[1]} ({listed(times)}), and there is one time; name "
            "all columns anew by --columns, the others of these by words that mean no quantity: t,other,q,v"
        )
    states = {what: np.hstack(parts[what]) for what in parts if what != "m"}
    n = states["q"].shape[1]
    for what, values in states.items():
        if what != "t" and values.shape != (len(t), n):
            raise StoreError(f"{path}: columns of {what}: {values.shape[1]}, of q: {n}")
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad):
            raise StoreError(f"{path}: row {bad[0] + 1} of {what} is not finite")
    if roundoff == 2.0**-53 and all(is_single(x) for what, x in states.items() if what != "t"):
        roundoff = 2.0**-24
    mass = np.hstack(parts["m"]) if "m" in parts else None
    if mass is not None and np.any(mass != mass[:1]):
        raise StoreError(f"{path}: the masses change from row to row")
    left = [name for name in columns if kind(name) is not None and name not in meant]
    said = "left out: a capital letter among small ones is an energy or another quantity"
    return States(
        t=t[:, 0], q=states["q"], p=states.get("p"), v=states.get("v"), roundoff=roundoff,
        mass=None if mass is None else mass[0], notes=(f"{listed(left)} {said}",) if left else (),
    )  # fmt: skip


def is_single(x: Floats) -> bool:
    """Whether all of these numbers are of single precision, and enough of them use all of its digits."""
    some = x[:FEW_ROWS]
    with np.errstate(over="ignore"):
        short = np.float32(some).view(np.uint32) & SHORT == 0
        return bool(
            len(np.unique(some[~short])) >= FEWEST_SINGLE
            and np.array_equal(np.float32(x).astype(np.float64), x)
        )


def listed(names: Iterable[str]) -> str:
    """Names separated by commas, the first eight of them."""
    names = list(names)
    shown = ", ".join(plain(name, 40) for name in names[:8]) if names else "none"
    return f"{shown} ..." if len(names) > 8 else shown


def named(path: Path, values: Floats, names: Sequence[str]) -> Columns:
    """The columns of a table (f, c) under names; StoreError where the numbers of the two differ."""
    if not names:
        how = f"give all {values.shape[1]}, as --columns t,q,v"
        raise StoreError(f"{path}: its columns have no names; {how}")
    if len(names) != values.shape[1]:
        raise StoreError(f"{path}: columns: {values.shape[1]}, names: {len(names)}: {listed(names)}")
    out: dict[str, Floats] = {}
    for i, name in enumerate(names):
        # columns may share a name, as the q of several particles do
        out[name if name not in out else f"{name}_{i}"] = values[:, i]
    return out
