"""A scene of which some numbers are set anew on the command line: --set, --step and --steps."""

from __future__ import annotations

import math
import tomllib
from argparse import Namespace
from dataclasses import replace

from springcheck.errors import SpringcheckError
from springcheck.physics import builders, scenefile
from springcheck.physics.bath import KELVIN, Bath
from springcheck.physics.scene import Scene


def changed(options: Namespace) -> Scene:
    """The scene that the options name, with their changes, which its title tells.

    SpringcheckError where a field is none of the scene's, or its value makes no sense.
    """
    scene = scenefile.load_scene(options.scene)
    given: dict[str, float] = {}
    for text in options.set:
        field, _, value = text.partition("=")
        whole = _whole(field, options.scene)
        if whole and field and "." not in field:
            raise SpringcheckError(f"--set {text}: which one? {whole}")
        _put(given, field, value, f"--set {text}: FIELD=NUMBER is needed, as spring.0.stiffness=2")
    for name, field in (("step", "time.step"), ("steps", "time.steps")):
        if getattr(options, name) is not None:
            _put(given, field, getattr(options, name), f"--{name}: a number is needed")
    if not given:
        return bathed(scene, options)
    from springcheck.studies.ensemble.vary import Axis, Plan, Varied

    plan = Plan(
        axes=tuple(Axis(field=field, values=(value,)) for field, value in given.items()),
        samples=None,
        seed=0,
        text=scenefile.text_of(options.scene),
    )
    found = Varied(scene, plan, option="--set").whole(given)
    said = ", ".join(f"{field} = {value:g}" for field, value in given.items())
    return bathed(replace(found, title=f"{scene.title}, with {said}"), options)


MEMORY = 0.1
"""Friction rate times step of a bath whose friction is not stated: momenta forget in some ten steps."""


def bathed(scene: Scene, options: Namespace) -> Scene:
    """The scene in the bath of --temperature and --friction, each in the place of the scene's own.

    A temperature is in kelvin where it says so (300K) or where the scene's units have them.  In reduced units
    it is kT, and kelvin count as kJ/mol for 1, as the store has them.
    """
    text, friction = options.temperature, options.friction
    if text is None and friction is None:
        return scene
    bath = scene.bath
    if text is None and bath is None:
        raise SpringcheckError("--friction goes with --temperature, or with a scene that has a bath")
    if text is not None:
        kelvin = text.strip().endswith("K")
        try:
            temperature = float(text.strip().removesuffix("K"))
        except ValueError:
            raise SpringcheckError(f"--temperature {text}: a number is needed, such as 300K") from None
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
        friction = bath.friction if bath else MEMORY / abs(scene.step)
    if temperature == 0:
        return builders.cold(replace(scene, bath=None), friction)
    made = Bath(temperature=temperature, friction=friction)
    return replace(scene, bath=made, title=f"{scene.title}, at temperature {text}, friction {friction:g}")


def _put(given: dict[str, float], field: str, value: object, needed: str) -> None:
    if field in given:
        raise SpringcheckError(f"{field} is set twice")
    try:
        given[field] = float(str(value))
    except ValueError:
        first, *rest = str(value).split() or [""]
        if rest and _is_number(first):
            needed = f"{needed.partition(': ')[0]}: a number alone is needed, in the scene's unit, as {first}"
        raise SpringcheckError(needed) from None
    if not field:
        raise SpringcheckError(needed)


def _whole(field: str, scene: str) -> str:
    """The fields of a scene whose last part this is, in full."""
    from springcheck.studies.ensemble.vary import fields

    found = (x for x in fields(tomllib.loads(scenefile.text_of(scene))) if x.endswith(f".{field}"))
    return " or ".join(found)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
