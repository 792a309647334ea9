"""Ctrl-C and SIGTERM at random moments of every command: no result, no traceback, nothing left behind.

    python validation/interrupts.py [interrupts] [seed] [commands, with commas between them]

Every command is started in an empty folder, with an empty folder for temporary files and a session of its
own, and gets SIGINT or SIGTERM at a random moment between its start and its usual end; every third one gets
a second signal shortly after.  Then:

* it has ended with exit status 130, within two seconds, with one line on standard error and no traceback;
* no process of its session is left, no temporary file, and in its folder nothing but what it is known to
  write; a journal there can be resumed;
* nothing was judged: no verdict on standard output.

In the end each command is given once more in the folder of its last interrupt, and must end as it does
undisturbed, with the same files.  Signals before the first line of springcheck meet the interpreter, whose
own way with them is a traceback or death by the signal; they are counted apart, as are those that came too
late.

Expected for 100 interrupts: every line ends in "0 wrong".
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from arguments import arguments, script
from springcheck import interrupts
from springcheck.errors import SpringcheckError

WITHIN = 2.0
"""Seconds from the signal to the end."""

LONGEST = 6.0
"""Seconds of a command in which it is interrupted."""

EULER = Path(__file__).parents[1] / "tests" / "command-examples" / "euler.sh"
COMMAND = f"awk=sh -c 'sleep 1; sh {EULER} $0 $1' {{scene}} {{out}}"

STEPPER = """def step(q, p, h, force, mass):
    p = p + h * force(q)
    return q + h * p / mass, p
"""

COMMANDS: dict[str, tuple[str, ...]] = {
    "run": ("run", "spring-uneven"),
    "run --thorough": ("run", "spring-uneven", "--thorough", "--method", "own:*"),
    "run --force": ("run", "spring-uneven", "--force", "-o", "input.h5"),
    "run --json": ("run", "anharmonic", "--json", "--method", "own:*"),
    "run --from": ("run", "--from", "input.h5"),
    "run --command": ("run", "spring-uneven", "--method", "command:*", "--command", COMMAND),
    "precision": ("precision", "spring-uneven", "--budget", "5", "--method", "own:*euler"),
    "stability": ("stability", "spring-uneven", "--method", "own:*"),
    "extremes": ("extremes", "--quick", "--method", "own:*euler"),
    "check": ("check", "input.h5"),
    "inspect": ("inspect", "input.h5"),
    "identify": ("identify", "input.h5"),
    "plot": ("plot", "input.h5", "-o", "figures"),
    "report": ("report", "input.h5"),
    "export": ("export", "input.h5", "own:euler", "out.h5md"),
    "identify --stepper": ("identify", "--stepper", "mine.py:step"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One interrupted command."""

    status: int
    seconds: float
    """From the signal to its end."""
    out: str
    err: str
    processes: int
    """Processes of its session that outlived it."""
    files: tuple[str, ...]
    """In its folder, without what it was given."""
    temporary: tuple[str, ...]
    too_late: bool
    """It had ended by itself."""

    @property
    def before(self) -> bool:
        """Whether the signal met the interpreter, before our first line or after our last."""
        ours = "springcheck: " in self.err or "springcheck/cli" in self.err
        return not self.too_late and self.status != interrupts.STATUS and not ours

    @property
    def wrong(self) -> list[str]:
        """What should not be."""
        if self.before or self.too_late:
            return []
        found = []
        if self.status != interrupts.STATUS:
            found.append(f"exit status {self.status}")
        if self.seconds > WITHIN:
            found.append(f"{self.seconds:.1f} s")
        if not self.err.startswith("springcheck: interrupted") or self.err.count("\n") != 1:
            found.append(f"said {self.err!r}")
        # a command that has printed its answer is complete, and says so
        if ("verdicts passed" in self.out or "FAILED" in self.out) and "is complete" not in self.err:
            found.append("judged")
        if self.processes:
            found.append(f"{self.processes} processes left")
        if self.temporary:
            found.append(f"temporary files left: {', '.join(self.temporary)}")
        if stray := [name for name in self.files if not _known(name)]:
            found.append(f"files left: {', '.join(stray)}")
        return found


def _known(name: str) -> bool:
    """Whether an interrupted command may leave this: a figure, a whole store, a journal with its claim."""
    return ".h5.parts" in name or (
        (".new" not in name and name.startswith(("figures", "out.h5md", "input.html")))
        or Path(name).suffix == ".h5"
    )


def interrupted(command: tuple[str, ...], folder: Path, moment: float, *, number: int, again: float) -> Trial:
    """Start a command in a folder and send the signal after so many seconds, and SIGINT `again` after it."""
    given = {path.name for path in folder.iterdir()}
    with tempfile.TemporaryDirectory() as temporary, _started(command, folder, temporary) as process:
        time.sleep(moment)
        too_late = process.poll() is not None
        began = time.perf_counter()
        if not too_late:
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(number)
                if again:
                    time.sleep(again)
                    process.send_signal(signal.SIGINT)
        try:
            out, err = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
        seconds = time.perf_counter() - began
        names = [path.relative_to(folder) for path in folder.rglob("*") if not path.is_dir()]
        return Trial(
            status=process.returncode, seconds=seconds, out=out, err=err, processes=left(process.pid),
            files=tuple(str(name) for name in sorted(names) if name.parts[0] not in given),
            temporary=tuple(sorted(os.listdir(temporary))),
            too_late=too_late or process.returncode in (0, 1),
        )  # fmt: skip


def _started(command: tuple[str, ...], folder: Path, temporary: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "springcheck", *command],
        cwd=folder, env=os.environ | {"TMPDIR": temporary}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
    )  # fmt: skip


def left(session: int) -> int:
    """Processes of a session, once those that end with their parent have had a second for it."""
    ends = time.perf_counter() + 1
    while (found := _of_session(session)) and time.perf_counter() < ends:
        time.sleep(0.02)
    return found


def _of_session(session: int) -> int:
    found = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            # state, parent, group, session; a zombie has ended
            fields = path.read_text().rpartition(")")[2].split()
            found += fields[0] != "Z" and int(fields[3]) == session
    return found


def undisturbed(command: tuple[str, ...], folder: Path) -> tuple[int, float]:
    """Exit status and seconds of a command that nobody interrupts."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as temporary, _started(command, folder, temporary) as process:
        process.communicate()
    return process.returncode, time.perf_counter() - began


def campaign(name: str, count: int, given: Path, rng: random.Random) -> list[str]:
    """So many interrupts of one command; prints a line, returns what was wrong."""
    command, wrong, counts = COMMANDS[name], [], {"interrupted": 0, "before": 0, "too late": 0}
    slowest = 0.0
    with tempfile.TemporaryDirectory() as home:
        whole = Path(shutil.copytree(given, Path(home) / "whole"))
        status, usual = undisturbed(command, whole)
        folder, late = whole, True
        for i in range(count):
            folder = Path(shutil.copytree(given, Path(home) / str(i)))
            trial = interrupted(
                command, folder, rng.uniform(0.1, min(usual, LONGEST)),
                number=rng.choice([signal.SIGINT, signal.SIGTERM]),
                again=0.0 if i % 3 else rng.uniform(0.001, 0.3),
            )  # fmt: skip
            counts["before" if trial.before else "too late" if trial.too_late else "interrupted"] += 1
            if not trial.before and not trial.too_late:
                slowest = max(slowest, trial.seconds)
            # the store was complete: the command would write it again
            late = trial.too_late or "is complete" in trial.err
            wrong += [f"{name}: {what}" for what in trial.wrong]
        again, _ = undisturbed(command, folder)
        # a store that is complete is refused
        if again != status and "--force" not in command and not late:
            wrong.append(f"{name}: given again it ends with exit status {again}, undisturbed with {status}")
        names = [{str(path.relative_to(one)) for path in one.rglob("*")} for one in (folder, whole)]
        if names[0] != names[1]:
            wrong.append(f"{name}: given again it leaves {sorted(names[0] ^ names[1])}")
    said = ", ".join(f"{number} {what}" for what, number in counts.items())
    print(f"{name:18} {usual:5.1f} s  {said}; slowest end {slowest:.2f} s; {len(wrong)} wrong", flush=True)
    for line in wrong:
        print(f"    {line}", flush=True)
    return wrong


def main() -> int:
    """Run the campaign."""
    given = arguments(__doc__, interrupts=100, seed=11, only="")
    # a shell starts a command in the background with SIGINT ignored, and every child would inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    rng = random.Random(given.seed)
    wrong: list[str] = []
    chosen = given.only.split(",") if given.only else list(COMMANDS)
    for name in set(chosen) - set(COMMANDS):
        raise SpringcheckError(f"no command {name!r}; there are {', '.join(COMMANDS)}")
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home) / "given"
        folder.mkdir()
        undisturbed(("run", "spring-uneven", "-o", "input.h5", "--method", "own:*"), folder)
        (folder / "mine.py").write_text(STEPPER)
        for name in chosen:
            wrong += campaign(name, -(-given.interrupts // len(chosen)), folder, rng)
    print(f"{given.interrupts} interrupts, {len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    script(main)
