"""What springcheck has: scenes, engines and checks, found in their folders."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from springcheck import checks, engines, schemes
from springcheck.physics import scenefile as scenes


def listing() -> dict[str, Any]:
    """Scenes, engines with versions or the reason of their absence, and checks, as plain data."""
    return {
        "scenes": [{"name": name, "title": scenes.load_scene(name).title} for name in scenes.names()],
        "engines": [_engine(name) for name in engines.names()],
        "unusable_engines": engines.unusable(),
        "checks": [
            {"name": check.name, "sentence": check.sentence}
            for check in dict.fromkeys((*checks.ALL, *checks.RANDOM))
        ],
    }


def _engine(name: str) -> dict[str, Any]:
    found = engines.engine(name)
    absence = engines.absence(name)
    return {
        "name": name,
        "title": found.title,
        "version": None if absence else engines.installed_version(name),
        "absence": absence,
        "origin": str(engines.origin(name)),
        "platforms": list(found.platforms),
        "methods": [
            {
                "method": f"{name}:{method.name}",
                "scheme": schemes.title(method.scheme),
                "about": method.about,
                "default": method.default,
            }
            for method in (*found.methods.values(), *found.thermostats.values())
        ],
    }


def lines(found: dict[str, Any]) -> Iterator[str]:
    """The list as text of 80 columns."""
    yield "Scenes"
    width = max(len(scene["name"]) for scene in found["scenes"])
    for scene in found["scenes"]:
        yield f"  {scene['name']:{width}}  {scene['title']}"
    yield "Engines and methods"
    for engine in found["engines"]:
        here = f"{engine['title']} {engine['version']}".strip()
        yield f"  {engine['absence'] or here}, from {engine['origin']}"
        for method in engine["methods"]:
            yield f"    {method['method']:26}  {method['about']}"
        if engine["platforms"]:
            yield f"    platforms, as METHOD@PLATFORM: {', '.join(engine['platforms'][:4])}"
            yield f"      {', '.join(engine['platforms'][4:])}"
    yield from (f"  {reason}" for reason in found["unusable_engines"].values())
    yield "Checks"
    for check in found["checks"]:
        yield f"  {check['name']:14}  {check['sentence']}"
