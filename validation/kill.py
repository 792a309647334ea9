"""Nothing that was reported is ever lost: a writer is killed at random moments, and at every system call.

    python validation/kill.py [kills]

A writer stores trajectories and tables, with a commit at the end, and reports each as soon as it is stored.
It is killed (SIGKILL) at a random moment of a part or of the commit, 200 times over; then before every third
of the system calls on files that a round makes (all of them with 600 kills).  After each kill everything
reported must be there with its digest, and every file must pass `check`.  Then the commands themselves,
`run`, `precision`, `stability` and `extremes`, killed at random moments a quarter as often and started again
until they end: every trajectory, table and point that one of them had finished must be in the store at the
end, bit for bit, so none is lost and none measured twice.
Then: a full disk at forty sizes, a reader that holds the file open through a commit, and two writers.

Kills show that no order of operations loses anything; that fsync reaches the disk is the system's word.

Expected, in about eight minutes on two cores: every line ends in "lost 0".
"""

from __future__ import annotations

import os
import random
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from arguments import arguments, script
from springcheck import cli, store
from springcheck.errors import StoreError
from springcheck.physics.scene import Scene
from springcheck.store import apart, parts, reading
from springcheck.studies.precision.points import CUT_OFF, POINTS

LABELS = [f"own:method-{i}" for i in range(6)]
PHASES = ("part", "collection")
CALLS = {"open", "write", "fsync", "replace", "unlink", "rmdir", "posix_fallocate", "mkdir", "truncate"}


def scene(frames: int) -> Scene:
    """Three particles of unequal mass."""
    m = np.array([3.7, 0.4, 1.9])
    return Scene(
        name="kill", title="", source="", m=m, q=m * 0, p=m, terms=(), step=0.1, steps=frames - 1
    )  # fmt: skip


def table(name: str) -> store.Table:
    """A study's small table."""
    return store.Table(name=f"precision/{name}", columns={"h": [0.1, 0.2], "error": np.eye(2)})


def write(path: Path, say: Callable[[str], None], seed: int) -> None:
    """One writer: take up what is there, do the rest, report each thing when it is stored."""
    with store.open_new(path, f"command {seed}") as journal:
        say("ready")
        for i, label in enumerate(LABELS):
            s = scene(400 if i % 2 else 9)
            rng = np.random.default_rng([seed, i])
            frames = s.frames - i % 3
            if label not in journal.finished():
                say("phase part")
                with journal.draft(label, s) as draft:
                    for _ in range(frames):
                        q, p = rng.normal(size=(1, 3)), rng.normal(size=(1, 3))
                        draft.append(q[:, 0], q, p, p[:, 0])
                    say(f"stored {label} {draft.finish({})}")
            if f"precision/{label}" not in journal.tables():
                journal.add(table(label))
                say(f"table precision/{label}")
        say("phase collection")
        journal.commit(scene(9))
        say("done")


def lost(path: Path, seed: int, stored: dict[str, str], listed: set[str]) -> list[str]:
    """What was reported and is not there, or not the same, once a writer has taken up the store."""
    missing = []
    try:
        with store.open_new(path, f"command {seed}") as journal:
            found, named = journal.finished(), set(journal.tables())
            digests = {label: digest(source, label) for label, source in found.items()}
    except StoreError as error:
        if "exists" not in str(error):
            return [str(error)]
        # the final commit was through: the store is closed, and holds everything
        digests = {label: digest(source, label) for label, source in store.sources(path).items()}
        named = set(dict(store.tables_of(path)))
    missing += [label for label, expected in stored.items() if digests.get(label) != expected]
    missing += sorted(listed - named)
    if path.is_file() or parts.folder_of(path).is_dir():
        missing += [f"{finding.place}: {finding.what}" for finding in found_by_check(path)]
    return missing


def found_by_check(path: Path) -> list[store.Damage]:
    """What `check` says; nothing where there is no file yet."""
    try:
        return store.check(path)
    except StoreError as error:
        return [] if "no such file" in str(error) else [store.Damage(place="/", what=str(error))]


def digest(path: Path, label: str) -> str:
    """The digest that a trajectory carries, its numbers read and checked against theirs."""
    store.read_one(path, label)
    with parts.opened(path) as file:
        return reading.run_and_arrays(file, label)[0].sha256


def child(work: Callable[[Callable[[str], None]], None]) -> tuple[int, int]:
    """A forked writer and the pipe that it reports through."""
    out, into = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(out)
        try:
            work(lambda line: (os.write(into, line.encode() + b"\n"), None)[1])
        except BaseException as error:
            os.write(into, f"failed {error!r}\n".encode())
        os._exit(0)
    os.close(into)
    return pid, out


def reports(pipe: int, until: str = "", timeout: float = 60) -> list[str]:
    """Lines of a writer up to one that begins with `until`, or to its end."""
    text = b""
    while select.select([pipe], [], [], timeout)[0]:
        got = os.read(pipe, 1 if until else 65536)
        text += got
        if not got or (until and text.endswith(b"\n") and text.splitlines()[-1].decode().startswith(until)):
            break
    return text.decode().splitlines()


class Ledger:
    """What a store's writers have reported."""

    def __init__(self) -> None:
        self.stored: dict[str, str] = {}
        self.listed: set[str] = set()
        self.failed: list[str] = []

    def add(self, lines: list[str]) -> None:
        for line in lines:
            words = line.split()
            if words[0] == "stored":
                self.stored[words[1]] = words[2]
            elif words[0] == "table":
                self.listed.add(words[1])
            elif words[0] == "failed":
                self.failed.append(line)


def random_kills(folder: Path, kills: int) -> int:
    """SIGKILL at random moments, half of them in each phase -> number of losses."""
    rng = random.Random(20)
    losses, reported, counts, seed = 0, 0, dict.fromkeys(PHASES, 0), 0
    duration = {"part": 0.02, "collection": 0.04}
    path, ledger = folder / "random.h5", Ledger()
    while sum(counts.values()) < kills:
        phase = PHASES[sum(counts.values()) % 2]
        pid, pipe = child(partial(write, path, seed=seed))
        lines = reports(pipe, f"phase {phase}")
        alive = bool(lines) and lines[-1] == f"phase {phase}"
        if alive:
            time.sleep(rng.uniform(0, duration[phase]))
            os.kill(pid, signal.SIGKILL)
        lines += reports(pipe)
        os.waitpid(pid, 0)
        os.close(pipe)
        ledger.add(lines)
        done = "done" in lines
        if alive and not done:
            counts[phase] += 1
        gone = lost(path, seed, ledger.stored, ledger.listed) + ledger.failed
        if gone:
            losses += len(gone)
            print("  lost:", gone)
        if done or (path.is_file() and not parts.folder_of(path).is_dir()):
            reported += len(ledger.stored) + len(ledger.listed)
            path.unlink(missing_ok=True)
            shutil.rmtree(parts.folder_of(path), ignore_errors=True)
            ledger, seed = Ledger(), seed + 1
    spread = ", ".join(f"{number} in a {phase}" for phase, number in counts.items())
    print(f"random kills: {sum(counts.values())} ({spread}), {reported} reports, lost {losses}")
    return losses


def commands(folder: Path, kills: int) -> int:
    """The commands that users give, killed at random moments and started again to their end -> losses."""
    rng = random.Random(21)
    losses = 0
    own = ["--method", "own:*", "--quiet"]
    for name, words in (
        ("run", ["run", "spring", *own]),
        ("precision", ["precision", "spring-uneven", "--budget", "2", *own]),
        ("stability", ["stability", "overdamped", *own]),
        ("extremes", ["extremes", "--quick", *own]),
    ):
        path = folder / f"{name}.h5"
        work = partial(command, [*words, "-o", str(path)])
        killed, rounds, kept = 0, 0, 0
        known: dict[str, object] = {}
        # once through here, so that what is forked has imported and compiled everything
        right = f"ended {cli.main([*words, '-o', str(path)])}"
        path.unlink()
        began = time.perf_counter()
        losses += f"ended {cli.main([*words, '-o', str(path)])}" != right
        longest = time.perf_counter() - began
        path.unlink()
        while killed < kills // 4 or known:
            pid, pipe = child(work)
            # the last one goes on to its end
            if killed < kills // 4:
                time.sleep(rng.uniform(0, longest))
                os.kill(pid, signal.SIGKILL)
            ended = reports(pipe)
            os.waitpid(pid, 0)
            os.close(pipe)
            killed += not ended
            now = finished(path)
            # killed between the last file operation and the report
            ended = ended or ([right] if path.is_file() and store.summary(path).complete else [])
            gone = [one for one, value in known.items() if not goes_on(value, now.get(one))]
            kept, known = kept + len(now.keys() - known.keys()), now
            if ended:
                gone += [f"{finding.place}: {finding.what}" for finding in store.check(path)]
                gone += [] if ended == [right] else ended
                path.unlink()
                known, rounds = {}, rounds + 1
            if gone:
                losses += len(gone)
                print("  lost:", gone)
        print(
            f"springcheck {name}: {killed} kills, {rounds} times to the end, {kept} kept, lost {losses}",
            flush=True,
        )
    return losses


def command(words: list[str], say: Callable[[str], None]) -> None:
    """One command line, and its exit status."""
    say(f"ended {cli.main(words)}")


def finished(path: Path) -> dict[str, object]:
    """What a store and its journal hold: digests of trajectories, points of precision, columns of tables."""
    if not path.is_file() and not parts.folder_of(path).is_dir():
        return {}
    try:
        found: dict[str, object] = {label: digest(file, label) for label, file in store.sources(path).items()}
        tables = dict(store.tables_of(path))
    except StoreError as error:
        if "no such file" in str(error):
            return {}
        raise
    for name, one in tables.items():
        if name.startswith("precision/") and ":" in name:
            points = POINTS.found(one)
            found[name] = [point for point in points if point.outcome != CUT_OFF]
        elif name != "precision/methods":
            found[name] = {
                # as text: NaN equals NaN, and every digit counts
                column: repr(np.asarray(values).tolist())
                for column, values in one.columns.items()
            }
    return found


def goes_on(before: object, after: object) -> bool:
    """Whether nothing of what was there is gone or another; a method's points may have become more."""
    if isinstance(before, list) and isinstance(after, list):
        return after[: len(before)] == before
    return after == before


def dies_before(call: int) -> Callable[..., None]:
    """A profiler that ends the process before its call-th system call on a file."""
    made = 0

    def watch(frame: object, event: str, what: object) -> None:
        nonlocal made
        if event == "c_call" and getattr(what, "__name__", "") in CALLS:
            made += 1
            if made == call:
                os.kill(os.getpid(), signal.SIGKILL)

    return watch


def every_call(folder: Path, stride: int) -> int:
    """A kill before each system call of a whole round -> losses."""
    losses, kills = 0, 0
    call, done = 1, False
    while not done:
        path = folder / f"call-{call}.h5"

        def work(say: Callable[[str], None], path: Path = path, call: int = call) -> None:
            sys.setprofile(dies_before(call))
            write(path, say, 0)
            sys.setprofile(None)

        pid, pipe = child(work)
        ledger = Ledger()
        lines = reports(pipe)
        ledger.add(lines)
        os.waitpid(pid, 0)
        os.close(pipe)
        done = "done" in lines
        kills += not done
        gone = lost(path, 0, ledger.stored, ledger.listed) + ledger.failed
        if gone:
            losses += len(gone)
            print(f"  before call {call}, lost:", gone)
        path.unlink(missing_ok=True)
        shutil.rmtree(parts.folder_of(path), ignore_errors=True)
        call += stride
    print(f"kills before each system call: {kills}, lost {losses}")
    return losses


def limited(path: Path, size: int) -> None:
    """A writer whose files may not grow beyond `size` bytes."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    try:
        write(path, lambda line: print(line, flush=True), 0)
    except StoreError as error:
        print("told", error, flush=True)


def full_disk(folder: Path) -> int:
    """Forty limits on the size of files: told in one line, no crash at exit, nothing lost."""
    losses, told = 0, 0
    for k in range(40):
        path = folder / f"full-{k}.h5"
        ran = subprocess.run(
            [sys.executable, __file__, "--limited", str(path), str(500 * 2 ** (k // 4) + 100 * k)],
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
        ledger = Ledger()
        lines = ran.stdout.splitlines()
        ledger.add(lines)
        told += any(line.startswith("told") for line in lines)
        gone = lost(path, 0, ledger.stored, ledger.listed) + ledger.failed
        if ran.returncode or ran.stderr:
            gone.append(f"status {ran.returncode}: {ran.stderr[-300:]}")
        if gone or not (lines and lines[-1].split()[0] in {"told", "done"}):
            losses += 1
            print(f"  limit {k}:", gone, lines[-1:])
    print(f"disk full at 40 sizes: {told} told, lost {losses}")
    return losses


def reader_and_writers(folder: Path) -> int:
    """A reader holds the old file through a commit; a second writer is refused."""
    path = folder / "shared.h5"
    write(path, lambda line: None, 1)
    losses = 0
    with parts.opened(path) as file:
        held = file[f"observables/{LABELS[0]}/q/value"]
        before = held[()]
        with store.open_new(path, "command 2", force=True) as journal:
            try:
                store.open_new(path, "command 2", force=True)
                losses += 1
            except StoreError as error:
                print(f"  second writer: {error}")
            journal.save(store.read_one(path, LABELS[0]), scene(9))
            journal.commit(scene(9))
        losses += not np.array_equal(held[()], before)
    losses += bool(store.check(path)) or list(store.read(path)) != LABELS[:1]
    print(f"reader through a commit, second writer: lost {losses}")
    return losses


def main() -> int:
    """All of it; the exit status says whether anything was lost."""
    if sys.argv[1:2] == ["--limited"]:
        limited(Path(sys.argv[2]), int(sys.argv[3]))
        return 0
    kills = arguments(__doc__, kills=200).kills
    # what a kill leaves is read in this process: a thousand trials in processes of their own take an hour
    apart.read = lambda *given: apart.heard(apart.answer(*given))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        total = random_kills(folder, kills) + every_call(folder, max(1, 600 // kills))
        total += commands(folder, kills)
        total += full_disk(folder) + reader_and_writers(folder)
    return int(total > 0)


if __name__ == "__main__":
    script(main)
