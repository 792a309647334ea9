"""Reports for continuous integration: JUnit, and a summary in Markdown.

Both derive from the JSON document of a command, so that nothing is decided twice.
"""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from springcheck.errors import SpringcheckError, plain
from springcheck.store import files
from springcheck.studies.arguments import REPORT_FORMS
from springcheck.text.wording import DIAGNOSIS, count

HEAD = b"<?xml version='1.0' encoding='utf-8'?>\n<testsuites name=\"springcheck\""
"""First bytes of a JUnit report; a file that begins otherwise is not overwritten."""

WORDS = {0: "passed", 1: "failed", 2: "nothing judged"}

MOST_CASES = 20
"""Most cases in a summary; the report has all of them."""

_NOT_IN_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One item that was judged."""

    subject: str
    """Method, trajectory or file."""
    name: str
    passed: bool | None
    """None where nothing could be judged."""
    why: str
    error: bool = False
    """Not judged because of an error that a user can correct."""


def check_paths(options: Namespace) -> None:
    """SpringcheckError where a report cannot be written, or would overwrite a file that is none."""
    given = {name: getattr(options, name, None) for name in REPORT_FORMS}
    read = [getattr(options, name, None) for name in ("file", "source", "scene", "output")]
    others = [str(x) for x in (*read, *(getattr(options, "files", None) or ())) if x]
    for name, path in given.items():
        if path is None:
            continue
        said = f"--{name} {path}"
        if not path:
            raise SpringcheckError(f"--{name}: a name is needed, not an empty one")
        place = Path(path)
        if place.is_dir():
            raise SpringcheckError(f"{said}: it is a folder, a file is needed")
        if not place.parent.is_dir():
            raise SpringcheckError(f"{said}: there is no folder {place.parent}")
        taken = [*others, *(str(x) for key, x in given.items() if x and key != name)]
        if any(place.resolve() == Path(x).resolve() for x in taken):
            raise SpringcheckError(f"{said}: the command reads or writes that file otherwise; name another")
        if name == "junit" and place.is_file() and place.stat().st_size:
            with place.open("rb") as file:
                if file.read(len(HEAD)) != HEAD:
                    raise SpringcheckError(f"{said}: the file is no such report; give another name")


def report(options: Namespace, document: dict[str, Any], status: int) -> None:
    """Write the reports requested of a command's JSON document and exit status."""
    _write(options, list(cases(options.name, document, status)), status)


def failed(options: Namespace, error: BaseException) -> None:
    """Write the reports requested of a command that ended in an error."""
    _write(options, [Case(subject=options.name, name="input", passed=None, why=str(error), error=True)], 2)


def cases(command: str, document: dict[str, Any], status: int) -> Iterator[Case]:
    """Every item that a JSON document reports as judged."""
    for method, why in document.get("broke", {}).items():
        yield Case(subject=method, name="run", passed=None, why=why, error=True)
    for one in document.get("files", [document]):
        for found in one.get("identifications", [one]):
            yield from _identified(found, one.get("file", ""))
        subject = one.get("file") or document.get("scene") or command
        for verdict in one.get("verdicts", ()):
            yield Case(
                subject=str(verdict.get("method", subject)),
                name=verdict["check"],
                passed=verdict["passed"],
                why=_reason(verdict),
            )
        for repeat in one.get("repeats", ()):
            why = "" if repeat["equal"] else f"differs by {_number(repeat['difference'])} of its size"
            yield Case(subject=repeat["method"], name="repetition", passed=repeat["equal"], why=why)
        for doubt in one.get("not_trusted", ()):
            yield Case(
                subject=str(subject), name=f"integrity of {doubt['place']}", passed=False, why=doubt["what"]
            )
    if not any(x in document for x in ("files", "identifications", "verdict", "verdicts", "repeats")):
        yield Case(subject=command, name="exit status", passed=(True, False, None)[status], why=WORDS[status])


def _identified(found: dict[str, Any], file: str) -> Iterator[Case]:
    if "error" in found:
        yield Case(subject=file, name="scheme", passed=None, why=found["error"], error=True)
    elif "statement" in found:
        label = found["trajectory"]
        subject = file if file and label == Path(file).name else ", ".join(filter(None, (file, label)))
        right = found["fits"] or found["verdict"] == "adaptive"
        passed = True if right else None if found["undecided"] else False
        first = found["explanations"][:1]
        why = f"{first[0]['cause']}. What to do: {first[0]['remedy']}" if first else found["statement"]
        if found.get("unlike"):
            passed, why = False, found["unlike"]
        yield Case(subject=subject, name="scheme", passed=passed, why=why)


def _reason(verdict: dict[str, Any]) -> str:
    if verdict["passed"] is None:
        return str(verdict["why"])
    why, _, shown = str(verdict["why"]).partition(DIAGNOSIS)
    size = f"{_number(verdict['value'])} of {_number(verdict['bound'])} {verdict['unit']}".strip()
    # the cause is the first sentence
    return f"{shown}. {size}; {why}" if shown else f"{size}; {why}"


def _number(x: float | None) -> str:
    return "unknown" if x is None else f"{x:.3g}"


def sentence(found: Sequence[Case], status: int) -> str:
    """The first sentence of a summary: the failure, or that there is none."""
    wrong = [x for x in found if x.error] or [x for x in found if x.passed is False]
    if wrong:
        named = "" if wrong[0].name in ("scheme", "input", "run") else f", {wrong[0].name}"
        return f"{wrong[0].subject}{named}: {wrong[0].why}"
    if status == 2:
        return (
            found[0].why
            if len(found) == 1
            else "Nothing was judged: no check that applies could tell a scheme."
        )
    schemes = [x for x in found if x.name == "scheme"]
    if len(schemes) == 1:
        return f"{schemes[0].subject}: {schemes[0].why}"
    return _tally(found)


def _tally(found: Sequence[Case]) -> str:
    judged = [x.passed for x in found if not x.error]
    passed, wrong, skipped = (judged.count(value) for value in (True, False, None))
    errors = sum(x.error for x in found)
    said = f"{count(passed, 'check')} passed, {wrong or 'none'} failed, {skipped} not applicable"
    return f"{said}, {count(errors, 'error')}." if errors else f"{said}."


def junit(command: str, found: Sequence[Case]) -> bytes:
    """A JUnit report, of one suite."""
    from xml.etree import ElementTree

    suite = ElementTree.Element("testsuite", name=f"springcheck {command}", tests=str(len(found)))
    numbers = {"failures": 0, "errors": 0, "skipped": 0}
    for x in found:
        names = {"classname": _text(x.subject), "name": _text(x.name)}
        case = ElementTree.SubElement(suite, "testcase", names, time="0")
        if x.passed:
            continue
        kind, key = ("failure", "failures") if x.passed is False else ("skipped", "skipped")
        kind, key = ("error", "errors") if x.error else (kind, key)
        numbers[key] += 1
        ElementTree.SubElement(case, kind, message=_text(x.why)).text = _text(x.why)
    suite.attrib.update({key: str(number) for key, number in numbers.items()})
    root = ElementTree.Element("testsuites", {"name": "springcheck", "tests": str(len(found))})
    root.append(suite)
    ElementTree.indent(root)
    body: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return body + b"\n"


def summary(command: str, found: Sequence[Case], status: int) -> str:
    """A summary in Markdown; its first sentence is the cause."""
    wrong = [x for x in found if x.passed is False or x.error]
    first, tally = sentence(found, status), _tally(found)
    words = WORDS[status]
    if status == 2 and any(x.passed is not None for x in found):
        words = "error" if any(x.error for x in found) else "not everything judged"
    lines = [f"### springcheck {command}: {words}", "", _cell(first), ""]
    if len(wrong) > 1:
        lines += ["| what | check | why |", "|---|---|---|"]
        lines += [f"| {_cell(x.subject)} | {_cell(x.name)} | {_cell(x.why)} |" for x in wrong[:MOST_CASES]]
        lines += ["", f"and {len(wrong) - MOST_CASES} more", ""] if len(wrong) > MOST_CASES else [""]
    lines += [] if tally == first else [tally, ""]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Text escaped for Markdown."""
    return re.sub(r"([\\|<>`*_\[\]])", r"\\\1", plain(text))


def _text(text: str) -> str:
    return _NOT_IN_XML.sub("?", text)


def _write(options: Namespace, found: list[Case], status: int) -> None:
    if options.junit:
        _put(options.junit, junit(options.name, found))
    if options.summary:
        text = summary(options.name, found, status).encode()
        where = Path(options.summary)
        with files.told(where, "write"), where.open("ab") as file:
            file.write(text)


def _put(name: str, data: bytes) -> None:
    """Write a report whole or not at all, behind a link too; as a stream into a device."""
    path = Path(name)
    with files.told(path, "write"):
        if path.exists() and not path.is_file():
            path.write_bytes(data)
        else:
            files.put_bytes(data, path.resolve())
