"""Whatever springcheck is given, it answers: scenes, stores, files, words and programs broken at random.

    python validation/campaign.py FILE [cases] [part]

A case is made from its part's name and its number alone, and given to springcheck in a process forked from
one that has imported everything.  FILE gets a line of JSON for each; where it exists the campaign goes on
with those that are not in it or that went wrong, and ends after so many `cases` more (0: when every part has
its size).  The parts:

* `scenes`: a shipped scene with numbers, words, lines or characters changed; to `run` and `show`, now and
  then to `stability`, `precision` or `judge`;
* `mutated`: a store of ours or a file of another format, damaged; to every command that reads one;
* `hostile`: a store that somebody made to do harm, of the kinds of `hostile.py`; to the same commands;
* `arguments`: random command lines of all commands, most of which nearly fit;
* `doors`: plug-ins, functions, programs and tables with something broken in them.

What must hold, whatever is given:

* exit status 0, 1 or 2; no traceback; with 2 one line on standard error, no line above 500 characters;
* no control character on standard output or standard error;
* at most 1 GiB of memory and 20 seconds of the processor; what is rightly long (a budget, 1e9 steps) is
  interrupted after 3 and ends within 2 with exit status 130;
* of a store that nobody has forged, damaged or not, either a command says that something is wrong, or it
  prints what it prints of the whole one;
* nothing is written but below the folder of the case; no file is read but those that were given, and those
  of the Python, the engines and the system that run (seen by strace, where there is one).

Of every eighth store alone figures are drawn, and the process that tries a file without a seal starts from
nothing; of the others it is forked.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import broken
import hostile
from arguments import arguments, script
from forked import Result, Warm
from springcheck.errors import SpringcheckError
from springcheck.store import seal

MEMORY, SECONDS, MESSAGE = 1 << 30, 20.0, 500
PATIENCE, WITHIN = 3.0, 2.0
"""Seconds of the processor after which a command is interrupted, and from the signal to its end."""

PARTS = {"scenes": 10_000, "mutated": 5_000, "hostile": 500, "arguments": 1_000, "doors": 400}
BATCH = 250
"""Cases of one process that forks."""

READERS: tuple[tuple[str, ...], ...] = (
    ("inspect", "FILE"),
    ("inspect", "FILE", "--json"),
    ("inspect", "FILE", "--trajectory", "LABEL", "--verdicts"),
    ("plot", "FILE", "-o", "pictures"),
    ("report", "FILE", "-o", "page.html"),
    ("check", "FILE"),
    ("export", "FILE", "LABEL", "out.h5md"),
    ("identify", "FILE"),
    ("judge", "FILE", "--scene", "spring", "--scheme", "explicit-euler", "--trajectory", "LABEL"),
    ("run", "--from", "FILE"),
)
"""Every command that reads a store."""

UNLIKE = {"run", "inspect", "plot"}
"""Commands whose output holds times, or pictures that are not always drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What is given to springcheck, in a folder that holds what it names."""

    commands: tuple[tuple[str, ...], ...]
    what: str
    complete: bool = True
    """Whether figures are rendered, and damaged files tried in a fresh process."""
    interrupted: bool = False
    """Whether it may rightly take long, and is then interrupted."""
    whole: tuple[str, ...] = ()
    """What the commands print of the file before it was damaged."""


@dataclass(slots=True)
class Answer:
    """What springcheck made of a case."""

    results: list[Result]
    wrong: list[str]
    interrupted: bool = False


class Place:
    """The folder of a campaign: what all cases share, and the folder of the one that runs."""

    def __init__(self, home: Path) -> None:
        self.home, self.own, self.cases = home, home / "own", 0
        self.case = home / "case-0"
        self.own.mkdir()
        hostile.secrets(self.own)
        self.whole = hostile.base(home)
        self.originals = hostile.originals(self.whole, home)
        self.printed: dict[str, tuple[str, ...]] = {}

    @property
    def work(self) -> Path:
        """The folder that commands run in."""
        return self.case / "work"

    @property
    def stores(self) -> Path:
        """The folder of the store that they are given."""
        return self.case / "stores"

    def fresh(self) -> None:
        """An empty folder, with a name of its own: strace shows who is at work by it."""
        shutil.rmtree(self.case, ignore_errors=True)
        self.cases += 1
        self.case = self.home / f"case-{self.cases}"
        for path in (self.work, self.stores, self.case / "tmp"):
            path.mkdir(parents=True)

    def make(self, part: str, number: int) -> Case:
        """The case of a number."""
        self.fresh()
        rng = random.Random(f"{part} {number}")
        if part == "scenes":
            return Case(commands=_frozen(broken.scene(self.work, rng)), what="scene", interrupted=True)
        if part == "arguments":
            broken.given(self.work, self.originals["sealed"])
            return Case(commands=(tuple(broken.command_line(rng)),), what="words", interrupted=True)
        if part == "doors":
            door = broken.DOORS[number % len(broken.DOORS)]
            return Case(commands=(tuple(door(self.work, rng)),), what=door.__name__, interrupted=True)
        path, label = self.stores / "s.h5", hostile.LABEL
        if part == "hostile":
            what = list(hostile.KINDS)[number % len(hostile.KINDS)]
            forged = number // len(hostile.KINDS) % 2 == 1
            hostile.build(what, self.whole, path, self.own, number, forged=forged)
        else:
            kinds = ("sealed", "sealed", "unsealed", "export", "sealed", "unsealed", "earliest", "latest")
            kind = kinds[number % len(kinds)]
            forged = kind == "unsealed" and rng.random() < 0.5
            hostile.damaged(self.originals[kind], rng, path)
            if forged:
                seal.attach(path, [])
            what = f"{kind}{', forged' * forged}"
            label = "all" if kind in {"earliest", "latest"} else label
        return Case(
            commands=self._readers(label),
            what=what,
            complete=number % 8 == 0,
            whole=self.printed.get(what, ()),
        )

    def _readers(self, label: str) -> tuple[tuple[str, ...], ...]:
        named = {"FILE": str(self.stores / "s.h5"), "LABEL": label}
        return tuple(tuple(named.get(word, word) for word in command) for command in READERS)

    def print_whole(self, server: Warm) -> None:
        """What is printed of a whole store, to compare with."""
        self.fresh()
        (self.stores / "s.h5").write_bytes(self.originals["sealed"])
        server.learn(self._readers(hostile.LABEL), self.work)
        self.fresh()
        (self.stores / "s.h5").write_bytes(self.originals["sealed"])
        case = Case(commands=self._readers(hostile.LABEL), what="whole", complete=False)
        answer = self.answer(case, server)
        assert not answer.wrong, answer.wrong
        self.printed["sealed"] = tuple(_pathless(result.out) for result in answer.results)

    def answer(self, case: Case, server: Warm) -> Answer:
        """Give a case to springcheck."""
        before = _names(self.stores)
        job = server.start(case.commands, self.work, self.case / "tmp", whole=case.complete)
        signalled, late = 0.0, 0.0
        while not job.ended():
            time.sleep(0.005)
            if job.seconds() > (PATIENCE if case.interrupted else SECONDS * len(case.commands)):
                signalled = time.perf_counter()
                with contextlib.suppress(ProcessLookupError):
                    os.kill(job.pid, 2 if case.interrupted else 9)
                while not job.ended() and late < 5 * WITHIN:
                    time.sleep(0.005)
                    late = time.perf_counter() - signalled
                if not job.ended():
                    os.kill(job.pid, 9)
                break
        results = job.results()
        wrong = [
            f"{' '.join(result.command)[:200]}: {what}"
            for number, result in enumerate(results)
            for what in wrongs(result, signalled=bool(signalled), whole=case.whole[number : number + 1])
        ]
        if late > WITHIN:
            wrong.append(f"ends {late:.1f} s after a signal")
        if not signalled and len(results) < len(case.commands):
            wrong.append(f"the process has ended in command {len(results)}")
        if _names(self.stores) != before:
            wrong.append(f"written beside the file: {sorted(_names(self.stores) ^ before)}")
        left = [path.name for path in (self.case / "tmp").iterdir()]
        if left:
            wrong.append(f"temporary files left: {', '.join(left)}")
        if (self.home / "PWNED").exists():
            wrong.append("a name has climbed out")
        return Answer(results=results, wrong=wrong, interrupted=bool(signalled))


def _frozen(commands: list[list[str]]) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(words) for words in commands)


def _pathless(text: str) -> str:
    """What is printed without the number of the case."""
    return re.sub(r"/case-\d+/", "/case/", text)


def _names(folder: Path) -> set[str]:
    return {f"{path.name} {path.stat().st_mtime_ns}" for path in folder.iterdir()}


def wrongs(result: Result, *, signalled: bool, whole: tuple[str, ...]) -> Iterator[str]:
    """What must not happen in a command."""
    out, err, lines = result.out, result.err, result.err.splitlines()
    if result.status not in ({0, 1, 2, 130} if signalled else {0, 1, 2}):
        yield f"exit status {result.status}"
    if "Traceback" in err or "Traceback" in out or "mistake in springcheck" in err:
        yield f"a traceback: {err[-300:]!r}"
    # identify says a line of each of its files
    files = max(1, sum(word[:1] != "-" for word in result.command[1:]) * (result.command[0] == "identify"))
    if result.status == 2 and not 1 <= len(lines) <= files and (lines or not out):
        # where nothing could be measured or judged the report on standard output says why
        yield f"{len(lines)} lines of message: {err[:300]!r}"
    if any(len(line) > MESSAGE for line in lines):
        yield f"a message of {max(map(len, lines))} characters: {err[:200]!r}"
    strange = {
        c
        for c in out + err
        if (ord(c) < 32 and c not in "\t\n") or 127 <= ord(c) < 160 or c in "\u202e\u2066"
    }
    if strange:
        yield f"control characters {sorted(strange)!a}"
    for text in (out, err):
        if hostile.SECRET in text or "4711.08" in text:
            yield "another file is shown"
    if result.seconds > SECONDS:
        yield f"{result.seconds:.1f} s"
    if result.memory > MEMORY:
        yield f"{result.memory / MEMORY:.1f} GiB"
    if (
        whole
        and result.status == 0
        and not err
        and result.command[0] not in UNLIKE
        and _pathless(out) != whole[0]
    ):
        yield f"a damaged file is shown as if nothing were: {out[:300]!r}"


SYSTEM = ("/usr/", "/lib/", "/lib64/", "/etc/", "/proc/", "/sys/",
          f"{Path.home()}/.config/", f"{sys.prefix}/", f"{sys.base_prefix}/",
          *{f"{Path(name).parents[2]}/" for name in sys.path if name.endswith("site-packages")},
          *filter(None, sys.path), str(Path(__file__).resolve().parent.parent))  # fmt: skip
"""Where the programs are."""

CACHES = (f"{Path.home()}/.cache/", "/dev/shm/mpich_", "/dev/shm/ucx_", "/proc/")
"""Where compilers of OpenCL and Matplotlib keep what they make, and MPI its memory; Numba's lie beside its
functions."""

DEVICES = ("/dev/null", "/dev/urandom", "/dev/full", "/dev/zero", "/dev/tty")
CALLS = "openat,open,creat,mkdir,mkdirat,unlink,unlinkat,rename,renameat,renameat2,link,linkat,symlink"
CALLS += ",symlinkat,truncate,chmod,fchmodat,rmdir,chdir"
_CALL = re.compile(r"^\d+ +(\w+)\((.*)$")


def trace(log: Path, place: Place, asked: dict[int, tuple[str, ...]]) -> dict[int, list[str]]:
    """What strace saw that must not be, by the number of the case's folder; its words are `asked`."""
    found: dict[int, list[str]] = {}
    now, mine = -1, ""
    at_work = re.compile(re.escape(f"{place.home}/case-") + r"(\d+)/work$")
    waiting: dict[str, str] = {}
    for raw in log.read_text(errors="backslashreplace").splitlines():
        # a call that another process came between stands in two lines
        pid, _, rest = raw.partition(" ")
        if raw.endswith("<unfinished ...>"):
            waiting[pid] = raw.removesuffix("<unfinished ...>")
            continue
        line = raw
        if rest.lstrip().startswith("<...") and pid in waiting:
            line = waiting.pop(pid) + rest.partition("resumed>")[2]
        match = _CALL.match(line)
        if not match:
            continue
        call, rest = match.groups()
        strings = re.findall(r'(?:(?:AT_FDCWD|\d+)<([^>]*)>, )?"((?:[^"\\]|\\.)*)"', rest)
        begun = at_work.match(strings[0][1]) if call == "chdir" and strings else None
        if begun:
            now, mine = int(begun[1]), f"{place.home}/case-{begun[1]}/"
        if now not in asked or not strings or call == "chdir" or re.search(r"\) += -1 E", rest):
            continue
        reads = call in {"openat", "open"} and not re.search(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC", rest)
        for folder, name in strings:
            path = os.path.normpath(os.path.join(folder or f"{mine}work", name))
            if f"{path}/".startswith((mine, *CACHES)) or path in DEVICES or "/__pycache__" in path:
                continue
            real = os.path.realpath(os.path.join(folder or f"{mine}work", name))
            # the campaign itself may lie among the programs, in a TMPDIR there
            program = f"{real}/".startswith(SYSTEM) and not real.startswith(os.path.realpath(place.home))
            if reads and (path in asked[now] or program):
                continue
            if {"-o", "--output"} & set(asked[now]) and os.path.dirname(path) in asked[now]:
                continue
            found.setdefault(now, []).append(f"{call} {path}")
    return found


def campaign(kept: Path, cases: int, only: str) -> int:
    """Go on where the file ends; returns how many cases did what must not happen."""
    records = [record for record in _read(kept) if not record["wrong"]]
    kept.write_text("".join(json.dumps(record) + "\n" for record in records))
    done = {(record["part"], record["number"]) for record in records}
    wanted = [
        (number / size, part, number)
        for part, size in PARTS.items()
        if only in ("", part)
        for number in range(size)
        if (part, number) not in done
    ]
    # parts grow together
    wanted = sorted(wanted)[: cases or None]
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        place = Place(Path(os.path.realpath(name)))
        log = place.home / "trace"
        quiet = ("-qq", "-s", "4096", "-e", f"trace={CALLS}", "-o", str(log))
        strace = ("strace", "-f", "--seccomp-bpf", "-y", *quiet)
        before = strace if shutil.which("strace") else ()
        for start in range(0, len(wanted), BATCH):
            server, records = Warm(*before), []
            asked: dict[int, tuple[str, ...]] = {}
            found: dict[int, dict[str, Any]] = {}
            place.print_whole(server)
            for _, part, number in wanted[start : start + BATCH]:
                case = place.make(part, number)
                answer = place.answer(case, server)
                records.append(_record(part, number, case, answer))
                found[place.cases] = records[-1]
                asked[place.cases] = tuple(word for command in case.commands for word in command)
            server.close()
            for folder, seen in (trace(log, place, asked) if before else {}).items():
                found[folder]["wrong"] += sorted(set(seen))[:9]
            with kept.open("a") as file:
                for record in records:
                    print(json.dumps(record), file=file)
                    for what in record["wrong"]:
                        print(f"{record['part']} {record['number']} ({record['what']}): {what}", flush=True)
            bad += sum(bool(record["wrong"]) for record in records)
    return bad


def _read(kept: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []


def _record(part: str, number: int, case: Case, answer: Answer) -> dict[str, Any]:
    return {
        "part": part,
        "number": number,
        "what": case.what,
        "commands": len(answer.results),
        "status": [result.status for result in answer.results],
        "seconds": round(max((result.seconds for result in answer.results), default=0.0), 2),
        "memory": max((result.memory for result in answer.results), default=0),
        "wrong": answer.wrong,
    }


def summary(kept: Path) -> str:
    """Counts of a file."""
    said = []
    records = _read(kept)
    for part in PARTS:
        mine = [record for record in records if record["part"] == part]
        if not mine:
            continue
        status = Counter(x for record in mine for x in record["status"])
        said.append(
            f"{part}: {len(mine):,} cases, {sum(status.values()):,} commands (exit status "
            + ", ".join(f"{value}: {count:,}" for value, count in sorted(status.items()))
            + f"), {sum(bool(record['wrong']) for record in mine)} wrong; "
            f"at most {max(record['seconds'] for record in mine):.1f} s "
            f"and {max(record['memory'] for record in mine) / 2**20:.0f} MiB"
        )
    return "\n".join(said)


def main() -> int:
    """Run cases; the exit status says whether one of them did what must not happen."""
    # a shell starts a command in the background with SIGINT ignored, and every child would inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    given = arguments(__doc__, file=Path, cases=0, part=("", *PARTS))
    if given.file is None:
        raise SpringcheckError(
            "name the file that keeps the cases, a new one or that of a campaign to go on with"
        )
    bad = campaign(given.file, given.cases, given.part)
    print(summary(given.file))
    return int(bad > 0)


if __name__ == "__main__":
    script(main)
