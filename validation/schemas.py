"""The JSON documents of the commands, as JSON Schema in `data/schemas`; does what is printed keep to it?

A document names its schema and version first.  Here each command is run in several ways, and what they print
is put together: the types that were met, and the names that were always there.  A name that goes, or another
type, needs another version (`springcheck.cli.output.SCHEMAS`); a name more does not.

`scene-1.json` is that of scene files, made of the structs that read them.

Run:   python validation/schemas.py            (50 s: 0 documents of 21 are off)
       python validation/schemas.py write      (writes data/schemas anew)
"""

import contextlib
import io
import json
import tempfile
from inspect import cleandoc
from pathlib import Path
from typing import Any
from unittest import mock

import msgspec

from arguments import arguments, script
from springcheck.cli import main as springcheck
from springcheck.cli.output import SCHEMAS
from springcheck.physics.scenefile import tables
from springcheck.studies.faults import measure
from springcheck.studies.faults.table import FAULTS

FOLDER = Path(__file__).parents[1] / "data" / "schemas"

WAYS = {
    "run": (
        "run spring --method own:euler --method own:rk4 -o run.h5",
        "run spring-uneven --method own:euler -o f.h5 --fault stiffness",
        "run --from run.h5",
    ),
    "inspect": (
        "inspect run.h5",
        "inspect run.h5 --verdicts",
        "inspect run.h5 --trajectory own:rk4",
    ),
    "identify": (
        "identify run.h5",
        "identify table.csv --stiffness 2.9 --mass 3.7 --step 0.1",
        "identify table.csv --mass 3.7 --scheme rk4",
        "identify run.h5 table.csv",
    ),
    "judge": ("judge table.csv --scene spring-uneven --scheme velocity-verlet",),
    "list": ("list",),
    "census": ("census --method own:euler --method own:rk4 -o census.h5",),
    "sampling": ("sampling --method own:baoab -o sampling.h5",),
    "stability": ("stability spring --method own:euler -o stability.h5",),
    "precision": (
        "precision spring --method own:euler -o precision.h5",
        "precision spring --method own:euler --budget 0.5 -o short.h5",
    ),
    "extremes": ("extremes --quick --method own:euler --method own:implicit-euler -o extremes.h5",),
    "faults": ("faults --workers 1",),
    "doctor": ("doctor",),
}
"""What is run of each command; `table.csv` is half a drift, `run.h5` the store of the first."""

FEW: dict[str, Any] = {"FAULTS": FAULTS[:1], "DECADE_HALVINGS": 0}
"""What of the study of faults is enough for a document of it."""


BY_NAME = ("limits", "libraries", "unusable_engines", "broke", "counts")
"""Objects whose keys are names of faults, engines or outcomes, and not of the document."""

MEANS = {
    "energy_drift": "H - H0 where it is largest, over the energy that the report's table names.  With "
    "friction or a drive the H of the exact solution, where it is known, takes the place of H0."
}
"""What a number is, where its name does not tell."""


def inferred(values: list[Any], name: str = "") -> dict[str, Any]:
    """The schema of these values: their types, and what they hold where they are objects or arrays."""
    names = {
        dict: "object",
        list: "array",
        tuple: "array",
        str: "string",
        bool: "boolean",
        type(None): "null",
    }
    types = sorted({names.get(type(x), "number") for x in values})
    if types in ([], ["null"]):
        # what was never there may be anything
        return {}
    found: dict[str, Any] = {"type": types[0] if len(types) == 1 else types}
    if name in MEANS:
        found["description"] = MEANS[name]
    objects = [x for x in values if isinstance(x, dict)]
    if objects and name in BY_NAME:
        found["additionalProperties"] = inferred([y for x in objects for y in x.values()], name)
    elif objects:
        # what made a trajectory are names of libraries
        keys = {key: None for x in objects for key in x if not key.startswith("origin.")}
        found["properties"] = {key: inferred([x[key] for x in objects if key in x], key) for key in keys}
        found["required"] = [key for key in keys if all(key in x for x in objects)]
    entries = [y for x in values if isinstance(x, list | tuple) for y in x]
    if entries:
        found["items"] = inferred(entries)
    return found


def problems(value: Any, schema: dict[str, Any], where: str = "") -> list[str]:
    """What in a value is not as the schema says."""
    name = inferred([value]).get("type", "null")
    allowed = schema.get("type", name)
    allowed = allowed if isinstance(allowed, list) else [allowed]
    if name not in allowed:
        return [f"{where or 'document'} is {name}, not {' or '.join(allowed)}"]
    if isinstance(value, dict):
        out = [f"{where}.{key} is missing" for key in schema.get("required", ()) if key not in value]
        known, rest = schema.get("properties", {}), schema.get("additionalProperties", {})
        return out + [
            x for key, y in value.items() for x in problems(y, known.get(key, rest), f"{where}.{key}")
        ]
    if isinstance(value, list) and "items" in schema:
        return [x for i, y in enumerate(value) for x in problems(y, schema["items"], f"{where}[{i}]")]
    return []


def unlisted(value: Any, schema: dict[str, Any], where: str = "") -> list[str]:
    """Names of a document that its schema does not list: legal, but the schema then says too little."""
    if isinstance(value, dict) and "properties" in schema:
        known = schema["properties"]
        new = [key for key in value if key not in known and not key.startswith("origin.")]
        out = [f"{where}.{key} is not in the schema" for key in new]
        return out + [
            x for key in known if key in value for x in unlisted(value[key], known[key], f"{where}.{key}")
        ]
    if isinstance(value, dict):
        rest = schema.get("additionalProperties", {})
        return [x for key, y in value.items() for x in unlisted(y, rest, f"{where}.{key}")]
    if isinstance(value, list):
        return [x for i, y in enumerate(value) for x in unlisted(y, schema.get("items", {}), f"{where}[{i}]")]
    return []


def table() -> str:
    """A trajectory of velocity Verlet with half a drift, which fits nothing."""
    q, v, h, w2 = 0.3, 0.7 / 3.7, 0.1, 2.9 / 3.7
    rows = ["t,q,v"]
    for i in range(101):
        rows.append(f"{i * h!r},{q!r},{v!r}")
        v -= h / 2 * w2 * q
        q += h / 2 * v
        v -= h / 2 * w2 * q
    return "\n".join(rows) + "\n"


def printed(words: str) -> Any:
    """The document that a command prints."""
    with (
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()) as said,
        mock.patch.multiple(measure, **FEW),
    ):
        springcheck([*words.split(), "--json"])
    if not out.getvalue():
        raise RuntimeError(f"{words}: {said.getvalue()}")
    return json.loads(out.getvalue())


def with_nulls(schema: Any, kept: Any) -> Any:
    """The schema, with null where the kept one allows it: a hurried study knows fewer orders under load."""
    if not (isinstance(schema, dict) and isinstance(kept, dict)):
        return schema
    found = {key: with_nulls(value, kept.get(key)) for key, value in schema.items()}
    if isinstance(found.get("type"), str) and "null" in kept.get("type", ()):
        found["type"] = sorted({"null", found["type"]})
    return found


def named(command: str) -> str:
    """A command with the version of its documents, as its file is called."""
    return f"{command}-{SCHEMAS.get(command, 1)}"


def schema_of(command: str, documents: list[Any]) -> dict[str, Any]:
    """The schema of a command's documents, with its head."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"springcheck/{named(command).replace('-', '/')}",
        **inferred(documents),
    }


def of_scenes() -> str:
    """The schema of scene files."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "a scene of springcheck"}
    return json.dumps(head | _settled(msgspec.json.schema(tables.scene_table())), indent=1) + "\n"


def _settled(schema: Any, key: str = "") -> Any:
    """Descriptions are docstrings, whose margin Python takes from 3.13 on; alternatives have no order."""
    if isinstance(schema, list):
        found = [_settled(x) for x in schema]
        return sorted(found, key=json.dumps) if key == "anyOf" else found
    if isinstance(schema, dict):
        return {k: _settled(x, k) for k, x in schema.items()}
    return cleandoc(schema) if key == "description" and isinstance(schema, str) else schema


def main() -> int:
    """Compare, or write; the exit status says whether every document keeps to its schema."""
    given = arguments(__doc__, what=("compare", "write"))
    wrong, scenes = 0, FOLDER / "scene-1.json"
    if given.what == "write":
        scenes.write_text(of_scenes())
    wrong += scenes.read_text() != of_scenes()
    print(f"scene files: {'another schema than data/schemas' if wrong else 'as their schema says'}")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("table.csv").write_text(table())
        for command, ways in WAYS.items():
            documents = [printed(words) for words in ways]
            path = FOLDER / f"{named(command)}.json"
            if given.what == "write":
                new = with_nulls(schema_of(command, documents), json.loads(path.read_text()))
                path.write_text(json.dumps(new, indent=1) + "\n")
            schema = json.loads(path.read_text())
            for words, document in zip(ways, documents, strict=True):
                found = problems(document, schema) + unlisted(document, schema)
                wrong += bool(found)
                print(f"{words}: {'; '.join(found[:5]) or 'as its schema says'}")
    print(f"{wrong} documents of {sum(map(len, WAYS.values()))} are off")
    return int(bool(wrong))


if __name__ == "__main__":
    script(main)
