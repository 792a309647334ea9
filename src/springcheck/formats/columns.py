"""Meaning of a table's columns by their names: times, positions, and momenta or velocities."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import pi
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
    "t": r"t|times?|zeit|temps|tid|tiempo",
    "q": r"q|r|(pos|positions?|coordinates?)([_ ][xyz])?|[xyz]|angle|theta|phi|winkel|vinkel|auslenkung|ort"
    r"|weg|displacement|posisjon|utslag|[ée]longation|allongement|d[ée]placement|abscisse|posici[óo]n",
    "p": r"p(_?[xyz])?|(mom|moment(um|a))([_ ][xyz])?|impuls|bevegelsesmengde|quantit[ée] de mouvement",
    "v": r"v(_?[xyz])?|(vel|velocity|velocities)([_ ][xyz])?|([qxyz]|theta|phi)(_?dot|')|d([qxyz]|theta)/?dt"
    r"|omega|angular[_ ]velocity|speed|(winkel)?geschwindigkeit|vitesse([_ ]angulaire)?|(vinkel)?hastighet"
    r"|fart|velocidad",
    "m": r"m|mass|masses|masse",
}
ENERGY = r"e[_ ]?(tot|total|kin|pot)?|hamiltonian|((total|kinetic|potential)[_ ])?energy"

LENGTHS = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "pm": 1e-12, "km": 1e3, "angstrom": 1e-10,
    "å": 1e-10, "rad": 1.0, "deg": pi / 180, "degrees": pi / 180, "°": pi / 180,
}  # fmt: skip
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12, "fs": 1e-15, "min": 60.0, "h": 3600.0}
ANGLES = "rad", "deg", "degrees", "°"
"""Units that a column's name may state: lengths or angles, and times, in m, rad and s."""

FEWEST_SINGLE, FEW_ROWS, SHORT = 8, 1000, 0xFFF
"""Evidence that numbers are of single precision: so many different ones in so many rows, and bits among the
last of the 24 set in some.  None is set in numbers that no step has rounded, such as 0.75."""

MOST_NUMBERS = 1 << 24
"""Numbers of one trajectory."""
LONGEST_NAME = 200
"""Characters of a column's name; patterns take the square of it."""
SLOPE = 0.2
"""Largest relative difference of velocities from the differences of positions over those of times."""

ALONE = "positions alone are the same for leapfrog, Verlet and semi-implicit Euler: record velocities too"
"""Note on a file that cannot distinguish schemes which share one recurrence of the positions."""
BARE = "columns without names were taken as t, q and v: the last is the rate of the one before"
ANEW = "name all columns, as --columns t,q,v; - leaves one out, as -,t,q,v"


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
    """Units of q, v, t and mass, as the file states them."""
    notes: tuple[str, ...] = ()
    """Parts of the file that were left out or converted."""


Reader: TypeAlias = Callable[[Path, list[str], float | None], States]
"""(path, names of columns, time step of a file that counts steps) -> its states."""


def fitting(path: Path, found: States) -> States:
    """States with velocities in the units of positions and times, and angles in rad; StoreError where masses
    do not fit positions."""
    if found.mass is not None and (not len(found.mass) or found.q.shape[1] % len(found.mass)):
        raise StoreError(f"{path}: masses: {len(found.mass)}, columns of q: {found.q.shape[1]}")
    if found.fixed:
        # decimals that hold numbers of single precision have no more of its digits
        found = replace(found, roundoff=max(found.roundoff, found.fixed.beside))
    q, t, v = (found.units.get(what, "").lower().replace("µ", "u") for what in "qtv")
    of, over = [*re.split(r"\s*/\s*|[ ·*](?=\w+\^?-1$)", v), ""][:2]
    over = over.removesuffix("-1").removesuffix("^")
    known = {q, of} <= LENGTHS.keys() and {t, over} <= TIMES.keys() and (q in ANGLES) == (of in ANGLES)
    if not known or found.v is None:
        return found
    turned, unit = (LENGTHS[q], "rad") if q in ANGLES else (1.0, q)
    factor = turned * LENGTHS[of] / LENGTHS[q] * TIMES[t] / TIMES[over]
    notes = [f"positions in {q} were multiplied by {turned:.6g}: rad"] * (turned != 1)
    notes += [f"velocities in {of}/{over} were multiplied by {factor:.6g}: {unit}/{t}"] * (factor != 1)
    if not notes:
        return found
    fixed = found.fixed and Fixed(found.fixed.q * turned, found.fixed.v * factor, found.fixed.beside)
    units = {**found.units, "q": unit, "t": t, "v": f"{unit} {t}-1"}
    position, rate, said = found.q * turned, found.v * factor, (*found.notes, *notes)
    return replace(found, q=position, v=rate, fixed=fixed, units=units, notes=said)


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
    """Quantity that a column of this name holds; units, numbers and case are ignored."""
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
    bare = _with_unit(name[:LONGEST_NAME])[0]
    return len(bare) == 1 and bare.isupper()


def _with_unit(name: str) -> tuple[str, str]:
    """A name, and its unit: ("Zeit", "s") of ``Zeit [s]``, ``Zeit (s)`` or ``Zeit / s``."""
    bare = re.sub(r"^'(.*)'$", r"\1", name.strip().strip('"#').strip())
    # GROMACS heads its columns so
    bare = re.sub(r"^atom (\d+) ([XYZ])$", r"\2\1", bare)
    # the index of an array is its number
    bare = re.sub(r"(?<=[^\W\d])\s*[\[(](\d+)[\])]", r"_\1", bare)
    bare, *units = re.split(r"[\[(](.*?)[\])]| / | in |[_ ](?=deg$|rad$)", bare, maxsplit=1)
    return bare.strip(), " ".join(filter(None, units)).strip()


def _parted(name: str) -> tuple[str, str]:
    """A name without its unit and case, and the number at its end, or before the sign of a derivative."""
    if len(name) > LONGEST_NAME:
        return "", ""
    bare = re.sub(r"(\d+)(_?dot|'|/?dt)$", r"\2\1", _with_unit(name)[0].lower())
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


def split(
    path: Path, columns: Columns, roundoff: float = 2.0**-53, step: float | None = None, finite: bool = True
) -> States:
    """Named columns as states; without times, frames are a `step` apart, where it is stated.

    StoreError names those that are missing, do not fit together or, where they must be, are not `finite`.
    """
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
    if "q" not in parts:
        _energies_alone(path, columns)
        raise StoreError(f"{path}: no column of positions among {listed(columns)}; {ANEW}")
    if "t" not in parts:
        if step is None:
            how = "; or give the time between frames, as --step H"
            raise StoreError(f"{path}: no column of times among {listed(columns)}; {ANEW}{how}")
        parts["t"] = [times(path, np.arange(len(parts["q"][0]))[:, None], step)]
    t = np.hstack(parts["t"])
    if t.shape[1] != 1:
        names = listed(name for name, what in meant.items() if what == "t")
        raise StoreError(f"{path}: columns of times: {t.shape[1]} ({names}), and there is one time; {ANEW}")
    states = {what: np.hstack(parts[what]) for what in parts if what != "m"}
    n = states["q"].shape[1]
    for what, values in states.items():
        if what != "t" and values.shape != (len(t), n):
            raise StoreError(f"{path}: columns of {what}: {values.shape[1]}, of q: {n}")
        bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if len(bad) and finite:
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
        units={what: unit for name, what in meant.items() if (unit := _with_unit(name)[1])},
    )  # fmt: skip


def _energies_alone(path: Path, columns: Columns) -> None:
    """Raise StoreError if the columns are energies, which identify no scheme."""
    found = {name: x for name, x in columns.items() if re.fullmatch(ENERGY, _parted(name)[0])}
    if not found:
        return
    parts = {name: x for name, x in found.items() if re.search("kin|pot", name, re.IGNORECASE)}
    whole = {name: x for name, x in found.items() if name not in parts}
    name = next(iter(whole), " + ".join(parts))
    total = sum(np.reshape(x, (len(x), -1)).sum(axis=1) for x in ([whole[name]] if whole else parts.values()))
    size = float(np.max(np.abs(total))) or 1.0
    shown = f"{np.ptp(total) / size:.2g} of its size, {(total[-1] - total[0]) / size:+.2g} from start to end"
    raise StoreError(
        f"{path}: holds energies alone ({listed(found)}): {plain(name, 80)} changes by {shown}. That shows "
        "drift, and no scheme: record positions and velocities too"
    )


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


def is_rate(t: Floats, q: Floats, v: Floats) -> bool:
    """Whether one column is the derivative of another."""
    if len(t) < 5 or not np.all(np.diff(t) > 0):
        return False
    with np.errstate(all="ignore"):
        off = (q[2:] - q[:-2]) / (t[2:] - t[:-2]) - v[1:-1]
        return bool(np.linalg.norm(off) <= SLOPE * np.linalg.norm(v[1:-1]) > 0)


def named(path: Path, values: Floats, names: Sequence[str]) -> Columns:
    """The columns of a table (f, c) under names; StoreError where the numbers of the two differ.

    Without names, three columns of which the last is the rate of the second are t, q and v.
    """
    if not names and values.shape[1] == 3 and is_rate(*values.T):
        names = ["t", "q", "v"]
    if not names:
        how = f"give all {values.shape[1]}, as --columns t,q,v"
        raise StoreError(f"{path}: its columns have no names; {how}; - leaves one out")
    if len(names) != values.shape[1]:
        how = "- leaves a column out, as --columns -,t,q,v"
        raise StoreError(f"{path}: columns: {values.shape[1]}, names: {len(names)}: {listed(names)}; {how}")
    out: dict[str, Floats] = {}
    for i, name in enumerate(names):
        # columns may share a name, as the q of several particles do
        out[name if name not in out else f"{name}_{i}"] = values[:, i]
    return out
