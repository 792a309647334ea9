"""Lists of the scenes, engines and checks, as found in their folders."""

from __future__ import annotations

import textwrap
import tomllib
from typing import Any

from springcheck import checks, engines, schemes
from springcheck.checks.seeds import SEEDED
from springcheck.physics import scenefile as scenes
from springcheck.physics.scene import Scene
from springcheck.text.lines import Lines, plain


def listing() -> dict[str, Any]:
    """Scenes, engines with versions or the reason of their absence, and checks, as plain data."""
    return {
        # a shipped scene is valid: its title is read without building the scene
        "scenes": [
            {"name": name, "title": tomllib.loads(scenes.text_of(name))["title"]} for name in scenes.names()
        ],
        "engines": [_engine(name) for name in engines.names()],
        "unusable_engines": engines.unusable(),
        "checks": [
            {"name": check.name, "sentence": check.sentence, "applies_to": check.needs}
            for check in dict.fromkeys((*checks.ALL, *checks.RANDOM, *SEEDED))
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


def methods(scene: Scene | None) -> list[dict[str, Any]]:
    """Every method: its scheme, whether it runs by default, and why it cannot run here, or on this scene."""
    rows = []
    for engine in map(_engine, engines.names()):
        for one in engine["methods"]:
            refused = engines.refusal(scene, engines.parse(one["method"])) if scene is not None else ""
            row = {name: one[name] for name in ("method", "scheme", "default")}
            rows.append({**row, "why not": engine["absence"] or refused or ""})
    return rows


def lines(found: dict[str, Any]) -> Lines:
    """The list as text of 80 columns."""
    out = ["Scenes"]
    width = max(len(scene["name"]) for scene in found["scenes"])
    for scene in found["scenes"]:
        out += _entry(scene["name"], width, scene["title"])
    out.append("Engines and methods")
    for engine in found["engines"]:
        here = f"{engine['title']} {engine['version']}".strip()
        out += _entry(f"{engine['absence'] or here}, from {engine['origin']}", 0, "")
        for method in engine["methods"]:
            out += _entry(f"  {method['method']}", 28, method["about"])
        if engine["platforms"]:
            out += _entry("  platforms", 28, "as METHOD@PLATFORM: " + ", ".join(engine["platforms"]))
    for reason in found["unusable_engines"].values():
        out += _entry(reason, 0, "")
    out.append("Checks")
    for check in found["checks"]:
        out += _entry(check["name"], 16, f"{check['sentence']} Applies to: {check['applies_to']}.")
    return list(map(plain, out))


def _entry(name: str, width: int, words: str) -> list[str]:
    """A name and its description, in lines of 80 columns; a path is not broken, so that it can be copied."""
    return textwrap.wrap(
        f"{name:{width}}  {words}".rstrip(), 80, initial_indent="  ", subsequent_indent=" " * (width + 4),
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
