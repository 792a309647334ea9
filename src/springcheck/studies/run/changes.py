"""A scene of which some numbers are set anew on the command line: --set, --step and --steps."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from springcheck.errors import SpringcheckError
from springcheck.physics import scenefile
from springcheck.physics.scene import Scene
from springcheck.studies.ensemble.vary import Axis, Plan, Varied


def changed(options: Namespace) -> Scene:
    """The scene that the options name, with their changes, which its title tells.

    SpringcheckError where a field is none of the scene's, or its value makes no sense.
    """
    scene = scenefile.load_scene(options.scene)
    given: dict[str, float] = {}
    for text in options.set:
        field, _, value = text.partition("=")
        _put(given, field, value, f"--set {text}: FIELD=NUMBER is needed, as spring.0.stiffness=2")
    for name, field in (("step", "time.step"), ("steps", "time.steps")):
        if getattr(options, name) is not None:
            _put(given, field, getattr(options, name), f"--{name}: a number is needed")
    if not given:
        return scene
    plan = Plan(
        axes=tuple(Axis(field=field, values=(value,)) for field, value in given.items()),
        samples=None,
        seed=0,
        text=scenefile.text_of(options.scene),
    )
    found = Varied(scene, plan, option="--set").whole(given)
    said = ", ".join(f"{field} = {value:g}" for field, value in given.items())
    return replace(found, title=f"{scene.title}, with {said}")


def _put(given: dict[str, float], field: str, value: object, needed: str) -> None:
    if field in given:
        raise SpringcheckError(f"{field} is set twice")
    try:
        given[field] = float(str(value))
    except ValueError:
        raise SpringcheckError(needed) from None
    if not field:
        raise SpringcheckError(needed)
