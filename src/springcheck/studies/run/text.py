"""Parts of the report of a run as text."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from springcheck import checks, schemes
from springcheck.checks.compare import Same
from springcheck.physics.exact import has_true_motion, no_reference
from springcheck.physics.norm import energy_scale
from springcheck.physics.scene import Scene
from springcheck.physics.trajectory import Comparison, Verdict
from springcheck.studies.run.tally import MethodRun
from springcheck.text.lines import Lines, Row, Text, TextTable, hanging, plain, table
from springcheck.text.wording import number, rounded_down, seconds

if TYPE_CHECKING:
    from springcheck.bath.heat import Heated

BELOW = "the exact solution is known no better than this, and the run is no further from it"


def beyond(scene: Scene, runs: Sequence[MethodRun]) -> Lines:
    """Warnings for methods whose step is beyond the limit of stability: their motion grows without bound."""
    system, h, known = scene.system, abs(scene.step), schemes.known()
    ran = [known[name] for name in {run.scheme for run in runs} if name in known]
    ours = schemes.SCHEMES | schemes.ATTACHED
    plainly = all(one is ours.get(one.name) and not one.has("mixes") for one in ran)
    if system.has_modes and not system.is_damped and plainly:
        # no scan is needed: the catalogue's limits are those of undamped springs, 0 where a scheme has none
        least = min((one.limit for one in ran if one.limit), default=np.inf)
        if h * np.sqrt(np.max(np.abs(system.modes.w2))) < least:
            return []
    from springcheck.studies.stability.longest import too_long

    out: Lines = []
    for scheme in dict.fromkeys(run.scheme for run in runs):
        title = schemes.title(scheme)
        if (limit := too_long(scheme, scene)) is None:
            continue
        said = f"is beyond the limit of {title} here, {rounded_down(limit)}"
        names = ", ".join(run.method for run in runs if run.scheme == scheme)
        out.append(plain(f"h = {scene.step:g} {said}: {names}", "bold yellow"))
    return [plain(), *out] if out else []


def fractions(verdicts: Sequence[Verdict], question: str = "") -> Lines:
    """Value over bound of each check for each method."""
    return [
        plain(),
        plain(f"{question}Largest value of each check over its bound:"),
        plain("Values below 1 pass; ! marks a failure.", "dim"),
        *matrices(verdicts),
        *sights(verdicts),
    ]


def methods(scene: Scene, runs: Sequence[MethodRun]) -> Lines:
    """One row for each method, grouped by scheme; what its columns are, and the runs that ended early."""
    rows: list[Row] = []
    for scheme in dict.fromkeys(run.scheme for run in runs):
        rows.append(plain(schemes.title(scheme), "italic"))
        rows += [
            (
                f"  {run.method}",
                f"{'<' if run.error_below else ''}{_error(run.max_error)}",
                f"{run.energy_drift:+.1e}",
                seconds(run.start_seconds),
                seconds(run.run_seconds),
                plain(run.outcome, "" if run.outcome == "complete" else "red"),
            )
            for run in runs
            if run.scheme == scheme
        ]
    titles = ("method", "error", "energy", "start", "run", "outcome")
    unit = f"root of the {scene.system.norm.of or 'unit'}, as the start has no energy"
    unit = "initial energy norm" if "initial" in unit else unit
    return [
        table(titles, rows, left=("method", "outcome"), drop=("start", "energy")),
        plain(f"error: largest distance from the exact solution, over the {unit}", "dim"),
        *[plain(f"<: {BELOW}", "dim")] * any(run.error_below for run in runs),
        *[plain(f"-: no reference solution, because {why}", "dim") for why in [no_reference(scene)] if why],
        plain(f"energy: {of_energy(scene)}", "dim"),
        *(
            plain(f"  {run.method}: {run.outcome} after step {run.steps}: {run.message}")
            for run in runs
            if run.outcome != "complete"
        ),
        *(
            plain(f"  {', '.join(run.method for run in runs if run.message == said)}: {said}")
            for said in {run.message: None for run in runs if run.outcome == "complete" and run.message}
        ),
    ]


def of_energy(scene: Scene) -> str:
    """Explanation of the column of energies, relative to the scene's `energy_scale`."""
    system = scene.system
    changes = ["loss by friction"] * system.is_damped + ["work of the drive"] * system.is_driven
    known = bool(changes) and has_true_motion(scene)
    off = f"H - H{' exact' if known else '0'}"
    of = energy_scale(scene.system)[1]
    over = "|H0|" if of == "initial energy" else f"({of})"
    part = f"({off})/{over}" if of else off
    how = f", the {'exact ' * known}{' and '.join(changes)} {'taken off' if known else 'in it'}"
    return f"{part} where it is largest{how if changes else ''}"


def _error(x: float) -> str:
    """Three digits in eight columns, two where the exponent has three digits."""
    if np.isnan(x):
        return "-"
    return f"{x:.2e}" if x < 1e100 else f"{x:.1e}"


def same_motions(found: Sequence[Same]) -> Lines:
    """Which trajectories are one motion, and how closely they agree."""
    out: Lines = []
    titles = {"rounding": "The same motion, to rounding:", "tolerance": "As near as a tolerance allows:"}
    for same in found:
        title = plain(titles[same.within])
        out += [] if title in out else [plain(), title]
        names = " = ".join("exact solution" if label == "exact" else label for label in same.labels)
        out.append(plain(f"  {names}"))
        far = f"differ by at most {same.difference:.1e} ({same.within} allows {same.allowed:.1e})"
        out.append(plain(f"    {far if same.difference else 'equal bit for bit'}"))
    return out


def temperatures(found: Sequence[Heated]) -> Lines:
    """Temperatures of runs in a bath, each next to the exact one of its scheme."""
    if not found:
        return []
    rows: list[Row] = [
        (
            one.method,
            number(one.configurational_law, ".6f"), _measured(one.configurational, one.configurational_error),
            number(one.kinetic_law, ".6f"), _measured(one.kinetic, one.kinetic_error),
        )
        for one in found
    ]  # fmt: skip
    titles = ("method", "configurational", "measured", "kinetic", "measured ")
    return [
        plain(),
        plain("Temperatures over that of the bath, exact for each scheme, and as measured:"),
        table(titles, rows, left=("method",), drop=("measured ", "kinetic")),
    ]


def _measured(x: float, error: float) -> str:
    return number(x, ".4f") if np.isnan(x + error) else f"{x:.4f} +- {error:.4f}"


def ratio(verdict: Verdict) -> float:
    """Value as a fraction of the bound; infinite where an exact bound is missed."""
    if verdict.value == 0:
        return 0.0
    return verdict.value / verdict.bound if verdict.bound else float("inf")


def matrices(verdicts: Sequence[Verdict]) -> Lines:
    """Tables of the checks of recorded states, and of the experiments where there are any."""
    tried = {check.name for check in checks.THOROUGH}
    short = _names("motion") | {one.name: one.short for one in checks.RANDOM if one.family == "noise"}
    out: Lines = [verdict_matrix([v for v in verdicts if v.check not in tried], short)]
    for title, short, exact in (("steps", _names("map"), _names("repeat")), ("laws", _names("law"), {})):
        mine = [v for v in verdicts if v.check in short or v.check in exact]
        if any(v.passed is not None for v in mine):
            out += [plain(), plain(f"Experiments with {title}, likewise:"), verdict_matrix(mine, short)]
    return out


def _names(family: str) -> dict[str, str]:
    """Short names, for narrow columns, of the checks of a family."""
    return {check.name: check.short for check in checks.ALL if check.family == family}


def verdict_matrix(verdicts: Sequence[Verdict], short: Mapping[str, str]) -> TextTable:
    """A row for each method, a column for each check; checks whose bound is 0 share the column `exact`."""
    named = [c for c in dict.fromkeys(v.check for v in verdicts) if c in short]
    shown = [c for c in named if any(v.check == c and v.passed is not None for v in verdicts)]
    exact = any(v.check not in short for v in verdicts)
    rows: list[Row] = []
    for method in dict.fromkeys(v.method for v in verdicts):
        mine = {v.check: v for v in verdicts if v.method == method}
        cells = [_cell(mine.get(check)) for check in shown]
        rest = [v for name, v in mine.items() if name not in short and v.passed is not None]
        good = sum(1 for v in rest if v.passed)
        if exact:
            cells.append(plain(f"{good}/{len(rest)}", "" if good == len(rest) else "bold red"))
        rows.append((method, *cells))
    titles = [short[check] for check in shown]
    # on a narrow terminal; what fails is printed in full below
    return table(["method", *titles, *["exact"] * exact], rows, drop=titles[:0:-1])


def _cell(verdict: Verdict | None) -> Text:
    if verdict is None or verdict.passed is None:
        return plain("-", "dim")
    value = ratio(verdict)
    text = f"{value:.2f}" if 0.01 <= value < 100 else f"{value:.0e}"
    return plain(text if verdict.passed else text + "!", "" if verdict.passed else "bold red")


def sights(verdicts: Sequence[Verdict]) -> Lines:
    """Smallest detectable errors of a stiffness and of a temperature, in the best and the worst method."""
    out: Lines = []
    for quantity in ("stiffness", "temperature"):
        known: dict[str, float] = {}
        for v in verdicts:
            if v.passed and (x := getattr(v.sees, quantity)) is not None:
                known[v.method] = min(x, known.get(v.method, x))
        if known:
            best, worst = (how(known, key=known.__getitem__) for how in (min, max))
            said = f"Smallest detectable {quantity} error: {known[best]:.1e} ({best})"
            said += f" to {known[worst]:.1e} ({worst})" if worst != best else ""
            out += hanging("", said)
    return out


def failures(verdicts: Iterable[Verdict]) -> Lines:
    """Every failed verdict with value, bound, ratio and reason."""
    out: Lines = []
    for v in verdicts:
        if v.passed is False:
            out.append(plain(f"FAILED {v.method} {v.check}: {verdict_line(v)}", "bold red"))
    return out


def faults(broken: Mapping[str, str], verdicts: Sequence[Verdict]) -> Lines:
    """The fault of each engine that is broken on purpose, and the checks that reject it."""
    out: Lines = []
    for method, about in broken.items():
        mine = [v for v in verdicts if v.method == method and v.passed is not None]
        seen = [v.check for v in mine if not v.passed]
        said = f"rejected by {', '.join(seen)}" if seen else "NOT rejected: no check here detects it"
        out.append(plain(f"{method}, broken on purpose ({about}): {said}", "" if seen else "bold yellow"))
    return out


def unjudged(verdicts: Sequence[Verdict], store: Path | None) -> Lines:
    """Methods for which no check that applied distinguishes schemes, with the reasons; and the parts of other
    methods that no check could judge."""
    out: Lines = []
    for v in verdicts:
        said = [part for part in v.why.split("; ") if part.endswith(checks.BLIND)] if v.passed else []
        out += [plain(f"{v.method}: {part}", "bold yellow") for part in said]
    alike: dict[str, list[str]] = {}
    for method in checks.not_judged(verdicts):
        mine = (v for v in verdicts if v.method == method and v.passed is None and v.check in checks.TELLING)
        why = dict.fromkeys(v.why for v in mine)
        alike.setdefault("; ".join(why), []).append(method)
    for reason, methods in alike.items():
        line = f"not judged: {', '.join(methods)}: nothing that applied could tell ({reason})"
        if "--scheme NAME states it" in reason:
            name = shlex.quote(str(store)) if store else "FILE"
            file = f"{name} --trajectory {methods[0]}"
            if methods[0].startswith("stepper:"):
                # a function is tried on separate springs, whatever the forces of the scene are
                file = f"--stepper FILE.py:{methods[0].partition(':')[2]}"
            line += f"; springcheck identify {file} looks for it"
        out.append(plain(line, "bold yellow"))
    return out


def verdict_line(v: Verdict) -> str:
    """Value, bound, ratio and reason."""
    if v.passed is None:
        return f"not applicable: {v.why}"
    return f"{v.value:.3g} of {v.bound:.3g} {v.unit} (ratio {ratio(v):.2g}): {v.reason}"


def in_full(verdicts: Iterable[Verdict], options: Namespace | None) -> Lines:
    """Every verdict in full, where `--verdicts` asks for it."""
    if not getattr(options, "verdicts", False):
        return []
    words = {True: ("passed", ""), False: ("FAILED", "bold red"), None: ("n/a", "dim")}
    titles = ("method", "check", "verdict", "value, bound, ratio, why")
    rows = [
        (v.method, v.check, plain(*words[v.passed]), plain(verdict_line(v), words[v.passed][1]))
        for v in verdicts
    ]
    return [table(titles, rows, left=titles, prose=titles[-1])]


def differences(comparison: Comparison) -> TextTable:
    """The largest difference of each pair of runs."""
    rows = [
        (f"{i} {label}", *(_short(x) for x in comparison.max_difference[i, : i + 1]))
        for i, label in enumerate(comparison.labels)
    ]
    numbers = [str(i) for i in range(len(comparison.labels))]
    return table(["", *numbers], rows, left=("",), drop=numbers[:0:-1])


def _short(x: float) -> str:
    if np.isnan(x):
        return "-"
    if x == 0:
        return "0"
    return f"{x:.0e}".replace("e-0", "e-").replace("e+00", "").replace("e+0", "e")
