"""Scene files: TOML in, `model.Scene` out, and every mistake answered with file, field and remedy."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from springcheck import mechanics
from springcheck.errors import SceneError
from springcheck.model import Kind, Scene, Term, Units

Positive = Annotated[float, msgspec.Meta(gt=0)]
Count = Annotated[int, msgspec.Meta(ge=1)]
End = int | Literal["wall"]


class _Table(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, frozen=True):
    """A table of a scene file: what is not a field of it is refused."""


class ParticleTable(_Table, frozen=True):
    """mass [M], position [L] and momentum [M L/T] at the start."""

    mass: Positive
    position: float = 0.0
    momentum: float = 0.0


class SpringTable(_Table, frozen=True):
    """A spring of a stiffness [M/T2] and a rest length [L]; a wall end stands at `wall` [L].

    `fast` springs are taken in the short step of a method of multiple time steps.
    """

    ends: tuple[End, End]
    stiffness: float
    rest: float = 0.0
    wall: float = 0.0
    fast: bool = False


class QuarticTable(_Table, frozen=True):
    """A stiffening well V = coefficient/4 (q - at)**4 of one particle."""

    particle: int
    coefficient: float
    at: float = 0.0


class DampingTable(_Table, frozen=True):
    """Friction of one particle: force -coefficient p/mass, coefficient [M/T]."""

    particle: int
    coefficient: Annotated[float, msgspec.Meta(ge=0)]


class TimeTable(_Table, frozen=True):
    """Step [T], number of steps, and the relative tolerance per step of adaptive solvers."""

    step: float
    steps: Count
    every: Count | None = None
    tolerance: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 1e-12


class MethodsTable(_Table, frozen=True):
    """Labels or globs of the methods to run; all that can serve the scene when left out."""

    include: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)] = ("*",)


class RecordTable(_Table, frozen=True):
    """Every how many steps a frame is kept, and what of it."""

    every: Count | None = None
    quantities: tuple[Literal["q", "p", "energy"], ...] = ("q", "p", "energy")


class SceneTable(_Table, frozen=True):
    """A whole scene file."""

    title: str
    particle: Annotated[tuple[ParticleTable, ...], msgspec.Meta(min_length=1)]
    time: TimeTable
    source: str = ""
    units: Units = "reduced"
    kind: Kind = "particles"
    spring: tuple[SpringTable, ...] = ()
    quartic: tuple[QuarticTable, ...] = ()
    damping: tuple[DampingTable, ...] = ()
    methods: MethodsTable = MethodsTable()
    record: RecordTable = RecordTable()


def folder() -> Path:
    """Where the shipped scenes lie: inside the installed package, or in a checkout's data folder."""
    packaged = Path(__file__).parent / "data" / "scenes"
    return packaged if packaged.is_dir() else Path(__file__).parents[2] / "data" / "scenes"


def names() -> tuple[str, ...]:
    """Names of the shipped scenes."""
    return tuple(sorted(path.stem for path in folder().glob("*.toml")))


def load_scene(name_or_path: str | Path) -> Scene:
    """Read a shipped scene by name, or any scene file by path.

    Raises:
        SceneError: no such scene, or a mistake in the file: says which field, what stands there and
            what is accepted.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml" and path.parent == Path() and not path.is_file():
        path = folder() / f"{name_or_path}.toml"
        if not path.is_file():
            raise SceneError(
                f"no scene {str(name_or_path)!r}: shipped are {', '.join(names())}; "
                "the name of a file of your own ends in .toml"
            )
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise SceneError(f"{path}: cannot be read: {reason}") from error
    return parse(text, name=path.stem, where=str(path))


def parse(text: str, *, name: str, where: str | None = None) -> Scene:
    """The scene that a TOML text describes; `where` is named in messages.  Raises SceneError."""
    where = where or name
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError(f"{where}: not valid TOML: {error}") from error
    for field, value in _numbers(data):
        if not math.isfinite(value):
            raise SceneError(f"{where}: {field} = {value}; a finite number is needed")
    try:
        table = msgspec.convert(data, SceneTable, strict=True)
    except msgspec.ValidationError as error:
        raise SceneError(f"{where}: {_explain(str(error), data)}") from error
    try:
        return _scene(table, name=name, text=text)
    except _MistakeError as error:
        raise SceneError(f"{where}: {error}") from error


class _MistakeError(ValueError):
    """A value of the right type that makes no sense."""


def _numbers(data: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """All numbers in nested tables, each with its field's path."""
    if isinstance(data, bool):
        return
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _numbers(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from _numbers(value, f"{path}[{i}]")
    elif isinstance(data, int | float):
        try:
            yield path, float(data)
        except OverflowError:
            yield path, math.inf


_FIELDS: dict[str, type[_Table]] = {
    "": SceneTable,
    "particle": ParticleTable,
    "spring": SpringTable,
    "quartic": QuarticTable,
    "damping": DampingTable,
    "time": TimeTable,
    "methods": MethodsTable,
    "record": RecordTable,
}


def _explain(message: str, data: Any) -> str:
    """msgspec's message with the field first, what was found there, and the fields that exist."""
    what, _, path = message.partition(" - at `$")
    field = path.rstrip("`").lstrip(".")
    found = data
    for part in re.findall(r"[^.\[\]]+", field):
        try:
            found = found[int(part)] if part.isdigit() else found[part]
        except (KeyError, IndexError, TypeError):
            found = None
    what = what[0].lower() + what[1:]
    if "unknown field" in what or "missing required field" in what:
        table = _FIELDS.get(re.sub(r"\[.*", "", field))
        known = f"; its fields are {', '.join(table.__struct_fields__)}" if table else ""
        return f"{field or 'the scene'}: {what.replace('object', 'it')}{known}"
    return f"{field} = {found!r}: {what}"


def _scene(table: SceneTable, *, name: str, text: str) -> Scene:
    n = len(table.particle)
    time = table.time
    if time.step == 0:
        raise _MistakeError("time.step = 0: a step forwards (> 0) or backwards (< 0) is needed")
    if time.every is not None and table.record.every is not None:
        raise _MistakeError("record.every and time.every are both given; keep record.every")
    every = table.record.every or time.every or 1
    if time.steps % every:
        raise _MistakeError(
            f"record.every = {every}: time.steps = {time.steps} is no multiple of it, so the end "
            "would not be recorded"
        )
    if not {"q", "p"} <= set(table.record.quantities):
        raise _MistakeError('record.quantities needs "q" and "p"; "energy" may be left out')
    return Scene(
        name=name,
        title=table.title,
        source=table.source,
        units=table.units,
        kind=table.kind,
        m=np.array([particle.mass for particle in table.particle]),
        q=np.array([particle.position for particle in table.particle]),
        p=np.array([particle.momentum for particle in table.particle]),
        terms=tuple(_terms(table, n)),
        step=time.step,
        steps=time.steps,
        every=every,
        tolerance=time.tolerance,
        include=table.methods.include,
        quantities=table.record.quantities,
        text=text,
    )


def _particle(value: int, n: int, field: str) -> int:
    if not 0 <= value < n:
        raise _MistakeError(f"{field} = {value}: there are {n} particles, numbered 0 to {n - 1}")
    return value


def _terms(table: SceneTable, n: int) -> Iterator[Term]:
    walls: dict[bool, list[tuple[int, float, float]]] = {False: [], True: []}
    pairs: dict[bool, list[tuple[int, int, float, float]]] = {False: [], True: []}
    for j, spring in enumerate(table.spring):
        field = f"spring[{j}].ends"
        for end in spring.ends:
            if end != "wall":
                _particle(end, n, field)
        match spring.ends:
            case ("wall", "wall"):
                raise _MistakeError(f"{field}: a spring between two walls moves nothing")
            case ("wall", int(particle)):
                walls[spring.fast].append((particle, spring.stiffness, spring.wall + spring.rest))
            case (int(particle), "wall"):
                walls[spring.fast].append((particle, spring.stiffness, spring.wall - spring.rest))
            case (int(one), int(other)):
                if one == other:
                    raise _MistakeError(f"{field} = [{one}, {other}]: the two ends are the same particle")
                if spring.wall:
                    raise _MistakeError(f"spring[{j}].wall is given, but no end of it is a wall")
                pairs[spring.fast].append((one, other, spring.stiffness, spring.rest))
    for fast in (False, True):
        if walls[fast]:
            i, k, at = zip(*walls[fast], strict=True)
            yield mechanics.WallSpring(i=np.array(i), k=np.array(k), at=np.array(at), fast=fast)
        if pairs[fast]:
            a, b, k, rest = zip(*pairs[fast], strict=True)
            yield mechanics.Spring(
                a=np.array(a), b=np.array(b), k=np.array(k), rest=np.array(rest), fast=fast
            )
    if table.quartic:
        yield mechanics.Quartic(
            i=np.array(
                [_particle(x.particle, n, f"quartic[{j}].particle") for j, x in enumerate(table.quartic)]
            ),
            b=np.array([x.coefficient for x in table.quartic]),
            at=np.array([x.at for x in table.quartic]),
        )
    if table.damping:
        braked = [_particle(x.particle, n, f"damping[{j}].particle") for j, x in enumerate(table.damping)]
        yield mechanics.Damping(
            i=np.array(braked),
            c=np.array([x.coefficient for x in table.damping]),
            m=np.array([table.particle[j].mass for j in braked]),
        )
