"""`springcheck list`: what there is, in one screen; each kind of thing on a page of its own."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

from springcheck import checks, engines, schemes
from springcheck.checks.seeds import SEEDED
from springcheck.physics import scenefile as scenes
from springcheck.physics import terms
from springcheck.physics.scene import Scene
from springcheck.text.lines import Lines, plain
from springcheck.text.wording import count


def listing() -> dict[str, Any]:
    """Scenes, engines (with version, or why they are absent), checks, terms and schemes, as plain data."""
    every = dict.fromkeys((*checks.ALL, *checks.RANDOM, *SEEDED))
    return {
        # a shipped scene is valid: its title is read without building the scene
        "scenes": [
            {"name": name, "title": tomllib.loads(scenes.text_of(name))["title"]} for name in scenes.names()
        ],
        "engines": [_engine(name) for name in engines.names()],
        "unusable_engines": engines.unusable(),
        "checks": [
            {"name": check.name, "sentence": check.sentence, "applies_to": check.needs} for check in every
        ],
        "terms": [
            {"name": name, "formula": term.formula, "columns": [x.name for x in term.columns]}
            for name, term in terms.known().items()
            if not issubclass(term, terms.ToPoints)
        ],
        "schemes": [
            {"name": one.name, "title": one.title, "order": one.order} for one in schemes.known().values()
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


def _overview(found: dict[str, Any]) -> list[str]:
    here = [one for one in found["engines"] if not one["absence"]]
    installed = ", ".join(f"{one['title']} {one['version']}".strip() for one in here)
    sizes = {
        "scenes": count(len(found["scenes"]), "scene"),
        "methods": f"{sum(len(one['methods']) for one in here)} methods of {count(len(here), 'engine')}",
        "checks": count(len(found["checks"]), "check"),
        "terms": f"{count(len(found['terms']), 'term')} of scene files",
        "schemes": count(len(found["schemes"]), "scheme"),
    }
    out = [f"  springcheck list {kind:9}{words}" for kind, words in sizes.items()]
    out += ["", *_entry("Installed:", 10, installed)]
    absent = [one["name"] for one in found["engines"] if one["absence"]]
    if absent:
        out += _entry("Missing:", 10, f"{', '.join(absent)} (springcheck doctor says how to install them)")
    for reason in found["unusable_engines"].values():
        out += _entry("Unusable:", 10, reason)
    return [*out, "", "  springcheck explain NAME tells what any of these is."]


def _methods(found: dict[str, Any]) -> list[str]:
    out = []
    for engine in sorted(found["engines"], key=lambda one: one["absence"] is not None):
        here = f"{engine['title']} {engine['version']}".strip()
        out += _entry(f"{engine['absence'] or here}, from {engine['origin']}", 0, "")
        for method in engine["methods"]:
            out += _entry(f"  {method['method']}", 28, method["about"])
        if engine["platforms"]:
            out += _entry("  platforms", 28, "as METHOD@PLATFORM: " + ", ".join(engine["platforms"]))
    for reason in found["unusable_engines"].values():
        out += _entry(reason, 0, "")
    return out


def _table(kind: str, words: Callable[[Mapping[str, Any]], str]) -> Callable[[dict[str, Any]], list[str]]:
    def page(found: dict[str, Any]) -> list[str]:
        rows = found[kind]
        width = max(len(row["name"]) for row in rows)
        return [line for row in rows for line in _entry(row["name"], width, words(row))]

    return page


PAGES: Mapping[str, Callable[[dict[str, Any]], list[str]]] = {
    "scenes": _table("scenes", lambda row: str(row["title"])),
    "methods": _methods,
    "checks": _table("checks", lambda row: f"{row['sentence']} Applies to: {row['applies_to']}."),
    "terms": _table("terms", lambda row: f"V = {row['formula']}"),
    "schemes": _table(
        "schemes", lambda row: row["title"] + (f", order {row['order']}" if row["order"] else "")
    ),
}
"""Pages of the list, in the order of the overview."""


def lines(found: dict[str, Any], kind: str | None = None) -> Lines:
    """One page of the list, or the overview, as text of 80 columns."""
    return list(map(plain, (PAGES[kind] if kind else _overview)(found)))


def _entry(name: str, width: int, words: str) -> list[str]:
    """A name and its description, in lines of 80 columns; a path is not broken, so that it can be copied."""
    return textwrap.wrap(
        f"{name:{width}}  {words}".rstrip(), 80, initial_indent="  ", subsequent_indent=" " * (width + 4),
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
