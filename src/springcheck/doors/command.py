"""A program in any language as an engine: the scene goes in as JSON, a table of states comes out.

``name=./engine {scene} {out}``: the program is called once, without a shell, with the paths of the scene and
of the file that it is to write.  Its time is that of the whole command, reading and writing included.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from springcheck import processes, schemes
from springcheck.engines import BRAKES, DRIVEN, EVERY_FORCE, Engine, Label, Method, Simulation
from springcheck.errors import MethodError, StoreError
from springcheck.physics.arrays import Floats
from springcheck.physics.scene import Scene
from springcheck.schemes import UNKNOWN

SECONDS = 600.0
"""Seconds that a command may take where `--timeout` does not say."""


def engine(
    texts: Sequence[str], stated: Callable[[str], str] = lambda name: "", seconds: float = SECONDS
) -> Engine:
    """An engine of ``name=command`` texts.  MethodError where a command cannot be called."""
    commands: dict[str, list[str]] = {}
    for text in texts:
        name, words = _words(text)
        if name in commands:
            raise MethodError(f"--command {name}: two commands have this name")
        commands[name] = words
    schemes.bring(UNKNOWN)
    known = {name: schemes.scheme(stated(name) or UNKNOWN.name).name for name in commands}

    def start(scene: Scene, method: Method, label: Label, step: float) -> Simulation:
        return _Command(method.name, commands[method.name], scene, step, seconds)

    return Engine(
        name="command",
        title=f"the command {next(iter(commands))}" if len(commands) == 1 else "commands",
        methods={
            name: Method(
                name=name,
                scheme=known[name],
                about=f"{shlex.join(words)}; its time is the whole command's",
                terms=EVERY_FORCE | DRIVEN | BRAKES,
            )
            for name, words in commands.items()
        },
        schemes=(UNKNOWN,),
        start=start,
        version=lambda: {name: shlex.join(words) for name, words in commands.items()},
        convention=lambda method: "as the command writes them",
    )


def _words(text: str) -> tuple[str, list[str]]:
    """Name and arguments of a command."""
    name, equals, line = text.partition("=")
    if not equals or not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise MethodError(f"--command {text!r}: not of the form 'name=./engine {{scene}} {{out}}'")
    try:
        words = shlex.split(line)
    except ValueError as error:
        raise MethodError(f"--command {name}: {error}") from error
    for place in ("{scene}", "{out}"):
        if not any(place in word for word in words):
            raise MethodError(f"--command {name}: no {place} among its arguments: {line.strip()!r}")
    if shutil.which(words[0]) is None:
        raise MethodError(f"--command {name}: there is no program {words[0]!r} here that can be run")
    return name, words


def files(text: str) -> list[str]:
    """The files that a command names, its program among them."""
    words = shlex.split(text.partition("=")[2])
    return [shutil.which(words[0]) or "", *words[1:]]


def as_json(scene: Scene, step: float, every: int) -> dict[str, Any]:
    """A scene as plain data.  One mass on one spring to a wall is also given by four plain numbers."""
    terms: list[dict[str, Any]] = [
        {"key": term.key} | {name: values.tolist() for name, values in term.arrays.items()}
        for term in scene.terms
    ]
    out: dict[str, Any] = {
        "name": scene.name, "step": step, "steps": scene.steps, "every": every, "units": scene.units,
        "m": scene.m.tolist(), "q": scene.q.tolist(), "p": scene.p.tolist(), "terms": terms,
    }  # fmt: skip
    if scene.n == 1 and len(terms) == 1 and terms[0]["key"] == "wall-spring" and terms[0]["at"] == [0.0]:
        out |= {
            "mass": float(scene.m[0]), "stiffness": terms[0]["k"][0],
            "position": float(scene.q[0]), "momentum": float(scene.p[0]),
        }  # fmt: skip
    return out


class _Command:
    """A command that runs once, when the first states are asked for."""

    def __init__(self, name: str, words: list[str], scene: Scene, step: float, seconds: float) -> None:
        self.force_calls = 0
        self._name, self._words, self._scene, self._h, self._seconds = name, words, scene, step, seconds
        self._every = self._row = 0
        self._q, self._p = np.empty((0, 0)), np.empty((0, 0))

    def advance(self, every: int, q: Floats, p: Floats) -> None:
        if not self._every:
            self._every = every
            self._q, self._p = self._run(every)
        stride, rest = divmod(every, self._every)
        if rest:
            raise self._failed(f": frames {self._scene.every} steps apart; 65536 at most")
        rows = self._row + stride * np.arange(1, len(q) + 1)
        if rows[-1] >= len(self._q):
            raise self._failed(f": too few rows: {len(self._q)}, {rows[-1] + 1} are needed")
        q[:], p[:] = self._q[rows], self._p[rows]
        self._row = int(rows[-1])

    def _failed(self, what: str) -> MethodError:
        return MethodError(f"command {self._name}{what}")

    def _run(self, every: int) -> tuple[Floats, Floats]:
        with processes.folder(prefix="springcheck-") as folder:
            scene, out = folder / "scene.json", folder / "out"
            scene.write_text(json.dumps(as_json(self._scene, self._h, every)))
            words = [word.replace("{scene}", str(scene)).replace("{out}", str(out)) for word in self._words]
            try:
                done = processes.called(words, self._seconds)
            except subprocess.TimeoutExpired as error:
                said = f" did not end within {self._seconds:g} s; --timeout gives it more"
                raise self._failed(said) from error
            except OSError as error:
                raise self._failed(f" cannot be run: {error.strerror}") from error
            if done.returncode:
                said = " ".join((done.stderr or done.stdout).decode(errors="replace").split())[-300:]
                raise self._failed(f" ended with status {done.returncode}{f': {said}' if said else ''}")
            if not out.is_file():
                raise self._failed(" wrote no file {out}")
            return self._read(out, every)

    def _read(self, out: Path, every: int) -> tuple[Floats, Floats]:
        try:
            # imported here: a function under test needs no reader of files, and so no h5py
            from springcheck import formats

            states = formats.moving(out, next(iter(formats.read(out).values())))
        except StoreError as error:
            raise self._failed(f": its output{str(error).removeprefix(str(out))}") from error
        scene = self._scene
        if states.q.shape[1] != scene.n:
            raise self._failed(f": positions in a row of its output: {states.q.shape[1]}, not {scene.n}")
        p = states.p if states.p is not None else np.asarray(states.v) * scene.m
        t = np.arange(len(states.t)) * every * self._h
        # a time may be a sum of steps, rounded at each
        off = np.abs(states.t - t) > 1e-9 * (np.abs(t) + abs(self._h))
        if np.any(off):
            row = int(np.argmax(off))
            raise self._failed(
                f": row {row + 1} is at t = {states.t[row]:.12g}, not {t[row]:.12g}; the first row is the "
                f"start, the next {every} x {self._h:g} later"
            )
        if not (np.array_equal(states.q[0], scene.q) and np.array_equal(p[0], scene.p)):
            close = np.allclose(states.q[0], scene.q, rtol=1e-9) and np.allclose(p[0], scene.p, rtol=1e-9)
            why = "; write numbers with 17 digits" if close else ""
            raise self._failed(f": its first row is not the scene's start{why}")
        return states.q, p
