"""`springcheck doctor`: the capabilities of this installation, and what the missing ones need."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import suppress
from importlib import metadata
from typing import Any

import numpy as np

import springcheck
from springcheck import engines
from springcheck.errors import MethodError
from springcheck.physics import scenefile
from springcheck.physics.arrays import WIDE
from springcheck.text.lines import Lines, plain

LIBRARIES = ("numpy", "scipy", "h5py", "numba", "matplotlib", "jinja2", "rich", "msgspec", "pandas", "xarray")
"""Libraries that results depend on, then optional ones."""


def found() -> dict[str, Any]:
    """Versions, arithmetic, engines that load or why not, as plain data.  Every engine is imported."""
    wide = np.finfo(np.longdouble)
    return {
        "springcheck": springcheck.__version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "long_double": {
            "bits": int(wide.nmant) + 1,
            "wider": WIDE,
            "means": "judged to a rounding of double precision"
            if WIDE
            else "no wider than double here: bounds are wider, and `extremes` does not run",
        },
        "libraries": {name: _version(name) for name in LIBRARIES},
        "engines": [_engine(name) for name in engines.names()],
        "unusable_engines": engines.unusable(),
    }


def _version(name: str) -> str | None:
    with suppress(metadata.PackageNotFoundError):
        return metadata.version(name)
    return None


def _engine(name: str) -> dict[str, Any]:
    known = engines.engine(name)
    row: dict[str, Any] = {"name": name, "version": None, "problem": engines.absence(name), "platforms": []}
    if row["problem"] is None:
        try:
            engines.load(name)
            row |= {"version": engines.installed_version(name), "platforms": list(_usable(known))}
        except MethodError as error:
            row["problem"] = str(error)
    return row


def _usable(engine: engines.Engine) -> Iterator[str]:
    """Platforms on which one of its methods starts here, without their precisions."""
    scene = scenefile.load_scene("spring")
    method = next((name for name, one in engine.methods.items() if one.default), "")
    for place in engine.platforms if method else ():
        if "-" not in place:
            try:
                engines.Started(scene, engines.parse(f"{engine.name}:{method}@{place}"))
            except MethodError:
                continue
            yield place


def lines(data: dict[str, Any]) -> Lines:
    """The data as text, each problem with its remedy."""
    return list(map(plain, _said(data)))


def _said(data: dict[str, Any]) -> Iterator[str]:
    wide = data["long_double"]
    yield f"springcheck {data['springcheck']}, python {data['python']} on {data['system']}"
    yield f"long double has {wide['bits']} bits of mantissa: {wide['means']}"
    here = [f"{name} {found}" for name, found in data["libraries"].items() if found]
    yield f"libraries: {', '.join(here)}"
    if missing := [name for name, found in data["libraries"].items() if not found]:
        yield f"not here, and not needed: {', '.join(missing)}"
    good = [one for one in data["engines"] if one["problem"] is None]
    yield f"{len(good)} of {len(data['engines'])} engines can be used"
    for one in data["engines"]:
        if one["problem"] is None:
            yield f"  ok       {one['name']} {one['version'] or ''}".rstrip()
            if one["platforms"]:
                yield f"           as METHOD@PLATFORM: {', '.join(one['platforms'])}"
        else:
            yield f"  missing  {one['name']}: {one['problem']}"
    yield from (f"  broken   {name}: {reason}" for name, reason in data["unusable_engines"].items())
