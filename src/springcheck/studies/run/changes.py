"""A scene with numbers changed on the command line: --set, --step and --steps."""

from __future__ import annotations

import math
import re
import tomllib
from argparse import Namespace
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from springcheck.errors import SpringcheckError, nearest
from springcheck.physics import builders, scenefile
from springcheck.physics.bath import KELVIN, Bath
from springcheck.physics.scene import Scene


def changed(options: Namespace) -> Scene:
    """The scene that the options name, with their changes, which its title lists.

    SpringcheckError where the scene has no such field, or its value is invalid.
    """
    scene, text = scenefile.load_scene(options.scene), scenefile.text_of(options.scene)
    named = [(f"--set {one}", *one.partition("=")[::2]) for one in options.set]
    named += [
        (f"--{name} {value:.12g}", f"time.{name}", value)
        for name in ("step", "steps")
        if (value := getattr(options, name)) is not None
    ]
    if not named:
        return bathed(scene, options)
    tables, given = tomllib.loads(text or scene.to_toml()), dict[str, float]()
    for option, field, value in named:
        if "." not in field and (whole := [x for x in _fields(tables) if x.endswith(f".{field}")]):
            raise SpringcheckError(f"{option}: which one? {' or '.join(whole)}")
        if field in given:
            raise SpringcheckError(f"{field} is set twice")
        given[field] = _number(option, field, str(value))
        _put(tables, field, given[field], scene.name)
    where = ", ".join(option for option, *_ in named)
    found = scenefile.from_tables(tables, name=scene.name, where=where)
    said = ", ".join(f"{field} = {value:g}" for field, value in given.items())
    return bathed(replace(found, title=f"{scene.title}, with {said}"), options)


def _put(tables: Any, field: str, value: float, scene: str) -> None:
    """Set a number in the tables of a scene file.  SpringcheckError where it has no such number."""
    found = tables
    try:
        *parts, last = re.findall(r"[^.\[\]]+", field)
        for part in parts:
            found = found[_key(found, part)]
        key = _key(found, last)
        before = found.get(key) if isinstance(found, dict) else found[key]
        if isinstance(before, dict | list | str) or not isinstance(found, dict | list):
            raise KeyError
    except (KeyError, IndexError, ValueError, TypeError):
        raise SpringcheckError(
            f"--set {field}: scene {scene} has no such number{nearest(field, _fields(tables))}; "
            "fields are named as in its file, such as spring.0.stiffness or time.step"
        ) from None
    is_count = isinstance(before, int) and not isinstance(before, bool) and value.is_integer()
    found[key] = int(value) if is_count else value


def _key(table: Any, part: str) -> Any:
    """Key of this name in a table, or index into a list; ValueError for an index out of range or negative."""
    return range(len(table)).index(int(part)) if isinstance(table, list) else part


def _fields(tables: Mapping[str, Any]) -> list[str]:
    """Names of the fields of a scene file, as --set takes them."""
    return [
        f"{name}.{i}.{field}" if isinstance(table, list) else f"{name}.{field}"
        for name, table in tables.items()
        for i, row in enumerate(table if isinstance(table, list) else [table])
        if isinstance(row, dict)
        for field in row
    ]


def _number(option: str, field: str, value: str) -> float:
    """The number that an option gives a field."""
    needed = f"{option}: FIELD=NUMBER is needed, as spring.0.stiffness=2"
    if field and (found := _float(value)) is not None:
        return found
    first, *rest = value.split() or [""]
    if rest and _float(first) is not None:
        needed = f"{option}: a number alone is needed, in the scene's unit, as {first}"
    raise SpringcheckError(needed)


def _float(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


BATH_MEMORY = 0.1
"""Friction rate times step of a bath without a stated friction: momenta decorrelate in some ten steps."""


def bathed(scene: Scene, options: Namespace) -> Scene:
    """The scene in the bath of --temperature and --friction, which replace the scene's own.

    A temperature is in kelvin where it says so (300K) or where the scene's units have them.  In reduced units
    it is kT, and kelvin are converted with kJ/mol as the unit of energy, as in the store.
    """
    text, friction = options.temperature, options.friction
    if text is None and friction is None:
        return scene
    bath = scene.bath
    if text is None and bath is None:
        raise SpringcheckError("--friction goes with --temperature, or with a scene that has a bath")
    if text is not None:
        kelvin = text.strip().endswith("K")
        temperature = _float(text.strip().removesuffix("K"))
        if temperature is None:
            raise SpringcheckError(f"--temperature {text}: a number is needed, such as 300K")
        if not 0 <= temperature < math.inf:
            raise SpringcheckError(
                f"--temperature {text}: a finite number >= 0 is needed, such as 300K; 0 is friction without "
                "noise"
            )
        if kelvin and scene.units == "reduced":
            temperature *= KELVIN["md"]
    else:
        assert bath is not None
        temperature, text = bath.temperature, f"{bath.temperature:g}"
    if friction is None:
        friction = bath.friction if bath else BATH_MEMORY / abs(scene.step)
    if temperature == 0:
        return builders.cold(replace(scene, bath=None), friction)
    made = Bath(temperature=temperature, friction=friction)
    return replace(scene, bath=made, title=f"{scene.title}, at temperature {text}, friction {friction:g}")
