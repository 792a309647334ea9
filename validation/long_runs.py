"""Long runs: 1e8 recorded frames cost no more than h5py needs for the bytes, in bounded memory.

    python validation/long_runs.py [frames]

1. Recording, side by side with plain h5py writing the same arrays (t, q, p, energy, step, and for a mass
   other than 1 velocities) into contiguous datasets with fsync: the store alone with arrays that are at
   hand, and a real run of own:semi-implicit-euler streamed into it; each in a process of its own, in turn,
   the median of five ratios, because a shared disk is never as fast twice.
2. The commands, on a spring of m = 3.7, k = 2.9 by own:semi-implicit-euler: `run` with every frame
   recorded (made, stored, judged in 16 pieces), then `inspect`, `plot`, `identify` and `check` of its file;
   seconds, and peak memory above what the same command needs for 200 frames.  Then `run` of ten times as
   many steps with none but the last recorded.
3. What compression would bring for a real trajectory, 2e6 frames of a spring: size and time of contiguous,
   chunked and shuffle + gzip 1 datasets.

Expected with the defaults, in four minutes: recording at most 1.5 times h5py, and no command more than
300 MiB above a short run.  Seen on two cores and a shared ext4 disk, 3.6 and 4.4 GB: the store 1.06 and 1.02
of h5py (single rounds 0.55 to 1.26), a real run 1.02 and 1.06, in 161 and 169 MiB.  `run` as a whole 10 s in
167 MiB, of which importing, and judging 16 pieces of 16,384 frames, take 2 to 3 s; inspect 0.3 s, plot 1.9 s
and 57 MiB, identify 0.6 s, check 4.9 s.  1e9 unrecorded steps 8.5 s.  Of the bytes of a trajectory shuffle +
gzip 1 leaves 76 % and writes 91 MB/s where contiguous writes 3000: a quarter of the space for 30 times the
time, so nothing is compressed, and the seal finds what gzip's checksum would.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import h5py
import numpy as np

from arguments import arguments, script
from springcheck import driver, engines, store
from springcheck.physics import scenefile as scenes
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene

PIECE = 1 << 16

DISK = os.environ.get("TMPDIR", "/var/tmp")
"""Where the files go: a disk, which /tmp need not be."""

ROUNDS = 5

RATIO, MEMORY = 1.5, 300.0
"""What must hold: seconds of h5py, and MiB above the imports."""


MASSES = (1.0, 3.7)
"""With the first, momenta are velocities, and stored once."""

SCENE = """
title = "A long run"
[[particle]]
mass = {mass}
position = 0.3
momentum = 0.7
[[spring]]
ends = ["wall", 0]
stiffness = 2.9
[time]
step = 0.1
steps = {steps}
[record]
every = {every}
[methods]
include = ["own:semi-implicit-euler"]
"""


def scene(frames: int, mass: float) -> Scene:
    """One particle."""
    one = np.ones(1)
    return Scene(
        name="long", title="", source="", m=mass * one, q=0 * one, p=one, terms=(), step=0.1, steps=frames - 1
    )


def pieces(frames: int) -> Iterator[tuple[int, Floats, Floats, Floats, Floats]]:
    """Offset, t, q, p and energy of chunks as a fast engine would hand them over."""
    t: Floats = np.linspace(0, 6500, PIECE)
    q, p = np.sin(t)[:, None], np.cos(t)[:, None]
    energy: Floats = np.full(PIECE, 0.5)
    for start in range(0, frames, PIECE):
        n = min(PIECE, frames - start)
        yield start, t[:n], q[:n], p[:n], energy[:n]


def ours(path: Path, frames: int, mass: float) -> None:
    """The store: streamed, finished, committed."""
    s = scene(frames, mass)
    with store.open_new(path, "speed") as journal:
        with journal.draft("own:semi-implicit-euler", s) as draft:
            for _, t, q, p, energy in pieces(frames):
                draft.append(t, q, p, energy)
            draft.finish({})
        journal.commit(s)


def recorded(path: Path, frames: int, mass: float) -> None:
    """The same with a real run: own:semi-implicit-euler, every frame of it."""
    s = scenes.parse(SCENE.format(mass=mass, steps=frames - 1, every=1), name="long")
    with store.open_new(path, "speed") as journal:
        with journal.draft("own:semi-implicit-euler", s) as draft:
            driver.play(s, engines.parse("own:semi-implicit-euler"), draft.append)
            draft.finish({})
        journal.commit(s)


def plain(path: Path, frames: int, mass: float) -> None:
    """The same bytes by h5py alone."""
    with h5py.File(path, "w") as file:
        names = ("t", "q", "p", "energy") if mass == 1 else ("t", "q", "p", "energy", "v")
        shapes = ((frames,), (frames, 1), (frames, 1), (frames,), (frames, 1))[: len(names)]
        made = [file.create_dataset(name, shape, "<f8") for name, shape in zip(names, shapes, strict=True)]
        steps = file.create_dataset("step", (frames,), "<i4")
        for start, *arrays in pieces(frames):
            end = start + len(arrays[0])
            if mass != 1:
                arrays.append(arrays[2] / mass)
            for dataset, values in zip(made, arrays, strict=True):
                dataset[start:end] = values
            steps[start:end] = np.arange(start, end)
    with path.open("rb+") as raw:
        os.fsync(raw.fileno())


WRITERS = {"h5py": plain, "store": ours, "recorded": recorded}


def timed(kind: str, frames: int, mass: float) -> tuple[float, float]:
    """Seconds, and peak memory above the imports [MiB], of one writer in a process of its own."""
    command = [sys.executable, __file__, kind, str(frames), str(mass)]
    ran = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds, memory = ran.stdout.split()
    return float(seconds), float(memory)


def alone(kind: str, frames: int, mass: float) -> None:
    """Print seconds and MiB of one writer."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with tempfile.TemporaryDirectory(dir=DISK) as folder:
        start = time.perf_counter()
        WRITERS[kind](Path(folder) / "s.h5", frames, mass)
        seconds = time.perf_counter() - start
    print(seconds, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)


def compression() -> None:
    """Size and speed of the ways to lay a real trajectory out."""
    frames = 2_000_000
    q, p, out = 0.3, 0.7, np.empty((frames, 1))
    for i in range(frames):
        out[i] = q
        p -= 2.9 * q * 1e-3
        q += p / 3.7 * 1e-3
    ways: dict[str, dict[str, object]] = {
        "contiguous": {},
        "chunks of 4096": {"chunks": (4096, 1)},
        "shuffle + gzip 1": {
            "chunks": (4096, 1),
            "shuffle": True,
            "compression": "gzip",
            "compression_opts": 1,
        },
    }
    for name, how in ways.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "c.h5"
            start = time.perf_counter()
            with h5py.File(path, "w", libver=("v110", "v110")) as file:
                file.create_dataset("q", data=out, **how)
            wrote = time.perf_counter() - start
            with h5py.File(path) as file:
                start = time.perf_counter()
                file["q"][()]
                read = time.perf_counter() - start
            share = path.stat().st_size / out.nbytes
        to, back = out.nbytes / 1e6 / wrote, out.nbytes / 1e6 / read
        print(f"{name:17s} {share:5.2f} of the bytes, {to:5.0f} MB/s written, {back:5.0f} read")


def commanded(words: list[str], folder: Path) -> tuple[float, float]:
    """Seconds and peak memory [MiB] of a command; its memory is that of a process of its own."""
    start = time.perf_counter()
    with (folder / "out").open("w") as out:
        pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-m", "springcheck", *words],
            os.environ,
            file_actions=[(os.POSIX_SPAWN_DUP2, out.fileno(), 1)],
        )
        _, status, used = os.wait4(pid, 0)
    if status:
        raise SystemExit(f"springcheck {' '.join(words)}: status {os.waitstatus_to_exitcode(status)}")
    return time.perf_counter() - start, used.ru_maxrss / 1024


def commands(frames: int, bare: float) -> list[str]:
    """Every command on a long run beside the same on a short one; what does not hold."""
    failed = []
    with tempfile.TemporaryDirectory(dir=DISK) as name:
        folder = Path(name)
        base: dict[str, float] = {}
        for length, steps in (("short", 199), ("long", frames - 1)):
            toml, file = folder / f"{length}.toml", str(folder / f"{length}.h5")
            toml.write_text(SCENE.format(mass=3.7, steps=steps, every=1))
            for what, words in {
                "run": ["run", str(toml), "-o", file],
                "inspect": ["inspect", file],
                "inspect --trajectory": ["inspect", file, "--trajectory", "own:semi-implicit-euler"],
                "plot": ["plot", file, "-o", str(folder / "figures")],
                "identify": ["identify", file],
                "check": ["check", file],
            }.items():
                seconds, memory = commanded(words, folder)
                if length == "short":
                    base[what] = memory
                    continue
                above = memory - base[what]
                of_h5py = f", {seconds / bare:.2f} of h5py" if what == "run" else ""
                print(f"{what:21s} {seconds:6.1f} s{of_h5py}, {above:4.0f} MiB above {base[what]:.0f}")
                if above > MEMORY:
                    failed.append(what)
        toml = folder / "unrecorded.toml"
        toml.write_text(SCENE.format(mass=3.7, steps=10 * frames, every=10 * frames))
        seconds, memory = commanded(["run", str(toml), "-o", str(folder / "unrecorded.h5")], folder)
        each = 1e9 * seconds / (10 * frames)
        print(f"run, {10 * frames:.0e} steps and two frames: {seconds:.1f} s, {each:.2f} ns a step")
    return failed


def main() -> int:
    """All parts; the exit status says whether the bounds hold."""
    if sys.argv[1:2] and sys.argv[1] in WRITERS:
        alone(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))
        return 0
    frames = int(arguments(__doc__, frames=1e8).frames)
    failed, bare = [], 0.0
    for mass in MASSES:
        rounds = [{kind: timed(kind, frames, mass) for kind in WRITERS} for _ in range(ROUNDS)]
        bare = median(one["h5py"][0] for one in rounds)
        print(f"m = {mass}: h5py {bare:.1f} s")
        for kind in ("store", "recorded"):
            seconds = median(one[kind][0] for one in rounds)
            ratios = sorted(one[kind][0] / one["h5py"][0] for one in rounds)
            memory = max(one[kind][1] for one in rounds)
            spread = f"{ratios[0]:.2f} to {ratios[-1]:.2f}"
            print(f"  {kind:8s} {seconds:5.1f} s, ratio {median(ratios):.2f} ({spread}), {memory:.0f} MiB")
            if median(ratios) > RATIO or memory > MEMORY:
                failed.append(f"{kind}, m = {mass}")
    failed += commands(frames, bare)
    compression()
    print("does not hold:", ", ".join(failed) or "nothing")
    return int(bool(failed))


if __name__ == "__main__":
    script(main)
