"""Which scheme made a file, by the page: where a browser names one, `springcheck identify` names it too."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import identify_corpus as corpus
from springcheck import schemes
from springcheck.cli.page import given, writing
from springcheck.formats import columns
from springcheck.identify import Identification, identify
from springcheck.identify.candidates import other_names
from springcheck.physics.arrays import Floats

SCRIPTS = [writing.HERE / name for name in ("drawing.js", "loops.js", "files.js")]
SHARE = 0.2
"""Of the corpus; all of it was run once: 229 of 893 are named, by the command as well."""


def said(texts: Sequence[str], tmp_path: Path) -> list[dict[str, Any]]:
    """What the page says of files, through node: the test is skipped where there is none."""
    program = shutil.which("node")
    if program is None and not os.environ.get("SPRINGCHECK_REQUIRE_TOOLS"):
        pytest.skip("node is not here")
    assert program, "node is required here"
    data = {"columns": columns.NAMES, "schemes": given.plain_schemes()}
    lines = [
        "const matchMedia = () => ({});",
        f"const DATA = {json.dumps(data)}, TEXTS = {json.dumps(texts)};",
        *(path.read_text(encoding="utf-8").replace('"use strict";', "") for path in SCRIPTS),
        "console.log(JSON.stringify(TEXTS.map(plainScheme)));",
    ]
    script = tmp_path / "a.js"
    script.write_text("\n".join(lines), encoding="utf-8")
    run = subprocess.run([program, script], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    found: list[dict[str, Any]] = json.loads(run.stdout)
    return found


def text(**of: Floats | None) -> str:
    """A file of states, with all digits."""
    held = {name: x.reshape(len(x), -1) for name, x in of.items() if x is not None}
    names = [name + (str(i) if x.shape[1] > 1 else "") for name, x in held.items() for i in range(x.shape[1])]
    rows = np.hstack(list(held.values())).tolist()
    return "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows)])


def test_where_the_page_names_a_scheme_the_command_names_it(tmp_path: Path) -> None:
    cases = corpus.chosen(SHARE)
    found = said([text(t=case.t, q=case.q, v=case.v, p=case.p) for case in cases], tmp_path)
    named = [(case, one["scheme"]) for case, one in zip(cases, found, strict=True) if "scheme" in one]
    assert len(named) > 0.2 * len(cases)
    for case, scheme in named:
        command = identify(case.t, case.q, case.p, v=case.v)
        assert isinstance(command, Identification)
        assert command.scheme == scheme, case.name


def test_schemes_of_the_same_map_are_named_together_as_the_command_lists_them(tmp_path: Path) -> None:
    rows, q, p = [], 0.3, 0.7
    for i in range(40):
        rows.append((0.1 * i, q, p))
        # Heun's
        q1, p1 = q + 0.1 * p, p - 0.1 * q
        q, p = q + 0.05 * (p + p1), p - 0.05 * (q + q1)
    t, x, v = np.array(rows).T
    command = identify(t, x, v=v)
    assert isinstance(command, Identification)
    titles = {one["scheme"]: one["title"] for one in given.plain_schemes()}
    assert titles["rk2-midpoint"] == "Explicit midpoint (RK2) (on a spring the same map: Heun (RK2))"
    assert {command.scheme, *command.aliases} == {"rk2-midpoint", "rk2-heun"}
    for name, title in titles.items():
        others = [x for x in other_names(name, damped=False) if not x.endswith(" friction")]
        assert all(schemes.title(other) in title for other in others)
    (found,) = said([text(t=t, q=x, v=v)], tmp_path)
    assert found["title"] == titles["rk2-midpoint"]


def motion(
    *, every: int = 1, friction: float = 0.0, h: float = 0.13, momenta: bool = False
) -> dict[str, Floats]:
    """Velocity Verlet around 0.7, m = 1.9, k = 2.3."""
    q, v, rows = 1.1, 0.4, []
    for i in range(80 * every):
        if i % every == 0:
            rows.append((i * h, q, 1.9 * v if momenta else v))
        v += h / 2 * (-2.3 * (q - 0.7) / 1.9)
        q += h * v
        v = (v + h / 2 * (-2.3 * (q - 0.7) / 1.9)) * (1 - friction)
    return dict(zip(("t", "q", "p" if momenta else "v"), np.array(rows).T, strict=True))


def test_what_is_not_plain_is_left_to_the_command(tmp_path: Path) -> None:
    plain = motion()
    noisy = {**plain, "q": plain["q"] + 1e-12 * np.random.default_rng(3).normal(size=80)}
    files = {
        "plain": text(**plain),
        "spaced, with units and another column": text(**plain)
        .replace("t,q,v", "# Time[ps] x_1 vx energy")
        .replace(",", " ")
        .replace("\n", " 1\n")
        .replace("energy 1", "energy")
        + " 1",
        "noise": text(**noisy),
        "few digits": text(**{name: np.round(x, 6) for name, x in plain.items()}),
        "friction": text(**motion(friction=1e-3)),
        "every third frame": text(**motion(every=3)),
        "tiny steps": text(**motion(h=1e-5)),
        "momenta without a mass": text(**motion(momenta=True)),
        "velocities in another unit": text(**{**plain, "v": 10 * plain["v"]}),
        "uneven times": text(**{**plain, "t": plain["t"] ** 1.1}),
        "no velocities": text(t=plain["t"], q=plain["q"]),
        "no names": text(**plain).partition("\n")[2],
        "nothing": "",
    }
    found = dict(zip(files, said(list(files.values()), tmp_path), strict=True))
    names = {name: one.get("scheme") for name, one in found.items()}
    assert names.pop("plain") == "velocity-verlet"
    assert found["plain"]["turn"] == pytest.approx(0.13 * np.sqrt(2.3 / 1.9), rel=1e-12)
    assert names.pop("spaced, with units and another column") == "velocity-verlet"
    assert set(names.values()) == {None}
    assert all(one.get("scheme") or one["why"] for one in found.values())


def test_a_frame_that_is_off_is_seen_however_large_others_are(tmp_path: Path) -> None:
    """Explicit Euler at h omega = 1 grows 2**20 times in 40 steps; an arc is short beside its velocity."""
    texts = []
    for h, steps, tableau in ((1.0, 40, [0.0]), (0.025, 13, [0.0, 0.5])):
        state, rows = np.array([0.3, 0.7]), []
        for i in range(steps):
            rows.append((i * h, *state))
            k = np.zeros(2)
            for part in tableau:
                x = state + part * h * k
                k = np.array([x[1], -x[0]])
            state = state + h * k
        t, q, v = np.array(rows).T
        off = q.copy()
        off[steps // 2] *= 1 + 1e-13
        texts += [text(t=t, q=q, v=v), text(t=t, q=off, v=v)]
    names = [one.get("scheme") for one in said(texts, tmp_path)]
    assert names == ["explicit-euler", None, "rk2-midpoint", None]
